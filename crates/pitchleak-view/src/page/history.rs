//! What a page shows over time, gathered while a trace goes by, in bounded memory.

use super::chart::{Chart, Charts, Ink, Limit, Line};
use crate::envelope::{Envelopes, Range, Row, Spot};
use maud::{Markup, html};
use pitchleak::core::{Estimate, Leak, PerLeak};
use pitchleak::replay::Replay;
use pitchleak::trace::Record;
use pitchleak::units::LPM_PER_M3S;

const KELVIN: f64 = 273.15;

// Columns of what is gathered.
const POSITION: usize = 0;
const PRESSURE_A: usize = 1;
const PRESSURE_B: usize = 2;
const FLOW_A: usize = 3;
const FLOW_B: usize = 4;
const FORCE: usize = 5;
const TEMPERATURE: usize = 6;
/// The flow balance's innovation, in its own standard deviations.
const BALANCE: usize = 7;
/// The position equation's squared innovation over its variance, a running mean.
const POSITION_RESIDUAL: usize = 8;
/// The first of the leaks' …
const LEAKS: usize = 9;
/// … and of their reference meters'.
const REFERENCES: usize = 12;
const QUANTITIES: usize = 15;

/// A line of a chart: its name, colour and column.
type Signal = (&'static str, Ink, usize);

/// The charts of the signals: title, unit, and lines.
const SIGNALS: [(&str, &str, &[Signal]); 5] = [
    ("Piston position", "mm", &[("x", Ink::Blue, POSITION)]),
    ("Chamber pressures", "bar", &[("P_A", Ink::Blue, PRESSURE_A), ("P_B", Ink::Vermilion, PRESSURE_B)]),
    ("Flows into the chambers", "L/min", &[("Q_A", Ink::Blue, FLOW_A), ("Q_B", Ink::Vermilion, FLOW_B)]),
    ("Load force against extension", "kN", &[("force", Ink::Blue, FORCE)]),
    ("Oil temperature", "°C", &[("temperature", Ink::Blue, TEMPERATURE)]),
];

/// Signals, estimates and residuals of a replay as a screen can show them, however long the trace.
#[derive(Clone, Debug, Default)]
pub struct History {
    envelopes: Envelopes<QUANTITIES>,
    leaks_lpm: PerLeak<Option<Spot>>,
    position_residual: Option<Spot>,
}

impl History {
    /// Takes in a record, and the replay that has taken it in before; `renewed` where its estimates are new.
    pub fn add(&mut self, replay: &Replay, record: &Record, renewed: bool) {
        if renewed {
            self.leaks_lpm = replay.watched_flows_m3s().map(|flow| Some(spot(flow.scaled(LPM_PER_M3S))));
            self.position_residual =
                replay.estimator().normalised_innovation().map(|[_, position]| Spot::at(position));
        }
        let spots = self.spots(replay, record);
        if record.after_gap {
            self.envelopes.pause();
        }
        self.envelopes.add(record.t_s, &spots);
    }

    fn spots(&self, replay: &Replay, record: &Record) -> [Option<Spot>; QUANTITIES] {
        let s = &record.sample;
        let mut spots = [None; QUANTITIES];
        let scaled = |value: Option<f64>, factor: f64| value.map(|value| Spot::at(value * factor));
        spots[POSITION] = scaled(Some(s.x_m), 1e3);
        spots[PRESSURE_A] = scaled(Some(s.pa_pa), 1e-5);
        spots[PRESSURE_B] = scaled(Some(s.pb_pa), 1e-5);
        spots[FLOW_A] = scaled(s.qa_m3s, LPM_PER_M3S);
        spots[FLOW_B] = scaled(s.qb_m3s, LPM_PER_M3S);
        spots[FORCE] = scaled(s.force_n, 1e-3);
        spots[TEMPERATURE] = record.temperature_k.map(|kelvin| Spot::at(kelvin - KELVIN));
        spots[BALANCE] = replay.innovation().map(Spot::at);
        spots[POSITION_RESIDUAL] = self.position_residual;
        for leak in Leak::ALL {
            spots[LEAKS + leak as usize] = self.leaks_lpm[leak];
            spots[REFERENCES + leak as usize] = scaled(record.leak_m3s[leak], LPM_PER_M3S);
        }
        spots
    }

    /// As it is drawn.
    pub(super) fn drawn(&self) -> Drawn {
        Drawn(self.envelopes.rows())
    }
}

/// An estimate with its 95 % interval; of one whose spread is unknown the value alone.
fn spot(estimate: Estimate<f64>) -> Spot {
    let [low, high] = if estimate.std > 0.0 { estimate.ci95() } else { [estimate.value; 2] };
    Spot { low, value: estimate.value, high }
}

/// The colour of a leak wherever it stands.
pub(super) fn ink(leak: Leak) -> Ink {
    match leak {
        Leak::Internal => Ink::Blue,
        Leak::ExternalA => Ink::Vermilion,
        Leak::ExternalB => Ink::Green,
    }
}

/// A history in rows, ready for charts.
pub(super) struct Drawn(Vec<Row<QUANTITIES>>);

impl Drawn {
    /// The charts' common time.
    pub fn charts(&self) -> Charts {
        Charts::over(self.0.iter().map(|row| row.t_s))
    }

    fn line(&self, name: impl Into<String>, ink: Ink, column: usize) -> Line {
        let of = |row: &Row<QUANTITIES>| row.ranges.get(column).copied().flatten();
        let ranges: Vec<Option<Range>> = self.0.iter().map(of).collect();
        Line::over_time(name, ink, &ranges)
    }

    /// Leak flows with their bands, beside reference meters where there are any.
    pub fn leaks(&self) -> Vec<Line> {
        let line = |leak: Leak| self.line(leak.label(), ink(leak), LEAKS + leak as usize);
        let reference = |leak: Leak| {
            let line = self.line("reference meters", Ink::Grey, REFERENCES + leak as usize);
            // A meter's scatter would hide the estimates.
            Line { low: None, high: None, ..line.dashed() }
        };
        Leak::ALL.into_iter().map(reference).chain(Leak::ALL.into_iter().map(line)).collect()
    }

    /// Every signal as it was read.
    pub fn signals(&self, charts: &mut Charts) -> Markup {
        html! {
            @for (title, unit, lines) in SIGNALS {
                @let line = |(name, ink, column): &Signal| self.line(*name, *ink, *column);
                @let lines = lines.iter().map(line).collect();
                (charts.place(Chart { title: title.to_owned(), unit, lines, ..Chart::default() }))
            }
        }
    }

    /// Innovations: readings less what the estimates before them predicted.
    pub fn residuals(&self, charts: &mut Charts) -> Markup {
        let balance = Chart {
            title: "Residual of the flow balance".to_owned(),
            unit: "σ",
            note: "In standard deviations of the declared noise. As long as model and declared noise hold, 95 % stay between the dashed lines.",
            lines: vec![self.line("flow balance", Ink::Blue, BALANCE)],
            limits: [2.0, -2.0].map(|value| Limit { value, label: format!("{value:+.0} σ") }).to_vec(),
            ..Chart::default()
        };
        let position = Chart {
            title: "Position against the flows".to_owned(),
            unit: "",
            note: "Square of the residual over its variance, running mean. About 1 where position and flows agree, far above where they do not.",
            lines: vec![self.line("position residual", Ink::Vermilion, POSITION_RESIDUAL)],
            limits: vec![Limit { value: 1.0, label: "expected".to_owned() }],
            ..Chart::default()
        };
        html! { (charts.place(balance)) (charts.place(position)) }
    }
}
