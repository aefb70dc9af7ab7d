"""The command that sets the renderers side by side: scenes, tables, detectors, painted ground."""

import numpy as np
import pytest

from fieldgym.rendering.cameras import view_of
from fieldgym.rendering.renderer import Renderer
from fieldgym.scripts.beside_tiny import by_tiny, numbered, painted, visible
from fieldgym.scripts.compare_renderers import main
from fieldgym.scripts.detections import DETECTORS
from fieldgym.scripts.takes import GROUPS, takes


def test_the_command_says_how_equal_a_camera_s_pictures_are(tmp_path, capsys):
    main(["--only", "sorter", "--repeat", "1", "--out", str(tmp_path / "table.md")])
    printed, lines = capsys.readouterr().out, (tmp_path / "table.md").read_text("utf-8").splitlines()
    rows = [line.split(" | ") for line in lines if line.startswith("| sort")]
    assert [row[0] for row in rows] == ["| sorter's camera", "| sorting"] and "sorter's camera" in printed
    for name, pixels, own_ms, _, tiny_ms, times, identities, depth_um, colours, digest in rows:
        assert pixels in ("320 x 240", "640 x 480") and len(digest) == len("0123456789abcdef |")
        assert float(times) == pytest.approx(float(tiny_ms) / float(own_ms), rel=0.02, abs=0.6)
        # People look from four times as far, where PyBullet's buffer of depths is coarser.
        assert float(identities) >= 99.9 and float(depth_um) < (2.0 if "camera" in name else 5.0)
        assert 50.0 < float(colours) < 100.0


def test_digests_are_of_pictures(capsys):
    main(["--only", "trays", "--hashes"])
    first = capsys.readouterr().out
    main(["--only", "trays", "--hashes"])
    assert capsys.readouterr().out == first
    lines = [line.split(" ", 1) for line in first.splitlines()]
    assert [name for _, name in lines] == ["tray camera, source row", "tray camera, target row", "trays"]
    assert len({digest for digest, _ in lines}) == 3


def test_wrong_options_are_told_in_one_line(capsys):
    for words, said in ((["--frames", "1"], "--frames 1: give 0, or 2 or more"), (["--repeat", "0"], "--repeat 0")):
        with pytest.raises(SystemExit):
            main(words)
        assert said in capsys.readouterr().err


def test_painted_ground_is_that_of_the_renderer():
    for take in takes("laser"):
        if not take.people:
            assert take.view.ground is not None
            drawn = take.stage.things("plants", "soil")
            bare = Renderer(take.stage.library).look(drawn, *take.view.whence).frame
            taken = take.draw()
            assert np.array_equal(painted(bare, take.view.ground, view_of(*take.view.whence)).rgb, taken.rgb)
            assert not np.array_equal(bare.rgb, taken.rgb)


def test_what_cannot_show_is_left_out_and_nothing_else():
    for take in takes("picker"):
        if not take.people:
            whole = take.view._replace(things=numbered(take.view.things))
            some = visible(take.stage.library, whole)
            assert len(some.mesh) < 0.9 * len(whole.things.mesh)
            renderer = Renderer(take.stage.library)
            own, other = (renderer.look(these, *whole.whence).identity for these in (whole.things, some))
            assert np.array_equal(own, other)
            break


@pytest.mark.slow
@pytest.mark.parametrize("name", DETECTORS)
def test_detectors_make_the_same_of_both(name):
    # Few pictures of the belt do not show both tubers and fruit.
    pictures = 16 if "produce" in name else 4
    own = DETECTORS[name](pictures)
    with by_tiny():
        tiny = DETECTORS[name](pictures)
    assert own.truth == tiny.truth > 0 and abs(own.found - tiny.found) <= 1 and abs(own.false - tiny.false) <= 1
    assert own.found > 0.4 * own.truth
    assert (np.isnan(own.error_mm) and np.isnan(tiny.error_mm)) or abs(own.error_mm - tiny.error_mm) < 0.3


@pytest.mark.slow
def test_every_camera_and_every_task_s_picture_is_compared():
    names = [take.name for take in takes() if take.draw() is not None]
    assert len(names) == len(set(names)) == 17 and len(GROUPS) == 5
