#include "testing.h"

void test_claim(void);

enum { CLAIM_WORDS = CM_OWNER_LEFT - CM_OWNER_TOKEN };

static cm_answer claim(uint32_t token, uint16_t timeout_s)
{
    uint16_t words[CLAIM_WORDS] = {0, 0, timeout_s, 'a' << 8 | '@', 'b' << 8};
    cm_put_u32(words, token);
    return cm_write(&drive, CM_OWNER_TOKEN, CLAIM_WORDS, words);
}

static void only_the_holder_renews_and_anybody_releases(void)
{
    fresh_drive();
    CHECK(read_u32(CM_OWNER_TOKEN) == 0 && read_word(CM_OWNER_LEFT) == 0);
    CHECK(claim(7, 5) == CM_OK && read_u32(CM_OWNER_TOKEN) == 7 && read_word(CM_OWNER_LEFT) == 5);
    CHECK(claim(8, 9) == CM_BAD_VALUE && read_u32(CM_OWNER_TOKEN) == 7 && read_word(CM_OWNER_TIMEOUT) == 5);
    CHECK(claim(7, 6) == CM_OK && read_word(CM_OWNER_LEFT) == 6);
    CHECK(claim(0, 0) == CM_OK && read_word(CM_OWNER_LEFT) == 0);
    CHECK(claim(8, 601) == CM_BAD_VALUE && claim(8, 2) == CM_OK && read_u32(CM_OWNER_TOKEN) == 8);
}

static void a_claim_ends_by_itself_unless_the_heartbeat_changes(void)
{
    fresh_drive();
    the_bench.runs_on_motor_time = true;
    CHECK(claim(7, 2) == CM_OK);
    the_bench.time_s += 1.5;
    CHECK(write_word(CM_HEARTBEAT, (uint16_t)(read_word(CM_HEARTBEAT_ECHO) + 1)) == CM_OK);
    the_bench.time_s += 1.5;
    CHECK(read_u32(CM_OWNER_TOKEN) == 7 && read_word(CM_OWNER_LEFT) == 1);
    the_bench.time_s += 0.5;
    CHECK(read_u32(CM_OWNER_TOKEN) == 0 && read_word(CM_OWNER_LEFT) == 0 && claim(9, 1) == CM_OK);
}

static void a_changed_setting_counts_once_and_a_repeated_one_never(void)
{
    fresh_drive();
    uint16_t before = read_word(CM_SETTINGS_COUNT);
    CHECK(write_f32(CM_AXIS_DEG, 30.0f) == CM_OK && read_word(CM_SETTINGS_COUNT) == (uint16_t)(before + 1));
    CHECK(write_f32(CM_AXIS_DEG, 30.0f) == CM_OK && read_word(CM_SETTINGS_COUNT) == (uint16_t)(before + 1));
    CHECK(write_word(CM_ECHO, 0x1234) == CM_OK && claim(7, 5) == CM_OK);
    CHECK(read_word(CM_SETTINGS_COUNT) == (uint16_t)(before + 1));
    CHECK(write_word(CM_WATCHDOG_MS, 3) == CM_BAD_VALUE && read_word(CM_SETTINGS_COUNT) == (uint16_t)(before + 1));
}

void test_claim(void)
{
    only_the_holder_renews_and_anybody_releases();
    a_claim_ends_by_itself_unless_the_heartbeat_changes();
    a_changed_setting_counts_once_and_a_repeated_one_never();
}
