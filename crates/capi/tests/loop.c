// The loop in C: a resonator at the carrier, sample by sample, and the instrument by cvg.h. From rest into whole-angle mode at
// 100 deg/s, then a reading that is no number, then a hold. Exits with 0 where all went as it should.

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cvg.h"

static const double pi = 3.14159265358979323846;
static int failures;

static void expect(bool holds, const char *what) {
    if (!holds) {
        failures++;
        printf("not so: %s\n", what);
    }
}

// An isotropic resonator in the plane, of which the pattern precesses at -k times the rate.
typedef struct {
    double x, y, px, py, turn_cos, turn_sin, step_cos, step_sin, decay, push, force_x, force_y;
} resonator;

static resonator made(const cvg_settings *s, double frequency_hz, double rate_deg_s) {
    const double step = 2 * pi * frequency_hz / s->sample_hz, turn = -0.78 * rate_deg_s * pi / 180 / s->sample_hz;
    resonator r = {0};
    r.turn_cos = cos(turn), r.turn_sin = sin(turn), r.step_cos = cos(step), r.step_sin = sin(step);
    r.decay = exp(-1.0 / (22.0 * s->sample_hz));
    r.push = 2.0 * s->drive_per_s_v; // f/omega, by the envelope's rate f/(2 omega)
    return r;
}

// Held force: the motion around the displacement that the force holds.
static void move(resonator *r, const cvg_settings *s, double step_cos, double step_sin) {
    const double omega = acos(r->step_cos) * s->sample_hz, at_x = r->push * r->force_x / omega, at_y = r->push * r->force_y / omega;
    const double x = r->x - at_x, y = r->y - at_y;
    r->x = at_x + x * step_cos + r->px * step_sin;
    r->y = at_y + y * step_cos + r->py * step_sin;
    r->px = r->px * step_cos - x * step_sin;
    r->py = r->py * step_cos - y * step_sin;
}

static void turned(double c, double s, double *a, double *b) {
    const double x = *a, y = *b;
    *a = c * x - s * y;
    *b = s * x + c * y;
}

// One sample: the outputs change half a sample after the readings (drive_delay_s).
static cvg_output sample(const cvg_settings *s, const cvg_instrument *i, cvg_state *state, resonator *r, bool broken) {
    const cvg_output out = cvg_step(i, state, broken ? NAN : (float)r->x, (float)r->y);
    const double half = acos(r->step_cos) * 0.5, c = cos(half), n = sin(half);
    move(r, s, c, n);
    r->force_x = out.dac_x, r->force_y = out.dac_y;
    move(r, s, c, n);
    turned(r->turn_cos, r->turn_sin, &r->x, &r->y);
    turned(r->turn_cos, r->turn_sin, &r->px, &r->py);
    r->x *= r->decay, r->y *= r->decay, r->px *= r->decay, r->py *= r->decay;
    expect(fabs(out.dac_x) <= s->dac_limit_v && fabs(out.dac_y) <= s->dac_limit_v, "a command within its limit");
    return out;
}

// The loops at the envelope around a readout of 3 % ratio and a drive of 2 %, with the calibrator joined to them: turned by
// hand after a minute at rest. No line of it knows the ratio; what is learned, and what is kept over a night, has to be it.
static void self_calibration(void) {
    cvg_calibrator calibrator;
    cvg_learned learned;
    cvg_calibrator_settings s = cvg_calibrator_settings_default(), wrong = s;
    wrong.steps = 40;
    expect(cvg_calibrator_init(&calibrator, &learned, &wrong).parameter_length > 0, "a cycle of 40 steps is refused");
    expect(cvg_calibrator_init(&calibrator, &learned, NULL).parameter_length > 0, "no settings are refused");
    expect(cvg_calibrator_init(&calibrator, &learned, &s).parameter_length == 0, "the settings are taken");
    const double dt = s.control_s, split = 1.5;
    double x = 1, y = 0, xq = 0, yq = 0, energy = -0.05 / 16, quadrature = 0, phase = 0, c = 1, n = 0;
    for (long k = 0; k < 240000; k++) {
        const double rate = k > 140000 && k < 160000 ? 1.0 : 0.0;
        const cvg_four read = {(float)x, (float)xq, (float)(1.03 * y), (float)(1.03 * yq)};
        const cvg_four e = cvg_calibrator_readout(&calibrator, &learned, read);
        const double E = e.x_c * e.x_c + e.x_s * e.x_s + e.y_c * e.y_c + e.y_s * e.y_s;
        const double Q = 2 * (e.x_c * e.y_s - e.y_c * e.x_s), R = e.x_c * e.x_c + e.x_s * e.x_s - e.y_c * e.y_c - e.y_s * e.y_s;
        const double S = 2 * (e.x_c * e.y_c + e.x_s * e.y_s);
        const double theta = 0.5 * atan2(S, R), sign = cos(theta) * c + sin(theta) * n < 0 ? -1 : 1;
        c = sign * cos(theta), n = sign * sin(theta);
        const double u = e.x_c * c + e.y_c * n, uq = e.x_s * c + e.y_s * n, L = 2 * u * uq;
        const cvg_added add = cvg_calibrator_forward(&calibrator, &learned, (float)c, (float)n, 1.0f);
        energy += (E - 1) * dt, quadrature += Q * dt, phase += L * 200 * dt;
        const cvg_control control = {.energy = (float)E, .quadrature = (float)Q, .r = (float)R, .s = (float)S, .l = (float)L,
            .cos = (float)c, .sin = (float)n, .v_as = (float)(8 * (E - 1 + 2 * energy)), .v_qs = add.v_qs,
            .v_qc = (float)(-8 * (Q + 2 * quadrature)) + add.v_qc, .disturbed = false};
        const double ahead = 40 * L + phase - add.detuning_rad_s;
        const cvg_four wanted = {(float)(-control.v_qc * n), (float)(control.v_as * c - control.v_qs * n),
            (float)(control.v_qc * c), (float)(control.v_as * n + control.v_qs * c)};
        const cvg_four f = cvg_calibrator_drives(&calibrator, &learned, wanted);
        cvg_calibrator_step(&calibrator, &learned, &control);
        // X' = k Omega Y - X/tau - F_s - i(F_c + split X/2 - ahead X), X = x - i xq; two steps of the midpoint rule
        const double at[4] = {x, xq, y, yq};
        for (int half = 2; half >= 1; half--) {
            const double h = dt / half, a = 0.5 * split;
            const double dx = 0.8 * rate * y - 0.05 * x - f.x_s + (a - ahead) * -xq, dxq = 0.8 * rate * yq - 0.05 * xq + f.x_c + (a - ahead) * x;
            const double dy = -0.8 * rate * x - 0.05 * y - 1.02 * f.y_s + (-a - ahead) * -yq;
            const double dyq = -0.8 * rate * xq - 0.05 * yq + 1.02 * f.y_c + (-a - ahead) * y;
            x = at[0] + h * dx, xq = at[1] + h * dxq, y = at[2] + h * dy, yq = at[3] + h * dyq;
        }
    }
    const cvg_known known = cvg_calibrator_known(&calibrator, &learned);
    printf("learned a ratio of %.5f, %.0e\n", known.ratio, known.ratio_sigma);
    expect(known.learned && known.detection_known && fabs(known.ratio - 0.03) < 1e-3, "the ratio is learned");
    unsigned char record[CVG_RECORD_BYTES];
    expect(cvg_calibrator_save(&calibrator, &learned, record), "it is saved");
    cvg_learned other;
    cvg_calibrator_init(&calibrator, &other, &s);
    record[100] ^= 1;
    expect(cvg_calibrator_restore(&calibrator, &other, record) == CVG_RECORD_DAMAGED, "a damaged record is refused");
    record[100] ^= 1;
    expect(cvg_calibrator_restore(&calibrator, &other, record) == CVG_RECORD_RESTORED, "a whole one is restored");
    const cvg_four x_alone = {1, 0, 0, 0}, y_alone = {0, 0, 1.03f, 0};
    const double along_x = cvg_calibrator_readout(&calibrator, &other, x_alone).x_c;
    expect(fabs(cvg_calibrator_readout(&calibrator, &other, y_alone).y_c / along_x - 1) < 2e-3, "and compensates");
    expect(cvg_calibrator_readout(NULL, &other, y_alone).y_c == 1.03f, "null is answered");
}

int main(void) {
    cvg_instrument instrument;
    cvg_state state;
    cvg_settings s = cvg_settings_default();

    // what is refused, by name
    cvg_settings wrong = s;
    wrong.window = 2;
    cvg_refusal why = cvg_init(&instrument, &state, &wrong);
    expect(why.parameter_length > 0 && why.expected_length > 0, "a window of two samples is refused");
    why = cvg_init(&instrument, &state, NULL);
    expect(why.parameter_length == strlen("settings") && !strncmp(why.parameter, "settings", why.parameter_length),
           "no settings are refused");
    const cvg_effect unknown = {"no-such-effect", {0}};
    wrong = s, wrong.readout = &unknown, wrong.readout_count = 1;
    expect(cvg_init(&instrument, &state, &wrong).parameter_length > 0, "an unknown effect is refused");
    expect(cvg_step(NULL, &state, 1, 1).dac_x == 0 && cvg_step(&instrument, NULL, 1, 1).mode == CVG_FAULT, "null is answered");

    // undoing a gain of one changes nothing, and takes the way of compensation
    const cvg_effect gain = {"detection-gain-mismatch", {1.0}};
    s.readout = &gain, s.readout_count = 1;
    why = cvg_init(&instrument, &state, &s);
    expect(why.parameter_length == 0, "the settings are taken");

    resonator r = made(&s, s.carrier_hz * 1.004, 100.0);
    cvg_output out = {0};
    long reached = 0;
    for (long k = 0; k < 300000 && out.mode != CVG_WHOLE_ANGLE; k++, reached = k) out = sample(&s, &instrument, &state, &r, false);
    expect(out.mode == CVG_WHOLE_ANGLE && out.fault == CVG_NO_FAULT, "from rest into whole-angle mode");
    for (long k = 0; k < 150000; k++) out = sample(&s, &instrument, &state, &r, false);
    const double before = cvg_angle_deg(&state);
    for (long k = 0; k < 100000; k++) out = sample(&s, &instrument, &state, &r, false);
    const double rate = cvg_angle_deg(&state) - before;
    cvg_seen seen = cvg_last_control(&state);
    printf("whole angle after %.2f s, energy %.4f, quadrature %.5f, %.3f deg/s\n", reached / s.sample_hz, seen.energy,
           seen.quadrature, rate);
    expect(fabs(seen.energy - 1) < 0.01 && fabs(seen.quadrature) < 0.01, "the amplitude and the line are held");
    expect(fabs(rate + 78.0) < 0.1, "the pattern precesses at -k times the rate");

    out = sample(&s, &instrument, &state, &r, true);
    for (long k = 0; k < 5000; k++) out = sample(&s, &instrument, &state, &r, false);
    expect(out.mode == CVG_WHOLE_ANGLE, "back after a reading that is no number");

    expect(!cvg_request(&state, 17) && cvg_request(&state, CVG_REQUEST_HOLD), "a request is taken, no other");
    for (long k = 0; k < 200000; k++) out = sample(&s, &instrument, &state, &r, false);
    printf("held at %.3f deg\n", cvg_angle_deg(&state));
    expect(out.mode == CVG_HOLD && fabs(remainder(cvg_angle_deg(&state), 180.0)) < 1.0, "held");
    self_calibration();
    return failures != 0;
}
