//! The report of what was told without a reference: what two channels draw, and how far an angle at rest wanders.

use std::fmt::Write as _;

use cvg_calibration::Surveyed;
use cvg_calibration::report::survey::{Survey, VirtualPrecession};
use cvg_calibration::report::{Allan, Estimate};
use serde_json::json;

use super::circle;
use super::figures::{self, Figure, axis, shorts};
use super::numbers::{Shown, degrees, estimated, interval, measured, significant, times};
use super::tables::{parameter, row, runs, table, temperature};
use super::{begin, draw, escape, finish, warnings};
use crate::Failure;

/// The page.
pub(crate) fn page(surveyed: &Surveyed) -> Result<String, Failure> {
    let r = &surveyed.report;
    let figures: Vec<Figure> = surveyed
        .curve
        .iter()
        .flat_map(circle::figures)
        .chain(r.allan.as_ref().map(deviation))
        .chain(figures::temperature(&r.runs))
        .collect();
    let mut h = String::with_capacity(2 << 20);
    begin(&mut h, &r.device, r.instrument);
    headline(&mut h, r);
    warnings(&mut h, &r.warnings);
    h.push_str("</header><main>");
    parameters(&mut h, r);
    effects(&mut h, r);
    without_a_table(&mut h, r);
    draw(&mut h, "<p>The figures need scripts, which this file brings along.</p>", &figures);
    runs(&mut h, &r.runs);
    temperature(&mut h, r.temperature.as_ref());
    files(&mut h, r);
    let json = serde_json::to_string_pretty(r).map_err(Failure::input)?;
    finish(
        &mut h,
        ["report.json", &json],
        r.schema,
        "There is no angle error: nothing was recorded to count it against.",
        &figures,
    )?;
    Ok(h)
}

fn headline(h: &mut String, r: &Survey) {
    if let Some(radius) = &r.radius {
        let [before, after] = [radius.before.rms, radius.after.rms].map(|v| format!("{:.3} %", 100.0 * v));
        let angle = radius
            .correction_rms_deg
            .map_or(String::new(), |d| format!(" Undoing it changes the angle by {} rms.", degrees(d)));
        let _ = write!(
            h,
            "<p class=\"headline\">{before} <span class=\"arrow\">→</span> {after} rms of the radius, {}</p><p \
             class=\"finding\">A sensor without a reference: the radius of its two channels, on rows that nothing was fitted \
             to, as recorded and with what was found undone.{angle}</p>",
            times(radius.before.rms, radius.after.rms)
        );
    }
    if let Some(v) = &r.virtual_precession {
        let _ = write!(h, "<p class=\"headline\">{}</p>", escape(&headline_without_a_table(v)));
        let _ = write!(h, "<p class=\"finding\">{}</p>", escape(&seconds_in_words(v)));
    }
    if let Some(allan) = &r.allan {
        let _ = write!(h, "<p class=\"finding\">At rest:{}.</p>", escape(&allan_in_words(allan).join(";")));
    }
}

fn parameters(h: &mut String, r: &Survey) {
    h.push_str("<h2 id=\"parameters\">Parameters</h2>");
    table(h, "Values with 95 % intervals", &["parameter", "value", "95 % interval", "unit"], |h| {
        let mut estimate = |name: &str, e: Option<&Estimate>, unit: &str| {
            if let Some(e) = e {
                let [value, low, high] = interval(e.value, e.ci95);
                row(h, &[name, &value, &format!("{low} … {high}"), unit]);
            }
        };
        estimate("detection gain ratio G<sub>Dy</sub>/G<sub>Dx</sub>", r.detection_gain_ratio.as_ref(), "1");
        estimate("actuation gain ratio G<sub>Ax</sub>/G<sub>Ay</sub>", r.actuation_gain_ratio.as_ref(), "1");
        if let Some(a) = &r.allan {
            estimate("angle random walk", a.angle_random_walk_deg_sqrt_h.as_ref(), "deg/√h");
            estimate("bias instability", Some(&a.bias_instability_dph), "deg/h");
        }
        for p in r.virtual_precession.iter().flat_map(|v| &v.parameters) {
            let ends = p.ci95.map(|c| interval(p.value, c));
            let (value, ends) = ends
                .map_or((significant(p.value), "not shown to hold".to_owned()), |[v, low, high]| {
                    (v, format!("{low} … {high}"))
                });
            row(h, &[&escape(&p.name), &value, &ends, &escape(&p.unit)]);
        }
        let once = |name: &str| match name {
            "detection_gain_ratio" => r.detection_gain_ratio.is_none(),
            "actuation_gain_ratio" => r.actuation_gain_ratio.is_none(),
            _ => true,
        };
        let all = r.effects.iter().flat_map(|e| e.parameters.iter().map(move |p| (e, p)));
        for (e, p) in all.filter(|(_, p)| once(&p.name)) {
            parameter(h, e, p, "as it was read");
        }
    });
}

fn effects(h: &mut String, r: &Survey) {
    if r.effects.is_empty() {
        return;
    }
    h.push_str("<h2 id=\"effects\">Effects</h2>");
    table(h, "What the data supports", &["effect", "evidence"], |h| {
        for e in &r.effects {
            let _ = write!(h, "<tr><td>{}</td><td class=\"why\">{}</td></tr>", escape(&e.id), escape(&e.evidence));
        }
    });
}

/// What the filter left unpredicted, and what nothing told.
fn without_a_table(h: &mut String, r: &Survey) {
    let Some(v) = &r.virtual_precession else { return };
    h.push_str("<h2 id=\"not-identifiable\">Not identifiable from this campaign</h2>");
    table(h, "and which run would tell it", &["what", "separated by"], |h| {
        for n in &v.not_identifiable {
            row(h, &[&escape(&n.what), &escape(&n.separated_by)]);
        }
    });
    h.push_str("<h2 id=\"innovations\">What was not predicted</h2>");
    let heads = ["channel", "rms [rad]", "of it white [rad]", "cycles"];
    table(h, "Rows that nothing was fitted to", &heads, |h| {
        for i in &v.heldout {
            let [rms, noise] = [i.rms_rad, i.noise_rad].map(|v| format!("{v:.1e}"));
            row(h, &[&escape(&i.channel), &rms, &noise, &i.cycles.to_string()]);
        }
    });
}

fn headline_without_a_table(v: &VirtualPrecession) -> String {
    if v.detection_known {
        format!("Told without a table: the detection may still make {} of bias, rms", degrees(v.bias_deg))
    } else {
        "Detection and actuation cannot be separated".to_owned()
    }
}

fn seconds_in_words(v: &VirtualPrecession) -> String {
    let [rest, turning] = v.seconds;
    format!("{rest:.0} s of precession at rest, {turning:.0} s turning")
}

fn files(h: &mut String, r: &Survey) {
    h.push_str("<h2 id=\"files\">Files</h2>");
    table(h, "Recordings", &["file", "kind", "used for", "rows", "rate at rest [deg/s]"], |h| {
        for x in &r.runs {
            let rate = x.bias_dps.map_or("—".into(), |b| format!("{:.3e} ± {:.1e}", b.value, b.half_width()));
            row(h, &[&escape(&x.file), &x.kind, &x.r#use, &x.rows.to_string(), &rate]);
        }
    });
}

/// Ticks of a logarithmic axis: powers of ten alone over two decades and more, and 1, 2 and 5 over less. All digits have no room below
/// each other.
fn ticks(values: impl Iterator<Item = f64>) -> usize {
    /// How much longer an axis is than what it shows.
    const MARGIN: f64 = 1.12;
    let (low, high) =
        values.filter(|v| *v > 0.0).fold((f64::INFINITY, 0.0f64), |(low, high), v| (low.min(v), high.max(v)));
    let decades = if high > low { MARGIN * (high / low).log10() } else { 0.0 };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few decades")]
    let whole = decades as usize;
    (whole + 1).max(3)
}

/// The Allan deviation over the averaging time.
fn deviation(allan: &Allan) -> Figure {
    let half = |i: usize| -> Vec<f64> {
        allan
            .points
            .iter()
            .map(|p| if i == 0 { p.deviation_dph - p.ci95[0] } else { p.ci95[1] - p.deviation_dph })
            .collect()
    };
    let traces = vec![json!({"type": "scatter", "mode": "lines+markers", "name": "Allan deviation",
        "x": shorts(allan.points.iter().map(|p| p.tau_s)), "y": shorts(allan.points.iter().map(|p| p.deviation_dph)),
        "error_y": {"type": "data", "symmetric": false, "array": shorts(half(1)), "arrayminus": shorts(half(0))},
        "marker": {"size": 5, "color": "@declared"}, "line": {"color": "@declared", "width": 1.4}})];
    let mut layout =
        json!({"xaxis": axis("averaging time [s]"), "yaxis": axis("deviation [deg/h]"), "showlegend": false});
    layout["xaxis"]["type"] = json!("log");
    layout["yaxis"]["type"] = json!("log");
    layout["yaxis"]["nticks"] = json!(ticks(allan.points.iter().flat_map(|p| p.ci95)));
    let caption = "Overlapping Allan deviation at rest, with 95 % intervals: −1 is noise of the angle, −½ angle random walk, \
                   flat bias instability, +½ a random walk of the rate.";
    Figure::new("allan", "Allan deviation", caption, traces, layout)
}

/// The Allan deviation in a line or two of a summary.
pub(crate) fn allan_in_words(allan: &Allan) -> Vec<String> {
    let told = |e: &Estimate, unit: &str| format!("{} {unit}", estimated(e));
    let walk = allan.angle_random_walk_deg_sqrt_h.as_ref().map_or("none seen".to_owned(), |e| told(e, "deg/√h"));
    vec![
        format!("  angle random walk           {walk}"),
        format!(
            "  bias instability            {} at {} s",
            told(&allan.bias_instability_dph, "deg/h"),
            significant(allan.bias_instability_tau_s)
        ),
    ]
}

/// What a person wants to read first.
pub(crate) fn summary(r: &Survey) -> String {
    let mut s = format!("{} ({})\n", r.device, r.instrument);
    let mut line = |text: String| {
        let _ = writeln!(s, "{text}");
    };
    if let Some(radius) = &r.radius {
        line(format!(
            "  held-out radius, rms        {:.4} % as recorded → {:.4} %",
            100.0 * radius.before.rms,
            100.0 * radius.after.rms
        ));
        if let Some(d) = radius.correction_rms_deg {
            line(format!("  which changes the angle by  {d:.5}° rms"));
        }
    }
    if let Some(v) = &r.virtual_precession {
        line(format!("  {}", headline_without_a_table(v)));
        line(format!("  {}", seconds_in_words(v)));
        for p in &v.parameters {
            let unit = if p.unit == "1" { "" } else { &p.unit };
            line(format!("  {:<26} {} {unit}", p.name, measured(p.value, p.ci95)).trim_end().to_owned());
        }
        for n in &v.not_identifiable {
            line(format!("  not identifiable: {}; it takes {}", n.what, n.separated_by));
        }
    }
    for e in &r.effects {
        let parameters = e.parameters.iter().map(|p| Shown::of(e, p).in_words());
        line(format!("  {:<26} {}", e.id, parameters.collect::<Vec<_>>().join(", ")));
    }
    r.allan.iter().flat_map(allan_in_words).for_each(&mut line);
    for w in &r.warnings {
        line(format!("  warning: {w}"));
    }
    s
}

#[cfg(test)]
mod tests {
    use super::ticks;

    #[test]
    fn a_logarithmic_axis_has_no_more_ticks_than_leave_room_for_their_digits() {
        // below 0.3 decades a tick every digit is written, above 0.7 none between powers of ten
        for (low, high) in [(1.0, 1.5), (1.0, 11.0), (0.5, 20.0), (1.0, 900.0), (1e-4, 1e3)] {
            let decades: f64 = f64::log10(high / low) / ticks([low, high].into_iter()) as f64;
            assert!(decades < 0.3 && high / low < 10.0 || decades > 0.3 && decades < 1.0, "{low} to {high}: {decades}");
        }
        assert_eq!(ticks(std::iter::empty()), 3);
    }
}
