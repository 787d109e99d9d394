"""The verdict on hand-made evidence: axes are compared where the iron was equally deep."""

from dataclasses import replace

from commissioner.motor.circuit import Quantity
from commissioner.motor.nameplate import prior
from commissioner.procedure.verdict import PARAMETERS, Decision, Evidence, decide
from commissioner.settings import load_motor, load_procedure

PLATE = load_motor("motor_2kw2")
VALUES = {
    name: Quantity(value, 0.001 * value)
    for name, value in zip(PARAMETERS, prior(PLATE).typical.as_tuple(), strict=True)
}
ACCEPTANCE = load_procedure(None, axes_deg=None).acceptance


def with_magnetizing(factor):
    l_m = VALUES["magnetizing_inductance_h"]
    return {**VALUES, "magnetizing_inductance_h": Quantity(factor * l_m.value, l_m.std)}


def test_axes_that_agree_at_one_flux_are_not_apart_because_one_went_deeper_into_the_iron():
    axes = ((0.0, VALUES), (60.0, with_magnetizing(0.9)))
    alike = ((0.0, VALUES), (60.0, with_magnetizing(1.001)))
    evidence = Evidence(VALUES, axes, at_one_flux=alike)
    assert decide(evidence, prior(PLATE), ACCEPTANCE, write_back=True).decision is Decision.WRITE_BACK


def test_axes_that_differ_at_one_flux_are_objected_to():
    alike = ((0.0, VALUES), (60.0, with_magnetizing(0.9)))
    verdict = decide(Evidence(VALUES, alike, at_one_flux=alike), prior(PLATE), ACCEPTANCE, write_back=True)
    assert verdict.decision is Decision.REJECT
    assert "magnetizing_inductance_h differs" in verdict.reason


def test_without_saturation_the_values_themselves_are_compared():
    axes = ((0.0, VALUES), (60.0, with_magnetizing(0.9)))
    evidence = replace(Evidence(VALUES, axes), at_one_flux=())
    assert decide(evidence, prior(PLATE), ACCEPTANCE, write_back=True).decision is Decision.REJECT
