"""A drive's own tuning by clicks: one that this program starts, one that a person starts at the drive, and STOP."""

import re

import pytest
from playwright.sync_api import expect

from tests.support.service.browser import SLOW_MS, technician
from tests.support.service.service_process import ServiceProcess
from tests.support.vendor_process import DRIVES, Vendor

pytestmark = pytest.mark.timeout(600)


@pytest.fixture(scope="module")
def remote():
    with Vendor("schneider_atv340", "--tuning-s", "3") as drive:
        yield drive


@pytest.fixture(scope="module")
def assisted():
    with Vendor("danfoss_fc302", "--tuning-s", "0.2") as drive:
        yield drive


@pytest.fixture(scope="module")
def bench(tmp_path_factory, remote, assisted):
    more = DRIVES.format(remote=remote.url, assisted=assisted.url)
    with ServiceProcess(tmp_path_factory.mktemp("tuning"), more=more) as made:
        yield made


def begin(hand, drive):
    """From the plate to a tuning that is begun, once; the run's id."""
    hand.go(f"/drives/{drive}")
    hand.check()
    hand.button("what")
    expect(hand.page.locator("#hold")).to_be_enabled(timeout=SLOW_MS)
    assert hand.violations() == [] and hand.fits()
    hand.page.locator("#repeat").select_option("1")
    hand.confirm()
    hand.hold()
    expect(hand.page).to_have_url(re.compile("/runs/"), timeout=SLOW_MS)
    return hand.page.url.rsplit("/", 1)[1]


def test_a_drive_tunes_itself_by_clicks_and_gets_its_old_values_back(bench, browser, remote):
    with technician(browser, bench) as hand:
        run = begin(hand, "remote")
        hand.wait_energised()
        hand.wait_said("The drive tunes itself at standstill")
        assert hand.violations() == [] and hand.fits()
        expect(hand.page.locator("h1")).to_contain_text("tuned itself", timeout=SLOW_MS)
        expect(hand.page.locator("main")).to_contain_text("As before, read back")
        assert hand.violations() == [] and hand.fits() and hand.complaints == []
    result = bench.wait_over(run)
    assert (result["outcome"], len(result["tune"]["repeats"])) == ("commissioned", 1)
    told = [entry["what"] for entry in bench.client.get("/api/audit").json()["entries"] if entry.get("run") == run]
    assert {"run begun", "run ended: commissioned"} <= set(told)


def test_stop_ends_a_tuning_that_the_page_began(bench, browser):
    with technician(browser, bench) as hand:
        run = begin(hand, "remote")
        hand.wait_energised()
        hand.page.keyboard.press("Escape")
        expect(hand.page.locator("h1")).to_have_text("Stopped by the operator", timeout=SLOW_MS)
        expect(hand.page.locator("#big")).to_have_text("Motor not energised", timeout=SLOW_MS)
        assert hand.complaints == []
    result = bench.wait_over(run)
    assert (result["outcome"], result["tune"]["in_the_drive"]) == ("aborted", "as before, read back")


def test_a_person_at_the_drive_is_asked_on_the_page_and_answers_there(bench, browser, assisted):
    with technician(browser, bench) as hand:
        run = begin(hand, "assisted")
        for number, (asked, key) in enumerate(
            (("choose|set 1-29", "tune"), ("ended its tuning", ""), ("bus control", "remote")), 1
        ):
            question = hand.page.locator(f"form[action$=answer]:has([name=number][value='{number}'])")
            expect(question).to_be_visible(timeout=SLOW_MS)
            expect(hand.page.locator(".ask")).to_have_text(re.compile(asked))
            if key:
                assisted.press(key)
                hand.page.wait_for_timeout(600)
            question.get_by_role("button", name="Done", exact=True).click()
        expect(hand.page.locator("h1")).to_contain_text("tuning", timeout=SLOW_MS)
    result = bench.wait_over(run)
    assert result["outcome"] in ("commissioned", "rejected") and len(result["tune"]["repeats"]) == 1
    refused = bench.client.post(f"/api/runs/{run}/answer", json={"number": 1, "done": True})
    assert refused.status_code == 409
