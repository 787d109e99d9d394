"""Every view of the technician's page as pictures, at three widths, light and dark: to be looked at.

python -m tests.campaigns.page.pictures OUT [--language de] [--only live,result]
"""

from __future__ import annotations

import argparse
import re
import tempfile
from functools import partial
from pathlib import Path

from tests.support.service.browser import SIZES, SLOW_MS, Technician, chromium, technician
from tests.support.service.service_process import ServiceProcess
from tests.support.vendor_process import DRIVES, Vendor


class Album:
    """Takes pictures of what a technician sees."""

    def __init__(self, hand: Technician, out: Path, only: set[str]) -> None:
        self.hand, self.out, self.only = hand, out, only
        self.faults: list[str] = []

    def take(self, name: str, *, whole: bool = True) -> None:
        """The view at each size and in both appearances; faults seen by the way are kept."""
        if self.only and name not in self.only:
            return
        page = self.hand.page
        for size in SIZES:
            self.hand.size(size)
            for theme in ("light", "dark"):
                page.emulate_media(color_scheme=theme)
                page.screenshot(path=self.out / f"{name}-{size}-{theme}.png", full_page=whole)
            if self.hand.overflow() > 0:
                self.faults.append(f"{name} at {size}: {self.hand.overflow()} px too wide")
            if not self.hand.stop_is_in_view():
                self.faults.append(f"{name} at {size}: STOP is not in view")
        self.hand.size("1280")
        page.emulate_media(color_scheme="light")


def work(album: Album) -> None:
    """The whole work, view by view; each view is met as a person meets it."""
    hand, page = album.hand, album.hand.page
    hand.go("/")
    album.take("start")
    hand.choose_simulator()
    album.take("motor")
    for name, value in (("rated_speed_rpm", "1563"), ("pole_pairs", "2,5"), ("power_factor", "")):
        page.locator(f"#{name}").fill(value)
    page.locator("#rated_voltage_v").focus()
    page.wait_for_timeout(600)
    album.take("motor-wrong")
    page.reload()
    page.locator("#rated_current_a").fill("8,66")
    page.locator("#rated_voltage_v").focus()
    page.wait_for_timeout(600)
    album.take("motor-odd")
    page.reload()
    hand.check()
    album.take("checks")
    hand.see_what_will_happen()
    album.take("energise")
    hand.confirm()
    hand.hold()
    page.wait_for_url("**/runs/*")
    page.wait_for_timeout(300)
    album.take("live-begin", whole=False)
    hand.wait_energised()
    page.locator("[data-p='3']").filter(has_not_text="–").wait_for()
    album.take("live", whole=True)
    second = page.locator("[data-last='3']").filter(has_not_text="–").or_(page.locator(".verdict"))
    second.wait_for()  # on a busy host the run is over before its pictures are taken
    if page.locator("#live").count():
        page.wait_for_timeout(1500)
        album.take("live-second", whole=True)
    hand.wait_result()
    album.take("result-early")
    run = page.url.rsplit("/", 1)[1]
    hand.service.wait_over(run, 300)
    page.reload()
    album.take("result")
    hand.button("see")
    page.wait_for_url("**/write-back")
    album.take("write")
    hand.button("write")
    album.take("written")
    hand.go(f"/runs/{run}/restore")
    album.take("restore")
    hand.button("restore all")
    album.take("restored")
    hand.go(f"/runs/{run}/report")
    page.wait_for_timeout(800)
    album.take("report")
    shelves(album, run)


def shelves(album: Album, run: str) -> None:
    """What stands beside the work."""
    hand, page = album.hand, album.hand.page
    hand.go("/")
    page.locator("#file").set_input_files(hand.service.runs / run / "recording.parquet")
    page.locator("#dropform button").click()
    page.wait_for_url("**/recordings/*")
    album.take("recording-works")
    page.locator("#working").wait_for(state="detached", timeout=SLOW_MS)
    page.wait_for_timeout(800)
    album.take("recording")
    hand.go("/audit")
    album.take("audit")
    hand.go("/runs/none")
    album.take("refused")
    hand.go("/login")
    album.take("login")


def ends(album: Album) -> None:
    """A run stopped by the operator, one more that is good, then comparing; faults; the service lost."""
    hand, page = album.hand, album.hand.page
    run = hand.energise()
    hand.wait_energised()
    page.keyboard.press("Escape")
    page.wait_for_timeout(250)
    album.take("stopping", whole=False)
    hand.service.wait_over(run, 200)
    page.wait_for_timeout(1500)
    album.take("stopped")
    hand.energise()
    hand.wait_result()
    hand.go("/runs")
    album.take("archive")
    boxes = page.locator("main input[type=checkbox]:not([disabled])")
    boxes.nth(0).check()
    boxes.nth(1).check()
    page.locator("main button.main").click()
    album.take("compare")
    hand.go("/motors/motor_2kw2/trend")
    page.wait_for_timeout(500)
    album.take("trend")
    hand.service.start_simulator("sto_open")
    hand.go("/drives/simulator")
    hand.check()
    album.take("checks-bad")
    hand.service.start_simulator("default")
    hand.energise()
    hand.wait_energised()
    hand.service.kill()
    page.wait_for_timeout(2500)
    album.take("offline")


def tunings(album: Album, assisted: Vendor) -> None:
    """A drive that tunes itself when it is told to, and one that a person must start."""
    hand, page = album.hand, album.hand.page
    for drive in ("remote", "assisted"):
        hand.go(f"/drives/{drive}")
        hand.check()
        album.take(f"{drive}-checks")
        hand.button("what")
        page.locator("#hold:enabled").wait_for(timeout=SLOW_MS)
        page.locator("#repeat").select_option("1")
        album.take(f"{drive}-tune")
        hand.confirm()
        hand.hold()
        page.wait_for_url("**/runs/*")
        if drive == "remote":
            hand.wait_energised()
            album.take("remote-tuning", whole=False)
        for number, key in enumerate(("tune", "", "remote") if drive == "assisted" else (), 1):
            question = page.locator(f"form[action$=answer]:has([name=number][value='{number}'])")
            question.wait_for(timeout=SLOW_MS)
            album.take(f"assisted-asked-{number}")
            if key:
                assisted.press(key)
                page.wait_for_timeout(600)
            question.get_by_role("button", name=re.compile("Done|Fertig")).click()
        page.locator(".verdict").wait_for(timeout=SLOW_MS)
        album.take(f"{drive}-tuned")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--language", default="en", choices=("en", "de"))
    parser.add_argument("--speed", default="1")
    parser.add_argument("--only", default="")
    parser.add_argument("--axes", default="0, 60, 120")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory() as folder,
        chromium() as browser,
        Vendor("schneider_atv340", "--tuning-s", "3") as remote,
        Vendor("danfoss_fc302", "--tuning-s", "0.2") as assisted,
        ServiceProcess(
            Path(folder) / "s",
            speed=asked.speed,
            diagnosis=True,
            settings=f"axes_deg = [{asked.axes}]",
            more=DRIVES.format(remote=remote.url, assisted=assisted.url),
        ) as service,
        technician(browser, service, asked.language) as hand,
    ):
        album = Album(hand, asked.out, set(filter(None, asked.only.split(","))))
        for part in (partial(tunings, assisted=assisted), work, ends):
            part(album)
        for fault in (*album.faults, *hand.complaints):
            print(fault)


if __name__ == "__main__":
    main()
