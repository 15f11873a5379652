//! A recording walked through the filter that flies: the same regressors, the same gates, the same rules for what is not
//! known. What a bench has and an instrument in operation has not is the recording itself, which can be walked again about
//! what was learned: each pass linearises anew.
//!
//! Numbers are taken to be constant, as long as the recording is: nothing is forgotten but by the integrals.

use cvg_model::{AxisForces, Envelope, Float, Pendulum};

use crate::commit::SHARED;
use crate::complex::Complex;
use crate::correction::Correction;
use crate::cycle::{Doubt, MEASURE};
use crate::parameters::{DETECTION, N, Parameter, get};
use crate::regressors::CHANNELS;
use crate::state::{Commit, Filter, Schedule, State};
use crate::status::Status;
use crate::window::{Push, Sums};
use crate::{Calibrator, ConfigError, Settings};

/// A recording on its way through the filter.
#[derive(Clone, Copy, Debug)]
pub struct Replay<T> {
    calibrator: Calibrator<T>,
    /// the share of a row for which forces are held
    held: T,
    state: State<T>,
    learning: Learning,
    /// a row before this one, without a gap between
    follows: bool,
    /// as of the end of the last pass
    doubt: Option<Doubt<T>>,
    /// what is taken for noise, in place of what the filter makes of it on its way
    levels: Option<[T; CHANNELS]>,
    turning: u32,
    precessing: u32,
}

/// What a pass is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Learning {
    /// to learn
    On,
    /// to see what is left with what is known
    Off,
}

/// What a cycle shows that was not predicted: ln of the amplitude, angle, ellipticity, rad; each where it counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovations<T> {
    /// amplitude, angle, ellipticity
    pub of: [Option<T>; CHANNELS],
    /// the instrument is taken to turn
    pub turning: bool,
}

/// No instrument is like what a pass found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Implausible;

impl<T: Float> Replay<T> {
    /// The first pass, about a perfect instrument of the damping as designed. A control step is a row here; forces are held
    /// on their axes for `hold_s`, which is less where rows are some of the control steps.
    ///
    /// # Errors
    /// A setting outside its domain.
    pub fn new(settings: &Settings, hold_s: f64) -> Result<Self, ConfigError> {
        if settings.steps < 2 {
            return Err(ConfigError { parameter: "steps", expected: "at least 2" });
        }
        if !(0.0..=settings.control_s).contains(&hold_s) {
            return Err(ConfigError { parameter: "hold_s", expected: "at most a row" });
        }
        let calibrator = Calibrator::of_cycles(settings)?;
        let mut replay = Self {
            calibrator,
            held: T::from_f64(hold_s / settings.control_s),
            state: calibrator.start(),
            learning: Learning::On,
            follows: false,
            doubt: None,
            levels: None,
            turning: 0,
            precessing: 0,
        };
        replay.begin(0, Learning::On);
        Ok(replay)
    }

    /// Another pass over all of it, about what is in force; the coarser, the lower the `stage` (0 to 4).
    pub fn begin(&mut self, stage: u8, learning: Learning) {
        let s = &mut self.state;
        if learning == Learning::On {
            let noise = s.filter.noise;
            s.filter = Filter { noise, ..Filter::new() };
        }
        s.schedule = Schedule { stage, ..Schedule::new(0) };
        s.before.whole = false;
        s.sums = Sums::after(s.direction);
        s.step = 0;
        (self.learning, self.follows, self.turning, self.precessing) = (learning, false, 0, 0);
    }

    /// From here on, this is the white noise of amplitude, angle and ellipticity, a cycle's, rad².
    pub fn expect(&mut self, variances: [T; CHANNELS]) {
        self.levels = Some(variances.map(|v| if v > T::zero() && v.is_finite() { v } else { T::one() }));
    }

    /// What follows does not follow what came before.
    pub fn interrupt(&mut self) {
        self.state.sums.spoil();
        self.follows = false;
    }

    /// A row: the readout as it came, and what was put out to the drives, V.
    pub fn row(&mut self, seen: &Envelope<T>, forces: &AxisForces<T>) -> Option<Innovations<T>> {
        let (c, s) = (&self.calibrator, &mut self.state);
        let e = s.correction.readout(seen, c.amplitude_v, c.per_amplitude);
        let p = c.normal(&e.pendulum());
        let (sin, cos) = p.angle().sin_cos();
        let now = if e.x_c * cos + e.y_c * sin < T::zero() { (-cos, -sin) } else { (cos, sin) };
        let before = if self.follows { s.direction } else { now };
        if !self.follows {
            s.sums.begin(now);
        }
        let push = c.pushed(s, &p, now, forces);
        let known = s.correction.known;
        s.sums.add_exactly(&p, now, before, &push, self.held, &known);
        s.direction = now;
        self.follows = true;
        s.step += 1;
        if s.step < c.steps {
            return None;
        }
        s.step = 0;
        s.closed = s.sums;
        s.sums = Sums::after(now);
        Some(self.cycle())
    }

    fn cycle(&mut self) -> Innovations<T> {
        let (c, s) = (&self.calibrator, &mut self.state);
        let mut seen = Innovations { of: [None; CHANNELS], turning: false };
        c.close(s);
        if !s.schedule.live {
            return seen;
        }
        s.closed.direct(&mut s.sample);
        c.integrate_all(s, 1);
        let doubt = self.doubt.unwrap_or_else(|| Doubt::of(s));
        // a pass has no stages to go back to
        let stage = core::mem::replace(&mut s.schedule.stage, 1);
        c.notice(s, doubt);
        s.schedule.stage = stage;
        c.integrate_all(s, 0);
        c.integrate_all(s, 2);
        for channel in 0..CHANNELS {
            if let Some(levels) = self.levels {
                s.filter.noise = levels;
            }
            c.measure(s, channel, 0);
            if s.schedule.accept
                && let (Some(slot), Some(e)) = (seen.of.get_mut(channel), s.filter.innovation.get(channel))
            {
                *slot = Some(*e);
            }
            if self.learning == Learning::Off {
                s.schedule.accept = false;
            }
            for k in 1..MEASURE {
                c.measure(s, channel, k);
            }
        }
        seen.turning = s.schedule.excited;
        let counted = if seen.turning { &mut self.turning } else { &mut self.precessing };
        *counted = counted.saturating_add(u32::from(seen.turning || seen.of.iter().all(Option::is_some)));
        seen
    }

    /// The end of a pass: what it told goes into force, by the rules of a commit. Returns how far the farthest of it moved,
    /// in standard deviations.
    ///
    /// # Errors
    /// [`Implausible`], and nothing is moved.
    pub fn relinearise(&mut self) -> Result<T, Implausible> {
        let (c, s) = (&self.calibrator, &mut self.state);
        s.schedule.commit = Commit::Forth;
        s.schedule.stage = s.schedule.stage.max(1);
        for k in 0..SHARED {
            c.commit_slice(s, k);
        }
        s.schedule.commit = Commit::None;
        let trial = core::mem::replace(&mut s.trial, [T::zero(); N]);
        s.score = T::zero();
        s.correction = s.correction.moved(&trial).and_then(|c| c.skews_in_phase()).ok_or(Implausible)?;
        let mut farthest = T::zero();
        for (j, ((mean, delta), p)) in s.filter.mean.iter_mut().zip(&trial).zip(Parameter::ALL).enumerate() {
            let delta = *delta / p.expected::<T>();
            *mean = *mean - delta;
            let far = delta.magnitude() / s.filter.ud.variance(j).sqrt();
            farthest = if far > farthest { far } else { farthest };
        }
        if s.schedule.angle_used >= c.cycles(10) {
            self.doubt = Some(Doubt::of(s));
        }
        Ok(farthest)
    }

    /// What is in force.
    pub fn correction(&self) -> &Correction<T> {
        &self.state.correction
    }

    /// What is in force, and what is believed of the detection beyond it; none where no instrument is like that.
    pub fn believed(&self) -> Option<Correction<T>> {
        let mut all = [T::zero(); N];
        for (slot, p) in all.iter_mut().zip(Parameter::ALL).skip(N - DETECTION) {
            *slot = self.left(p);
        }
        self.state.correction.moved(&all).and_then(|c| c.skews_in_phase())
    }

    /// What is believed of a parameter beyond what is in force, in its unit.
    pub fn left(&self, p: Parameter) -> T {
        get(&self.state.filter.mean, p) * p.expected::<T>()
    }

    /// Whether the pass told a parameter, rather than the expectation of devices.
    pub fn told(&self, p: Parameter) -> bool {
        let seen = self.state.schedule.angle_used >= self.calibrator.cycles(10);
        self.state.filter.ud.variance(p as usize) < T::ratio(1, 4) && (seen || !p.needs_known_precession())
    }

    /// Variance of a sum of parameters, each in its unit and times a factor.
    pub fn variance(&self, of: &[(Parameter, T)]) -> T {
        let mut h = [T::zero(); N];
        for (p, by) in of {
            if let Some(slot) = h.get_mut(*p as usize) {
                *slot = *slot + *by * p.expected::<T>();
            }
        }
        self.state.filter.ud.variance_along(&h)
    }

    /// White noise of amplitude, angle and ellipticity, a cycle's, rad.
    pub fn noise(&self) -> [T; CHANNELS] {
        self.state.filter.noise.map(cvg_model::Real::sqrt)
    }

    /// Seconds of this pass at rest with the angle in use, and turning.
    pub fn seconds(&self) -> [T; 2] {
        let of = |cycles: u32| T::from_f64(f64::from(cycles)) * self.calibrator.cycle_s;
        [of(self.precessing), of(self.turning)]
    }

    /// What is known, as in operation.
    pub fn status(&self) -> Status<T> {
        self.calibrator.status(&self.state)
    }
}

impl<T: Float> Calibrator<T> {
    /// What forces on the axes push of a vibration along `now`, the drives as they are known, in amplitudes per second.
    fn pushed(&self, s: &State<T>, p: &Pendulum<T>, (cos, sin): (T, T), f: &AxisForces<T>) -> Push<T> {
        let (x, y) = s.correction.drives.apply(Complex::new(f.x_s, f.x_c), Complex::new(f.y_s, f.y_c));
        let per_v = self.drive_per_s * self.per_amplitude;
        let (a_s, q_s) = (cos * x.re + sin * y.re, cos * y.re - sin * x.re);
        let (a_c, q_c) = (cos * x.im + sin * y.im, cos * y.im - sin * x.im);
        let lead = -(T::half() * p.l / p.e);
        let (along, across) = (-(a_s * per_v), a_c * per_v);
        let (aside, quadrature) = (-(q_s * per_v), q_c * per_v);
        Push {
            along: along - lead * across,
            across: across + lead * along,
            aside: aside - lead * quadrature,
            quadrature: quadrature + lead * aside,
        }
    }
}

#[cfg(test)]
#[path = "tests/replay.rs"]
mod tests;
