"""What a sheet calls its values, in English and German, and in languages whose words `words` knows: `P_N [kW]`, `Wirkungsgrad 3/4`, `I_A/I_N`, `cos phi`, `Kippmoment`."""

from __future__ import annotations

import re
import unicodedata

from commissioner.identify.catalogue.sheet import ABSOLUTE, KEYS
from commissioner.recordings.catalogue.cells import UNITS, unit_key
from commissioner.recordings.units import unbracketed, unit_in
from commissioner.recordings.words import readings, translated

_RATED = r"(?:rated|nominal|full ?load|nenn|bemessungs)?"
_OVER = (
    r"(?:ratio|verhaltnis|multiple|factor|(?:perunit|pu))?(?:/(?:in|ir|i|mn|mr|m|tn|tr|t|cn|c|rated\w*|nenn\w*|fl\w*))?"
)
_START = r"(?:starting|start|lockedrotor|anlauf|anzugs|anzug)"
_LOAD = r"(?:(?:at|bei)?(?:load|last)?(4/4|3/4|2/4|1/2|1/1|100|75|50|fullload|volllast|fl)(?:load|last)?)?"
NAMES = {
    "rated_power_w": rf"{_RATED}(?:output|shaft|mechanical|wellen|abgabe|motor)?(?:power|leistung|output)|p[nr2]?|kw|hp|ps",
    "rated_voltage_v": rf"{_RATED}(?:line|supply)?(?:voltage|spannung)|[uv][nr]?",
    "rated_frequency_hz": rf"{_RATED}(?:supply)?(?:frequency|frequenz|netzfrequenz)|f[nr]?",
    "rated_speed_rpm": rf"{_RATED}(?:speed|drehzahl)|n[nr]?|rpm",
    "rated_slip": rf"{_RATED}(?:slip|schlupf)|s[nr]?",
    "rated_current_a": rf"{_RATED}(?:current|strom|amps)|i[nr]?|fla|flc",
    "power_factor": rf"{_RATED}(?:powerfactor|leistungsfaktor|pf|cos(?:phi)?[nr]?){_LOAD}",
    "efficiency": rf"{_RATED}(?:efficiency|wirkungsgrad|eff|eta[nr]?){_LOAD}",
    "rated_torque_nm": rf"{_RATED}(?:torque|moment|drehmoment)|[mtc][nr]?",
    "starting_current": rf"(?:{_START}(?:current|strom)|i(?:a|st|s|lr|l|anl)|lra|lrc){_OVER}|i[dp]/(?:in|ir|i)|ir/in",
    "starting_torque": rf"(?:{_START}(?:torque|moment|drehmoment)|[mtc](?:a|st|lr|l|d)|cs|lrt|ts){_OVER}|[mtc]p/[mtc](?:n|r)?|[mtc]r/[mtc]n",
    "breakdown_torque": rf"(?:(?:breakdown|pullout|maximum|max|kipp)(?:torque|moment|drehmoment)|[mtc](?:k|max|b|m)|bdt){_OVER}",
    "pull_up_torque": rf"(?:(?:pullup|sattel|hochlauf)(?:torque|moment|drehmoment)|[mt](?:s|u|pu)|c(?:u|pu)){_OVER}",
    "no_load_current_a": r"(?:noload|idle|leerlauf)(?:current|strom)|i0",
    "inertia_kg_m2": r"(?:rotor|mass|massen|motor)?(?:inertia|momentofinertia|tragheitsmoment|tragheit)(?:jm?)?(?:gd2/4)?"
    r"|j(?:m|mot|rotor)?(?:gd2/4)?|gd2/4|(?:rotor)?w[kr]2",
    "flywheel_effect": r"(?:rotor)?(?:(?:schwungmoment|flywheel(?:effect|moment))(?:[gp]d2)?|[gp]d2)",
    "winding_resistance": r"(?:winding|stator|stander|phase|wicklungs|strang|klemmen|terminal|line(?:toline)?)?(?:resistance|widerstand)\w*|r(?:uv|1|s|ph)\w*",
    "winding_temperature_c": r"(?:at|bei|reference|bezugs|mess|winding|resistance|wicklungs)?temperatu?re?|temperatur",
    "pole_pairs": r"pole?pairs?|polpaare|polpaarzahl|numberofpolepairs",
    "poles": r"(?:numberof)?poles?|polzahl|2p",
    "connection": r"connection|schaltung|wiring|wicklungsschaltung",
    "design_class": r"(?:nema|iec)?design(?:class|letter)?",
}  # fmt: skip
"""Patterns of the letters and digits of a name; a group says the load."""
_PATTERNS = {key: re.compile(pattern.replace(" ", "")) for key, pattern in NAMES.items()}
_GREEK = {"η": "eta", "φ": "phi", "ϕ": "phi", "ϑ": "temperature", "₀": "0", "µ": "u", "½": "1/2", "¾": "3/4"}
_SUFFIX = re.compile(r"(?<=[a-z])_(kw|w|hp|v|kv|hz|a|nm|rpm|ohm|c|pct|percent|kg_m2|kgm2)$", re.IGNORECASE)
_OF_RATED = re.compile(r"[imtc]_?[a-z]{1,3}/[imtc]_?[nr]?", re.IGNORECASE)
HALF_LOADS = {"3/4": "_75", "75": "_75", "2/4": "_50", "1/2": "_50", "50": "_50"}
_LOAD_SAID = r"(?:4/4|3/4|2/4|1/1|1/2|1/4|5/4|125|100|75|50|25)"
_LOADS = re.compile(
    rf"[\[(]?\s*(?<![\d.,]){_LOAD_SAID}(?:\s*%?\s*(?:[/|,;-]|\s)\s*{_LOAD_SAID}){{1,4}}(?![\d.,])\s*%?\s*(?:load|last)?\s*[\])]?",
    re.IGNORECASE,
)
"""Loads behind one name, in any order: `Efficiency 100/75/50 %`."""
_ENDINGS = {"4/4": "", "1/1": "", "100": "", **HALF_LOADS}


def loads_in(name: str) -> tuple[str | None, ...]:
    """The endings of the keys of several loads behind one name, in their order (None of a load that no key has); empty where it names
    none, or one."""
    found = _LOADS.search(name)
    return tuple(_ENDINGS.get(load) for load in re.findall(_LOAD_SAID, found[0])) if found else ()


def load_of(text: str) -> str | None:
    """The ending of the keys at the load that stands above a column (`75 %`, `3/4 load`): nothing for the whole; None of any other text."""
    found = re.fullmatch(
        rf"({_LOAD_SAID})\s*%?", re.sub(r"load|last|charge|carga|carico", "", text.lower()).strip("[]() ")
    )
    return _ENDINGS.get(found[1]) if found else None


def key_of(name: str) -> str | None:
    """The key of `KEYS` that a name means (`starting_current` and its like without ratio or unit; winding_resistance, poles, connection
    and design_class beside them), or None."""
    if name.strip().lower() in KEYS:
        return name.strip().lower()
    if (found := SAID_WHOLE.get(name.strip().lower())) is not None:
        return found
    bare = _SUFFIX.sub("", _without_unit(_LOADS.sub("", name)))
    return _in_any_order(bare) or _before_symbol(bare) or _over_rated(bare)


def _before_symbol(name: str) -> str | None:
    """The key of words that a symbol of the same follows (`Kippmoment M_K/M_N`). A symbol's letters abbreviate the sheet's own language
    (`Coppia di spunto Cs/Cn`): of another than English and German the words decide."""
    words, _, symbol = re.sub(r"cos\s+(?=\S)", "cos", name.strip()).rpartition(" ")
    key = _in_any_order(words)
    is_abroad = key in ABSOLUTE and words != translated(words) and _OF_RATED.fullmatch(symbol) is not None
    is_so = key in _PATTERNS and _PATTERNS[key].fullmatch(_letters(symbol)) is not None
    return key if is_abroad or is_so or key == _matched(symbol) else None


def _over_rated(name: str) -> str | None:
    """The key of a ratio to its rated value that is written out (`Par de arranque / par nominal`)."""
    over, _, rated = name.partition("/")
    key = _in_any_order(over)
    return key if key in ABSOLUTE and _in_any_order(rated) == ABSOLUTE[key] else None


def _in_any_order(name: str) -> str | None:
    return next((key for reading in readings(name) if (key := _matched(reading))), None)


def _matched(name: str) -> str | None:
    letters = _letters(name)
    for key, pattern in _PATTERNS.items():
        if (match := pattern.fullmatch(letters)) is not None:
            return key + (HALF_LOADS.get(match[1] or "", "") if pattern.groups else "")
    return None


SAID_WHOLE = {f"{kind}_{load}": f"{kind}_{load}" for kind in ("efficiency", "power_factor") for load in (75, 50)}


def unit_of(name: str) -> str:
    """The unit in a name: in brackets, after a slash that divides by none of the rated values, or as its last letters (`_kw`)."""
    name = _LOADS.sub("", name)
    if after := _behind_comma(name):
        return after
    if (ending := _SUFFIX.search(name.strip())) is not None:
        return {"pct": "%", "percent": "%", "kg_m2": "kgm2"}.get(ending[1].lower(), ending[1])
    if (bare := re.search(r"[\[(]\s*([^\])]*)[\])]\s*$", name)) is not None:
        return "" if _is_load(bare[1]) or _OF_RATED.fullmatch(bare[1].strip()) else bare[1].strip()
    found = unbracketed(unit_in(name))
    return (
        "" if found != unit_in(name).strip() or re.fullmatch(r"[A-Za-z]_?[A-Za-z]+|\d", found) or not found else found
    )


def is_ratio(name: str) -> bool:
    """Whether the name says that it is one: `I_A/I_N`, `starting current ratio`."""
    is_said = re.search(r"/[imtc][_ ]?[nr]?|/rated|/nenn|ratio|verh|multiple|_pu\b", name.lower()) is not None
    return is_said or _over_rated(_without_unit(name)) is not None


def is_between_terminals(name: str) -> bool | None:
    """Of a winding's resistance: between two terminals, of one phase, or unsaid."""
    lower = translated(name).lower()
    if re.search(r"uv|u-v|terminal|line|klemme|phase[- ]?(?:to[- ]?)?phase|zwischen|between", lower):
        return True
    return False if re.search(r"phase|strang|per ph|_ph", lower) else None


_A_LOAD = re.compile(r"\s*(?:4/4|3/4|2/4|1/2|1/1|(?:100|75|50)\s*%?|full load|volllast)\s*(?:load|last)?\s*")


def _is_load(text: str) -> bool:
    """Whether it names a load, or several one after the other."""
    return all(_A_LOAD.fullmatch(part) for part in re.split("[,;]", text.lower()))


def _without_unit(name: str) -> str:
    """Without a unit in brackets or behind a comma at the end; a load in brackets stays."""
    if _behind_comma(name):
        return name.rpartition(",")[0]
    found = re.search(r"[\[(]\s*([^\])]*)[\])]\s*$", name)
    return name[: found.start()] if found is not None and not _is_load(found[1]) else name


def _behind_comma(name: str) -> str:
    """The unit behind the comma that ends a name (`Rated power, kW`), or nothing."""
    _, _, last = name.rpartition(",")
    return last.strip() if "," in name and unit_key(last) not in ("", "-") and unit_key(last) in UNITS else ""


def _letters(name: str) -> str:
    """Lower-case letters, digits and slashes, without marks above them."""
    for letter, word in _GREEK.items():
        name = name.lower().replace(letter, word)
    plain = unicodedata.normalize("NFKD", name.lower())
    return re.sub(r"[^a-z0-9/]", "", plain)
