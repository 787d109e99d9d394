"""Lists of a no-load and a locked-rotor test, told by the index of their symbols (`U0 I0 P0`, `U_k;I_k;P_k`), as rows that name their test."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from commissioner.recordings.sheet_names import sheet_meaning
from commissioner.recordings.units import IN_NAME, NO_UNIT, read_unit, unit_in
from commissioner.recordings.words import folded, translated
from commissioner.records import DIRECT_TEST, IDLE_TEST, LOCKED_TEST, ReadingNote, Signal

_SYMBOL = re.compile(
    r"(?:(?P<kind>[UVEIPWf])(?:_?(?P<of>ph|str|ln))?|(?P<factor>cos[\W_]*(?:phi|φ|ϕ|fi)|pf))[_, ]{0,2}"
    r"\{?(?P<test>(?P<idle>0|nl|o)|(?P<locked>k|cc|sc|lr|br|bl|cto)|(?P<direct>dc|=))\}?(?:[_, ]?(?P<behind>ph|str|ln))?",
    re.IGNORECASE,
)
"""Of volts, amperes or watts of a test, of a phase (`ph`, `str`) or to the neutral (`ln`) where it says so; of its power factor."""
_TESTS = {"idle": IDLE_TEST, "locked": LOCKED_TEST, "direct": DIRECT_TEST}
_INDEX = {IDLE_TEST: "0", LOCKED_TEST: "k", DIRECT_TEST: "dc"}
_NEEDS = {IDLE_TEST: "UIP", LOCKED_TEST: "UIP", DIRECT_TEST: "UI"}
_FORMS = {"U": {"U", "Uph", "Uln"}, "I": {"I", "Iph"}, "P": {"P", "Pph", "cosphi"}}
"""Of each test what it needs, and what each may be given in."""
_WORDS = {
    IDLE_TEST: re.compile(r"no[\W_]*load|leerlauf(?:versuchs?)?|idling|idle|unloaded"),
    LOCKED_TEST: re.compile(
        r"(?:locked|blocked)[\W_]*(?:rotor)?|kurzschlu(?:ss|ß)(?:versuchs?)?|short[\W_]*circuit|festgebremst|stand[\W_]?still"
    ),
    DIRECT_TEST: re.compile(
        r"(?<![a-z])d\.?c\.?(?![a-z])|direct(?:[\W_]*current(?=[\W_]+\w))?|gleich(?=spannung|strom)"
    ),
}
"""What names of quantities say of their test."""
_SPELT = {"voltage_line_v": "U", "current_line_a": "I", "power_w": "P", "frequency_hz": "f", "voltage_phase_v": "Uph",
          "voltage_neutral_v": "Uln", "current_phase_a": "Iph", "power_phase_w": "Pph", "power_factor": "cosphi"}  # fmt: skip
_KIND = {"u": "U", "v": "U", "e": "U", "i": "I", "p": "P", "w": "P", "f": "f"}
MEASURES = {"U": "voltage", "I": "current", "P": "power", "f": "frequency"}
SHOWN = {"U": "V", "Uph": "V", "Uln": "V", "I": "A", "Iph": "A", "P": "W", "Pph": "W", "cosphi": "", "f": "Hz"}
CALLED = {IDLE_TEST: "no load", LOCKED_TEST: "locked rotor", DIRECT_TEST: "direct current"}


def is_symbol(name: str) -> bool:
    """Whether a name is the symbol of a test's quantity: `U_0`, `Ik [A]`."""
    return _SYMBOL.fullmatch(IN_NAME.sub("", name).strip()) is not None


def symbol_of(name: str, titled: float) -> str:
    """The symbol of what words mean together (`No-load voltage`: `U_0`), the test said by them or by the title above."""
    plain = folded(translated(name)).lower()
    test = next((test for test, words in _WORDS.items() if words.search(plain)), titled)
    if test not in _INDEX:
        return ""
    bare = " ".join(_WORDS[test].sub(" ", plain).split()).strip(" -,:;/()")
    kind = _SPELT.get(sheet_meaning(re.sub(r"\b(?:test|in|im|bei|at|of|the|am)\b", "", bare).strip(" -,:;/()")) or "")
    return f"{kind}_{_INDEX[test]}" if kind else ""


def tests_in(names: Sequence[str]) -> Mapping[float, Mapping[str, int]]:
    """Of each test whose volts, amperes and watts (beside another, of direct current volts and amperes) are all there, once: the place of each symbol's name. None where other names count on
    (`I0`, `I1`): then they are phases."""
    found: dict[float, dict[str, int]] = {}
    bare = [IN_NAME.sub("", name).strip() for name in names]
    if any(re.fullmatch(r"[UVEI][_ ]?1", name, re.IGNORECASE) for name in bare):
        return {}
    for k, name in enumerate(bare):
        if (one := _SYMBOL.fullmatch(name)) is None:
            continue
        of_test = found.setdefault(next(test for of, test in _TESTS.items() if one[of]), {})
        phase = (one["of"] or one["behind"] or "").lower().replace("str", "ph")
        kind = "cosphi" if one["factor"] else _KIND[one["kind"].lower()] + phase
        if kind in of_test:
            return {}
        of_test[kind] = k
    whole = {test: of for test, of in found.items() if all(_FORMS[need] & of.keys() for need in _NEEDS[test])}
    return whole if whole.keys() - {DIRECT_TEST} else {}


def in_rows(
    names: Sequence[str], units: Sequence[str], values: Sequence[Signal]
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[Signal, ...], list[ReadingNote]]:
    """The columns with a row for each point of each test, its test named; as they are where no names tell tests."""
    tests = tests_in(names)
    if not tests or any(_factor(k, kind, names, units) is None for of in tests.values() for kind, k in of.items()):
        return tuple(names), tuple(units), tuple(values), []
    taken = {k for of in tests.values() for k in of.values()}
    others = [k for k in range(len(names)) if k not in taken]
    kinds = [kind for kind in SHOWN if any(kind in of for of in tests.values())]
    parts: list[list[Signal]] = []
    for test, of in tests.items():
        own = [_in_si(of.get(kind), kind, names, units, values) for kind in kinds]
        if test == DIRECT_TEST:
            own = [_of_direct(kind, column, own, kinds) for kind, column in zip(kinds, own, strict=True)]
        rows = np.isfinite(own).any(axis=0)
        parts.append([column[rows] for column in (np.full(rows.size, test), *own, *(values[k] for k in others))])
    columns = tuple(np.concatenate(part) for part in zip(*parts, strict=True))
    said = [f"{', '.join(names[k] for k in of.values())}: the {CALLED[test]} test" for test, of in tests.items()]
    note = ReadingNote("indexed_tests", "; ".join(said) + "; each of its points was taken as a row")
    called = ("test", *kinds, *(names[k] for k in others))
    return called, ("", *(SHOWN[kind] for kind in kinds), *(units[k] for k in others)), columns, [note]


def _of_direct(kind: str, column: Signal, own: Sequence[Signal], kinds: Sequence[str]) -> Signal:
    """Of direct current what a sheet leaves out: its frequency is zero, its watts are volts times amperes."""
    nothing = np.full(column.size, np.nan)
    volts, amps = (own[kinds.index(k)] if k in kinds else nothing for k in "UI")
    left_out = {"f": np.where(np.isfinite(volts), 0.0, np.nan), "P": volts * amps}.get(kind, column)
    return np.where(np.isfinite(column), column, left_out)


def _factor(k: int, kind: str, names: Sequence[str], units: Sequence[str]) -> float | None:
    """To SI; None of a unit that is not one of this quantity, which is refused by its name."""
    text = units[k] or unit_in(names[k])
    unit = read_unit(text) if text else None
    if kind == "cosphi":
        return {"%": 0.01}.get(text, 1.0 if text.lower() in NO_UNIT else None)
    if not text:
        return 1.0
    return unit.scale if unit and unit.measures == MEASURES[kind[0]] and not unit.is_ambiguous else None


def _in_si(k: int | None, kind: str, names: Sequence[str], units: Sequence[str], values: Sequence[Signal]) -> Signal:
    if k is None:
        return np.full(values[0].size, np.nan)
    return values[k] * (_factor(k, kind, names, units) or 1.0)
