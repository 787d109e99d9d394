"""The layers hold: what may import what, and which packages stay pure."""

import ast
import pathlib

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
LAYERS = [
    {"compiled", "errors", "records"},
    {"motor"},
    {"identify", "registers"},
    {"diagnose", "monitor"},
    {"safety"},
    {"procedure"},
    {"report"},
    {"link", "recordings", "settings"},
    {"run"},
    {"study"},
    {"service", "cli"},
]
RANK = {name: rank for rank, names in enumerate(LAYERS) for name in names}
PURE = {"errors", "records", "motor", "identify", "registers", "diagnose", "monitor", "safety", "procedure", "report"}
IMPURE = {
    "asyncio",
    "socket",
    "pathlib",
    "os",
    "logging",
    "time",
    "datetime",
    "pymodbus",
    "pydantic",
    "serial",
    "subprocess",
    "random",
    "threading",
    "secrets",
    "tempfile",
    "shutil",
    "typer",
    "rich",
}


def _files(package: str) -> list[pathlib.Path]:
    return sorted((ROOT / package).rglob("*.py"))


def _imports(path: pathlib.Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def _part(name: str) -> str | None:
    pieces = name.split(".")
    return pieces[1] if pieces[0] == "commissioner" and len(pieces) > 1 and pieces[1] in RANK else None


def test_commissioner_and_sim_never_import_each_other():
    for path in _files("commissioner"):
        assert not any(name.split(".")[0] == "sim" for name in _imports(path)), path
    for path in _files("sim"):
        assert not any(name.split(".")[0] == "commissioner" for name in _imports(path)), path


def test_imports_point_downward():
    for path in _files("commissioner"):
        own = path.relative_to(ROOT / "commissioner").parts[0].removesuffix(".py")
        if own not in RANK:
            continue
        for name in _imports(path):
            other = _part(name)
            assert other is None or RANK[other] <= RANK[own], f"{path.relative_to(ROOT)} imports {name}"


@pytest.mark.parametrize("package", sorted(PURE))
def test_pure_packages_touch_no_file_clock_or_wire(package):
    paths = _files(f"commissioner/{package}") or [ROOT / "commissioner" / f"{package}.py"]
    for path in paths:
        touched = {name.split(".")[0] for name in _imports(path)} & IMPURE
        assert not touched, f"{path.relative_to(ROOT)} imports {touched}"


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
