//! How far the vibration's frequency is from the reference, from the envelope's own turning: what starts the
//! phase-locked loop.
//!
//! The sum of X_k X̄_{k−1} + Y_k Ȳ_{k−1} over windows turns by (ω − ω_r)T a window whatever the orbit is, line or circle,
//! and however the pattern precesses. Its angle is unique up to half a turn a window.

use cvg_model::{Envelope, Float};

/// The sum: plain data, any content is admissible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beat<T> {
    pub(crate) last: Envelope<T>,
    pub(crate) along: T,
    pub(crate) across: T,
    pub(crate) x2: T,
    pub(crate) y2: T,
    pub(crate) windows: u32,
}

impl<T: Float> Default for Beat<T> {
    fn default() -> Self {
        let zero = T::zero();
        Self { last: Envelope::zero(), along: zero, across: zero, x2: zero, y2: zero, windows: 0 }
    }
}

impl<T: Float> Beat<T> {
    /// Adds a window.
    #[inline]
    pub fn add(&mut self, e: &Envelope<T>) {
        if self.windows > 0 {
            let l = &self.last;
            // (x_c − i x_s)(l_c + i l_s)
            self.along = self.along + (e.x_c * l.x_c + e.x_s * l.x_s) + (e.y_c * l.y_c + e.y_s * l.y_s);
            self.across = self.across + (e.x_c * l.x_s - e.x_s * l.x_c) + (e.y_c * l.y_s - e.y_s * l.y_c);
        }
        self.x2 = self.x2 + e.x_c * e.x_c + e.x_s * e.x_s;
        self.y2 = self.y2 + e.y_c * e.y_c + e.y_s * e.y_s;
        self.last = *e;
        self.windows = self.windows.saturating_add(1);
    }

    /// Windows added.
    pub fn windows(&self) -> u32 {
        self.windows
    }

    /// ω − ω_r in rad per window, in [−π, π]; 0 where nothing is known.
    #[inline]
    pub fn radians_per_window(&self) -> T {
        self.across.atan2(self.along).bounded(T::PI)
    }

    /// Sums of the squared envelopes of X and Y.
    pub fn powers(&self) -> (T, T) {
        (self.x2, self.y2)
    }
}

/// Cosine and sine of the phase δ of the vibration ahead of the reference, in (−90°, 90°]: half the angle of
/// X² + Y² = (a² − q²)e^{2iδ}. (1, 0) where that is 0 or no number.
#[inline]
pub fn phase_ahead<T: Float>(e: &Envelope<T>) -> (T, T) {
    let cos_2 = e.x_c * e.x_c - e.x_s * e.x_s + e.y_c * e.y_c - e.y_s * e.y_s;
    let sin_2 = -(T::two() * (e.x_c * e.x_s + e.y_c * e.y_s));
    let (cos, sin) = crate::nco::half_angle(cos_2, sin_2);
    if cos.is_finite() && sin.is_finite() { (cos, sin) } else { (T::one(), T::zero()) }
}

#[cfg(test)]
mod tests {
    use super::{Beat, Envelope};

    #[test]
    fn windows_are_counted_to_the_end_of_the_count_and_stay_there() {
        let mut beat = Beat { windows: u32::MAX - 1, ..Beat::<f32>::default() };
        for _ in 0..3 {
            beat.add(&Envelope::new(1.0, 0.0, 0.0, 0.0));
            assert_eq!(beat.windows(), u32::MAX);
        }
    }
}
