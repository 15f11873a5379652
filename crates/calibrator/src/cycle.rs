//! A cycle of the filter, a slice a control step.

use cvg_model::Float;

use crate::Calibrator;
use crate::parameters::{DETECTION, N, OTHERS, Parameter, dot};
use crate::regressors::{CHANNELS, PARTS, part, turned};
use crate::state::{Commit, Filter, Forgetting, State, Work};
use crate::ud::{Ud, Update};

/// Slices that a cycle needs: none does more than some 180 instructions.
pub(crate) const SLICES: u16 = 160;
/// Those of the first pass of a measurement, and of the second.
const PROJECT: u16 = 7;
const ABSORB: u16 = 21;
/// A variance is taken in three slices, of the columns between these.
pub(crate) const THIRDS: [usize; 4] = [0, 8, 13, N];
/// Slices of a measurement: innovation, the first pass, gate, the second pass, the mean; then what the next cycle begins with.
pub(crate) const OPEN: u16 = 1 + PROJECT;
pub(crate) const TAKEN: u16 = OPEN + 1 + ABSORB;
const RETIRE: u16 = TAKEN + 1;
pub(crate) const MEASURE: u16 = RETIRE + PARTS as u16;
/// The slices of a cycle.
const INTEGRATE: u16 = PARTS as u16 + 1;
const DETECT: u16 = 2 + INTEGRATE;
const DETECTED: u16 = DETECT + 3;
const NOTICE: u16 = DETECTED + 1;
const OTHER_CHANNELS: u16 = NOTICE + 1;
pub(crate) const FIRST_MEASURE: u16 = OTHER_CHANNELS + 2 * INTEGRATE;
const GROW: u16 = FIRST_MEASURE + MEASURE * CHANNELS as u16;
const PLAN: u16 = GROW + 4 + N as u16;
/// White noise never falls below this, rad.
const GATE: f64 = 36.0;

/// How well the precession by force is known: standard deviations of the force scale, relative, and of the constant rate,
/// rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Doubt<T> {
    pub(crate) force_scale: T,
    pub(crate) rate: T,
}

impl<T: Float> Doubt<T> {
    pub(crate) fn of(s: &State<T>) -> Self {
        Self { force_scale: deviation(s, Parameter::ForceScale), rate: deviation(s, Parameter::Rate) }
    }
}

fn deviation<T: Float>(s: &State<T>, p: Parameter) -> T {
    s.filter.ud.variance(p as usize).sqrt() * p.expected::<T>()
}

impl<T: Float> Calibrator<T> {
    /// This control step's slices: one, or two where a cycle is of fewer steps.
    pub(crate) fn work(&self, s: &mut State<T>) {
        if self.steps >= SLICES {
            self.slice(s, s.step);
        } else {
            self.slice(s, 2 * s.step);
            self.slice(s, 2 * s.step + 1);
        }
    }

    /// A column of what is forgotten; the mean and what was under way at last.
    #[inline(never)]
    fn forget_slice(s: &mut State<T>, k: u16) {
        let Forgetting { count, done, d } = s.schedule.forgetting;
        let (count, column) = (usize::from(count), usize::from(done));
        if k >= SLICES - 1 {
            // the end of the cycle has its own work
            if column > N + 1 {
                s.schedule.commit = Commit::None;
            }
            return;
        }
        if column < N {
            s.filter.ud.forget(column, count, d);
        } else if column == N {
            for mean in s.filter.mean.iter_mut().take(count) {
                *mean = T::zero();
            }
        } else if column == N + 1 {
            s.filter.work = Work::Measure(Update::idle());
        }
        s.schedule.forgetting.done = done.saturating_add(1);
    }

    fn slice(&self, s: &mut State<T>, k: u16) {
        match s.schedule.commit {
            Commit::None => {}
            Commit::Forget => return Self::forget_slice(s, k),
            Commit::Forth | Commit::Back => return self.commit_slice(s, k),
        }
        // most of them, and the longest: found at once
        if (FIRST_MEASURE..GROW).contains(&k) {
            if s.schedule.live {
                let n = k - FIRST_MEASURE;
                self.measure(s, usize::from(n / MEASURE), n % MEASURE);
            }
            return;
        }
        match k {
            0 => self.close(s),
            GROW..PLAN => self.grow(s, k - GROW),
            PLAN => self.plan(s),
            _ if !s.schedule.live => {}
            1 => s.closed.direct(&mut s.sample),
            2..DETECT => self.integrate(s, 1, usize::from(k - 2)),
            DETECT..DETECTED => s.filter.add_variance(Parameter::ForceScale as usize, k - DETECT),
            DETECTED => Self::doubt(s),
            NOTICE => self.notice(s, s.schedule.doubt),
            OTHER_CHANNELS..FIRST_MEASURE => {
                let n = k - OTHER_CHANNELS;
                self.integrate(s, usize::from(2 * (n / INTEGRATE)), usize::from(n % INTEGRATE));
            }
            _ => {}
        }
    }

    /// [`Doubt::of`], the first variance of which is taken already.
    #[inline(never)]
    fn doubt(s: &mut State<T>) {
        s.schedule.doubt.force_scale = s.filter.spread.sqrt() * Parameter::ForceScale.expected::<T>();
        s.schedule.doubt.rate = deviation(s, Parameter::Rate);
    }

    //= specs/self-calibration.md#held
    //# Nothing MUST be learned from a disturbed instrument.
    #[inline(never)]
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

    /// What was seen beyond what is known, and what each parameter should have shown of it, part by part.
    pub(crate) fn integrate(&self, s: &mut State<T>, c: usize, n: usize) {
        match n {
            0 => self.integrate_part::<0>(s, c),
            1 => self.integrate_part::<1>(s, c),
            2 => self.integrate_part::<2>(s, c),
            3 => self.integrate_part::<3>(s, c),
            4 => self.integrate_part::<4>(s, c),
            _ => self.see(s, c),
        }
    }

    /// Part `P` of it. It is known when it is compiled, here and below, so that its parameters and their units are, too.
    #[inline(never)]
    fn integrate_part<const P: usize>(&self, s: &mut State<T>, c: usize) {
        let half_s = T::half() * self.cycle_s;
        let row = part(&s.sample, &s.correction.known, c, P != 1 || self.scaled(s), P);
        let filter = &mut s.filter;
        let of = row.first..row.end;
        let Some(shown) = filter.shown.get_mut(c).and_then(|v| v.get_mut(of.clone())) else { return };
        let (Some(mean), Some(units)) = (filter.mean.get(of.clone()), Parameter::ALL.get(of)) else { return };
        let mut believed = if P == 0 { T::zero() } else { filter.believed };
        for ((((shown, mean), p), rate), direct) in shown.iter_mut().zip(mean).zip(units).zip(row.rate).zip(row.direct)
        {
            let step = (half_s * rate + direct) * p.expected();
            *shown = *shown + step;
            believed = believed + step * *mean;
        }
        filter.believed = believed;
    }

    /// Every part of it.
    pub(crate) fn integrate_all(&self, s: &mut State<T>, c: usize) {
        for n in 0..=PARTS {
            self.integrate(s, c, n);
        }
    }

    /// The end of [`Calibrator::integrate`]: what was seen, and what a turn that no force explains shows of the detection.
    #[inline(never)]
    fn see(&self, s: &mut State<T>, c: usize) {
        let change = pick(&s.sample.y, c) - pick(&s.before.y, c);
        let seen = change - pick(&s.before.late, c) - pick(&s.sample.early, c);
        if let Some(slot) = s.filter.seen.get_mut(c) {
            *slot = self.forget * *slot + seen;
        }
        if c == 1 {
            // what neither forces nor mechanics, known and believed, explain of the turn
            s.schedule.turn = if s.before.whole { seen - s.filter.believed - s.before.angle } else { T::zero() };
        } else if s.schedule.excited
            && let Some(shown) = s.filter.shown.get_mut(c)
        {
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

    /// The cycle is past: what of it belongs to the next one's step, part by part.
    fn retire(&self, s: &mut State<T>, c: usize, n: usize) {
        match n {
            0 => self.retire_part::<0>(s, c),
            1 => self.retire_part::<1>(s, c),
            2 => self.retire_part::<2>(s, c),
            3 => self.retire_part::<3>(s, c),
            _ => self.retire_part::<4>(s, c),
        }
    }

    #[inline(never)]
    fn retire_part<const P: usize>(&self, s: &mut State<T>, c: usize) {
        let half_s = T::half() * self.cycle_s;
        let row = part(&s.sample, &s.correction.known, c, P != 1 || self.scaled(s), P);
        let filter = &mut s.filter;
        let Some(all) = filter.shown.get_mut(c) else { return };
        if P == 2 {
            // with a part that has little else to do
            for slot in all.get_mut(OTHERS..).unwrap_or(&mut []) {
                *slot = self.forget * *slot;
            }
        }
        let mut ahead = if P == 0 { T::zero() } else { filter.believed };
        let of = row.first..row.end;
        let Some(shown) = all.get_mut(of.clone()) else { return };
        let (Some(mean), Some(units)) = (filter.mean.get(of.clone()), Parameter::ALL.get(of)) else { return };
        for ((((shown, mean), p), rate), direct) in shown.iter_mut().zip(mean).zip(units).zip(row.rate).zip(row.direct)
        {
            let step = (half_s * rate - direct) * p.expected();
            *shown = self.forget * *shown + step;
            ahead = ahead + step * *mean;
        }
        filter.believed = ahead;
        if P == PARTS - 1 && c == 1 {
            s.before.angle = ahead;
        }
        if P == 3 && c == CHANNELS - 1 {
            // with the mechanics that do nothing to this channel
            s.before.y = s.sample.y;
            put(&mut s.before.y, 1, s.sample.before_next);
            s.before.late = s.sample.late;
            s.before.cos_2 = s.sample.cos_2;
            s.before.sin_2 = s.sample.sin_2;
            s.before.whole = true;
        }
    }

    pub(crate) fn measure(&self, s: &mut State<T>, c: usize, k: u16) {
        match k {
            0 => self.innovate(s, c),
            RETIRE.. => self.retire(s, c, usize::from(k - RETIRE)),
            _ if !s.schedule.accept => {}
            OPEN => self.gate(s, c),
            TAKEN => self.learn(s, c),
            1..OPEN => s.project(c, k - 1),
            _ => s.filter.absorb(k - OPEN - 1),
        }
    }

    #[inline(never)]
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
        let floor = floor::<T>(s.schedule.stage);
        let still = pick(&s.filter.noise, c) + floor * floor;
        if s.schedule.excited { still + T::from_f64(9e-10) * s.schedule.rate.squared() } else { still }
    }

    #[inline(never)]
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
        s.filter.open(noise);
    }

    #[inline(never)]
    fn learn(&self, s: &mut State<T>, c: usize) {
        s.filter.learn(pick(&s.filter.innovation, c));
        if c == 0 && s.schedule.excited {
            s.schedule.untold = 0;
        }
        if c == 1 {
            s.schedule.angle_used = s.schedule.angle_used.saturating_add(1);
        }
    }

    /// One parameter a cycle may have wandered, while it is better known than expected of any device. The first slice looks
    /// how well that is.
    #[inline(never)]
    pub(crate) fn grow(&self, s: &mut State<T>, k: u16) {
        match k {
            0..3 => s.filter.add_variance(s.filter.growing, k),
            3 => {
                let j = s.filter.growing;
                s.filter.growing = if j + 1 < N { j + 1 } else { 0 };
                if let Some(p) = Parameter::ALL.get(j)
                    && s.schedule.live
                    && s.filter.spread < T::one()
                {
                    let sigma = p.wander::<T>() / p.expected::<T>();
                    let q = sigma * sigma * self.cycle_s * T::ratio(19, 1);
                    Ud::grow_begin(&mut s.filter.growth, j, q);
                }
            }
            _ => s.filter.ud.grow(&mut s.filter.growth),
        }
    }

    /// The instrument turns where more is unexplained than forces and mechanics may leave of the rate, as well as they are
    /// known, and for two seconds after.
    #[inline(never)]
    pub(crate) fn notice(&self, s: &mut State<T>, doubt: Doubt<T>) {
        let limit = T::from_f64(0.02)
            + T::from_f64(2.5) * doubt.force_scale * s.sample.push.aside.magnitude()
            + T::two() * doubt.rate;
        let sc = &mut s.schedule;
        sc.rate = sc.turn * self.cycles_per_s;
        sc.swept = sc.swept + sc.turn.magnitude();
        sc.unexplained = sc.unexplained + self.smoothing * (sc.rate - sc.unexplained);
        if !sc.unexplained.within(limit) {
            if sc.moving == 0 {
                // what turned before it was noticed isn't in the integrals
                sc.fresh = 0;
                if sc.stage == 0 {
                    sc.forget(OTHERS, T::one());
                    sc.used = 0;
                    s.before.whole = false;
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

/// What the model neglects before each linearisation, rad.
fn floor<T: Float>(stage: u8) -> T {
    let c = T::from_f64;
    match stage {
        0 => c(1e-3),
        1 => c(5e-4),
        2 => c(1e-4),
        3 => c(2e-5),
        _ => c(3e-6),
    }
}

impl<T: Float> State<T> {
    /// A slice of the first pass of a measurement along what channel `c` has shown, or along what is on trial where there is
    /// no such channel.
    #[inline(never)]
    pub(crate) fn project(&mut self, c: usize, slice: u16) {
        let Self { filter: Filter { ud, work, shown, spread, .. }, trial, .. } = self;
        let h = shown.get(c).unwrap_or(trial);
        let Some(update) = work.update() else { return };
        macro_rules! columns {
            ($($j:literal)+) => { *spread $(+ ud.project::<$j>(update, h))+ };
        }
        *spread = match slice {
            0 => columns!(0 1 2 3 4 5 6),
            1 => columns!(7 8 9),
            2 => columns!(10 11),
            3 => columns!(12 13),
            4 => columns!(14 15),
            5 => columns!(16 17),
            _ => columns!(18),
        };
    }
}

impl<T: Float> Filter<T> {
    /// A third of P_jj; all of it is in `spread` after the last.
    pub(crate) fn add_variance(&mut self, j: usize, third: u16) {
        let at = |n: u16| THIRDS.get(usize::from(n)).copied().unwrap_or(N);
        let before = if third == 0 { T::zero() } else { self.spread };
        self.spread = before + self.ud.variance_by(j, at(third), at(third + 1));
    }

    /// Between the passes.
    pub(crate) fn open(&mut self, noise: T) {
        if let Some(update) = self.work.update() {
            self.ud.open(update, noise);
        }
    }

    /// A slice of the second pass: some columns, or some of one's rows.
    pub(crate) fn absorb(&mut self, slice: u16) {
        let Some(update) = self.work.update() else { return };
        let ud = &mut self.ud;
        macro_rules! columns {
            ($($j:literal)+) => {{ $(ud.absorb::<$j>(update);)+ }};
        }
        macro_rules! first_rows {
            ($j:literal, $end:literal) => {{
                ud.absorb_diagonal::<$j>(update);
                ud.absorb_rows::<$j, 0, $end>(update);
            }};
        }
        match slice {
            0 => columns!(0 1 2),
            1 => columns!(3 4),
            2 => columns!(5),
            3 => columns!(6),
            4 => columns!(7),
            5 => columns!(8),
            6 => columns!(9),
            7 => columns!(10),
            8 => columns!(11),
            9 => columns!(12),
            10 => {
                ud.absorb_diagonal::<13>(update);
                ud.absorb_rows::<13, 0, 11>(update);
            }
            11 => {
                ud.absorb_rows::<13, 11, 13>(update);
                ud.absorb_diagonal::<14>(update);
                ud.absorb_rows::<14, 0, 6>(update);
            }
            12 => ud.absorb_rows::<14, 6, 14>(update),
            13 => first_rows!(15, 6),
            14 => ud.absorb_rows::<15, 6, 15>(update),
            15 => first_rows!(16, 7),
            16 => ud.absorb_rows::<16, 7, 16>(update),
            17 => first_rows!(17, 7),
            18 => ud.absorb_rows::<17, 7, 17>(update),
            19 => first_rows!(18, 7),
            _ => ud.absorb_rows::<18, 7, 18>(update),
        }
    }

    /// The mean moves by what the measurement showed.
    pub(crate) fn learn(&mut self, innovation: T) {
        let Some(update) = self.work.update() else { return };
        let by = innovation * update.inverse();
        for (mean, gain) in self.mean.iter_mut().zip(update.gain()) {
            *mean = *mean + *gain * by;
        }
    }
}

impl<T: Float> crate::state::Schedule<T> {
    /// The first `count` parameters are as unknown as `d`, in expected units squared: from the next slice on.
    pub(crate) fn forget(&mut self, count: usize, d: T) {
        self.commit = Commit::Forget;
        #[allow(clippy::cast_possible_truncation, reason = "at most the number of parameters")]
        let count = count as u8;
        self.forgetting = Forgetting { count, done: 0, d };
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
