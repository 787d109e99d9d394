"""Addresses of our own pages: where a browser is, came from, and may be sent."""

from __future__ import annotations

from starlette.requests import Request

from commissioner.text import split_address


def local(path: str) -> str:
    """A path of this service, whatever was asked for."""
    return path if path.startswith("/") and not path.startswith(("//", "/\\")) else "/"


def came_from(request: Request) -> str:
    """The page that sent the browser here, where it says so and it is one of ours."""
    address = split_address(request.headers.get("referer", ""))
    is_ours = address.netloc.lower() == request.headers.get("host", "").lower()
    return local(address.path + (f"?{address.query}" if address.query else "")) if is_ours else "/"


def seen_at(request: Request) -> str:
    """Where the page can be looked at again: its own address, or that of the page whose form it answers."""
    if request.method == "GET":
        return request.url.path + (f"?{request.url.query}" if request.url.query else "")
    return came_from(request)
