//! `cvg`: files in, reports out.
//!
//! Exit status: 0 done, 1 the data does not allow an answer, 2 bad use or bad input. Messages and progress go to
//! standard error; standard output carries results only.
#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    cvg_cli::run()
}
