"""What a report says holds on paper too: in grey, without a pointer, and with nothing closed."""

import ast
import re
from pathlib import Path

import pytest

import commissioner
from commissioner.report.page import Folded, Page, Picture, Section, Table, render

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
    page = render(Page("t", "h", "good", (), [Section("For experts", Folded("more", ["the rest"]))]))
    on_paper = page.partition("@media print")[2].partition("</style>")[0]
    assert "details::details-content" in on_paper and "content-visibility: visible" in on_paper


def test_a_recordings_page_is_a_sheet_whose_tables_fold_and_whose_figures_keep_their_letters_on_a_phone():
    """9 pt drawn 662 pt wide: on 360 px they were 4 px high; 48 rem is 720 px, where they are 10 px."""
    table = Table(("what repeats", "frequency / Hz", ""), [("shaft", "24.36", "1<2")], ["warn"], "a caption")
    text = render(Page("t", "h", "warn", [("slip", "2 %")], [Section("s", table, Picture("<svg></svg>", "seen"))]))
    body = text.partition("<main>")[2]
    assert '<div class="wide" tabindex="0"><table class="cards"><caption>a caption</caption>' in body
    assert (
        '<tr class="warn"><th scope="row">shaft</th><td data-l="frequency / Hz">24.36</td><td>1&lt;2</td></tr>' in body
    )
    assert '<figure><div class="wide" tabindex="0"><svg></svg></div><figcaption>seen</figcaption></figure>' in body
    assert "<dt>slip</dt><dd><b>2 %</b></dd>" in body
    on_a_phone = text.partition("@media screen and (max-width: 760px)")[2].partition("</style>")[0]
    assert ".wide > :is(svg, img) { min-width: 48rem; }" in on_a_phone
    assert "@media screen { .wide { overflow-x: auto; } }" in text
    assert 'content: "page " counter(page)' in text
    assert '<nav class="bar" aria-label="Parts of the report"><b>t</b></nav>' in text
