//! The instrument on a Cortex-M4F under QEMU: it is given what the converters read in a recording of the host, and has to
//! answer with the same bits; and it counts its instructions.
//!
//! That SysTick counts instructions is measured first. What is counted is a call: with its prologue, and with the loads and stores of its state.
#![no_std]
#![no_main]

mod meter;
mod scalar;
mod scenario;

use core::hint::black_box;

use cortex_m::peripheral::SYST;
use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use cvg_instrument::{Instrument, Mode, State, Status};
use meter::{Count, between};
use scalar::Single;
use scenario::{RECORDINGS, settings, word};

/// Where QEMU loads the recordings, and how far apart.
const RECORDED: usize = 0x2100_0000;
const APART: usize = 0x0080_0000;

/// Words of a sample in a recording: what the converters read, what is put out, and the status.
const WORDS: usize = 5;

/// What an interrupt of the converter would do.
#[inline(never)]
fn sample(i: &Instrument<Single>, state: &mut State<Single>, x: Single, y: Single) -> (Single, Single, Status) {
    i.step(state, x, y)
}

#[entry]
fn main() -> ! {
    let (empty, mut wrong) = meter::start();
    for (k, name) in RECORDINGS.iter().enumerate() {
        let start = (RECORDED + k * APART) as *const u32;
        // SAFETY: QEMU has loaded a recording there: its length, and as many samples
        let samples = unsafe {
            let count = *start as usize;
            core::slice::from_raw_parts(start.add(1), count * WORDS)
        };
        wrong += run(name, k, samples, empty);
    }
    meter::end(wrong == 0)
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
