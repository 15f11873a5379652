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
        let ((x0, x1), (y0, y1)) = (span(|p| p.0), span(|p| p.1));
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

/// The font that text is measured with, and drawn with in bitmaps: it comes with the program.
fn fonts() -> Result<(), &'static str> {
    plotters::style::register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular())
        .map_err(|_| "the font that comes with the program cannot be read")
}
