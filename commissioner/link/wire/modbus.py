"""The port over pymodbus 3.15: every reply checked, every exception mapped, no write repeated that may have arrived.

A request on a closed connection opens it, once, within `connect_timeout_s`: there is no back-off and no reconnection
behind the caller's back. What may be believed is decided in `link.wire.trust`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import NoReturn, TypeVar

from pymodbus.exceptions import ConnectionException, ModbusException, ModbusIOException
from pymodbus.pdu import ModbusPDU

from commissioner.errors import CommissionerError, ReplyMismatch, ReplyTimeout, RequestRefused
from commissioner.link.wire.clients import SerialClient, make_client
from commissioner.link.wire.debts import Shape
from commissioner.link.wire.port import MAY_BE_CARRIED_OUT, LinkStats, Words, ask_again
from commissioner.link.wire.trust import ConnectionTrust, SerialTrust, Trust, longest_frames_s
from commissioner.link.wire.unopened import unopened
from commissioner.link.wire.url import DriveUrl, RtuUrl
from commissioner.registers.profile import DriveProfile
from commissioner.text import counted

READ_COIL, READ, WRITE_COIL, WRITE_ONE, WRITE, EXCHANGE = 0x01, 0x03, 0x05, 0x06, 0x10, 0x17
COIL_ON = 0xFF00
ILLEGAL_FUNCTION = 1

EXCEPTION_MEANINGS = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "device failure",
    5: "acknowledged, still at work",
    6: "device busy",
    7: "negative acknowledge: it cannot carry this out",
    8: "memory parity error",
    10: "gateway path unavailable",
    11: "gateway target did not answer",
}
"""MODBUS Application Protocol Specification V1.1b3, section 7; 7: Modicon's PI-MBUS-300 reference guide, appendix A."""
HOST_STOPPED = 2.0
"""A request is given up after the time for a reply: where one took so many times as long, it was this host that stood still."""
NOT_CARRIED_OUT = frozenset({6, 10})
"""Busy, or no way to the device: asked again, whatever it was, until the time for a reply is over."""
BUSY_PAUSE_S = 0.01
_GATEWAY = (
    "the gateway answers and the drive behind it does not: check that device={device} is the drive's number, the gateway's "
    "table, its baud rate and parity, and the drive's supply"
)
_OTHER_FILE = (
    "the drive does not know these registers of the drive file: see that the file is this drive's, else name its own by "
    "--profile (`commissioner drives list`)"
)
READ_REMEDIES = dict.fromkeys((1, 2, 3), _OTHER_FILE)
"""A drive that will not read what its file describes is another one."""
PROVEN = 20
"""Answers from which on device number and line settings are known to be right: a line that lost one byte in a thousand was told to look at
its baud rate and parity after 400 good answers."""
DISTURBED = (
    "answers came whole before, so that the settings are right and the line is disturbed: see its shield, earth and terminators, and that it "
    "keeps off motor cables; a lower baud rate helps"
)
SILENT = "answers came before, so that the settings are right: check the drive's supply, the cable and its plugs"
READING = frozenset({3, 4})
"""Function codes that read registers."""
REMEDIES = {
    2: "it has no such register, or none that can be written: see that the drive file is this drive's, model and firmware",
    3: "it takes no such value there: see the register's range in the manual, and address, width and scale in the drive file",
    4: "it does not do this in its present state: see on its display whether it is stopped, unlocked and under bus control",
    5: "it stays at work longer than an answer may take: let its job end, then start again",
    6: "it stays busy: let what occupies it end, or disconnect the other master, then start again",
    10: _GATEWAY,
    11: _GATEWAY,
}

Result = TypeVar("Result")


class ModbusPort:
    """A `Port` on a pymodbus client."""

    def __init__(
        self,
        url: DriveUrl,
        profile: DriveProfile,
        *,
        reply_timeout_s: float,
        connect_timeout_s: float,
        sleep: Callable[[float], None] = time.sleep,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.stats = LinkStats()
        self.read_retries = 1
        self.patience_s = 0.0
        self.reply_timeout_s = reply_timeout_s
        self._connect_timeout_s = connect_timeout_s
        self._url, self._profile = url, profile
        self._exceptions = EXCEPTION_MEANINGS | dict(profile.exceptions)
        self._own = frozenset(profile.exceptions)
        """Exceptions that mean what the drive file says: none is waited for because the protocol means busy by its number."""
        self._waited_for = NOT_CARRIED_OUT - self._own | frozenset(profile.link.busy_exceptions)
        self._waited_for_twice = self._waited_for | MAY_BE_CARRIED_OUT - self._own
        """Of what does no harm twice."""
        self._device = profile.link.device_id if url.device is None else url.device
        self._client = make_client(url, self._device)
        self._has_exchange = profile.link.has_read_write_multiple
        self._token = time.time_ns() & 0xFFFF
        self._sleep, self._clock = sleep, clock
        self._answered_s = clock()
        self._trust = self._make_trust()

    @property
    def bit_s(self) -> float | None:
        """Seconds a bit takes on a serial line; None of other wires."""
        return 1.0 / self._url.baud if isinstance(self._url, RtuUrl) else None

    # --- the port -------------------------------------------------------------------------------------------------
    def read(self, address: int, count: int) -> Words:
        return ask_again(
            lambda: self._trusted(lambda: self._ask_apart(address, count), repeats=True),
            self.read_retries, self.patience_s, self._clock,
        )  # fmt: skip

    def write_register(self, address: int, values: Sequence[int]) -> None:
        """One register by function 6, whatever the drive file says."""
        self._trusted(lambda: self._ask_write_one(address, values[0]))

    def write_registers(self, address: int, values: Sequence[int]) -> None:
        """By function 16, whatever the drive file says."""
        self._trusted(lambda: self._ask_write(address, list(values)))

    def write(self, address: int, values: Sequence[int]) -> None:
        if len(values) == 1 and WRITE_ONE in self._profile.link.write_functions:
            self._trusted(lambda: self._ask_write_one(address, values[0]))
        else:
            self._trusted(lambda: self._ask_write(address, list(values)))
        if self._profile.link.write_pause_s:
            self._sleep(self._profile.link.write_pause_s)

    def exchange(
        self, write_address: int, values: Sequence[int], read_address: int, count: int, *, proves_itself: bool = False
    ) -> Words:
        if self._has_exchange:
            try:
                return self._trusted(
                    lambda: self._ask_exchange(write_address, list(values), read_address, count),
                    not proves_itself,
                    repeats=True,
                )
            except RequestRefused as refused:
                if refused.value != ILLEGAL_FUNCTION:
                    raise
                self._has_exchange = False
        self.write(write_address, values)
        return self._trusted(lambda: self._ask_apart(read_address, count), not proves_itself, repeats=True)

    def write_coil(self, address: int, value: bool) -> None:
        self._trusted(lambda: self._ask_write_coil(address, value))

    def read_coil(self, address: int) -> bool:
        return self._trusted(lambda: self._ask_read_coil(address))

    def doubt(self) -> None:
        self._trust.doubt_content()

    def close(self) -> None:
        with suppress(Exception):  # closing what is gone may fail
            self._client.close()  # type: ignore[no-untyped-call]

    def connect(self) -> None:
        """Open the wire. Raises LinkUnreachable with the reason."""
        self._client.comm_params.timeout_connect = self._connect_timeout_s
        try:
            self._client.connect()
        except Exception as error:  # pyserial lets termios errors through
            raise unopened(self._url, error, f"a connection within {self._connect_timeout_s:g} s") from error
        self.stats.connections += 1

    # --- one request each -------------------------------------------------------------------------------------------
    def _ask_read(self, address: int, count: int) -> Words:
        what = f"read {counted(count, 'register')} at {address}"
        reply = self._transact(
            (READ, 2 * count),
            what,
            lambda: self._client.read_holding_registers(address, count=count, device_id=self._device),
        )
        return self._words(reply, count, what)

    def _ask_apart(self, address: int, count: int) -> Words:
        """As `_ask_read`; by the other function, with a token to write, where an answer of the same shape is owed: even
        alone and with the line in step that one could stand in our answer's place while ours is late itself."""
        echo = self._profile.items.get("echo")
        if echo is None or not self._has_exchange or not self._trust.is_owed((READ, 2 * count)):
            return self._ask_read(address, count)
        if self._trust.is_owed((EXCHANGE, 2 * count)):
            return self._ask_read(address, count)
        try:
            return self._ask_exchange(echo.address, [self._next_token()], address, count)
        except RequestRefused as refused:
            if refused.value != ILLEGAL_FUNCTION:
                raise
            self._has_exchange = False
        return self._ask_read(address, count)

    def _ask_write(self, address: int, values: list[int]) -> None:
        what = f"write {counted(len(values), 'register')} at {address}"
        reply = self._transact(
            (WRITE, address, len(values)),
            what,
            lambda: self._client.write_registers(address, values, device_id=self._device),
        )
        self._expect(what, (reply.address, reply.count), (address, len(values)))

    def _ask_write_one(self, address: int, value: int) -> None:
        what = f"write register {address}"
        reply = self._transact(
            (WRITE_ONE, address, value),
            what,
            lambda: self._client.write_register(address, value, device_id=self._device),
        )
        self._expect(what, (reply.address, tuple(reply.registers)), (address, (value,)))

    def _ask_write_coil(self, address: int, value: bool) -> None:
        what = f"write coil {address}"
        reply = self._transact(
            (WRITE_COIL, address, COIL_ON * value),
            what,
            lambda: self._client.write_coil(address, value, device_id=self._device),
        )
        self._expect(what, (reply.address, reply.bits[:1]), (address, [value]))

    def _ask_read_coil(self, address: int) -> bool:
        what = f"read coil {address}"
        reply = self._transact(
            (READ_COIL, address), what, lambda: self._client.read_coils(address, count=1, device_id=self._device)
        )
        self._expect(what, len(reply.bits) > 0, True)
        return bool(reply.bits[0])

    def _ask_exchange(self, write_address: int, values: list[int], read_address: int, count: int) -> Words:
        what = f"write {counted(len(values), 'register')} at {write_address} and read {count} at {read_address}"
        reply = self._transact(
            (EXCHANGE, 2 * count),
            what,
            lambda: self._client.readwrite_registers(
                read_address=read_address,
                read_count=count,
                write_address=write_address,
                values=values,
                device_id=self._device,
            ),
        )
        return self._words(reply, count, what)

    # --- trust --------------------------------------------------------------------------------------------------------
    def _trusted(self, ask: Callable[[], Result], needs_proof: bool = True, *, repeats: bool = False) -> Result:
        """`repeats`: it does no harm twice, so that it is asked again where it may have been carried out, too."""
        waited_for = self._waited_for_twice if repeats else self._waited_for
        end = self._clock() + self.reply_timeout_s
        while True:
            if not self._client.connected:
                self.connect()
            self._checked("bring the line into step", self._trust.ready)
            try:
                answer = ask()
                break
            except RequestRefused as refused:  # an old refusal may come late like any other answer
                self._checked("prove the refusal", self._trust.confirm)
                if refused.value not in waited_for or self._clock() + BUSY_PAUSE_S > end:
                    raise
            self.stats.waits += 1
            self._sleep(BUSY_PAUSE_S)
        if needs_proof:
            self._checked("prove the answer", self._trust.confirm)
        return answer

    def _checked(self, what: str, check: Callable[[], None]) -> None:
        """Draining touches the wire as well: an adapter pulled out in the middle of it is a broken connection."""
        try:
            check()
        except CommissionerError:
            raise
        except Exception as error:
            self._broke(what, error)

    def _make_trust(self) -> Trust:
        if not isinstance(self._client, SerialClient):
            return ConnectionTrust(self._client)
        assert isinstance(self._url, RtuUrl)
        return SerialTrust(
            self._client,
            self._url,
            turnaround_s=self._profile.link.turnaround_s,
            prove=self._prove,
            busy=self._waited_for_twice,
            busy_s=self.reply_timeout_s,
            stats=self.stats,
            sleep=self._sleep,
            clock=self._clock,
        )

    def _prove(self) -> None:
        """A fresh token through the echo register; without one, reads of different length. Raises LinkError."""
        echo = self._profile.items.get("echo")
        if echo is not None:
            token = self._next_token()
            self._ask_write_one(echo.address, token)
            self._expect("read the echo register", self._ask_read(echo.address, 1), (token,))
            return
        readable = (i for i in self._profile.items.values() if "r" in i.access and i.parameter is None)
        by_words = {item.words: item for item in readable}
        for item in by_words.values():
            self._ask_read(item.address, item.words)

    def _next_token(self) -> int:
        self._token = (self._token * 25173 + 13849) & 0xFFFF
        return self._token

    # --- one transaction ----------------------------------------------------------------------------------------------
    def _transact(self, shape: Shape, what: str, send: Callable[[], ModbusPDU]) -> ModbusPDU:
        """`shape`: by which the answer would be taken for another's, `link.wire.debts`; the function comes first."""
        self._trust.asked(shape)
        self._client.comm_params.timeout_connect = self.reply_timeout_s
        self.stats.requests += 1
        start = self._clock()
        gap_s = start - self._answered_s
        self.stats.longest_gap_s = max(self.stats.longest_gap_s, gap_s)
        try:
            reply = send()
        except ModbusException as error:
            self._failed(what, error)
        except Exception as error:  # sockets, pyserial and termios have no common base
            self._broke(what, error)
        except BaseException:
            self._trust.doubt()
            raise
        finally:
            self._answered_s = self._clock()
            took_s = self._answered_s - start
            self.stats.turns_s.append((gap_s, took_s))
            if took_s > HOST_STOPPED * self.reply_timeout_s:
                self.stats.longest_gap_s = max(self.stats.longest_gap_s, took_s)
        if took_s <= HOST_STOPPED * self.reply_timeout_s:
            self.stats.latencies_s.append(took_s)
        self._expect(what, (reply.dev_id, reply.function_code & 0x7F), (self._device, shape[0]))
        if reply.isError():
            self._refused(what, reply.exception_code, is_read=shape[0] in READING)
        return reply

    def _words(self, reply: ModbusPDU, count: int, what: str) -> Words:
        self._expect(what, counted(len(reply.registers), "register"), counted(count, "register"))
        return tuple(reply.registers)

    def _expect(self, what: str, seen: object, wanted: object) -> None:
        if seen == wanted:
            return
        self.stats.mismatches += 1
        self._trust.doubt()
        raise ReplyMismatch(
            f"the answer to '{what}' is not its answer",
            step=what,
            value=seen,
            limit=wanted,
            remedy="an answer to another request or a damaged one; check cable, device number and other masters",
        )

    def _failed(self, what: str, error: ModbusException) -> NoReturn:
        if isinstance(error, ConnectionException):
            self._broke(what, error)
        if isinstance(error, ModbusIOException) and "No response received" in str(error):
            self._timed_out(what, self._heard(), error)
        self.stats.mismatches += 1
        self._trust.doubt()
        raise ReplyMismatch(
            f"the answer to '{what}' cannot be read",
            step=what,
            value=str(error),
            limit="a Modbus answer",
            remedy="check cable, baud rate and that the device speaks Modbus",
        ) from error

    def _broke(self, what: str, error: Exception) -> NoReturn:
        with suppress(Exception):  # closing what is gone may fail as well
            self._client.close()  # type: ignore[no-untyped-call]
        self._client.socket = None
        self._timed_out(what, f"the connection broke: {error}", error)

    def _timed_out(self, what: str, value: str, error: Exception) -> NoReturn:
        self.stats.timeouts += 1
        self._trust.doubt()
        raise ReplyTimeout(
            f"no answer to '{what}'",
            step=what,
            value=value,
            limit=f"an answer of device {self._device} within {self.reply_timeout_s:g} s",
            remedy=self._remedy(),
        ) from error

    def _heard(self) -> str:
        """What came in an answer's place."""
        other = self._client.other_device()
        if other is not None:
            return f"an answer of device {other}"
        part = self._client.part()
        if part:
            return f"{part} in {self.reply_timeout_s:g} s"
        if self._client.received:
            return f"{len(self._client.received)} bytes that are no Modbus answer to it"
        return f"nothing in {self.reply_timeout_s:g} s"

    def _remedy(self) -> str:
        other = self._client.other_device()
        if other is not None:
            return (
                f"device {other} is another one than {self._device}: give its number as ?device={other} if it is the drive, "
                "else correct the number in the drive or the gateway's table"
            )
        if len(self.stats.latencies_s) >= PROVEN:
            where = DISTURBED if isinstance(self._url, RtuUrl) and self._client.received else SILENT
        elif isinstance(self._url, RtuUrl):
            line = f"{self._url.baud} Bd, parity {self._url.parity}, {self._url.stop_bits} stop"
            where = f"check that the drive is set to {line} and to device {self._device}; then its supply and the cable"
        else:
            is_other = self._client.received and not self._client.part()
            wrong_port = "see that Modbus TCP, and nothing else, answers on this port; " if is_other else ""
            where = (
                f"{wrong_port}check the drive's supply, the cable, and that device={self._device} is its number there"
            )
        return f"{where}; an answer that needs longer gets it by reply=SECONDS in the address"

    def _refused(self, what: str, code: int, *, is_read: bool) -> NoReturn:
        self.stats.refusals += 1
        meaning = self._exceptions.get(code, "a code the drive file does not explain")
        remedies = {} if code in self._own else REMEDIES | READ_REMEDIES if is_read else REMEDIES
        raise RequestRefused(
            f"the drive refused to {what}: exception {code}, {meaning}",
            step=what,
            value=code,
            limit="a request the drive allows now",
            remedy=remedies.get(code, "the drive says: {meaning}").format(meaning=meaning, device=self._device),
        )


def open_port(
    url: DriveUrl, profile: DriveProfile, *, reply_timeout_s: float = 0.5, connect_timeout_s: float = 2.0
) -> ModbusPort:
    """A connected port. `reply_timeout_s` holds where neither the address (`reply=`) nor the drive file names another
    time; it is on top of the time the longest frames take on a serial line.

    Raises LinkUnreachable where nothing answers, UsageError where a TLS file cannot be used.
    """
    said = url.reply_s if url.reply_s is not None else profile.link.reply_s
    reply_timeout_s = reply_timeout_s if said is None else said
    reply_timeout_s += longest_frames_s(url)
    port = ModbusPort(url, profile, reply_timeout_s=reply_timeout_s, connect_timeout_s=connect_timeout_s)
    port.connect()
    return port
