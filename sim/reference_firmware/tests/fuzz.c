/* Fuzzer of the firmware: requests, broken requests, time, trips and power cycles in any order, and what must hold after
 * each of them. `LLVMFuzzerTestOneInput` for libFuzzer (clang -fsanitize=fuzzer -DCM_LIBFUZZER); without clang a driver
 * that makes inputs for so many seconds: fuzz SECONDS [SEED]. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench.h"
#include "cm_drive.h"

static cm_drive drive;

static void must(bool holds, const char *what)
{
    if (!holds) {
        fprintf(stderr, "fuzz: does not hold: %s\n", what);
        abort();
    }
}

typedef struct { const uint8_t *at, *end; } input;

static uint8_t next_byte(input *from)
{
    return from->at < from->end ? *from->at++ : 0;
}

static uint16_t next_word(input *from)
{
    uint16_t high = next_byte(from);
    return (uint16_t)(high << 8 | next_byte(from));
}

static void check_always(void)
{
    double volts = hypot(the_bench.axis_voltage[0], the_bench.axis_voltage[1]);
    must(the_bench.is_on == (drive.state == CM_ENABLED), "the output is on in the enabled state and in no other");
    must((drive.state == CM_FAULT) == (drive.fault != 0), "a fault code stands in the fault state and in no other");
    must(isfinite(volts) && volts <= 300.01, "the voltage is finite and within what the modulator reaches");
    must(!the_bench.is_on || drive.image[CM_WATCHDOG_MS] >= 100, "nothing is energised without a watchdog");
    must(!the_bench.is_on || volts <= (double)cm_get_f32(&drive.image[CM_VOLTAGE_LIMIT]) + 0.011, "the voltage limit holds");
    must(drive.ring.next_unread <= drive.ring.produced, "no sample is read before it is there");
    must(the_bench.is_on != drive.ring.has_ended, "the stream has ended when the output is off");
}

/* Numbers a firmware author would not think of, and registers that matter more often than others. */
static uint16_t a_word(input *from)
{
    static const uint16_t picked[] = {0, 1, 2, 6, 7, 15, 0x80, 100, 1000, 0xFFFF, 0x7F80, 0x7FC0, 0xFF80, 0x4120, 0x42C8, 0xC0DE, 0x570E};
    uint8_t choice = next_byte(from);
    return choice < 128 ? picked[choice % (sizeof picked / sizeof picked[0])] : next_word(from);
}

static uint16_t an_address(input *from)
{
    uint8_t choice = next_byte(from);
    if (choice < 200)
        return cm_items[choice % cm_item_count].address;
    return choice < 230 ? (uint16_t)(next_word(from) % 700) : next_word(from);
}

static size_t a_request(input *from, uint8_t *request)
{
    static const uint8_t functions[] = {3, 6, 16, 23, 16, 6, 23, 3};
    uint8_t choice = next_byte(from);
    uint16_t address = an_address(from), count = (uint16_t)(1 + next_byte(from) % 8);
    size_t size = 5;
    request[0] = choice < 240 ? functions[choice % 8] : next_byte(from);
    request[1] = (uint8_t)(address >> 8);
    request[2] = (uint8_t)address;
    request[3] = 0;
    request[4] = request[0] == 6 ? next_byte(from) : (uint8_t)count;
    if (request[0] == 6) {
        uint16_t word = a_word(from);
        request[3] = (uint8_t)(word >> 8);
        request[4] = (uint8_t)word;
    }
    if (request[0] == 16 || request[0] == 23) {
        if (request[0] == 23) {
            uint16_t into = an_address(from);
            request[4] = (uint8_t)(1 + next_byte(from) % 125);
            request[5] = (uint8_t)(into >> 8);
            request[6] = (uint8_t)into;
            request[7] = 0;
            request[8] = (uint8_t)count;
            size = 9;
        }
        request[size++] = (uint8_t)(2 * count);
        for (int k = 0; k < count; k++) {
            uint16_t word = a_word(from);
            request[size++] = (uint8_t)(word >> 8);
            request[size++] = (uint8_t)word;
        }
    }
    for (uint8_t spoilt = next_byte(from); spoilt > 250 && size; spoilt = next_byte(from))
        request[next_byte(from) % size] = next_byte(from);
    return next_byte(from) > 250 ? next_byte(from) % (size + 1) : size;
}

static void ask(input *from)
{
    uint8_t request[300], answer[253];
    bool was_on = drive.state == CM_ENABLED;
    uint16_t session = drive.session, axis[2] = {drive.image[CM_AXIS_DEG], drive.image[CM_AXIS_DEG + 1]};
    float in_use = cm_get_f32(&drive.image[CM_IN_USE]);
    size_t size = a_request(from, request), length = cm_answer_pdu(&drive, request, size, answer);
    must(length <= sizeof answer, "an answer fits a Modbus frame");
    must((length == 0) == (size == 0), "every request is answered");
    must(length != 2 || (answer[0] & 0x80 && answer[1] >= 1 && answer[1] <= 6), "an exception has a code of the standard");
    must(was_on || drive.state != CM_ENABLED || drive.session != session, "an enable opens a new session");
    must(!was_on || !memcmp(axis, &drive.image[CM_AXIS_DEG], sizeof axis) || !the_bench.is_on, "the axis stays while energised");
    must(memcmp(&in_use, &(float){cm_get_f32(&drive.image[CM_IN_USE])}, sizeof in_use) == 0, "no request alone changes what is in use");
}

/* The documented way to an energised output, so that the fuzzer is not only outside the door. */
static void set_up(void)
{
    static const uint16_t supervision[] = {1000, 0x4120, 0, 0x4270, 0, 0x42C8, 0};
    static const uint16_t signal[] = {0x4270, 0, 0x40A0, 0, 0x42C8, 0, 0x3F80, 0, 0x4120, 0, 0x3F80, 0, 1, 0x40C0, 0, 0x4120, 0};
    static const uint16_t words[] = {0x06, 0x07, 0x0F};
    uint16_t mode = 1;
    cm_write(&drive, CM_WATCHDOG_MS, 7, supervision);
    cm_write(&drive, CM_AXIS_DEG, 17, signal);
    cm_write(&drive, CM_MODE, 1, &mode);
    for (int k = 0; k < 3; k++)
        cm_write(&drive, CM_CONTROL_WORD, 1, &words[k]);
}

static void pass_time(unsigned periods)
{
    for (unsigned k = 0; k < periods; k++) {
        cm_control_interrupt(&drive);
        check_always();
        if (the_bench.is_on && k % 16 == 0) /* the motor is dear and not what is tried here */
            bench_advance_period();
        else
            the_bench.time_s += 2e-4;
    }
}

static void one_step(input *from)
{
    uint8_t choice = next_byte(from);
    if (choice < 190)
        ask(from);
    else if (choice < 215)
        pass_time(next_byte(from));
    else if (choice < 232)
        cm_background(&drive);
    else if (choice < 246)
        set_up();
    else if (choice < 249)
        the_bench.interlocks = next_byte(from) < 200 ? CM_INTERLOCK_ALL : next_byte(from);
    else if (choice < 251)
        the_bench.hardware_trip = next_byte(from) % 16 == 0 ? next_byte(from) % 10 : 0;
    else if (choice < 253)
        the_bench.memory_fails = !the_bench.memory_fails;
    else if (choice < 254)
        the_bench.time_s += 0.01 * next_byte(from);
    else
        cm_power_up(&drive);
    check_always();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    input from = {data, data + size};
    bench_start(1, 0);
    the_bench.runs_on_motor_time = true;
    cm_power_up(&drive);
    check_always();
    while (from.at < from.end)
        one_step(&from);
    return 0;
}

#ifndef CM_LIBFUZZER
int main(int count, char **argument)
{
    double seconds = count > 1 ? atof(argument[1]) : 5.0, end = wall_seconds() + seconds;
    uint64_t x = count > 2 ? strtoull(argument[2], 0, 10) : 1, inputs = 0, enabled = 0;
    static uint8_t data[4096];
    while (wall_seconds() < end) {
        for (size_t k = 0; k < sizeof data; k++) {
            x = x * 6364136223846793005u + 1442695040888963407u;
            data[k] = (uint8_t)(x >> 56);
        }
        LLVMFuzzerTestOneInput(data, sizeof data);
        inputs++;
        enabled += drive.memory.power_ups > 0 && drive.ring.produced > 0;
    }
    printf("%llu inputs of %zu bytes, %llu ended with samples taken; nothing failed\n", (unsigned long long)inputs,
        sizeof data, (unsigned long long)enabled);
    return inputs == 0;
}
#endif
