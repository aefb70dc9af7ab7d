"""Videos of episodes in real time, with what happens between two decisions in them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from .kernels.files import replaced

Picture = NDArray[np.uint8]

FRAMES_PER_SECOND = 30
"""Of videos."""
MOST_SPEED = 1000.0
"""Simulated seconds a second of video, at most."""
_BAR_PX, _INDENT_PX, _LETTERS = 46, 10, 0.5
"""Height of the lines under a picture, their indent, and the size of their letters where there is room for it."""
_EXACT = 1e-6
"""Of a frame: what is said to begin with a frame may do so by rounding."""
_BAR, _TITLE, _FIGURES = (28, 30, 33), (245, 245, 245), (190, 200, 190)


class RecordField(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Writes a video of every episode, in real time or so many times faster.

    Gymnasium's ``RecordVideo`` takes one picture a decision, and a decision lasts from a fraction of a second to many
    seconds: its videos last as long as episodes do, since ``metadata["render_fps"]`` is the mean rate of decisions, but
    they jump from decision to decision. Here the motion between them is seen, drawn of what the executor has carried
    out, and the simulated clock decides which picture is shown when. Infos and rewards are the same with and without.

    Files are called ``PREFIX-episode-N.mp4``. One appears when its episode ends, and holds what there is where
    ``reset`` or ``close`` comes before that.

    Attributes:
        files: that were written, in their order.
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        folder: str | PathLike[str],
        prefix: str = "field",
        episode_trigger: Callable[[int], bool] | None = None,
        fps: int = FRAMES_PER_SECOND,
        speed: float = 1.0,
        title: str | None = None,
    ):
        """Write nothing yet.

        Args:
            env: of this package, under wrappers of any kind; ``camera``, ``width`` and ``height`` of ``gym.make`` say
                what is seen.
            folder: of the files; it is made.
            prefix: of their names.
            episode_trigger: says of an episode's number, from 0, whether it is recorded; by default all are.
            fps: pictures a second of video.
            speed: simulated seconds a second of video.
            title: stands under the pictures, beside the time, the net rate and the cycle time; by default the machine,
                with ``""`` there is no line.

        Raises:
            ImportError: imageio is not installed.
            ValueError: the environment does not record, or a number is out of range.
        """
        RecordConstructorArgs.__init__(
            self, folder=folder, prefix=prefix, episode_trigger=episode_trigger, fps=fps, speed=speed, title=title
        )
        super().__init__(env)
        if not hasattr(env.unwrapped, "record"):
            raise ValueError(f"{env.unwrapped} is none of fieldgym's environments: use Gymnasium's RecordVideo")
        if not 1 <= fps <= 240:
            raise ValueError(f"fps = {fps}: give 1..240 pictures a second")
        if not 0.0 < speed <= MOST_SPEED:
            raise ValueError(f"speed = {speed}: give a positive factor up to {MOST_SPEED:g}, 1 is real time")
        require_writer()
        self.files: list[Path] = []
        self._folder, self._prefix = Path(folder), prefix
        self._folder.mkdir(parents=True, exist_ok=True)
        self._trigger, self._fps, self._rate = episode_trigger, fps, fps / speed
        self._title = machine_of(env) if title is None else title
        self._episode = -1
        self._open = ExitStack()
        self._filming: Filming | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode, and its file where it is recorded."""
        self._finish()
        self._episode += 1
        observation, info = self.env.reset(seed=seed, options=options)
        if self._trigger is None or self._trigger(self._episode):
            write = self._open.enter_context(video_file(self._path(), self._fps))
            self._filming = Filming(self.env, write, self._rate, self._title, info["scorecard"])
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Carry out a decision, and record it."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        if self._filming is not None:
            self._filming.took(info)
        if terminated or truncated:
            self._finish()
        return observation, reward, terminated, truncated, info

    def close(self) -> None:
        """Finish the file and close the environment; idempotent."""
        self._finish()
        self.env.close()

    def _finish(self) -> None:
        if self._filming is not None:
            self._filming.end()
            self._filming = None
            self._open.close()
            self.files.append(self._path())

    def _path(self) -> Path:
        return self._folder / f"{self._prefix}-episode-{self._episode}.mp4"


class Filming:
    """Pictures of one environment's decisions as frames of a video: each when the simulated clock says so."""

    def __init__(
        self,
        env: gym.Env[Any, Any],
        write: Callable[[Picture], None],
        frames_per_second: float,
        title: str,
        scorecard: Mapping[str, float],
    ):
        """Begin with an episode.

        Args:
            env: was reset; ``took`` follows each ``step``.
            write: takes the frames.
            frames_per_second: frames a simulated second.
            title: stands under the pictures; none does where it is empty.
            scorecard: of the episode's beginning.
        """
        self._inner: Any = env.unwrapped
        self._write, self._rate, self._title = write, frames_per_second, title
        self._scorecard = dict(scorecard)
        self._began_s, self._frames, self._seen = 0.0, 0, 0
        self._last: Picture = self._inner.view.frame()
        self._inner.record(self._take, frames_per_second)

    def took(self, info: Mapping[str, Any]) -> None:
        """Hold the last picture until the decision's end, and take over its scores."""
        self._seen = 0
        self._began_s += sum(info["phases_s"].values())
        self._scorecard = dict(info["scorecard"])
        self._hold(self._began_s)

    def end(self) -> None:
        """The episode is over; one in which nothing was decided is a single frame."""
        self._inner.record(None)
        if not self._frames:
            self._show(0.0)

    def _take(self, picture: Picture) -> None:
        """A decision's pictures come as many a second as there are frames, the first at its beginning."""
        self._hold(self._began_s + self._seen / self._rate)
        self._seen += 1
        self._last = picture

    def _hold(self, until_s: float) -> None:
        """Frames before a moment show what was there last."""
        while self._frames < until_s * self._rate - _EXACT:
            self._show(self._frames / self._rate)

    def _show(self, at_s: float) -> None:
        self._frames += 1
        lines = (self._title, self._told(at_s))
        self._write(captioned(self._last, lines) if self._title else self._last)

    def _told(self, at_s: float) -> str:
        card = self._scorecard
        cycle = f"{card['cycle_time_s']:.2f} s" if card["done"] > 0.0 else "-"
        return f"{at_s:.1f} s    net rate {100.0 * card['net_rate']:.1f} %    cycle time {cycle}"


@contextmanager
def video_file(path: Path, fps: int) -> Iterator[Callable[[Picture], None]]:
    """Gives what takes the frames (h, w, 3), one at least, of an MP4 file; the file appears when it is whole."""
    import imageio.v2

    with replaced(path) as temporary:
        writer = imageio.v2.get_writer(temporary, fps=fps, macro_block_size=2)

        def take(picture: Picture) -> None:
            high, wide = (size // 2 * 2 for size in picture.shape[:2])
            writer.append_data(picture[:high, :wide])

        try:
            yield take
        finally:
            writer.close()


def require_writer() -> None:
    """Find out whether videos can be written.

    Raises:
        ImportError: they cannot; the message says what to install.
    """
    try:
        import imageio.v2  # noqa: F401
        import imageio_ffmpeg  # noqa: F401
    except ImportError as error:
        raise ImportError('videos need imageio: pip install "fieldgym[bench]"') from error


def machine_of(env: gym.Env[Any, Any]) -> str:
    """The name of an environment and its machine, for people."""
    from .envs.task import task

    env_id = "" if env.spec is None else env.spec.id
    try:
        return f"{env_id.split('/')[-1]}: {task(env_id).machine}"
    except ValueError:
        return env_id or type(env.unwrapped).__name__


def captioned(picture: Picture, lines: tuple[str, str]) -> Picture:
    """A picture (h, w, 3) with two lines under it, in letters that fit: (h + 46, w, 3)."""
    import cv2

    wide = picture.shape[1]
    bar = np.full((_BAR_PX, wide, 3), _BAR, np.uint8)
    for line, foot, colour in zip(lines, (18, 38), (_TITLE, _FIGURES), strict=True):
        text = line.encode("ascii", "replace").decode("ascii")
        (long, _), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, _LETTERS, 1)
        scale = _LETTERS * min(1.0, (wide - 2 * _INDENT_PX) / max(long, 1))
        cv2.putText(bar, text, (_INDENT_PX, foot), cv2.FONT_HERSHEY_SIMPLEX, scale, colour, 1, cv2.LINE_AA)
    return np.concatenate([picture, bar])
