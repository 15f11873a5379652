//! `report.html`: the report for a person, in one file that needs no network.
//!
//! The page is plain HTML that can be read, searched and printed as it is; the figures are data beside it, drawn by
//! Plotly's basic bundle (`assets/README.md`), which is part of the file.

mod circle;
mod figures;
mod finding;
pub(crate) mod fleet;
pub(crate) mod further;
pub(crate) mod numbers;
pub(crate) mod summary;
pub(crate) mod survey;
mod tables;

use std::fmt::Write as _;

use cvg_calibration::Identification;
use serde_json::Value;

use self::figures::Figure;
use self::finding::{finding, of_the_device};
use self::numbers::{degrees, times};
pub(crate) use self::tables::{WHOLE_TURN_RAD, name_of_angle};
use crate::{Failure, clouds, output};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
/// Lines, points, bars and shapes: a quarter of what all of Plotly weighs.
const PLOTLY: &str = include_str!("../../assets/plotly-basic.min.js");
/// Nothing is fetched, whatever a name in a recording says.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data: blob:";
/// Points of the still picture for readers without scripts.
const STILL_POINTS: usize = 600;

/// report.json
pub(crate) fn json(identified: &Identification) -> Result<String, Failure> {
    serde_json::to_string_pretty(&identified.report).map_err(Failure::input)
}

/// The report of an identification.
pub(crate) fn page(identified: &Identification) -> Result<String, Failure> {
    let r = &identified.report;
    let figures = figures::all(identified);
    let mut h = String::with_capacity(2 << 20);
    begin(&mut h, &r.device, &r.instrument);
    headline(&mut h, identified);
    warnings(&mut h, &r.warnings);
    stages(&mut h, identified);
    let standard = if tables::has_standard(r) { "<a href=\"#standard\">IEEE 1431</a>" } else { "" };
    let _ = write!(
        h,
        "<nav aria-label=\"sections\"><a href=\"#effects\">Effects</a><a href=\"#parameters\">Parameters</a><a \
         href=\"#look\">Figures</a><a href=\"#runs\">Runs</a><a href=\"#left\">What is left</a>{standard}<a \
         href=\"#files\">Files</a></nav></header><main>"
    );
    let still = clouds::bias_svg(identified, STILL_POINTS, true)?;
    let without = "<p>The figures need scripts, which this file brings along; here is one without.</p>";
    tables::found(&mut h, identified);
    draw(&mut h, &format!("{without}{still}"), &figures);
    tables::besides(&mut h, identified);
    let footer = "Errors are angle minus the best line, angular gain and bias refitted on the same held-out samples.";
    finish(&mut h, ["report.json", &json(identified)?], &r.schema, footer, &figures)?;
    Ok(h)
}

/// The page up to its first words.
fn begin(h: &mut String, device: &str, instrument: &str) {
    let _ = write!(
        h,
        "<!doctype html>\n<html lang=\"en\" data-theme=\"light\"><head><meta charset=\"utf-8\"><meta \
         http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\"><meta name=\"viewport\" \
         content=\"width=device-width,initial-scale=1\"><title>{0}: cvg report</title><style>{STYLE}</style></head><body>\
         <header><div class=\"bar\"><h1>{0} · {1}</h1><button id=\"theme\" type=\"button\" hidden \
         aria-label=\"switch between light and dark\">Dark</button></div>",
        escape(device),
        escape(instrument)
    );
}

/// The facts for programs under the name of their file, the footer, and what the figures are drawn from.
fn finish(
    h: &mut String,
    [named, json]: [&str; 2],
    schema: &str,
    footer: &str,
    figures: &[Figure],
) -> Result<(), Failure> {
    let _ = write!(
        h,
        "<details><summary>{named}</summary><div class=\"scroll\" tabindex=\"0\"><pre>{}</pre></div></details></main>\
         <footer>cvg {}, schema {}. {footer}</footer>",
        escape(json),
        env!("CARGO_PKG_VERSION"),
        escape(schema)
    );
    let data: Vec<Value> = figures.iter().map(Figure::data).collect();
    let data = serde_json::to_string(&data).map_err(Failure::input)?;
    // no text within a script may end it, or begin another
    let _ = writeln!(
        h,
        "<script type=\"application/json\" id=\"figures\">{}</script><script type=\"text/javascript\">{PLOTLY}</script>\
         <script>{SCRIPT}</script></body></html>",
        data.replace('<', "\\u003c")
    );
    Ok(())
}

fn headline(h: &mut String, identified: &Identification) {
    let held = &identified.report.heldout;
    let before = held.raw.unwrap_or(held.declared);
    let said = finding::of_nothing(identified.report.status, held).unwrap_or_else(|| {
        format!(
            "{} <span class=\"arrow\">→</span> {} rms angle error, {}",
            degrees(before.rms_deg),
            degrees(held.discovered.rms_deg),
            times(of_the_device(&identified.report), held.discovered.rms_deg)
        )
    });
    let sentence = escape(&finding(&identified.report));
    let _ = write!(h, "<p class=\"headline\">{said}</p><p class=\"finding\">{sentence}</p>");
}

fn warnings(h: &mut String, list: &[String]) {
    if list.is_empty() {
        return;
    }
    h.push_str("<section class=\"warnings\" aria-labelledby=\"heed\"><h2 id=\"heed\">Warnings</h2><ul>");
    for w in list {
        let _ = write!(h, "<li>{}</li>", escape(w));
    }
    h.push_str("</ul></section>");
}

fn stages(h: &mut String, identified: &Identification) {
    let held = &identified.report.heldout;
    h.push_str("<div class=\"stages\">");
    let mut card = |class: &str, value: Option<f64>, what: &str| {
        let value = value.map_or("the raw angle does not turn".to_owned(), degrees);
        let _ = write!(h, "<div class=\"stage {class}\"><b>{value}</b><span>{what}</span></div>");
    };
    card("raw", held.raw.map(|e| e.rms_deg), "raw, as recorded");
    let declared =
        if tables::has_pattern(identified) { "after the paper's model" } else { "after the declared effects" };
    card("declared", Some(held.declared.rms_deg), declared);
    card("discovered", Some(held.discovered.rms_deg), "after all that was found");
    card("floor", Some(held.noise_floor_deg), "noise of the recording");
    h.push_str("</div>");
}

/// The figures; `still` is for readers without scripts.
fn draw(h: &mut String, still: &str, figures: &[Figure]) {
    h.push_str(
        "<h2 id=\"look\">Figures</h2><p class=\"keys\">Drag to zoom, double-click to reset, point to read off. With the \
         keyboard: focus a figure; <kbd>←</kbd> <kbd>→</kbd> <kbd>↑</kbd> <kbd>↓</kbd> move, <kbd>+</kbd> <kbd>-</kbd> \
         zoom, <kbd>0</kbd> shows all.</p>",
    );
    let _ = write!(h, "<noscript>{still}</noscript>");
    h.push_str("<div class=\"figures\">");
    for f in figures {
        let id = escape(&f.id);
        let wide = if f.wide { " class=\"wide\"" } else { "" };
        let title = escape(&f.title);
        let _ = write!(h, "<figure{wide} aria-labelledby=\"title-{id}\"><h3 id=\"title-{id}\">{title}</h3>");
        if !f.toggles.is_empty() {
            let _ = write!(h, "<div class=\"toggles\" role=\"group\" aria-label=\"stages shown in {title}\">");
            for (mark, label) in &f.toggles {
                let _ = write!(
                    h,
                    "<button type=\"button\" data-of=\"{id}\" data-series=\"{0}\" aria-pressed=\"true\">{1}</button>",
                    escape(mark),
                    escape(label)
                );
            }
            h.push_str("</div>");
        }
        let caption = escape(&f.caption);
        let _ = write!(
            h,
            "<div class=\"plot\" id=\"plot-{id}\" tabindex=\"0\" role=\"application\" aria-label=\"{title}, a chart: \
             {caption}\"></div><figcaption>{caption}</figcaption></figure>"
        );
    }
    h.push_str("</div>");
}

fn escape(text: &str) -> String {
    output::plain(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::PLOTLY;

    #[test]
    fn the_script_of_the_figures_is_the_one_that_is_described_and_does_not_end_its_element() {
        assert!(!PLOTLY.contains("</script") && !PLOTLY.contains("<!--"));
        let described = include_str!("../../assets/README.md");
        let version = PLOTLY.split_once("(basic - minified) v").and_then(|(_, rest)| rest.lines().next());
        let version = version.expect("a version");
        let sum = format!("{:08x}", crc32fast::hash(PLOTLY.as_bytes()));
        assert!(described.contains(&format!("Version {version}, CRC-32 {sum}")), "{version} {sum}");
    }
}
