"""The browser view in a real browser: its buttons do what they say, and browsers that vanish change nothing."""

import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from waiting import PATIENCE_S, over_and_over, until

from fieldgym.agents import make_policy
from fieldgym.agents.policies.base import act_single
from fieldgym.envs import env_ids, task
from fieldgym.scripts import chromium
from fieldgym.scripts.view import seat_of
from fieldgym.viewer import panels
from fieldgym.viewer.play import Play

pytest.importorskip("viser", reason="the view extra is not installed")
playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(chromium.PATH is None, reason="there is no Chromium on this machine"),
]

HOE = "fieldgym/HoeWeeding-v0"
BESIDE_M = 0.1
"""Cells of a tray stand so near to one another that a click on a small page may take the next one."""
GLANCE_MS = 5000.0
"""One try at what a page may just be drawing anew."""


def served(play: Play, speed: float = 1.0) -> Iterator[Any]:
    """A viewer whose loop runs."""
    from fieldgym.viewer.show import Viewer

    one = Viewer(play, seat_of, port=0, speed=speed)
    thread = threading.Thread(target=one.run, daemon=True)
    thread.start()
    yield one
    one.stop()
    thread.join(PATIENCE_S)
    assert not thread.is_alive()
    one.close()


@pytest.fixture
def viewer() -> Iterator[Any]:
    yield from served(Play(HOE, "fifo", seed=3, settings={"backend": "analytic"}))


@pytest.fixture(scope="module")
def started() -> Iterator[Any]:
    with playwright.sync_playwright() as driver:
        one = driver.chromium.launch(executable_path=chromium.PATH, args=list(chromium.ARGUMENTS))
        yield one
        one.close()


@pytest.fixture
def browser(started: Any) -> Iterator[Any]:
    """A browser without pages, and after the test again."""
    yield started
    for context in started.contexts:
        context.close()


def opened(browser: Any, viewer: Any, width: int = 640) -> Any:
    page = browser.new_page(viewport={"width": width, "height": 3 * width // 4})
    page.set_default_timeout(1000.0 * PATIENCE_S)
    shown = page.get_by_role("button", name="One decision")
    # Several pages drawn in software are slow to show what they have, and one that stalls is loaded again.
    over_and_over(lambda: page.goto(viewer.address), lambda: bool(shown.count()), "the page stays empty", 30.0)
    return page


def press(page: Any, name: str) -> None:
    page.get_by_role("button", name=name, exact=True).dispatch_event("click")


def tried(act: Callable[[], None]) -> None:
    """Do something that fails while a page draws a panel anew: the click or the panel is lost."""
    with suppress(playwright.TimeoutError):
        act()


def turn_to(page: Any, tab: str) -> None:
    place = page.get_by_role("tab", name=tab, exact=True)
    over_and_over(
        lambda: tried(lambda: place.click(force=True, timeout=GLANCE_MS)),
        lambda: place.get_attribute("aria-selected") == "true",
        f"{tab} stays behind other tabs",
    )


def pick(page: Any, label: str, option: str, taken: Callable[[], bool] = lambda: True) -> None:
    """Open a list and take an option, again where a click from before, late, has taken another one back."""
    wanted = page.get_by_role("option", name=option, exact=True)
    place = page.get_by_label(label, exact=True).first

    def take() -> None:
        if not wanted.count():
            place.click(force=True, timeout=GLANCE_MS)
        wanted.dispatch_event("click", timeout=GLANCE_MS)

    over_and_over(
        lambda: tried(take),
        lambda: place.input_value() == option and taken(),
        f"{label} does not come to {option}",
    )


def give_seed(page: Any, viewer: Any, seed: int) -> None:
    """Type a seed; a page that draws the field anew meanwhile forgets what was typed."""
    place = page.get_by_label("seed", exact=True).first

    def typed() -> None:
        place.fill(str(seed), timeout=GLANCE_MS)
        place.press("Enter", timeout=GLANCE_MS)

    over_and_over(lambda: tried(typed), lambda: viewer.play.seed == seed, "the seed is not taken", 2.0)


def test_buttons_do_what_they_say(viewer: Any, browser: Any):
    page = opened(browser, viewer)
    press(page, "One decision")
    until(lambda: len(viewer.seats[0].log) == 1 and not viewer.running)
    press(page, "Play")
    until(lambda: len(viewer.seats[0].log) > 4)
    press(page, "Pause")
    until(lambda: not viewer.running)
    done = len(viewer.seats[0].log)
    press(page, "One decision")  # to the end of what is under way
    until(lambda: len(viewer.seats[0].log) == done + 1 and not viewer.running and not viewer.seats[0].busy)

    turn_to(page, "Decide")
    wait = viewer.seats[0].layout.actions - 1
    pick(page, "action", "wait", lambda: viewer.desk._action.value == "wait")
    done = len(viewer.seats[0].log)
    press(page, "Do it")
    until(lambda: len(viewer.seats[0].log) == done + 1 and not viewer.running)
    entry = viewer.seats[0].log[-1]
    assert entry.by_hand and entry.action == wait

    until(lambda: bool(np.isfinite(viewer.seats[0].belief.slot_m).any()))
    slot = int(np.flatnonzero(np.isfinite(viewer.seats[0].belief.slot_m[:, 0]))[0])
    pick(page, "candidate", f"slot {slot}", lambda: viewer.picked == slot)
    page.get_by_text("crop_gap").first.wait_for()

    turn_to(page, "Played")
    pick(page, "policy", "nearest", lambda: viewer.seats[0].policy.name == "nearest")
    until(lambda: not viewer.seats[0].log)
    give_seed(page, viewer, 7)
    page.get_by_text("seed 7").first.wait_for()


def _seats() -> Iterator[Any]:
    """Ids and backends; pages of all of them are made the same way, so that some are looked at every time."""
    seats = [(env_id, backend) for env_id in env_ids() for backend in task(env_id).backends]
    always = [*(seat for seat in seats if seat[0] == env_ids()[0]), (HOE, "analytic")]
    for env_id, backend in seats:
        again = (env_id, backend) not in always
        yield pytest.param((env_id, backend), marks=[pytest.mark.long] * again, id=f"{env_id} {backend}")


@pytest.fixture(params=_seats())
def any_viewer(request: pytest.FixtureRequest) -> Iterator[Any]:
    """A viewer of one environment on one backend, fast where a decision lasts for many seconds."""
    env_id, backend = request.param
    parts = task(env_id).assembly
    speed = 16.0 if parts.mean_decision_s(parts.headline) > 5.0 else 1.0
    yield from served(Play(env_id, task(env_id).reference, seed=3, settings={"backend": backend}), speed)


def click_on(viewer: Any, page: Any, slot: int) -> None:
    """Have a candidate in the middle of the page, and click on it until it, or one right beside it, is picked."""
    (client,) = viewer.server.get_clients().values()
    mirror, camera = viewer._mirrors[0], client.camera
    slots_m = viewer.seats[0].belief.slot_m
    place = slots_m[slot] - mirror.middle + mirror.place
    away = 0.6 * (np.asarray(camera.position) - camera.look_at)
    camera.position, camera.look_at = place + away, place
    size = page.viewport_size

    def picked() -> bool:
        return viewer.picked is not None and bool(np.linalg.norm(slots_m[viewer.picked] - slots_m[slot]) <= BESIDE_M)

    over_and_over(
        lambda: page.mouse.click(0.5 * size["width"], 0.5 * size["height"]), picked, f"slot {slot} is not picked"
    )


def test_every_environment_is_played_from_the_page_on_every_backend(any_viewer: Any, browser: Any):
    viewer = any_viewer
    spec = task(viewer.play.env_id)
    page = opened(browser, viewer, 900)
    press(page, "One decision")
    until(lambda: len(viewer.seats[0].log) == 1 and not viewer.running)
    press(page, "Play")
    until(lambda: len(viewer.seats[0].log) >= 3)
    press(page, "Pause")
    until(lambda: not viewer.running)
    press(page, "One decision")
    until(lambda: not viewer.running and not viewer.seats[0].busy)

    turn_to(page, "Decide")
    until(lambda: bool(np.isfinite(viewer.seats[0].belief.slot_m).any()))
    there = np.flatnonzero(np.isfinite(viewer.seats[0].belief.slot_m[:, 0])).tolist()
    click_on(viewer, page, there[0])
    pick(page, "candidate", f"slot {there[-1]}", lambda: viewer.picked == there[-1])

    # The last action that is possible, whatever the policy would do.
    chosen = list(viewer.desk._actions)[-1]
    wanted, done = viewer.desk._actions[chosen], len(viewer.seats[0].log)
    pick(page, "action", chosen, lambda: viewer.desk._action.value == chosen)
    press(page, "Do it")
    until(lambda: len(viewer.seats[0].log) == done + 1 and not viewer.running)
    assert viewer.seats[0].log[-1].by_hand and viewer.seats[0].log[-1].action == wanted

    turn_to(page, "Played")
    other = next(name for name in spec.policies if name not in (spec.reference, "learned"))
    pick(page, "policy", other, lambda: viewer.seats[0].policy.name == other)
    until(lambda: not viewer.seats[0].log)
    give_seed(page, viewer, 7)
    until(lambda: not viewer.seats[0].log)


def test_a_minute_s_replay_opens_from_the_disk_without_a_network(tmp_path: Path, browser: Any):
    from fieldgym.viewer.record import record

    path = tmp_path / "minute.html"
    (card,) = record(path, Play(HOE, "edf", seed=3, settings={"backend": "analytic"}), seat_of, 60.0)
    assert card["duration_s"] > 59.0 and path.stat().st_size < 2e6
    context = browser.new_context(offline=True)
    page = context.new_page()
    page.set_default_timeout(1000.0 * PATIENCE_S)
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(path.as_uri())
    table = page.locator("#fieldgym")
    table.wait_for(state="attached")
    page.locator("canvas").first.wait_for(state="attached")
    for name in ("net_rate", "cycle_time_s", "duration_s", "missed"):
        assert panels.figure(name, card[name]) in str(table.text_content()), name
    assert not [url for url in asked if url.startswith(("http:", "https:", "ws:", "wss:"))]
    context.close()


@pytest.mark.long
def test_browsers_that_vanish_change_nothing(viewer: Any, browser: Any):
    pages = [opened(browser, viewer, 200) for _ in range(3)]
    viewer.order(lambda: viewer.set_running(True))
    until(lambda: len(viewer.seats[0].log) > 2)
    pages[0].close()
    pages[1].reload(wait_until="commit")
    until(lambda: len(viewer.seats[0].log) > 6)
    for context in browser.contexts:
        context.close()
    viewer.order(lambda: viewer.set_running(False))
    until(lambda: not viewer.running)
    env = gym.make(HOE, disable_env_checker=True, backend="analytic")
    policy = make_policy("fifo", env, 1)
    observation, _ = env.reset(seed=3)
    for entry in viewer.seats[0].log:
        action = act_single(policy, observation)
        observation, reward, _, _, info = env.step(action)
        assert (entry.action, entry.reward, entry.scorecard) == (action, float(reward), info["scorecard"])
    env.close()
