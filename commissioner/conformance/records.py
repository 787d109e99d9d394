"""What a rule asks, what comes back, and how it was judged: frozen records and two ways to end early."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from enum import Enum
from typing import TypeVar

Words = tuple[int, ...]


@dataclass(frozen=True)
class Ask:
    """One request PDU. `device` None: the drive's own number."""

    pdu: bytes
    device: int | None = None


@dataclass(frozen=True)
class Wait:
    seconds: float


@dataclass(frozen=True)
class Reply:
    """The answer PDU, None for silence. `flaw` names what was wrong with its frame; `at_s` is since the kit began."""

    pdu: bytes | None = None
    at_s: float = 0.0
    took_s: float = 0.0
    flaw: str = ""

    @property
    def exception(self) -> int | None:
        """The Modbus exception code, None where the answer is none."""
        return self.pdu[1] if self.pdu is not None and len(self.pdu) == 2 and self.pdu[0] & 0x80 else None


T = TypeVar("T")
Steps = Generator[Ask | Wait, Reply, T]
"""A course of requests that ends in a T."""


class Broken(Exception):
    """The rule does not hold; the text says what was seen and what would be right. Caught by `judge`."""


class NotTested(Exception):
    """The rule cannot be tried here; the text says why. Caught by `judge`."""


class Outcome(Enum):
    PASS = "pass"
    FAIL = "fail"
    NOT_TESTED = "not tested"


@dataclass(frozen=True)
class Exchange:
    """Evidence: request and reply as hexadecimal PDUs (reply empty for silence), when and how long."""

    at_s: float
    request: str
    reply: str
    took_s: float


@dataclass(frozen=True)
class RuleResult:
    """How one rule ended. `evidence`: its last exchanges, the deciding one last; `requests`: how many there were."""

    name: str
    claim: str
    source: str
    energises: bool
    outcome: Outcome
    reason: str
    requests: int
    evidence: tuple[Exchange, ...]
