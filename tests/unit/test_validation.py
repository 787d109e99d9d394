"""What pydantic finds wrong reaches a technician in the field's words, whatever kind of problem it is."""

import typing

import pytest
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core.core_schema import ErrorType

from commissioner.validation import first_problem, human, wanted


class Anything(dict):
    """A context that has everything."""

    def __missing__(self, key):
        return 1


class Inner(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    hold_s: typing.Annotated[float, Field(gt=0, le=60, allow_inf_nan=False)] = 1.0
    is_on: bool = True
    names: typing.Annotated[list[str], Field(min_length=1, max_length=2)] = ["a"]


class Table(Inner):
    model_config = ConfigDict(extra="forbid", strict=True)
    rated_current_a: typing.Annotated[float, Field(ge=0.05, lt=5e3, description="line rms")] = 1.0
    pole_pairs: typing.Annotated[int, Field(ge=1, le=24)] = 2
    kind: typing.Literal["bits", "none"] = "bits"
    name: typing.Annotated[str, Field(min_length=2, max_length=3, pattern="^[a-z]+$")] = "ab"
    inner: Inner = Inner()
    items: dict[str, Inner] = {}
    axes_deg: list[float] | typing.Literal["all"] = "all"


@pytest.mark.parametrize(
    ("document", "key", "expected"),
    [
        ({"rated_current_a": "5 A"}, "rated_current_a", "rated current: a number in A (line rms)"),
        ({"rated_current_a": 0.01}, "rated_current_a", "rated current: 0.05 A or more (line rms)"),
        ({"rated_current_a": 5e3}, "rated_current_a", "rated current: below 5000 A (line rms)"),
        ({"pole_pairs": 2.5}, "pole_pairs", "pole pairs: a whole number"),
        ({"pole_pairs": 25}, "pole_pairs", "pole pairs: at most 24"),
        ({"kind": "ring"}, "kind", "kind: one of 'bits' or 'none'"),
        ({"name": "a"}, "name", "name: text of at least 2 characters"),
        ({"name": "abcd"}, "name", "name: text of at most 3 characters"),
        ({"name": "A1"}, "name", "name: text of the form ^[a-z]+$"),
        ({"name": 3}, "name", "name: text"),
        ({"inner": {"is_on": "perhaps"}}, "inner.is_on", "is on: true or false"),
        ({"inner": {"hold_s": 0.0}}, "inner.hold_s", "hold: above 0 s"),
        ({"inner": {"hold_s": float("inf")}}, "inner.hold_s", "hold: a finite number in s"),
        ({"inner": {"names": []}}, "inner.names", "names: at least one entry"),
        ({"inner": {"names": ["a", "b", "c"]}}, "inner.names", "names: at most 2 entries"),
        ({"inner": {"names": "a"}}, "inner.names", "names: a list"),
        ({"axes_deg": 5}, "axes_deg", "axes: a list"),
        ({"axes_deg": [0.0, "x"]}, "axes_deg.1", "axes, entry 2: a number in degrees"),
        ({"inner": 5}, "inner", "inner: a table of keys and values"),
        ({"items": []}, "items", "items: a table of keys and values"),
        (
            {"inner": {"hold": 1.0}},
            "inner.hold",
            "no such key; known here: hold_s, is_on, names; did you mean 'hold_s'?",
        ),
        (
            {"items": {"x": {"hold": 1.0}}},
            "items.x.hold",
            "no such key; known here: hold_s, is_on, names; did you mean 'hold_s'?",
        ),
    ],
)
def test_a_problem_names_the_field_its_unit_and_what_is_wanted(document, key, expected):
    with pytest.raises(ValidationError) as caught:
        Table.model_validate(document)
    problem = first_problem(caught.value, Table)
    assert (problem.key, problem.expected) == (key, expected)


def test_a_misspelt_key_comes_before_the_one_that_is_missing_for_it():
    class Needed(BaseModel):
        model_config = ConfigDict(extra="forbid")
        pole_pairs: int

    with pytest.raises(ValidationError) as caught:
        Needed.model_validate({"polepairs": 2})
    assert (
        first_problem(caught.value, Needed).expected
        == "no such key; known here: pole_pairs; did you mean 'pole_pairs'?"
    )
    missing = next(one for one in caught.value.errors() if one["type"] == "missing")
    assert wanted(missing, Needed) == "pole pairs: needed"


def test_every_kind_of_problem_that_pydantic_knows_is_worded_without_its_own_sentence():
    kinds = typing.get_args(ErrorType)
    assert len(kinds) > 80
    for kind in kinds:
        said = wanted(
            {"type": kind, "loc": ("rated_current_a",), "msg": "Input should", "input": None, "ctx": Anything(some=1)}
        )
        assert "Input should" not in said and said.startswith(("rated current: ", "no such key")), kind


@pytest.mark.parametrize(
    ("key", "words"),
    [("inertia_kg_m2", ("inertia", "kg m2")), ("watchdog_s", ("watchdog", "s")), ("s", ("s", "")),
     ("axis_spread_percent", ("axis spread", "%")), ("connection", ("connection", ""))],
)  # fmt: skip
def test_a_key_as_words(key, words):
    assert human(key) == words
