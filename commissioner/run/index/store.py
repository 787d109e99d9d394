"""Where the rows lie: a SQLite file beside the run folders, memory, or a database that several computers share."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from commissioner.errors import CommissionerError, UsageError
from commissioner.run.index.rows import CLEAR, CREATE, DELETE, SCHEMA, UPSERT, Bound, Row

if TYPE_CHECKING:
    from sqlalchemy import Engine

NAME = "index.sqlite"
BUSY_S = 10.0
"""A writer waits so long for another one; a transaction of 10 000 rows takes half a second."""
PAGE = 16384
"""Bytes; eight rows to a page, so that little is left over."""
POSTGRES = "postgresql+psycopg://"


class Store(Protocol):
    """Rows of runs. `is_shared`: other computers' archives have theirs here, too."""

    is_shared: bool

    def read(self, statement: str, bound: Bound) -> Sequence[Sequence[Any]]: ...

    def write(self, place: str, rows: Iterable[Row], gone: Iterable[str], *, anew: bool = False) -> None:
        """In one transaction: the rows put in, the runs that are `gone` taken out; `anew`: all others of the place as well."""
        ...

    def close(self) -> None: ...


class SqliteStore:
    """One file, or memory where `path` is None. sqlite3.Error, where it cannot be read or written."""

    is_shared = False

    def __init__(self, path: Path | None) -> None:
        self._connection = sqlite3.connect(
            ":memory:" if path is None else path, timeout=BUSY_S, isolation_level=None, check_same_thread=False
        )
        self._connection.create_function("lower", 1, lambda text: str(text).lower(), deterministic=True)
        try:
            self._make_tables()
        except sqlite3.Error:
            self._connection.close()
            raise

    def read(self, statement: str, bound: Bound) -> Sequence[Sequence[Any]]:
        return self._connection.execute(statement, bound).fetchall()

    def write(self, place: str, rows: Iterable[Row], gone: Iterable[str], *, anew: bool = False) -> None:
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            if anew:
                self._connection.execute(CLEAR, {"place": place})
            self._connection.executemany(UPSERT, [row._asdict() for row in rows])
            self._connection.executemany(DELETE, [{"place": place, "run": run} for run in gone])
            self._connection.execute("COMMIT")
        except BaseException:
            with suppress(sqlite3.Error):
                self._connection.execute("ROLLBACK")
            raise

    def close(self) -> None:
        self._connection.close()

    def _make_tables(self) -> None:
        """The table where there is none; one of another version of this program is made anew."""
        if self._schema() == SCHEMA:
            return
        self._connection.execute(f"PRAGMA page_size = {PAGE}")
        self._connection.execute("BEGIN IMMEDIATE")
        if self._schema() != SCHEMA:  # nobody made it meanwhile
            self._connection.execute("DROP TABLE IF EXISTS runs")
            for statement in CREATE:
                self._connection.execute(statement)
            self._connection.execute(f"PRAGMA user_version = {SCHEMA}")
        self._connection.execute("COMMIT")

    def _schema(self) -> int:
        return int(self._connection.execute("PRAGMA user_version").fetchone()[0])


class SharedStore:
    """A PostgreSQL database by its URL. CommissionerError where it cannot be reached; a password comes from `~/.pgpass`."""

    is_shared = True

    def __init__(self, url: str, *, connect_s: int = 5) -> None:
        self._shown = url
        try:
            self._engine = self._open(url, connect_s)
        except Exception as failure:
            raise self._failed(failure) from failure

    def read(self, statement: str, bound: Bound) -> Sequence[Sequence[Any]]:
        from sqlalchemy import text
        from sqlalchemy.exc import SQLAlchemyError

        try:
            with self._engine.connect() as connection:
                return [tuple(row) for row in connection.execute(text(statement), dict(bound))]
        except SQLAlchemyError as failure:
            raise self._failed(failure) from failure

    def write(self, place: str, rows: Iterable[Row], gone: Iterable[str], *, anew: bool = False) -> None:
        from sqlalchemy import text
        from sqlalchemy.exc import SQLAlchemyError

        made = sorted(
            (_storable(row) for row in rows), key=lambda row: row["run"]
        )  # two writers never wait for each other in a ring
        left = [{"place": place, "run": run} for run in sorted(gone)]
        try:
            with self._engine.begin() as connection:
                if anew:
                    connection.execute(text(CLEAR), {"place": place})
                if made:
                    connection.execute(text(UPSERT), made)
                if left:
                    connection.execute(text(DELETE), left)
        except SQLAlchemyError as failure:
            raise self._failed(failure) from failure

    def close(self) -> None:
        self._engine.dispose()

    def _open(self, url: str, connect_s: int) -> Engine:
        from sqlalchemy import create_engine
        from sqlalchemy.pool import NullPool

        from commissioner.run.index.migrations.upgrade import upgrade

        engine = create_engine(url, poolclass=NullPool, connect_args={"connect_timeout": connect_s})
        upgrade(engine)
        return engine

    def _failed(self, failure: Exception) -> CommissionerError:
        first = str(failure).strip().splitlines()[0] if str(failure).strip() else type(failure).__name__
        return CommissionerError(
            "the archive's database cannot be used", step="archive index", value=first, limit=self._shown, remedy=_remedy(failure)
        )  # fmt: skip


def _remedy(failure: Exception) -> str:
    """A database that answers, and refuses what is asked of its tables, is reached."""
    if isinstance(failure, ImportError):
        return 'pip install ".[postgres]" in the folder of this program'
    from sqlalchemy.exc import ProgrammingError

    if isinstance(failure, ProgrammingError):
        return "let this user make and write the tables, or give an empty database: the folders fill it"
    return "check address, database, user and `~/.pgpass`; without --archive the folders alone are read"


def check_url(url: str) -> str:
    """The URL. UsageError: not PostgreSQL's, or a password stands in it."""
    user, _, place = url.removeprefix(POSTGRES).partition("/")[0].rpartition("@")
    _, colon, port = place.rpartition("]")[2].rpartition(":")
    if not url.startswith(POSTGRES) or not place or (colon and not port.isdecimal()):
        raise UsageError(
            "this is no archive database", step="archive index", value=url.partition("@")[2] or url,
            limit=f"{POSTGRES}USER@HOST/DATABASE", remedy="leave --archive out for the SQLite file beside the runs",
        )  # fmt: skip
    if ":" in user or "password=" in url:
        raise UsageError(
            "a password does not belong into a call", step="archive index", value="a password in --archive",
            limit=f"{POSTGRES}USER@HOST/DATABASE", remedy="put it into ~/.pgpass (HOST:PORT:DATABASE:USER:PASSWORD, mode 0600)",
        )  # fmt: skip
    return url


def open_file(root: Path) -> SqliteStore:
    """The SQLite index of the archive in `root`, made where there is none. sqlite3.Error: it cannot be had here, or is damaged."""
    return SqliteStore(root / NAME)


def forget(root: Path) -> None:
    """Delete the SQLite index; first what belongs to its last transaction, which must not be played into a new file."""
    for name in (f"{NAME}-journal", f"{NAME}-wal", f"{NAME}-shm", NAME):
        with suppress(OSError):
            (root / name).unlink()


def _storable(row: Row) -> dict[str, str | int]:
    """PostgreSQL's text takes no NUL."""
    return {name: value.replace("\0", "") if isinstance(value, str) else value for name, value in row._asdict().items()}
