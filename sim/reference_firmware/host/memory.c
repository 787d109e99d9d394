/* The port layer's clock and non-volatile memory on a computer. */
#define _POSIX_C_SOURCE 200112L
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "bench.h"
#include "cm_port.h"

static cm_memory kept;
static bool is_kept;

double wall_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

uint32_t cm_port_milliseconds(void)
{
    double seconds = the_bench.runs_on_motor_time ? the_bench.time_s : wall_seconds();
    return (uint32_t)(uint64_t)(seconds * 1e3);
}

cm_memory_answer cm_port_memory_read(cm_memory *memory)
{
    FILE *file = the_bench.memory_file ? fopen(the_bench.memory_file, "rb") : 0;
    if (!the_bench.memory_file && is_kept) {
        *memory = kept;
        return CM_MEMORY_READ;
    }
    if (!file)
        return CM_MEMORY_BLANK;
    size_t read = fread(memory, sizeof *memory, 1, file);
    fclose(file);
    return read == 1 ? CM_MEMORY_READ : CM_MEMORY_FAILED;
}

/* Beside the old file, then over it: whole or not at all. */
static bool write_file(const cm_memory *memory)
{
    char beside[1024];
    int length = snprintf(beside, sizeof beside, "%s.part", the_bench.memory_file);
    FILE *file = length > 0 && (size_t)length < sizeof beside ? fopen(beside, "wb") : 0;
    if (!file)
        return false;
    bool is_written = fwrite(memory, sizeof *memory, 1, file) == 1;
    is_written = fclose(file) == 0 && is_written;
    return is_written && rename(beside, the_bench.memory_file) == 0;
}

bool cm_port_memory_write(const cm_memory *memory)
{
    if (the_bench.memory_fails)
        return false;
    if (the_bench.memory_file)
        return write_file(memory);
    kept = *memory;
    is_kept = true;
    return true;
}
