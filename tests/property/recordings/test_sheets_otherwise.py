"""A test sheet with windings, meters and units as others write them: one circuit, or a refusal that names its cause."""

import pytest

from commissioner.errors import DataRefused
from commissioner.operations.recordings.identify import IdentifyRequest, identify_any

MEANT = [0.2429, 0.1514, 3.484e-3, 35.11e-3]
"""7.5 hp, 208 V, 60 Hz, star: the textbook's circuit, as in test_test_sheets."""


def identified(tmp_path, text):
    path = tmp_path / "sheet.csv"
    path.write_text(text, encoding="utf-8")
    return [q["value"] for q in identify_any(IdentifyRequest((path,))).document["parameters"].values()][:4]


@pytest.mark.parametrize(
    ("names", "ohm"), [("R_U,R_V,R_W", 0.24285), ("RU,RV,RW", 0.24285), ("R12,R23,R31", 0.4857), ("R_L1L2 [Ohm],R_L2L3 [Ohm],R_L3L1 [Ohm]", 0.4857)]
)  # fmt: skip
@pytest.mark.parametrize("head", [("T [°C]", ""), ("T", "Hz,V,A,W,,,,°C")], ids=["beside", "below"])
def test_resistances_beside_a_temperature(tmp_path, names, ohm, head):
    """`R_U` was a voltage of phase U, and `T` a time."""
    row = ",".join([f"{ohm}"] * 3)
    text = f"f,U,I,P,{names},{head[0]}\n{head[1]}\n" if head[1] else f"f,U,I,P,{names},{head[0]}\n"
    found = identified(tmp_path, f"# connection: star\n{text}60,208,8.17,420,{row},22\n15,25,27.9,920,{row},22\n")
    assert found == pytest.approx(MEANT, rel=2e-3)


@pytest.mark.parametrize("head", ["Test,Freq.,V avg,I avg,P total", "Test,Frequency (Hz),V,I,Active Power Total (W)"])
def test_names_with_points_and_totals(tmp_path, head):
    found = identified(tmp_path, f"{head}\ndc,0,13.6,28,380.8\nno load,60,208,8.17,420\nlocked rotor,15,25,27.9,920\n")
    assert found == pytest.approx(MEANT, rel=2e-3)


@pytest.mark.parametrize(
    ("head", "units", "cause"),
    [
        ("test,f,U,I,P", ",Hz,% Un,% In,W", "none that is known"),
        ("test,f [Hz],U [% Un],I [% In],P [W]", "", "none that is known"),
        ("test,f [Hz],U [Vpk],I [Apk],P [W]", "", "is a peak"),
        ("test,f,U,I,P", ",Hz,Vpk,Apk,W", "is a peak"),
        ("test,nothing,U,I,P", "", "frequency_hz of the alternating-current tests is not there"),
    ],
)
def test_what_would_be_another_number_is_asked_for(tmp_path, head, units, cause):
    rows = "dc,0,13.6,28,380.8\nno load,60,208,8.17,420\nlocked rotor,15,25,27.9,920\n"
    with pytest.raises(DataRefused, match=cause):
        identified(tmp_path, f"{head}\n{units}\n{rows}" if units else f"{head}\n{rows}")
