//! A cycle of the filter, a slice a control step.

use cvg_model::Float;

use crate::parameters::{DETECTION, N, OTHERS, Parameter, dot};
use crate::regressors::{CHANNELS, rates, turned};
use crate::state::{Commit, State};
use crate::ud::Ud;
use crate::{Calibrator, parameters};

/// Control steps that a cycle needs.
pub(crate) const SLICES: u16 = 80;
/// Slices of a measurement: innovation, five of the first pass, gate, twelve of the second, the mean.
pub(crate) const MEASURE: u16 = 20;
const FIRST_MEASURE: u16 = 5;
const GROW: u16 = FIRST_MEASURE + MEASURE * 3;
/// Columns of the second pass, some twenty elements a slice.
const COLUMNS: [(usize, usize); 12] =
    [(0, 6), (6, 8), (8, 10), (10, 11), (11, 12), (12, 13), (13, 14), (14, 15), (15, 16), (16, 17), (17, 18), (18, 19)];
/// What the model neglects before each linearisation, rad.
const FLOOR: [f64; 5] = [1e-3, 5e-4, 1e-4, 2e-5, 3e-6];
/// White noise never falls below this, rad.
const GATE: f64 = 36.0;

/// How well the precession by force is known: standard deviations of the force scale, relative, and of the constant rate,
/// rad/s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Doubt<T> {
    force_scale: T,
    rate: T,
}

impl<T: Float> Doubt<T> {
    pub(crate) fn of(s: &State<T>) -> Self {
        let of = |p: Parameter| s.filter.ud.variance(p as usize).sqrt() * p.expected::<T>();
        Self { force_scale: of(Parameter::ForceScale), rate: of(Parameter::Rate) }
    }
}

impl<T: Float> Calibrator<T> {
    pub(crate) fn work(&self, s: &mut State<T>) {
        let k = s.step;
        if s.schedule.commit != Commit::None {
            self.commit_slice(s, k);
            return;
        }
        match k {
            0 => self.close(s),
            1 if s.schedule.live => self.direct(s),
            2 if s.schedule.live => {
                self.integrate(s, 1);
                self.detect(s);
            }
            3 if s.schedule.live => self.integrate(s, 0),
            4 if s.schedule.live => self.integrate(s, 2),
            FIRST_MEASURE..GROW if s.schedule.live => {
                let n = k - FIRST_MEASURE;
                self.measure(s, usize::from(n / MEASURE), n % MEASURE);
            }
            77 => self.plan(s),
            GROW..77 => self.grow(s, k == GROW),
            _ => {}
        }
    }

    //= specs/self-calibration.md#held
    //# Nothing MUST be learned from a disturbed instrument.
    pub(crate) fn close(&self, s: &mut State<T>) {
        match s.closed.close(self.control_s) {
            Some(sample) => {
                s.sample = sample;
                s.schedule.live = true;
            }
            None => {
                s.schedule.live = false;
                s.before.whole = false;
                // a second and a half for the loops to settle after whatever it was
                s.schedule.settle = self.cycles(3) / 2;
            }
        }
    }

    pub(crate) fn direct(&self, s: &mut State<T>) {
        s.closed.direct(&mut s.sample);
        s.schedule.turn =
            if s.before.whole { half_turns(pick(&s.sample.y, 1) - pick(&s.before.y, 1)) } else { T::zero() };
    }

    /// What was seen beyond what is known, and what each parameter should have shown of it.
    pub(crate) fn integrate(&self, s: &mut State<T>, c: usize) {
        let half_s = T::half() * self.cycle_s;
        let (h, direct) = rates(&s.sample, &s.correction.known, c, self.scaled(s));
        let change = if c == 1 { s.schedule.turn } else { pick(&s.sample.y, c) - pick(&s.before.y, c) };
        let seen = change - pick(&s.before.late, c) - pick(&s.sample.early, c);
        let Some(shown) = s.filter.shown.get_mut(c) else { return };
        let mut new = T::zero();
        for (((shown, h), direct), mean) in shown.iter_mut().zip(&h).zip(&direct).zip(&s.filter.mean) {
            let step = half_s * *h + *direct;
            *shown = *shown + step;
            new = new + step * *mean;
        }
        if let Some(slot) = s.filter.seen.get_mut(c) {
            *slot = self.forget * *slot + seen;
        }
        if c == 1 {
            // what neither forces nor mechanics, known and believed, explain of the turn
            s.schedule.turn = if s.before.whole { seen - new - s.before.angle } else { T::zero() };
        } else if s.schedule.excited {
            let half_turn = T::half() * s.schedule.turn;
            let now = turned(c, s.sample.cos_2, s.sample.sin_2, half_turn);
            let then = turned(c, s.before.cos_2, s.before.sin_2, half_turn);
            for ((slot, a), b) in shown.iter_mut().skip(OTHERS).take(DETECTION).zip(now).zip(then) {
                *slot = *slot + a + b;
            }
        }
        if s.schedule.fresh == 0 || !s.before.whole {
            s.filter.restart(c);
        }
    }

    /// Whether a known precession is seen in the angle, or has been for long enough.
    fn scaled(&self, s: &State<T>) -> bool {
        s.schedule.moving == 0 || s.schedule.angle_used >= self.cycles(10)
    }

    /// The cycle is past: what of it belongs to the next one's step.
    fn retire(&self, s: &mut State<T>, c: usize) {
        let half_s = T::half() * self.cycle_s;
        let (h, direct) = rates(&s.sample, &s.correction.known, c, self.scaled(s));
        let Some(shown) = s.filter.shown.get_mut(c) else { return };
        let mut ahead = T::zero();
        for (((shown, h), direct), mean) in shown.iter_mut().zip(&h).zip(&direct).zip(&s.filter.mean) {
            let step = half_s * *h - *direct;
            *shown = self.forget * *shown + step;
            ahead = ahead + step * *mean;
        }
        if c == 1 {
            s.before.angle = ahead;
        }
        if c == CHANNELS - 1 {
            s.before.y = s.sample.y;
            s.before.late = s.sample.late;
            s.before.cos_2 = s.sample.cos_2;
            s.before.sin_2 = s.sample.sin_2;
            s.before.whole = true;
        }
    }

    pub(crate) fn measure(&self, s: &mut State<T>, c: usize, k: u16) {
        match k {
            0 => self.innovate(s, c),
            19 => {
                if s.schedule.accept {
                    self.learn(s, c);
                }
                self.retire(s, c);
            }
            _ if !s.schedule.accept => {}
            1..=5 => {
                let Some(h) = s.filter.shown.get(c) else { return };
                let first = usize::from(k - 1) * 4;
                project(&s.filter.ud, &mut s.filter.update, h, first, &mut s.filter.spread);
            }
            6 => self.gate(s, c),
            _ => absorb(&mut s.filter.ud, &mut s.filter.update, k - 7),
        }
    }

    fn innovate(&self, s: &mut State<T>, c: usize) {
        s.schedule.accept = s.schedule.fresh > 0;
        if c == 1 && pick(&s.schedule.hold, 1) > 0 {
            s.filter.restart(1);
            if let Some(hold) = s.schedule.hold.get_mut(1) {
                *hold -= 1;
            }
            s.schedule.accept = false;
        }
        if !s.schedule.accept {
            return;
        }
        let Some(shown) = s.filter.shown.get(c) else { return };
        let e = pick(&s.filter.seen, c) - dot(shown, &s.filter.mean);
        let change = e - pick(&s.filter.last_innovation, c);
        put(&mut s.filter.innovation, c, e);
        put(&mut s.filter.last_innovation, c, e);
        if s.schedule.fresh > 5 {
            let level = pick(&s.filter.noise, c);
            let most = T::from_f64(9.0) * level;
            let v = T::half() * change * change;
            let v = if v < most { v } else { most };
            put(&mut s.filter.noise, c, level + T::from_f64(0.004) * (v - level));
        }
        s.filter.spread = T::zero();
    }

    /// The variance of this channel's white noise and of what the model neglects.
    fn variance(&self, s: &State<T>, c: usize) -> T {
        let floor = T::from_f64(FLOOR.get(usize::from(s.schedule.stage)).copied().unwrap_or(3e-6));
        let still = pick(&s.filter.noise, c) + floor * floor;
        if s.schedule.excited { still + T::from_f64(9e-10) * s.schedule.rate.squared() } else { still }
    }

    fn gate(&self, s: &mut State<T>, c: usize) {
        let noise = self.variance(s, c);
        let all = s.filter.spread + noise;
        let e = pick(&s.filter.innovation, c);
        let within = s.schedule.stage < 4 || e * e <= T::from_f64(GATE) * all;
        if !(within && all.is_finite() && e.is_finite()) {
            s.schedule.accept = false;
            let second = self.cycles(1);
            if let Some(hold) = s.schedule.hold.get_mut(c) {
                if c == 1 {
                    *hold = second;
                } else {
                    s.schedule.refused = s.schedule.refused.saturating_add(2);
                    *hold = hold.saturating_add(1);
                    if *hold > second {
                        *hold = 0;
                        s.filter.restart(c);
                    }
                }
            }
            return;
        }
        if c != 1 {
            s.schedule.refused = s.schedule.refused.saturating_sub(1);
            put(&mut s.schedule.hold, c, 0);
        }
        if let Some(shown) = s.filter.shown.get(c) {
            // held out: the innovation was predicted before it was seen
            let would = dot(shown, &s.trial);
            s.score = s.score + T::half() * would * (would + T::two() * e) / all;
        }
        s.filter.ud.open(&mut s.filter.update, noise);
    }

    fn learn(&self, s: &mut State<T>, c: usize) {
        let by = pick(&s.filter.innovation, c) * s.filter.update.inverse();
        for (mean, gain) in s.filter.mean.iter_mut().zip(s.filter.update.gain()) {
            *mean = *mean + *gain * by;
        }
        if c == 0 && s.schedule.excited {
            s.schedule.untold = 0;
        }
        if c == 1 {
            s.schedule.angle_used = s.schedule.angle_used.saturating_add(1);
        }
    }

    /// One parameter a cycle may have wandered, while it is better known than expected of any device.
    pub(crate) fn grow(&self, s: &mut State<T>, begin: bool) {
        if !begin {
            s.filter.ud.grow(&mut s.filter.growth);
            s.filter.ud.grow(&mut s.filter.growth);
            return;
        }
        let j = s.filter.growing;
        s.filter.growing = if j + 1 < N { j + 1 } else { 0 };
        if let Some(p) = Parameter::ALL.get(j)
            && s.schedule.live
            && s.filter.ud.variance(j) < T::one()
        {
            let sigma = p.wander::<T>() / p.expected::<T>();
            let q = sigma * sigma * self.cycle_s * T::ratio(19, 1);
            Ud::grow_begin(&mut s.filter.growth, j, q);
        }
    }

    /// Whether the instrument turns: what nothing explains of the angle, against how well the precession is known.
    pub(crate) fn detect(&self, s: &mut State<T>) {
        self.notice(s, Doubt::of(s));
    }

    /// The instrument turns where more is unexplained than forces and mechanics may leave of the rate, as well as they are
    /// known, and for two seconds after.
    pub(crate) fn notice(&self, s: &mut State<T>, doubt: Doubt<T>) {
        let limit = T::from_f64(0.02)
            + T::from_f64(2.5) * doubt.force_scale * s.sample.push.aside.magnitude()
            + T::two() * doubt.rate;
        let sc = &mut s.schedule;
        sc.rate = sc.turn * self.cycles_per_s;
        sc.swept = sc.swept + sc.turn.magnitude();
        sc.unexplained = sc.unexplained + T::ratio(1, 5) * (sc.rate - sc.unexplained);
        if !sc.unexplained.within(limit) {
            if sc.moving == 0 {
                // what turned before it was noticed isn't in the integrals
                sc.fresh = 0;
                if sc.stage == 0 {
                    s.filter.forget_others(T::one());
                    sc.used = 0;
                } else if sc.stage == 1 && sc.angle_used < self.cycles(10) {
                    // too short a rest to learn anything from: on as before it
                    sc.stage = sc.stage.max(sc.before_rest);
                }
            }
            sc.moving = self.cycles(2);
        }
        sc.excited = sc.moving > 0;
        if sc.excited {
            sc.moving -= 1;
            put(&mut sc.hold, 1, self.cycles(1));
            if sc.moving == 0 && sc.angle_used < self.cycles(10) && sc.stage > 1 {
                // the first rest: scale, rotation and rate were never seen before
                sc.before_rest = sc.stage;
                sc.stage = 1;
                sc.used = 0;
            }
        }
        if sc.settle > 0 {
            sc.settle -= 1;
            sc.fresh = 0;
        } else {
            sc.fresh = sc.fresh.saturating_add(1);
        }
    }
}

/// Four columns of the first pass.
pub(crate) fn project<T: Float>(
    ud: &Ud<T>,
    update: &mut crate::ud::Update<T>,
    h: &parameters::Vector<T>,
    first: usize,
    spread: &mut T,
) {
    for j in first..first + 4 {
        if j < N {
            *spread = *spread + ud.project(update, h, j);
        }
    }
}

/// A slice of the second pass.
pub(crate) fn absorb<T: Float>(ud: &mut Ud<T>, update: &mut crate::ud::Update<T>, slice: u16) {
    if let Some((first, end)) = COLUMNS.get(usize::from(slice)) {
        for j in *first..*end {
            ud.absorb(update, j);
        }
    }
}

#[inline]
fn pick<V: Copy>(v: &[V; CHANNELS], c: usize) -> V {
    let [amplitude, angle, ellipticity] = *v;
    match c {
        0 => amplitude,
        1 => angle,
        _ => ellipticity,
    }
}

#[inline]
fn put<V>(v: &mut [V], c: usize, value: V) {
    if let Some(slot) = v.get_mut(c) {
        *slot = value;
    }
}

/// An angle with a sign that keeps: within half a turn.
fn half_turns<T: Float>(x: T) -> T {
    if x > T::PI {
        x - T::two() * T::PI
    } else if x < -T::PI {
        x + T::two() * T::PI
    } else {
        x
    }
}
