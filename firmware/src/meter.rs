//! Counts instructions by SysTick, and says what a program has to say.
//!
//! QEMU runs one instruction per [`TICKS`]/[`PER`] ticks of SysTick (`-icount`), so that SysTick counts instructions.

use core::arch::asm;

use cortex_m::peripheral::{SYST, syst::SystClkSource};
use cortex_m_semihosting::{debug, hprintln};

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
pub fn between(before: u32, after: u32) -> u32 {
    let ticks = before.wrapping_sub(after) & 0x00ff_ffff;
    (ticks * PER + TICKS / 2) / TICKS
}

/// How many instructions calls took.
#[derive(Clone, Copy, Default)]
pub struct Count {
    calls: u32,
    instructions: u32,
    pub most: u32,
}

impl Count {
    pub fn add(&mut self, instructions: u32) {
        self.calls += 1;
        self.instructions += instructions;
        self.most = self.most.max(instructions);
    }

    /// Mean in tenths.
    pub fn tenths(&self) -> u32 {
        (self.instructions.saturating_mul(10) + self.calls / 2) / self.calls.max(1)
    }
}

/// Starts SysTick; what an empty measurement counts, and how many of a thousand instructions are not counted as one each.
pub fn start() -> (u32, u32) {
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
    (empty, thousand.abs_diff(1000))
}

/// The end of the program.
pub fn end(alike: bool) -> ! {
    hprintln!("{}", if alike { "all alike" } else { "not alike" });
    debug::exit(if alike { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    loop {
        cortex_m::asm::wfi();
    }
}
