//! The unknowns of a fit, sorted by what they act on, and the lanes in which their slopes are carried.

use cvg_model::effects::{MAX_PARAMETERS, Stage, Values};

use crate::model::hypothesis::{Hypothesis, Member, Unknown};
use crate::model::jet::{Jet, LANES};

/// Up to [`LANES`] unknowns that are differentiated against together.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lanes {
    /// the column of each lane among all unknowns
    pub(crate) columns: Vec<usize>,
    /// lanes of each member's parameters
    of_members: Vec<[Option<usize>; MAX_PARAMETERS]>,
    pub(crate) force_scale: Option<usize>,
    pub(crate) control_latency: Option<usize>,
}

impl Lanes {
    fn new(columns: &[usize], all: &[Unknown], members: usize) -> Self {
        let mut lanes =
            Self { columns: columns.to_vec(), of_members: vec![[None; MAX_PARAMETERS]; members], ..Self::default() };
        for (lane, &column) in columns.iter().enumerate() {
            match all[column] {
                Unknown::Effect(i, p) => lanes.of_members[i][p] = Some(lane),
                Unknown::ForceScale => lanes.force_scale = Some(lane),
                Unknown::ControlLatency => lanes.control_latency = Some(lane),
                Unknown::AngularGain | Unknown::Damping => {}
            }
        }
        lanes
    }

    pub(crate) fn jet(&self, value: f64, lane: Option<usize>) -> Jet {
        lane.map_or_else(|| Jet::constant(value), |l| Jet::unknown(value, l))
    }

    /// A member's values, those with a lane as unknowns.
    pub(crate) fn values(&self, index: usize, member: &Member) -> Values<Jet> {
        let lanes = &self.of_members[index];
        std::array::from_fn(|p| self.jet(member.values[p], lanes[p]))
    }
}

/// The unknowns of a fit, sorted by what they act on.
#[derive(Debug, Clone)]
pub(crate) struct Unknowns {
    /// all, in the order of columns
    pub(crate) all: Vec<Unknown>,
    /// some are readout parameters
    pub(crate) of_the_readout: bool,
    /// columns of mechanics parameters
    pub(crate) mechanics: Vec<usize>,
    /// force scale, control latency and actuation parameters, in groups of lanes: one without columns where there are none
    pub(crate) forcing: Vec<Lanes>,
    /// input parameters, in the same way
    pub(crate) input: Vec<Lanes>,
    /// column of k
    pub(crate) angular_gain: Option<usize>,
    /// column of 1/τ
    pub(crate) damping: Option<usize>,
}

impl Unknowns {
    pub(crate) fn new(hypothesis: &Hypothesis, all: Vec<Unknown>) -> Self {
        let at = |stage: Stage| -> Vec<usize> {
            (0..all.len())
                .filter(|&column| match all[column] {
                    Unknown::Effect(i, _) => hypothesis.members[i].id.description().stage == stage,
                    Unknown::ForceScale | Unknown::ControlLatency => stage == Stage::Actuation,
                    Unknown::AngularGain | Unknown::Damping => false,
                })
                .collect()
        };
        let members = hypothesis.members.len();
        let groups =
            |columns: &[usize]| -> Vec<Lanes> { columns.chunks(LANES).map(|c| Lanes::new(c, &all, members)).collect() };
        let one_at_least = |columns: &[usize]| {
            if columns.is_empty() { vec![Lanes::new(columns, &all, members)] } else { groups(columns) }
        };
        Self {
            of_the_readout: !at(Stage::Readout).is_empty(),
            mechanics: at(Stage::Mechanics),
            forcing: one_at_least(&at(Stage::Actuation)),
            input: one_at_least(&at(Stage::Input)),
            angular_gain: all.iter().position(|u| *u == Unknown::AngularGain),
            damping: all.iter().position(|u| *u == Unknown::Damping),
            all,
        }
    }

    /// The column of each parameter of a member.
    pub(crate) fn columns_of(&self, member: usize) -> [Option<usize>; MAX_PARAMETERS] {
        std::array::from_fn(|p| self.all.iter().position(|u| *u == Unknown::Effect(member, p)))
    }
}
