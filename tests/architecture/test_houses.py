"""The house holds: import directions (the contracts of pyproject.toml), sizes of its rooms, what lies at the top."""

import ast
import os
import pathlib
import subprocess
import sys
from collections import Counter
from graphlib import CycleError, TopologicalSorter

import grimp
import pytest
from importlinter.cli import lint_imports

ROOT = pathlib.Path(__file__).resolve().parents[2]
MOST_FILES = 12
PACKAGES = sorted(p.parent for top in ("commissioner", "sim") for p in (ROOT / top).rglob("__init__.py"))


def test_import_contracts_are_kept(capsys):
    broken = lint_imports(config_filename=str(ROOT / "pyproject.toml"), cache_dir=None, no_cache=True)
    assert broken == 0, capsys.readouterr().out


def test_no_module_is_imported_by_what_it_imports():
    """Not for the sake of a type either: a circle is one room with two doors."""
    graph = grimp.build_graph("commissioner", "sim", exclude_type_checking_imports=False, cache_dir=None)
    packages = {m for m in graph.modules if graph.find_children(m)}
    imports = {m: graph.find_modules_directly_imported_by(m) - packages for m in graph.modules - packages}
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as circle:
        pytest.fail(" -> ".join(circle.args[1]))


def test_no_folder_holds_more_files_than_one_can_look_over():
    """Modules of its own, beside `__init__`; data folders with a name each are listed by that name instead."""
    modules = [p for top in ("commissioner", "sim", "tests") for p in (ROOT / top).rglob("*.py")]
    count = Counter(path.parent for path in modules if path.name != "__init__.py")
    assert {str(folder.relative_to(ROOT)): n for folder, n in count.items() if n > MOST_FILES} == {}


@pytest.mark.parametrize("room", PACKAGES, ids=lambda room: str(room.relative_to(ROOT)))
def test_every_room_says_what_it_is(room):
    assert ast.get_docstring(ast.parse((room / "__init__.py").read_text("utf-8"))), room


@pytest.mark.xdist_group("kept together")
def test_what_shares_a_fixture_stays_on_one_worker(request):
    """pytest 9.2 and xdist 3.8 together did not: every run that many tests look at was made twice."""
    is_grouped = hasattr(request.config, "workerinput") and request.config.getvalue("loadgroup")
    assert request.node.nodeid.endswith("@kept together") == is_grouped


@pytest.mark.parametrize("test", (ROOT / ".ci" / "night.txt").read_text("utf-8").split())
def test_what_the_night_runs_is_there(test):
    file, name = test.split("::")
    assert f"def {name.split('[')[0]}(" in (ROOT / file).read_text("utf-8")


def test_top_level_holds_nothing_but_the_house():
    allowed = {
        "pyproject.toml",
        "commissioner",
        "config",
        "sim",
        "tests",
        "README.md",
        "LICENSE",
        "runs",
        "build",
        "dist",
    }
    seen = {path.name for path in ROOT.iterdir() if not path.name.startswith(".")}
    assert seen <= allowed


def test_what_was_late_alone_is_judged_once_more(tmp_path):
    """As `.ci/run` does it: of tests whose group has a name of its own, too. For a while all were, one after the other: ten minutes."""
    (tmp_path / "conftest.py").write_text("from tests.conftest import pytest_runtest_logreport\n", "utf-8")
    (tmp_path / "test_late.py").write_text(
        "import pytest\n@pytest.mark.xdist_group('sim/test_late.py')\n"
        "@pytest.mark.parametrize('late', [True, False])\ndef test(late):\n    assert not late\n",
        "utf-8",
    )
    command = [
        sys.executable, "-m", "pytest", "-c", str(ROOT / "pyproject.toml"), "--rootdir", str(tmp_path), "-o", f"cache_dir={tmp_path / 'kept'}",
        str(tmp_path),
    ]  # fmt: skip
    alone = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    said = [
        subprocess.run(
            [*command, *more], capture_output=True, text=True, encoding="utf-8", check=False, cwd=ROOT, env=alone
        ).stdout
        for more in (["-n", "1", "--dist", "loadgroup"], ["--lf", "--lfnf=none"])
    ]
    assert "1 failed, 1 passed" in said[0] and "1 failed" in said[1] and "passed" not in said[1], said
