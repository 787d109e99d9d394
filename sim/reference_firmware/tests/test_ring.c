#include <string.h>

#include "testing.h"

void test_ring(void);

static uint16_t window[CM_WINDOW_WORDS], again[CM_WINDOW_WORDS];

static bool has_right_crc(const uint16_t *words, uint16_t channels)
{
    uint16_t crc = cm_crc16(0xFFFF, words, 7);
    return words[7] == cm_crc16(crc, &words[8], (uint16_t)(words[3] * channels));
}

static void the_same_question_has_the_same_answer(void)
{
    fresh_drive();
    prepare();
    CHECK(switch_on());
    run_periods(100);
    CHECK(read_window(20, window) == 29 && has_right_crc(window, 4));
    run_periods(500);
    CHECK(read_window(20, again) == 29);
    CHECK(!memcmp(&window[8], &again[8], CM_WINDOW_DATA * sizeof *window) && again[5] == CM_FLAG_RUNNING);
    CHECK(cm_get_u32(&again[1]) == 20 && again[0] == drive.session && again[4] == 15);
}

static void windows_join_without_gap_and_the_last_one_says_that_it_is(void)
{
    uint32_t index = 0;
    fresh_drive();
    prepare();
    write_f32(CM_DURATION, 0.1f);
    CHECK(switch_on());
    run_to_end(20000);
    do {
        uint16_t count = read_window(index, window);
        CHECK(cm_get_u32(&window[1]) == index && has_right_crc(window, 4));
        CHECK(!(window[5] & CM_FLAG_RUNNING));
        index += count;
    } while (!(window[5] & CM_FLAG_ENDED) && index < 100000);
    CHECK(index == drive.ring.produced && read_u32(CM_SAMPLES_PRODUCED) == index);
    CHECK(read_window(index + 5, window) == 0 && cm_get_u32(&window[1]) == index + 5 && window[5] & CM_FLAG_ENDED);
}

static void what_was_overwritten_is_counted_and_flagged(void)
{
    fresh_drive();
    prepare();
    write_f32(CM_DURATION, 60.0f);
    CHECK(switch_on());
    run_periods(CM_RING_SAMPLES + 1000);
    CHECK(read_window(0, window) == 29 && cm_get_u32(&window[1]) == 1000);
    CHECK(window[5] == (CM_FLAG_OVERRUN | CM_FLAG_RUNNING) && read_word(CM_OVERRUNS) == 1000 && has_right_crc(window, 4));
    CHECK(read_window(1029, window) == 29 && window[5] == CM_FLAG_RUNNING && read_word(CM_OVERRUNS) == 1000);
}

static void a_mask_chooses_channels_in_order(void)
{
    fresh_drive();
    prepare();
    write_word(CM_CHANNEL_MASK, 0x6);
    CHECK(switch_on());
    run_periods(100);
    CHECK(read_window(0, window) == 58 && window[4] == 6 && has_right_crc(window, 2));
    for (int k = 0; k < 58; k++)
        CHECK((int16_t)window[8 + 2 * k] == drive.ring.sample[k][1] && (int16_t)window[9 + 2 * k] == drive.ring.sample[k][2]);
}

static void decimated_samples_are_means(void)
{
    static const int16_t currents[3] = {3, -3, -7};
    cm_ring *ring = &drive.ring;
    fresh_drive();
    write_word(CM_DECIMATION, 4);
    cm_start_ring(&drive);
    for (int16_t k = 0; k < 8; k++)
        cm_add_sample(ring, (int16_t)(10 * k), currents, k == 6 ? CM_FLAG_CLIPPED : 0);
    CHECK(ring->produced == 2 && ring->sample[0][0] == 15 && ring->sample[1][0] == 55);
    CHECK(ring->sample[0][1] == 3 && ring->sample[0][2] == -3 && ring->sample[0][3] == -7);
    CHECK(ring->flags[0] == 0 && ring->flags[1] == CM_FLAG_CLIPPED);
    static const int16_t odd[3] = {1, -1, 0};
    cm_add_sample(ring, 1, odd, 0);
    cm_add_sample(ring, 2, odd, 0);
    cm_add_sample(ring, 2, odd, 0);
    cm_add_sample(ring, 1, odd, 0);
    CHECK(ring->sample[2][0] == 2); /* 1.5: halves upwards */
    for (int k = 0; k < 4; k++)
        cm_add_sample(ring, (int16_t)(k < 2 ? -1 : -2), odd, 0);
    CHECK(ring->sample[3][0] == -1); /* -1.5: halves upwards */
}

static void a_short_read_brings_fewer_samples_with_a_right_check_sum(void)
{
    uint16_t index[2] = {0, 0};
    fresh_drive();
    prepare();
    CHECK(switch_on());
    run_periods(100);
    cm_write(&drive, CM_WINDOW_INDEX, 2, index);
    for (uint16_t registers = 1; registers <= CM_WINDOW_WORDS; registers++) {
        CHECK(cm_read(&drive, CM_WINDOW, registers, window) == CM_OK);
        uint16_t fits = (uint16_t)(registers < 8 ? 0 : (registers - 8) / 4);
        CHECK(registers < 4 || window[3] == fits);
        CHECK(registers < 8 || has_right_crc(window, 4));
    }
}

void test_ring(void)
{
    the_same_question_has_the_same_answer();
    windows_join_without_gap_and_the_last_one_says_that_it_is();
    what_was_overwritten_is_counted_and_flagged();
    a_mask_chooses_channels_in_order();
    decimated_samples_are_means();
    a_short_read_brings_fewer_samples_with_a_right_check_sum();
}
