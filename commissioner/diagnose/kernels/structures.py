"""What the kernels are given: named tuples, which a compiled function takes as they are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Drive(NamedTuple):
    """What drives the machine through a segment: commanded voltage alpha and beta (n,), V, and known functions of time: factors on
    voltage, link and rotor resistance (n,) and on the phase resistances (n, 3), electrical speed (n,), rad/s.
    """

    voltage_a: Array
    voltage_b: Array
    voltage_factor: Array
    link_factor: Array
    phase_factor: Array
    rotor_factor: Array
    omega: Array


class Machine(NamedTuple):
    """Constants (`plant.prediction` makes `base`) and curves as cells (intervals, 4), those without any size empty, each over its
    range; memory operators at work with gain (s,) and radius (s, 2), extra branches with gain and time constant (b,).
    """

    base: Array
    legs: Array
    legs_link: Array
    iron: Array
    leak: Array
    legs_top: float
    legs_knee: float
    iron_top: float
    leak_top: float
    stop_gain: Array
    stop_radius: Array
    branch_gain: Array
    branch_time: Array


class Course(NamedTuple):
    """A trajectory at its n samples: states (n + 1, order), those of the memory operators (n + 1, s, 2), terminal current (2, n), its slope
    after and before each sample (2, n), and rotor current (2, n)."""

    states: Array
    stop_states: Array
    current: Array
    slope_after: Array
    slope_before: Array
    rotor_current: Array


class Asked(NamedTuple):
    """The parameters (P,) whose derivatives are asked for: kinds and indices; B-spline weights of leg curves (K, width), cells of iron
    and leakage curves (K, intervals, 4), empty where no parameter needs them; d (psi_s, psi_R) / d parameter at the start (P, 4).
    """

    kinds: NDArray[np.int64]
    indices: NDArray[np.int64]
    legs: Array
    iron: Array
    leak: Array
    start: Array


class Samples(NamedTuple):
    """What is known at the samples of a block, row 0 the sample before it: `at` (ROWS, B+1); `before`, `now` (B+1, 3) phase currents at
    the ends of the period, `secant` (B+1, 3) resistance of phase and leg between them, `leg_mean` (B+1, 2, width) mean weights of the
    leg curve, `lost` (B+1, 3) mean voltage of a leg that is as the mean of the three, `memory` (B+1, s, 7) derivatives of the memory
    operators at work: factor, by the flux (aa, ab, bb), by the state before.
    """

    at: Array
    before: Array
    now: Array
    secant: Array
    leg_mean: Array
    lost: Array
    memory: Array


class Matrices(NamedTuple):
    """The step of states x = (d psi_s, d psi_R) to each sample of a block: (8) of `tangent` solved for the end of the period.

    x' = `step` x + `push` (t + t', w + w') + T `push_v` v;   d i = `amp` x + t;   d w = `cage` x + `cage_push` (push without K).

    `step` (B+1, 4, 4) and `push` (4, 8, B+1), the last four columns T push_v; `amp`, `cage` (B+1, 2, 4); `cage_push` (B+1, 7) K
    (2, 2) that takes a current at the magnetizing node to w, and what rotor branches leave of a voltage (aa, ab, bb).
    """

    step: Array
    push: Array
    amp: Array
    cage: Array
    cage_push: Array


class Pushes(NamedTuple):
    """What a parameter pushes at each sample of a block: into the magnetizing and the stator current, straight into the terminal
    current, and into w (`rotor`), each (2, B+1); into d psi_s/dt and d psi_R/dt over the period before (`flux`, (4, B+1)).
    """

    magnetizing: Array
    current: Array
    terminal: Array
    flux: Array
    rotor: Array


class Carried(NamedTuple):
    """What parameters (p,) that meet memory take from sample to sample: state x (p, 4), derivatives of memory operators z (p, s, 2) and
    rotor branches q (p, b, 2), the iron's `flux` and the w (`rate`) that fed them (p, 2), and what they pushed into current and w
    (`fed`, (p, 4)); `own` (p,): 1 where the iron's flux itself depends on the parameter.
    """

    own: Array
    x: Array
    z: Array
    q: Array
    flux: Array
    rate: Array
    fed: Array
