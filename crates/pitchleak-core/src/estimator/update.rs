/// What one [`Rls::update`](super::Rls::update) did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Update<T> {
    /// The first sample, or the first after a gap: nothing to integrate yet.
    Started,
    /// The sample was taken in.
    Accepted,
    /// The sample completed a block of the balance. After every second one the estimates are renewed, a part with each
    /// sample that follows, so that none takes much longer than another.
    Balanced {
        /// What the flow balance of the block had that the estimates before it did not foretell; none where a
        /// chamber had no flow to balance.
        innovation: Option<Innovation<T>>,
    },
    /// The estimates are new.
    Renewed {
        /// Time that was watched since the estimates were last new, s: without gaps, for
        /// [`LeakDetector::update`](crate::LeakDetector::update).
        elapsed_s: T,
        /// The leak has changed at once: what was learnt before counts for nothing any more.
        changed: bool,
        /// That of a block which the sample completed, as in [`Balanced`](Self::Balanced): only where it shows that the
        /// leak has changed.
        innovation: Option<Innovation<T>>,
    },
    /// Not a number, or beyond what a cylinder can do: the sample was left out.
    Rejected,
}

/// One innovation of the flow balance A_B·(A) + A_A·(B), both sides divided by the standard deviation that the
/// declared sensor noise gives it: as long as model and noise hold, normal with mean zero and this variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation<T> {
    /// Measured less foretold, in standard deviations of the declared noise.
    pub value: T,
    /// Its variance: 1 of the noise, and what the uncertainty of the estimates adds.
    pub variance: T,
}
