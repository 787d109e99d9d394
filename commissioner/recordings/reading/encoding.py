"""Bytes to text: marks, UTF-8, UTF-16 without a mark, GBK, Windows' and Latin code pages."""

from __future__ import annotations

import re

SAMPLE = 1 << 16
KNOWN_CHINESE = re.compile("[时時间間电電流压壓相秒安伏通道线線速频頻率功采样周期数据序号]")


def decode(data: bytes) -> tuple[str, str]:
    """(text, the encoding's name). Latin-1 takes any byte, so this never fails; names then decide what is understood."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data[: len(data) // 2 * 2].decode("utf-16", errors="replace"), "UTF-16"
    head = data[:SAMPLE]
    for order, at in (("utf-16-le", 1), ("utf-16-be", 0)):
        half = head[at::2]
        if len(half) > 8 and half.count(0) > 0.7 * len(half):
            return data[: len(data) // 2 * 2].decode(order, errors="replace"), order.upper()
    try:
        return data.decode("utf-8-sig"), "UTF-8"
    except UnicodeDecodeError:
        pass
    try:
        text = data.decode("gb18030")
    except UnicodeDecodeError:
        text = ""
    if text and len(KNOWN_CHINESE.findall(text[:SAMPLE])) >= 2:
        return text, "GBK"
    try:
        return data.decode("cp1252"), "Windows-1252"
    except UnicodeDecodeError:
        return data.decode("latin-1"), "Latin-1"
