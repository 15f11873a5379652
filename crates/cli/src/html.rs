//! `report.html`: the report for a person, in one file without a network.

use std::fmt::Write as _;

use cvg_calibration::report::{Estimate, Report};
use cvg_calibration::{Identification, Origin};

use crate::commands::significant;
use crate::figure::{BLUE, GREEN, Series, VERMILLION, plot};
use crate::{Failure, commands};

/// Points of a cloud that a plain figure can carry.
const POINTS: usize = 3000;

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#1b1b1b;background:#fff}\
h1{font-size:1.6rem;margin-bottom:.2rem}h2{font-size:1.15rem;margin-top:2rem}table{border-collapse:collapse;width:100%}\
th,td{text-align:left;padding:.3rem .6rem;border-bottom:1px solid #ddd;vertical-align:top}td.n{font-variant-numeric:tabular-nums}\
.lead{font-size:1.2rem}.warn{border-left:4px solid #d55e00;padding:.4rem .8rem;background:#fdf3ec;margin:.4rem 0}\
svg{max-width:100%;height:auto}figcaption{color:#555;font-size:.9rem}figure{margin:1rem 0}";

/// The report of an identification.
pub(crate) fn report(identified: &Identification) -> Result<String, Failure> {
    let r = &identified.report;
    let mut h = String::new();
    let _ = write!(
        h,
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" \
         content=\"width=device-width,initial-scale=1\"><title>{0} — cvg report</title><style>{STYLE}</style></head>\
         <body><h1>{0}</h1>",
        escape(&r.device)
    );
    headline(&mut h, r);
    for w in &r.warnings {
        let _ = write!(h, "<p class=\"warn\" role=\"note\">{}</p>", escape(w));
    }
    bias_figure(&mut h, identified)?;
    errors(&mut h, r);
    parameters(&mut h, r);
    effects(&mut h, r);
    harmonics(&mut h, r);
    ring_down_figure(&mut h, identified)?;
    runs(&mut h, r);
    let _ = write!(
        h,
        "<details><summary>report.json</summary><pre>{}</pre></details></body></html>",
        escape(&commands::report_json(identified)?)
    );
    Ok(h)
}

fn headline(h: &mut String, r: &Report) {
    let after = r.heldout.discovered.rms_deg;
    let before = r.heldout.raw.unwrap_or(r.heldout.declared).rms_deg;
    let found: Vec<&str> = r.effects.iter().filter(|e| e.origin == Origin::Discovered).map(|e| e.id.as_str()).collect();
    let finding = match (found.is_empty(), r.unexplained.is_empty()) {
        (false, _) => format!("Beyond the declared model: {}.", found.join(", ")),
        (true, true) => "The declared model leaves nothing to explain.".into(),
        (true, false) => "Something is left that no effect of the library explains.".into(),
    };
    let _ = write!(
        h,
        "<p class=\"lead\">Held-out angle error {before:.4}° → {after:.4}° rms, {:.0} times less (noise floor {:.4}°). \
         {}</p>",
        before / after,
        r.heldout.noise_floor_deg,
        escape(&finding)
    );
}

/// Angle error over the pattern angle as SVG: all three stages, or without the raw one.
pub(crate) fn bias_svg(identified: &Identification, points: usize, with_raw: bool) -> Result<String, Failure> {
    let curves = &identified.figures.bias;
    let total: usize = curves.iter().map(|c| c.pattern_deg.len()).sum();
    let stride = (total / points).max(1);
    let cloud = |name, colour, pick: fn(&cvg_calibration::BiasCurve) -> &Vec<f64>| {
        let all = curves.iter().flat_map(|c| c.pattern_deg.iter().copied().zip(pick(c).iter().copied()));
        Series { name, colour, points: all.step_by(stride).collect(), joined: false }
    };
    let series = [
        cloud("raw", VERMILLION, |c| &c.raw_deg),
        cloud("declared", BLUE, |c| &c.declared_deg),
        cloud("discovered", GREEN, |c| &c.discovered_deg),
    ];
    plot("pattern angle [deg]", "angle error [deg]", if with_raw { &series } else { &series[1..] })
}

fn bias_figure(h: &mut String, identified: &Identification) -> Result<(), Failure> {
    let _ = write!(h, "<h2>Angle error over the pattern angle, held-out data</h2>");
    for (with_raw, caption) in
        [(true, "before any compensation, after the declared model, after all"), (false, "the last two, enlarged")]
    {
        let svg = bias_svg(identified, POINTS, with_raw)?;
        let _ = write!(h, "<figure>{svg}<figcaption>{caption}</figcaption></figure>");
    }
    Ok(())
}

fn ring_down_figure(h: &mut String, identified: &Identification) -> Result<(), Failure> {
    let downs = &identified.figures.ring_downs;
    if downs.is_empty() {
        return Ok(());
    }
    let names: Vec<String> =
        downs.iter().map(|r| format!("{:.0}°: τ = {:.3} s", r.angle_rad.to_degrees(), r.tau_s)).collect();
    let series: Vec<Series<'_>> = downs
        .iter()
        .zip(&names)
        .zip([BLUE, VERMILLION, GREEN].into_iter().cycle())
        .map(|((r, name), colour)| Series { name, colour, points: r.decay.clone(), joined: true })
        .collect();
    let svg = plot("time [s]", "amplitude [V]", &series)?;
    let _ = write!(h, "<h2>Ring-downs</h2><figure>{svg}</figure>");
    Ok(())
}

fn errors(h: &mut String, r: &Report) {
    let _ = write!(
        h,
        "<h2>Error before and after, held-out data</h2><table><thead><tr><th>stage</th><th>rms [deg]</th><th>peak \
         [deg]</th><th>peak to peak [deg]</th></tr></thead><tbody>"
    );
    for (name, size) in
        [("raw", r.heldout.raw), ("declared", Some(r.heldout.declared)), ("discovered", Some(r.heldout.discovered))]
    {
        let _ = match size {
            Some(e) => write!(
                h,
                "<tr><td>{name}</td><td class=\"n\">{:.5}</td><td class=\"n\">{:.5}</td><td class=\"n\">{:.5}</td></tr>",
                e.rms_deg, e.peak_deg, e.peak_to_peak_deg
            ),
            None => write!(h, "<tr><td>{name}</td><td colspan=\"3\">the raw angle does not turn</td></tr>"),
        };
    }
    let _ = write!(h, "</tbody></table>");
}

fn parameters(h: &mut String, r: &Report) {
    let _ = write!(
        h,
        "<h2>Parameters</h2><table><thead><tr><th>parameter</th><th>value</th><th>95 % interval</th></tr></thead><tbody>"
    );
    let mut row = |name: &str, e: &Option<Estimate>| {
        let _ = match e {
            Some(e) => write!(
                h,
                "<tr><td>{name}</td><td class=\"n\">{:.7}</td><td class=\"n\">{:.7} … {:.7}</td></tr>",
                e.value, e.ci95[0], e.ci95[1]
            ),
            None => write!(h, "<tr><td>{name}</td><td colspan=\"2\">not told by this campaign</td></tr>"),
        };
    };
    row("angular gain k", &Some(r.angular_gain));
    row("detection gain ratio G<sub>Dy</sub>/G<sub>Dx</sub>", &r.detection_gain_ratio);
    if r.instrument == "gyroscope" {
        row("actuation gain ratio G<sub>Ax</sub>/G<sub>Ay</sub>", &r.actuation_gain_ratio);
    }
    let _ = write!(h, "</tbody></table>");
}

fn effects(h: &mut String, r: &Report) {
    let _ = write!(
        h,
        "<h2>Effects</h2><table><thead><tr><th>effect</th><th>origin</th><th>parameters (95 % \
         interval)</th><th>held-out rms [deg]</th><th>evidence</th></tr></thead><tbody>"
    );
    for e in &r.effects {
        let list = e
            .parameters
            .iter()
            .map(|p| {
                let ci =
                    p.ci95.map(|c| format!(" ({} … {})", significant(c[0]), significant(c[1]))).unwrap_or_default();
                format!("{} = {} {}{ci}", escape(&p.name), significant(p.value), escape(&p.unit))
            })
            .collect::<Vec<_>>()
            .join("<br>");
        let change = e.heldout_rms_deg.map(|b| format!("{:.5} → {:.5}", b.before, b.after)).unwrap_or_default();
        let confounded = if e.confounded_with.is_empty() {
            String::new()
        } else {
            format!(
                "<br>Confounded with {}; separated by {}.",
                escape(&e.confounded_with.join(", ")),
                escape(e.separated_by.as_deref().unwrap_or("another run"))
            )
        };
        let _ = write!(
            h,
            "<tr><td>{}</td><td>{}</td><td class=\"n\">{list}</td><td class=\"n\">{change}</td><td>{}{confounded}</td></tr>",
            escape(&e.id),
            format!("{:?}", e.origin).to_lowercase(),
            escape(&e.evidence)
        );
    }
    let _ = write!(h, "</tbody></table>");
    if !r.unexplained.is_empty() {
        let _ = write!(h, "<h2>Unexplained</h2><ul>");
        for u in &r.unexplained {
            let n = u.n.map(|n| format!(", n = {n}")).unwrap_or_default();
            let f = u.frequency_hz.map(|f| format!(", {f:.4} Hz")).unwrap_or_default();
            let _ = write!(h, "<li>{}{n}{f}: {:.5}° rms. {}</li>", escape(&u.class), u.rms_deg, escape(&u.suggestion));
        }
        let _ = write!(h, "</ul>");
    }
}

fn harmonics(h: &mut String, r: &Report) {
    let white = if r.residual.white { "no memory" } else { "some memory" };
    let _ = write!(
        h,
        "<h2>What is left</h2><p>Ljung–Box at 1 %: {white} in the residual.</p><table><thead><tr><th>harmonic \
         of</th><th>n</th><th>amplitude [deg]</th><th>95 % of a component [deg]</th></tr></thead><tbody>"
    );
    for x in &r.residual.harmonics {
        let of = format!("{:?}", x.of).to_lowercase();
        let _ = write!(
            h,
            "<tr><td>{of}</td><td>{}</td><td class=\"n\">{:.6}</td><td class=\"n\">± {:.6}</td></tr>",
            x.n, x.amplitude_deg, x.ci95_deg
        );
    }
    let _ = write!(h, "</tbody></table>");
}

fn runs(h: &mut String, r: &Report) {
    let _ = write!(
        h,
        "<h2>Runs</h2><table><thead><tr><th>file</th><th>kind</th><th>use</th><th>rows</th><th>rate \
         [deg/s]</th><th>dropped</th></tr></thead><tbody>"
    );
    for x in &r.runs {
        let rate = x.rate_dps.map(|v| format!("{v:.2}")).unwrap_or_default();
        let _ = write!(
            h,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{rate}</td><td>{}</td></tr>",
            escape(&x.file),
            x.kind,
            x.r#use,
            x.rows,
            escape(&x.dropped.join("; "))
        );
    }
    let _ = write!(h, "</tbody></table>");
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
