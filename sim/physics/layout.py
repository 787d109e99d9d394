"""Where each number sits in the flat arrays that the compiled kernels share; one name per slot, nothing else."""

from __future__ import annotations

# machine and power stage, constant during a run -------------------------------------------------------------
(
    P_PERIOD,
    P_SUBSTEPS,
    P_ORDER,
    P_RSA,
    P_RSB,
    P_RSC,
    P_RR,
    P_RR_C,
    P_RR_S,
    P_LEAK_H,
    P_LIN_H,
    P_FLUX_N,
    P_SAT,
    P_SAT_ORDER,
    P_SAT_SHAPE,
    P_SALIENT_C,
    P_SALIENT_S,
    P_LEAKSAT,
    P_LEAKSAT_WB,
    P_LEAKSAT_SHAPE,
    P_ANISO_C,
    P_ANISO_S,
    P_SKIN1_OHM,
    P_SKIN1_H,
    P_SKIN2_OHM,
    P_SKIN2_H,
    P_IRON_S,
    P_EDDY_OHM,
    P_EDDY_H,
    P_HYST_A,
    P_HYST_WB,
    P_HYST_SHAPE,
    P_FLUX0_C,
    P_FLUX0_S,
    P_LINK_V,
    P_LINK_NOMINAL_V,
    P_RIPPLE,
    P_RIPPLE_HZ,
    P_RIPPLE_RAD,
    P_RIPPLE_SHAPE,
    P_SAG_V_PER_W,
    P_SAG_TAU,
    P_SAG_SHAPE,
    P_DEAD_FRACTION,
    P_DEAD_PER_A,
    P_DEAD_SHAPE,
    P_DROP_V,
    P_DROP_PER_A,
    P_DROP_SHAPE,
    P_SLOPE_OHM,
    P_HEAT_S,
    P_HEAT_S_TAU,
    P_HEAT_S_SHAPE,
    P_HEAT_R,
    P_HEAT_R_TAU,
    P_SPEED,
    P_SPEED_RATE,
    P_SPEED_SHAPE,
    P_RATED_PEAK_A,
    P_LAG_KEEP,
    P_LAG_W0,
    P_LAG_WM,
    P_LAG_W1,
    P_LAG_HALF,
    P_LAG_H0,
    P_LAG_HM,
    P_LAG_H1,
    P_LAG_ORDER,
    P_COUNT,
) = range(69)

# differential state of the machine, integrated by Runge-Kutta ---------------------------------------------------
X_FLUX_S, X_FLUX_R, X_SKIN1, X_SKIN2, X_EDDY, X_HYST = 0, 2, 4, 6, 8, 10
X_ODE = 12
# the rest of the state, advanced once per substep or period
X_PLAY = 12  # three vector plays
X_LAG1, X_LAG2 = 18, 20
X_SAG = 22
X_HEAT_A, X_HEAT_B, X_HEAT_C, X_HEAT_IRON, X_HEAT_R = 23, 24, 25, 26, 27
X_TIME = 28
X_PEAK_S, X_PEAK_R, X_PEAK_A = 29, 30, 31  # largest stator flux, inverse-Gamma rotor flux, phase current
X_LINK = 32
X_ENERGY_IN, X_ENERGY_LOSS = 33, 34  # J since the state was made, at the terminals and in the copper
X_COUNT = 35

POINTS = 5
"""Current samples kept inside each control period (ends included), for sampling between control instants."""

# excitation -----------------------------------------------------------------------------------------------------
(
    E_BIAS,
    E_BIAS_TARGET,
    E_BIAS_RAMP,
    E_SCALE,
    E_SCALE_TARGET,
    E_SCALE_RAMP,
    E_AXIS_RAD,
    E_TONES,
    E_LIMIT_V,
    E_DURATION,
    E_TIME_LIMIT,
    E_STEP_V,
) = range(12)
E_AMPLITUDE, E_FREQUENCY, E_PHASE = 12, 20, 28
E_LOST, E_MOST_V, E_MOST_A, E_FOLDBACK_OHM = 36, 37, 38, 39  # what a drive cuts off its output and does not tell
E_COUNT = 40

# sensing ------------------------------------------------------------------------------------------------------
(
    S_DELAY,
    S_FULL_SCALE_A,
    S_LSB_A,
    S_NOISE_A,
    S_TRIP_A,
    S_OFFSET_U,
    S_OFFSET_V,
    S_OFFSET_W,
    S_GAIN_U,
    S_GAIN_V,
    S_GAIN_W,
    S_DRIFT_U,
    S_DRIFT_V,
    S_DRIFT_W,
    S_DRIFT_TAU,
    S_DRIFT_SHAPE,
    S_QUADRATIC,
    S_CUBIC,
    S_NONLINEAR_SHAPE,
    S_PICKUP_U,
    S_PICKUP_V,
    S_PICKUP_W,
    S_PICKUP_HZ,
    S_PICKUP_RAD,
    S_PICKUP_SHAPE,
    S_CLIP_A,
    S_CLIP_SHAPE,
    S_CABLE_F,
    S_CABLE_SHAPE,
    S_LINK_NOISE_V,
    S_LINK_LSB_V,
    S_START_U,
    S_START_V,
    S_START_W,
    S_START_TAU,
) = range(35)
S_COUNT = 35

# counters of a live session (int64) -----------------------------------------------------------------------------
C_PERIOD, C_PRODUCED, C_DECIMATION, C_IN_MEAN, C_STOP, C_CLIPPED, C_CLAMPED = range(7)
C_COUNT = 7
STOP_NONE, STOP_OVERCURRENT, STOP_ENDED, STOP_TIME_LIMIT = 0, 1, 2, 7
