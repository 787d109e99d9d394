"""STOP in each of its ways, and what happens when pages go, come and want control."""

import re
import time

import pytest
from playwright.sync_api import Browser, expect

from tests.integration.service.conftest import PAGE_LOST_S
from tests.support.service.browser import SLOW_MS, technician
from tests.support.service.service_process import ServiceProcess

pytestmark = pytest.mark.timeout(900)
"""A guard against hanging: what is judged by time says so itself."""
ZERO_VOLTS_S = 0.5
DEAF = "window.WebSocket = class { constructor() { this.readyState = 0; } addEventListener() {} send() {} };"
"""A browser whose WebSocket never opens: STOP goes by POST."""


PRESSES = 4
"""A press may fall into the pause between two voltages, and ends the run there; so many in a row do not."""


def pressed(service: ServiceProcess, browser: Browser, way: str) -> tuple[str, str]:
    """The run that STOP ended while it was energised or paused, and what the page said to it; nothing without script."""
    run, said = service.start_run(), ""
    with technician(browser, service, java_script_enabled=way != "form") as hand:
        if way == "POST":
            hand.page.add_init_script(DEAF)
        hand.go(f"/runs/{run}")
        service.wait_energised(run)
        if way == "WebSocket":
            hand.wait_energised()  # its line is there
        else:
            hand.page.locator("#stop").hover()  # the hand is there: what is measured is the press, not the finding
        began = time.time()
        if way == "WebSocket":
            hand.page.keyboard.press("Escape")
        else:
            hand.page.mouse.down()
            hand.page.mouse.up()
        assert service.wait_dead(began) <= ZERO_VOLTS_S
        if way != "form":
            answer = hand.page.locator("#stopsub")
            expect(answer).to_have_text(re.compile("confirmed after|off already"), timeout=10_000)
            said = answer.inner_text()
    return run, said


@pytest.mark.parametrize("way", ["WebSocket", "POST", "form"])
def test_stop_ends_the_voltage_in_each_of_its_ways(service, browser, way):
    for _ in range(PRESSES):
        run, said = pressed(service, browser, way)
        result = service.wait_over(run)
        assert (result["outcome"], result["error"]["what"]) == ("aborted", "stopped by the operator")
        told = [entry for entry in service.client.get("/api/audit").json()["entries"] if entry["what"] == "STOP"]
        assert (told[0]["by"], told[0]["run"], told[0]["zero_volts"]) == (way, run, True)
        if "off already" not in said:
            break
    assert way == "form" or "confirmed after" in said


def test_two_browsers_one_operates_and_hands_over_and_a_lost_page_stops_the_run(browser, tmp_path):
    """A run of twelve tests: it must still be energised when the second page has been lost."""
    settings = f"page_lost_s = {PAGE_LOST_S}\nhand_over_s = 60.0\naxes_deg = {list(range(0, 360, 30))}"
    with (
        ServiceProcess(tmp_path, settings=settings) as service,
        technician(browser, service) as first,
        technician(browser, service, "de") as second,
    ):
        service.start_simulator()
        run = first.energise()
        first.wait_energised()
        second.go(f"/runs/{run}")
        expect(second.page.locator("#controlline")).to_have_text("Sie schauen zu")
        assert service.client.post("/api/drives/simulator/control", json={"do": "grant"}).status_code == 409
        second.page.get_by_role("button", name="Bedienung anfordern").click()
        first.page.get_by_role("button", name="Hand over control").click(timeout=SLOW_MS)
        expect(second.page.locator("#control")).to_have_text("Sie")
        expect(first.page.locator("#controlline")).to_have_text("you watch")
        first.page.close()
        first_gone = time.time()
        while time.time() < first_gone + PAGE_LOST_S + 1.0:
            second.page.wait_for_timeout(100)
            assert "nothing" not in second.page.locator("#stopsub").inner_text()
        assert run in service.client.get("/api/health").json()["runs_live"]
        second.page.close()
        began = time.time()
        assert service.wait_dead(began, timeout_s=PAGE_LOST_S + 3.0) <= PAGE_LOST_S + ZERO_VOLTS_S + 0.5
        error = service.wait_over(run)["error"]
        assert "the operator's page was lost" in error["value"]


def test_a_page_that_has_lost_the_service_says_what_it_cannot_do(browser, tmp_path):
    """The service is killed: zero volts by the dead man; the page points at the emergency stop."""
    with ServiceProcess(tmp_path) as service, technician(browser, service) as hand:
        service.start_simulator()
        # a service's first page costs most: on a busy host a run heard nothing of it for two seconds
        hand.go("/drives/simulator")
        run = service.start_run()
        hand.go(f"/runs/{run}")
        hand.wait_energised()
        began = time.time()
        service.kill()
        assert service.wait_dead(began) <= ZERO_VOLTS_S
        expect(hand.page.locator("#big")).to_have_text("TAKE THE MOTOR AS LIVE", timeout=10_000)
        expect(hand.page.locator("#stopsub")).to_have_text("cannot be sent: use the emergency stop")
        expect(hand.page.get_by_role("alert")).to_contain_text("If anything is wrong at the machine: emergency stop.")
        assert hand.stop_is_in_view()
        hand.page.locator("#stop").click()
        expect(hand.page.locator("#stopsub")).to_have_text("cannot be sent: use the emergency stop")
        assert hand.violations() == []
        with ServiceProcess(
            tmp_path, port=service.port
        ):  # the page stood there as of a test in progress, its data older and older
            expect(hand.page.locator("#livedata")).to_have_count(0, timeout=SLOW_MS)
            assert "in progress" not in hand.page.locator("h1").inner_text()
