"""Every view, at every width: axe finds nothing, STOP is in view, nothing is too wide; foreign markup stays text."""

import json
import re
import shutil

import pytest
from playwright.sync_api import expect

from tests.support.service.browser import AXE_RULES, CONTRAST, SIZES, SLOW_MS, technician

pytestmark = pytest.mark.timeout(900)
"""A guard against hanging: what is judged by time says so itself."""
EVIL = '"><img src=x onerror="window.hit=1"><script>window.hit=1</script>{{7*7}}%s%(n)s'
HIT = "() => window.hit !== undefined || document.querySelector('img[src=x]') !== null"


@pytest.fixture(scope="module")
def shelf(service, finished):
    """Runs to look at: one that is good, a later copy, one that was stopped, one whose name and origin are hostile."""
    copies = {"later": f"{finished}-2", "evil": f"{finished[:15]}-<img src=x onerror=window.hit=1>"}
    for name in copies.values():
        service.add_copy(finished, name)
    request = service.runs / copies["evil"] / "request.json"
    told = json.loads(request.read_text("utf-8"))
    told["origin"] = {"person": EVIL, "by": EVIL, "drive": EVIL, "motor": EVIL + 80 * "Ü"}
    request.write_text(json.dumps(told), encoding="utf-8")
    stopped = service.start_run()
    service.wait_energised(stopped)
    service.client.post(f"/api/runs/{stopped}/stop", json={"reason": EVIL})
    service.wait_over(stopped)
    yield copies | {"good": finished, "stopped": stopped}
    for name in copies.values():
        shutil.rmtree(service.runs / name)


def paths(shelf):
    return {
        "start": "/",
        "motor": "/drives/simulator",
        "result": f"/runs/{shelf['good']}",
        "stopped": f"/runs/{shelf['stopped']}",
        "write": f"/runs/{shelf['good']}/write-back",
        "restore": f"/runs/{shelf['stopped']}/restore",
        "archive": "/runs",
        "compare": f"/compare?run={shelf['good']}&run={shelf['later']}",
        "trend": "/motors/motor_2kw2/trend",
        "report": f"/runs/{shelf['good']}/report",
        "audit": "/audit",
        "login": "/login",
        "refused": "/runs/none",
    }


def test_no_view_has_a_violation_or_hides_stop(service, browser, shelf):
    """In the light colours, and in the dark ones where only contrast can be another."""
    found = []
    with technician(browser, service) as hand:

        def judge(name):
            for size in SIZES:
                hand.size(size)
                if not hand.fits():
                    found.append(
                        f"{name} at {size}: {hand.overflow()} px too wide, STOP in view: {hand.stop_is_in_view()}"
                    )
            found.extend(f"{name}: {fault}" for fault in hand.faults_on_paper())
            for scheme, rules in (("dark", CONTRAST), ("light", AXE_RULES)):
                hand.page.emulate_media(color_scheme=scheme)
                found.extend(f"{name}, {scheme}: {violation}" for violation in hand.violations(rules))

        for name, path in paths(shelf).items():
            hand.go(path)
            judge(name)
        hand.go("/drives/simulator")
        for field in ("rated_speed_rpm", "power_factor"):
            hand.page.locator(f"#{field}").fill("")
        hand.button("check")
        expect(hand.page.locator("#power_factor")).to_have_attribute("aria-invalid", "true")
        judge("motor, wrong")
        hand.go("/drives/simulator")
        hand.check()
        judge("checks")
        hand.see_what_will_happen()
        judge("energise")
        hand.confirm()
        hand.hold()
        hand.wait_energised()
        expect(hand.page.locator("[data-p='3']")).to_have_text(re.compile(r"\d"), timeout=SLOW_MS)
        judge("live")
        hand.page.keyboard.press("Escape")
        expect(hand.page.locator("h1")).to_have_text("Stopped by the operator", timeout=SLOW_MS)
        assert hand.complaints == []
    assert found == []


def test_foreign_markup_stays_text(service, browser, shelf):
    """In the names of motors, drives and runs, in reasons, in addresses and in searches."""
    with technician(browser, service) as hand:
        hand.go("/")
        form = hand.page.locator("form[action='/drives']")
        if not form.locator("#dn").is_visible():
            hand.page.get_by_text("Add a drive").click()
        form.locator("#dn").fill(EVIL)
        form.locator("#du").fill("tcp://127.0.0.1:9?device=1")
        form.locator("button").click()
        hand.page.locator("#name").fill(EVIL)
        hand.button("check")
        expect(hand.page.locator("h1")).to_contain_text("No connection", timeout=SLOW_MS)
        assert not hand.page.evaluate(HIT)
        told = service.client.get("/api/motors").json()["motors"]
        motor = next(m["id"] for m in told if m["name"] == EVIL[:80])
        places = [
            "/",
            "/drives/simulator",
            f"/drives/simulator?motor={motor}",
            "/runs",
            f"/runs?motor={EVIL}&since={EVIL}",
            "/audit",
        ]
        places += [
            f"/runs/{shelf['evil']}",
            f"/runs/{shelf['stopped']}",
            f"/runs/{EVIL}",
            f"/motors/{EVIL}/trend",
            f"/login?next={EVIL}",
        ]
        places += [f"/compare?run={shelf['good']}&run={shelf['evil']}", f"/drives/{EVIL}", f"/recordings/{EVIL}"]
        for place in places:
            hand.page.goto(f"{service.url}{place.replace('%', '%25').replace('#', '%23')}")
            assert not hand.page.evaluate(HIT), place
            assert "Content-Security-Policy" not in str(hand.complaints), place
        hand.complaints.clear()


DROP = """([name, text]) => { const data = new DataTransfer(); data.items.add(new File([text], name));
document.querySelector('#drop').dispatchEvent(new DragEvent('drop', { dataTransfer: data, bubbles: true, cancelable: true })); }"""


def test_a_file_that_is_dropped_is_answered_by_the_same_verb(service, browser):
    """`identify`, whose refusal has step, value, limit and remedy here as on the command line."""
    with technician(browser, service) as hand:
        hand.go("/")
        expect(hand.page.locator("#drop[data-takes=files]")).to_be_visible()
        hand.page.evaluate(DROP, ["pump.csv", "time_s,current_u_a\n0,1\n1,2\n"])
        assert hand.page.evaluate("() => document.querySelector('#file').files[0].name") == "pump.csv"
        hand.button("Send the file")
        expect(hand.page.locator("h2").filter(has_text="No answer from these data")).to_be_visible(timeout=SLOW_MS)
        job = service.client.get(f"/api/recordings/{hand.page.url.rsplit('/', 1)[1]}").json()
        assert job["exit_code"] in (2, 3) and job["problem"]["remedy"]
        expect(hand.page.locator("main")).to_contain_text(str(job["problem"]["limit"]))
        assert hand.violations() == []
