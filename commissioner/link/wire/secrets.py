"""What of a call must stand in nothing that is shown or kept, whoever words it: we, the command line's library, a traceback."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import Any
from urllib.parse import unquote

from commissioner.link.wire.url import USERINFO, without_secrets

HIDDEN = "***"
_OPTION = re.compile(
    r"--?(?![\w-]*-file\b)[\w-]*(?:pass|pwd|secret|token|credential|auth|key)[\w-]*(?:=(.*))?",
    re.IGNORECASE | re.DOTALL,
)
"""An option that holds a secret; the file that one is read from is none."""
_TLS_FILE = re.compile(
    r"[?&](?:c|%63)(?:e|%65)(?:r|%72)(?:t|%74)=([^&]+)|[?&](?:k|%6b)(?:e|%65)(?:y|%79)=([^&]+)", re.IGNORECASE
)


class Secrets:
    """Passwords, with their users, and the paths of certificates and keys in the arguments of a call."""

    def __init__(self, arguments: Sequence[str]) -> None:
        found = {form for secret in _found(arguments) for form in (secret, unquote(secret), repr(secret)[1:-1])}
        words = sorted(filter(None, found), key=len, reverse=True)
        self._pattern = re.compile("|".join(rf"(?<!\w){re.escape(word)}(?!\w)" for word in words)) if words else None

    def hide(self, value: Any) -> Any:
        """The text, or the document's texts, without them; other values as they are."""
        if isinstance(value, str):
            return self._pattern.sub(HIDDEN, value) if self._pattern else value
        if isinstance(value, dict):
            return {key: self.hide(part) for key, part in value.items()}
        if isinstance(value, list | tuple):
            return [self.hide(part) for part in value]
        return value


def shown_call(arguments: Sequence[str]) -> str:
    """The call as it may be shown and kept."""
    hide = Secrets(arguments).hide
    return " ".join(without_secrets(hide(argument)) for argument in arguments)


def _found(arguments: Sequence[str]) -> Iterator[str]:
    for argument, following in zip_longest(arguments, arguments[1:], fillvalue=""):
        if option := _OPTION.fullmatch(argument):
            yield following if option[1] is None else option[1]
        if user := USERINFO.search(argument):
            yield user[0].rstrip("@")
            yield user[0].rstrip("@").partition(":")[2]
        for certificate, key in _TLS_FILE.findall(argument):
            yield certificate or key
