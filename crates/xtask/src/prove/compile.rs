//! Harnesses → one wasm module for each crate → C.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::Harness;
use super::root::Root;

/// The crates that have harnesses; the guards are files of this one.
pub(crate) const CRATES: [&str; 5] = ["estimator", "controller", "instrument", "calibrator", "model"];

/// The folders in which the C is, ready for CBMC, by the crate whose harnesses it holds.
pub(crate) fn compile(
    repository: &Path,
    root: &Root,
    harnesses: &[Harness],
) -> Result<BTreeMap<String, PathBuf>, String> {
    let work = repository.join("target/prove");
    let shim = work.join("shim");
    fs::create_dir_all(&shim).map_err(|e| e.to_string())?;
    // the stand-in for Kani is handed to every crate, without being a dependency of any
    let sources = repository.join("crates/kani-shim");
    let rustc = || {
        let mut command = Command::new(root.tool("rustc"));
        command.args(["--edition=2024", "--out-dir"]).arg(&shim);
        command
    };
    run(rustc()
        .args(["--crate-name=cvg_kani_macros", "--crate-type=proc-macro", "--extern=proc_macro"])
        .arg(sources.join("macros/src/lib.rs")))?;
    run(rustc()
        .args(["--crate-name=kani", "--crate-type=rlib", "--target=wasm32-unknown-unknown", "-Copt-level=3"])
        .arg(format!("--extern=cvg_kani_macros={}", shim.join("libcvg_kani_macros.so").display()))
        .arg(sources.join("src/lib.rs")))?;

    // of one module for all, every harness would carry the data of all
    let mut groups: BTreeMap<String, Vec<&Harness>> = BTreeMap::new();
    for h in harnesses {
        groups.entry(h.package()).or_default().push(h);
    }
    let mut folders = BTreeMap::new();
    for (package, members) in groups {
        let folder = module(repository, root, &work, &package, &members)?;
        folders.insert(package, folder);
    }
    Ok(folders)
}

/// The C of one crate's harnesses.
fn module(repository: &Path, root: &Root, work: &Path, package: &str, members: &[&Harness]) -> Result<PathBuf, String> {
    let io = |e: std::io::Error| e.to_string();
    let (shim, crate_folder, c) = (work.join("shim"), work.join(package).join("harness"), work.join(package).join("c"));
    for folder in [&crate_folder.join("src"), &c] {
        fs::create_dir_all(folder).map_err(io)?;
    }
    write_crate(repository, &crate_folder, package, members)?;
    let flags = [
        "--cfg=cvg_prove".to_owned(),
        format!("--extern=kani={}", shim.join("libkani.rlib").display()),
        format!("-Ldependency={}", shim.display()),
        format!("-Clinker={}", root.tool("wasm-ld").display()),
        format!("-Clink-arg=-zstack-size={}", stack(package)),
        // saturating conversions as plain code; bulk copies stay, see `known_lengths`
        "-Ctarget-cpu=mvp".to_owned(),
    ];
    let target = work.join("wasm");
    run(Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(["build", "--release", "--target=wasm32-unknown-unknown", "--manifest-path"])
        .arg(crate_folder.join("Cargo.toml"))
        .arg("--target-dir")
        .arg(&target)
        .env("RUSTC", root.tool("rustc"))
        .env("CARGO_ENCODED_RUSTFLAGS", flags.join("\u{1f}"))
        .env_remove("RUSTC_WRAPPER")
        .env_remove("CARGO_TARGET_DIR"))?;
    run(Command::new(root.tool("wasm2c"))
        .args(["-n", "harness", "-o"])
        .arg(c.join("harness.c"))
        .arg(target.join("wasm32-unknown-unknown/release/harness.wasm")))?;
    let module = fs::read_to_string(c.join("harness.c")).map_err(io)?;
    known_lengths(&module).map_err(|reason| format!("{package}: {reason}"))?;
    fs::write(c.join("data.c"), data(&module, stack(package))?).map_err(io)?;
    fs::write(c.join("host.c"), include_str!("host.c")).map_err(io)?;
    Ok(c)
}

/// The crate that exports every harness by its name.
fn write_crate(repository: &Path, folder: &Path, package: &str, harnesses: &[&Harness]) -> Result<(), String> {
    let io = |e: std::io::Error| e.to_string();
    let mut manifest = "[package]\nname = \"harness\"\nversion = \"0.0.0\"\nedition = \"2024\"\n\n[lib]\n\
        crate-type = [\"cdylib\"]\n\n[profile.release]\npanic = \"abort\"\nopt-level = 3\nlto = \"fat\"\n\
        codegen-units = 1\noverflow-checks = true\n\n[workspace]\n\n[dependencies]\n"
        .to_owned();
    let mut source = "#![no_std]\n#[panic_handler]\n\
         fn panic(_: &core::panic::PanicInfo) -> ! { core::arch::wasm32::unreachable() }\n"
        .to_owned();
    if let Some(name) = package.strip_prefix("cvg-") {
        let path = repository.join("crates").join(name);
        let _ = writeln!(manifest, "{package} = {{ path = {:?} }}", path.display().to_string());
    } else {
        let guards = repository.join("crates/xtask/src/prove/guards.rs");
        let _ = writeln!(source, "#[path = {:?}]\nmod guards;", guards.display().to_string());
    }
    for h in harnesses {
        let _ = writeln!(
            source,
            "#[unsafe(export_name = {name:?})]\npub extern \"C\" fn export_{name}() {{ {path}() }}",
            name = h.function.name,
            path = h.path
        );
    }
    fs::write(folder.join("Cargo.toml"), manifest).map_err(io)?;
    fs::write(folder.join("src/lib.rs"), source).map_err(io)?;
    // the same versions as in the workspace
    fs::copy(repository.join("Cargo.lock"), folder.join("Cargo.lock")).map_err(io)?;
    Ok(())
}

/// Bytes of stack; the linker puts the data after it. The guards need little: one asks for more than there is, and the solvers carry
/// every byte through every store at a place that they do not know.
fn stack(package: &str) -> usize {
    if package == "xtask" { 1024 } else { 4096 }
}

/// The memory with the data segments that `module`, wasm2c's output, loads when it starts, behind the `stack`.
fn data(module: &str, stack: usize) -> Result<String, String> {
    let mut initial = String::new();
    let mut end = stack;
    // the body of wasm2c's memory_init, the instruction for bulk data, which the target does not have
    let bulk = "(*dest), dest_addr, src + src_addr, n);";
    let loads = module.lines().filter_map(|line| line.trim().strip_prefix("LOAD_DATA(")).filter(|load| *load != bulk);
    for load in loads {
        let parts: Vec<_> = load.trim_end_matches(");").split(", ").collect();
        let [_, offset, segment, length] = parts[..] else {
            return Err(format!("wasm2c loads data in a way that is not known: {load}"));
        };
        let bytes = module
            .split_once(&format!("{segment}[] = {{"))
            .and_then(|(_, rest)| rest.split_once("};"))
            .map(|(bytes, _)| bytes.trim().trim_end_matches(','))
            .ok_or_else(|| format!("wasm2c's data segment {segment} was not found"))?;
        let count = bytes.split(',').count();
        if length.parse() != Ok(count) {
            return Err(format!("data segment {segment}: {count} bytes, {length} are loaded"));
        }
        let first: usize = offset
            .trim_end_matches('u')
            .parse()
            .map_err(|_| format!("data segment {segment}: {offset} is no offset"))?;
        end = end.max(first + count);
        let _ = writeln!(initial, "[{offset}] = {bytes},");
    }
    // no more than is used: what lies beyond is out of bounds
    let memory = end.next_multiple_of(1024) + 1024;
    Ok(format!("#define MEMORY {memory}\nstatic uint8_t memory[MEMORY] = {{{initial}}};\n"))
}

/// Refuses bulk copies and fills of a length that is not a number in the module.
///
/// wasm2c makes `memmove` and `memset` of them, of which CBMC has models of its own. The guards ask whether these are whole where
/// the length is a number; of one that may be anything they leave it to arrays whose size may be anything, which nothing here
/// vouches for.
fn known_lengths(module: &str) -> Result<(), String> {
    let mut before = "";
    let mut function = "";
    for line in module.lines() {
        if !line.starts_with([' ', '\t', '}', '#']) && line.ends_with('{') {
            function = line;
        }
        let line = line.trim();
        let bulk = ["memory_copy(&", "memory_fill(&"].into_iter().any(|call| line.starts_with(call));
        if bulk {
            // the operand is pushed by the line before it is used
            let length = line.trim_end_matches(");").rsplit(", ").next().unwrap_or_default();
            let known = before.split_once(" = ").is_some_and(|(name, value)| {
                let digits = value.strip_suffix("u;").unwrap_or_default();
                name == length && !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit())
            });
            if !known {
                return Err(format!("a copy of a length that is not known: {line} in {function}"));
            }
        }
        before = line;
    }
    Ok(())
}

fn run(command: &mut Command) -> Result<(), String> {
    let shown = format!("{:?}", command.get_program());
    let output = command.output().map_err(|e| format!("{shown}: {e}"))?;
    if output.status.success() {
        return Ok(());
    }
    let said = [output.stdout, output.stderr].concat();
    Err(format!("{shown}: {}\n{}", output.status, String::from_utf8_lossy(&said)))
}

#[cfg(test)]
mod tests {
    use super::{data, known_lengths};

    const MODULE: &str = "static const u8 segment_a[] = {\n  0x01, 0x02, \n  0x03, \n};\n\
        static void init() {\n  LOAD_DATA(instance->w2c_memory, 4096u, segment_a, 3);\n}\n";

    #[test]
    fn data_segments_are_where_they_are_loaded() {
        let text = data(MODULE, 4096).expect("a segment");
        assert!(text.contains("[4096u] = 0x01, 0x02, \n  0x03"), "{text}");
    }

    #[test]
    fn a_segment_that_is_not_there_or_not_whole_is_an_error() {
        data(&MODULE.replace("segment_a[]", "segment_b[]"), 4096).expect_err("not there");
        data(&MODULE.replace("0x02, ", ""), 4096).expect_err("not whole");
        data(&MODULE.replace("LOAD_DATA(instance->w2c_memory, ", "LOAD_DATA("), 4096).expect_err("not known");
    }

    /// What wasm2c makes of `to[..n].copy_from_slice(&from[..n])`, with `n` as it is given.
    fn copying(length: &str) -> String {
        format!(
            "static inline void memory_copy(wasm_rt_memory_t* dest,\n}}\nvoid w2c_harness_x(w2c_harness* instance) {{\n  \
             var_i1 += var_i2;\n  var_i2 = {length};\n  \
             memory_copy(&instance->w2c_memory, &instance->w2c_memory, var_i0, var_i1, var_i2);\n}}\n"
        )
    }

    #[test]
    fn a_copy_of_a_length_that_is_a_number_is_taken() {
        known_lengths(&copying("128u")).expect("a number");
        known_lengths(&copying("128u").replace("memory_copy(&", "memory_fill(&")).expect("a number");
        known_lengths(MODULE).expect("no copy");
    }

    #[test]
    fn a_copy_of_any_length_is_refused() {
        for length in ["var_l2", "var_l2 + 1u", "", "u", "-1u"] {
            let said = known_lengths(&copying(length)).expect_err(length);
            assert!(said.contains("memory_copy") && said.contains("w2c_harness_x"), "{said}");
            known_lengths(&copying(length).replace("memory_copy(&", "memory_fill(&")).expect_err(length);
        }
        // a number of something else
        known_lengths(&copying("128u").replace("var_i2 = ", "var_i3 = ")).expect_err("the length is not the number");
        // the length is what was computed before
        known_lengths(&copying("128u").replace("  memory_copy(&", "  var_i0 += var_i1;\n  memory_copy(&"))
            .expect_err("far");
    }
}
