"""What a column of somebody else's test sheet is called: `Voltage (V)`, `I_line [A]`, `P_in/kW`, `Strangspannung`, `R_UV [Ohm]`."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Set
from functools import lru_cache

from commissioner.recordings.names import ALPHABETS, PHASES, is_remark, key_of, meanings_of
from commissioner.recordings.units import IN_NAME, unit_in
from commissioner.recordings.words import MOST_KEPT, readings, translated
from commissioner.records import WATT_METERS, WINDINGS

_VOLTS = r"(?:v|u|e|voltage|volts?|spannung|tension)"
_AMPS = r"(?:i|current|amps?|strom|courant)"
SHEET = {
    "frequency_hz": re.compile(r"f|freq(?:uency)?f?|supplyfrequency|fs"),
    "voltage_line_v": re.compile(
        rf"{_VOLTS}(?:l|ll|line|linetoline|linevoltage|rms|eff|mean|avg)?|line(?:toline)?voltage|lltvoltage|terminalvoltage|appliedvoltage"
        r"|(?:mean|average)(?:line)?voltage|meanspannung|(?:voltage|spannung|tension)[uv]"
    ),
    "voltage_neutral_v": re.compile(
        rf"{_VOLTS}(?:ln|phn|linetoneutral|phaseneutral|phasetoneutral|star)|(?:phase|line)(?:to)?neutral(?:voltage)?|star(?:voltage|spannung)"
    ),
    "voltage_phase_v": re.compile(
        rf"{_VOLTS}(?:ph|phase|perphase|str)(?:rms|eff)?|phase(?:rms)?(?:voltage|volts|spannung|tension)|strangspannung"
    ),
    "current_line_a": re.compile(
        rf"{_AMPS}(?:l|line|avg|mean|rms|eff)?|line(?:current|amps)|(?:mean|average)(?:line)?current|meanstrom|(?:current|strom|courant)i"
    ),
    "current_phase_a": re.compile(
        rf"{_AMPS}(?:ph|phase|perphase|str)(?:rms|eff)?|phase(?:rms)?(?:current|amps|strom|courant)|strangstrom"
    ),
    "power_w": re.compile(
        r"(?:p|w|power|watts?)(?:in|tot|total|input|3ph|el|active)?|(?:input|total|active|three(?:phase)?|3ph(?:ase)?)+power(?:total)?|powerinput|inputwatts|power(?:in)?p"
    ),
    "power_phase_w": re.compile(
        r"p(?:ph|phase|perphase|str)|(?:active|input)?(?:power|leistung)(?:per|pro|je)?(?:phase|strang)|(?:phase|strang)(?:power|leistung)"
    ),
    "power_factor": re.compile(r"cos(?:ine)?(?:phi|φ|ϕ)?|pf|powerfactor|leistungsfaktor|λ|lambda"),
}  # fmt: skip
"""Line values, also with their own symbol behind the word (`Spannung U`, of which no `Spannung V` is beside it), values of one phase, and the power of all phases. Values of each phase (`I_u`, `U_12`) are a recording's columns."""
FORMS = {
    "voltage_line_v": ("voltage_line_v", "voltage_neutral_v", "voltage_phase_v"),
    "current_line_a": ("current_line_a", "current_phase_a"),
    "power_w": ("power_w", *WATT_METERS, "power_phase_w"),
}  # fmt: skip
"""What a test sheet needs, in any of these columns or, of volts and amperes, in those of each phase."""
_OF_WINDING = r"(?:winding|stator|stander|motor|wicklungs|statorwicklungs|standerwicklungs)*(?:resistance|widerstand|r)"
_PER_PHASE = r"(?:per|pro|je)?(?:phase|strang)"
SHEET_RESISTANCE = {
    "winding_resistance_line_ohm": re.compile(
        r"(?:terminals?|line(?:toline)?|klemmen)(?:winding)?(?:resistance|widerstand)|rll"
        rf"|{_OF_WINDING}(?:(?:between|zwischen)?(?:terminals?|line(?:toline)?|ll|klemmen)|betweenphases?|phasetophase)"
    ),
    "winding_resistance_phase_ohm": re.compile(
        rf"strangwiderstand|phasewindingresistance|(?:winding|wicklungs)+(?:resistance|widerstand){_PER_PHASE}"
        rf"|(?:resistance|widerstand)(?:winding{_PER_PHASE}|{_PER_PHASE}winding|(?:per|je|pro)(?:winding|wicklung|strang))"
        rf"|{_OF_WINDING}(?:between)?(?:terminals)?(?:u1u2|v1v2|w1w2)"
    ),
    "winding_resistance_ohm": re.compile(r"windings?resistance|resistanceof(?:the)?windings?|wicklungswiderstand"),
    "phase_resistance_ohm": re.compile(r"phases?(?:resistance|nwiderstand)|rph(?:ase)?|resistanceperphase"),
    "stator_resistance_ohm": re.compile(r"(?:stator|stander)(?:winding|wicklungs)?(?:resistance|widerstand)|rs|r1"),
    "resistance_ohm": re.compile(r"resistance|widerstand"),
}
"""Columns of a test sheet with the windings' resistance, beside those between two terminals that are named (`R_UV`, `R 1-2`)."""
_TERMINALS = re.compile(
    rf"{_OF_WINDING}(?:between)?(?:terminals)?(?:l?([abcuvwrst123])l?([abcuvwrst123])|([uvw])1([uvw])1|t([123])t([123]))"
)
"""Also as the terminals are marked (IEC 60034-8 `U1-V1`, NEMA MG 1 `T1-T2`); `U1-U2` are the two ends of one winding."""
_PAIR_IN_BRACKETS = re.compile(r"[(\[]\s*([A-Z]?[A-Z0-9]\s*[-/\u2013]\s*[A-Z]?[A-Z0-9])\s*[)\]]", re.IGNORECASE)
_BETWEEN = frozenset(f"winding_resistance_{pair}_ohm" for pair in ("uv", "vw", "wu"))
_TERMINALS_SAID = re.compile(
    r"[(\[]\s*(?:(?:measured|gemessen)?\s*(?:between|at|zwischen|an)?\s*(?:two|zwei|2)?\s*(?:terminals?|klemmen)|line[ -]?to[ -]?line)\s*[)\]]",
    re.IGNORECASE,
)
"""In brackets behind a resistance's name: `Rs (between terminals)`."""
_SYMBOL_BEHIND = re.compile(r"(.*(?:resistance|widerstand))[\s,(]+(R[ _-]?[A-Za-z0-9-]{0,5})\)?", re.IGNORECASE)
"""A symbol behind words of the same: `Stator resistance Rs`, `Winding resistance R_UV`."""
_WINDING = re.compile(
    rf"{_OF_WINDING}(?:(?:of)?(?:phase|winding|strang)l?([123uvwabcrst])|l([123])|(?P<ends>[uvw])1(?P=ends)2|([uvwabcrst]))"
)
"""One of the three windings, by its phase; a bare number (`R1`) may be a measurement's, or the stator's beside the rotor's."""
_OHM_ENDING = re.compile(r"_([mkµu]?ohms?)$", re.IGNORECASE)
_WATT_METER = re.compile(
    r"(?:p|w|power|watts?|wattmeter|leistung|puissance|potencia)l?([123])|(?:p|power)l?([uvwabcrst])"
)
"""A wattmeter's number, or its phase."""
_NUMBERED_VOLTS = re.compile(rf"(?:{_VOLTS}|voltmeter)l?[123]")
"""A meter's number or a phase's, between lines or to the neutral: not said."""


@lru_cache(MOST_KEPT)
def sheet_meaning(name: str) -> str | None:
    """The column of a test sheet (`Voltage (V)`, `I_line [A]`, `P_in/kW`) that a name means, or None."""
    if name in SHEET:
        return name
    said = unit_in(name) if is_remark(unit_in(name)) else ""
    bare = re.sub(r"_(?:hz|v|a|w|kw)$", "", IN_NAME.sub("", name).strip(), flags=re.IGNORECASE)
    keys = [key_of(reading) + key_of(said) for reading in readings(bare)]
    return next((column for key in keys for column, names in SHEET.items() if names.fullmatch(key)), None)


def sheet_columns(names: Iterable[str]) -> dict[str, str]:
    """Names of a test sheet that mean a column which no recording has, with it: volts, amperes, watts, hertz and ohms. Of three
    meters (`I_a`, `I_b`, `I_c`) none is one with its unit behind it (`I_a`)."""
    names = [n for n in names if n]
    windings = winding_columns(names)
    meters = meanings_of([n for n in names if n not in windings])
    several = {m[:7] for m in meters.values() if len({other for other in meters.values() if other[:7] == m[:7]}) > 1}
    own = {n: c for n in names if (c := sheet_meaning(n)) and (n in SHEET or meters.get(n, "")[:7] not in several)}
    own |= _watt_meters(names) | windings
    with_s = any(resistance_meaning(n) in _BETWEEN for n in names if n not in own)
    return own | {n: c for n in names if n not in own and (c := resistance_meaning(n, with_s))}


def _watt_meters(names: Iterable[str]) -> dict[str, str]:
    """Names of two or three wattmeters (`W1`, `W2`; `P_u`, `P_v`, `P_w`) with the column of each; nothing of one alone."""
    found: dict[str, int] = {}
    for name in names:
        bare = (
            re.sub(r"_k?w$", "", IN_NAME.sub("", name).strip(), flags=re.IGNORECASE)
            if name not in WATT_METERS
            else name[:-2]
        )
        meter = next((m for reading in readings(bare) if (m := _WATT_METER.fullmatch(key_of(reading)))), None)
        if meter:
            found[name] = "uvw".index(PHASES[meter[1] or meter[2]])
    is_clear = len(found) > 1 and len(set(found.values())) == len(found)
    return {name: WATT_METERS[k] for name, k in found.items()} if is_clear else {}


def winding_columns(names: Iterable[str]) -> dict[str, str]:
    """Names of three windings' resistances (`R_U [Ohm]`, `R_V [Ohm]`, `R_W [Ohm]`) with the column of each; nothing of fewer."""
    found = {name: phase for name in names if (phase := _first(name, _of_one_winding))}
    return (
        {name: WINDINGS["uvw".index(phase)] for name, phase in found.items()}
        if sorted(found.values()) == [*"uvw"]
        else {}
    )


@lru_cache(MOST_KEPT)
def resistance_meaning(name: str, with_s: bool = False) -> str | None:
    """The column of the windings' resistance (`R_UV [Ohm]`, `Strangwiderstand`) that a name in a test sheet means, or None. `with_s`: behind
    words `RS` is between the terminals R and S, for another pair stands beside it; else it is the stator's symbol, which tells no more than
    the words before it."""
    bare = translated(_OHM_ENDING.sub("", IN_NAME.sub("", name).strip()))
    if _TERMINALS_SAID.search(translated(name)) and _first(_TERMINALS_SAID.sub("", translated(name)), _of_resistance):
        return "winding_resistance_line_ohm"
    if (found := _SYMBOL_BEHIND.fullmatch(bare)) is not None:
        of_symbol = _of_resistance("r" + key_of(found[2]) if with_s and key_of(found[2]) == "rs" else key_of(found[2]))
        if of_symbol in _BETWEEN:
            return of_symbol
        return _first(found[1], _of_resistance) or of_symbol
    return _first(name, _of_resistance)


def _first(name: str, told: Callable[[str], str | None]) -> str | None:
    """What the first reading of a name, without its unit, tells."""
    name = _PAIR_IN_BRACKETS.sub(r" \1", name)
    bare = _OHM_ENDING.sub("", IN_NAME.sub("", name).strip())
    spelt = (*readings(bare), *readings(name))  # the V of `R_V` is a phase
    return next((found for reading in spelt if (found := told(key_of(reading)))), None)


def _of_one_winding(key: str) -> str | None:
    found = _WINDING.fullmatch(key)
    return PHASES[next(filter(None, found.groups()))] if found else None


def _of_resistance(key: str) -> str | None:
    found = _TERMINALS.fullmatch(key)
    ends = [end for end in found.groups() if end] if found else []
    if len({*ends}) > 1 and any({*ends} <= {*letters} for letters in ALPHABETS):
        pair = {PHASES[end] for end in ends}
        return f"winding_resistance_{next(p for p in ('uv', 'vw', 'wu') if set(p) == pair)}_ohm"
    return next((column for column, names in SHEET_RESISTANCE.items() if names.fullmatch(key)), None)


def sheet_unit(name: str) -> str:
    """The unit at the end of a test sheet's `power_kw` or `winding_resistance_uv_mohm`, which no other column has; or nothing."""
    found = _OHM_ENDING.search(name)
    return found[1] if found else "kW" if name.lower().endswith("_kw") else ""


def is_sheet(names: Iterable[str]) -> bool:
    """Whether names are those of a test sheet: volts, amperes and watts in one of their `FORMS`, none twice, and no time."""
    names = [n for n in names if n]
    own, meters = _own(names), _meters(names)
    has_all = all(_has(need, own.keys(), meters) for need in FORMS)
    return has_all and own.total() == len(own) and "time_s" not in meters


def missing_of_sheet(names: Iterable[str]) -> list[str]:
    """What names of a test sheet lack of its columns: two of them at least are there, or the frequency; nothing of other names."""
    names = [n for n in names if n]
    own, meters = _own(names).keys(), _meters(names)
    if "time_s" in meters or not ("frequency_hz" in own or len(own) > 1):
        return []
    return [need for need in FORMS if not _has(need, own, meters)]


def _has(need: str, own: Set[str], meters: Set[str]) -> bool:
    """Whether a sheet gives it in any form. A power factor stands for watts beside a frequency: without one it may be a plate's."""
    is_factor = need == "power_w" and {"frequency_hz", "power_factor"} <= own
    return is_factor or bool(own & set(FORMS[need]) or form_of(need) & meters)


def form_of(need: str) -> frozenset[str]:
    """The columns of each phase that volts or amperes may stand in; none of watts."""
    phases = {"voltage_line_v": ("uv", "vw", "wu", "u", "v", "w"), "current_line_a": ("u", "v", "w")}
    return frozenset(f"{need[:7]}_{phase}_{need[-1]}" for phase in phases.get(need, ()))


def _own(names: list[str]) -> Counter[str]:
    return Counter(column for column in sheet_columns(names).values() if column in SHEET or column in WATT_METERS)


def _meters(names: list[str]) -> set[str]:
    """What names mean in a recording, without voltmeters that are only numbered."""
    return {m for name, m in meanings_of(names).items() if not _NUMBERED_VOLTS.fullmatch(key_of(IN_NAME.sub("", name)))}
