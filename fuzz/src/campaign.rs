//! Any bytes as a campaign file beside two recordings: opened or refused, never a panic; what is opened is written and
//! opened again as the same.

use std::fs;
use std::sync::LazyLock;

use cvg_calibration::recording::Campaign;
use tempfile::TempDir;

static FOLDER: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = TempDir::new().expect("a temporary folder");
    let rotation = "t_s,rate_dps,xc_v,yc_v\n0,500,1,0\n0.5,500,0.9,0.1\n1,500,0.8,0.2\n";
    let ringdown = "t_s,xc_v,yc_v,vas_v\n0,1,0,-0.1\n1,1,0,-0.1\n2,0.9,0,0\n";
    for (name, text) in [("rot.csv", rotation), ("ring.csv", ringdown)] {
        fs::write(folder.path().join(name), text).expect("a temporary file");
    }
    folder
});

pub fn run(bytes: &[u8]) {
    let path = FOLDER.path().join("campaign.toml");
    fs::write(&path, bytes).expect("a temporary file");
    let Ok(campaign) = Campaign::open(&path) else { return };
    let text = campaign.to_toml();
    fs::write(&path, &text).expect("a temporary file");
    let again = Campaign::open(&path).expect("what was written is opened");
    assert_eq!(again.to_toml(), text);
}
