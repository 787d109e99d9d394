/* Signal generator at control rate: ramped DC bias, ramped scale, up to eight tones. */
#include <math.h>

#include "cm_drive.h"

#define TURNS 4294967296.0
#define BILLION 1.0e9f
#define RADIANS_PER_TURN 6.28318530717958647692

/* `value` of a unit as a count of 1e-9, kept where sums of two still fit. */
static int64_t billionths(float value)
{
    const float most = 4.0e9f;
    float kept = value > most ? most : (value < -most ? -most : value);
    return (int64_t)(kept * BILLION);
}

static int64_t larger(int64_t a, int64_t b)
{
    return a > b ? a : b;
}

/* A part of a turn as a count of 2^-32 turns; only the fraction matters. */
static uint32_t as_turn(double turns)
{
    double part = turns - floor(turns);
    return (uint32_t)(uint64_t)(part * TURNS + 0.5);
}

static uint32_t periods(float seconds, float period_s)
{
    double count = ceil((double)seconds / (double)period_s * (1.0 - 1.0e-6)); /* two floats are no nearer than that */
    return count > 4.0e9 ? 4000000000u : (uint32_t)count;
}

void cm_take_live(cm_drive *drive)
{
    cm_excitation *e = &drive->excitation;
    float period_s = cm_port_ratings()->control_period_s;
    float bias_v = cm_get_f32(&drive->image[CM_DC_BIAS]), scale = cm_get_f32(&drive->image[CM_AMPLITUDE_SCALE]);
    int64_t bias_step = billionths(cm_get_f32(&drive->image[CM_BIAS_RAMP]) * period_s);
    int64_t scale_step = billionths(cm_get_f32(&drive->image[CM_SCALE_RAMP]) * period_s);
    cm_port_lock();
    e->bias_target = billionths(bias_v);
    e->scale_target = billionths(scale);
    e->bias_step = bias_step;
    e->scale_step = scale_step;
    /* at the end of the test both are gone within half a second, however slow the ramps are */
    e->bias_last_step = larger(bias_step, billionths(2.0f * fabsf(bias_v) * period_s));
    e->scale_last_step = larger(scale_step, billionths(2.0f * period_s));
    cm_port_unlock();
}

void cm_latch_excitation(cm_drive *drive)
{
    cm_excitation *e = &drive->excitation;
    const cm_ratings *ratings = cm_port_ratings();
    double axis_rad = (double)cm_get_f32(&drive->image[CM_AXIS_DEG]) / 360.0;
    axis_rad = (axis_rad - floor(axis_rad)) * RADIANS_PER_TURN;
    e->cos_axis = (float)cos(axis_rad);
    e->sin_axis = (float)sin(axis_rad);
    e->limit_v = fminf(cm_get_f32(&drive->image[CM_VOLTAGE_LIMIT]), ratings->largest_voltage_v);
    e->last_period = periods(cm_get_f32(&drive->image[CM_DURATION]), ratings->control_period_s);
    e->time_limit_period = periods(cm_get_f32(&drive->image[CM_TEST_TIME_LIMIT]), ratings->control_period_s);
    e->tones = drive->image[CM_TONE_COUNT];
    for (int k = 0; k < CM_TONE_LIMIT; k++) {
        const uint16_t *tone = &drive->image[CM_TONES + 6 * k];
        e->amplitude_v[k] = cm_get_f32(tone);
        e->turn_step[k] = as_turn((double)cm_get_f32(tone + 2) * (double)ratings->control_period_s);
        e->turn[k] = as_turn((double)cm_get_f32(tone + 4) / RADIANS_PER_TURN);
    }
    e->period = 0;
    e->bias = e->scale = 0;
    cm_take_live(drive);
}

static int64_t towards(int64_t value, int64_t target, int64_t step)
{
    if (value < target)
        return target - value > step ? value + step : target;
    return value - target > step ? value - step : target;
}

static float tones_now(cm_excitation *e)
{
    float sum = 0.0f;
    for (int k = 0; k < e->tones; k++) {
        float angle = (float)(int32_t)e->turn[k] * (float)(RADIANS_PER_TURN / TURNS);
        sum += e->amplitude_v[k] * cosf(angle);
        e->turn[k] += e->turn_step[k];
    }
    return sum;
}

bool cm_next_voltage(cm_excitation *e, float *volts)
{
    bool is_over = e->period >= e->last_period;
    e->bias = towards(e->bias, is_over ? 0 : e->bias_target, is_over ? e->bias_last_step : e->bias_step);
    e->scale = towards(e->scale, is_over ? 0 : e->scale_target, is_over ? e->scale_last_step : e->scale_step);
    if (is_over && e->bias == 0 && e->scale == 0)
        return false;
    *volts = (float)e->bias / BILLION + (float)e->scale / BILLION * tones_now(e);
    e->period++;
    return true;
}
