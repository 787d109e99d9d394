"""Channels of a TDMS file (National Instruments, "TDMS File Format Internal Structure", version 2.0).

Read are numeric channels of interleaved and contiguous segments, with linear NI scaling, and their waveform properties.
Channels that began at different times are cut to what all of them have. DAQmx raw data, extended floats and other scalings are
refused by name; texts and channels of time stamps are passed over.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from commissioner.recordings.bounds import MAX_BYTES, MAX_COLUMNS, too_large
from commissioner.recordings.formats.begins import from_last_begin
from commissioner.recordings.formats.stretch import Stretch
from commissioner.records import ReadingNote, Signal

_META, _NEW_LIST, _RAW, _INTERLEAVED, _BIG_ENDIAN, _DAQMX = 1 << 1, 1 << 2, 1 << 3, 1 << 5, 1 << 6, 1 << 7
_NO_DATA, _AS_BEFORE, _UNFINISHED = 0xFFFFFFFF, 0, 0xFFFFFFFFFFFFFFFF
_TYPES = {
    1: "i1", 2: "i2", 3: "i4", 4: "i8", 5: "u1", 6: "u2", 7: "u4", 8: "u8", 9: "f4", 10: "f8", 0x19: "f4", 0x1A: "f8",
    0x21: "u1",
}  # fmt: skip
_TEXT, _TIME_STAMP = 0x20, 0x44
MAX_SEGMENTS = 200_000
_UNITS = ("unit_string", "ni_unitdescription", "unit", "units")
"""Properties that name a channel's unit, in any case: LabVIEW's, DAQmx's, and what people write themselves."""


@dataclass(frozen=True)
class _Stamp:
    """Since the beginning of 1904: whole seconds, and parts of one in 2^-64."""

    seconds: int
    parts: int


Property = float | str | _Stamp


@dataclass
class _Channel:
    """One object of the file: where its values lie in the present segment, what was collected, its properties."""

    kind: int = 0
    count: int = 0
    text_bytes: int = 0
    pieces: list[np.ndarray] = field(default_factory=list)
    properties: dict[str, Property] = field(default_factory=dict)

    def size(self, order: str) -> int:
        return self.text_bytes if self.kind == _TEXT else self.count * self.dtype(order).itemsize

    def dtype(self, order: str) -> np.dtype:
        return np.dtype("V16") if self.kind == _TIME_STAMP else np.dtype(order + _TYPES[self.kind])


def channels(path: Path) -> tuple[dict[str, Signal], dict[str, float | str], tuple[ReadingNote, ...]]:
    """(values by `group.channel [unit]`, the file's properties and the sample period where all channels agree on one, what was cut).

    DataRefused: damaged, too large, not read here, or channels that began a part of a sample apart.
    """
    file, objects = Stretch.of_file(path, "TDMS"), dict[str, _Channel]()
    active: list[str] = []
    for _ in range(MAX_SEGMENTS):
        if file.is_at_end:
            break
        active = _segment(file, objects, active)
    else:
        raise too_large(path, f"> {MAX_SEGMENTS} segments", MAX_SEGMENTS)
    held = {key: channel for key, channel in objects.items() if channel.pieces and channel.kind in _TYPES}
    size = 8 * sum(piece.size for channel in held.values() for piece in channel.pieces)
    if size > MAX_BYTES:
        raise too_large(path, size, MAX_BYTES)
    values = {
        _name(key, channel): _scaled(channel, _above(key, channel, objects), file) for key, channel in held.items()
    }
    several = {
        _name(key, channel): channel.properties for key, channel in held.items() if values[_name(key, channel)].size > 1
    }
    waveforms = [properties for properties in several.values() if "wf_increment" in properties]
    values, notes = from_last_begin(values, _begins(several), _period(waveforms), str(path))
    return values, _metadata(objects, list(held.values())), notes


def _begins(said: Mapping[str, Mapping[str, Property]]) -> dict[str, float | None]:
    """When each channel begins, s from the first stamp of any; None where it is no waveform, or has no stamp and others have."""
    stamps = {name: at for name, one in said.items() if isinstance(at := one.get("wf_start_time"), _Stamp)}
    first, unstamped = min((at.seconds for at in stamps.values()), default=0), None if stamps else _Stamp(0, 0)
    out: dict[str, float | None] = {}
    for name, one in said.items():
        at, offset = stamps.get(name, unstamped), one.get("wf_start_offset", 0.0)
        if at is None or "wf_increment" not in one or not (isinstance(offset, float) and np.isfinite(offset)):
            out[name] = None
        else:
            out[name] = at.seconds - first + at.parts / 2**64 + offset
    return out


def _period(said: Iterable[Mapping[str, Property]]) -> float | None:
    """None where they are of several rates, or one is no waveform."""
    periods = {one.get("wf_increment") for one in said}
    period = periods.pop() if len(periods) == 1 else None
    return period if isinstance(period, float) and period > 0 else None


def _metadata(objects: dict[str, _Channel], held: list[_Channel]) -> dict[str, float | str]:
    of_file = objects["/"].properties if "/" in objects else {}
    known: dict[str, float | str] = {name: value for name, value in of_file.items() if not isinstance(value, _Stamp)}
    period = _period(channel.properties for channel in held)
    return known | ({"sample_period_s": period} if period is not None else {})


def _segment(file: Stretch, objects: dict[str, _Channel], active: list[str]) -> list[str]:
    """Read one segment; the objects that hold raw data in it, which the next one may take over."""
    start = file.at
    if bytes(file.take(4)) != b"TDSm":
        file.refuse("a segment without its mark")
    (contents,) = file.read("<I")
    order = ">" if contents & _BIG_ENDIAN else "<"
    _, length, raw_at = file.read(order + "iQQ")
    if contents & _DAQMX:
        file.refuse("DAQmx raw data")
    body = start + 28
    end = len(file.data) if length == _UNFINISHED else body + length
    if contents & _META:
        part = file.part(body, raw_at)
        active = _objects(part, order, objects, [] if contents & _NEW_LIST else active)
    if contents & _RAW and body + raw_at < end:
        raw = file.part(body + raw_at, min(end, len(file.data)) - body - raw_at)
        _values(raw, order, [objects[key] for key in active if objects[key].count], bool(contents & _INTERLEAVED))
    if end <= start:
        file.refuse("a segment of no length")
    file.at = end
    return active


def _objects(part: Stretch, order: str, objects: dict[str, _Channel], active: list[str]) -> list[str]:
    known = dict.fromkeys(active)
    (count,) = part.read(order + "I")
    for _ in range(count):
        key = _text(part, order)
        channel = objects.setdefault(key, _Channel())
        if len(objects) > MAX_COLUMNS:
            raise too_large(part.path, f"{len(objects)} channels", MAX_COLUMNS)
        (index,) = part.read(order + "I")
        if index not in (_NO_DATA, _AS_BEFORE):
            channel.kind, dimension, channel.count = part.read(order + "IIQ")
            if dimension != 1 or channel.kind not in (*_TYPES, _TEXT, _TIME_STAMP):
                part.refuse(f"a channel of type {channel.kind:#x}")
            channel.text_bytes = part.read(order + "Q")[0] if channel.kind == _TEXT else 0
        if index != _NO_DATA:
            known[key] = None
        (properties,) = part.read(order + "I")
        for _ in range(properties):
            name = _text(part, order)
            channel.properties[name] = _property(part, order)
    return list(known)


def _values(raw: Stretch, order: str, held: list[_Channel], is_interleaved: bool) -> None:
    """The chunks of a segment; each channel's values contiguous, or sample by sample in turn. A torn last chunk is left."""
    if is_interleaved:
        if any(channel.kind == _TEXT for channel in held):
            raw.refuse("interleaved texts")
        row = np.dtype([(f"c{k}", channel.dtype(order)) for k, channel in enumerate(held)])
        table = np.frombuffer(raw.take(len(raw.data) // row.itemsize * row.itemsize), row) if held else ()
        for k, channel in enumerate(held):
            channel.pieces.append(table[f"c{k}"])  # type: ignore[call-overload]
        return
    chunk = sum(channel.size(order) for channel in held)
    count = len(raw.data) // chunk if chunk else 0
    if not count:
        return
    rows, start = np.frombuffer(raw.take(count * chunk), np.uint8).reshape(count, chunk), 0
    for channel in held:
        end = start + channel.size(order)
        if channel.kind != _TEXT:
            channel.pieces.append(np.ascontiguousarray(rows[:, start:end]).view(channel.dtype(order)).ravel())
        start = end


def _above(key: str, channel: _Channel, objects: Mapping[str, _Channel]) -> Mapping[str, Property]:
    """The properties that say how it is scaled: its own, else its group's, else the file's."""
    group = objects.get(key[: key.rindex("/'")], _Channel()) if "/'" in key[1:] else _Channel()
    all_of_them = (channel.properties, group.properties, objects.get("/", _Channel()).properties)
    return next((p for p in all_of_them if "NI_Number_Of_Scales" in p), {})


def _scaled(channel: _Channel, said: Mapping[str, Property], file: Stretch) -> Signal:
    """In the channel's unit, as its scaling says; as it stands where that was applied before."""
    values = np.concatenate(channel.pieces).astype(np.float64)
    if said.get("NI_Scaling_Status", "unscaled") != "unscaled":
        return values
    scalings = said.get("NI_Number_Of_Scales")
    for k in range(int(scalings) if isinstance(scalings, float) and 0 < scalings < 100 else 0):
        kind = said.get(f"NI_Scale[{k}]_Scale_Type")
        slope = said.get(f"NI_Scale[{k}]_Linear_Slope")
        offset = said.get(f"NI_Scale[{k}]_Linear_Y_Intercept")
        if kind is None:
            continue
        if kind != "Linear" or not isinstance(slope, float) or not isinstance(offset, float):
            file.refuse(f"a scaling of the kind {kind}")
        values = slope * values + offset
    return values


def _text(part: Stretch, order: str) -> str:
    (length,) = part.read(order + "I")
    return bytes(part.take(length)).decode("utf-8", errors="replace")


def _property(part: Stretch, order: str) -> Property:
    (kind,) = part.read(order + "I")
    if kind == _TEXT:
        return _text(part, order)
    if kind == _TIME_STAMP:
        seconds, parts = part.read(order + "qQ") if order == ">" else reversed(part.read(order + "Qq"))
        return _Stamp(seconds, parts)
    if kind not in _TYPES:
        part.refuse(f"a property of type {kind:#x}")
    dtype = np.dtype(order + _TYPES[kind])
    return float(np.frombuffer(part.take(dtype.itemsize), dtype)[0])


def _name(key: str, channel: _Channel) -> str:
    """`/'group'/'channel'` -> `group.channel [unit]`"""
    name = ".".join(part.strip("'").replace("''", "'") for part in key.strip("/").split("'/'"))
    said = {key.lower(): value for key, value in channel.properties.items()}
    unit = next((said[key] for key in _UNITS if said.get(key)), None)
    return f"{name} [{unit}]" if isinstance(unit, str) and unit else name
