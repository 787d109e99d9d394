"""What a segment begins with: the flux that the one before it left, remanence, and unknown starts after a hole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.intake.record import Segment
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.kernels.decay import LEAST_SHARE, decayed
from commissioner.diagnose.kernels.forcing import tilted
from commissioner.diagnose.kernels.memory import replayed
from commissioner.diagnose.kernels.spline import cells_of
from commissioner.diagnose.kernels.structures import Machine
from commissioner.diagnose.plant.model import Layout, Model, Term

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Left:
    """Rotor flux that outlives the pause, (2,), and what it is made of: `left = tilted kept turned before`."""

    before: Array
    share: Array
    """(2,) of it that a straight iron keeps: along it, and across (a shaft that turns)."""
    size: float
    kept: float
    steeper: float
    derivatives: Array
    """Of its logarithm, (1 + K,), by 1/L_M and the curve's numbers."""
    tilt: Array
    """(2, 2) of the open machine's rate R_R / L_M, by direction."""

    @property
    def rates_spent(self) -> float:
        """Of the tilt, in the logarithm of what is left: the pause is -log(share) L_M / R_R long."""
        return float(np.log(max(self.size, LEAST_SHARE))) * (1.0 + self.steeper) if self.size < 1.0 else 0.0

    @property
    def even(self) -> Array:
        """Without what a direction keeps more than the other."""
        return self.kept * _turned(self.share, self.before)

    @property
    def flux(self) -> Array:
        return np.asarray(self.even + self.rates_spent * self.tilt @ self.even)

    def per_share(self, component: int) -> Array:
        """(2,) derivative by the share along (0) or across (1)."""
        relative = self.share[component] / max(self.size, 1e-12) ** 2
        slope = self.kept * _turned(np.eye(2)[component], self.before) + self.steeper * relative * self.even
        longer = relative * (1.0 + self.steeper) if LEAST_SHARE < self.size < 1.0 else 0.0
        return np.asarray(slope + self.rates_spent * self.tilt @ slope + longer * self.tilt @ self.even)


def initial_state(model: Model, segment: Segment, machine: Machine) -> tuple[Array, Array]:
    """(psi_s, psi_R) at the first sample: index 0, 1 sets both alike (a flux without current), 2-5 one component; and (s, 2) what
    the memory operators at work remember.
    """
    memory = _memory(model, segment, machine.stop_radius)
    state = np.tile(_left(model, segment, machine, np.zeros((0, 0, 4))).flux, 2) + _magnetized(machine, memory)
    for term, value in zip(model.terms, model.values, strict=True):
        if term.kind == kinds.INITIAL_FLUX and term.segment in (-1, segment.uid):
            state += value * _unit(term.index)
    return state, memory


def slopes_of_start(model: Model, segment: Segment, machine: Machine, layout: Layout, asked: Sequence[Term]) -> Array:
    """(4 + asked, 4) derivatives of the initial state by the kernels' four (R_s, R_R, 1/L_sigma, 1/L_M) and by `asked`."""
    coupled, splits = machine.base[14], machine.base[15:17]
    bends = any(t.kind == kinds.IRON_CURVE for t in asked)
    left = _left(model, segment, machine, cells_of(layout.iron_vectors if bends else layout.iron_vectors[:0]))
    per_tilt = left.rates_spent * left.even
    per_memory = _per_memory_current(machine)
    of_all = per_ampere(layout.stop_radius_wb)[:, None] * _memory(model, segment, layout.stop_radius_wb)
    tilts = {
        kinds.ROTOR_ANISOTROPY: 1.0,
        kinds.LEAKAGE_ANISOTROPY: coupled,
        kinds.MAGNETIZING_ANISOTROPY: 1.0 - coupled,
    }
    out = np.zeros((4 + len(asked), 4))
    out[kinds.GAMMA_M] = np.tile(left.derivatives[0] * left.flux, 2)
    out[kinds.GAMMA_M] -= model.nominal[3] * np.tile(
        _magnetized(machine, _memory(model, segment, machine.stop_radius))[2:], 2
    )
    for row, term in enumerate(asked, start=4):
        if term.kind == kinds.INITIAL_FLUX:
            out[row] = _unit(term.index)
        elif term.kind == kinds.STOP:
            out[row] = per_memory @ of_all[term.index]
        elif term.kind == kinds.CARRY:
            out[row] = np.tile(left.per_share(term.index), 2)
        elif term.kind == kinds.IRON_CURVE:
            out[row] = np.tile(left.derivatives[1 + term.index] * left.flux, 2)
        elif term.kind == kinds.ANISOTROPY_SPLIT:
            out[row] = np.tile(tilted(splits[0], splits[1], *per_tilt), 2)
        elif term.kind in tilts:
            out[row] = np.tile(tilts[term.kind] * np.array(tilted(1.0 - term.index, term.index, *per_tilt)), 2)
    return out


def _memory(model: Model, segment: Segment, radius: Array) -> Array:
    """(s, 2) what operators of `radius` (s, 2) remember of the segments before; nothing where the pause wipes it out."""
    if not model.total(kinds.MEMORY) or segment.iron_before_wb is None:
        return np.zeros((len(radius), 2))
    radii = np.ascontiguousarray(radius[:, 0])
    key = radii.tobytes()
    if key not in segment.memories:
        segment.memories[key] = np.asarray(replayed(segment.iron_before_wb, radii))
    return segment.memories[key]


def _magnetized(machine: Machine, memory: Array) -> Array:
    """(psi_s, psi_R) that the memory keeps up."""
    return np.asarray(_per_memory_current(machine) @ ((machine.stop_gain * per_ampere(machine.stop_radius)) @ memory))


def _per_memory_current(machine: Machine) -> Array:
    """(4, 2): (psi_s, psi_R) per ampere of memory current where neither terminals nor cage carry any: (3), (6) of `trajectory`."""
    l_sigma, l_m, nu = 1.0 / machine.base[2], 1.0 / machine.base[3], machine.base[4]
    return np.vstack([-(l_m + nu * l_sigma) * np.eye(2), -l_m * np.eye(2)])


def per_ampere(radius: Array) -> Array:
    """(s,) current of each memory operator per ampere and state (1/Wb), near no flux; `radius` (s, 2) with its loop's rate."""
    return np.where(radius[:, 1] > 0.0, 0.0, 1.0 / np.abs(radius[:, 0]))


def _left(model: Model, segment: Segment, machine: Machine, vectors: Array) -> _Left:
    base, iron, iron_top = machine.base, machine.iron, machine.iron_top
    before, share = np.array(segment.flux_before_wb), np.zeros(2)
    for term, value in zip(model.terms, model.values, strict=True):
        if term.kind == kinds.CARRY and term.segment in (-1, segment.uid):
            share[term.index] += value
    size = float(np.hypot(*share))
    cosine, sine = base[6:8] + base[10:12]
    kept, steeper, derivatives = decayed(float(np.hypot(*before)), size, model.nominal[3], iron, iron_top, vectors)
    return _Left(before, share, size, kept, steeper, derivatives, np.array([[cosine, sine], [sine, -cosine]]))


def _turned(share: Array, flux: Array) -> Array:
    return np.array([share[0] * flux[0] - share[1] * flux[1], share[0] * flux[1] + share[1] * flux[0]])


def _unit(index: int) -> Array:
    """The state that one number of a start makes."""
    state = np.zeros(4)
    state[[index, 2 + index] if index < 2 else [index - 2]] = 1.0
    return state
