//! Which tools prove: these versions and no others, from wherever Debian still has them.

/// The tools and what of theirs decides an answer, as Debian's unstable had them on [`DAY`].
pub(super) const PINNED: [(&str, &str); 10] = [
    ("bitwuzla", "0.8.2-4+b1"),
    ("libbitwuzla0", "0.8.2-4+b1"),
    ("cbmc", "6.6.0-4"),
    ("minisat", "1:2.2.1-8"),
    ("wabt", "1.0.42+dfsg+~cs1.0.39-2"),
    ("rustc", "1.97.1+dfsg1-1"),
    ("libstd-rust-dev-wasm32", "1.97.1+dfsg1-1"),
    ("libllvm22", "1:22.1.8-3"),
    ("lld", "1:21.1.8-74"),
    ("lld-21", "1:21.1.8-14"),
];

/// The day of which Debian's archive of snapshots is asked where the mirror has gone on.
pub(super) const DAY: &str = "20261030T080000Z";

/// What `apt-get` is asked to install.
pub(super) fn requests() -> impl Iterator<Item = String> {
    PINNED.iter().map(|(name, version)| format!("{name}={version}"))
}

/// The names of the pinned packages' archives, without the architecture.
fn archives() -> impl Iterator<Item = String> {
    PINNED.iter().map(|(name, version)| format!("{name}_{}", version.replace(':', "%3a")))
}

/// What of the pinned versions is not among `unpacked`, the names of archives.
pub(super) fn missing(unpacked: &[String]) -> Vec<String> {
    let there = |archive: &String| {
        unpacked.iter().any(|name| name.strip_prefix(archive.as_str()).is_some_and(|rest| rest.starts_with('_')))
    };
    archives().filter(|archive| !there(archive)).collect()
}

#[cfg(test)]
mod tests {
    use super::{archives, missing, requests};

    #[test]
    fn another_version_of_a_tool_is_missed() {
        let all: Vec<String> = archives().map(|name| format!("{name}_amd64")).collect();
        assert_eq!(missing(&all), [""; 0]);
        let newer: Vec<String> = all.iter().map(|name| name.replace("cbmc_6.6.0-4", "cbmc_6.6.0-40")).collect();
        assert_eq!(missing(&newer), ["cbmc_6.6.0-4"]);
        assert_eq!(missing(&all[1..]), ["bitwuzla_0.8.2-4+b1"]);
        assert!(all.contains(&"lld_1%3a21.1.8-74_amd64".to_owned()));
        assert!(requests().any(|r| r == "minisat=1:2.2.1-8"));
    }
}
