/* The commissioning map as firmware: no allocation, one structure, five entry points.
 *
 *   cm_power_up            once, before anything else
 *   cm_control_interrupt   every control period, as its first act, after the currents were sampled
 *   cm_background          from the main loop, at least every 10 ms: watchdog, temperatures, commit, store
 *   cm_read, cm_write      register access for the Modbus stack (functions 3, 6, 16 and 23); or cm_answer_pdu, which is
 *                          those functions on bytes, for a drive without a stack
 */
#ifndef CM_DRIVE_H
#define CM_DRIVE_H

#include <stddef.h>

#include "cm_map.h"
#include "cm_port.h"

#ifndef CM_RING_SAMPLES
#define CM_RING_SAMPLES 4096u        /* 9 bytes each; at 5 kHz the reader may be 0.8 s late */
#endif

/* Signal generator: u = bias + scale * sum A_k cos(2 pi f_k t + phi_k), t = 0 at enable. Ramps count in 1e-9. */
typedef struct {
    int tones;
    float amplitude_v[CM_TONE_LIMIT];
    uint32_t turn[CM_TONE_LIMIT], turn_step[CM_TONE_LIMIT];   /* 2^32 = one period */
    int64_t bias, bias_target, bias_step, bias_last_step;     /* nV */
    int64_t scale, scale_target, scale_step, scale_last_step; /* 1e-9 */
    uint32_t period, last_period, time_limit_period;
    float cos_axis, sin_axis, limit_v;
} cm_excitation;

/* Samples of one session. `flags` holds clipped and clamped per sample. */
typedef struct {
    int16_t sample[CM_RING_SAMPLES][CM_CHANNELS];
    uint8_t flags[CM_RING_SAMPLES];
    uint32_t produced, next_unread, overruns;
    int32_t sum[CM_CHANNELS];
    uint16_t in_mean, decimation, mask;
    uint8_t flags_in_mean;
    bool has_ended;
} cm_ring;

typedef struct {
    uint16_t image[CM_IMAGE_WORDS];  /* the register file; read-only items are refreshed when they are read */
    volatile cm_state state;
    uint16_t fault, trip_cause;
    float trip_value, trip_limit;
    uint16_t session, last_control, heartbeat_echo;
    uint32_t fed_at_ms, claimed_at_ms;
    uint16_t settings_count;
    float trip_current_a, largest_current_a;
    cm_excitation excitation;
    cm_ring ring;
    cm_memory memory;
    uint16_t commit_result, store_result;
} cm_drive;

void cm_power_up(cm_drive *drive);
void cm_control_interrupt(cm_drive *drive);
void cm_background(cm_drive *drive);
cm_answer cm_read(cm_drive *drive, uint16_t address, uint16_t count, uint16_t *words);
cm_answer cm_write(cm_drive *drive, uint16_t address, uint16_t count, const uint16_t *words);
/* The answer to a request PDU (without unit and check sum); 0 = stay silent. `answer` takes 253 bytes. */
size_t cm_answer_pdu(cm_drive *drive, const uint8_t *request, size_t length, uint8_t *answer);

/* --- between the files of the firmware --- */
void cm_refresh(cm_drive *drive);                          /* cm_status.c */
void cm_control(cm_drive *drive, uint16_t word);           /* cm_states.c */
void cm_feed(cm_drive *drive, uint16_t heartbeat);
void cm_leave(cm_drive *drive, cm_state state);
void cm_trip(cm_drive *drive, uint16_t cause, float value, float limit);
bool cm_may_enable(const cm_drive *drive);
void cm_latch_excitation(cm_drive *drive);                 /* cm_excitation.c */
void cm_take_live(cm_drive *drive);
bool cm_next_voltage(cm_excitation *excitation, float *volts); /* false: the excitation is over */
void cm_start_ring(cm_drive *drive);                       /* cm_ring.c */
void cm_add_sample(cm_ring *ring, int16_t voltage, const int16_t currents[3], uint8_t flags);
void cm_build_window(cm_drive *drive, uint16_t registers);
bool cm_admits(const cm_drive *drive, uint32_t token);     /* cm_claim.c */
void cm_renew_claim(cm_drive *drive);
void cm_refresh_claim(cm_drive *drive);
void cm_count_change(cm_drive *drive, uint16_t address, uint16_t count, const uint16_t *words);
void cm_load_parameters(cm_drive *drive);                  /* cm_parameters.c */
void cm_begin_commit(cm_drive *drive);
void cm_begin_store(cm_drive *drive);
void cm_finish_parameters(cm_drive *drive);

#endif
