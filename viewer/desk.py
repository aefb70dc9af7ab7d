"""What stands beside the scene: controls, score and log."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from ..agents.sources import policy_names, policy_source
from ..envs.task import task
from ..kernels.seeds import HeldOutError, refuse_held_out
from . import panels
from .choices import asked, choice_of, features, possible, shares
from .controls import Control
from .play import Play
from .seat import Seat

NOBODY = "nobody"
_NONE = "-"
_MARKS = {"believed": "what it believes", "true": "what is true", "cameras": "cameras"}
PLAY, PAUSE, SINGLE, START = "Play", "Pause", "One decision", "Start again"
_EVERY_S = 0.25
"""The panels are renewed after this at the earliest: decisions may come fifty a second."""
_MOST_SEED = 2**31 - 1


class Viewer(Protocol):
    """What a desk controls and shows; see ``show.Viewer``."""

    play: Play
    seats: list[Seat]
    speed: float
    speeds: tuple[float, ...]
    bound: dict[str, float] | None
    running: bool
    now_s: float
    picked: int | None

    @property
    def over(self) -> bool: ...  # noqa: D102
    def order(self, deed: Callable[[], Any]) -> None: ...  # noqa: D102
    def load(self, play: Play, fresh: bool = True) -> None: ...  # noqa: D102
    def set_running(self, running: bool) -> None: ...  # noqa: D102
    def single(self, action: int | None = None) -> None: ...  # noqa: D102
    def pick(self, slot: int | None) -> None: ...  # noqa: D102
    def show_marks(self, what: str, shown: bool) -> None: ...  # noqa: D102


class Desk:
    """The controls of a page.

    All pages show the same. Callbacks run in threads of the server: they only leave orders with the viewer.
    """

    def __init__(self, server: Any, viewer: Viewer):
        """Lay them out."""
        self._viewer, self._server = viewer, server
        self._renewed_s, self._stale = -np.inf, True
        self._policies: dict[str, Any] = {}
        self._actions: dict[str, int] = {}
        gui = server.gui
        gui.configure_theme(dark_mode=False, show_logo=False, show_share_button=False)
        self._head = gui.add_html("")
        self._play = gui.add_button(PLAY)
        self._play.on_click(lambda _: viewer.order(lambda: viewer.set_running(not viewer.running)))
        self._single = gui.add_button(SINGLE, color="gray")
        self._single.on_click(lambda _: viewer.order(viewer.single))
        speeds = [_speed(x) for x in viewer.speeds]
        self._control(gui.add_dropdown("speed", speeds, initial_value=_speed(viewer.speed)), self._take_speed)
        self._note = gui.add_markdown("", visible=False)
        self._tabs = gui.add_tab_group()
        with self._tabs.add_tab("Score"):
            self._scores = gui.add_html("")
            self._course = self._add_course(1)
            self._strip = gui.add_html("")
            self._rewards = gui.add_html("")
        with self._tabs.add_tab("Decide"):
            self._opinions = gui.add_html("")
            self._slot = self._control(gui.add_dropdown("candidate", [_NONE], initial_value=_NONE), self._take_slot)
            self._features = gui.add_html("")
            self._action = self._control(gui.add_dropdown("action", [_NONE], initial_value=_NONE))
            self._do = gui.add_button("Do it")
            self._do.on_click(lambda _: viewer.order(self._take_action))
        with self._tabs.add_tab("See"):
            for what, label in _MARKS.items():
                box = gui.add_checkbox(label, initial_value=what != "true")
                box.on_update(
                    lambda event, what=what: viewer.order(lambda: viewer.show_marks(what, event.target.value))
                )
            self._key = gui.add_html(panels.key())
            self._camera = gui.add_image(np.full((2, 2, 3), 255, np.uint8), visible=False)
        with self._tabs.add_tab("Log"):
            self._log = gui.add_html("")
        with self._tabs.add_tab("Played"):
            play = viewer.play
            spec = task(play.env_id)
            self._names = [*dict.fromkeys([*policy_names(spec.id), play.policy, *filter(None, [play.against])])]
            scenario = self._scenario_of(play)
            scenarios = [*dict.fromkeys([*spec.scenarios, scenario])]
            others = [NOBODY, *self._names]
            self._played = {
                what: self._control(handle, lambda value, what=what: self._take_play(what, value))
                for what, handle in (
                    ("policy", gui.add_dropdown("policy", self._names, initial_value=play.policy)),
                    ("against", gui.add_dropdown("against", others, initial_value=play.against or NOBODY)),
                    ("scenario", gui.add_dropdown("scenario", scenarios, initial_value=scenario)),
                    ("seed", gui.add_number("seed", initial_value=play.seed, min=0, max=_MOST_SEED, step=1)),
                )
            }
            self._again = gui.add_button(START, color="gray")
        self._again.on_click(lambda _: viewer.order(lambda: viewer.load(viewer.play, fresh=False)))

    def loaded(self) -> None:
        """Show that another episode has begun."""
        self._policies = {}
        self._stale = True
        self._action.renew()
        self._show_play()
        self.running()

    def decided(self) -> None:
        """Show what a decision has brought, soon."""
        self._action.renew()
        self._stale = True

    def bounded(self) -> None:
        """Show the bound, soon."""
        self._stale = True

    def running(self) -> None:
        """Show whether time goes on."""
        label = PAUSE if self._viewer.running else PLAY
        if self._play.label != label:
            self._play.label = label
        self._stale = True
        self._renew()

    def tick(self) -> None:
        """Time has gone on."""
        if time.perf_counter() - self._renewed_s > _EVERY_S:
            self._renew()

    def tell(self, text: str) -> None:
        """Say what cannot be done, and show again what is played."""
        self._note.content, self._note.visible = f"**{text}**", True
        self._show_play()

    def _renew(self) -> None:
        """Bring all panels to what has happened."""
        viewer = self._viewer
        seats = viewer.seats
        if not seats:
            return
        self._renewed_s = time.perf_counter()
        names, logs = [seat.policy.name for seat in seats], [seat.log for seat in seats]
        with self._server.atomic():
            self._head.content = self.title()
            if not self._stale:
                return
            self._stale = False
            self._scores.content = panels.scores(names, [seat.scorecard for seat in seats], viewer.bound)
            self._rewards.content = panels.rewards(names, logs)
            self._strip.content = panels.strip(seats[0].log)
            self._log.content = "".join(
                panels.boxed(f"<b>{panels.escape(name)}</b>") + panels.decisions(log)
                for name, log in zip(names, logs, strict=True)
            )
            end_s = max(max(seat.now_s for seat in seats), 1e-3)
            times, rows = panels.course(logs, end_s)
            self._course.data = tuple(np.array(row, np.float64) for row in (times, rows[-1], rows[0]))
            self._show_camera()
            self.picked()

    def picked(self) -> None:
        """Show the candidate that a person looks at, and what can be done now."""
        viewer, seat = self._viewer, self._viewer.seats[0]
        belief, layout = seat.belief, seat.layout
        if belief is None:
            return
        there = np.flatnonzero(np.isfinite(belief.slot_m).all(axis=1)).tolist()
        slots = [_NONE, *(f"slot {slot}" for slot in there)]
        slot = viewer.picked if viewer.picked in there else None
        self._actions = {} if seat.over else possible(seat.observation, layout, belief)
        best = _NONE if seat.choice is None else choice_of(seat.choice, layout, belief).text
        wanted = best
        if slot is not None:
            of_slot = [text for text in self._actions if text.startswith(f"slot {slot}:")]
            wanted = best if best in of_slot or not of_slot else of_slot[len(of_slot) // 2]
        self._slot.offer(_NONE if slot is None else f"slot {slot}", slots)
        actions = [*self._actions] or [_NONE]
        self._action.offer(wanted if wanted in actions else actions[0], actions)
        self._do.disabled = seat.over
        self._features.content = (
            panels.boxed("Click a ring in the scene: its features come here.")
            if slot is None
            else panels.features(features(seat.observation, layout, belief, slot))
        )
        if viewer.running:
            self._opinions.content = panels.boxed("Pause to ask every policy.")
        elif seat.busy:
            self._opinions.content = panels.boxed(f"{SINGLE} ends what is under way; then every policy is asked.")
        else:
            self._opinions.content = self._asked()

    def _asked(self) -> str:
        """What every policy would do now."""
        seat, play = self._viewer.seats[0], self._viewer.play
        if seat.over:
            return panels.boxed("The episode is over.")
        if not self._policies:
            for name in dict.fromkeys([*policy_names(play.env_id), play.policy]):
                if name not in ("random", play.policy):
                    self._policies[name] = policy_source(play.env_id, name).make(seat.env, play.seed)
            for policy in self._policies.values():
                policy.reset(np.ones(1, bool))
        rows = []
        answers = {play.policy: seat.choice, **asked(self._policies, seat.observation)}
        for name, action in answers.items():
            if action is None:
                continue
            policy = seat.policy if name == play.policy else self._policies[name]
            weights = shares(policy, seat.observation)
            sure = "" if weights is None else f"{100.0 * weights[action]:.0f} %"
            rows.append((name, choice_of(action, seat.layout, seat.belief).text, sure))
        return panels.opinions(rows)

    def _show_camera(self) -> None:
        """The last picture of the first seat's camera, with what was made of it."""
        seat = self._viewer.seats[0]
        if seat.watching.looks:
            look = next(iter(seat.watching.looks.values()))
            self._camera.image, self._camera.visible = panels.seen(look, seat.belief), True
        else:
            self._camera.visible = False

    def _take_slot(self, word: str) -> None:
        slot = None if word == _NONE else int(word.split()[1])
        self._slot.renew()  # it may have gone meanwhile
        if slot != self._viewer.picked:
            self._viewer.pick(slot)

    def _take_action(self) -> None:
        action = self._actions.get(str(self._action.value))
        if action is not None and not self._viewer.seats[0].busy:
            self._viewer.single(action)

    def title(self) -> str:
        """What is played, and how it stands."""
        viewer, play = self._viewer, self._viewer.play
        inner: Any = viewer.seats[0].env.unwrapped
        state = "over" if viewer.over else "playing" if viewer.running else "paused"
        count = len(viewer.seats[0].log)
        return panels.head(
            task(play.env_id).name,
            f"{inner.scenario}, {inner.backend}, {inner.perception} reports",
            f"seed {play.seed}" if play.field is None else f"field {play.field}",
            f"{state}: {viewer.now_s:.1f} s, {count} decision{'' if count == 1 else 's'}",
        )

    def _show_play(self) -> None:
        """Have the controls say what is played."""
        play = self._viewer.play
        self._names = [*dict.fromkeys([*self._names, play.policy])]
        self._played["policy"].show(play.policy, self._names)
        self._played["against"].show(play.against or NOBODY, [NOBODY, *self._names])
        self._played["scenario"].show(self._scenario_of(play))
        self._played["seed"].show(play.seed)

    def _control(self, handle: Any, take: Callable[[Any], None] | None = None) -> Control:
        return Control(handle, self._server.get_event_loop(), self._viewer.order, take)

    def _take_play(self, what: str, value: Any) -> None:
        viewer, play = self._viewer, self._viewer.play
        if what == "scenario":
            wanted = replace(play, settings={**play.settings, "scenario": value})
        else:
            wanted = replace(play, **{what: "" if value == NOBODY else value})
        try:
            refuse_held_out([wanted.seed])
        except HeldOutError:
            self._show_play()
            raise
        if wanted != play and value != self._scenario_of(play):
            self._note.visible = False
            viewer.load(wanted)

    @staticmethod
    def _scenario_of(play: Play) -> str:
        return str(play.settings.get("scenario") or task(play.env_id).headline)

    def _take_speed(self, word: str) -> None:
        self._viewer.speed = float(word.strip("x"))

    def _add_course(self, rows: int) -> Any:
        import viser.uplot as uplot

        empty = np.zeros(2)
        return self._server.gui.add_uplot(
            data=(np.array([0.0, 1.0]), empty, empty),
            series=(
                uplot.Series(label="s"),
                uplot.Series(label="against", stroke="#e45756", width=2),
                uplot.Series(label="net rate", stroke="#2b6cb0", width=2),
            ),
            scales={"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(range=(0.0, 1.0))},
            axes=(uplot.Axis(size=26), uplot.Axis(size=34)),
            legend=uplot.Legend(show=False),
            height=120,
        )


def _speed(value: float) -> str:
    return f"x{value:g}"
