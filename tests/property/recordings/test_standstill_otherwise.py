"""A standstill recording under other headers, units and vectors: the same numbers, or a refusal that names its cause."""

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.recordings.importers import contract_table
from commissioner.recordings.table import to_standstill

N, PERIOD = 40, 2e-4
K = np.arange(3 * N)
SEGMENT, AXIS = K // N, 60.0 * (K // N)
TIME = PERIOD * (K % N) + SEGMENT
ANGLE = np.deg2rad(AXIS)
VOLTS, AMPS = 20.0 * np.sin(0.21 * K) + 5.0, 2.0 * np.sin(0.21 * K - 0.7) + 0.5


def along(signal, phase):
    return signal * np.cos(ANGLE - 2.0 * np.pi / 3.0 * "uvw".index(phase))


U, V = along(AMPS, "u"), along(AMPS, "v")
ALPHA, BETA = AMPS * np.cos(ANGLE), AMPS * np.sin(ANGLE)
PHASES = [along(VOLTS, phase) for phase in "uvw"]
HEAD = ["time_s", "segment", "axis_deg", "voltage_axis_v", "current_u_a", "current_v_a"]
COLUMNS = [TIME, SEGMENT, AXIS, VOLTS, U, V]


def written(path, head, columns, units=None, above=""):
    rows = [head, *([units] if units else [])]
    rows += [[c if isinstance(c, str) else f"{c:.9g}" for c in row] for row in zip(*columns, strict=True)]
    path.write_text(above + "\n".join(",".join(row) for row in rows) + "\n", encoding="utf-8")
    return path


def assert_same(path):
    read = to_standstill(contract_table(path))
    assert np.array_equal(read.segment, SEGMENT)
    for name, meant in zip(HEAD[2:], COLUMNS[2:], strict=True):
        assert getattr(read, name) == pytest.approx(meant, abs=1e-5), name
    return read


@pytest.mark.parametrize(
    ("name", "per_degree"),
    [
        ("axis_rad", np.pi / 180), ("axis [rad]", np.pi / 180), ("axis [turns]", 1 / 360), ("axis (rev)", 1 / 360),
        ("axis_el_deg", 1), ("axis angle el. (deg)", 1), ("axis [° el]", 1), ("axis deg", 1),
    ],
)  # fmt: skip
def test_an_axis_in_any_unit_that_is_said(tmp_path, name, per_degree):
    assert_same(
        written(tmp_path / "a.csv", [*HEAD[:2], name, *HEAD[3:]], [*COLUMNS[:2], per_degree * AXIS, *COLUMNS[3:]])
    )


@pytest.mark.parametrize("per_degree", [np.pi / 180, 1 / 360])
@pytest.mark.parametrize("name", ["axis", "axis_deg"])
def test_axes_that_are_no_degrees_are_refused(tmp_path, name, per_degree):
    columns = [*COLUMNS[:2], per_degree * AXIS, *COLUMNS[3:]]
    path = written(tmp_path / "a.csv", [*HEAD[:2], name, *HEAD[3:]], columns)
    with pytest.raises(DataRefused, match="look like radians or turns"):
        to_standstill(contract_table(path))


@pytest.mark.parametrize("unit", ["% In", "% of rated", "p.u.", "A/bit"])
def test_a_unit_that_needs_a_factor_is_asked_for_wherever_it_stands(tmp_path, unit):
    """`% In` had been passed over: per cent of the rated current as amperes."""
    columns = [*COLUMNS[:4], 20.0 * U, 20.0 * V]
    below = written(tmp_path / "a.csv", [*HEAD[:4], "Ia", "Ib"], columns, ["s", "", "deg", "V", unit, unit])
    beside = written(tmp_path / "b.csv", [*HEAD[:4], f"Ia [{unit}]", f"Ib [{unit}]"], columns)
    for path in (below, beside):
        with pytest.raises(DataRefused, match=r"none that is known|needs a factor"):
            contract_table(path)


@pytest.mark.parametrize("unit", ["A peak", "Apk", "A pk"])
def test_peaks_are_samples_and_rms_is_said(tmp_path, unit):
    assert_same(written(tmp_path / "a.csv", [*HEAD[:4], f"Ia [{unit}]", f"Ib [{unit}]"], COLUMNS))
    for said in ("Arms", "A rms"):
        table = contract_table(written(tmp_path / "b.csv", [*HEAD[:4], f"Ia [{said}]", f"Ib [{said}]"], COLUMNS))
        assert any(note.code == "rms" for note in table.notes)


@pytest.mark.parametrize("names", [("i_alpha", "i_beta"), ("Iα [A]", "Iβ [A]"), ("current_alpha_a", "current_beta_a")])
def test_components_are_phases(tmp_path, names):
    read = assert_same(written(tmp_path / "a.csv", [*HEAD[:4], *names], [*COLUMNS[:4], ALPHA, BETA]))
    assert read.current_w_a is None
    volts = [VOLTS * np.cos(ANGLE), VOLTS * np.sin(ANGLE)]
    path = written(
        tmp_path / "b.csv", [*HEAD[:3], "u_alpha_ref", "u_beta_ref", *names], [*COLUMNS[:3], *volts, ALPHA, BETA]
    )
    assert_same(path)


def test_voltages_of_phases_lie_along_the_axis(tmp_path):
    common = [v + 280.0 for v in PHASES]
    assert_same(written(tmp_path / "a.csv", [*HEAD[:3], "Uu", "Uv", "Uw", *HEAD[4:]], [*COLUMNS[:3], *common, U, V]))
    lines = [PHASES[0] - PHASES[1], PHASES[1] - PHASES[2]]
    assert_same(written(tmp_path / "b.csv", [*HEAD[:3], "Uuv", "Uvw", *HEAD[4:]], [*COLUMNS[:3], *lines, U, V]))
    wrong = [*COLUMNS[:2], 0.5 * AXIS, *PHASES, U, V]
    with pytest.raises(DataRefused, match="do not lie along axis_deg"):
        contract_table(written(tmp_path / "c.csv", [*HEAD[:3], "Uu", "Uv", "Uw", *HEAD[4:]], wrong))


@pytest.mark.parametrize("said", ["axis_deg: 60 deg", "axis: 60", "Achswinkel: 60 Grad", "axis_rad: 1.04719755"])
def test_one_axis_without_gaps_is_one_segment(tmp_path, said):
    part = slice(N, 2 * N)
    columns = [c[part] for c in (TIME, VOLTS, U, V)]
    read = to_standstill(
        contract_table(written(tmp_path / "a.csv", [HEAD[0], *HEAD[3:]], columns, above=f"# {said}\n"))
    )
    assert read.axis_deg == pytest.approx(np.full(N, 60.0), abs=1e-5)
    assert not read.segment.any() and any(note.code == "segment" for note in read.notes)


def test_segments_that_are_missing_are_asked_for(tmp_path):
    path = written(tmp_path / "a.csv", [HEAD[0], *HEAD[2:]], [TIME, *COLUMNS[2:]])
    with pytest.raises(DataRefused, match="segment is not there") as refused:
        to_standstill(contract_table(path))
    assert refused.value.value == "3 axes, 2 gaps"


def test_segments_in_words_are_numbered(tmp_path):
    words = [("DC", "step at 60", "DC again")[k] for k in SEGMENT]
    assert_same(written(tmp_path / "a.csv", HEAD, [TIME, words, *COLUMNS[2:]]))


def test_a_scale_above_the_contracts_own_columns_is_said(tmp_path):
    table = contract_table(written(tmp_path / "a.csv", HEAD, COLUMNS, above="# current_scale: 0.001 A/count\n"))
    assert any(note.code == "factors" for note in table.notes)


def test_decimal_commas_above_decimal_commas(tmp_path):
    path = tmp_path / "a.csv"
    rows = ["# power_factor: 0,81", "# rated_current_a: 4,86", ";".join(HEAD)]
    path.write_text(
        "\n".join([*rows, *(";".join(f"{c:.6f}".replace(".", ",") for c in r) for r in zip(*COLUMNS, strict=True))])
    )
    assert contract_table(path).metadata == {"power_factor": 0.81, "rated_current_a": 4.86}
    assert_same(path)
