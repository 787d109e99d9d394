/* reference_firmware: the commissioning map in C on a computer, with a motor, behind libmodbus. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench.h"
#include "server.h"

static const char usage[] =
    "usage: reference_firmware [--tcp PORT | --rtu DEVICE [--baud N] [--parity N|E|O]] [--speed N|max] [--seed N]\n"
    "                          [--nvm FILE] [--truth] [--map]\n";

static cm_drive drive;

/* The item table as lines of address, kind, length, flags: what the drive file is compared with. */
static void print_map(void)
{
    static const char *const kinds[] = {"u16", "u32", "f32", "ascii", "window"};
    for (int k = 0; k < cm_item_count; k++)
        printf("%d %s %d %d\n", cm_items[k].address, kinds[cm_items[k].kind], cm_items[k].length, cm_items[k].flags);
}

static int fail(const char *what)
{
    fprintf(stderr, "reference_firmware: %s\n%s", what, usage);
    return 2;
}

int main(int count, char **argument)
{
    server_options options = {1.0, -1, 115200, 'N', 0};
    const char *memory_file = 0;
    bool shows_truth = false, shows_map = false;
    uint64_t seed = 1;
    for (int k = 1; k < count; k++) {
        const char *name = argument[k], *value = k + 1 < count ? argument[k + 1] : 0;
        if (!strcmp(name, "--truth") || !strcmp(name, "--map")) {
            shows_truth = shows_truth || name[2] == 't';
            shows_map = shows_map || name[2] == 'm';
            continue;
        }
        if (!value)
            return fail(name);
        k++;
        if (!strcmp(name, "--tcp"))
            options.tcp_port = atoi(value);
        else if (!strcmp(name, "--rtu"))
            options.rtu = value;
        else if (!strcmp(name, "--baud"))
            options.baud = atoi(value);
        else if (!strcmp(name, "--parity"))
            options.parity = value[0];
        else if (!strcmp(name, "--speed"))
            options.speed = strcmp(value, "max") ? atof(value) : 0.0;
        else if (!strcmp(name, "--seed"))
            seed = strtoull(value, 0, 10);
        else if (!strcmp(name, "--nvm"))
            memory_file = value;
        else
            return fail(name);
    }
    bench_start(seed, memory_file);
    cm_power_up(&drive);
    if (shows_map)
        print_map();
    int code = options.tcp_port < 0 && !options.rtu ? 0 : serve(&drive, &options);
    if (code)
        fprintf(stderr, "reference_firmware: the line cannot be had\n");
    if (shows_truth)
        bench_print_truth(stdout);
    return code;
}
