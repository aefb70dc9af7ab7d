"""The page beside a training: it plays the last evaluation's file, anew when it changes, while somebody watches."""

import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

from fieldgym.kernels.files import replace_file
from fieldgym.scripts import train
from fieldgym.scripts.common import CommandError
from fieldgym.scripts.view import seat_of
from fieldgym.viewer.play import Play

pytest.importorskip("viser", reason="the view extra is not installed")

HOE = "fieldgym/HoeWeeding-v0"
SHIPPED = Path(__file__).resolve().parents[1] / "assets" / "policies" / "HoeWeeding-v0.load-1.25.npz"
PLAY = Play(HOE, "fifo", settings={"backend": "analytic"})


def test_it_plays_the_newest_file_while_somebody_watches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from fieldgym.viewer import follow
    from fieldgym.viewer.show import Viewer

    monkeypatch.setattr(follow, "_EVERY_S", 0.0)
    watchers: dict[int, Any] = {}
    viewer = Viewer(PLAY, seat_of, port=0, bounded=False)
    monkeypatch.setattr(viewer.server, "get_clients", lambda: watchers)
    file = tmp_path / "last.npz"
    follower = follow.Follower(viewer, file)
    try:
        follower.turn()
        assert not viewer.running
        shutil.copy(SHIPPED, file)
        shutil.copy(SHIPPED.with_suffix(".json"), file.with_suffix(".json"))
        follower.turn()
        assert not viewer.running and viewer.play == PLAY, "nobody watches"
        monkeypatch.setattr(viewer, "_aim_narrow", lambda client: None)
        monkeypatch.setattr("fieldgym.viewer.show.aim", lambda *args: None)
        watchers[0] = object()
        follower.turn()
        assert viewer.running and viewer.play.policy == str(file) and viewer.seats[0].policy.name == str(file)
        viewer.set_running(False)
        follower.turn()
        assert not viewer.running, "who watches has paused it"
        before = viewer.seats[0]
        replace_file(file, SHIPPED.read_bytes())
        follower.turn()
        assert viewer.seats[0] is not before and viewer.running and viewer.play.seed == 0
        viewer.seats[0].over = True
        follower.turn()
        assert viewer.running and viewer.play.seed == 1
        watchers.clear()
        follower.turn()
        assert not viewer.running
        watchers[0] = object()
        follower.turn()
        assert viewer.running and viewer.play.seed == 1
        file.write_bytes(b"half of it")
        present = viewer.seats[0]
        follower.turn()
        assert viewer.seats[0] is present
        replace_file(file, SHIPPED.read_bytes())
        follower.turn()
        assert viewer.seats[0] is not present and viewer.play.seed == 1
    finally:
        viewer.close()


@pytest.mark.slow
def test_a_process_serves_it_and_ends_when_it_is_told(tmp_path: Path):
    from urllib.request import urlopen

    from fieldgym.viewer.follow import beside

    process, address = beside(PLAY, tmp_path / "last.npz", seat_of, port=0)
    try:
        assert address.startswith("http://127.0.0.1:")
        assert b"<html" in urlopen(address, timeout=20.0).read(20_000).lower()
        assert process.is_alive()
    finally:
        process.terminate()
        process.join(20.0)
    assert not process.is_alive()


def test_what_cannot_be_shown_is_told_at_once(monkeypatch: pytest.MonkeyPatch):
    class Settings:
        observation = "pixels"

    with pytest.raises(CommandError, match="sees pixels: leave it out"):
        train._check_view(Settings())
    Settings.observation = "features"
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(CommandError, match=r"fieldgym\[view\]"):
        train._check_view(Settings())
