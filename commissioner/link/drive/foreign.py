"""Another master: what the drive holds against what we wrote, asked again wherever its count of changes is not ours."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from commissioner.errors import DriveFault, ForeignMaster
from commissioner.registers.codec import Value, held_words
from commissioner.registers.profile import DriveProfile, Span
from commissioner.text import counted

GUARDED = (
    "control_word", "mode", "watchdog_ms", "current_limit_a", "test_time_limit_s", "voltage_limit_v", "axis_deg", "dc_bias_v",
    "bias_ramp_v_per_s", "amplitude_scale", "scale_ramp_per_s", "duration_s", "tone_count", "tones", "channel_mask",
    "decimation",
)  # fmt: skip
"""Settings that matter to a test, beside the motor parameters."""
MOST_AT_ONCE = 0x8000
UNCOUNTED = ("heartbeat", "window_index", "echo", "commit", "store", "owner_token", "owner_timeout_s", "owner_name")
"""Writes of these are no change of a setting: the drive does not count them."""


@dataclass(frozen=True)
class Change:
    """One item that is not as we left it."""

    name: str
    ours: Value
    theirs: Value

    @property
    def words(self) -> str:
        return f"{self.name} from {_short(self.ours)} to {_short(self.theirs)}"


class Watched:
    """Keeps what we wrote and how many changes that made; says what somebody else did."""

    def __init__(self, profile: DriveProfile) -> None:
        self._profile = profile
        self._ours: dict[str, Value] = {}
        self._perhaps: dict[str, Value] = {}
        """Written by us without an answer: the drive holds this, or what it held before."""
        self._count: int | None = None
        self._unseen: set[str] = set()
        """Commands whose effect was not looked at yet: a drive that ignores one has no other master."""
        self.is_armed = False

    def wrote(self, span: Span, values: Mapping[str, Value]) -> None:
        """One request that the drive has acknowledged."""
        names = _counted(span)
        if any(self._is_new(name, values[name]) is None for name in names):
            self._count = None  # what was there before is not known: nor is whether it counted
        elif self._count is not None and any(self._is_new(name, values[name]) for name in names):
            self._count = (self._count + 1) & 0xFFFF
        self._ours |= {name: values[name] for name in names}
        self._unseen |= {"control_word"} & set(names)
        self._forget_if_applied(span)

    def lost(self, span: Span, values: Mapping[str, Value]) -> None:
        """One request that the drive may have carried out: what it holds tells, before the next status counts."""
        self._count = None
        self._perhaps |= {name: values[name] for name in _counted(span)}
        self._forget_if_applied(span)

    def found(self, parameters: Mapping[str, Value]) -> None:
        """Motor parameters as they were read: they are to stay so."""
        self._ours |= parameters

    def forget_parameters(self) -> None:
        """They change by our own doing now."""
        for name in self._profile.parameter_names:
            for prefix in ("", "stored_"):
                self._ours.pop(prefix + name, None)
        self._count = None

    def _forget_if_applied(self, span: Span) -> None:
        if any(item.name in ("commit", "store") for item in span.items):
            self.forget_parameters()

    def judge(self, count: int | None, read: Callable[[Iterable[str]], Mapping[str, Value]]) -> None:
        """ForeignMaster where the drive is not as we left it. Settings are read only where the counts differ."""
        if not self.is_armed:
            return
        if count is None or count != self._count:
            held = read(self._watched_names())
            self._settle(held)
            self._compare({name: value for name, value in held.items() if name in self._ours}, count)
            self._count = count
        self._unseen.clear()

    def _settle(self, held: Mapping[str, Value]) -> None:
        """What the drive holds tells what became of commands that were not looked at and of writes without an answer."""
        done = {
            name for name in self._perhaps.keys() & held.keys() if self._same(name, self._perhaps[name], held[name])
        }
        self._ours |= {name: held[name] for name in (self._unseen & held.keys()) | done}
        self._perhaps.clear()

    def _compare(self, held: Mapping[str, Value], count: int | None) -> None:
        changes = [Change(n, self._ours[n], v) for n, v in held.items() if not self._same(n, self._ours[n], v)]
        if _has_restarted(held, self._ours):
            raise DriveFault(
                "the drive has lost all that it was set to", step="watch the drive's settings", value=held.get("watchdog_ms"),
                limit=self._ours["watchdog_ms"],
                remedy="it was switched off and on: check its supply, then start again",
            )  # fmt: skip
        more = 0 if count is None or self._count is None else (count - self._count) & 0xFFFF
        if changes or 0 < more < MOST_AT_ONCE:  # fewer than ours: the drive did not take one of them
            raise _another_master(changes, more)

    def look_again(self) -> None:
        """The next status is to be followed by a look at every setting, whatever the count says."""
        self._count = None

    def _watched_names(self) -> list[str]:
        parameters = self._profile.parameter_names
        names = (*GUARDED, *parameters, *(f"{p}{name}" for p in ("staged_", "stored_") for name in parameters))
        known = self._ours.keys() | self._perhaps.keys()
        return [name for name in names if name in known and name in self._profile.items]

    def _is_new(self, name: str, value: Value) -> bool | None:
        """True where our write changes the item; None where it is not known what it held."""
        return None if name not in self._ours else not self._same(name, self._ours[name], value)

    def _same(self, name: str, first: Value, second: Value) -> bool:
        item = self._profile.item(name)
        return held_words(item, first) == held_words(item, second)


def _counted(span: Span) -> list[str]:
    """The settings among a request's items."""
    return [item.name for item in span.items if item.name not in UNCOUNTED]


def _has_restarted(held: Mapping[str, Value], ours: Mapping[str, Value]) -> bool:
    """What a power-up leaves: every command and the whole supervision at zero."""
    names = ("control_word", "mode", "watchdog_ms", "current_limit_a", "voltage_limit_v")
    seen = [name for name in names if name in held]
    return bool(ours.get("watchdog_ms")) and len(seen) >= 3 and not any(held[name] for name in seen)


def _another_master(changes: list[Change], writes: int) -> ForeignMaster:
    what = (
        "; ".join(change.words for change in changes[:4])
        or f"{counted(writes, 'setting')}, back at our values or none of ours"
    )
    first = changes[0] if changes else None
    return ForeignMaster(
        f"another master wrote to the drive: it changed {what}", step="watch for other masters",
        value=_short(first.theirs) if first else writes, limit=_short(first.ours) if first else "our own settings only",
        remedy="disconnect the other master, or find who wrote; then start again",
    )  # fmt: skip


def _short(value: Value) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
