//! Figures like the paper's Fig. 5 to 8, of one window of each wind.

use super::protocol::{Case, ReproduceError, Run};
use super::search::paper_rig;
use super::trial::EstimateHistory;
use super::{Reproduction, SAMPLE_RATE_HZ, rig};
use pitchleak::core::{Leak, PerLeak};
use pitchleak::output::{self, Inputs};
use pitchleak::simulate::{Biases, Sensing, Truth};
use pitchleak::units::{LPM_PER_BAR, LPM_PER_M3S};
use pitchleak_view::figure::{Ink, Line, Panel, svg};
use std::path::Path;

/// The window drawn (30 to 50 s of each wind history) …
const WINDOW: usize = 1;
/// … with the noise of this seed.
const SEED: u64 = 1;

const COLUMNS: usize = 2;

type Points = Vec<(f64, f64)>;

/// A figure of several panels.
pub struct Drawing {
    /// Short, for links.
    pub id: &'static str,
    /// Of its file.
    pub name: &'static str,
    /// For people.
    pub title: &'static str,
    /// Row by row, two to a row.
    pub panels: Vec<Panel>,
}

impl Reproduction {
    /// The figures by their file names.
    ///
    /// # Errors
    /// [`ReproduceError::Figure`], [`ReproduceError::Filter`].
    pub fn figures(&self) -> Result<Vec<(&'static str, String)>, ReproduceError> {
        let draw = |Drawing { name, panels, .. }| Ok((name, svg(&legend_once(panels), COLUMNS)?));
        self.drawings()?.into_iter().map(draw).collect()
    }

    /// What is in the figures: like the paper's Fig. 5 to 8.
    ///
    /// # Errors
    /// [`ReproduceError`], where a window cannot be estimated.
    pub fn drawings(&self) -> Result<Vec<Drawing>, ReproduceError> {
        let of_case = |case: Case| -> Vec<&Run> {
            self.runs
                .iter()
                .zip(Case::ALL.iter().cycle())
                .filter(|(_, c)| **c == case)
                .map(|(run, _)| run)
                .collect()
        };
        let first = of_case(Case::One);
        let mut drawings = vec![
            Drawing {
                id: "wind",
                name: "fig5_wind.svg",
                title: "Wind, as Fig. 5",
                panels: first.iter().map(|run| wind(run)).collect(),
            },
            Drawing {
                id: "tracking",
                name: "fig6_tracking.svg",
                title: "What the rig followed, as Fig. 6",
                panels: first.iter().flat_map(|run| followed(run)).collect(),
            },
        ];
        let names = [
            [
                ("leakage-1", "fig7a_leakage_case1.svg", "Leak flows, case 1, as Fig. 7"),
                ("coefficients-1", "fig7b_coefficients_case1.svg", "Leak coefficients, case 1, as Fig. 7"),
            ],
            [
                ("leakage-2", "fig8a_leakage_case2.svg", "Leak flows, case 2, as Fig. 8"),
                ("coefficients-2", "fig8b_coefficients_case2.svg", "Leak coefficients, case 2, as Fig. 8"),
            ],
        ];
        for (case, [leakage, coefficients]) in Case::ALL.into_iter().zip(names) {
            let histories =
                of_case(case).into_iter().map(|run| self.histories(run)).collect::<Result<Vec<_>, _>>()?;
            let mut add = |(id, name, title), panels: fn(&Histories) -> [Panel; 2]| {
                drawings.push(Drawing {
                    id,
                    name,
                    title,
                    panels: histories.iter().flat_map(panels).collect(),
                });
            };
            add(leakage, leak_flows);
            add(coefficients, leak_coefficients);
        }
        Ok(drawings)
    }

    /// Writes the figures, `table.txt` and `reproduce.json` into `directory`, which is made if need be.
    ///
    /// # Errors
    /// [`ReproduceError`].
    pub fn write(&self, directory: &Path) -> Result<(), ReproduceError> {
        output::make_folder(directory)?;
        let write = |name: &str, text: &str| output::write(directory.join(name), text, &Inputs::default());
        for (name, text) in self.figures()? {
            write(name, &text)?;
        }
        write("table.txt", &self.report.to_text())?;
        Ok(write("reproduce.json", &self.report.to_json()?)?)
    }

    /// Both laws on the same readings of the window that is drawn.
    fn histories(&self, run: &Run) -> Result<Histories, ReproduceError> {
        let best = self.report.paper_gains.first();
        let (lambda, gamma) = best.map_or((10.0, 1.0), |best| (best.lambda_per_s, best.gamma));
        let history = |rig| {
            let sensing = Sensing::new(super::rig().sensors(), Biases::default(), SEED);
            EstimateHistory::run(&rig, run.window(WINDOW), sensing)
        };
        let mean_mps = run.wind.mean_mps();
        Ok(Histories {
            mean_mps,
            truth: run.leaks_m3spa,
            paper: history(paper_rig(lambda, gamma))?,
            ours: history(rig())?,
        })
    }
}

struct Histories {
    mean_mps: u32,
    truth: PerLeak<f64>,
    paper: EstimateHistory,
    ours: EstimateHistory,
}

fn over_time(truths: &[Truth], value: impl Fn(&Truth) -> f64) -> Points {
    (0..).zip(truths).map(|(k, truth)| (f64::from(k) / SAMPLE_RATE_HZ, value(truth))).collect()
}

fn line(label: &'static str, ink: Ink, points: Points) -> Line {
    Line { label, ink, points }
}

fn wind(run: &Run) -> Panel {
    let start = WINDOW * super::protocol::WINDOW_SAMPLES;
    let speeds = run.wind_mps.iter().skip(start).take(super::protocol::WINDOW_SAMPLES);
    let points = (0..).zip(speeds).map(|(k, speed)| (f64::from(k) / SAMPLE_RATE_HZ, *speed)).collect();
    Panel {
        title: format!("Mean wind {} m/s", run.wind.mean_mps()),
        x_label: "time (s)",
        y_label: "wind (m/s)",
        lines: vec![line("", Ink::Ours, points)],
        y_range: None,
    }
}

fn followed(run: &Run) -> [Panel; 2] {
    let truths = run.window(WINDOW);
    let wind = run.wind.mean_mps();
    let panel = |what, y_label, reference, output| Panel {
        title: format!("{wind} m/s: {what}"),
        x_label: "time (s)",
        y_label,
        lines: vec![line("reference", Ink::Measured, reference), line("output", Ink::Ours, output)],
        y_range: None,
    };
    let position = over_time(truths, |t| 1e3 * t.signals.x_m);
    let mut tracking = panel(
        "piston position",
        "position (mm)",
        over_time(truths, |t| 1e3 * t.position_reference_m),
        position.clone(),
    );
    tracking.y_range = Some(at_least(1.0, &position));
    [
        tracking,
        panel(
            "load",
            "load (kN)",
            over_time(truths, |t| 1e-3 * t.load_reference_n),
            over_time(truths, |t| 1e-3 * t.signals.force_n),
        ),
    ]
}

/// A legend in the first row is enough.
fn legend_once(mut panels: Vec<Panel>) -> Vec<Panel> {
    for line in panels.iter_mut().skip(COLUMNS).flat_map(|panel| &mut panel.lines) {
        line.label = "";
    }
    panels
}

/// The range of the points, widened by a twelfth and to `least` at the least.
fn at_least(least: f64, points: &Points) -> (f64, f64) {
    let (low, high) =
        points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p.1), h.max(p.1)));
    let half = (0.58 * (high - low)).max(0.5 * least);
    (0.5 * (low + high) - half, 0.5 * (low + high) + half)
}

fn leak_flows(histories: &Histories) -> [Panel; 2] {
    let panel = |leak: Leak| {
        let points = |flows: &[PerLeak<f64>]| -> Points {
            histories.ours.t_s.iter().zip(flows).map(|(t, q)| (*t, LPM_PER_M3S * q[leak])).collect()
        };
        let reference = points(&histories.ours.references_m3s);
        let (low, high) = at_least(0.1, &reference);
        let room = 0.3 * (high - low);
        Panel {
            title: format!("{} m/s: {} leakage", histories.mean_mps, leak.label()),
            x_label: "time (s)",
            y_label: "leakage (L/min)",
            y_range: Some((low - room, high + room)),
            lines: vec![
                line("measured", Ink::Measured, reference),
                line("paper's law", Ink::Paper, points(&histories.paper.flows_m3s)),
                line("ours", Ink::Ours, points(&histories.ours.flows_m3s)),
            ],
        }
    };
    [panel(Leak::Internal), panel(Leak::ExternalA)]
}

fn leak_coefficients(histories: &Histories) -> [Panel; 2] {
    let panel = |leak: Leak| {
        let points = |history: &EstimateHistory| -> Points {
            let values = history.coefficients.iter().map(|c| LPM_PER_BAR * c[leak].value);
            history.t_s.iter().copied().zip(values).collect()
        };
        let truth = LPM_PER_BAR * histories.truth[leak];
        let end = histories.ours.t_s.last().copied().unwrap_or(0.0);
        Panel {
            title: format!("{} m/s: {} leak coefficient", histories.mean_mps, leak.label()),
            x_label: "time (s)",
            y_label: "coefficient (L/min/bar)",
            y_range: Some((-0.2 * truth, 2.0 * truth)),
            lines: vec![
                line("measured", Ink::Measured, vec![(0.0, truth), (end, truth)]),
                line("paper's law", Ink::Paper, points(&histories.paper)),
                line("ours", Ink::Ours, points(&histories.ours)),
            ],
        }
    };
    [panel(Leak::Internal), panel(Leak::ExternalA)]
}
