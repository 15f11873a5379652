//! What the trait gives an effect that has nothing of its own.

use super::*;

/// An effect that leaves its inverse to the trait: Y sees a part of X's square.
struct Bent;

impl listed::Listed for Bent {}

impl Effect for Bent {
    const DESCRIPTION: Description = Description {
        id: "bent",
        title: "bent axes",
        stage: Stage::Readout,
        declared: false,
        empirical: false,
        in_sensors: false,
        parameters: &[],
        onsets: &[],
        shown: &[],
        signature: "none",
        scaling: Scaling { rate: 0, amplitude: 1, odd_in_rate: false },
        source: "this test",
    };

    fn read<T: Real>(&[bend, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        Envelope::new(e.x_c + bend * e.y_c * e.y_c, e.x_s, e.y_c + bend * e.x_c * e.x_c, e.y_s)
    }
}

#[test]
fn an_effect_without_an_inverse_of_its_own_is_undone_step_by_step() {
    let vibration = Envelope { x_c: 0.6, x_s: -0.2, y_c: 0.5, y_s: 0.3 };
    let now = Moment { t_s: 2.5, table_rad: 0.7, precession_rad_s: -0.4, ..Moment::default() };
    let bend = [0.02, 0.0, 0.0, 0.0];
    let back = Bent::unread(&bend, Bent::read(&bend, vibration, &now), &now);
    // each of eight steps leaves a fiftieth
    assert!((back - vibration).pendulum().e.sqrt() < 1e-13, "{back:?}");
    // what it doesn't act on it leaves
    assert_eq!(Bent::mechanics(&bend, &vibration, &now), Envelope::zero());
    assert_eq!(Bent::input_rate(&bend, 3.0, &now), 3.0);
}
