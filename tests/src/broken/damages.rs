//! What can be wrong with a recording although it is read: each is done to one run, or to all runs of a campaign.
#![allow(clippy::unwrap_used, reason = "what is made has these channels")]

use super::{Made, RATIO};
use crate::bench::Draws;
use cvg_calibration::recording::{Channel, Recording};

mod channels;
mod recording;
mod table;

/// Where a damage can be told from a sound recording at all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shows {
    /// in the run itself
    Alone,
    /// beside sound runs only: by itself it is a sound run of another instrument, or at another rate
    Beside,
}

/// One way for a recording to be wrong.
#[derive(Debug, Clone, Copy)]
pub struct Damage {
    /// what it is called
    pub name: &'static str,
    /// where it can be told
    pub shows: Shows,
    /// does it to the recording of a run that was made so
    pub of: fn(&Made, &mut Draws) -> Recording,
}

/// All of them.
pub const DAMAGES: &[Damage] = &[
    alone("held rows", recording::held),
    alone("a clock that slips", recording::slipped),
    beside("rates by a factor", table::factor),
    alone("rates in rad/s", table::radians),
    alone("times in ms", recording::milliseconds),
    alone("swapped channels", channels::swapped),
    alone("a channel without its sign", channels::negated),
    alone("references that disagree", table::contradicted),
    alone("clipping", channels::clipped),
    alone("spikes", channels::spikes),
    alone("lost rows", recording::lost),
    // at one rate a channel that is late is one that is not square to the other
    beside("a channel one row late", channels::one_row_late),
    alone("a channel with a clock of its own", channels::own_clock),
    alone("rows that are there twice", recording::doubled),
    beside("another gain", channels::other_gain),
    beside("another device", channels::other_device),
    alone("another amplitude", channels::other_amplitude),
    alone("a converter that wraps", channels::wraps),
    alone("three digits", recording::three_digits),
    beside("a table that saturates", table::saturated),
    alone("a table that follows late", table::late),
    alone("rates without their sign", table::unsigned),
    alone("minutes that are missing", recording::missing),
    beside("a filter on one channel", channels::filtered),
    alone("rows from last to first", recording::reversed),
    alone("means at the wrap of the table", table::mean_at_wrap),
    alone("a table with jitter", table::jitter),
    alone("outliers in the rate", table::outliers),
    alone("rows filled in by lines", recording::filled_in),
    beside("a rate with an offset", table::biased_rate),
    alone("a channel whose range is switched", channels::range_switched),
    beside("a clock that runs fast", recording::fast_clock),
    alone("one channel in the other's place for a while", channels::one_for_other),
    alone("a plug that is turned halfway", channels::turned_plug),
    alone("a burst of noise", channels::burst),
    alone("eight bits", channels::eight_bits),
    beside("an offset of a channel", channels::offset),
    alone("rates of another moment", table::delayed_rate),
    alone("a bit that hangs", channels::hanging_bit),
    alone("electronics that warm up", channels::warming),
    alone("mains hum", channels::hum),
    alone("a loose contact", channels::loose),
    alone("a knock", channels::knocked),
    alone("plugs exchanged halfway", channels::exchanged),
    alone("crosstalk that comes in", channels::crosstalk),
    alone("codes cut towards zero", channels::cut),
    // throughout a campaign it is an amplifier of the instrument, whose gain is a matter of the amplitude
    beside("a soft rail", channels::soft),
    alone("a median filter", channels::median),
    alone("a filter on both channels", channels::both_filtered),
    alone("channels without their mean", channels::coupled),
    alone("channels over their amplitude", channels::normalised),
    alone("two recordings in one", recording::two_in_one),
    alone("blocks out of order", recording::out_of_order),
    alone("exponents cut off", recording::without_exponents),
    alone("straight lines between fewer rows", recording::resampled),
    alone("rows stamped in bursts", recording::bursts),
    beside("a clock that warms up", recording::warming_clock),
    beside("a row lost of every block", recording::lost_of_every_block),
    beside("rates in whole deg/s", table::whole),
    alone("a table that ripples", table::rippled),
];

const fn alone(name: &'static str, of: fn(&Made, &mut Draws) -> Recording) -> Damage {
    Damage { name, shows: Shows::Alone, of }
}

const fn beside(name: &'static str, of: fn(&Made, &mut Draws) -> Recording) -> Damage {
    Damage { name, shows: Shows::Beside, of }
}

// Pieces

/// A stretch of rows in the middle of a recording.
fn stretch(rows: usize, draw: &mut Draws) -> std::ops::Range<usize> {
    let at = rows / 8 + draw.below(rows / 2);
    at..at + 2 + draw.below(rows / 16)
}

fn both(recording: &mut Recording) -> impl Iterator<Item = &mut Vec<f64>> {
    [&mut recording.xc_v, &mut recording.yc_v].into_iter().flatten()
}

/// X, or Y, as it is drawn.
fn either<'a>(recording: &'a mut Recording, draw: &mut Draws) -> &'a mut Vec<f64> {
    let channel = if draw.below(2) == 0 { &mut recording.xc_v } else { &mut recording.yc_v };
    channel.as_mut().unwrap()
}

fn readouts(recording: &mut Recording, change: impl Fn(f64) -> f64) {
    both(recording).flatten().for_each(|v| *v = change(*v));
}

/// A share that is now small and now large, of either sign.
fn share(draw: &mut Draws, low: f64, high: f64) -> f64 {
    let sign = if draw.below(2) == 0 { 1.0 } else { -1.0 };
    sign * draw.scale(low, high)
}

/// Turns the pattern of every row by so much, rad.
fn turn(recording: &mut Recording, by: impl Fn(usize) -> f64) {
    let (Some(x), Some(y)) = (&mut recording.xc_v, &mut recording.yc_v) else { unreachable!() };
    for (i, (x, y)) in x.iter_mut().zip(y).enumerate() {
        let ((sin, cos), [a, b]) = (by(i).sin_cos(), [*x, *y / RATIO]);
        (*x, *y) = (a * cos - b * sin, RATIO * (a * sin + b * cos));
    }
}

/// Columns made anew, the value of a row from a column and the row.
fn every_column(recording: &mut Recording, rows: &[usize]) {
    for channel in Channel::ALL.into_iter().filter(|c| *c != Channel::Time) {
        if let Some(values) = recording.channel(channel) {
            let anew = rows.iter().map(|i| values[*i]).collect();
            recording.set_channel(channel, anew);
        }
    }
    recording.t_s.truncate(rows.len());
}
