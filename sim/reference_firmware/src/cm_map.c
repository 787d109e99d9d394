/* The item table, and words to and from numbers. */
#include "cm_map.h"

#include <string.h>

#define ANY 3.4e38f
#define RO(address, kind, length) {address, kind, length, 0, 0.0f, 0.0f}
#define RW(address, kind, length, low, high) {address, kind, length, CM_WRITABLE, low, high}
#define ACT(address, kind, low, high) {address, kind, 1, CM_WRITABLE | CM_ACTS, low, high}
#define STOP(address, kind, length, low, high) {address, kind, length, CM_WRITABLE | CM_NEEDS_STOP, low, high}
#define STOP_ACT(address, kind, low, high) {address, kind, 1, CM_WRITABLE | CM_NEEDS_STOP | CM_ACTS, low, high}

const cm_item cm_items[] = {
    RO(CM_MAGIC, CM_U32, 1), RO(CM_MAP_VERSION, CM_U16, 1), RO(CM_FIRMWARE_VERSION, CM_U32, 1),
    RO(CM_SERIAL_NUMBER, CM_U32, 1), RO(CM_DRIVE_TYPE, CM_ASCII, 8), RO(CM_RATED_DRIVE_CURRENT, CM_F32, 1),
    RO(CM_CONTROL_PERIOD, CM_U32, 1), RO(CM_SWITCHING_FREQUENCY, CM_F32, 1), RW(CM_ECHO, CM_U16, 1, 0, 65535),

    ACT(CM_CONTROL_WORD, CM_U16, 0, 65535), ACT(CM_MODE, CM_U16, 0, 1), ACT(CM_HEARTBEAT, CM_U16, 0, 65535),
    RW(CM_WINDOW_INDEX, CM_U32, 1, 0, ANY),

    RO(CM_STATUS_WORD, CM_U16, 1), RO(CM_FAULT_CODE, CM_U16, 1), RO(CM_TRIP_CAUSE, CM_U16, 1),
    RO(CM_TRIP_VALUE, CM_F32, 1), RO(CM_TRIP_LIMIT, CM_F32, 1), RO(CM_HEARTBEAT_ECHO, CM_U16, 1),
    RO(CM_SESSION_ID, CM_U16, 1), RO(CM_INTERLOCKS, CM_U16, 1), RO(CM_DC_LINK, CM_F32, 1),
    RO(CM_HEATSINK, CM_F32, 1), RO(CM_WINDING, CM_F32, 1), RO(CM_SHAFT_SPEED, CM_F32, 1),
    RO(CM_CURRENT_MAGNITUDE, CM_F32, 1), RO(CM_PRESENT_SCALE, CM_F32, 1), RO(CM_SAMPLES_PRODUCED, CM_U32, 1),
    RO(CM_OVERRUNS, CM_U16, 1), RO(CM_TEST_TIME_LEFT, CM_F32, 1), RO(CM_PRESENT_BIAS, CM_F32, 1),
    RO(CM_SETTINGS_COUNT, CM_U16, 1),

    ACT(CM_OWNER_TOKEN, CM_U32, 0, ANY), RW(CM_OWNER_TIMEOUT, CM_U16, 1, 0, 600),
    RW(CM_OWNER_NAME, CM_ASCII, 12, 0, 65535), RO(CM_OWNER_LEFT, CM_U16, 1),

    STOP(CM_WATCHDOG_MS, CM_U16, 1, 0, 2000), STOP(CM_CURRENT_LIMIT, CM_F32, 1, 0, ANY),
    STOP(CM_TEST_TIME_LIMIT, CM_F32, 1, 0, ANY), STOP(CM_VOLTAGE_LIMIT, CM_F32, 1, 0, ANY),

    STOP(CM_AXIS_DEG, CM_F32, 1, -ANY, ANY), ACT(CM_DC_BIAS, CM_F32, -ANY, ANY), ACT(CM_BIAS_RAMP, CM_F32, 0, ANY),
    ACT(CM_AMPLITUDE_SCALE, CM_F32, 0, 1), ACT(CM_SCALE_RAMP, CM_F32, 0, ANY), STOP(CM_DURATION, CM_F32, 1, 0, ANY),
    STOP(CM_TONE_COUNT, CM_U16, 1, 0, CM_TONE_LIMIT), STOP(CM_TONES, CM_F32, 24, -ANY, ANY),
    STOP(CM_CHANNEL_MASK, CM_U16, 1, 1, 15), STOP(CM_DECIMATION, CM_U16, 1, 1, 100),

    RO(CM_CURRENT_SCALE, CM_F32, 1), RO(CM_VOLTAGE_SCALE, CM_F32, 1), RO(CM_DC_LINK_SCALE, CM_F32, 1),
    RO(CM_RING_CAPACITY, CM_U32, 1), RO(CM_CURRENT_FULL_SCALE, CM_F32, 1),

    RO(CM_WINDOW, CM_WINDOW_BLOCK, CM_WINDOW_WORDS),

    RO(CM_RATED_POWER, CM_F32, 1), RO(CM_RATED_VOLTAGE, CM_F32, 1), RO(CM_RATED_FREQUENCY, CM_F32, 1),
    RO(CM_RATED_CURRENT, CM_F32, 1), RO(CM_RATED_SPEED, CM_F32, 1), RO(CM_POWER_FACTOR, CM_F32, 1),
    RO(CM_POLE_PAIRS, CM_U16, 1),

    RO(CM_IN_USE, CM_F32, 1), RO(CM_IN_USE + 2, CM_F32, 1), RO(CM_IN_USE + 4, CM_F32, 1),
    RO(CM_IN_USE + 6, CM_F32, 1),
    STOP(CM_STAGED, CM_F32, 1, -ANY, ANY), STOP(CM_STAGED + 2, CM_F32, 1, -ANY, ANY),
    STOP(CM_STAGED + 4, CM_F32, 1, -ANY, ANY), STOP(CM_STAGED + 6, CM_F32, 1, -ANY, ANY),
    STOP(CM_STAGED_CRC, CM_U16, 1, 0, 65535), STOP_ACT(CM_COMMIT, CM_U16, 0, 65535),
    STOP_ACT(CM_STORE, CM_U16, 0, 65535), RO(CM_COMMIT_RESULT, CM_U16, 1), RO(CM_STORE_RESULT, CM_U16, 1),
    RO(CM_STORE_COUNT, CM_U32, 1),
    RO(CM_STORED, CM_F32, 1), RO(CM_STORED + 2, CM_F32, 1), RO(CM_STORED + 4, CM_F32, 1),
    RO(CM_STORED + 6, CM_F32, 1),
};
const int cm_item_count = (int)(sizeof cm_items / sizeof cm_items[0]);

uint16_t cm_words_each(const cm_item *item)
{
    return item->kind == CM_U32 || item->kind == CM_F32 ? 2 : 1;
}

uint16_t cm_words(const cm_item *item)
{
    return (uint16_t)(item->length * cm_words_each(item));
}

const cm_item *cm_find_item(uint16_t address)
{
    int low = 0, high = cm_item_count - 1;
    while (low <= high) {
        int middle = (low + high) / 2;
        const cm_item *item = &cm_items[middle];
        if (address < item->address)
            high = middle - 1;
        else if (address >= item->address + cm_words(item))
            low = middle + 1;
        else
            return item;
    }
    return 0;
}

bool cm_is_mapped(uint16_t address, uint16_t count)
{
    uint32_t at = address, end = (uint32_t)address + count;
    while (at < end) {
        const cm_item *item = at < CM_IMAGE_WORDS ? cm_find_item((uint16_t)at) : 0;
        if (!item)
            return false;
        at = (uint32_t)item->address + cm_words(item);
    }
    return true;
}

uint16_t cm_crc16(uint16_t crc, const uint16_t *words, uint16_t count)
{
    for (uint16_t k = 0; k < count; k++) {
        for (int shift = 8; shift >= 0; shift -= 8) {
            crc ^= (uint16_t)(words[k] >> shift & 0xFF);
            for (int bit = 0; bit < 8; bit++)
                crc = (uint16_t)(crc & 1 ? crc >> 1 ^ 0xA001 : crc >> 1);
        }
    }
    return crc;
}

void cm_put_u32(uint16_t *at, uint32_t value)
{
    at[0] = (uint16_t)(value >> 16);
    at[1] = (uint16_t)value;
}

uint32_t cm_get_u32(const uint16_t *at)
{
    return (uint32_t)at[0] << 16 | at[1];
}

void cm_put_f32(uint16_t *at, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    cm_put_u32(at, bits);
}

float cm_get_f32(const uint16_t *at)
{
    uint32_t bits = cm_get_u32(at);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}
