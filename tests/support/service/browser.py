"""A technician at the page: Debian's chromium, driven by playwright, and what a hand does in each view.

with chromium() as browser, technician(browser, service) as hand:
    hand.commission()
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, ConsoleMessage, Page, expect, sync_playwright

from tests.support.service.service_process import ServiceProcess

CHROMIUM = "/usr/bin/chromium"
AXE = Path(__file__).parents[2] / "data" / "axe_core" / "axe.min.js"
AXE_RULES = ("wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice")
"""WCAG 2.2 A and AA, and axe's best practices."""
CONTRAST = ("color-contrast", "link-in-text-block")
"""What colours alone decide."""
SIZES = {"1280": (1280, 800), "1024": (1024, 768), "390": (390, 844)}
SLOW_MS = 240_000
"""A simulated drive beside other work on the host."""
LOOKS = 20
PAPER = {"upright": 703, "lying": 1032}
"""Pixels of A4 between margins of 12 mm."""
JUDGE_PAPER = """() => {
  const faults = [], box = (selector) => document.querySelector(selector).getBoundingClientRect();
  const [red, green, blue] = getComputedStyle(document.body).color.match(/[0-9.]+/g).map(Number);
  if (red + green + blue > 300) faults.push('light letters on white paper');
  if (box('main').width < 0.8 * innerWidth) faults.push(`the work is ${Math.round(box('main').width)} px wide`);
  if (box('#small').bottom > box('#band').bottom + 1 || box('#band').bottom > box('main').top + 1) faults.push('the band runs into the work');
  for (const node of document.querySelectorAll('main *:not(svg *):not(iframe):not(.hidden)')) {
    const b = node.getBoundingClientRect();
    if (b.width > 1 && b.height > 1 && b.right > innerWidth + 1) { faults.push(`${node.tagName} ${node.className} is cut off: ${node.textContent.trim().slice(0, 40)}`); break; }
  }
  return faults;
}"""
KEEP_WHAT_IS_SAID = """(() => {
  if (window !== top) return;
  const look = () => {
    const said = JSON.parse(sessionStorage.getItem('said') || '[]'), before = said.length;
    for (const id of ['big', 'small']) {
      const text = document.getElementById(id)?.textContent.trim();
      if (text && !said.includes(text)) said.push(text);
    }
    if (said.length > before) sessionStorage.setItem('said', JSON.stringify(said));
  };
  look();
  new MutationObserver(look).observe(document, { subtree: true, childList: true, characterData: true });
})()"""
"""Each sentence of the state's line, once: beside other work a sentence can come and go between two looks."""
WORDS = {
    "en": {"try": "Try it without a drive", "check": "Check the drive", "again": "Check again", "what": "What will happen", "see": "See what would be written",
           "write": re.compile("Write these . values"), "written": re.compile("Written and read back"), "energised": "MOTOR ENERGISED",
           "restore": "Restore the old values", "restore all": re.compile("Restore these . values"), "restored": re.compile("Restored"),
           "off": "Motor not energised", "passed": re.compile("Every parameter is within")},
    "de": {"try": "Ohne Umrichter ausprobieren", "check": "Umrichter prüfen", "again": "Erneut prüfen", "what": "Was geschehen wird", "see": "Zeigen, was geschrieben würde",
           "write": re.compile("Diese . Werte schreiben"), "written": re.compile("Geschrieben und zurückgelesen"), "energised": "MOTOR BESTROMT",
           "restore": "Alte Werte zurückschreiben", "restore all": re.compile("Diese . Werte zurückschreiben"),
           "restored": re.compile("Zurückgeschrieben"), "off": "Motor nicht bestromt", "passed": re.compile("Alle Parameter liegen")},
}  # fmt: skip


@contextmanager
def chromium() -> Iterator[Browser]:
    """One browser; its contexts are its users."""
    arguments = ["--no-sandbox"] if os.geteuid() == 0 else []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=[*arguments, "--disable-gpu"])
        try:
            yield browser
        finally:
            browser.close()


class Technician:
    """One person's browser. `complaints`: what its console said, and every request to another machine."""

    def __init__(self, page: Page, service: ServiceProcess, language: str) -> None:
        self.page, self.service, self.words = page, service, WORDS[language]
        self.complaints: list[str] = []
        page.add_init_script(KEEP_WHAT_IS_SAID)
        page.on("console", self._hear)
        page.on("pageerror", lambda error: self.complaints.append(error.stack or str(error)))
        page.on(
            "request",
            lambda request: (
                request.url.startswith((service.url, "data:", "blob:")) or self.complaints.append(request.url)
            ),
        )
        page.set_default_timeout(SLOW_MS)

    def _hear(self, message: ConsoleMessage) -> None:
        if message.type in ("error", "warning") and "the server responded with a status of 4" not in message.text:
            self.complaints.append(message.text)

    def go(self, path: str) -> None:
        self.page.goto(self.service.url + path)

    def size(self, name: str) -> None:
        width, height = SIZES[name]
        self.page.set_viewport_size({"width": width, "height": height})

    def button(self, word: str) -> None:
        """Press the button or link of this name."""
        name = self.words.get(word, word)
        self.page.locator("main").get_by_role("button", name=name).or_(
            self.page.locator("main").get_by_role("link", name=name)
        ).first.click()

    # --- the work, step by step ------------------------------------------------------------------------------------
    def choose_simulator(self) -> None:
        self.go("/")
        self.button("try")
        expect(self.page.locator("#plate")).to_be_visible(timeout=120_000)

    def check(self) -> None:
        """The plate as it is, then the checks."""
        self.button("check")
        expect(self.page).to_have_url(re.compile("/checks"), timeout=SLOW_MS)

    def see_what_will_happen(self) -> None:
        """A host with other work answers late: then the check of the link says no, and a technician checks again."""
        for _ in range(LOOKS):
            if self.page.locator("a.main").count():
                break
            self.button("again")
            expect(self.page.locator("main .actions")).to_be_visible(timeout=SLOW_MS)
        self.button("what")
        expect(self.page.locator("#energise")).to_be_visible()
        expect(self.page.locator("#hold")).to_be_enabled(timeout=180_000)

    def confirm(self) -> None:
        for box in self.page.locator(".must").all():
            box.check()

    def hold(self, milliseconds: float = 2300) -> None:
        """Press the button, hold it, let go. What the state's line said before is forgotten."""
        self.page.evaluate("() => sessionStorage.removeItem('said')")
        self.page.locator("#hold").hover()
        self.page.mouse.down()
        self.page.wait_for_timeout(milliseconds)
        self.page.mouse.up()

    def energise(self) -> str:
        """From the start page to a running test; the run's id."""
        self.choose_simulator()
        self.check()
        self.see_what_will_happen()
        self.confirm()
        self.hold()
        expect(self.page).to_have_url(re.compile("/runs/"), timeout=SLOW_MS)
        self.page.wait_for_load_state()
        return self.page.url.rsplit("/", 1)[1]

    def wait_energised(self) -> None:
        """Until the motor is energised, or was since the button was held: at full speed a test is over between two looks of a busy host."""
        self.wait_said(str(self.words["energised"]))

    def wait_said(self, words: str) -> None:
        """Until the state's line has said them, now or before, since the button was held."""
        self.page.wait_for_function(
            "words => JSON.parse(sessionStorage.getItem('said') || '[]').some(text => text.includes(words))", arg=words
        )

    def wait_result(self, timeout_ms: float = 600_000) -> None:
        expect(self.page.locator(".verdict")).to_be_visible(timeout=timeout_ms)

    # --- judging ---------------------------------------------------------------------------------------------------
    def violations(self, only: Sequence[str] = AXE_RULES) -> list[str]:
        """What axe finds by these rules; all folds opened."""
        for fold in self.page.locator("details:not([open]) > summary").all():
            fold.click()
        if not self.page.evaluate("'axe' in window"):
            self.page.evaluate(AXE.read_text("utf-8") + "\n;0")
        found: dict[str, Any] = self.page.evaluate(
            "only => axe.run(document, { runOnly: only, resultTypes: ['violations'] })", list(only)
        )
        return [
            json.dumps(
                {
                    "rule": v["id"],
                    "help": v["help"],
                    "nodes": [n["html"][:160] + " | " + n["failureSummary"][:200] for n in v["nodes"][:4]],
                }
            )
            for v in found["violations"]
        ]

    def fits(self) -> bool:
        """No wider than its window and STOP in view, within a second of a change of size or page: what is drawn follows a frame later."""
        for _ in range(20):
            if self.overflow() <= 0 and self.stop_is_in_view():
                return True
            self.page.wait_for_timeout(50)
        return False

    def overflow(self) -> int:
        """Pixels by which the page is wider than its window."""
        return int(self.page.evaluate("() => document.documentElement.scrollWidth - window.innerWidth"))

    def faults_on_paper(self) -> list[str]:
        """What a print of this view, upright and lying, would show wrong; also of a page that is dark on the screen."""
        found = []
        for width in PAPER.values():
            self.page.set_viewport_size({"width": width, "height": 1000})
            self.page.emulate_media(media="print", color_scheme="dark")
            found += [f"on {width} px of paper: {fault}" for fault in self.page.evaluate(JUDGE_PAPER)]
        self.page.emulate_media(media="screen", color_scheme="light")
        self.size("1280")
        return found

    def stop_is_in_view(self) -> bool:
        """STOP, whole, inside the window and not covered."""
        return bool(
            self.page.evaluate(
                """() => { const s = document.querySelector('#stop'), b = s.getBoundingClientRect();
                const top = document.elementFromPoint(b.x + b.width / 2, b.y + b.height / 2);
                return b.top >= 0 && b.left >= 0 && b.bottom <= innerHeight && b.right <= innerWidth && b.height >= 44 && s.contains(top) && !s.disabled; }"""
            )
        )


@contextmanager
def technician(
    browser: Browser, service: ServiceProcess, language: str = "en", size: str = "1280", **more: Any
) -> Iterator[Technician]:
    """A browser of its own, with its own cookies."""
    width, height = SIZES[size]
    locale = {"en": "en-GB", "de": "de-DE"}[language]
    context = browser.new_context(viewport={"width": width, "height": height}, locale=locale, timezone_id="UTC", **more)
    try:
        yield Technician(context.new_page(), service, language)
    finally:
        context.close()
