//! Sums over the control steps of a cycle, and what they say: amplitude, angle, ellipticity, and the push of the forces.
//!
//! All in amplitudes and per second. It refuses to divide by an amplitude that isn't there: such a cycle is not used.

use cvg_model::{Float, Pendulum};

use crate::parameters::Vector;
use crate::regressors::{exact_rates, known_rates};

/// Sums of one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sums<T> {
    energy: T,
    quadrature: T,
    /// of the angle since the step before the first
    turned: T,
    push: [T; 4],
    /// known rates of the three channels, and the same weighted by how far into the cycle they act
    rate: [T; 3],
    ramp: [T; 3],
    /// the direction in the step before the first
    from: (T, T),
    angle: T,
    count: T,
    whole: bool,
}

/// Sums of a cycle's pushes: along the major axis, along the minor axis, quadrature along the minor axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Push<T> {
    pub(crate) along: T,
    pub(crate) aside: T,
    pub(crate) quadrature: T,
    /// in quadrature along the major axis
    pub(crate) across: T,
}

/// One cycle, as it enters the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample<T> {
    /// ½ ln E, rad of the pattern since the step before, ellipticity
    pub(crate) y: [T; 3],
    /// the mean angle as the next cycle counts it: since the last step of this one
    pub(crate) before_next: T,
    pub(crate) per_amplitude: T,
    /// ½Q/√(E² − Q²)
    pub(crate) r: T,
    pub(crate) push: Push<T>,
    /// integral of what is known to act: the part that shows at once
    pub(crate) early: [T; 3],
    /// the part that shows in the next cycle
    pub(crate) late: [T; 3],
    pub(crate) cos: T,
    pub(crate) sin: T,
    pub(crate) cos_2: T,
    pub(crate) sin_2: T,
}

impl<T: Float> Sums<T> {
    /// A cycle begins after a step in which the direction was `from`.
    pub(crate) fn after(from: (T, T)) -> Self {
        let zero = T::zero();
        Self {
            energy: zero,
            quadrature: zero,
            turned: zero,
            push: [zero; 4],
            rate: [zero; 3],
            ramp: [zero; 3],
            from,
            angle: zero,
            count: zero,
            whole: true,
        }
    }

    /// A cycle is whole: it goes to `closed`, and the next one begins after a step in which the direction was `from`. Field by
    /// field: what copies more than 64 bytes at once costs firmware a call, and half as much again.
    #[inline(never)]
    pub(crate) fn hand_over(&mut self, closed: &mut Self, from: (T, T)) {
        let Self { energy, quadrature, turned, push, rate, ramp, from: began, angle, count, whole } = *self;
        *closed = Self { energy, quadrature, turned, push, rate, ramp, from: began, angle, count, whole };
        *self = Self::after(from);
    }

    /// One control step: pendulum variables over the set energy, direction now and a step before, the pushes, and the
    /// mechanics in force.
    #[inline]
    pub(crate) fn add(&mut self, p: &Pendulum<T>, now: (T, T), before: (T, T), push: &Push<T>, known: &Vector<T>) {
        self.take(p, now, before, push, T::one(), |push, twice| {
            // 1/a of a vibration that the energy loop holds
            let h = T::half() * (p.e - T::one());
            let per_a = T::one() - h + T::ratio(3, 2) * h * h;
            known_rates(&push.over(per_a), T::half() * p.q * per_a * per_a, twice, known)
        });
    }

    /// [`Sums::add`] of a vibration that no loop need hold, on an orbit that no loop need flatten, where forces are held for
    /// the share `held` of a step.
    #[inline]
    pub(crate) fn add_exactly(
        &mut self,
        p: &Pendulum<T>,
        now: (T, T),
        before: (T, T),
        push: &Push<T>,
        held: T,
        known: &Vector<T>,
    ) {
        self.take(p, now, before, push, held, |push, twice| exact_rates(push, p, twice, known));
    }

    #[inline]
    fn take(
        &mut self,
        p: &Pendulum<T>,
        now: (T, T),
        before: (T, T),
        push: &Push<T>,
        held: T,
        rates: impl FnOnce(&Push<T>, (T, T)) -> [T; 3],
    ) {
        // sine of the turn since the step before, far below a radian; of differences, so that it is as precise as it is small
        let x = (now.1 - before.1) * before.0 - (now.0 - before.0) * before.1;
        let x2 = x * x;
        self.angle = self.angle + x + x * x2 * (T::ratio(1, 6) + x2 * T::ratio(3, 40));
        self.count = self.count + T::one();
        self.turned = self.turned + self.angle;
        let excess = p.e - T::one();
        self.energy = self.energy + excess;
        self.quadrature = self.quadrature + p.q;
        let push = push.held(T::half() * held * x);
        for (sum, push) in self.push.iter_mut().zip([push.along, push.aside, push.quadrature, push.across]) {
            *sum = *sum + push;
        }
        // the mechanics at the middle of the step
        let (cos_2, sin_2) = (now.0 * now.0 - now.1 * now.1, T::two() * now.0 * now.1);
        let (cos_2, sin_2) = (cos_2 - x * sin_2, sin_2 + x * cos_2);
        let rates = rates(&push, (cos_2, sin_2));
        for ((sum, ramp), rate) in self.rate.iter_mut().zip(self.ramp.iter_mut()).zip(rates) {
            *sum = *sum + rate;
            *ramp = *ramp + rate * self.count;
        }
    }

    /// The first step is one after which nothing is known: it does not turn.
    pub(crate) fn begin(&mut self, direction: (T, T)) {
        self.from = direction;
    }

    /// Not a whole cycle: something happened in it.
    pub(crate) fn spoil(&mut self) {
        self.whole = false;
    }

    /// Amplitude, ellipticity and pushes. None of a cycle that was spoilt or is not that of a vibration at work.
    pub(crate) fn close(&self, control_s: T) -> Option<Sample<T>> {
        let per = T::one() / self.count;
        let excess = self.energy * per;
        if !(self.whole && excess.within(T::from_f64(0.4)) && self.turned.is_finite()) {
            return None;
        }
        let energy = T::one() + excess;
        let q = self.quadrature * per / energy;
        if !q.within(T::from_f64(0.3)) {
            return None;
        }
        let per_amplitude = T::one() / energy.sqrt();
        let by = per * per_amplitude;
        let [along, aside, quadrature, across] = self.push;
        let push = Push { along, aside, quadrature, across }.over(by);
        let mut late = self.ramp;
        let mut early = self.rate;
        for (late, early) in late.iter_mut().zip(early.iter_mut()) {
            *late = *late * per * control_s;
            *early = *early * control_s - *late;
            if !(late.is_finite() && early.is_finite()) {
                return None;
            }
        }
        let zero = T::zero();
        Some(Sample {
            y: [half_log(excess), zero, T::half() * q * (T::one() + q * q * T::ratio(1, 6))],
            before_next: zero,
            per_amplitude,
            r: T::half() * q / (T::one() - q * q).sqrt(),
            push,
            early,
            late,
            cos: zero,
            sin: zero,
            cos_2: zero,
            sin_2: zero,
        })
    }

    /// The mean angle, and its cosines and sines.
    pub(crate) fn direct(&self, sample: &mut Sample<T>) {
        let mean = self.turned / self.count;
        let (sin, cos) = turn_of(mean);
        let (cos, sin) = (self.from.0 * cos - self.from.1 * sin, self.from.1 * cos + self.from.0 * sin);
        let [_, y, _] = &mut sample.y;
        *y = mean;
        sample.before_next = mean - self.angle;
        sample.cos = cos;
        sample.sin = sin;
        sample.cos_2 = cos * cos - sin * sin;
        sample.sin_2 = T::two() * cos * sin;
    }
}

impl<T: Float> Sample<T> {
    /// A sample of nothing.
    pub(crate) fn blank() -> Self {
        let zero = T::zero();
        Self {
            y: [zero; 3],
            before_next: zero,
            per_amplitude: T::one(),
            r: zero,
            push: Push { along: zero, aside: zero, quadrature: zero, across: zero },
            early: [zero; 3],
            late: [zero; 3],
            cos: T::one(),
            sin: zero,
            cos_2: T::one(),
            sin_2: zero,
        }
    }
}

impl<T: Float> Push<T> {
    /// Forces are held while the pattern turns on, by `lag` rad to the middle of the step.
    #[inline]
    fn held(&self, lag: T) -> Self {
        Self {
            along: self.along + lag * self.aside,
            aside: self.aside - lag * self.along,
            quadrature: self.quadrature - lag * self.across,
            across: self.across + lag * self.quadrature,
        }
    }

    /// All of it times `k`.
    #[inline]
    pub(crate) fn over(&self, k: T) -> Self {
        Self { along: self.along * k, aside: self.aside * k, quadrature: self.quadrature * k, across: self.across * k }
    }
}

/// Sine and cosine of a turn of a cycle, in a few products: `libm` takes double precision, which firmware has no unit for.
/// Domain: |x| ≤ π/2; error below 10⁻¹¹ there, and far below nearer to 0.
pub(crate) fn turn_of<T: Float>(x: T) -> (T, T) {
    let r = T::ratio;
    let x = x * r(1, 4);
    let x2 = x * x;
    let mut sin = x * (T::one() - x2 * (r(1, 6) - x2 * (r(1, 120) - x2 * (r(1, 5040) - x2 * r(1, 362_880)))));
    // 1 − cos: what is doubled has to be small
    let mut less = x2 * (T::half() - x2 * (r(1, 24) - x2 * (r(1, 720) - x2 * (r(1, 40_320) - x2 * r(1, 3_628_800)))));
    for _ in 0..2 {
        (sin, less) = (T::two() * sin * (T::one() - less), T::two() * sin * sin);
    }
    (sin, T::one() - less)
}

/// ½ ln(1 + x) = artanh(x/(2 + x)). Domain: |x| ≤ 0.4; error below 10⁻⁸ there and far below nearer to 0.
fn half_log<T: Float>(x: T) -> T {
    let z = x / (T::two() + x);
    let z2 = z * z;
    let r = T::ratio;
    z * (T::one() + z2 * (r(1, 3) + z2 * (r(1, 5) + z2 * (r(1, 7) + z2 * (r(1, 9) + z2 * r(1, 11))))))
}
