//! fleet.json, and the same in words.

use std::fmt::Write as _;

use serde_json::{Map, Value, json};

use crate::output;
use crate::population::{Change, Device, Line, Oddity, Population};
use crate::report::fleet as page;
use crate::report::numbers::significant;

/// fleet.json
pub(super) fn facts(population: &Population, devices: &[Device]) -> Value {
    let of = |status: &str| devices.iter().filter(|d| d.text("status") == status).count();
    let mut parameters: Map<String, Value> = Map::new();
    for (name, d) in &population.distributions {
        let facts = json!({"unit": d.unit, "devices": d.count, "median": d.median, "robust_deviation": d.deviation});
        parameters.insert(name.clone(), facts);
    }
    let named = |at: usize| devices[at].text("device");
    let lines: Map<String, Value> = population.lines.iter().map(|(name, l)| (name.clone(), line(l, named))).collect();
    let effects = population.effects.iter().map(|(label, s)| {
        json!({"id": label, "devices": s.devices, "share": s.share, "share_ci95": s.ci95,
               "shared": s.is_shared, "rare": s.is_rare})
    });
    let odd = devices.iter().zip(&population.odd).filter(|(_, odd)| !odd.is_empty());
    json!({
        "schema": "cvg.fleet/1",
        "devices": devices.len(),
        "answered": of("answered"),
        "neutral": of("neutral"),
        "refused": of("refused"),
        "outside_limits": devices.iter().filter(|d| d.outside.is_some()).count(),
        "parameters": parameters,
        "quantities": lines,
        "effects": effects.collect::<Vec<_>>(),
        "odd": odd.map(|(d, odd)| json!({
            "device": d.text("device"), "folder": d.folder,
            "by": odd.iter().map(Oddity::name).collect::<Vec<_>>(),
            "why": odd.iter().map(oddity).collect::<Vec<_>>(),
        })).collect::<Vec<_>>(),
    })
}

fn line<'d>(l: &Line, named: impl Fn(usize) -> &'d str) -> Value {
    let change = l.change.map(|change| match change {
        Change::Trend { change, chance } => json!({"kind": "trend", "change": change, "chance": chance}),
        Change::Step { from, before, after, chance } => {
            let from = l.values.get(from).map(|(at, _)| named(*at));
            json!({"kind": "step", "from": from, "before": before, "after": after, "chance": chance})
        }
    });
    let chart = l.chart.map(|c| {
        json!({"centre": c.centre, "lower": c.lower, "upper": c.upper, "outside": c.outside, "longest_run": c.longest_run})
    });
    json!({
        "of": l.of,
        "devices": l.values.len(),
        "centre": l.spread.as_ref().map(|s| s.centre),
        "between_devices": l.spread.as_ref().map(|s| s.between),
        "error": l.error,
        "change": change,
        "control": chart,
        "group": l.group,
    })
}

fn oddity(odd: &Oddity) -> Value {
    match odd {
        Oddity::Effect { label, gain } => json!({"effect": label, "gain": gain}),
        Oddity::Lack { label } => json!({"without": label}),
        Oddity::Value { of, value, deviations, chance } => {
            // what is infinitely far out of devices that are alike to the digit
            let deviations = Some(deviations).filter(|d| d.is_finite());
            json!({"parameter": of, "value": value, "deviations": deviations, "chance": chance})
        }
    }
}

/// The same for a person.
pub(super) fn in_words(population: &Population, devices: &[Device]) -> String {
    let mut out = String::new();
    let answered = population.answered;
    let _ = writeln!(out, "{}, {answered} answered", output::counted(devices.len(), "device"));
    for (name, d) in population.distributions.iter().filter(|(_, d)| 2 * d.count > answered) {
        let unit = if d.unit == "1" { "" } else { &d.unit };
        let (middle, deviation) = (significant(d.median), significant(d.deviation));
        let _ = writeln!(out, "  {name:<40} median {middle} {unit}, robust deviation {deviation} {unit}");
    }
    for (label, share) in &population.effects {
        let what = if share.is_shared { "shared: of the design or the board" } else { "" };
        let _ = writeln!(out, "  {label:<40} in {:.1} % of the devices  {what}", 100.0 * share.share);
    }
    for (name, line) in &population.lines {
        if let Some(change) = &line.change {
            let _ = writeln!(out, "  {name}: {}", page::in_words(line, change, devices));
        }
        if line.group > 0 {
            let _ =
                writeln!(out, "  {name}: {} apart from the others: too many to be odd", page::devices_are(line.group));
        }
    }
    for (device, odd) in devices.iter().zip(&population.odd).filter(|(_, odd)| !odd.is_empty()) {
        let names: Vec<String> = odd.iter().map(Oddity::name).collect();
        let _ = writeln!(out, "  odd: {} ({}): {}", device.text("device"), device.folder, names.join(", "));
    }
    for device in devices.iter().filter(|d| !d.has_answer()) {
        let [status, name, reason] = ["status", "device", "reason"].map(|of| device.text(of));
        let _ = writeln!(out, "  {status}: {name} ({}): {reason}", device.folder);
    }
    out
}
