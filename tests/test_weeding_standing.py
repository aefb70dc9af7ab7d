"""Cameras on a frame that shakes: rendered pictures show what the rules reckon with."""

from dataclasses import replace

import numpy as np
import pytest

from fieldgym.envs.shaking import believed, height_at, lands
from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.eyes import ClassicalEyes
from fieldgym.envs.weeding.ground import draw_profile, shape_of, surface_of
from fieldgym.envs.weeding.ground_config import GroundConfig
from fieldgym.envs.weeding.standing import Standing
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.scene import WeederScene
from fieldgym.perception.weeds import detect

CONFIG = replace(
    WeedingConfig(pictures="easy"),
    scenario=replace(SCENARIOS["load-1.0"], ground=GroundConfig(iso_class="soil", wander_m=0.0143)),
)
SHAPE = shape_of(CONFIG)
CARTS = (0.4, 2.3, 5.1)


@pytest.fixture(scope="module")
def scene():
    made = WeederScene(CONFIG, CONFIG.parameters)
    yield made
    made.close()


def show(scene, weeds, standing):
    """Put two-leaf broadleaves at places (n, 2) on some ground."""
    kinds = np.zeros(len(weeds), np.int64), np.ones(len(weeds), np.int64)
    scene.load(
        np.asarray(weeds, float), *kinds, np.linspace(0.1, 0.9, len(weeds)), np.array([[50.0, 0.0]]), 7.5e-6, standing
    )


def ground(look):
    return surface_of(CONFIG, [draw_profile(CONFIG, look)])[0]


@pytest.mark.parametrize("cart", CARTS)
def test_the_front_camera_takes_plants_to_be_where_a_level_frame_would_see_them(scene, cart):
    surface = ground(0.31)
    weeds = [(cart + 0.85 + along, across) for along in (-0.1, 0.0, 0.1) for across in (-0.12, 0.09)]
    show(scene, weeds, Standing(surface, SHAPE))
    found, off = detect(scene.look_front(cart)).position, []
    for along, across in weeds:
        wanted = np.array(believed(surface, SHAPE, cart, 0.85, 0.85, along, across))
        assert np.hypot(*(found - wanted).T).min() < 0.0025
        off.append(np.hypot(*(wanted - np.array([along, across]))))
    assert max(off) > 0.006


@pytest.mark.parametrize("cart", CARTS)
def test_the_tool_camera_sees_plants_from_where_the_tool_is(scene, cart):
    surface = ground(0.77)
    carrier, lean, across = cart + 0.05, -0.06, 0.11
    told, at = np.array([carrier + lean, across]), np.array(lands(surface, SHAPE, cart, carrier, lean, across))
    show(scene, [at + np.array([0.006, -0.004])], Standing(surface, SHAPE))
    eye = np.array([carrier, 0.0, CONFIG.reach.target_height_m + CONFIG.reach.gap_m])
    seen = ClassicalEyes().tool(scene.look_tool(eye, told, cart), told, 0.008)
    assert seen is not None and np.hypot(*(seen - told - np.array([0.006, -0.004]))) < 0.003
    # From where it was told to be it would have seen the plant elsewhere.
    scene.standing = None
    assert np.hypot(*(at - told)) > 0.003


def test_nothing_on_the_ground_is_below_what_pictures_paint_as_ground():
    surface = ground(0.5)
    standing = Standing(surface, SHAPE)
    places = np.column_stack([np.linspace(-0.5, 8.5, 400), np.linspace(-0.2, 0.2, 400)])
    heights = standing.heights_m(places)
    assert heights.min() >= 0.0
    rules = np.array([height_at(surface, SHAPE, *place) for place in places.tolist()])
    assert np.ptp(heights - rules) < 1e-12
