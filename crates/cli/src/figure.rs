//! Still figures, as SVG and PNG: for the book, the README, and readers without scripts.

use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;

use crate::Failure;

/// One set of points in a figure.
pub(crate) struct Series<'a> {
    pub(crate) name: &'a str,
    pub(crate) colour: RGBColor,
    pub(crate) points: Vec<(f64, f64)>,
    pub(crate) joined: bool,
}

/// Colours that stay apart for colour-blind readers (Okabe and Ito).
pub(crate) const VERMILLION: RGBColor = RGBColor(213, 94, 0);
pub(crate) const BLUE: RGBColor = RGBColor(0, 114, 178);
pub(crate) const GREEN: RGBColor = RGBColor(0, 158, 115);
pub(crate) const PURPLE: RGBColor = RGBColor(204, 121, 167);

/// Least height of an axis, in its unit: below it is rounding.
const LEAST_SPAN: f64 = 1e-9;
/// Width and height, px.
const SIZE: (u32, u32) = (860, 380);

/// Draws `series` over common axes.
pub(crate) fn plot(x_label: &str, y_label: &str, series: &[Series<'_>]) -> Result<String, Failure> {
    let mut svg = String::new();
    draw(&SVGBackend::with_string(&mut svg, SIZE).into_drawing_area(), x_label, y_label, series)?;
    Ok(svg)
}

/// The same as a PNG file.
pub(crate) fn plot_png(path: &Path, x_label: &str, y_label: &str, series: &[Series<'_>]) -> Result<(), Failure> {
    draw(&BitMapBackend::new(path, SIZE).into_drawing_area(), x_label, y_label, series)
}

fn draw<B: DrawingBackend>(
    root: &DrawingArea<B, Shift>,
    x_label: &str,
    y_label: &str,
    series: &[Series<'_>],
) -> Result<(), Failure> {
    let drawn = || -> Result<(), Box<dyn std::error::Error + '_>> {
        let span = |of: fn(&(f64, f64)) -> f64| {
            let (lo, hi) = series
                .iter()
                .flat_map(|s| &s.points)
                .map(of)
                .filter(|v| v.is_finite())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            if hi > lo { (lo, hi) } else { (0.0, 1.0) }
        };
        let wide =
            |(lo, hi): (f64, f64)| if hi - lo < LEAST_SPAN { (lo - LEAST_SPAN, hi + LEAST_SPAN) } else { (lo, hi) };
        let ((x0, x1), (y0, y1)) = (span(|p| p.0), wide(span(|p| p.1)));
        // room above for the names
        let margin = 0.05 * (y1 - y0);
        fonts()?;
        root.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(root)
            .margin(12)
            .x_label_area_size(42)
            .y_label_area_size(76)
            .build_cartesian_2d(x0..x1, (y0 - margin)..(y1 + 4.0 * margin))?;
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .bold_line_style(RGBColor(228, 228, 228))
            .x_desc(x_label)
            .y_desc(y_label)
            .axis_desc_style(("sans-serif", 14))
            .label_style(("sans-serif", 12))
            .draw()?;
        for s in series {
            let colour = s.colour;
            if s.joined {
                chart
                    .draw_series(LineSeries::new(s.points.iter().copied(), colour.stroke_width(2)))?
                    .label(s.name)
                    .legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
            } else {
                chart
                    .draw_series(s.points.iter().map(|p| Circle::new(*p, 1, colour.filled())))?
                    .label(s.name)
                    .legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
            }
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(200, 200, 200))
            .label_font(("sans-serif", 13))
            .draw()?;
        root.present()?;
        Ok(())
    };
    drawn().map_err(|e| Failure::input(format!("figure: {e}")))
}

/// Width of a figure of several panels, height of a panel, and of the axis below the last, px.
const PANEL: (u32, u32) = (860, 92);
const PANEL_AXIS: u32 = 44;

/// One panel below the other over a common horizontal axis, each series in its own span.
pub(crate) fn panels(x_label: &str, series: &[Series<'_>]) -> Result<String, Failure> {
    let mut svg = String::new();
    draw_panels(&SVGBackend::with_string(&mut svg, panels_size(series)).into_drawing_area(), x_label, series)?;
    Ok(svg)
}

/// The same as a PNG file.
pub(crate) fn panels_png(path: &Path, x_label: &str, series: &[Series<'_>]) -> Result<(), Failure> {
    draw_panels(&BitMapBackend::new(path, panels_size(series)).into_drawing_area(), x_label, series)
}

#[allow(clippy::cast_possible_truncation, reason = "a recording has some twenty channels")]
fn panels_size(series: &[Series<'_>]) -> (u32, u32) {
    (PANEL.0, PANEL.1 * series.len().max(1) as u32 + PANEL_AXIS)
}

/// Least and largest of what is finite; a span of its own where there is none.
fn span(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let start = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = values.filter(|v| v.is_finite()).fold(start, |(l, h), v| (l.min(v), h.max(v)));
    if high > low {
        (low, high)
    } else if low.is_finite() {
        let half = (1e-3 * low.abs()).max(f64::MIN_POSITIVE.sqrt());
        (low - half, low + half)
    } else {
        (0.0, 1.0)
    }
}

fn draw_panels<B: DrawingBackend>(
    root: &DrawingArea<B, Shift>,
    x_label: &str,
    series: &[Series<'_>],
) -> Result<(), Failure> {
    let drawn = || -> Result<(), Box<dyn std::error::Error + '_>> {
        let (x0, x1) = span(series.iter().flat_map(|s| &s.points).map(|p| p.0));
        fonts()?;
        root.fill(&WHITE)?;
        let mut rest = root.clone();
        for (at, s) in series.iter().enumerate() {
            let is_last = at + 1 == series.len();
            let (area, below) = if is_last { (rest.clone(), rest.clone()) } else { rest.split_vertically(PANEL.1) };
            rest = below;
            let (y0, y1) = span(s.points.iter().map(|p| p.1));
            let margin = 0.08 * (y1 - y0);
            let mut chart = ChartBuilder::on(&area)
                .margin_left(12)
                .margin_right(16)
                .margin_top(18)
                .x_label_area_size(if is_last { PANEL_AXIS } else { 0 })
                .y_label_area_size(84)
                .build_cartesian_2d(x0..x1, (y0 - margin)..(y1 + margin))?;
            let mut mesh = chart.configure_mesh();
            mesh.light_line_style(WHITE)
                .bold_line_style(RGBColor(228, 228, 228))
                .y_labels(3)
                .axis_desc_style(("sans-serif", 14))
                .label_style(("sans-serif", 12));
            if is_last {
                mesh.x_desc(x_label);
            }
            mesh.draw()?;
            chart.draw_series(LineSeries::new(s.points.iter().copied(), s.colour.stroke_width(1)))?;
            area.draw(&Text::new(s.name.to_owned(), (100, 2), ("sans-serif", 14).into_font()))?;
        }
        root.present()?;
        Ok(())
    };
    drawn().map_err(|e| Failure::input(format!("figure: {e}")))
}

/// The font that text is measured with, and drawn with in bitmaps: it comes with the program.
fn fonts() -> Result<(), &'static str> {
    plotters::style::register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular())
        .map_err(|_| "the font that comes with the program cannot be read")
}
