"""What a person sets while a page is busy: it is done, done once, and never set back before it is."""

import asyncio
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from fieldgym.scripts.view import seat_of
from fieldgym.viewer.play import Play

pytest.importorskip("viser", reason="the view extra is not installed")

HOE = "fieldgym/HoeWeeding-v0"
SOON_S = 60.0


class Page:
    """A page's messages to a viewer, by viser's own way in, without a browser."""

    def __init__(self, viewer: Any, monkeypatch: pytest.MonkeyPatch):
        self._viewer = viewer
        monkeypatch.setattr(viewer.server.gui, "_resolve_client", lambda client_id: object())
        self.handles = {control.label: control for control in viewer.server.gui._gui_input_handle_from_uuid.values()}

    def sets(self, label: str, value: Any) -> None:
        """As when somebody has typed or chosen it; the message has arrived when this comes back."""
        from viser._messages import GuiUpdateMessage

        gui = self._viewer.server.gui
        message = GuiUpdateMessage(self.handles[label]._impl.uuid, {"value": value})
        self._wait(gui._handle_gui_updates(0, message))

    def shows(self, label: str) -> Any:
        """What stands there, once all that was told has arrived."""
        self._wait(asyncio.sleep(0))
        return self.handles[label].value

    def _wait(self, coroutine: Any) -> None:
        asyncio.run_coroutine_threadsafe(coroutine, self._viewer.server.get_event_loop()).result(SOON_S)


@pytest.fixture
def viewer() -> Iterator[Any]:
    """A viewer whose loop is the test's."""
    from fieldgym.viewer.show import Viewer

    made = Viewer(Play(HOE, "fifo", seed=3, settings={"backend": "analytic"}), seat_of, port=0, bounded=False)
    yield made
    made.close()


@pytest.fixture
def page(viewer: Any, monkeypatch: pytest.MonkeyPatch) -> Page:
    return Page(viewer, monkeypatch)


def test_a_seed_that_is_typed_while_a_field_is_made_is_played_next(viewer: Any, page: Page):
    def meanwhile(play: Play, name: str) -> Any:
        page.sets("seed", 7)
        return seat_of(play, name)

    page.sets("policy", "nearest")
    viewer._make_seat = meanwhile
    viewer._obey()
    assert (viewer.play.policy, viewer.play.seed) == ("nearest", 3)
    assert page.shows("seed") == 7
    viewer._make_seat = seat_of
    viewer._obey()
    assert (viewer.play.policy, viewer.play.seed) == ("nearest", 7)
    assert page.shows("policy") == "nearest" and page.shows("seed") == 7


def test_of_a_number_s_digits_the_last_wish_alone_is_played(viewer: Any, page: Page):
    loads = viewer._loads
    for seed in (1, 12, 123):
        page.sets("seed", seed)
    viewer._obey()
    assert viewer.play.seed == 123 and viewer._loads == loads + 1
    # What goes back to what is played is no wish at all.
    page.sets("seed", 4)
    page.sets("seed", 123)
    viewer._obey()
    assert viewer._loads == loads + 1 and page.shows("seed") == 123


def test_what_cannot_be_played_is_told_and_taken_back(viewer: Any, page: Page):
    page.sets("policy", "no-such")
    viewer._obey()
    assert viewer.play.policy == "fifo" and page.shows("policy") == "fifo"
    assert "no-such" in viewer.desk._note.content


def play_on(viewer: Any) -> None:
    """One decision after the other, until there is a choice."""
    viewer.single()
    while viewer.running:
        viewer.go_on(0.05)
    if len(viewer.desk._actions) < 2:
        play_on(viewer)


def another(viewer: Any, shown: str) -> str:
    return next(text for text in viewer.desk._actions if text != shown)


def test_an_action_that_was_chosen_by_hand_outlasts_the_news(viewer: Any, page: Page):
    play_on(viewer)
    chosen = another(viewer, page.shows("action"))
    page.sets("action", chosen)
    viewer.desk.bounded()
    viewer.desk._renew()
    assert page.shows("action") == chosen
    done = len(viewer.seats[0].log)
    viewer.desk._take_action()
    while viewer.running:
        viewer.go_on(0.05)
    assert viewer.seats[0].log[done].by_hand


def test_another_decision_offers_the_policy_s_choice_again(viewer: Any, page: Page):
    """Even where it is what was offered before."""
    play_on(viewer)
    offered = page.shows("action")
    page.sets("action", another(viewer, offered))
    viewer.desk.decided()
    viewer.desk._renew()
    assert page.shows("action") == offered


def test_a_candidate_that_is_chosen_while_panels_are_renewed_is_looked_at(viewer: Any, page: Page):
    slot = page.handles["candidate"].options[1]
    page.sets("candidate", slot)
    viewer.desk.bounded()
    viewer.desk._renew()
    assert page.shows("candidate") == slot
    viewer._obey()
    assert viewer.picked == int(slot.split()[1]) and page.shows("candidate") == slot
    viewer.pick(None)
    assert page.shows("candidate") == "-"
    # One that has gone meanwhile: nothing is looked at.
    gone = int(np.flatnonzero(~np.isfinite(viewer.seats[0].belief.slot_m[:, 0]))[0])
    page.sets("candidate", f"slot {gone}")
    viewer._obey()
    assert page.shows("candidate") == "-"
