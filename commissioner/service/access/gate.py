"""The gate before every request: whose host name, whose page, and what a browser may do with the answer."""

from __future__ import annotations

from collections.abc import Iterable

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from commissioner.service.problems import Refusal, respond
from commissioner.text import split_address

CSP = (
    "default-src 'none'; script-src 'self'; style-src 'self'; font-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "form-action 'self'; frame-src 'self'; base-uri 'none'; frame-ancestors 'none'"
)
REPORT_CSP = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; frame-ancestors 'self'; sandbox"
)
"""A report is one file with its own style and pictures: shown without script, form or link to anywhere."""
SAFE = ("GET", "HEAD", "OPTIONS")
BODY_BYTES = 1_000_000
"""No request but an upload needs more."""


class Gate:
    """Refuses foreign Host and Origin, on the WebSocket too, and adds the security headers."""

    def __init__(self, app: ASGIApp, *, host_names: Iterable[str], uploads: tuple[str, ...] = ()) -> None:
        self._app, self._names, self._uploads = app, frozenset(name.lower() for name in host_names), uploads

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(scope)
        if refusal is None:
            await self._app(scope, receive, _with_headers(send))
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 4403, "reason": refusal.problem.title})
        else:
            await respond(refusal)(scope, receive, _with_headers(send))

    def _refusal(self, scope: Scope) -> Refusal | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if _name_of(host) not in self._names:
            return _refused(400, "the service is not called that", host, ", ".join(sorted(self._names)))
        if scope["type"] == "http" and scope["method"] in SAFE:
            return None
        origin, site = headers.get("origin"), headers.get("sec-fetch-site", "none")
        if (origin is not None and split_address(origin).netloc.lower() != host.lower()) or site not in (
            "same-origin",
            "none",
        ):
            return _refused(403, "the request comes from another site's page", origin or site, f"a page of {host}")
        if scope["type"] == "websocket":
            return None
        length = headers.get("content-length", "0")
        is_upload = scope["path"].startswith(self._uploads or ("\0",))
        if not is_upload and ("transfer-encoding" in headers or not length.isdigit() or int(length) > BODY_BYTES):
            return _refused(413, "the request is too large", length[:20], f"{BODY_BYTES} bytes")
        return None


def _name_of(host: str) -> str:
    """Without its port."""
    return (host[: host.find("]") + 1] if host.startswith("[") else host.partition(":")[0]).lower()


def _refused(status: int, title: str, value: str, limit: str) -> Refusal:
    return Refusal(
        status, title, step="gate", value=value[:200], limit=limit, remedy="open the page from the service itself"
    )


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            headers.setdefault("content-security-policy", CSP)
            headers.setdefault("x-content-type-options", "nosniff")
            headers.setdefault("referrer-policy", "same-origin")
            headers.setdefault("x-frame-options", "SAMEORIGIN")
            headers.setdefault("cross-origin-opener-policy", "same-origin")
            headers.setdefault("cross-origin-resource-policy", "same-origin")
            headers.setdefault("cache-control", "no-store")
        await send(message)

    return sending
