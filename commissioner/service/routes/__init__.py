"""The HTTP contract, a file for each noun."""

from __future__ import annotations

from fastapi import APIRouter


def all_routers() -> list[APIRouter]:
    """Every route of the API."""
    from commissioner.service.routes import (
        access,
        checks,
        control,
        events,
        health,
        history,
        incoming,
        library,
        recordings,
        runs,
        tuning,
        write,
    )

    modules = (health, library, checks, runs, tuning, control, events, write, history, recordings, incoming, access)
    return [module.router for module in modules]
