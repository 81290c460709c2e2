//! Figures like the paper's Fig. 5 to 8, of one window of each wind.

use super::protocol::{Case, ReproduceError, Run, WINDOW_SAMPLES, paper_rig};
use super::table::EstimateHistory;
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
        let of_case = |case: Case| {
            let cases = self.runs.iter().zip(Case::ALL.into_iter().cycle());
            cases.filter(move |(_, own)| *own == case).map(|(run, _)| run)
        };
        let histories =
            |case| of_case(case).map(|run| self.histories(run)).collect::<Result<Vec<Histories>, _>>();
        let (one, two) = (histories(Case::One)?, histories(Case::Two)?);
        let flows = |histories: &[Histories]| histories.iter().flat_map(leak_flows).collect();
        let coefficients = |histories: &[Histories]| histories.iter().flat_map(leak_coefficients).collect();
        let drawing = |id, name, title, panels| Drawing { id, name, title, panels };
        Ok(vec![
            drawing("wind", "fig5_wind.svg", "Wind, as Fig. 5", of_case(Case::One).map(wind).collect()),
            drawing(
                "tracking",
                "fig6_tracking.svg",
                "What the rig followed, as Fig. 6",
                of_case(Case::One).flat_map(followed).collect(),
            ),
            drawing("leakage-1", "fig7a_leakage_case1.svg", "Leak flows, case 1, as Fig. 7", flows(&one)),
            drawing(
                "coefficients-1",
                "fig7b_coefficients_case1.svg",
                "Leak coefficients, case 1, as Fig. 7",
                coefficients(&one),
            ),
            drawing("leakage-2", "fig8a_leakage_case2.svg", "Leak flows, case 2, as Fig. 8", flows(&two)),
            drawing(
                "coefficients-2",
                "fig8b_coefficients_case2.svg",
                "Leak coefficients, case 2, as Fig. 8",
                coefficients(&two),
            ),
        ])
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

fn over_time(values: impl Iterator<Item = f64>) -> Points {
    (0..).zip(values).map(|(k, value)| (f64::from(k) / SAMPLE_RATE_HZ, value)).collect()
}

fn line(label: &'static str, ink: Ink, points: Points) -> Line {
    Line { label, ink, points }
}

/// A panel over time whose range is that of its lines.
fn panel(title: String, y_label: &'static str, lines: Vec<Line>) -> Panel {
    Panel { title, x_label: "time (s)", y_label, lines, y_range: None }
}

fn wind(run: &Run) -> Panel {
    let speeds = run.wind_mps.iter().skip(WINDOW * WINDOW_SAMPLES).take(WINDOW_SAMPLES);
    let lines = vec![line("", Ink::Ours, over_time(speeds.copied()))];
    panel(format!("Mean wind {} m/s", run.wind.mean_mps()), "wind (m/s)", lines)
}

fn followed(run: &Run) -> [Panel; 2] {
    let truths = run.window(WINDOW);
    let over = |of: fn(&Truth) -> f64| over_time(truths.iter().map(of));
    let both = |what: &str, y_label, reference, output| {
        let lines = vec![line("reference", Ink::Measured, reference), line("output", Ink::Ours, output)];
        panel(format!("{} m/s: {what}", run.wind.mean_mps()), y_label, lines)
    };
    let position = over(|t| 1e3 * t.signals.x_m);
    let y_range = Some(at_least(1.0, &position));
    let asked = over(|t| 1e3 * t.position_reference_m);
    let [load_asked, load] = [over(|t| 1e-3 * t.load_reference_n), over(|t| 1e-3 * t.signals.force_n)];
    [
        Panel { y_range, ..both("piston position", "position (mm)", asked, position) },
        both("load", "load (kN)", load_asked, load),
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

/// One leak: as it was, by the paper's law, and by the default estimator.
fn compared(
    title: String,
    y_label: &'static str,
    y_range: (f64, f64),
    [was, paper, ours]: [Points; 3],
) -> Panel {
    let lines = vec![
        line("measured", Ink::Measured, was),
        line("paper's law", Ink::Paper, paper),
        line("ours", Ink::Ours, ours),
    ];
    Panel { y_range: Some(y_range), ..panel(title, y_label, lines) }
}

fn leak_flows(histories: &Histories) -> [Panel; 2] {
    let Histories { mean_mps, paper, ours, .. } = histories;
    [Leak::Internal, Leak::ExternalA].map(|leak| {
        let points = |flows: &[PerLeak<f64>]| -> Points {
            ours.t_s.iter().zip(flows).map(|(t, q)| (*t, LPM_PER_M3S * q[leak])).collect()
        };
        let reference = points(&ours.references_m3s);
        let (low, high) = at_least(0.1, &reference);
        let room = 0.3 * (high - low);
        compared(
            format!("{mean_mps} m/s: {} leakage", leak.label()),
            "leakage (L/min)",
            (low - room, high + room),
            [reference, points(&paper.flows_m3s), points(&ours.flows_m3s)],
        )
    })
}

fn leak_coefficients(histories: &Histories) -> [Panel; 2] {
    let Histories { mean_mps, paper, ours, truth } = histories;
    [Leak::Internal, Leak::ExternalA].map(|leak| {
        let points = |history: &EstimateHistory| -> Points {
            let values = history.coefficients.iter().map(|c| LPM_PER_BAR * c[leak].value);
            history.t_s.iter().copied().zip(values).collect()
        };
        let truth = LPM_PER_BAR * truth[leak];
        let end = ours.t_s.last().copied().unwrap_or(0.0);
        compared(
            format!("{mean_mps} m/s: {} leak coefficient", leak.label()),
            "coefficient (L/min/bar)",
            (-0.2 * truth, 2.0 * truth),
            [vec![(0.0, truth), (end, truth)], points(paper), points(ours)],
        )
    })
}
