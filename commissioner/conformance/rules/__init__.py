"""All rules, in the order they are tried: whether this is the map at all, what only asks first, what writes next, what energises last."""

from __future__ import annotations

from commissioner.conformance.registry import Rule
from commissioner.conformance.rules import (
    enabling,
    excitation,
    identity,
    parameters,
    protocol,
    states,
    stopping,
    supervision,
    trips,
    window,
)

RULES: tuple[Rule, ...] = (
    *identity.RULES[:1],
    *protocol.RULES,
    *identity.RULES[1:],
    *supervision.RULES,
    *states.RULES,
    *parameters.RULES,
    *stopping.RULES,
    *enabling.RULES,
    *excitation.RULES,
    *window.RULES,
    *trips.RULES,
)
