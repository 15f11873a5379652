//! What was learned enters the compensation: only along directions whose interval says that it helps.

use cvg_model::Float;

use crate::Calibrator;
use crate::cycle::{MEASURE, absorb, project};
use crate::parameters::{N, OTHERS, Parameter, Vector, dot, get, set};
use crate::state::{Commit, State};
use crate::ud::Ud;

const SHARE: u16 = MEASURE + 1;
/// The slice after that of the last parameter.
pub(crate) const SHARED: u16 = 37;
const LAST: u16 = 40;
/// Standard deviations of a direction that is committed.
const SIGMAS: f64 = 3.0;
/// The same while it turns: ratio and skew are told anew all the time then, and what is beyond its 95 % interval is followed.
const SIGMAS_TURNING: f64 = 2.0;
/// So many times what is expected of devices is no device.
const NO_DEVICE: i32 = 5;
/// How well the antisymmetric part of the split vanishes, rad/s.
const SYMMETRY: f64 = 1e-4;

impl<T: Float> Calibrator<T> {
    pub(crate) fn commit_slice(&self, s: &mut State<T>, k: u16) {
        if s.schedule.commit == Commit::Back {
            if k == LAST {
                self.take_back(s);
            }
            return;
        }
        match k {
            0 => self.symmetry(s),
            1..=5 if s.schedule.accept => {
                let h = s.trial;
                project(&s.filter.ud, &mut s.filter.update, &h, usize::from(k - 1) * 4, &mut s.filter.spread);
            }
            6 if s.schedule.accept => self.weigh(s),
            7..=18 if s.schedule.accept => absorb(&mut s.filter.ud, &mut s.filter.update, k - 7),
            19 if s.schedule.accept => {
                let by = s.score * s.filter.update.inverse();
                for (mean, gain) in s.filter.mean.iter_mut().zip(s.filter.update.gain()) {
                    *mean = *mean + *gain * by;
                }
            }
            MEASURE => self.decide(s),
            SHARE..SHARED => self.share(s, usize::from(k - SHARE)),
            LAST => self.put_in_force(s),
            _ => {}
        }
    }

    /// The split of a mechanism is symmetric: what looks antisymmetric in it is ratio and skew of the detection,
    ///
    /// $$0 = q_0 - \tfrac12(k_s\gamma + k_c s) + \psi d_s$$
    ///
    /// taken as one measurement between two commits. Uses [`State::trial`] for its row and [`State::score`] for its
    /// innovation: both begin anew with the commit.
    fn symmetry(&self, s: &mut State<T>) {
        let known = s.correction.known;
        let believed = |p: Parameter| get(&known, p) + get(&s.filter.mean, p) * p.expected::<T>();
        let mut h = [T::zero(); N];
        let mut along = |p: Parameter, v: T| set(&mut h, p, v * p.expected::<T>());
        along(Parameter::QuadratureRate, T::one());
        along(Parameter::DetectionRatio, -(T::half() * believed(Parameter::SplitSin)));
        along(Parameter::DetectionSkew, -(T::half() * believed(Parameter::SplitCos)));
        along(Parameter::DetectionPhase, believed(Parameter::AnisodampingSin));
        s.score = -get(&known, Parameter::QuadratureRate) - dot(&h, &s.filter.mean);
        s.trial = h;
        s.filter.spread = T::zero();
        let phase = s.filter.ud.variance(Parameter::ForcePhase as usize).sqrt() * Parameter::ForcePhase.expected::<T>();
        let seen = s.schedule.angle_used > self.cycles(10);
        s.schedule.accept = s.schedule.stage >= 4 && seen && phase < T::from_f64(1e-3);
    }

    /// The equation is one: it is used again only where it says more than what is known, and no better than it holds in
    /// the coordinates of a ratio and a skew that are still uncertain.
    fn weigh(&self, s: &mut State<T>) {
        let uses = s.schedule.uses_of_symmetry.saturating_add(1);
        let unknown = |p: Parameter| s.filter.ud.variance(p as usize) * p.expected::<T>().squared();
        let split = get(&s.correction.known, Parameter::SplitCos).norm(get(&s.correction.known, Parameter::SplitSin));
        let bent = T::half() * split * (unknown(Parameter::DetectionRatio) + unknown(Parameter::DetectionSkew));
        let noise = T::from_f64(SYMMETRY * SYMMETRY) * T::ratio(i32::from(uses), 1) + bent * bent;
        let all = s.filter.spread + noise;
        if s.filter.spread > T::ratio(4, 1) * noise && s.score * s.score < T::ratio(16, 1) * all {
            s.schedule.uses_of_symmetry = uses;
            s.filter.ud.open(&mut s.filter.update, noise);
        } else {
            s.schedule.accept = false;
        }
    }

    /// How much of the detection is committed. What the others are then is theirs given that.
    fn decide(&self, s: &mut State<T>) {
        let mut delta: Vector<T> = [T::zero(); N];
        if s.schedule.stage >= 2 {
            self.detection(s, &mut delta);
        }
        s.trial = delta;
    }

    fn detection(&self, s: &State<T>, delta: &mut Vector<T>) {
        let ud = &s.filter.ud;
        let (ratio, skew, phase) = (Parameter::DetectionRatio, Parameter::DetectionSkew, Parameter::DetectionPhase);
        let sigmas = if s.schedule.stage >= 4 && s.schedule.moving > 0 { SIGMAS_TURNING } else { SIGMAS };
        let beyond = T::from_f64(sigmas * sigmas);
        let m = get(&s.filter.mean, phase);
        let v = ud.variance(phase as usize);
        if m * m > beyond * v && v < T::ratio(1, 4) {
            set(delta, phase, m * phase.expected());
        }
        let (ug, us) = (ratio.expected::<T>(), skew.expected::<T>());
        let pgg = ud.variance(ratio as usize) * ug * ug;
        let pss = ud.variance(skew as usize) * us * us;
        let pgs = ud.covariance(ratio as usize, skew as usize) * ug * us;
        let (mg, ms) = (get(&s.filter.mean, ratio) * ug, get(&s.filter.mean, skew) * us);
        let (sin, cos) = (T::half() * (T::two() * pgs).atan2(pgg - pss)).sin_cos();
        let (mut g, mut k) = (T::zero(), T::zero());
        for (x, y) in [(cos, sin), (-sin, cos)] {
            let variance = x * x * pgg + T::two() * x * y * pgs + y * y * pss;
            let along = x * mg + y * ms;
            if along * along > beyond * variance {
                g = g + x * along;
                k = k + y * along;
            }
        }
        set(delta, ratio, g);
        set(delta, skew, k);
    }

    //= specs/self-calibration.md#excitation
    //# What was not excited MUST NOT be moved.
    /// The conditional mean of parameter `j` given what is committed of the detection.
    fn share(&self, s: &mut State<T>, j: usize) {
        let Some(p) = Parameter::ALL.get(j).copied() else { return };
        let ud = &s.filter.ud;
        let excess = |p: Parameter| get(&s.trial, p) / p.expected::<T>() - get(&s.filter.mean, p);
        let (phase, ratio, skew) = (OTHERS, OTHERS + 1, OTHERS + 2);
        let of_skew = excess(Parameter::DetectionSkew);
        let of_ratio = excess(Parameter::DetectionRatio) - ud.u(ratio, skew) * of_skew;
        let of_phase = excess(Parameter::DetectionPhase) - ud.u(phase, ratio) * of_ratio - ud.u(phase, skew) * of_skew;
        let given =
            get(&s.filter.mean, p) + ud.u(j, phase) * of_phase + ud.u(j, ratio) * of_ratio + ud.u(j, skew) * of_skew;
        let excited =
            ud.variance(j) < T::ratio(1, 4) && !(p.needs_known_precession() && s.schedule.angle_used < self.cycles(10));
        let coarse =
            matches!(p, Parameter::SplitCos | Parameter::SplitSin | Parameter::Damping | Parameter::ForceScale);
        if excited && (s.schedule.stage > 0 || coarse) {
            set(&mut s.trial, p, given * p.expected());
        }
    }

    /// Whether what is believed of the detection could be that of a device.
    fn is_of_a_device(&self, s: &State<T>) -> bool {
        let most = T::ratio(NO_DEVICE, 1);
        let believed = [
            (Parameter::DetectionRatio, s.correction.detection_ratio()),
            (Parameter::DetectionSkew, s.correction.detection_skew()),
            (Parameter::DetectionPhase, s.correction.detection_phase()),
        ];
        // false for NaN
        believed.into_iter().all(|(p, in_force)| (in_force / p.expected() + get(&s.filter.mean, p)).within(most))
    }

    fn put_in_force(&self, s: &mut State<T>) {
        s.schedule.commit = Commit::None;
        s.score = T::zero();
        let trial = s.trial;
        s.trial = [T::zero(); N];
        let Some(moved) = s.correction.moved(&trial).filter(|_| self.is_of_a_device(s)) else {
            // no instrument is like that: what led there is forgotten, but for the mechanics about which it is learned anew
            s.filter.ud = Ud::diagonal(T::one());
            s.filter.mean = [T::zero(); N];
            self.split_changed(s);
            return;
        };
        s.correction = moved;
        for ((mean, delta), p) in s.filter.mean.iter_mut().zip(&trial).zip(Parameter::ALL) {
            *mean = *mean - *delta / p.expected::<T>();
        }
        let sc = &mut s.schedule;
        let tracking = sc.stage >= 4;
        if sc.stage < 3 {
            let anew = sc.stage == 0 || sc.angle_used < self.cycles(10);
            let variance = if anew { T::one() } else { T::from_f64(0.01) };
            s.filter.forget_others(variance);
        }
        if !tracking {
            sc.stage += 1;
            sc.before_rest = 0;
        } else {
            for (slot, (delta, p)) in s.trial.iter_mut().zip(trial.iter().zip(Parameter::ALL)) {
                *slot = *delta / p.expected::<T>();
            }
        }
        self.resume(s);
    }

    //= specs/self-calibration.md#taken-back
    //# A commit that predicts what follows worse than the values before it MUST be taken back.
    fn take_back(&self, s: &mut State<T>) {
        s.schedule.commit = Commit::None;
        s.score = T::zero();
        let mut back = s.trial;
        s.trial = [T::zero(); N];
        for (slot, p) in back.iter_mut().zip(Parameter::ALL) {
            *slot = -(*slot * p.expected::<T>());
        }
        if let Some(moved) = s.correction.moved(&back) {
            s.correction = moved;
            s.taken_back = s.taken_back.saturating_add(1);
            for ((mean, delta), p) in s.filter.mean.iter_mut().zip(&back).zip(Parameter::ALL) {
                *mean = *mean - *delta / p.expected::<T>();
            }
        }
        self.resume(s);
    }

    /// The loops settle on the new compensation.
    fn resume(&self, s: &mut State<T>) {
        s.schedule.used = 0;
        s.schedule.swept = T::zero();
        s.schedule.settle = self.cycles(3) / 2;
        s.schedule.fresh = 0;
        s.before.whole = false;
    }
}
