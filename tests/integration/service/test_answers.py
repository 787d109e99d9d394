"""What is sent is what OpenAPI says: whole answers, every key. Those of all other tests of this folder are looked at, too (`conftest`)."""

import pytest
from starlette.testclient import TestClient

from commissioner.errors import UsageError
from commissioner.service.access.accounts import Role
from commissioner.service.application import create_app
from commissioner.service.configuration import Settings
from commissioner.service.parts import make_parts
from commissioner.settings import CONFIG_FOLDER, ProcedureFile, load_procedure, read_toml
from tests.support.archive.synthetic import MACHINE, make_run, result_of
from tests.support.service.described import Description

PLATE = {"rated_power_w": 2200, "rated_voltage_v": 400, "rated_frequency_hz": 50, "rated_current_a": 5.0, "rated_speed_rpm": 1436,
         "power_factor": 0.8, "pole_pairs": 2, "connection": "star"}  # fmt: skip
GOOD, CUT, BETTER = "20260101-000000-simulated-a", "20260102-000000-simulated-b", "20260103-000000-simulated-c"
NEW = {"name": "otto", "password": "operating 1234", "role": "operator"}
DRIVE = {"id": "lab", "name": "Lab", "url": "tcp://127.0.0.1:9?device=1", "profile": "simulated"}
PACKAGED = read_toml(CONFIG_FOLDER / "procedure.toml")
LONGER = PACKAGED | {"excitation": PACKAGED["excitation"] | {"seconds": 11.5}}
ASKED = (
    ("GET", "/api/health", None),
    ("GET", "/api/drives", None),
    ("POST", "/api/drives", DRIVE),
    ("GET", "/api/drives/lab/state", None),
    ("POST", "/api/drives/lab/control", {"do": "ask"}),
    ("GET", "/api/motors", None),
    ("POST", "/api/motors", {"id": "mine", **PLATE}),
    ("GET", "/api/motors/pump/trend", None),
    ("POST", "/api/procedures", {"id": "longer", "procedure": LONGER}),
    ("GET", "/api/procedures", None),
    ("POST", "/api/nameplates/validate", PLATE),
    ("POST", "/api/nameplates/validate", {"pole_pairs": "two"}),
    ("GET", "/api/runs", None),
    ("GET", "/api/runs?motor=&drive=&outcome=&since=&limit=", None),
    ("GET", f"/api/runs/{CUT}", None),
    ("POST", f"/api/runs/{GOOD}/stop", None),
    ("POST", "/api/stop", None),
    ("GET", f"/api/incoming/{GOOD}", None),
    ("PUT", "/api/incoming/20260104-000000-x/journal.jsonl", None),
    ("GET", "/api/accounts", None),
    ("POST", "/api/accounts", NEW),
    ("DELETE", "/api/accounts/otto", None),
    ("GET", "/api/audit", None),
    ("POST", "/api/logout", None),
)


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    folder = tmp_path_factory.mktemp("app")
    for run, result in ((GOOD, MACHINE), (CUT, None), (BETTER, MACHINE)):
        document = result_of(run, result) if result else None
        make_run(folder / "runs", run, result=document, closed=result is not None, origin={"motor": "pump"})
    parts = make_parts(Settings(folder / "runs", folder / "data"))
    parts.accounts.add("ada", Role.ADMINISTRATOR, "administering 1234")
    made = TestClient(create_app(parts), base_url="http://127.0.0.1:8321")
    yield made
    parts.desk.watch(parts.library.drive("lab")).close()


@pytest.fixture(scope="module")
def described(client):
    return Description(client.get("/openapi.json").json())


@pytest.fixture(scope="module")
def token(client, described):
    answer = client.post("/api/login", json={"name": "ada", "password": "administering 1234"})
    described.judge("POST", "/api/login", answer.status_code, answer.json())
    return {"x-csrf-token": answer.json()["csrf"]}


def test_every_answer_is_as_described(client, described, token):
    for method, path, body in ASKED:
        answer = client.request(method, path, json=body, headers=token)
        assert answer.status_code < 300, answer.text
        described.judge(method, path.partition("?")[0], answer.status_code, answer.json())


def test_a_procedure_that_was_sent_is_kept_and_chosen_by_its_id(client):
    login = client.post("/api/login", json={"name": "ada", "password": "administering 1234"}).json()
    parts = client.app.state.parts
    longer = parts.library.put_procedure("longer", ProcedureFile.model_validate(LONGER))
    assert load_procedure(longer.path).excitation.seconds == 11.5
    assert [one.id for one in parts.library.procedures()] == ["standard", "longer"]
    assert parts.desk.commissioning([0], write_back=False, procedure=longer)[-2:] == ["--procedure", str(longer.path)]
    late = LONGER | {"supervision": LONGER["supervision"] | {"watchdog_s": 2.0}}
    for wrong, named in (
        ({"id": "late", "procedure": late}, "watchdog_s"),
        ({"id": "bad", "procedure": LONGER | {"x": 1}}, "x"),
        (
            {"id": "aslant", "procedure": LONGER | {"axes": LONGER["axes"] | {"orientations_deg": [0, 45]}}},
            "axis 45 deg",
        ),
        ({"id": "standard", "procedure": LONGER}, "standard"),
    ):
        answer = client.post("/api/procedures", json=wrong, headers={"x-csrf-token": login["csrf"]})
        assert answer.status_code == 422 and named in answer.json()["title"]
    with pytest.raises(UsageError, match="axis 45 deg"):
        parts.desk.commissioning([0, 45], write_back=False, procedure=longer)


@pytest.mark.parametrize(("method", "path"), [("GET", "/nosuch"), ("PUT", "/api/health"), ("GET", "/api/compare")])
def test_a_problem_names_step_value_limit_and_remedy(client, token, method, path):
    problem = client.request(method, path, headers=token).json()
    assert all(problem[fact] for fact in ("title", "step", "value", "limit", "remedy"))


def test_a_result_of_an_older_version_passes_as_it_lies_there(client, token):
    client.post("/api/login", json={"name": "ada", "password": "administering 1234"})
    assert client.get(f"/api/runs/{GOOD}").json() == result_of(GOOD, MACHINE)


def test_what_is_not_described_is_seen(described):
    answer = {"status": "ok", "version": "1", "runs_live": [], "is_warm": True}
    described.judge("GET", "/api/health", 200, answer)
    for wrong in (answer | {"more": 1}, answer | {"is_warm": None}, {"status": "ok"}):
        with pytest.raises(AssertionError, match="/api/health"):
            described.judge("GET", "/api/health", 200, wrong)
