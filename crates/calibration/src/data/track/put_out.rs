//! What drives put out of a track's commands, in the place of these.

use cvg_estimator::direction::major_axis;

use super::Track;

impl Track {
    /// Takes for commands what the drives put out: `added` has what that is more than was commanded, of X and Y in quadrature with the pattern
    /// and in phase with it, V, in the mean from each sample to the next. Along the axis of either command that is another command; what
    /// is put out across the pattern beside v_as is kept by itself. What pushes along the pattern in phase with it moves that phase alone.
    pub(crate) fn put_out(&mut self, added: &[[[f64; 2]; 2]]) {
        let around = |i: usize, phase: usize, axis: usize| {
            let intervals = [i.checked_sub(1), Some(i)].into_iter().flatten().filter_map(|j| added.get(j));
            0.5 * intervals.map(|added| added[phase][axis]).sum::<f64>()
        };
        let more: Vec<[f64; 3]> = (0..self.t_s.len())
            .map(|i| {
                let seen = self.envelope(i);
                let d = major_axis(&seen, &seen.pendulum());
                let [[x_s, y_s], [x_c, y_c]] = [0, 1].map(|phase| [0, 1].map(|axis| around(i, phase, axis)));
                [x_s * d.cos + y_s * d.sin, y_c * d.cos - x_c * d.sin, y_s * d.cos - x_s * d.sin]
            })
            .collect();
        let Some(commands) = &mut self.commands else { return };
        for (command, column) in commands.iter_mut().zip(0..) {
            command.iter_mut().zip(&more).for_each(|(v, more)| *v += more[column]);
        }
        self.across = Some(more.iter().map(|more| more[2]).collect());
    }
}
