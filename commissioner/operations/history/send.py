"""Run folders to a service over HTTP: only what it lacks, in pieces, proved by their chain on both sides, gone on with where it broke off."""

from __future__ import annotations

import hashlib
import http.client
import json
import re
import ssl
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from http.cookies import SimpleCookie
from pathlib import Path
from typing import Any
from urllib.parse import quote

from commissioner.encoding import JsonObject, read_json
from commissioner.errors import CommissionerError, UsageError
from commissioner.link.wire.unopened import certificate_remedy
from commissioner.operations.history.share import (
    CONFLICT,
    CONFLICTING,
    COPIED,
    LEFT,
    NEWER,
    NOT_TAKEN,
    PIECE,
    THERE,
    UPDATED,
    Moved,
    file_names,
)
from commissioner.run.archive.catalogue import find_folder, run_folders
from commissioner.run.archive.journal import whole_lines
from commissioner.run.archive.verify import DAMAGED, verify
from commissioner.run.index.index import JOURNAL
from commissioner.text import split_address

ANSWER_S = 120.0
AT_ONCE = PIECE // 2
"""Bytes of one request; the service takes no larger ones."""
LOG_IN = "/api/login"
RUN = r"^[0-9]{8}-[0-9]{6}-[\w.\-]{1,150}$"
FILE = r"^[A-Za-z0-9][\w.\-]{0,99}$"
"""Names that a service takes: of a run, of a file in it."""
OF_ONE_RUN = (413, 422)
"""Refusals that say nothing of the runs after it."""
LOGGED_OUT = "push again: it logs in anew and goes on where it broke off; the account may have been taken away or changed in between"
LOOPBACK = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True)
class Account:
    """Who pushes, where the service has accounts."""

    name: str
    password: str


def send(
    runs: Path, url: str, names: Sequence[str] = (), *, account: Account | None = None, ca: Path | None = None
) -> tuple[Moved, ...]:
    """The runs named, or all, to the service at `url`; `ca`: PEM file of who vouches for it. UsageError: no such address, or a
    password that anybody could read on the way. CommissionerError: the service cannot be reached or refuses; what it has
    by then stays, and the next call goes on from there."""
    folders = [find_folder(runs, name) for name in names] if names else run_folders(runs)
    with _Service(url, account, ca) as service:
        return tuple(_try(folder, service) for folder in folders)


class _NotTaken(CommissionerError):
    """The service refuses this run, not its pusher."""


def _try(folder: Path, service: _Service) -> Moved:
    """One run that is not taken holds up no other."""
    if not (why := _misnamed(folder)):
        try:
            return _one(folder, service)
        except _NotTaken as refusal:
            why = f"{refusal.what}: {refusal.value}; {refusal.remedy}"
    return Moved(folder.name, NOT_TAKEN, 0, 0, why)


def _misnamed(folder: Path) -> str:
    """What of the run has a name that no service takes; nothing of one as it was made."""
    if not re.search(RUN, folder.name):
        return "its folder was given another name than a run has: call it as its run again"
    odd = next((name for name in file_names(folder) if not re.search(FILE, name)), None)
    return f"a service takes no file called {odd!r}: letters, digits, - _ . without spaces" if odd is not None else ""


def _one(folder: Path, service: _Service) -> Moved:
    seen, run = verify(folder), folder.name
    if seen.state == DAMAGED:
        return Moved(run, LEFT, 0, 0, f"{seen.losses[0].file}: {seen.losses[0].what}")
    journal, path = whole_lines(folder / JOURNAL), f"/api/incoming/{quote(run)}"
    there = service.ask("GET", f"{path}?journal_bytes={len(journal)}")
    relation = _relation(journal, there["journal"])
    if relation == CONFLICT:
        return Moved(run, CONFLICT, 0, 0, CONFLICTING)
    if relation in (THERE, NEWER):
        return Moved(run, relation, 0, 0)
    files, size, digests = 0, 0, dict[str, str]()
    for name in file_names(folder):
        content = journal if name == JOURNAL else (folder / name).read_bytes()
        digests[name] = hashlib.sha256(content).hexdigest()
        if sent := _send(content, f"{path}/{quote(name)}", there["begun"].get(name), service):
            files, size = files + 1, size + sent
    done = service.ask(
        "POST", path, json.dumps({"files": list(digests), "sha256": digests}).encode(), "application/json"
    )
    return Moved(run, str(done["what"]), files, size, str(done["why"]))


def _relation(journal: bytes, there: Mapping[str, Any] | None) -> str:
    """As between two folders: one journal that begins with the other is its later state."""
    if there is None:
        return COPIED
    count = int(there["bytes"])
    if hashlib.sha256(journal[:count]).hexdigest() != there["sha256"]:
        return CONFLICT
    if count == len(journal):
        return UPDATED if there["is_damaged"] else THERE
    return UPDATED if count < len(journal) else NEWER


def _send(content: bytes, path: str, begun: Mapping[str, Any] | None, service: _Service) -> int:
    """Bytes sent: the rest of what was begun, everything where that is not ours."""
    held = int(begun["bytes"]) if begun else -1
    if begun is None or held > len(content) or hashlib.sha256(content[:held]).hexdigest() != begun["sha256"]:
        held = -1
    if held == len(content):
        return 0
    for start in range(max(held, 0), max(len(content), 1), AT_ONCE):
        piece = content[start : start + AT_ONCE]
        service.ask("PUT", f"{path}?start={start}", piece, "application/octet-stream")
    if begun is not None and int(begun["bytes"]) > len(content) > 0:  # what another left behind our end
        service.ask("PUT", f"{path}?start={len(content)}", b"", "application/octet-stream")
    return len(content) - max(held, 0)


class _Service:
    """One connection to a service; logged in, where there is an account."""

    def __init__(self, url: str, account: Account | None, ca: Path | None) -> None:
        parts = split_address(url)
        if parts.scheme not in ("http", "https") or not parts.hostname or parts.username is not None:
            raise _usage("this is no address of a service", parts.hostname or parts.scheme or "nothing",
                         "http://HOST:PORT or https://HOST:PORT", "give what `commissioner serve` prints, the name with --account")  # fmt: skip
        if account is not None and parts.scheme == "http" and parts.hostname not in LOOPBACK:
            raise _usage("the password could be read on its way", f"http to {parts.hostname}", "https",
                         "give the service's https address")  # fmt: skip
        self._url, self._account, self._headers = f"{parts.scheme}://{parts.netloc}", account, dict[str, str]()
        self._connection = (
            http.client.HTTPSConnection(parts.netloc, timeout=ANSWER_S, context=_trust(ca))
            if parts.scheme == "https"
            else http.client.HTTPConnection(parts.netloc, timeout=ANSWER_S)
        )

    def __enter__(self) -> _Service:
        try:
            if self._account is not None:
                document = self.ask("POST", LOG_IN, json.dumps(vars(self._account)).encode(), "application/json")
                self._headers["X-CSRF-Token"] = str(document["csrf"])
        except BaseException:
            self._connection.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()

    def ask(self, method: str, path: str, body: bytes | None = None, kind: str = "") -> JsonObject:
        """The answer's document. CommissionerError: none came, or a refusal, in the service's own words."""
        headers = self._headers | ({"Content-Type": kind} if kind else {})
        try:
            self._connection.request(method, path, body, headers)
            answer = self._connection.getresponse()
            text = answer.read()
            document = read_json(text)
        except ssl.SSLCertVerificationError as failure:
            raise CommissionerError(
                f"the service's certificate is not trusted: {failure.verify_message}", step="push", value=self._url,
                limit="a certificate of this name from an authority that this computer knows, or of --ca",
                remedy=certificate_remedy(
                    failure,
                    "give --ca FILE with the certificate of who vouches for it, as whoever set up the service has it; take the address that "
                    "the certificate is made out to",
                ),
            ) from failure  # fmt: skip
        except (OSError, http.client.HTTPException, ValueError) as failure:
            raise CommissionerError(
                f"the service does not answer: {getattr(failure, 'strerror', None) or failure}", step="push", value=self._url,
                limit="a running `commissioner serve`", remedy="look at the service, then repeat: the same call goes on where it broke off",
            ) from failure  # fmt: skip
        if answer.status >= 400:
            is_out = answer.status == 401 and path != LOG_IN
            remedy = (LOGGED_OUT if self._account else "give --account NAME") if is_out else document.get("remedy")
            kind_of = _NotTaken if answer.status in OF_ONE_RUN and path != LOG_IN else CommissionerError
            raise kind_of(
                str(document.get("title", "refused")), step=str(document.get("step") or "push"), value=document.get("value"),
                limit=document.get("limit"), remedy=str(remedy or ""),
            )  # fmt: skip
        for morsel in SimpleCookie(answer.getheader("set-cookie") or "").values():
            self._headers["Cookie"] = f"{morsel.key}={morsel.value}"
        return dict(document)


def _trust(ca: Path | None) -> ssl.SSLContext:
    """Whom to believe that the service is the service: the system's authorities, or one file."""
    try:
        return ssl.create_default_context(cafile=str(ca) if ca else None)
    except OSError as failure:
        raise _usage(
            "the file of --ca holds no certificate", str(ca), "a PEM file", "ask whoever set up the service for it"
        ) from failure


def _usage(what: str, value: str, limit: str, remedy: str) -> UsageError:
    return UsageError(what, step="push", value=value, limit=limit, remedy=remedy)
