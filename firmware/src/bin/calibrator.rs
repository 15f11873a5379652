//! The calibrator on a Cortex-M4F under QEMU: it lives what it lives on the host, every number that it hands out has to have
//! the same bits, and its instructions are counted.
//!
//! What is counted is a call: with its prologue, and with the loads and stores of its state.
#![no_std]
#![no_main]

#[path = "../calibration.rs"]
mod calibration;
#[path = "../meter.rs"]
mod meter;
#[path = "../scalar.rs"]
mod scalar;

use core::hint::black_box;

use calibration::{Life, Meter, PER_S, Part, SECONDS};
use cortex_m::peripheral::SYST;
use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use cvg_calibrator::{Settings, State};
use meter::{Count, between};
use scalar::Single;

/// Where QEMU loads the checksums of the host, one a second.
const RECORDED: *const u32 = 0x2100_0000 as *const u32;
const SLICES: usize = 160;

struct Counts {
    empty: u32,
    slice: usize,
    now: u32,
    by_slice: [u32; SLICES],
    step: Count,
}

impl Meter for Counts {
    #[inline(always)]
    fn count<R>(&mut self, what: Part, f: impl FnOnce() -> R) -> R {
        let before = SYST::get_current();
        let result = called(f);
        let took = between(before, SYST::get_current()).saturating_sub(self.empty);
        self.now += took;
        if what == Part::Step {
            self.step.add(took);
            if let Some(most) = self.by_slice.get_mut(self.slice) {
                *most = (*most).max(took);
            }
        }
        result
    }
}

/// A call, of which nothing is moved out.
#[inline(never)]
fn called<R>(f: impl FnOnce() -> R) -> R {
    f()
}

#[entry]
fn main() -> ! {
    let (empty, mut wrong) = meter::start();
    let settings = Settings::default();
    let mut life = match Life::<Single>::new(black_box(&settings)) {
        Ok(life) => life,
        Err(e) => panic!("{e}"),
    };
    let mut counts = Counts { empty, slice: 0, now: 0, by_slice: [0; SLICES], step: Count::default() };
    let mut all = Count::default();
    let mut differing = 0;
    for second in 0..SECONDS {
        for _ in 0..PER_S {
            counts.slice = life.slice(&settings) as usize;
            counts.now = 0;
            life.step(&mut counts);
            all.add(counts.now);
        }
        // SAFETY: QEMU has loaded as many checksums there
        if life.checksum != unsafe { RECORDED.add(second as usize).read_volatile() } {
            if differing == 0 {
                hprintln!("calibrator: second {} differs", second);
            }
            differing += 1;
        }
    }
    hprintln!("ratio less 0.03, ppm: {}", ((life.ratio() - 0.03) * 1e6) as i32);
    hprintln!("most of each slice {:?}", counts.by_slice);
    hprintln!(
        "calibrator: seconds {}, differing {}, control {}.{} most {}, slice {}.{} most {}, state {}",
        SECONDS,
        differing,
        all.tenths() / 10,
        all.tenths() % 10,
        all.most,
        counts.step.tenths() / 10,
        counts.step.tenths() % 10,
        counts.step.most,
        size_of::<State<Single>>(),
    );
    wrong += differing;
    meter::end(wrong == 0)
}
