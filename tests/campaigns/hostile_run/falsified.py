"""The samples of a window as a false sensor would show them."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from tests.campaigns.hostile_run.troubles import Trouble
from tests.support.scripted_port import crc16

WINDOW, HEADER_WORDS, CRC_WORD, CHANNELS = 256, 8, 7, 4
CLIP_COUNTS = 400


def falsified(trouble: Trouble, words: Sequence[int], held: list[tuple[int, ...]]) -> list[int]:
    """A window's words with the trouble in them and a check sum that fits; `held` keeps what is frozen."""
    count = words[3]
    rows = [words[HEADER_WORDS + k * CHANNELS : HEADER_WORDS + (k + 1) * CHANNELS] for k in range(count)]
    false = [_false_row(trouble, [_signed(word) for word in row], held) for row in rows]
    data = [max(-32768, min(32767, value)) & 0xFFFF for row in false for value in row]
    out = [*words[:HEADER_WORDS], *data, *words[HEADER_WORDS + len(data) :]]
    out[CRC_WORD] = crc16(struct.pack(f">{CRC_WORD + len(data)}H", *out[:CRC_WORD], *data))
    return out


def _false_row(trouble: Trouble, row: list[int], held: list[tuple[int, ...]]) -> list[int]:
    kind, one, other = trouble.kind, 1 + trouble.phase, 1 + (trouble.phase + 1) % 3
    if kind == "currents_doubled":
        return [row[0], *(2 * i for i in row[1:])]
    if kind == "currents_halved":
        return [row[0], *(i // 2 for i in row[1:])]
    if kind == "sensors_swapped":
        row[one], row[other] = row[other], row[one]
    elif kind == "clipped":
        return [row[0], *(max(-CLIP_COUNTS, min(CLIP_COUNTS, i)) for i in row[1:])]
    elif kind in ("sensor_frozen", "all_frozen"):
        if not held:
            held.append(tuple(row))
        for k in (one,) if kind == "sensor_frozen" else (1, 2, 3):
            row[k] = held[0][k]
    else:
        row[one] = {"sensor_reversed": -row[one], "sensor_silent": 0, "sensor_doubled": 2 * row[one]}[kind]
    return row


def _signed(word: int) -> int:
    return word - 0x10000 if word & 0x8000 else word
