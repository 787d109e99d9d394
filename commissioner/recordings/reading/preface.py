"""What stands above the columns: keys with values, the sample interval or rate, start and increment."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from commissioner.recordings.units import measured_by, read_unit, without_brackets
from commissioner.recordings.words import translated
from commissioner.records import ReadingNote

INTERVAL = frozenset(
    {"sampleinterval", "samplinginterval", "samplingperiod", "sampleperiod", "sampleperiods", "dt", "deltat", "deltatime",
     "tinc", "xincr", "xincrement", "increment", "hresolution", "resolution", "deltax", "tsample", "ts", "timestep",
     "abtastintervall", "abtastzeit", "periodeechantillonnage", "采样周期", "采样间隔", "timeinterval", "hinterval", "interval",
     "sampletime", "abtastperiode", "zykluszeit", "cycletime", "périodedéchantillonnage", "pasdetemps"}
)  # fmt: skip
RATE = frozenset(
    {"samplerate", "samplingrate", "samplingfrequency", "samplefrequency", "fs", "samplespersecond", "abtastrate",
     "abtastfrequenz", "采样率", "采样频率", "frequenceechantillonnage", "fréquencedéchantillonnage", "samplerateinhz", "sampleratehz", "samplingratehz",
     "fshz", "samplessec", "srate"}
)  # fmt: skip
START = frozenset({"start", "t0", "starttime", "xzero", "xorigin", "x0", "hoffset"})
VALUE = re.compile(r"(?:[A-Za-z]+:)?\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([^\d\s].*)?")
_THOUSANDS = re.compile(r"\s*[1-9]\d{0,2}(?:,\d{3})+(?![\d.,])")
_POINTED = re.compile(r"\s*[1-9]\d{0,2}(?:\.\d{3})+(?![\d.,])")
SIGNS = re.compile(r"^([^:=]{1,60})[:=]\s*(.+)$")


@dataclass(frozen=True)
class Clock:
    """When the samples were taken, by what stands beside them: interval and start in seconds, each None where unsaid."""

    interval_s: float | None = None
    start_s: float | None = None
    said_by: str = ""


def key(text: str) -> str:
    """Letters (of any script) and digits, in lower case, without a unit in brackets."""
    return re.sub(r"[\W_]", "", translated(without_brackets(text)).lower())


def pairs(rows: Iterable[Sequence[str]]) -> list[tuple[str, str, str]]:
    """(key, value, unit) of rows `key,value[,unit]` and of cells `key: value` or `key = value`."""
    found = []
    for row in rows:
        cells = [c.strip().strip('"') for c in row]
        for cell in cells:
            if said := SIGNS.match(cell):
                found.append((said[1].strip().lstrip("# "), said[2].strip(), ""))
        filled = [c for c in cells if c]
        if len(filled) >= 2 and not SIGNS.match(filled[0]):
            found.append((filled[0].rstrip(":= "), filled[1], filled[2] if len(filled) > 2 else ""))
    return found


def clock_in(said: Iterable[tuple[str, str, str]], decimal: str = ".") -> Clock:
    """The first interval or rate that is said, with its unit (seconds and hertz where none stands); none that may be thousands by the
    decimal mark of the file."""
    interval, start, by = None, None, ""
    for name, value, unit in said:
        number = None if decimal == "," and _POINTED.match(value) else seconds(name, value, unit)
        if number is None:
            continue
        if key(name) in START:
            start = number if start is None else start
        elif interval is None and key(name) in INTERVAL and number > 0:
            interval, by = number, f"{name} {value} {unit}".strip()
        elif interval is None and key(name) in RATE and number > 0:
            interval, by = 1.0 / number, f"{name} {value} {unit}".strip()
    return Clock(interval, start, by)


def seconds(name: str, value: str, unit: str) -> float | None:
    """The number in seconds (or hertz, of a rate); None where it is none, may be thousands (`5,000 Hz`), or its unit is not one of
    time or rate."""
    if _THOUSANDS.match(value):
        return None
    text = value.replace(",", ".") if value.count(",") == 1 and "." not in value else value
    found = VALUE.fullmatch(text.strip())
    if not found or not math.isfinite(number := float(found[1])):
        return None
    said = (found[2] or "").strip() or _in_brackets(name) or unit
    return number * _factor(said, key(name) in RATE) if said else number


def _in_brackets(name: str) -> str:
    found = re.search(r"[\[(]([^\])]+)[\])]\s*$", name)
    return found[1] if found else ""


def _factor(unit: str, is_rate: bool) -> float:
    """To seconds, or to hertz; 1 where the text is no unit of it."""
    bare = unit.strip("[]() ")
    if is_rate:
        found = re.fullmatch(r"([kMG]?)(?:S/s|Sa/s|SPS|Hz|S|samples/s)", bare)
        return {"": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}[found[1]] if found else 1.0
    known = read_unit(bare)
    return known.scale if known and known.measures == "time" else 1.0


def metadata_of(said: Iterable[tuple[str, str, str]]) -> Mapping[str, str]:
    """Keys with their values, as texts; the first of two alike stands."""
    out: dict[str, str] = {}
    for name, value, _ in said:
        out.setdefault(name.strip(), value)
    return out


def probes_in(preface: Sequence[Sequence[str]]) -> str:
    """Ratios of probes other than one that a row of the preface names, as `200:1, 10:1`; empty where there is none."""
    found = [_RATIO.fullmatch(cell) for _, cells in _keyed(preface, _PROBE) for cell in cells]
    ratios = [float(one[1]) for one in found if one]
    return ", ".join(f"{ratio:g}:1" for ratio in dict.fromkeys(ratios) if ratio != 1.0)


def factors_in(preface: Sequence[Sequence[str]]) -> str:
    """Scales and transformers' ratios other than one that a row of the preface names, as `CT ratio 100/5`; empty where there
    is none."""
    found = [
        (name, [c for c in dict.fromkeys(cells) if c and not _ONE.fullmatch(c)])
        for name, cells in _keyed(preface, _SCALE)
    ]
    return "; ".join(f"{name} {', '.join(cells)}" for name, cells in found if any(re.search(r"\d", c) for c in cells))


def factors_said(preface: Sequence[Sequence[str]]) -> list[ReadingNote]:
    """A note of the scales that a preface names: none is applied."""
    what = "stands above the columns: numbers are taken as they are printed; where they do not hold this factor yet, map the channels with it"
    return [ReadingNote("factors", f"{factors} {what}")] if (factors := factors_in(preface)) else []


@dataclass(frozen=True)
class UnitSaid:
    """The unit that a line above the columns gives for all that measure the same, and that line."""

    unit: str
    line: str


def units_said(said: Iterable[tuple[str, str, str]], cells: Iterable[str]) -> Mapping[str, UnitSaid]:
    """The units that stand once above the columns for all times, currents or voltages, by what these are: of keys (`Time unit: ms`),
    else of lines."""
    keys = [(_UNIT_OF.fullmatch(key(name)), name, value) for name, value, _ in said]
    of_keys = {
        _MEASURES[one[1] or one[2]]: UnitSaid(value, f"{name}: {value}") for one, name, value in reversed(keys) if one
    }
    return {**_units_in_lines(cells), **of_keys}


def _units_in_lines(cells: Iterable[str]) -> Mapping[str, UnitSaid]:
    """The units that lines say beside what is measured (`currents in mA`, `Spannungen [kV]`, `current_u_a: mA`), by what they measure;
    of what is said in two units, or with a value (`rated current in mA: 4860`), nothing."""
    found: dict[str, list[UnitSaid]] = {}
    for cell in cells:
        for one in _IN_UNIT.finditer(" ".join(translated(cell.replace("：", ":")).split())):
            unit = read_unit(one["unit"])
            if unit and unit.measures == _measured(one["what"]):
                found.setdefault(unit.measures, []).append(UnitSaid(one["unit"], cell.strip().lstrip("# ")))
    return {
        measures: said[0]
        for measures, said in found.items()
        if len({unit.scale for one in said if (unit := read_unit(one.unit))}) == 1
    }


def _measured(word: str) -> str | None:
    """What a word of prose, or a column of the contract, measures."""
    kind = _NOUN.search(word.lower())
    return measured_by(word.lower()) or (kind.lastgroup if kind else None)


def _keyed(preface: Sequence[Sequence[str]], names: re.Pattern[str]) -> list[tuple[str, list[str]]]:
    """(key, cells behind it) of rows `key,cell,...` and of cells `key: value` whose key is one of these names."""
    signs = [said for row in preface for cell in row if (said := SIGNS.match(cell.strip()))]
    rows = [(row[0], list(row[1:])) for row in preface if len(row) > 1] + [
        (s[1].strip().lstrip("# "), [s[2]]) for s in signs
    ]
    return [(name.strip(), [c.strip() for c in cells]) for name, cells in rows if names.fullmatch(key(name))]


_PROBE = re.compile(r"(?:probe|(?:probe)?(?:attenuation|ratio))\d*")
_KIND = r"(?:current|voltage|strom|spannungs?|courant|tension|transformer|transducer|sensor|ct|pt|vt)"
_SCALE = re.compile(
    rf"(?:{_KIND}*(?:ratio|scale|scal(?:e|ing)factor|multiplier|gain|factor|faktor|skalierung|übersetzung){_KIND}*)\d*"
)
_ONE = re.compile(r"1(?:[.,]0*)?(?:\s*[:/]\s*1|\s*x)?")
_MEASURES = {"time": "time", "zeit": "time", "temps": "time", "horizontal": "time", "x": "time", "current": "current", "strom": "current",
             "courant": "current", "voltage": "voltage", "spannung": "voltage", "spannungs": "voltage", "tension": "voltage"}  # fmt: skip
_UNIT_OF = re.compile(
    rf"({'|'.join(_MEASURES)})(?:axis)?(?:units?|einheit|unitlabel)|unité(?:de)?({'|'.join(_MEASURES)})"
)
_NOUN = re.compile(
    r"(?P<current>(?:currents?|str(?:o|oe|ö)me?|amperages?)$|^i$)|(?P<voltage>(?:voltages?|spannung(?:en)?)$|^[uv]$)"
    r"|(?P<time>(?:times?|zeit(?:en)?|temps)$|^t$)|(?P<power>(?:powers?|leistung(?:en)?)$|^p$)|(?P<speed>(?:speeds?|drehzahl)$)"
)
_IN_UNIT = re.compile(
    r"(?<!\w)(?P<what>[^\W\d]\w*)(?: (?:units?|einheit|单位|is|are|was|were|given|measured|recorded|stored|values?|samples|all|sind|ist|werte?|angegeben|gemessen|sont))*"
    r"\s*(?:(?<!\w)(?:in|en)(?!\w)|[:=(\[])\s*\(?\[?(?P<unit>[^\W\d][^\s,;.:()\[\]]*)(?![^\s,;.:)\]])(?![)\]]?\s*[:=;]?\s*[-+]?\d)",
    re.IGNORECASE,
)
"""What is measured, and the text of a unit behind it that no value follows."""
_RATIO = re.compile(r"(\d+(?:\.\d+)?(?:e[+-]?\d+)?)\s*(?::\s*1|x)?", re.IGNORECASE)
