#include "testing.h"

void test_states(void);

static void the_way_up_and_down_is_cia_402s(void)
{
    fresh_drive();
    CHECK(read_word(CM_STATUS_WORD) == 0x0240);
    write_word(CM_CONTROL_WORD, 0x07);
    CHECK(drive.state == CM_SWITCH_ON_DISABLED);
    write_word(CM_CONTROL_WORD, 0x0F);
    CHECK(drive.state == CM_SWITCH_ON_DISABLED);
    write_word(CM_CONTROL_WORD, 0x06);
    CHECK(read_word(CM_STATUS_WORD) == 0x0231);
    write_word(CM_CONTROL_WORD, 0x07);
    CHECK(read_word(CM_STATUS_WORD) == 0x0233);
    write_word(CM_CONTROL_WORD, 0x02);
    CHECK(drive.state == CM_SWITCH_ON_DISABLED);
    prepare();
    CHECK(switch_on() && read_word(CM_STATUS_WORD) == 0x0237);
    write_word(CM_CONTROL_WORD, 0x06);
    CHECK(drive.state == CM_READY && !the_bench.is_on);
}

static void nothing_is_energised_while_a_condition_is_missing(void)
{
    static const uint16_t words[] = {CM_WATCHDOG_MS, CM_MODE};
    static const uint16_t numbers[] = {CM_CURRENT_LIMIT, CM_TEST_TIME_LIMIT, CM_VOLTAGE_LIMIT, CM_DURATION};
    for (int k = 0; k < 6; k++) {
        fresh_drive();
        prepare();
        CHECK((k < 2 ? write_word(words[k], 0) : write_f32(numbers[k - 2], 0.0f)) == CM_OK);
        CHECK(!switch_on() && !the_bench.is_on);
    }
    for (int bit = 0; bit < 5; bit++) {
        fresh_drive();
        prepare();
        the_bench.interlocks = (uint16_t)(31 & ~(1 << bit));
        CHECK(!switch_on() && !the_bench.is_on);
    }
    fresh_drive();
    prepare();
    the_bench.hardware_trip = CM_TRIP_EARTH;
    CHECK(!switch_on());
}

static void the_watchdog_bites_when_no_changed_heartbeat_comes(void)
{
    fresh_drive();
    prepare();
    write_word(CM_WATCHDOG_MS, 100);
    write_f32(CM_DURATION, 60.0f);
    CHECK(switch_on());
    run_periods(5000); /* fed: ten times its time */
    CHECK(drive.state == CM_ENABLED);
    uint16_t same = drive.heartbeat_echo;
    unsigned lasted = 0;
    while (drive.state == CM_ENABLED && lasted < 10000) {
        write_word(CM_HEARTBEAT, same);
        cm_control_interrupt(&drive);
        bench_advance_period();
        lasted++;
    }
    CHECK(lasted >= 499 && lasted <= 512);
    CHECK(drive.state == CM_FAULT && drive.trip_cause == CM_TRIP_WATCHDOG && !the_bench.is_on);
    CHECK(drive.trip_value > 100.0f && drive.trip_limit == 100.0f);
}

static void the_watchdog_bites_without_any_interrupt_too(void)
{
    fresh_drive();
    prepare();
    write_word(CM_WATCHDOG_MS, 100);
    CHECK(switch_on());
    the_bench.time_s += 0.11;
    cm_background(&drive);
    CHECK(drive.state == CM_FAULT && !the_bench.is_on);
}

static void too_much_current_trips_with_its_value(void)
{
    fresh_drive();
    prepare();
    write_f32(CM_CURRENT_LIMIT, 0.2f);
    CHECK(switch_on());
    run_to_end(5000);
    CHECK(drive.fault == CM_TRIP_OVERCURRENT && drive.trip_value > 0.2f && drive.trip_limit == 0.2f);
    CHECK(read_word(CM_STATUS_WORD) == 0x0208 && read_word(CM_FAULT_CODE) == 1);
}

static void the_time_limit_trips(void)
{
    fresh_drive();
    prepare();
    write_f32(CM_TEST_TIME_LIMIT, 0.1f);
    CHECK(switch_on());
    run_periods(250);
    CHECK(NEAR(read_f32(CM_TEST_TIME_LEFT), 0.05f, 1e-4f));
    CHECK(250 + run_to_end(5000) == 501 && drive.fault == CM_TRIP_TIME_LIMIT && NEAR(drive.trip_limit, 0.1f, 1e-6f));
}

static void a_fault_is_left_by_a_rising_reset_only_and_its_cause_stays(void)
{
    fresh_drive();
    prepare();
    CHECK(switch_on());
    the_bench.interlocks = 31 & ~CM_INTERLOCK_STO;
    run_periods(1);
    CHECK(drive.fault == CM_TRIP_STO && !the_bench.is_on);
    the_bench.interlocks = 31;
    CHECK(!switch_on());
    write_word(CM_CONTROL_WORD, 0x80);
    CHECK(drive.state == CM_SWITCH_ON_DISABLED && read_word(CM_FAULT_CODE) == 0 && read_word(CM_TRIP_CAUSE) == CM_TRIP_STO);
    CHECK(switch_on() && read_word(CM_TRIP_CAUSE) == 0);
    cm_trip(&drive, CM_TRIP_EARTH, 0.0f, 0.0f);
    write_word(CM_CONTROL_WORD, 0x80);
    cm_trip(&drive, CM_TRIP_EARTH, 0.0f, 0.0f);
    write_word(CM_CONTROL_WORD, 0x80); /* held, not given again */
    CHECK(drive.state == CM_FAULT);
    the_bench.hardware_trip = CM_TRIP_EARTH;
    write_word(CM_CONTROL_WORD, 0);
    write_word(CM_CONTROL_WORD, 0x80);
    CHECK(drive.state == CM_FAULT);
}

static void every_enable_opens_a_session_of_its_own(void)
{
    fresh_drive();
    prepare();
    uint16_t before = read_word(CM_SESSION_ID);
    CHECK(switch_on() && read_word(CM_SESSION_ID) == (uint16_t)(before + 1));
    run_periods(50);
    write_word(CM_CONTROL_WORD, 0);
    CHECK(switch_on() && read_word(CM_SESSION_ID) == (uint16_t)(before + 2) && read_u32(CM_SAMPLES_PRODUCED) == 0);
}

static void leaving_the_mode_blocks_the_output(void)
{
    fresh_drive();
    prepare();
    CHECK(switch_on());
    write_word(CM_MODE, 0);
    CHECK(drive.state == CM_SWITCH_ON_DISABLED && !the_bench.is_on);
}

void test_states(void)
{
    the_way_up_and_down_is_cia_402s();
    nothing_is_energised_while_a_condition_is_missing();
    the_watchdog_bites_when_no_changed_heartbeat_comes();
    the_watchdog_bites_without_any_interrupt_too();
    too_much_current_trips_with_its_value();
    the_time_limit_trips();
    a_fault_is_left_by_a_rising_reset_only_and_its_cause_stays();
    every_enable_opens_a_session_of_its_own();
    leaving_the_mode_blocks_the_output();
}
