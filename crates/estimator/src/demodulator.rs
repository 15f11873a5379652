//! Carrier samples → envelope: mixers and a decimating low-pass that leaves nothing of the carrier.
//!
//! A window of N samples is fitted by x = x_c cos φ + x_s sin φ + o in the least-squares sense. The sums Σx cos φ,
//! Σx sin φ, Σx are the mixers and an integrate-and-dump; what a plain integrate-and-dump would leave of twice the
//! carrier and of the converter's offset, because N samples are no whole number of periods, the fit takes out exactly.
//! Its matrix needs no sums over samples: with e^{iφ} the oscillator's phasor and w its step, sums of cosines and sines
//! are differences of the phasor at the window's two ends,
//!
//! $$\sum_{k=0}^{N-1} e^{i\varphi_k} = \frac{e^{i\varphi_N}-e^{i\varphi_0}}{e^{iw}-1},\qquad
//!   \sum_{k=0}^{N-1} e^{2i\varphi_k} = \frac{e^{2i\varphi_N}-e^{2i\varphi_0}}{e^{2iw}-1},\qquad
//!   \frac{1}{e^{2iw}-1} = -\tfrac12(1+i\cot w).$$
//!
//! The envelope is that of the window's middle: the group delay is (N − 1)/2 samples, whatever N.
//!
//! It refuses to repair: a window with a sample that is no number has no envelope.

use cvg_model::{Envelope, Float};

use crate::nco::Phasor;
use crate::{ConfigError, Status};

/// The demodulator's configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demodulator<T> {
    samples: u32,
    all_samples: T,
    per_two_samples: T,
    full_scale_v: T,
    /// an envelope beyond this is none
    most_v: T,
    clip_v: T,
}

/// A window while it grows: plain data, any content is admissible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window<T> {
    /// Σx cos φ, Σx sin φ, Σy cos φ, Σy sin φ
    pub mixed: Envelope<T>,
    /// Σx
    pub x: T,
    /// Σy
    pub y: T,
    /// cosine and sine of the phase at the first sample
    pub start: (T, T),
    /// the last samples of both channels
    pub last: (T, T),
    /// samples so far
    pub count: u32,
    /// samples of either channel that were no finite number
    pub invalid: u16,
    /// samples of either channel at the end of the converter's range
    pub clipped: u16,
}

/// What one window measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement<T> {
    /// the envelope at the window's middle
    pub envelope: Envelope<T>,
    /// [`Window::fingerprint`]
    pub fingerprint: [T; 4],
    /// whether the envelope was measured
    pub status: Status,
    /// samples of either channel that were no finite number
    pub invalid: u16,
    /// samples of either channel at the end of the converter's range
    pub clipped: u16,
}

impl<T: Float> Window<T> {
    /// An empty window that begins at `phasor`.
    #[inline]
    pub fn begin(phasor: &Phasor<T>) -> Self {
        Self {
            mixed: Envelope::zero(),
            x: T::zero(),
            y: T::zero(),
            start: (phasor.cos, phasor.sin),
            last: (T::zero(), T::zero()),
            count: 0,
            invalid: 0,
            clipped: 0,
        }
    }

    /// Σx and Σy, and the last samples: what tells a converter that repeats itself.
    #[inline(always)]
    pub fn fingerprint(&self) -> [T; 4] {
        [self.x, self.y, self.last.0, self.last.1]
    }
}

impl<T: Float> Demodulator<T> {
    /// A demodulator of windows of `samples` (8 to 10,000) for a converter of range ±`full_scale_v` (> 0).
    ///
    /// # Errors
    /// A parameter outside its domain.
    pub fn new(samples: u16, full_scale_v: f64) -> Result<Self, ConfigError> {
        if !(8..=10_000).contains(&samples) {
            return Err(ConfigError { parameter: "samples", expected: "between 8 and 10 000" });
        }
        // the square has to be a number in f32 too
        if !(full_scale_v > 1e-9 && full_scale_v < 1e9) {
            return Err(ConfigError { parameter: "full_scale_v", expected: "between 1e-9 and 1e9" });
        }
        Ok(Self {
            samples: u32::from(samples),
            all_samples: T::from_f64(f64::from(samples)),
            per_two_samples: T::from_f64(0.5 / f64::from(samples)),
            full_scale_v: T::from_f64(full_scale_v),
            most_v: T::from_f64(8.0 * full_scale_v),
            clip_v: T::from_f64(full_scale_v * (1.0 - 1e-4)),
        })
    }

    /// Samples a window.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// Samples by which an envelope is older than the last sample of its window.
    pub fn group_delay_samples(&self) -> f64 {
        0.5 * (f64::from(self.samples) - 1.0)
    }

    /// Adds one sample of each channel, taken at the phase of `phasor`; true when the window is full. Total.
    #[inline]
    pub fn accumulate(&self, window: &mut Window<T>, x: T, y: T, phasor: &Phasor<T>) -> bool {
        let (x, y) = if self.takes(x, y) { (x, y) } else { self.admit(window, x, y) };
        let full = self.add(window, x, y, phasor);
        if full {
            window.last = (x, y);
        }
        full
    }

    /// Both are numbers and below the end of the converter's range.
    #[inline(always)]
    pub fn takes(&self, x: T, y: T) -> bool {
        // false for NaN
        x.magnitude() < self.clip_v && y.magnitude() < self.clip_v
    }

    /// [`Demodulator::accumulate`] for samples that it [takes](Demodulator::takes), but for [`Window::last`], which is
    /// left to whoever finishes the window.
    #[inline(always)]
    pub fn add(&self, window: &mut Window<T>, x: T, y: T, phasor: &Phasor<T>) -> bool {
        window.mixed.x_c = window.mixed.x_c + x * phasor.cos;
        window.mixed.x_s = window.mixed.x_s + x * phasor.sin;
        window.mixed.y_c = window.mixed.y_c + y * phasor.cos;
        window.mixed.y_s = window.mixed.y_s + y * phasor.sin;
        window.x = window.x + x;
        window.y = window.y + y;
        window.count = window.count.wrapping_add(1);
        window.count >= self.samples
    }

    /// Samples of which one is at the end of the range or no number: counted, and made numbers within the range.
    #[cold]
    #[inline(never)]
    pub fn admit(&self, window: &mut Window<T>, x: T, y: T) -> (T, T) {
        let mut one = |v: T| {
            if !v.is_finite() {
                window.invalid = window.invalid.saturating_add(1);
                T::zero()
            } else if v.magnitude() >= self.clip_v {
                window.clipped = window.clipped.saturating_add(1);
                // a number, and not a small one: an end of the range, or short of it
                let end = if v < T::zero() { -self.full_scale_v } else { self.full_scale_v };
                if v.within(self.full_scale_v) { v } else { end }
            } else {
                v
            }
        };
        (one(x), one(y))
    }

    //= specs/dsp.md#carrier-rejection
    //# A stationary carrier MUST be demodulated to its envelope whatever the number of samples in a window and whatever the offset of the converter.
    //= specs/dsp.md#group-delay
    //# An envelope that changes evenly MUST be measured as it is at the middle of its window.
    /// The envelope of a full window that ends where `end` begins, one sample after its last, with the step that was
    /// in use in it.
    pub fn finish(&self, window: &Window<T>, end: &Phasor<T>) -> Measurement<T> {
        let (fingerprint, invalid, clipped) = (window.fingerprint(), window.invalid, window.clipped);
        let (envelope, status) = match self.envelope(window, end) {
            Some(envelope) => (envelope, Status::Valid),
            None => (Envelope::zero(), Status::Invalid),
        };
        Measurement { envelope, fingerprint, status, invalid, clipped }
    }

    /// The envelope of [`Demodulator::finish`], if the window has one.
    #[inline(always)]
    pub fn envelope(&self, window: &Window<T>, end: &Phasor<T>) -> Option<Envelope<T>> {
        if window.invalid > 0 {
            return None;
        }
        let (c0, s0) = window.start;
        let (c1, s1) = (end.cos, end.sin);
        let cosecant = T::one() / end.step_sin;
        let cot = end.step_cos * cosecant;
        let cot_half = cot + cosecant;
        // twice Σe^{iφ} = −(1 + i cot w/2)(e^{iφ_N} − e^{iφ_0})
        let (dc, ds) = (c1 - c0, s1 - s0);
        let (sum_c, sum_s) = (cot_half * ds - dc, -(cot_half * dc + ds));
        // Σe^{2iφ}, the phasors being of length one
        let (a, b) = (s1 * s1 - s0 * s0, c1 * s1 - c0 * s0);
        let (sum_2c, sum_2s) = (a + cot * b, cot * a - b);
        // twice the normal equations, the offset eliminated
        let (mean_c, mean_s) = (sum_c * self.per_two_samples, sum_s * self.per_two_samples);
        let cc = self.all_samples + sum_2c - sum_c * mean_c;
        let ss = self.all_samples - sum_2c - sum_s * mean_s;
        let cs = sum_2s - sum_c * mean_s;
        let inverse = T::two() / (cc * ss - cs * cs);
        let (ic, is, ix) = (cc * inverse, ss * inverse, cs * inverse);
        let solve = |c: T, s: T, sum: T| {
            let (c, s) = (c - sum * mean_c, s - sum * mean_s);
            (is * c - ix * s, ic * s - ix * c)
        };
        let (x_c, x_s) = solve(window.mixed.x_c, window.mixed.x_s, window.x);
        let (y_c, y_s) = solve(window.mixed.y_c, window.mixed.y_s, window.y);
        self.plausible(Envelope::new(x_c, x_s, y_c, y_s))
    }

    /// The envelope, if all four parts of it are numbers and none is far out of range.
    #[inline(always)]
    pub(crate) fn plausible(&self, e: Envelope<T>) -> Option<Envelope<T>> {
        // the sum is a number only if all four are
        let size = e.x_c.magnitude() + e.x_s.magnitude() + e.y_c.magnitude() + e.y_s.magnitude();
        if size < self.most_v { Some(e) } else { None }
    }
}
