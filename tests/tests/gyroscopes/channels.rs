//! What the report says of every channel and of every step: with which harmonics, and how they scale.

use cvg_calibration::report::{ChannelHarmonic, ChannelReport};
use cvg_calibration::{Follows, Identification, Origin};

use cvg_model::effects::EffectId;
use cvg_simulator::Scenario;
use cvg_simulator::scenario::Run;
use cvg_tests::bench::{deviations, effect, found, identify, plain_paper};

fn channel<'a>(identified: &'a Identification, stage: &str, name: &str) -> &'a ChannelReport {
    let channels = &identified.report.channels;
    channels.iter().find(|c| c.stage == stage && c.channel == name).unwrap_or_else(|| panic!("no {name} at {stage}"))
}

fn harmonic(channel: &ChannelReport, of: Follows, n: u32) -> &ChannelHarmonic {
    channel.harmonics.iter().find(|h| h.of == of && h.n == n).unwrap()
}

/// Harmonics of the pattern beyond their intervals.
fn told(channel: &ChannelReport) -> Vec<u32> {
    let large = channel.harmonics.iter().filter(|h| h.of == Follows::Pattern && h.amplitude > 2.0 * h.ci95);
    large.map(|h| h.n).collect()
}

#[test]
fn the_cubic_readout_shows_in_angle_and_amplitude_by_its_scaling_and_is_gone_after() {
    let identified = identify(Scenario::paper().settings().clone()).unwrap();
    let angle = channel(&identified, "declared", "angle");
    let fourth = harmonic(angle, Follows::Pattern, 4);
    let scaling = fourth.scaling.unwrap();
    let (rate, amplitude) = (scaling.rate.unwrap(), scaling.amplitude.unwrap());
    println!(
        "4θ {:.4}° ∝ rate^({:.2} ± {:.2}) amplitude^({:.2} ± {:.2})",
        fourth.amplitude, rate.value, rate.ci95, amplitude.value, amplitude.ci95
    );
    assert!(rate.value.abs() <= rate.ci95.max(0.1), "a readout does not know the rate: {rate:?}");
    assert!(amplitude.ci95 < 0.5 && (amplitude.value - 2.0).abs() <= amplitude.ci95.max(0.1), "∝ a²: {amplitude:?}");
    assert_eq!(scaling.turns_with_direction, Some(false));
    assert!(told(channel(&identified, "declared", "amplitude")).contains(&4), "the readout bends the amplitude too");
    let after = channel(&identified, "discovered", "angle");
    assert!(after.white && told(after).is_empty(), "{:?}", told(after));
    assert!(after.autocorrelation[1..].iter().all(|r| r.abs() < 2.0 * after.band99), "{:?}", after.autocorrelation);
}

#[test]
fn the_spring_scales_with_one_over_the_rate_and_turns_with_the_direction() {
    let mut settings = plain_paper();
    settings.effects.push(effect(EffectId::SpringCubic, &[0.012, 0.008]));
    let identified = identify(settings).unwrap();
    let scaling = harmonic(channel(&identified, "declared", "angle"), Follows::Pattern, 4).scaling.unwrap();
    let rate = scaling.rate.unwrap();
    println!("4θ ∝ rate^({:.2} ± {:.2})", rate.value, rate.ci95);
    assert!((rate.value + 1.0).abs() <= rate.ci95.max(0.2), "{rate:?}");
    assert_eq!(scaling.turns_with_direction, Some(true));
}

#[test]
fn a_line_in_time_is_told_from_harmonics() {
    let mut settings = plain_paper();
    settings.effects.push(effect(EffectId::TimePeriodic, &[7.3, 2e-4, 0.0]));
    let identified = identify(settings).unwrap();
    let line = channel(&identified, "declared", "angle").line.unwrap();
    println!("{:.4} Hz, {:.5}° rms", line.frequency_hz, line.rms);
    assert!((line.frequency_hz - 7.3).abs() < 0.01, "{line:?}");
    // 2e-4 rad of amplitude
    assert!((line.rms - 2e-4f64.to_degrees() / 2f64.sqrt()).abs() < 0.1 * line.rms, "{line:?}");
    assert_eq!(channel(&identified, "discovered", "angle").line, None);
}

#[test]
fn every_recorded_channel_is_analysed_at_both_stages() {
    let identified = identify(plain_paper()).unwrap();
    for stage in ["declared", "discovered"] {
        for (name, unit) in [("angle", "deg"), ("amplitude", "1"), ("vas", "1/s"), ("vqc", "1/s"), ("quadrature", "1")]
        {
            let channel = channel(&identified, stage, name);
            assert_eq!(channel.unit, unit);
            assert!(channel.rms > 0.0 && channel.rms.is_finite(), "{stage} {name}: {}", channel.rms);
        }
    }
}

#[test]
fn paper_the_fourth_harmonic_is_removed_by_97_percent_and_the_spring_is_beaten() {
    let steps = identify(Scenario::paper().settings().clone()).unwrap().report.steps;
    let stages: Vec<&str> = steps.iter().map(|s| s.stage.as_str()).collect();
    assert_eq!(stages, ["raw", "declared", "discovered"]);
    assert!(steps.windows(2).all(|s| s[1].heldout.rms_deg < s[0].heldout.rms_deg), "{steps:?}");
    let fourth = |at: usize| steps[at].harmonics.iter().find(|h| h.n == 4).unwrap();
    println!("4θ {:.5}° to {:.5} ± {:.5}°", fourth(1).amplitude_deg, fourth(2).amplitude_deg, fourth(2).ci95_deg);
    assert!(fourth(2).amplitude_deg <= 0.03 * fourth(1).amplitude_deg, "{:?}", fourth(2));
    assert_eq!(steps[2].effect.as_deref(), Some("detection-cubic"));
    assert!(steps[2].rivals.iter().any(|r| r.id == "spring-cubic" && r.beaten_by > 100.0), "{:?}", steps[2].rivals);
}

/// With little quadrature left the angle shows a split by its square alone, in 4θ and in k: one of 0.7 rad/s along another axis
/// explains the fourth harmonic of a cubic readout, and only the quadrature command says that it is not there.
#[test]
fn at_low_rates_a_split_does_not_take_the_place_of_a_cubic_readout() {
    let mut settings = plain_paper();
    settings.noise_v = 3e-4;
    settings.effects.push(effect(EffectId::DetectionCubic, &[0.004]));
    settings.runs.retain(|r| matches!(r, Run::Rotation { rate_dps, .. } if rate_dps.abs() > 190.0));
    for (run, rate) in settings.runs.iter_mut().zip([10.0, -10.0, 20.0, -20.0]) {
        if let Run::Rotation { rate_dps, duration_s, amplitude, .. } = run {
            (*rate_dps, *duration_s, *amplitude) = (rate, 60.0, 1.0);
        }
    }
    settings.runs.truncate(4);
    let identified = identify(settings).unwrap();
    assert_eq!(found(&identified, Origin::Discovered), ["detection-cubic"]);
    let k = &identified.report.angular_gain;
    println!("k is {:+.2} deviations off", deviations(k, 0.78));
    assert!(deviations(k, 0.78).abs() < 4.0, "{k:?}");
}
