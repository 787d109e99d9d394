"""Simulated motors behind simulated drives, from whichever package offers them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import entry_points
from typing import Any, Protocol

from commissioner.errors import UsageError
from commissioner.link.wire.in_process import Simulator

GROUP = "commissioner.simulators"


class Drawn(Protocol):
    """One case: `plate` as a motor file has it, `station` answers PDUs; the rest is the answer key."""

    motor: str
    plate: Mapping[str, Any]
    document: Mapping[str, Any]
    """The scenario, as `python -m sim --scenario FILE.json` reads it under the key `scenario`."""
    effects: Sequence[str]
    station: Simulator

    @property
    def highest_flux_wb(self) -> float:
        """Peak stator flux that really was."""
        ...

    def parameters_at(self, stator_flux_wb: float, axes_deg: Sequence[float]) -> Mapping[str, float]:
        """The true inverse-Gamma values at a peak stator flux, by the contract's names, SI, as the sensors scale what is tested
        along these axes."""
        ...


class Factory(Protocol):
    """What an entry point of the group is."""

    def motors(self) -> Sequence[str]:
        """Names of the motors it knows."""
        ...

    def draw(
        self,
        motor: str | Mapping[str, Any],
        seed: int,
        *,
        spread: float,
        effects: Sequence[str],
        noise_a: float | None,
        faults: Sequence[str],
    ) -> Drawn:
        """`motor`: one of `motors`, a scenario file, or a scenario's tables `nameplate` and `machine` under a `name`; `spread`: parameters moved by up to this share; `effects`: names, or one of "none", "any". ValueError: impossible."""
        ...


def simulator() -> Factory:
    """The installed simulator. UsageError where there is none."""
    found = list(entry_points(group=GROUP))
    if not found:
        raise UsageError(
            "no simulator is installed", step="study", value="none", limit=f"an entry point of {GROUP}",
            remedy="install this package again: the simulator comes with it",
        )  # fmt: skip
    factory: Factory = found[0].load()()
    return factory
