"""What a column of somebody else's file is called: `Ia`, `i_L1 (A)`, `Strom U`, `stator_current_a`, `I_R`, `U L1-L2 [V]`, `vab`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import lru_cache

from commissioner.recordings.units import (
    IN_NAME,
    is_temperature,
    measured_by,
    read_unit,
    unbracketed,
    unit_in,
    without_brackets,
)
from commissioner.recordings.words import MOST_KEPT, folded, translated

PHASES = {
    "a": "u",
    "b": "v",
    "c": "w",
    "1": "u",
    "2": "v",
    "3": "w",
    "u": "u",
    "v": "v",
    "w": "w",
    "r": "u",
    "s": "v",
    "t": "w",
}
ALPHABETS = ("abc", "uvw", "rst", "123")
SAME_KIND = {"tension": "uv", "spannung": "u", "voltage": "uv", "strom": "i", "courant": "i", "current": "i"}
"""Symbols that say the same again: `Tension U12`, `Strom I1`."""
FILLING = frozenset(
    {
        "phase",
        "ph",
        "stator",
        "line",
        "motor",
        "machine",
        "mains",
        "grid",
        "supply",
        "channel",
        "terminal",
        "measured",
        "to",
        "fase",
        "phasen",
        "actual",
        "value",
        "istwert",
        "last",
        "ave",
        "instantaneous",
        "inst",
        "abc",
        "uvw",
        "rst",
        "star",
        "between",
    }
)
REMARKS = FILLING | {
    "ll",
    "avg",
    "mean",
    "rms",
    "eff",
    "total",
    "in",
    "probe",
    "sensor",
    "utc",
    "local",
    "relative",
    "absolute",
}
"""Words that describe a channel in brackets, where its unit might stand."""
CURRENT = r"i|is|il|iph|cur|curr|current|currents|strom|courant|amps"
VOLTAGE = r"u|v|vs|vl|ul|vph|uph|vll|ull|vol|volt|volts|voltage|voltages|spannung|tension"
TIME = frozenset(
    {
        "t",
        "time",
        "times",
        "zeit",
        "temps",
        "timestamp",
        "x",
        "xaxis",
        "second",
        "seconds",
        "sec",
        "xvalue",
        "timesec",
        "zeitstempel",
        "uhrzeit",
        "datetime",
        "messzeit",
        "zeitpunkt",
        "dateandtime",
        "datumuhrzeit",
        "datumzeit",
        "datumunduhrzeit",
        "fechahora",
        "fechayhora",
        "hora",
        "dateheure",
        "dateetheure",
        "heure",
        "horodatage",
        "dataora",
        "ora",
    }
)
SPEED = frozenset({"speed", "speedradpers", "wm", "omegam", "shaftspeed", "rotorspeed"})
SPEED_PER_MINUTE = frozenset({"drehzahl", "n", "rpm", "speedrpm", "nrpm"})
"""Without a unit of its own such a column is in 1/min."""
AXIS = frozenset({"axis", "achse", "axe", "eje", "asse"})
SEGMENT = frozenset({"segment", "seg", "segmento", "abschnitt"})
BESIDE = FILLING | {
    "angle",
    "winkel",
    "angulo",
    "angolo",
    "test",
    "along",
    "command",
    "commanded",
    "no",
    "nr",
    "number",
    "id",
    "deg",
    "el",
    "elec",
    "electrical",
    "elektrisch",
}
"""What else the names of a standstill test's columns say."""
WHOLE_NAMES = {
    "achswinkel": "axis_deg", "achsenwinkel": "axis_deg", "achsspannung": "voltage_axis_v", "achsenspannung": "voltage_axis_v",
    "vdc": "dc_link_v", "udc": "dc_link_v", "dclink": "dc_link_v", "dclinkvoltage": "dc_link_v", "dcbus": "dc_link_v",
    "dcbusvoltage": "dc_link_v", "zwischenkreisspannung": "dc_link_v", "uzk": "dc_link_v", "vbus": "dc_link_v", "busvoltage": "dc_link_v",
    "uaxis": "voltage_axis_v", "vaxis": "voltage_axis_v",
}  # fmt: skip
CONTRACT = re.compile(r"time_s|current_[uvw]_a|voltage_(?:u|v|w|uv|vw|wu)_v|speed_rad_per_s")
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[0-9]")
_PHASE = re.compile(r"l?([abcuvwrst123])(?:n|0)?")
_NUMBERED = re.compile(r"([a-z]+)([0-9])(?:a|v|ma|mv|kv)?")
_OF_THREE = re.compile(
    rf"(?:^|(?<=\.))({CURRENT}|{VOLTAGE})[ _]?(abc|uvw|rst)[ _.]?[\[(]?([012])[\])]?((?:\s*[\[(/].*)?)$", re.IGNORECASE
)
_ONE_PHASE = re.compile(r"[abcuvwrst123]|l[123]")
_PAIR = re.compile(r"l?([abcuvwrst123])l?([abcuvwrst123])")
_CLOCK_FORM = re.compile(r"[hmsdy]+(?:[:.,/ -]+[hmsdyf]+)*:[hmsf]+(?:[.,]\w+)?", re.IGNORECASE)
"""`hh:mm:ss.fff`, in brackets behind a time of day."""
_PARAMETER = re.compile(r"^[rp]\d{2,5}(?:\[\d+\])?[:\s]+")
"""Of a drive's trace: `r0069[0] Phase current actual value, Phase U`."""
_TIME_OF_RATE = re.compile(r"time\d*(?:default|slow|fast)?samplerate")
_RYB_AS_RST = str.maketrans("yb", "st")
_STATOR = re.compile(r"([iuv])(?:s([abcuvw123])|([abc123])s)|([uv])s([abcuvw123]{2})")
"""`isa`, `usb`; `ias`, `vbs`; `usab`: stator quantities."""
_PATH = re.compile(r"^.*\.(?=[^.\s\[\]()][^.\[\]()]*(?:[\[(].*)?$)")
_NEUTRAL = re.compile(r"(?:[iuv]|current|voltage|strom|spannung|courant|tension)(?:n|neutral)")
"""Of the neutral: no phase, whatever letters its unit adds."""
_KIND = rf"(?:{CURRENT}|{VOLTAGE})"
_COLOURED = re.compile(rf"(?<![a-z])({_KIND}?)([ryb]{{1,2}}|red|yellow|blue)(?=n?(?![a-z]))", re.IGNORECASE)
"""Phases by their colours, red, yellow and blue: `I_Y`, `VRY`, `B phase current`, `R-N voltage`."""
_OTHERS = re.compile(rf"(?<![a-z]){_KIND}?[acst](?![a-z])", re.IGNORECASE)
_OF_A_PHASE = re.compile(rf"(?<![a-z]){_KIND}(?=[ryb]{{0,2}}n?(?![a-z]))", re.IGNORECASE)
_COMPONENT = re.compile(rf"({CURRENT}|{VOLTAGE})s?(alpha|beta)(?:ref|soll|set|cmd|command|act|ist|mess|meas)?")
"""Of a vector: `i_alpha`, `uβ`, `us_alpha_ref`."""
_ROW_NUMBER = re.compile(r"n[°º]\.?", re.IGNORECASE)
"""A count of rows in French, Italian and Spanish; no speed n with a degree sign."""
_OF_CHANNEL = re.compile(
    r"^(?:ch|chan|channel|kanal|kanaal|voie|canale?)[ ._]?\d+(?:[-_.]\d+)?[ .:_-]+(?=[^\W\d])", re.IGNORECASE
)
"""An instrument's own name of a channel, before that which somebody gave it: `CH1 Ia`."""
_LOOSE = re.compile(
    r"[\[(](?P<before>[^\])]+)[\])]\s*(?P<after>\S.*)|(?P<name>.*[^\s.-])(?:\s+-\s*|\.|\s+)(?P<unit>[^\s.]{1,6})"
)
"""A unit before its name, or behind a dash, a point or a space."""
_TIME_OF = re.compile(r"(?:t|time|zeit|temps|tempo|tiempo)[ _.](?!.*/)(.+)", re.IGNORECASE)
"""A time that one channel has to itself: `t Ia`, `Time_CH1`."""
_KIND_DOT = re.compile(rf"(?<![^\W_])({_KIND})\.(?=l?[abcuvwrst123]{{1,2}}(?![^\W_]))", re.IGNORECASE)
"""`i.u`, `Motor.U.uv`: the point stands between a quantity and its phase."""
_CYRILLIC = re.compile(r"(?<![а-яё])[авс]{1,2}(?![а-яё])", re.IGNORECASE)
_AS_LATIN = str.maketrans("авсАВС", "abcABC")
"""Phases in letters that look alike."""
_SHORT = re.compile(rf"({CURRENT}|{VOLTAGE})((?:l?[abcuvwrst123]){{1,2}})(?:n|0|a|v)?")


@lru_cache(MOST_KEPT)
def meaning_of(name: str, with_s: bool = False) -> str | None:
    """The contract's column that a name means, or None. `with_s`: a bare `is` or `us` is phase S, for R and T are there too."""
    if CONTRACT.fullmatch(name):
        return name
    if _ROW_NUMBER.fullmatch(name.strip()):
        return None
    raw, last = name, _PARAMETER.sub("", _without_path(name))
    name = translated(name if last.isdigit() else last)
    if _NEUTRAL.fullmatch(key_of(IN_NAME.sub("", name))):
        return None
    if not IN_NAME.sub("", name).strip() and (unit := read_unit(unit_in(name))) and unit.measures == "time":
        return "time_s"
    found = _meaning(IN_NAME.sub("", name), with_s) or _meaning(name, with_s)  # `voltage_A` is a phase, not ampere
    found = found or _meaning_of_loose(raw, with_s)
    return None if found == "time_s" and is_temperature(unit_in(name)) else found


def _meaning_of_loose(name: str, with_s: bool) -> str | None:
    """The column of a name with its channel before it, its unit elsewhere than at its end in brackets, or a time of one channel."""
    if (own := _OF_CHANNEL.sub("", name)) != name:
        return meaning_of(own, with_s)
    if (of := _TIME_OF.fullmatch(name)) and (meaning_of(of[1], with_s) or "").startswith(("current_", "voltage_")):
        return "time_s"
    loose = _loose_unit(name)
    return meaning_of(loose[0], with_s) if loose else None


def _loose_unit(name: str) -> tuple[str, str] | None:
    """(name, unit) of a name whose unit stands before it, or behind a dash, a point or a space, and measures what the name means."""
    found = _LOOSE.fullmatch(name.strip())
    if not found:
        return None
    bare, text = found["after"] or found["name"], found["before"] or found["unit"]
    unit, meaning = read_unit(text), meaning_of(bare)
    return (bare, text) if unit and meaning and measured_by(meaning) == unit.measures else None


def unit_of(name: str, with_s: bool = False) -> str:
    """The text of the unit at the end of a name; nothing where what stands there is part of the name (`V(a,b)`, `voltage_A`)
    or describes the channel (`Ia (phase A)`)."""
    text, bare = unit_in(name), IN_NAME.sub("", name).strip()
    known = read_unit(text)
    if not text:
        loose = None if _meaning(translated(_without_path(name)), with_s) else _loose_unit(name)
        return loose[1] if loose else ""
    is_part = bare and meaning_of(bare, with_s) is None and meaning_of(name, with_s) is not None
    return "" if is_remark(text) or (is_part and (known is None or known.scale == 1.0)) else text


def is_remark(text: str) -> bool:
    """Whether a text in brackets describes a channel: words for it, with a phase or without, or how a time of day is written."""
    words = re.findall(r"[^\W\d_]+|\d+|%", unbracketed(text).lower())
    described = [word for word in words if word in REMARKS]
    is_description = described and all(word in REMARKS or _ONE_PHASE.fullmatch(word) for word in words)
    return bool(is_description) or _CLOCK_FORM.fullmatch(unbracketed(text)) is not None


def turned(name: str) -> str:
    """What a name with a minus before it (`-Ia`) is the negative of; nothing of any other name."""
    found = re.fullmatch(r"[-\u2212\u2013](?=[^\W\d])(.+)", name.strip())
    return found[1] if found else ""


def reversed_pair(name: str) -> str | None:
    """The line-to-line voltage whose negative a name means: `Uac` is minus `voltage_wu_v`; None where it means none."""
    found = re.fullmatch(rf"(?:{VOLTAGE})l?([abcuvwrst123])l?([abcuvwrst123])", key_of(name))
    if not found or not any(found[1] in letters and found[2] in letters for letters in ALPHABETS):
        return None
    pair = PHASES[found[2]] + PHASES[found[1]]
    return f"voltage_{pair}_v" if pair in {"uv", "vw", "wu"} else None


def uses_rst(names: Iterable[str]) -> bool:
    """True where the phases are called R, S, T."""
    keys = {key_of(name) for name in names}
    return any({f"{kind}r", f"{kind}t"} <= keys for kind in ("i", "u", "v", "il", "ul", "vl"))


def uses_ryb(names: Iterable[str]) -> bool:
    """True where the phases are called R, Y, B: two of them, and with Y missing none of A, C, S, T."""
    bare = [without_brackets(name) for name in names]
    coloured = [_COLOURED.findall(name) for name in bare if _OF_A_PHASE.search(name)]
    letters = {letter for found in coloured for _, said in found for letter in _letters(said)}
    return len(letters) > 1 and ("y" in letters or not any(map(_OTHERS.search, bare)))


def in_company(names: Sequence[str]) -> dict[str, str]:
    """The names as they are to be read beside each other: phases that are called R, Y, B with R, S, T in their place, and without
    a unit that only a phase of its own name could be (`Current (A)` where there is no `Current (B)`); `i_abc[1]`, counted from zero,
    as `i_b`."""
    from_zero = _from_zero(names)
    said = {name: _lettered(name) if name in from_zero else name for name in names}
    ours = [translated(name) for name in said.values()]
    if uses_ryb(ours):
        return dict(zip(said, (_COLOURED.sub(_as_rst, name) for name in ours), strict=True))
    return {name: IN_NAME.sub("", name).strip() if _is_unit_alone(name, names) else own for name, own in said.items()}


def _is_unit_alone(name: str, names: Sequence[str]) -> bool:
    """Whether the unit of a name is the only phase that it says, and no other phase is called so."""
    own, *others = (_without_path(one).lower() for one in (name, *names))
    unit, bare = unit_in(name).lower(), IN_NAME.sub("", own).strip()
    if (
        not bare
        or unit not in PHASES
        or read_unit(unit) is None
        or meaning_of(bare) is not None
        or meaning_of(name) is None
    ):
        return False
    called = {form for other in others for form in (other, without_brackets(other)) if form.startswith(bare)}
    rests = {re.sub(r"[^a-z0-9]", "", form[len(bare) :]) for form in called}
    return not any({unit, rest} <= set(letters) for letters in ALPHABETS for rest in rests - {unit})


def _as_rst(found: re.Match[str]) -> str:
    return found[1] + _letters(found[2]).translate(_RYB_AS_RST)


def _letters(said: str) -> str:
    return said.lower()[:1] if len(said) > 2 else said.lower()


def counted_from_zero(names: Iterable[str]) -> frozenset[str]:
    """Names whose phases are 0, 1, 2 (`i[0]` ...): which of them is u is not what their numbers say elsewhere, unless the signal
    names them (`i_abc[0]`)."""
    return frozenset(name for name in _from_zero(names) if _lettered(name) == name)


def _from_zero(names: Iterable[str]) -> frozenset[str]:
    stems: dict[str, dict[str, str]] = {}
    for name in names:
        if found := _NUMBERED.fullmatch(re.sub(r"[^a-z0-9]", "", name.lower())):
            stems.setdefault(found[1], {})[found[2]] = name
    return frozenset(name for by in stems.values() if set(by) == {"0", "1", "2"} for name in by.values())


def _lettered(name: str) -> str:
    """Of a signal that names its phases the one meant, counted from zero: `i_abc[1]` as `i_b`; any other name as it is."""
    found = _OF_THREE.search(name)
    return f"{found[1]}_{found[2][int(found[3])]}{found[4]}" if found else name


@lru_cache(MOST_KEPT)
def key_of(name: str) -> str:
    """Letters and digits of a name, without accents, its unit in brackets and its path."""
    bare = without_brackets(_without_path(name))
    return re.sub(r"[^a-z0-9]", "", folded(bare).lower())


def _without_path(name: str) -> str:
    """A name without the structures before it; points of its unit (`Ia [p.u.]`) and of a short word (`Segment No.`) are its own."""
    return _PATH.sub("", _KIND_DOT.sub(r"\1_", name))


def meanings_of(names: Sequence[str]) -> dict[str, str]:
    """Names that mean a column of the contract, by what their letters are in this company, with that column."""
    meant = in_company(names)
    with_s = uses_rst(n for n in meant.values() if n)
    found = {name: meaning_of(own, with_s) for name, own in meant.items() if name}
    return {name: meaning for name, meaning in found.items() if meaning is not None}


def is_per_minute(name: str) -> bool:
    """A speed column whose name alone says 1/min."""
    return key_of(name) in SPEED_PER_MINUTE


def _meaning(bare: str, with_s: bool) -> str | None:
    bare = re.sub("[αΑ]", "alpha", re.sub("[βΒ]", "beta", folded(bare)))
    bare = _CYRILLIC.sub(lambda found: found[0].translate(_AS_LATIN), bare)
    words = [word.lower() for word in _WORD.findall(bare)]
    key = re.sub(r"[^a-z0-9]", "", bare.lower())
    if key in TIME or _TIME_OF_RATE.fullmatch(key):
        return "time_s"
    if key in SPEED | SPEED_PER_MINUTE:
        return "speed_rad_per_s"
    if at_rest := WHOLE_NAMES.get(key) or _at_rest({word for word in words if word not in BESIDE}):
        return at_rest
    if stator := _STATOR.fullmatch(key):
        return _column(stator[1] or stator[4], stator[2] or stator[3] or stator[5])
    if component := _COMPONENT.fullmatch(key):
        return f"current_{component[2]}_a" if re.fullmatch(CURRENT, component[1]) else f"voltage_{component[2]}_v"
    words = [word for word in words if word not in FILLING]
    kinds = [word for word in words if re.fullmatch(rf"{CURRENT}|{VOLTAGE}", word)]
    kind = max(kinds, key=len, default="")
    if kind and (len(words) > 1):
        rest = list(words)
        rest.remove(kind)
        found = _column(kind, "".join(rest)) or _column(
            kind, "".join(w for w in rest if w not in SAME_KIND.get(kind, ""))
        )
        if found:
            return found
    short = _SHORT.fullmatch("".join(words) if words else key)
    if short and (with_s or short.group(0) not in {"is", "us", "vs"}) and (with_s or short.group(0) != "it"):
        return _column(short.group(1), short.group(2))
    return None


def _at_rest(words: set[str]) -> str | None:
    """The column of a standstill test that these words mean together: the axis, the voltage along it, the segment."""
    others = words - AXIS
    if not words & AXIS:
        return "segment" if len(words) == 1 and words <= SEGMENT else None
    if not others:
        return "axis_deg"
    return "voltage_axis_v" if all(re.fullmatch(VOLTAGE, word) for word in others) else None


def _column(kind: str, phase: str) -> str | None:
    is_current = re.fullmatch(CURRENT, kind) is not None
    one = _PHASE.fullmatch(phase)
    if one:
        return f"current_{PHASES[one.group(1)]}_a" if is_current else f"voltage_{PHASES[one.group(1)]}_v"
    two = None if is_current else _PAIR.fullmatch(phase)
    alike = two and any(two.group(1) in letters and two.group(2) in letters for letters in ALPHABETS)
    pair = PHASES[two.group(1)] + PHASES[two.group(2)] if two and alike else ""
    return f"voltage_{pair}_v" if pair in {"uv", "vw", "wu"} else None
