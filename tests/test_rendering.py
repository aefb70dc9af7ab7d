"""The rasteriser: no gaps, exact depth, sides, clipping, light; pictures that follow from their arguments alone."""

import itertools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from fieldgym.kernels import compiled
from fieldgym.kernels.wide import product
from fieldgym.perception.frames import Camera
from fieldgym.rendering.instances import about_z, instances, joined
from fieldgym.rendering.library import GRID, MeshLibrary
from fieldgym.rendering.noise import add_noise, normals, stream
from fieldgym.rendering.plants import spiny_leaf, tuft, whorl
from fieldgym.rendering.renderer import SUN, Renderer, level_colour
from fieldgym.rendering.shapes import Mesh, ball, box, cylinder, ellipsoid, flat_shaded, frustum, merged, rod
from fieldgym.simulation.stage import Stage

CAMERA = Camera(160, 120, np.deg2rad(46.0), 0.1, 3.0)
EYE, UP = np.array([0.0, 0.0, 0.8]), np.array([0.0, 1.0, 0.0])
DOWN = EYE - np.array([0.0, 0.0, 1.0])
RED = (0.9, 0.1, 0.1)
ONE = np.array([[0, 1, 2]])


@pytest.fixture(scope="module")
def garden():
    """A renderer and a scene of everything: (renderer, instances)."""
    library = MeshLibrary()
    meshes = [box((0.1, 0.2, 0.1)), cylinder(0.05, 0.1), ball(0.06), tuft(0.05, 0.05), box((3.0, 3.0, 0.02))]
    kinds = [library.add(mesh) for mesh in [*meshes, whorl(5, spiny_leaf(0.08, 0.03, 0.015, 3), 0.08)]]
    rng = np.random.default_rng(1)
    n = 60
    things = instances(
        np.array(kinds)[rng.integers(0, len(kinds), n)],
        rng.uniform((-0.6, -0.5, 0.0), (0.6, 0.5, 0.3), (n, 3)),
        about_z(rng.uniform(0.0, 7.0, n)) * rng.uniform(0.5, 1.5, (n, 1, 3)),
        rng.uniform(0.0, 1.0, (n, 3)),
        np.arange(n),
    )
    return Renderer(library), things


def seen(mesh, place=(0.0, 0.0, 0.0), turn=None, camera=CAMERA, eye=EYE, target=DOWN, up=UP):
    library = MeshLibrary()
    thing = instances(library.add(mesh), place, turn, RED, 7)
    return Renderer(library).look(thing, camera, eye, target, up)


@pytest.mark.parametrize("seed", range(5))
def test_a_sheet_of_triangles_has_no_gap_and_is_as_deep_as_its_plane(seed):
    """Corners on and off the samples, at random views; every pixel well inside must show the sheet."""
    rng = np.random.default_rng(seed)
    n = 17
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, n), np.linspace(-0.4, 0.4, n))
    inner = np.zeros((n, n), bool)
    inner[1:-1, 1:-1] = True
    step = 0.8 / (n - 1)
    x, y = x + inner * rng.uniform(-0.3, 0.3, (n, n)) * step, y + inner * rng.uniform(-0.3, 0.3, (n, n)) * step
    corner = np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)])
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [np.stack([first, first + 1, first + n + 1], -1), np.stack([first, first + n + 1, first + n], -1)]
    )
    eye = np.array([*rng.uniform(-0.1, 0.1, 2), 0.8])
    look = seen(flat_shaded(corner, faces), eye=eye, target=np.array([*rng.uniform(-0.05, 0.05, 2), 0.0]))
    pose = look.frame.camera
    rows, columns = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    rays = np.stack([columns, rows, np.ones_like(rows)], -1) @ np.linalg.inv(pose.intrinsics).T
    rays = rays @ pose.world_from_camera[:3, :3].T
    depth = -pose.world_from_camera[2, 3] / rays[..., 2]
    spot = pose.world_from_camera[:2, 3] + depth[..., None] * rays[..., :2]
    inside = (np.abs(spot) < 0.4 - 1e-4).all(axis=-1)
    assert inside.mean() > 0.3
    assert (look.identity[inside] == 7).all()
    assert np.abs(look.frame.depth_m - depth)[inside].max() < 1e-6
    assert (look.identity[(np.abs(spot) > 0.4 + 1e-4).any(axis=-1)] == -1).all()


def test_a_face_shows_its_front_alone_unless_its_twin_shows_the_back():
    sheet = np.array([[-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.0, 0.1, 0.0]])
    front, back = np.array([[0, 1, 2]]), np.array([[2, 1, 0]])
    assert (seen(flat_shaded(sheet, front)).identity == 7).sum() > 100
    assert (seen(flat_shaded(sheet, back)).identity == 7).sum() == 0
    both = MeshLibrary()
    both.add(flat_shaded(sheet, back, two_sided=True))
    assert both.meshes.two_sided.tolist() == [1] and len(both.meshes.vertex) == 3
    lit = seen(flat_shaded(sheet, back, two_sided=True)).frame.rgb
    assert np.array_equal(lit, seen(flat_shaded(sheet, front)).frame.rgb)


def test_what_is_nearer_than_near_is_cut_away_and_no_more():
    """A wall that runs from behind the camera into its view is seen from ``near_m`` on."""
    wall = box((0.02, 2.0, 2.0))
    for face, nearest in ((0.02, CAMERA.near_m), (0.14, 0.14 * 2.0 * np.tan(np.deg2rad(23.0)) ** -1 * 60.0 / 158.0)):
        look = seen(wall, place=(face + 0.01, 0.0, 0.8))
        depth = look.frame.depth_m[look.identity == 7]
        # Unless near comes first, the wall leaves the picture at its right edge.
        assert depth.min() == pytest.approx(nearest, rel=0.02) and depth.min() > CAMERA.near_m - 1e-6
        assert len(depth) > 1000
    housing = seen(box((0.15, 0.15, 0.15)), place=EYE)
    assert (housing.identity == -1).all(), "a camera sees out of its own housing"
    cut = seen(box((4.0, 4.0, 0.2)), place=(0.0, 0.0, 0.65), camera=Camera(160, 120, np.deg2rad(46.0), 0.02, 3.0))
    assert (cut.identity == 7).all() and cut.frame.depth_m == pytest.approx(0.05, abs=1e-6)


def test_light_is_the_formula_that_the_cameras_were_measured_in():
    """62 % from everywhere, 50 % from the sun, 3 % highlight; colours are cut to whole numbers before and after."""
    look = seen(box((1.0, 1.0, 0.1)), place=(0.0, 0.0, -0.05))
    assert (look.frame.rgb == level_colour(RED)).all()
    n_l = SUN.towards[2]
    shine = 0.5 * n_l + 0.03 * n_l**2
    wanted = [int(int(255 * c) * (0.62 + shine * tint)) for c, tint in zip(RED, (1.0, 0.98, 0.94), strict=True)]
    assert level_colour(RED).tolist() == wanted
    # A side away from the sun has the ambient share alone.
    dark = seen(
        box((0.4, 0.4, 0.4)), eye=np.array([-1.0, 0.3, 0.0]), target=np.zeros(3), up=np.array([0.0, 0.0, 1.0])
    ).frame.rgb
    assert [int(0.62 * int(255 * c)) for c in RED] in dark.reshape(-1, 3).tolist()


def test_a_stretched_ball_is_an_ellipsoid_with_its_light():
    half = (0.2, 0.1, 0.05)
    turn = about_z([0.7])[0]
    stretched = seen(ellipsoid((1.0, 1.0, 1.0)), turn=turn * np.array(half))
    whole = seen(ellipsoid(half), turn=turn)
    assert (stretched.identity != whole.identity).mean() < 1e-3
    assert (
        np.abs(stretched.frame.depth_m - whole.frame.depth_m)[(stretched.identity == 7) & (whole.identity == 7)].max()
        < 1e-5
    )
    assert np.abs(stretched.frame.rgb.astype(int) - whole.frame.rgb)[stretched.identity == whole.identity].max() <= 2


def test_what_reaches_into_the_picture_is_drawn_wherever_its_middle_is():
    """The same mesh with a speck far away, whose ball is never left out, gives the same picture."""
    leaf, speck = spiny_leaf(0.3, 0.05, 0.02), flat_shaded(np.array([[9.0, 0, 0], [9.0, 0, 1e-4], [9.0, 1e-4, 0]]), ONE)
    library = MeshLibrary()
    kinds = library.add(leaf), library.add(merged(leaf, speck))
    renderer, numbers = Renderer(library), np.random.default_rng(6)
    visible = 0
    for _ in range(150):
        place, turn = numbers.uniform((-0.7, -0.6, 0.0), (0.7, 0.6, 0.7)), about_z(numbers.uniform(0.0, 7.0))
        one, other = (renderer.look(instances(kind, place, turn, RED, 7), CAMERA, EYE, DOWN, UP) for kind in kinds)
        assert np.array_equal(one.identity, other.identity)
        visible += 0 < (one.identity == 7).sum() < 200
    assert visible > 10


def test_balls_about_meshes_hide_nothing(garden):
    """Each instance alone is seen where it is the nearest in the picture of all."""
    renderer, things = garden
    full = renderer.look(things, CAMERA, EYE, DOWN, UP)
    for i in np.unique(full.identity[full.identity >= 0])[::4]:
        alone = renderer.look(things.where(np.arange(len(things.mesh)) == i), CAMERA, EYE, DOWN, UP)
        there = full.identity == i
        assert np.array_equal(alone.frame.rgb[there], full.frame.rgb[there])
        assert np.array_equal(alone.frame.depth_m[there], full.frame.depth_m[there])


def test_a_picture_follows_from_its_arguments_alone(garden):
    renderer, things = garden
    first = renderer.look(things, CAMERA, EYE, DOWN, UP)
    picture = renderer.picture(things, things, CAMERA, [0.9, -0.9, 0.7], [0.0, 0.0, 0.1], [0.0, 0.0, 0.0])
    renderer.look(things.where(things.mesh > 2), Camera(80, 60), EYE + 0.1, DOWN, UP)
    other = Renderer(renderer.library)
    again = other.picture(things, things, CAMERA, [0.9, -0.9, 0.7], [0.0, 0.0, 0.1], [0.0, 0.0, 0.0])
    assert np.array_equal(picture, again)
    for look in (other.look(things, CAMERA, EYE, DOWN, UP), renderer.look(things, CAMERA, EYE, DOWN, UP)):
        assert np.array_equal(first.frame.rgb, look.frame.rgb) and np.array_equal(first.identity, look.identity)
        assert not np.shares_memory(first.frame.rgb, look.frame.rgb)


def test_many_looks_in_one_call_are_the_single_ones_whatever_the_batch_and_the_threads(garden):
    renderer, things = garden
    rng = np.random.default_rng(3)
    scenes = [things.where(rng.random(len(things.mesh)) < 0.7) for _ in range(8)]
    eye = EYE + rng.uniform(-0.1, 0.1, (8, 3))
    target = eye - np.array([0.0, 0.0, 1.0])
    whole = renderer.looks(scenes, CAMERA, eye, target, UP)
    for k in range(8):
        single = renderer.look(scenes[k], CAMERA, eye[k], target[k], UP)
        assert np.array_equal(whole[0][k], single.frame.rgb)
        assert np.array_equal(whole[1][k], single.frame.depth_m)
        assert np.array_equal(whole[2][k], single.identity)

    def part(k):
        return Renderer(renderer.library).looks(scenes[k : k + 2], CAMERA, eye[k : k + 2], target[k : k + 2], UP)

    with ThreadPoolExecutor(2) as pool:
        parts = list(pool.map(part, range(0, 8, 2)))
    for column, together in enumerate(whole):
        assert np.array_equal(np.concatenate([part[column] for part in parts]), together)


def test_a_shadow_falls_away_from_the_sun_and_marks_throw_none():
    library = MeshLibrary()
    ground = instances(library.add(box((6.0, 6.0, 0.02))), (0.0, 0.0, -0.01), None, (0.6, 0.6, 0.6))
    post = instances(library.add(box((0.1, 0.1, 0.4))), (0.0, 0.0, 0.2), None, RED)
    renderer, both = Renderer(library), joined([ground, post])
    eye, target = np.array([0.0, -0.01, 3.0]), np.zeros(3)
    camera = Camera(200, 200, np.deg2rad(40.0), 0.1, 6.0)
    bare = renderer.picture(both, ground, camera, eye, target, target)
    shaded = renderer.picture(both, joined([ground, post]), camera, eye, target, target)
    darker = (bare.astype(int) - shaded).sum(axis=-1) > 60
    rows, columns = np.nonzero(darker)
    focal = 100.0 / np.tan(np.deg2rad(20.0))
    place = np.stack([columns - 100.0, 99.0 - rows], axis=-1) * 3.0 / focal
    # Light comes from (0.6, -0.5, 1.6): a post 0.4 m high is as long on the ground as 0.4 / 1.6 of that.
    way = -0.4 / 1.6 * np.array([0.6, -0.5])
    along = place @ way / np.linalg.norm(way)
    corner = 0.05 * np.abs(way).sum() / np.linalg.norm(way)
    assert 200 < darker.sum() < 2000
    assert along.max() == pytest.approx(np.linalg.norm(way) + corner, abs=0.02) and along.min() > -corner
    assert (bare[0, 0] == level_colour((0.6, 0.6, 0.6))).all()


def test_what_the_sun_reaches_does_not_shade_itself():
    library = MeshLibrary()
    plate = instances(library.add(box((1.0, 1.0, 0.02))), (0.0, 0.0, 0.0), None, RED)
    things = joined([plate, instances(library.add(ball(0.2)), (0.0, 0.0, 0.4), None, RED)])
    renderer, view = Renderer(library), (CAMERA, [0.0, -1.4, 0.9], [0.0, 0.0, 0.1], np.zeros(3))
    bare, shaded = renderer.picture(things, joined([]), *view), renderer.picture(things, things, *view)
    changed = (bare != shaded).any(axis=-1)
    # The ball's shadow lies on the plate; nowhere else is it darker, but on the ball's own edge of night.
    assert 0.01 < changed.mean() < 0.06
    assert (renderer.picture(plate, plate, *view) == renderer.picture(plate, joined([]), *view)).all()


def test_marks_for_people_throw_no_shadow():
    stage = Stage()
    ground, post = stage.library.add(box((6.0, 6.0, 0.02))), stage.library.add(box((0.1, 0.1, 0.4)))
    stage.put("ground", instances(ground, (0.0, 0.0, -0.01), None, (0.6, 0.6, 0.6)))
    pictures = []
    for shadow in (True, False):
        stage.put("post" if shadow else "mark", instances(post, (0.0, 0.0, 0.2), None, RED), shadow=shadow)
        pictures.append(stage.picture(CAMERA, (0.0, -0.01, 3.0), np.zeros(3), np.zeros(3)).astype(int))
        stage.put("post", joined([]))
    dark = int(0.62 * 153 + 0.5 * 0.35 * 153)
    assert [np.count_nonzero(picture[..., 0] < dark) > 50 for picture in pictures] == [True, False]


def test_edges_in_pictures_are_blended_with_the_sky():
    library = MeshLibrary()
    black = instances(library.add(box((0.5, 0.5, 0.02))), (0.0, 0.0, 0.0), about_z([0.3]), (0.0, 0.0, 0.0))
    red = Renderer(library).picture(black, joined([]), CAMERA, [0.0, -0.01, 0.8], np.zeros(3), np.zeros(3))[..., 0]
    assert 100 < np.count_nonzero((red > 20) & (red < 150)) < 800
    assert np.count_nonzero(red == 0) > 5000 and (np.diff(red[:, 0].astype(int)) >= 0).all()


def test_coordinates_lie_on_a_grid_that_no_last_bit_crosses():
    library = MeshLibrary()
    mesh = spiny_leaf(0.085, 0.030, 0.015, 3)
    library.add(mesh)
    library.add(mesh._replace(vertices=np.nextafter(mesh.vertices, np.inf)))
    half = len(library.meshes.vertex) // 2
    assert np.array_equal(library.meshes.vertex[:half], library.meshes.vertex[half:])
    assert np.array_equal(library.meshes.vertex * GRID, np.rint(library.meshes.vertex * GRID))
    thing = instances(0, [0.1 + 2**-40, 1 / 3, 0.0])
    assert np.array_equal(thing.shift * GRID, np.rint(thing.shift * GRID))


def test_products_of_words_are_whole():
    words = [0, 1, 3, 2**32 - 1, 2**63 + 5, 2**64 - 1, 0x9E3779B97F4A7C15]
    for a, b in itertools.product(words, words):
        for high, low in (product(np.uint64(a), np.uint64(b)), compiled_product(np.uint64(a), np.uint64(b))):
            assert (int(high) << 64) + int(low) == a * b


@compiled
def compiled_product(a, b):
    return product(a, b)


def test_noise_is_numpys_own_to_the_last_bit_and_goes_on_where_it_ended():
    """Odd lengths leave half a word; the tail, one number in some thousands, is among 2 million."""
    for seed in range(50):
        state, numpys = stream(seed), np.random.default_rng(seed)
        for length in (40_001, 3):
            out = np.empty(length, np.float32)
            normals(state, out)
            assert np.array_equal(out, numpys.standard_normal(length, dtype=np.float32))


def test_a_cheap_camera_drifts_in_gain_and_is_noisy_in_colour_and_depth():
    numbers = np.random.default_rng(8)
    rgb, depth = numbers.integers(0, 256, (24, 31, 3)).astype(np.uint8), np.full((24, 31), 0.5, np.float32)
    seen = add_noise(stream([7, 3]), rgb, depth, 0.03, 3.0, 0.001)
    numpys = np.random.default_rng([7, 3])
    gain = 1.0 + np.float32(0.03) * numpys.standard_normal(3, dtype=np.float32)
    colour = rgb * gain + np.float32(3.0) * numpys.standard_normal(rgb.shape, dtype=np.float32)
    assert np.array_equal(seen[0], np.clip(np.rint(colour), 0, 255).astype(np.uint8))
    assert np.array_equal(seen[1], depth + np.float32(0.001) * numpys.standard_normal(depth.shape, dtype=np.float32))


@pytest.mark.parametrize("place", [(np.nan, 0.0, 0.0), (0.0, np.inf, 0.0), (1e9, 0.0, 0.0)])
def test_places_that_are_none_are_refused(place):
    with pytest.raises(ValueError, match="finite metres"):
        instances(0, place)


def test_empty_meshes_and_views_are_refused():
    library = MeshLibrary()
    with pytest.raises(ValueError, match="without area"):
        library.add(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]), np.ones((3, 3))))
    kind = library.add(box((0.1, 0.1, 0.1)))
    for target in (EYE, EYE + UP, [np.nan, 0.0, 0.0]):
        with pytest.raises(ValueError, match="sees nothing"):
            Renderer(library).look(instances(kind, (0.0, 0.0, 0.0)), CAMERA, EYE, target, UP)


def test_nothing_is_white_and_far():
    library = MeshLibrary()
    library.add(box((0.1, 0.1, 0.1)))
    look = Renderer(library).look(joined([]), CAMERA, EYE, DOWN, UP)
    assert (look.frame.rgb == 255).all() and (look.identity == -1).all()
    assert (look.frame.depth_m == CAMERA.far_m).all()


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
