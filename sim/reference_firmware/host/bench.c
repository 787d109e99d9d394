/* Power stage and sensors around the motor. */
#include "bench.h"

#include <math.h>
#include <string.h>

#include "cm_port.h"

#define HALF_SQRT3 0.86602540378443864676
#define PI 3.14159265358979323846
#define NOMINAL_LINK_V 540.0
#define DEAD_TIME_V (2.4e-6 * 5000.0 * NOMINAL_LINK_V) /* mean of a leg: dead time x switching frequency x link */
#define DEVICE_V 1.1
#define DEVICE_OHM 0.03
#define KNEE_A 0.13
#define CONTROL_PERIOD_S 2.0e-4
#define STEPS_PER_PERIOD 8

static const double sensor_gain[3] = {1.002, 0.999, 0.998};
static const double sensor_offset_a[3] = {-0.020, 0.015, 0.022};
static const double sensor_noise_a = 0.010;

bench the_bench;

void bench_start(uint64_t seed, const char *memory_file)
{
    memset(&the_bench, 0, sizeof the_bench);
    the_bench.random = seed * 2862933555777941757u + 3037000493u;
    the_bench.interlocks = 31;
    the_bench.memory_file = memory_file;
}

/* xorshift64*, Vigna 2016 (arXiv 1402.6246): uniform in [0, 1). */
static double uniform(void)
{
    uint64_t x = the_bench.random ? the_bench.random : 1;
    x ^= x >> 12;
    x ^= x << 25;
    x ^= x >> 27;
    the_bench.random = x;
    return (double)((x * 2685821657736338717u) >> 11) / 9007199254740992.0;
}

/* Marsaglia's polar method. */
static double normal(void)
{
    double u, v, s;
    do {
        u = 2.0 * uniform() - 1.0;
        v = 2.0 * uniform() - 1.0;
        s = u * u + v * v;
    } while (s >= 1.0 || s == 0.0);
    return u * sqrt(-2.0 * log(s) / s);
}

/* Mean voltage a leg loses: the error saturates beyond the knee; a threshold and a slope of the devices add to it. */
static double leg_loss(double i)
{
    double z = i / KNEE_A, sign = z / cbrt(1.0 + fabs(z * z * z));
    return (DEAD_TIME_V + DEVICE_V) * sign + DEVICE_OHM * i;
}

static double phase(vector i, int number)
{
    return number == 0 ? i.a : -0.5 * i.a + (number == 1 ? HALF_SQRT3 : -HALF_SQRT3) * i.b;
}

static double link_v(void)
{
    return NOMINAL_LINK_V * (1.0 + 0.004 * sin(2.0 * PI * 300.0 * the_bench.time_s));
}

/* What arrives at the terminals: the command, with the link's ripple in it, less what the three legs lose. */
static vector terminals(vector i, void *context)
{
    const double *command = context;
    double u = leg_loss(phase(i, 0)), v = leg_loss(phase(i, 1)), w = leg_loss(phase(i, 2));
    vector volts = {command[0] - (2.0 * u - v - w) / 3.0, command[1] - (v - w) / (2.0 * HALF_SQRT3)};
    return volts;
}

void bench_advance_period(void)
{
    double ripple = link_v() / NOMINAL_LINK_V;
    double command[2] = {ripple * the_bench.axis_voltage[0], ripple * the_bench.axis_voltage[1]};
    motor_run(&motor_of_this_bench, &the_bench.motor, CONTROL_PERIOD_S, STEPS_PER_PERIOD, terminals, command);
    the_bench.time_s += CONTROL_PERIOD_S;
}

void bench_coast(double seconds)
{
    motor_coast(&motor_of_this_bench, &the_bench.motor, seconds);
    the_bench.time_s += seconds;
}

/* --- the port layer: measurements and power stage --- */

static const cm_ratings ratings = {
    .drive_type = "SIM-INV-7A", .firmware_version = 0x00010300, .serial_number = 20260101,
    .rated_current_a = 7.0f, .control_period_s = (float)CONTROL_PERIOD_S, .switching_frequency_hz = 5000.0f,
    .current_scale_a = 30.0f / 65536.0f, /* a 12-bit converter over -15 ... 15 A, left-aligned in 16 bits */
    .current_full_scale_a = 15.0f, .hardware_current_limit_a = 14.0f,
    .voltage_scale_v = 0.01f, .largest_voltage_v = 300.0f, .dc_link_scale_v = 0.02f,
    .dc_link_min_v = 480.0f, .dc_link_max_v = 640.0f, .heatsink_max_degc = 85.0f, .winding_max_degc = 120.0f,
    .default_parameters = {3.0f, 1.9f, 25.0f, 190.0f},
    .rated_power_w = 2200.0f, .rated_voltage_v = 400.0f, .rated_frequency_hz = 50.0f, .rated_motor_current_a = 5.0f,
    .rated_speed_rpm = 1436.0f, .power_factor = 0.80f, .pole_pairs = 2,
};

const cm_ratings *cm_port_ratings(void)
{
    return &ratings;
}

void cm_port_output(bool on)
{
    if (the_bench.is_on && !on)
        bench_coast(1e-3); /* the diodes take the current down against the link voltage */
    the_bench.is_on = on;
    the_bench.axis_voltage[0] = the_bench.axis_voltage[1] = 0.0;
}

void cm_port_apply_voltage(float alpha_v, float beta_v)
{
    the_bench.axis_voltage[0] = (double)alpha_v;
    the_bench.axis_voltage[1] = (double)beta_v;
}

void cm_port_currents(int16_t counts[3])
{
    vector i = stator_current(&motor_of_this_bench, &the_bench.motor);
    for (int k = 0; k < 3; k++) {
        double seen = sensor_gain[k] * phase(i, k) + sensor_offset_a[k] + sensor_noise_a * normal();
        double code = floor(seen / 30.0 * 4096.0 + 0.5);
        code = code > 2047.0 ? 2047.0 : (code < -2047.0 ? -2047.0 : code);
        counts[k] = (int16_t)(16.0 * code);
    }
}

float cm_port_dc_link_v(void)
{
    return (float)link_v();
}

float cm_port_heatsink_degc(void)
{
    return 31.0f;
}

float cm_port_winding_degc(void)
{
    return 23.0f + (float)(the_bench.motor.warmth / 0.00393);
}

float cm_port_shaft_speed_rad_per_s(void)
{
    return 0.0f;
}

uint16_t cm_port_interlocks(void)
{
    return the_bench.interlocks;
}

uint16_t cm_port_hardware_trip(void)
{
    return the_bench.hardware_trip;
}

void cm_port_lock(void) {} /* one thread */
void cm_port_unlock(void) {}

/* --- the answer key --- */

/* Inverse-Gamma set at a main flux: k = L_m/L_r; R_R = k^2 R_r, L_M = k L_m, L_sigma = L_ls + k L_lr. Secant values. */
static void print_row(FILE *out, double main_flux_wb)
{
    const motor_data *m = &motor_of_this_bench;
    double i_m = magnetizing_current(m, main_flux_wb), l_m = main_flux_wb / i_m, k = l_m / (l_m + m->rotor_leakage_h);
    fprintf(out,
        "{\"stator_flux_wb\": %.9g, \"secant\": {\"rotor_resistance_ohm\": %.9g, \"leakage_inductance_h\": %.9g, "
        "\"magnetizing_inductance_h\": %.9g}}",
        main_flux_wb + m->stator_leakage_h * i_m, k * k * m->rotor_resistance_ohm, m->stator_leakage_h + k * m->rotor_leakage_h,
        k * l_m);
}

void bench_print_truth(FILE *out)
{
    fprintf(out, "{\"apparent_stator_resistance_ohm\": %.9g, \"peak_stator_flux_wb\": %.9g, \"leg_error_v\": %.9g, ",
        motor_of_this_bench.stator_resistance_ohm + DEVICE_OHM, the_bench.motor.peak_stator_flux, DEAD_TIME_V + DEVICE_V);
    fprintf(out, "\"inverse_gamma\": {\"over_flux\": [");
    for (int k = 1; k <= 60; k++) {
        print_row(out, 0.02 * k);
        fprintf(out, k < 60 ? ", " : "]}}\n");
    }
    fflush(out);
}
