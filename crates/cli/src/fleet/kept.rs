//! Answers that are there: one is kept where it rests on the same bytes and this very program, and its files are as they were
//! written.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;
use std::sync::LazyLock;

use cvg_calibration::recording::{Campaign, read_text};
use cvg_calibration::report::{self, Tool};
use serde_json::{Value, json};

use crate::commands::RESULTS;

/// What the folder of a device has of what its answer rests on.
pub(super) const SOURCE: &str = "source.json";
/// Bytes that are read at once.
const PIECE: usize = 1 << 16;

/// A checksum of this program: two builds of one version may answer differently. None where the system does not say where it is.
static PROGRAM: LazyLock<Option<String>> = LazyLock::new(|| {
    let mut file = File::open(std::env::current_exe().ok()?).ok()?;
    let (mut sum, mut piece) = (crc32fast::Hasher::new(), vec![0; PIECE]);
    loop {
        match file.read(&mut piece).ok()? {
            0 => return Some(format!("{:08x}", sum.finalize())),
            n => sum.update(&piece[..n]),
        }
    }
});

/// source.json: the rows of a lake that an answer rests on, the program, and the answer itself.
pub(super) fn source(rows: Option<&Value>, report: &str, calibration: Option<&str>) -> String {
    let sum = |text: &str| format!("{:08x}", crc32fast::hash(text.as_bytes()));
    let [facts, _, undone] = RESULTS;
    let results = json!({facts: sum(report), undone: calibration.map(sum)});
    format!("{:#}\n", json!({"rows": rows, "program": *PROGRAM, "results": results}))
}

/// The report that is there, where nothing that it rests on has changed and nothing of it is missing.
pub(super) fn answer(own: &Path, campaign: &Campaign, rows: Option<&Value>) -> Option<Value> {
    let [facts, _, undone] = RESULTS;
    let text = read_text(&own.join(facts)).ok()?;
    let calibration = read_text(&own.join(undone)).ok();
    let expected = source(rows, &text, calibration.as_deref());
    if read_text(&own.join(SOURCE)).ok()? != expected {
        return None;
    }
    let answer: Value = serde_json::from_str(&text).ok()?;
    let inputs = serde_json::to_value(report::inputs(campaign)).ok()?;
    let tool = serde_json::to_value(Tool::default()).ok()?;
    (answer["inputs"] == inputs && answer["tool"] == tool).then_some(answer)
}
