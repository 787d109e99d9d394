"""A sheet's numbers, drawings and form."""

import re
from importlib.resources import files

import numpy as np
import pytest
from markupsafe import Markup

from commissioner.report import page
from commissioner.report.sheet import marks
from commissioner.report.sheet.document import Margins, Page, document
from commissioner.report.sheet.drawing import Panel, envelope, padded, ticks
from commissioner.report.sheet.numbers import digits, fixed, held, interval, like, signed, with_interval


@pytest.mark.parametrize(
    ("value", "half", "shown"),
    [
        (3.71598, 0.0098, "3.7160 ± 0.0098"),
        (309.08, 0.50, "309.08 ± 0.50"),
        (309.08, 0.0996, "309.08 ± 0.10"),
        (309.08, 12.3, "309 ± 12"),
        (2345.0, 123.0, "2340 ± 120"),
        (-0.4886, 0.0049, "−0.4886 ± 0.0049"),
        (21.486, 0.0, "21.5"),
    ],
)
def test_an_interval_has_two_digits_and_the_value_ends_where_it_ends(value, half, shown):
    assert with_interval(value, half) == shown


def test_an_old_value_takes_the_places_of_the_new_one():
    assert like(3.2, 0.0098) == "3.2000"
    assert interval(1.0, float("nan")) == ("1.00", "")


def test_no_minus_before_nothing_and_a_true_minus_elsewhere():
    assert fixed(-0.0001, 2) == "0.00"
    assert signed(-2.5, 2) == "−2.5"
    assert signed(2.5, 2) == "+2.5"


def test_two_neighbouring_floats_of_32_bits_are_told_apart_and_one_is_itself():
    one = np.float32(3.7159)
    other = np.nextafter(one, np.float32(4))
    assert held(float(one)) != held(float(other))
    assert held(float(np.float32(3.71596157))) == held(float(np.float32(3.71596146)))


@pytest.mark.parametrize(
    ("value", "shown"), [(0.0, "0"), (1234.5, "1234"), (0.00012, "0.000120"), (float("inf"), "not finite")]
)
def test_digits_without_an_exponent(value, shown):
    assert digits(value, 3) == shown


def test_ticks_are_round_and_inside():
    assert ticks(0.0, 12.2, 3) == [0.0, 5.0, 10.0]
    assert ticks(-11.7, 11.7, 5) == [-10.0, -5.0, 0.0, 5.0, 10.0]
    assert ticks(1.0, 1.0) == [1.0]


def test_a_range_is_never_empty():
    assert padded([2.0, 2.0])[0] < 2.0 < padded([2.0, 2.0])[1]
    assert padded([]) == (-1.0, 1.0)


def test_an_envelope_keeps_the_extremes_of_each_window():
    time = np.arange(1000) * 1e-3
    value = np.sin(2 * np.pi * 50 * time)
    _, low, high = envelope(time, value, 0.02)
    assert low.min() == value.min()
    assert high.max() == value.max()
    assert low.size == 50


def test_a_panel_draws_its_limit_where_the_scale_has_it():
    panel = Panel(100, 50, (0.0, 1.0), (0.0, 10.0), "x", left=0, right=0, top=0, bottom=0).level(7.5)
    assert 'd="M0 12.50H100"' in str(panel.drawn())


def test_values_that_are_not_finite_interrupt_a_line():
    panel = Panel(100, 50, (0.0, 3.0), (0.0, 1.0), "x").line([0, 1, 2, 3], [0.0, float("nan"), 1.0, 1.0])
    assert str(panel.drawn()).count("M") == 2


def test_text_is_escaped_wherever_it_stands():
    evil = "<img src=x onerror=alert(1)>\"'</style>"
    margins = Margins(evil, evil, evil, evil, evil)
    body = (
        marks.facts([(evil, evil)])
        + marks.table([marks.Column(evil), marks.Column("b")], [(evil, evil)])
        + marks.coded(evil)
    )
    body += (
        marks.actions([evil])
        + marks.unchecked([evil])
        + marks.strip([(evil, evil, evil)])
        + marks.figure(evil, Markup(""), evil)
    )
    body += Panel(9, 9, (0, 1), (0, 1), evil).text(1, 1, evil).drawn()
    text = document(evil, margins, [Page("a", evil, body)])
    assert "<img" not in text
    assert text.count("</style>") == 1


def test_nothing_is_loaded_from_elsewhere():
    text = document("t", Margins("s", "m", "r", "", ""), [Page("a", "A", Markup("<p>x</p>"))])
    assert "http" not in text
    assert all(
        source.startswith("data:")
        for source in re.findall(r"url\(([^)]*)\)", text)
        if source.startswith(("data", "h", "/"))
    )
    assert 'counter(page) " of " counter(pages)' in text


def test_a_printed_card_breaks_between_its_figures_and_no_heading_stands_alone():
    """A section that may not break leaves most of the page before it blank."""
    text = page.render(page.Page("t", "h", "plain", [], [page.Section("s", page.Table(("a",), [("1",)]))]))
    printed = text[text.index("@media print") :].partition("</style>")[0]
    assert ".part:not(:has(figure, table)) { break-inside: avoid; }" in printed
    assert "p:has(+ figure), summary, thead { break-after: avoid; }" in printed
    assert "h2, h3, h4, .lead { break-after: avoid; }" in printed
    assert re.search(r"\.part \{[^}]*break-inside", printed) is None
    assert '<th scope="col">a</th>' in text


def test_what_has_happened_since_stands_on_the_first_printed_page_and_letters_wait_for_no_font():
    text = page.with_notice(
        document("a", Margins("s", "", "r", "", ""), [Page("x", "X", Markup("<h1>b</h1>"))]), "since"
    )
    assert re.search(r'<section class="notice"><p>since</p></section><section class="pg"', text)
    assert re.search(r"@media print .*\.notice \+ \.pg \{ break-before: auto; \}", text, re.S)
    assert "font-display: swap" in text
    assert "font-display: block" not in text


def test_a_legend_hides_no_curve():
    figure, drawn = page.figure_of(1, 1, 3.0)
    drawn[0, 0].plot([0.0, 1.0], [0.0, 1.0], label="measured")
    page.legend_above(drawn[0, 0])
    figure.draw_without_rendering()
    legend, curves = drawn[0, 0].get_legend().get_window_extent(), drawn[0, 0].get_window_extent()
    assert legend.y0 >= curves.y1
    assert legend.x1 <= figure.bbox.x1


def test_a_symbol_keeps_its_index_where_a_card_names_its_columns():
    columns = (marks.Column("Test"), marks.Column(marks.R_S), marks.Column("Change"))
    said = marks.table(columns, [("1", "3.7", "0")], "cards")
    assert '<span class="col" aria-hidden="true"><b class="n">R<sub>s</sub></b></span>3.7' in said
    assert 'data-l="Change"' in said


def test_a_cards_label_wraps_where_its_value_must_not():
    sheet = files("commissioner.report.sheet").joinpath("sheet.css").read_text("utf-8")
    rule = next(line for line in sheet.splitlines() if "table.cards td[data-l]::before, table.cards .col" in line)
    assert "white-space: normal" in rule


def test_two_sheets_that_flow_share_a_printed_page_and_any_other_begins_its_own():
    pages = [Page(n, n, Markup("<p>x</p>"), flows=n != "a") for n in "abc"]
    text = document("t", Margins("s", "m", "r", "", ""), pages)
    assert re.findall(r'<section class="([^"]*)" id', text) == ["pg", "pg flows", "pg flows"]
    printed = text.partition("@media print")[2]
    assert ".pg.flows + .pg.flows { break-before: auto;" in printed and "break-before: page; }" in printed
