"""Pictures of fields that differ: soil, shadows, lens and sensor, plants of single leaves, and the keyword for them."""

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.envs.weeding.growing import BROADLEAVES, CROPS, GRASSES, LEAVES, Nursery, leaf_mesh
from fieldgym.envs.weeding.outdoors import day_of, seen_by
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.scene import WeederScene
from fieldgym.perception.frames import Camera
from fieldgym.rendering.cameras import sun_view
from fieldgym.rendering.instances import instances
from fieldgym.rendering.library import MeshLibrary
from fieldgym.rendering.noise import stream
from fieldgym.rendering.optics import Optics, blurred, sensed, taps
from fieldgym.rendering.outdoor import TILE, Outdoors, Shade, Soil, height, shade_share, sun_share, tile
from fieldgym.rendering.raster import Light
from fieldgym.rendering.renderer import Renderer
from fieldgym.rendering.shapes import box

CLEAR = Optics(0.0, 0.0, np.ones(3), 0.0, 0.0, 0.0)
LIT = Shade(np.array([1.0, 0.0]), 0.0, 0.01, 1.0)
EVEN = Soil(np.array([120.0, 100.0, 80.0]), 0.0, 0.0, 0.0, np.array([1.0, 0.0]), np.zeros(2))
SUN = Light(np.array([0.6, 0.0, 0.8]), 0.4, 0.75, 0.0, np.ones(3))
CAMERA = Camera(80, 60, 0.5, 0.1, 3.0)
EYE, DOWN, UP = np.array([0.0, 0.0, 1.0]), np.zeros(3), (1.0, 0.0, 0.0)


def taken(things, library, **changed):
    """A picture from above of things on even ground."""
    outdoors = Outdoors(SUN, 0.1, EVEN, LIT, CLEAR, 1)._replace(**changed)
    return Renderer(library).look(things, CAMERA, EYE, DOWN, UP, outdoors)


def empty():
    library = MeshLibrary()
    library.add(box((0.04, 0.04, 0.2)))
    return instances(np.zeros(0, np.int32), np.zeros((0, 3))), library


def test_the_tile_is_even_on_average_and_goes_on_around_its_edges():
    heights = tile()
    assert heights.shape == (TILE, TILE) and abs(float(heights.mean())) < 1e-3
    assert float(heights.std()) == pytest.approx(1.0, abs=1e-3)
    assert height(heights, 0.005, 0.007, 1.0) == pytest.approx(float(heights[7, 5]), abs=1e-6)
    assert height(heights, 0.0025 + 1.024, -1.0235, 1.0) == pytest.approx(
        height(heights, 0.0025, 0.0005, 1.0), abs=1e-5
    )
    # No step where the tile begins anew.
    across = np.abs(np.diff(heights, axis=1))
    assert np.abs(heights[:, 0] - heights[:, -1]).mean() < 2.0 * across.mean()


def test_level_ground_has_its_colour_under_sun_and_sky():
    rgb = taken(*empty()).frame.rgb
    assert np.ptp(rgb, axis=(0, 1)).max() <= 1
    assert rgb[30, 40] == pytest.approx(np.array([120.0, 100.0, 80.0]) * (0.4 + 0.75 * 0.8), abs=1.0)


def test_a_post_throws_a_shadow_as_long_as_the_sun_is_low():
    _, library = empty()
    post = instances(0, (-0.1, 0.0, 0.1), None, (1.0, 1.0, 1.0), 5)
    look = taken(post, library)
    rgb, pixels = look.frame.rgb.astype(float), 60.0 / (2.0 * np.tan(0.25))
    lit = 100.0 * (0.4 + 0.75 * 0.8)

    def at(x, y):
        # The picture's top is ahead (+x), its left +y; the axis meets (w / 2, h / 2 - 1).
        return rgb[round(29 - x * pixels), round(40 - y * pixels), 1]

    # The sun stands ahead: the shadow falls behind, 0.2 * 0.6 / 0.8 beyond the post.
    assert at(0.05, 0.0) == pytest.approx(lit, abs=1.5) and at(-0.2, 0.1) == pytest.approx(lit, abs=1.5)
    assert at(-0.2, 0.0) == pytest.approx(100.0 * (0.4 + 0.1 * 0.75 * 0.8), abs=2.0)
    assert at(-0.23, 0.0) < 0.6 * lit
    assert set(np.unique(look.identity)) == {-1, 5}
    assert look.frame.depth_m[29, 5] == pytest.approx(1.0, abs=1e-3)


def test_shade_begins_at_its_edge():
    shade = Shade(np.array([0.0, 1.0]), 0.2, 0.02, 0.25)
    assert [shade_share(shade, 3.0, y) for y in (0.18, 0.2, 0.22)] == pytest.approx([1.0, 0.625, 0.25])
    rgb = taken(*empty(), shade=Shade(np.array([0.0, 1.0]), 0.0, 0.001, 0.25)).frame.rgb
    assert rgb[30, 10, 1] < 0.7 * rgb[30, 70, 1]


def test_sunlight_is_blended_over_the_edge_of_a_shadow():
    view = sun_view(np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.1, 20)
    reached = np.zeros((20, 20), np.float32)
    reached[:, :10] = view.far_m
    shares = [sun_share(view, reached, *place, 0.0, 0.01, 0.2) for place in ((-0.05, 0.0), (0.05, 0.0), (5.0, 0.0))]
    assert sorted(shares[:2]) == pytest.approx([0.2, 1.0]) and shares[2] == 1.0


def test_a_blur_keeps_the_light_and_motion_smears_it_down():
    still, moved = taps(0.6, 0.0), taps(0.6, 4.0)
    assert float(still.sum()) == pytest.approx(1.0, abs=1e-6) and float(moved.sum()) == pytest.approx(1.0, abs=1e-6)
    assert np.array_equal(still, still[::-1]) and moved[4] < still[4]
    flat = np.full((12, 14, 3), 77.0, np.float32)
    assert np.abs(blurred(flat, still, moved) - 77.0).max() < 1e-3
    point = np.zeros((15, 17, 3), np.float32)
    point[7, 8, 1] = 100.0
    seen = blurred(point, still, moved)
    assert np.abs(seen[3:12, 4:13, 1] - 100.0 * np.outer(moved, still)).max() < 1e-3
    assert not seen[..., 0].any()


@pytest.mark.parametrize("shape", [(13, 21, 3), (3, 5, 3), (1, 2, 3), (6, 1, 3)])
def test_a_blur_adds_its_taps_up_in_their_order(shape):
    """To the last bit, also where a picture is narrower than the blur."""
    image = np.random.default_rng(4).uniform(0.0, 300.0, shape).astype(np.float32)
    across, down = taps(0.7, 0.0), taps(0.9, 3.0)
    flat, seen = np.zeros_like(image), np.zeros_like(image)
    beyond = np.pad(image, ((0, 0), (4, 4), (0, 0)), mode="edge")
    for i, weight in enumerate(across):
        flat += weight * beyond[:, i : i + shape[1]]
    beyond = np.pad(flat, ((4, 4), (0, 0), (0, 0)), mode="edge")
    for i, weight in enumerate(down):
        seen += weight * beyond[i : i + shape[0]]
    np.testing.assert_array_equal(blurred(image, across, down), seen)


def test_the_sensor_s_noise_is_each_colour_s_own_and_grows_with_light():
    dark, bright = np.full((60, 80, 3), 40.0, np.float32), np.full((60, 80, 3), 160.0, np.float32)
    rgb = sensed(bright, np.ones(3), 2.0, 0.2, 0.0, stream(3)).astype(float)
    assert rgb.std() == pytest.approx(np.sqrt(4.0 + 32.0), rel=0.05)
    assert sensed(dark, np.ones(3), 2.0, 0.2, 0.0, stream(3)).astype(float).std() == pytest.approx(
        np.sqrt(12.0), rel=0.05
    )
    assert abs(np.corrcoef(rgb[..., 0].ravel(), rgb[..., 1].ravel())[0, 1]) < 0.05
    still = sensed(dark, np.array([0.5, 1.0, 2.0]), 0.0, 0.0, 0.3, stream(3))
    assert still[30, 40].tolist() == [20, 40, 80] and still[0, 0].tolist() == [14, 28, 56]


def test_a_day_follows_from_one_number_and_two_numbers_make_two_days():
    one, same, other = day_of(0.25), day_of(0.25), day_of(0.2500001)
    assert np.array_equal(one.soil.colour, same.soil.colour) and one.light.ambient == same.light.ambient
    assert not np.array_equal(one.soil.colour, other.soil.colour)
    eye = np.array([1.0, 0.0, 0.85])
    slow, fast = (seen_by(one, eye, speed, 0.001, 3).optics.moved_px for speed in (0.1, 0.2))
    assert fast == pytest.approx(2.0 * slow) and slow == pytest.approx(0.1 * one.open_s / 0.001)


def test_leaves_are_one_long_and_their_shapes_differ():
    for name, leaf in LEAVES.items():
        corners = leaf_mesh(leaf, 0).vertices
        assert corners[:, 0].min() == pytest.approx(0.0) and corners[:, 0].max() == pytest.approx(1.0), name
        assert 0.6 < np.ptp(corners[:, 1]) <= 1.01, name
    corners = [leaf_mesh(LEAVES["oval"], variant).vertices for variant in range(4)]
    assert len({float(each[each[:, 0].argmax(), 2].round(4)) for each in corners}) == 4


def grown(species, stage, look):
    n = len(look)
    nursery = Nursery(MeshLibrary(), "beet")
    return nursery.weeds(np.full(n, species), np.full(n, stage), np.asarray(look))


def test_a_plant_follows_from_its_look_alone_and_plants_of_a_kind_differ():
    one, many = grown(0, 1, [0.3]), grown(0, 1, np.linspace(0.01, 0.99, 60))
    again = grown(0, 1, [0.7, 0.3])
    own = again.plant == 1
    assert np.array_equal(one.turn, again.turn[own]) and np.array_equal(one.colour, again.colour[own])
    leaves = np.bincount(many.plant)
    assert len(set(leaves.tolist())) > 2
    length = np.array([np.linalg.norm(many.turn[many.plant == i, :, 0], axis=1).max() for i in range(60)])
    assert 0.008 < length.min() < 0.75 * np.median(length) and 1.35 * np.median(length) < length.max() < 0.05
    assert many.colour.std(axis=0).min() > 0.02


@pytest.mark.parametrize("growth", [*BROADLEAVES, *GRASSES, *CROPS.values()])
def test_a_kind_of_plant_is_whole(growth):
    assert growth.leaf in LEAVES and growth.seed_leaf in ("", *LEAVES)
    assert len(growth.leaf_m) == len(growth.leaves)
    assert all(low <= high for low, high in growth.leaves) and growth.rise[0] < growth.rise[1]
    assert growth.seed_leaf or growth.leaves[0][0] > 0


def test_shares_of_the_species_add_up():
    for kinds in (BROADLEAVES, GRASSES):
        assert sum(growth.share for growth in kinds) == pytest.approx(1.0)


@pytest.fixture(scope="module")
def scene():
    config = WeedingConfig(pictures="field")
    made = WeederScene(config, config.parameters)
    yield made
    made.close()


def show(scene, look=0.4, ground=0.37):
    places = np.array([[0.0, 0.11], [0.05, -0.11], [0.1, 0.12]])
    scene.load(
        places, np.array([0, 1, 0]), np.array([2, 2, 1]), np.array([look, 0.5, 0.9]), np.array([[0.0, 0.0]]), ground
    )


def whose(scene):
    eye = np.array([0.0, 0.0, 0.85])
    scene.plant_around(0.0)
    ground = scene.bare_ground(scene.front, eye)
    return scene.stage.seen(scene.front, eye, eye - [0, 0, 1], UP, "plants", "soil", ground=ground)


def test_the_same_place_gives_the_same_picture_and_another_look_another_plant(scene):
    show(scene)
    first = scene.look_front(-0.85).rgb
    scene.look_front(2.0)
    assert np.array_equal(first, scene.look_front(-0.85).rgb)
    before = whose(scene).identity
    show(scene, look=0.41)
    after = whose(scene).identity
    assert np.array_equal(before == 1, after == 1) and not np.array_equal(before == 0, after == 0)
    show(scene, ground=0.38)
    assert np.abs(scene.look_front(-0.85).rgb.astype(float) - first).mean() > 5.0


def test_every_leaf_belongs_to_its_plant_and_a_dead_one_is_scorched(scene):
    show(scene)
    look = whose(scene)
    assert {0, 1, 2, 3} <= set(np.unique(look.identity).tolist())
    alive = look.frame.rgb[look.identity == 0].mean(axis=0)
    scene.set_dead(np.array([True, False, False]), np.zeros(1, bool), [])
    dead = whose(scene)
    assert dead.frame.rgb[dead.identity == 0].mean(axis=0).max() < 0.4 * alive.max()
    assert np.array_equal(dead.identity == 1, look.identity == 1)


def test_pictures_are_chosen_by_keyword_and_do_not_change_the_field():
    made: list[Any] = [
        gym.make("fieldgym/LaserWeeding-v0", backend="analytic", perception="perfect", pictures=kind).unwrapped
        for kind in ("easy", "field")
    ]
    easy, field = made
    easy.reset(seed=3)
    field.reset(seed=3)
    assert np.array_equal(easy.field.weeds.along_m, field.field.weeds.along_m)
    assert replace(easy.core.config, pictures="field") == field.core.config
    with pytest.raises(ValueError, match=r"pictures.*'easy' or 'field'"):
        gym.make("fieldgym/LaserWeeding-v0", pictures="hard")
