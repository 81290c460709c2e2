use crate::envelope::{Envelopes, Spot};
use pitchleak::core::{Leak, PerLeak};
use pitchleak::replay::Replay;
use pitchleak::rig::Rig;
use pitchleak::trace::Record;
use pitchleak::units::LPM_PER_M3S;

/// Stretches of the trace that are kept at most.
const STRETCHES: usize = 480;

/// What a terminal shows of a replay beside its text, gathered on the way in a few kilobytes: how large each leak was over the
/// trace, beside its alarm level.
#[derive(Clone, Debug)]
pub struct ReplaySketch {
    flows_lpm: Envelopes<3>,
    threshold_lpm: PerLeak<f64>,
    ends_s: Option<[f64; 2]>,
}

impl ReplaySketch {
    /// Of a replay by `rig` that has not begun.
    pub fn new(rig: &Rig) -> Self {
        Self {
            flows_lpm: Envelopes::of_at_most(STRETCHES),
            threshold_lpm: rig.alarms.threshold_m3s.map(|flow| flow * LPM_PER_M3S),
            ends_s: None,
        }
    }

    /// Takes in a record, and the replay that has taken it in before; `renewed` where its estimates are new.
    pub fn add(&mut self, replay: &Replay, record: &Record, renewed: bool) {
        if record.after_gap {
            self.flows_lpm.pause();
        }
        let [first_s, _] = self.ends_s.unwrap_or([record.t_s; 2]);
        self.ends_s = Some([first_s, record.t_s]);
        if !renewed {
            return;
        }
        let flows = replay.watched_flows_m3s();
        let spots = Leak::ALL.map(|leak| Some(Spot::at(flows[leak].value * LPM_PER_M3S)));
        self.flows_lpm.add(record.t_s, &spots);
    }

    /// Times of the first and the last record, s.
    pub fn ends_s(&self) -> [f64; 2] {
        self.ends_s.unwrap_or_default()
    }

    /// The alarm levels, L/min.
    pub fn threshold_lpm(&self) -> PerLeak<f64> {
        self.threshold_lpm
    }

    /// Each leak's flow over the trace in at most `columns` stretches of the same length, L/min; none where it pauses.
    pub fn courses_lpm(&self, columns: usize) -> PerLeak<Vec<Option<f64>>> {
        let courses = self.flows_lpm.courses(columns);
        PerLeak::from_fn(|leak| courses.get(leak as usize).cloned().unwrap_or_default())
    }
}
