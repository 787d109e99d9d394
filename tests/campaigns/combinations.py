"""The main job on other motors behind other inverters: `python -m tests.campaigns.combinations [NAME...]`.

Each case is a row of the simulator's machine table and a power stage; commissioned over TCP, judged by the answer key.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.support.command_line import at_flux, call, truth
from tests.support.sim_process import SimProcess


@dataclass(frozen=True)
class Case:
    """`drive_a` is the drive's rated current, `saturation` the iron's excess at rated flux."""

    name: str
    machine: str
    dead_time_us: float
    switching_khz: float
    threshold_v: float
    drive_a: float
    saturation: float = 0.4
    order: int = 7
    link_v: float = 540.0


CASES = (
    Case("default", "", 2.5, 5, 1.2, 7),
    Case("large_motor", "", 3, 5, 1.4, 18),
    Case("0k18_small_inverter", "db_0k18", 1.5, 8, 0.8, 2.5),
    Case("0k25_6kHz", "s4a_0k25", 2, 6, 1.0, 2.0),
    Case("0k37_large_drive", "db_0k37", 2.5, 5, 1.2, 7, 0.4, 6),
    Case("1k1_fast_switching", "lab_1k1", 3, 8, 1.4, 4),
    Case("1k7_soft_iron", "ad42_6", 2, 4, 1.0, 7, 0.9),
    Case("2k2_ideal_devices", "abb_2k2", 1, 2, 0.7, 8),
    Case("2k2_hard", "abb_2k2", 4, 8, 1.6, 8),
    Case("4k_slow_switching", "haumer_112m04", 3, 2, 1.4, 12),
    Case("5hp_high_slip", "sps_5hp_400v_50hz", 3, 6, 1.4, 12, 0.6),
    Case("7k5_4us_8kHz", "haumer_132m04", 4, 8, 1.6, 20),
    Case("10hp_60hz", "sps_10hp_460v_60hz", 2.5, 4, 1.2, 18, link_v=620),
    Case("15k", "sps_20hp_400v_50hz", 3, 4, 1.4, 38),
    Case("15k_hard", "sps_20hp_400v_50hz", 4, 8, 1.6, 38, 0.6),
    Case("18k5", "msl_18kw5", 3, 3, 1.4, 45),
    Case("18k5_drive_of_its_size", "msl_18kw5", 3, 5, 1.4, 39),
    Case("37k_drive_of_its_size", "sps_50hp_400v_50hz", 3, 5, 1.4, 77),
)


def scenario(case: Case) -> str:
    """The case as a scenario file; sensors and knees are of the drive's size."""
    return f"""
description = "{case.name}"
[machine]
id = "{case.machine}"
saturation_at_rated_flux = {case.saturation}
saturation_order = {case.order}
[power_stage]
switching_frequency_hz = {1e3 * case.switching_khz}
dead_time_s = {case.dead_time_us}e-6
dead_time_knee_a = {0.017 * case.drive_a:.4g}
threshold_v = {case.threshold_v}
threshold_knee_a = {0.011 * case.drive_a:.4g}
slope_ohm = {0.15 / case.drive_a:.3g}
link_v = {case.link_v}
[sensors]
full_scale_a = {2.5 * case.drive_a}
noise_a = {0.0015 * case.drive_a:.4g}
offset_a = [{0.004 * case.drive_a:.4g}, {-0.003 * case.drive_a:.4g}, {0.002 * case.drive_a:.4g}]
[drive]
rated_current_a = {case.drive_a}
hardware_current_limit_a = {2.2 * case.drive_a}
"""


@dataclass(frozen=True)
class Outcome:
    """`errors_percent` against the answer key at the flux the result names; `peak` true flux over the limit."""

    case: Case
    ended: str
    reason: str
    errors_percent: dict[str, float]
    sigmas: dict[str, float]
    peak: float
    energised_s: float
    seconds: float

    @property
    def is_good(self) -> bool:
        return self.ended == "commissioned" and all(abs(e) < 3.0 for e in self.errors_percent.values())


def run_case(case: Case, folder: Path, seed: int = 1, arguments: Sequence[str] = ()) -> Outcome:
    """Commission the case without write-back."""
    name = case.name
    if case.machine:
        file = folder / f"{case.name}.toml"
        file.write_text(scenario(case))
        name = str(file)
    key = truth(name)
    plate = folder / f"{case.name}_plate.toml"
    plate.write_text("".join(f"{k} = {v}\n" for k, v in key["nameplate"].items()) + 'connection = "star"\n')
    began = time.monotonic()
    with SimProcess("--scenario", name, "--tcp", "0", "--seed", str(seed)) as sim:
        answer = call(
            "run", "--drive", sim.url, "--motor", str(plate), "--yes", "--json", "--write-back",
            "--runs", str(folder / "runs"), *arguments, timeout_s=400.0,
        )  # fmt: skip
        peaks = [row for row in sim.log() if row["event"] == "peaks"]
    if "energised_s" not in answer.json:
        raise SystemExit(f"{case.name}: {answer.stdout[:600]}")
    return judge(case, answer.json, key, peaks, time.monotonic() - began)


def judge(case: Case, result: Any, key: Any, peaks: Sequence[Any], seconds: float) -> Outcome:
    errors: dict[str, float] = {}
    sigmas: dict[str, float] = {}
    if result.get("parameters"):
        for name, true in at_flux(key, result["holds_for_stator_flux_wb"]).items():
            found = result["parameters"][name]
            errors[name] = 100 * (found["value"] / true - 1)
            sigmas[name] = (found["value"] - true) / found["std"]
    limit = (result.get("flux_guard") or {}).get("limit_wb") or float("nan")
    peak = max((row["stator_flux_wb"] for row in peaks), default=0.0) / limit
    return Outcome(
        case, result["outcome"], str(result.get("reason", result.get("error"))), errors, sigmas, peak,
        result["energised_s"], seconds,
    )  # fmt: skip


def line(o: Outcome) -> str:
    errors = " ".join(f"{e:+6.2f}({o.sigmas[n]:+5.1f})" for n, e in o.errors_percent.items())
    return (
        f"{'ok ' if o.is_good else 'BAD'} {o.case.name:22s} {o.ended:13s} {errors:60s} flux {o.peak:.3f} "
        f"{o.energised_s:5.1f} s {o.seconds:5.1f} s  {'' if o.ended == 'commissioned' else o.reason}"
    )


def main(names: Sequence[str]) -> int:
    chosen = [case for case in CASES if not names or case.name in names]
    bad = 0
    with tempfile.TemporaryDirectory() as folder:
        print(f"{'':26s} {'ended':13s} R_R, L_sigma, L_M, R_s: error in % (standard errors)")
        for case in chosen:
            outcome = run_case(case, Path(folder))
            bad += not outcome.is_good
            print(line(outcome), flush=True)
    print(f"{len(chosen) - bad} of {len(chosen)} commissioned within 3 %")
    return 1 if bad else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
