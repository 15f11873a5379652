//! What the calibrator remembers between control steps. Plain data.

use cvg_model::Float;

use crate::correction::{Correction, Move};
use crate::cycle::Doubt;
use crate::parameters::{N, Vector};
use crate::regressors::CHANNELS;
use crate::ud::{Growth, Ud, Update};
use crate::window::{Sample, Sums};

/// The filter: an error state about the compensation in force, in expected units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Filter<T> {
    pub(crate) ud: Ud<T>,
    pub(crate) work: Work<T>,
    pub(crate) growth: Growth<T>,
    pub(crate) mean: Vector<T>,
    /// what each parameter should have shown since the integrals began, forgotten slowly
    pub(crate) shown: [Vector<T>; CHANNELS],
    /// what was seen beyond what is known
    pub(crate) seen: [T; CHANNELS],
    /// white noise of each channel, squared
    pub(crate) noise: [T; CHANNELS],
    pub(crate) innovation: [T; CHANNELS],
    pub(crate) last_innovation: [T; CHANNELS],
    pub(crate) spread: T,
    /// what the mean says of this cycle, while a channel is integrated part by part
    pub(crate) believed: T,
    /// whose turn it is to have wandered
    pub(crate) growing: usize,
}

/// What is under way over several control steps: one thing at a time, so that they share their room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Work<T> {
    /// a measurement
    Measure(Update<T>),
    /// a commit, moved into the compensation
    Move(Move<T>),
}

impl<T: Float> Work<T> {
    pub(crate) fn update(&mut self) -> Option<&mut Update<T>> {
        match self {
            Self::Measure(update) => Some(update),
            Self::Move(_) => None,
        }
    }
}

/// What is kept of the cycle before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Before<T> {
    pub(crate) y: [T; CHANNELS],
    pub(crate) late: [T; CHANNELS],
    pub(crate) cos_2: T,
    pub(crate) sin_2: T,
    /// what the mean says of the angle's first half step
    pub(crate) angle: T,
    pub(crate) whole: bool,
}

/// Where the learning is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Schedule<T> {
    pub(crate) stage: u8,
    /// cycles used in this stage
    pub(crate) used: u32,
    /// cycles until integrals may run
    pub(crate) settle: u16,
    /// cycles until the pattern counts as at rest again
    pub(crate) moving: u16,
    /// cycles until the angle may be used again
    pub(crate) hold: [u16; CHANNELS],
    /// cycles that the angle was used, up to what is enough
    pub(crate) angle_used: u16,
    pub(crate) uses_of_symmetry: u16,
    /// the rate that nothing explains, low-passed, rad/s
    pub(crate) unexplained: T,
    pub(crate) turn: T,
    /// rotation since the last commit, back and forth, rad
    pub(crate) swept: T,
    pub(crate) rate: T,
    pub(crate) doubt: Doubt<T>,
    pub(crate) profile: u32,
    pub(crate) fresh: u16,
    /// twice the innovations beyond all expectation, less those within
    pub(crate) refused: u16,
    /// the stage that the first rest interrupted
    pub(crate) before_rest: u8,
    /// in the first stage, and nothing was told of the detection before it
    pub(crate) cold: bool,
    /// cycles since rotation told the detection
    pub(crate) untold: u16,
    pub(crate) excited: bool,
    pub(crate) live: bool,
    pub(crate) accept: bool,
    pub(crate) commit: Commit,
    pub(crate) forgetting: Forgetting<T>,
}

/// What a [`Commit::Forget`] is on its way to: the first `count` parameters of variance `d` each, and told by nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Forgetting<T> {
    pub(crate) count: u8,
    /// columns of the covariance that are done; then the mean, then what was under way
    pub(crate) done: u8,
    pub(crate) d: T,
}

/// What this cycle's control steps are spent on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Commit {
    None,
    /// moves the mean into the compensation
    Forth,
    /// takes the last one back
    Back,
    /// forgets, to the end of the cycle in which that is done
    Forget,
}

/// What the calibrator remembers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State<T> {
    pub(crate) correction: Correction<T>,
    pub(crate) filter: Filter<T>,
    pub(crate) before: Before<T>,
    pub(crate) schedule: Schedule<T>,
    pub(crate) sums: Sums<T>,
    pub(crate) closed: Sums<T>,
    pub(crate) sample: Sample<T>,
    /// what the last commit moved, and how much worse it has predicted since
    pub(crate) trial: Vector<T>,
    pub(crate) score: T,
    pub(crate) taken_back: u16,
    pub(crate) step: u16,
    pub(crate) direction: (T, T),
    /// rad/s that are to be commanded
    pub(crate) precession: T,
}

impl<T: Float> Filter<T> {
    pub(crate) fn new() -> Self {
        let zero = T::zero();
        Self {
            ud: Ud::diagonal(T::one()),
            work: Work::Measure(Update::idle()),
            growth: Growth::idle(),
            mean: [zero; N],
            shown: [[zero; N]; CHANNELS],
            seen: [zero; CHANNELS],
            noise: [T::from_f64(1e-9); CHANNELS],
            innovation: [zero; CHANNELS],
            last_innovation: [zero; CHANNELS],
            spread: T::one(),
            believed: zero,
            growing: 0,
        }
    }

    /// The integrals of a channel begin anew.
    pub(crate) fn restart(&mut self, channel: usize) {
        if let Some(shown) = self.shown.get_mut(channel) {
            *shown = [T::zero(); N];
        }
        if let Some(seen) = self.seen.get_mut(channel) {
            *seen = T::zero();
        }
    }
}

impl<T: Float> Before<T> {
    pub(crate) fn none() -> Self {
        let zero = T::zero();
        Self { y: [zero; 3], late: [zero; 3], cos_2: zero, sin_2: zero, angle: zero, whole: false }
    }
}

impl<T: Float> Schedule<T> {
    pub(crate) fn new(settle: u16) -> Self {
        let zero = T::zero();
        Self {
            stage: 0,
            used: 0,
            settle,
            moving: 0,
            hold: [0; CHANNELS],
            angle_used: 0,
            uses_of_symmetry: 0,
            unexplained: zero,
            turn: zero,
            swept: zero,
            rate: zero,
            doubt: Doubt { force_scale: zero, rate: zero },
            profile: 0,
            fresh: 0,
            refused: 0,
            before_rest: 0,
            cold: true,
            untold: u16::MAX,
            excited: false,
            live: false,
            accept: false,
            commit: Commit::None,
            forgetting: Forgetting { count: 0, done: 0, d: T::one() },
        }
    }
}
