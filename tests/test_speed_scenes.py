"""What the speed command draws: every scene that it times is one."""

import pytest

from fieldgym.scripts.speed_scenes import picture_scenes


@pytest.mark.slow
def test_every_timed_picture_is_drawn_by_both_renderers():
    names = []
    for name, target_ms, draw, tiny in picture_scenes():
        draw()
        tiny()
        assert target_ms > 0.0
        names.append(name)
    assert len(names) == len(set(names)) == 14
