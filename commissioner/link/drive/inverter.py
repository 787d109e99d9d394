"""A drive behind a port: who it is, how it is, set up, energise, steer, fetch, de-energise.

One owner, no threads: the loop that fetches samples is the loop that feeds the drive's watchdog. Whoever holds an
`Inverter` keeps the only `finally` that calls `disarm`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping, Sequence

from commissioner.errors import (
    CheckFailed,
    DriveFault,
    ForeignMaster,
    ReplyMismatch,
    ReplyTimeout,
    RequestRefused,
    UsageError,
)
from commissioner.link.drive.claim import Claim
from commissioner.link.drive.disarming import DISABLE_VOLTAGE, SHUTDOWN, de_energise
from commissioner.link.drive.facts import Action, DisarmReport, Intent, Journal, WriteReport, keep_no_journal
from commissioner.link.drive.items import Items, number
from commissioner.link.drive.ordinary.found import Implausible, implausible
from commissioner.link.drive.ordinary.tuning import Operator, Tuner
from commissioner.link.drive.readiness import check_ready, not_ready
from commissioner.link.drive.reading import read_identity, read_nameplate, read_others, read_status
from commissioner.link.drive.write_back import WriteBack
from commissioner.link.wire.port import Port
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate
from commissioner.records import DriveIdentity, DriveStatus, ParameterSnapshot
from commissioner.registers.codec import Value
from commissioner.registers.convention import as_in_drive, drive_values, parameter_limits
from commissioner.registers.profile import DriveProfile, Watchdog, WindowLayout
from commissioner.registers.status import DriveState
from commissioner.registers.tuning import Tuning
from commissioner.registers.window import (
    StreamCursor,
    StreamFormat,
    Window,
    WindowRefusal,
    channel_mask,
    decode_window,
    encode_request,
)

SWITCH_ON, ENABLE, RESET_FAULT = 0x07, 0x0F, 0x80
SINGLE_AXIS_TEST = 1
STATE_DEADLINE_S = 1.0
POLL_S = 0.002
FETCH_ATTEMPTS = 2
AT_REST = 3.0
"""Times for a reply within which a drive that is not energised is asked again. Of 40 snapshots over a serial line that damaged 5 % of the
answers, each of them proved by two more, two attempts a read lost 8; these lose none, nor at 10 %."""


class Inverter:
    """The drive. Every method ends within the port's deadlines; a drive that does not obey is a DriveFault."""

    def __init__(
        self,
        port: Port,
        profile: DriveProfile,
        journal: Journal = keep_no_journal,
        *,
        sleep: Callable[[float], None] = time.sleep,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.port = port
        self.profile = profile
        self.journal = journal
        self._items = Items(port, profile, sleep, clock)
        self.claim = Claim(self._items)
        self.sleep, self.now_s = sleep, clock
        """Whoever waits for this drive, or asks how old its samples are, asks here: a drive in motor time has a clock of its own."""
        self._heartbeat = 0
        self._watchdog_ms = 0.0
        self._supervision: dict[str, Value] = {}
        self._signal: dict[str, Value] = {}
        self._read_retries = port.read_retries
        self._repeat_reads()

    # --- who and how -------------------------------------------------------------------------------------------
    def identify(self) -> DriveIdentity:
        """Who answers. IdentityMismatch: not the drive, map or firmware of the drive file."""
        return read_identity(self._items)

    def read_status(self) -> DriveStatus:
        """The drive's state now. What the drive file does not describe is NaN, 0 or empty.

        ForeignMaster: the drive was set up by us and is not as we left it.
        """
        status = read_status(self._items)
        self._items.watched.judge(status.settings_count, self._items.read)
        return status

    def read_nameplate(self) -> dict[str, float]:
        """The nameplate the drive holds, by the contract's keys; what its file does not describe is left out."""
        return read_nameplate(self._items)

    def read_others(self) -> dict[str, Value | RequestRefused]:
        """What the drive file describes and nothing else asks for; for an item that the drive refuses its refusal."""
        return read_others(self._items)

    def snapshot(self) -> ParameterSnapshot:
        """The motor parameters in use and stored, with the identity of the drive that holds them."""
        found = self._write_back().snapshot()
        stored = {f"stored_{name}": value for name, value in found.stored.items()}
        staged = self._items.read([f"staged_{name}" for name in found.in_use])
        self._items.watched.found({**found.in_use, **stored, **staged})
        return found

    # --- set up -------------------------------------------------------------------------------------------------
    def set_watchdog(self, time_ms: float) -> None:
        """Arm the drive's own supervision. CheckFailed: the drive cannot; DriveFault: it says so and does not."""
        watchdog = self.profile.watchdog
        if watchdog is None:
            raise self._no_watchdog(self.profile.unknown.get("watchdog", "the drive file describes none"), time_ms)
        if not watchdog.min_ms <= time_ms <= watchdog.max_ms:
            raise self._no_watchdog(f"{watchdog.min_ms:g} ... {watchdog.max_ms:g} ms", time_ms)
        values: dict[str, Value] = {watchdog.register: time_ms / self._unit_ms(watchdog)}
        self.journal(Intent(Action.PREPARE, values))
        try:
            self._items.write_verified(values, "arm the watchdog")
        except RequestRefused as refused:
            raise self._no_watchdog(refused.what, time_ms) from refused
        self._watchdog_ms = time_ms
        self._supervision |= values
        self._items.watched.is_armed = True

    def set_limits(self, *, current_a: float, voltage_v: float, time_s: float) -> None:
        """Limits the drive enforces by itself: peak phase current (trips), axis voltage (clamps), energised time."""
        values: dict[str, Value] = {
            "current_limit_a": current_a,
            "test_time_limit_s": time_s,
            "voltage_limit_v": voltage_v,
        }
        self._prepare(values, "set the drive's limits")
        self._supervision |= values

    def load_excitation(
        self,
        *,
        axis_deg: float,
        tones: Sequence[tuple[float, float, float]],
        bias_v: float,
        bias_ramp_v_per_s: float,
        scale: float,
        scale_ramp_per_s: float,
        duration_s: float,
        channels: Sequence[str] = ("voltage_axis_v", "current_u_a", "current_v_a"),
        decimation: int = 1,
    ) -> None:
        """The test signal of the next enable; tones are (amplitude_v, frequency_hz, phase_rad). Read back."""
        self.profile.require("excite")
        _check_scale(scale)
        self._signal = {
            "axis_deg": axis_deg,
            "dc_bias_v": bias_v,
            "bias_ramp_v_per_s": bias_ramp_v_per_s,
            "amplitude_scale": scale,
            "scale_ramp_per_s": scale_ramp_per_s,
            "duration_s": duration_s,
            "tone_count": len(tones),
            "tones": tuple(float(part) for tone in tones for part in tone),
            "channel_mask": channel_mask(channels),
            "decimation": decimation,
        }
        self.journal(Intent(Action.PREPARE, self._signal))
        self._items.write_verified(self._signal, "load the excitation")

    def reset_fault(self) -> DriveStatus:
        """A fault reset edge; the status after it, which says whether the fault is gone."""
        self.journal(Intent(Action.PREPARE, {"control_word": RESET_FAULT}))
        self._items.write({"control_word": DISABLE_VOLTAGE})
        self._items.write({"control_word": RESET_FAULT})
        self._items.write({"control_word": DISABLE_VOLTAGE})
        return self.read_status()

    # --- energised ----------------------------------------------------------------------------------------------
    def enable(self) -> StreamCursor:
        """Energise the loaded excitation through the CiA 402 states; the cursor at the first sample of its session.

        CheckFailed: a condition does not hold and nothing was energised. DriveFault: the drive does not follow.
        """
        self.profile.require("excite")
        self._check_set_up()
        self._keep_claim()
        self.read_status()  # where somebody else changed a setting, that is the reason, not what it would lead to
        before = check_ready(self._items, self._supervision, self._watchdog_ms / 1000)
        self._prepare({"mode": SINGLE_AXIS_TEST}, "choose the single-axis test")
        stream = self._stream_format()
        self.port.read_retries, self.port.patience_s = 0, 0.0
        self._go(SHUTDOWN, DriveState.READY_TO_SWITCH_ON)
        self._go(SWITCH_ON, DriveState.SWITCHED_ON)
        self.journal(self.energising())
        self._go(ENABLE, DriveState.OPERATION_ENABLED)
        session = int(self._items.read_number("session_id"))
        if session == before.session:
            raise DriveFault(
                "the drive enabled without opening a session",
                step="enable",
                value=session,
                limit="a session number that differs from the one before",
                remedy="check the drive's firmware",
            )
        self.beat()  # over a slow link the requests since the start have used up most of the watchdog's time
        return StreamCursor(stream(session))

    def energising(self) -> Intent:
        """What `enable` announces: all of the signal that is loaded."""
        return Intent(Action.ENERGISE, {"control_word": ENABLE, **self._signal})

    def fetch(self, cursor: StreamCursor, most: int | None = None) -> Window:
        """The next samples, `most` of them where that is given, and the watchdog fed, in one transaction. `block` is None where none is ready yet.

        Asked again, once, with a new heartbeat, where the answer was lost or was not its own: the window is
        idempotent. Raises ReplyTimeout or ReplyMismatch after that.
        """
        failure: ReplyTimeout | ReplyMismatch
        for _ in range(FETCH_ATTEMPTS):
            try:
                return self._fetch_once(cursor, most)
            except (ReplyTimeout, ReplyMismatch) as error:
                failure = error
        raise failure

    def beat(self) -> int:
        """Feed the watchdog without fetching; the echo the drive gave back."""
        self._heartbeat = (self._heartbeat + 1) & 0xFFFF
        heartbeat, echo = self.profile.item("heartbeat"), self.profile.item("heartbeat_echo")
        return self.port.exchange(heartbeat.address, [self._heartbeat], echo.address, 1)[0]

    def set_scale(self, scale: float) -> None:
        """Steer the amplitude scale (0 ... 1); the drive ramps to it. Read back in the same transaction."""
        _check_scale(scale)
        self._steer({"amplitude_scale": scale})

    def set_bias(self, bias_v: float) -> None:
        """Steer the DC bias in volts along the axis; the drive ramps to it. Read back in the same transaction."""
        self._steer({"dc_bias_v": bias_v})

    def disarm(self) -> DisarmReport:
        """De-energise by every path until the drive's status confirms it, else by its watchdog. Never raises a
        CommissionerError; idempotent; legal in every state."""
        report = de_energise(self._items, self._watchdog_ms / 1000, self.sleep)
        if report.is_confirmed:
            self._repeat_reads()
        return report

    def _repeat_reads(self) -> None:
        """As often as a drive at rest may be asked."""
        self.port.read_retries, self.port.patience_s = self._read_retries, AT_REST * self.port.reply_timeout_s

    def implausible(self, held: Mapping[str, float], nameplate: Nameplate) -> list[Implausible]:
        """What of `held` no motor near this plate has. A commissioning map has proved its registers by its magic number."""
        if self.profile.kind == "commissioning_map":
            return []
        return implausible(self._items, held, parameter_limits(self.profile, nameplate))

    # --- parameters ---------------------------------------------------------------------------------------------
    def write_parameters(
        self, values: Mapping[str, float], snapshot: ParameterSnapshot, *, store: bool = True
    ) -> WriteReport:
        """Stage, verify, commit, verify, store, verify; only what differs. `values` by the drive file's names.

        IdentityMismatch: the drive or its present values are not the snapshot's, nothing was written.
        WriteBackFailed: says whether the snapshot was restored.
        """
        self.profile.require("write_back")
        self._keep_claim()
        return self._write_back().write(values, snapshot, store=store)

    def write_circuit(
        self, circuit: InverseGamma, nameplate: Nameplate, snapshot: ParameterSnapshot, *, store: bool = True
    ) -> WriteReport:
        """As `write_parameters`: every parameter the drive file knows, in the drive's own circuit, form and unit."""
        doubtful = self.implausible(snapshot.in_use, nameplate)
        if doubtful:
            raise doubtful[0].as_error()
        written = drive_values(self.profile, circuit, as_in_drive(nameplate, snapshot.plate))
        return self.write_parameters(written.values, snapshot, store=store)

    def keep_tuned(self, values: Mapping[str, float], snapshot: ParameterSnapshot) -> WriteReport:
        """A set that this drive found by its own tuning, in its own terms, in use and stored: no unit needs to be known."""
        self.profile.require("restore")
        return self._write_back().write(values, snapshot, store=True, always=True)

    def tuner(self, tuning: Tuning, operator: Operator) -> Tuner:
        """By which the drive tunes itself."""
        return Tuner(self._items, tuning, operator, self.journal, sleep=self.sleep, clock=self.now_s)

    def read_watchdog_ms(self) -> float:
        """What the drive's own supervision of the link is set to."""
        watchdog = self.profile.watchdog
        assert watchdog is not None
        return self._unit_ms(watchdog) * self._items.read_number(watchdog.register)

    def read_kept_samples(self) -> int:
        """How many samples its memory keeps of a session; 0 where its file has no register for it."""
        return int(self._items.read_number("ring_capacity")) if "ring_capacity" in self.profile.items else 0

    def restore(
        self,
        snapshot: ParameterSnapshot,
        expected_present: Mapping[str, float] | None = None,
        again: Collection[str] = (),
    ) -> WriteReport:
        """The snapshot's values in use and stored again. Refused where the drive does not hold `expected_present`. `again`: parameters
        that are written whatever the drive shows, for something else was just written there."""
        self.profile.require("restore")
        return self._write_back().restore(snapshot, expected_present, again)

    def _write_back(self) -> WriteBack:
        return WriteBack(self._items, self.journal, sleep=self.sleep, clock=self.now_s)

    # --- steps --------------------------------------------------------------------------------------------------
    def _keep_claim(self) -> None:
        """ForeignMaster: the drive has become somebody else's."""
        if self.claim.renew():
            return
        held = self.claim.holder()
        raise ForeignMaster(
            "another master took the drive: it no longer holds our claim",
            step="keep the drive",
            value="nobody's" if held is None else held.name or "a master without a name",
            limit="our claim until the run has ended",
            remedy="disconnect the other master, then start again",
        )

    def _prepare(self, values: Mapping[str, Value], step: str) -> None:
        self.journal(Intent(Action.PREPARE, values))
        self._items.write_verified(values, step)

    def _steer(self, values: dict[str, Value]) -> None:
        self.journal(Intent(Action.STEER, values))
        self._items.exchange_verified(values, "steer the excitation")

    def _check_set_up(self) -> None:
        if not (self._watchdog_ms and self._signal and "current_limit_a" in self._supervision):
            raise not_ready("the drive was not set up", None, "watchdog, limits and excitation set", "set them first")

    def _stream_format(self) -> Callable[[int], StreamFormat]:
        scales = self._items.read(["control_period_s", "voltage_scale_v", "current_scale_a", "dc_link_scale_v"])
        decimation, mask = int(number(self._signal["decimation"])), int(number(self._signal["channel_mask"]))
        return lambda session: StreamFormat(
            layout=self._window(),
            session=session,
            axis_deg=number(self._signal["axis_deg"]),
            channel_mask=mask,
            sample_period_s=number(scales["control_period_s"]) * decimation,
            voltage_scale_v=number(scales["voltage_scale_v"]),
            current_scale_a=number(scales["current_scale_a"]),
            dc_link_scale_v=number(scales["dc_link_scale_v"]),
            averaged=decimation,
        )

    def _go(self, command: int, wanted: DriveState) -> None:
        """Give the command and watch the status, feeding the watchdog, until the state is there."""
        self._items.write({"control_word": command})
        end = self.now_s() + STATE_DEADLINE_S
        while True:
            self.beat()
            status = self.read_status()
            if status.state == wanted.value:
                return
            if status.state == DriveState.FAULT.value:
                raise DriveFault(
                    f"the drive tripped: {status.trip_text}",
                    step="enable",
                    value=status.trip_value,
                    limit=status.trip_limit,
                    unit=status.trip_unit,
                    remedy=f"remove the cause of: {status.fault_text}",
                )
            if self.now_s() > end:
                raise DriveFault(
                    f"the drive does not reach '{wanted.value}'",
                    step="enable",
                    value=status.state,
                    limit=f"within {STATE_DEADLINE_S:g} s",
                    remedy="check enable inputs and remote control",
                )
            self.sleep(POLL_S)

    def _fetch_once(self, cursor: StreamCursor, most: int | None) -> Window:
        self._heartbeat = (self._heartbeat + 1) & 0xFFFF
        layout = cursor.stream.layout
        request = encode_request(self._heartbeat, cursor.next_index)
        address = self.profile.items["heartbeat"].address
        asked = layout.words if most is None else cursor.stream.registers_for(most)
        words = self.port.exchange(address, request, layout.address, asked, proves_itself=True)
        decoded = decode_window(words, cursor, asked)
        if isinstance(decoded, WindowRefusal):
            self.port.doubt()
            raise ReplyMismatch(
                decoded.reason.value,
                step="fetch samples",
                value=decoded.seen,
                limit=decoded.expected,
                remedy="check the link; a drive that restarted must be commissioned again",
            )
        return decoded

    def _window(self) -> WindowLayout:
        self.profile.require("stream")
        assert self.profile.window is not None
        return self.profile.window

    def _unit_ms(self, watchdog: Watchdog) -> float:
        """Milliseconds in the unit of its register."""
        return 1000.0 if self.profile.item(watchdog.register).unit == "s" else 1.0

    def _no_watchdog(self, limit: str, time_ms: float) -> CheckFailed:
        return CheckFailed(
            "the drive's watchdog cannot be set",
            step="arm the watchdog",
            value=time_ms,
            limit=limit,
            remedy="nothing is energised without it; choose a time the drive allows or another drive",
        )


def _check_scale(scale: float) -> None:
    if not 0.0 <= scale <= 1.0:
        raise UsageError(
            "the amplitude scale is not a fraction",
            step="steer the excitation",
            value=scale,
            limit="0 ... 1",
            remedy="ask for a scale between 0 and 1",
        )
