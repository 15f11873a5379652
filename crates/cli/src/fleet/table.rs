//! fleet.csv: a row for each device.

use std::fmt::Write as _;

use crate::population::prior::Posterior;
use crate::population::{Device, Oddity, Population};

/// The table of all devices.
pub(super) fn table(population: &Population, devices: &[Device]) -> String {
    let names: Vec<&String> = population.distributions.keys().collect();
    let mut out = String::from(
        "device,campaign,folder,status,reason,raw_rms_deg,declared_rms_deg,discovered_rms_deg,noise_floor_deg,effects,odd,\
         outside_limits",
    );
    for name in &names {
        let _ = write!(out, ",{0},{0}.low,{0}.high", quoted(name));
    }
    out.push('\n');
    for ((device, parameters), odd) in devices.iter().zip(&population.parameters).zip(&population.odd) {
        let effects: Vec<String> = device.effects().into_iter().map(|f| f.label).collect();
        let odd: Vec<String> = odd.iter().map(Oddity::name).collect();
        let mut cells = vec![
            quoted(device.text("device")),
            quoted(&device.campaign.display().to_string()),
            quoted(&device.folder),
            device.text("status").to_owned(),
            quoted(device.text("reason")),
        ];
        let errors = ["raw/rms_deg", "declared/rms_deg", "discovered/rms_deg", "noise_floor_deg"];
        cells.extend(errors.map(|stage| number(device.number(&format!("/heldout/{stage}")))));
        cells.extend([quoted(&effects.join(" ")), quoted(&odd.join(" "))]);
        cells.push(quoted(device.outside.as_deref().unwrap_or_default()));
        for name in &names {
            let p = parameters.iter().find(|p| p.name == **name);
            let ends = p.and_then(|p| p.ci95);
            cells.extend([p.map(|p| p.value), ends.map(|e| e[0]), ends.map(|e| e[1])].map(number));
        }
        let _ = writeln!(out, "{}", cells.join(","));
    }
    out
}

/// fleet-prior.csv: a row for each quantity of each device, with and without what the fleet says.
pub(super) fn prior(posteriors: &[Posterior], devices: &[Device]) -> String {
    let mut out = String::from(
        "device,folder,quantity,own,own.low,own.high,fleet,fleet.low,fleet.high,with_fleet,with_fleet.low,with_fleet.high,\
         share_of_own,not_applied\n",
    );
    for p in posteriors {
        let device = &devices[p.device];
        let mut cells = vec![quoted(device.text("device")), quoted(&device.folder), quoted(&p.quantity)];
        for measured in [p.own, Some(p.fleet), p.both] {
            let ends = measured.map(Posterior::ends);
            cells.extend([measured.map(|m| m.value), ends.map(|e| e[0]), ends.map(|e| e[1])].map(number));
        }
        cells.push(number(Some(p.of_own)));
        cells.push(p.not_applied.unwrap_or_default().to_owned());
        let _ = writeln!(out, "{}", cells.join(","));
    }
    out
}

/// A number as a cell: empty where there is none.
pub(super) fn number(value: Option<f64>) -> String {
    value.filter(|v| v.is_finite()).map_or(String::new(), |v| v.to_string())
}

/// A text as a cell (RFC 4180).
pub(super) fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}
