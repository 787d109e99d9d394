/* What the drive says about itself: the read-only registers, refreshed when somebody reads. */
#include <string.h>

#include "cm_drive.h"

static void put_text(uint16_t *at, const char *text, int words)
{
    bool has_ended = false;
    for (int k = 0; k < 2 * words; k++) {
        has_ended = has_ended || text[k] == 0;
        uint16_t character = has_ended ? 0 : (uint8_t)text[k];
        at[k / 2] = (uint16_t)(k % 2 ? at[k / 2] | character : character << 8);
    }
}

static void refresh_identity(uint16_t *image)
{
    const cm_ratings *r = cm_port_ratings();
    cm_put_u32(&image[CM_MAGIC], CM_MAGIC_VALUE);
    image[CM_MAP_VERSION] = 1;
    cm_put_u32(&image[CM_FIRMWARE_VERSION], r->firmware_version);
    cm_put_u32(&image[CM_SERIAL_NUMBER], r->serial_number);
    put_text(&image[CM_DRIVE_TYPE], r->drive_type, 8);
    cm_put_f32(&image[CM_RATED_DRIVE_CURRENT], r->rated_current_a);
    cm_put_u32(&image[CM_CONTROL_PERIOD], (uint32_t)(r->control_period_s * 1.0e9f + 0.5f));
    cm_put_f32(&image[CM_SWITCHING_FREQUENCY], r->switching_frequency_hz);
    cm_put_f32(&image[CM_CURRENT_SCALE], r->current_scale_a);
    cm_put_f32(&image[CM_VOLTAGE_SCALE], r->voltage_scale_v);
    cm_put_f32(&image[CM_DC_LINK_SCALE], r->dc_link_scale_v);
    cm_put_u32(&image[CM_RING_CAPACITY], CM_RING_SAMPLES);
    cm_put_f32(&image[CM_CURRENT_FULL_SCALE], r->current_full_scale_a);
    cm_put_f32(&image[CM_RATED_POWER], r->rated_power_w);
    cm_put_f32(&image[CM_RATED_VOLTAGE], r->rated_voltage_v);
    cm_put_f32(&image[CM_RATED_FREQUENCY], r->rated_frequency_hz);
    cm_put_f32(&image[CM_RATED_CURRENT], r->rated_motor_current_a);
    cm_put_f32(&image[CM_RATED_SPEED], r->rated_speed_rpm);
    cm_put_f32(&image[CM_POWER_FACTOR], r->power_factor);
    image[CM_POLE_PAIRS] = r->pole_pairs;
}

static uint16_t status_word(const cm_drive *drive)
{
    uint16_t word = (uint16_t)drive->state;
    if (drive->state == CM_READY || drive->state == CM_SWITCHED_ON || drive->state == CM_ENABLED)
        word |= CM_STATUS_VOLTAGE;
    if (cm_port_interlocks() & CM_INTERLOCK_REMOTE)
        word |= CM_STATUS_REMOTE;
    return word;
}

static void refresh_test(const cm_drive *drive, uint16_t *image)
{
    const cm_excitation *e = &drive->excitation;
    bool is_on = drive->state == CM_ENABLED;
    float left = is_on && e->time_limit_period > e->period ? (float)(e->time_limit_period - e->period) : 0.0f;
    cm_put_f32(&image[CM_CURRENT_MAGNITUDE], is_on ? drive->largest_current_a : 0.0f);
    cm_put_f32(&image[CM_PRESENT_SCALE], is_on ? (float)e->scale / 1.0e9f : 0.0f);
    cm_put_f32(&image[CM_PRESENT_BIAS], is_on ? (float)e->bias / 1.0e9f : 0.0f);
    cm_put_f32(&image[CM_TEST_TIME_LEFT], left * cm_port_ratings()->control_period_s);
    cm_put_u32(&image[CM_SAMPLES_PRODUCED], drive->ring.produced);
    image[CM_OVERRUNS] = (uint16_t)(drive->ring.overruns > 0xFFFF ? 0xFFFF : drive->ring.overruns);
}

static void refresh_parameters(const cm_drive *drive, uint16_t *image)
{
    image[CM_COMMIT_RESULT] = drive->commit_result;
    image[CM_STORE_RESULT] = drive->store_result;
    cm_put_u32(&image[CM_STORE_COUNT], drive->memory.store_count);
    for (int k = 0; k < CM_PARAMETERS; k++)
        cm_put_f32(&image[CM_STORED + 2 * k], drive->memory.parameters[k]);
}

void cm_refresh(cm_drive *drive)
{
    uint16_t *image = drive->image;
    cm_port_lock();
    refresh_identity(image);
    image[CM_STATUS_WORD] = status_word(drive);
    image[CM_FAULT_CODE] = drive->fault;
    image[CM_TRIP_CAUSE] = drive->trip_cause;
    cm_put_f32(&image[CM_TRIP_VALUE], drive->trip_value);
    cm_put_f32(&image[CM_TRIP_LIMIT], drive->trip_limit);
    image[CM_HEARTBEAT_ECHO] = drive->heartbeat_echo;
    image[CM_SESSION_ID] = drive->session;
    image[CM_INTERLOCKS] = cm_port_interlocks();
    cm_put_f32(&image[CM_DC_LINK], cm_port_dc_link_v());
    cm_put_f32(&image[CM_HEATSINK], cm_port_heatsink_degc());
    cm_put_f32(&image[CM_WINDING], cm_port_winding_degc());
    cm_put_f32(&image[CM_SHAFT_SPEED], cm_port_shaft_speed_rad_per_s());
    cm_refresh_claim(drive);
    refresh_test(drive, image);
    refresh_parameters(drive, image);
    cm_port_unlock();
}
