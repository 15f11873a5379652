//! Any text as a calibration, by its own checksum and by the right one: read or refused, never a panic; what is read is
//! written and read again as the same, and what it makes of a recording is finite.

use std::sync::LazyLock;

use cvg_calibration::calibration::Calibration;
use cvg_calibration::compensate;
use cvg_calibration::recording::Recording;

/// A gyroscope with its commands, an angle, and two channels alone.
static RECORDINGS: LazyLock<[Recording; 3]> = LazyLock::new(|| {
    let mut texts = [
        "t_s,rate_dps,xc_v,xs_v,yc_v,ys_v,vas_v,vqc_v\n".to_owned(),
        "t_s,table_deg,theta_deg\n".to_owned(),
        "t_s,table_deg,xc_v,yc_v\n".to_owned(),
    ];
    for i in 0..60 {
        let t = f64::from(i) * 0.01;
        let (sin, cos) = (t * 400.0).to_radians().sin_cos();
        texts[0] += &format!("{t},500,{cos},0.001,{sin},0.002,0.01,0.001\n");
        texts[1] += &format!("{t},{},{}\n", t * 500.0, (t * 400.0).rem_euclid(180.0));
        texts[2] += &format!("{t},{},{cos},{sin}\n", t * 500.0);
    }
    texts.map(|text| Recording::parse_csv(text.as_bytes(), "r.csv".as_ref()).expect("a recording"))
});

const CHECKSUM: &str = "\n# checksum = \"crc32:";

pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let _ = Calibration::from_text(text, "as it is");
    let body = text.rsplit_once(CHECKSUM).map_or(text, |(body, _)| body);
    let sum = crc32(body.as_bytes());
    let Ok(calibration) = Calibration::from_text(&format!("{body}{CHECKSUM}{sum:08x}\"\n"), "summed") else { return };
    let written = calibration.to_text();
    let again = Calibration::from_text(&written, "again").unwrap_or_else(|e| panic!("{e}: {written}"));
    assert_eq!(again.to_text(), written);
    for recording in RECORDINGS.iter() {
        let Ok(made) = compensate(&calibration, recording) else { continue };
        let columns = [&made.xc_v, &made.yc_v, &made.theta_deg, &made.rate_dps, &made.table_deg];
        let is_finite = columns.into_iter().flatten().flatten().all(|v| v.is_finite());
        assert!(is_finite, "{written}");
    }
}

/// The checksum of a calibration, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |sum: u32, _| if sum & 1 == 1 { (sum >> 1) ^ 0xedb8_8320 } else { sum >> 1 };
    !bytes.iter().fold(u32::MAX, |sum, byte| (0..8).fold(sum ^ u32::from(*byte), step))
}
