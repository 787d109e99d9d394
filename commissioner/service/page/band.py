"""The band at the top: what the motor is, who says so, how old that is, and what STOP can do."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass

from commissioner.records import drive_words
from commissioner.report.run.standing import Standing
from commissioner.report.sheet.words import NBSP
from commissioner.service.access.visitor import Visitor
from commissioner.service.library import Drive
from commissioner.service.page.texts import Texts
from commissioner.service.parts import Parts
from commissioner.service.problems import Refusal
from commissioner.service.runs.control import Control
from commissioner.service.runs.desk import LiveRun
from commissioner.service.runs.watch import Seen

OLD_S = 1.0
"""Nothing is called `not energised` on an older word than this."""


@dataclass(frozen=True)
class Place:
    """What a page is about: a run, a drive, or neither."""

    run: str = ""
    drive: str = ""


@dataclass(frozen=True)
class Band:
    """`level`: off | off-bad | unknown | live | alarm. All texts in the reader's language; `asking`: who wants control."""

    level: str
    big: str
    small: str
    drive: str
    drive_line: str
    control: str
    control_line: str
    stop: str
    run: str = ""
    phase: str = ""
    asking: str = ""
    has_control: bool = False
    is_held: bool = False


@dataclass(frozen=True)
class _Said:
    level: str
    big: str
    small: str
    stop: str


PARTS = {"levels": "DC levels", "look": "first look", "tones": "five tones", "bias": "small tones on DC"}


def band_of(parts: Parts, who: Visitor, place: Place, t: Texts) -> Band:
    """The band of a page, now. A page that shows a drive wants to know of it: its watch goes on."""
    run = _run_of(parts, place)
    drive = parts.library.known_drive(place.drive or (run.drive if run else ""))
    live = run if run is not None and not run.is_over and not run.has_freed_drive else None
    seen = Seen()
    if drive is not None and drive.url and live is None:
        watch = parts.desk.watch(drive)
        watch.want()
        seen = watch.seen
    said = _of_run(live, t) if live is not None else _at_rest(parts, run, drive, seen, t)
    name, line = _drive_facts(live, drive, seen, t)
    control, control_line = _control(parts, who, drive, live, t)
    held = parts.desk.control(drive.id) if drive is not None else None
    asking = held.asking.person if held is not None and held.asking is not None else ""
    return Band(
        said.level,
        said.big,
        said.small,
        name,
        line,
        control,
        control_line,
        said.stop,
        run.id if run else "",
        run.feed.state.phase if run else "",
        asking,
        held is not None and held.is_held_by(who.party),
        held is not None and held.holder is not None,
    )


def _run_of(parts: Parts, place: Place) -> LiveRun | None:
    """The page's own run, else the one on its drive, else any that goes on: STOP in the band is for that one."""
    own = parts.desk.runs.get(place.run)
    if own is not None or place.run:
        return own
    if place.drive:
        return parts.desk.live_on(place.drive)
    return next((run for run in parts.desk.live() if not run.has_freed_drive), None)


# --- a run goes on ------------------------------------------------------------------------------------------------
def _of_run(run: LiveRun, t: Texts) -> _Said:
    state = run.feed.state
    if state.output == "unknown":
        return _take_as_live(t.gettext("The drive does not confirm that its output is off. Isolate its supply"), t)
    if state.output == "on" and state.phase == "tuning":
        small = t.gettext("The drive tunes itself at standstill")
        return _Said("live", t.gettext("MOTOR ENERGISED"), small, t.gettext("Esc or Space"))
    if state.output == "on":
        return _Said("live", t.gettext("MOTOR ENERGISED"), _test_line(run, t), t.gettext("Esc or Space"))
    if run.stop_asked_by:
        return _stopping(run, t)
    soon = t.gettext("ends the run: Esc or Space")
    if state.phase == "tuning":
        small = t.gettext("Output off between two tunings of its own. Stay clear")
        return _Said("live", t.gettext("ENERGISED AGAIN SOON"), small, soon)
    if state.phase == "measuring":
        return _Said(
            "live",
            t.gettext("ENERGISED AGAIN SOON")
            if state.tests and state.tests[0].energised_s
            else t.gettext("ENERGISED SOON"),
            _between_line(run, t),
            soon,
        )
    if state.phase in ("judging", "writing", "ended"):
        what = {"judging": "the result is being judged", "writing": "the values are being written"}.get(
            state.phase, "the run is ending"
        )
        small = t.say(
            "Output off at %(time)s by the drive’s word; %(what)s", time=_time(state.output_utc), what=t.gettext(what)
        )
        return _Said("live", t.gettext("THE RUN IS NOT OVER"), small, soon)
    what = {"warming up": "Preparing the estimators", "checking": "The drive is checked once more"}.get(
        state.phase, "The run connects to the drive"
    )
    return _Said(
        "live",
        t.gettext("ENERGISED SOON"),
        t.say("%(what)s; the test starts by itself. Stay clear", what=t.gettext(what)),
        soon,
    )


def _stopping(run: LiveRun, t: Texts) -> _Said:
    """STOP was taken while the computer worked: the run ends as soon as it has done so."""
    state = run.feed.state
    said = t.gettext("It is not energised again; the computer ends its work first")
    if state.output_utc:
        said = t.say("Output off at %(time)s by the drive’s word; %(what)s", time=_time(state.output_utc), what=said)
    return _Said(
        "live", t.gettext("STOPPED: THE RUN IS ENDING"), said, t.say("asked by %(who)s", who=run.stop_asked_by)
    )


def _test_line(run: LiveRun, t: Texts) -> str:
    state = run.feed.state
    k = state.current
    if k is None:
        return t.gettext("The last test ends")
    return t.say(
        "Test %(k)s of %(n)s, %(part)s, %(axis)s, %(left)s left",
        k=k + 1,
        n=len(state.tests),
        part=t.gettext(PARTS.get(state.part, "test")),
        axis=f"{state.tests[k].axis_deg:g}°",
        left=t.number(state.left_s, 0, "s"),
    )


def _between_line(run: LiveRun, t: Texts) -> str:
    state = run.feed.state
    k = state.current
    return t.say("Output off while the computer works; test %(k)s goes on by itself. Stay clear", k=(k or 0) + 1)


def _take_as_live(small: str, t: Texts) -> _Said:
    return _Said(
        "alarm", t.gettext("TAKE THE MOTOR AS LIVE"), small, t.gettext("not confirmed: use the emergency stop")
    )


# --- no run holds the drive ---------------------------------------------------------------------------------------
def _at_rest(parts: Parts, run: LiveRun | None, drive: Drive | None, seen: Seen, t: Texts) -> _Said:
    nothing = t.gettext("nothing energised from here")
    if drive is None or not drive.url:
        if run is not None:
            return _Said(
                "unknown",
                t.gettext("State of the motor not known"),
                t.gettext("The drive of this run is not one of this service"),
                nothing,
            )
        return _Said(
            "off",
            t.gettext("Nothing energised from here"),
            t.gettext("No drive chosen"),
            nothing,
        )
    if parts.desk.is_starting(drive.id):
        return _Said(
            "live",
            t.gettext("ENERGISED SOON"),
            t.gettext("The run is being started; the test starts by itself. Stay clear"),
            t.gettext("ends the run: Esc or Space"),
        )
    if drive.id in {going.drive for going in parts.writing.values()}:
        return _Said(
            "asking",
            t.gettext("State of the motor not known"),
            t.gettext(
                "The drive is kept for what is being written, which energises nothing; it is asked again after that"
            ),
            nothing,
        )
    is_open = run is not None and run.feed.state.output != "off"
    if seen.status is not None and seen.age_s <= OLD_S and not seen.error:
        return _by_status(run, _standing(parts, run), seen, t)
    if is_open:
        return _take_as_live(t.gettext("The drive does not answer. Isolate its supply"), t)
    if not seen.says_status and seen.age_s <= OLD_S:
        return _Said(
            "unknown",
            t.gettext("State of the motor not known"),
            t.gettext("This drive’s file describes no status: look at the drive"),
            nothing,
        )
    if seen.error:
        return _Said(
            "unknown",
            t.gettext("State of the motor not known"),
            t.say("The drive does not answer: %(what)s", what=t.tell(seen.error)),
            nothing,
        )
    return _Said("asking", t.gettext("State of the motor not known"), t.gettext("The drive is being asked"), nothing)


def _standing(parts: Parts, run: LiveRun | None) -> str:
    """How the run stands now: what was written or restored after its end is in the archive."""
    if run is None or run.feed.state.end is None:
        return ""
    try:
        return parts.archive.find(run.id).standing
    except Refusal:  # its end is not saved yet
        return ""


def _by_status(run: LiveRun | None, standing: str, seen: Seen, t: Texts) -> _Said:
    assert seen.status is not None
    if seen.status.is_energised:
        return _Said(
            "live",
            t.gettext("MOTOR ENERGISED"),
            t.say("By somebody else. The drive says: %(state)s", state=t.gettext(seen.status.state)),
            t.gettext("not started from here: stop it at the drive"),
        )
    off = t.gettext("Motor not energised")
    word = t.say("The drive says: %(state)s", state=t.gettext(seen.status.state))
    if run is None:
        return _Said("off", off, word, t.gettext("nothing energised"))
    level, small, stop = _ended(run, standing, word, t)
    return _Said(level, off, small, stop)


def _ended(run: LiveRun, standing: str, word: str, t: Texts) -> tuple[str, str, str]:
    """Level, sentence and STOP's second line of a run that is over, with the drive's fresh word that the output is off."""
    state, nothing = run.feed.state, t.gettext("nothing energised")
    end = state.end
    if end is None:
        return "off-bad", t.say("The run was cut off. %(word)s", word=word), nothing
    outcome = end["outcome"]
    if state.stop is not None:
        who = t.person(state.stop.get("person") or "") or t.gettext("the operator")
        text = t.say("Stopped by %(who)s. %(word)s", who=who, word=word)
        return "off", text, t.say("stopped %(time)s", time=_time(str(state.stop["utc"])))
    if outcome == "commissioned":
        done = {
            Standing.COMMISSIONED.value: "Measured and written",
            Standing.RESTORED_SINCE.value: "Measured, written, and the old values restored",
            Standing.UNSURE.value: "Measured. The drive holds its old or its new parameters",
        }.get(standing, "Measured: every parameter within its acceptance. Not written")
        return "off", f"{t.gettext(done)}. {word}", nothing
    what = {"rejected": "Measured, not good enough", "aborted": "The run was aborted"}.get(outcome, "The run failed")
    return "off-bad" if outcome != "rejected" else "off", f"{t.gettext(what)}. {word}", nothing


# --- facts --------------------------------------------------------------------------------------------------------
def _drive_facts(live: LiveRun | None, drive: Drive | None, seen: Seen, t: Texts) -> tuple[str, str]:
    if live is not None:
        found = live.feed.state.drive
        said = t.tell(drive_words(found["drive_type"], found["serial_number"])) if found else ""
        name = said or (drive.name if drive else live.id)
        return name, t.say("data %(age)s old", age=t.number(live.feed.age_s, 1, "s"))
    if drive is None:
        return t.gettext("none"), ""
    if not drive.url:
        return drive.name, t.gettext("not started")
    name = t.tell(seen.identity.words) if seen.identity else drive.name
    if seen.at_s < 0:
        return name, t.gettext("no answer yet")
    if seen.error:
        return name, t.say("no answer for %(age)s", age=t.number(seen.age_s, 1, "s"))
    latency = t.number(1e3 * seen.latency_s, 1, "ms")
    return name, t.say("data %(age)s old, link %(latency)s", age=t.number(seen.age_s, 1, "s"), latency=latency)


def _control(parts: Parts, who: Visitor, drive: Drive | None, live: LiveRun | None, t: Texts) -> tuple[str, str]:
    if who.role is None:
        return t.gettext("nobody"), t.gettext("not logged in")
    if drive is None:
        return t.gettext("free"), t.gettext("nobody controls")
    held = parts.desk.control(drive.id)
    if held.holder is None:
        by_command = live is not None and live.party is None
        return (
            (t.gettext("command line"), t.gettext("you watch"))
            if by_command
            else (t.gettext("free"), t.gettext("nobody controls"))
        )
    if held.is_held_by(who.party):
        others = max(0, (live.feed.watchers if live else 1) - 1)
        watching = t.gettext("nobody watching") if not others else t.say("%(n)s watching", n=others)
        return t.gettext("you"), watching
    return _holder(held, t), t.gettext("you watch")


def _holder(held: Control, t: Texts) -> str:
    assert held.holder is not None
    return held.holder.person if held.holder.person != "operator" else t.gettext("another page")


def _time(utc: str) -> str:
    """Local time of this computer, to the second."""
    return dt.datetime.fromisoformat(utc).astimezone().strftime("%H:%M:%S") if utc else NBSP
