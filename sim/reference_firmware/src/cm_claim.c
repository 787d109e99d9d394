/* Who is master of the drive, and how many of its settings were changed: what one master has to know of another. */
#include "cm_drive.h"

/* Whole seconds until the claim ends by itself; 0 = nobody holds the drive. */
static uint16_t left_s(const cm_drive *drive)
{
    uint32_t elapsed_ms = cm_port_milliseconds() - drive->claimed_at_ms;
    uint32_t timeout_ms = 1000u * drive->image[CM_OWNER_TIMEOUT];
    if (cm_get_u32(&drive->image[CM_OWNER_TOKEN]) == 0 || elapsed_ms >= timeout_ms)
        return 0;
    return (uint16_t)((timeout_ms - elapsed_ms + 999u) / 1000u);
}

bool cm_admits(const cm_drive *drive, uint32_t token)
{
    return token == 0 || token == cm_get_u32(&drive->image[CM_OWNER_TOKEN]) || left_s(drive) == 0;
}

void cm_renew_claim(cm_drive *drive)
{
    drive->claimed_at_ms = cm_port_milliseconds();
}

void cm_refresh_claim(cm_drive *drive)
{
    uint16_t left = left_s(drive);
    if (left == 0)
        cm_put_u32(&drive->image[CM_OWNER_TOKEN], 0);
    drive->image[CM_OWNER_LEFT] = left;
    drive->image[CM_SETTINGS_COUNT] = drive->settings_count;
}

static bool is_setting(uint16_t address)
{
    return !(address == CM_ECHO || address == CM_HEARTBEAT || address == CM_COMMIT || address == CM_STORE
             || (address >= CM_WINDOW_INDEX && address < CM_WINDOW_INDEX + 2)
             || (address >= CM_OWNER_TOKEN && address < CM_OWNER_LEFT));
}

void cm_count_change(cm_drive *drive, uint16_t address, uint16_t count, const uint16_t *words)
{
    for (uint16_t k = 0; k < count; k++) {
        uint16_t at = (uint16_t)(address + k);
        if (is_setting(at) && drive->image[at] != words[k]) {
            drive->settings_count++;
            return;
        }
    }
}
