//! The supervisor a second time, as the specification tells it: from any state and for any window, on both sides of every
//! bound, one step is that of the table here, in both precisions. What is left out by each is what the other would show.

use super::*;
use cvg_model::Float;

/// A number with its neighbours.
trait Scalar: Float {
    fn neighbours(self) -> [Self; 2];
}

impl Scalar for f32 {
    fn neighbours(self) -> [Self; 2] {
        [self.next_up(), self.next_down()]
    }
}

impl Scalar for f64 {
    fn neighbours(self) -> [Self; 2] {
        [self.next_up(), self.next_down()]
    }
}

fn t<T: Float>(v: f64) -> T {
    T::from_f64(v)
}

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
        requested: dice.of(&[
            RequestedMode::WholeAngle,
            RequestedMode::WholeAngle,
            RequestedMode::Hold,
            RequestedMode::RingDown,
            RequestedMode::Off,
        ]),
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
fn near<T: Scalar>(dice: &mut Dice, v: T) -> T {
    let [up, down] = v.neighbours();
    let v = dice.of(&[v, up, down]);
    dice.of(&[v, v, -v])
}

fn any_window<T: Scalar>(dice: &mut Dice) -> Observation<T> {
    let e = dice.of(&[SET_2, SET_2, SET_2, 0.25 * SET_2, 2.25 * SET_2, 20.0, 30.0, LEAST, 1.0, 0.0, f64::INFINITY]);
    let e = if dice.rarely() { near(dice, t::<T>(e)).magnitude() } else { t(e) };
    let share = |dice: &mut Dice, shares: &[f64]| {
        let share = dice.of(shares);
        near(dice, t::<T>(share) * e)
    };
    let q = share(dice, &[0.0, 0.0, 1.0 / 32.0, 1.0 / 16.0, 0.1, 0.5, 0.6]);
    let l = share(dice, &[0.0, 0.0, 1.0 / 32.0, 1.0 / 16.0, 0.2, 0.5, 0.6]);
    let (r, s) = (share(dice, &[0.6, 1.0, 0.3]), share(dice, &[0.8, 0.0, 1.0 / 30.0, 0.01]));
    let mut pendulum = Pendulum { e, q, r, s, l };
    if dice.rarely() {
        match dice.of(&[0, 1, 2]) {
            0 => pendulum.e = t(f64::NAN),
            1 => pendulum.q = t(f64::NAN),
            _ => pendulum.l = t(f64::NAN),
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

fn any_beat<T: Scalar>(dice: &mut Dice) -> Option<Beat<T>> {
    // eight windows of 0.25 V² are heard above 2 V², and a channel of a 400th is dead
    let sums = [(9.0, 9.0), (1.0, 1.0), (1.0, 1.0), (399.0, 1.0), (1.0, 399.0), (0.9, 399.1), (399.1, 0.9)];
    let which = dice.of(&[0, 1, 2, 3, 4, 5, 6]);
    let (x2, y2) = (t(sums[which].0), t::<T>(sums[which].1));
    // two and a unit more in the last place of their sum
    let y2 = if which == 2 { y2.neighbours()[0].neighbours()[0] } else { y2 };
    if dice.rarely() { None } else { Some(Beat { x2, y2, windows: 8 }) }
}

/// What is requested is a mode of operation.
fn requested(requested: RequestedMode) -> Mode {
    match requested {
        RequestedMode::Hold => Mode::Hold,
        RequestedMode::RingDown => Mode::RingDown,
        _ => Mode::WholeAngle,
    }
}

fn run<T>(mode: Mode) -> LoopCommand<T> {
    LoopCommand::Run { hold: mode == Mode::Hold || mode == Mode::RingDown, ring_down: mode == Mode::RingDown }
}

fn half<T: Float>(v: T) -> T {
    v / t(2.0)
}

fn is_nan<T: Float>(v: T) -> bool {
    v.to_f64().is_nan()
}

/// One window of the table: what is next, and what the loops are to do.
struct Table {
    s: SupervisorState,
}

impl Table {
    fn fault<T: Scalar>(&mut self, fault: Fault) -> LoopCommand<T> {
        (self.s.mode, self.s.fault, self.s.windows, self.s.good) = (Mode::Fault, Some(fault), 0, 0);
        (self.s.bad, self.s.coasts, self.s.trying) = (0, 0, 0);
        LoopCommand::Rest
    }

    fn to<T: Scalar>(&mut self, mode: Mode, command: LoopCommand<T>) -> LoopCommand<T> {
        (self.s.mode, self.s.windows, self.s.good) = (mode, 0, 0);
        command
    }

    /// The 51st interruption is a fault.
    fn interrupted(&mut self) -> bool {
        self.s.coasts = self.s.coasts.saturating_add(1);
        self.s.coasts > 50
    }

    fn step<T: Scalar>(&mut self, o: &Observation<T>, beat: Option<Beat<T>>) -> LoopCommand<T> {
        self.s.windows = self.s.windows.saturating_add(1);
        let p = &o.pendulum;
        let aligned =
            matches!(self.s.mode, Mode::WholeAngle | Mode::Hold) && requested(self.s.requested) == self.s.mode;
        let bounded = p.e > t(6.25) && p.e < t(56.25) && p.q.magnitude() < half(p.e) && p.l.magnitude() < half(p.e);
        let unblemished = o.valid && !o.clipped && !o.repeats && !o.jumped;
        if aligned && self.s.requested != RequestedMode::Off && bounded && unblemished {
            self.s.repeats = 0;
            if self.s.windows >= ENDURE {
                (self.s.bad, self.s.clipped) = (0, 0);
            }
            if self.s.windows >= FORGET {
                (self.s.starts, self.s.coasts, self.s.trying, self.s.cause) = (0, 0, 0, None);
            }
            return run(self.s.mode);
        }
        if self.s.requested == RequestedMode::Off {
            self.s =
                SupervisorState { requested: RequestedMode::Off, fault: self.s.fault, ..SupervisorState::default() };
            return LoopCommand::Rest;
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
    fn ended<T: Scalar>(&mut self, o: &Observation<T>) -> Option<LoopCommand<T>> {
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
                self.to(Mode::Coast, LoopCommand::Rest)
            });
        }
        None
    }

    fn rest<T: Scalar>(&mut self, o: &Observation<T>) -> LoopCommand<T> {
        let tried_often = self.s.starts >= 2;
        let rest = if tried_often { REST * LONG_REST } else { REST };
        if !o.valid || o.clipped || self.s.repeats >= 20 || self.s.windows < rest {
            return LoopCommand::Rest;
        }
        if !tried_often {
            self.s.starts += 1;
        }
        (self.s.sweeps, self.s.clipped, self.s.trying, self.s.cause) = (0, 0, 0, None);
        self.to(Mode::Listen, LoopCommand::Rest)
    }

    fn listen<T: Scalar>(&mut self, beat: Option<Beat<T>>) -> LoopCommand<T> {
        let Some(beat) = beat.filter(|_| self.s.windows >= LISTEN) else { return LoopCommand::Listen };
        let both = beat.x2 + beat.y2;
        let heard = both > t(f64::from(beat.windows) * 0.25);
        let driven = self.s.sweeps > 0 || self.s.fault == Some(Fault::DeadChannel);
        let dead = driven && (if beat.x2 < beat.y2 { beat.x2 } else { beat.y2 }) < both * T::ratio(1, 400);
        match (heard, dead) {
            (true, false) => self.to(Mode::Lock, LoopCommand::Tune),
            _ if self.s.sweeps < 3 => self.to(Mode::Sweep, LoopCommand::Rest),
            (true, true) => self.fault(Fault::DeadChannel),
            (false, _) => self.fault(Fault::NoResonance),
        }
    }

    fn sweep<T: Scalar>(&mut self) -> LoopCommand<T> {
        let length = SWEEP << self.s.sweeps.min(8);
        if self.s.windows >= length {
            self.s.sweeps = self.s.sweeps.saturating_add(1);
            return self.to(Mode::Listen, LoopCommand::Rest);
        }
        let share = t::<T>(f64::from(self.s.windows)) / t(f64::from(length));
        LoopCommand::Sweep {
            correction_rad_s: t::<T>(100.0) * (t::<T>(2.0) * share - t(1.0)),
            opposed: self.s.sweeps % 2 == 1,
        }
    }

    fn lock<T: Scalar>(&mut self, o: &Observation<T>) -> LoopCommand<T> {
        let p = &o.pendulum;
        if t::<T>(4.0) * p.e < t(0.25) {
            return self.to(Mode::Listen, LoopCommand::Rest);
        }
        if self.s.windows == 1 {
            return LoopCommand::Snap;
        }
        self.s.good = if p.l.magnitude() < t::<T>(0.2) * p.e { self.s.good.saturating_add(1) } else { 0 };
        if self.s.good >= 20 {
            return self.to(Mode::SpinUp, run(Mode::WholeAngle));
        }
        if self.s.windows >= LOCK { self.fault(Fault::NoLock) } else { LoopCommand::Lock }
    }

    /// The names of a vibration that is gone or jumped.
    fn instead<T: Scalar>(o: &Observation<T>, fault: Fault) -> Fault {
        match (o.clipped, o.repeats) {
            (true, _) => Fault::Saturated,
            (_, true) => Fault::StuckChannel,
            _ => fault,
        }
    }

    fn spin_up<T: Scalar>(&mut self, o: &Observation<T>) -> LoopCommand<T> {
        let p = &o.pendulum;
        if t::<T>(4.0) * p.e < t(0.25) {
            return self.fault(Self::instead(o, Fault::AmplitudeLow));
        }
        let there = (p.e - t(SET_2)).magnitude() < t::<T>(0.2) * t(SET_2) && p.q.magnitude() < t::<T>(0.1) * p.e;
        self.s.good = if there { self.s.good.saturating_add(1) } else { 0 };
        if self.s.good >= 20 {
            self.s.sweeps = 0;
            if self.s.cause == Some(Fault::DeadChannel) && p.s.magnitude() < p.r.magnitude() * T::ratio(1, 30) {
                return self.fault(Fault::DeadChannel);
            }
            let mode = requested(self.s.requested);
            return self.to(mode, run(mode));
        }
        if let Some(command) = self.bounds(p, false) {
            return command;
        }
        if self.s.windows >= SPIN_UP {
            return self.fault(Fault::NoSpinUp);
        }
        run(if self.s.requested == RequestedMode::WholeAngle { Mode::WholeAngle } else { Mode::Hold })
    }

    fn coast<T: Scalar>(&mut self, o: &Observation<T>) -> LoopCommand<T> {
        if !o.valid {
            self.s.good = 0;
            if self.s.windows >= COAST {
                return self.fault(self.s.cause.unwrap_or(Fault::InvalidSamples));
            }
            return LoopCommand::Rest;
        }
        self.s.good = self.s.good.saturating_add(1);
        match (self.s.good >= 2, t::<T>(4.0) * o.pendulum.e < t(0.25)) {
            (false, _) => LoopCommand::Rest,
            (true, true) => self.to(Mode::Listen, LoopCommand::Rest),
            (true, false) => self.to(Mode::Lock, LoopCommand::Snap),
        }
    }

    fn operate<T: Scalar>(&mut self, o: &Observation<T>) -> LoopCommand<T> {
        let p = &o.pendulum;
        if o.jumped {
            let cause = Self::instead(o, Fault::DeadChannel);
            self.s.cause = Some(cause);
            return if self.interrupted() { self.fault(cause) } else { self.to(Mode::Coast, LoopCommand::Rest) };
        }
        if t::<T>(4.0) * p.e < t(0.25) {
            return self.fault(Self::instead(o, Fault::AmplitudeLow));
        }
        let (mode, low) = (self.s.mode, p.e < t(6.25));
        if requested(self.s.requested) != mode {
            self.s.trying = 0;
            let next = if low { Mode::SpinUp } else { requested(self.s.requested) };
            return self.to(next, run(next));
        }
        if let Some(command) = self.bounds(p, low && mode != Mode::RingDown) {
            return command;
        }
        if mode != Mode::RingDown {
            self.s.windows = 0;
        }
        run(mode)
    }

    fn bounds<T: Scalar>(&mut self, p: &Pendulum<T>, low: bool) -> Option<LoopCommand<T>> {
        let in_phase = p.l.magnitude() < half(p.e);
        if !in_phase {
            return Some(if self.interrupted() {
                self.fault(Fault::NoLock)
            } else {
                self.to(Mode::Lock, LoopCommand::Snap)
            });
        }
        let names = [
            (p.e > t(56.25) || is_nan(p.e), Fault::AmplitudeHigh),
            (low, Fault::AmplitudeLow),
            (is_nan(p.q) || p.q.magnitude() >= half(p.e), Fault::QuadratureHigh),
        ];
        let (_, fault) = names.into_iter().find(|(out, _)| *out)?;
        self.s.bad = self.s.bad.saturating_add(1);
        (self.s.bad >= ENDURE).then(|| self.fault(fault))
    }
}

fn a_step_is_that_of_the_table<T: Scalar>() {
    let mut dice = Dice(0x9E37_79B9_7F4A_7C15);
    let supervisor = Supervisor::<T>::new(&settings()).expect("valid");
    let mut passed = std::collections::BTreeSet::new();
    for _ in 0..400_000 {
        let (before, o, beat) = (any_state(&mut dice), any_window::<T>(&mut dice), any_beat(&mut dice));
        let (mut state, mut table) = (before, Table { s: before });
        let command = supervisor.step(&mut state, &o, beat);
        let expected = table.step(&o, beat);
        assert_eq!((state, command), (table.s, expected), "{before:?}\n{o:?}\n{beat:?}");
        passed.insert(format!("{:?} {:?} {:?}", before.mode, state.mode, state.fault_now()));
    }
    // from every mode to every mode that follows it, and every fault
    assert!(passed.len() > 70, "{}", passed.len());
}

#[test]
fn a_step_from_any_state_is_that_of_the_table_in_both_precisions() {
    a_step_is_that_of_the_table::<f32>();
    a_step_is_that_of_the_table::<f64>();
}

fn what_goes_on_is_counted<T: Scalar>() {
    let mut dice = Dice(0xD1B5_4A32_D192_ED03);
    let supervisor = Supervisor::<T>::new(&settings()).expect("valid");
    let mut on = 0;
    for _ in 0..400_000 {
        let (before, o) = (any_state(&mut dice), any_window::<T>(&mut dice));
        if !supervisor.runs_unchanged(&before, &o.pendulum) {
            continue;
        }
        on += 1;
        let well = Observation { valid: true, clipped: false, repeats: false, jumped: false, ..o };
        let (mut state, mut counted) = (before, before);
        let command = supervisor.step(&mut state, &well, None);
        counted.count();
        assert_eq!((state, command), (counted, run(before.mode)), "{before:?}\n{o:?}");
        assert!(Supervisor::in_phase(&o.pendulum), "{before:?}\n{o:?}");
    }
    assert!(on > 500, "{on}");
}

#[test]
fn what_goes_on_is_counted_and_nothing_else_in_both_precisions() {
    what_goes_on_is_counted::<f32>();
    what_goes_on_is_counted::<f64>();
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
                let requested = dice.of(&[
                    RequestedMode::WholeAngle,
                    RequestedMode::WholeAngle,
                    RequestedMode::Hold,
                    RequestedMode::RingDown,
                    RequestedMode::Off,
                ]);
                (state.requested, table.s.requested) = (requested, requested);
            }
            let beat = (state.mode == Mode::Listen).then(|| any_beat(&mut dice)).flatten();
            let command = supervisor().step(&mut state, &o, beat);
            assert_eq!(
                (state, command),
                {
                    let expected = table.step(&o, beat);
                    (table.s, expected)
                },
                "{seed} {k} {o:?}"
            );
        }
    }
}
