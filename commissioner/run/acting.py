"""The commands that set a drive up and steer it, as calls of the inverter: carried out by the runner, announced by `replay`."""

from __future__ import annotations

from collections.abc import Sequence

from commissioner.link.drive.facts import Intent
from commissioner.link.drive.inverter import Inverter
from commissioner.link.wire.port import LinkStats, Words
from commissioner.registers.profile import DriveProfile
from commissioner.safety import commands as ask

SETTINGS = (ask.ArmWatchdog, ask.SetDriveLimits, ask.LoadExcitation, ask.SetScale, ask.SetBias)


def set_up(inverter: Inverter, command: ask.Command) -> None:
    """Carry out one of SETTINGS."""
    match command:
        case ask.SetScale(scale=scale):
            inverter.set_scale(scale)
        case ask.SetBias(bias_v=bias):
            inverter.set_bias(bias)
        case ask.ArmWatchdog(timeout_s=timeout):
            inverter.set_watchdog(1000 * timeout)
        case ask.SetDriveLimits(current_a=current, voltage_v=voltage, time_s=limit):
            inverter.set_limits(current_a=current, voltage_v=voltage, time_s=limit)
        case ask.LoadExcitation():
            inverter.load_excitation(
                axis_deg=command.axis_deg,
                tones=command.tones,
                bias_v=0.0,
                bias_ramp_v_per_s=command.bias_ramp_v_per_s,
                scale=0.0,
                scale_ramp_per_s=command.scale_ramp_per_s,
                duration_s=command.duration_s,
                channels=command.channels,
                decimation=command.averaged,
            )
        case _:
            raise TypeError(f"no such command: {command!r}")


class Announcer:
    """What a run announces before it carries a command out, without a drive: a memory takes what would be written."""

    def __init__(self, profile: DriveProfile) -> None:
        self._intents: list[Intent] = []
        self._inverter = Inverter(_Memory(), profile, self._intents.append)

    def announced(self, command: ask.Command) -> list[Intent]:
        """The intents of one of SETTINGS, and of Enable the one that energises; of others none."""
        self._intents.clear()
        if isinstance(command, SETTINGS):
            set_up(self._inverter, command)
        return [self._inverter.energising()] if isinstance(command, ask.Enable) else list(self._intents)


class _Memory:
    """A port on registers that hold what was written."""

    read_retries = 0
    patience_s = 0.0
    reply_timeout_s = 0.0

    def __init__(self) -> None:
        self.stats = LinkStats()
        self._words: dict[int, int] = {}

    def read(self, address: int, count: int) -> Words:
        return tuple(self._words.get(address + k, 0) for k in range(count))

    def write(self, address: int, values: Sequence[int]) -> None:
        self._words |= {address + k: value for k, value in enumerate(values)}

    def exchange(
        self, write_address: int, values: Sequence[int], read_address: int, count: int, *, proves_itself: bool = False
    ) -> Words:
        self.write(write_address, values)
        return self.read(read_address, count)

    def write_coil(self, address: int, value: bool) -> None:
        pass

    def read_coil(self, address: int) -> bool:
        return False

    def doubt(self) -> None:
        pass

    def close(self) -> None:
        pass
