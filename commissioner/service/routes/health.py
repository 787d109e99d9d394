"""Is it there, and what goes on."""

from __future__ import annotations

from fastapi import APIRouter, Request

from commissioner.service.access.visitors import parts_of
from commissioner.service.contract.description import Typed
from commissioner.service.contract.runs import Health

router = APIRouter(route_class=Typed)


@router.get("/api/health")
async def health(request: Request) -> Health:
    """Status, version, and the runs that go on. Needs no log-in."""
    parts = parts_of(request)
    return {
        "status": "ok",
        "version": request.app.version,
        "runs_live": [run.id for run in parts.desk.live()],
        "is_warm": parts.warm.is_done,
    }
