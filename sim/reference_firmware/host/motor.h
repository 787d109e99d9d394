/* An induction motor at standstill, T circuit with a saturating main path. Flux linkages are the states.
 *
 *   d psi_s/dt = u_s - R_s i_s          i_s = (psi_s - psi_m) / L_ls
 *   d psi_r/dt =     - R_r i_r          i_r = (psi_r - psi_m) / L_lr      (stator coordinates, shaft at rest)
 *   i_s + i_r = i_m(|psi_m|) psi_m/|psi_m|,      i_m(psi) = psi/L_0 + I_k sinh(psi/psi_k)
 *
 * psi_m lies along c = psi_s/L_ls + psi_r/L_lr, so that one scalar equation is left:
 * psi (1/L_ls + 1/L_lr) + i_m(psi) = |c|.
 */
#ifndef MOTOR_H
#define MOTOR_H

typedef struct {
    double stator_resistance_ohm, rotor_resistance_ohm, stator_leakage_h, rotor_leakage_h;
    double linear_inductance_h;          /* L_0 */
    double knee_current_a, knee_flux_wb; /* I_k, psi_k */
    double warming_per_a2s;              /* relative rise of both resistances per A^2 s, adiabatic */
} motor_data;

typedef struct { double a, b; } vector;

typedef struct {
    vector stator_flux, rotor_flux;
    double main_flux;                    /* where Newton's iteration starts next time */
    double warmth;                       /* relative rise of the resistances */
    double peak_stator_flux, peak_current;
} motor;

/* What a motor answers to: the terminal voltage (V) for a stator current (A); `context` is the caller's. */
typedef vector (*terminal_voltage)(vector current, void *context);

extern const motor_data motor_of_this_bench;

double magnetizing_current(const motor_data *data, double main_flux);
vector stator_current(const motor_data *data, motor *state);
/* Advance by `seconds` in `steps` of Heun's third-order method. */
void motor_run(const motor_data *data, motor *state, double seconds, int steps, terminal_voltage voltage, void *context);
/* The output is blocked: the diodes have taken the stator current away, the rotor's dies by itself. */
void motor_coast(const motor_data *data, motor *state, double seconds);

#endif
