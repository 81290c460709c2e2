//! Figures of curves over time, as SVG text: panels on a grid, each with its axes, units and legend.

use crate::envelope::extremes;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

/// Colours that stay apart in print and for the colour-blind (Okabe and Ito 2008).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ink {
    /// Grey and wide, as a bed for the others: what was measured, or asked for.
    Measured,
    /// Blue: our estimate, or what came out.
    Ours,
    /// Vermilion: the paper's estimate.
    Paper,
    /// Thin and dark: what chance allows, or theory says.
    Limit,
}

impl Ink {
    fn style(self) -> ShapeStyle {
        let (colour, width) = match self {
            Self::Measured => (RGBColor(165, 165, 165), 5),
            Self::Ours => (RGBColor(0, 114, 178), 2),
            Self::Paper => (RGBColor(213, 94, 0), 2),
            Self::Limit => (RGBColor(60, 60, 60), 1),
        };
        colour.stroke_width(width)
    }
}

/// One curve of a panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Name in the legend; empty for none.
    pub label: &'static str,
    /// Its colour.
    pub ink: Ink,
    /// Points of the curve, in the panel's units; breaks at values that are not finite.
    pub points: Vec<(f64, f64)>,
}

/// One pair of axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Heading.
    pub title: String,
    /// Quantity and unit of the horizontal axis.
    pub x_label: &'static str,
    /// Quantity and unit of the vertical axis.
    pub y_label: &'static str,
    /// The curves, drawn in this order.
    pub lines: Vec<Line>,
    /// Vertical range; `None` takes in every point.
    pub y_range: Option<(f64, f64)>,
}

/// Why a figure was not drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cannot draw the figure: {0}")]
pub struct FigureError(String);

const PANEL_WIDTH: u32 = 560;
const PANEL_HEIGHT: u32 = 250;
/// Points of one curve that are drawn at most: two to a pixel.
const MOST_POINTS: usize = 1000;
/// Height that a legend adds to its panel, as a share.
const LEGEND_SHARE: f64 = 0.5;

/// Draws `panels` row by row, `columns` to a row.
///
/// # Errors
/// [`FigureError`] when the plotting library gives up.
pub fn svg(panels: &[Panel], columns: usize) -> Result<String, FigureError> {
    let columns = columns.max(1);
    let rows = panels.len().div_ceil(columns).max(1);
    let size = (PANEL_WIDTH * columns as u32, PANEL_HEIGHT * rows as u32);
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        area.fill(&WHITE).map_err(error)?;
        for (panel, cell) in panels.iter().zip(area.split_evenly((rows, columns))) {
            draw(panel, &cell)?;
        }
        area.present().map_err(error)?;
    }
    Ok(text)
}

fn error(cause: impl std::fmt::Display) -> FigureError {
    FigureError(cause.to_string())
}

type Cell<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

fn draw(panel: &Panel, cell: &Cell) -> Result<(), FigureError> {
    let finite =
        || panel.lines.iter().flat_map(|line| &line.points).filter(|p| p.0.is_finite() && p.1.is_finite());
    let (left, right) = range(finite().map(|p| p.0), 0.0);
    let (low, top) = panel.y_range.unwrap_or_else(|| range(finite().map(|p| p.1), 0.08));
    let labelled = panel.lines.iter().any(|line| !line.label.is_empty());
    // Room for the legend above the curves.
    let high = if labelled { top + LEGEND_SHARE * (top - low) } else { top };
    let mut chart = ChartBuilder::on(cell)
        .caption(&panel.title, ("sans-serif", 17))
        .margin(8)
        .margin_right(16)
        .x_label_area_size(38)
        .y_label_area_size(68)
        .build_cartesian_2d(left..right, low..high)
        .map_err(error)?;
    chart
        .configure_mesh()
        .x_desc(panel.x_label)
        .y_desc(panel.y_label)
        .axis_desc_style(("sans-serif", 15))
        .label_style(("sans-serif", 13))
        .light_line_style(TRANSPARENT)
        .bold_line_style(RGBColor(220, 220, 220))
        .x_labels(6)
        .x_label_formatter(&|value| short(*value, right - left))
        .y_labels(6)
        .y_label_formatter(&|value| short(*value, high - low))
        .draw()
        .map_err(error)?;
    for line in &panel.lines {
        draw_line(&mut chart, line, low, high)?;
    }
    if labelled {
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .label_font(("sans-serif", 13))
            .background_style(WHITE)
            .border_style(RGBColor(180, 180, 180))
            .draw()
            .map_err(error)?;
    }
    Ok(())
}

fn draw_line(chart: &mut Chart, line: &Line, low: f64, high: f64) -> Result<(), FigureError> {
    let style = line.ink.style();
    let mut label = line.label;
    let stride = line.points.len().div_ceil(MOST_POINTS).max(1);
    for piece in line.points.split(|p| !p.0.is_finite() || !p.1.is_finite()) {
        let points: Vec<_> = piece.iter().step_by(stride).copied().collect();
        for inside in clipped(&points, low, high) {
            let drawn = chart.draw_series(LineSeries::new(inside, style)).map_err(error)?;
            if !label.is_empty() {
                drawn.label(label).legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
                label = "";
            }
        }
    }
    Ok(())
}

/// The parts of a curve between `low` and `high`: one that leaves the panel goes on to its edge and begins again there.
fn clipped(points: &[(f64, f64)], low: f64, high: f64) -> Vec<Vec<(f64, f64)>> {
    let mut parts: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut goes_on = false;
    for pair in points.windows(2) {
        let &[a, b] = pair else { continue };
        let Some([from, to]) = within(a, b, low, high) else {
            goes_on = false;
            continue;
        };
        if !goes_on {
            parts.push(vec![from]);
        }
        parts.last_mut().into_iter().for_each(|part| part.push(to));
        goes_on = (low..=high).contains(&b.1);
    }
    parts
}

/// The part of a straight line between `low` and `high` (Liang and Barsky 1984, in one direction).
fn within(a: (f64, f64), b: (f64, f64), low: f64, high: f64) -> Option<[(f64, f64); 2]> {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let [mut from, mut to] = [0.0_f64, 1.0_f64];
    if dy.abs() > 0.0 {
        let [enters, leaves] = if dy > 0.0 { [low, high] } else { [high, low] }.map(|edge| (edge - a.1) / dy);
        (from, to) = (from.max(enters), to.min(leaves));
    } else if a.1 < low || a.1 > high {
        return None;
    }
    // The ends as they are, so that the next piece goes on in the same place.
    let at =
        |share: f64| if share >= 1.0 { b } else { (a.0 + share * dx, (a.1 + share * dy).clamp(low, high)) };
    (from <= to).then(|| [at(from), at(to)])
}

/// Least and greatest value, widened by `share` of their distance; never empty.
fn range(values: impl Iterator<Item = f64>, share: f64) -> (f64, f64) {
    let [low, high] = extremes(values);
    let room = (high - low).max(1e-9 * high.abs().max(low.abs())).max(1e-12);
    if low <= high { (low - share * room, high + share * room) } else { (0.0, 1.0) }
}

/// A tick's number with as many decimals as ticks over `span` need.
fn short(value: f64, span: f64) -> String {
    let decimals = (1.0 - span.max(1e-12).log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel(points: Vec<(f64, f64)>) -> Panel {
        let line = Line { label: "ours", ink: Ink::Ours, points };
        Panel {
            title: "A title".into(),
            x_label: "time (s)",
            y_label: "leak (L/min)",
            lines: vec![line],
            y_range: None,
        }
    }

    #[test]
    fn a_figure_names_its_axes_and_draws_its_curve() {
        let wave = (0..100).map(|k| (0.1 * f64::from(k), (0.3 * f64::from(k)).sin())).collect();
        let text = svg(&[panel(wave)], 1).expect("draws");
        for part in ["A title", "time (s)", "leak (L/min)", "ours", "<polyline"] {
            assert!(text.contains(part), "{part}");
        }
    }

    #[test]
    fn a_curve_meets_the_frame_where_it_leaves_and_begins_again_there() {
        let zigzag = [(0.0, 0.0), (1.0, 2.0), (2.0, 0.0), (3.0, -4.0), (4.0, 4.0)];
        let parts = clipped(&zigzag, -1.0, 1.0);
        let expected: [&[(f64, f64)]; 3] = [
            &[(0.0, 0.0), (0.5, 1.0)],
            &[(1.5, 1.0), (2.0, 0.0), (2.25, -1.0)],
            &[(3.375, -1.0), (3.625, 1.0)],
        ];
        assert_eq!(parts, expected);
        assert_eq!(clipped(&[(0.0, 5.0), (1.0, 5.0)], -1.0, 1.0), Vec::<Vec<_>>::new());
        assert_eq!(clipped(&[(0.0, 1.0), (1.0, 1.0)], -1.0, 1.0), [[(0.0, 1.0), (1.0, 1.0)]]);
    }

    #[test]
    fn no_points_or_strange_ones_still_make_a_figure() {
        for points in [vec![], vec![(0.0, f64::NAN), (1.0, f64::INFINITY)], vec![(0.0, 3.0), (1.0, 3.0)]] {
            assert!(svg(&[panel(points.clone()), panel(points)], 2).is_ok());
        }
    }
}
