//! The tables of the page.

use std::fmt::Write as _;

use cvg_calibration::Identification;
use cvg_calibration::report::{Estimate, Report};

use super::escape;
use super::figures::run_name;
use super::finding::interval;
use super::further::{Number, further};
use crate::commands::significant;
use crate::standard;

/// Correlations that a reader should know of.
const STRONG: f64 = 0.5;

pub(super) fn all(h: &mut String, identified: &Identification) {
    let r = &identified.report;
    parameters(h, identified);
    effects(h, r);
    steps(h, identified);
    left(h, r);
    words(h, r);
    files(h, r);
}

/// A table with a header; `rows` writes its rows.
pub(super) fn table(h: &mut String, label: &str, columns: &[&str], rows: impl FnOnce(&mut String)) {
    let _ = write!(
        h,
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{0}\"><table><caption>{0}</caption><thead><tr>",
        escape(label)
    );
    for c in columns {
        let _ = write!(h, "<th scope=\"col\">{c}</th>");
    }
    h.push_str("</tr></thead><tbody>");
    rows(h);
    h.push_str("</tbody></table></div>");
}

pub(super) fn row(h: &mut String, cells: &[&str]) {
    h.push_str("<tr>");
    for (i, c) in cells.iter().enumerate() {
        let class = if i == 0 || c.len() > 60 { "" } else { " class=\"n\"" };
        let _ = write!(h, "<td{class}>{c}</td>");
    }
    h.push_str("</tr>");
}

fn parameters(h: &mut String, identified: &Identification) {
    let r = &identified.report;
    h.push_str("<h2 id=\"parameters\">Parameters</h2>");
    table(h, "Values with 95 % intervals", &["parameter", "value", "95 % interval", "unit"], |h| {
        let mut estimate = |name: &str, e: Option<&Estimate>| match e {
            Some(e) => {
                let [value, low, high] = interval(e.value, e.ci95);
                row(h, &[name, &value, &format!("{low} … {high}"), "1"]);
            }
            None => row(h, &[name, "not told by this campaign", "", "1"]),
        };
        estimate("angular gain k (scale factor)", Some(&r.angular_gain).filter(|k| k.is_told()));
        estimate("detection gain ratio G<sub>Dy</sub>/G<sub>Dx</sub>", r.detection_gain_ratio.as_ref());
        if r.instrument == "gyroscope" {
            estimate("actuation gain ratio G<sub>Ax</sub>/G<sub>Ay</sub>", r.actuation_gain_ratio.as_ref());
        }
        for Number { name, value, unit } in further(r) {
            let [value, low, high] = interval(value.value, value.ci95);
            row(h, &[name, &value, &format!("{low} … {high}"), unit]);
        }
        for (e, p) in r.effects.iter().flat_map(|e| e.parameters.iter().map(move |p| (e, p))) {
            let name = format!("{}: {}", escape(&e.id), escape(&p.name));
            let (value, ends) = match p.ci95.map(|c| interval(p.value, c)) {
                Some([value, low, high]) => (value, format!("{low} … {high}")),
                None => (significant(p.value), "set by a search".to_owned()),
            };
            row(h, &[&name, &value, &ends, &escape(&p.unit)]);
        }
    });
    let Some(c) = identified.plots.as_ref().map(|p| &p.correlations) else { return };
    let mut strong: Vec<(f64, &str, &str)> = Vec::new();
    for i in 0..c.names.len() {
        strong.extend((0..i).map(|j| (c.rows[i][j], c.names[j].as_str(), c.names[i].as_str())));
    }
    strong.retain(|s| s.0.abs() >= STRONG);
    strong.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    if strong.is_empty() {
        let _ = write!(h, "<p>No two parameters are correlated by {STRONG} or more.</p>");
        return;
    }
    table(h, "Correlations of 0.5 and more", &["of", "and", "correlation"], |h| {
        for (value, one, other) in strong {
            row(h, &[&escape(one), &escape(other), &format!("{value:+.3}")]);
        }
    });
}

fn effects(h: &mut String, r: &Report) {
    h.push_str("<h2 id=\"effects\">Effects</h2>");
    let columns =
        ["effect", "origin", "held-out rms [deg]", "evidence", "confounded with, and the run that would tell"];
    table(h, "What the data supports", &columns, |h| {
        for e in &r.effects {
            let change = e.heldout_rms_deg.map(|b| format!("{:.5} → {:.5}", b.before, b.after)).unwrap_or_default();
            let confounded = if e.confounded_with.is_empty() {
                "—".to_owned()
            } else {
                let separated = escape(e.separated_by.as_deref().unwrap_or("another run"));
                format!("{}: {separated}", escape(&e.confounded_with.join(", ")))
            };
            let origin = format!("{:?}", e.origin).to_lowercase();
            let _ = write!(
                h,
                "<tr><td>{}</td><td>{origin}</td><td class=\"n\">{change}</td><td class=\"why\">{}</td><td>{confounded}</td></tr>",
                escape(&e.id),
                escape(&e.evidence)
            );
        }
    });
}

fn steps(h: &mut String, identified: &Identification) {
    if identified.steps.is_empty() {
        h.push_str("<p>No effect was added to the declared model.</p>");
        return;
    }
    let columns = ["effect", "gain in 2 ln likelihood", "rivals", "held-out rms before [deg]", "after [deg]"];
    table(h, "Steps of the search, in order", &columns, |h| {
        for s in &identified.steps {
            let rivals: Vec<String> = s.rivals.iter().map(|(id, gain)| format!("{id} {gain:.0}")).collect();
            let [before, after] = s.heldout_rms_deg.map(|v| format!("{v:.5}"));
            let rivals = if rivals.is_empty() { "—".into() } else { rivals.join(", ") };
            row(h, &[&s.id.to_string(), &format!("{:.0}", s.gain), &rivals, &before, &after]);
        }
    });
}

fn left(h: &mut String, r: &Report) {
    let memory = if r.residual.white { "no memory" } else { "some memory" };
    let _ = write!(h, "<h2 id=\"left\">What is left</h2><p>Ljung–Box at 1 %: {memory} in the residual.</p>");
    shares(h, r);
    if r.unexplained.is_empty() {
        h.push_str("<p>Nothing that asks for an explanation.</p>");
    } else {
        let columns = ["class", "harmonic", "frequency [Hz]", "rms [deg]", "suggestion"];
        table(h, "Without an explanation", &columns, |h| {
            for u in &r.unexplained {
                let n = u.n.map_or("—".into(), |n| n.to_string());
                let f = u.frequency_hz.map_or("—".into(), |f| format!("{f:.5}"));
                row(h, &[&escape(&u.class), &n, &f, &format!("{:.5}", u.rms_deg), &escape(&u.suggestion)]);
            }
        });
    }
    proposals(h, r);
    if !r.channels.is_empty() {
        let columns = ["channel", "stage", "rms", "unit", "memory", "line in time [Hz]", "slow change, rms"];
        table(h, "Channels of the fitted runs", &columns, |h| {
            for c in &r.channels {
                let line = c.line.map_or("—".to_owned(), |l| format!("{:.4}", l.frequency_hz));
                let drift = c.drift_rms.map_or("—".to_owned(), |v| format!("{v:.2e}"));
                let memory = if c.white { "none" } else { "some" };
                let rms = format!("{:.3e}", c.rms);
                row(h, &[&escape(&c.channel), &escape(&c.stage), &rms, &escape(&c.unit), memory, &line, &drift]);
            }
        });
    }
    let columns = ["of", "n", "amplitude [deg]", "95 % of a component [deg]", "phase [deg]"];
    table(h, "Harmonics of the residual", &columns, |h| {
        for x in &r.residual.harmonics {
            let of = format!("{:?}", x.of).to_lowercase();
            let amplitude = format!("{:.6}", x.amplitude_deg);
            let interval = format!("± {:.6}", x.ci95_deg);
            row(h, &[&of, &x.n.to_string(), &amplitude, &interval, &format!("{:.0}", x.phase_deg)]);
        }
    });
}

/// What the error that the declared model leaves is a function of.
fn shares(h: &mut String, r: &Report) {
    if r.decomposition.is_empty() {
        return;
    }
    table(h, "What the declared model's residual follows", &["it follows", "share of its variance", "95 %"], |h| {
        for s in &r.decomposition {
            let [low, high] = s.ci95.map(|v| format!("{:.1} %", 100.0 * v));
            row(h, &[&escape(&s.of), &format!("{:.1} %", 100.0 * s.share), &format!("{low} … {high}")]);
        }
    });
}

/// The facts under the names that IEEE Std 1431 has for them.
fn words(h: &mut String, r: &Report) {
    h.push_str("<h2 id=\"standard\">In the words of IEEE Std 1431</h2>");
    table(h, "Terms of the standard", &["term", "here", "value"], |h| {
        for entry in standard::entries(r) {
            row(h, &[entry.term, &escape(entry.here), &escape(&entry.value)]);
        }
    });
}

fn files(h: &mut String, r: &Report) {
    h.push_str("<h2 id=\"files\">Files</h2>");
    let columns = ["file", "kind", "use", "rows", "rate [deg/s]", "run-down τ [s]", "rows dropped, and why"];
    table(h, "Recordings that were read", &columns, |h| {
        for x in &r.runs {
            let rate = match x.rate_dps {
                // a rotation whose mean is nothing went there and back
                Some(v) if x.kind == "rotation" && v.abs() < 0.005 => "both ways".to_owned(),
                Some(v) => format!("{v:.2}"),
                None => "—".to_owned(),
            };
            let tau = x.tau_s.map_or("—".into(), |t| format!("{:.4} ± {:.4}", t.value, t.half_width()));
            let dropped = if x.dropped.is_empty() { "none".into() } else { escape(&x.dropped.join("; ")) };
            let rows = x.rows.to_string();
            row(h, &[&escape(&run_name(&x.file)), &x.kind, &x.r#use, &rows, &rate, &tau, &dropped]);
        }
    });
}

/// What is described and not explained, as laws.
fn proposals(h: &mut String, r: &Report) {
    if r.proposals.is_empty() {
        return;
    }
    let columns = ["proposal", "what it is", "size [deg]", "goes with", "channels", "stage that this means"];
    table(h, "Laws without a cause, each with an effect as text that reproduces it", &columns, |h| {
        for p in &r.proposals {
            let Some(law) = &p.law else { continue };
            let power = |of: &str, e: Option<[f64; 2]>| e.map(|[low, high]| format!("{of}^({low:.2} … {high:.2})"));
            let turns = law.turns_with_direction.filter(|t| *t).map(|_| "the direction".to_owned());
            let goes = [power("rate", law.rate), power("amplitude", law.amplitude), turns];
            let goes: Vec<String> = goes.into_iter().flatten().collect();
            let stage = format!("{}: {}", law.stage, law.meaning);
            let size = format!("{:.5}", law.size_deg);
            let channels = law.channels.join(", ");
            row(
                h,
                &[
                    &escape(&p.id),
                    &escape(&p.summary),
                    &size,
                    &escape(&goes.join(", ")),
                    &escape(&channels),
                    &escape(&stage),
                ],
            );
        }
    });
}
