"""The API, fuzzed from its own description: no request breaks the service, each refusal is a problem, nothing moves."""

from contextlib import nullcontext, suppress

import schemathesis
from hypothesis import HealthCheck, given, settings
from hypothesis.errors import Unsatisfiable
from schemathesis import GenerationMode

EXAMPLES = 5
"""Of each operation, as described and against the description."""
LEFT_OUT = r"/api/simulator$|/events$"
"""Starts another process each time, its one field being a choice; a stream that ends with its run."""


def test_no_request_breaks_the_service_or_energises(service):
    schema = schemathesis.openapi.from_url(f"{service.url}/openapi.json")
    seen: dict[int, int] = {}

    def judge(case):
        answer = case.call(timeout=60)
        seen[answer.status_code] = seen.get(answer.status_code, 0) + 1
        assert answer.status_code < 500 or answer.status_code in (502, 503), f"{case.method} {case.path}: {answer.text}"
        if answer.status_code >= 400:
            assert answer.headers["content-type"] == ["application/problem+json"], (
                f"{case.method} {case.path}: {answer.text}"
            )
            problem = answer.json()
            assert (
                problem["status"] == answer.status_code and problem["title"] and problem["step"] and problem["remedy"]
            )
        assert "Traceback" not in answer.text

    energised = [line["event"] for line in service.truth()].count("energised")
    for result in schema.exclude(path_regex=LEFT_OUT).get_all_operations():
        for mode in (GenerationMode.POSITIVE, GenerationMode.NEGATIVE):
            bounded = settings(
                max_examples=EXAMPLES,
                deadline=None,
                derandomize=True,
                suppress_health_check=list(HealthCheck),
                database=None,
            )
            nothing_to_violate = suppress(Unsatisfiable) if mode == GenerationMode.NEGATIVE else nullcontext()
            with nothing_to_violate:
                bounded(given(case=result.ok().as_strategy(mode))(judge))()
    assert sum(seen.values()) > 200 and seen[200] and seen[422] and seen[404]
    assert [line["event"] for line in service.truth()].count("energised") == energised
    assert service.client.get("/api/health").json()["status"] == "ok"
