//! What is put out: the drives at a phase of the carrier, within the converter's limit.

use cvg_model::{AxisForces, Float};

//= specs/dsp.md#bounded-commands
//# Every output of the instrument MUST be finite and within the converter's limit for every input and every state.
/// The drives of X and Y at the phase of (`cos`, `sin`), V, each within ±`limit_v`; 0 where that is no number.
///
/// Nothing is assumed of the drives or the phase: this is the last that a command passes, and what is bounded here is
/// bounded whatever came before.
#[inline(always)]
pub(crate) fn put_out<T: Float>(limit_v: T, d: &AxisForces<T>, cos: T, sin: T) -> (T, T) {
    let (x, y) = (d.x_c * cos + d.x_s * sin, d.y_c * cos + d.y_s * sin);
    if x.within(limit_v) && y.within(limit_v) { (x, y) } else { limited(limit_v, x, y) }
}

#[cold]
#[inline(never)]
pub(crate) fn limited<T: Float>(limit_v: T, x: T, y: T) -> (T, T) {
    (x.bounded(limit_v), y.bounded(limit_v))
}

#[cfg(test)]
mod tests {
    use super::{AxisForces, put_out};

    #[test]
    fn each_output_is_held_to_its_own_limit() {
        let nan = f64::NAN;
        let cases = [
            ([3.0, 0.5], [2.0, 0.5]),
            ([0.5, 3.0], [0.5, 2.0]),
            ([-3.0, 0.5], [-2.0, 0.5]),
            ([0.5, -3.0], [0.5, -2.0]),
            ([3.0, -3.0], [2.0, -2.0]),
            ([2.0, -2.0], [2.0, -2.0]),
            ([nan, 0.5], [0.0, 0.5]),
            ([0.5, nan], [0.5, 0.0]),
        ];
        for ([x, y], [put_x, put_y]) in cases {
            let in_phase = AxisForces { x_c: x, x_s: 0.0, y_c: y, y_s: 0.0 };
            assert_eq!(put_out(2.0, &in_phase, 1.0, 0.0), (put_x, put_y), "{x} {y}");
            let in_quadrature = AxisForces { x_c: 0.0, x_s: x, y_c: 0.0, y_s: y };
            assert_eq!(put_out(2.0, &in_quadrature, 0.0, 1.0), (put_x, put_y), "{x} {y}");
        }
    }
}
