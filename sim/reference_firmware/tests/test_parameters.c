#include "testing.h"

void test_parameters(void);

static void stage(const float values[4], uint16_t spoil)
{
    for (int k = 0; k < 4; k++)
        CHECK(write_f32((uint16_t)(CM_STAGED + 2 * k), values[k]) == CM_OK);
    CHECK(write_word(CM_STAGED_CRC, (uint16_t)(cm_crc16(0xFFFF, &drive.image[CM_STAGED], 8) ^ spoil)) == CM_OK);
}

static uint16_t commit(void)
{
    CHECK(write_word(CM_COMMIT, CM_COMMIT_WORD) == CM_OK && read_word(CM_COMMIT_RESULT) == CM_WORKING);
    cm_background(&drive);
    return read_word(CM_COMMIT_RESULT);
}

static void staged_values_come_into_use_by_a_commit_and_stay_by_a_store(void)
{
    static const float wanted[4] = {3.5f, 2.2f, 22.0f, 270.0f};
    fresh_drive();
    float stored = read_f32(CM_STORED);
    uint32_t count = read_u32(CM_STORE_COUNT);
    stage(wanted, 0);
    CHECK(read_f32(CM_IN_USE) == stored);
    CHECK(commit() == CM_DONE && read_f32(CM_IN_USE) == 3.5f && read_f32(CM_IN_USE + 6) == 270.0f);
    CHECK(read_f32(CM_STORED) == stored && read_u32(CM_STORE_COUNT) == count && read_word(CM_COMMIT) == 0);
    CHECK(write_word(CM_STORE, CM_STORE_WORD) == CM_OK);
    cm_background(&drive);
    CHECK(read_word(CM_STORE_RESULT) == CM_DONE && read_f32(CM_STORED + 6) == 270.0f);
    CHECK(read_u32(CM_STORE_COUNT) == count + 1);
    cm_power_up(&drive);
    CHECK(read_f32(CM_IN_USE + 4) == 22.0f && read_f32(CM_STAGED) == 3.5f && read_u32(CM_STORE_COUNT) == count + 1);
}

static void a_wrong_check_sum_or_value_changes_nothing(void)
{
    static const float good[4] = {3.6f, 2.3f, 23.0f, 280.0f}, bad[4] = {3.6f, 2.3f, 23.0f, 0.001f};
    fresh_drive();
    float before = read_f32(CM_IN_USE);
    stage(good, 1);
    CHECK(commit() == CM_WRONG_CHECK_SUM && read_f32(CM_IN_USE) == before);
    stage(bad, 0);
    CHECK(commit() == CM_OUT_OF_RANGE && read_f32(CM_IN_USE) == before);
    write_word(CM_COMMIT, 0xC0DF);
    cm_background(&drive);
    CHECK(read_word(CM_COMMIT_RESULT) == CM_OUT_OF_RANGE);
}

static void a_memory_that_fails_is_said_and_nothing_is_lost(void)
{
    static const float wanted[4] = {4.5f, 2.9f, 29.0f, 290.0f};
    fresh_drive();
    float stored = read_f32(CM_STORED);
    stage(wanted, 0);
    CHECK(commit() == CM_DONE);
    the_bench.memory_fails = true;
    write_word(CM_STORE, CM_STORE_WORD);
    cm_background(&drive);
    CHECK(read_word(CM_STORE_RESULT) == CM_STORE_FAILED && read_f32(CM_STORED) == stored);
}

static void a_damaged_memory_is_a_fault_at_power_up(void)
{
    cm_memory memory;
    fresh_drive();
    CHECK(cm_port_memory_read(&memory) == CM_MEMORY_READ);
    memory.parameters[2] += 1.0f;
    cm_port_memory_write(&memory);
    cm_power_up(&drive);
    CHECK(read_word(CM_FAULT_CODE) == CM_TRIP_MEMORY && drive.state == CM_FAULT);
    memory.parameters[2] -= 1.0f;
    cm_port_memory_write(&memory);
}

static void a_commit_that_meets_an_enabled_output_is_refused(void)
{
    fresh_drive();
    prepare();
    static const float wanted[4] = {3.5f, 2.2f, 22.0f, 270.0f};
    stage(wanted, 0);
    write_word(CM_COMMIT, CM_COMMIT_WORD);
    CHECK(switch_on());
    cm_background(&drive);
    CHECK(read_word(CM_COMMIT_RESULT) == CM_NOT_STOPPED);
}

void test_parameters(void)
{
    staged_values_come_into_use_by_a_commit_and_stay_by_a_store();
    a_wrong_check_sum_or_value_changes_nothing();
    a_memory_that_fails_is_said_and_nothing_is_lost();
    a_damaged_memory_is_a_fault_at_power_up();
    a_commit_that_meets_an_enabled_output_is_refused();
}
