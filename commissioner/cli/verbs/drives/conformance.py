"""`commissioner drives conformance`: every rule of the commissioning map against somebody's firmware."""

from __future__ import annotations

from rich.markup import escape
from typing_extensions import TypedDict

from commissioner.cli.screens import screen
from commissioner.conformance.kit import Conformance, chosen, run_conformance
from commissioner.conformance.records import Exchange, Outcome, RuleResult
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.url import parse_url
from commissioner.operations.ranges import require_range
from commissioner.registers.codec import Value

MARKS = {Outcome.PASS: "[green]✓[/]", Outcome.FAIL: "[red]✗[/]", Outcome.NOT_TESTED: "[yellow]–[/]"}
SOME_FAILED = 3


def conformance(
    *,
    url: str,
    profile: str,
    energise: bool,
    rules: tuple[str, ...],
    reply_timeout_s: float,
    yes: bool,
    names_all: bool,
    as_json: bool,
) -> None:
    """Prints every rule that was tried as it ends, and of the others how many there are; exits with 3 where one failed."""
    drive_url, drive_profile = parse_url(url), load_profile(profile)
    chosen(rules)
    require_range("--reply-timeout", reply_timeout_s, 0.01, 60.0)
    if energise:
        _ask(yes=yes, as_json=as_json)
    done = run_conformance(
        drive_url,
        drive_profile,
        energise=energise,
        only=rules,
        reply_timeout_s=reply_timeout_s,
        on_result=_keep_quiet if as_json else _show_tried,
    )
    if as_json:
        screen.emit(as_document(done))
    else:
        _show_unenergised(done, names_all=names_all)
        untold = "" if names_all or not done.count(Outcome.NOT_TESTED) else "  [dim]--all names them[/]"
        screen.out.print(f"[bold]{_counts(done)}[/]{untold}")
    if not done.conforms:
        raise SystemExit(SOME_FAILED)


class RuleRow(TypedDict):
    """A rule and how it ended: `outcome` pass | fail | not tested; `evidence`: its last exchanges, the deciding one last."""

    name: str
    claim: str
    source: str
    energises: bool
    outcome: str
    reason: str
    requests: int
    evidence: tuple[Exchange, ...]


class ConformanceDocument(TypedDict):
    """`outcome` passed | rejected; `drive`: what answered; `counts` by the rules' outcomes."""

    outcome: str
    reason: str
    drive: dict[str, Value]
    energised: bool
    counts: dict[str, int]
    rules: list[RuleRow]


def as_document(done: Conformance) -> ConformanceDocument:
    """The JSON of `--json`: outcome, counts and every rule with its evidence."""
    return {
        "outcome": "passed" if done.conforms else "rejected",
        "reason": _counts(done),
        "drive": done.drive,
        "energised": done.energised,
        "counts": {outcome.value: done.count(outcome) for outcome in Outcome},
        "rules": [_row(result) for result in done.results],
    }


def _row(result: RuleResult) -> RuleRow:
    return {
        "name": result.name, "claim": result.claim, "source": result.source, "energises": result.energises, "outcome": result.outcome.value,
        "reason": result.reason, "requests": result.requests, "evidence": result.evidence,
    }  # fmt: skip


def _counts(done: Conformance) -> str:
    passed, failed, rest = (done.count(outcome) for outcome in (Outcome.PASS, Outcome.FAIL, Outcome.NOT_TESTED))
    return f"{passed} rules passed, {failed} failed, {rest} not tested"


def _keep_quiet(_: RuleResult) -> None:
    """With --json nothing but the document goes to stdout."""


def _show_tried(result: RuleResult) -> None:
    """Each rule as it ends, but for those that wait for a voltage: they mostly share one reason, which is said once."""
    if not _is_unenergised(result):
        _show(result)


def _is_unenergised(result: RuleResult) -> bool:
    return result.energises and result.outcome is Outcome.NOT_TESTED


def _show_unenergised(done: Conformance, *, names_all: bool) -> None:
    """How many rules would have put a voltage on the motor, under the reason why none was put; `names_all`: and which."""
    by_reason: dict[str, list[RuleResult]] = {}
    for result in filter(_is_unenergised, done.results):
        by_reason.setdefault(result.reason, []).append(result)
    for reason, results in by_reason.items():
        if len(results) == 1:
            _show(results[0])
            continue
        screen.out.print(f"{MARKS[Outcome.NOT_TESTED]} {len(results)} rules not tested: {escape(reason)}")
        if names_all:
            screen.out.print(f"    [dim]{', '.join(result.name for result in results)}[/]")


def _show(result: RuleResult) -> None:
    """One line per rule; a failed one with its reason and the deciding request and reply."""
    screen.out.print(f"{MARKS[result.outcome]} {result.name}", soft_wrap=True)
    if result.outcome is Outcome.PASS:
        return
    screen.out.print(f"    [dim]{escape(result.claim)}[/]")
    screen.out.print(f"    {escape(result.reason)}")
    if result.outcome is Outcome.FAIL:
        for exchange in result.evidence[-2:]:
            reply = exchange.reply or "silence"
            took = f"{1e3 * exchange.took_s:.1f} ms"
            screen.out.print(
                f"    [dim]{exchange.at_s:.3f} s  {exchange.request} -> {reply}  {took}[/]", soft_wrap=True
            )


def _ask(*, yes: bool, as_json: bool) -> None:
    """A person says yes before the motor is energised."""
    screen.require_yes(yes, as_json=as_json)
    if yes:
        return
    screen.out.print(
        "[bold yellow]The motor will be energised[/] at standstill, again and again for some seconds each, with a fifth of "
        "its rated current. No torque is made on purpose, but the shaft may move.\n"
        "Energise only with guards on, people away and the emergency stop tested."
    )
    screen.confirm("Energise?", otherwise="nothing was energised")
