//! What a fit says of the instrument: the angular gain, the ratios of the gains and the effects, each with its interval, where
//! the campaign tells it.

use cvg_model::effects::harmonic_n;
use cvg_model::effects::{EffectId, Parameter, Role as ParameterRole, Shown, Stage};
use nalgebra::DMatrix;

use crate::diagnostics::evaluate::{Evaluation, evaluate};
use crate::estimation::actuation::DriveGains;
use crate::estimation::coloured_noise::DRIFT_RAD_S;
use crate::estimation::fit::Prior;
use crate::estimation::identifiability::{confounded_with, separated_by};
use crate::estimation::joint_fit::{Dataset, Fitted};
use crate::estimation::residuals::Window;
use crate::estimation::ring_down_agreement::spread_of_dampings;
use crate::estimation::unseen_quadrature::with_unseen_quadrature;
use crate::model::hypothesis::{Hypothesis, Member, Origin, Unknown};
use crate::recording::{Instrument, Role};
use crate::report::polar::polar;
use crate::report::{BeforeAfter, EffectReport, Estimate, ParameterReport};
use crate::selection::candidates::alike_at_one_amplitude;
use crate::selection::step::Step;

/// Share of its prior's width to which an unknown must narrow to count as told by the data.
const MIN_CONTRACTION: f64 = 0.1;
/// Gain ratios known no better than this, as the half width of the interval, are no answer.
const WIDEST_DETECTION_RATIO: f64 = 0.1;
const WIDEST_ACTUATION_RATIO: f64 = 0.02;

/// What a fit says of the instrument, with intervals.
pub(crate) struct Inference<'a> {
    pub(crate) dataset: &'a Dataset,
    pub(crate) fitted: &'a Fitted,
    /// of the unknowns, as the fit has it: what it takes for one another
    pub(crate) by_fit: &'a DMatrix<f64>,
    /// of the unknowns, with what effects that were not found may have moved
    pub(crate) covariance: &'a DMatrix<f64>,
}

/// A step of a readout's unknown that the ring-downs still answer in proportion to.
const LARGEST_STEP: f64 = 1e-3;
/// What a run says by itself contradicts all runs beyond this many of its standard deviations.
pub(crate) const CONTRADICTS: f64 = 6.0;
/// Ring-downs of one device differ by less than this share in their damping once the anisodamping is known.
const OTHER_DAMPING: f64 = 0.01;
/// An interval that is so many times as wide as noise makes it was widened because ring-downs and rotations differ.
const CONTRADICTED: f64 = 3.0;
/// A drift that contradicts what is believed of drifts, in standard deviations of that: 1 in 100.
const UNBELIEVED: f64 = 2.33;
/// Cubics of the two channels differ by this share of them at most, as where the gaps of their plates differ by a tenth: engineering choice.
const UNLIKE_CUBICS: f64 = 0.2;

/// An estimate from all runs whose interval also covers what single runs contradict it with, each with its standard
/// deviation, beyond so many of them: the fit takes what runs differ in for noise, and many samples make little of that. Says
/// which do.
pub(crate) fn covering<'a>(
    all: Estimate,
    what: &str,
    runs: impl Iterator<Item = (&'a str, Option<[f64; 2]>)>,
    beyond: f64,
    warnings: &mut Vec<String>,
) -> Estimate {
    let odd = contradicting(all, runs, beyond);
    let Some(farthest) = odd.iter().map(|(_, own)| (own - all.value).abs()).max_by(f64::total_cmp) else { return all };
    warnings.push(format!(
        "the runs do not agree on the {what}, {:.5} of all of them: {}; its interval covers them",
        all.value,
        listed(&odd)
    ));
    all.widened(farthest - all.half_width())
}

/// The runs that contradict an estimate from all of them, beyond so many standard deviations of their own, each with what it
/// tells.
fn contradicting<'a>(
    all: Estimate,
    runs: impl Iterator<Item = (&'a str, Option<[f64; 2]>)>,
    beyond: f64,
) -> Vec<(&'a str, f64)> {
    let half = all.half_width();
    let contradicts = |own: f64, deviation: f64| (own - all.value).abs() > half.max(beyond * deviation);
    runs.filter_map(|(run, own)| own.filter(|[v, d]| contradicts(*v, *d)).map(|[v, _]| (run, v))).collect()
}

/// The first of runs with what each tells, for a message.
fn listed(runs: &[(&str, f64)]) -> String {
    runs.iter().take(4).map(|(run, own)| format!("{run} {own:.5}")).collect::<Vec<_>>().join(", ")
}

/// An estimate with an interval that reaches to what single runs tell.
fn reaching(all: Estimate, runs: &[(&str, f64)]) -> Estimate {
    runs.iter().fold(all, |e, (_, own)| Estimate { ci95: [e.ci95[0].min(*own), e.ci95[1].max(*own)], ..e })
}

/// What rotations say without the ring-downs lies no further beyond the common value than so many times what lies between that and the
/// ring-downs': of the two covariances either may be off.
const MOST_BEYOND: f64 = 2.0;

/// The share by which a correction without a cause slows a nominal precession, rad/s, if it is mechanics: by ½ p²/(kΩ)² of a
/// precession p sin nθ. An error A sin nθ of the angle is one of n A kΩ.
fn slowing(m: &Member, nominal: f64) -> f64 {
    let square = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
    if m.id == EffectId::HarmonicN {
        return 0.5 * (m.values[0] * harmonic_n::factor(m.values[3], nominal)).powi(2) * square(&m.values[1..3]);
    }
    let is_mechanics = m.id.description().stage == Stage::Mechanics;
    if is_mechanics { 0.5 * square(&m.values) / (nominal * nominal) } else { 0.0 }
}

impl Inference<'_> {
    fn hypothesis(&self) -> &Hypothesis {
        &self.fitted.fit.hypothesis
    }

    fn index(&self, unknown: Unknown) -> Option<usize> {
        self.fitted.fit.unknowns.iter().position(|u| *u == unknown)
    }

    fn deviation(&self, unknown: Unknown) -> f64 {
        let Some(i) = self.index(unknown) else { return 0.0 };
        self.covariance[(i, i)].max(0.0).sqrt().hypot(self.by_damping(unknown))
    }

    /// What a fault of the drives could be by as much damping as nobody knows, where their commands were not recorded: what they do
    /// against it is the damping times the fault, and two faults that nearly cancel narrow it by their product alone. What they do
    /// against a split of the frequencies, where there is one, tells them by itself.
    fn by_damping(&self, unknown: Unknown) -> f64 {
        let (Unknown::Effect(at, p), Some(damping)) = (unknown, self.index(Unknown::Damping)) else { return 0.0 };
        let member = &self.hypothesis().members[at];
        if member.id.description().stage != Stage::Actuation || self.tells_a_split() {
            return 0.0;
        }
        let share = self.covariance[(damping, damping)].max(0.0).sqrt() / self.hypothesis().damping_per_s;
        (share * (member.values[p] - member.id.neutral::<f64>()[p])).abs()
    }

    /// A split of the frequencies is told from nothing.
    fn tells_a_split(&self) -> bool {
        let Some(at) = self.hypothesis().position(EffectId::Anisoelasticity) else { return false };
        let values = &self.hypothesis().members[at].values;
        let variance = |p: usize| self.index(Unknown::Effect(at, p)).map_or(0.0, |i| self.covariance[(i, i)].max(0.0));
        values[0].hypot(values[1]) > 1.96 * (variance(0) + variance(1)).sqrt()
    }

    fn estimate(&self, unknown: Unknown) -> Estimate {
        Estimate::new(self.hypothesis().get(unknown), self.deviation(unknown))
    }

    /// The angular gain. A precession p sin 4θ slows the mean of −kΩ to √((kΩ)² − p²), an error of the readout does not:
    /// where a residual at 4θ is corrected as either without a known cause, what the other would make of k is allowed for. So
    /// is what single runs contradict it with, by how much the references of every run differ, and what is beyond belief.
    pub(crate) fn angular_gain(&self, warnings: &mut Vec<String>) -> Estimate {
        let estimate = self.estimate(Unknown::AngularGain);
        let slowest = self.dataset.tracks.iter().map(|t| t.track.mean_speed()).fold(f64::INFINITY, f64::min);
        let nominal = (estimate.value * slowest).abs().max(f64::MIN_POSITIVE);
        let causeless = self.hypothesis().members.iter().filter(|m| m.origin == Origin::Empirical);
        let slowed: f64 = causeless.map(|m| slowing(m, nominal)).sum();
        let open = slowed + self.dataset.screen.references_apart;
        let estimate = estimate.widened(open * estimate.value.abs() + self.beyond_belief(Unknown::AngularGain));
        let estimate = covering(estimate, "angular gain", self.own_angular_gains(), UNBELIEVED, warnings);
        let estimate = self.turned_back_once(estimate, warnings);
        with_unseen_quadrature(estimate, self.dataset, self.fitted)
    }

    /// The parameters that the fit moved beyond belief, each with the centre and the deviation of that.
    fn unbelieved(&self) -> Vec<Prior> {
        let mut priors = self.dataset.priors(self.hypothesis(), self.fitted.drive.as_ref());
        priors.retain(|p| p.is_exceeded(self.hypothesis()));
        priors
    }

    /// By how much an unknown would be another if what the fit moved beyond belief stood where it is believed to: what moved it
    /// is not in the model, and moved the others with it.
    fn beyond_belief(&self, unknown: Unknown) -> f64 {
        let Some(at) = self.index(unknown) else { return 0.0 };
        let with = |prior: &Prior| {
            let i = self.index(prior.unknown)?;
            let slope = self.covariance[(at, i)] / self.covariance[(i, i)].max(f64::MIN_POSITIVE);
            Some((slope * (self.hypothesis().get(prior.unknown) - prior.mean)).abs())
        };
        self.unbelieved().iter().filter_map(with).sum()
    }

    /// Says what the fit moved beyond belief.
    pub(crate) fn said_of_the_unbelieved(&self) -> impl Iterator<Item = String> {
        self.unbelieved().into_iter().filter_map(|prior| {
            let Unknown::Effect(member, parameter) = prior.unknown else { return None };
            let of = self.hypothesis().members[member].id.description();
            Some(format!(
                "{} of {} came out as {:.3}, where {:.3} ± {:.3} is believed: what the model lacks moved it there; the intervals cover what the \
                 angular gain and the detection gain ratio are without",
                of.parameters[parameter].name,
                of.id,
                self.hypothesis().get(prior.unknown),
                prior.mean,
                1.96 * prior.deviation
            ))
        })
    }

    /// The cubic of a readout at one amplitude beside its gain ratio: the two channels are taken to have the same one, and a
    /// difference δ of them reads as a ratio of 1 + ¾ δ a² there.
    fn cubic_of_both_channels(&self) -> Option<f64> {
        let cubic = self.hypothesis().member(EffectId::DetectionCubic).filter(|m| !m.refined && m.values[0] != 0.0)?;
        let ratio = self.first(EffectId::DetectionGainMismatch).filter(|_| self.dataset.alike().amplitude);
        ratio.map(|_| cubic.values[0])
    }

    /// What cubics that differ may make of the detection gain ratio.
    fn by_unlike_cubics(&self) -> f64 {
        let amplitude = self.dataset.usual_amplitude();
        self.cubic_of_both_channels().map_or(0.0, |kappa| 0.75 * UNLIKE_CUBICS * kappa.abs() * amplitude * amplitude)
    }

    /// What has to be said of a gain ratio beside a cubic of the readout at one amplitude.
    pub(crate) fn cubics_that_may_differ(&self) -> Option<String> {
        self.cubic_of_both_channels().map(|_| {
            format!(
                "the detection gain ratio stands beside a cubic that is taken to be the same in both channels, and all runs are at one \
                 amplitude: a difference of the cubics is part of the ratio, whose interval allows for {UNLIKE_CUBICS} of them; a run at \
                 another amplitude would separate them"
            )
        })
    }

    /// The angular gain with an interval that also covers what the runs that turn one way would tell of it if they did not
    /// drift, where a single run turns back and tells the gain from their drifts: were its rate another, the drifts would take
    /// that up, and nothing would contradict.
    fn turned_back_once(&self, gain: Estimate, warnings: &mut Vec<String>) -> Estimate {
        let fitted = self.dataset.tracks.iter().filter(|p| p.drifts && p.track.samples(Role::Fit) > 0);
        if fitted.filter(|p| p.track.one_way_rate().is_none()).count() != 1 {
            return gain;
        }
        let without_drift = self.own_angular_gains().filter_map(|(run, own)| Some((run, own?[0])));
        let odd: Vec<(&str, f64)> =
            without_drift.filter(|(_, own)| (own - gain.value).abs() > gain.half_width()).collect();
        if odd.is_empty() {
            return gain;
        }
        warnings.push(format!(
            "the angular gain, {:.5}, is separated from drifts by one run that turns back, and no other bears it out: without a drift \
             the others give {}, and its interval covers them; a second run there and back would tell",
            gain.value,
            listed(&odd)
        ));
        reaching(gain, &odd)
    }

    /// The angular gain that each track tells where it turns one way and drifted by nothing, and how far off that is by as
    /// much drift as is believed. Where the commands were not recorded, what runs differ in is taken for a drift of each; a
    /// drift that is not believed is a gain of another instrument, another clock or another rate as well.
    fn own_angular_gains(&self) -> impl Iterator<Item = (&str, Option<[f64; 2]>)> {
        let sense = self.hypothesis().sense();
        self.dataset.tracks.iter().zip(&self.fitted.fit.starts).map(move |(p, starts)| {
            let fitted = p.track.segments.iter().zip(starts).filter(|(s, _)| s.role == Role::Fit);
            let longest = fitted.max_by_key(|(s, _)| s.range.len()).filter(|_| p.drifts);
            let steady = longest.zip(p.track.one_way_rate());
            let k = self.hypothesis().angular_gain;
            (p.track.file.as_str(), steady.map(|((_, s), rate)| [k + sense * s.drift / rate, DRIFT_RAD_S / rate.abs()]))
        })
    }

    /// The first parameter of the first member `id`, if it was fitted.
    fn first(&self, id: EffectId) -> Option<Unknown> {
        let unknown = Unknown::Effect(self.hypothesis().position(id)?, 0);
        self.index(unknown).map(|_| unknown)
    }

    /// G_Dy/G_Dx, where the campaign identifies it, with what each track alone tells of it. Its interval allows for what may be
    /// taken for something else.
    pub(crate) fn detection_ratio(&self, own: &[Option<[f64; 2]>], warnings: &mut Vec<String>) -> Option<Estimate> {
        let estimate = self.first(EffectId::DetectionGainMismatch).map(|u| self.estimate(u));
        let identified = estimate.filter(|e| e.half_width() < WIDEST_DETECTION_RATIO);
        if identified.is_none() {
            warnings.push("the campaign cannot tell the detection gain ratio".into());
        }
        let runs = self.dataset.tracks.iter().map(|t| t.track.file.as_str()).zip(own.iter().copied());
        let unbelieved = self.first(EffectId::DetectionGainMismatch).map_or(0.0, |u| self.beyond_belief(u));
        let identified =
            identified.map(|ratio| ratio.widened(self.held_by_harmonics() + unbelieved + self.by_unlike_cubics()));
        let ratio = covering(identified?, "detection gain ratio", runs, CONTRADICTS, warnings);
        Some(self.borne_out(ratio, warnings))
    }

    /// What harmonics without a cause may hold of the detection gain ratio, which is ½(g − 1) sin 2θ: where they go with the
    /// rate each run tells another ratio, and nothing tells which is the instrument's.
    fn held_by_harmonics(&self) -> f64 {
        let causeless = self.hypothesis().members.iter().filter(|m| m.origin == Origin::Empirical);
        let second = causeless.filter(|m| m.id == EffectId::HarmonicN && m.values[0] == 2.0);
        let precessions = || self.dataset.tracks.iter().map(|t| self.hypothesis().precession(t.track.mean_speed()));
        let largest = |scaling: f64| precessions().map(|p| harmonic_n::factor(scaling, p).abs()).fold(0.0, f64::max);
        second.map(|m| 2.0 * (m.values[2] * largest(m.values[3])).abs()).sum()
    }

    /// The detection gain ratio with an interval that also covers what the runs would tell of it without anisodamping, where
    /// the two are separated by a run that no other bears out, or the runs contradict each other in the angular gain:
    /// ½(g − 1) sin 2θ of the readout beside Δ(1/τ)/(4kΩ) sin 2θ of the mechanics. Were a run of another instrument, the
    /// difference would be that of two ratios.
    fn borne_out(&self, ratio: Estimate, warnings: &mut Vec<String>) -> Estimate {
        let damping = self.hypothesis().member(EffectId::Anisodamping).map_or(0.0, |m| m.values[1]);
        let gain = self.estimate(Unknown::AngularGain);
        let contradicted = !contradicting(gain, self.own_angular_gains(), UNBELIEVED).is_empty();
        if self.dataset.instrument == Instrument::Sensor || !(self.dataset.rests_on_one_run() || contradicted) {
            return ratio;
        }
        let alone = |rate: f64| ratio.value - 0.5 * damping / self.hypothesis().precession(rate);
        let runs = self.dataset.tracks.iter().map(|t| (t.track.file.as_str(), alone(t.track.mean_rate())));
        let odd: Vec<(&str, f64)> = runs.filter(|(_, own)| (own - ratio.value).abs() > ratio.half_width()).collect();
        if odd.is_empty() {
            return ratio;
        }
        warnings.push(format!(
            "the detection gain ratio, {:.5}, and anisodamping are separated by a run that no other bears out, or that contradicts \
             others: without anisodamping the runs differ in the ratio, {}, and its interval covers them; a rotation run at yet another rate \
             would tell",
            ratio.value,
            listed(&odd)
        ));
        reaching(ratio, &odd)
    }

    /// G_Ax/G_Ay, where the campaign identifies it.
    pub(crate) fn actuation_ratio(&self, detection: Option<Estimate>, warnings: &mut Vec<String>) -> Option<Estimate> {
        if self.dataset.instrument == Instrument::Sensor {
            warnings.push("a sensor has no drive: there is no actuation gain ratio".into());
            return None;
        }
        let unknown = self.first(EffectId::ActuationGainMismatch);
        let identified = unknown
            .filter(|u| self.is_identified(*u, &EffectId::ActuationGainMismatch.description().parameters[0]))
            .map(|u| self.estimate(u))
            .or_else(|| self.fitted.drive.as_ref().map(|d| Estimate::new(d.ratio(), d.ratio() * d.ratio_error)))
            .map(|e| self.with_the_readouts_share(e, detection))
            .map(|e| self.covering_the_rotations(e, warnings))
            .filter(|e| e.half_width() < WIDEST_ACTUATION_RATIO);
        match (&identified, &self.fitted.drive) {
            (None, _) => warnings.push(
                "the campaign cannot tell the actuation gain ratio: ring-downs at 0° and 90° with vas_v would".into(),
            ),
            (Some(_), None) => warnings.push(
                "the actuation gain ratio comes from rotation runs alone: ring-downs at 0° and 90° would confirm it"
                    .into(),
            ),
            (Some(estimate), Some(drive)) => {
                let deviation = (estimate.half_width() / 1.96).hypot(drive.ratio() * drive.ratio_error);
                if (estimate.value - drive.ratio()).abs() > 4.0 * deviation {
                    warnings.push(format!(
                        "ring-downs (Equation 11) give an actuation gain ratio of {:.5}, all runs together {:.5}",
                        drive.ratio(),
                        estimate.value
                    ));
                }
                let by_noise =
                    unknown.and_then(|u| self.index(u)).map(|i| self.fitted.fit.by_noise[(i, i)].max(0.0).sqrt());
                let contradicted = by_noise.is_some_and(|own| estimate.half_width() > CONTRADICTED * 1.96 * own);
                let spread = spread_of_dampings(&self.fitted.ring_downs, self.hypothesis());
                if contradicted && spread > OTHER_DAMPING && self.dataset.tracks_differ() {
                    warnings.push(format!(
                        "the rotations do not bear out the actuation gain ratio of the ring-downs, {:.5}, whose dampings differ by \
                         {:.1} % beyond the anisodamping: is one of another device? The interval covers what either says",
                        drive.ratio(),
                        100.0 * spread
                    ));
                }
            }
        }
        identified
    }

    /// An actuation gain ratio with an interval that also covers what the rotations make of it, where that is not what the ring-downs are
    /// believed to say.
    fn covering_the_rotations(&self, ratio: Estimate, warnings: &mut Vec<String>) -> Estimate {
        let unknown = self.first(EffectId::ActuationGainMismatch);
        let all = self.unbelieved();
        let Some(prior) = all.iter().find(|prior| Some(prior.unknown) == unknown) else { return ratio };
        let by_both = self.hypothesis().get(prior.unknown);
        // the value of a fit lies between what it was told and what it would be without, by their weights
        let variance = self.index(prior.unknown).map_or(0.0, |i| self.fitted.fit.by_noise[(i, i)]);
        let weight = 1.0 / (prior.deviation.powi(2) / variance.max(f64::MIN_POSITIVE) - 1.0);
        let by_rotations = by_both + (by_both - prior.mean) * weight.clamp(0.0, MOST_BEYOND);
        let names: Vec<&str> = self.fitted.ring_downs.iter().map(|r| r.name.as_str()).collect();
        warnings.push(format!(
            "the rotations give an actuation gain ratio of {by_rotations:.4}, the ring-downs {:.4}: is one of {} of another device, or its \
             command in another unit? The interval covers both",
            prior.mean,
            names.join(", ")
        ));
        reaching(ratio, &[("the rotations", by_rotations), ("the ring-downs", prior.mean)])
    }

    /// An actuation gain ratio with an interval that also covers what the readout's unknowns make of the ring-downs: the drive
    /// is told per amplitude, and the amplitudes of both axes are known as well as the gains of the detection are.
    fn with_the_readouts_share(&self, ratio: Estimate, detection: Option<Estimate>) -> Estimate {
        let told = |h: &Hypothesis| {
            let all = self.dataset.ring_downs(h).ok()?;
            DriveGains::from_ring_downs(&all).map(|d| d.ratio().ln())
        };
        let Some(nominal) = self.fitted.drive.as_ref().and_then(|_| told(self.hypothesis())) else { return ratio };
        let unknowns = self.fitted.fit.unknowns.iter().enumerate();
        let readout = unknowns.filter(|(_, u)| {
            matches!(u, Unknown::Effect(at, _)
                if self.hypothesis().members[*at].id.description().stage == Stage::Readout)
        });
        // where one stands in the covariance, and what a unit of it makes of the ratio's logarithm
        let slopes: Vec<(usize, Unknown, f64)> = readout
            .filter_map(|(i, u)| {
                let step = self.deviation(*u).min(LARGEST_STEP);
                let mut moved = self.hypothesis().clone();
                moved.set(*u, moved.get(*u) + step);
                let slope = (told(&moved)? - nominal) / step;
                slope.is_finite().then_some((i, *u, slope))
            })
            .collect();
        let pairs = slopes.iter().flat_map(|a| slopes.iter().map(move |b| (a, b)));
        let fitted: f64 = pairs.map(|((i, _, a), (j, _, b))| a * b * self.covariance[(*i, *j)]).sum();
        // the detection ratio's own interval may cover more than its deviation
        let gain = self.first(EffectId::DetectionGainMismatch);
        let wider = slopes.iter().find(|(_, u, _)| Some(*u) == gain).zip(detection).map_or(0.0, |((i, _, a), e)| {
            a * a * ((e.half_width() / 1.96).powi(2) - self.covariance[(*i, *i)]).max(0.0)
        });
        let share = 1.96 * ratio.value.abs() * (fitted + wider).max(0.0).sqrt();
        ratio.widened(ratio.half_width().hypot(share) - ratio.half_width())
    }

    /// The deviation of a parameter is well below what was believed of it without data.
    fn is_identified(&self, unknown: Unknown, parameter: &Parameter) -> bool {
        self.dataset.believed(parameter).is_none_or(|believed| self.deviation(unknown) < MIN_CONTRACTION * believed)
    }

    /// All that was fitted of a member is identified.
    pub(crate) fn identifiable(&self, at: usize, member: &Member) -> bool {
        if member.id == EffectId::DriveSaturation {
            // the quadrature balance tells it
            return false;
        }
        let parameters = member.id.description().parameters.iter().enumerate();
        let fitted: Vec<(Unknown, &Parameter)> = parameters
            .map(|(p, parameter)| (Unknown::Effect(at, p), parameter))
            .filter(|(u, _)| self.index(*u).is_some())
            .collect();
        !fitted.is_empty() && fitted.iter().all(|(u, parameter)| self.is_identified(*u, parameter))
    }

    /// Every effect that the campaign tells, in the words of the report.
    pub(crate) fn effects(&self, steps: &[Step], after: &Evaluation) -> Vec<EffectReport> {
        let with = after.size().rms_deg;
        let mut steps: Vec<&Step> = steps.iter().collect();
        let alike = self.dataset.alike();
        self.hypothesis()
            .members
            .iter()
            .enumerate()
            .filter(|(at, m)| self.identifiable(*at, m))
            .map(|(at, m)| {
                let step = steps.iter().position(|s| s.id == m.id).map(|i| steps.remove(i));
                let mut rivals = confounded_with(m.id, self.hypothesis(), &self.fitted.fit.unknowns, self.by_fit);
                let found = step.map(|s| s.confounded_with.as_slice()).unwrap_or_default().iter().copied();
                let at_one_amplitude = alike.amplitude && m.origin == Origin::Discovered;
                for r in found.chain(alike_at_one_amplitude(m.id).filter(|_| at_one_amplitude)) {
                    if !rivals.contains(&r) {
                        rivals.push(r);
                    }
                }
                let mut without = self.hypothesis().clone();
                without.members.remove(at);
                let before = step.map_or_else(
                    || {
                        let e = evaluate(
                            &self.dataset.tracks,
                            &without,
                            &self.fitted.fit.starts,
                            Role::Holdout,
                            Window::Whole,
                            Some(after),
                        );
                        e.size().rms_deg
                    },
                    |s| s.heldout_rms_deg[0],
                );
                let after_deg = step.map_or(with, |s| s.heldout_rms_deg[1]);
                EffectReport {
                    id: m.id.to_string(),
                    origin: m.origin,
                    parameters: self.parameters(at, m),
                    heldout_rms_deg: before.is_finite().then_some(BeforeAfter { before, after: after_deg }),
                    evidence: evidence(m, step),
                    separated_by: rivals.first().map(|r| separated_by(m.id, *r, alike).to_string()),
                    confounded_with: rivals.iter().map(ToString::to_string).collect(),
                }
            })
            .collect()
    }

    /// A member's parameters as they are shown, polar ones with intervals by propagation.
    fn parameters(&self, at: usize, member: &Member) -> Vec<ParameterReport> {
        let d = member.id.description();
        let mut out = Vec::new();
        for shown in d.shown {
            match *shown {
                Shown::Plain(p) => {
                    let parameter = &d.parameters[p];
                    let hidden = parameter.role == ParameterRole::Refined && !member.refined;
                    if !hidden {
                        let unknown = Unknown::Effect(at, p);
                        out.push(ParameterReport {
                            name: parameter.name.into(),
                            unit: parameter.unit.into(),
                            value: member.values[p],
                            ci95: self.index(unknown).map(|_| self.estimate(unknown).ci95),
                        });
                    }
                }
                Shown::Polar { cos, sin, magnitude, unit, angle, division } => {
                    let (value, phase) =
                        polar([member.values[cos], member.values[sin]], self.block(at, cos, sin), division);
                    let entry = |name: &str, unit: &str, e: Estimate| ParameterReport {
                        name: name.into(),
                        unit: unit.into(),
                        value: e.value,
                        ci95: Some(e.ci95),
                    };
                    out.push(entry(magnitude, unit, value));
                    out.push(entry(angle, "deg", phase));
                }
            }
        }
        out
    }

    /// Variances and covariance of two parameters of a member.
    fn block(&self, at: usize, one: usize, other: usize) -> (f64, f64, f64) {
        let [one, other] = [one, other].map(|p| self.index(Unknown::Effect(at, p)));
        let between = |i: Option<usize>, j: Option<usize>| i.zip(j).map_or(0.0, |at| self.covariance[at]);
        (between(one, one), between(other, other), between(one, other))
    }
}

/// One sentence on why an effect is believed.
fn evidence(member: &Member, step: Option<&Step>) -> String {
    let d = member.id.description();
    let Some(step) = step else {
        return match member.origin {
            Origin::Declared => format!("declared by the paper's model ({})", d.signature),
            _ => format!("needed to centre the readout before there is an angle ({})", d.signature),
        };
    };
    let mut compared = String::new();
    for (id, gain) in &step.rivals {
        let lead = step.gain - gain;
        compared += &if lead >= 0.0 {
            format!("; beat {id} by {lead:.0}")
        } else {
            format!("; preferred by its plainness or by the energy balance to {id}, which gained {:.0} more", -lead)
        };
    }
    let ppm = |balance: f64| format!("{:.1}", 1e6 * balance);
    let balance = step.energy_balance.map(|[before, after]| [ppm(before), ppm(after)]).filter(|[b, a]| a != b);
    let balance = balance.map_or_else(String::new, |[before, after]| {
        format!("; the energy balance leaves {after} ppm of the amplitude instead of {before}")
    });
    let inconsistency =
        step.inconsistency.as_ref().map_or_else(String::new, |why| format!("; not claimed as a cause: {why}"));
    format!(
        "{}; gained {:.0} in 2 ln likelihood after its price{compared}; held-out rms {:.5}° to {:.5}°{balance}{inconsistency}",
        d.signature, step.gain, step.heldout_rms_deg[0], step.heldout_rms_deg[1]
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_covers_the_runs_that_contradict_it_and_no_others() {
        let all = Estimate::new(1.0132, 1e-5);
        let told = |own: [f64; 2]| {
            let mut warnings = Vec::new();
            let runs = [("a.csv", Some([1.0132, 1e-5])), ("b.csv", Some(own)), ("c.csv", None)];
            (covering(all, "detection gain ratio", runs.into_iter(), CONTRADICTS, &mut warnings), warnings)
        };
        let (estimate, warnings) = told([1.0152, 1e-5]);
        assert!((estimate.ci95[1] - 1.0152).abs() < 1e-12 && (estimate.ci95[0] - 1.0112).abs() < 1e-12, "{estimate:?}");
        assert!(warnings[0].contains("b.csv 1.01520") && !warnings[0].contains("a.csv"), "{warnings:?}");
        // its noise allows that
        assert_eq!(told([1.0152, 1e-3]), (all, vec![]));
    }
}
