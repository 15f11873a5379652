//! What devices live through, and many of them at once.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use cvg_calibrator::Settings;
use cvg_model::Float;

use super::{CONTROL_S, Device, Loop, Moment};

/// What a device lives through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Life {
    /// at rest for ever
    Rest,
    /// at rest, turned by hand for ten seconds after five minutes, 30 to 90 deg/s
    RestThenHand,
    /// 0 to 300 deg/s, another rate every three seconds
    Turning,
    /// two minutes at rest, then 1 to 10 deg/s, another rate every five seconds
    RestThenSlow,
    /// the same without the rest
    Slow,
    /// at rest, a second split after four minutes
    SecondSplit,
}

/// A life, moment by moment.
pub struct Profile {
    life: Life,
    steps: Vec<f64>,
}

impl Profile {
    /// The profile of a seed.
    pub fn new(life: Life, seed: u64) -> Self {
        let mut r = ChaCha8Rng::seed_from_u64(seed ^ 0xabcd_0000);
        let (low, high) = match life {
            Life::Turning => (0.0, 300.0),
            Life::RestThenHand => (30.0, 90.0),
            _ => (1.0, 10.0),
        };
        let steps = (0..400)
            .map(|_| {
                let v: f64 = low + (high - low) * r.random::<f64>();
                if r.random::<bool>() { v } else { -v }
            })
            .collect();
        Self { life, steps }
    }

    fn at(&self, t: f64, hold: f64) -> f64 {
        // a body can't step: 50 ms to either side
        let i = (t / hold).floor();
        let into = t - i * hold;
        let now = self.steps[i as usize];
        let next = self.steps[i as usize + 1];
        let before = if i > 0.0 { self.steps[i as usize - 1] } else { 0.0 };
        let w = if into < 0.05 {
            before + (now - before) * (0.5 + into / 0.1)
        } else if into > hold - 0.05 {
            now + (next - now) * (into - hold + 0.05) / 0.1
        } else {
            now
        };
        w.to_radians()
    }

    /// What happens at `t` s.
    pub fn moment(&self, t: f64) -> Moment {
        let earth = (10.0_f64 / 3600.0).to_radians();
        let mut m = Moment { rate_rad_s: earth, ..Moment::default() };
        match self.life {
            Life::Rest => {}
            Life::RestThenHand if (300.0..310.0).contains(&t) => m.rate_rad_s = self.at(t - 300.0, 5.0),
            Life::Turning => m.rate_rad_s = self.at(t, 3.0),
            Life::RestThenSlow if t >= 120.0 => m.rate_rad_s = self.at(t - 120.0, 5.0),
            Life::Slow => m.rate_rad_s = self.at(t, 5.0),
            Life::SecondSplit => m.tuned = t >= 240.0,
            _ => {}
        }
        m
    }
}

/// A device lives for some seconds.
pub fn lived<'a, T: Float>(device: &'a Device, seed: u64, life: Life, seconds: f64) -> Loop<'a, T> {
    lived_under(device, seed, life, seconds, |_| ())
}

/// The same, `seen` after every second.
pub fn lived_under<'a, T: Float>(
    device: &'a Device,
    seed: u64,
    life: Life,
    seconds: f64,
    mut seen: impl FnMut(&Loop<'a, T>),
) -> Loop<'a, T> {
    let profile = Profile::new(life, seed);
    let mut run = Loop::<T>::new(device, seed, &Settings::default());
    for i in 0..steps(seconds) {
        run.step(profile.moment(run.t), true);
        if life == Life::SecondSplit && i == steps(240.0) {
            run.calibrator.split_changed(&mut run.state);
        }
        if (i + 1) % steps(1.0) == 0 {
            seen(&run);
        }
    }
    run
}

/// Control steps of some seconds.
pub fn steps(seconds: f64) -> usize {
    (seconds / CONTROL_S) as usize
}

/// `trial` of every number below `count`, on all processors.
pub fn all<R: Send>(count: u64, trial: impl Fn(u64) -> R + Sync) -> Vec<R> {
    let next = std::sync::atomic::AtomicU64::new(0);
    let workers = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let mut done: Vec<(u64, R)> = std::thread::scope(|scope| {
        let work = || {
            let mut mine = Vec::new();
            loop {
                let number = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                if number >= count {
                    return mine;
                }
                mine.push((number, trial(number)));
            }
        };
        let handles: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        handles.into_iter().flat_map(|h| h.join().expect("a trial that ends")).collect()
    });
    done.sort_by_key(|(number, _)| *number);
    done.into_iter().map(|(_, result)| result).collect()
}
