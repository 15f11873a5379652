//! What two channels draw against each other, with a reference and without.

use cvg_calibration::Curve;
use serde_json::json;

use super::figures::{Figure, angles_axis, axis, shorts};

/// The closed curve of the channels, and its radius.
pub(super) fn figures(curve: &Curve) -> [Figure; 2] {
    [circle(curve), radius(curve)]
}

fn circle(curve: &Curve) -> Figure {
    let points = |name: &str, symbol: &str, points: &[[f64; 2]]| {
        json!({"type": "scatter", "mode": "markers", "name": name, "meta": name,
               "x": shorts(points.iter().map(|p| p[0])), "y": shorts(points.iter().map(|p| p[1])),
               "marker": {"size": 4, "symbol": symbol, "color": format!("@{name}"), "opacity": 0.8}})
    };
    let turn = || (0..=180).map(|i| f64::from(i) * std::f64::consts::PI / 90.0);
    let circle = json!({"type": "scatter", "mode": "lines", "name": "circle", "x": shorts(turn().map(f64::cos)),
                        "y": shorts(turn().map(f64::sin)), "line": {"color": "@4", "width": 1.2}});
    let traces = vec![points("raw", "circle", &curve.before), points("discovered", "diamond", &curve.after), circle];
    let mut layout =
        json!({"xaxis": axis("x over the mean radius"), "yaxis": axis("y over the mean radius"), "showlegend": true});
    layout["yaxis"]["scaleanchor"] = json!("x");
    layout["xaxis"]["constrain"] = json!("domain");
    let caption = "The two channels against each other on held-out rows: as recorded, with what was found undone, and the \
                   circle that a sensor without errors draws.";
    Figure::new("circle", "X and Y", caption, traces, layout)
}

fn radius(curve: &Curve) -> Figure {
    let points = |name: &str, symbol: &str, points: &[[f64; 2]]| {
        json!({"type": "scatter", "mode": "markers", "name": name, "meta": name,
               "x": shorts(points.iter().map(|[x, y]| y.atan2(*x).to_degrees())),
               "y": shorts(points.iter().map(|[x, y]| 100.0 * (x.hypot(*y) - 1.0))),
               "marker": {"size": 4, "symbol": symbol, "color": format!("@{name}"), "opacity": 0.8}})
    };
    let traces = vec![points("raw", "circle", &curve.before), points("discovered", "diamond", &curve.after)];
    let x = angles_axis("angle [deg]", 360.0);
    let layout = json!({"xaxis": x, "yaxis": axis("radius less its mean [%]"), "showlegend": true});
    let caption = "The radius over the angle: once a turn is an offset, twice a gain or a skew, four times a cubic.";
    Figure::new("radius", "Radius", caption, traces, layout)
}
