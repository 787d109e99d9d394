#include "testing.h"

void test_map(void);

static void items_are_sorted_and_do_not_overlap(void)
{
    for (int k = 1; k < cm_item_count; k++)
        CHECK(cm_items[k].address >= cm_items[k - 1].address + cm_words(&cm_items[k - 1]));
    CHECK(cm_items[cm_item_count - 1].address + cm_words(&cm_items[cm_item_count - 1]) == CM_IMAGE_WORDS);
}

static void every_register_of_an_item_finds_it_and_no_other(void)
{
    int covered = 0, found = 0;
    for (int k = 0; k < cm_item_count; k++)
        covered += cm_words(&cm_items[k]);
    for (unsigned address = 0; address < 0x10000; address++) {
        const cm_item *item = cm_find_item((uint16_t)address);
        found += item != 0;
        CHECK(!item || (address >= item->address && address < item->address + (unsigned)cm_words(item)));
        CHECK(cm_is_mapped((uint16_t)address, 1) == (item != 0));
    }
    CHECK(found == covered);
}

static void the_crc_is_the_catalogues(void)
{
    /* CRC-16/MODBUS of "123456789" is 0x4B37; here over whole registers: "12345678" is 0x37DD (computed by bytes) */
    const uint16_t words[] = {0x3132, 0x3334, 0x3536, 0x3738};
    uint16_t by_bytes = 0xFFFF;
    const char *text = "123456789";
    for (int k = 0; k < 9; k++) {
        if (k == 8)
            CHECK(cm_crc16(0xFFFF, words, 4) == by_bytes);
        by_bytes ^= (uint8_t)text[k];
        for (int bit = 0; bit < 8; bit++)
            by_bytes = (uint16_t)(by_bytes & 1 ? by_bytes >> 1 ^ 0xA001 : by_bytes >> 1);
    }
    CHECK(by_bytes == 0x4B37);
}

static void numbers_come_back_from_their_words(void)
{
    uint16_t words[2];
    cm_put_u32(words, 0x12345678u);
    CHECK(words[0] == 0x1234 && words[1] == 0x5678 && cm_get_u32(words) == 0x12345678u);
    cm_put_f32(words, -1.5f);
    CHECK(words[0] == 0xBFC0 && words[1] == 0 && cm_get_f32(words) == -1.5f);
}

void test_map(void)
{
    items_are_sorted_and_do_not_overlap();
    every_register_of_an_item_finds_it_and_no_other();
    the_crc_is_the_catalogues();
    numbers_come_back_from_their_words();
}
