/* The bench of the host build: motor, power stage, sensors and clock behind the firmware's port layer. */
#ifndef BENCH_H
#define BENCH_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "motor.h"

typedef struct {
    motor motor;
    double time_s;                       /* motor time */
    double axis_voltage[2];              /* alpha, beta of the present control period */
    bool is_on;
    bool runs_on_motor_time;             /* the millisecond clock: motor time, or the wall's */
    uint64_t random;
    uint16_t interlocks, hardware_trip;
    const char *memory_file;             /* NULL: kept in this process only */
    bool memory_fails;
} bench;

extern bench the_bench;

void bench_start(uint64_t seed, const char *memory_file);
/* One control period with the voltage the firmware applied. */
void bench_advance_period(void);
/* Time without output. */
void bench_coast(double seconds);
double wall_seconds(void);
/* The answer key as one JSON line. */
void bench_print_truth(FILE *out);

#endif
