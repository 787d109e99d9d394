#include <string.h>

#include "testing.h"

void test_pdu(void);

static uint8_t answer[253];

static void functions_answer_as_the_standard_asks(void)
{
    static const uint8_t read[] = {3, 0, 0, 0, 2}, one[] = {6, 0, CM_ECHO, 0xA5, 0xC3};
    static const uint8_t more[] = {16, 0, CM_ECHO, 0, 1, 2, 0x12, 0x34};
    static const uint8_t exchange[] = {23, 0, CM_ECHO, 0, 1, 0, CM_ECHO, 0, 1, 2, 0x56, 0x78};
    fresh_drive();
    CHECK(cm_answer_pdu(&drive, read, sizeof read, answer) == 6 && !memcmp(answer, "\x03\x04" "CMSR", 6));
    CHECK(cm_answer_pdu(&drive, one, sizeof one, answer) == 5 && !memcmp(answer, one, 5));
    CHECK(read_word(CM_ECHO) == 0xA5C3);
    CHECK(cm_answer_pdu(&drive, more, sizeof more, answer) == 5 && !memcmp(answer, more, 5));
    CHECK(read_word(CM_ECHO) == 0x1234);
    CHECK(cm_answer_pdu(&drive, exchange, sizeof exchange, answer) == 4 && !memcmp(answer, "\x17\x02\x56\x78", 4));
}

static uint8_t exception_of(const uint8_t *request, size_t length)
{
    size_t size = cm_answer_pdu(&drive, request, length, answer);
    return size == 2 && answer[0] == (request[0] | 0x80) ? answer[1] : 0;
}

static void what_is_wrong_gets_its_exception(void)
{
    static const uint8_t unknown[] = {0x2B, 14, 1, 0}, far[] = {3, 0xFF, 0xFF, 0, 1}, many[] = {3, 1, 0, 0, 126};
    static const uint8_t none[] = {3, 0, 0, 0, 0}, cut[] = {16, 0, CM_ECHO, 0, 2, 4, 1, 2};
    static const uint8_t lying[] = {16, 0, CM_ECHO, 0, 1, 4, 1, 2, 3, 4}, fixed[] = {6, 0, 0, 0, 1};
    static const uint8_t unread[] = {23, 0xFF, 0, 0, 1, 0, CM_ECHO, 0, 1, 2, 0x11, 0x11};
    fresh_drive();
    write_word(CM_ECHO, 0x2222);
    CHECK(exception_of(unknown, sizeof unknown) == 1 && exception_of(far, sizeof far) == 2);
    CHECK(exception_of(many, sizeof many) == 3 && exception_of(none, sizeof none) == 3);
    CHECK(exception_of(cut, sizeof cut) == 3 && exception_of(lying, sizeof lying) == 3);
    CHECK(exception_of(fixed, sizeof fixed) == 2 && exception_of(unread, sizeof unread) == 2);
    CHECK(read_word(CM_ECHO) == 0x2222);
    CHECK(cm_answer_pdu(&drive, far, 0, answer) == 0);
}

void test_pdu(void)
{
    functions_answer_as_the_standard_asks();
    what_is_wrong_gets_its_exception();
}
