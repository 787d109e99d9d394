"""Recordings dropped on the page: identified, diagnosed or monitored by a process of their own; no drive is touched."""

from __future__ import annotations

import asyncio
import contextlib
import datetime as dt
import itertools
import json
import re
import secrets
import shutil
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, cast

from commissioner.encoding import JsonObject
from commissioner.service.contract.recordings import FailureDocument, RecordingDocument, SaidOfIt
from commissioner.service.problems import Refusal
from commissioner.service.runs.child import ask

Verb = Literal["identify", "diagnose", "monitor"]
VERBS: tuple[Verb, ...] = ("identify", "diagnose", "monitor")
ENDINGS = (
    ".csv",
    ".csv.gz",
    ".parquet",
    ".mat",
    ".tdms",
    ".mf4",
    ".cfg",
    ".dat",
    ".cff",
    ".txt",
    ".xlsx",
    ".xlsm",
    ".xlsb",
    ".xls",
    ".ods",
)
LARGEST = 1_000_000_000
"""Bytes of one upload."""
LONGEST_S, KEPT = 1800.0, 50
LOG = "said.log"
"""No recording is called so: the verb's words of distress would overwrite it."""


@dataclass
class Job:
    """One verb on one recording. `document`: what the verb said; `exit_code` None while it works."""

    id: str
    verb: Verb
    files: list[str]
    folder: Path
    begun_utc: str = field(default_factory=lambda: dt.datetime.now(dt.UTC).isoformat(timespec="seconds"))
    document: JsonObject = field(default_factory=dict)
    exit_code: int | None = None
    failure: FailureDocument | None = None
    task: asyncio.Task[None] | None = None

    @property
    def is_done(self) -> bool:
        return self.exit_code is not None or self.failure is not None

    @property
    def report(self) -> Path | None:
        """The page with its pictures, where the verb makes one."""
        return next((p for p in sorted((self.folder / "out").glob("report*.html"))), None)

    def as_document(self) -> RecordingDocument:
        return {
            "id": self.id,
            "verb": self.verb,
            "files": self.files,
            "begun_utc": self.begun_utc,
            "is_done": self.is_done,
            "exit_code": self.exit_code,
            "result": cast("SaidOfIt", self.document),
            "problem": self.failure,
            "report": f"/api/recordings/{self.id}/report" if self.report else None,
        }


class Recordings:
    """The jobs of this service's life; the uploaded files go with them."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._jobs: dict[str, Job] = {}
        self._one_at_a_time = asyncio.Semaphore(1)

    def find(self, identifier: str) -> Job:
        """Refusal 404 where there is none."""
        job = self._jobs.get(identifier)
        if job is None:
            raise Refusal(
                404,
                "there is no such recording",
                step="recordings",
                value=identifier[:60],
                limit="one that was uploaded since the service began",
                remedy="upload it again",
            )
        return job

    async def take(self, verb: str, motor: str | None, uploads: AsyncIterator[tuple[str, AsyncIterator[bytes]]]) -> Job:
        """Keep the files and begin. Refusal: no file, a kind that no importer reads, or one that is too large."""
        if verb not in VERBS:
            raise Refusal(
                422,
                "there is no such verb",
                step="recordings",
                value=verb[:40],
                limit=", ".join(VERBS),
                remedy="choose identify, diagnose or monitor",
            )
        job = Job(secrets.token_hex(8), verb, [], self._root)
        job.folder = self._root / job.id
        job.folder.mkdir(parents=True, mode=0o700)
        try:
            async for name, pieces in uploads:
                job.files.append(await _keep(job.folder, name, pieces))
            if not job.files:
                raise Refusal(
                    422, "no file came", step="recordings", value=0, limit="at least one file", remedy="choose a file"
                )
        except BaseException:
            shutil.rmtree(job.folder, ignore_errors=True)
            raise
        self._jobs[job.id] = job
        self._forget()
        job.task = asyncio.create_task(self._work(job, motor))
        return job

    async def close(self) -> None:
        """Stop what works, and leave no uploaded file behind."""
        for job in self._jobs.values():
            if job.task is not None and not job.task.done():
                job.task.cancel()
                with contextlib.suppress(asyncio.CancelledError, Exception):
                    await job.task
        await asyncio.to_thread(shutil.rmtree, self._root, True)

    async def _work(self, job: Job, motor: str | None) -> None:
        out = job.folder / "out"
        files = [str(job.folder / name) for name in job.files if not name.lower().endswith(".dat")] or [
            str(job.folder / job.files[0])
        ]
        arguments = [job.verb, *(files if job.verb != "monitor" else files[:1]), "--json"]
        arguments += ["--motor", motor] if motor else []
        arguments += ["--out", str(out)]
        try:
            async with self._one_at_a_time:
                job.exit_code, job.document = await ask(arguments, job.folder / LOG, LONGEST_S)
        except Refusal as refusal:
            job.failure = cast("FailureDocument", refusal.problem.model_dump(mode="json"))
        else:
            error = job.document.get("error")
            if isinstance(error, dict):
                job.failure = cast("FailureDocument", {"title": error.get("what"), **error})
        _say_names(job)

    def _forget(self) -> None:
        done = [job for job in self._jobs.values() if job.is_done]
        for job in done[: max(0, len(self._jobs) - KEPT)]:
            del self._jobs[job.id]
            shutil.rmtree(job.folder, ignore_errors=True)


async def _keep(folder: Path, name: str, pieces: AsyncIterator[bytes]) -> str:
    """The file under a harmless form of its name, which is returned."""
    safe = re.sub(r"[^\w.\-]", "_", Path(name.replace("\\", "/")).name)[-100:].lstrip(".") or "recording"
    if not safe.lower().endswith(ENDINGS):
        raise Refusal(
            415,
            f"{safe} is no recording",
            step="recordings",
            value=safe,
            limit=", ".join(ENDINGS),
            remedy="give CSV, XLSX, Parquet, MATLAB 5, TDMS, MDF 4 or COMTRADE",
        )
    size, safe = 0, _unused(folder, safe)
    path = folder / safe
    with path.open("xb") as file:
        async for piece in pieces:
            size += len(piece)
            if size > LARGEST:
                raise Refusal(
                    413,
                    f"{safe} is too large",
                    step="recordings",
                    value=f"more than {LARGEST} bytes",
                    limit=f"{LARGEST} bytes",
                    remedy="cut the recording, or use the command line",
                )
            await asyncio.to_thread(file.write, piece)
    return safe


def _unused(folder: Path, name: str) -> str:
    """The name, numbered where another file of the upload has it already."""
    taken = {path.name.lower() for path in folder.iterdir()}
    names = (f"{number}_{name}" if number else name for number in itertools.count())
    return next(called for called in names if called.lower() not in taken)


def _say_names(job: Job) -> None:
    """The document speaks of the files by their names, not of where they lie here."""
    text = json.dumps(job.document).replace(json.dumps(str(job.folder))[1:-1] + "/", "")
    job.document = json.loads(text)
    if job.failure:
        job.failure = json.loads(json.dumps(job.failure, default=str).replace(str(job.folder) + "/", ""))
