//! The cylinder as a drawing: chambers, piston, ports and meters, each leak an arrow of its size, each sensor in its state.

use crate::text::thresholds_lpm;
use maud::{Markup, html};
use pitchleak::core::{Leak, PerLeak};
use pitchleak::report::{ReplayReport, Status, interval};
use pitchleak::rig::Rig;
use pitchleak::signal::Signal;

/// Colours and strokes, for a page that defines `--text`, `--faint`, `--line`, `--card`, `--leak` and `--caution`.
pub const STYLE: &str = include_str!("assets/drawing.css");

/// What is drawn into the cylinder.
#[derive(Clone, Debug, Default)]
pub struct Drawing {
    leaks: PerLeak<Flow>,
    suspected: Vec<Signal>,
    absent: Vec<Signal>,
}

/// A leak's flow.
#[derive(Clone, Debug, Default)]
struct Flow {
    state: Known,
    /// Share of its alarm level.
    share: f64,
    /// In L/min, with its interval.
    text: String,
}

/// How it stands to its alarm level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Known {
    #[default]
    Unknown,
    Open,
    Below,
    Leaks,
}

impl Known {
    fn of(leak: Leak, report: &ReplayReport) -> Self {
        let verdict = &report.verdict;
        match verdict.status {
            _ if !report.estimates.leaks()[leak].identifiable => Self::Unknown,
            Status::Leak if verdict.faults.contains(&leak) => Self::Leaks,
            Status::Leak | Status::Sound => Self::Below,
            Status::Doubtful => Self::Unknown,
            Status::NotSure => match verdict.probability {
                Some(probability) if probability[leak] < RULED_OUT => Self::Below,
                _ => Self::Open,
            },
        }
    }

    /// Its class on the page, and what it says of a leak.
    fn names(self) -> [&'static str; 2] {
        match self {
            Self::Unknown => ["unknown", "not identified"],
            Self::Open => ["open", "perhaps above its alarm level"],
            Self::Below => ["below", "below its alarm level"],
            Self::Leaks => ["leaks", "above its alarm level"],
        }
    }
}

/// A leak is less likely than this where none is.
const RULED_OUT: f64 = 0.05;
/// Width of an arrow at its leak's alarm level, and the least and the largest that are drawn.
const AT_ALARM: f64 = 5.0;
const WIDTHS: [f64; 2] = [1.0, 16.0];

/// Where each sensor stands, and its symbol.
const SENSORS: [(Signal, [u16; 2], &str, &str); 5] = [
    (Signal::PressureA, [120, 22], "P", "A"),
    (Signal::PressureB, [260, 22], "P", "B"),
    (Signal::FlowA, [120, 158], "Q", "A"),
    (Signal::FlowB, [260, 158], "Q", "B"),
    (Signal::Position, [366, 80], "x", ""),
];

impl Drawing {
    /// The leaks at the end of a replay, and the sensors that its verdict or its explanations speak against.
    pub fn of(report: &ReplayReport, rig: &Rig) -> Self {
        let levels = thresholds_lpm(rig);
        let flow = |leak: Leak| {
            let state = Known::of(leak, report);
            let leakage = &report.leakage[leak];
            let share = leakage.mean_lpm / levels[leak];
            let text = if state == Known::Unknown { "not known".to_owned() } else { interval(leakage) };
            Flow { state, share, text }
        };
        Self { leaks: PerLeak::from_fn(flow), suspected: suspected(report), absent: absent(report) }
    }

    /// As SVG; one of nothing known is what a page with values of its own fills in.
    pub fn svg(&self) -> Markup {
        html! {
            svg .cylinder viewBox="0 0 400 188" role="img" aria-label=(self.in_words()) {
                (body())
                @for (signal, place, symbol, chamber) in SENSORS { (self.sensor(signal, place, symbol, chamber)) }
                (self.leak(Leak::Internal, "translate(162 62) scale(56 1)", (190, "middle")))
                (self.leak(Leak::ExternalA, "translate(117 127) scale(-60 1)", (4, "start")))
                (self.leak(Leak::ExternalB, "translate(263 127) scale(60 1)", (396, "end")))
            }
        }
    }

    fn sensor(&self, signal: Signal, [x, y]: [u16; 2], symbol: &str, chamber: &str) -> Markup {
        let state = match signal {
            _ if self.absent.contains(&signal) => "absent",
            _ if self.suspected.contains(&signal) => "suspected",
            _ => "",
        };
        html! {
            g class={ "sensor " (state) } data-sensor=(signal.name()) {
                circle cx=(x) cy=(y) r="13" {}
                text x=(x) y=(y + 4) { (symbol) tspan .chamber dy="3" { (chamber) } }
                text .mark x=(x + 17) y=(y - 5) { "!" }
            }
        }
    }

    fn leak(&self, leak: Leak, place: &str, (x, anchor): (u16, &str)) -> Markup {
        let Flow { state, share, text } = &self.leaks[leak];
        let [class, _] = state.names();
        let known = if *state == Known::Unknown { 0.0 } else { *share };
        let width = (AT_ALARM * known).clamp(WIDTHS[0], WIDTHS[1]);
        html! {
            g class={ "leak " (class) } data-leak=(leak.id()) {
                g transform=(place) { path transform={ "scale(1 " (format!("{width:.1}")) ")" } d="M0-.5H.72V-1.2L1 0 .72 1.2V.5H0Z" {} }
                text text-anchor=(anchor) x=(x) y="156" { (leak.label()) }
                text .flow text-anchor=(anchor) x=(x) y="170" { (text) }
            }
        }
    }

    fn in_words(&self) -> String {
        let leaks = Leak::ALL.map(|leak| {
            let Flow { state, text, .. } = &self.leaks[leak];
            let [_, says] = state.names();
            match state {
                Known::Unknown => format!("{} leak {says}", leak.label()),
                _ => format!("{} leak {text} L/min, {says}", leak.label()),
            }
        });
        let names = |signals: &[Signal]| signals.iter().map(|one| one.name()).collect::<Vec<_>>().join(", ");
        let mut words = format!("The cylinder: {}", leaks.join("; "));
        for (signals, what) in [(&self.suspected, "sensors in doubt"), (&self.absent, "not measured")] {
            if !signals.is_empty() {
                words += &format!("; {what}: {}", names(signals));
            }
        }
        words
    }
}

/// Barrel, piston, rod and the lines to gauges, meters and valve.
fn body() -> Markup {
    html! {
        path .line d="M120 35V48M260 35V48M120 112V145M260 112V145M120 171V188M260 171V188" {}
        rect .oil x="60" y="48" width="260" height="64" rx="4" {}
        rect .rod x="197" y="74" width="156" height="12" {}
        rect .piston x="183" y="48" width="14" height="64" {}
        text .name x="90" y="86" { "A" }
        text .name x="296" y="70" { "B" }
    }
}

/// A sensor that is more likely off than not, or that a reason of the verdict names.
fn suspected(report: &ReplayReport) -> Vec<Signal> {
    let verdict = &report.verdict;
    let is_named = |signal: Signal| verdict.reasons.iter().any(|reason| reason.sensors.contains(&signal));
    let probability = |signal: Signal| {
        let about = verdict.explanations.iter().filter(|one| one.sensors.contains(&signal));
        about.map(|one| one.probability).sum::<f64>()
    };
    let suspected = |signal: &Signal| is_named(*signal) || probability(*signal) > 0.5;
    SENSORS.map(|(signal, ..)| signal).into_iter().filter(suspected).collect()
}

/// Flow meters in a hold test and where the valve's flows stood for them, and the pressure that one may lack then.
fn absent(report: &ReplayReport) -> Vec<Signal> {
    if report.hold.is_none() && report.valve.is_none() {
        return Vec::new();
    }
    let unread = report.valve.as_ref().and_then(|valve| valve.unread).and_then(Signal::by_name);
    [Signal::FlowA, Signal::FlowB].into_iter().chain(unread).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawing() -> Drawing {
        let flow = |state, share, text: &str| Flow { state, share, text: text.to_owned() };
        let leaks = PerLeak {
            internal: flow(Known::Leaks, 2.0, "0.200 ± 0.010"),
            external_a: flow(Known::Below, 0.1, "0.010 ± 0.010"),
            external_b: flow(Known::Unknown, 3.0, "not known"),
        };
        Drawing { leaks, suspected: vec![Signal::FlowB], absent: vec![Signal::PressureA] }
    }

    #[test]
    fn each_leak_is_an_arrow_of_its_size() {
        let svg = drawing().svg().into_string();
        let arrow = |leak: &str| svg.split_once(&format!("data-leak=\"{leak}\"")).unwrap().1;
        assert!(svg.contains("class=\"leak leaks\" data-leak=\"internal\""), "{svg}");
        assert!(arrow("internal").contains("scale(1 10.0)"), "twice the alarm level");
        assert!(arrow("external_a").starts_with(
            "><g transform=\"translate(117 127) scale(-60 1)\"><path transform=\"scale(1 1.0)\""
        ));
        assert!(!svg.contains("scale(1 15.0)"), "a flow that nobody knows has no size");
        assert!(svg.contains("class=\"leak unknown\" data-leak=\"external_b\""), "{svg}");
    }

    #[test]
    fn sensors_stand_in_their_state() {
        let svg = drawing().svg().into_string();
        for (class, name) in [("suspected", "qb"), ("absent", "pa"), ("", "qa"), ("", "x")] {
            assert!(
                svg.contains(&format!("class=\"sensor {class}\" data-sensor=\"{name}\"")),
                "{name}: {svg}"
            );
        }
    }

    #[test]
    fn whoever_does_not_see_it_is_told() {
        let words = "The cylinder: internal leak 0.200 ± 0.010 L/min, above its alarm level; external A leak 0.010 ± 0.010 L/min, \
                     below its alarm level; external B leak not identified; sensors in doubt: qb; not measured: pa";
        assert_eq!(drawing().in_words(), words);
    }
}
