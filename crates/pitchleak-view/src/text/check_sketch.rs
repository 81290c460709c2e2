use crate::bar::{Bar, INTERVAL, LIMIT, ZERO, scale};
use crate::envelope::{Envelopes, Spot};
use crate::spark::course;
use pitchleak::check::{Reading, SIGNALS, values};
use pitchleak::core::{Leak, PerLeak};
use pitchleak::rig::Rig;
use pitchleak::trace::Record;
use pitchleak::units::LPM_PER_M3S;

/// Stretches of the trace that are kept at most.
const STRETCHES: usize = 240;
/// Cells of a course.
const COURSE: usize = 28;
/// Cells of a bar.
const BAR: usize = 32;

/// What a terminal shows of a check beside its text, gathered on the way in a few kilobytes: each signal over the trace,
/// and how large a leak is hidden, beside its alarm level.
#[derive(Clone, Debug)]
pub struct CheckSketch {
    signals: Envelopes<{ SIGNALS.len() }>,
    threshold_lpm: PerLeak<f64>,
}

impl CheckSketch {
    /// Of a check by `rig` that has not begun.
    pub fn new(rig: &Rig) -> Self {
        Self {
            signals: Envelopes::of_at_most(STRETCHES),
            threshold_lpm: rig.alarms.threshold_m3s.map(|flow| flow * LPM_PER_M3S),
        }
    }

    /// Takes in a record.
    pub fn add(&mut self, record: &Record) {
        if record.after_gap {
            self.signals.pause();
        }
        let spots = values(record).map(|value| value.map(Spot::at));
        self.signals.add(record.t_s, &spots);
    }

    /// Each signal over the trace, from its lowest to its highest reading; in the order of `readings`.
    pub(super) fn courses(&self, readings: &[Reading]) -> Vec<String> {
        let courses = self.signals.courses(COURSE);
        let of = |reading: &Reading| {
            let place = SIGNALS.iter().position(|signal| signal.name() == reading.signal)?;
            Some(course(courses.get(place)?, [reading.least, reading.most]))
        };
        readings.iter().map(|reading| of(reading).unwrap_or_default()).collect()
    }

    /// Says what the bars show.
    pub(super) fn legend() -> String {
        format!("{INTERVAL} hidden by noise  {LIMIT} alarm level")
    }

    /// A bar for each leak of these resolutions, L/min, on one scale.
    pub(super) fn bars(&self, resolution_lpm: PerLeak<Option<f64>>) -> PerLeak<String> {
        let bar = |leak: Leak| {
            let interval = [0.0, resolution_lpm[leak]?];
            Some(Bar { interval, value: (0.0, ZERO), limit: self.threshold_lpm[leak] })
        };
        let bars = PerLeak::from_fn(bar);
        let ends = scale(bars.iter().filter_map(|(_, bar)| bar.as_ref()));
        bars.map(|bar| bar.zip(ends).map_or_else(String::new, |(bar, ends)| bar.text(ends, BAR)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sketch() -> CheckSketch {
        let mut sketch = CheckSketch::new(&Rig::paper());
        for i in (0..1000).filter(|i| !(400..600).contains(i)) {
            let mut record = Record { t_s: 0.01 * f64::from(i), after_gap: i == 600, ..Record::default() };
            record.sample.x_m = 1e-4 * f64::from(i);
            record.sample.qb_m3s = None;
            sketch.add(&record);
        }
        sketch
    }

    #[test]
    fn a_signal_goes_from_its_lowest_to_its_highest_reading_and_stops_where_the_trace_pauses() {
        let reading = |signal, most| Reading { signal, unit: "", least: 0.0, most, present_percent: 100.0 };
        let courses = sketch().courses(&[reading("x", 0.1), reading("pa", 0.0), reading("qb", 0.0)]);
        assert_eq!(courses[0], "▁▁▁▂▂▂▂▃▃▃▄▄    ▅▆▆▆▆▇▇▇▇███");
        assert_eq!(courses[1], courses[0].replace(|mark| mark != ' ', "▁"));
        assert_eq!(courses[2].trim(), "");
    }

    #[test]
    fn what_is_hidden_is_seen_beside_the_alarm_level() {
        let sketch = CheckSketch { threshold_lpm: PerLeak::from_fn(|_| 0.1), ..sketch() };
        let known = PerLeak { internal: Some(0.05), external_a: Some(0.2), external_b: None };
        let bars = sketch.bars(known);
        assert_eq!(bars.internal.trim_end(), "│━━━━━━━━       ┊");
        assert_eq!(bars.external_a, "│━━━━━━━━━━━━━━━┊━━━━━━━━━━━━━━━");
        assert_eq!(bars.external_b, "");
    }
}
