use crate::rig::Rig;
use crate::semihosting::{File, exit, print};
use core::arch::asm;
use core::ptr::{read_volatile, write_volatile};
use pitchleak_core::Sample;

/// An estimator as the firmware runs it.
pub trait Estimator: Sized {
    /// The estimator of a rig, and what else stands in the file before the samples; none where the rig is impossible.
    fn new(rig: &Rig, file: &File) -> Option<Self>;
    /// Takes in a sample; says whether the estimates are new, and for how long was watched, s.
    fn update(&mut self, dt_s: f32, sample: &Sample<f32>) -> Option<f32>;
    /// What a controller does once the estimates are new: hold the leaks against their alarms.
    fn watch(&mut self, elapsed_s: f32);
    /// Values and standard deviations.
    fn told(&self) -> Told;
}

/// κ and the leak coefficients, each with its standard deviation; SI.
pub type Told = [f32; 8];

const CONTROL_AND_STATUS: *mut u32 = 0xe000_e010 as *mut u32;
const RELOAD: *mut u32 = 0xe000_e014 as *mut u32;
const CURRENT: *mut u32 = 0xe000_e018 as *mut u32;
/// 24 bits, counting down.
const FULL: u32 = 0x00ff_ffff;

const PAINT: u32 = 0x5eed_1eaf;
/// Stack that is painted, bytes.
const PAINTED: usize = 64 * 1024;

#[derive(Default)]
struct Cost {
    updates: u32,
    ticks: u32,
    worst: u32,
    watch: u32,
    /// Both in one sample.
    sample: u32,
}

/// Runs the trace through `E` and tells the host.
pub fn run<E: Estimator>() -> ! {
    let file = File::open(b"trace.f32\0");
    if let Some(rig) = Rig::read(&file)
        && let Some(mut estimator) = E::new(&rig, &file)
    {
        start_clock();
        let top = paint_stack();
        let cost = replay(&mut estimator, &file);
        let stack = (top - deepest(top)) as u32;
        let Cost { updates, ticks, worst, watch, sample } = cost;
        print(b"cost\0", &[updates, ticks, worst, watch, sample, size_of::<E>() as u32, stack]);
    }
    exit()
}

#[inline(never)]
fn replay<E: Estimator>(estimator: &mut E, file: &File) -> Cost {
    let mut cost = Cost::default();
    while let Some([dt_s, x_m, pa_pa, pb_pa, qa, qb, force]) = file.read() {
        let measured = |value: f32| (!value.is_nan()).then_some(value);
        let sample = Sample {
            x_m,
            pa_pa,
            pb_pa,
            qa_m3s: measured(qa),
            qb_m3s: measured(qb),
            force_n: measured(force),
        };
        let (renewed, ticks) = timed(|| estimator.update(dt_s, &sample));
        cost.updates += 1;
        cost.ticks += ticks;
        cost.worst = cost.worst.max(ticks);
        cost.sample = cost.sample.max(ticks);
        if let Some(elapsed_s) = renewed {
            let ((), watching) = timed(|| estimator.watch(elapsed_s));
            cost.watch = cost.watch.max(watching);
            cost.sample = cost.sample.max(ticks + watching);
            let [kappa, kappa_std, c, c_std, a, a_std, b, b_std] = estimator.told().map(f32::to_bits);
            print(b"told\0", &[cost.updates, kappa, kappa_std, c, c_std, a, a_std, b, b_std]);
        }
    }
    cost
}

fn start_clock() {
    // SAFETY: the system timer's own registers (Armv7-M Architecture Reference Manual, B3.3).
    unsafe {
        write_volatile(RELOAD, FULL);
        write_volatile(CURRENT, 0);
        write_volatile(CONTROL_AND_STATUS, 0b101);
    }
}

#[inline(always)]
fn timed<R>(work: impl FnOnce() -> R) -> (R, u32) {
    // SAFETY: reading the timer has no effect.
    let before = unsafe { read_volatile(CURRENT) };
    let result = work();
    // SAFETY: as above.
    let after = unsafe { read_volatile(CURRENT) };
    (result, before.wrapping_sub(after) & FULL)
}

/// Paints what lies below the stack's end by now; gives that end.
#[inline(never)]
fn paint_stack() -> usize {
    let top: usize;
    // SAFETY: reads a register.
    unsafe { asm!("mov {}, sp", out(reg) top) };
    for place in (top - PAINTED..top).step_by(4) {
        // SAFETY: below the stack's end there is nothing; no interrupt is on.
        unsafe { write_volatile(place as *mut u32, PAINT) };
    }
    top
}

/// The lowest place where the paint is gone.
fn deepest(top: usize) -> usize {
    // SAFETY: reads memory that was painted.
    (top - PAINTED..top)
        .step_by(4)
        .find(|place| unsafe { read_volatile(*place as *const u32) } != PAINT)
        .unwrap_or(top)
}
