"""What a report says holds on paper too: in grey, without a pointer, and with nothing closed."""

import ast
import re
from pathlib import Path

import pytest

import commissioner
from commissioner.report.folded import folded
from commissioner.report.page import Page, Section, render

ROOT = Path(commissioner.__file__).parent
ONLY_ON_A_SCREEN = re.compile(
    r"\b(orange|blue|red|green|purple)\b|\bpointer\b|\bhover|\bclick\b|\btitle=", re.IGNORECASE
)
SOURCES = sorted(
    path for folder in ("report", "diagnose", "monitor", "running") for path in (ROOT / folder).rglob("*.py")
)


def sentences(path):
    """Every text of a module that is no docstring and more than a word."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    loose = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and id(node) not in loose
            and " " in node.value
        ):
            yield node.value


def test_there_is_something_to_read():
    assert sum(len(list(sentences(path))) for path in SOURCES) > 500


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_sentence_of_a_report_names_a_colour_or_asks_for_a_pointer(path):
    assert [text for text in sentences(path) if ONLY_ON_A_SCREEN.search(re.sub(r"<[^>]*>|\{[^}]*\}", "", text))] == []


def test_what_is_folded_on_the_screen_is_open_on_paper():
    page = render(Page("t", "h", "good", (), [Section("For experts", folded("more", ["the rest"]))]))
    on_paper = page.partition("@media print")[2].partition("</style>")[0]
    assert "details::details-content" in on_paper and "content-visibility:visible" in on_paper
