"""The index says what the folders say, whatever was done to either; on SQLite and on PostgreSQL."""

from __future__ import annotations

import json
import multiprocessing
import shutil
import sqlite3

import pytest

from commissioner.errors import CommissionerError, UsageError
from commissioner.operations.archive import verify_runs
from commissioner.operations.history.runs import Archive
from commissioner.operations.history.trend import trend
from commissioner.run.archive import catalogue
from commissioner.run.archive.catalogue import DATED_AHEAD, find_folder, read_runs
from commissioner.run.archive.folder import RunFolder
from commissioner.run.index import index
from commissioner.run.index.index import ARCHIVE, find, note, refresh
from commissioner.run.index.rows import CREATE, Row, Wanted
from commissioner.run.index.store import NAME, check_url
from tests.support.archive.synthetic import MACHINE, make_archive, make_run, result_of


@pytest.fixture
def root(tmp_path):
    made = tmp_path / "runs"
    make_archive(made, 40)
    return made


def names(found):
    return [row.run for row in found.rows]


def told(root, database, **wanted):
    return names(find(root, Wanted(**wanted), database))


def by_folders(root):
    return [run.run for run in read_runs(root, with_results=False)]


def test_a_list_is_what_the_folders_hold_newest_first(root, database):
    refresh(root, database, rebuild=True)
    found = find(root, Wanted(), database)
    summaries = read_runs(root, with_results=False)
    assert names(found) == [run.run for run in summaries]
    for row, run in zip(found.rows, summaries, strict=True):
        document = json.loads(row.document)
        assert (row.outcome, row.standing, row.reason, row.drive) == (run.outcome, run.standing, run.reason, run.drive)
        assert (document["motor_tag"], document["folder"]) == (run.motor_tag, str(root / run.run))
        assert document["motor"] == run.motor


def test_each_filter_finds_what_a_walk_over_the_folders_finds(root, database):
    refresh(root, database)
    runs = read_runs(root, with_results=False)
    some = runs[7]
    number = str(some.serial_number)
    cases = {
        "motor": (some.motor_tag.lower(), lambda run: run.motor_tag == some.motor_tag),
        "drive": ("sim-inv-7a", lambda run: True),
        "serial": (number, lambda run: str(run.serial_number) == number),
        "person": ("jörg", lambda run: run.person == "Jörg"),
        "outcome": ("faulted", lambda run: run.outcome == "faulted"),
        "since": (some.started_utc, lambda run: run.started_utc >= some.started_utc),
        "until": (some.started_utc, lambda run: run.started_utc <= some.started_utc),
        "text": ("acceptance REJECTED", lambda run: run.outcome == "rejected"),
    }
    for name, (value, holds) in cases.items():
        expected = [run.run for run in runs if holds(run)]
        assert told(root, database, **{name: value}) == expected, name
        assert expected, name
    assert told(root, database, person="jörg", outcome="aborted") == [
        run.run for run in runs if run.person == "Jörg" and run.outcome == "aborted"
    ]


@pytest.mark.parametrize("sign", ["%", "_", "\\", "'", ";--", ":x", "%(y)s"])
def test_signs_of_the_language_mean_themselves(root, database, sign):
    assert told(root, database, text=sign) == []
    make_run(root, "20990101-000000-simulated-aaaaaa", person=f"O{sign}Neill", outcome="aborted")
    assert told(root, database, person=sign) == ["20990101-000000-simulated-aaaaaa"]


@pytest.mark.parametrize("limit", [0, 1, 2])
def test_a_folder_that_somebody_called_otherwise_is_never_the_newest(tmp_path, database, limit):
    """`restore last` would write what an old run found."""
    for name in (
        "pump7-before",
        "20260101-060000-simulated-000abc",
        "20260102-060000-simulated-000abc",
        "Übergabe",
        "(copy)",
    ):
        make_run(tmp_path / "runs", name)
    newest = ["20260102-060000-simulated-000abc", "20260101-060000-simulated-000abc"]
    found = find(tmp_path / "runs", Wanted(limit=limit), database)
    assert names(found)[:2] == newest[: limit or 2]
    assert found.total == 5
    assert find_folder(tmp_path / "runs", "last").name == newest[0]
    assert by_folders(tmp_path / "runs")[:2] == newest


def test_a_run_of_a_clock_that_was_ahead_is_not_the_newest_for_ever(tmp_path, database, monkeypatch):
    """`last` was that run until its time came, and a drive that it left in the middle was settled by it."""
    runs, ahead, made = tmp_path / "runs", "20990101-060000-simulated-000abc", "20260102-060000-simulated-000abc"
    for name in (ahead, "20260101-060000-simulated-000abc", made):
        make_run(runs, name, result=result_of(name, MACHINE), origin={"motor_tag": "PUMP-7"})
    assert names(find(runs, Wanted(), database))[0] == made == find_folder(runs, "last").name == by_folders(runs)[0]
    assert names(find(runs, Wanted(), database)) == by_folders(runs)
    found = trend(Archive(runs, database), "PUMP-7")
    assert [point.run for point in found.found.trends[0].points] == ["20260101-060000-simulated-000abc", made]
    assert found.left_out == (f"{ahead}: {DATED_AHEAD}",)
    monkeypatch.setattr(catalogue, "names_until", lambda: "21000101-000000~")  # its time has come
    assert find_folder(runs, "last").name == ahead


def test_a_limit_tells_how_many_there_are(root, database):
    found = find(root, Wanted(limit=7), database)
    assert len(found.rows) == 7 and found.total == 40


def test_folders_that_come_go_and_change_are_seen_at_the_next_list(root, database):
    refresh(root, database)
    shutil.rmtree(root / by_folders(root)[3])
    make_run(root, "20260101-000000-simulated-bbbbbb", closed=False)
    assert told(root, database) == by_folders(root)
    folder = RunFolder(root / "20260101-000000-simulated-bbbbbb")
    folder.journal("about_to", {"action": "stage"})
    (newest, *_) = find(root, Wanted(), database).rows
    assert (newest.outcome, newest.holds) == ("cut off", "old or new")  # a kill here would leave it so
    folder.journal("run_ended", {"outcome": "aborted", "reason": "x", "energised_s": 1.0})
    folder.close()
    assert told(root, database, outcome="aborted")[0] == newest.run


def test_whoever_ends_a_run_tells_the_index(root, database, monkeypatch):
    refresh(root, database)
    if database is not None:
        monkeypatch.setenv(ARCHIVE, database)
    folder = RunFolder.create(root, "test")
    folder.close()
    rows = stored(root, database)
    assert folder.path.name in rows and len(rows) == 41


def test_a_damaged_folder_is_a_row_and_harms_nobody(root, database):
    hostile = root / "20990101-000000-hostile"
    hostile.mkdir()
    (hostile / "journal.jsonl").write_bytes(b'{"kind": "run_ended", "record": [' + b"[" * 5000 + b"\x00\xff\n" * 3)
    deep = make_run(root, "20990102-000000-deep")
    summary = json.loads((deep / "summary.json").read_text())
    summary["summary"]["reason"] = "\x1b[31m\u202e\x00 red " + "x" * 10_000
    (deep / "summary.json").write_text(json.dumps(summary))
    (root / "20990103-000000-pipe").mkdir()
    (root / "20990103-000000-pipe" / "journal.jsonl").mkdir()
    (root / "20990104-000000-torn").mkdir()
    (root / "20990104-000000-torn" / "journal.jsonl").write_text('{"n": 0, "kind": "run_st')
    (root / "a file").write_text("x")
    found = find(root, Wanted(), database)
    assert set(by_folders(root)) <= set(names(found))
    assert len(found.rows) in (43, 44)
    refresh(root, database, rebuild=True)
    assert names(find(root, Wanted(), database)) == names(found)


def test_a_name_that_is_no_text_harms_nobody(root, database):
    (root / b"2099-\xff\xfe".decode("utf-8", "surrogateescape")).mkdir()
    (root / b"2099-\xff\xfe".decode("utf-8", "surrogateescape") / "journal.jsonl").write_text("")
    assert len(find(root, Wanted(), database).rows) == 41


def _writer(root, database, number):
    for k in range(5):
        folder = make_run(root, f"2098010{number}-00000{k}-w{number}")
        if database is None:
            note(folder)
        else:
            refresh(root, database)


def test_writers_at_the_same_time_lose_nothing(root, database):
    refresh(root, database)
    context = multiprocessing.get_context("spawn")
    writers = [context.Process(target=_writer, args=(root, database, n)) for n in range(4)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join(120)
    assert [writer.exitcode for writer in writers] == [0] * 4
    if database is None:
        assert len(stored(root, database)) == 60  # all were told, before anybody looked
    assert told(root, database) == by_folders(root)


def stored(root, database):
    """What the index itself holds, no folder asked."""
    if database is None:
        with sqlite3.connect(root / NAME) as connection:
            return {row[0] for row in connection.execute("SELECT run FROM runs")}
    from sqlalchemy import create_engine, text

    engine = create_engine(database)
    with engine.connect() as connection:
        rows = {row[0] for row in connection.execute(text("SELECT run FROM runs"))}
    engine.dispose()
    return rows


# --- the file --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "content", [b"", b"no database at all, but long enough to be one", b"SQLite format 3\0" + b"\xff" * 5000]
)
def test_a_damaged_index_is_made_anew(root, content):
    refresh(root)
    whole = (root / NAME).read_bytes()
    (root / NAME).write_bytes(content)
    assert told(root, None) == by_folders(root)
    (root / NAME).write_bytes(whole[:-20_000])
    assert told(root, None) == by_folders(root)
    assert len(stored(root, None)) == 40


def test_an_index_of_another_version_is_made_anew(root):
    refresh(root)
    with sqlite3.connect(root / NAME) as connection:
        connection.execute("DROP TABLE runs")
        connection.execute("CREATE TABLE runs (id INTEGER)")
        connection.execute("PRAGMA user_version = 99")
    assert told(root, None) == by_folders(root)
    assert len(stored(root, None)) == 40


def test_a_plate_in_the_words_of_an_earlier_version_is_told_in_todays(root, database):
    """As an index of version 1 has it: the folders have not changed, its words have."""
    refresh(root, database)
    run = by_folders(root)[3]
    earlier = "UPDATE runs SET plate = '4 kW, 1420 rpm' WHERE run = :run"
    if database is None:
        with sqlite3.connect(root / NAME) as connection:
            connection.execute(earlier, {"run": run})
            connection.execute("PRAGMA user_version = 1")
    else:
        from sqlalchemy import create_engine, text

        shared = create_engine(database)
        with shared.begin() as connection:
            connection.execute(text(earlier), {"run": run})
            connection.execute(text("UPDATE alembic_version SET version_num = '0001'"))
        shared.dispose()
    (row,) = [row for row in find(root, Wanted(), database).rows if row.run == run]
    assert "1/min" in row.plate and "rpm" not in row.plate
    assert not find(root, Wanted(text="rpm"), database).rows


def test_a_value_changed_in_the_index_is_found_by_verify_and_mended_by_a_rebuild(root):
    refresh(root)
    run = by_folders(root)[3]
    assert all(not seen.lost_in(NAME) for seen in verify_runs(root, None))
    with sqlite3.connect(root / NAME) as connection:
        connection.execute("UPDATE runs SET outcome = 'commissioned too' WHERE run = ?", (run,))
    (loss,) = [loss for seen in verify_runs(root, None) if not seen.is_whole for loss in seen.lost_in(NAME)]
    assert "its outcome of this run is not the folder's" in loss.what
    (one,) = verify_runs(root, run)
    assert one.losses == (loss,)
    refresh(root, rebuild=True)
    assert not verify_runs(root, run)[0].losses


def test_to_verify_one_run_no_other_is_looked_at(root, monkeypatch):
    refresh(root)
    monkeypatch.setattr(index, "stamps", lambda _root: pytest.fail("every folder was looked at"))
    select, found, run = index._select, [], by_folders(root)[3]
    monkeypatch.setattr(index, "_select", lambda *asked: found.append(select(*asked)) or found[-1])
    assert not index.unlike(root, {run})
    assert [row.run for row in found[0].rows] == [run]


def test_a_list_works_where_no_index_can_be_written(root):
    refresh(root)
    shutil.rmtree(root / by_folders(root)[0])
    holder = sqlite3.connect(root / NAME, isolation_level=None)
    holder.execute("BEGIN EXCLUSIVE")
    from commissioner.run.index import store

    patience, store.BUSY_S = store.BUSY_S, 0.05
    try:
        found = find(root, Wanted())
        assert names(found) == by_folders(root) and found.indexed == "folders"
        with pytest.raises(CommissionerError, match="cannot be written"):
            refresh(root)
    finally:
        store.BUSY_S = patience
        holder.close()


def test_a_small_archive_gets_no_index_file_by_itself(tmp_path):
    make_archive(tmp_path / "runs", 5)
    assert len(find(tmp_path / "runs", Wanted()).rows) == 5
    assert not (tmp_path / "runs" / NAME).exists()


# --- the database ----------------------------------------------------------------------------------------------------
def test_the_migrations_make_the_tables_that_sqlite_has(fresh_database, tmp_path):
    from sqlalchemy import create_engine, inspect

    refresh(tmp_path, fresh_database)
    shared = create_engine(fresh_database)
    file = sqlite3.connect(":memory:")
    for statement in CREATE:
        file.execute(statement)
    own = [row[1] for row in file.execute("PRAGMA table_info(runs)")]
    assert [column["name"] for column in inspect(shared).get_columns("runs")] == own == list(Row._fields)
    assert {index["name"] for index in inspect(shared).get_indexes("runs")} == {"runs_by_motor", "runs_in_step"}
    shared.dispose()


def test_two_computers_share_a_database_and_a_copied_run_is_told_once(fresh_database, tmp_path, monkeypatch):
    from commissioner.run.index import index

    make_archive(tmp_path / "a", 6, seed=1)
    make_archive(tmp_path / "b", 4, seed=2)
    copied = by_folders(tmp_path / "a")[0]
    shutil.copytree(tmp_path / "a" / copied, tmp_path / "b" / copied)
    refresh(tmp_path / "a", fresh_database)
    monkeypatch.setattr(index, "machine_part", lambda: "ffffff")
    found = find(tmp_path / "b", Wanted(), fresh_database)
    assert len(found.rows) == 10
    (row,) = [row for row in found.rows if row.run == copied]
    assert row.folder == str(tmp_path / "b" / copied)  # the one that is here
    assert find(tmp_path / "b", Wanted(limit=3), fresh_database).total == 10


@pytest.mark.parametrize(
    "url",
    [
        "postgresql+psycopg://",
        "postgresql+psycopg://anna@host:port/db",
        "mysql://x/y",
        "postgresql://x/y",
        "postgresql+psycopg://anna:secret@host/db",
        "runs.sqlite",
    ],
)
def test_an_address_that_is_none_or_holds_a_password_is_refused(url):
    with pytest.raises(UsageError) as caught:
        check_url(url)
    assert "secret" not in json.dumps(caught.value.as_dict())


def test_a_database_whose_tables_are_not_ours_is_said_to_be_so(root, fresh_database):
    from sqlalchemy import create_engine, text

    refresh(root, fresh_database)
    engine = create_engine(fresh_database)
    with engine.begin() as connection:
        connection.execute(text("DROP TABLE runs"))
    engine.dispose()
    for act in (lambda: find(root, Wanted(), fresh_database), lambda: refresh(root, fresh_database, rebuild=True)):
        with pytest.raises(CommissionerError, match="database cannot be used") as caught:
            act()
        assert "give an empty database" in caught.value.remedy


def test_a_database_that_does_not_answer_is_one_clear_failure(root):
    with pytest.raises(CommissionerError, match="database cannot be used") as caught:
        find(root, Wanted(), "postgresql+psycopg://nobody@127.0.0.1:1/none")
    assert caught.value.remedy
    note(root / by_folders(root)[0])  # never fails
