"""Locked-rotor points of deep bars and double cages: is R_R at running slip within its stated error?

python -m tests.campaigns.intake.bars --draws 200
"""

from __future__ import annotations

import argparse

import numpy as np

from commissioner.diagnose.intake.points import Points
from commissioner.diagnose.points.bars import slow_rotor
from commissioner.diagnose.points.table import read_points

FREQUENCIES = ((50, 25, 12.5), (50, 25, 12.5, 5), (50, 12.5), (60, 30, 15), (50, 40, 30, 20, 10))


def draw(random: np.random.Generator) -> tuple[Points, float]:
    """Points of a T circuit with a dispersive rotor, and its inverse-Gamma R_R at slip frequency."""
    leak = 10 ** random.uniform(-3, -1.5)
    r_r = 314.16 * leak * random.uniform(0.25, 0.9)
    r_s, main, rotor_leak = r_r * random.uniform(0.5, 2), leak * random.uniform(8, 28), leak * random.uniform(0.2, 0.5)
    stator_leak = max(leak - rotor_leak * random.uniform(0.3, 1), 0.3 * leak)
    shape, is_deep = random.uniform(0.0, 1.0, 4), random.integers(2)

    def rotor(f):
        w = 2 * np.pi * f
        if is_deep:
            part, depth = 0.4 + 0.55 * shape[0], (1 + 1j) * np.sqrt(f / (12 + 68 * shape[1]))
            return r_r * (1 - part + part * depth / np.tanh(depth)) + 1j * w * rotor_leak
        outer = r_r * (1.5 + 3.5 * shape[0])
        a = outer + 1j * w * rotor_leak * (0.2 + 0.6 * shape[1])
        b = 1 / (1 / r_r - 1 / outer) + 1j * w * rotor_leak * (1 + 2 * shape[2])
        return a * b / (a + b)

    slow = rotor(np.array([1e-3]))[0]
    true = slow.real * (main / (main + slow.imag / (2e-3 * np.pi))) ** 2
    f = np.repeat(np.array(FREQUENCIES[random.integers(len(FREQUENCIES))], dtype=float), 3)
    w, i = 2 * np.pi * f, np.tile([0.5, 0.8, 1.1], f.size // 3)
    z = r_s + 1j * w * stator_leak + 1j * w * main * rotor(f) / (1j * w * main + rotor(f))
    scatter = 10 ** random.uniform(-4, -2.3)
    columns = {
        "frequency_hz": f,
        "voltage_line_v": np.sqrt(3) * i * abs(z) * (1 + scatter * random.standard_normal(f.size)),
        "current_line_a": i,
        "power_w": 3 * i**2 * z.real * (1 + scatter * random.standard_normal(f.size)),
        "winding_resistance_uv_ohm": np.full(f.size, 2 * r_s),
    }
    points = read_points(columns, "locked_rotor")
    return (points, float(true)) if isinstance(points, Points) else draw(random)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--seed", type=int, default=39)
    asked = parser.parse_args()
    random = np.random.default_rng(asked.seed)
    off, std = [], []
    for _ in range(asked.draws):
        points, true = draw(random)
        found = slow_rotor(points)
        off.append(abs(found.resistance_ohm / true - 1))
        std.append(found.std_ohm / true)
    sigma = np.array(off) / np.array(std)
    print(
        f"within the stated error (two standard deviations) {np.mean(sigma < 2):.1%} of {asked.draws}, within one {np.mean(sigma < 1):.1%}; "
        f"error {np.median(off):.2%} in the median, {np.max(off):.1%} at worst"
    )


if __name__ == "__main__":
    main()
