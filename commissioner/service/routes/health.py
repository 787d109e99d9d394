"""Is it there, and what goes on."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request

from commissioner.service.access.visitors import parts_of

router = APIRouter()


@router.get("/api/health")
async def health(request: Request) -> dict[str, Any]:
    """Status, version, and the runs that go on. Needs no log-in."""
    parts = parts_of(request)
    return {
        "status": "ok",
        "version": request.app.version,
        "runs_live": [run.id for run in parts.desk.live()],
        "is_warm": parts.warm.is_done,
    }
