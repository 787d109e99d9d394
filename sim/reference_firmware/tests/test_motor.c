#include <math.h>

#include "testing.h"

void test_motor(void);

static vector fixed_voltage(vector current, void *context)
{
    (void)current;
    return *(vector *)context;
}

static void a_direct_current_is_voltage_over_resistance(void)
{
    motor_data data = motor_of_this_bench;
    motor state = {0};
    vector volts = {7.0, -3.0};
    data.warming_per_a2s = 0.0;
    motor_run(&data, &state, 5.0, 200000, fixed_voltage, &volts);
    vector i = stator_current(&data, &state);
    CHECK(NEAR(i.a, 7.0 / data.stator_resistance_ohm, 1e-6) && NEAR(i.b, -3.0 / data.stator_resistance_ohm, 1e-6));
    double flux = hypot(state.rotor_flux.a, state.rotor_flux.b);
    CHECK(NEAR(magnetizing_current(&data, flux), hypot(i.a, i.b), 1e-6)); /* the rotor carries none: its flux is the main flux */
}

static void a_step_meets_the_leakage_first(void)
{
    motor_data data = motor_of_this_bench;
    motor state = {0};
    vector volts = {10.0, 0.0};
    double l_m = data.linear_inductance_h, l_r = l_m + data.rotor_leakage_h;
    l_m = 1.0 / (1.0 / l_m + data.knee_current_a / data.knee_flux_wb);
    l_r = l_m + data.rotor_leakage_h;
    double leakage = data.stator_leakage_h + l_m * data.rotor_leakage_h / l_r;
    motor_run(&data, &state, 1e-6, 1, fixed_voltage, &volts);
    CHECK(NEAR(stator_current(&data, &state).a, 10.0 * 1e-6 / leakage, 1e-7));
}

static void an_open_stator_leaves_the_rotor_to_its_time_constant(void)
{
    motor_data data = motor_of_this_bench;
    motor state = {0};
    data.knee_current_a = 0.0; /* linear: the closed form is an exponential */
    state.rotor_flux.a = 0.8;
    double l_r = data.linear_inductance_h + data.rotor_leakage_h;
    motor_coast(&data, &state, 0.1);
    double wanted = 0.8 * exp(-0.1 * data.rotor_resistance_ohm / l_r);
    CHECK(NEAR(state.rotor_flux.a, wanted, 1e-4));
    CHECK(NEAR(stator_current(&data, &state).a, 0.0, 1e-9));
}

void test_motor(void)
{
    a_direct_current_is_voltage_over_resistance();
    a_step_meets_the_leakage_first();
    an_open_stator_leaves_the_rotor_to_its_time_constant();
}
