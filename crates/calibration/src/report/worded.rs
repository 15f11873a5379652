//! Warnings as a reader wants them: what many recordings say alike is said once.

use crate::facts::RunReport;

/// Recordings from which on what they say alike is said once.
const MANY: usize = 3;

/// Says once what many recordings say alike, `file: what`: with the name of the first, and how many others there are.
pub(crate) fn once_a_kind(warnings: &mut Vec<String>, runs: &[RunReport]) {
    let names: Vec<&str> = runs.iter().flat_map(|run| [run.file.as_str(), last(&run.file)]).collect();
    let of_a_file = |warning: &'_ str| {
        let (file, what) = warning.split_once(": ").filter(|(file, _)| names.contains(file))?;
        Some((file.to_owned(), what.to_owned()))
    };
    let said: Vec<Option<(String, String)>> = warnings.iter().map(|warning| of_a_file(warning)).collect();
    let mut all = std::mem::take(warnings).into_iter().zip(&said).enumerate();
    warnings.extend(all.by_ref().filter_map(|(at, (warning, parts))| {
        let Some((file, what)) = parts else { return Some(warning) };
        let alike = |parts: &&Option<(String, String)>| parts.as_ref().is_some_and(|(_, other)| other == what);
        let count = said.iter().filter(alike).count();
        if count < MANY {
            return Some(warning);
        }
        let is_first = !said[..at].iter().any(|parts| alike(&parts));
        is_first.then(|| format!("{file} and {} other files: {what}", count - 1))
    }));
}

/// The name of a file without its folders.
fn last(file: &str) -> &str {
    file.rsplit(['/', '\\']).next().unwrap_or(file)
}

#[cfg(test)]
mod tests {
    use super::once_a_kind;
    use crate::recording::{Recording, Role, Run, RunKind};
    use crate::report::recorded::run_report;

    #[test]
    fn what_many_files_say_alike_is_said_once_and_all_else_as_it_was() {
        let run = |number: usize| Run {
            kind: RunKind::Rotation,
            file: format!("day-1/{number}.csv").into(),
            settle_s: 0.0,
            role: Role::Fit,
            amplitude: None,
            recording: Recording::default(),
        };
        let runs: Vec<_> = (0..4).map(|number| run_report(&run(number))).collect();
        let mut warnings: Vec<String> = Vec::new();
        for number in 0..4 {
            warnings.push(format!("{number}.csv: `xc_v` is in mV and taken to V"));
            warnings.push(format!("{number}.csv: {number} rows were dropped"));
        }
        warnings.extend(
            ["0.csv: is late", "1.csv: is late", "k: is unusual", "k: is unusual", "k: is unusual"].map(str::to_owned),
        );
        let before = warnings.clone();
        once_a_kind(&mut warnings, &runs);
        assert_eq!(warnings[0], "0.csv and 3 other files: `xc_v` is in mV and taken to V");
        let kept: Vec<&String> = before.iter().filter(|warning| !warning.contains("mV")).collect();
        assert_eq!(warnings[1..].iter().collect::<Vec<_>>(), kept);
    }
}
