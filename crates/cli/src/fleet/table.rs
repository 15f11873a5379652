//! fleet.csv and fleet.parquet: a row for each device; fleet-prior.csv: one for each of its quantities.

use std::fmt::Write as _;

use cvg_calibration::recording::{Cells, Values};

use crate::population::prior::Posterior;
use crate::population::{Device, Oddity, Population};
use crate::service::Columns;

/// A row for each device, as columns.
pub(super) fn columns(population: &Population, devices: &[Device]) -> Columns {
    let texts = |name: &str, of: &dyn Fn(usize) -> String| {
        (name.to_owned(), Values::Texts((0..devices.len()).map(of).collect::<Cells>()))
    };
    let numbers = |name: &str, of: &dyn Fn(usize) -> Option<f64>| {
        let values = (0..devices.len()).map(|at| of(at).unwrap_or(f64::NAN));
        (name.to_owned(), Values::Numbers(values.collect()))
    };
    let mut out = vec![
        texts("device", &|at| devices[at].text("device").to_owned()),
        texts("campaign", &|at| devices[at].campaign.display().to_string()),
        texts("folder", &|at| devices[at].folder.clone()),
        texts("status", &|at| devices[at].text("status").to_owned()),
        texts("reason", &|at| devices[at].text("reason").to_owned()),
    ];
    for stage in ["raw", "declared", "discovered"] {
        out.push(numbers(&format!("{stage}_rms_deg"), &|at| devices[at].number(&format!("/heldout/{stage}/rms_deg"))));
    }
    out.push(numbers("noise_floor_deg", &|at| devices[at].number("/heldout/noise_floor_deg")));
    let joined = |names: Vec<String>| names.join(" ");
    out.push(texts("effects", &|at| joined(devices[at].effects().into_iter().map(|f| f.label).collect())));
    out.push(texts("odd", &|at| joined(population.odd[at].iter().map(Oddity::name).collect())));
    out.push(texts("outside_limits", &|at| devices[at].outside.clone().unwrap_or_default()));
    for name in population.distributions.keys() {
        let of = |at: usize| population.parameters[at].iter().find(|p| p.name == *name);
        let end = |at: usize, end: usize| of(at).and_then(|p| p.ci95).map(|ends| ends[end]);
        out.push(numbers(name, &|at| of(at).map(|p| p.value)));
        out.push(numbers(&format!("{name}.low"), &|at| end(at, 0)));
        out.push(numbers(&format!("{name}.high"), &|at| end(at, 1)));
    }
    out
}

/// The same as fleet.csv.
pub(super) fn csv(columns: &Columns) -> String {
    let names: Vec<String> = columns.iter().map(|(name, _)| quoted(name)).collect();
    let mut out = names.join(",") + "\n";
    let rows = columns.first().map_or(0, |(_, values)| values.len());
    for row in 0..rows {
        let cell = |(_, values): &(String, Values)| match values {
            Values::Numbers(numbers) => number(Some(numbers[row])),
            Values::Texts(cells) => quoted(cells.get(row).unwrap_or_default()),
            Values::Unreadable { .. } => String::new(),
        };
        let _ = writeln!(out, "{}", columns.iter().map(cell).collect::<Vec<_>>().join(","));
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
fn number(value: Option<f64>) -> String {
    value.filter(|v| v.is_finite()).map_or(String::new(), |v| v.to_string())
}

/// A text as a cell (RFC 4180). One that a spreadsheet would take for a formula is told as a text, with an apostrophe before it.
fn quoted(text: &str) -> String {
    let text = if text.starts_with(['=', '+', '-', '@']) { format!("'{text}") } else { text.to_owned() };
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text }
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn a_text_that_a_spreadsheet_would_work_out_stays_a_text() {
        assert_eq!(quoted("=HYPERLINK(\"a\",1)"), "\"'=HYPERLINK(\"\"a\"\",1)\"");
        assert_eq!(["+1", "-b", "@c", "d=1"].map(quoted), ["'+1", "'-b", "'@c", "d=1"]);
    }
}
