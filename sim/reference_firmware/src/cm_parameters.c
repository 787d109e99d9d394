/* Motor parameters: staged, committed into use, stored for good. Wire units: ohm, ohm, mH, mH. */
#include <math.h>
#include <string.h>

#include "cm_drive.h"

static const float lowest[CM_PARAMETERS] = {1e-3f, 1e-3f, 1e-3f, 1e-2f};
static const float highest[CM_PARAMETERS] = {1e3f, 1e3f, 1e3f, 1e4f};

static uint16_t check_sum(const cm_memory *memory)
{
    uint16_t words[2 * CM_PARAMETERS + 4];
    for (int k = 0; k < CM_PARAMETERS; k++)
        cm_put_f32(&words[2 * k], memory->parameters[k]);
    cm_put_u32(&words[2 * CM_PARAMETERS], memory->store_count);
    cm_put_u32(&words[2 * CM_PARAMETERS + 2], memory->power_ups);
    return cm_crc16(0xFFFF, words, 2 * CM_PARAMETERS + 4);
}

static bool save(cm_memory *memory)
{
    memory->check_sum = check_sum(memory);
    return cm_port_memory_write(memory);
}

void cm_load_parameters(cm_drive *drive)
{
    cm_memory *memory = &drive->memory;
    cm_memory_answer answer = cm_port_memory_read(memory);
    bool is_intact = answer == CM_MEMORY_BLANK || (answer == CM_MEMORY_READ && memory->check_sum == check_sum(memory));
    if (answer != CM_MEMORY_READ || !is_intact) {
        memset(memory, 0, sizeof *memory);
        memcpy(memory->parameters, cm_port_ratings()->default_parameters, sizeof memory->parameters);
    }
    if (is_intact) {
        memory->power_ups++;
        save(memory);
    } else {
        cm_trip(drive, CM_TRIP_MEMORY, 0.0f, 0.0f);
    }
    for (int k = 0; k < CM_PARAMETERS; k++) {
        cm_put_f32(&drive->image[CM_IN_USE + 2 * k], memory->parameters[k]);
        cm_put_f32(&drive->image[CM_STAGED + 2 * k], memory->parameters[k]);
    }
}

void cm_begin_commit(cm_drive *drive)
{
    drive->commit_result = CM_WORKING;
}

void cm_begin_store(cm_drive *drive)
{
    drive->store_result = CM_WORKING;
}

static uint16_t judge_staged(const cm_drive *drive)
{
    const uint16_t *staged = &drive->image[CM_STAGED];
    if (cm_crc16(0xFFFF, staged, 2 * CM_PARAMETERS) != drive->image[CM_STAGED_CRC])
        return CM_WRONG_CHECK_SUM;
    for (int k = 0; k < CM_PARAMETERS; k++) {
        float value = cm_get_f32(&staged[2 * k]);
        if (!(value >= lowest[k] && value <= highest[k]))
            return CM_OUT_OF_RANGE;
    }
    return CM_DONE;
}

static void finish_commit(cm_drive *drive)
{
    uint16_t result = drive->state == CM_ENABLED ? CM_NOT_STOPPED : judge_staged(drive);
    if (result == CM_DONE) {
        cm_count_change(drive, CM_IN_USE, 2 * CM_PARAMETERS, &drive->image[CM_STAGED]);
        memcpy(&drive->image[CM_IN_USE], &drive->image[CM_STAGED], 2 * CM_PARAMETERS * sizeof(uint16_t));
    }
    drive->image[CM_COMMIT] = 0;
    drive->commit_result = result;
}

static void finish_store(cm_drive *drive)
{
    cm_memory next = drive->memory;
    uint16_t result = CM_NOT_STOPPED;
    if (drive->state != CM_ENABLED) {
        for (int k = 0; k < CM_PARAMETERS; k++)
            next.parameters[k] = cm_get_f32(&drive->image[CM_IN_USE + 2 * k]);
        next.store_count++;
        result = save(&next) ? CM_DONE : CM_STORE_FAILED;
    }
    if (result == CM_DONE) {
        if (memcmp(next.parameters, drive->memory.parameters, sizeof next.parameters) != 0)
            drive->settings_count++;
        drive->memory = next;
    }
    drive->image[CM_STORE] = 0;
    drive->store_result = result;
}

void cm_finish_parameters(cm_drive *drive)
{
    if (drive->commit_result == CM_WORKING)
        finish_commit(drive);
    if (drive->store_result == CM_WORKING)
        finish_store(drive);
}
