"""A replay as one page of its own: an episode's scenes with a time slider, and its scorecard. It needs no network."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..kernels.files import replaced
from . import panels
from .limits import bound_of
from .play import Play
from .seat import Seat
from .show import LOOPBACK, SCENES_PER_SECOND, Viewer

STEP_S = 0.05
"""From a scene to the next, in simulated seconds: with more of them a replay outgrows two megabytes a minute."""


def record(
    path: Path,
    play: Play,
    make_seat: Callable[[Play, str], Seat],
    until_s: float = float("inf"),
    progress: Callable[[float], None] = lambda _: None,
) -> list[dict[str, float]]:
    """Play an episode and write its replay; the file appears when it is whole.

    Args:
        path: of the page.
        play: what is played.
        make_seat: makes the seat of a policy.
        until_s: simulated seconds after which the replay ends, by default with the episode.
        progress: is told the simulated time now and then.

    Returns:
        The last scorecard of each policy.
    """
    # Nobody connects: the server keeps what its pages would show, and that is what is recorded.
    viewer = Viewer(play, make_seat, LOOPBACK, 0, speed=SCENES_PER_SECOND * STEP_S, bounded=False)
    try:
        serializer = viewer.server.get_scene_serializer()
        score = viewer.caption()
        while not viewer.over and viewer.now_s < until_s:
            viewer.go_on(STEP_S)
            score(f"{viewer.now_s:.0f} s")
            serializer.insert_sleep(STEP_S)
            progress(viewer.now_s)
        html = serializer.as_html()
        seats = viewer.seats
        names, logs = [seat.policy.name for seat in seats], [seat.log for seat in seats]
        side = panels.replay(viewer.desk.title(), names, [seat.scorecard for seat in seats], logs, bound_of(play))
        with replaced(path) as temporary:
            Path(temporary).write_text(html.replace("</body>", f"{side}</body>", 1), "utf-8")
        return [dict(seat.scorecard) for seat in viewer.seats]
    finally:
        viewer.close()
