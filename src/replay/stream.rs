use super::Replay;
use crate::report::{ReplayReport, TraceSummary};
use crate::rig::Rig;
use crate::trace::{Intake, Record, TraceError, TraceFault, TraceReader};

/// A replay whose trace comes in parts, as in live operation: the parts together give what the whole trace
/// would, to the last bit.
pub struct Stream {
    replay: Replay,
    intake: Option<Intake>,
}

impl Stream {
    /// A stream for a rig.
    pub fn new(rig: &Rig) -> Self {
        Self { replay: Replay::new(rig), intake: None }
    }

    /// Takes in the next part of the trace; says how often the estimates were renewed.
    ///
    /// # Errors
    /// Where a bad row is fatal, or the part cannot be read on: what came before it is taken in. A part
    /// without a good row is no error.
    pub fn extend(&mut self, part: TraceReader<'_>) -> Result<u64, TraceError> {
        let mut reader = match self.intake.take() {
            Some(before) => part.resuming(before),
            None => part,
        };
        let mut record = Record::default();
        let mut renewals = 0;
        let ended = loop {
            match reader.next_record(&mut record) {
                Ok(true) => renewals += u64::from(self.replay.push(&record)),
                Ok(false) | Err(TraceError { fault: TraceFault::NoRows { .. }, .. }) => break Ok(renewals),
                Err(error) => break Err(error),
            }
        };
        self.intake = Some(reader.into_intake());
        ended
    }

    /// Time of the last good row, s; none before the first.
    pub fn time_s(&self) -> Option<f64> {
        self.intake.as_ref().and_then(Intake::time_s)
    }

    /// The running replay.
    pub fn replay(&self) -> &Replay {
        &self.replay
    }

    /// The report as it stands; `name` is the trace's. None before the first part.
    pub fn report(&self, name: &str) -> Option<ReplayReport> {
        let quality = self.intake.as_ref()?.quality();
        Some(self.replay.report(TraceSummary::new(name, quality)))
    }
}
