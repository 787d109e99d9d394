"""A configuration file that cannot be right is refused with file, key, value and what would be right."""

import tomllib

import pytest
from pydantic import ValidationError

from commissioner.errors import ConfigurationError, UsageError
from commissioner.identify.intake.plate import nameplate_from
from commissioner.link.files.drive_file import load_profile
from commissioner.recordings.plate import inertia_overruled, plate_of
from commissioner.recordings.reading.mapping import read_mapping
from commissioner.service.configuration import ServiceFile
from commissioner.service.routes.runs import RunWish
from commissioner.settings import CONFIG_FOLDER, load_motor, load_procedure
from commissioner.study.specification import Specification

PLATE = (CONFIG_FOLDER / "motors" / "motor_2kw2.toml").read_text()


def _motor(tmp_path, text):
    path = tmp_path / "motor.toml"
    path.write_text(text)
    return str(path)


def test_every_shipped_motor_and_the_procedure_load():
    for path in (CONFIG_FOLDER / "motors").glob("*.toml"):
        assert load_motor(path.stem).rated_power_w > 0
    assert load_procedure().tests_deg == (0.0, 60.0, 120.0, 0.0)


@pytest.mark.parametrize(
    ("old", "new", "key", "hint"),
    [
        ("rated_power_w = 2200.0", "rated_power_w = 2.2", "rated_power_w", "watts"),
        ("rated_power_w = 2200.0", "rated_power_kw = 2.2", "rated_power_kw", "rated_power_w"),
        ("pole_pairs = 2", "pole_pairs = 2.5", "pole_pairs", "whole number"),
        ("pole_pairs = 2", "pole_pairs = 4", "rated_speed_rpm", "synchronous"),
        ("power_factor = 0.80", "power_factor = 80", "power_factor", "cos phi"),
        ('connection = "star"', 'connection = "ring"', "connection", "star (Y, wye) or delta"),
        ('connection = "star"', "connection = 3", "connection", "star (Y, wye) or delta"),
        ("rated_current_a = 5.0", "rated_current_a = [5.0]", "rated_current_a", "rated current: a number in A"),
        ("rated_current_a = 5.0", 'rated_current_a = "5 A"', "rated_current_a", "number"),
        ("rated_current_a = 5.0", "rated_current_a = nan", "rated_current_a", "0.05"),
        ("rated_voltage_v = 400.0", "", "rated_voltage_v", "volts"),
        ("rated_current_a = 5.0", "rated_current_a = 2.0", "rated_power_w", ""),
    ],
)
def test_an_impossible_plate_names_file_key_value_and_what_would_be_right(tmp_path, old, new, key, hint):
    assert old in PLATE
    path = _motor(tmp_path, PLATE.replace(old, new))
    with pytest.raises(ConfigurationError) as caught:
        load_motor(path)
    error = caught.value
    assert error.exit_code == 2
    assert error.file == path
    assert error.key == key
    assert hint in str(error.limit)
    assert key in error.remedy
    assert "Input should" not in str(error.limit)


@pytest.mark.parametrize(
    ("written", "meant"),
    [("Y", "star"), ("y", "star"), ("WYE", "star"), (" Star ", "star"), ("D", "delta"), ("\u0394", "delta"),
     ("\u25b3", "delta"), ("triangle", "delta"), ("Delta", "delta")],
)  # fmt: skip
def test_star_and_delta_are_read_as_plates_and_drives_write_them(tmp_path, written, meant):
    path = _motor(tmp_path, PLATE.replace('connection = "star"', f'connection = "{written}"'))
    assert load_motor(path).connection == meant
    numbers = {key: value for key, value in tomllib.loads(PLATE).items() if isinstance(value, float | int)}
    assert nameplate_from(numbers | {"connection": written}).connection == meant
    assert (
        plate_of(
            {key: float(value) for key, value in numbers.items()} | {"connection": written}, "x.csv", None
        ).connection
        == meant
    )


def test_a_ring_is_no_connection_in_a_recording_either():
    numbers = {key: value for key, value in tomllib.loads(PLATE).items() if isinstance(value, float | int)}
    with pytest.raises(ConfigurationError) as caught:
        nameplate_from(numbers | {"connection": "ring"})
    assert "star (Y, wye) or delta" in str(caught.value.as_dict())


def test_a_byte_order_mark_of_windows_is_no_part_of_a_file(tmp_path):
    path = tmp_path / "motor.toml"
    path.write_text(PLATE, "utf-8-sig")
    assert load_motor(str(path)) == load_motor("motor_2kw2")
    path.write_text('[columns]\nCH1 = "current_u_a"\n', "utf-8-sig")
    assert read_mapping(path).columns["CH1"].column == "current_u_a"


def test_an_umlaut_of_another_encoding_is_told_with_its_line(tmp_path):
    path = tmp_path / "motor.toml"
    path.write_bytes(PLATE.encode() + "# Lüfter Süd\n".encode("latin-1"))
    with pytest.raises(ConfigurationError) as caught:
        load_motor(str(path))
    assert f"in line {len(PLATE.splitlines()) + 1}: save it as UTF-8" in caught.value.limit


def test_an_inertia_that_only_the_recording_states_stays_and_another_one_is_told(tmp_path):
    """The manual's own example took 0.015 of the motor file for the 0.03 of motor and load, and said nothing: half the load torque."""
    said = {"inertia_kg_m2": 0.03}
    bare = "\n".join(line for line in PLATE.splitlines() if "inertia" not in line) + "\n"
    assert plate_of(said, "x.csv", _motor(tmp_path, bare)).inertia_kg_m2 == 0.03
    plate = plate_of(said, "x.csv", _motor(tmp_path, bare + "inertia_kg_m2 = 0.015\n"))
    assert plate.inertia_kg_m2 == 0.015
    (note,) = inertia_overruled(said, plate)
    assert "0.03" in note.what and "0.015" in note.what and "--inertia" in note.what
    assert inertia_overruled({"inertia_kg_m2": 0.0152}, plate) == inertia_overruled({}, plate) == ()


def test_a_decimal_comma_is_told_with_its_line_and_the_point(tmp_path):
    current = next(line for line in PLATE.splitlines() if line.startswith("rated_current_a"))
    number = PLATE.splitlines().index(current) + 1
    with pytest.raises(ConfigurationError) as caught:
        load_motor(_motor(tmp_path, PLATE.replace(current, "rated_current_a = 4,86  # A")))
    assert f"in line {number} a decimal comma" in caught.value.limit
    assert "rated_current_a = 4.86" in caught.value.limit


@pytest.mark.parametrize(
    ("key", "line", "what", "right"),
    [
        ("connection", "connection = star  # as wired", "without quotes", 'connection = "star"'),
        ("connection", "connection = “star”", "typographic quotes", 'connection = "star"'),
        ("rated_power_w", "rated_power_w = 2200 W", "a unit stands behind the number", "rated_power_w = 2200"),
        ("rated_power_w", "rated_power_w = 2.2kW # plate", "a unit stands behind the number", "rated_power_w = 2.2"),
        ("rated_power_w", "rated_power_w: 2200", "a colon stands where TOML has =", "rated_power_w = 2200"),
        ("rated_power_w", "rated_power_w =", "nothing stands behind the =", "rated_power_w = ..."),
    ],
)
@pytest.mark.parametrize("ends", ["\n", "\r\n"])
def test_a_line_that_people_write_in_place_of_toml_is_told_with_the_right_one(tmp_path, key, line, what, right, ends):
    old = next(one for one in PLATE.splitlines() if one.startswith(key))
    number = PLATE.splitlines().index(old) + 1
    path = tmp_path / "motor.toml"
    path.write_bytes(PLATE.replace(old, line).replace("\n", ends).encode())
    with pytest.raises(ConfigurationError) as caught:
        load_motor(str(path))
    assert f"in line {number} " in caught.value.limit
    assert what in caught.value.limit and caught.value.limit.endswith(right)


@pytest.mark.parametrize(
    ("encoding", "told"),
    [("utf-16", "UTF-16, which Windows calls Unicode"), ("cp1252", "in another encoding, seen in line 1")],
)
def test_a_file_in_another_encoding_is_to_be_saved_as_utf_8(tmp_path, encoding, told):
    path = tmp_path / "motor.toml"
    path.write_text(PLATE.replace("[", "").replace("2.2 kW", "Lüfter"), encoding)
    with pytest.raises(ConfigurationError) as caught:
        load_motor(str(path))
    assert f"the file is {told}: save it as UTF-8" in caught.value.limit


def test_a_number_that_only_looks_like_one_with_a_unit_is_not_blamed(tmp_path):
    with pytest.raises(ConfigurationError) as caught:
        load_motor(_motor(tmp_path, "rated_power_w = 2e3\npole_pairs = 0x2\nrated_current_a = 5 A\n"))
    assert "in line 3 a unit stands behind the number: rated_current_a = 5" in caught.value.limit


def test_one_pole_pair_is_one(tmp_path):
    with pytest.raises(ConfigurationError) as caught:
        load_motor(_motor(tmp_path, PLATE.replace("pole_pairs = 2", "pole_pairs = 1")))
    assert "3000 1/min of 1 pole pair at 50 Hz" in str(caught.value.limit)
    assert "is of 2 pole pairs" in str(caught.value.limit)


@pytest.mark.parametrize("key", ["pole_pairs", "rated_power_w", "inertia_kg_m2"])
def test_true_is_no_number(tmp_path, key):
    old = next(one for one in PLATE.splitlines() if one.startswith(key))
    with pytest.raises(ConfigurationError) as caught:
        load_motor(_motor(tmp_path, PLATE.replace(old, f"{key} = true")))
    assert caught.value.key == key and "not true" in str(caught.value.limit)


def test_broken_toml_and_missing_files_are_named(tmp_path):
    with pytest.raises(ConfigurationError, match="syntax"):
        load_motor(_motor(tmp_path, "rated_power_w = "))
    with pytest.raises(UsageError, match="no file"):
        load_motor(str(tmp_path / "nothing.toml"))
    with pytest.raises(UsageError) as caught:
        load_motor("no_such_motor")
    assert "motor_2kw2" in str(caught.value.limit) and "did you mean" not in str(caught.value)


def test_a_folder_in_place_of_a_name_is_called_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "motors").mkdir()
    with pytest.raises(UsageError, match="motors is a folder"):
        load_motor("motors")


@pytest.mark.parametrize(
    ("load", "asked", "meant"),
    [
        (load_motor, "motor_2kw3", "motor_2kw2"),
        (load_profile, "danfos_fc302", "danfoss_fc302"),
        (load_profile, "Yaskawa_A1000", "yaskawa_a1000"),
        (load_profile, "simul", "simulated"),
    ],
)
def test_a_name_that_is_nearly_one_that_comes_along_is_asked_back(load, asked, meant):
    with pytest.raises(UsageError, match=f"did you mean '{meant}'"):
        load(asked)


def test_a_files_error_says_its_limit_once_and_what_to_do_with_the_key(tmp_path):
    """A key that is missing is added, one that nobody knows is renamed, another is corrected."""
    for old, new, remedy in (
        ("power_factor = 0.80", "", "add power_factor in "),
        ("power_factor = 0.80", "power_facter = 0.80", "rename or remove power_facter in "),
        ("power_factor = 0.80", "power_factor = 8.0", "correct power_factor in "),
    ):
        path = _motor(tmp_path, PLATE.replace(old, new))
        with pytest.raises(ConfigurationError) as caught:
            load_motor(path)
        assert caught.value.remedy == f"{remedy}{path}"
        assert str(caught.value.limit)
    assert "did you mean" not in str(caught.value.limit)


def test_a_huge_file_is_not_read(tmp_path):
    with pytest.raises(ConfigurationError, match="file"):
        load_motor(_motor(tmp_path, "#" * 2_000_000))


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("watchdog_s = 0.5", "watchdog_s = 1.5", "supervision.watchdog_s"),
        ("flux_fraction = 0.9", "flux_fraction = 1.1", "limits.flux_fraction"),
        ("first_scale = 0.1", "first_scales = 0.1", "excitation.first_scale"),
        ("orientations_deg = [0.0, 60.0, 120.0]", "orientations_deg = []", "axes.orientations_deg"),
    ],
)
def test_a_procedure_that_cannot_be_right_is_refused(tmp_path, old, new, key):
    text = (CONFIG_FOLDER / "procedure.toml").read_text()
    assert old in text
    path = tmp_path / "procedure.toml"
    path.write_text(text.replace(old, new))
    with pytest.raises(ConfigurationError) as caught:
        load_procedure(path)
    assert caught.value.key.startswith(key)


@pytest.mark.parametrize(
    ("replaced", "key", "value", "limit"),
    [
        (
            ("total_time_s = 240.0", "total_time_s = 15.9"),
            "limits.total_time_s",
            15.9,
            "at least limits.axis_time_s = 16.0 s",
        ),
        (("\nseconds = 4.6", "\nseconds = 16"), "excitation.seconds", 16.0, "less than limits.axis_time_s = 16.0 s"),
        (
            ("axis_time_s = 16.0", "axis_time_s = 4.0"),
            "excitation.seconds",
            4.6,
            "less than limits.axis_time_s = 4.0 s",
        ),
    ],
)
def test_times_that_contradict_each_other_are_refused_with_both_keys(tmp_path, replaced, key, value, limit):
    text = (CONFIG_FOLDER / "procedure.toml").read_text()
    assert replaced[0] in text
    path = tmp_path / "procedure.toml"
    path.write_text(text.replace(*replaced))
    with pytest.raises(ConfigurationError) as caught:
        load_procedure(path)
    error = caught.value
    assert (error.exit_code, error.step) == (2, "read configuration")
    assert (error.key, error.value, error.limit) == (key, value, limit)
    assert key in error.remedy
    assert "limits.axis_time_s" in str(error.limit)


def test_a_run_may_be_as_long_as_its_one_test_and_a_test_just_longer_than_its_tones(tmp_path):
    path = tmp_path / "procedure.toml"
    text = (CONFIG_FOLDER / "procedure.toml").read_text()
    path.write_text(
        text.replace("total_time_s = 240.0", "total_time_s = 23.1").replace("\nseconds = 4.6", "\nseconds = 15.9")
    )
    assert load_procedure(path, (0.0,)).limits.total_time_s == 23.1
    with pytest.raises(
        ConfigurationError
    ) as caught:  # four tests of it were ended at the limit, the motor energised in vain
        load_procedure(path)
    assert (caught.value.key, caught.value.value) == ("limits.total_time_s", 23.1)
    assert caught.value.limit == "at least 92 s, which 4 axis tests take"


@pytest.mark.parametrize("axis_deg", [17.0, 45.0, -45.0, 1.0, 29.0, 359.0])
def test_an_axis_beside_which_the_legs_drive_a_current_is_refused_before_anything_is_energised(axis_deg):
    with pytest.raises(UsageError) as caught:
        load_procedure(axes_deg=(0.0, axis_deg))
    assert (caught.value.exit_code, caught.value.value) == (2, f"{axis_deg:g} deg")
    assert "multiples of 30 deg" in str(caught.value.limit)


@pytest.mark.parametrize(
    ("model", "table"),
    [
        (Specification, {"kind": "commission", "axes_deg": [0, 45]}),
        (ServiceFile, {"service": {"axes_deg": [45]}}),
        (RunWish, {"drive": "d", "motor": "m", "confirm": True, "axes_deg": [17]}),
    ],
)
def test_so_do_the_files_and_requests_that_runs_are_made_of(model, table):
    with pytest.raises(ValidationError, match="multiples of 30 deg"):
        model.model_validate(table)


def test_every_axis_on_which_the_legs_are_alike_is_taken():
    axes_deg = tuple(30.0 * k for k in range(-6, 6))
    assert load_procedure(axes_deg=axes_deg).axes_deg == axes_deg
    assert load_procedure(axes_deg=(-0.4, 359.6, 90.4)).axes_deg == (-0.4, 359.6, 90.4)
