/* CiA 402 states, what must hold before the output goes on, supervision, and the control interrupt. */
#include <math.h>
#include <string.h>

#include "cm_drive.h"

enum { ENABLE_VOLTAGE = 0x02, QUICK_STOP_OFF = 0x04, RESET_FAULT = 0x80 };

void cm_power_up(cm_drive *drive)
{
    memset(drive, 0, sizeof *drive);
    cm_port_output(false);
    drive->state = CM_SWITCH_ON_DISABLED;
    drive->ring.has_ended = true;
    drive->image[CM_CHANNEL_MASK] = 15;
    drive->image[CM_DECIMATION] = 1;
    cm_put_f32(&drive->image[CM_BIAS_RAMP], 20.0f);
    cm_put_f32(&drive->image[CM_SCALE_RAMP], 1.0f);
    drive->ring.mask = 15;
    drive->ring.decimation = 1;
    cm_load_parameters(drive);
    drive->session = (uint16_t)(drive->memory.power_ups * 1009u & 0x7FFFu);
}

/* The one place where the output is blocked. */
static void block(cm_drive *drive)
{
    cm_port_output(false);
    drive->ring.has_ended = true;
}

void cm_leave(cm_drive *drive, cm_state state)
{
    cm_port_lock();
    if (drive->fault == CM_TRIP_NONE) { /* a trip of the interrupt is not undone by a command that came with it */
        if (drive->state == CM_ENABLED)
            block(drive);
        drive->state = state;
    }
    cm_port_unlock();
}

void cm_trip(cm_drive *drive, uint16_t cause, float value, float limit)
{
    cm_port_lock();
    cm_leave(drive, CM_FAULT);
    drive->fault = drive->trip_cause = cause;
    drive->trip_value = value;
    drive->trip_limit = limit;
    cm_port_unlock();
}

void cm_feed(cm_drive *drive, uint16_t heartbeat)
{
    if (heartbeat == drive->heartbeat_echo)
        return;
    drive->heartbeat_echo = heartbeat;
    drive->fed_at_ms = cm_port_milliseconds();
    cm_renew_claim(drive);
}

static bool is_too_hot(void)
{
    const cm_ratings *ratings = cm_port_ratings();
    return cm_port_heatsink_degc() > ratings->heatsink_max_degc || cm_port_winding_degc() > ratings->winding_max_degc;
}

bool cm_may_enable(const cm_drive *drive)
{
    const cm_ratings *ratings = cm_port_ratings();
    float link_v = cm_port_dc_link_v();
    return drive->image[CM_MODE] == 1
        && drive->image[CM_WATCHDOG_MS] >= 100
        && cm_port_interlocks() == CM_INTERLOCK_ALL
        && cm_port_hardware_trip() == CM_TRIP_NONE
        && link_v >= ratings->dc_link_min_v && link_v <= ratings->dc_link_max_v
        && cm_get_f32(&drive->image[CM_CURRENT_LIMIT]) > 0.0f
        && cm_get_f32(&drive->image[CM_TEST_TIME_LIMIT]) > 0.0f
        && cm_get_f32(&drive->image[CM_VOLTAGE_LIMIT]) > 0.0f
        && cm_get_f32(&drive->image[CM_DURATION]) > 0.0f
        && !is_too_hot();
}

static void enable(cm_drive *drive)
{
    if (!cm_may_enable(drive))
        return;
    drive->session++;
    drive->trip_cause = CM_TRIP_NONE;
    drive->trip_value = drive->trip_limit = 0.0f;
    drive->trip_current_a = fminf(cm_get_f32(&drive->image[CM_CURRENT_LIMIT]), cm_port_ratings()->hardware_current_limit_a);
    drive->largest_current_a = 0.0f;
    cm_start_ring(drive);
    cm_latch_excitation(drive);
    drive->fed_at_ms = cm_port_milliseconds();
    cm_port_output(true);
    drive->state = CM_ENABLED;
}

void cm_control(cm_drive *drive, uint16_t word)
{
    bool is_reset_edge = (word & RESET_FAULT) && !(drive->last_control & RESET_FAULT);
    drive->last_control = word;
    if (drive->state == CM_FAULT) {
        if (is_reset_edge && cm_port_hardware_trip() == CM_TRIP_NONE) {
            drive->fault = CM_TRIP_NONE;
            cm_leave(drive, CM_SWITCH_ON_DISABLED);
        }
        return;
    }
    if (!(word & ENABLE_VOLTAGE) || !(word & QUICK_STOP_OFF))
        cm_leave(drive, CM_SWITCH_ON_DISABLED);
    else if ((word & 0x07) == 0x06)
        cm_leave(drive, CM_READY);
    else if (drive->state == CM_SWITCH_ON_DISABLED)
        return;
    else if ((word & 0x0F) == 0x07)
        cm_leave(drive, CM_SWITCHED_ON);
    else if ((word & 0x0F) == 0x0F && drive->state != CM_ENABLED) {
        cm_leave(drive, CM_SWITCHED_ON);
        enable(drive);
    }
}

/* Whatever must end the test although nobody asks: called from the interrupt and from the background. */
static void supervise(cm_drive *drive)
{
    const cm_ratings *ratings = cm_port_ratings();
    uint32_t silent_ms = cm_port_milliseconds() - drive->fed_at_ms;
    uint16_t watchdog_ms = drive->image[CM_WATCHDOG_MS], hardware = cm_port_hardware_trip();
    if (drive->state != CM_ENABLED)
        return;
    if (hardware)
        cm_trip(drive, hardware, 0.0f, 0.0f);
    else if (!(cm_port_interlocks() & CM_INTERLOCK_STO))
        cm_trip(drive, CM_TRIP_STO, 0.0f, 0.0f);
    else if (silent_ms > watchdog_ms)
        cm_trip(drive, CM_TRIP_WATCHDOG, (float)silent_ms, (float)watchdog_ms);
    else if (cm_port_dc_link_v() < ratings->dc_link_min_v)
        cm_trip(drive, CM_TRIP_UNDERVOLTAGE, cm_port_dc_link_v(), ratings->dc_link_min_v);
    else if (cm_port_heatsink_degc() > ratings->heatsink_max_degc)
        cm_trip(drive, CM_TRIP_HEATSINK, cm_port_heatsink_degc(), ratings->heatsink_max_degc);
    else if (cm_port_winding_degc() > ratings->winding_max_degc)
        cm_trip(drive, CM_TRIP_WINDING, cm_port_winding_degc(), ratings->winding_max_degc);
}

/* The axis voltage on the PWM's grid, within the limit; in counts. */
static int16_t on_grid(float volts, float limit_v, uint8_t *flags)
{
    float grid_v = cm_port_ratings()->voltage_scale_v;
    float kept = volts > limit_v ? limit_v : (volts < -limit_v ? -limit_v : volts);
    if (kept != volts)
        *flags |= CM_FLAG_CLAMPED;
    return (int16_t)floorf(kept / grid_v + 0.5f);
}

static float largest_current_a(const int16_t counts[3], uint8_t *flags)
{
    const cm_ratings *ratings = cm_port_ratings();
    float largest_a = 0.0f;
    for (int phase = 0; phase < 3; phase++)
        largest_a = fmaxf(largest_a, fabsf((float)counts[phase]) * ratings->current_scale_a);
    if (largest_a >= ratings->current_full_scale_a - 16.5f * ratings->current_scale_a)
        *flags |= CM_FLAG_CLIPPED;
    return largest_a;
}

void cm_control_interrupt(cm_drive *drive)
{
    cm_excitation *e = &drive->excitation;
    int16_t currents[3], voltage;
    uint8_t flags = 0;
    float volts = 0.0f;
    if (drive->state != CM_ENABLED)
        return;
    supervise(drive);
    if (drive->state != CM_ENABLED)
        return;
    if (e->period >= e->time_limit_period) {
        float limit_s = (float)e->time_limit_period * cm_port_ratings()->control_period_s;
        cm_trip(drive, CM_TRIP_TIME_LIMIT, limit_s, limit_s);
        return;
    }
    if (!cm_next_voltage(e, &volts)) {
        cm_leave(drive, CM_SWITCH_ON_DISABLED);
        return;
    }
    cm_port_currents(currents);
    drive->largest_current_a = largest_current_a(currents, &flags);
    voltage = on_grid(volts, e->limit_v, &flags);
    cm_add_sample(&drive->ring, voltage, currents, flags);
    if (drive->largest_current_a > drive->trip_current_a) {
        cm_trip(drive, CM_TRIP_OVERCURRENT, drive->largest_current_a, drive->trip_current_a);
        return;
    }
    volts = (float)voltage * cm_port_ratings()->voltage_scale_v;
    cm_port_apply_voltage(volts * e->cos_axis, volts * e->sin_axis);
}

void cm_background(cm_drive *drive)
{
    supervise(drive);
    cm_finish_parameters(drive);
}
