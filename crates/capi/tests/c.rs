//! `cvg.h` is what cbindgen makes of the source, and a C program that includes it runs the loop.

use std::path::PathBuf;
#[cfg(unix)]
use std::{path::Path, process::Command};

fn crate_folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The header is committed, so that C needs neither cbindgen nor cargo to read it. `CVG_HEADER=write` makes it anew.
#[test]
fn the_header_is_current() {
    let folder = crate_folder();
    let configuration = cbindgen::Config::from_file(folder.join("cbindgen.toml")).expect("cbindgen.toml");
    let bindings = cbindgen::Builder::new()
        .with_config(configuration)
        .with_src(folder.join("src/lib.rs"))
        .with_src(folder.join("src/calibrator.rs"))
        .generate()
        .expect("bindings");
    let mut made = Vec::new();
    bindings.write(&mut made);
    let made = String::from_utf8(made).expect("a text");
    let path = folder.join("include/cvg.h");
    if std::env::var("CVG_HEADER").is_ok_and(|v| v == "write") {
        std::fs::write(&path, &made).expect("written");
    }
    let committed = std::fs::read_to_string(&path).expect("crates/capi/include/cvg.h").replace("\r\n", "\n");
    assert!(made == committed, "crates/capi/include/cvg.h is not current: CVG_HEADER=write cargo test -p cvg-capi");
}

#[cfg(unix)]
fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}\n{text}");
    text
}

#[cfg(unix)]
fn compiled(folder: &Path, library: &Path) -> PathBuf {
    let program = folder.join("loop");
    let here = crate_folder();
    run(Command::new("cc")
        .args(["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(&program)
        .arg("-I")
        .arg(here.join("include"))
        .arg(here.join("tests/loop.c"))
        .arg(library)
        .args(["-lm", "-lpthread"])
        .args(if cfg!(target_os = "linux") { &["-ldl"][..] } else { &[] }));
    program
}

#[cfg(unix)]
#[test]
fn a_c_program_runs_the_loop() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let target = folder.join("capi");
    run(Command::new(env!("CARGO"))
        .args(["build", "--release", "--quiet", "-p", "cvg-capi", "--target-dir"])
        .arg(&target)
        .current_dir(crate_folder()));
    let program = compiled(&folder, &target.join("release/libcvg.a"));
    let said = run(&mut Command::new(program));
    print!("{said}");
    assert!(said.contains("whole angle after") && said.contains("held at"), "{said}");
}
