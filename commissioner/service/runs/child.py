"""A run as a child process: exactly what `commissioner run` is, held by a pipe that beats."""

from __future__ import annotations

import asyncio
import contextlib
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from commissioner.encoding import JsonObject
from commissioner.run.stopping.dead_man import BEAT_S
from commissioner.service.problems import Refusal

BEGIN_S = 60.0
"""Until a run has its folder: imports on a slow disk included."""
SENT_BACK = {2: 422, 3: 409, 4: 409, 5: 502}
OF_KIND = {"DriveInUse": 409, "DiskRefused": 507}
"""What also ends with 5, and is no failure of drive or link."""


def program(*arguments: str) -> list[str]:
    """The command line that runs this product."""
    return [sys.executable, "-m", "commissioner", *arguments]


class Child:
    """One `commissioner run` or `tune` with `--dead-man`. Its end of the pipe going away, or falling silent, means zero volts."""

    def __init__(self, process: asyncio.subprocess.Process, log: Path) -> None:
        self._process, self._log = process, log
        self._beating = asyncio.create_task(self._beat())

    @classmethod
    async def start(cls, arguments: Sequence[str], log: Path) -> Child:
        """The process, in a session of its own: Ctrl-C at the service reaches it by the pipe alone."""
        log.parent.mkdir(parents=True, exist_ok=True)
        with log.open("wb") as errors:
            process = await asyncio.create_subprocess_exec(
                *program(*arguments), stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, stderr=errors,
                start_new_session=True, limit=2**24,
            )  # fmt: skip
        return cls(process, log)

    async def begin(self, origin: Mapping[str, Any]) -> Path:
        """Let the run begin; its folder. Refusal, as the run itself says it, where it did not come to that."""
        self._say("begin", origin)
        assert self._process.stdout is not None
        try:
            line = await asyncio.wait_for(self._process.stdout.readline(), BEGIN_S)
        except TimeoutError:
            self.kill()
            raise Refusal(503, "the run did not begin", step="start a run", value=f"nothing within {BEGIN_S:g} s",
                          limit="a run folder", remedy="look at the computer's load and disk, then try again") from None  # fmt: skip
        said = _document(line)
        if "folder" in said:
            return Path(said["folder"])
        rest = line + await self._process.stdout.read()
        raise await self._failure(rest)

    def stop(self, person: str, reason: str) -> None:
        """The operator's word."""
        self._say("stop", {"person": person, "reason": reason})

    def answer(self, number: int, *, is_done: bool) -> None:
        """To what the run's journal asks the person at the drive."""
        self._say("answer", {"number": number, "done": is_done})

    async def wait(self) -> JsonObject:
        """Until it has ended; what it says then, which is in its folder as well where its disk took that."""
        assert self._process.stdout is not None
        said = await self._process.stdout.read()
        await self._process.wait()
        self._beating.cancel()
        return _document(said)

    @property
    def is_alive(self) -> bool:
        return self._process.returncode is None

    def kill(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            self._process.kill()

    def let_go(self) -> None:
        """Close the pipe: the run ends by itself, at zero volts first."""
        self._beating.cancel()
        if self._process.stdin is not None:
            self._process.stdin.close()

    async def _beat(self) -> None:
        while self.is_alive:
            self._write(b"beat\n")
            await asyncio.sleep(BEAT_S)

    def _say(self, word: str, facts: Mapping[str, Any]) -> None:
        self._write(f"{word} {json.dumps(dict(facts))}\n".encode())

    def _write(self, line: bytes) -> None:
        if self._process.stdin is not None and not self._process.stdin.is_closing():
            with contextlib.suppress(OSError, RuntimeError):
                self._process.stdin.write(line)

    async def _failure(self, text: bytes) -> Refusal:
        code = await self._process.wait()
        self._beating.cancel()
        return _refusal(code, _document(text), self._log)


async def ask(
    arguments: Sequence[str], log: Path, timeout_s: float = 120.0, *, may_kill: bool = True
) -> tuple[int, JsonObject]:
    """A verb with --json as a process: exit code and document. Refusal where it answered none. `may_kill`: not of one that writes into
    a drive; where nobody waits for it any longer, as where the service is shut down, it goes on to its end by itself."""
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("wb") as errors:
        process = await asyncio.create_subprocess_exec(
            *program(*arguments), stdin=subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE, stderr=errors,
            start_new_session=True, limit=2**24,
        )  # fmt: skip
    try:
        text, _ = await asyncio.wait_for(process.communicate(), timeout_s)
    except BaseException as broken:
        if may_kill:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()
        if not isinstance(broken, TimeoutError | asyncio.TimeoutError):
            raise
        raise Refusal(503, f"`commissioner {arguments[0]}` took too long", step=arguments[0], value=f"{timeout_s:g} s",
                      limit="an answer", remedy="try again") from broken  # fmt: skip
    code = process.returncode or 0
    try:
        document = json.loads(text)
    except ValueError:
        raise _refusal(code, {}, log) from None
    return code, document if isinstance(document, dict) else {}


async def ask_for(wanted: str, arguments: Sequence[str], log: Path) -> JsonObject:
    """The verb's document. Refusal in the verb's own words where `wanted` is not in it."""
    code, document = await ask(arguments, log)
    if wanted not in document:
        raise _refusal(code, document, log)
    return document


async def succeed(
    arguments: Sequence[str], log: Path, timeout_s: float = 120.0, *, may_kill: bool = True
) -> JsonObject:
    """The verb's document. Refusal in the verb's own words where it failed. `may_kill`: as `ask`."""
    code, document = await ask(arguments, log, timeout_s, may_kill=may_kill)
    if code != 0:
        raise _refusal(code, document, log)
    return document


def _document(text: bytes) -> JsonObject:
    """Empty where it is none."""
    with contextlib.suppress(ValueError):
        read = json.loads(text)
        if isinstance(read, dict):
            return read
    return {}


def _refusal(code: int, document: JsonObject, log: Path) -> Refusal:
    """What a verb says under `error`, as a refusal."""
    error = document.get("error") or {}
    if not error:
        said = log.read_text("utf-8", "replace").strip().splitlines() if log.is_file() else []
        error = {"what": "the process ended without a word", "step": "run", "value": (said or ["nothing"])[-1][:200],
                 "limit": "a result", "remedy": f"see {log}"}  # fmt: skip
    status = OF_KIND.get(str(error.get("kind")), SENT_BACK.get(code, 503))
    return Refusal(
        status, str(error.get("what", "")), detail=str(error.get("what", "")), step=str(error.get("step") or ""),
        value=error.get("value"), limit=error.get("limit"), remedy=str(error.get("remedy") or ""),
    )  # fmt: skip
