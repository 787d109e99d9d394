"""Does a motor that was switched on come up to speed? By the resistance that its terminals show, R_s + R_R / slip (less what the
magnetizing branch takes): it is several times larger once the shaft turns at its speed, in whatever unit the current is."""

from __future__ import annotations

ROTOR_SHARE = 0.3
"""Of a standing motor's resistance, the rotor's at least: 0.31 ... 0.71 in 37 circuits of 0.18 kW to 1.7 MW."""
MOST_RISE = 0.3
"""Of the resistance since closing, from which on a shaft may be coming up to speed, and below which heat alone (75 K) makes it."""
MOST_SPEED = MOST_RISE / (MOST_RISE + ROTOR_SHARE)
"""Of the synchronous speed, that belongs to this rise."""
LEAST_SPEED = 0.02
"""Of the synchronous speed: less is within what measures it."""
SETTLED_S, LEAST_S = 0.1, 1.0
"""Behind the closing, where its direct part is over; shortest recording that shows a motor which does not start."""


def is_standing(first_ohm: float, last_ohm: float) -> bool:
    """Whether the terminals' resistance at the recording's end is that of a shaft which has not started since the first one."""
    return 0.0 < last_ohm < (1.0 + MOST_RISE) * first_ohm


def highest_speed(first_ohm: float, last_ohm: float) -> float:
    """Of the synchronous speed, the highest that this rise allows if none of it is heat."""
    rise = max(last_ohm / first_ohm - 1.0, 0.0)
    return max(rise / (rise + ROTOR_SHARE), LEAST_SPEED)


def words(current_over_rated: float, length_s: float, speed: float) -> str:
    """What is said of such a motor, `speed` over the synchronous one."""
    return (
        f"the motor does not start: for {length_s:.3g} s, to the end of the recording, its current stays at {current_over_rated:.3g} times the "
        f"rated one, as that of a shaft does that stands or creeps (no more than {speed:.0%} of its synchronous speed)"
    )
