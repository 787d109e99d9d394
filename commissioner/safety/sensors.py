"""Do the current sensors tell the truth? Judged on every block of a session, and against what the drive itself says.

Along one axis all three phase currents are one current times a known cosine. What the phases show beyond that is no
current of the test: a sensor that is silent, frozen, reversed, exchanged or of foreign scale leaves a misfit in that
pattern as large as the current itself. A scale common to all sensors leaves none: it shows only against the drive's own
current magnitude, sample for sample, where the drive offers one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from commissioner.motor.space_vector import phase_cosines
from commissioner.records import DriveStatus, SampleBlock, Signal, peak
from commissioner.safety.watch import StopReason

ZERO_S, WINDOW_S = 0.05, 0.04
"""Time at zero voltage from which the offsets are taken; time over which the pattern is judged."""
MISFIT = 0.12
"""Largest misfit of a phase, of the axis current: gains that differ by a tenth leave 0.04 and legs that do as much again. The
phase that carries the whole axis current leaves only (g - 1) / (2 g + 1) of a gain g: 0.2 where it shows twice its current."""
SIGMAS = 6.0
NOISES = 5.0
"""Standard deviations of a sensor's noise that the drive's word may be off beside: it may be of the neighbouring sample. Where no current flowed, a
magnitude of 0.037 A against 0.004 A ended a sound run."""
SCALE, SCALE_FLOOR = 0.1, 0.004
"""How far the drive's magnitude of one sample may be off the stream's: of the larger, and of the current limit."""
UNSEEN = 3
"""A third current that is the others' negative sum has the offsets of both, and the drive's own has that of its sensor."""
MOVES, LEAST_SHARE = 0.1, 0.1
"""A phase stands still that shows one and the same number while the voltage moves by this share of itself; a phase whose
share of the axis current is smaller than the second is not asked."""
STEPS = 2.0
"""What a current that moves with its voltage must move by before a coarse converter shows it: of steps of 0.64 A a sound sensor showed one
and the same beside a current of 0.7 A, and the run ended as a fault."""
NAMES = ("u", "v", "w")
CHECK = "check the current sensors, their plugs, order, sign and scale in the drive, and the motor cable"
OPEN_SHARE = 0.1
"""Of the axis current: what a phase that carries none still shows, its sensor's noise and offset aside."""
QUIET = 3.0
"""Standard deviations of its noise that the mean square of a phase without current, or of all three's sum, may show."""
FLOWED, GONE_S = 60.0, 0.12
"""Standard deviations of its noise from which a current surely flows. One that after such a current stays below `SIGMAS` of them for so long,
beside as much voltage, has stopped: where it changes its sign, it stays there for 0.05 s at half a hertz."""
AS_MUCH = 0.95
"""Of the voltage, in the root mean square, that drove such currents: what an inverter loses may take all of a smaller one."""
PARTS = 16
"""Of a window: where in it a phase opened is told to one of them."""
CABLE = "isolate the supply, then check motor cable, terminals and contactor"
TURNING = "see that the shaft stands still, for one that turns makes currents beside the axis, too; "


@dataclass(frozen=True)
class _Zero:
    """What the sensors show while nothing is driven: mean and standard deviation, `(phases,)`."""

    offset_a: Signal
    noise_a: Signal


@dataclass
class SensorWatch:
    """One per energised session. `current_limit_a`: what the drive trips at, the scale of what matters."""

    current_limit_a: float
    _at_rest: list[Signal] = field(default_factory=list)
    _window: list[SampleBlock] = field(default_factory=list)
    _zero: _Zero | None = None
    _claimed: tuple[int, float] | None = None
    _step_a: float = 0.0
    """The smallest difference that a sensor has shown: the step of a coarse converter, next to nothing of any other."""
    _drove: tuple[float, int] = (0.0, 0)
    """Of the windows in which a current surely flowed: the sum of their mean squared voltages, and how many they are."""
    _gone_s: float = 0.0
    """For so long no current has flowed beside as much voltage."""

    def claim(self, status: DriveStatus) -> None:
        """The drive says how large its newest sample's largest phase current is."""
        if status.is_energised and math.isfinite(status.current_magnitude_a):
            self._claimed = (status.samples_produced - 1, status.current_magnitude_a)

    def judge(self, block: SampleBlock) -> StopReason | None:
        """The first reason to distrust a sensor that this block and those before it give."""
        return self._against_the_drive(block) or self._against_the_axis(block)

    def _against_the_drive(self, block: SampleBlock) -> StopReason | None:
        if self._claimed is None:
            return None
        place = self._claimed[0] - block.first_index
        if place >= block.count:
            return None
        claimed, self._claimed = self._claimed[1], None
        if place < 0:
            return None
        phases = _phases([block])
        shown = peak(_three(phases)[:, place])
        noise_a = NOISES * float(np.max(self._zero.noise_a)) if self._zero else 0.0
        floor_a = (SCALE_FLOOR * self.current_limit_a + noise_a) * (1 if len(phases) == 3 else UNSEEN)
        if abs(shown - claimed) <= SCALE * max(shown, claimed) + floor_a:
            return None
        return _distrusted(
            "the current samples and the drive's own current magnitude differ", shown, f"{claimed:.4g} A"
        )

    def _against_the_axis(self, block: SampleBlock) -> StopReason | None:
        if self._zero is None:
            self._learn(block)
            return None
        self._window.append(block)
        if sum(part.count for part in self._window) * block.sample_period_s < WINDOW_S:
            return None
        seen, volts = _phases(self._window), np.concatenate([part.voltage_axis_v for part in self._window])
        self._window.clear()
        self._step_a = _smallest_step(seen, self._step_a)
        stopped = self._stopped(seen, volts, self._zero, volts.size * block.sample_period_s)
        return stopped or _misfit(seen, volts, self._zero, block.axis_deg, self._step_a)

    def _stopped(self, seen: Signal, voltage_v: Signal, zero: _Zero, seconds: float) -> StopReason | None:
        """A window in which no current flows any more, after others."""
        size_a = max(_rms(phase) for phase in seen - zero.offset_a[:, None])
        noise_a, volts_v = float(np.max(zero.noise_a)), _rms(voltage_v)
        square, windows = self._drove
        if size_a > FLOWED * noise_a + self._step_a:
            self._drove = square + volts_v**2, windows + 1
        if size_a > SIGMAS * noise_a + self._step_a or not windows:
            self._gone_s = 0.0
            return None
        drove_v = math.sqrt(square / windows)
        self._gone_s += seconds if volts_v >= AS_MUCH * drove_v else 0.0
        if self._gone_s < GONE_S:
            return None
        return StopReason(
            f"no current flows any more, although {volts_v:.3g} V are applied", size_a, f"a current, as {drove_v:.3g} V drove before",
            CABLE, unit="A",
        )  # fmt: skip

    def _learn(self, block: SampleBlock) -> None:
        """Offsets and noise, from the time before the first volt."""
        phases = _phases([block])
        at_rest = phases[:, np.cumsum(np.abs(block.voltage_axis_v)) == 0.0]
        self._at_rest.append(at_rest)
        seen = np.concatenate(self._at_rest, axis=1)
        is_over = at_rest.shape[1] < phases.shape[1]
        if seen.shape[1] > 1 and (is_over or seen.shape[1] * block.sample_period_s >= ZERO_S):
            self._zero = _Zero(seen.mean(axis=1), seen.std(axis=1))


def _smallest_step(seen: Signal, known_a: float) -> float:
    """The smallest difference between two values of a phase, or the one known before; 0 while none has moved."""
    steps = np.diff(np.sort(seen, axis=1), axis=1)
    least_a = float(np.min(steps, initial=known_a or math.inf, where=steps > 0.0))
    return least_a if least_a < math.inf else 0.0


def _misfit(seen: Signal, voltage_v: Signal, zero: _Zero, axis_deg: float, step_a: float = 0.0) -> StopReason | None:
    """Of one window, `(phases, n)` and `(n,)`: a phase that is open, one that stands still though it should move by `STEPS` at least, or the
    worst one's rms distance from the axis' pattern. A coarse converter shows one and the same number of an open phase, too."""
    cosines = np.array(phase_cosines(axis_deg))[: seen.shape[0]]
    current = seen - zero.offset_a[:, None]
    noise_a = SIGMAS * float(np.max(zero.noise_a))
    size_a, rest = _beside(current, cosines)
    allowed = MISFIT * size_a + noise_a + step_a
    is_off = float(np.max(rest)) > allowed
    if is_off and (opened := _opened(current, cosines, noise_a, step_a)) is not None:
        return opened
    top_v, moved_v = peak(voltage_v), float(np.ptp(voltage_v))
    moves = min(moved_v, top_v) * size_a * np.abs(cosines) > STEPS * step_a * top_v
    still = (np.ptp(seen, axis=1) == 0.0) & (np.abs(cosines) > LEAST_SHARE) & moves
    if still.any() and size_a > noise_a and moved_v > MOVES * top_v:
        names = " and ".join(name for name, is_still in zip(NAMES, still, strict=False) if is_still)
        return _distrusted(
            f"the current sensor of phase {names} stands still", 0.0, "a current that moves with the voltage"
        )
    if not is_off:
        return None
    return _distrusted(
        f"the current sensor of phase {_culprit(current, cosines)} does not follow the test axis",
        float(np.max(rest)), f"at most {allowed:.3g} A beside the axis", TURNING + CHECK,
    )  # fmt: skip


def _beside(current: Signal, cosines: Signal) -> tuple[float, Signal]:
    """Rms of what flows along the axis, and of what each phase shows beside it, `(phases,)`."""
    along = cosines @ current / float(cosines @ cosines)
    return _rms(along), np.sqrt(np.mean(np.square(current - np.outer(cosines, along)), axis=1))


def _opened(current: Signal, cosines: Signal, noise_a: float, step_a: float) -> StopReason | None:
    """A phase that is open in the whole window, or from somewhere in it on and follows the axis before: of a shaft that turns, whose currents
    pass each phase's zero, too, they do not."""
    rows, quiet_a = current.shape[1], QUIET / SIGMAS * noise_a + step_a
    part = max(rows // PARTS, 1)
    for count in range(rows, part - 1, -part):
        last = current[:, rows - count :]
        size_a, _ = _beside(last, cosines)
        phase = _open_phase(last, cosines, size_a, quiet_a)
        if phase is None:
            continue
        if (before := current[:, : max(rows - count - part, 0)]).size:
            along_a, rest = _beside(before, cosines)
            if float(np.max(rest)) > MISFIT * along_a + noise_a + step_a:
                return None
        return StopReason(
            f"phase {NAMES[phase]} carries no current, what flows goes through the other two: it is open", _rms(last[phase]),
            f"{abs(cosines[phase]) * size_a:.3g} A", CABLE, unit="A",
        )  # fmt: skip
    return None


def _open_phase(current: Signal, cosines: Signal, size_a: float, noise_a: float) -> int | None:
    """The phase that carries nothing although the axis asks it to, while the other two carry one current, there and back; a sensor that is
    silent leaves two that are no negatives of each other. Two sensors cannot tell: their sum is the third phase's."""
    if _rms(current.sum(axis=0)) > OPEN_SHARE * size_a + noise_a:
        return None
    phase = int(np.argmin([_rms(one) for one in current]))
    carries_a, asked_a = _rms(current[phase]), abs(float(cosines[phase])) * size_a
    is_open = carries_a <= OPEN_SHARE * size_a + noise_a < asked_a
    return phase if is_open else None


def _rms(signal: Signal) -> float:
    return math.sqrt(float(signal @ signal) / signal.size)


def _culprit(current: Signal, cosines: Signal) -> str:
    """The phase without which the others agree best; two sensors alone cannot accuse each other."""
    if len(cosines) < 3:
        return "u or v"
    left = []
    for phase in range(len(cosines)):
        c, i = np.delete(cosines, phase), np.delete(current, phase, axis=0)
        along = c @ i / float(c @ c)
        left.append(float(np.mean(np.square(i - np.outer(c, along)))))
    return " or ".join(NAMES[k] for k, rest in enumerate(left) if rest <= 1.5 * min(left))


def _distrusted(what: str, value: float, limit: str, remedy: str = CHECK) -> StopReason:
    return StopReason(what, value, limit, remedy, is_fault=True, unit="A")


def _phases(blocks: Sequence[SampleBlock]) -> Signal:
    """`(2 or 3, n)`: the sensors there are, of blocks one after the other."""
    w = [block.current_w_a for block in blocks if block.current_w_a is not None]
    phases = [[block.current_u_a for block in blocks], [block.current_v_a for block in blocks], *([w] if w else [])]
    return np.stack([np.concatenate(parts) for parts in phases])


def _three(phases: Signal) -> Signal:
    return phases if phases.shape[0] == 3 else np.vstack([phases, -phases.sum(axis=0)])
