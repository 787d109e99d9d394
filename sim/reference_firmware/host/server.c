/* The firmware behind libmodbus: TCP for any number of masters, or one serial line. */
#define _POSIX_C_SOURCE 200809L
#include "server.h"

#include <errno.h>
#include <modbus.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <unistd.h>

#include "bench.h"
#include "pace.h"

enum { READ = 3, WRITE_ONE = 6, WRITE = 16, EXCHANGE = 23, TICK_US = 2000, LINK_FAILED = 5 };

static volatile sig_atomic_t is_stopped;

static void stop(int number)
{
    (void)number;
    is_stopped = 1;
}

static uint16_t word_at(const uint8_t *bytes)
{
    return (uint16_t)(bytes[0] << 8 | bytes[1]);
}

static cm_answer write_half(cm_drive *drive, uint16_t address, uint16_t count, const uint8_t *bytes)
{
    uint16_t words[CM_LONGEST_WRITE];
    if (count == 0 || count > CM_LONGEST_WRITE)
        return CM_BAD_VALUE;
    for (int k = 0; k < count; k++)
        words[k] = word_at(&bytes[2 * k]);
    return cm_write(drive, address, count, words);
}

/* libmodbus answers function 23 from its own table after it has copied the request's words there: let it copy what the
 * firmware holds. */
static void show_what_is_held(const cm_drive *drive, uint16_t address, uint16_t count, uint8_t *bytes)
{
    for (int k = 0; k < count; k++) {
        bytes[2 * k] = (uint8_t)(drive->image[address + k] >> 8);
        bytes[2 * k + 1] = (uint8_t)drive->image[address + k];
    }
}

static cm_answer read_half(cm_drive *drive, modbus_mapping_t *table, uint16_t address, uint16_t count)
{
    bool is_window = address == CM_WINDOW;
    uint16_t words[CM_LONGEST_READ];
    pace_request(drive, is_window ? count : 0);
    cm_answer why = cm_read(drive, address, count, words);
    if (why == CM_OK)
        memcpy(&table->tab_registers[address], words, count * sizeof *words);
    return why;
}

/* What the firmware says to the request's PDU; the table then holds what libmodbus answers from. */
static cm_answer carry_out(cm_drive *drive, modbus_mapping_t *table, uint8_t *pdu)
{
    cm_answer why;
    uint16_t address = word_at(&pdu[1]), count = word_at(&pdu[3]);
    switch (pdu[0]) {
    case READ:
        return read_half(drive, table, address, count);
    case WRITE_ONE:
        pace_request(drive, 0);
        return write_half(drive, address, 1, &pdu[3]);
    case WRITE:
        pace_request(drive, 0);
        return write_half(drive, address, count, &pdu[6]);
    case EXCHANGE:
        if (count == 0 || count > CM_LONGEST_READ)
            return CM_BAD_VALUE;
        if (!cm_is_mapped(address, count))
            return CM_NO_SUCH_ADDRESS;
        why = write_half(drive, word_at(&pdu[5]), word_at(&pdu[7]), &pdu[10]);
        if (why != CM_OK)
            return why;
        why = read_half(drive, table, address, count);
        show_what_is_held(drive, word_at(&pdu[5]), word_at(&pdu[7]), &pdu[10]);
        return why;
    default:
        return CM_NO_SUCH_FUNCTION;
    }
}

/* One request from the line; false where it has gone. */
static bool answer_one(modbus_t *line, cm_drive *drive, modbus_mapping_t *table)
{
    uint8_t request[MODBUS_MAX_ADU_LENGTH];
    int length = modbus_receive(line, request);
    if (length <= 0) /* 0: a frame for another unit; -1 on a serial line: a damaged frame */
        return length == 0 || (errno != ECONNRESET && errno != EBADF && errno != EIO);
    cm_answer why = carry_out(drive, table, &request[modbus_get_header_length(line)]);
    if (why != CM_OK)
        return modbus_reply_exception(line, request, (unsigned)why) >= 0;
    return modbus_reply(line, request, length, table) >= 0;
}

static int serve_serial(cm_drive *drive, const server_options *options, modbus_mapping_t *table)
{
    modbus_t *line = modbus_new_rtu(options->rtu, options->baud, options->parity, 8, 1);
    if (!line || modbus_set_slave(line, 1) < 0 || modbus_connect(line) < 0)
        return LINK_FAILED;
    printf("listening rtu %s\n", options->rtu);
    fflush(stdout);
    while (!is_stopped) {
        fd_set ready;
        struct timeval tick = {0, TICK_US};
        FD_ZERO(&ready);
        FD_SET(modbus_get_socket(line), &ready);
        if (select(modbus_get_socket(line) + 1, &ready, 0, 0, &tick) > 0 && !answer_one(line, drive, table))
            return LINK_FAILED;
        pace_keep(drive);
    }
    modbus_close(line);
    modbus_free(line);
    return 0;
}

static int listen_on(modbus_t *line)
{
    struct sockaddr_in address;
    socklen_t size = sizeof address;
    int listener = modbus_tcp_listen(line, 4);
    if (listener < 0 || getsockname(listener, (struct sockaddr *)&address, &size) < 0)
        return -1;
    printf("listening tcp 127.0.0.1:%d\n", ntohs(address.sin_port));
    fflush(stdout);
    return listener;
}

static void accept_master(int listener, fd_set *open, int *highest)
{
    int yes = 1, master = accept(listener, 0, 0);
    if (master < 0)
        return;
    if (master >= FD_SETSIZE) {
        close(master);
        return;
    }
    setsockopt(master, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    FD_SET(master, open);
    *highest = master > *highest ? master : *highest;
}

static int serve_tcp(cm_drive *drive, const server_options *options, modbus_mapping_t *table)
{
    modbus_t *line = modbus_new_tcp("127.0.0.1", options->tcp_port);
    int listener = line ? listen_on(line) : -1, highest = listener;
    fd_set open;
    if (listener < 0)
        return LINK_FAILED;
    FD_ZERO(&open);
    FD_SET(listener, &open);
    while (!is_stopped) {
        fd_set ready = open;
        struct timeval tick = {0, TICK_US};
        if (select(highest + 1, &ready, 0, 0, &tick) > 0)
            for (int s = 0; s <= highest; s++) {
                if (!FD_ISSET(s, &ready))
                    continue;
                if (s == listener) {
                    accept_master(listener, &open, &highest);
                    continue;
                }
                modbus_set_socket(line, s);
                if (!answer_one(line, drive, table)) {
                    FD_CLR(s, &open);
                    close(s);
                }
            }
        pace_keep(drive);
    }
    close(listener);
    modbus_free(line);
    return 0;
}

int serve(cm_drive *drive, const server_options *options)
{
    struct sigaction on_stop;
    memset(&on_stop, 0, sizeof on_stop);
    on_stop.sa_handler = stop;
    sigaction(SIGINT, &on_stop, 0);
    sigaction(SIGTERM, &on_stop, 0);
    modbus_mapping_t *table = modbus_mapping_new(0, 0, CM_IMAGE_WORDS, 0);
    if (!table)
        return LINK_FAILED;
    pace_start(options->speed);
    int code = options->rtu ? serve_serial(drive, options, table) : serve_tcp(drive, options, table);
    cm_control(drive, 0);
    modbus_mapping_free(table);
    return code;
}
