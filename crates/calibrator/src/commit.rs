//! What was learned enters the compensation: only along directions whose interval says that it helps.

use core::ops::Range;

use cvg_model::Float;

use crate::Calibrator;
use crate::correction::Move;
use crate::cycle::{OPEN, TAKEN};
use crate::parameters::{N, OTHERS, Parameter, dot, get, set};
use crate::regressors::CHANNELS;
use crate::state::{Commit, State, Work};

/// The slices of a commit: the symmetry of the split as a measurement; what to move; the move.
const PROJECT: u16 = 3;
pub(crate) const WEIGH: u16 = PROJECT + OPEN - 1;
const ABSORB: u16 = WEIGH + 1;
const LEARN: u16 = WEIGH + TAKEN - OPEN;
pub(crate) const DECIDE: u16 = LEARN + 1;
const DECIDE_PAIR: u16 = DECIDE + 1;
const SHARE: u16 = DECIDE_PAIR + 1;
/// The slice after that of the last parameter.
pub(crate) const SHARED: u16 = SHARE + 4 * OTHERS as u16;
const BEGIN: u16 = SHARED + 1;
const MOVE: u16 = BEGIN + 1;
const MOVED: u16 = MOVE + Move::<f32>::PARTS;
const LEAVE: u16 = MOVED + 1;
const LEFT: u16 = LEAVE + 3;
/// So many parameters leave in a slice.
const LEAVING: usize = 7;

/// Standard deviations of a direction that is committed.
const SIGMAS: f64 = 3.0;
/// The same while it turns: ratio and skew are told anew all the time then, and what is beyond its 95 % interval is followed.
const SIGMAS_TURNING: f64 = 2.0;
/// So many times what is expected of devices is no device.
const NO_DEVICE: i32 = 5;
/// How well the antisymmetric part of the split vanishes, rad/s.
const SYMMETRY: f64 = 1e-4;

impl<T: Float> Calibrator<T> {
    #[inline(never)]
    pub(crate) fn commit_slice(&self, s: &mut State<T>, k: u16) {
        match k {
            SHARED.. => self.move_slice(s, k),
            _ if s.schedule.commit == Commit::Back => {}
            SHARE..SHARED => {
                let (j, n) = (usize::from((k - SHARE) / 4), (k - SHARE) % 4);
                if n < 3 {
                    s.filter.add_variance(j, n);
                } else {
                    self.share(s, j);
                }
            }
            _ => self.decide_slice(s, k),
        }
    }

    /// The symmetry of the split, and what is committed of the detection.
    #[inline(never)]
    fn decide_slice(&self, s: &mut State<T>, k: u16) {
        match k {
            0 => Self::symmetry(s),
            1 => Self::asymmetry(s),
            2 => self.symmetry_is_seen(s),
            DECIDE => self.decide_phase(s),
            DECIDE_PAIR => self.decide_ratio_and_skew(s),
            _ if !s.schedule.accept => {}
            PROJECT..WEIGH => s.project(CHANNELS, k - PROJECT),
            WEIGH => self.weigh(s),
            ABSORB..LEARN => s.filter.absorb(k - ABSORB),
            LEARN => s.filter.learn(s.score),
            _ => {}
        }
    }

    /// What was decided goes into force.
    #[inline(never)]
    fn move_slice(&self, s: &mut State<T>, k: u16) {
        match k {
            SHARED => self.judge(s),
            BEGIN => Self::begin(s),
            MOVE..MOVED => Self::advance(s, k - MOVE),
            MOVED => self.put_in_force(s),
            LEAVE..LEFT => {
                let first = LEAVING * usize::from(k - LEAVE);
                Self::leave(s, first..(first + LEAVING).min(N));
            }
            LEFT => self.end_commit(s),
            _ => {}
        }
    }

    /// The split of a mechanism is symmetric: what looks antisymmetric in it is ratio and skew of the detection,
    ///
    /// $$0 = q_0 - \tfrac12(k_s\gamma + k_c s) + \psi d_s$$
    ///
    /// taken as one measurement between two commits: its row. [`State::trial`] holds it and [`State::score`] its innovation,
    /// since both begin anew with the commit.
    #[inline(never)]
    fn symmetry(s: &mut State<T>) {
        let known = &s.correction.known;
        let believed = |p: Parameter| get(known, p) + get(&s.filter.mean, p) * p.expected::<T>();
        let mut h = [T::zero(); N];
        let mut along = |p: Parameter, v: T| set(&mut h, p, v * p.expected::<T>());
        along(Parameter::QuadratureRate, T::one());
        along(Parameter::DetectionRatio, -(T::half() * believed(Parameter::SplitSin)));
        along(Parameter::DetectionSkew, -(T::half() * believed(Parameter::SplitCos)));
        along(Parameter::DetectionPhase, believed(Parameter::AnisodampingSin));
        s.trial = h;
    }

    #[inline(never)]
    fn asymmetry(s: &mut State<T>) {
        s.score = -get(&s.correction.known, Parameter::QuadratureRate) - dot(&s.trial, &s.filter.mean);
        s.filter.spread = T::zero();
    }

    #[inline(never)]
    fn symmetry_is_seen(&self, s: &mut State<T>) {
        let phase = s.filter.ud.variance(Parameter::ForcePhase as usize).sqrt() * Parameter::ForcePhase.expected::<T>();
        let seen = s.schedule.angle_used > self.cycles(10);
        s.schedule.accept = s.schedule.stage >= 4 && seen && phase < T::from_f64(1e-3);
    }

    /// The equation is one: it is used again only where it says more than what is known, and no better than it holds in
    /// the coordinates of a ratio and a skew that are still uncertain.
    #[inline(never)]
    fn weigh(&self, s: &mut State<T>) {
        let uses = s.schedule.uses_of_symmetry.saturating_add(1);
        let unknown = |p: Parameter| s.filter.ud.variance(p as usize) * p.expected::<T>().squared();
        let split = get(&s.correction.known, Parameter::SplitCos).norm(get(&s.correction.known, Parameter::SplitSin));
        let bent = T::half() * split * (unknown(Parameter::DetectionRatio) + unknown(Parameter::DetectionSkew));
        let noise = T::from_f64(SYMMETRY * SYMMETRY) * T::ratio(i32::from(uses), 1) + bent * bent;
        let all = s.filter.spread + noise;
        if s.filter.spread > T::ratio(4, 1) * noise && s.score * s.score < T::ratio(16, 1) * all {
            s.schedule.uses_of_symmetry = uses;
            s.filter.open(noise);
        } else {
            s.schedule.accept = false;
        }
    }

    fn sigmas(s: &State<T>) -> T {
        let turning = s.schedule.stage >= 4 && s.schedule.moving > 0;
        if turning { T::from_f64(SIGMAS_TURNING) } else { T::from_f64(SIGMAS) }
    }

    /// How much of the detection is committed: its phase.
    #[inline(never)]
    fn decide_phase(&self, s: &mut State<T>) {
        s.trial = [T::zero(); N];
        if s.schedule.stage < 2 {
            return;
        }
        let phase = Parameter::DetectionPhase;
        let beyond = Self::sigmas(s).squared();
        let m = get(&s.filter.mean, phase);
        let v = s.filter.ud.variance(phase as usize);
        if m * m > beyond * v && v < T::ratio(1, 4) {
            set(&mut s.trial, phase, m * phase.expected());
        }
    }

    /// And its ratio and skew, along the principal directions of what is known of them. What the others are then is theirs
    /// given that.
    #[inline(never)]
    fn decide_ratio_and_skew(&self, s: &mut State<T>) {
        if s.schedule.stage < 2 {
            return;
        }
        let ud = &s.filter.ud;
        let (ratio, skew) = (Parameter::DetectionRatio, Parameter::DetectionSkew);
        let beyond = Self::sigmas(s).squared();
        let (ug, us) = (ratio.expected::<T>(), skew.expected::<T>());
        let pgg = ud.variance(ratio as usize) * ug * ug;
        let pss = ud.variance(skew as usize) * us * us;
        let pgs = ud.covariance(ratio as usize, skew as usize) * ug * us;
        let (mg, ms) = (get(&s.filter.mean, ratio) * ug, get(&s.filter.mean, skew) * us);
        let (cos, sin) = principal(pgg, pgs, pss);
        let (mut g, mut k) = (T::zero(), T::zero());
        for (x, y) in [(cos, sin), (-sin, cos)] {
            let variance = x * x * pgg + T::two() * x * y * pgs + y * y * pss;
            let along = x * mg + y * ms;
            if along * along > beyond * variance {
                g = g + x * along;
                k = k + y * along;
            }
        }
        set(&mut s.trial, ratio, g);
        set(&mut s.trial, skew, k);
    }

    //= specs/self-calibration.md#excitation
    //# What was not excited MUST NOT be moved.
    /// The conditional mean of parameter `j`, whose variance is [`Filter::spread`](crate::state::Filter), given what is
    /// committed of the detection.
    #[inline(never)]
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
        let excited = s.filter.spread < T::ratio(1, 4)
            && !(p.needs_known_precession() && s.schedule.angle_used < self.cycles(10));
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
            (Parameter::DetectionPhase, s.correction.detection_lag()),
        ];
        // false for NaN
        believed.into_iter().all(|(p, in_force)| (in_force / p.expected() + get(&s.filter.mean, p)).within(most))
    }

    /// Whether to move at all; and a move back is the one there was, turned round, in the parameters' own units.
    #[inline(never)]
    fn judge(&self, s: &mut State<T>) {
        s.score = T::zero();
        if s.schedule.commit == Commit::Back {
            for (slot, p) in s.trial.iter_mut().zip(Parameter::ALL) {
                *slot = -(*slot * p.expected::<T>());
            }
        } else if !self.is_of_a_device(s) {
            self.begin_anew(s);
        }
    }

    #[inline(never)]
    fn begin(s: &mut State<T>) {
        s.filter.work = Work::Move(Move::begin(&s.correction));
    }

    #[inline(never)]
    fn advance(s: &mut State<T>, part: u16) {
        if let Work::Move(way) = &mut s.filter.work {
            way.advance(&s.trial, part);
        }
    }

    //= specs/self-calibration.md#taken-back
    //# A commit that predicts what follows worse than the values before it MUST be taken back.
    #[inline(never)]
    fn put_in_force(&self, s: &mut State<T>) {
        let Work::Move(way) = &s.filter.work else { return };
        if let Some(moved) = way.end() {
            s.correction = moved;
            if s.schedule.commit == Commit::Back {
                s.taken_back = s.taken_back.saturating_add(1);
            }
        } else if s.schedule.commit == Commit::Back {
            s.trial = [T::zero(); N];
        } else {
            self.begin_anew(s);
        }
    }

    /// No instrument is like that: what led there is forgotten, but for the mechanics about which it is learned anew.
    fn begin_anew(&self, s: &mut State<T>) {
        self.split_changed(s);
        s.schedule.forget(N, T::one());
        s.schedule.cold = true;
    }

    /// What was moved leaves the mean, and is on trial where nothing is linearised any more.
    #[inline(never)]
    fn leave(s: &mut State<T>, of: Range<usize>) {
        let tried = s.schedule.stage >= 4 && s.schedule.commit == Commit::Forth;
        let Some(parameters) = Parameter::ALL.get(of.clone()) else { return };
        let (Some(mean), Some(trial)) = (s.filter.mean.get_mut(of.clone()), s.trial.get_mut(of)) else { return };
        for ((mean, delta), p) in mean.iter_mut().zip(trial).zip(parameters) {
            let moved = *delta / p.expected::<T>();
            *mean = *mean - moved;
            *delta = if tried { moved } else { T::zero() };
        }
    }

    #[inline(never)]
    fn end_commit(&self, s: &mut State<T>) {
        let sc = &mut s.schedule;
        let (forth, stage) = (sc.commit == Commit::Forth, sc.stage);
        let anew = stage == 0 || sc.angle_used < self.cycles(10);
        match stage {
            // loops that settle and drives of which nothing is known may have looked like a turn
            0 if forth && sc.cold => sc.forget(N, T::one()),
            0..3 if forth => sc.forget(OTHERS, if anew { T::one() } else { T::from_f64(0.01) }),
            // to the end of the cycle: the slices that are left would be of no measurement
            _ => sc.forget(0, T::one()),
        }
        if forth && stage < 4 {
            sc.stage += 1;
            sc.before_rest = 0;
            sc.cold = false;
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

/// The direction in which a covariance [[xx, xy], [xy, yy]] is largest, as a cosine and a sine: half the angle of what is
/// uneven of it.
fn principal<T: Float>(xx: T, xy: T, yy: T) -> (T, T) {
    let (even, uneven) = (xx - yy, T::two() * xy);
    let n = even.norm(uneven);
    if n > T::zero() {
        let half = (T::half() * (T::one() + even.magnitude() / n)).sqrt();
        let other = T::half() * uneven / (n * half);
        if even < T::zero() { (other, half) } else { (half, other) }
    } else {
        (T::one(), T::zero())
    }
}
