/// What a function did: zero or above where all is well.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PitchleakResult {
    /// Done; of a sample: taken in.
    Ok = 0,
    /// The first sample, or the first after a gap: nothing to integrate yet.
    Started = 1,
    /// The sample was taken in, and the estimates are new.
    Renewed = 2,
    /// Renewed, after a sudden change of the leak: what was learnt before no longer counts.
    Changed = 3,
    /// The sample was left out: not a number, or beyond what a cylinder can do.
    Rejected = 4,
    /// A pointer is null.
    NullPointer = -1,
    /// The estimator was not begun, or its memory was overwritten.
    NotBegun = -2,
    /// The cylinder or its oil is impossible.
    BadCylinder = -3,
    /// A sensor's noise, bias or gain error is negative or not a number.
    BadSensors = -4,
    /// An alarm's threshold is not positive.
    BadThreshold = -5,
    /// The buffer is too small.
    TooSmall = -6,
    /// The bytes are no state, or a damaged one.
    Damaged = -7,
    /// The bytes are the state of another version, or of an estimator of another size.
    OtherVersion = -8,
    /// A number of the valve's calibration cannot be.
    BadCalibration = -9,
}
