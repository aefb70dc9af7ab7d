"""Parting plants and finding stems on drawn pictures, the detector on a painted field, and tracks over pictures."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldgym.perception.frames import CameraPose, Frame
from fieldgym.perception.regions import regions
from fieldgym.perception.rosettes import Rosette, best, blade_foot, broad_bodies, part, sees, slenderness
from fieldgym.perception.weeds import (
    Rows,
    Seedlings,
    WeedSettings,
    WeedTracker,
    detect,
    on_plane,
    plant_mask,
)

SOIL, GREEN = (100, 78, 58), (85, 140, 56)
PIXEL_M, EYE_M = 0.00125, 0.85
FOCAL = EYE_M / PIXEL_M
INTRINSICS = np.array([[FOCAL, 0.0, 200.0], [0.0, FOCAL, 160.0], [0.0, 0.0, 1.0]])
# Straight down, the top of the picture ahead: image right is -y, image down is -x.
CAMERA = np.array([[0.0, -1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, EYE_M], [0.0, 0.0, 0.0, 1.0]])


def leaves(mask, centre, length, width, angles):
    """Draw elliptic leaves that radiate from ``centre`` (column, row)."""
    for angle in angles:
        out = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])
        middle = np.rint(np.array(centre) + 0.5 * length * out).astype(int)
        cv2.ellipse(mask, tuple(middle.tolist()), (round(0.5 * length), round(0.5 * width)), angle, 0, 360, 1, -1)
    cv2.circle(mask, centre, max(width // 4, 1), 1, -1)
    return mask


def tapered(mask, foot, tip, width):
    """Draw a blade that is ``width`` wide at its foot and a point at its tip, both (column, row)."""
    foot, tip = np.array(foot, float), np.array(tip, float)
    side = np.array([-(tip - foot)[1], (tip - foot)[0]]) / np.linalg.norm(tip - foot) * 0.5 * width
    corners = np.rint([foot + side, foot - side, tip]).astype(np.int32)
    cv2.fillPoly(mask, [corners], 1)
    return mask


@settings(max_examples=30, deadline=None)
@given(turn=st.floats(0.0, 90.0), length=st.integers(18, 40))
def test_the_stem_of_a_rosette_is_where_its_leaves_meet(turn, length):
    mask = leaves(np.zeros((120, 120), np.uint8), (60, 58), length, 9, [turn + 90.0 * k for k in range(4)])
    plants = part(mask, 12)
    assert len(plants) == 1
    assert np.hypot(*(plants[0].stem - [58.0, 60.0])) < 2.0


def test_plants_that_touch_are_parted():
    mask = leaves(np.zeros((140, 180), np.uint8), (60, 70), 30, 9, [20.0, 110.0, 200.0, 290.0])
    mask = tapered(mask, (110, 58), (80, 84), 6)
    mask = tapered(mask, (110, 58), (150, 75), 6)
    assert cv2.connectedComponents(mask)[0] == 2
    stems = np.array([plant.stem for plant in part(mask, 30)])
    for row, column in ((70, 60), (58, 110)):
        assert np.hypot(*(stems - [row, column]).T).min() < 5.0


def test_parts_of_a_blob_are_its_own_pixels_and_no_crumbs():
    mask = leaves(np.zeros((120, 120), np.uint8), (60, 60), 30, 9, [0.0, 90.0, 180.0, 270.0])
    mask = tapered(mask, (85, 60), (110, 100), 4)
    seen = np.zeros_like(mask)
    for plant in part(mask, 25):
        assert len(plant.pixels) >= 25
        seen[plant.pixels[:, 0], plant.pixels[:, 1]] += 1
    assert np.all(seen <= mask)


@settings(max_examples=30, deadline=None)
@given(angle=st.floats(0.0, 2.0 * np.pi))
def test_a_blade_stands_on_its_wider_end(angle):
    foot = np.array([60.0, 60.0])
    tip = foot + 40.0 * np.array([np.cos(angle), np.sin(angle)])
    mask = tapered(np.zeros((121, 121), np.uint8), foot, tip, 7)
    pixels = np.argwhere(mask)
    assert np.hypot(*(blade_foot(Rosette(pixels.mean(axis=0), pixels))[::-1] - foot)) < 4.0
    assert slenderness(pixels) < 0.2


def test_only_broad_leaves_are_bodies():
    mask = np.zeros((200, 200), np.uint8)
    cv2.circle(mask, (80, 100), 30, 1, -1)
    mask = tapered(mask, (105, 100), (180, 100), 6)
    bodies = broad_bodies(*regions(mask), 10.0, 100)
    assert len(bodies) == 1
    assert bodies[0].mean(axis=0) == pytest.approx([100.0, 80.0], abs=1.0)
    assert bodies[0][:, 1].max() < 116
    assert broad_bodies(*regions(mask), 40.0, 100) == []


def test_shade_does_not_change_the_mask():
    rgb = np.full((60, 60, 3), SOIL, np.uint8)
    rgb[20:40, 20:40] = GREEN
    shaded = (0.55 * rgb).astype(np.uint8)
    bright, dark = plant_mask(rgb, 0.14, 1), plant_mask(shaded, 0.14, 1)
    assert np.array_equal(bright, dark)
    assert np.count_nonzero(bright) == pytest.approx(400, abs=90)


@settings(max_examples=40, deadline=None)
@given(x=st.floats(-0.2, 0.2), y=st.floats(-0.2, 0.2), z=st.floats(0.0, 0.05))
def test_rays_meet_the_plane_where_the_point_is(x, y, z):
    seen = INTRINSICS @ (np.linalg.inv(CAMERA) @ [x, y, z, 1.0])[:3]
    place = on_plane((seen[:2] / seen[2])[None], INTRINSICS, CAMERA, z)[0]
    assert place == pytest.approx([x, y], abs=1e-9)


def seen(rgb):
    """The picture as the camera gives it."""
    return Frame(rgb, np.zeros(rgb.shape[:2], np.float32), CameraPose(INTRINSICS, CAMERA))


def painted(*draw):
    """A picture of soil with plants drawn into it."""
    rgb = np.full((320, 400, 3), SOIL, np.uint8)
    mask = np.zeros((320, 400), np.uint8)
    for put in draw:
        put(mask)
    rgb[mask > 0] = GREEN
    return rgb


def test_the_detector_says_what_stands_where():
    rgb = painted(
        lambda m: leaves(m, (100, 60), 24, 11, [10.0, 100.0, 190.0, 280.0]),
        lambda m: leaves(m, (300, 60), 7, 4, [30.0, 210.0]),
        lambda m: tapered(m, (300, 200), (300, 182), 2),
        lambda m: leaves(m, (200, 160), 44, 24, [0.0, 60.0, 120.0, 180.0, 240.0, 300.0]),
        lambda m: leaves(m, (90, 318), 20, 10, [0.0, 90.0, 180.0, 270.0]),
    )
    found = detect(seen(rgb))
    # The fifth plant is cut off by the picture's edge.
    assert len(found.position) == 4
    assert found.crop.sum() == 1
    by_place = {(round(-y / PIXEL_M / 10.0), round(-x / PIXEL_M / 10.0)): i for i, (x, y) in enumerate(found.position)}
    four, cotyledon = by_place[(-10, -10)], by_place[(10, -10)]
    assert (found.species[four], found.stage[four]) == (0, 2)
    assert (found.species[cotyledon], found.stage[cotyledon]) == (0, 0)
    grass = int(np.flatnonzero(found.species == 1)[0])
    assert found.position[grass] == pytest.approx([-40 * PIXEL_M, -100 * PIXEL_M], abs=0.004)
    assert found.position[found.crop][0] == pytest.approx([0.0, 0.0], abs=0.003)
    whole = detect(seen(rgb), settings=WeedSettings(whole=False))
    assert len(whole.position) == 5


def test_a_crop_plant_is_one_only_in_the_row():
    rgb = painted(lambda m: leaves(m, (60, 160), 44, 24, [0.0, 60.0, 120.0, 180.0, 240.0, 300.0]))
    assert not detect(seen(rgb)).crop.any()
    row = -(60 - 200) * PIXEL_M
    assert detect(seen(rgb), Rows((row,))).crop.tolist() == [True]


def test_an_empty_field_has_no_plants():
    found = detect(seen(painted()))
    assert found.position.shape == (0, 2) and found.box.shape == (0, 4)


def seedlings(*places, crop=False, score=1.0):
    n = len(places)
    zeros = np.zeros(n, np.int64)
    position = np.array(places, float).reshape(-1, 2)
    return Seedlings(position, zeros, zeros, np.full(n, crop), np.zeros((n, 4), np.int64), np.full(n, score))


def test_tracks_are_joined_within_the_gate_and_confirmed_by_the_second_picture():
    tracker = WeedTracker(gate_m=0.01)
    tracker.update(seedlings((0.5, 0.0), (0.5, 0.1)), 0.0, (0.3, 0.7))
    assert [t.confirmed_m for t in tracker.tracks] == [np.inf, np.inf]
    tracker.update(seedlings((0.504, 0.1), (0.504, 0.0), (0.6, 0.0)), 0.06, (0.3, 0.7))
    assert len(tracker.tracks) == 3
    assert [t.confirmed_m for t in tracker.tracks] == [0.06, 0.06, np.inf]
    assert tracker.tracks[0].place == pytest.approx([0.502, 0.0])
    # Far out of the gate: another plant.
    tracker.update(seedlings((0.52, 0.0)), 0.12, (0.3, 0.7))
    assert len(tracker.tracks) == 4


def test_one_bad_picture_does_not_move_a_track():
    tracker = WeedTracker()
    for i, x in enumerate((0.5, 0.5, 0.51, 0.5, 0.5)):
        tracker.update(seedlings((x, 0.0)), 0.06 * i, (0.3, 0.7))
    assert len(tracker.tracks) == 1
    assert tracker.tracks[0].place == pytest.approx([0.5, 0.0])


def test_what_most_pictures_do_not_show_is_doubtful():
    tracker = WeedTracker()
    for i in range(6):
        tracker.update(seedlings((0.5, 0.0)) if i < 2 else seedlings(), 0.01 * i, (0.3, 0.7))
    assert tracker.tracks[0].is_doubtful
    # Pictures that it does not lie in do not count against it.
    tracker = WeedTracker()
    for i in range(6):
        tracker.update(seedlings((0.5, 0.0)) if i < 2 else seedlings(), 0.01 * i, (0.3, 0.7) if i < 2 else (0.6, 1.0))
    assert not tracker.tracks[0].is_doubtful


def test_one_sure_picture_counts_beside_many_that_are_not():
    doubts = []
    for scores in ((0.9, 0.3, 0.3, 0.3), (0.45, 0.45, 0.45, 0.45)):
        tracker = WeedTracker(least=0.6)
        for i, score in enumerate(scores):
            tracker.update(seedlings((0.5, 0.0), score=score), 0.01 * i, (0.3, 0.7))
        doubts.append(tracker.tracks[0].is_doubtful)
    # Both are sure to 0.45 on average; the first one's surest picture brings that to 0.675.
    assert doubts == [False, True]


def test_most_pictures_decide_what_is_a_crop_plant():
    tracker = WeedTracker()
    for i in range(5):
        tracker.update(seedlings((0.5, 0.0), crop=i < 2), 0.06 * i, (0.3, 0.7))
    assert not tracker.tracks[0].is_crop
    for i in range(5, 7):
        tracker.update(seedlings((0.5, 0.0), crop=True), 0.06 * i, (0.3, 0.7))
    assert tracker.tracks[0].is_crop


def test_a_mask_is_opencv_s_to_the_last_pixel():
    rng = np.random.default_rng(5)
    for size in ((31, 47), (2, 9), (60, 2)):
        rgb = rng.integers(0, 256, (*size, 3), dtype=np.uint8)
        r, g, b = (rgb[..., c].astype(np.float32) for c in range(3))
        index = (2.0 * g - r - b) / np.maximum(r + g + b, 30.0)
        expected = (cv2.GaussianBlur(index, (3, 3), 0.0) > 0.05).astype(np.uint8) * 255
        assert 0.1 < (expected > 0).mean() < 0.9
        assert np.array_equal(plant_mask(rgb, 0.05, 1), expected)


def seen_step_by_step(road, at, pixel):
    """Whether every pixel of the line between two is road."""
    steps = int(np.abs(pixel - at).max())
    if steps < 2:
        return True
    step = (np.asarray(pixel - at) << 16) // steps
    line = ((at << 16) + 32768 + step * np.arange(1, steps)[:, None]) >> 16
    return bool(road[line[:, 0], line[:, 1]].all())


def test_sight_is_that_of_a_line_walked_step_by_step():
    rng = np.random.default_rng(2)
    clear = 0
    for _ in range(20):
        road = (rng.random((40, 57)) < 0.97).astype(np.uint8)
        free = cv2.distanceTransform(road, cv2.DIST_C, 3).astype(np.int32)
        pixels = np.argwhere(road)
        for at, pixel in pixels[rng.integers(0, len(pixels), (60, 2))]:
            expected = seen_step_by_step(road, at, pixel)
            assert sees(free, at, pixel) == expected
            clear += expected
    assert 300 < clear < 900


def test_the_best_places_are_those_of_counting_all():
    mask = leaves(np.zeros((120, 120), np.uint8), (60, 58), 40, 9, [5.0, 80.0, 200.0, 290.0])
    road = cv2.dilate(mask, np.ones((3, 3), np.uint8))
    free = cv2.distanceTransform(road, cv2.DIST_C, 3).astype(np.int32)
    pixels = np.argwhere(mask)
    at, tried = pixels[::37], pixels[::11]
    seen = np.array([sum(seen_step_by_step(road, place, pixel) for pixel in tried) for place in at])
    assert 1 < np.count_nonzero(seen >= 0.93 * seen.max()) < len(at) // 2
    assert np.array_equal(best(free, at, tried), at[seen >= 0.93 * seen.max()])


def test_regions_have_opencv_s_boxes():
    mask = (np.random.default_rng(0).random((50, 70)) < 0.3).astype(np.uint8)
    for connectivity in (4, 8):
        count, expected, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=connectivity)
        labels, boxes = regions(mask, connectivity)
        assert count > 20 and np.array_equal(labels, expected) and np.array_equal(boxes[1:], stats[1:])
        assert not boxes[0].any()


def test_bodies_are_an_opening_of_the_whole_mask():
    """Each plant in a window of its own, at the picture's edge too."""
    mask = np.zeros((160, 200), np.uint8)
    for x, y, radius in ((0, 20, 16), (60, 60, 14), (90, 64, 12), (199, 159, 22), (140, 20, 8), (30, 130, 11)):
        cv2.circle(mask, (x, y), radius, 1, -1)
    mask = tapered(mask, (60, 60), (120, 140), 7)
    mask[100:131, 150:181] = 1
    deep = cv2.distanceTransform(mask, cv2.DIST_L2, 5)
    expected = (cv2.distanceTransform((deep < 7.3).astype(np.uint8), cv2.DIST_L2, 5) < 7.3).astype(np.uint8)
    found = np.zeros_like(mask)
    for pixels in broad_bodies(*regions(mask), 7.3, 1):
        found[pixels[:, 0], pixels[:, 1]] = 1
    assert 0 < found.sum() < mask.sum() and np.array_equal(found, expected)


def test_a_blob_that_leaves_no_road_s_end_in_its_window_is_parted():
    """The classical eyes before a picture that is green all over: no pixel is farther than two from the blob."""
    mask = np.ones((40, 48), np.uint8)
    mask[::3, ::3] = mask[::3, 1::3] = 0
    [plant, *_] = part(mask, 12)
    assert len(plant.pixels) == mask.sum()
