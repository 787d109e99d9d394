/* The commissioning map: wire addresses (base 0) and words, as config/drives/simulated.toml publishes them. */
#ifndef CM_MAP_H
#define CM_MAP_H

#include <stdbool.h>
#include <stdint.h>

enum {
    CM_MAGIC = 0, CM_MAP_VERSION = 2, CM_FIRMWARE_VERSION = 3, CM_SERIAL_NUMBER = 5, CM_DRIVE_TYPE = 7,
    CM_RATED_DRIVE_CURRENT = 15, CM_CONTROL_PERIOD = 17, CM_SWITCHING_FREQUENCY = 19, CM_ECHO = 21,

    CM_CONTROL_WORD = 32, CM_MODE = 33, CM_HEARTBEAT = 34, CM_WINDOW_INDEX = 35,

    CM_STATUS_WORD = 48, CM_FAULT_CODE = 49, CM_TRIP_CAUSE = 50, CM_TRIP_VALUE = 51, CM_TRIP_LIMIT = 53,
    CM_HEARTBEAT_ECHO = 55, CM_SESSION_ID = 56, CM_INTERLOCKS = 57, CM_DC_LINK = 58, CM_HEATSINK = 60,
    CM_WINDING = 62, CM_SHAFT_SPEED = 64, CM_CURRENT_MAGNITUDE = 66, CM_PRESENT_SCALE = 68,
    CM_SAMPLES_PRODUCED = 70, CM_OVERRUNS = 72, CM_TEST_TIME_LEFT = 73, CM_PRESENT_BIAS = 75, CM_SETTINGS_COUNT = 77,

    CM_OWNER_TOKEN = 80, CM_OWNER_TIMEOUT = 82, CM_OWNER_NAME = 83, CM_OWNER_LEFT = 95,

    CM_WATCHDOG_MS = 96, CM_CURRENT_LIMIT = 97, CM_TEST_TIME_LIMIT = 99, CM_VOLTAGE_LIMIT = 101,

    CM_AXIS_DEG = 128, CM_DC_BIAS = 130, CM_BIAS_RAMP = 132, CM_AMPLITUDE_SCALE = 134, CM_SCALE_RAMP = 136,
    CM_DURATION = 138, CM_TONE_COUNT = 140, CM_TONES = 141, CM_CHANNEL_MASK = 189, CM_DECIMATION = 190,

    CM_CURRENT_SCALE = 224, CM_VOLTAGE_SCALE = 226, CM_DC_LINK_SCALE = 228, CM_RING_CAPACITY = 230,
    CM_CURRENT_FULL_SCALE = 232,

    CM_WINDOW = 256, CM_WINDOW_HEADER = 8, CM_WINDOW_DATA = 117, CM_WINDOW_WORDS = 125,

    CM_RATED_POWER = 544, CM_RATED_VOLTAGE = 546, CM_RATED_FREQUENCY = 548, CM_RATED_CURRENT = 550,
    CM_RATED_SPEED = 552, CM_POWER_FACTOR = 554, CM_POLE_PAIRS = 556,

    CM_IN_USE = 576, CM_STAGED = 592, CM_STAGED_CRC = 600, CM_COMMIT = 601, CM_STORE = 602,
    CM_COMMIT_RESULT = 603, CM_STORE_RESULT = 604, CM_STORE_COUNT = 605, CM_STORED = 608,

    CM_IMAGE_WORDS = 616
};

enum { CM_TONE_LIMIT = 8, CM_CHANNELS = 4, CM_PARAMETERS = 4, CM_LONGEST_READ = 125, CM_LONGEST_WRITE = 123 };

#define CM_MAGIC_VALUE 0x434D5352u   /* "CMSR" */
#define CM_COMMIT_WORD 0xC0DEu
#define CM_STORE_WORD 0x570Eu

/* Modbus exceptions; 0 = done. */
typedef enum { CM_OK = 0, CM_NO_SUCH_FUNCTION = 1, CM_NO_SUCH_ADDRESS = 2, CM_BAD_VALUE = 3, CM_BUSY = 6 } cm_answer;

/* CiA 402 states by their status word patterns. */
typedef enum {
    CM_SWITCH_ON_DISABLED = 0x40, CM_READY = 0x21, CM_SWITCHED_ON = 0x23, CM_ENABLED = 0x27, CM_FAULT = 0x08
} cm_state;
enum { CM_STATUS_VOLTAGE = 0x10, CM_STATUS_REMOTE = 0x200 };

/* fault_code and trip_cause. */
enum {
    CM_TRIP_NONE, CM_TRIP_OVERCURRENT, CM_TRIP_HEATSINK, CM_TRIP_EARTH, CM_TRIP_STO, CM_TRIP_UNDERVOLTAGE,
    CM_TRIP_WATCHDOG, CM_TRIP_TIME_LIMIT, CM_TRIP_WINDING, CM_TRIP_MEMORY
};

enum {
    CM_INTERLOCK_STO = 1, CM_INTERLOCK_REMOTE = 2, CM_INTERLOCK_AT_REST = 4, CM_INTERLOCK_SUPPLY = 8,
    CM_INTERLOCK_NO_OTHER_MASTER = 16, CM_INTERLOCK_ALL = 31
};

enum { CM_FLAG_RUNNING = 1, CM_FLAG_CLIPPED = 2, CM_FLAG_OVERRUN = 4, CM_FLAG_CLAMPED = 8, CM_FLAG_ENDED = 16 };

/* commit_result and store_result. */
enum { CM_IDLE, CM_WORKING, CM_DONE, CM_WRONG_CHECK_SUM, CM_OUT_OF_RANGE, CM_NOT_STOPPED, CM_STORE_FAILED = 3 };

typedef enum { CM_U16, CM_U32, CM_F32, CM_ASCII, CM_WINDOW_BLOCK } cm_kind;
enum { CM_WRITABLE = 1, CM_NEEDS_STOP = 2, CM_ACTS = 4 };

/* One item; `low` and `high` bound what may be written. */
typedef struct {
    uint16_t address;
    uint8_t kind, length, flags;
    float low, high;
} cm_item;

extern const cm_item cm_items[];
extern const int cm_item_count;

/* The item that covers the register, or NULL. */
const cm_item *cm_find_item(uint16_t address);
uint16_t cm_words_each(const cm_item *item);
uint16_t cm_words(const cm_item *item);
/* Whether every register of the run belongs to an item. */
bool cm_is_mapped(uint16_t address, uint16_t count);

/* CRC-16/MODBUS over registers, high byte first; start with 0xFFFF. */
uint16_t cm_crc16(uint16_t crc, const uint16_t *words, uint16_t count);

void cm_put_u32(uint16_t *at, uint32_t value);
uint32_t cm_get_u32(const uint16_t *at);
void cm_put_f32(uint16_t *at, float value);
float cm_get_f32(const uint16_t *at);

#endif
