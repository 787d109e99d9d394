"""Double-cage machines whose catalogue page follows from their circuit in closed form: do the stated errors hold the truth?

python -m tests.campaigns.intake.catalogue --draws 200
"""

from __future__ import annotations

import argparse
import csv
import math
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from commissioner.identify.catalogue.answer import Answer, answer
from commissioner.identify.catalogue.contradictions import settled
from commissioner.motor.circuit import PARAMETERS
from commissioner.recordings.catalogue.reading import sheet_in

NAMES = ("R_s", "R_R", "L_sigma", "L_M")
SIZES_KW = (0.37, 0.75, 1.5, 2.2, 4, 5.5, 7.5, 11, 15, 22, 30, 45, 55, 75, 90, 132, 160, 200, 315)


@dataclass(frozen=True)
class Machine:
    """Two parallel cages and iron loss across the main branch, SI, star phase; friction and stray loss at the shaft."""

    r_s: float
    x_s: float
    x_m: float
    r_fe: float
    cages: tuple[tuple[float, float], ...]
    leak_at_start: float
    friction_w: float
    stray_w: float
    voltage_v: float
    frequency_hz: float
    pairs: int

    def rotor(self, slip, leak=1.0):
        return 1.0 / sum(1.0 / (r / slip + 1j * leak * x) for r, x in self.cages)

    def current(self, slip, leak=1.0):
        main = 1.0 / (1.0 / self.r_fe + 1.0 / (1j * self.x_m) + 1.0 / self.rotor(slip, leak))
        return self.voltage_v / math.sqrt(3.0) / (self.r_s + 1j * leak * self.x_s + main), main

    def gap(self, slip, leak=1.0):
        current, main = self.current(slip, leak)
        return 3.0 * abs(current * main / self.rotor(slip, leak)) ** 2 * self.rotor(slip, leak).real

    def shaft(self, slip, rated_a):
        current = abs(self.current(slip)[0])
        return self.gap(slip) * (1.0 - slip) - self.friction_w - self.stray_w * (current / rated_a) ** 2

    def pull_out(self):
        leak = math.sqrt(self.leak_at_start)
        found = minimize_scalar(lambda s: -self.gap(math.exp(s), leak), bounds=(math.log(0.01), 0.0), method="bounded")
        return -float(found.fun)

    def truth(self, slip):
        """(R_s, R_R, L_sigma, L_M) at a slip."""
        z, w = self.rotor(slip), 2 * math.pi * self.frequency_hz
        ratio = self.x_m / (self.x_m + z.imag)
        leak = self.x_s + self.x_m * (1 - ratio)
        return np.array([self.r_s, ratio**2 * z.real * slip, leak / w, ratio * self.x_m / w])


def draw(random: np.random.Generator) -> tuple[Machine, float]:
    """A machine and its rated power: losses, shares, leakages and cages of built motors."""
    power = 1000.0 * random.choice(SIZES_KW)
    pairs, frequency = int(random.choice([1, 2, 2, 2, 3])), float(random.choice([50, 50, 50, 60]))
    voltage = 400.0 if frequency == 50 else 460.0
    efficiency = 1.0 - 0.2 * (power / 1000.0) ** -0.27 * random.uniform(0.75, 1.25)
    factor = random.uniform(0.74, 0.82) if power < 3000 else random.uniform(0.8, 0.9)
    current = power / (math.sqrt(3.0) * voltage * efficiency * factor)
    base, loss = voltage / math.sqrt(3.0) / current, power / efficiency - power
    shares = random.uniform([0.3, 0.1, 0.03, 0.05], [0.48, 0.3, 0.14, 0.15])
    rotor = 1.0 - shares.sum()
    slip = max(rotor, 0.12) * loss / power / (1.0 + max(rotor, 0.12) * loss / power)
    leak, split = base * random.uniform(0.13, 0.24), random.uniform(0.33, 0.52)
    r_0 = 0.95 * slip * base * factor
    outer = r_0 * random.uniform(1.6, 4.5)
    inner = 1.0 / (1.0 / r_0 - 1.0 / outer)
    x_outer = leak * (1 - split) * random.uniform(0.6, 0.95)
    x_inner = x_outer + inner * (1.0 + outer / inner) * random.uniform(1.0, 6.0) * 0.3
    machine = Machine(
        shares[0] * loss / (3 * current**2), leak * split, base * random.uniform(1.05, 1.35) / math.sqrt(1 - factor**2),
        voltage**2 * 0.93**2 / (shares[1] * loss), ((inner, x_inner), (outer, x_outer)), random.uniform(0.75, 1.0),
        shares[2] * loss, shares[3] * loss, voltage, frequency, pairs,
    )  # fmt: skip
    return machine, power


def values(machine: Machine, power: float, is_usual: bool = True) -> dict[str, float] | None:
    """The catalogue's values, exact; None where the machine cannot carry its power as motors do."""
    rated = power / (math.sqrt(3.0) * machine.voltage_v * 0.85 * 0.85)
    for _ in range(4):
        slips = np.geomspace(1e-3, 0.3, 60)
        shafts = [machine.shaft(s, rated) for s in slips]
        if max(shafts) < (1.5 if is_usual else 1.02) * power:
            return None
        first = next(k for k, p in enumerate(shafts) if p > power)
        slip = brentq(lambda s, r=rated: machine.shaft(s, r) - power, slips[max(first - 1, 0)], slips[first])
        rated = abs(machine.current(slip)[0])
    synchronous = 60.0 * machine.frequency_hz / machine.pairs
    torque = power / (1.0 - slip)
    out = {
        "rated_power_w": power, "rated_voltage_v": machine.voltage_v, "rated_frequency_hz": machine.frequency_hz, "rated_slip": slip,
        "rated_speed_rpm": synchronous * (1.0 - slip), "rated_current_a": rated,
        "starting_current_ratio": abs(machine.current(1.0, machine.leak_at_start)[0]) / rated,
        "starting_torque_ratio": machine.gap(1.0, machine.leak_at_start) / torque,
        "breakdown_torque_ratio": (machine.pull_out() - machine.friction_w) / torque,
    }  # fmt: skip
    for load, ending in ((1.0, ""), (0.75, "_75"), (0.5, "_50")):
        s = brentq(lambda x, p=load * power: machine.shaft(x, rated) - p, 1e-5, 1.001 * slip)
        current = machine.current(s)[0]
        out["power_factor" + ending] = current.real / abs(current)
        out["efficiency" + ending] = load * power / (math.sqrt(3.0) * machine.voltage_v * current.real)
    usual = (
        1.5 < out["breakdown_torque_ratio"] < 4.5
        and 3.5 < out["starting_current_ratio"] < 10
        and 0.7 < out["starting_torque_ratio"] < min(4.0, out["breakdown_torque_ratio"])
    )
    return out if usual or not is_usual else None


def scattered(exact: dict[str, float], random: np.random.Generator) -> dict[str, float]:
    """What the catalogue declares of the type of which `exact` is one motor: within IEC 60034-1's tolerances."""
    power, out = exact["rated_power_w"], dict(exact)
    u = random.uniform
    slip = exact["rated_slip"] / (1.0 + (0.3 if power < 1000 else 0.2) * u(-1, 1))
    out["rated_slip"], out["rated_speed_rpm"] = (
        slip,
        exact["rated_speed_rpm"] / (1 - exact["rated_slip"]) * (1.0 - slip),
    )
    loss, factor = (0.15 if power <= 150e3 else 0.1) * u(-1, 1), u(-1, 1)
    for ending in ("", "_75", "_50"):
        out["efficiency" + ending] = 1.0 - (1.0 - exact["efficiency" + ending]) / (1.0 + loss)
        cos = exact["power_factor" + ending]
        out["power_factor" + ending] = cos + factor * min(max((1 - exact["power_factor"]) / 6, 0.02), 0.07) * cos * (1 - cos**2) / (
            exact["power_factor"] * (1 - exact["power_factor"] ** 2)
        )  # fmt: skip
    out["rated_current_a"] = power / (math.sqrt(3.0) * out["rated_voltage_v"] * out["efficiency"] * out["power_factor"])
    out["starting_current_ratio"] = (
        exact["starting_current_ratio"] * exact["rated_current_a"] / out["rated_current_a"] / (1.0 + 0.2 * u(-1, 1))
    )
    out["breakdown_torque_ratio"] = exact["breakdown_torque_ratio"] / (1.0 + 0.1 * u(-1, 1))
    start = exact["starting_torque_ratio"] / (1.0 + u(-0.15, 0.25))
    out["starting_torque_ratio"] = min(start, out["breakdown_torque_ratio"])
    return out


def printed(exact: dict[str, float]) -> dict[str, str]:
    """As catalogues print them: three digits, whole revolutions or fives, ratios to a tenth."""
    out = {}
    for key, value in exact.items():
        if key == "rated_slip":
            continue
        if key == "rated_speed_rpm":
            out[key] = f"{5 * round(value / 5)}" if value % 100 < 70 else f"{value:.0f}"
        elif key == "rated_current_a":
            out[key] = f"{value:.0f}" if value >= 100 else f"{value:.1f}" if value >= 10 else f"{value:.2f}"
        elif key.startswith("power_factor"):
            out[key] = f"{value:.2f}"
        elif key.startswith("efficiency"):
            out[key] = f"{value:.3f}"
        elif key.endswith("_ratio"):
            out[key] = f"{value:.1f}"
        else:
            out[key] = f"{value:g}"
    return out


LABELS = {
    "rated_power_w": "Rated power [W]", "rated_voltage_v": "Rated voltage [V]", "rated_frequency_hz": "Frequency [Hz]",
    "rated_speed_rpm": "Speed [1/min]", "rated_current_a": "Rated current [A]", "power_factor": "cos phi 4/4",
    "power_factor_75": "cos phi 3/4", "power_factor_50": "cos phi 1/2", "efficiency": "Efficiency 4/4", "efficiency_75": "Efficiency 3/4",
    "efficiency_50": "Efficiency 1/2", "starting_current_ratio": "I_A/I_N", "starting_torque_ratio": "M_A/M_N",
    "breakdown_torque_ratio": "M_K/M_N", "winding_resistance_uv_ohm": "Winding resistance between terminals, 20 degC [ohm]",
}  # fmt: skip
PARTS = ("power_factor_75", "power_factor_50", "efficiency_75", "efficiency_50")
START = ("starting_current_ratio", "starting_torque_ratio")
PAGES = {"a whole page": (), "without part loads": PARTS, "without part loads and start": (*PARTS, *START)}


def page(exact: dict[str, float], without: tuple[str, ...] = ()) -> str:
    """The sheet as a technician types it."""
    lines = printed({k: v for k, v in exact.items() if k not in without})
    return "".join(f"{LABELS[key]}; {text.replace('.', ',')}\n" for key, text in lines.items())


def found_in(text: str) -> Answer:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sheet.csv"
        path.write_text(text, encoding="utf-8")
        sheet = sheet_in(path)
    assert sheet is not None
    return answer(settled(sheet, frozenset()))


@dataclass(frozen=True)
class Covered:
    """Of some draws, `(n, 4)` each: error over its stated standard deviation, that over the value, error over the truth."""

    sigmas: np.ndarray
    stated: np.ndarray
    off: np.ndarray


def covered(draws: int, seed: int, without: tuple[str, ...] = (), is_another: bool = False) -> Covered:
    """`is_another`: the sheet is of the type and the truth of another motor of it. What a sheet withholds is not a number."""
    random = np.random.default_rng(seed)
    compared: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    while len(compared) < draws:
        machine, power = draw(random)
        exact = values(machine, power)
        if exact is None:
            continue
        found = found_in(page(scattered(exact, random) if is_another else exact, without))
        compared.append(_compared(found, machine.truth(exact["rated_slip"]), is_another))
    sigmas, stated, off = (np.array(x) for x in zip(*compared, strict=True))
    return Covered(sigmas, stated, off)


MOTORS = Path(__file__).parents[2] / "data" / "motors" / "motors.csv"


def published() -> Iterator[tuple[Machine, float]]:
    """One cage each, with the rated power; losses that a row lacks as of common motors."""
    with MOTORS.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["use_for_mc"] == "1"]
    for row in rows:
        power, w = 1000 * float(row["P_kW"]), 2 * math.pi * float(row["f_Hz"])
        rotor = (float(row["Rr_ohm"]), w * float(row["Llr_mH"]) / 1e3)
        volts, iron = float(row["V_LL"]), float(row["P_fe_W"] or 0.02 * power)
        yield Machine(
            float(row["Rs_ohm"]), w * float(row["Lls_mH"]) / 1e3, w * float(row["Lm_mH"]) / 1e3, 0.9 * volts**2 / iron, (rotor,), 1.0,
            float(row["P_fric_W"] or 0.01 * power), 0.005 * power, volts, float(row["f_Hz"]), int(row["poles"]) // 2,
        ), power  # fmt: skip


def of_published(every: int = 1) -> Covered:
    """Pages of published machines against their own circuits, by the errors of the type."""
    compared = []
    for machine, power in list(published())[::every]:
        exact = values(machine, power, is_usual=False)
        assert exact is not None
        compared.append(_compared(found_in(page(exact)), machine.truth(exact["rated_slip"]), is_another=False))
    sigmas, stated, off = (np.array(x) for x in zip(*compared, strict=True))
    return Covered(sigmas, stated, off)


def _compared(found: Answer, truth: np.ndarray, is_another: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    one = [found.parameters.get(name) for name in PARAMETERS]
    value = np.array([np.nan if q is None else q.value for q in one])
    std = np.array([np.nan if q is None else (q.std if is_another else q.of_type) for q in one])
    return (value - truth) / std, std / value, value / truth - 1.0


def share(inside: np.ndarray, of: np.ndarray) -> np.ndarray:
    """Of those that are numbers."""
    return np.sum(inside, axis=0) / np.maximum(np.sum(np.isfinite(of), axis=0), 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--seed", type=int, default=39)
    asked = parser.parse_args()
    for is_another in (False, True):
        for name, without in PAGES.items():
            print(
                f"{name}, {'a motor within the tolerances of the type' if is_another else 'the type itself'}: {asked.draws} draws"
            )
            show(covered(asked.draws, asked.seed, without, is_another))
    print("published machines of one cage, a whole page, the type itself")
    show(of_published())


def show(of: Covered) -> None:
    inside = share(np.abs(of.sigmas) < 2, of.sigmas), share(np.abs(of.sigmas) < 1, of.sigmas)
    for k, n in enumerate(NAMES):
        print(
            f"    {n:8} within 2 std {inside[0][k]:6.1%}, within 1 std {inside[1][k]:6.1%}; stated {np.nanmedian(of.stated[:, k]):6.1%}, "
            f"off by {np.nanmedian(abs(of.off[:, k])):6.1%} in the median, {np.nanpercentile(abs(of.off[:, k]), 95):6.1%} in 1 of 20; "
            f"withheld {np.mean(np.isnan(of.off[:, k])):.0%}",
            flush=True,
        )


if __name__ == "__main__":
    main()
