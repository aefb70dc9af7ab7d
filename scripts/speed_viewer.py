"""How often the live page is renewed while a browser looks on."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from typing import TYPE_CHECKING

from fieldgym.scripts import chromium
from fieldgym.scripts.speed_lines import Line

if TYPE_CHECKING:
    from fieldgym.viewer.show import Viewer

UPDATES_PER_S = 30.0
_CROWDED = {"scenario.density_per_m2": 720.0, "scenario.max_weeds": 2400}
"""Overrides of the weeder's ``dense`` that put so many into the page."""
_LOOKING = """
import sys, time
from playwright.sync_api import sync_playwright
from fieldgym.scripts import chromium

with sync_playwright() as driver:
    browser = driver.chromium.launch(executable_path=chromium.PATH, args=list(chromium.ARGUMENTS))
    page = browser.new_page(viewport={"width": 320, "height": 240})
    page.goto(sys.argv[1], timeout=120000)
    page.get_by_role("button", name="One decision").wait_for(state="attached", timeout=120000)
    print("ready", flush=True)
    sys.stdin.read()
    browser.close()
"""


def viewer(quick: bool) -> Iterator[Line]:
    """Updates a second at x1 with one page open, by the wall's clock: the browser shares the machine's processors."""
    if chromium.PATH is None or not find_spec("playwright") or not find_spec("viser"):
        yield Line("updates of the live page", None, "1/s", note="needs viser, Playwright and Chromium")
        return
    from fieldgym.scripts.view import seat_of
    from fieldgym.viewer.play import Play
    from fieldgym.viewer.show import Viewer

    settings = {"backend": "analytic", "scenario": "dense", "overrides": _CROWDED}
    shown = Viewer(Play("fieldgym/LaserWeeding-v0", "edf", seed=3, settings=settings), seat_of, port=0, bounded=False)
    scene = shown.seats[0].watching.scene
    assert scene is not None
    plants = len(scene.groups["plants"].mesh)
    looking = subprocess.Popen(
        [sys.executable, "-c", _LOOKING, shown.address],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert looking.stdin is not None and looking.stdout is not None
    try:
        if looking.stdout.readline().strip() != "ready":
            yield Line("updates of the live page", None, "1/s", note="the browser did not open it")
            return
        shown.set_running(True)
        _run(shown, 3.0 if quick else 10.0)
        before, start, spent = shown.updates, time.perf_counter(), time.thread_time()
        _run(shown, 5.0 if quick else 25.0)
        count, wall_s = shown.updates - before, time.perf_counter() - start
        spent = time.thread_time() - spent
    finally:
        looking.stdin.close()
        looking.wait(60.0)
        shown.close()
    note = f"{plants} plants drawn, x1, one Chromium"
    yield Line("updates of the live page", count / wall_s, "1/s", UPDATES_PER_S, note=note)
    yield Line("an update, in the loop's thread", 1e3 * spent / count, "ms")


def _run(shown: Viewer, seconds: float) -> None:
    end = time.perf_counter() + seconds
    shown.run(lambda: time.perf_counter() > end)
