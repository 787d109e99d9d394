"""What a number of the extended model multiplies; its index picks the channel, spline vector, branch or component."""

from __future__ import annotations

# inside the motor and the power stage
R_S, R_R, GAMMA_SIGMA, GAMMA_M, NU = 0, 1, 2, 3, 4
LEGS, IRON_CURVE, LEAKAGE_CURVE, STOP, BRANCH, IRON_LOSS = 5, 6, 7, 8, 9, 10
VOLTAGE_MOD, OMEGA, PHASE_RESISTANCE, ROTOR_MOD = 11, 12, 13, 14
ROTOR_ANISOTROPY, LEAKAGE_ANISOTROPY, MAGNETIZING_ANISOTROPY, INITIAL_FLUX = 15, 16, 17, 18
LEGS_LINK = 19  # as LEGS, scaled with the link voltage and switching frequency (dead time, not device threshold)
LEAK_SPLIT = 21  # share of the saturating leakage on the rotor side
LEG_SHARE = (
    23  # of a leg, what its loss is above the mean of the three, over that mean (1: V, 2: W; U has what is missing)
)
ANISOTROPY_SPLIT = 22  # share of the leakage on the rotor side where inductances differ between directions
MEMORY = 24  # 1: what the iron remembers outlives the pause between two segments
CARRY = 20  # share of the flux at the end of the segment before that is left at the start: along it (0), across (1)

NOMINAL = (R_S, R_R, GAMMA_SIGMA, GAMMA_M)
NONLINEAR = frozenset({LEGS, LEGS_LINK, IRON_CURVE, LEAKAGE_CURVE, STOP})

# between the terminals and the recording
FIRST_OF_SENSING = 100
DELAY, LAG, CLOCK, OFFSET, DRIFT, GAIN, EVEN, ODD, TONE, CABLE, END = range(100, 111)
