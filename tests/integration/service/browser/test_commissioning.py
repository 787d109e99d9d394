"""A whole commissioning by clicks, and by the keyboard alone."""

import re
from pathlib import Path

import pytest
from babel.messages.pofile import read_po
from playwright.sync_api import expect

import commissioner.service.page
from tests.support.service.browser import SLOW_MS, Technician, technician

pytestmark = pytest.mark.timeout(900)
"""A guard against hanging: what is judged by time says so itself."""
CATALOGUE = Path(commissioner.service.page.__file__).parent / "catalogues" / "de.po"
ZERO_VOLTS_S = 0.5


def english_sentences() -> set[str]:
    """What must not stand in a German page: every message of more than one word that has another form in German."""
    with CATALOGUE.open("rb") as file:
        return {
            m.id
            for m in read_po(file, locale="de")
            if m.id and m.string != m.id and " " in str(m.id) and "%(" not in str(m.id)
        }


def texts_of(hand: Technician) -> set[str]:
    """Every piece of text in the page that is not marked as another language's."""
    found: list[str] = hand.page.evaluate(
        """() => { const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), found = [];
        for (let node = walk.nextNode(); node; node = walk.nextNode())
          if (!node.parentElement.closest('script, template, [lang=en]')) found.push(node.textContent.trim());
        for (const node of document.querySelectorAll('[aria-label]')) found.push(node.getAttribute('aria-label'));
        return found.filter(Boolean); }"""
    )
    return set(found)


def judge_view(hand: Technician, language: str, english: set[str]) -> None:
    """STOP in view, nothing too wide; in German no English left."""
    assert hand.fits(), f"{hand.overflow()} px too wide, STOP in view: {hand.stop_is_in_view()}"
    assert hand.page.locator("html").get_attribute("lang") == language
    if language == "de":
        assert not english & texts_of(hand)


@pytest.mark.parametrize("language", ["en", "de"])
def test_a_whole_commissioning_by_clicks(service, browser, language):
    english = english_sentences()
    before = service.energised_times()
    with technician(browser, service, language) as hand:
        run = hand.energise()
        judge_view(hand, language, english)
        hand.wait_energised()
        assert service.energised_times() > before
        expect(hand.page.locator("#control")).to_have_text({"en": "you", "de": "Sie"}[language])
        expect(hand.page.locator("[data-p='3']")).to_have_text(re.compile(r"\d[.,]\d"), timeout=SLOW_MS)
        hand.wait_said({"en": "Test 1 of 1", "de": "Prüfung 1 von 1"}[language])
        judge_view(hand, language, english)
        hand.wait_result()
        expect(hand.page.locator("h1").first).to_have_text(hand.words["passed"])
        resistance = hand.page.locator("main table .val").first.inner_text()
        assert float(resistance.replace(",", ".").split("\u00a0")[0]) == pytest.approx(3.7, rel=0.02)
        assert ("," in resistance) is (language == "de")
        expect(hand.page.locator("#big")).to_have_text(str(hand.words["off"]))
        assert not service.is_energised()
        judge_view(hand, language, english)
        service.wait_over(run)
        steps = [("see", "write"), ("write", "written"), ("restore", "restore all"), ("restore all", "restored")]
        for press, seen in (
            steps if language == "en" else steps[:3]
        ):  # before a restore the whole run is proved once more
            hand.button(press)
            expect(hand.page.locator("main")).to_contain_text(hand.words[seen], timeout=SLOW_MS)
            judge_view(hand, language, english)
            if seen == "written":
                hand.page.reload()
                expect(hand.page.locator("main")).to_contain_text(hand.words[seen])
                kept = {"en": "Measured and written", "de": "Gemessen und geschrieben"}[language]
                expect(hand.page.locator("#small")).to_contain_text(kept)
        hand.go(f"/runs/{run}")
        expect(hand.page.locator("[aria-current=step] .dot")).to_have_text("8" if language == "de" else "6")
        for path in ("/", "/runs", "/audit", "/motors/motor_2kw2/trend", f"/runs/{run}/report", "/runs/none", "/login"):
            hand.go(path)
            judge_view(hand, language, english)
        assert hand.complaints == []
    told = [entry["what"] for entry in service.client.get("/api/audit").json()["entries"] if entry.get("run") == run]
    assert {"run begun", "wrote", "run ended: commissioned", *(["restored"] if language == "en" else [])} <= set(told)


def test_the_language_is_switched_on_the_page_and_stays(service, browser):
    with technician(browser, service) as hand:
        hand.go("/runs?outcome=aborted")
        hand.page.get_by_role("button", name="Deutsch").click()
        expect(hand.page.locator("h1")).to_have_text("Archiv")
        assert hand.page.url.endswith("/runs?outcome=aborted")
        hand.go("/")
        expect(hand.page.locator("h1")).to_have_text("Was wollen Sie messen?")
        hand.page.get_by_role("button", name="Dunkel").click()
        expect(hand.page.locator("html")).to_have_attribute("data-theme", "dark")


def test_a_plate_is_judged_while_it_is_typed(service, browser):
    with technician(browser, service, "de") as hand:
        hand.go("/drives/simulator")
        hand.page.locator("#rated_speed_rpm").fill("1563")
        hand.page.locator("#rated_voltage_v").focus()
        speed = hand.page.locator("[data-field=rated_speed_rpm]")
        expect(speed.locator(".msg")).to_contain_text("Widerspricht dem übrigen Schild")
        expect(hand.page.locator("#why")).to_have_text("1 zu berichtigen")
        with hand.page.expect_navigation():
            hand.button("check")
        expect(speed.locator("input")).to_have_attribute("aria-invalid", "true")
        hand.page.locator("#rated_speed_rpm").fill("1436")
        hand.page.locator("#rated_current_a").fill("8,66")
        hand.page.locator("#rated_voltage_v").focus()
        expect(hand.page.locator("#judgement")).to_contain_text("45,8\u00a0%: Sternspannung mit Dreieckstrom?")
        hand.page.locator("#pole_pairs").fill("2,5")
        hand.page.locator("#rated_voltage_v").focus()
        expect(hand.page.locator("[data-field=pole_pairs] .msg")).to_contain_text("Muss eine ganze Zahl sein")
        assert hand.complaints == []


def test_the_keyboard_alone_energises_and_a_held_key_is_no_stop(service, browser):
    """Tab and Enter from the start page; released early nothing happens; Space stops."""
    with technician(browser, service) as hand:
        page = hand.page

        def reach(name: str) -> None:
            for _ in range(60):
                page.keyboard.press("Tab")
                if page.evaluate("() => document.activeElement.textContent.trim()").startswith(name):
                    return
            raise AssertionError(f"Tab does not reach {name!r}")

        hand.go("/")
        for name, then in (
            ("Try it", "/drives/simulator"),
            ("Check the drive", "/checks"),
            ("What will happen", "/energise"),
        ):
            reach(name)
            page.keyboard.press("Enter")
            expect(page).to_have_url(re.compile(then), timeout=SLOW_MS)
        expect(page.locator("#hold")).to_be_enabled(timeout=SLOW_MS)
        reach("Hold 2 s")
        page.keyboard.press("Enter")
        expect(page.locator("#holdmsg")).to_contain_text("confirm 3 more")
        for _ in range(3):
            page.keyboard.press("Space")
            page.keyboard.press("Tab")
        reach("Hold 2 s")
        page.keyboard.down("Enter")
        page.wait_for_timeout(700)
        page.keyboard.up("Enter")
        expect(page.locator("#holdmsg")).to_contain_text("Released before 2 s")
        page.keyboard.down("Space")
        page.wait_for_timeout(2300)
        page.keyboard.up("Space")
        expect(page).to_have_url(re.compile("/runs/"), timeout=SLOW_MS)
        hand.wait_energised()
        began = page.evaluate("() => Date.now()") / 1000
        page.keyboard.press("Space")
        assert service.wait_dead(began) <= ZERO_VOLTS_S
        run = page.url.rsplit("/", 1)[1]
        assert service.wait_over(run)["error"]["what"] == "stopped by the operator"
        expect(page.locator("h1")).to_have_text("Stopped by the operator", timeout=SLOW_MS)
        assert hand.complaints == []
