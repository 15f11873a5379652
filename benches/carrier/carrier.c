// The loop at the carrier as one writes it in C: resonator, plates, converters, demodulator, loops, drives. The arithmetic is
// that of the Rust crates in whole-angle mode, sample by sample; what C leaves out is start-up and faults, of which it
// keeps the tests that every window makes.

#include <math.h>
#include <stdbool.h>

typedef struct {
    double free[4][4], before[2][4], after[2][4]; // columns
    double gain[2], inverse_gap_2, late_cos, late_sin;
    double adc_range, adc_step, dac_range, dac_step;
    double clip, centre_cos, centre_sin, period, correction_limit;
    double energy_gain, energy_time, quadrature_gain, quadrature_time, window_s, limit;
    double phase_gain, phase_integral, set_2, lead, share, jump, least_2;
    double delay_cos, delay_sin, delay, dac_limit;
    int samples;
} config;

typedef struct {
    double z[4], out[2];
    double c, s, step_c, step_s;
    double xc, xs, yc, ys, sx, sy, start_c, start_s;
    double fxc, fxs, fyc, fys;
    double energy, quadrature, detuning;
    double cos_2, sin_2, per_window, print[4];
    int count, half_turns, invalid, clipped, bad;
} state;

static inline double bounded(double v, double limit) { return v > limit ? limit : v < -limit ? -limit : v; }

static inline double convert(double v, double range, double step, double per_step) {
    const double round = 6755399441055744.0;
    v = v < -range ? -range : v > range ? range : v;
    return ((v * per_step + round) - round) * step;
}

static inline double plates(double x, double gain, double inverse_gap_2) {
    double closed = x * x * inverse_gap_2;
    return closed < 0.9025 ? gain * x / (1.0 - closed) : gain * copysign(0.95 / sqrt(inverse_gap_2), x) / (1.0 - 0.9025);
}

static inline double pi(double *integral, double gain, double time, double period, double limit, double e) {
    double sum = *integral + period * e;
    double asked = gain * (e + sum / (2.0 * time));
    double most = 2.0 * time * limit / gain;
    if (asked >= -limit && asked <= limit && sum >= -most && sum <= most) {
        *integral = sum;
        return asked;
    }
    return bounded(asked, limit);
}

static __attribute__((noinline)) void control(const config *k, state *s) {
    // the window's least-squares fit
    double n = k->samples, c0 = s->start_c, s0 = s->start_s, c1 = s->c, s1 = s->s, cw = s->step_c, sw = s->step_s;
    double cosecant = 1.0 / sw, cot = cw * cosecant, cot_half = cot + cosecant;
    double dc = c1 - c0, ds = s1 - s0, sum_c = cot_half * ds - dc, sum_s = -(cot_half * dc + ds);
    double d2c = s1 * s1 - s0 * s0, d2s = c1 * s1 - c0 * s0, sum_2c = d2c + cot * d2s, sum_2s = cot * d2c - d2s;
    double per_two = 0.5 / n, mean_c = sum_c * per_two, mean_s = sum_s * per_two;
    double cc = n + sum_2c - sum_c * mean_c, ss = n - sum_2c - sum_s * mean_s;
    double cs = sum_2s - sum_c * mean_s, inverse = 2.0 / (cc * ss - cs * cs);
    double ic = cc * inverse, is = ss * inverse, ix = cs * inverse;
    double a = s->xc - s->sx * mean_c, b = s->xs - s->sx * mean_s;
    double xc = is * a - ix * b, xs = ic * b - ix * a;
    a = s->yc - s->sy * mean_c, b = s->ys - s->sy * mean_s;
    double yc = is * a - ix * b, ys = ic * b - ix * a;

    double x2 = xc * xc + xs * xs, y2 = yc * yc + ys * ys;
    double e = x2 + y2, q = 2.0 * (xc * ys - yc * xs), r = x2 - y2, t = 2.0 * (xc * yc + ys * xs), l = 2.0 * (xc * xs + yc * ys);

    double line = sqrt(r * r + t * t), scale = 1.0 / line;
    double cos_2 = r * scale, sin_2 = t * scale;
    double across = sin_2 * s->cos_2 - cos_2 * s->sin_2, along = cos_2 * s->cos_2 + sin_2 * s->sin_2;
    if (cos_2 + s->cos_2 < 0.0) {
        if (s->sin_2 >= 0.0 && sin_2 < 0.0) s->half_turns++;
        else if (s->sin_2 < 0.0 && sin_2 >= 0.0) s->half_turns--;
    }
    s->cos_2 = cos_2, s->sin_2 = sin_2;
    bool steady = line > k->least_2 && along > 0.0 && fabs(across) <= k->jump;
    if (steady) s->per_window += k->share * (across - s->per_window);

    bool repeats = (s->sx == s->print[0] && xc == s->print[2]) || (s->sy == s->print[1] && yc == s->print[3]);
    s->print[0] = s->sx, s->print[1] = s->sy, s->print[2] = xc, s->print[3] = yc;
    bool well = steady && !repeats && !s->invalid && !s->clipped && e > 0.25 * k->set_2 && e < 2.25 * k->set_2
        && fabs(q) < 0.5 * e && fabs(l) < 0.5 * e;
    double correction = s->detuning;
    if (!well) {
        s->bad++;
        s->fxc = s->fxs = s->fyc = s->fys = 0.0;
    } else {
        double v_as = pi(&s->energy, k->energy_gain, k->energy_time, k->window_s, k->limit, e - k->set_2);
        double v_qc = -pi(&s->quadrature, k->quadrature_gain, k->quadrature_time, k->window_s, k->limit, q);
        double error = -(0.5 * l / e);
        s->detuning = bounded(s->detuning + k->phase_integral * error, k->correction_limit);
        correction = bounded(k->phase_gain * error + s->detuning, k->correction_limit);
        double wide = 1.0 + fabs(cos_2), dir_c = cos_2 < 0.0 ? sin_2 : wide, dir_s = cos_2 < 0.0 ? wide : sin_2;
        double in_phase = dir_c * xc + dir_s * yc;
        double unit = 1.0 / sqrt(wide * wide + sin_2 * sin_2);
        if (in_phase < 0.0) unit = -unit;
        dir_c *= unit, dir_s *= unit;
        double psi = 0.5 * s->per_window * k->lead, length = 1.0 - 0.5 * psi * psi;
        double cos = dir_c * length - dir_s * psi, sin = dir_s * length + dir_c * psi;
        double f_xc = bounded(-v_qc * sin, k->limit), f_xs = bounded(v_as * cos, k->limit);
        double f_yc = bounded(v_qc * cos, k->limit), f_ys = bounded(v_as * sin, k->limit);
        double more = correction * k->delay;
        double dcos = k->delay_cos - k->delay_sin * more, dsin = k->delay_sin + k->delay_cos * more;
        s->fxc = f_xc * dcos + f_xs * dsin, s->fxs = f_xs * dcos - f_xc * dsin;
        s->fyc = f_yc * dcos + f_ys * dsin, s->fys = f_ys * dcos - f_yc * dsin;
    }
    double u = correction * k->period, u2 = u * u;
    double du_s = u * (1.0 - u2 * (1.0 / 6.0 - u2 * (1.0 / 120.0)));
    double du_c = 1.0 - u2 * (0.5 - u2 * (1.0 / 24.0 - u2 * (1.0 / 720.0)));
    s->step_c = k->centre_cos * du_c - k->centre_sin * du_s;
    s->step_s = k->centre_sin * du_c + k->centre_cos * du_s;
    double norm = 1.5 - 0.5 * (s->c * s->c + s->s * s->s);
    s->c *= norm, s->s *= norm;
    s->start_c = s->c, s->start_s = s->s;
    s->xc = s->xs = s->yc = s->ys = s->sx = s->sy = 0.0;
    s->count = s->invalid = s->clipped = 0;
}

void carrier_run(const config *k, state *s, long samples) {
    double adc_per = 1.0 / k->adc_step, dac_per = 1.0 / k->dac_step;
    for (long i = 0; i < samples; i++) {
        const double *z = s->z;
        double x = plates(k->late_cos * z[0] - k->late_sin * z[2], k->gain[0], k->inverse_gap_2);
        double y = plates(k->late_cos * z[1] - k->late_sin * z[3], k->gain[1], k->inverse_gap_2);
        x = convert(x, k->adc_range, k->adc_step, adc_per);
        y = convert(y, k->adc_range, k->adc_step, adc_per);
        if (!(fabs(x) < k->clip && fabs(y) < k->clip)) s->clipped++;
        double c = s->c, n = s->s;
        s->xc += x * c, s->xs += x * n, s->yc += y * c, s->ys += y * n, s->sx += x, s->sy += y;
        s->c = c * s->step_c - n * s->step_s;
        s->s = n * s->step_c + c * s->step_s;
        if (++s->count >= k->samples) control(k, s);
        double ox = convert(bounded(s->fxc * c + s->fxs * n, k->dac_limit), k->dac_range, k->dac_step, dac_per);
        double oy = convert(bounded(s->fyc * c + s->fys * n, k->dac_limit), k->dac_range, k->dac_step, dac_per);
        double next[4];
        for (int j = 0; j < 4; j++) {
            double free = (k->free[0][j] * z[0] + k->free[1][j] * z[1]) + (k->free[2][j] * z[2] + k->free[3][j] * z[3]);
            double first = k->before[0][j] * s->out[0] + k->before[1][j] * s->out[1];
            double second = k->after[0][j] * ox + k->after[1][j] * oy;
            next[j] = free + (first + second);
        }
        for (int j = 0; j < 4; j++) s->z[j] = next[j];
        s->out[0] = ox, s->out[1] = oy;
    }
}
