"""A DC link that was recorded: its ripple is set apart, its course is the sag's, and a model file does without it."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.causes.mains_lines import recorded_sag
from commissioner.diagnose.causes.regressors import RECORDED_LINK

SAG = CATALOGUE["dc_link_sag"]


def with_link(setting, course):
    """The setting in whose record the link swings by `course(segment, channels)`."""
    record = setting.record
    swings = [course(s, c) for s, c in zip(record.segments, record.channels, strict=True)]
    segments = tuple(replace(s, link_swing=x) for s, x in zip(record.segments, swings, strict=True))
    record = replace(record, segments=segments).with_channels(((RECORDED_LINK,), [x[:, None] for x in swings]))
    return replace(setting, record=record)


def tone(hertz):
    return lambda segment, channels: 0.01 * np.cos(2.0 * np.pi * hertz * segment.time_s)


def model_of(setting, nominal, **numbers):
    terms = SAG.form_of(numbers, SAG.terms(setting))
    return replace(nominal, terms=terms, values=tuple(numbers.get(t.symbol, 0.0) for t in terms))


def test_a_sag_has_the_same_size_on_the_recorded_link_and_on_lagged_power(setting, nominal):
    column = setting.record.channel("sag_3ms")
    seen = with_link(setting, lambda s, c: 0.1 * c[:, column])
    model = model_of(seen, nominal, link_recorded=0.5, sag_3ms=0.01)
    alone = SAG.without_recorded(model, seen.record)
    wanted = {"sag_3ms": 0.06}
    assert alone.of("dc_link_sag") == pytest.approx(
        {t.symbol: wanted.get(t.symbol, 0.0) for t in model.terms}, abs=1e-6
    )
    sizes = [SAG.sizes(seen, m.of("dc_link_sag"))["sag_at_rated_power"][0] for m in (model, alone)]
    assert sizes == pytest.approx([0.06, 0.06], rel=1e-3)


def test_what_the_load_does_not_make_is_said_as_a_part_of_the_recorded_swing(setting, nominal):
    seen = with_link(setting, tone(7.3))
    assert SAG.sizes(seen, model_of(seen, nominal, link_recorded=0.9).of("dc_link_sag")) == {
        "of_the_recorded_swing": (0.9, "1")
    }


def test_a_rectifiers_ripple_is_none_of_it(setting):
    both = with_link(setting, lambda s, c: 3.0 * tone(300.4)(s, c) + tone(7.3)(s, c))
    for segment, left in zip(both.record.segments, recorded_sag(both.record), strict=True):
        assert np.std(left - tone(7.3)(segment, None)) < 0.02 * np.std(left)


def test_a_link_that_was_recorded_in_some_segments_only_is_none(setting):
    seen = with_link(setting, tone(7.3)).record
    assert not recorded_sag(replace(seen, segments=(replace(seen.segments[0], link_swing=None), *seen.segments[1:])))
    assert not recorded_sag(setting.record)
    assert RECORDED_LINK not in {t.symbol for t in SAG.terms(setting)}


def test_a_sag_that_a_coarse_record_of_the_link_hides_is_said_at_rated_power(setting, nominal):
    """Of a link whose noise is all that was seen, 0.04 +- 0.04 was called the part that reaches the motor."""
    noise = np.random.default_rng(1)
    column = setting.record.channel("sag_3ms")
    seen = with_link(setting, lambda s, c: 0.002 * noise.standard_normal(s.count) + 0.01 * c[:, column])
    sizes = SAG.sizes(seen, model_of(seen, nominal, link_recorded=0.04, sag_3ms=0.01).of("dc_link_sag"))
    assert sizes["sag_at_rated_power"][0] == pytest.approx(0.01, rel=0.05)
