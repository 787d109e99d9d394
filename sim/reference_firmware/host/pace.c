#include "pace.h"

#include "bench.h"

#define STEP_ENERGISED_S 1e-3
#define STEP_OFF_S 1e-2

static double speed, started_s;

void pace_start(double wanted_speed)
{
    speed = wanted_speed;
    started_s = wall_seconds();
    the_bench.runs_on_motor_time = speed > 0.0;
}

static void advance_period(cm_drive *drive)
{
    cm_control_interrupt(drive);
    if (the_bench.is_on)
        bench_advance_period();
}

static void advance_to(cm_drive *drive, double until_s)
{
    double period_s = (double)cm_port_ratings()->control_period_s;
    while (drive->state == CM_ENABLED && the_bench.time_s + 0.5 * period_s < until_s)
        advance_period(drive);
    if (drive->state != CM_ENABLED && the_bench.time_s < until_s)
        bench_coast(until_s - the_bench.time_s);
}

void pace_keep(cm_drive *drive)
{
    if (speed > 0.0)
        advance_to(drive, (wall_seconds() - started_s) * speed);
    cm_background(drive);
}

void pace_request(cm_drive *drive, uint16_t reads_window)
{
    if (speed > 0.0) {
        pace_keep(drive);
        return;
    }
    if (reads_window == 0)
        advance_to(drive, the_bench.time_s + (drive->state == CM_ENABLED ? STEP_ENERGISED_S : STEP_OFF_S));
    else {
        uint32_t mask = drive->ring.mask, channels = 0, wanted = cm_get_u32(&drive->image[CM_WINDOW_INDEX]);
        for (; mask; mask >>= 1)
            channels += mask & 1;
        uint32_t most = drive->ring.produced + CM_RING_SAMPLES;
        wanted = wanted < most ? wanted : most;
        wanted += reads_window > CM_WINDOW_HEADER && channels ? (reads_window - CM_WINDOW_HEADER) / channels : 0;
        while (drive->state == CM_ENABLED && drive->ring.produced < wanted && drive->ring.produced < most)
            advance_period(drive);
    }
    cm_background(drive);
}
