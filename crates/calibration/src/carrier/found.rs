//! Where the carrier is: the highest peak of the spectrum of both channels.

use realfft::RealFftPlanner;

use super::Carrier;
use crate::error::Refusal;
use crate::numerics::statistics::median;

/// Rows that are transformed at most.
const MOST_ROWS: usize = 1 << 17;
/// How far from what the campaign states a carrier is looked for.
const NEAR: f64 = 0.2;
/// Bins next to zero that belong to the rest point and its drift.
const REST: usize = 4;
/// Power of a carrier over the usual bin's.
const STANDS_OUT: f64 = 100.0;
/// Points a period that a carrier needs.
const FEWEST_POINTS: f64 = 2.2;

/// Frequency of the carrier, Hz, near `stated_hz` where that is given.
///
/// # Errors
/// Where no peak stands out, or the rows are too few.
pub(crate) fn frequency(carrier: Carrier<'_>, name: &str, stated_hz: Option<f64>) -> Result<f64, Refusal> {
    let refuse =
        |problem: String| Err(Refusal::no_answer(name, problem, "x_v and y_v with a carrier, several points a period"));
    let n = carrier.t_s.len().min(MOST_ROWS);
    if n < 32 {
        return refuse(format!("{n} rows are too few to find a carrier in"));
    }
    let step_s = carrier.step_s();
    let Some(power) = spectrum(&carrier, n, step_s) else { return refuse("the carrier has no spectrum".into()) };
    let bin_hz = 0.5 / (step_s * (power.len() - 1) as f64);
    let near = |bin: usize| stated_hz.is_none_or(|f| (bin as f64 * bin_hz / f - 1.0).abs() < NEAR);
    let candidates = (REST..power.len() - 1).filter(|b| near(*b));
    let Some(peak) = candidates.max_by(|a, b| power[*a].total_cmp(&power[*b])) else {
        return refuse(format!("the stated carrier of {} Hz is beyond half the sample rate", stated_hz.unwrap_or(0.0)));
    };
    let usual = median(&mut power.clone());
    if power[peak].is_nan() || power[peak] <= STANDS_OUT * usual {
        return refuse("no carrier stands out of the spectrum".into());
    }
    // the top of the parabola through the logarithms about the peak of a Hann window
    let [below, top, above] = [power[peak - 1], power[peak], power[peak + 1]].map(|p| (p + f64::MIN_POSITIVE).ln());
    let curvature = below - 2.0 * top + above;
    let shift = if curvature < 0.0 { (0.5 * (below - above) / curvature).clamp(-0.5, 0.5) } else { 0.0 };
    let found = (peak as f64 + shift) * bin_hz;
    if found * step_s * FEWEST_POINTS > 1.0 {
        return refuse(format!("the carrier of {found:.4} Hz has fewer than {FEWEST_POINTS} points a period"));
    }
    Ok(found)
}

/// Power over frequency of the first `n` rows of both channels, brought to even steps.
fn spectrum(carrier: &Carrier<'_>, n: usize, step_s: f64) -> Option<Vec<f64>> {
    let mut planner = RealFftPlanner::<f64>::new();
    let size = (2 * n).next_power_of_two();
    let transform = planner.plan_fft_forward(size);
    let mut spectrum = transform.make_output_vec();
    let mut power = vec![0.0; spectrum.len()];
    for values in [carrier.x, carrier.y] {
        let mut buffer = transform.make_input_vec();
        let mean = values[..n].iter().sum::<f64>() / n as f64;
        let mut at = 0;
        for (i, b) in buffer.iter_mut().take(n).enumerate() {
            let t = carrier.t_s[0] + i as f64 * step_s;
            while at + 2 < carrier.t_s.len() && carrier.t_s[at + 1] < t {
                at += 1;
            }
            let (t0, t1) = (carrier.t_s[at], carrier.t_s[at + 1]);
            let share = ((t - t0) / (t1 - t0)).clamp(0.0, 1.0);
            let value = values[at] + share * (values[at + 1] - values[at]) - mean;
            let hann = (std::f64::consts::PI * (i as f64 + 0.5) / n as f64).sin().powi(2);
            *b = hann * value;
        }
        transform.process(&mut buffer, &mut spectrum).ok()?;
        for (p, c) in power.iter_mut().zip(&spectrum) {
            *p += c.norm_sqr();
        }
    }
    Some(power)
}
