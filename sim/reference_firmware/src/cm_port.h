/* What a drive has to supply: the port layer of the commissioning map.
 *
 * Fourteen small functions and one table of facts. Nothing above this line knows the hardware; nothing below it knows
 * the map. See commissioner/docs/porting.md. No function may block longer than a control period, except
 * cm_port_memory_write, which is called from cm_background only.
 */
#ifndef CM_PORT_H
#define CM_PORT_H

#include <stdbool.h>
#include <stdint.h>

/* Facts of the drive that do not change while it is powered. SI units. */
typedef struct {
    char drive_type[17];             /* as `identity.drive_type` of the drive file */
    uint32_t firmware_version;       /* 0x00MMmmpp */
    uint32_t serial_number;
    float rated_current_a;           /* rms, of the drive */
    float control_period_s;
    float switching_frequency_hz;
    float current_scale_a;           /* A per count of cm_port_currents */
    float current_full_scale_a;      /* beyond it the sensor clips */
    float hardware_current_limit_a;  /* the drive trips here whatever it was told */
    float voltage_scale_v;           /* V per count: the grid of the PWM, or finer */
    float largest_voltage_v;         /* phase amplitude the modulator reaches at the lowest DC link */
    float dc_link_scale_v;           /* V per count in the window's header */
    float dc_link_min_v, dc_link_max_v;
    float heatsink_max_degc, winding_max_degc;
    float default_parameters[4];     /* ohm, ohm, mH, mH: in use until the memory was written */
    float rated_power_w, rated_voltage_v, rated_frequency_hz, rated_motor_current_a, rated_speed_rpm, power_factor;
    uint16_t pole_pairs;
} cm_ratings;

/* What is kept without power. */
typedef struct {
    float parameters[4];             /* ohm, ohm, mH, mH */
    uint32_t store_count;
    uint32_t power_ups;
    uint16_t check_sum;              /* of what stands above; the firmware makes and checks it */
} cm_memory;

typedef enum { CM_MEMORY_READ, CM_MEMORY_BLANK, CM_MEMORY_FAILED } cm_memory_answer;

const cm_ratings *cm_port_ratings(void);

/* Power stage. `on` releases the gates with zero voltage; `!on` blocks them at once: also called from the interrupt. */
void cm_port_output(bool on);
/* Mean voltage of the control period that begins now (amplitude-invariant alpha, beta; V). */
void cm_port_apply_voltage(float alpha_v, float beta_v);

/* Measurements. Currents u, v, w in counts, sampled at the start of this control period. */
void cm_port_currents(int16_t counts[3]);
float cm_port_dc_link_v(void);
float cm_port_heatsink_degc(void);
float cm_port_winding_degc(void);    /* NaN where no sensor is fitted */
float cm_port_shaft_speed_rad_per_s(void);

/* Interlocks by CM_INTERLOCK_*, 1 = closed; and what the hardware itself trips on: CM_TRIP_*, 0 = none. */
uint16_t cm_port_interlocks(void);
uint16_t cm_port_hardware_trip(void);

/* A millisecond clock that runs on when communication and interrupt do not; wraps. */
uint32_t cm_port_milliseconds(void);

/* Non-volatile memory: whole or not at all. */
cm_memory_answer cm_port_memory_read(cm_memory *memory);
bool cm_port_memory_write(const cm_memory *memory);

/* Keep the control interrupt out for a few microseconds. Nests; also called from the interrupt itself. */
void cm_port_lock(void);
void cm_port_unlock(void);

#endif
