/* Modbus functions 3, 6, 16 and 23 on bytes: for a drive that has no stack of its own. */
#include "cm_drive.h"

enum { READ = 3, WRITE_ONE = 6, WRITE = 16, EXCHANGE = 23 };

static uint16_t word_at(const uint8_t *bytes)
{
    return (uint16_t)(bytes[0] << 8 | bytes[1]);
}

static size_t refuse(uint8_t function, cm_answer why, uint8_t *answer)
{
    answer[0] = (uint8_t)(function | 0x80);
    answer[1] = (uint8_t)why;
    return 2;
}

static cm_answer write_bytes(cm_drive *drive, uint16_t address, uint16_t count, const uint8_t *bytes)
{
    uint16_t words[CM_LONGEST_WRITE];
    for (uint16_t k = 0; k < count; k++)
        words[k] = word_at(&bytes[2 * k]);
    return cm_write(drive, address, count, words);
}

static cm_answer read_bytes(cm_drive *drive, uint16_t address, uint16_t count, uint8_t *bytes)
{
    uint16_t words[CM_LONGEST_READ];
    cm_answer why = cm_read(drive, address, count, words);
    for (uint16_t k = 0; why == CM_OK && k < count; k++) {
        bytes[2 * k] = (uint8_t)(words[k] >> 8);
        bytes[2 * k + 1] = (uint8_t)words[k];
    }
    return why;
}

static size_t answer_read(cm_drive *drive, const uint8_t *request, size_t at, uint8_t *answer)
{
    uint16_t count = word_at(&request[at + 2]);
    cm_answer why = read_bytes(drive, word_at(&request[at]), count, &answer[2]);
    if (why != CM_OK)
        return refuse(request[0], why, answer);
    answer[0] = request[0];
    answer[1] = (uint8_t)(2 * count);
    return 2 + 2 * (size_t)count;
}

static size_t answer_write_one(cm_drive *drive, const uint8_t *request, uint8_t *answer)
{
    cm_answer why = write_bytes(drive, word_at(&request[1]), 1, &request[3]);
    if (why != CM_OK)
        return refuse(WRITE_ONE, why, answer);
    for (int k = 0; k < 5; k++)
        answer[k] = request[k];
    return 5;
}

/* The write half of functions 16 and 23: `at` is where address, count and byte count stand. */
static cm_answer write_half(cm_drive *drive, const uint8_t *request, size_t at, size_t length)
{
    uint16_t count = word_at(&request[at + 2]);
    if (count == 0 || count > CM_LONGEST_WRITE || request[at + 4] != 2 * count || length != at + 5 + 2 * (size_t)count)
        return CM_BAD_VALUE;
    return write_bytes(drive, word_at(&request[at]), count, &request[at + 5]);
}

static size_t answer_write(cm_drive *drive, const uint8_t *request, size_t length, uint8_t *answer)
{
    cm_answer why = write_half(drive, request, 1, length);
    if (why != CM_OK)
        return refuse(WRITE, why, answer);
    for (int k = 0; k < 5; k++)
        answer[k] = request[k];
    return 5;
}

static size_t answer_exchange(cm_drive *drive, const uint8_t *request, size_t length, uint8_t *answer)
{
    uint16_t read_count = word_at(&request[3]);
    if (read_count == 0 || read_count > CM_LONGEST_READ)
        return refuse(EXCHANGE, CM_BAD_VALUE, answer);
    if (!cm_is_mapped(word_at(&request[1]), read_count))
        return refuse(EXCHANGE, CM_NO_SUCH_ADDRESS, answer);
    cm_answer why = write_half(drive, request, 5, length);
    if (why != CM_OK)
        return refuse(EXCHANGE, why, answer);
    return answer_read(drive, request, 1, answer);
}

size_t cm_answer_pdu(cm_drive *drive, const uint8_t *request, size_t length, uint8_t *answer)
{
    if (length == 0)
        return 0;
    switch (request[0]) {
    case READ:
        return length == 5 ? answer_read(drive, request, 1, answer) : refuse(READ, CM_BAD_VALUE, answer);
    case WRITE_ONE:
        return length == 5 ? answer_write_one(drive, request, answer) : refuse(WRITE_ONE, CM_BAD_VALUE, answer);
    case WRITE:
        return length >= 6 ? answer_write(drive, request, length, answer) : refuse(WRITE, CM_BAD_VALUE, answer);
    case EXCHANGE:
        return length >= 10 ? answer_exchange(drive, request, length, answer) : refuse(EXCHANGE, CM_BAD_VALUE, answer);
    default:
        return refuse((uint8_t)(request[0] & 0x7F), CM_NO_SUCH_FUNCTION, answer);
    }
}
