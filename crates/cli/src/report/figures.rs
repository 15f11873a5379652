//! The figures of the page, as Plotly takes them. Colours are names that the page turns into those of its theme.

use cvg_calibration::plots::{EffectSizes, PlotData};
use cvg_calibration::report::RunReport;
use cvg_calibration::{BiasCurve, Identification};
use cvg_model::effects::EffectId;
use serde_json::{Value, json};

use super::circle;
use super::numbers::LEAST_DEG;
use super::tables::name_of_angle;
use crate::clouds::thinned;

/// One figure.
pub(super) struct Figure {
    pub(super) id: String,
    pub(super) title: String,
    /// what it shows and what to look for
    pub(super) caption: String,
    pub(super) wide: bool,
    /// series that can be switched off: mark of the series, its label
    pub(super) toggles: Vec<(String, String)>,
    traces: Vec<Value>,
    layout: Value,
}

impl Figure {
    pub(super) fn new(id: &str, title: &str, caption: impl Into<String>, traces: Vec<Value>, layout: Value) -> Self {
        let (id, title, caption) = (id.into(), title.into(), caption.into());
        Self { id, title, caption, wide: false, toggles: Vec::new(), traces, layout }
    }

    fn wide(self) -> Self {
        Self { wide: true, ..self }
    }

    /// What the page's script draws.
    pub(super) fn data(&self) -> Value {
        json!({"id": self.id, "traces": self.traces, "layout": self.layout})
    }
}

/// Markers of one stage in the figure of the bias.
const BIAS_POINTS: usize = 1200;
/// Ticks of an amplitude.
const TICKS: [f64; 13] = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.5, 2.0, 5.0, 10.0];
/// Colours of runs, in turn.
const INKS: [&str; 7] = ["@declared", "@raw", "@discovered", "@4", "@5", "@6", "@7"];

/// Every figure that the identification has the data for.
pub(super) fn all(identified: &Identification) -> Vec<Figure> {
    let channels = identified.figures.channels.iter().flat_map(circle::figures);
    let mut out: Vec<Figure> = channels.chain([bias(identified)]).collect();
    let empty = PlotData::default();
    let plots = identified.plots.as_ref().unwrap_or(&empty);
    out.extend(angle(plots, identified));
    out.extend(ring_downs(identified));
    out.extend(drive(plots));
    out.extend(harmonics(plots, name_of_angle(identified)));
    out.extend(plots.scaling.iter().filter_map(scaling));
    out.extend(residual(plots));
    out.extend(memory(plots));
    out.extend(histogram(plots));
    out.extend(temperature(&identified.report.runs));
    out.extend(correlations(plots));
    out
}

/// A number with six significant digits: what a screen can show.
fn short(value: f64) -> Value {
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    json!(rounded)
}

pub(super) fn shorts(values: impl IntoIterator<Item = f64>) -> Value {
    values.into_iter().map(short).collect()
}

pub(super) fn axis(title: &str) -> Value {
    json!({"title": {"text": title}})
}

/// An axis of errors of an angle, deg: where all of them are none, it does not show what rounding leaves.
fn errors_axis<'a>(errors: impl IntoIterator<Item = &'a f64>) -> Value {
    let mut axis = axis("angle error [deg]");
    if errors.into_iter().fold(0.0, |m: f64, e| m.max(e.abs())) < LEAST_DEG {
        axis["range"] = json!([-LEAST_DEG, LEAST_DEG]);
    }
    axis
}

/// An axis of an angle within its period, deg: ticks at multiples of 45° or 90°.
pub(super) fn angles_axis(title: &str, period_deg: f64) -> Value {
    let every = if period_deg > 200.0 { 90 } else { 45 };
    json!({"title": {"text": title}, "dtick": every, "tick0": 0})
}

/// The file's name without its folder.
pub(super) fn run_name(path: &str) -> String {
    std::path::Path::new(path).file_name().map_or_else(|| path.to_owned(), |n| n.to_string_lossy().into_owned())
}

fn bias(identified: &Identification) -> Figure {
    let curves = &identified.figures.bias;
    let total: usize = curves.iter().map(|c| c.pattern_deg.len()).sum();
    type Pick = fn(&BiasCurve) -> &Vec<f64>;
    let stages: [(&str, &str, Pick); 3] = [
        ("raw", "circle", |c| &c.raw_deg),
        ("declared", "square", |c| &c.declared_deg),
        ("discovered", "diamond", |c| &c.discovered_deg),
    ];
    let mut traces = Vec::new();
    let mut toggles = Vec::new();
    for (name, symbol, pick) in stages {
        let points = || {
            let all = curves.iter().flat_map(|c| {
                let run = run_name(&c.name);
                c.pattern_deg.iter().zip(pick(c)).map(move |(x, y)| (*x, *y, run.clone()))
            });
            thinned(all, total, BIAS_POINTS)
        };
        if points().next().is_none() {
            continue;
        }
        toggles.push((name.to_owned(), name.to_owned()));
        traces.push(json!({
            "type": "scatter", "mode": "markers", "name": name, "meta": name,
            "x": shorts(points().map(|p| p.0)), "y": shorts(points().map(|p| p.1)),
            "text": points().map(|p| p.2).collect::<Vec<_>>(),
            "marker": {"size": 4, "symbol": symbol, "color": format!("@{name}"), "opacity": 0.8},
            "hovertemplate": "%{x:.2f}°: %{y:.5f}°<br>%{text}",
        }));
    }
    let over = format!("{} [deg]", name_of_angle(identified));
    let x = angles_axis(&over, identified.calibration.hypothesis.period_rad.to_degrees());
    let y = errors_axis(curves.iter().flat_map(|c| stages.iter().flat_map(|s| s.2(c))));
    let layout = json!({"xaxis": x, "yaxis": y, "showlegend": false});
    let caption = "Angle minus the best line on held-out data, before any compensation, after the declared effects, and \
                   after all. Switch off a stage to enlarge the others. Where points of a run leave the curve, its error \
                   changes with time too.";
    Figure { toggles, ..Figure::new("bias", "Angle-dependent bias", caption, traces, layout).wide() }
}

fn angle(plots: &PlotData, identified: &Identification) -> Option<Figure> {
    let (curve, name) = (plots.angles.first()?, name_of_angle(identified));
    let t = shorts(curve.t_s.iter().copied());
    let line = |name: &str, y: &[f64], axis: &str, ink: &str| {
        json!({"type": "scatter", "mode": "lines", "name": name, "x": t, "y": shorts(y.iter().copied()),
               "yaxis": axis, "line": {"color": ink, "width": 1.6}, "hovertemplate": "%{x:.4f} s: %{y:.3f}°"})
    };
    let traces =
        vec![line(name, &curve.wrapped_deg, "y", "@declared"), line("unwrapped", &curve.unwrapped_deg, "y2", "@raw")];
    let layout = json!({
        "xaxis": axis("time [s]"), "yaxis": angles_axis(&format!("{name} [deg]"), identified.calibration.hypothesis.period_rad.to_degrees()),
        "yaxis2": {"title": {"text": "unwrapped [deg]"}, "overlaying": "y", "side": "right", "showgrid": false},
    });
    let caption = format!("As recorded in {}, the first held-out turns.", run_name(&curve.name));
    let title = format!("{}{}", name[..1].to_uppercase(), &name[1..]);
    Some(Figure::new("angle", &title, caption, traces, layout))
}

fn ring_downs(identified: &Identification) -> Option<Figure> {
    let downs = &identified.figures.ring_downs;
    if downs.is_empty() {
        return None;
    }
    let traces = downs.iter().zip(INKS.iter().cycle()).map(|(r, ink)| {
        json!({
            "type": "scatter", "mode": "lines", "line": {"color": ink, "width": 2},
            // a rounded angle below zero is not to read −0
            "name": format!("{:.0}°: τ = {:.4} ± {:.4} s", r.angle_rad.to_degrees().round() + 0.0, r.tau_s, 1.96 * r.tau_error_s),
            "x": shorts(r.decay.iter().map(|p| p.0)), "y": shorts(r.decay.iter().map(|p| p.1)),
            "hovertemplate": "%{x:.2f} s: %{y:.5f} V",
        })
    });
    let layout = json!({
        "xaxis": axis("time [s]"),
        "yaxis": {"title": {"text": "amplitude [V]"}, "type": "log", "tickvals": TICKS},
    });
    let caption = "Amplitude with the pattern held, the energy loop on and then off. Straight lines are exponential \
                   decays; their slope is the damping of that direction (run-down).";
    Some(Figure::new("ringdowns", "Ring-downs", caption, traces.collect(), layout))
}

fn drive(plots: &PlotData) -> Option<Figure> {
    // the fastest run, the slowest, and one between
    let mut drives: Vec<_> = plots.drives.iter().collect();
    drives.sort_by(|a, b| b.rate_dps.abs().total_cmp(&a.rate_dps.abs()));
    let last = drives.len().checked_sub(1)?;
    let mut shown = [0, last / 2, last].to_vec();
    shown.dedup();
    let mut traces = Vec::new();
    for (number, d) in shown.into_iter().map(|at| drives[at]).enumerate() {
        let visible = if number == 0 { json!(true) } else { json!("legendonly") };
        let run = run_name(&d.name);
        let stages = [("before", &d.before_v, "circle", "@raw"), ("after", &d.after_v, "diamond", "@discovered")];
        for (stage, values, symbol, ink) in stages {
            traces.push(json!({
                "type": "scatter", "mode": "lines+markers", "name": format!("{run}, {stage}"), "visible": visible,
                "x": shorts(d.pattern_deg.iter().copied()), "y": shorts(values.iter().copied()),
                "marker": {"size": 5, "symbol": symbol}, "line": {"width": 1.5, "color": ink},
                "hovertemplate": "%{x:.1f}°: %{y:.5f} V",
            }));
        }
    }
    let layout =
        json!({"xaxis": angles_axis("pattern angle [deg]", 180.0), "yaxis": axis("energy control output v_as [V]")});
    let caption = "As recorded, and what would hold the true amplitude with the identified electronics undone. What \
                   still depends on the angle afterwards is damping. Other runs can be switched on in the legend.";
    Some(Figure::new("drive", "Energy control over the pattern angle", caption, traces, layout).wide())
}

fn harmonics(plots: &PlotData, angle: &str) -> Option<Figure> {
    let any = plots.stages.iter().any(|(_, h)| !h.is_empty());
    let traces = plots.stages.iter().map(|(name, list)| {
        json!({
            "type": "bar", "name": name, "marker": {"color": format!("@{name}")},
            "x": list.iter().map(|h| h.n.to_string()).collect::<Vec<_>>(),
            "y": shorts(list.iter().map(|h| h.amplitude_deg)),
            "error_y": {"type": "data", "array": shorts(list.iter().map(|h| h.ci95_deg)), "color": "@muted", "width": 3},
            "hovertemplate": "harmonic %{x}: %{y:.6f}°",
        })
    });
    let mut layout = json!({
        "barmode": "group", "xaxis": axis(&format!("harmonic of the {angle}")),
        "yaxis": {"title": {"text": "amplitude [deg]"}, "type": "log", "exponentformat": "power", "dtick": 1},
    });
    // numbers of harmonics, each with a place of its own: none stands between two of them
    layout["xaxis"]["type"] = json!("category");
    let largest = plots.stages.iter().flat_map(|(_, list)| list).fold(0.0, |m: f64, h| m.max(h.amplitude_deg));
    if largest < LEAST_DEG {
        layout["yaxis"]["range"] = json!([LEAST_DEG.log10() - 1.0, LEAST_DEG.log10() + 1.0]);
    }
    let caption =
        "Of the held-out error, at each stage, with 95 % intervals. A bar no higher than its interval is noise.";
    any.then(|| Figure::new("harmonics", "Harmonics", caption, traces.collect(), layout))
}

fn residual(plots: &PlotData) -> Option<Figure> {
    let traces: Vec<Value> = plots
        .residuals
        .iter()
        .zip(INKS.iter().cycle())
        .map(|(r, ink)| {
            json!({
                "type": "scatter", "mode": "lines", "name": run_name(&r.name), "line": {"width": 0.8, "color": ink},
                "x": shorts(r.t_s.iter().copied()), "y": shorts(r.error_deg.iter().copied()),
                "hovertemplate": "%{x:.3f} s: %{y:.5f}°",
            })
        })
        .collect();
    let y = errors_axis(plots.residuals.iter().flat_map(|r| &r.error_deg));
    let layout = json!({"xaxis": axis("time [s]"), "yaxis": y});
    let caption = "What is left on held-out data; of each stretch its smallest and its largest value. It should have no \
                   shape.";
    (!traces.is_empty()).then(|| Figure::new("residual", "Residual over time", caption, traces, layout).wide())
}

fn memory(plots: &PlotData) -> Option<Figure> {
    let m = &plots.memory;
    let lags: Vec<usize> = (1..m.correlation.len()).collect();
    if lags.is_empty() {
        return None;
    }
    let end = lags.len() as f64 + 0.5;
    let traces = vec![json!({
        "type": "bar", "name": "autocorrelation", "x": lags, "y": shorts(m.correlation.iter().skip(1).copied()),
        "marker": {"color": "@declared"}, "hovertemplate": "lag %{x}: %{y:.4f}",
    })];
    let layout = json!({
        "xaxis": axis("lag [samples]"), "yaxis": axis("correlation"), "showlegend": false,
        "shapes": [{"type": "rect", "x0": 0.5, "x1": end, "y0": -m.band99, "y1": m.band99, "fillcolor": "@band",
                    "line": {"width": 1, "color": "@muted", "dash": "dot"}}],
    });
    let caption =
        format!("Of the residual. White noise stays within the band, ± {:.4}, at 99 % of the lags.", m.band99);
    Some(Figure::new("autocorrelation", "Autocorrelation", caption, traces, layout))
}

fn histogram(plots: &PlotData) -> Option<Figure> {
    let h = &plots.histogram;
    if h.count.is_empty() {
        return None;
    }
    let x = shorts(h.middle_deg.iter().copied());
    let traces = vec![
        json!({"type": "bar", "name": "residual", "x": x, "y": h.count, "marker": {"color": "@discovered"},
               "hovertemplate": "%{x:.5f}°: %{y}"}),
        json!({"type": "scatter", "mode": "lines", "name": "normal", "x": x, "y": shorts(h.normal.iter().copied()),
               "line": {"color": "@raw", "width": 2}, "hovertemplate": "%{x:.5f}°: %{y:.1f}"}),
    ];
    let layout = json!({"bargap": 0, "xaxis": errors_axis(&h.middle_deg), "yaxis": axis("samples")});
    let caption = "Of the residual, beside a normal distribution of the same mean square.";
    Some(Figure::new("histogram", "Distribution", caption, traces, layout))
}

/// Size of one effect over rate and over amplitude, each reduced by its own law to the other's middle.
fn scaling(sizes: &EffectSizes) -> Option<Figure> {
    let runs = &sizes.runs;
    let middle = |of: fn(&cvg_calibration::plots::EffectSize) -> f64| {
        let logs: Vec<f64> = runs.iter().map(of).filter(|v| *v > 0.0).map(f64::ln).collect();
        (!logs.is_empty()).then(|| (logs.iter().sum::<f64>() / logs.len() as f64).exp())
    };
    let rate_0 = middle(|r| r.rate_dps.abs())?;
    let amplitude_0 = middle(|r| r.amplitude_v)?;
    let id = sizes.id.description().id;
    let (p, q) = (i32::from(sizes.scaling.rate), i32::from(sizes.scaling.amplitude));
    let mut traces = Vec::new();
    let names: Vec<String> = runs.iter().map(|r| run_name(&r.name)).collect();
    type Of = Box<dyn Fn(&cvg_calibration::plots::EffectSize) -> f64>;
    let panels: [(&str, Of, Of, i32, f64); 2] = [
        ("", Box::new(|r| r.rate_dps.abs()), Box::new(move |r| (r.amplitude_v / amplitude_0).powi(-q)), p, rate_0),
        ("2", Box::new(|r| r.amplitude_v), Box::new(move |r| (r.rate_dps.abs() / rate_0).powi(-p)), q, amplitude_0),
    ];
    for (panel, x, reduce, power, x_0) in &panels {
        let (xa, ya) = (format!("x{panel}"), format!("y{panel}"));
        let xs: Vec<f64> = runs.iter().map(x).collect();
        traces.push(json!({
            "type": "scatter", "mode": "markers", "name": "each run alone", "legendgroup": "m", "showlegend": panel.is_empty(),
            "xaxis": xa, "yaxis": ya, "x": shorts(xs.iter().copied()), "text": names,
            "y": shorts(runs.iter().map(|r| r.measured_deg[0] * reduce(r))),
            "error_y": {"type": "data", "array": shorts(runs.iter().map(|r| r.measured_deg[1] * reduce(r))), "color": "@muted"},
            "marker": {"size": 8, "color": "@declared", "symbol": "circle"},
            "hovertemplate": "%{text}<br>%{x:.4g}: %{y:.3g}°",
        }));
        let level = runs.iter().map(|r| {
            (r.fitted_deg * reduce(r)).max(f64::MIN_POSITIVE).ln()
                - f64::from(*power) * (x(r) / x_0).max(f64::MIN_POSITIVE).ln()
        });
        let level = (level.sum::<f64>() / runs.len() as f64).exp();
        let (lo, hi) = xs.iter().fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
        let (lo, hi) = if lo < 0.98 * hi { (lo, hi) } else { (0.9 * lo, 1.1 * hi) };
        let law: Vec<f64> = (0..=24).map(|i| lo * (hi / lo).powf(f64::from(i) / 24.0)).collect();
        traces.push(json!({
            "type": "scatter", "mode": "lines", "name": "its law", "legendgroup": "l", "showlegend": panel.is_empty(),
            "xaxis": xa, "yaxis": ya, "x": shorts(law.iter().copied()),
            "y": shorts(law.iter().map(|x| level * (x / x_0).powi(*power))),
            "line": {"color": "@raw", "dash": "dash", "width": 2}, "hoverinfo": "skip",
        }));
    }
    let y = json!({"title": {"text": "size in the angle [deg]"}, "rangemode": "tozero"});
    let layout = json!({
        "xaxis": {"title": {"text": "rate [deg/s]"}, "domain": [0.0, 0.46]}, "yaxis": y,
        "xaxis2": {"title": {"text": "amplitude [V]"}, "domain": [0.57, 1.0], "anchor": "y2"},
        "yaxis2": {"rangemode": "tozero", "anchor": "x2"},
    });
    let law = |power: i32, of: &str| match power {
        0 => format!("does not depend on the {of}"),
        1 => format!("grows with the {of}"),
        -1 => format!("falls as one over the {of}"),
        n => format!("goes as the {of} to the power {n}"),
    };
    let through = if sizes.id == EffectId::Anisoelasticity {
        " It acts through the quadrature that the loop leaves, so the law is a rough one."
    } else {
        ""
    };
    let caption = format!(
        "{}: by its definition it {} and {}.{through} Each point is what one run alone says of it, with its 95 % interval; below zero it says \
         the opposite.",
        sizes.id.description().title,
        law(p, "rate"),
        law(q, "amplitude")
    );
    (runs.len() > 1)
        .then(|| Figure::new(&format!("scaling-{id}"), &format!("Scaling of {id}"), caption, traces, layout))
}

/// Gain and bias of runs over their temperatures, and the gain ratio.
pub(super) fn temperature(runs: &[RunReport]) -> Option<Figure> {
    let warm: Vec<(f64, &RunReport)> = runs.iter().filter_map(|r| Some((r.temp_c?, r))).collect();
    type Told = fn(&RunReport) -> Option<(f64, f64)>;
    let told: [(&str, Told); 3] = [
        ("k", |r| r.angular_gain.map(|e| (e.value, e.half_width()))),
        ("bias [deg/s]", |r| r.bias_dps.map(|e| (e.value, e.half_width()))),
        ("G<sub>Dy</sub>/G<sub>Dx</sub>", |r| r.detection_gain_ratio.map(|v| (v, 0.0))),
    ];
    let panels: Vec<_> = told
        .into_iter()
        .map(|(name, of)| {
            (name, warm.iter().filter_map(|(t, r)| Some((*t, of(r)?, run_name(&r.file)))).collect::<Vec<_>>())
        })
        .filter(|(_, points)| points.len() > 1)
        .collect();
    let share = 1.0 / panels.len().max(1) as f64;
    let mut layout = json!({"showlegend": false, "height": 150 * panels.len() + 60});
    let mut traces = Vec::new();
    for (at, ((name, points), ink)) in panels.iter().zip(INKS).enumerate() {
        let number = if at == 0 { String::new() } else { (at + 1).to_string() };
        // the first at the top, all over the axis of the last
        let top = 1.0 - share * at as f64;
        let mut y = axis(name);
        y["domain"] = json!([top - 0.82 * share, top]);
        layout[format!("yaxis{number}")] = y;
        traces.push(json!({
            "type": "scatter", "mode": "markers", "name": name, "xaxis": "x", "yaxis": format!("y{number}"),
            "x": shorts(points.iter().map(|p| p.0)), "y": points.iter().map(|p| exact(p.1.0)).collect::<Vec<_>>(),
            "error_y": {"type": "data", "array": shorts(points.iter().map(|p| p.1.1)), "color": "@muted"},
            "text": points.iter().map(|p| p.2.clone()).collect::<Vec<_>>(), "marker": {"size": 8, "color": ink},
            "hovertemplate": "%{text}<br>%{x:.2f} °C: %{y}<extra></extra>",
        }));
    }
    let last = if panels.len() > 1 { format!("y{}", panels.len()) } else { "y".to_owned() };
    layout["xaxis"] = json!({"title": {"text": "mean temperature of the run [°C]"}, "anchor": last});
    let caption = "What each run tells by itself, with its 95 % interval, over its temperature. Slopes with their intervals stand \
                   under Temperature.";
    (!panels.is_empty()).then(|| Figure::new("temperature", "Temperature", caption, traces, layout).wide())
}

/// A number with ten significant digits: what differs little from run to run is to be seen.
fn exact(value: f64) -> Value {
    let rounded: f64 = format!("{value:.9e}").parse().unwrap_or(value);
    json!(rounded)
}

fn correlations(plots: &PlotData) -> Option<Figure> {
    let c = &plots.correlations;
    if c.names.len() < 2 {
        return None;
    }
    // parameters have names of their own, the effect in front of them is not needed
    let short = |name: &str| match name.split_once(' ') {
        Some((id, parameter)) if EffectId::from_id(id).is_some() => parameter.to_owned(),
        _ => name.to_owned(),
    };
    let names: Vec<String> = c.names.iter().map(|n| short(n)).collect();
    let cells = || c.rows.iter().enumerate().flat_map(|(i, row)| row.iter().enumerate().map(move |(j, v)| (i, j, *v)));
    let shapes: Vec<Value> = cells().map(|(i, j, v)| cell(i, j, v)).collect();
    // what is pointed at is said by points that nobody sees
    let traces = vec![json!({
        "type": "scatter", "mode": "markers", "x": cells().map(|(_, j, _)| j).collect::<Vec<_>>(),
        "y": cells().map(|(i, ..)| i).collect::<Vec<_>>(), "marker": {"size": 16, "opacity": 0},
        "text": cells().map(|(i, j, v)| format!("{}<br>{}<br>{v:.3}", names[j], names[i])).collect::<Vec<_>>(),
        "hovertemplate": "%{text}<extra></extra>",
    })];
    let places: Vec<usize> = (0..names.len()).collect();
    let end = names.len() as f64 - 0.5;
    let layout = json!({
        "xaxis": {"tickangle": -40, "showgrid": false, "zeroline": false, "tickvals": places, "ticktext": names,
                  "range": [-0.5, end]},
        "yaxis": {"showgrid": false, "zeroline": false, "tickvals": places, "ticktext": names, "range": [end, -0.5]},
        "margin": {"l": 170, "r": 16, "t": 16, "b": 130}, "shapes": shapes, "showlegend": false,
    });
    let caption = "Of everything that was fitted: blue where two go together, red where one goes against the other, the fuller \
                   the closer to ±1, where the data tell only a combination of the two.";
    Some(Figure::new("correlations", "Correlations", caption, traces, layout).wide())
}

/// A correlation as a rectangle, the fuller the stronger.
fn cell(row: usize, column: usize, value: f64) -> Value {
    let (x, y) = (column as f64, row as f64);
    json!({
        "type": "rect", "layer": "below", "x0": x - 0.48, "x1": x + 0.48, "y0": y - 0.48, "y1": y + 0.48,
        "fillcolor": if value < 0.0 { "@raw" } else { "@declared" }, "opacity": short(value.abs().min(1.0)),
        "line": {"width": 0},
    })
}
