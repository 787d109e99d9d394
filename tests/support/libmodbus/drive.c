/* A Modbus server on libmodbus that behaves as its options say: a commercial drive as far as registers go.
 *
 *   --tcp PORT | --rtu PATH     0: any free port; prints "listening tcp 127.0.0.1:PORT"
 *   --set A=V,V,...             registers from A on; every other address is exception 2
 *   --functions 3,6,16          others are exception 1
 *   --max-read N --max-write N  longer blocks are exception 3
 *   --delay MS                  before every answer
 *   --enter A,A,...             registers written are in use, and read back, after a write to one of these
 *   --coil A=V
 *   --watchdog MS:A:BIT         silence longer than MS sets BIT of register A, for good
 *   --busy CODE:N:A             the first N requests that touch A are answered with exception CODE
 *   --later CODE:MS:A           a write to A is answered with exception CODE and carried out MS later
 *   --unit N                    TCP answers come from unit N, whoever was asked
 *   --lose-write A              the first write to A is carried out, its answer lost
 *   --trip-on A:S:BIT           a write to A sets BIT of register S
 *
 * SIGTERM: one JSON line: "registers", "coils", "requests" [[function, address, count]], "tripped".
 */
#include <errno.h>
#include <modbus.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <netinet/in.h>
#include <arpa/inet.h>
#include <time.h>
#include <unistd.h>

#define WORDS 65536
#define REQUESTS 20000

static modbus_mapping_t *map;
static uint16_t staged[WORDS];
static unsigned char known[WORDS], is_staged[WORDS];
static int functions[256], any_function = 1, max_read = 125, max_write = 123, delay_ms;
static int enter[8], enters, busy_code, busy_left, busy_at = -1, lose_at = -1;
static int later_code, later_ms, later_at = -1, later_address, later_count, unit = -1;
static double later_s;
static uint16_t later_words[128];
static int watchdog_ms, watchdog_at, watchdog_bit, tripped, trip_on = -1, trip_at, trip_bit;
static int log_of[REQUESTS][3], requests;
static volatile sig_atomic_t stop;

static void on_term(int signal_number) { (void)signal_number; stop = 1; }

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static void set(const char *text)
{
    char *at = NULL;
    long address = strtol(text, &at, 0);
    while (*at) {
        long value = strtol(at + 1, &at, 0);
        map->tab_registers[address] = (uint16_t)value;
        known[address++] = 1;
    }
}

static int touches(int address, int count, int wanted) { return address <= wanted && wanted < address + count; }

static void take(int address, uint16_t value)
{
    int is_enter = 0;
    for (int k = 0; k < enters; k++) is_enter |= enter[k] == address;
    if (is_enter) {
        for (int k = 0; k < WORDS; k++)
            if (is_staged[k]) { map->tab_registers[k] = staged[k]; is_staged[k] = 0; }
    } else if (enters) {
        staged[address] = value;
        is_staged[address] = 1;
    } else {
        map->tab_registers[address] = value;
    }
    if (address == trip_on) { map->tab_registers[trip_at] |= (uint16_t)(1 << trip_bit); tripped = 1; }
}

/* The PDU starts at `p`. Returns an exception code, 0: answer it, -1: stay silent. */
static int judge(const uint8_t *p, int write, int address, int count)
{
    if (!any_function && !functions[p[0]]) return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
    if (p[0] == 1 || p[0] == 5) return 0;
    if (count > (write ? max_write : max_read)) return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
    for (int k = 0; k < count; k++)
        if (address + k >= WORDS || !known[address + k]) return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    if (busy_left > 0 && touches(address, count, busy_at)) { busy_left--; return busy_code; }
    return 0;
}

static void answer(modbus_t *bus, const uint8_t *request, int length)
{
    const uint8_t *p = request + modbus_get_header_length(bus);
    int address = p[1] << 8 | p[2], number = p[3] << 8 | p[4];
    int write = p[0] == 6 || p[0] == 16;
    int count = p[0] == 6 || p[0] == 5 ? 1 : number;
    if (requests < REQUESTS) { log_of[requests][0] = p[0]; log_of[requests][1] = address; log_of[requests++][2] = count; }
    if (delay_ms) usleep(1000 * delay_ms);
    int code = judge(p, write, address, count);
    if (unit >= 0) ((uint8_t *)request)[6] = (uint8_t)unit;
    if (code == 0 && write && touches(address, count, later_at)) {
        later_s = now_s() + 1e-3 * later_ms;
        later_address = address;
        later_count = count;
        for (int k = 0; k < count; k++)
            later_words[k] = (uint16_t)(p[0] == 6 ? number : p[6 + 2 * k] << 8 | p[7 + 2 * k]);
        code = later_code;
    }
    if (code > 0) { modbus_reply_exception(bus, request, code); return; }
    if (write) {
        uint16_t before[128];
        memcpy(before, map->tab_registers + address, sizeof(uint16_t) * count);
        for (int k = 0; k < count; k++)
            take(address + k, (uint16_t)(p[0] == 6 ? number : p[6 + 2 * k] << 8 | p[7 + 2 * k]));
        if (touches(address, count, lose_at)) { lose_at = -1; return; }
        uint16_t after[128];   /* libmodbus' own writing is undone: what counts is what `take` made of it */
        memcpy(after, map->tab_registers + address, sizeof(uint16_t) * count);
        modbus_reply(bus, request, length, map);
        memcpy(map->tab_registers + address, after, sizeof(uint16_t) * count);
        return;
    }
    modbus_reply(bus, request, length, map);
}

static void tell(void)
{
    const char *comma = "";
    printf("{\"registers\": {");
    for (int k = 0; k < WORDS; k++)
        if (known[k]) { printf("%s\"%d\": %d", comma, k, map->tab_registers[k]); comma = ", "; }
    printf("}, \"coils\": {");
    comma = "";
    for (int k = 0; k < 256; k++) { printf("%s\"%d\": %d", comma, k, map->tab_bits[k]); comma = ", "; }
    printf("}, \"tripped\": %d, \"requests\": [", tripped);
    for (int k = 0; k < requests; k++) printf("%s[%d, %d, %d]", k ? ", " : "", log_of[k][0], log_of[k][1], log_of[k][2]);
    printf("]}\n");
    fflush(stdout);
}

static double heard_s;

static void starve(void)
{
    if (later_s > 0 && now_s() > later_s) {
        later_s = 0;
        for (int k = 0; k < later_count; k++) take(later_address + k, later_words[k]);
    }
    if (watchdog_ms && heard_s > 0 && now_s() - heard_s > 1e-3 * watchdog_ms) {
        map->tab_registers[watchdog_at] |= (uint16_t)(1 << watchdog_bit);
        tripped = 1;
    }
}

static void serve_line(modbus_t *bus, int descriptor)
{
    uint8_t request[MODBUS_TCP_MAX_ADU_LENGTH];
    while (!stop) {
        struct pollfd ready = {descriptor, POLLIN, 0};
        int n = poll(&ready, 1, 20);
        starve();
        if (n <= 0) continue;
        int length = modbus_receive(bus, request);
        if (length < 0) return;
        heard_s = now_s();
        if (length > 0) answer(bus, request, length);
    }
}

static void serve_tcp(int port)
{
    modbus_t *bus = modbus_new_tcp("127.0.0.1", port ? port : 1502);
    int one = 1, listener = socket(AF_INET, SOCK_STREAM, 0);
    struct sockaddr_in here = {0};
    socklen_t size = sizeof here;
    here.sin_family = AF_INET;
    here.sin_port = htons((uint16_t)port);
    here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (bind(listener, (struct sockaddr *)&here, size) || listen(listener, 4)) { perror("bind"); exit(5); }
    getsockname(listener, (struct sockaddr *)&here, &size);
    printf("listening tcp 127.0.0.1:%d\n", ntohs(here.sin_port));
    fflush(stdout);
    while (!stop) {
        struct pollfd ready = {listener, POLLIN, 0};
        if (poll(&ready, 1, 20) <= 0) { starve(); continue; }
        int line = accept(listener, NULL, NULL);
        modbus_set_socket(bus, line);
        serve_line(bus, line);
        close(line);
    }
    modbus_free(bus);
}

static void serve_rtu(const char *path)
{
    modbus_t *bus = modbus_new_rtu(path, 115200, 'N', 8, 1);
    modbus_set_slave(bus, 1);
    if (modbus_connect(bus)) { perror(path); exit(5); }
    printf("listening rtu %s\n", path);
    fflush(stdout);
    while (!stop) serve_line(bus, modbus_get_socket(bus));
    modbus_free(bus);
}

int main(int argc, char **argv)
{
    int port = -1;
    const char *path = NULL;
    struct sigaction action = {0};
    action.sa_handler = on_term;
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGINT, &action, NULL);
    map = modbus_mapping_new(256, 0, WORDS, 0);
    for (int k = 1; k + 1 < argc; k += 2) {
        const char *name = argv[k], *text = argv[k + 1];
        if (!strcmp(name, "--tcp")) port = atoi(text);
        else if (!strcmp(name, "--rtu")) path = text;
        else if (!strcmp(name, "--set")) set(text);
        else if (!strcmp(name, "--max-read")) max_read = atoi(text);
        else if (!strcmp(name, "--max-write")) max_write = atoi(text);
        else if (!strcmp(name, "--delay")) delay_ms = atoi(text);
        else if (!strcmp(name, "--lose-write")) lose_at = atoi(text);
        else if (!strcmp(name, "--watchdog")) sscanf(text, "%d:%d:%d", &watchdog_ms, &watchdog_at, &watchdog_bit);
        else if (!strcmp(name, "--later")) sscanf(text, "%d:%d:%i", &later_code, &later_ms, &later_at);
        else if (!strcmp(name, "--unit")) unit = atoi(text);
        else if (!strcmp(name, "--busy")) sscanf(text, "%d:%d:%d", &busy_code, &busy_left, &busy_at);
        else if (!strcmp(name, "--trip-on")) sscanf(text, "%d:%d:%d", &trip_on, &trip_at, &trip_bit);
        else if (!strcmp(name, "--coil")) { int a, v; sscanf(text, "%d=%d", &a, &v); map->tab_bits[a] = (uint8_t)v; }
        else if (!strcmp(name, "--functions") || !strcmp(name, "--enter")) {
            char *at = (char *)text - 1;
            do {
                int number = (int)strtol(at + 1, &at, 0);
                if (name[2] == 'f') { functions[number] = 1; any_function = 0; } else { enter[enters++] = number; known[number] = 1; }
            } while (*at == ',');
        } else { fprintf(stderr, "unknown option %s\n", name); return 2; }
    }
    if (path) serve_rtu(path); else serve_tcp(port);
    tell();
    return 0;
}
