//! The rooms of this crate import in one direction, as ARCHITECTURE.md says.
#![allow(clippy::expect_used, clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::{Path, PathBuf};

/// From the bottom up: each may import those before it.
const ROOMS: [&str; 8] = ["numerics", "model", "facts", "data", "estimation", "diagnostics", "selection", "report"];

fn sources(path: &Path, out: &mut Vec<PathBuf>) {
    if path.is_dir() {
        fs::read_dir(path).expect("a folder").for_each(|entry| sources(&entry.expect("an entry").path(), out));
    } else if path.extension().is_some_and(|e| e == "rs") {
        out.push(path.to_owned());
    }
}

/// Rooms that a source imports, doc comments aside.
fn imported(source: &str) -> Vec<&str> {
    source
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .flat_map(|line| line.split("crate::").skip(1))
        .filter_map(|rest| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next())
        .collect()
}

#[test]
fn rooms_import_only_those_beneath_them() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut upward = Vec::new();
    for (floor, room) in ROOMS.iter().enumerate() {
        let mut files = Vec::new();
        let [folder, file] = [root.join(room), root.join(format!("{room}.rs"))];
        sources(if folder.exists() { &folder } else { &file }, &mut files);
        assert!(!files.is_empty(), "no room {room}");
        for path in files {
            let source = fs::read_to_string(&path).expect("a source");
            let above = |name: &&str| ROOMS[floor + 1..].contains(name) || PATHS.contains(name);
            upward
                .extend(imported(&source).into_iter().filter(above).map(|name| format!("{}: {name}", path.display())));
        }
    }
    assert!(upward.is_empty(), "imports that go up:\n{}", upward.join("\n"));
}

/// What walks a recording through the rooms: no room knows it.
const PATHS: [&str; 8] = [
    "rate_table",
    "angle_sensor",
    "free_decay",
    "virtual_precession",
    "carrier",
    "identification",
    "identified",
    "survey",
];

#[test]
fn an_import_is_seen() {
    assert_eq!(
        imported("use crate::report::Share;\n//! crate::data\nlet x = crate::model::y(crate::data::z);"),
        ["report", "model", "data"]
    );
}
