//! Any bytes as a campaign file beside some recordings: opened or refused, never a panic; what is opened is
//! written, with its recordings, and opened again as the same.

use std::fs::{self, File};
use std::path::Component;
use std::sync::LazyLock;

use cvg_recording::{Campaign, Run, limit_memory};
use tempfile::TempDir;

use super::csv::{ALLOWED, admitted, as_promised};

/// Where a campaign and its recordings are written.
static AGAIN: LazyLock<TempDir> = LazyLock::new(|| TempDir::new().expect("a temporary folder"));
/// Where recordings lie.
static FOLDER: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = TempDir::new().expect("a temporary folder");
    let rotation = "t_s,rate_dps,xc_v,yc_v\n0,500,1,0\n0.5,500,0.9,0.1\n1,500,0.8,0.2\n";
    let ringdown = "t_s,xc_v,yc_v,vas_v\n0,1,0,-0.1\n1,1,0,-0.1\n2,0.9,0,0\n";
    let film = "t_s,x_v,y_v\n0,1,2\n1,2,3\n2,1,1\n";
    let angle = "t_s,theta_deg\n0,1\n1,2\n2,3\n";
    let pair = "t_s,xc_v,yc_v,temp_c\n0,1,0,20\n1,0,1,21\n2,-1,0,22\n";
    let turned = "t_s,xc_v,xs_v,yc_v,ys_v,vas_v,vqc_v,virtual_dps\n0,1,0,0,0,-0.1,0,10\n1,0.9,0,0.1,0,-0.1,0,10\n2,0.8,0,0.2,0,-0.1,0,10\n";
    let foreign =
        "Time (ms),Gyro (rad/s),Pos [mrad],A (mV),B (counts)\n0,0,0,1,2\n500,1,1,2,1\n700,,1,3,3\n1000,1,2,1,2\n";
    let files = [
        ("rot.csv", rotation),
        ("ring.csv", ringdown),
        ("film.csv", film),
        ("angle.csv", angle),
        ("pair.csv", pair),
        ("foreign.csv", foreign),
        ("turned.csv", turned),
    ];
    for (name, text) in files {
        fs::write(folder.path().join(name), text).expect("a temporary file");
    }
    // three rows of two channels as f32, six as i16, and half a row
    let scope: Vec<u8> = (0..13_i16).flat_map(|k| (k * 1021).to_le_bytes()).collect();
    fs::write(folder.path().join("scope.bin"), scope).expect("a temporary file");
    folder
});

pub fn run(bytes: &[u8]) {
    limit_memory(ALLOWED);
    let path = FOLDER.path().join("campaign.toml");
    fs::write(&path, bytes).expect("a temporary file");
    let Some(campaign) = admitted(Campaign::open(&path)) else { return };
    campaign.runs.iter().for_each(|run| as_promised(&run.recording));
    assert!(campaign.all_warnings().all(|warning| !warning.is_empty()));
    assert!(Campaign::columns(&path).is_ok(), "what was opened names its columns");
    // those that lie beside it; of two of one name that with more columns is written last
    let is_beside = |run: &&Run| run.file.components().eq([Component::Normal(run.file.as_os_str())]);
    let mut runs: Vec<&Run> = campaign.runs.iter().filter(is_beside).collect();
    if runs.len() < campaign.runs.len() {
        return;
    }
    runs.sort_by_key(|run| run.recording.rate_dps.is_some());
    for run in runs {
        let file = File::create(AGAIN.path().join(&run.file)).expect("a temporary file");
        run.recording.write_csv(file).expect("what was read can be written");
    }
    let text = campaign.to_toml();
    let path = AGAIN.path().join("campaign.toml");
    fs::write(&path, &text).expect("a temporary file");
    let again = Campaign::open(&path).unwrap_or_else(|error| panic!("{error}: {text}"));
    assert_eq!(again.to_toml(), text);
}
