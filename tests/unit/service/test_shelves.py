"""Two runs beside each other and a motor over the years: what moved is told at one flux and one winding temperature."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from jinja2 import ChoiceLoader, DictLoader

from commissioner.encoding import plain
from commissioner.errors import UsageError
from commissioner.identify.estimate.axes import Identity
from commissioner.operations.history.compare import compare_runs
from commissioner.operations.history.runs import Archive as Runs
from commissioner.operations.history.trend import trend
from commissioner.report.run.standing import Held
from commissioner.report.sheet.words import NBSP
from commissioner.service.archive import Archive
from commissioner.service.page.frame import environment, words_of
from commissioner.service.routes.history import trend_of
from tests.support.archive.synthetic import MACHINE, PLATE, make_run, result_of
from tests.support.service.markup import without_layout

COPPER_PER_K = 1.0 / (235.0 + 20.0)
COLD, WARM = "20240105-081500-simulated-000abc", "20240620-081500-simulated-001abc"
CURVE = ((0.1, 0.32), (0.716, 0.3091), (0.8, 0.299))


def archive(root, rotor=1.0):
    """A motor at 20 and at 45 °C, both resistances as copper's, its rotor's `rotor` times that."""
    warmth = 1.0 + 25.0 * COPPER_PER_K
    warm = MACHINE | {
        "stator_resistance_ohm": warmth * MACHINE["stator_resistance_ohm"],
        "rotor_resistance_ohm": rotor * warmth * MACHINE["rotor_resistance_ohm"],
    }
    for name, machine, degc in ((COLD, MACHINE, 20.0), (WARM, warm, 45.0)):
        make_run(root, name, result=result_of(name, machine, degc=degc, curve=CURVE), origin={"motor": "pump"})
    return SimpleNamespace(archive=Archive(root))


@pytest.mark.parametrize(("rotor", "moved"), [(1.0, set()), (1.1, {"rotor_resistance_ohm"})])
def test_a_warmer_winding_is_no_change_of_the_motor(tmp_path, rotor, moved):
    changes = trend_of(archive(tmp_path, rotor), "pump")["changes"]
    assert set(changes) == set(MACHINE)
    assert {name for name, change in changes.items() if change["is_beyond_chance"]} == moved
    assert changes["stator_resistance_ohm"]["relative"] == pytest.approx(0.0, abs=1e-3)
    assert changes["rotor_resistance_ohm"]["relative"] == pytest.approx(rotor - 1.0, abs=1e-3)


def test_a_trend_is_found_by_the_motors_file_tag_or_serial_number_on_the_page_as_on_the_command_line(tmp_path):
    names = {"motor": "pump", "motor_tag": "PUMP-7", "motor_serial": "SN 77"}
    for name in (COLD, WARM):
        make_run(tmp_path, name, result=result_of(name, MACHINE), origin=names)
    parts = SimpleNamespace(archive=Archive(tmp_path))
    for asked in names.values():
        assert [point["run"] for point in trend_of(parts, asked)["points"]] == [COLD, WARM]
        assert [point.run for point in trend(Runs(tmp_path), asked).found.trends[0].points] == [COLD, WARM]
    with pytest.raises(UsageError):
        trend(Runs(tmp_path), "PUMP")
    assert [entry.run for entry in parts.archive.entries(motor="pump-7")] == [WARM, COLD]


def rendered(name, language, **facts):
    """The main part of a page."""
    words = words_of(language)
    macros = environment().get_template("frame/parts.html").make_module(words)
    bare = DictLoader({"frame/base.html": "{% block main %}{% endblock %}"})
    template = environment().overlay(loader=ChoiceLoader([bare, environment().loader])).get_template(name)
    said = template.render({**words, "p": macros, **facts})
    return said.partition("<h1>")[2].replace(NBSP, " ").replace("&#39;", "'")


def page(parts, language):
    """Of both runs."""
    compared = plain(compare_runs(parts.archive.root, COLD, WARM))
    before, after = (parts.archive.find(name) for name in (COLD, WARM))
    return rendered("shelves/compare.html", language, document=compared, before=before, after=after)


def test_where_the_last_run_tells_no_error_the_points_still_stand(tmp_path):
    parts = archive(tmp_path)
    last = "20241201-081500-simulated-002abc"
    spoilt = result_of(last, MACHINE, curve=CURVE)
    for value in spoilt["parameters"].values():
        value["std"] = None
    make_run(tmp_path, last, result=spoilt, origin={"motor": "pump"})
    document = trend_of(parts, "pump")
    assert [point["run"] for point in document["points"]] == [COLD, WARM, last] and document["changes"] == {}
    said = without_layout(rendered("shelves/trend.html", "en", document=document, motor="pump"))
    assert "3.716</td>" in said and "3.716 ± 0.009</td>" in said and "σ)" not in said


@pytest.mark.parametrize(("language", "verdict", "change"), [
    ("en", "The same motor, changed:", "rotor resistance +10.0 % ("), ("de", "Derselbe Motor, verändert:", "Läuferwiderstand +10,0 % ("),
])  # fmt: skip
def test_the_page_of_two_runs_says_one_thing_of_each_parameter_in_the_readers_language(
    tmp_path, language, verdict, change
):
    said = page(archive(tmp_path, 1.1), language)
    assert verdict in said and change in said
    assert "+20" not in said  # the difference as measured, which is mostly the winding's warmth
    assert "45 °C" in said and "20 °C" in said
    assert 'lang="en"' not in said or language == "en"


def test_every_verdict_of_a_comparison_has_its_words():
    source, _, _ = environment().loader.get_source(environment(), "shelves/compare.html")
    assert all(f'"{one}": _(' in source for one in map(plain, Identity))


@pytest.mark.parametrize(
    ("language", "said"), [("en", "3.73 kW, 400 V, 7.396 A, 1420 1/min"), ("de", "3,73 kW, 400 V, 7,396 A, 1420 1/min")]
)
def test_a_motor_without_a_name_is_told_by_its_plate_in_the_readers_language(tmp_path, language, said):
    plate = {"rated_power_w": 3730.0, "rated_voltage_v": 400.0, "rated_current_a": 7.39629}
    make_run(tmp_path, COLD, result=result_of(COLD, MACHINE), plate=PLATE | plate)
    shown = rendered("shelves/archive.html", language, found=Archive(tmp_path).entries(), live=set(), limit=100)
    assert said in shown
    assert '<span class="col" aria-hidden="true">R<sub>s</sub></span>' in shown


def test_an_unknown_motor_is_refused_in_german():
    assert words_of("de")["tell"]("there is no motor 'PUMP-7'") == "Motor 'PUMP-7' gibt es nicht"


@pytest.mark.parametrize(
    ("holds", "may"),
    [
        (Held.AS_BEFORE, False),
        (Held.RESTORED, False),
        (Held.NEW, True),
        (Held.OLD_OR_NEW, True),
    ],
)
def test_old_values_are_offered_only_where_the_drive_may_hold_others(tmp_path, holds, may):
    make_run(tmp_path, COLD, result=result_of(COLD, MACHINE))
    (tmp_path / COLD / "snapshot.json").write_text("{}")
    assert replace(Archive(tmp_path).find(COLD), held=holds).can_restore is may


@pytest.mark.parametrize(("language", "value", "half"), [("en", "4.02 Ω", "± 0.95 Ω"), ("de", "4,02 Ω", "± 0,95 Ω")])
def test_a_recordings_values_end_where_their_intervals_end(language, value, half):
    found = {
        "parameters": {"stator_resistance_ohm": {"value": 4.0197, "std": 0.4832}},
        "mean_torque_nm": {"value": 9.4583, "std": 0.3571},
    }
    job = SimpleNamespace(verb="monitor", files=["pump.csv"], is_done=True, failure=None, report=None)
    shown = rendered(
        "shelves/recording.html",
        language,
        job=job,
        document=found | {"mean_speed_rad_per_s": {"value": 153.067, "std": 0.00118}},
    )
    said = shown.replace("&nbsp;", " ")
    assert f'<span class="val">{value}</span>' in said and half in said
    assert ("9.46 ± 0.70 N m" if language == "en" else "9,46 ± 0,70 N m") in said
    assert ("1461.682 ± 0.022 1/min" if language == "en" else "1461,682 ± 0,022 1/min") in said
