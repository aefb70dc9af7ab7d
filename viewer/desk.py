"""What stands beside the scene: controls, score and log."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from ..agents.sources import policy_names
from ..envs.task import task
from . import panels
from .play import Play
from .seat import Seat

NOBODY = "nobody"
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

    @property
    def over(self) -> bool: ...  # noqa: D102
    def order(self, deed: Callable[[], Any]) -> None: ...  # noqa: D102
    def load(self, play: Play, fresh: bool = True) -> None: ...  # noqa: D102
    def set_running(self, running: bool) -> None: ...  # noqa: D102
    def single(self, action: int | None = None) -> None: ...  # noqa: D102


class Desk:
    """The controls of a page.

    All pages show the same. Callbacks run in threads of the server: they only leave orders with the viewer.
    """

    def __init__(self, server: Any, viewer: Viewer):
        """Lay them out."""
        self._viewer, self._server = viewer, server
        self._renewed_s, self._stale = -np.inf, True
        self._setting = False
        gui = server.gui
        gui.configure_theme(dark_mode=False, show_logo=False, show_share_button=False)
        self._head = gui.add_html("")
        self._play = gui.add_button(PLAY)
        self._play.on_click(lambda _: viewer.order(lambda: viewer.set_running(not viewer.running)))
        self._single = gui.add_button(SINGLE, color="gray")
        self._single.on_click(lambda _: viewer.order(viewer.single))
        self._speed = gui.add_dropdown("speed", [_speed(x) for x in viewer.speeds], initial_value=_speed(viewer.speed))
        self._speed.on_update(lambda _: viewer.order(self._take_speed))
        self._note = gui.add_markdown("", visible=False)
        self._tabs = gui.add_tab_group()
        with self._tabs.add_tab("Score"):
            self._scores = gui.add_html("")
            self._course = self._add_course(1)
            self._strip = gui.add_html("")
            self._rewards = gui.add_html("")
        with self._tabs.add_tab("Log"):
            self._log = gui.add_html("")
        with self._tabs.add_tab("Played"):
            play = viewer.play
            spec = task(play.env_id)
            names = [*dict.fromkeys([*policy_names(spec.id), play.policy, *filter(None, [play.against])])]
            scenario = str(play.settings.get("scenario") or spec.headline)
            self._policy = gui.add_dropdown("policy", names, initial_value=play.policy)
            self._against = gui.add_dropdown("against", [NOBODY, *names], initial_value=play.against or NOBODY)
            self._scenario = gui.add_dropdown(
                "scenario", [*dict.fromkeys([*spec.scenarios, scenario])], initial_value=scenario
            )
            self._seed = gui.add_number("seed", initial_value=play.seed, min=0, max=_MOST_SEED, step=1)
            self._again = gui.add_button(START, color="gray")
        for control in (self._policy, self._against, self._scenario, self._seed):
            control.on_update(lambda _: viewer.order(self._take_play))
        self._again.on_click(lambda _: viewer.order(lambda: viewer.load(viewer.play, fresh=False)))

    def loaded(self) -> None:
        """Show that another episode has begun."""
        self._stale = True
        self.running()

    def decided(self) -> None:
        """Show what a decision has brought, soon."""
        self._stale = True

    def running(self) -> None:
        """Show whether time goes on."""
        label = PAUSE if self._viewer.running else PLAY
        if self._play.label != label:
            self._play.label = label
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
            self._head.content = self._title()
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
            self._course.data = tuple(np.array(row, np.float64) for row in (times, rows[0], rows[-1]))
            self._show_play()

    def _title(self) -> str:
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
        play = self._viewer.play
        self._setting = True
        values = (
            (self._policy, play.policy),
            (self._against, play.against or NOBODY),
            (self._seed, play.seed),
        )
        try:
            for control, value in values:
                if control.value != value:
                    control.value = value
        finally:
            self._setting = False

    def _take_play(self) -> None:
        if self._setting:
            return
        viewer = self._viewer
        against = "" if self._against.value == NOBODY else self._against.value
        settings = {**viewer.play.settings, "scenario": self._scenario.value}
        play = viewer.play
        changes = {"policy": self._policy.value, "against": against, "seed": int(self._seed.value)}
        if all(getattr(play, name) == value for name, value in changes.items()) and (
            str(play.settings.get("scenario") or task(play.env_id).headline) == self._scenario.value
        ):
            return
        self._note.visible = False
        viewer.load(replace(play, **changes, settings=settings))

    def _take_speed(self) -> None:
        self._viewer.speed = float(self._speed.value.strip("x"))

    def _add_course(self, rows: int) -> Any:
        import viser.uplot as uplot

        empty = np.zeros(2)
        return self._server.gui.add_uplot(
            data=(np.array([0.0, 1.0]), empty, empty),
            series=(
                uplot.Series(label="s"),
                uplot.Series(label="net rate", stroke="#e45756", width=2),
                uplot.Series(label="against", stroke="#4c78a8", width=2),
            ),
            scales={"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(range=(0.0, 1.0))},
            axes=(uplot.Axis(size=26), uplot.Axis(size=34)),
            legend=uplot.Legend(show=False),
            height=120,
        )


def _speed(value: float) -> str:
    return f"x{value:g}"
