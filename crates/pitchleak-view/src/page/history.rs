//! What a page shows over time, gathered while a trace goes by, in bounded memory.

use super::chart::{Chart, Charts, Ink, Limit, Line};
use crate::envelope::{Envelopes, Range, Row, Spot};
use maud::{Markup, html};
use pitchleak::core::{Estimate, Leak, PerLeak};
use pitchleak::replay::Replay;
use pitchleak::trace::Record;
use pitchleak::units::LPM_PER_M3S;

const KELVIN: f64 = 273.15;

/// What is gathered, in the order of the columns below.
#[derive(Clone, Copy, Debug)]
enum Quantity {
    Position,
    PressureA,
    PressureB,
    FlowA,
    FlowB,
    Force,
    Temperature,
    /// The flow balance's innovation, in its own standard deviations.
    Balance,
    /// The position equation's squared innovation over its variance, a running mean.
    PositionResidual,
    Leak(Leak),
    Reference(Leak),
}

const QUANTITIES: usize = 15;

impl Quantity {
    fn column(self) -> usize {
        match self {
            Self::Position => 0,
            Self::PressureA => 1,
            Self::PressureB => 2,
            Self::FlowA => 3,
            Self::FlowB => 4,
            Self::Force => 5,
            Self::Temperature => 6,
            Self::Balance => 7,
            Self::PositionResidual => 8,
            Self::Leak(leak) => 9 + leak as usize,
            Self::Reference(leak) => 12 + leak as usize,
        }
    }
}

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
        let mut put = |quantity: Quantity, spot: Option<Spot>| {
            if let Some(place) = spots.get_mut(quantity.column()) {
                *place = spot;
            }
        };
        let scaled = |value: Option<f64>, factor: f64| value.map(|value| Spot::at(value * factor));
        put(Quantity::Position, scaled(Some(s.x_m), 1e3));
        put(Quantity::PressureA, scaled(Some(s.pa_pa), 1e-5));
        put(Quantity::PressureB, scaled(Some(s.pb_pa), 1e-5));
        put(Quantity::FlowA, scaled(s.qa_m3s, LPM_PER_M3S));
        put(Quantity::FlowB, scaled(s.qb_m3s, LPM_PER_M3S));
        put(Quantity::Force, scaled(s.force_n, 1e-3));
        put(Quantity::Temperature, record.temperature_k.map(|kelvin| Spot::at(kelvin - KELVIN)));
        put(Quantity::Balance, replay.innovation().map(Spot::at));
        put(Quantity::PositionResidual, self.position_residual);
        for leak in Leak::ALL {
            put(Quantity::Leak(leak), self.leaks_lpm[leak]);
            put(Quantity::Reference(leak), scaled(record.leak_m3s[leak], LPM_PER_M3S));
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

    fn line(&self, name: impl Into<String>, ink: Ink, quantity: Quantity) -> Line {
        let of = |row: &Row<QUANTITIES>| row.ranges.get(quantity.column()).copied().flatten();
        let ranges: Vec<Option<Range>> = self.0.iter().map(of).collect();
        Line::over_time(name, ink, &ranges)
    }

    /// Leak flows with their bands, beside reference meters where there are any.
    pub fn leaks(&self) -> Vec<Line> {
        let line = |leak: Leak| self.line(leak.label(), ink(leak), Quantity::Leak(leak));
        let reference = |leak: Leak| {
            let line = self.line("reference meters", Ink::Grey, Quantity::Reference(leak));
            // A meter's scatter would hide the estimates.
            Line { low: None, high: None, ..line.dashed() }
        };
        Leak::ALL.into_iter().map(reference).chain(Leak::ALL.into_iter().map(line)).collect()
    }

    /// Every signal as it was read.
    pub fn signals(&self, charts: &mut Charts) -> Markup {
        let mut chart = |title: &str, unit, lines: Vec<Line>| {
            charts.place(Chart { title: title.to_owned(), unit, lines, ..Chart::default() })
        };
        html! {
            (chart("Piston position", "mm", vec![self.line("x", Ink::Blue, Quantity::Position)]))
            (chart("Chamber pressures", "bar", vec![
                self.line("P_A", Ink::Blue, Quantity::PressureA),
                self.line("P_B", Ink::Vermilion, Quantity::PressureB),
            ]))
            (chart("Flows into the chambers", "L/min", vec![
                self.line("Q_A", Ink::Blue, Quantity::FlowA),
                self.line("Q_B", Ink::Vermilion, Quantity::FlowB),
            ]))
            (chart("Load force against extension", "kN", vec![self.line("force", Ink::Blue, Quantity::Force)]))
            (chart("Oil temperature", "°C", vec![self.line("temperature", Ink::Blue, Quantity::Temperature)]))
        }
    }

    /// Innovations: readings less what the estimates before them predicted.
    pub fn residuals(&self, charts: &mut Charts) -> Markup {
        let balance = Chart {
            title: "Residual of the flow balance".to_owned(),
            unit: "σ",
            note: "In standard deviations of the declared noise. As long as model and declared noise hold, 95 % stay between the dashed lines.",
            lines: vec![self.line("flow balance", Ink::Blue, Quantity::Balance)],
            limits: [2.0, -2.0].map(|value| Limit { value, label: format!("{value:+.0} σ") }).to_vec(),
            ..Chart::default()
        };
        let position = Chart {
            title: "Position against the flows".to_owned(),
            unit: "",
            note: "Square of the residual over its variance, running mean. About 1 where position and flows agree, far above where they do not.",
            lines: vec![self.line("position residual", Ink::Vermilion, Quantity::PositionResidual)],
            limits: vec![Limit { value: 1.0, label: "expected".to_owned() }],
            ..Chart::default()
        };
        html! { (charts.place(balance)) (charts.place(position)) }
    }
}
