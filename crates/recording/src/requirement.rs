//! Which columns a run needs.
//!
//! Only presence is judged: whether the columns carry a rotation or a ring-down is the identification's to say.

use super::Recording;
use super::campaign::{Instrument, Reference};
use super::channel::Channel;
use super::error::ReadError;

const ANGLE: &str = "`t_s` and one of (`xc_v` with `yc_v`, `theta_deg`, `x_v` with `y_v`)";
const ROTATION: &str =
    "`t_s`, one of (`rate_dps`, `table_deg`) and one of (`xc_v` with `yc_v`, `theta_deg`, `x_v` with `y_v`)";
const CHANNELS: &str = "`t_s`, `xc_v` and `yc_v`";
const RINGDOWN: &str = "`t_s`, `xc_v`, `yc_v` and `vas_v`, or at the carrier `x_v`, `y_v`, `fx_v` and `fy_v`";
const DECAY: &str = "`t_s` and one of (`xc_v` with `xs_v`, `yc_v` and `ys_v`; `x_v` with `y_v`)";
const VIRTUAL: &str =
    "`t_s`, `xc_v`, `xs_v`, `yc_v`, `ys_v`, `vas_v` and `vqc_v`, and `virtual_dps` where there was any";

/// Whether a set of channels holds the time and an angle: the least that makes a recording.
pub(super) fn holds_an_angle(has: impl Fn(Channel) -> bool) -> bool {
    let pair = |x, y| has(x) && has(y);
    has(Channel::Time) && (has(Channel::Theta) || pair(Channel::Xc, Channel::Yc) || pair(Channel::X, Channel::Y))
}

/// What `holds_an_angle` wants, in words.
pub(super) const fn angle_in_words() -> &'static str {
    ANGLE
}

impl Recording {
    /// Whether the columns of a rotation run are there: `t_s`, one of (`rate_dps`, `table_deg`), and one of (`xc_v` with
    /// `yc_v`, `theta_deg`, `x_v` with `y_v`).
    ///
    /// # Errors
    /// [`ReadError::MissingColumns`] says what is needed and what is there.
    pub fn require_rotation(&self) -> Result<(), ReadError> {
        let has = |channel| self.channel(channel).is_some();
        let whole = holds_an_angle(has) && (has(Channel::Rate) || has(Channel::Table));
        self.require(whole, "a rotation", ROTATION)
    }

    /// Whether the columns are there that a turn of this instrument needs: those of a rotation, or of a sensor its two
    /// channels alone, which need no reference to tell their own errors. Where the campaign says that there is no
    /// reference, none is asked for.
    pub(crate) fn require_turn(&self, instrument: Instrument, reference: Option<Reference>) -> Result<(), ReadError> {
        let channels = self.xc_v.is_some() && self.yc_v.is_some();
        if reference == Some(Reference::Absent) {
            return self.require(channels, "a sensor without a reference", CHANNELS);
        }
        if instrument == Instrument::Sensor && channels {
            return Ok(());
        }
        self.require_rotation()
    }

    /// Whether the columns of a ring-down are there: `t_s`, `xc_v`, `yc_v`, `vas_v`, or at the carrier `x_v` and `y_v` with the
    /// forces `fx_v` and `fy_v` or with `vas_v`.
    ///
    /// # Errors
    /// [`ReadError::MissingColumns`] says what is needed and what is there.
    pub fn require_ringdown(&self) -> Result<(), ReadError> {
        let has = |channel| self.channel(channel).is_some();
        let forces = has(Channel::Fx) && has(Channel::Fy);
        let vibrates = has(Channel::Xc) && has(Channel::Yc);
        let at_the_carrier = has(Channel::X) && has(Channel::Y);
        let whole = (vibrates && has(Channel::Vas)) || (at_the_carrier && (has(Channel::Vas) || forces));
        self.require(whole, "a ring-down", RINGDOWN)
    }

    /// Whether the columns of a free decay are there: `t_s`, and `xc_v`, `xs_v`, `yc_v`, `ys_v` or `x_v`, `y_v`.
    ///
    /// # Errors
    /// [`ReadError::MissingColumns`] says what is needed and what is there.
    pub fn require_decay(&self) -> Result<(), ReadError> {
        let all = |channels: &[Channel]| channels.iter().all(|channel| self.channel(*channel).is_some());
        let whole = all(&[Channel::Xc, Channel::Xs, Channel::Yc, Channel::Ys]) || all(&[Channel::X, Channel::Y]);
        self.require(whole, "a free decay", DECAY)
    }

    /// Whether the columns of a run of virtual precession or of unknown rotation are there: `t_s`, `xc_v`, `xs_v`, `yc_v`,
    /// `ys_v`, `vas_v`, `vqc_v`. Without `virtual_dps` nothing was commanded.
    ///
    /// # Errors
    /// [`ReadError::MissingColumns`] says what is needed and what is there.
    pub fn require_virtual(&self) -> Result<(), ReadError> {
        let needed = [Channel::Xc, Channel::Xs, Channel::Yc, Channel::Ys, Channel::Vas, Channel::Vqc];
        let whole = needed.iter().all(|channel| self.channel(*channel).is_some());
        self.require(whole, "virtual precession", VIRTUAL)
    }

    fn require(&self, whole: bool, needed_for: &'static str, needed: &'static str) -> Result<(), ReadError> {
        if whole {
            return Ok(());
        }
        Err(ReadError::MissingColumns {
            path: self.source.clone(),
            needed_for,
            needed,
            present: in_words(self.column_names()),
        })
    }
}

/// Column names as a list to read.
pub(super) fn in_words<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<String> = names.into_iter().map(|name| format!("`{}`", name.escape_debug())).collect();
    if names.is_empty() { "no columns".to_owned() } else { names.join(", ") }
}
