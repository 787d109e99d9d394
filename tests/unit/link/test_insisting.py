"""A lock, or the switch that makes writes lasting, is put back although the link takes a request along."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from commissioner.errors import ReplyTimeout, RequestRefused
from commissioner.link.drive.ordinary.insisting import ATTEMPTS, insist
from commissioner.link.drive.ordinary.unlocking import unlocked
from commissioner.link.drive.putting import Direct

FACTS = {"step": "", "value": "", "limit": "", "remedy": ""}


class Wire:
    """A port that loses its first `lost` requests to put something back."""

    def __init__(self, lost):
        self.lost, self.seen, self.coil = lost, [], False

    def write(self, address, values):
        self._take((address, *values), values == [0])

    def write_coil(self, address, value):
        self._take((address, value), not value)
        self.coil = value

    def read_coil(self, address):
        return self.coil

    def _take(self, what, puts_back):
        if puts_back and self.lost:
            self.lost -= 1
            raise ReplyTimeout("no answer", **FACTS)
        self.seen.append(what)


PROFILE = SimpleNamespace(unlock=SimpleNamespace(writes=((9, 1),), locks=((9, 0), (8, 0))))


@pytest.mark.parametrize("lost", range(ATTEMPTS))
def test_a_drive_is_locked_again(lost):
    wire = Wire(lost)
    with unlocked(wire, PROFILE):
        pass
    assert wire.seen == [(9, 1), (9, 0), (8, 0)]


@pytest.mark.parametrize("lost", range(ATTEMPTS))
def test_writes_are_not_left_lasting(lost):
    wire = Wire(lost)
    items = SimpleNamespace(port=wire, profile=PROFILE)
    sets = SimpleNamespace(items=items, store=SimpleNamespace(coil=64))
    with Direct(sets, print, print, print)._store_mode(True):
        assert wire.coil
    assert not wire.coil


def test_a_link_that_is_gone_is_told_and_a_refusal_is_an_answer():
    with pytest.raises(ReplyTimeout), unlocked(Wire(ATTEMPTS), PROFILE):
        pass
    asked = []

    def refuse():
        asked.append(1)
        raise RequestRefused("no", **FACTS)

    with pytest.raises(RequestRefused):
        insist(refuse)
    assert len(asked) == 1
