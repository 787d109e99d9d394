"""The manual ships with the package and fits its readers; what README and chapters name is there."""

import importlib.util
import json
import re
from pathlib import Path

import pytest
import typer

from commissioner.cli.app import app
from commissioner.docs import chapter_names, chapter_title, read_chapter, read_schema
from tests.unit.cli.test_failures import leave

ROOT = Path(__file__).parents[3]
README = (ROOT / "README.md").read_text(encoding="utf-8")
CHAPTERS = {
    "accuracy", "monitoring", "diagnosis", "running", "running_blind", "blind", "reliability", "formats", "drives", "porting", "service", "archive", "study", "pipeline", "benchmarks", "development", "changelog",
}  # fmt: skip
PAGES = {"README": README} | {name: read_chapter(name) for name in sorted(CHAPTERS)}
FOLDERS = "commissioner|sim|config|tests|.github|.ci"


def verbs(command=None, before=""):
    """Every call the command line knows: `run`, `runs`, `runs list` ..."""
    command = command or typer.main.get_command(app)
    found = set()
    for name, inner in getattr(command, "commands", {}).items():
        found |= {f"{before}{name}"} | verbs(inner, f"{before}{name} ")
    return found


def named_verbs(text):
    """The verbs of the calls of `commissioner` in a text; the parts of a group are named with it."""
    for first, second in re.findall(r"\bcommissioner (?!/)([a-z][a-z-]*)(?: ([a-z]+))?", text):
        yield f"{first} {second}" if first == "runs" else first


FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.DOTALL | re.MULTILINE)


def in_code(text):
    """What stands in the commands and in the quoted code of a Markdown text; printed output does not count."""
    fenced = [body for language, body in FENCE.findall(text) if language in ("sh", "toml")]
    return "\n".join([*fenced, *re.findall(r"`([^`\n]+)`", FENCE.sub("", text))])


def test_every_chapter_ships_and_begins_with_its_title():
    assert set(chapter_names()) == CHAPTERS
    for name in CHAPTERS:
        assert read_chapter(name).startswith("# ")
        assert len(chapter_title(name)) > 5


@pytest.mark.parametrize("encoding", ["cp1252", "cp850"])
@pytest.mark.parametrize("name", sorted(CHAPTERS))
def test_every_chapter_can_be_shown_on_a_windows_console(name, encoding):
    read_chapter(name).encode(encoding)


def test_the_readme_is_read_in_five_minutes_and_the_decisions_in_ten():
    assert len(README.encode()) <= 8_000
    assert (ROOT / "commissioner" / "DECISIONS.md").stat().st_size <= 12_000
    (ROOT / "commissioner" / "DECISIONS.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", sorted(PAGES))
def test_every_verb_that_is_named_exists(page):
    assert set(named_verbs(in_code(PAGES[page]))) <= verbs()


def test_the_readme_names_every_verb():
    assert {verb.partition(" ")[0] for verb in verbs()} <= {
        verb.partition(" ")[0] for verb in named_verbs(in_code(README))
    }


@pytest.mark.parametrize("page", sorted(PAGES))
def test_every_module_that_a_command_names_exists(page):
    for module in re.findall(r"python -m ([\w.]+)", PAGES[page]):
        assert importlib.util.find_spec(module), module


@pytest.mark.parametrize("page", sorted(PAGES))
def test_every_path_that_is_named_exists(page):
    for path in re.findall(rf"(?<![\w/.])(?:{FOLDERS})/[\w./]*[\w/]", in_code(PAGES[page])):
        assert (ROOT / path).exists(), path


def test_every_address_in_an_example_is_quoted():
    for page, text in PAGES.items():
        assert not re.findall(r"--drive (?!\")\w+://", text), page


def test_the_pictures_of_report_and_page_are_there():
    pictures = re.findall(r"!\[[^]]*\]\(([^)]+)\)", README)
    assert [Path(picture).stem for picture in pictures] == ["report", "live"]
    assert all((ROOT / picture).read_bytes().startswith(b"\x89PNG") for picture in pictures)


def test_docs_gives_a_chapter_as_one_document(capsys):
    code, document = leave(capsys, "docs", "accuracy")
    assert (code, document) == (0, {"name": "accuracy", "text": read_chapter("accuracy")})


def test_docs_gives_a_schema_as_it_ships(capsys):
    code, document = leave(capsys, "docs", "run.schema.json")
    assert (code, document) == (0, json.loads(read_schema("run")))
    assert "run.schema.json" in leave(capsys, "docs")[1]["schemas"]
    assert leave(capsys, "docs", "nope.schema.json")[0] == 2


def test_docs_into_a_pipe_is_the_plain_markdown(capsys):
    app(["docs", "formats"], standalone_mode=False)
    assert capsys.readouterr().out == read_chapter("formats")


def test_docs_without_a_name_lists_the_chapters(capsys):
    code, document = leave(capsys, "docs")
    assert code == 0
    assert {chapter["name"] for chapter in document["chapters"]} == CHAPTERS


def test_a_chapter_that_there_is_not_is_a_usage_error_that_names_those_there_are(capsys):
    code, document = leave(capsys, "docs", "nope")
    assert code == 2
    assert all(name in document["error"]["limit"] for name in CHAPTERS)


@pytest.mark.parametrize("name", ["../__init__", "", "accuracy.md", "../schemas/run.schema.json"])
def test_a_name_is_no_path(capsys, name):
    code, document = leave(capsys, "docs", name)
    assert code == 2, json.dumps(document)
