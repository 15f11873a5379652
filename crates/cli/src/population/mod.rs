//! What the devices of a fleet say together: how each quantity is distributed and goes from device to device, which devices
//! are odd, which effects many share.
//!
//! A device is odd where that is no accident among all the comparisons that are made: in a fleet without an odd device, at
//! most one in twenty has one named, and of many that are named one in twenty is expected to be none. What so many have that it is no exception is a group, not odd.

pub(crate) mod course;
pub(crate) mod device;
pub(crate) mod prior;
pub(crate) mod spread;

use std::collections::BTreeMap;

pub(crate) use self::course::{Change, Chart};
pub(crate) use self::device::{Device, Found, Quantity};
use self::spread::{Measured, Spread, median};
use crate::compare::Parameter;

/// How probable it is that any device is named in a fleet in which none is odd; and of those that are named, the share that
/// is expected to be none.
const FALSE_ALARM: f64 = 0.05;
/// Devices from which on a distribution tells what is odd.
pub(crate) const FEWEST_DEVICES: usize = 8;
/// An effect that at most this share of the devices have is odd in those that have it; one that more than
/// [`SHARED`] have is of the design or the board; one that this share lacks is odd in those that lack it.
const RARE: f64 = 0.1;
const SHARED: f64 = 0.5;
/// Median absolute deviation of a normal distribution times this is its standard deviation.
const NORMAL: f64 = 1.4826;
/// Of those that have an effect, the weakest in so many decide whether one could have missed it, and by how much more gain
/// than one device needs.
const WEAKEST: usize = 20;
const CERTAIN: f64 = 4.0;

/// How one parameter of the report is distributed over the devices.
pub(crate) struct Distribution {
    pub(crate) unit: String,
    pub(crate) median: f64,
    /// robust standard deviation of the values, errors and all
    pub(crate) deviation: f64,
    pub(crate) count: usize,
}

/// One quantity over all devices, in the order of their serial numbers.
pub(crate) struct Line {
    /// the parameter that it is of
    pub(crate) of: String,
    /// device and value, by serial number
    pub(crate) values: Vec<(usize, Measured)>,
    pub(crate) spread: Option<Spread>,
    /// median of the standard errors
    pub(crate) error: f64,
    pub(crate) change: Option<Change>,
    pub(crate) chart: Option<Chart>,
    /// devices that are beyond chance, but too many to be exceptions
    pub(crate) group: usize,
}

/// An effect in the fleet.
pub(crate) struct Share {
    pub(crate) devices: usize,
    pub(crate) share: f64,
    /// 95 % interval of the share in the population that these devices are drawn from
    pub(crate) ci95: [f64; 2],
    pub(crate) is_rare: bool,
    pub(crate) is_shared: bool,
}

/// Why a device is odd.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Oddity {
    /// an effect that few have
    Effect { label: String, gain: Option<f64> },
    /// the lack of one that nearly all have
    Lack { label: String },
    /// a quantity far from those of the others
    Value { of: String, value: f64, deviations: f64, chance: f64 },
}

impl Oddity {
    /// What it is named by.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Effect { label, .. } => label.clone(),
            Self::Lack { label } => format!("without {label}"),
            Self::Value { of, .. } => of.clone(),
        }
    }
}

/// What the devices say together.
pub(crate) struct Population {
    pub(crate) parameters: Vec<Vec<Parameter>>,
    pub(crate) distributions: BTreeMap<String, Distribution>,
    pub(crate) lines: BTreeMap<String, Line>,
    pub(crate) effects: BTreeMap<String, Share>,
    /// why each device is odd
    pub(crate) odd: Vec<Vec<Oddity>>,
    /// devices with an answer
    pub(crate) answered: usize,
}

impl Population {
    pub(crate) fn of(devices: &[Device]) -> Self {
        let parameters: Vec<Vec<Parameter>> = devices.iter().map(Device::parameters).collect();
        let answered = devices.iter().filter(|d| d.has_answer()).count();
        let found: Vec<Option<Vec<Found>>> = devices.iter().map(|d| d.has_answer().then(|| d.effects())).collect();
        let mut population = Self {
            distributions: distributions(&parameters),
            parameters,
            lines: lines(devices),
            effects: shares(&found, answered),
            odd: vec![Vec::new(); devices.len()],
            answered,
        };
        if answered >= FEWEST_DEVICES {
            population.odd_by_effects(&found);
            population.odd_by_values();
        }
        population
    }

    /// 2 ln likelihood beyond its price that an effect needs where any of so many devices may have it.
    fn needed(&self) -> f64 {
        2.0 * (self.answered as f64).ln()
    }

    /// Effects that few have, and the lack of those that nearly all have.
    fn odd_by_effects(&mut self, found: &[Option<Vec<Found>>]) {
        let needed = self.needed();
        let lacks = |has: &[Found], label: &str| !has.iter().any(|f| f.label == label);
        for (odd, has) in self.odd.iter_mut().zip(found) {
            let Some(has) = has else { continue };
            let rare = has.iter().filter(|f| self.effects.get(&f.label).is_some_and(|s| s.is_rare));
            let claimed = rare.filter(|f| f.gain.is_none_or(|gain| gain > needed));
            // a shared effect under the name of one that the campaign hardly tells from it is nothing of the device's own
            let stands_for = |f: &Found| {
                let shared = |id: &String| self.effects.get(id).is_some_and(|s| s.is_shared);
                f.rivals.iter().any(|(id, by)| *by < needed && shared(id) && lacks(has, id))
            };
            let own = claimed.filter(|f| !stands_for(f));
            odd.extend(own.map(|f| Oddity::Effect { label: f.label.clone(), gain: f.gain }));
        }
        let common: Vec<&String> = self
            .effects
            .iter()
            .filter(|(_, s)| s.share >= 1.0 - RARE && s.share < 1.0)
            .map(|(label, _)| label)
            .collect();
        for label in common {
            let gain = |f: &Found| f.gain.unwrap_or(f64::NAN);
            let mut gains: Vec<f64> =
                found.iter().flatten().flatten().filter(|f| f.label == *label).map(gain).collect();
            gains.sort_by(f64::total_cmp);
            if gains[gains.len() / WEAKEST] <= CERTAIN * needed || gains.iter().any(|g| g.is_nan()) {
                continue;
            }
            // what explains the same is a name for it
            let stands_in = |f: &Found| f.rivals.iter().any(|(id, by)| *by < needed && id == label);
            let answered = found.iter().zip(&mut self.odd).filter_map(|(has, odd)| Some((has.as_ref()?, odd)));
            let without = answered.filter(|(has, _)| lacks(has, label) && !has.iter().any(stands_in));
            without.for_each(|(_, odd)| odd.push(Oddity::Lack { label: label.clone() }));
        }
    }

    /// Values that are no accident among all the comparisons made (Benjamini and Hochberg): the more stand out, the less far
    /// out each has to be, so that tails which one outlier might be of do not hide several.
    fn odd_by_values(&mut self) {
        let comparisons: usize = self.lines.values().filter(|l| l.spread.is_some()).map(|l| l.values.len()).sum();
        let alone = FALSE_ALARM / comparisons.max(1) as f64;
        let mut claims: Vec<(f64, &str, usize, Measured)> = Vec::new();
        let mut groups: BTreeMap<String, usize> = BTreeMap::new();
        for (name, line) in &self.lines {
            let Some(spread) = &line.spread else { continue };
            let judged = line.values.iter().map(|(at, m)| (spread.chance(*m), name.as_str(), *at, *m));
            let unlikely: Vec<_> = judged.filter(|(chance, ..)| *chance < FALSE_ALARM).collect();
            let far = unlikely.iter().filter(|(chance, ..)| *chance < alone).count();
            if far > exceptions(line.values.len()) {
                groups.insert(name.clone(), far);
            } else {
                claims.extend(unlikely);
            }
        }
        claims.sort_by(|a, b| a.0.total_cmp(&b.0));
        let holds = |(at, claim): &(usize, &(f64, &str, usize, Measured))| claim.0 < alone * (*at as f64 + 1.0);
        let most = claims.iter().enumerate().filter(holds).map(|(at, _)| at + 1).next_back().unwrap_or(0);
        for (chance, name, at, m) in &claims[..most] {
            let line = &self.lines[*name];
            let deviations = line.spread.as_ref().map_or(f64::NAN, |s| s.score(*m));
            if !self.odd[*at].iter().any(|o| o.name() == line.of) {
                self.odd[*at].push(Oddity::Value { of: line.of.clone(), value: m.value, deviations, chance: *chance });
            }
        }
        for (name, count) in groups {
            self.lines.entry(name).and_modify(|line| line.group = count);
        }
    }
}

/// The most devices that are exceptions: one, or a tenth.
fn exceptions(devices: usize) -> usize {
    ((RARE * devices as f64) as usize).max(1)
}

fn distributions(parameters: &[Vec<Parameter>]) -> BTreeMap<String, Distribution> {
    let mut values: BTreeMap<String, (String, Vec<f64>)> = BTreeMap::new();
    for p in parameters.iter().flatten() {
        values.entry(p.name.clone()).or_insert_with(|| (p.unit.clone(), Vec::new())).1.push(p.value);
    }
    let distribution = |(name, (unit, values)): (String, (String, Vec<f64>))| {
        let middle = median(values.clone());
        let deviation = NORMAL * median(values.iter().map(|v| (v - middle).abs()).collect());
        (name, Distribution { unit, median: middle, deviation, count: values.len() })
    };
    values.into_iter().map(distribution).collect()
}

fn lines(devices: &[Device]) -> BTreeMap<String, Line> {
    let mut order: Vec<usize> = (0..devices.len()).collect();
    let key = |at: &usize| (devices[*at].text("device"), devices[*at].folder.as_str());
    order.sort_by(|a, b| course::by_serial_number(key(a).0, key(b).0).then_with(|| key(a).1.cmp(key(b).1)));
    let mut all: BTreeMap<String, (String, Vec<(usize, Measured)>)> = BTreeMap::new();
    for at in order {
        for Quantity { name, of, measured } in devices[at].quantities() {
            all.entry(name).or_insert_with(|| (of, Vec::new())).1.push((at, measured));
        }
    }
    all.retain(|_, (_, values)| values.len() >= FEWEST_DEVICES);
    let quantities = all.len();
    let line = |(name, (of, values)): (String, (String, Vec<(usize, Measured)>))| {
        let measured: Vec<Measured> = values.iter().map(|v| v.1).collect();
        let numbers: Vec<f64> = measured.iter().map(|m| m.value).collect();
        let line = Line {
            of,
            spread: Spread::of(&measured),
            error: median(measured.iter().map(|m| m.error).collect()),
            change: course::change(&numbers, quantities),
            chart: Chart::of(&numbers),
            values,
            group: 0,
        };
        (name, line)
    };
    all.into_iter().map(line).collect()
}

fn shares(found: &[Option<Vec<Found>>], answered: usize) -> BTreeMap<String, Share> {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for f in found.iter().flatten().flatten() {
        *counts.entry(f.label.clone()).or_default() += 1;
    }
    let share = |(label, devices): (String, usize)| {
        let share = devices as f64 / answered as f64;
        let is_rare = devices <= exceptions(answered);
        let is_shared = share >= SHARED && answered > 1;
        (label, Share { devices, share, ci95: wilson(devices, answered), is_rare, is_shared })
    };
    counts.into_iter().map(share).collect()
}

/// Wilson's 95 % interval of a share.
fn wilson(of: usize, all: usize) -> [f64; 2] {
    const Z2: f64 = 1.96 * 1.96;
    let (n, p) = (all as f64, of as f64 / all as f64);
    let middle = (p + 0.5 * Z2 / n) / (1.0 + Z2 / n);
    let half = (p * (1.0 - p) * Z2 / n + 0.25 * (Z2 / n).powi(2)).sqrt() / (1.0 + Z2 / n);
    [(middle - half).max(0.0), (middle + half).min(1.0)]
}

#[cfg(test)]
mod tests;
