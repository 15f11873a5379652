//! From a campaign to an identified instrument: prepare, fit what is declared, and what the residual asks for.

use cvg_model::effects::{Belief, EffectId, Parameter, Role as ParameterRole, Stage};

use crate::data::leaping_rows;
use crate::data::plausibility::{without_commands_in_another_unit, without_dead_command, without_held_commands};
use crate::data::quantised_drives::{Quantisation, quantisation};
use crate::data::track::Track;
use crate::error::Refusal;
use crate::estimation::actuation::{DriveGains, RingDown};
use crate::estimation::amplitude_equation::energy_balance;
use crate::estimation::fit::{Effort, Fit, Noise, Prepared, Prior, fit};
use crate::estimation::initial_guess::{Motion, common_gain, pulled};
use crate::estimation::propagation::Start;
use crate::estimation::residuals::{Window, residuals};
use crate::estimation::screening::{Screen, stated};
use crate::estimation::unknown_drives::command_rms;
use crate::model::hypothesis::{Hypothesis, Origin, Unknown};
use crate::numerics::statistics::{median, robust_deviation, root_mean_square, white_noise};
use crate::recording::{Campaign, Instrument, Role, RunKind};

/// Beliefs before the data: what a whole-angle gyroscope can plausibly be. They matter only where the data is silent.
pub mod belief {
    /// 1/τ, 1/s, where nothing tells it: time constants of 8 s and more
    pub const DAMPING_PER_S: f64 = 0.06;
    /// control latency, s
    pub const CONTROL_LATENCY_S: f64 = 2e-3;
    /// the energy command cannot change the amplitude faster than this, 1/s
    pub const FORCING_PER_S: f64 = 3.0;
}

/// Residuals further out than this many robust deviations are spikes.
const SPIKE: f64 = 6.0;
/// What the energy balance leaves of ln a, and how far it is trusted at best; less where the angle has no say in the
/// force scale. A recorded v_as is taken to act, noise and all: noise that a logger added pulls the scale towards zero.
const BALANCE_NOISE: f64 = 1e-3;
pub(super) const BALANCE_SHARE: f64 = 0.3;
const BALANCE_SHARE_ALONE: f64 = 3.0;
/// How far below the usual misfit of all runs, as a share of it, one run's is believed.
const LARGEST_LEAD: f64 = 0.3;
/// A run of which this many times the usual misfit is left is given up.
const GIVEN_UP: f64 = 10.0;
/// How well a search places a line, as a share of its width, one over the longest run.
const LINE_SHARE: f64 = 0.1;
/// The smallest noise that is believed, rad: rounding of the angle itself.
const LEAST_NOISE: f64 = 1e-9;

/// A campaign made ready for fits.
#[derive(Debug)]
pub(crate) struct Dataset {
    pub(crate) instrument: Instrument,
    pub(crate) tracks: Vec<Prepared>,
    pub(crate) start: Hypothesis,
    pub(crate) ring_down_runs: Vec<crate::recording::Run>,
    /// files of those that are of another instrument, or without their command
    pub(crate) ring_downs_left_out: Vec<String>,
    pub(crate) warnings: Vec<String>,
    /// effects as text, which compete with the library's
    pub(crate) written: Vec<EffectId>,
    /// rms of the energy and the quadrature command per unit of amplitude, V/V
    pub(crate) command_rms: [f64; 2],
    /// force scale and its uncertainty as the amplitude tells it, where no ring-down does
    pub(crate) energy_balance: Option<(f64, f64)>,
    /// Δω along both axes and its uncertainty, rad/s, as the quadrature loop tells it
    pub(crate) quadrature_balance: Option<([f64; 2], f64)>,
    /// Δ(1/τ) along both axes and its uncertainty, 1/s, as the energy loop tells it
    pub(crate) damping_balance: Option<([f64; 2], f64)>,
    /// the effects that the fit at hand holds where a loop tells them: for want of an effect that is not in the model the angle takes
    /// them elsewhere
    pub(crate) held: Vec<EffectId>,
    /// 1/level at which the drives clip and its uncertainty, 1/V, as the quadrature balance tells it
    pub(crate) clipping: Option<(f64, f64)>,
    /// the steps that the drives put out, of which the tracks have the mean
    pub(crate) quantisation: Option<Quantisation>,
    /// the runs tell what the commands do from the rest, and the fit at hand adjusts it
    pub(crate) drive_is_free: bool,
    /// fits begin with it free and where the hypothesis has it: nothing is missing that would drag it along
    pub(crate) drive_is_free_at_once: bool,
    /// the usual misfit of the runs is their rms and not their median, which is small where two of three are fitted at the cost of the third
    pub(crate) counts_every_run: bool,
    /// which runs are in, and which were left out and why
    pub(crate) screen: Screen,
}

impl Dataset {
    /// Prepares a campaign.
    ///
    /// # Errors
    /// Where a run is not what the campaign says it is, or tells nothing.
    pub(crate) fn new(campaign: Campaign) -> Result<Self, Refusal> {
        let instrument = campaign.instrument;
        let default_period = if instrument == Instrument::Sensor { 360.0 } else { 180.0 };
        let period_rad = campaign.period_deg.unwrap_or(default_period).to_radians();
        let (mut rotations, ring_downs): (Vec<_>, Vec<_>) =
            campaign.runs.into_iter().partition(|r| r.kind == RunKind::Rotation);
        let mut warnings: Vec<String> = Vec::new();
        for r in rotations.iter().chain(&ring_downs) {
            warnings.extend(r.recording.warnings.iter().cloned());
        }
        for run in &mut rotations {
            without_dead_command(&mut run.recording, f64::INFINITY, &mut warnings);
            without_held_commands(&mut run.recording, &mut warnings);
        }
        without_commands_in_another_unit(&mut rotations, &mut warnings);
        // a ring-down tells nothing without its command
        let (mut ring_down_runs, mut ring_downs_left_out) = (Vec::new(), Vec::new());
        for mut run in ring_downs {
            warnings.extend(leaping_rows::mend(&mut run.recording).map(|(_, said)| said));
            let off_s =
                if let RunKind::Ringdown { energy_off_s, .. } = run.kind { energy_off_s } else { f64::INFINITY };
            if without_dead_command(&mut run.recording, off_s, &mut warnings) {
                ring_downs_left_out.push(run.file.display().to_string());
            } else {
                ring_down_runs.push(run);
            }
        }
        let mut screen = Screen::new(stated(&campaign.angular_gain)?, rotations.len());
        let sound = screen.mended(rotations, &mut warnings)?;
        let tracks = screen.tracks(sound, period_rad, &mut warnings)?;
        let mut start = Hypothesis::ideal(instrument, period_rad, campaign.angular_gain.unwrap_or(0.8));
        let moving = screen.motions(tracks, &start, &mut warnings)?;
        let pulls = (instrument == Instrument::Gyroscope).then(|| pulled(&moving, start.sense())).flatten();
        if let Some(pulls) = pulls {
            let member = start.admit(EffectId::Anisodamping, Origin::Declared);
            (0..2).for_each(|p| start.set(Unknown::Effect(member, p), pulls[p]));
        }
        start.angular_gain = common_gain(&moving, pulls, start.sense());
        let mut prepared: Vec<Prepared> =
            moving.into_iter().map(|(track, motion)| prepared_run(track, motion, instrument)).collect();
        if prepared.iter().all(|p| p.track.samples(Role::Fit) == 0) {
            return Err(Refusal::new("campaign", "no rotation run is left to fit", "a run with use = \"fit\""));
        }
        // Which way a sensor counts is a matter of its wiring: the campaign's own sign is kept.
        let stated = campaign.angular_gain.unwrap_or(start.angular_gain);
        if instrument == Instrument::Sensor && stated * start.angular_gain < 0.0 {
            start.follows_input = true;
            start.angular_gain = -start.angular_gain;
        }
        let quantisation = quantisation(prepared.iter().map(|p| &p.track));
        for p in &mut prepared {
            if let Some(quantisation) = &quantisation {
                quantisation.apply(&mut p.track);
            }
            let precession = start.precession(p.track.mean_speed());
            p.track.thin(precession);
        }
        if !prepared.iter().any(|p| p.track.has_commands()) {
            start.damping_per_s = belief::DAMPING_PER_S;
        }
        let command_rms = command_rms(&prepared);
        start.reference_c = campaign.temperature_c.or_else(|| mean_temperature(&prepared));
        if let Some(reference_c) = start.reference_c {
            prepared.iter_mut().for_each(|p| p.track.refer_to(reference_c));
        }
        Ok(Self {
            instrument,
            command_rms,
            tracks: prepared,
            start,
            ring_down_runs,
            ring_downs_left_out,
            warnings,
            written: Vec::new(),
            energy_balance: None,
            quadrature_balance: None,
            damping_balance: None,
            held: Vec::new(),
            clipping: None,
            quantisation,
            drive_is_free: false,
            drive_is_free_at_once: false,
            counts_every_run: false,
            screen,
        })
    }

    /// The unknowns of a hypothesis on this campaign: what the recorded columns can speak of at all.
    ///
    /// How strong the commands are and how late turns the pattern at a steady rate: k is uncertain by both in any case.
    /// Where nobody recorded them, what they hold is known instead, all but the damping that they replace. What else they
    /// do is left alone unless runs at two or more rates, or in both directions, can tell it.
    pub(crate) fn unknowns(&self, hypothesis: &Hypothesis) -> Vec<Unknown> {
        let mut all = vec![Unknown::AngularGain];
        let recorded = self.tracks.iter().any(|t| t.track.has_commands());
        let gyroscope = self.instrument == Instrument::Gyroscope;
        let commands = self.drive_is_free && gyroscope;
        let quadrature = self.tracks.iter().any(|t| t.track.has_quadrature());
        if gyroscope && recorded {
            all.extend([Unknown::ForceScale, Unknown::ControlLatency]);
        } else if gyroscope {
            all.extend([Unknown::Damping, Unknown::ControlLatency]);
        }
        all.extend(hypothesis.effect_unknowns().into_iter().filter(|u| match u {
            Unknown::Effect(i, _) => match hypothesis.members[*i].id {
                EffectId::Anisoelasticity => quadrature,
                id => commands || !(id.description().stage == Stage::Actuation && id.description().declared),
            },
            _ => true,
        }));
        all
    }

    /// By what factor the residuals exceed their white part: the median over fitted tracks.
    pub(crate) fn excess(&self) -> f64 {
        let fitted = self.tracks.iter().filter(|p| p.track.samples(Role::Fit) > 0);
        median(&mut fitted.map(|p| p.noise.angle / p.white.angle).collect::<Vec<_>>())
    }

    /// Whether a fit leaves far more of one run than of most.
    pub(crate) fn gives_a_run_up(&self) -> bool {
        let fitted = self.tracks.iter().filter(|p| p.track.samples(Role::Fit) > 0);
        let largest = fitted.map(|p| p.noise.angle / p.white.angle).fold(0.0, f64::max);
        largest > GIVEN_UP * self.excess().max(1.0)
    }

    /// The median of the fitted runs' mean amplitudes, V.
    pub(crate) fn usual_amplitude(&self) -> f64 {
        median(&mut fitted_tracks(&self.tracks).map(Track::mean_amplitude).collect::<Vec<_>>())
    }

    /// rms of the commands over the amplitude, V/V.
    fn commanded(&self) -> f64 {
        self.command_rms[0].hypot(self.command_rms[1]).max(1e-9)
    }

    /// The force scale with which the energy command replaces the damping that is believed, 1/s; `None` where it was not recorded.
    fn believed_force_scale(&self) -> Option<f64> {
        (self.command_rms[0] > 0.0).then(|| belief::DAMPING_PER_S / self.command_rms[0])
    }

    /// How far a parameter may be from its neutral value before the data, as a standard deviation.
    pub(crate) fn believed(&self, parameter: &Parameter) -> Option<f64> {
        match parameter.belief {
            Belief::Vague => None,
            Belief::Within(deviation) => Some(deviation),
            Belief::ShareOfAmplitude(share) => Some(share / self.commanded()),
        }
    }

    /// Priors for the unknowns that the data may be silent about.
    pub(crate) fn priors(&self, hypothesis: &Hypothesis, drive: Option<&DriveGains>) -> Vec<Prior> {
        let prior = |unknown, mean, deviation| Prior { unknown, mean, deviation, considered: false };
        let considered = !self.drive_is_free;
        let mut all = vec![
            Prior { considered, ..prior(Unknown::ControlLatency, 0.0, belief::CONTROL_LATENCY_S) },
            Prior { considered: true, ..prior(Unknown::Damping, belief::DAMPING_PER_S, belief::DAMPING_PER_S) },
        ];
        for (i, member) in hypothesis.members.iter().enumerate() {
            for (p, parameter) in member.id.description().parameters.iter().enumerate() {
                if let Some(deviation) = self.believed(parameter) {
                    all.push(prior(Unknown::Effect(i, p), parameter.neutral, deviation));
                }
            }
        }
        // what was measured takes the place of what is believed
        let mut measured = |id, p, mean, deviation| {
            let unknown = hypothesis.position(id).map(|member| Unknown::Effect(member, p));
            for prior in all.iter_mut().filter(|prior| Some(prior.unknown) == unknown) {
                (prior.mean, prior.deviation) = (mean, deviation);
            }
        };
        if let Some((split, deviation)) = self.quadrature_balance {
            (0..2).for_each(|p| measured(EffectId::Anisoelasticity, p, split[p], deviation));
        }
        if let Some((anisodamping, deviation)) = self.damping_balance.filter(|_| self.holds(EffectId::Anisodamping)) {
            (0..2).for_each(|p| measured(EffectId::Anisodamping, p, anisodamping[p], deviation));
        }
        if let Some(d) = drive {
            measured(EffectId::ActuationGainMismatch, 0, d.ratio(), d.ratio() * d.ratio_error.max(1e-6));
        }
        if let Some((inverse_level, deviation)) = self.clipping
            && let Some(member) = hypothesis.position(EffectId::DriveSaturation)
        {
            all.push(Prior { considered, ..prior(Unknown::Effect(member, 0), inverse_level, deviation) });
        }
        let silent = self.believed_force_scale().map_or((0.0, belief::FORCING_PER_S / self.commanded()), |s| (s, s));
        let share = if considered { BALANCE_SHARE_ALONE } else { BALANCE_SHARE };
        let balance = self.energy_balance.map(|(scale, deviation)| (scale, deviation.max(share * scale)));
        let told = self.told_with_the_step().or(balance).unwrap_or(silent);
        let scale = drive.map_or(told, |d| (d.mean(), d.mean() * d.mean_error.max(1e-4)));
        all.push(Prior { considered, ..prior(Unknown::ForceScale, scale.0, scale.1) });
        // A search finds a line to a fraction of its width: beyond that lies another line.
        let spans = self.tracks.iter().map(|p| p.track.t_s[p.track.t_s.len() - 1] - p.track.t_s[0]);
        let width = LINE_SHARE / spans.fold(f64::MIN_POSITIVE, f64::max);
        for (i, m) in hypothesis.members.iter().enumerate() {
            let parameters = m.id.description().parameters.iter().enumerate();
            for (p, _) in parameters.filter(|(_, p)| matches!(p.role, ParameterRole::Located(_))) {
                all.push(prior(Unknown::Effect(i, p), m.values[p], width));
            }
        }
        for member in self.held.iter().filter_map(|id| hypothesis.position(*id)) {
            for p in all.iter_mut().filter(|p| matches!(p.unknown, Unknown::Effect(m, _) if m == member)) {
                p.considered = true;
            }
        }
        // At one rate the sine part of anisodamping is a detection gain mismatch to the last digit: it is held, and
        // widens the interval of that.
        if let Some(member) = hypothesis.position(EffectId::Anisodamping).filter(|_| !self.tracks_differ()) {
            for p in all.iter_mut().filter(|p| p.unknown == Unknown::Effect(member, 1)) {
                p.considered = true;
            }
        }
        all
    }

    /// The force scale from the energy balance alone: how the amplitude answers to the energy command. The amplitude's
    /// own noise wanders, so this is a belief for the fit of the angle and not a part of it.
    pub(crate) fn balance_energy(&mut self, hypothesis: &mut Hypothesis) {
        self.energy_balance = None;
        // at none nothing that the drive does has a slope
        if hypothesis.force_scale <= 0.0 {
            hypothesis.force_scale = self.believed_force_scale().unwrap_or(0.0);
        }
        if let Some((scale, _)) = self.told_with_the_step() {
            // what is put out within a step has the amplitude in it
            hypothesis.force_scale = scale;
            return;
        }
        let starts: Vec<_> = self.tracks.iter().map(|p| p.starts.clone()).collect();
        let Some(balance) = energy_balance(&self.tracks, hypothesis, &starts) else { return };
        let (scale, deviation) = (balance.closed.force_scale, balance.deviation(BALANCE_NOISE));
        if scale > 2.0 * deviation {
            self.energy_balance = Some((scale, deviation));
            (hypothesis.force_scale, hypothesis.damping_per_s) = (scale, balance.closed.damping_per_s);
        }
    }

    /// Takes the drive to be as nothing but the energy balance tells it: where it was free, a misfit may have dragged it along.
    fn believe_the_drive(&self, hypothesis: &mut Hypothesis) {
        if let Some(member) = hypothesis.position(EffectId::ActuationGainMismatch) {
            hypothesis.set(Unknown::Effect(member, 0), 1.0);
        }
        if let Some(scale) = self.believed_force_scale().filter(|_| self.energy_balance.is_none()) {
            hypothesis.force_scale = scale;
        }
    }

    /// Fits a hypothesis from where the runs are, moves them there and measures what is left; says whether that is what
    /// the fit was weighted by.
    pub(super) fn fitted(
        &mut self,
        hypothesis: &Hypothesis,
        drive: Option<&DriveGains>,
        effort: Effort,
    ) -> (Fit, bool) {
        let (unknowns, priors) = (self.unknowns(hypothesis), self.priors(hypothesis, drive));
        let result = fit(&self.tracks, hypothesis, &unknowns, &priors, Role::Fit, effort);
        for (p, s) in self.tracks.iter_mut().zip(&result.starts) {
            p.starts.clone_from(s);
        }
        let before: Vec<f64> = self.tracks.iter().map(|p| p.noise.angle).collect();
        self.measure_noise(&result);
        let settled = self.tracks.iter().zip(before).all(|(p, before)| {
            let change = p.noise.angle / before;
            change < SAME_NOISE && change > SAME_NOISE.recip()
        });
        (result, settled)
    }

    /// Whether the fit at hand holds an effect where a loop tells it.
    pub(super) fn holds(&self, id: EffectId) -> bool {
        self.held.contains(&id)
    }

    /// Fits from `hypothesis` until what is left is what the fit was weighted by.
    pub(super) fn fitted_anew(&mut self, hypothesis: &Hypothesis, drive: Option<&DriveGains>) -> Fit {
        let (mut result, mut settled) = self.fitted(hypothesis, drive, Effort::FULL);
        for _ in ROUNDS..MOST_ROUNDS {
            if settled {
                break;
            }
            (result, settled) = self.fitted(&result.hypothesis, drive, Effort::FULL);
        }
        result
    }

    pub(super) fn weighting(&self) -> Weighting {
        Weighting {
            runs: self.tracks.iter().map(|p| ([p.noise, p.white, p.limit], p.starts.clone())).collect(),
            energy_balance: self.energy_balance,
            quadrature_balance: self.quadrature_balance,
            damping_balance: self.damping_balance,
            held: self.held.clone(),
            drive_is_free: self.drive_is_free,
        }
    }

    pub(super) fn weigh_by(&mut self, weighting: &Weighting) {
        for (p, ([noise, white, limit], starts)) in self.tracks.iter_mut().zip(&weighting.runs) {
            (p.noise, p.white, p.limit) = (*noise, *white, *limit);
            p.starts.clone_from(starts);
        }
        self.energy_balance = weighting.energy_balance;
        self.quadrature_balance = weighting.quadrature_balance;
        self.damping_balance = weighting.damping_balance;
        self.held.clone_from(&weighting.held);
        self.drive_is_free = weighting.drive_is_free;
    }

    /// Weighs the runs by what a fit left of them: trials after it leave them as their own fits had them.
    pub(crate) fn restore(&mut self, fitted: &Fitted) {
        self.weigh_by(&fitted.weighting);
    }

    /// Measures the noise of every track from what a fit leaves, and sets the limits beyond which a residual is a spike.
    pub(crate) fn measure_noise(&mut self, fit: &Fit) {
        let rests = residuals(&self.tracks, &fit.hypothesis, &fit.starts, Role::Fit, Window::Dense);
        let mut left = Vec::with_capacity(rests.len());
        for (prepared, segments) in self.tracks.iter_mut().zip(&rests) {
            if let Some(s) = segments.iter().max_by_key(|s| s.samples) {
                prepared.white = Noise {
                    angle: white_noise(&s.angle).max(LEAST_NOISE),
                    amplitude: white_noise(&s.amplitude).max(LEAST_NOISE),
                };
            }
            left.push((!segments.is_empty()).then(|| Noise {
                angle: robust_deviation(segments.iter().flat_map(|s| s.angle.iter().copied())),
                amplitude: robust_deviation(segments.iter().flat_map(|s| s.amplitude.iter().copied())),
            }));
        }
        let excess = |(p, n): (&Prepared, &Option<Noise>)| n.as_ref().map(|n| n.angle / p.white.angle);
        let mut all: Vec<f64> = self.tracks.iter().zip(&left).filter_map(excess).collect();
        let usual = if self.counts_every_run { root_mean_square(&all) } else { median(&mut all) };
        for (prepared, left) in self.tracks.iter_mut().zip(left) {
            let Some(left) = left else { continue };
            // Weights follow what is really left, so that a misfit cannot outvote a prior or another run; but a run
            // that fits while the others do not must not have it all its way.
            let angle = left.angle.max(LARGEST_LEAD * usual * prepared.white.angle);
            prepared.noise.angle = angle.max(prepared.white.angle);
            if prepared.noise.amplitude.is_finite() {
                prepared.noise.amplitude = left.amplitude.max(prepared.white.amplitude);
            }
            prepared.limit =
                Noise { angle: SPIKE * angle.max(LEAST_NOISE), amplitude: SPIKE * left.amplitude.max(LEAST_NOISE) };
        }
    }
}

/// A run with what its first look leaves for its noise.
fn prepared_run(track: Track, motion: Motion, instrument: Instrument) -> Prepared {
    let deviation = motion.deviation.max(LEAST_NOISE);
    let by_amplitude = instrument == Instrument::Sensor && track.has_amplitude();
    let noise = Noise { angle: deviation, amplitude: if by_amplitude { deviation } else { f64::INFINITY } };
    let limit = Noise { angle: SPIKE * motion.deviation + LEAST_NOISE, amplitude: f64::INFINITY };
    // what a split of the frequencies does to the pattern goes with a quadrature that nobody recorded
    let drifts = instrument == Instrument::Gyroscope && !track.records_the_loops();
    Prepared { noise, white: noise, limit, starts: motion.starts, drifts, track }
}

/// The tracks of which some samples are fitted.
pub(crate) fn fitted_tracks(tracks: &[Prepared]) -> impl Iterator<Item = &Track> {
    tracks.iter().map(|p| &p.track).filter(|t| t.samples(Role::Fit) > 0)
}

/// Mean temperature of the runs that are fitted, °C, where one was recorded.
fn mean_temperature(tracks: &[Prepared]) -> Option<f64> {
    let all = || fitted_tracks(tracks).flat_map(Track::temperatures_c);
    let count = all().count();
    (count > 0).then(|| all().sum::<f64>() / count as f64)
}

/// A hypothesis fitted, and what the ring-downs said.
#[derive(Debug, Clone)]
pub(crate) struct Fitted {
    pub(crate) fit: Fit,
    pub(crate) ring_downs: Vec<RingDown>,
    pub(crate) drive: Option<DriveGains>,
    pub(super) weighting: Weighting,
}

/// What a fit leaves the runs weighted by, for those that go on from it: noise, its white part, limits and starts of every run,
/// what the balances tell, and whether the drive is adjusted.
#[derive(Debug, Clone)]
pub(super) struct Weighting {
    runs: Vec<([Noise; 3], Vec<Start>)>,
    energy_balance: Option<(f64, f64)>,
    quadrature_balance: Option<([f64; 2], f64)>,
    damping_balance: Option<([f64; 2], f64)>,
    held: Vec<EffectId>,
    drive_is_free: bool,
}

/// The paper's model for an instrument: the effects that are declared.
pub(crate) fn declared_hypothesis(start: &Hypothesis) -> Hypothesis {
    let mut hypothesis = start.clone();
    for &id in EffectId::ALL {
        let d = id.description();
        if d.declared && hypothesis.member(id).is_none() && (d.in_sensors || start.instrument == Instrument::Gyroscope)
        {
            hypothesis.admit(id, Origin::Declared);
        }
    }
    hypothesis
}

/// A residual beyond this multiple of its white part is a misfit.
const LARGEST_EXCESS: f64 = 4.0;
/// To what share of it the drive has to bring a misfit that it is believed to explain.
const DRIVES_SHARE: f64 = 0.5;
/// Rounds of fit, noise and spikes: those that come before the drive is freed with the last, and the most there are.
const ROUNDS: usize = 3;
const MOST_ROUNDS: usize = 6;
/// Weights that what is left contradicts by more than this factor call for another round.
const SAME_NOISE: f64 = 1.5;

/// Deviations of its belief beyond which a ratio of the drives is none.
const INCREDIBLE: f64 = 4.0;

/// Whether a fit has the drive where no drive is, whose commands were recorded: it pushes nothing, or the ratio of its gains is beyond all
/// belief.
fn drive_is_incredible(hypothesis: &Hypothesis, commanded: bool) -> bool {
    let parameter = &EffectId::ActuationGainMismatch.description().parameters[0];
    let Belief::Within(deviation) = parameter.belief else { return false };
    let ratio = hypothesis.member(EffectId::ActuationGainMismatch).map_or(parameter.neutral, |m| m.values[0]);
    commanded && (hypothesis.force_scale <= 0.0 || (ratio - parameter.neutral).abs() > INCREDIBLE * deviation)
}

/// Fits `hypothesis` with its ring-downs: readout first, then the drive from the ring-downs, then all together.
///
/// What the commands do is adjusted last, and only when little else is left or it explains most of what is: it multiplies,
/// and a misfit would drag it along.
///
/// # Errors
/// Where a ring-down is not one.
pub(crate) fn fit_with_ring_downs(dataset: &mut Dataset, hypothesis: &Hypothesis) -> Result<Fitted, Refusal> {
    let mut hypothesis = hypothesis.clone();
    hypothesis.control_latency_s = 0.0;
    dataset.held.clear();
    if let Some(member) = hypothesis.position(EffectId::ActuationGainMismatch)
        && !dataset.drive_is_free_at_once
    {
        hypothesis.set(Unknown::Effect(member, 0), 1.0);
    }
    let commanded = dataset.believed_force_scale().is_some();
    let mut explains = None;
    let mut round = 0;
    loop {
        // the drive first: it multiplies all that the commands do
        let ring_downs = dataset.ring_downs(&hypothesis)?;
        let drive = DriveGains::from_ring_downs(&ring_downs);
        match &drive {
            Some(d) => {
                hypothesis.force_scale = d.mean();
                hypothesis.damping_per_s =
                    ring_downs.iter().map(|r| r.tau_s.recip()).sum::<f64>() / ring_downs.len() as f64;
                if let Some(member) = hypothesis.position(EffectId::ActuationGainMismatch) {
                    hypothesis.set(Unknown::Effect(member, 0), d.ratio());
                }
            }
            None => dataset.balance_energy(&mut hypothesis),
        }
        dataset.balance_quadrature(&hypothesis, drive.as_ref());
        dataset.begin_with_the_balance(&mut hypothesis);
        let last = round + 1 >= ROUNDS;
        let freed = last && (explains == Some(true) || dataset.excess() < LARGEST_EXCESS);
        dataset.drive_is_free = dataset.tells_the_drive() && (dataset.drive_is_free_at_once || freed);
        if drive.is_none() && !dataset.drive_is_free && drive_is_incredible(&hypothesis, commanded) {
            dataset.believe_the_drive(&mut hypothesis);
        }
        let (result, settled) =
            dataset.fitted(&hypothesis, drive.as_ref(), if last { Effort::FULL } else { Effort::ROUGH });
        hypothesis = result.hypothesis.clone();
        round += 1;
        if !last || !(settled || round >= MOST_ROUNDS) {
            continue;
        }
        if explains.is_none() && !dataset.drive_is_free && dataset.tells_the_drive() {
            let (held, before) = (dataset.weighting(), dataset.excess());
            dataset.drive_is_free = true;
            let (freed, _) = dataset.fitted(&hypothesis, drive.as_ref(), Effort::FULL);
            // a ratio of the drives that nobody believes explains nothing
            let believed =
                !dataset.priors(&freed.hypothesis, drive.as_ref()).iter().any(|p| p.is_exceeded(&freed.hypothesis));
            explains = Some(believed && dataset.excess() < DRIVES_SHARE * before);
            if explains == Some(true) {
                (hypothesis, round) = (freed.hypothesis, ROUNDS);
                continue;
            }
            dataset.weigh_by(&held);
        }
        let result = if drive.is_none() && dataset.drive_is_free && drive_is_incredible(&result.hypothesis, commanded) {
            // the angle does not tell it after all
            dataset.drive_is_free = false;
            dataset.believe_the_drive(&mut hypothesis);
            dataset.fitted_anew(&hypothesis, drive.as_ref())
        } else {
            result
        };
        let result = if dataset.contradicts_the_balance(&result.hypothesis) {
            dataset.with_the_split_held(&hypothesis, drive.as_ref())
        } else {
            result
        };
        return Ok(Fitted { fit: result, ring_downs, drive, weighting: dataset.weighting() });
    }
}
