//! Every public step of the crates for firmware behind `#[no_panic]`: if the compiler cannot show that a call returns, the
//! program does not link. Run with `--features mutant`, linking has to fail.
//!
//! The steps take what they need from the command line, so that nothing is known when the program is compiled.

use core::hint::black_box;

use cvg_calibrator::{Calibrator, Commands, Health};
use cvg_controller::supervisor::{Beat as Heard, Observation};
use cvg_controller::{
    Allocation, Heading, OrbitCommands, Pi, PiState, RateLoop, Supervisor, SupervisorState,
};
use cvg_estimator::direction::major_axis;
use cvg_estimator::{
    AngleState, Beat, Compensation, Demodulator, LockState, Oscillator, PatternAngle, PhaseLock, Phasor, Precession,
    PrecessionState, Window,
};
use cvg_instrument::{Instrument, Settings, State, Status};
use cvg_model::effects::Moment;
use cvg_model::{AxisForces, Envelope, Float, Pendulum};
use no_panic::no_panic;

macro_rules! steps {
    ($module:ident, $t:ty) => {
        mod $module {
            use super::*;
            type T = $t;

            #[no_panic]
            #[inline(never)]
            pub fn instrument(c: &Instrument<T>, s: &mut State<T>, x: T, y: T) -> (T, T, Status) {
                c.step(s, x, y)
            }
            #[no_panic]
            #[inline(never)]
            pub fn angle(s: &PrecessionState<T>) -> (i32, T) {
                s.angle()
            }
            #[no_panic]
            #[inline(never)]
            pub fn pattern_angle(c: &PatternAngle<T>, s: &mut AngleState<T>, e: &Envelope<T>) -> T {
                c.step(s, e).within_rad
            }
            #[no_panic]
            #[inline(never)]
            pub fn phase_lock(c: &PhaseLock<T>, s: &mut LockState<T>, p: &Pendulum<T>) -> T {
                c.step(s, p).rad_s
            }
            #[no_panic]
            #[inline(never)]
            pub fn precession(c: &Precession<T>, s: &mut PrecessionState<T>, e: &Envelope<T>, p: &Pendulum<T>) -> T {
                c.step(s, p);
                c.ahead(s, &major_axis(e, p)).cos
            }
            #[no_panic]
            #[inline(never)]
            pub fn compensation(c: &Compensation<T, 4>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
                c.apply(e, at)
            }
            #[no_panic]
            #[inline(never)]
            pub fn demodulator(c: &Demodulator<T>, o: &Oscillator<T>, w: &mut Window<T>, p: &mut Phasor<T>, x: T) -> T {
                let full = c.accumulate(w, x, x, p);
                *p = o.tune(&p.advanced(), x);
                if full { c.finish(w, p).envelope.x_c } else { x }
            }
            #[no_panic]
            #[inline(never)]
            pub fn beat(b: &mut Beat<T>, e: &Envelope<T>) -> T {
                b.add(e);
                b.radians_per_window()
            }
            #[no_panic]
            #[inline(never)]
            pub fn loops(c: &Pi<T>, s: &mut PiState<T>, e: T) -> T {
                c.energy(s, e, e).volts + c.quadrature(s, e).volts + c.control(s, e).volts
            }
            #[no_panic]
            #[inline(never)]
            pub fn rate(c: &RateLoop<T>, s: &mut PiState<T>, p: &Pendulum<T>, h: &Heading<T>) -> T {
                c.step(s, p, h).volts
            }
            #[no_panic]
            #[inline(never)]
            pub fn allocation(c: &Allocation<T>, v: &OrbitCommands<T>, cos: T, sin: T) -> T {
                let d = c.step(v, cos, sin).volts;
                d.x_c + d.x_s + d.y_c + d.y_s
            }
            #[no_panic]
            #[inline(never)]
            pub fn supervisor(c: &Supervisor<T>, s: &mut SupervisorState, o: &Observation<T>, b: Option<Heard<T>>) -> bool {
                matches!(c.step(s, o, b), cvg_controller::LoopCommand::Rest)
            }

            #[no_panic]
            #[inline(never)]
            pub fn calibrator(c: &Calibrator<T>, s: &mut cvg_calibrator::State<T>, e: &Envelope<T>, v: &Commands<T>) -> T {
                let e = c.readout(s, e);
                let f = c.forward(s, e.x_c, e.y_c, e.x_c);
                c.step(s, &e.pendulum(), (e.x_c, e.y_c), v, Health::Operating);
                let axes = c.drives(s, &AxisForces { x_c: e.x_c, x_s: e.x_s, y_c: e.y_c, y_s: e.y_s });
                c.status(s).bias_rad + f.quadrature_v + axes.x_c
            }
            #[no_panic]
            #[inline(never)]
            pub fn record(c: &Calibrator<T>, s: &cvg_calibrator::State<T>) -> bool {
                c.restore(&c.save(s)).is_ok()
            }

            pub fn all(v: f64) -> Result<f64, Box<dyn core::error::Error>> {
                let t = <T as Float>::from_f64(v);
                let settings = black_box(Settings::default());
                let i = black_box(Instrument::<T>::new(&settings)?);
                let mut state = black_box(i.start());
                let e = black_box(Envelope::new(t, t, t, t));
                let p = e.pendulum();
                let mut sum = 0.0;
                for _ in 0..200 {
                    let (x, y, _) = instrument(&i, &mut state, t, t);
                    sum += f64::from(x + y);
                }
                sum += f64::from(angle(&state.precession).1);
                let tracker = black_box(PatternAngle::new(cvg_estimator::Period::Pattern, t)?);
                sum += f64::from(pattern_angle(&tracker, &mut AngleState::default(), &e));
                let lock = black_box(PhaseLock::new(t, t, t, t)?);
                sum += f64::from(phase_lock(&lock, &mut LockState::default(), &p));
                let moves = black_box(Precession::new(v, v, v, v, v, v)?);
                sum += f64::from(precession(&moves, &mut PrecessionState::default(), &e, &p));
                let none = black_box(Compensation::<T, 4>::new(&[(
                    cvg_model::effects::EffectId::DetectionCubic,
                    black_box([t, <T as Float>::from_f64(0.0), <T as Float>::from_f64(0.0), <T as Float>::from_f64(0.0)]),
                )])?);
                sum += f64::from(compensation(&none, e, &Moment::default()).x_c);
                let (demod, osc) = (black_box(Demodulator::new(8, 1.0)?), black_box(Oscillator::<T>::new(v, 1.0, 0.01)?));
                let mut phasor = osc.start();
                let mut window = Window::begin(&phasor);
                sum += f64::from(demodulator(&demod, &osc, &mut window, &mut phasor, t));
                sum += f64::from(beat(&mut Beat::default(), &e));
                let pi = black_box(Pi::new(t, t, t, t)?);
                sum += f64::from(loops(&pi, &mut PiState::default(), t));
                let hold = black_box(RateLoop::tuned(t, t, t, t, t, t)?);
                sum += f64::from(rate(&hold, &mut PiState::default(), &p, &Heading::new(t)?));
                let drives = black_box(Allocation::new(None, t)?);
                sum += f64::from(allocation(&drives, &OrbitCommands { v_as: t, v_qs: t, v_qc: t, v_ac: t }, t, t));
                let observation = Observation { pendulum: p, valid: true, clipped: false, repeats: false, jumped: v > 1.0 };
                let supervisor_settings = cvg_controller::SupervisorSettings {
                    window_s: 1e-3,
                    amplitude_v: 1.0,
                    detection_threshold_v: 0.1,
                    band_rad_s: 1.0,
                    sweep_s: 1.0,
                    sweeps: 3,
                    listen_s: 0.1,
                    lock_s: 0.1,
                    spin_up_s: 0.1,
                    coast_s: 0.1,
                    fault_debounce_s: 0.1,
                    rest_s: 0.1,
                    retries: 3,
                    fault_memory_s: 1.0,
                };
                let watch = black_box(Supervisor::<T>::new(&supervisor_settings)?);
                let mut watched = black_box(SupervisorState::default());
                sum += f64::from(u8::from(supervisor(&watch, &mut watched, &observation, None)));
                let learns = black_box(Calibrator::<T>::new(&cvg_calibrator::Settings::default())?);
                let mut learned = black_box(learns.start());
                let asked = Commands { energy_v: t, precession_v: t, quadrature_v: t };
                for _ in 0..200 {
                    sum += f64::from(calibrator(&learns, &mut learned, &e, &asked));
                }
                sum += f64::from(u8::from(record(&learns, &learned)));
                Ok(sum)
            }
        }
    };
}

steps!(single, f32);
steps!(double, f64);

#[cfg(feature = "mutant")]
#[no_panic]
#[inline(never)]
fn mutant(table: &[f64], v: f64) -> f64 {
    table[v as usize]
}

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let v: f64 = std::env::args().nth(1).unwrap_or_else(|| "0.2".to_owned()).parse()?;
    #[cfg(feature = "mutant")]
    println!("{}", mutant(black_box(&[v, v]), black_box(v)));
    println!("linked: no step can panic ({:.3e}, {:.3e})", single::all(v)?, double::all(v)?);
    Ok(())
}
