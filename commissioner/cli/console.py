"""What a console cannot show is spelled out: `ohm` for the sign, `R_sigma` for the letter, `?` for what has no spelling.

A Windows console may speak cp1252 or cp850, a pipe whatever the system says; none of them may end a verb.
"""

from __future__ import annotations

import codecs
import io
import sys
import unicodedata

SPELLED = {
    "Ω": "ohm", "\N{OHM SIGN}": "ohm", "σ": "sigma", "ψ": "psi", "φ": "phi", "µ": "u", "μ": "u", "°": " deg", "²": "2", "³": "3",
    "±": "+-", "×": "x", "·": "*", "√": "sqrt", "≤": "<=", "≥": ">=", "≈": "~", "→": "->", "−": "-", "–": "-", "—": "-",
    "…": "...", "•": "*", "✓": "ok", "✗": "x", "■": "#", "█": "#", "▇": "#", "\N{NO-BREAK SPACE}": " ",
}  # fmt: skip


def degrade_output() -> None:
    """From here on stdout and stderr spell out what their encoding lacks."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="spelled-out")


def spelled(text: str, encoding: str) -> str:
    """The text as a console of this encoding shows it: spelled out before columns are laid, not after."""
    return text if text.isascii() else text.encode(encoding, "spelled-out").decode(encoding)


def _spell(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lost = error.object[error.start : error.end]
    return "".join(_plainly(sign) for sign in lost), error.end


def _plainly(sign: str) -> str:
    """The spelling of one sign, or the sign without its marks, or `?`."""
    plain = SPELLED.get(sign) or unicodedata.normalize("NFKD", sign)
    return plain.encode("ascii", "ignore").decode("ascii") or "?"


codecs.register_error("spelled-out", _spell)
