//! The tables of the page.

use std::fmt::Write as _;

use cvg_calibration::Identification;
use cvg_calibration::report::{EffectReport, Estimate, ParameterReport, Report, RunReport, Share, Temperature};
use cvg_model::effects::EffectId;

use super::escape;
use super::figures::run_name;
use super::further::{Number, further};
use super::numbers::{NOT_IDENTIFIABLE, Shown, estimated, interval, significant};
use crate::standard;

/// Correlations that a reader should know of.
const STRONG: f64 = 0.5;
/// Periods beyond this are a whole turn, and no pattern's half.
pub(crate) const WHOLE_TURN_RAD: f64 = 4.0;

/// A gyroscope whose output is an angle of its own turns once a turn and has no pattern.
pub(super) fn is_rate_gyroscope(identified: &Identification) -> bool {
    let h = &identified.calibration.hypothesis;
    identified.report.instrument == "gyroscope" && h.period_rad > WHOLE_TURN_RAD
}

/// A vibration has an orientation, and a sensor an angle.
pub(crate) fn name_of_angle(identified: &Identification) -> &'static str {
    if has_pattern(identified) { "pattern angle" } else { "angle" }
}

pub(super) fn has_pattern(identified: &Identification) -> bool {
    identified.report.instrument == "gyroscope" && !is_rate_gyroscope(identified)
}

/// A sensor has none of what the standard of gyroscopes speaks of.
pub(super) fn has_standard(r: &Report) -> bool {
    r.instrument == "gyroscope"
}

/// A word of the facts as a reader of this instrument has it: what has no pattern has an angle.
fn said_of(word: &str, has_pattern: bool) -> String {
    if has_pattern { word.to_owned() } else { word.replace("pattern angle", "angle").replace("pattern", "angle") }
}

/// What was found: before the figures.
pub(super) fn found(h: &mut String, identified: &Identification) {
    let declared = if has_pattern(identified) {
        "Declared effects are those of the paper's model, which every campaign is asked for"
    } else if is_rate_gyroscope(identified) {
        "A rate gyroscope is asked for its bias, its lag and its scale factor, which is |k|"
    } else {
        "Declared effects are unequal gains of two channels, which every campaign is asked for"
    };
    effects(h, &identified.report, declared);
    parameters(h, identified);
}

/// How it was found, run by run, and what is left: after the figures.
pub(super) fn besides(h: &mut String, identified: &Identification) {
    let r = &identified.report;
    runs(h, &r.runs);
    temperature(h, r.temperature.as_ref());
    correlations(h, identified);
    steps(h, identified);
    left(h, r, has_pattern(identified));
    if has_standard(r) {
        words(h, r, has_pattern(identified));
    }
    files(h, r);
}

/// A table with a header; `rows` writes its rows. A column in which no row has anything is named in the caption and left out.
pub(super) fn table(h: &mut String, label: &str, columns: &[&str], rows: impl FnOnce(&mut String)) {
    let mut body = String::new();
    rows(&mut body);
    let told = told(&body, columns.len());
    let untold: Vec<&str> = columns.iter().zip(&told).filter(|(_, told)| !**told).map(|(c, _)| *c).collect();
    let nothing = if untold.is_empty() { String::new() } else { format!("; nothing under: {}", untold.join(", ")) };
    let _ = write!(
        h,
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{0}\"><table><caption>{0}{nothing}</caption><thead><tr>",
        escape(label)
    );
    for c in columns.iter().zip(&told).filter(|(_, told)| **told).map(|(c, _)| c) {
        let _ = write!(h, "<th scope=\"col\">{c}</th>");
    }
    h.push_str("</tr></thead><tbody>");
    labelled(h, &body, columns, &told);
    h.push_str("</tbody></table></div>");
}

/// Whether any row has something in each column but the first, whose absence is a dash.
fn told(body: &str, columns: usize) -> Vec<bool> {
    let is_dash = |cell: &str| cell.split_once('>').is_some_and(|(_, text)| text.starts_with("—</td>"));
    let rows: Vec<Vec<&str>> = body.split_inclusive("</tr>").map(|line| line.split("<td").skip(1).collect()).collect();
    let any = |at: usize| rows.iter().any(|cells| cells.get(at).is_some_and(|cell| !is_dash(cell)));
    (0..columns).map(|at| at == 0 || rows.is_empty() || any(at)).collect()
}

/// The rows, each cell with the name of its column, which a narrow page writes in front of it.
fn labelled(h: &mut String, body: &str, columns: &[&str], told: &[bool]) {
    for line in body.split_inclusive("</tr>") {
        for (at, part) in line.split("<td").enumerate() {
            if at == 0 {
                h.push_str(part);
            } else if told.get(at - 1).copied().unwrap_or(true) {
                let name = columns.get(at - 1).copied().unwrap_or_default();
                let _ = write!(h, "<td data-label=\"{name}\"{part}");
            } else if let Some((_, end)) = part.split_once("</td>") {
                h.push_str(end);
            }
        }
    }
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
    // of an output that is an angle or a rate no channel was read
    let rates_alone = is_rate_gyroscope(identified);
    table(h, "Values with 95 % intervals", &["parameter", "value", "95 % interval", "unit"], |h| {
        let mut estimate = |name: &str, e: Option<&Estimate>| match e {
            Some(e) => {
                let [value, low, high] = interval(e.value, e.ci95);
                row(h, &[name, &value, &format!("{low} … {high}"), "1"]);
            }
            None => row(h, &[name, NOT_IDENTIFIABLE, "", "1"]),
        };
        estimate("angular gain k (scale factor)", Some(&r.angular_gain).filter(|k| k.is_told()));
        if !rates_alone {
            estimate("detection gain ratio G<sub>Dy</sub>/G<sub>Dx</sub>", r.detection_gain_ratio.as_ref());
        }
        if r.instrument == "gyroscope" && !rates_alone {
            estimate("actuation gain ratio G<sub>Ax</sub>/G<sub>Ay</sub>", r.actuation_gain_ratio.as_ref());
        }
        for Number { name, value, unit } in further(r) {
            let [value, low, high] = interval(value.value, value.ci95);
            row(h, &[&escape(&name), &value, &format!("{low} … {high}"), unit]);
        }
        let once = |name: &str| match name {
            "detection_gain_ratio" => r.detection_gain_ratio.is_none(),
            "actuation_gain_ratio" => r.actuation_gain_ratio.is_none(),
            _ => true,
        };
        for e in &r.effects {
            match harmonics_of_a_table(e) {
                Some((order, largest)) => {
                    let size = format!("largest {} at {}", significant(largest.1.to_degrees()), largest.0);
                    row(h, &[ANGLE_TABLE, &format!("{order} harmonics"), &size, "deg"]);
                }
                None => e.parameters.iter().filter(|p| once(&p.name)).for_each(|p| parameter(h, e, p, SEARCHED)),
            }
        }
    });
    if let Some(e) = r.effects.iter().find(|e| harmonics_of_a_table(e).is_some()) {
        h.push_str("<details><summary>Coefficients of the angle table</summary>");
        table(h, "Coefficients of the angle table", &["parameter", "value", "95 % interval", "unit"], |h| {
            e.parameters.iter().for_each(|p| parameter(h, e, p, SEARCHED));
        });
        h.push_str("</details>");
    }
}

/// In the place of an interval.
const SEARCHED: &str = "set by a search";
/// The effect whose parameters are a series, two for each harmonic, and many.
const ANGLE_TABLE: &str = "angle-table";

/// How many harmonics a table has, and which is the largest: its number and amplitude.
fn harmonics_of_a_table(e: &EffectReport) -> Option<(usize, (usize, f64))> {
    let pairs = e.parameters.chunks_exact(2).filter(|_| e.id == ANGLE_TABLE);
    let amplitudes = pairs.map(|p| p[0].value.hypot(p[1].value)).enumerate().map(|(at, a)| (at + 1, a));
    let largest = amplitudes.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((e.parameters.len() / 2, largest))
}

/// A parameter of an effect; `without` stands where it has no interval. A skew is said as an angle besides.
pub(super) fn parameter(h: &mut String, e: &EffectReport, p: &ParameterReport, without: &str) {
    let mut said = |shown: &Shown<'_>| {
        let (value, ends) = match shown.ci95.map(|c| interval(shown.value, c)) {
            Some([value, low, high]) => (value, format!("{low} … {high}")),
            None => (significant(shown.value), without.to_owned()),
        };
        row(h, &[&format!("{}: {}", escape(&e.id), escape(shown.name)), &value, &ends, &escape(shown.unit)]);
    };
    said(&Shown::of(e, p));
    if e.id == EffectId::DetectionSkew.description().id {
        let angle = |v: f64| v.atan().to_degrees();
        let (value, ci95) = (angle(p.value), p.ci95.map(|c| c.map(angle)));
        said(&Shown { name: "axes off a right angle by", value, ci95, unit: "deg" });
    }
}

fn correlations(h: &mut String, identified: &Identification) {
    let Some(c) = identified.plots.as_ref().map(|p| &p.correlations) else { return };
    let mut strong: Vec<(f64, &str, &str)> = Vec::new();
    for i in 0..c.names.len() {
        strong.extend((0..i).map(|j| (c.rows[i][j], c.names[j].as_str(), c.names[i].as_str())));
    }
    strong.retain(|s| s.0.abs() >= STRONG);
    strong.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    h.push_str("<h2 id=\"correlations-of\">Correlations and steps</h2>");
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

fn effects(h: &mut String, r: &Report, declared: &str) {
    let _ = write!(
        h,
        "<h2 id=\"effects\">Effects</h2><p>{declared}; \
         discovered ones were added because the data ask for them; an empirical one describes what no effect of the library \
         explains.</p>",
    );
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
    if !has_pattern(identified) {
        return;
    }
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

fn left(h: &mut String, r: &Report, has_pattern: bool) {
    let memory = if r.residual.white { "no memory" } else { "some memory" };
    let _ = write!(h, "<h2 id=\"left\">What is left</h2><p>Ljung–Box at 1 %: {memory} in the residual.</p>");
    shares(h, r, has_pattern);
    if r.unexplained.is_empty() {
        h.push_str("<p>Nothing that asks for an explanation.</p>");
    } else {
        let columns = ["class", "harmonic", "frequency [Hz]", "rms [deg]", "suggestion"];
        table(h, "Without an explanation", &columns, |h| {
            for u in &r.unexplained {
                let n = u.n.map_or("—".into(), |n| n.to_string());
                let f = u.frequency_hz.map_or("—".into(), |f| format!("{f:.5}"));
                row(
                    h,
                    &[
                        &escape(&said_of(&u.class, has_pattern)),
                        &n,
                        &f,
                        &format!("{:.5}", u.rms_deg),
                        &escape(&u.suggestion),
                    ],
                );
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
            let of = said_of(&format!("{:?}", x.of).to_lowercase(), has_pattern);
            let amplitude = format!("{:.6}", x.amplitude_deg);
            let interval = format!("± {:.6}", x.ci95_deg);
            row(h, &[&of, &x.n.to_string(), &amplitude, &interval, &format!("{:.0}", x.phase_deg)]);
        }
    });
}

/// What a share goes with: harmonics of the pattern angle that grow or change their sign are no shares of the angle alone.
fn followed(share: &Share) -> String {
    match share.named().as_str() {
        "amplitude" => "pattern angle, by the square of the amplitude".into(),
        "direction" => "pattern angle, by the direction of rotation".into(),
        "rate" => "pattern angle, by the inverse of the rate".into(),
        "pattern" => "pattern angle, the same in every run".into(),
        other => other.into(),
    }
}

/// What the error that the declared model leaves is a function of.
fn shares(h: &mut String, r: &Report, has_pattern: bool) {
    if r.decomposition.is_empty() {
        return;
    }
    table(h, "What the declared model's residual follows", &["it follows", "share of its variance", "95 %"], |h| {
        for s in &r.decomposition {
            let [low, high] = s.ci95.map(|v| format!("{:.1} %", 100.0 * v));
            let followed = said_of(&followed(s), has_pattern);
            row(h, &[&escape(&followed), &format!("{:.1} %", 100.0 * s.share), &format!("{low} … {high}")]);
        }
    });
}

/// The facts under the names that IEEE Std 1431 has for them.
fn words(h: &mut String, r: &Report, has_pattern: bool) {
    h.push_str("<h2 id=\"standard\">In the words of IEEE Std 1431</h2>");
    table(h, "Terms of the standard", &["term", "here", "value"], |h| {
        for entry in standard::entries(r, has_pattern) {
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
                // the mean of a rotation there and back is the rate of none of its parts
                Some(_) if x.way.as_deref() == Some("both") => "both ways".to_owned(),
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

/// What each run tells by itself.
pub(super) fn runs(h: &mut String, runs: &[RunReport]) {
    h.push_str("<h2 id=\"runs\">Runs</h2>");
    let told = |e: Option<Estimate>| e.map_or("—".to_owned(), |e| estimated(&e));
    let number = |v: Option<f64>, digits: usize| v.map_or("—".to_owned(), |v| format!("{v:.digits$}"));
    let columns = [
        "run",
        "way",
        "rate [deg/s]",
        "k",
        "bias [deg/s]",
        "rms [deg]",
        "spikes",
        "temperature [°C]",
        "agrees with the others",
    ];
    table(h, "What each run tells by itself", &columns, |h| {
        for x in runs {
            let way = match &x.way {
                _ if x.kind != "rotation" => x.kind.as_str(),
                Some(way) => way,
                None => "—",
            };
            let agrees = x.agrees.map_or("—", |a| if a { "yes" } else { "no" });
            row(
                h,
                &[
                    &escape(&run_name(&x.file)),
                    way,
                    &number(x.rate_dps, 2),
                    &told(x.angular_gain),
                    &told(x.bias_dps),
                    &number(x.rms_deg, 5),
                    &x.spikes.to_string(),
                    &number(x.temp_c, 2),
                    agrees,
                ],
            );
        }
    });
}

/// How that goes with the temperature.
pub(super) fn temperature(h: &mut String, told: Option<&Temperature>) {
    let Some(t) = told else { return };
    let [low, high] = t.range_c;
    let _ = write!(
        h,
        "<h2 id=\"temperature\">Temperature</h2><p>{} runs from {low:.1} to {high:.1} °C; straight lines, with 95 % intervals from \
         how the runs scatter about them.{}</p>",
        t.runs,
        t.reason.as_ref().map_or(String::new(), |r| format!(" Not identifiable: {}.", escape(r)))
    );
    let rows = [
        ("angular gain k", t.angular_gain_per_k, "1/K"),
        ("bias", t.bias_dps_per_k, "deg/s/K"),
        ("detection gain ratio G<sub>Dy</sub>/G<sub>Dx</sub>", t.detection_gain_ratio_per_k, "1/K"),
    ];
    if rows.iter().all(|r| r.1.is_none()) {
        return;
    }
    table(h, "Slopes over the temperature", &["of", "per K", "95 % interval", "unit", "beyond its interval"], |h| {
        for (name, e, unit) in rows {
            let Some(e) = e else { continue };
            let [value, low, high] = interval(e.value, e.ci95);
            let seen = if e.ci95[0] > 0.0 || e.ci95[1] < 0.0 { "yes" } else { "no" };
            row(h, &[name, &value, &format!("{low} … {high}"), unit, seen]);
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
            let warmer = law.temperature.map(|[low, high]| format!("the temperature, by {low:.2e} … {high:.2e} 1/K"));
            let goes = [power("rate", law.rate), power("amplitude", law.amplitude), warmer, turns];
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
