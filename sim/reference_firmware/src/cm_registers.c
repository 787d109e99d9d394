/* Register access: everything a request asks for, or nothing and the Modbus exception that says why. */
#include <math.h>
#include <string.h>

#include "cm_drive.h"

cm_answer cm_read(cm_drive *drive, uint16_t address, uint16_t count, uint16_t *words)
{
    if (count == 0 || count > CM_LONGEST_READ)
        return CM_BAD_VALUE;
    if (!cm_is_mapped(address, count))
        return CM_NO_SUCH_ADDRESS;
    if (address == CM_WINDOW)
        cm_build_window(drive, count);
    else if (address < CM_WINDOW || address >= CM_WINDOW + CM_WINDOW_WORDS)
        cm_refresh(drive);
    memcpy(words, &drive->image[address], count * sizeof *words);
    return CM_OK;
}

static bool is_allowed(const cm_item *item, const uint16_t *words)
{
    float value;
    if (item->kind == CM_U32)
        return true;
    value = item->kind == CM_F32 ? cm_get_f32(words) : (float)words[0];
    if (item->address == CM_WATCHDOG_MS && value > 0.0f && value < 100.0f)
        return false;
    return isfinite(value) && value >= item->low && value <= item->high;
}

/* How many of the words belong to the item from `address` on, or 0 and the reason in `answer`. */
static uint16_t examine(const cm_drive *drive, uint16_t address, uint16_t count, const uint16_t *words, cm_answer *answer)
{
    const cm_item *item = address < CM_IMAGE_WORDS ? cm_find_item(address) : 0;
    *answer = CM_NO_SUCH_ADDRESS;
    if (!item || !(item->flags & CM_WRITABLE))
        return 0;
    uint16_t each = cm_words_each(item), skip = (uint16_t)(address - item->address);
    if (skip % each || count < each)
        return 0; /* a number is never written by half */
    uint16_t left = (uint16_t)(cm_words(item) - skip);
    uint16_t used = (uint16_t)(left <= count ? left : count - count % each);
    *answer = CM_BUSY;
    if ((item->flags & CM_NEEDS_STOP) && drive->state == CM_ENABLED)
        return 0;
    *answer = CM_BAD_VALUE;
    for (uint16_t k = 0; k < used; k = (uint16_t)(k + each))
        if (!is_allowed(item, &words[k]))
            return 0;
    if (item->address == CM_OWNER_TOKEN && !cm_admits(drive, cm_get_u32(words)))
        return 0; /* somebody else holds the drive */
    *answer = CM_OK;
    return used;
}

static void act(cm_drive *drive, const cm_item *item)
{
    uint16_t word = drive->image[item->address];
    if (item->address == CM_HEARTBEAT)
        cm_feed(drive, word);
    else if (item->address == CM_OWNER_TOKEN)
        cm_renew_claim(drive);
    else if (item->address == CM_MODE && word != 1 && drive->state == CM_ENABLED)
        cm_leave(drive, CM_SWITCH_ON_DISABLED);
    else if (item->address == CM_COMMIT && word == CM_COMMIT_WORD)
        cm_begin_commit(drive);
    else if (item->address == CM_STORE && word == CM_STORE_WORD)
        cm_begin_store(drive);
    else if (item->address >= CM_DC_BIAS && item->address <= CM_SCALE_RAMP)
        cm_take_live(drive);
}

cm_answer cm_write(cm_drive *drive, uint16_t address, uint16_t count, const uint16_t *words)
{
    cm_answer answer = CM_OK;
    if (count == 0 || count > CM_LONGEST_WRITE)
        return CM_BAD_VALUE;
    for (uint32_t k = 0; k < count;) {
        if ((uint32_t)address + k > 0xFFFF)
            return CM_NO_SUCH_ADDRESS;
        uint16_t used = examine(drive, (uint16_t)(address + k), (uint16_t)(count - k), &words[k], &answer);
        if (!used)
            return answer;
        k += used;
    }
    cm_count_change(drive, address, count, words);
    memcpy(&drive->image[address], words, count * sizeof *words);
    for (int k = 0; k < cm_item_count; k++) {
        const cm_item *item = &cm_items[k];
        if ((item->flags & CM_ACTS) && item->address >= address && item->address < address + count
            && item->address != CM_CONTROL_WORD)
            act(drive, item);
    }
    if (address <= CM_CONTROL_WORD && address + count > CM_CONTROL_WORD) /* last: it may energise what came with it */
        cm_control(drive, drive->image[CM_CONTROL_WORD]);
    return CM_OK;
}
