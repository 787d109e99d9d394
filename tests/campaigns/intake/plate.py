"""Plate against data: scale errors that must be named, honest motors that must not.

    python -m tests.campaigns.intake.plate --cases 500

Each motor is a T circuit drawn around a published machine; its plate is what the circuit does at rated load, printed with the
tolerances of IEC 60034-1 (slip 20 %, current and power factor as a maker rounds them). The operating point is its true one at a
slip of 0.3 to 1.1 of rated, with a rotor 20 % colder or warmer. Currents, active and reactive power are then scaled.
"""

from __future__ import annotations

import argparse
import math

import numpy as np

from commissioner.motor.nameplate import Nameplate, check
from commissioner.motor.plate_match import OperatingPoint, contradiction
from tests.support.standstill import usable_motors

FACTORS = (math.sqrt(3.0), 2.0, 3.0, 10.0, 1000.0)
MOTORS = [m for m in usable_motors() if not check(m.plate)]


def case(random: np.random.Generator) -> tuple[OperatingPoint, Nameplate]:
    """A motor's operating point and its plate."""
    while True:
        motor = MOTORS[random.integers(len(MOTORS))]
        r_s, r_r, leak, main = (x * random.uniform(0.85, 1.18) for x in motor.truth)
        w, u = 2 * math.pi * motor.plate.rated_frequency_hz, motor.plate.rated_voltage_v / math.sqrt(3)

        def drawn(slip, r_r=r_r, r_s=r_s, leak=leak, main=main, w=w, u=u):
            rotor, magnetizing = r_r / slip, 1j * w * main
            current = u / (r_s + 1j * w * leak + rotor * magnetizing / (rotor + magnetizing))
            return (
                abs(current),
                3 * u * current.real,
                -3 * u * current.imag,
                3 * rotor * abs(current * magnetizing / (rotor + magnetizing)) ** 2,
            )

        slip = motor.plate.rated_slip
        current, power, reactive, gap = drawn(slip)
        plate = Nameplate(
            0.97 * gap * (1 - slip), motor.plate.rated_voltage_v, motor.plate.rated_frequency_hz,
            current * random.uniform(0.97, 1.03),
            60 * motor.plate.rated_frequency_hz / motor.plate.pole_pairs * (1 - slip * random.uniform(0.85, 1.18)),
            min(power / math.hypot(power, reactive) * random.uniform(0.98, 1.02), 0.98), motor.plate.pole_pairs, "star",
        )  # fmt: skip
        if check(plate):
            continue
        now = slip * random.uniform(0.3, 1.1)
        current, power, reactive, _ = drawn(now, r_r=r_r * random.uniform(0.85, 1.18))
        return OperatingPoint(u, motor.plate.rated_frequency_hz, now, current, power, reactive), plate


def scaled(point: OperatingPoint, factor: float) -> OperatingPoint:
    """The point with currents that read `factor` times too large."""
    return OperatingPoint(
        point.voltage_v, point.frequency_hz, point.slip,
        factor * point.current_a, factor * point.power_w, factor * point.reactive_var,
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=500)
    parser.add_argument("--seed", type=int, default=39)
    asked = parser.parse_args()
    random = np.random.default_rng(asked.seed)
    false = sum(contradiction(*case(random)) is not None for _ in range(asked.cases))
    named = likely = 0
    for _ in range(asked.cases):
        point, plate = case(random)
        factor = float(random.choice(FACTORS) ** random.choice([-1, 1]))
        found = contradiction(scaled(point, factor), plate)
        named += found is not None
        likely += found is not None and found.likely is not None and abs(math.log(found.likely / factor)) < 1e-6
    print(
        f"named {named} of {asked.cases} ({named / asked.cases:.1%}), by the right factor {likely}; false {false} ({false / asked.cases:.1%})"
    )


if __name__ == "__main__":
    main()
