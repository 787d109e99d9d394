/* The sample ring of a session, and the idempotent window into it. */
#include <string.h>

#include "cm_drive.h"

void cm_start_ring(cm_drive *drive)
{
    cm_ring *ring = &drive->ring;
    ring->produced = ring->next_unread = ring->overruns = 0;
    ring->decimation = drive->image[CM_DECIMATION];
    ring->mask = drive->image[CM_CHANNEL_MASK];
    ring->in_mean = 0;
    ring->flags_in_mean = 0;
    ring->has_ended = false;
    memset(ring->sum, 0, sizeof ring->sum);
}

/* Nearest whole mean, halves upwards. */
static int16_t mean(int32_t sum, int32_t count)
{
    int32_t twice = 2 * sum + count, divisor = 2 * count;
    int32_t whole = twice / divisor;
    if (twice % divisor < 0)
        whole--;
    return (int16_t)whole;
}

void cm_add_sample(cm_ring *ring, int16_t voltage, const int16_t currents[3], uint8_t flags)
{
    ring->sum[0] += voltage;
    for (int phase = 0; phase < 3; phase++)
        ring->sum[1 + phase] += currents[phase];
    ring->flags_in_mean |= flags;
    if (++ring->in_mean < ring->decimation)
        return;
    uint32_t row = ring->produced % CM_RING_SAMPLES;
    for (int channel = 0; channel < CM_CHANNELS; channel++)
        ring->sample[row][channel] = mean(ring->sum[channel], ring->in_mean);
    ring->flags[row] = ring->flags_in_mean;
    memset(ring->sum, 0, sizeof ring->sum);
    ring->in_mean = 0;
    ring->flags_in_mean = 0;
    ring->produced++;
}

static uint16_t channels_of(uint16_t mask)
{
    uint16_t count = 0;
    for (; mask; mask >>= 1)
        count += mask & 1;
    return count;
}

/* Copies the samples in mask order; returns the flags they carry. */
static uint16_t copy_samples(const cm_ring *ring, uint32_t first, uint16_t count, uint16_t *data)
{
    uint16_t flags = 0;
    for (uint16_t k = 0; k < count; k++) {
        uint32_t row = (first + k) % CM_RING_SAMPLES;
        flags |= ring->flags[row];
        for (int channel = 0; channel < CM_CHANNELS; channel++)
            if (ring->mask >> channel & 1)
                *data++ = (uint16_t)ring->sample[row][channel];
    }
    return flags;
}

static uint16_t link_counts(void)
{
    float counts = cm_port_dc_link_v() / cm_port_ratings()->dc_link_scale_v + 0.5f;
    return counts < 0.0f ? 0 : (counts > 32767.0f ? 32767 : (uint16_t)counts);
}

void cm_build_window(cm_drive *drive, uint16_t registers)
{
    cm_ring *ring = &drive->ring;
    uint16_t *window = &drive->image[CM_WINDOW];
    uint16_t channels = channels_of(ring->mask), used = 0, flags = 0;
    uint16_t room = (uint16_t)(registers > CM_WINDOW_HEADER && channels ? (registers - CM_WINDOW_HEADER) / channels : 0);
    uint32_t wanted = cm_get_u32(&drive->image[CM_WINDOW_INDEX]);

    memset(window, 0, CM_WINDOW_WORDS * sizeof *window);
    cm_port_lock();
    uint32_t produced = ring->produced;
    uint32_t oldest = produced > CM_RING_SAMPLES ? produced - CM_RING_SAMPLES : 0;
    uint32_t first = wanted < oldest ? oldest : wanted;
    uint32_t ready = first < produced ? produced - first : 0;
    uint16_t count = ready < room ? (uint16_t)ready : room;
    if (oldest > ring->next_unread) {
        ring->overruns += oldest - ring->next_unread;
        ring->next_unread = oldest;
    }
    flags = copy_samples(ring, first, count, window + CM_WINDOW_HEADER);
    if (count && first + count > ring->next_unread)
        ring->next_unread = first + count;
    flags |= drive->state == CM_ENABLED ? CM_FLAG_RUNNING : 0;
    flags |= wanted < oldest ? CM_FLAG_OVERRUN : 0;
    flags |= ring->has_ended && ready <= count ? CM_FLAG_ENDED : 0;
    cm_port_unlock();

    used = (uint16_t)(count * channels);
    window[0] = drive->session;
    cm_put_u32(&window[1], first);
    window[3] = count;
    window[4] = ring->mask;
    window[5] = flags;
    window[6] = link_counts();
    window[7] = cm_crc16(cm_crc16(0xFFFF, window, CM_WINDOW_HEADER - 1), window + CM_WINDOW_HEADER, used);
}
