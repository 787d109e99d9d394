"""Request PDUs and what their answers must look like (MODBUS Application Protocol Specification V1.1b3, section 6)."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from commissioner.conformance.records import Ask, Broken, Reply, Steps, Words

READ, WRITE_ONE, WRITE, EXCHANGE = 0x03, 0x06, 0x10, 0x17
BAD_FUNCTION, BAD_ADDRESS, BAD_VALUE, BUSY = 1, 2, 3, 6


def read_pdu(address: int, count: int) -> bytes:
    return struct.pack(">BHH", READ, address, count)


def write_one_pdu(address: int, word: int) -> bytes:
    return struct.pack(">BHH", WRITE_ONE, address, word)


def write_pdu(address: int, words: Sequence[int]) -> bytes:
    return struct.pack(f">BHHB{len(words)}H", WRITE, address, len(words), 2 * len(words), *words)


def exchange_pdu(write_address: int, words: Sequence[int], address: int, count: int) -> bytes:
    head = struct.pack(">BHHHHB", EXCHANGE, address, count, write_address, len(words), 2 * len(words))
    return head + struct.pack(f">{len(words)}H", *words)


def read(address: int, count: int) -> Steps[Words]:
    """`count` registers by function 3."""
    reply = yield Ask(read_pdu(address, count))
    return words_of(reply, READ, count, f"read {count} at {address}")


def exchange(write_address: int, words: Sequence[int], address: int, count: int) -> Steps[Words]:
    """Write, then read, by function 23."""
    reply = yield Ask(exchange_pdu(write_address, words, address, count))
    return words_of(reply, EXCHANGE, count, f"write {len(words)} at {write_address} and read {count} at {address}")


def write(address: int, words: Sequence[int]) -> Steps[None]:
    """Write by function 16; the answer must name address and count."""
    what = f"write {len(words)} at {address}"
    reply = yield Ask(write_pdu(address, words))
    _expect(reply, what, struct.pack(">BHH", WRITE, address, len(words)))


def write_one(address: int, word: int) -> Steps[None]:
    """Write by function 6; the answer must be the request."""
    reply = yield Ask(write_one_pdu(address, word))
    _expect(reply, f"write {word} at {address}", write_one_pdu(address, word))


def refusal(pdu: bytes, codes: Sequence[int], what: str) -> Steps[None]:
    """Broken unless the drive answers with one of these exceptions."""
    reply = yield Ask(pdu)
    answer = _answer(reply, what)
    if reply.exception not in codes or answer[0] != pdu[0] | 0x80:
        wanted = " or ".join(str(code) for code in codes)
        raise Broken(f"{what}: answered {answer.hex()}, wanted exception {wanted}")


def words_of(reply: Reply, function: int, count: int, what: str) -> Words:
    """The registers of a read's answer. Broken where it is not one."""
    answer = _answer(reply, what)
    if answer[:2] != bytes([function, 2 * count]) or len(answer) != 2 + 2 * count:
        raise Broken(f"{what}: the answer {answer[:8].hex()} ({len(answer)} bytes) does not carry {count} registers")
    return struct.unpack(f">{count}H", answer[2:])


def _expect(reply: Reply, what: str, wanted: bytes) -> None:
    answer = _answer(reply, what)
    if answer != wanted:
        raise Broken(f"{what}: answered {answer.hex()}, wanted {wanted.hex()}")


def _answer(reply: Reply, what: str) -> bytes:
    if reply.flaw:
        raise Broken(f"{what}: {reply.flaw}")
    if reply.pdu is None:
        raise Broken(f"{what}: no answer in {reply.took_s:.2f} s")
    return reply.pdu
