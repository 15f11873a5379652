//! The instrument on a Cortex-M4F under QEMU: it is given what the converters read in a recording of the host, and has to
//! answer with the same bits; and it counts its instructions.
//!
//! QEMU runs one instruction per [`TICKS`]/[`PER`] ticks of SysTick (`-icount`), so that SysTick counts instructions.
//! That it does is measured first. What is counted is a call: with its prologue, and with the loads and stores of its state.
#![no_std]
#![no_main]

mod scalar;
mod scenario;

use core::arch::asm;
use core::hint::black_box;

use cortex_m::peripheral::{SYST, syst::SystClkSource};
use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};
use cvg_instrument::{Instrument, Mode, State, Status};
use scalar::Single;
use scenario::{RECORDINGS, settings, word};

/// Where QEMU loads the recordings, and how far apart.
const RECORDED: usize = 0x2100_0000;
const APART: usize = 0x0080_0000;

/// Words of a sample in a recording: what the converters read, what is put out, and the status.
const WORDS: usize = 5;

/// Ticks of SysTick at 25 MHz for [`PER`] instructions of 2⁷ ns.
const TICKS: u32 = 16;
const PER: u32 = 5;

#[panic_handler]
fn panicked(info: &core::panic::PanicInfo<'_>) -> ! {
    hprintln!("{}", info);
    debug::exit(debug::EXIT_FAILURE);
    loop {
        cortex_m::asm::wfi();
    }
}

/// Instructions from one reading of SysTick to the next.
fn between(before: u32, after: u32) -> u32 {
    let ticks = before.wrapping_sub(after) & 0x00ff_ffff;
    (ticks * PER + TICKS / 2) / TICKS
}

/// How many instructions calls took.
#[derive(Clone, Copy, Default)]
struct Count {
    calls: u32,
    instructions: u32,
    most: u32,
}

impl Count {
    fn add(&mut self, instructions: u32) {
        self.calls += 1;
        self.instructions += instructions;
        self.most = self.most.max(instructions);
    }

    /// Mean in tenths.
    fn tenths(&self) -> u32 {
        (self.instructions * 10 + self.calls / 2) / self.calls.max(1)
    }
}

/// What an interrupt of the converter would do.
#[inline(never)]
fn sample(i: &Instrument<Single>, state: &mut State<Single>, x: Single, y: Single) -> (Single, Single, Status) {
    i.step(state, x, y)
}

#[entry]
fn main() -> ! {
    let Some(mut board) = cortex_m::Peripherals::take() else { panic!("no board") };
    board.SYST.set_clock_source(SystClkSource::Core);
    board.SYST.set_reload(0x00ff_ffff);
    board.SYST.clear_current();
    board.SYST.enable_counter();

    let empty = {
        let before = SYST::get_current();
        between(before, SYST::get_current())
    };
    let thousand = {
        let before = SYST::get_current();
        // SAFETY: does nothing, a thousand times
        unsafe { asm!(".rept 1000", "nop", ".endr") };
        between(before, SYST::get_current()) - empty
    };
    hprintln!("meter: 1000 instructions count {}", thousand);
    let mut wrong = u32::from(thousand != 1000);

    for (k, name) in RECORDINGS.iter().enumerate() {
        let start = (RECORDED + k * APART) as *const u32;
        // SAFETY: QEMU has loaded a recording there: its length, and as many samples
        let samples = unsafe {
            let count = *start as usize;
            core::slice::from_raw_parts(start.add(1), count * WORDS)
        };
        wrong += run(name, k, samples, empty);
    }
    hprintln!("{}", if wrong == 0 { "all alike" } else { "not alike" });
    debug::exit(if wrong == 0 { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    loop {
        cortex_m::asm::wfi();
    }
}

/// Answers the recording; how many samples are answered otherwise.
fn run(name: &str, recording: usize, samples: &[u32], empty: u32) -> u32 {
    let instrument = match Instrument::<Single>::new(black_box(&settings(recording))) {
        Ok(instrument) => instrument,
        Err(e) => panic!("{e}"),
    };
    let mut state = instrument.start();
    let (mut plain, mut control, mut elsewhere) = (Count::default(), Count::default(), Count::default());
    let mut differing = 0;
    for (k, words) in samples.chunks_exact(WORDS).enumerate() {
        let [x, y, out_x, out_y, status] = [words[0], words[1], words[2], words[3], words[4]];
        let (x, y) = (Single(f32::from_bits(x)), Single(f32::from_bits(y)));
        let running = state.supervisor.mode == Mode::WholeAngle;
        let before = SYST::get_current();
        let (answer_x, answer_y, said) = sample(&instrument, &mut state, x, y);
        let took = between(before, SYST::get_current()) - empty;
        let control_step = said.fresh;
        match (running && said.mode == Mode::WholeAngle && said.valid, control_step) {
            (true, false) => plain.add(took),
            (true, true) => control.add(took),
            _ => elsewhere.add(took),
        }
        if [answer_x.0.to_bits(), answer_y.0.to_bits(), word(&said)] != [out_x, out_y, status] {
            if differing == 0 {
                hprintln!("{}: sample {} differs: {} {} {:?}", name, k, answer_x.0, answer_y.0, said);
            }
            differing += 1;
        }
    }
    hprintln!(
        "{}: samples {}, differing {}, sample {}.{} most {}, control {}.{} most {}, elsewhere most {}",
        name,
        samples.len() / WORDS,
        differing,
        plain.tenths() / 10,
        plain.tenths() % 10,
        plain.most,
        (control.tenths() - plain.tenths()) / 10,
        (control.tenths() - plain.tenths()) % 10,
        control.most - plain.tenths() / 10,
        elsewhere.most,
    );
    differing
}
