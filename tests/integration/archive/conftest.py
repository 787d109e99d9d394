"""The index on SQLite and on a real PostgreSQL alike."""

from __future__ import annotations

import uuid
from collections.abc import Iterator

import pytest

from tests.support.archive import postgres


@pytest.fixture(scope="session")
def workshop() -> Iterator[str]:
    """URL of a PostgreSQL server."""
    assert not postgres.missing(), postgres.missing()
    with postgres.server() as url:
        yield url


@pytest.fixture
def fresh_database(workshop) -> str:
    """URL of an empty database on it."""
    from sqlalchemy import create_engine, text

    name = f"archive_{uuid.uuid4().hex[:12]}"
    engine = create_engine(workshop, isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(text(f"CREATE DATABASE {name}"))
    engine.dispose()
    return workshop.rpartition("/")[0] + f"/{name}"


@pytest.fixture(params=["sqlite", "postgresql"])
def database(request) -> str | None:
    """None: the SQLite file beside the runs."""
    return None if request.param == "sqlite" else request.getfixturevalue("fresh_database")
