"""All runs of this computer: started, followed, stopped; one at a time for each drive."""

from __future__ import annotations

import asyncio
import contextlib
import datetime as dt
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from commissioner.encoding import JsonObject
from commissioner.run.archive.documents import origin_of
from commissioner.run.archive.journal import read_journal
from commissioner.run.archive.summary import lacks_result
from commissioner.run.holding.drive_lock import runs_holding
from commissioner.run.stopping.operator_stop import SERVICE
from commissioner.run.stopping.stop_file import ask_to_stop
from commissioner.service.audit import Audit
from commissioner.service.configuration import Settings
from commissioner.service.contract.runs import Stopped
from commissioner.service.library import STANDARD, Drive, Library, Motor, Procedure
from commissioner.service.problems import Refusal
from commissioner.service.runs.child import Child, ask_for
from commissioner.service.runs.control import Control, Pages, Party
from commissioner.service.runs.feed import Feed
from commissioner.service.runs.others import drive_at, going_on, is_copied, request_of
from commissioner.service.runs.starting import Starting
from commissioner.service.runs.watch import DriveWatch
from commissioner.settings import load_procedure

POLL_S, SUMMARY_S = 0.04, 0.095
CONFIRM_S = 3.0
"""A stop waits so long for the drive's word before it says that there was none."""
LOOK_S, GONE_S = 0.5, 2.5
"""Between two looks for runs that somebody else of this computer started. Such a run lives while its process has the drive's
lock; one that has let it go, until it has been silent for so long."""
KEPT = 40
"""Feeds of ended runs that stay in memory."""


@dataclass
class LiveRun:
    """A run that goes on, or did lately. `child` None: started elsewhere on this computer."""

    id: str
    drive: str
    motor: str
    feed: Feed
    party: Party | None
    child: Child | None = None
    stop_asked_by: str = ""
    has_freed_drive: bool = False
    is_over: bool = False
    follower: asyncio.Task[None] | None = None

    @property
    def has_result(self) -> bool:
        """The run is over for whoever looks: its result is saved, or nobody will save one any more."""
        return self.is_over or (self.feed.state.is_over and (self.feed.folder / "result.json").is_file())

    @property
    def is_cut_off(self) -> bool:
        """Its process is gone, and it has no end."""
        return self.is_over and self.feed.state.end is None


@dataclass
class Desk:
    """The one place that starts and stops runs."""

    settings: Settings
    library: Library
    audit: Audit
    pages: Pages = field(default_factory=Pages)
    runs: dict[str, LiveRun] = field(default_factory=dict)
    _starting: dict[str, Starting] = field(default_factory=dict)
    _controls: dict[str, Control] = field(default_factory=dict)
    _watches: dict[str, DriveWatch] = field(default_factory=dict)
    _holding: frozenset[str] = frozenset()
    is_closing: bool = False

    # --- looking ------------------------------------------------------------------------------------------------
    def live(self) -> list[LiveRun]:
        return [run for run in self.runs.values() if not run.is_over]

    def without_result(self) -> list[LiveRun]:
        """Those for whom there is nothing yet to look at; a run that is only diagnosed has its result."""
        return [run for run in self.live() if not run.has_result]

    def live_on(self, drive: str) -> LiveRun | None:
        """The run that holds this drive."""
        return next((run for run in self.live() if run.drive == drive and not run.has_freed_drive), None)

    def is_starting(self, drive: str) -> bool:
        return drive in self._starting

    def control(self, drive: str) -> Control:
        return self._controls.setdefault(drive, Control(self.pages, self.settings.file.service.hand_over_s))

    def watch(self, drive: Drive) -> DriveWatch:
        """Of a drive with this address; a new one where the address has changed."""
        key = f"{drive.id} {drive.url}"
        for old in [k for k in self._watches if k.startswith(f"{drive.id} ") and k != key]:
            self._watches.pop(old).close()
        return self._watches.setdefault(key, DriveWatch(drive.url, drive.profile))

    # --- starting -----------------------------------------------------------------------------------------------
    async def start(self, drive: Drive, motor: Motor, verb: Sequence[str], party: Party) -> LiveRun:
        """A run as a child process: `verb` and its own options; `commissioning`, `tuning`. Refusal 409: somebody has the drive."""
        self._check_free(drive)
        self.control(drive.id).take(party)
        watch = self.watch(drive)
        starting = self._starting[drive.id] = Starting(party)
        try:
            child = starting.hold(await Child.start(self._arguments(drive, motor, verb), self.log("run", drive.id)))
            await asyncio.to_thread(watch.pause)
            origin = {"person": party.person, "by": "service", "drive": drive.id, "motor": motor.id}
            folder = await child.begin(origin)
        except BaseException:
            if starting.child is not None:
                starting.child.kill()
            watch.resume()
            raise
        finally:
            self._starting.pop(drive.id, None)
        run = LiveRun(folder.name, drive.id, motor.id, Feed(folder), party, child)
        self._add(run)
        return run

    def _check_free(self, drive: Drive) -> None:
        holder, starting = self.live_on(drive.id), self._starting.get(drive.id)
        if holder is not None or starting is not None:
            party = holder.party if holder is not None else starting and starting.party
            person = party.person if party else "a run from the command line"
            raise Refusal(409, f"{drive.name} is in use: {person}", step="start a run", value=holder.id if holder else "starting",
                          limit="one run at a time on a drive", remedy="wait for its end, or stop it")  # fmt: skip

    def commissioning(self, axes_deg: Sequence[float], *, write_back: bool, procedure: Procedure) -> list[str]:
        """The verb of an ordinary run. UsageError: no run can be made of these axes and this procedure."""
        chosen = axes_deg or self.settings.file.service.axes_deg
        load_procedure(procedure.path, tuple(chosen) or None)
        axes = ["--axes", ",".join(f"{axis:g}" for axis in chosen)] if chosen else []
        more = ["--write-back"] if write_back else []
        more += ["--procedure", str(procedure.path)] if procedure.id != STANDARD else []
        return ["run", *axes, *more, *([] if self.settings.file.service.diagnosis else ["--no-diagnosis"])]

    def _arguments(self, drive: Drive, motor: Motor, verb: Sequence[str]) -> list[str]:
        return [
            *verb, "--drive", drive.url, "--profile", drive.profile, "--motor", motor.source, "--runs",
            str(self.settings.runs), "--dead-man", "--json",
        ]  # fmt: skip

    def log(self, *names: str) -> Path:
        """Where a child's words of distress go."""
        return self.settings.data / "logs" / ("-".join(names) + ".txt")

    def _add(self, run: LiveRun) -> None:
        self.runs[run.id] = run
        run.follower = asyncio.create_task(self._follow(run))
        over = [one.id for one in self.runs.values() if one.is_over]
        for old in over[: max(0, len(over) - KEPT)]:
            del self.runs[old]

    # --- following ----------------------------------------------------------------------------------------------
    async def _follow(self, run: LiveRun) -> None:
        waiting = asyncio.create_task(run.child.wait()) if run.child else None
        told_s = 0.0
        while not self._has_gone(run, waiting):
            run.feed.poll()
            if time.monotonic() - told_s > SUMMARY_S:
                told_s = time.monotonic()
                run.feed.summarise()
            self._watch_over(run)
            await asyncio.sleep(POLL_S)
        while run.feed.poll():
            pass
        if waiting is not None and run.feed.state.end is None:
            run.feed.state.heard(waiting.result().get("error"))
        run.is_over = True
        self._free_drive(run)
        await asyncio.to_thread(self._write_end, run)
        run.feed.close()
        await self._make_result(run)

    def _has_gone(self, run: LiveRun, waiting: asyncio.Task[JsonObject] | None) -> bool:
        if waiting is not None:
            return waiting.done()
        return run.feed.age_s > GONE_S and run.id not in self._holding

    def _watch_over(self, run: LiveRun) -> None:
        state = run.feed.state
        if state.is_over and (state.link is not None or state.phase == "diagnosing"):
            self._free_drive(run)
        party = run.party
        if party is None or not party.session or state.is_over or run.child is None:
            return
        holder = self.control(run.drive).holder or party
        lost_s = self.pages.lost_for_s(holder.session)
        if lost_s > self.settings.file.service.page_lost_s:
            run.stop_asked_by = run.stop_asked_by or SERVICE
            run.child.stop(SERVICE, f"the operator's page was lost for {lost_s:.0f} s")

    def _free_drive(self, run: LiveRun) -> None:
        if run.has_freed_drive:
            return
        run.has_freed_drive = True
        with contextlib.suppress(Exception):
            self.watch(self.library.drive(run.drive)).resume()

    def _write_end(self, run: LiveRun) -> None:
        end = run.feed.state.end
        outcome = end["outcome"] if end else "cut off"
        with contextlib.suppress(OSError):
            self.audit.write(SERVICE, "", f"run ended: {outcome}", run=run.id)

    async def _make_result(self, run: LiveRun) -> None:
        """Of a child that was killed between its end and what came of it: from its samples, as a person would ask for it."""
        with contextlib.suppress(Refusal, OSError):  # then the run's page offers it
            if (
                run.child is not None
                and not self.is_closing
                and await asyncio.to_thread(_has_lost_result, run.feed.folder)
            ):
                await ask_for(
                    "report",
                    ["runs", "report", run.id, "--runs", str(self.settings.runs), "--json"],
                    self.log("report"),
                )

    # --- stopping -----------------------------------------------------------------------------------------------
    async def stop(self, run: LiveRun, person: str, reason: str) -> Stopped:
        """Ask for zero volts and wait for the drive's word. Never refused; twice is harmless."""
        asked_s, asked = time.monotonic(), dt.datetime.now(dt.UTC)
        run.feed.poll()
        was_off = _is_off(run)
        if not run.is_over:
            run.stop_asked_by = run.stop_asked_by or person or SERVICE
            if run.child is not None:
                run.child.stop(person, reason)
            else:
                await asyncio.to_thread(ask_to_stop, run.feed.folder, person, reason)
        state = run.feed.state
        while not _is_off(run) and time.monotonic() - asked_s < CONFIRM_S:
            run.feed.poll()
            await asyncio.sleep(0.005)
        is_off = _is_off(run)
        after_s = 0.0 if was_off else time.monotonic() - asked_s
        confirmed = state.output_utc if is_off else ""
        return Stopped(run.id, asked.isoformat(), is_off, confirmed, round(after_s, 4), state.output_word)

    async def stop_all(self, person: str, reason: str, drive: str | None = None) -> list[Stopped]:
        """Every run of this service, or of one drive; those that are only starting never begin."""
        for name, starting in list(self._starting.items()):
            if drive in (None, name):
                starting.stop(person, reason)
        runs = [run for run in self.live() if drive in (None, run.drive)]
        return list(await asyncio.gather(*(self.stop(run, person, reason) for run in runs)))

    # --- runs of others, start and end --------------------------------------------------------------------------
    async def look_around(self) -> None:
        """Take up runs that somebody started from the command line, until the service closes."""
        while not self.is_closing:
            with contextlib.suppress(OSError):  # a folder that cannot be read now may be at the next look
                await self.look()
            await asyncio.sleep(LOOK_S)

    async def look(self) -> None:
        """One of these looks. OSError: a folder that cannot be read."""
        self._holding = await asyncio.to_thread(runs_holding)
        for folder in await asyncio.to_thread(going_on, self.settings.runs, self._holding):
            if self._is_unknown(folder.name) and not self._is_beginning(folder):
                await self._take_up(folder)

    def _is_unknown(self, run: str) -> bool:
        """Also one that fell silent, was given up, and has its drive all the same."""
        known = self.runs.get(run)
        return known is None or (known.child is None and known.is_cut_off and run in self._holding)

    def _is_beginning(self, folder: Path) -> bool:
        """Of our own: its child says so itself."""
        return bool(self._starting) and bool(origin_of(request_of(folder)))

    async def _take_up(self, folder: Path) -> None:
        request = request_of(folder)
        if not request:  # it comes right after the folder
            return
        feed = Feed(folder)
        feed.poll()
        if feed.state.is_over or (folder.name not in self._holding and is_copied(folder, feed.state.utc)):
            return
        drive = await asyncio.to_thread(drive_at, self.library, str(request.get("url", "")))
        if drive is not None:
            self.watch(drive).pause(0.0)
        motor = str(origin_of(request).get("motor", ""))
        self._add(LiveRun(folder.name, drive.id if drive else "", motor, feed, None))

    async def close(self) -> None:
        """Zero volts everywhere, then the end of every child."""
        self.is_closing = True
        await self.stop_all(SERVICE, "the service is being shut down")
        for run in list(self.runs.values()):
            if run.child is not None and not run.is_over:
                run.child.let_go()
        followers = [run.follower for run in self.runs.values() if run.follower and run.child and not run.is_over]
        if followers:
            await asyncio.wait(followers, timeout=10.0)
        for watch in self._watches.values():
            watch.close()


def _has_lost_result(folder: Path) -> bool:
    return lacks_result(folder, read_journal(folder / "journal.jsonl"))


def _is_off(run: LiveRun) -> bool:
    state = run.feed.state
    return state.output == "off" and state.is_confirmed
