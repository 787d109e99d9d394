#include "testing.h"

int checks_made, checks_failed;
cm_drive drive;

void test_map(void), test_claim(void);
void test_registers(void);
void test_excitation(void);
void test_ring(void);
void test_states(void);
void test_parameters(void);
void test_pdu(void);
void test_motor(void);

void fresh_drive(void)
{
    bench_start(1, 0);
    the_bench.runs_on_motor_time = true;
    cm_power_up(&drive);
}

void prepare(void)
{
    const float values[] = {0.0f, 5.0f, 100.0f, 1.0f, 10.0f, 1.0f};
    write_word(CM_WATCHDOG_MS, 1000);
    write_f32(CM_CURRENT_LIMIT, 9.0f);
    write_f32(CM_TEST_TIME_LIMIT, 60.0f);
    write_f32(CM_VOLTAGE_LIMIT, 100.0f);
    for (int k = 0; k < 6; k++)
        write_f32((uint16_t)(CM_AXIS_DEG + 2 * k), values[k]);
    write_word(CM_TONE_COUNT, 1);
    write_f32(CM_TONES, 6.0f);
    write_f32(CM_TONES + 2, 10.0f);
    write_f32(CM_TONES + 4, 0.0f);
    write_word(CM_MODE, 1);
}

bool switch_on(void)
{
    write_word(CM_CONTROL_WORD, 0x06);
    write_word(CM_CONTROL_WORD, 0x07);
    write_word(CM_CONTROL_WORD, 0x0F);
    return drive.state == CM_ENABLED;
}

static void one_period(void)
{
    cm_control_interrupt(&drive);
    if (the_bench.is_on)
        bench_advance_period();
    else
        the_bench.time_s += 2e-4;
    cm_background(&drive);
}

void run_periods(unsigned count)
{
    for (unsigned k = 0; k < count; k++) {
        write_word(CM_HEARTBEAT, (uint16_t)(drive.heartbeat_echo + 1));
        one_period();
    }
}

unsigned run_to_end(unsigned count)
{
    unsigned k = 0;
    while (k < count && drive.state == CM_ENABLED) {
        run_periods(1);
        k++;
    }
    return k;
}

uint16_t read_word(uint16_t address)
{
    uint16_t word = 0xDEAD;
    CHECK(cm_read(&drive, address, 1, &word) == CM_OK);
    return word;
}

uint32_t read_u32(uint16_t address)
{
    uint16_t words[2] = {0, 0};
    CHECK(cm_read(&drive, address, 2, words) == CM_OK);
    return cm_get_u32(words);
}

float read_f32(uint16_t address)
{
    uint16_t words[2] = {0, 0};
    CHECK(cm_read(&drive, address, 2, words) == CM_OK);
    return cm_get_f32(words);
}

cm_answer write_word(uint16_t address, uint16_t word)
{
    return cm_write(&drive, address, 1, &word);
}

cm_answer write_f32(uint16_t address, float value)
{
    uint16_t words[2];
    cm_put_f32(words, value);
    return cm_write(&drive, address, 2, words);
}

uint16_t read_window(uint32_t index, uint16_t window[CM_WINDOW_WORDS])
{
    uint16_t words[2];
    cm_put_u32(words, index);
    CHECK(cm_write(&drive, CM_WINDOW_INDEX, 2, words) == CM_OK);
    CHECK(cm_read(&drive, CM_WINDOW, CM_WINDOW_WORDS, window) == CM_OK);
    return window[3];
}

int main(void)
{
    test_map();
    test_registers();
    test_claim();
    test_excitation();
    test_ring();
    test_states();
    test_parameters();
    test_pdu();
    test_motor();
    printf("%d checks, %d failed\n", checks_made, checks_failed);
    return checks_failed != 0;
}
