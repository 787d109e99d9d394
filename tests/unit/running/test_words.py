"""What a technician reads of a running diagnosis."""

from commissioner.report.running.words import actions, headline, meaning, quantity, said, sentence

CAUSE = {
    "name": "stator_asymmetry", "equivalent": [], "form": "phase v", "confidence": 0.99, "gain_share": 1.0,
    "parameters": {"current_in_v_of_rated": {"value": 0.0386, "std": 0.0002, "unit": ""}},
}  # fmt: skip


def test_the_phase_stands_in_the_sentence():
    assert sentence(CAUSE).startswith("Phase v of the stator takes 3.86 % of rated current")


def test_a_size_that_the_data_leave_open_is_said_with_its_interval():
    """At one operating point saturation shows while its size does not: -14 % was said as 14 % more current, and no interval."""
    said = {
        value: sentence(
            {**CAUSE, "name": "magnetizing_saturation", "form": "air-gap flux",
             "parameters": {"extra_at_rated_flux": {"value": value, "std": std, "unit": ""}}}
        )
        for value, std in ((-0.14, 1.69), (0.52, 1.52), (0.31, 0.01))
    }  # fmt: skip
    assert "takes \u221210 ± 330 % more" in said[-0.14]
    assert "takes 50 ± 300 % more" in said[0.52]
    assert "takes 31.0 % more" in said[0.31]
    assert quantity({"value": 0.31, "std": 2.9, "unit": ""}) == "30 ± 570 %"
    assert quantity({"value": 0.31, "std": 290.0, "unit": ""}) == "not told"


def test_a_tie_says_so():
    late = {
        **CAUSE,
        "name": "sampling_delay",
        "equivalent": ["sensor_lag"],
        "parameters": {"delay_us": {"value": 50.0, "std": 1.0, "unit": "us"}},
    }
    assert sentence(late).startswith(
        "Sampling delay or sensor lag: these data cannot say which. The first would mean: "
    )
    assert quantity(late["parameters"]["delay_us"]) == "50.0 ± 2.0 µs"


def test_the_headline_states_the_share_that_was_kept_aside():
    document = {"verdict": "explained", "causes": [CAUSE], "gain": {"held_out": 0.987, "explained_share": 0.999}}
    assert headline(document).endswith("It explains 98.7 % of the simulation's error.")
    small = {
        **document, "gain": {**document["gain"], "held_out": None, "explained_share": 0.0},
        "causes": [{**document["causes"][0], "strength_over_noise": 0.072}],
    }  # fmt: skip
    assert "too small to matter: 0.072 of the noise" in headline(small) and "explains" not in headline(small)


def test_no_key_of_a_cause_and_no_digit_beyond_the_interval_is_shown():
    assert said("These data cannot tell apart: sampling_delay or sensor_lag.") == (
        "These data cannot tell apart: sampling delay or sensor lag."
    )
    assert quantity({"value": 4.7912, "std": 0.66, "unit": "us"}) == "4.8 ± 1.3 µs"


def test_what_one_of_a_class_asks_for_is_said_of_that_one_only():
    """ "Stop the motor soon" stood above a healthy motor, of which shorted turns and a second cage could not be told apart."""
    tied = {"name": "stator_asymmetry", "equivalent": ["rotor_skin_effect"]}
    document = {"verdict": "not_distinguishable", "reason": "", "causes": [tied], "next_experiment": None}
    assert [text.split(":")[0] for _, text in actions(document)] == [
        "If it is stator asymmetry",
        "If it is rotor skin effect",
    ]
    assert meaning(document)[2].startswith("If it is rotor skin effect: ")
    alone = {**document, "verdict": "explained", "causes": [{**tied, "equivalent": []}]}
    assert actions(alone)[0][1].startswith("Stop the motor")
