"""How fast samples come over the wire: `python -m tests.benchmarks.bench_link` prints figures."""

from __future__ import annotations

import time

import pytest

from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.modbus import open_port
from commissioner.link.wire.url import parse_url
from commissioner.registers.window import StreamCursor
from tests.support.sim_process import SimProcess

WIRES = {"tcp": ("--tcp", "0"), "rtu over a pty": ("--rtu", "pty")}


def start(inverter: Inverter, seconds: float) -> StreamCursor:
    """Energise the simulated drive for so much motor time: voltage and two currents, every control period."""
    inverter.set_watchdog(2000)
    inverter.set_limits(current_a=10.0, voltage_v=90.0, time_s=600.0)
    inverter.load_excitation(
        axis_deg=0.0,
        tones=[(10.0, 5.0, 0.0)],
        bias_v=4.0,
        bias_ramp_v_per_s=40.0,
        scale=0.5,
        scale_ramp_per_s=5.0,
        duration_s=seconds,
    )
    return inverter.enable()


def measure(arguments: tuple[str, ...], seconds: float) -> dict[str, float]:
    """Samples and fetches per wall second of one whole session, client CPU per fetch, latency quantiles."""
    profile = load_profile("simulated")
    with SimProcess(*arguments) as sim:
        port = open_port(parse_url(sim.url), profile)
        inverter = Inverter(port, profile)
        cursor, fetches = start(inverter, seconds), 0
        wall, cpu = time.perf_counter(), time.process_time()
        while not (window := inverter.fetch(cursor)).has_ended:
            cursor, fetches = window.cursor, fetches + 1
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        inverter.disarm()
        port.close()
    return {
        "samples_per_s": window.cursor.next_index / wall,
        "fetches_per_s": fetches / wall,
        "client_cpu_us_per_fetch": 1e6 * cpu / fetches,
        "latency_p50_ms": 1e3 * port.stats.latency_s(0.5),
        "latency_p99_ms": 1e3 * port.stats.latency_s(0.99),
        "samples_lost": float(window.cursor.lost),
    }


@pytest.mark.benchmark
@pytest.mark.parametrize("wire", WIRES)
def test_streaming_rate(wire: str) -> None:
    figures = measure(WIRES[wire], seconds=1.0)
    print(wire, {name: round(value, 3) for name, value in figures.items()})
    assert figures["samples_lost"] == 0


if __name__ == "__main__":
    for name, arguments in WIRES.items():
        print(name, {key: round(value, 3) for key, value in measure(arguments, seconds=30.0).items()})
