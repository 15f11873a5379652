//! The tools of the proofs in a folder of their own: Debian's packages in pinned versions, unpacked, not installed.
//!
//! Nothing of it runs as root and nothing outside the folder changes: `apt-get` resolves and checks signatures with a
//! configuration of its own, `dpkg-deb` unpacks, and each tool is started through the folder's own loader.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::pins;

const TOOLS: [&str; 5] = ["cbmc", "bitwuzla", "wasm2c", "rustc", "wasm-ld"];
/// Changes when the recipe does; each recipe has a folder of its own.
const RECIPE: &str = "3";

/// The tools, ready to run.
#[derive(Clone, Debug)]
pub(crate) struct Root {
    folder: PathBuf,
}

impl Root {
    /// The folder with the tools.
    pub(crate) fn tools(&self) -> PathBuf {
        self.folder.join("bin")
    }

    /// The path of a tool.
    pub(crate) fn tool(&self, name: &str) -> PathBuf {
        self.tools().join(name)
    }

    /// The folder with the headers of wasm2c's output.
    pub(crate) fn headers(&self) -> PathBuf {
        self.folder.join("include")
    }

    /// Names and versions of what was unpacked.
    pub(crate) fn packages(&self) -> Vec<String> {
        let list = fs::read_to_string(self.folder.join("packages.txt")).unwrap_or_default();
        list.lines().map(str::to_owned).collect()
    }

    /// The folder at `CVG_PROVE_ROOT`, or in the user's cache; made where it is not there.
    pub(crate) fn ready() -> Result<Self, String> {
        let folder = place()?;
        let root = Self { folder };
        if fs::read_to_string(root.folder.join("recipe")).is_ok_and(|r| r == RECIPE) && root.is_pinned().is_ok() {
            return Ok(root);
        }
        println!("setting up the proof tools in {} (once; some 1.3 GB)", root.folder.display());
        set_up(&root.folder)?;
        root.is_pinned()?;
        fs::write(root.folder.join("recipe"), RECIPE).map_err(|e| e.to_string())?;
        Ok(root)
    }

    /// The tools are those that are pinned.
    fn is_pinned(&self) -> Result<(), String> {
        let missing = pins::missing(&self.packages());
        if missing.is_empty() { Ok(()) } else { Err(format!("other tools than those that are pinned: no {missing:?}")) }
    }
}

fn place() -> Result<PathBuf, String> {
    let from = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    from("CVG_PROVE_ROOT")
        .or_else(|| from("XDG_CACHE_HOME").map(|p| p.join(format!("cvg/prove-{RECIPE}"))))
        .or_else(|| from("HOME").map(|p| p.join(format!(".cache/cvg/prove-{RECIPE}"))))
        .ok_or_else(|| "no place for the proof tools: set CVG_PROVE_ROOT".to_owned())
}

fn checked(command: &mut Command) -> Result<(), String> {
    let shown = format!("{command:?}");
    let output = command.output().map_err(|e| format!("{shown}: {e}"))?;
    if output.status.success() {
        Ok(())
    } else {
        Err(format!("{shown}: {}\n{}", output.status, String::from_utf8_lossy(&output.stderr)))
    }
}

fn set_up(folder: &Path) -> Result<(), String> {
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        return Err("the proof tools are Debian's for x86-64 Linux; elsewhere use `cargo kani`".to_owned());
    }
    let io = |e: std::io::Error| e.to_string();
    if folder.exists() {
        fs::remove_dir_all(folder).map_err(io)?;
    }
    for part in ["apt/state/lists/partial", "apt/cache/archives/partial", "apt/etc/apt.conf.d", "apt/etc/preferences.d"]
    {
        fs::create_dir_all(folder.join(part)).map_err(io)?;
    }
    let archives = unpack(folder)?;
    fs::write(folder.join("packages.txt"), archives.join("\n")).map_err(io)?;
    fs::remove_dir_all(folder.join("apt")).map_err(io)?;

    let usr = folder.join("usr");
    fs::create_dir_all(folder.join("bin")).map_err(io)?;
    for tool in TOOLS {
        let script = format!(
            "#!/bin/sh\nexec {usr}/lib64/ld-linux-x86-64.so.2 --argv0 \"$0\" \
             --library-path {usr}/lib/x86_64-linux-gnu:{usr}/lib {usr}/bin/{tool} \"$@\"\n",
            usr = usr.display()
        );
        let path = folder.join("bin").join(tool);
        fs::write(&path, script).map_err(io)?;
        checked(Command::new("chmod").arg("+x").arg(&path))?;
        checked(Command::new(&path).arg("--version"))?;
    }
    // beside them lie the headers of Debian's C library, which are not the compiler's here
    fs::create_dir_all(folder.join("include")).map_err(io)?;
    for header in ["wasm-rt.h", "wasm-rt-exceptions.h"] {
        fs::copy(usr.join("include").join(header), folder.join("include").join(header)).map_err(io)?;
    }
    Ok(())
}

/// Downloads and unpacks the packages and what they depend on; the names of their archives. From the mirror, and where
/// that has other versions by now, from Debian's archive of snapshots.
fn unpack(folder: &Path) -> Result<Vec<String>, String> {
    let io = |e: std::io::Error| e.to_string();
    let mirror = std::env::var("CVG_PROVE_MIRROR").unwrap_or_else(|_| "http://deb.debian.org/debian".to_owned());
    let snapshot = format!("http://snapshot.debian.org/archive/debian/{}", pins::DAY);
    download(folder, &mirror)
        .or_else(|now| download(folder, &snapshot).map_err(|then| format!("{mirror}: {now}\n{snapshot}: {then}")))?;
    let mut names = Vec::new();
    for entry in fs::read_dir(folder.join("apt/cache/archives")).map_err(io)?.flatten() {
        let path = entry.path();
        if path.extension().is_some_and(|e| e == "deb") {
            checked(Command::new("dpkg-deb").arg("-x").arg(&path).arg(folder))?;
            names.extend(path.file_stem().map(|stem| stem.to_string_lossy().into_owned()));
        }
    }
    names.sort();
    Ok(names)
}

/// The archives of the pinned packages and of what they depend on, in `apt`'s cache.
fn download(folder: &Path, mirror: &str) -> Result<(), String> {
    let io = |e: std::io::Error| e.to_string();
    let keys = "/usr/share/keyrings/debian-archive-keyring.gpg";
    if !Path::new(keys).exists() {
        return Err(format!("{keys} is missing (package debian-archive-keyring)"));
    }
    let apt = folder.join("apt");
    fs::write(apt.join("etc/sources.list"), format!("deb [signed-by={keys}] {mirror} sid main\n")).map_err(io)?;
    fs::write(apt.join("state/status"), "").map_err(io)?;
    let configuration = apt.join("apt.conf");
    let settings = format!(
        "Dir \"{apt}\";\nDir::State \"{apt}/state\";\nDir::State::status \"{apt}/state/status\";\n\
         Dir::Cache \"{apt}/cache\";\nDir::Etc \"{apt}/etc\";\nDir::Log \"{apt}\";\n\
         APT::Architecture \"amd64\";\nAPT::Architectures {{ \"amd64\"; }};\nAPT::Install-Recommends \"false\";\n\
         APT::Sandbox::User \"\";\nAcquire::Languages \"none\";\n\
         // a mirror that stands still is as good: signatures are checked all the same\n\
         Acquire::Check-Valid-Until \"false\";\n",
        apt = apt.display()
    );
    fs::write(&configuration, settings).map_err(io)?;
    let get = || {
        let mut command = Command::new("apt-get");
        command.env("APT_CONFIG", &configuration).arg("-qq");
        command
    };
    checked(get().arg("update"))?;
    checked(get().args(["install", "-y", "--download-only"]).args(pins::requests()))
}
