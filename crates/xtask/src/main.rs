//! What the repository can do for itself.
//!
//! ```sh
//! cargo xtask prove [--only TEXT | --seconds N | --record]   # the bit-precise harnesses, by CBMC on the compiled code
//! cargo xtask audit                 # every equation, every requirement, and what this run says of it
//! cargo xtask faults [--only TEXT]... [--every N [--from K]] [--seconds N]   # faults that an engineer makes, planted; tests have to catch each
//! ```
#![forbid(unsafe_code)]

mod audit;
mod faults;
mod prove;
mod source;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

const USAGE: &str = "usage: cargo xtask prove [--only TEXT | --seconds N | --record] | cargo xtask audit [--keep-proofs] [--only TEXT] [--out FOLDER] | \
     cargo xtask faults [--only TEXT]... [--every N [--from K]] [--seconds N]";

/// What a task returns: whether everything held, or why it could not be found out.
type Outcome = Result<bool, String>;

/// The root of the repository.
fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).map(Path::to_owned).unwrap_or_default()
}

/// What `cargo xtask audit` is asked for.
fn request<'a>(options: &[&'a str]) -> Option<audit::Request<'a>> {
    let mut request = audit::Request::default();
    let mut options = options.iter();
    while let Some(option) = options.next() {
        match *option {
            "--keep-proofs" => request.keep_proofs = true,
            "--only" => request.only = Some(options.next()?),
            "--out" => request.folder = Some(options.next()?),
            _ => return None,
        }
    }
    Some(request)
}

/// What `cargo xtask prove` is asked for.
fn proved<'a>(options: &[&'a str]) -> Option<prove::Request<'a>> {
    let nothing = prove::Request::default();
    match *options {
        [] => Some(nothing),
        ["--record"] => Some(prove::Request { record: true, ..nothing }),
        ["--only", text] => Some(prove::Request { only: Some(text), ..nothing }),
        ["--seconds", n] => Some(prove::Request { most_s: Some(n.parse().ok()?), ..nothing }),
        _ => None,
    }
}

/// What `cargo xtask faults` is asked for.
fn planted(options: &[&str]) -> Outcome {
    let mut request = faults::Request::default();
    for pair in options.chunks(2) {
        match *pair {
            ["--only", text] => request.only.push(text),
            ["--every", n] => request.every = n.parse().map_err(|_| USAGE.to_owned())?,
            ["--from", k] => request.from = k.parse().map_err(|_| USAGE.to_owned())?,
            ["--seconds", n] => request.most_s = Some(n.parse().map_err(|_| USAGE.to_owned())?),
            _ => return Err(USAGE.to_owned()),
        }
    }
    faults::run(&request)
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    if arguments.iter().any(|a| matches!(*a, "--help" | "-h" | "help")) {
        println!("{USAGE}");
        return ExitCode::SUCCESS;
    }
    let outcome = match arguments[..] {
        ["prove", ref options @ ..] => proved(options).map_or_else(|| Err(USAGE.to_owned()), prove::run),
        ["faults", ref options @ ..] => planted(options),
        ["audit", ref options @ ..] => request(options).map_or_else(|| Err(USAGE.to_owned()), audit::run),
        _ => Err(USAGE.to_owned()),
    };
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(reason) => {
            eprintln!("not run: {reason}");
            ExitCode::from(2)
        }
    }
}
