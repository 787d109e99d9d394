#include "motor.h"

#include <math.h>

const motor_data motor_of_this_bench = {
    .stator_resistance_ohm = 3.45, .rotor_resistance_ohm = 2.40,
    .stator_leakage_h = 0.0105, .rotor_leakage_h = 0.0125,
    .linear_inductance_h = 0.300, .knee_current_a = 0.0035, .knee_flux_wb = 0.160,
    .warming_per_a2s = 2.0e-5,
};

double magnetizing_current(const motor_data *data, double main_flux)
{
    return main_flux / data->linear_inductance_h + data->knee_current_a * sinh(main_flux / data->knee_flux_wb);
}

static double magnetizing_slope(const motor_data *data, double main_flux)
{
    return 1.0 / data->linear_inductance_h + data->knee_current_a / data->knee_flux_wb * cosh(main_flux / data->knee_flux_wb);
}

/* The main flux at which psi * stiffness + i_m(psi) = drive: both sides rise, Newton from the last answer. */
static double solve_main_flux(const motor_data *data, double stiffness, double drive, double start)
{
    double flux = start;
    for (int k = 0; k < 40; k++) {
        double miss = flux * stiffness + magnetizing_current(data, flux) - drive;
        double step = miss / (stiffness + magnetizing_slope(data, flux));
        flux -= step;
        if (fabs(step) < 1e-12)
            break;
    }
    return flux;
}

static vector main_flux(const motor_data *data, motor *state)
{
    vector c = {
        state->stator_flux.a / data->stator_leakage_h + state->rotor_flux.a / data->rotor_leakage_h,
        state->stator_flux.b / data->stator_leakage_h + state->rotor_flux.b / data->rotor_leakage_h,
    };
    double size = hypot(c.a, c.b), stiffness = 1.0 / data->stator_leakage_h + 1.0 / data->rotor_leakage_h;
    state->main_flux = solve_main_flux(data, stiffness, size, state->main_flux);
    double share = size > 0.0 ? state->main_flux / size : 0.0;
    vector flux = {share * c.a, share * c.b};
    return flux;
}

static vector per(vector flux, vector main_part, double inductance_h)
{
    vector current = {(flux.a - main_part.a) / inductance_h, (flux.b - main_part.b) / inductance_h};
    return current;
}

vector stator_current(const motor_data *data, motor *state)
{
    return per(state->stator_flux, main_flux(data, state), data->stator_leakage_h);
}

typedef struct { vector stator, rotor; } slope;

static slope slopes(const motor_data *data, motor *state, terminal_voltage voltage, void *context)
{
    double warm = 1.0 + state->warmth;
    vector middle = main_flux(data, state);
    vector i_s = per(state->stator_flux, middle, data->stator_leakage_h);
    vector i_r = per(state->rotor_flux, middle, data->rotor_leakage_h);
    vector u = voltage(i_s, context);
    slope found = {
        {u.a - data->stator_resistance_ohm * warm * i_s.a, u.b - data->stator_resistance_ohm * warm * i_s.b},
        {-data->rotor_resistance_ohm * warm * i_r.a, -data->rotor_resistance_ohm * warm * i_r.b},
    };
    return found;
}

static motor ahead(const motor *from, slope along, double h)
{
    motor state = *from;
    state.stator_flux.a += h * along.stator.a;
    state.stator_flux.b += h * along.stator.b;
    state.rotor_flux.a += h * along.rotor.a;
    state.rotor_flux.b += h * along.rotor.b;
    return state;
}

static void keep_peaks(const motor_data *data, motor *state)
{
    vector i = stator_current(data, state);
    state->peak_stator_flux = fmax(state->peak_stator_flux, hypot(state->stator_flux.a, state->stator_flux.b));
    state->peak_current = fmax(state->peak_current, hypot(i.a, i.b));
}

void motor_run(const motor_data *data, motor *state, double seconds, int steps, terminal_voltage voltage, void *context)
{
    double h = seconds / steps;
    for (int k = 0; k < steps; k++) {
        slope first = slopes(data, state, voltage, context);
        motor third_way = ahead(state, first, h / 3.0);
        slope second = slopes(data, &third_way, voltage, context);
        motor two_thirds = ahead(state, second, 2.0 * h / 3.0);
        slope third = slopes(data, &two_thirds, voltage, context);
        slope mean = {
            {0.25 * first.stator.a + 0.75 * third.stator.a, 0.25 * first.stator.b + 0.75 * third.stator.b},
            {0.25 * first.rotor.a + 0.75 * third.rotor.a, 0.25 * first.rotor.b + 0.75 * third.rotor.b},
        };
        *state = ahead(state, mean, h);
    }
    keep_peaks(data, state);
    vector i = stator_current(data, state);
    state->warmth += data->warming_per_a2s * (i.a * i.a + i.b * i.b) * seconds;
}

/* How fast the main flux falls while the rotor alone carries it: psi_r = psi_m + L_lr i_m(psi_m), d psi_r/dt = -R_r i_m. */
static double decay(const motor_data *data, double main_flux, double resistance_ohm)
{
    return -resistance_ohm * magnetizing_current(data, main_flux)
        / (1.0 + data->rotor_leakage_h * magnetizing_slope(data, main_flux));
}

void motor_coast(const motor_data *data, motor *state, double seconds)
{
    double size = hypot(state->rotor_flux.a, state->rotor_flux.b), left = seconds;
    double along_a = size > 0.0 ? state->rotor_flux.a / size : 1.0, along_b = size > 0.0 ? state->rotor_flux.b / size : 0.0;
    double resistance_ohm = data->rotor_resistance_ohm * (1.0 + state->warmth);
    double flux = solve_main_flux(data, 1.0 / data->rotor_leakage_h, size / data->rotor_leakage_h, size);
    while (left > 0.0 && flux > 1e-9) {
        double h = fmin(left, 2e-3), middle = flux + 0.5 * h * decay(data, flux, resistance_ohm);
        flux += h * decay(data, middle, resistance_ohm);
        left -= h;
    }
    /* without current of its own the stator sees the main flux */
    double rotor_flux = flux + data->rotor_leakage_h * magnetizing_current(data, flux);
    state->rotor_flux.a = rotor_flux * along_a;
    state->rotor_flux.b = rotor_flux * along_b;
    state->main_flux = flux;
    state->stator_flux.a = flux * along_a;
    state->stator_flux.b = flux * along_b;
}
