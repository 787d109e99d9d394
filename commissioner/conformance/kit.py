"""The kit as a whole: open the line, ask who is there, try every rule, end with the output off."""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass

from commissioner.conformance.drive import Drive
from commissioner.conformance.judge import Recorder, judge
from commissioner.conformance.line import Line
from commissioner.conformance.records import Broken, Outcome, RuleResult, Steps
from commissioner.conformance.registry import Rule
from commissioner.conformance.rules import RULES
from commissioner.conformance.rules.stopping import VITAL
from commissioner.errors import CheckFailed, ReplyTimeout, UsageError
from commissioner.link.wire.url import DriveUrl, RtuUrl
from commissioner.registers.codec import Value
from commissioner.registers.profile import DriveProfile
from commissioner.registers.status import DriveState
from commissioner.text import did_you_mean

TEST_CURRENT_FRACTION = 0.2
"""Test current peak, of the rated motor current's peak in the drive's plate, else of the drive's own."""
SILENT_RULES = 3
"""Rules in a row without any answer: the drive is gone, not wrong."""
LEVEL = "a-bias-drives-a-current"
"""The rule that finds the voltage of the others."""
IDENTITY = "magic-and-map-version"
"""The first rule, always tried: the others write, and another device's registers are not ours."""
WHO = ("drive_type", "serial_number", "firmware_version", "map_version")


@dataclass(frozen=True)
class Conformance:
    """What answered, and one result per rule."""

    drive: dict[str, Value]
    results: tuple[RuleResult, ...]
    energised: bool

    def count(self, outcome: Outcome) -> int:
        return sum(result.outcome is outcome for result in self.results)

    @property
    def conforms(self) -> bool:
        """No rule failed; what was not tried is listed, not claimed."""
        return self.count(Outcome.FAIL) == 0


def run_conformance(
    url: DriveUrl,
    profile: DriveProfile,
    *,
    energise: bool = False,
    only: Collection[str] = (),
    reply_timeout_s: float = 0.5,
    on_result: Callable[[RuleResult], None] = lambda result: None,
) -> Conformance:
    """Try every rule, or `only` these and those that energising rests on.

    LinkUnreachable, ReplyTimeout: nobody answers, or no longer. CheckFailed: the drive is energised already.
    UsageError: the drive file describes no commissioning map, or no rule has such a name.
    """
    rules = chosen(only)
    if profile.kind != "commissioning_map":
        raise UsageError(
            f"{profile.name} does not implement the commissioning map",
            step="choose a drive file",
            value=profile.kind,
            limit="kind = commissioning_map",
            remedy="give --profile a drive file of that kind: conformance is about the map, not about commercial drives",
        )
    device = profile.link.device_id if url.device is None else url.device
    line = Line(url, device, reply_timeout_s)
    drive = Drive(profile, device, is_serial=isinstance(url, RtuUrl))
    try:
        who = _introduced(drive, line, energise=energise)
        results = _results(rules, drive, line, energise=energise, on_result=on_result)
    finally:
        _switch_off(drive, line)
        line.close()
    return Conformance(who, results, energise)


def chosen(only: Collection[str]) -> tuple[Rule, ...]:
    """The named rules in the kit's order; all where none is named. UsageError for a name no rule has."""
    unknown = set(only) - {rule.name for rule in RULES}
    if unknown:
        raise UsageError(
            f"no rule is named {sorted(unknown)[0]!r}"
            + did_you_mean(sorted(unknown)[0], [rule.name for rule in RULES]),
            step="choose rules",
            value=", ".join(sorted(unknown)),
            limit=", ".join(rule.name for rule in RULES),
            remedy="give names of rules",
        )
    energises = any(rule.energises and rule.name in only for rule in RULES)
    wanted = {*only, IDENTITY} | ({*VITAL, LEVEL} if energises else set())
    return tuple(rule for rule in RULES if not only or rule.name in wanted)


def _introduced(drive: Drive, line: Line, *, energise: bool) -> dict[str, Value]:
    """Who answers. Raises where nobody does or somebody else is energising."""
    recorder = Recorder(line.perform)
    try:
        who = recorder.run(drive.get(*WHO))
        state = recorder.run(drive.state())
        drive.test_current_a = recorder.run(_test_current(drive)) if energise else 0.0
    except Broken as broken:
        raise ReplyTimeout(
            f"no usable answer to the first questions: {broken}",
            step="identify",
            value=str(broken),
            limit="the identity of the drive file",
            remedy="check URL, device number and that the drive file fits the firmware",
        ) from broken
    if state.may_be_energised:
        raise CheckFailed(
            "the drive is energised already",
            step="check before testing",
            value=state.value,
            limit="a blocked output",
            remedy="stop the drive and keep other masters off",
        )
    return who


def _test_current(drive: Drive) -> Steps[float]:
    """Peak test current (A): a fifth of the motor's in the drive's plate, never more than a fifth of the drive's own."""
    rated_a = yield from drive.number("rated_drive_current_a")
    if "rated_current_a" in drive.profile.items:
        plate_a = yield from drive.number("rated_current_a")
        rated_a = min(rated_a, plate_a) if plate_a > 0 else rated_a
    return TEST_CURRENT_FRACTION * 2**0.5 * rated_a


def _results(
    rules: tuple[Rule, ...],
    drive: Drive,
    line: Line,
    *,
    energise: bool,
    on_result: Callable[[RuleResult], None],
) -> tuple[RuleResult, ...]:
    results: list[RuleResult] = []
    obstacle = _Obstacle(drive, line, results, energise=energise)
    for result in judge(rules, drive, line.perform, obstacle):
        results.append(result)
        on_result(result)
        if _is_silent(results[-SILENT_RULES:]):
            raise ReplyTimeout(
                "the drive no longer answers",
                step=result.name,
                value=result.reason,
                limit="an answer",
                remedy="check the drive; its watchdog blocks the output if it was energised",
            )
    return tuple(results)


class _Obstacle:
    """Why a rule is not tried: another device may be there, energising was not allowed, or the drive is not fit for it. Asks the drive once."""

    def __init__(self, drive: Drive, line: Line, results: list[RuleResult], *, energise: bool) -> None:
        self._drive, self._line, self._results, self._energise = drive, line, results, energise
        self._seen: str | None = None

    def __call__(self, rule: Rule) -> str:
        if any(result.name == IDENTITY and result.outcome is not Outcome.PASS for result in self._results):
            return f"nothing is written into what may be another device: {IDENTITY} did not pass"
        if not rule.energises:
            return ""
        if not self._energise:
            return "energises the motor: give --energise"
        for result in self._results:
            if result.name in VITAL and result.outcome is not Outcome.PASS:
                return f"nothing more is energised: {result.name} did not pass"
        if self._seen is None:
            self._seen = Recorder(self._line.perform).run(_unfit(self._drive))
        return self._seen


def _unfit(drive: Drive) -> Steps[str]:
    """What speaks against energising, empty where nothing does."""
    wanted = drive.profile.identity
    try:
        magic = yield from drive.number("magic")
        (interlocks,) = yield from drive.words("interlocks")
        state = yield from drive.state()
    except Broken as broken:
        return str(broken)
    if wanted.magic is not None and magic != wanted.magic:
        return "the magic number is not the drive file's"
    for name, bit in drive.profile.interlock_bits.items():
        if not interlocks >> bit & 1:
            return f"interlock {name} is open"
    return f"the drive is in '{state.value}'" if state is DriveState.FAULT else ""


def _is_silent(results: list[RuleResult]) -> bool:
    """Whether nothing but silence came in all of these."""
    return len(results) == SILENT_RULES and all(
        result.evidence and not result.evidence[-1].reply and result.outcome is Outcome.FAIL for result in results
    )


def _switch_off(drive: Drive, line: Line) -> None:
    """Whatever happened: the output off, as far as the line still carries it; else the drive's watchdog does it."""
    with suppress(Broken):
        Recorder(line.perform).run(drive.make_safe())
