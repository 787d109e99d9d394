"""How fast samples come over the wire: `python -m tests.benchmarks.bench_link` prints figures."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import pytest

from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.modbus import open_port
from commissioner.link.wire.url import parse_url
from commissioner.registers.window import StreamCursor
from tests.benchmarks.pairs import Pair
from tests.sim.client import TcpClient
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


WRITE_READ_BYTES, SILENCE_S, CHARACTER_BITS = 13 + 5, 1.75e-3, 11
"""Of function 23 besides its words: request and reply with address and CRC; between frames, above 19 200 Bd; of a character
(Modbus over serial line V1.02, 2.5.1)."""


def share_of_the_line(baud: int, seconds: float) -> dict[str, float]:
    """Words of windows a second, and that over what the line's bytes and the standard's silences between frames allow: in all, in the
    median exchange, in the best tenth. Through a pseudo terminal that takes the time of its bytes, a slave that answers at once."""
    profile = load_profile("simulated")
    with SimProcess("--rtu", "pty", "--pace", "--baud", str(baud), "--turnaround-ms", "0", speed="1") as sim:
        port = open_port(parse_url(sim.url.replace("baud=921600", f"baud={baud}")), profile)
        inverter = Inverter(port, profile)
        cursor, asked = start(inverter, seconds), 3
        layout, taken_s, began = cursor.stream.layout, [], time.perf_counter()
        while not (window := inverter.fetch(cursor)).has_ended:
            cursor, now = window.cursor, time.perf_counter()
            taken_s.append(now - began)
            began = now
        inverter.disarm()
        port.close()
    bytes_s = CHARACTER_BITS * (WRITE_READ_BYTES + 2 * (layout.words + asked)) / baud
    least_s, taken_s = bytes_s + 2.0 * SILENCE_S, sorted(taken_s)
    return {
        "words_per_s": layout.words * len(taken_s) / sum(taken_s), "of_the_wire": least_s * len(taken_s) / sum(taken_s),
        "of_the_wire_median": least_s / taken_s[len(taken_s) // 2], "of_the_wire_best_tenth": least_s / taken_s[len(taken_s) // 10],
    }  # fmt: skip


def pairs(closing: ExitStack, seconds: float = 4.0) -> list[Pair]:
    """One session's samples: checked and decoded by us, fetched undecoded by pymodbus and by a bare socket. The drive is another process."""
    sim = closing.enter_context(SimProcess(*WIRES["tcp"]))
    profile = load_profile("simulated")

    def session(read: Callable[[Inverter, Any, StreamCursor], int]) -> float:
        port = open_port(parse_url(sim.url), profile)
        inverter = Inverter(port, profile)
        cursor = start(inverter, seconds)
        began = time.process_time()
        samples = read(inverter, port, cursor)
        spent = time.process_time() - began
        inverter.disarm()
        port.close()
        return spent / samples

    def checked(inverter: Inverter, _port: Any, cursor: StreamCursor) -> int:
        while not (window := inverter.fetch(cursor)).has_ended:
            cursor = window.cursor
        return window.cursor.next_index

    def loop(ask: Callable[[list[int], int, int], list[int]], cursor: StreamCursor) -> int:
        layout, index, beat = cursor.stream.layout, 0, 0
        while True:
            beat += 1
            words = ask([beat & 0xFFFF, index >> 16, index & 0xFFFF], layout.address, layout.words)
            index = (words[1] << 16 | words[2]) + words[3]
            if words[5] & 16:
                return index

    def library(_inverter: Inverter, port: Any, cursor: StreamCursor) -> int:
        at = profile.items["heartbeat"].address
        return loop(
            lambda words, address, count: (
                port._client.readwrite_registers(
                    read_address=address, read_count=count, write_address=at, values=words, device_id=1
                ).registers
            ),
            cursor,
        )

    def bare(_inverter: Inverter, port: Any, cursor: StreamCursor) -> int:
        at, client = profile.items["heartbeat"].address, TcpClient.over(port._client.socket)
        return loop(lambda words, address, count: client.write_read(address, count, at, words), cursor)

    return [
        Pair(
            "samples over TCP, each checked and decoded",
            peer,
            lambda: session(checked),
            lambda read=read: session(read),
            "µs a sample",
            1e6,
        )
        for peer, read in (("pymodbus 3.15.0, words only", library), ("a bare socket, words only", bare))
    ]


@pytest.mark.benchmark
@pytest.mark.parametrize("wire", WIRES)
def test_streaming_rate(wire: str) -> None:
    figures = measure(WIRES[wire], seconds=1.0)
    print(wire, {name: round(value, 3) for name, value in figures.items()})
    assert figures["samples_lost"] == 0


if __name__ == "__main__":
    for name, arguments in WIRES.items():
        print(name, {key: round(value, 3) for key, value in measure(arguments, seconds=30.0).items()})
    for rate in (19200, 115200):
        print(f"paced, {rate} Bd", {key: round(value, 3) for key, value in share_of_the_line(rate, 10.0).items()})
