"""What is random in one short run, as Hypothesis strategies: the script, the faults and their moments, the operator."""

from __future__ import annotations

from dataclasses import dataclass

from hypothesis import strategies as st

from sim.wire.faults import SERVER
from tests.campaigns.short_run.short_course import DECISIONS, ROGUES, Script
from tests.campaigns.short_run.truth import RUNAWAY

WIRES = ("tcp", "rtu")
WIRE_FAULTS = (
    "late:0.03", "late:0.09", "late:0.2", "late:0.5", "lost", "lost_request", "repeated", "truncated", "truncated:1",
    "corrupted", "reordered", "stray_before", "stray_before:01", "stray_after", "wrong_unit", "wrong_function",
    "short_reply", "short_reply:4", "wrong_transaction", "stall:0.05", "stall:0.4", "restart:0.02", "restart:0.3",
    "half_open",
)  # fmt: skip
DRIVE_FAULTS = (
    "overcurrent", "heatsink", "winding", "earth_fault", "sto", "undervoltage", "overrun:50", "overrun:600",
    "sample_gap:3", "sample_gap:400", "power_cycle", "stuck_commit", "store_fails", "heartbeat_ignored",
    "ignore:control_word", "ignore:watchdog_ms", "ignore:current_limit_a", "ignore:amplitude_scale",
    "ignore:staged_stator_resistance", "ignore:commit", "ignore:tones", "refuse:watchdog_ms", "refuse:amplitude_scale",
    "refuse:commit",
)  # fmt: skip
REQUESTS = {("tcp", 1): 160, ("tcp", 2): 270, ("rtu", 1): 290, ("rtu", 2): 455}
"""About how many requests a sound run of one or two tests makes."""
BIASED_REQUESTS = {"tcp": 74, "rtu": 84}
"""So many more for every test that ends on a DC bias."""
WRITES = {1: 15, 2: 22}
"""Of them with function 16."""
FAULT_COUNTS = (0, *(1,) * 8, *(2,) * 6, *(3,) * 3, *(4,) * 2)


@dataclass(frozen=True)
class Sequence:
    """All that is random in one run; `seed` is the simulated drive's noise."""

    seed: int
    wire: str
    script: Script
    faults: tuple[str, ...]
    stop_after: int | None


@st.composite
def sequences(draw: st.DrawFn, wire: str) -> Sequence:
    """One run over `wire` (`both`: either)."""
    chosen, tests = wire if wire in WIRES else draw(st.sampled_from(WIRES)), draw(st.sampled_from([1, 1, 1, 1, 2]))
    is_biased = draw(st.booleans())
    requests = REQUESTS[chosen, tests] + is_biased * tests * BIASED_REQUESTS[chosen]
    script = Script(
        draw(st.sampled_from([*DECISIONS[:1] * 3, *DECISIONS[1:]])),
        tests,
        draw(st.floats(0.8, 2.5)),
        *draw(_rogue(requests)),
        is_biased,
    )
    seed = draw(st.integers(0, 9999))
    faults = tuple(draw(_fault(requests, WRITES[tests])) for _ in range(draw(st.sampled_from(FAULT_COUNTS))))
    return Sequence(
        seed=seed,
        wire=chosen,
        script=script,
        faults=(*faults, *_runaway(seed)),
        stop_after=draw(_seldom(st.integers(0, requests))),
    )


def _runaway(seed: int) -> tuple[str, ...]:
    """One time in forty the energised drive stops heeding anyone and its watchdog is dead. It is not drawn, so that every
    other sequence of a seed stays what it was."""
    return (f"{RUNAWAY}@e{seed // 40 % 100 / 200:.3f}s",) if seed % 40 == 17 else ()


def _seldom(strategy: st.SearchStrategy[int]) -> st.SearchStrategy[int | None]:
    """About one time in twenty."""
    return st.integers(0, 19).flatmap(lambda n: strategy if n == 13 else st.none())


@st.composite
def _rogue(draw: st.DrawFn, requests: int) -> tuple[str, int]:
    """A defective procedure, one time in six, and its moment."""
    if draw(st.integers(0, 5)) != 3:
        return "", 0
    return draw(st.sampled_from(list(ROGUES))), draw(st.integers(0, requests))


def _fault(requests: int, writes: int) -> st.SearchStrategy[str]:
    """Six of ten on the wire, one in a hundred another firmware's register map."""
    kinds = st.integers(0, 99)
    return kinds.flatmap(
        lambda n: (
            st.just("other_map") if n == 50 else _drive_fault(requests) if n > 60 else _wire_fault(requests, writes)
        )
    )


@st.composite
def _wire_fault(draw: st.DrawFn, requests: int, writes: int) -> str:
    """At a request, mostly once; one in four among those that write."""
    name, among_writes = draw(st.sampled_from(WIRE_FAULTS)), draw(st.integers(0, 3)) == 3
    first = draw(st.integers(1, writes if among_writes else requests))
    at = f"{name}@{'w' if among_writes else ''}{first}"
    if name.startswith(tuple(SERVER)):
        return at
    return at + draw(st.sampled_from(["", "", "", *(f"x{n}" for n in range(2, 8)), "+"]))


@st.composite
def _drive_fault(draw: st.DrawFn, requests: int) -> str:
    """At a request, at a time since the first energising, or just before a command is carried out."""
    name = draw(st.sampled_from(DRIVE_FAULTS))
    at_request = st.integers(1, requests).map(str)
    energised = st.integers(0, 6000).map(lambda n: f"e{n / 1e4:.4f}s")
    when = draw(st.one_of(at_request, at_request, energised, energised, st.sampled_from(["commit", "store"])))
    return f"{name}@{when}"
