//! fleet.html: what the devices of a fleet say together, in one file that needs no network.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::figures::{Figure, shorts};
use super::numbers::significant;
use super::tables::{row, table};
use super::{begin, draw, escape, finish};
use crate::Failure;
use crate::output::counted;
use crate::population::{Change, Device, Line, Oddity, Population};

/// Ordinary devices in one figure; the odd ones are all there.
const POINTS: usize = 2000;
/// Bars of a histogram.
const BARS: usize = 30;
/// Devices without an answer, or outside their limits, that are listed.
const LISTED: usize = 200;

/// The page; `facts` are those of fleet.json.
pub(crate) fn page(population: &Population, devices: &[Device], facts: &Value) -> Result<String, Failure> {
    let figures: Vec<Figure> = population
        .lines
        .iter()
        .enumerate()
        .filter_map(|(number, (name, line))| course(number, name, line, population, devices))
        .collect();
    let mut h = String::with_capacity(2 << 20);
    begin(&mut h, &counted(devices.len(), "device"), "fleet");
    headline(&mut h, population, devices);
    if let Some(prior) = facts["prior"]["statement"].as_str() {
        let _ = write!(h, "<p>{}: {}.</p>", escape(facts["prior"]["file"].as_str().unwrap_or_default()), escape(prior));
    }
    h.push_str(
        "<nav aria-label=\"sections\"><a href=\"#odd\">Odd devices</a><a href=\"#shared\">Effects</a><a \
         href=\"#quantities\">Quantities</a><a href=\"#look\">Figures</a><a href=\"#others\">Limits and refusals</a></nav></header><main>",
    );
    odd(&mut h, population, devices);
    effects(&mut h, population);
    quantities(&mut h, population, devices);
    draw(&mut h, "<p>The figures need scripts, which this file brings along.</p>", &figures);
    others(&mut h, devices);
    let footer = "Odd: in a fleet without an odd device, at most one in twenty has one named by its values.";
    let json = serde_json::to_string_pretty(facts).map_err(Failure::input)?;
    finish(&mut h, ["fleet.json", &json], facts["schema"].as_str().unwrap_or_default(), footer, &figures)?;
    Ok(h)
}

fn headline(h: &mut String, population: &Population, devices: &[Device]) {
    let odd = population.odd.iter().filter(|odd| !odd.is_empty()).count();
    let outside = devices.iter().filter(|d| d.outside.is_some()).count();
    let shared: Vec<&str> = population.effects.iter().filter(|(_, s)| s.is_shared).map(|(id, _)| id.as_str()).collect();
    let shared =
        if shared.is_empty() { String::new() } else { format!(" Of the design or the board: {}.", shared.join(", ")) };
    let limits = if outside == 0 { String::new() } else { format!(" {outside} are outside their limits.") };
    let _ = write!(
        h,
        "<p class=\"headline\">{} of {} answered, {odd} odd</p><p class=\"finding\">{}</p>",
        population.answered,
        devices.len(),
        escape(format!("{shared}{limits}").trim())
    );
}

/// Why a device is odd, for a person.
fn why(odd: &Oddity) -> String {
    match odd {
        Oddity::Effect { label, gain: Some(gain) } => format!("{label}: gains {gain:.0} in 2 ln likelihood"),
        Oddity::Effect { label, gain: None } => label.clone(),
        Oddity::Lack { label } => format!("lacks {label}"),
        Oddity::Value { of, value, deviations, chance } => {
            format!("{of} = {}: {deviations:.1} deviations off, chance {chance:.1e}", significant(*value))
        }
    }
}

fn odd(h: &mut String, population: &Population, devices: &[Device]) {
    h.push_str("<h2 id=\"odd\">Odd devices</h2>");
    let all = devices.iter().zip(&population.odd).filter(|(_, odd)| !odd.is_empty());
    if all.clone().next().is_none() {
        h.push_str("<p>None is apart from the others by more than chance.</p>");
        return;
    }
    table(h, "What sets them apart from the others", &["device", "folder", "by"], |h| {
        for (device, odd) in all {
            let reasons: Vec<String> = odd.iter().map(why).collect();
            row(h, &[&escape(device.text("device")), &escape(&device.folder), &escape(&reasons.join("; "))]);
        }
    });
}

fn effects(h: &mut String, population: &Population) {
    h.push_str("<h2 id=\"shared\">Effects beyond the declared model</h2>");
    table(h, "How many devices have each", &["effect", "devices", "share", "95 % interval", "which means"], |h| {
        for (label, s) in &population.effects {
            let means = match (s.is_shared, s.is_rare) {
                (true, _) => "shared: of the design or the board",
                (_, true) => "an exception",
                _ => "some have it: a batch, or hardly identifiable",
            };
            let percent = |v: f64| format!("{:.1} %", 100.0 * v);
            let ends = format!("{} … {}", percent(s.ci95[0]), percent(s.ci95[1]));
            row(h, &[&escape(label), &s.devices.to_string(), &percent(s.share), &ends, means]);
        }
    });
}

fn quantities(h: &mut String, population: &Population, devices: &[Device]) {
    h.push_str("<h2 id=\"quantities\">Quantities</h2>");
    let columns =
        ["quantity", "centre", "between devices", "error of one", "along the serial numbers", "outside the chart"];
    table(h, "What the devices differ by, and what their own errors are", &columns, |h| {
        for (name, line) in &population.lines {
            let Some(spread) = &line.spread else { continue };
            let change = line.change.as_ref().map_or("—".to_owned(), |c| in_words(line, c, devices));
            let group =
                if line.group > 0 { format!("; {} apart as a group", devices_are(line.group)) } else { String::new() };
            let outside =
                line.chart.map_or("—".to_owned(), |c| format!("{}, longest run {}", c.outside, c.longest_run));
            let brief = |v: f64| if v == 0.0 { "0".to_owned() } else { format!("{v:.2e}") };
            let cells = [
                escape(name),
                significant(spread.centre),
                brief(spread.between),
                brief(line.error),
                escape(&format!("{change}{group}")),
                outside,
            ];
            row(h, &cells.each_ref().map(String::as_str));
        }
    });
}

/// A number of devices, and the verb.
pub(crate) fn devices_are(count: usize) -> String {
    format!("{} {}", counted(count, "device"), if count == 1 { "is" } else { "are" })
}

/// What changes along the serial numbers.
pub(crate) fn in_words(line: &Line, change: &Change, devices: &[Device]) -> String {
    let named = |at: usize| line.values.get(at).map_or("", |(device, _)| devices[*device].text("device"));
    match *change {
        Change::Trend { change, .. } => {
            format!("goes by {} from {} to {}", significant(change), named(0), named(line.values.len() - 1))
        }
        Change::Step { from, before, after, .. } => {
            format!("{} before {}, {} from there on", significant(before), named(from), significant(after))
        }
    }
}

/// A quantity over the serial numbers, its limits, and beside it how often which value is there.
fn course(number: usize, name: &str, line: &Line, population: &Population, devices: &[Device]) -> Option<Figure> {
    let spread = line.spread.as_ref()?;
    let is_odd = |at: usize| population.odd[at].iter().any(|o| o.name() == line.of);
    let every = line.values.len().div_ceil(POINTS);
    let points = |odd: bool| {
        let all = line
            .values
            .iter()
            .enumerate()
            .filter(move |(place, (at, _))| is_odd(*at) == odd && (odd || place % every == 0));
        all.map(|(place, (at, m))| (place as f64 + 1.0, m.value, devices[*at].text("device"))).collect::<Vec<_>>()
    };
    let mut traces: Vec<Value> = [("devices", false, "circle", "@declared"), ("odd", true, "diamond", "@raw")]
        .into_iter()
        .map(|(label, odd, symbol, ink)| {
            let points = points(odd);
            json!({
                "type": "scatter", "mode": "markers", "name": label, "x": shorts(points.iter().map(|p| p.0)),
                "y": shorts(points.iter().map(|p| p.1)), "text": points.iter().map(|p| p.2).collect::<Vec<_>>(),
                "marker": {"size": if odd { 9 } else { 4 }, "symbol": symbol, "color": ink},
                "hovertemplate": "%{text}: %{y}",
            })
        })
        .collect();
    let ends = [1.0, line.values.len() as f64];
    let mut level = |label: &str, value: f64, dash: &str| {
        traces.push(json!({
            "type": "scatter", "mode": "lines", "name": label, "showlegend": !label.is_empty(), "x": ends, "y": shorts([value, value]),
            "line": {"color": "@muted", "width": 1.2, "dash": dash}, "hoverinfo": "skip",
        }));
    };
    level("centre", spread.centre, "solid");
    if let Some(chart) = line.chart {
        level("control limits", chart.upper, "dash");
        level("", chart.lower, "dash");
    }
    let (places, counts) = histogram(&line.values.iter().map(|v| v.1.value).collect::<Vec<_>>());
    traces.push(json!({
        "type": "bar", "orientation": "h", "name": "how many", "xaxis": "x2", "showlegend": false,
        "x": counts, "y": shorts(places), "marker": {"color": "@declared"}, "hovertemplate": "%{x} at %{y}",
    }));
    let layout = json!({
        "xaxis": {"title": {"text": "device, by serial number"}, "domain": [0.0, 0.8]},
        "xaxis2": {"title": {"text": "devices"}, "domain": [0.83, 1.0]}, "yaxis": {}, "bargap": 0.05,
    });
    let caption = "By serial number, with limits of three deviations of neighbours: what changes slowly leaves them. Beside \
                   or below it, how many devices have which value.";
    Some(Figure::new(&format!("quantity-{number}"), name, caption, traces, layout))
}

/// Middles of bars of equal width, and how many values are in each.
fn histogram(values: &[f64]) -> (Vec<f64>, Vec<usize>) {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    let width = (high - low) / BARS as f64;
    let mut counts = vec![0; BARS];
    if width > 0.0 {
        values.iter().for_each(|v| counts[(((v - low) / width) as usize).min(BARS - 1)] += 1);
    }
    ((0..BARS).map(|bar| low + (bar as f64 + 0.5) * width).collect(), counts)
}

fn others(h: &mut String, devices: &[Device]) {
    h.push_str("<h2 id=\"others\">Limits and refusals</h2>");
    let without = devices.iter().filter(|d| !d.has_answer()).map(|d| (d, d.text("status"), d.text("reason")));
    let outside = devices.iter().filter_map(|d| Some((d, "outside its limits", d.outside.as_deref()?)));
    let all: Vec<_> = outside.chain(without).collect();
    if all.is_empty() {
        h.push_str("<p>Every device has an answer, and none is outside a limit.</p>");
        return;
    }
    if all.len() > LISTED {
        let _ = write!(h, "<p>The first {LISTED} of {}; all are in fleet.csv.</p>", all.len());
    }
    table(h, "Devices without an answer or outside their limits", &["device", "folder", "what", "why"], |h| {
        for (device, what, why) in all.into_iter().take(LISTED) {
            row(h, &[&escape(device.text("device")), &escape(&device.folder), what, &escape(why)]);
        }
    });
}
