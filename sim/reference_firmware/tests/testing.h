/* Checks that name themselves, and a powered drive on the bench to make them on. */
#ifndef TESTING_H
#define TESTING_H

#include <stdio.h>

#include "bench.h"
#include "cm_drive.h"

extern int checks_made, checks_failed;

#define CHECK(holds)                                                                                                  \
    do {                                                                                                              \
        checks_made++;                                                                                                \
        if (!(holds)) {                                                                                               \
            checks_failed++;                                                                                          \
            printf("%s:%d: %s: not %s\n", __FILE__, __LINE__, __func__, #holds);                                      \
        }                                                                                                             \
    } while (0)

#define NEAR(seen, wanted, tolerance) ((seen) - (wanted) <= (tolerance) && (wanted) - (seen) <= (tolerance))

extern cm_drive drive;

void fresh_drive(void);
/* Test set-up: axis 0, bias 5 V at 100 V/s, one tone of 6 V, 10 Hz, scale 1 at 10/s, watchdog 1000 ms, 9 A, 60 s. */
void prepare(void);
/* Through the states; true when the output is on. */
bool switch_on(void);
/* Control periods, the watchdog fed. */
void run_periods(unsigned count);
/* Until the firmware switches off by itself, at most `count` periods; how many it took. */
unsigned run_to_end(unsigned count);
uint16_t read_word(uint16_t address);
float read_f32(uint16_t address);
uint32_t read_u32(uint16_t address);
cm_answer write_word(uint16_t address, uint16_t word);
cm_answer write_f32(uint16_t address, float value);
/* The window from the index on; the number of samples. */
uint16_t read_window(uint32_t index, uint16_t window[CM_WINDOW_WORDS]);

#endif
