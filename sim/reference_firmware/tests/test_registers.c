#include <math.h>
#include <string.h>

#include "testing.h"

void test_registers(void);

static void identity_reads_as_published(void)
{
    uint16_t words[22];
    fresh_drive();
    CHECK(cm_read(&drive, 0, 22, words) == CM_OK);
    CHECK(cm_get_u32(words) == 0x434D5352u && words[2] == 1);
    CHECK(words[CM_DRIVE_TYPE] == ('S' << 8 | 'I') && words[CM_DRIVE_TYPE + 4] == ('7' << 8 | 'A'));
    CHECK(words[CM_DRIVE_TYPE + 5] == 0 && words[CM_DRIVE_TYPE + 7] == 0);
    CHECK(cm_get_u32(&words[CM_CONTROL_PERIOD]) == 200000);
    CHECK(read_u32(CM_RING_CAPACITY) == CM_RING_SAMPLES);
}

static void what_is_not_mapped_is_refused(void)
{
    uint16_t words[CM_LONGEST_READ];
    fresh_drive();
    CHECK(cm_read(&drive, 22, 1, words) == CM_NO_SUCH_ADDRESS);
    CHECK(cm_read(&drive, 20, 3, words) == CM_NO_SUCH_ADDRESS);
    CHECK(cm_read(&drive, 0xFFFF, 2, words) == CM_NO_SUCH_ADDRESS);
    CHECK(cm_read(&drive, 0, 0, words) == CM_BAD_VALUE);
    CHECK(cm_read(&drive, CM_WINDOW, 126, words) == CM_BAD_VALUE);
    CHECK(cm_write(&drive, 0xFFFF, 2, words) == CM_NO_SUCH_ADDRESS);
    CHECK(write_word(CM_STATUS_WORD, 1) == CM_NO_SUCH_ADDRESS);
}

static void a_number_is_never_written_by_half(void)
{
    uint16_t three[3];
    fresh_drive();
    cm_put_f32(three, 2.0f);
    three[2] = 0x4000;
    CHECK(write_word(CM_CURRENT_LIMIT, 0x4100) == CM_NO_SUCH_ADDRESS);
    CHECK(write_word(CM_CURRENT_LIMIT + 1, 0x4100) == CM_NO_SUCH_ADDRESS);
    CHECK(cm_write(&drive, CM_CURRENT_LIMIT, 3, three) == CM_NO_SUCH_ADDRESS);
    CHECK(read_f32(CM_CURRENT_LIMIT) == 0.0f);
    CHECK(write_f32(CM_TONES + 6, 3.0f) == CM_OK); /* an array by its elements */
    CHECK(cm_write(&drive, CM_TONES, 3, three) == CM_NO_SUCH_ADDRESS);
    CHECK(read_f32(CM_TONES) == 0.0f && read_f32(CM_TONES + 6) == 3.0f);
}

static void one_bad_value_keeps_every_other_out(void)
{
    uint16_t words[7];
    fresh_drive();
    words[0] = 500;
    cm_put_f32(&words[1], 4.0f);
    cm_put_f32(&words[3], -1.0f);
    cm_put_f32(&words[5], 50.0f);
    CHECK(cm_write(&drive, CM_WATCHDOG_MS, 7, words) == CM_BAD_VALUE);
    CHECK(read_word(CM_WATCHDOG_MS) == 0 && read_f32(CM_CURRENT_LIMIT) == 0.0f);
    cm_put_f32(&words[3], 1.0f);
    CHECK(cm_write(&drive, CM_WATCHDOG_MS, 7, words) == CM_OK);
    CHECK(read_word(CM_WATCHDOG_MS) == 500 && read_f32(CM_TEST_TIME_LIMIT) == 1.0f);
}

static void ranges_hold(void)
{
    fresh_drive();
    CHECK(write_word(CM_WATCHDOG_MS, 99) == CM_BAD_VALUE && write_word(CM_WATCHDOG_MS, 2001) == CM_BAD_VALUE);
    CHECK(write_word(CM_WATCHDOG_MS, 100) == CM_OK && write_word(CM_WATCHDOG_MS, 2000) == CM_OK);
    CHECK(write_word(CM_WATCHDOG_MS, 0) == CM_OK);
    CHECK(write_f32(CM_AMPLITUDE_SCALE, 1.01f) == CM_BAD_VALUE && write_f32(CM_AMPLITUDE_SCALE, -0.1f) == CM_BAD_VALUE);
    CHECK(write_f32(CM_DC_BIAS, NAN) == CM_BAD_VALUE && write_f32(CM_DC_BIAS, INFINITY) == CM_BAD_VALUE);
    CHECK(write_word(CM_TONE_COUNT, 9) == CM_BAD_VALUE && write_word(CM_DECIMATION, 0) == CM_BAD_VALUE);
    CHECK(write_word(CM_DECIMATION, 101) == CM_BAD_VALUE && write_word(CM_CHANNEL_MASK, 16) == CM_BAD_VALUE);
    CHECK(write_word(CM_CHANNEL_MASK, 0) == CM_BAD_VALUE && write_word(CM_MODE, 2) == CM_BAD_VALUE);
}

static void what_needs_a_stop_is_refused_while_energised(void)
{
    fresh_drive();
    prepare();
    CHECK(switch_on());
    for (int k = 0; k < cm_item_count; k++) {
        uint16_t words[2], before[2], after[2];
        const cm_item *item = &cm_items[k];
        uint16_t each = cm_words_each(item);
        if (!(item->flags & CM_NEEDS_STOP))
            continue;
        cm_read(&drive, item->address, each, before);
        memset(words, 0, sizeof words);
        CHECK(cm_write(&drive, item->address, each, words) == CM_BUSY);
        cm_read(&drive, item->address, each, after);
        CHECK(before[0] == after[0] && (each == 1 || before[1] == after[1]));
    }
    CHECK(write_f32(CM_DC_BIAS, 4.0f) == CM_OK && write_word(CM_ECHO, 7) == CM_OK);
    CHECK(drive.state == CM_ENABLED);
}

void test_registers(void)
{
    identity_reads_as_published();
    what_is_not_mapped_is_refused();
    a_number_is_never_written_by_half();
    one_bad_value_keeps_every_other_out();
    ranges_hold();
    what_needs_a_stop_is_refused_while_energised();
}
