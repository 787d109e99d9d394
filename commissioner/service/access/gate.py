"""The gate before every request: whose host name, whose page, and what a browser may do with the answer."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import Response
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
HEADERS = {
    "content-security-policy": CSP, "x-content-type-options": "nosniff", "referrer-policy": "same-origin", "x-frame-options": "SAMEORIGIN",
    "cross-origin-opener-policy": "same-origin", "cross-origin-resource-policy": "same-origin", "cache-control": "no-store",
}  # fmt: skip
"""Of every answer that does not say otherwise."""
SAFE = ("GET", "HEAD", "OPTIONS")
BODY_BYTES, UPLOAD_BYTES = 1_000_000, 1_000_000_000
"""No request but an upload needs more than the first."""


class Gate:
    """Refuses foreign Host and Origin, on the WebSocket too, and adds the security headers. A body is stored before a route is
    asked: `refuse_upload` answers for whoever may send none to `uploads`, before it is read."""

    def __init__(
        self,
        app: ASGIApp,
        *,
        host_names: Iterable[str],
        uploads: tuple[str, ...],
        refuse_upload: Callable[[Request], Response | None],
    ) -> None:
        self._app, self._names = app, frozenset(name.lower() for name in host_names)
        self._uploads, self._refuse_upload = uploads, refuse_upload

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(scope)
        if refusal is None:
            refused = self._refuse_upload(Request(scope)) if self._is_upload(scope) else None
            await (refused or self._app)(scope, receive, _with_headers(send))
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
        length, most = headers.get("content-length", "0"), UPLOAD_BYTES if self._is_upload(scope) else BODY_BYTES
        if "transfer-encoding" in headers or not length.isdigit() or int(length) > most:
            return _refused(
                413,
                "the request is too large",
                length[:20],
                f"{most} bytes",
                "send less in one request, and say how much",
            )
        return None

    def _is_upload(self, scope: Scope) -> bool:
        return scope["type"] == "http" and scope["method"] not in SAFE and scope["path"].startswith(self._uploads)


def _name_of(host: str) -> str:
    """Without its port."""
    return (host[: host.find("]") + 1] if host.startswith("[") else host.partition(":")[0]).lower()


def _refused(
    status: int, title: str, value: str, limit: str, remedy: str = "open the page from the service itself"
) -> Refusal:
    return Refusal(status, title, step="gate", value=value[:200], limit=limit, remedy=remedy)


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return sending
