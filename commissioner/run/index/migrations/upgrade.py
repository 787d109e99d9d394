"""Bring a shared database to this version's tables."""

from __future__ import annotations

from pathlib import Path

from sqlalchemy import Engine, inspect, text

from commissioner.run.index.rows import SCHEMA

HEAD = f"{SCHEMA:04}"
_LOCK = 0x636F6D6D
"""An advisory lock of PostgreSQL, so that one of several computers makes the tables."""


def upgrade(engine: Engine) -> None:
    """Nothing to do where the tables are there; alembic is imported only where they are not. A database that a later version of
    this program has changed is used as it is: columns are only ever added."""
    with engine.connect() as connection:
        if _version(engine) >= HEAD:
            return
        from alembic import command
        from alembic.config import Config

        with connection.begin():
            if engine.dialect.name == "postgresql":
                connection.execute(text(f"SELECT pg_advisory_xact_lock({_LOCK})"))
            configuration = Config()
            configuration.set_main_option("script_location", str(Path(__file__).parent))
            configuration.attributes["connection"] = connection
            command.upgrade(configuration, "head")


def _version(engine: Engine) -> str:
    if not inspect(engine).has_table("alembic_version"):
        return ""
    with engine.connect() as connection:
        return str(connection.execute(text("SELECT version_num FROM alembic_version")).scalar() or "")
