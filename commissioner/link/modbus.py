"""The port over pymodbus 3.15: every reply checked, every exception mapped, no write repeated.

Modbus RTU has no transaction number: after one late answer every later request would get its predecessor's answer. So
after any doubt the line is left to fall silent, drained, and proven with a fresh token before the next request; and for
`WATCH_S` after that each answer is followed by a token too, which shows a shift by one at once. On TCP and TLS doubt
costs the connection: a new one carries no old answer. A request on a closed connection opens it, once, in
`connect_timeout_s`; there is no back-off and no reconnection behind the caller's back.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NoReturn, Protocol, TypeVar

from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ConnectionException, ModbusException, ModbusIOException
from pymodbus.pdu import ModbusPDU

from commissioner.errors import LinkError, LinkUnreachable, ReplyMismatch, ReplyTimeout, RequestRefused
from commissioner.link.port import LinkStats, Words
from commissioner.link.tls import TlsClient
from commissioner.link.url import DriveUrl, RtuUrl, TcpUrl
from commissioner.registers.profile import DriveProfile, Item

READ, WRITE_COIL, WRITE_ONE, WRITE, EXCHANGE = 0x03, 0x05, 0x06, 0x10, 0x17
MAX_FRAME_CHARACTERS = 256
WATCH_S = 2.0
RESYNCHRONISATIONS = 4
ILLEGAL_FUNCTION = 1

EXCEPTION_MEANINGS = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "device failure",
    5: "acknowledged, still at work",
    6: "device busy",
    8: "memory parity error",
    10: "gateway path unavailable",
    11: "gateway target did not answer",
}
"""MODBUS Application Protocol Specification V1.1b3, section 7."""

Client = ModbusTcpClient | ModbusSerialClient  # TlsClient is a ModbusTcpClient
Result = TypeVar("Result")


class Proof(Protocol):
    """Asks something whose answer cannot be an earlier request's. Raises LinkError where it is."""

    def __call__(self, port: ModbusPort) -> None: ...


class ModbusPort:
    """A `Port` on a pymodbus client. Made by `open_port`."""

    def __init__(
        self,
        client: Client,
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
        self.reply_timeout_s = reply_timeout_s
        self._connect_timeout_s = connect_timeout_s
        self._client = client
        self._url = url
        self._link = profile.link
        self._exceptions = EXCEPTION_MEANINGS | dict(profile.exceptions)
        self._device = url.device or profile.link.device_id
        self._has_exchange = profile.link.has_read_write_multiple
        self._prove = _choose_proof(profile)
        self._token = time.time_ns() & 0xFFFF
        self._is_in_doubt = isinstance(url, RtuUrl)
        self._watch_until = -1.0
        self._sleep, self._clock = sleep, clock

    # --- the port ----------------------------------------------------------------------------------------------
    def read(self, address: int, count: int) -> Words:
        return self._repeatable(lambda: self._proven(lambda: self.ask_read(address, count)))

    def write(self, address: int, values: Sequence[int]) -> None:
        self._proven(lambda: self._ask_write(address, list(values)))
        if self._link.write_pause_s:
            self._sleep(self._link.write_pause_s)

    def exchange(self, write_address: int, values: Sequence[int], read_address: int, count: int) -> Words:
        if self._has_exchange:
            try:
                return self._proven(lambda: self._ask_exchange(write_address, list(values), read_address, count))
            except RequestRefused as refused:
                if refused.value != ILLEGAL_FUNCTION:
                    raise
                self._has_exchange = False
        self.write(write_address, values)
        return self._proven(lambda: self.ask_read(read_address, count))

    def write_coil(self, address: int, value: bool) -> None:
        self._proven(lambda: self._ask_write_coil(address, value))

    def close(self) -> None:
        self._client.close()  # type: ignore[no-untyped-call]

    # --- single requests ----------------------------------------------------------------------------------------
    def ask_read(self, address: int, count: int) -> Words:
        """One FC03, checked for function and length."""
        what = f"read {count} registers at {address}"
        reply = self._transact(
            READ, what, lambda: self._client.read_holding_registers(address, count=count, device_id=self._device)
        )
        return self._words(reply, count, what)

    def ask_write_one(self, address: int, value: int) -> None:
        """One FC06, whose answer must repeat address and value."""
        what = f"write register {address}"
        reply = self._transact(
            WRITE_ONE, what, lambda: self._client.write_register(address, value, device_id=self._device)
        )
        self._expect(what, (reply.address, tuple(reply.registers)), (address, (value,)))

    def next_token(self) -> int:
        """A number no recent token had."""
        self._token = (self._token * 25173 + 13849) & 0xFFFF
        return self._token

    def _ask_write(self, address: int, values: list[int]) -> None:
        what = f"write {len(values)} registers at {address}"
        reply = self._transact(
            WRITE, what, lambda: self._client.write_registers(address, values, device_id=self._device)
        )
        self._expect(what, (reply.address, reply.count), (address, len(values)))

    def _ask_write_coil(self, address: int, value: bool) -> None:
        what = f"write coil {address}"
        reply = self._transact(
            WRITE_COIL, what, lambda: self._client.write_coil(address, value, device_id=self._device)
        )
        self._expect(what, (reply.address, reply.bits[:1]), (address, [value]))

    def _ask_exchange(self, write_address: int, values: list[int], read_address: int, count: int) -> Words:
        what = f"write {len(values)} registers at {write_address} and read {count} at {read_address}"
        reply = self._transact(
            EXCHANGE,
            what,
            lambda: self._client.readwrite_registers(
                read_address=read_address, read_count=count, write_address=write_address, values=values,
                device_id=self._device,
            ),
        )
        return self._words(reply, count, what)

    # --- trust -----------------------------------------------------------------------------------------------------
    def _repeatable(self, ask: Callable[[], Result]) -> Result:
        """`ask`, and again after a lost or doubtful answer: only for what may be asked twice."""
        for _ in range(self.read_retries):
            try:
                return ask()
            except (ReplyTimeout, ReplyMismatch):
                continue
        return ask()

    def _proven(self, ask: Callable[[], Result]) -> Result:
        """`ask` on a line that is in step; while late answers are about, its answer only counts once proven."""
        self._ready()
        answer = ask()
        if self._clock() < self._watch_until:
            self._prove(self)
        return answer

    def _ready(self) -> None:
        if not self._client.connected:
            self._connect()
        if self._is_in_doubt:
            self._resynchronise()

    def _connect(self) -> None:
        self._set_timeout(self._connect_timeout_s)
        try:
            is_open, why = bool(self._client.connect()), "nothing answers"
        except (OSError, ModbusException) as error:
            is_open, why = False, str(error)
        if not is_open:
            raise LinkUnreachable(
                f"no connection to {self._url}", step="connect", value=why,
                limit=f"a connection within {self._connect_timeout_s:g} s",
                remedy="check that the drive is powered, the cable, the address and that no other master holds it",
            )
        self.stats.connections += 1

    def _resynchronise(self) -> None:
        """Silence, drain, token; again while old answers keep coming. Leaves the line watched for `WATCH_S`."""
        self.stats.resynchronisations += 1
        failure: LinkError | None = None
        for _ in range(RESYNCHRONISATIONS):
            self._drain()
            try:
                self._is_in_doubt = False
                self._prove(self)
                self._watch_until = self._clock() + WATCH_S
                return
            except (ReplyTimeout, ReplyMismatch) as error:
                failure = error
        self._is_in_doubt = True
        raise ReplyTimeout(
            f"{self._url}: the line does not come back into step", step="resynchronise",
            value=failure.what if failure else None, limit=f"a proven answer within {RESYNCHRONISATIONS} attempts",
            remedy="check cable, baud rate, parity, termination and that one master only is on the line",
        ) from failure

    def _drain(self) -> None:
        """Wait until one turn-around and one frame long nothing came, and throw away what did."""
        quiet_s = self._link.turnaround_s + MAX_FRAME_CHARACTERS * _character_s(self._url)
        end = self._clock() + self.reply_timeout_s + 4 * quiet_s
        while True:
            self._sleep(quiet_s)
            if not self._discard_input() or self._clock() > end:
                return

    def _discard_input(self) -> int:
        line = self._client.socket if isinstance(self._client, ModbusSerialClient) else None
        if line is None:
            return 0
        try:
            return len(line.read(line.in_waiting))
        except Exception as error:  # pyserial lets termios and type errors through when a line vanishes
            self._broke("drain", error)

    # --- one transaction ---------------------------------------------------------------------------------------------
    def _transact(self, function: int, what: str, send: Callable[[], ModbusPDU]) -> ModbusPDU:
        self._set_timeout(self.reply_timeout_s)
        self.stats.requests += 1
        start = self._clock()
        try:
            reply = send()
        except ModbusException as error:
            self._failed(what, error)
        except Exception as error:
            self._broke(what, error)
        except BaseException:
            self._doubt()
            raise
        self.stats.latencies_s.append(self._clock() - start)
        self._check_envelope(function, what, reply)
        return reply

    def _check_envelope(self, function: int, what: str, reply: ModbusPDU) -> None:
        self._expect(what, reply.dev_id, self._device)
        self._expect(what, reply.function_code & 0x7F, function)
        if reply.isError():
            self._refused(what, reply.exception_code)

    def _words(self, reply: ModbusPDU, count: int, what: str) -> Words:
        self._expect(what, f"{len(reply.registers)} registers", f"{count} registers")
        return tuple(reply.registers)

    def _expect(self, what: str, seen: object, wanted: object) -> None:
        if seen == wanted:
            return
        self.stats.mismatches += 1
        self._doubt()
        raise ReplyMismatch(
            f"the answer to '{what}' is not its answer", step=what, value=seen, limit=wanted,
            remedy="an answer to another request or a damaged one; check cable, device number and other masters",
        )

    def _failed(self, what: str, error: ModbusException) -> NoReturn:
        if isinstance(error, ConnectionException):
            self._broke(what, error)
        if isinstance(error, ModbusIOException) and "No response received" in str(error):
            self._timed_out(what, f"nothing in {self.reply_timeout_s:g} s", error)
        self.stats.mismatches += 1
        self._doubt()
        raise ReplyMismatch(
            f"the answer to '{what}' cannot be read", step=what, value=str(error), limit="a Modbus answer",
            remedy="check cable, baud rate and that the device speaks Modbus",
        ) from error

    def _broke(self, what: str, error: Exception) -> NoReturn:
        self._client.close()  # type: ignore[no-untyped-call]
        self._timed_out(what, f"the connection broke: {error}", error)

    def _timed_out(self, what: str, value: str, error: Exception) -> NoReturn:
        self.stats.timeouts += 1
        self._doubt()
        raise ReplyTimeout(
            f"no answer to '{what}'", step=what, value=value, limit=f"an answer within {self.reply_timeout_s:g} s",
            remedy="check the drive's supply, the cable and the device number",
        ) from error

    def _refused(self, what: str, code: int) -> NoReturn:
        self.stats.refusals += 1
        meaning = self._exceptions.get(code, "not in the drive file")
        raise RequestRefused(
            f"the drive refused to {what}: exception {code}, {meaning}", step=what, value=code,
            limit="a request the drive allows now", remedy=f"the drive says: {meaning}",
        )

    def _doubt(self) -> None:
        """An answer may still be under way: the line is proven again first, a connection is given up."""
        if isinstance(self._url, RtuUrl):
            self._is_in_doubt = True
        else:
            self._client.close()  # type: ignore[no-untyped-call]

    def _set_timeout(self, timeout_s: float) -> None:
        self._client.comm_params.timeout_connect = timeout_s


def open_port(
    url: DriveUrl, profile: DriveProfile, *, reply_timeout_s: float = 0.5, connect_timeout_s: float = 3.0
) -> ModbusPort:
    """A connected port. `reply_timeout_s` is on top of the time the longest frames take on a serial line.

    Raises LinkUnreachable where nothing answers, UsageError where a TLS file cannot be used.
    """
    wire_s = 2 * MAX_FRAME_CHARACTERS * _character_s(url)
    port = ModbusPort(
        _client(url), url, profile, reply_timeout_s=reply_timeout_s + wire_s, connect_timeout_s=connect_timeout_s
    )
    port._connect()
    return port


def _client(url: DriveUrl) -> Client:
    if isinstance(url, TcpUrl):
        return ModbusTcpClient(url.host, port=url.port, retries=0)
    if isinstance(url, RtuUrl):
        return ModbusSerialClient(
            url.path, baudrate=url.baud, parity=url.parity, stopbits=url.stop_bits, retries=0
        )
    return TlsClient.for_url(url)


def _character_s(url: DriveUrl) -> float:
    return url.character_s if isinstance(url, RtuUrl) else 0.0


def _choose_proof(profile: DriveProfile) -> Proof:
    """The echo register where the drive has one, else two reads of different length."""
    echo = profile.items.get("echo")
    if echo is not None:
        return _echo_proof(echo.address)
    by_words = {item.words: item for item in reversed(list(profile.items.values())) if "r" in item.access}
    return _length_proof(tuple(by_words.values()))


def _echo_proof(address: int) -> Proof:
    def prove(port: ModbusPort) -> None:
        token = port.next_token()
        port.ask_write_one(address, token)
        port._expect("read the echo register", port.ask_read(address, 1), (token,))

    return prove


def _length_proof(items: tuple[Item, ...]) -> Proof:
    def prove(port: ModbusPort) -> None:
        for item in items:
            port.ask_read(item.address, item.words)

    return prove
