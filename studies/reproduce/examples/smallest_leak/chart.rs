//! Charts with two logarithmic axes, side by side, as SVG.

use crate::Failure;
use plotters::prelude::*;
use std::fmt::Write;

/// Name of the curve that is drawn as points.
pub const ESTIMATED: &str = "the estimator after a minute";

pub struct Chart {
    pub title: &'static str,
    pub x_label: &'static str,
    pub curves: Vec<Curve>,
}

/// Smallest leak, L/min, over the chart's quantity.
pub struct Curve {
    pub name: &'static str,
    pub points: Vec<(f64, f64)>,
}

const WIDTH: u32 = 560;
const HEIGHT: u32 = 360;
const COLUMNS: usize = 2;
/// Smallest and largest leak that is drawn, L/min.
const LEAKS_LPM: std::ops::Range<f64> = 5e-6..5.0;
/// Apart in print and for the colour-blind (Okabe and Ito 2008): a minute, an hour, a day.
const INKS: [RGBColor; 3] = [RGBColor(213, 94, 0), RGBColor(0, 114, 178), RGBColor(0, 158, 115)];
const POINTS: RGBColor = RGBColor(60, 60, 60);

impl Chart {
    /// The numbers, a row for each place.
    pub fn to_text(&self) -> String {
        let mut out = format!("{}\n{:>36}", self.title, self.x_label);
        for curve in &self.curves {
            let _ = write!(out, "  {:>12}", curve.name);
        }
        let places = self.curves.first().map_or(0, |curve| curve.points.len());
        for place in 0..places {
            let _ = write!(out, "\n{:>36}", self.curves[0].points[place].0);
            for curve in &self.curves {
                let _ = write!(out, "  {:>12.5}", curve.points[place].1);
            }
        }
        out + " L/min\n\n"
    }
}

pub fn svg(charts: &[Chart]) -> Result<String, Failure> {
    let rows = charts.len().div_ceil(COLUMNS);
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (WIDTH * COLUMNS as u32, HEIGHT * rows as u32));
        let area = area.into_drawing_area();
        area.fill(&WHITE)?;
        for (chart, cell) in charts.iter().zip(area.split_evenly((rows, COLUMNS))) {
            draw(chart, &cell).map_err(|cause| cause.to_string())?;
        }
        area.present()?;
    }
    Ok(text)
}

fn draw<'a>(
    chart: &Chart,
    cell: &DrawingArea<SVGBackend<'a>, plotters::coord::Shift>,
) -> Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>> {
    let places = chart.curves.iter().flat_map(|curve| &curve.points).map(|point| point.0);
    let (left, right) = places.fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
    let mut axes = ChartBuilder::on(cell)
        .caption(chart.title, ("sans-serif", 17))
        .margin(8)
        .margin_right(16)
        .x_label_area_size(38)
        .y_label_area_size(68)
        .build_cartesian_2d((left / 1.1..right * 1.1).log_scale(), LEAKS_LPM.log_scale())?;
    axes.configure_mesh()
        .x_desc(chart.x_label)
        .y_desc("smallest leak (L/min)")
        .axis_desc_style(("sans-serif", 15))
        .label_style(("sans-serif", 13))
        .light_line_style(TRANSPARENT)
        .bold_line_style(RGBColor(220, 220, 220))
        .x_label_formatter(&tick)
        .y_label_formatter(&tick)
        .draw()?;
    for (curve, ink) in chart.curves.iter().zip(INKS) {
        let style = ink.stroke_width(2);
        axes.draw_series(LineSeries::new(curve.points.iter().copied(), style))?
            .label(curve.name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
    }
    for curve in chart.curves.iter().filter(|curve| curve.name == ESTIMATED) {
        let points = curve.points.iter().map(|point| Circle::new(*point, 4, POINTS.filled()));
        axes.draw_series(points)?
            .label(curve.name)
            .legend(|(x, y)| Circle::new((x + 9, y), 4, POINTS.filled()));
    }
    axes.configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .label_font(("sans-serif", 13))
        .background_style(WHITE)
        .border_style(RGBColor(180, 180, 180))
        .draw()
}

/// One, two and five of each decade.
fn tick(value: &f64) -> String {
    let decade = 10.0_f64.powf(value.log10().floor());
    let digit = value / decade;
    let named = [1.0, 2.0, 5.0, 10.0].iter().any(|one| (digit - one).abs() < 1e-6);
    let decimals = (-decade.log10().round()).max(0.0) as usize;
    if named { format!("{value:.decimals$}") } else { String::new() }
}
