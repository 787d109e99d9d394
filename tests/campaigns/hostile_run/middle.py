"""A man in the middle of a Modbus TCP connection: delays, loses, repeats and falsifies what passes, as a trouble says.

It runs as a process of its own, so that a host that is stopped does not stop it, and counts the energisings by the control
words that pass. Of the product it knows nothing but the published map.
"""

from __future__ import annotations

import random
import socket
import struct
import sys
import threading
import time
from dataclasses import asdict
from multiprocessing import get_context
from multiprocessing.context import SpawnProcess
from typing import Any

from tests.campaigns.hostile_run.troubles import SENSORS, Trouble

WINDOW, CONTROL_WORD, ENABLE, HEADER_WORDS, CRC_WORD = 256, 32, 0x0F, 8, 7
WRITE, EXCHANGE = 0x10, 0x17


def crc16(data: bytes) -> int:
    """CRC-16/MODBUS."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return crc


class Middle:
    """`with Middle(port, trouble) as middle:` listens on `middle.port`. `began(session)`: when that energising began, by
    the wall clock, 0 before."""

    def __init__(self, port: int, trouble: Trouble, seed: int) -> None:
        context = get_context("spawn")
        self._began = context.Array("d", 64)
        self._port = context.Value("i", 0)
        self._process: SpawnProcess = context.Process(
            target=_serve, args=(port, asdict(trouble), seed, self._port, self._began), daemon=True
        )

    def __enter__(self) -> Middle:
        self._process.start()
        while not self._port.value:
            time.sleep(0.01)
        self.port = int(self._port.value)
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.join()

    def began(self, session: int) -> float:
        return float(self._began[session]) if session < len(self._began) else 0.0


def _serve(target: int, trouble: dict[str, Any], seed: int, port: Any, began: Any) -> None:
    sys.setswitchinterval(1e-4)
    listener = socket.create_server(("127.0.0.1", 0))
    state = _State(Trouble(**trouble), random.Random(seed), began)
    port.value = listener.getsockname()[1]
    while True:
        client, _ = listener.accept()
        threading.Thread(target=_connection, args=(client, target, state), daemon=True).start()


class _State:
    """What is known of the run, over all connections."""

    def __init__(self, trouble: Trouble, rng: random.Random, began: Any) -> None:
        self.trouble, self.rng, self._began = trouble, rng, began
        self._sessions, self._spent = 0, False
        self._held: list[tuple[int, ...]] = []
        began[0] = time.time()

    def note(self, frame: bytes) -> None:
        if frame[7] == WRITE and struct.unpack_from(">H", frame, 8)[0] == CONTROL_WORD and frame[14] == ENABLE:
            self._sessions += 1
            self._began[min(self._sessions, 63)] = time.time()

    def acts(self, *kinds: str) -> bool:
        """Whether the trouble is one of these kinds, and now; a single stall is spent once it has struck."""
        t = self.trouble
        if t.kind not in kinds or self._sessions < t.session or self._spent:
            return False
        passed = time.time() - self._began[t.session] - t.at_s
        if t.length_s == 0.0 and passed >= 0.0:
            self._spent = True
            return True
        return 0.0 <= passed < t.length_s

    def falsified(self, words: list[int]) -> list[int]:
        """The samples of a window as a false sensor would show them."""
        count, channels = words[3], 4
        rows = [list(words[HEADER_WORDS + k * channels : HEADER_WORDS + (k + 1) * channels]) for k in range(count)]
        rows = [self._false_row([_signed(w) for w in row]) for row in rows]
        data = [max(-32768, min(32767, v)) & 0xFFFF for row in rows for v in row]
        out = [*words[:HEADER_WORDS], *data, *words[HEADER_WORDS + len(data) :]]
        out[CRC_WORD] = crc16(struct.pack(f">{CRC_WORD + len(data)}H", *out[:CRC_WORD], *data))
        return out

    def _false_row(self, row: list[int]) -> list[int]:
        kind, one, other = self.trouble.kind, 1 + self.trouble.phase, 1 + (self.trouble.phase + 1) % 3
        if kind == "currents_doubled":
            return [row[0], *(2 * i for i in row[1:])]
        if kind == "currents_halved":
            return [row[0], *(i // 2 for i in row[1:])]
        if kind == "sensors_swapped":
            row[one], row[other] = row[other], row[one]
        elif kind == "clipped":
            return [row[0], *(max(-400, min(400, i)) for i in row[1:])]
        elif kind in ("sensor_frozen", "all_frozen"):
            self._held = self._held or [tuple(row)]
            for k in (one,) if kind == "sensor_frozen" else (1, 2, 3):
                row[k] = self._held[0][k]
        else:
            row[one] = {"sensor_reversed": -row[one], "sensor_silent": 0, "sensor_doubled": 2 * row[one]}[kind]
        return row


def _signed(word: int) -> int:
    return word - 0x10000 if word & 0x8000 else word


def _connection(client: socket.socket, target: int, state: _State) -> None:
    server = socket.create_connection(("127.0.0.1", target))
    for end in (client, server):
        end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    try:
        while True:
            _exchange(client, server, state)
    except OSError:
        pass
    finally:
        client.close()
        server.close()


def _exchange(client: socket.socket, server: socket.socket, state: _State) -> None:
    """One question and what becomes of its answer."""
    question = _frame(client)
    trouble, rng = state.trouble, state.rng
    if state.acts("request_stall"):
        time.sleep(trouble.amount)
    if state.acts("busy"):
        client.sendall(question[:4] + b"\x00\x03" + question[6:7] + bytes([question[7] | 0x80, int(trouble.amount)]))
        return
    server.sendall(question)
    answer = _frame(server)
    state.note(question)
    if state.acts("late", "spell", "stall"):
        time.sleep(trouble.amount)
    if state.acts("jitter"):
        time.sleep(rng.uniform(0.0, trouble.amount))
    is_hit = rng.random() < trouble.amount
    if state.acts("drop") and is_hit:
        return
    if state.acts("corrupt") and is_hit and len(answer) > 9:
        place = rng.randrange(9, len(answer))
        answer = answer[:place] + bytes([answer[place] ^ (1 << rng.randrange(8))]) + answer[place + 1 :]
    if _is_window(question, answer) and state.acts(*SENSORS):
        count = answer[8] // 2
        words = state.falsified(list(struct.unpack_from(f">{count}H", answer, 9)))
        answer = answer[:9] + struct.pack(f">{count}H", *words)
    client.sendall(answer)
    if state.acts("duplicate") and is_hit:
        client.sendall(answer)


def _is_window(question: bytes, answer: bytes) -> bool:
    return question[7] == EXCHANGE and struct.unpack_from(">H", question, 8)[0] == WINDOW and not answer[7] & 0x80


def _frame(end: socket.socket) -> bytes:
    head = _exactly(end, 6)
    return head + _exactly(end, struct.unpack_from(">H", head, 4)[0])


def _exactly(end: socket.socket, size: int) -> bytes:
    data = b""
    while len(data) < size:
        piece = end.recv(size - len(data))
        if not piece:
            raise OSError("closed")
        data += piece
    return data
