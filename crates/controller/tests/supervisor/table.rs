//! The supervisor a second time, as the specification tells it: from any state and for any window, on both sides of every
//! bound, one step is that of the table here. What is left out by each is what the other would show.

use super::*;

/// xorshift64*: any state is as likely as any other.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 16
    }

    fn of<V: Copy>(&mut self, all: &[V]) -> V {
        all[(self.roll() % all.len() as u64) as usize]
    }

    /// Rare: once in eight.
    fn rarely(&mut self) -> bool {
        self.roll().is_multiple_of(8)
    }
}

const FAULTS: [Option<Fault>; 5] =
    [None, Some(Fault::DeadChannel), Some(Fault::InvalidSamples), Some(Fault::NoLock), Some(Fault::AmplitudeHigh)];
/// Windows of a start, all its modes together, twice.
const BUDGET: u32 = 2 * (4 * LISTEN + 7 * SWEEP + LOCK + SPIN_UP + COAST);

/// About every number of windows after which something ends.
fn any_count(dice: &mut Dice) -> u32 {
    let ends = [
        0,
        1,
        2,
        LISTEN,
        SWEEP,
        2 * SWEEP,
        4 * SWEEP,
        8 * SWEEP,
        LOCK,
        SPIN_UP,
        COAST,
        ENDURE,
        REST,
        FORGET,
        IN_A_ROW,
        REST * LONG_REST,
        BUDGET,
        50,
        u32::MAX,
    ];
    let end = dice.of(&ends);
    dice.of(&[end.saturating_sub(2), end.saturating_sub(1), end, end.saturating_add(1)])
}

fn any_state(dice: &mut Dice) -> SupervisorState {
    let few = |dice: &mut Dice| if dice.rarely() { any_count(dice) } else { 0 };
    SupervisorState {
        mode: dice.of(&Mode::ALL),
        fault: dice.of(&FAULTS),
        wish: dice.of(&[Wish::WholeAngle, Wish::WholeAngle, Wish::Hold, Wish::RingDown, Wish::Off]),
        windows: any_count(dice),
        good: any_count(dice),
        bad: few(dice),
        repeats: few(dice),
        clipped: few(dice),
        trying: few(dice),
        sweeps: dice.of(&[0, 1, 2, 3, 4, 9, 255]),
        starts: dice.of(&[0, 1, 2, 3, 255]),
        cause: dice.of(&FAULTS),
        coasts: dice.of(&[0, 1, 49, 50, 51, 255]),
    }
}

/// A number, one of its neighbours, or its opposite.
fn near(dice: &mut Dice, v: f64) -> f64 {
    let v = dice.of(&[v, v.next_up(), v.next_down()]);
    dice.of(&[v, v, -v])
}

fn any_window(dice: &mut Dice) -> Observation<f64> {
    let e = dice.of(&[SET_2, SET_2, SET_2, 0.25 * SET_2, 2.25 * SET_2, 20.0, 30.0, LEAST, 1.0, 0.0, f64::INFINITY]);
    let e = if dice.rarely() { near(dice, e).abs() } else { e };
    let share = |dice: &mut Dice, shares: &[f64]| {
        let share = dice.of(shares);
        near(dice, share * e)
    };
    let q = share(dice, &[0.0, 0.0, 1.0 / 32.0, 1.0 / 16.0, 0.1, 0.5, 0.6]);
    let l = share(dice, &[0.0, 0.0, 1.0 / 32.0, 1.0 / 16.0, 0.2, 0.5, 0.6]);
    let (r, s) = (share(dice, &[0.6, 1.0, 0.3]), share(dice, &[0.8, 0.0, 1.0 / 30.0, 0.01]));
    let mut pendulum = Pendulum { e, q, r, s, l };
    if dice.rarely() {
        match dice.of(&[0, 1, 2]) {
            0 => pendulum.e = f64::NAN,
            1 => pendulum.q = f64::NAN,
            _ => pendulum.l = f64::NAN,
        }
    }
    Observation {
        pendulum,
        valid: !dice.rarely(),
        clipped: dice.rarely(),
        repeats: dice.rarely(),
        jumped: dice.rarely(),
    }
}

fn any_beat(dice: &mut Dice) -> Option<Beat<f64>> {
    // eight windows of 0.25 V² are heard above 2 V², and a channel of a 400th is dead
    let sums =
        [(9.0, 9.0), (1.0, 1.0), (1.0, 1.0_f64.next_up()), (399.0, 1.0), (1.0, 399.0), (0.9, 399.1), (399.1, 0.9)];
    let (x2, y2) = dice.of(&sums);
    if dice.rarely() { None } else { Some(Beat { x2, y2, windows: 8 }) }
}

/// What is wished is a mode of operation.
fn wished(wish: Wish) -> Mode {
    match wish {
        Wish::Hold => Mode::Hold,
        Wish::RingDown => Mode::RingDown,
        _ => Mode::WholeAngle,
    }
}

fn run(mode: Mode) -> Orders<f64> {
    match mode {
        Mode::Hold => RUN_HELD,
        Mode::RingDown => RUN_DOWN,
        _ => RUN,
    }
}

/// One window of the table: what is next, and what the loops are to do.
struct Table {
    s: SupervisorState,
}

impl Table {
    fn fault(&mut self, fault: Fault) -> Orders<f64> {
        (self.s.mode, self.s.fault, self.s.windows, self.s.good) = (Mode::Fault, Some(fault), 0, 0);
        (self.s.bad, self.s.coasts, self.s.trying) = (0, 0, 0);
        Orders::Rest
    }

    fn to(&mut self, mode: Mode, orders: Orders<f64>) -> Orders<f64> {
        (self.s.mode, self.s.windows, self.s.good) = (mode, 0, 0);
        orders
    }

    /// The 51st interruption is a fault.
    fn interrupted(&mut self) -> bool {
        self.s.coasts = self.s.coasts.saturating_add(1);
        self.s.coasts > 50
    }

    fn step(&mut self, o: &Observation<f64>, beat: Option<Beat<f64>>) -> Orders<f64> {
        self.s.windows = self.s.windows.saturating_add(1);
        let p = &o.pendulum;
        let aligned = matches!(self.s.mode, Mode::WholeAngle | Mode::Hold) && wished(self.s.wish) == self.s.mode;
        let bounded = p.e > 6.25 && p.e < 56.25 && p.q.abs() < p.e / 2.0 && p.l.abs() < p.e / 2.0;
        let unblemished = o.valid && !o.clipped && !o.repeats && !o.jumped;
        if aligned && self.s.wish != Wish::Off && bounded && unblemished {
            self.s.repeats = 0;
            if self.s.windows >= ENDURE {
                (self.s.bad, self.s.clipped) = (0, 0);
            }
            if self.s.windows >= FORGET {
                (self.s.starts, self.s.coasts, self.s.trying, self.s.cause) = (0, 0, 0, None);
            }
            return run(self.s.mode);
        }
        if self.s.wish == Wish::Off {
            self.s = SupervisorState { wish: Wish::Off, fault: self.s.fault, ..SupervisorState::default() };
            return Orders::Rest;
        }
        self.s.repeats = if o.repeats { self.s.repeats.saturating_add(1) } else { 0 };
        if self.s.mode == Mode::Fault {
            return self.rest(o);
        }
        self.s.clipped = self.s.clipped.saturating_add(u32::from(o.clipped));
        self.ended(o).unwrap_or_else(|| match self.s.mode {
            Mode::Listen => self.listen(beat),
            Mode::Sweep => self.sweep(),
            Mode::Lock => self.lock(o),
            Mode::SpinUp => self.spin_up(o),
            Mode::Coast => self.coast(o),
            _ => self.operate(o),
        })
    }

    /// What ends any mode but a fault.
    fn ended(&mut self, o: &Observation<f64>) -> Option<Orders<f64>> {
        let named = |fault| if o.clipped { Fault::Saturated } else { fault };
        if self.s.repeats >= 20 {
            return Some(self.fault(named(Fault::StuckChannel)));
        }
        if self.s.clipped >= ENDURE {
            return Some(self.fault(Fault::Saturated));
        }
        let out_of_time = match self.s.mode {
            Mode::Listen | Mode::Sweep => Some(Fault::NoResonance),
            Mode::Lock => Some(Fault::NoLock),
            Mode::SpinUp => Some(Fault::NoSpinUp),
            Mode::Coast => Some(self.s.cause.unwrap_or(Fault::InvalidSamples)),
            _ => None,
        };
        if let Some(fault) = out_of_time {
            self.s.trying = self.s.trying.saturating_add(1);
            if self.s.trying >= BUDGET {
                return Some(self.fault(fault));
            }
        }
        if !o.valid && self.s.mode != Mode::Coast {
            self.s.cause = Some(Fault::InvalidSamples);
            return Some(if self.interrupted() {
                self.fault(Fault::InvalidSamples)
            } else {
                self.to(Mode::Coast, Orders::Rest)
            });
        }
        None
    }

    fn rest(&mut self, o: &Observation<f64>) -> Orders<f64> {
        let tried_often = self.s.starts >= 2;
        let rest = if tried_often { REST * LONG_REST } else { REST };
        if !o.valid || o.clipped || self.s.repeats >= 20 || self.s.windows < rest {
            return Orders::Rest;
        }
        if !tried_often {
            self.s.starts += 1;
        }
        (self.s.sweeps, self.s.clipped, self.s.trying, self.s.cause) = (0, 0, 0, None);
        self.to(Mode::Listen, Orders::Rest)
    }

    fn listen(&mut self, beat: Option<Beat<f64>>) -> Orders<f64> {
        let Some(beat) = beat.filter(|_| self.s.windows >= LISTEN) else { return Orders::Listen };
        let both = beat.x2 + beat.y2;
        let heard = both > f64::from(beat.windows) * 0.25;
        let driven = self.s.sweeps > 0 || self.s.fault == Some(Fault::DeadChannel);
        let dead = driven && beat.x2.min(beat.y2) < both / 400.0;
        match (heard, dead) {
            (true, false) => self.to(Mode::Lock, Orders::Tune),
            _ if self.s.sweeps < 3 => self.to(Mode::Sweep, Orders::Rest),
            (true, true) => self.fault(Fault::DeadChannel),
            (false, _) => self.fault(Fault::NoResonance),
        }
    }

    fn sweep(&mut self) -> Orders<f64> {
        let length = SWEEP << self.s.sweeps.min(8);
        if self.s.windows >= length {
            self.s.sweeps = self.s.sweeps.saturating_add(1);
            return self.to(Mode::Listen, Orders::Rest);
        }
        let share = f64::from(self.s.windows) / f64::from(length);
        Orders::Sweep { correction_rad_s: 100.0 * (2.0 * share - 1.0), opposed: self.s.sweeps % 2 == 1 }
    }

    fn lock(&mut self, o: &Observation<f64>) -> Orders<f64> {
        let p = &o.pendulum;
        if 4.0 * p.e < 0.25 {
            return self.to(Mode::Listen, Orders::Rest);
        }
        if self.s.windows == 1 {
            return Orders::Snap;
        }
        self.s.good = if p.l.abs() < 0.2 * p.e { self.s.good.saturating_add(1) } else { 0 };
        if self.s.good >= 20 {
            return self.to(Mode::SpinUp, RUN);
        }
        if self.s.windows >= LOCK { self.fault(Fault::NoLock) } else { Orders::Lock }
    }

    /// The names of a vibration that is gone or jumped.
    fn instead(o: &Observation<f64>, fault: Fault) -> Fault {
        match (o.clipped, o.repeats) {
            (true, _) => Fault::Saturated,
            (_, true) => Fault::StuckChannel,
            _ => fault,
        }
    }

    fn spin_up(&mut self, o: &Observation<f64>) -> Orders<f64> {
        let p = &o.pendulum;
        if 4.0 * p.e < 0.25 {
            return self.fault(Self::instead(o, Fault::AmplitudeLow));
        }
        let there = (p.e - SET_2).abs() < 0.2 * SET_2 && p.q.abs() < 0.1 * p.e;
        self.s.good = if there { self.s.good.saturating_add(1) } else { 0 };
        if self.s.good >= 20 {
            self.s.sweeps = 0;
            if self.s.cause == Some(Fault::DeadChannel) && p.s.abs() < p.r.abs() * (1.0 / 30.0) {
                return self.fault(Fault::DeadChannel);
            }
            let mode = wished(self.s.wish);
            return self.to(mode, run(mode));
        }
        if let Some(orders) = self.bounds(p, false) {
            return orders;
        }
        if self.s.windows >= SPIN_UP {
            return self.fault(Fault::NoSpinUp);
        }
        if self.s.wish == Wish::WholeAngle { RUN } else { RUN_HELD }
    }

    fn coast(&mut self, o: &Observation<f64>) -> Orders<f64> {
        if !o.valid {
            self.s.good = 0;
            if self.s.windows >= COAST {
                return self.fault(self.s.cause.unwrap_or(Fault::InvalidSamples));
            }
            return Orders::Rest;
        }
        self.s.good = self.s.good.saturating_add(1);
        match (self.s.good >= 2, 4.0 * o.pendulum.e < 0.25) {
            (false, _) => Orders::Rest,
            (true, true) => self.to(Mode::Listen, Orders::Rest),
            (true, false) => self.to(Mode::Lock, Orders::Snap),
        }
    }

    fn operate(&mut self, o: &Observation<f64>) -> Orders<f64> {
        let p = &o.pendulum;
        if o.jumped {
            let cause = Self::instead(o, Fault::DeadChannel);
            self.s.cause = Some(cause);
            return if self.interrupted() { self.fault(cause) } else { self.to(Mode::Coast, Orders::Rest) };
        }
        if 4.0 * p.e < 0.25 {
            return self.fault(Self::instead(o, Fault::AmplitudeLow));
        }
        let (mode, low) = (self.s.mode, p.e < 6.25);
        if wished(self.s.wish) != mode {
            self.s.trying = 0;
            let next = if low { Mode::SpinUp } else { wished(self.s.wish) };
            return self.to(next, run(next));
        }
        if let Some(orders) = self.bounds(p, low && mode != Mode::RingDown) {
            return orders;
        }
        if mode != Mode::RingDown {
            self.s.windows = 0;
        }
        run(mode)
    }

    fn bounds(&mut self, p: &Pendulum<f64>, low: bool) -> Option<Orders<f64>> {
        let in_phase = p.l.abs() < p.e / 2.0;
        if !in_phase {
            return Some(if self.interrupted() {
                self.fault(Fault::NoLock)
            } else {
                self.to(Mode::Lock, Orders::Snap)
            });
        }
        let names = [
            (p.e > 56.25 || p.e.is_nan(), Fault::AmplitudeHigh),
            (low, Fault::AmplitudeLow),
            (p.q.is_nan() || p.q.abs() >= p.e / 2.0, Fault::QuadratureHigh),
        ];
        let (_, fault) = names.into_iter().find(|(out, _)| *out)?;
        self.s.bad = self.s.bad.saturating_add(1);
        (self.s.bad >= ENDURE).then(|| self.fault(fault))
    }
}

#[test]
fn a_step_from_any_state_is_that_of_the_table() {
    let mut dice = Dice(0x9E37_79B9_7F4A_7C15);
    let supervisor = supervisor();
    let mut passed = std::collections::BTreeSet::new();
    for _ in 0..400_000 {
        let (before, o, beat) = (any_state(&mut dice), any_window(&mut dice), any_beat(&mut dice));
        let (mut state, mut table) = (before, Table { s: before });
        let orders = supervisor.step(&mut state, &o, beat);
        let expected = table.step(&o, beat);
        assert_eq!((state, orders), (table.s, expected), "{before:?}\n{o:?}\n{beat:?}");
        passed.insert(format!("{:?} {:?} {:?}", before.mode, state.mode, state.fault_now()));
    }
    // from every mode to every mode that follows it, and every fault
    assert!(passed.len() > 70, "{}", passed.len());
}

#[test]
fn what_goes_on_is_counted_and_nothing_else() {
    let mut dice = Dice(0xD1B5_4A32_D192_ED03);
    let supervisor = supervisor();
    let mut on = 0;
    for _ in 0..400_000 {
        let (before, o) = (any_state(&mut dice), any_window(&mut dice));
        if !supervisor.goes_on(&before, &o.pendulum) {
            continue;
        }
        on += 1;
        let well = Observation { valid: true, clipped: false, repeats: false, jumped: false, ..o };
        let (mut state, mut counted) = (before, before);
        let orders = supervisor.step(&mut state, &well, None);
        counted.count();
        assert_eq!((state, orders), (counted, run(before.mode)), "{before:?}\n{o:?}");
        assert!(Supervisor::in_phase(&o.pendulum), "{before:?}\n{o:?}");
    }
    assert!(on > 500, "{on}");
}

#[test]
fn a_walk_of_any_windows_is_that_of_the_table() {
    for seed in 1..200 {
        let mut dice = Dice(seed);
        let mut state = SupervisorState::default();
        let mut table = Table { s: state };
        let calm = dice.of(&[0, 3, 30]);
        for k in 0..1000 {
            let o = if dice.roll().is_multiple_of(calm + 1) { any_window(&mut dice) } else { well() };
            if dice.roll().is_multiple_of(100) {
                let wish = dice.of(&[Wish::WholeAngle, Wish::WholeAngle, Wish::Hold, Wish::RingDown, Wish::Off]);
                (state.wish, table.s.wish) = (wish, wish);
            }
            let beat = (state.mode == Mode::Listen).then(|| any_beat(&mut dice)).flatten();
            let orders = supervisor().step(&mut state, &o, beat);
            assert_eq!(
                (state, orders),
                {
                    let expected = table.step(&o, beat);
                    (table.s, expected)
                },
                "{seed} {k} {o:?}"
            );
        }
    }
}
