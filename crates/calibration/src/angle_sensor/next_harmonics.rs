//! Lines of the reference's turn that are the next harmonics of the sensor's own table: where nothing tells whose they are, the table that
//! reaches them is taken, because a calibration carries that and no lines.

use super::cross_validation::{Candidate, Losses};
use super::lines::is_harmonic_of_table;
use super::selection::{Model, ORDERS, Selection};

/// A single line is a tooth or a pole, of whatever number; so many that a table would hold are its tail.
const A_TAIL: usize = 2;

impl Selection<'_> {
    /// A model with a longer table in the place of the lines that it holds, where it predicts about as well: no worse by more than the
    /// standard error that brought the lines in.
    pub(super) fn with_its_next_harmonics(&mut self, chosen: Candidate<Model>) -> Candidate<Model> {
        let (front, shape) = &chosen.model;
        let cycles = self.cycles_per_turn();
        let longer = |order: usize| {
            let lines: Vec<u32> =
                shape.lines.iter().copied().filter(|n| !is_harmonic_of_table(*n, order, cycles)).collect();
            (shape.lines.len() - lines.len() >= A_TAIL).then_some((order, lines))
        };
        let orders = ORDERS.into_iter().filter(|order| *order > shape.order);
        let shapes: Vec<_> = orders
            .filter_map(longer)
            .flat_map(|(order, lines)| self.shapes(&[order], &[shape.motion], &lines))
            .collect();
        let offered = self.offer(std::slice::from_ref(front), &shapes);
        let least = |a: &Candidate<Model>, b: &Candidate<Model>| a.losses.rms().total_cmp(&b.losses.rms());
        let best = offered.into_iter().min_by(least);
        best.filter(|c| !Losses::is_better_than(&chosen.losses, &c.losses)).unwrap_or(chosen)
    }
}
