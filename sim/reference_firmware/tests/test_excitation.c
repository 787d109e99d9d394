#include <math.h>

#include "testing.h"

#define PERIOD 2e-4
#define TWO_PI 6.28318530717958647692

void test_excitation(void);

/* Samples of the session are the command; the closed form is computed here in double precision. */
static double sample_v(uint32_t index)
{
    return 0.01 * drive.ring.sample[index % CM_RING_SAMPLES][0];
}

static void tones_and_ramps_are_the_formulas(void)
{
    static const float tone[8][3] = {{3, 1, 0.1f}, {2, 7.5f, 1}, {1, 33, -2}, {0.5f, 80, 3}, {1.5f, 121.7f, 0}, {1, 250, 0.5f}, {0.7f, 400, 2}, {2, 12.3f, 5}};
    double worst = 0.0;
    fresh_drive();
    prepare();
    write_word(CM_TONE_COUNT, 8);
    for (int k = 0; k < 24; k++)
        write_f32((uint16_t)(CM_TONES + 2 * k), tone[k / 3][k % 3]);
    CHECK(switch_on());
    run_periods(4000);
    for (uint32_t n = 0; n < 4000; n++) {
        double t = n * PERIOD, sum = 0.0, bias = fmin(5.0, 100.0 * (t + PERIOD)), scale = fmin(1.0, 10.0 * (t + PERIOD));
        for (int k = 0; k < 8; k++)
            sum += (double)tone[k][0] * cos(TWO_PI * (double)tone[k][1] * t + (double)tone[k][2]);
        worst = fmax(worst, fabs(sample_v(n) - bias - scale * sum));
    }
    CHECK(worst < 0.012);
}

static void a_live_target_is_reached_at_its_ramp(void)
{
    fresh_drive();
    prepare();
    write_word(CM_TONE_COUNT, 0);
    write_f32(CM_DURATION, 10.0f);
    CHECK(switch_on());
    run_periods(1000);
    CHECK(NEAR(sample_v(999), 5.0, 0.01) && NEAR(read_f32(CM_PRESENT_BIAS), 5.0f, 1e-5f));
    write_f32(CM_DC_BIAS, 3.0f);
    run_periods(50);
    CHECK(NEAR(sample_v(1049), 4.0, 0.011));
    run_periods(100);
    CHECK(NEAR(sample_v(1149), 3.0, 0.011));
}

static void after_its_duration_the_test_ramps_down_and_ends_without_a_fault(void)
{
    fresh_drive();
    prepare();
    write_f32(CM_DURATION, 0.2f);
    CHECK(switch_on());
    unsigned lasted = run_to_end(20000);
    CHECK(lasted >= 1000 && lasted <= 1000 + 2600);
    CHECK(drive.state == CM_SWITCH_ON_DISABLED && drive.fault == CM_TRIP_NONE && !the_bench.is_on);
    CHECK(fabs(sample_v(drive.ring.produced - 1)) < 0.1);
}

static void the_limit_clamps_and_says_so(void)
{
    fresh_drive();
    prepare();
    write_f32(CM_VOLTAGE_LIMIT, 6.0f);
    CHECK(switch_on());
    run_periods(1000);
    for (uint32_t n = 0; n < 1000; n++) {
        CHECK(fabs(sample_v(n)) <= 6.0);
        CHECK(!(drive.ring.flags[n] & CM_FLAG_CLAMPED) || NEAR(fabs(sample_v(n)), 6.0, 0.006));
    }
    CHECK(drive.ring.flags[900 + 50] & CM_FLAG_CLAMPED || drive.ring.flags[999] & CM_FLAG_CLAMPED);
}

static void the_axis_turns_the_voltage(void)
{
    fresh_drive();
    prepare();
    write_f32(CM_AXIS_DEG, 480.0f); /* 120 */
    write_word(CM_TONE_COUNT, 0);
    CHECK(switch_on());
    run_periods(1000);
    CHECK(NEAR(the_bench.axis_voltage[0], 5.0 * -0.5, 1e-4) && NEAR(the_bench.axis_voltage[1], 5.0 * 0.866025, 1e-4));
}

static void hours_of_a_slow_ramp_do_not_stick(void)
{
    cm_excitation e = {.last_period = 4000000000u};
    float volts = 0.0f;
    e.bias_target = 100000000000; /* 100 V at 1 mV/s: 200 nV a period, far below what a float of 50 V resolves */
    e.bias_step = 200;
    for (int k = 0; k < 1000000; k++)
        cm_next_voltage(&e, &volts);
    CHECK(NEAR(volts, 0.2f, 1e-6f));
}

void test_excitation(void)
{
    tones_and_ramps_are_the_formulas();
    a_live_target_is_reached_at_its_ramp();
    after_its_duration_the_test_ramps_down_and_ends_without_a_fault();
    the_limit_clamps_and_says_so();
    the_axis_turns_the_voltage();
    hours_of_a_slow_ramp_do_not_stick();
}
