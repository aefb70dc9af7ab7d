"""How often the live page is renewed while a browser looks on, and what a page beside a training costs it."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fieldgym.scripts import chromium
from fieldgym.scripts.speed_lines import Line

if TYPE_CHECKING:
    from fieldgym.viewer.show import Viewer

UPDATES_PER_S = 30.0
_CROWDED = {"scenario.density_per_m2": 720.0, "scenario.max_weeds": 2400}
"""Overrides of the weeder's ``dense`` that put so many into the page."""
_SHORT = "teacher_decisions: 60000, evaluate_every: 16384, evaluation_episodes: 32"
_TRAINS = """
import json, resource, sys
from fieldgym.scripts import cli

cli.app(sys.argv[1:], standalone_mode=False)
spent = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
print(json.dumps([each.ru_utime + each.ru_stime for each in spent]))
"""
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
    try:
        with looked_at(shown.address) as opened:
            if not opened:
                yield Line("updates of the live page", None, "1/s", note="the browser did not open it")
                return
            shown.set_running(True)
            _run(shown, 3.0 if quick else 10.0)
            before, start, spent = shown.updates, time.perf_counter(), time.thread_time()
            _run(shown, 5.0 if quick else 25.0)
            count, wall_s = shown.updates - before, time.perf_counter() - start
            spent = time.thread_time() - spent
    finally:
        shown.close()
    note = f"{plants} plants drawn, x1, one Chromium"
    yield Line("updates of the live page", count / wall_s, "1/s", UPDATES_PER_S, note=note)
    yield Line("an update, in the loop's thread", 1e3 * spent / count, "ms")


@contextmanager
def looked_at(address: str) -> Iterator[bool]:
    """A page that one Chromium looks at; whether it has opened it."""
    looking = subprocess.Popen(
        [sys.executable, "-c", _LOOKING, address],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert looking.stdin is not None and looking.stdout is not None
    try:
        yield looking.stdout.readline().strip() == "ready"
    finally:
        looking.stdin.close()
        looking.wait(60.0)


def training(quick: bool) -> Iterator[Line]:
    """CPU time of a training alone, with a page that nobody looks at, and with one that one Chromium looks at."""
    if not find_spec("sb3_contrib") or not find_spec("viser"):
        yield Line("training with a page", None, "s", note="needs the extras rl and view")
        return
    steps = 16_384 if quick else 131_072
    ways = {"alone": False, "with a page": False}
    if chromium.PATH is not None and find_spec("playwright"):
        ways["with a page that is looked at"] = True
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "short.yaml"
        config.write_text(f"defaults: {{{_SHORT}}}\n", "utf-8")
        weights: dict[str, np.ndarray] = {}
        for way, looked in ways.items():
            out = Path(folder) / way.replace(" ", "-")
            words = ["train", "HoeWeeding", "--steps", f"{steps}", "--config", str(config), "--out", str(out)]
            own_s, page_s = _trained([*words, "--threads", "1", *(["--view"] if way != "alone" else [])], looked)
            with np.load(out / "last.npz") as file:
                found = {name: file[name] for name in file.files}
            weights = weights or found
            same = all(np.array_equal(found[name], weights[name]) for name in weights)
            note = f"{steps:,} decisions, {'equal' if same else 'OTHER'} weights"
            yield Line(f"training {way}", own_s, "s", note=note)
            if page_s:
                yield Line("its page's process", page_s, "s")


def _trained(words: list[str], looked: bool) -> tuple[float, float]:
    """CPU seconds of a training and of the page beside it.

    Raises:
        RuntimeError: it failed.
    """
    process = subprocess.Popen([sys.executable, "-u", "-c", _TRAINS, *words], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    if looked:
        # The server's own greeting comes first.
        address = next((word for line in process.stdout for word in line.split()[-1:] if "Watch" in line), "")
        with looked_at(address) as opened:
            told = process.stdout.read()
        if not opened:
            raise RuntimeError(f"the browser did not open {address!r}")
    else:
        told = process.stdout.read()
    if process.wait():
        raise RuntimeError(f"training failed: {told[-2000:]}")
    own_s, page_s = json.loads(told.splitlines()[-1])
    return own_s, page_s


def _run(shown: Viewer, seconds: float) -> None:
    end = time.perf_counter() + seconds
    shown.run(lambda: time.perf_counter() > end)
