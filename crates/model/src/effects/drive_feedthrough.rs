//! Feed-through of the drive into the pick-off: X_d = X + c_x F_x, Y_d = Y + c_y F_y, with F the commanded voltage of that axis
//! as an envelope and c a complex number, c = c' + i c″.
//!
//! The energy command holds v_as/a, so what it adds in quadrature is a lag between the channels, and what it adds in phase
//! is a mismatch of their gains: v_as (c″_y − c″_x)/a. The quadrature command goes as sin 2(θ − θ_ω) where the plates are
//! split, and adds c' v_qc/a to the angle and c″ v_qc to the quadrature that the loop then nulls by a true one.

use super::{Belief, Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::{Envelope, Real};

/// What the drives feed through, in all.
const A_FIFTIETH: Belief = Belief::ShareOfAmplitude(0.02);

/// feed-through of the drive into the pick-off.
pub struct DriveFeedthrough;

impl Effect for DriveFeedthrough {
    const SEEN_BY_LOOPS: bool = true;
    const ON_COMMANDS: bool = true;
    const DESCRIPTION: Description = Description {
        id: "drive-feedthrough",
        title: "feed-through of the drive into the pick-off",
        stage: Stage::Readout,
        declared: false,
        empirical: false,
        in_sensors: false,
        parameters: &[
            fitted("x_in_phase", "V/V", 1.0, 1e-3).believed(A_FIFTIETH),
            fitted("x_quadrature", "V/V", 1.0, 1e-3).believed(A_FIFTIETH),
            fitted("y_in_phase", "V/V", 1.0, 1e-3).believed(A_FIFTIETH),
            fitted("y_quadrature", "V/V", 1.0, 1e-3).believed(A_FIFTIETH),
        ],
        onsets: &[],
        shown: &[Shown::Plain(0), Shown::Plain(1), Shown::Plain(2), Shown::Plain(3)],
        signature: "angle (v_qc/a)[½(c'_x + c'_y) − ½(c'_x − c'_y) cos 2θ] with v_qc at 2θ through a split, and (v_as/2a)(c″_y − c″_x) \
                    sin 2θ as a mismatch of the gains has it; both gone with the commands",
        scaling: Scaling { rate: 0, amplitude: 0, odd_in_rate: false },
        source: "capacitive coupling between drive and pick-off electrodes",
    };

    #[inline]
    fn read<T: Real>(p: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        e + fed_through(p, at)
    }

    #[inline]
    fn unread<T: Real>(p: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        e - fed_through(p, at)
    }
}

/// c F in each channel, with X = x_c − i x_s and F = f_c − i f_s.
#[inline]
fn fed_through<T: Real>(&[x_in, x_quad, y_in, y_quad]: &Values<T>, at: &Moment<T>) -> Envelope<T> {
    let f = &at.drive;
    Envelope::new(
        x_in * f.x_c + x_quad * f.x_s,
        x_in * f.x_s - x_quad * f.x_c,
        y_in * f.y_c + y_quad * f.y_s,
        y_in * f.y_s - y_quad * f.y_c,
    )
}
