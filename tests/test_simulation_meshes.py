"""Pools hide what is not needed, and a camera that leaves out what it cannot see draws the same picture."""

from collections.abc import Iterator

import numpy as np
import pytest

from fieldgym.perception.frames import Camera
from fieldgym.simulation.camera import look
from fieldgym.simulation.client import PhysicsClient
from fieldgym.simulation.meshes import Pool, box, frustum, rod, surface_of_revolution

CAMERA = Camera(160, 120, np.deg2rad(46.0), 0.1, 2.0)
EYE, UP = np.array([0.0, 0.0, 0.8]), np.array([0.0, 1.0, 0.0])
DOWN = EYE - np.array([0.0, 0.0, 1.0])
RED = (0.9, 0.1, 0.1, 1.0)


@pytest.fixture
def client() -> Iterator[PhysicsClient]:
    with PhysicsClient() as client:
        yield client


def red_pixels(client: PhysicsClient, *, shadows: bool = False) -> int:
    rgb = look(CAMERA, client, EYE, DOWN, UP, shadows=shadows).rgb.astype(int)
    return int(np.count_nonzero(rgb[..., 0] - rgb[..., 1] > 40))


def test_a_copy_is_seen_only_while_it_is_placed(client):
    pool = Pool(client, box((0.05, 0.05, 0.05)), RED, 3)
    assert red_pixels(client) == 0
    first = pool.place((-0.1, 0.0, 0.0))
    one = red_pixels(client)
    second = pool.place((0.1, 0.0, 0.0))
    assert one > 50 and red_pixels(client) == pytest.approx(2 * one, rel=0.1)
    assert first is not None and second is not None
    pool.park(second)
    assert red_pixels(client) == one
    pool.show(np.ones(2, dtype=bool))
    assert red_pixels(client) == one, "what was parked comes back with place alone"
    pool.show(np.zeros(2, dtype=bool))
    assert red_pixels(client) == 0
    pool.clear()
    assert len(pool.places) == 0 and red_pixels(client) == 0
    assert pool.place((-0.1, 0.0, 0.0)) == 0 and red_pixels(client) == one


def test_a_pool_says_when_it_is_empty_and_keeps_its_colours(client):
    pool = Pool(client, box((0.05, 0.05, 0.05)), RED, 2)
    assert pool.place((-0.1, 0.0, 0.0), colour=(0.1, 0.1, 0.9, 1.0)) == 0
    assert red_pixels(client) == 0
    assert pool.place((0.1, 0.0, 0.0)) == 1 and pool.place((0.0, 0.0, 0.0)) is None
    pool.clear()
    pool.place((-0.1, 0.0, 0.0), colour=RED)
    assert red_pixels(client) > 50


def test_hidden_copies_throw_no_shadow(client):
    ground = Pool(client, box((2.0, 2.0, 0.02), bottom=False), (0.8, 0.8, 0.8, 1.0), 1)
    ground.place((0.0, 0.0, -0.01))
    bare = look(CAMERA, client, EYE, DOWN, UP, shadows=True).rgb
    pool = Pool(client, box((0.1, 0.1, 0.02)), RED, 4)
    for x in (-0.2, 0.0, 0.2):
        pool.place((x, 0.0, 0.2))
    assert not np.array_equal(look(CAMERA, client, EYE, DOWN, UP, shadows=True).rgb, bare)
    pool.clear()
    assert np.array_equal(look(CAMERA, client, EYE, DOWN, UP, shadows=True).rgb, bare)


@pytest.mark.parametrize("up", [(0.0, 1.0, 0.0), (0.6, 0.8, 0.0)])
def test_leaving_out_what_cannot_be_seen_changes_no_pixel(client, up):
    numbers = np.random.default_rng(5)
    ball = surface_of_revolution(np.array([0.0, 0.03, 0.0]), np.array([-0.03, 0.0, 0.03]), 6)
    pool = Pool(client, ball, RED, 60)
    for place in numbers.uniform((-0.5, -0.5, 0.0), (0.8, 0.6, 0.6), (60, 3)):
        pool.place(place)
    view = EYE, DOWN + np.array([0.2, 0.1, 0.0]), np.array(up)
    full = look(CAMERA, client, *view)
    seen = CAMERA.sees(pool.places, pool.reach_m, *view)
    pool.show(seen)
    culled = look(CAMERA, client, *view)
    assert 10 < seen.sum() < 50
    assert np.array_equal(full.rgb, culled.rgb) and np.array_equal(full.depth_m, culled.depth_m)
    pool.show(~seen)
    assert look(CAMERA, client, *view).depth_m.min() > 1.99


def test_a_box_without_its_bottom_looks_the_same_from_above(client):
    for bottom in (True, False):
        assert box((0.2, 0.1, 0.05), bottom=bottom).triangles.shape == (12 if bottom else 10, 3)
    pool = Pool(client, box((0.2, 0.1, 0.05), bottom=True), RED, 1)
    pool.place((0.0, 0.0, 0.0))
    whole = look(CAMERA, client, EYE, DOWN, UP).rgb
    pool.clear()
    Pool(client, box((0.2, 0.1, 0.05), bottom=False), RED, 1).place((0.0, 0.0, 0.0))
    assert np.array_equal(look(CAMERA, client, EYE, DOWN, UP).rgb, whole)


def test_a_rod_runs_from_end_to_end():
    start, end = np.array([0.1, -0.2, 0.3]), np.array([0.5, 0.4, -0.6])
    offset = rod(start, end, 0.004).vertices - start
    way = end - start
    along = offset @ way / np.linalg.norm(way)
    aside = np.linalg.norm(offset - np.outer(along, way) / np.linalg.norm(way), axis=1)
    assert np.allclose(aside, 0.004 / np.sqrt(2.0))
    assert np.allclose(np.unique(along.round(9)), [0.0, float(np.linalg.norm(way))])


def test_a_frustum_has_an_edge_to_each_corner_and_between_them():
    mesh = frustum((0.2, 0.1), 0.7, 0.004)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    assert np.allclose(high, (0.2, 0.1, 0.0), atol=0.005) and np.allclose(low, (-0.2, -0.1, -0.7), atol=0.005)
    assert len(mesh.triangles) == 8 * len(box((1.0, 1.0, 1.0)).triangles)
