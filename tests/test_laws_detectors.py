"""Every threshold of the detectors decides where it says: pictures of plain patches on either side of it."""

from typing import Any

import cv2
import numpy as np
import pytest

from fieldgym.perception import blooms, produce, trays, weeds
from fieldgym.perception.frames import CameraPose, Frame

HEIGHT, WIDTH, FOCAL = 120, 160, 200.0
DOWN = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
"""A camera one metre above the origin that looks straight down; rows of the picture run against the second axis."""


def frame(rgb: Any, depth_m: Any, pose: Any = DOWN) -> Any:
    intrinsics = np.array([[FOCAL, 0.0, 0.5 * WIDTH], [0.0, FOCAL, 0.5 * HEIGHT], [0.0, 0.0, 1.0]])
    depth = np.full((HEIGHT, WIDTH), depth_m, np.float32) if np.isscalar(depth_m) else np.asarray(depth_m, np.float32)
    return Frame(np.ascontiguousarray(rgb, np.uint8), depth, CameraPose(intrinsics, pose))


def plain(colour: Any) -> np.ndarray:
    return np.full((HEIGHT, WIDTH, 3), colour, np.uint8)


def of_hsv(hue: int, saturation: int, value: int) -> tuple[int, ...]:
    """The colour that OpenCV reads as such a hue (0-179), saturation and value."""
    return tuple(
        int(part) for part in cv2.cvtColor(np.array([[[hue, saturation, value]]], np.uint8), cv2.COLOR_HSV2RGB)[0, 0]
    )


def square(rgb: np.ndarray, colour: Any, top: int, left: int, side: int) -> np.ndarray:
    rgb[top : top + side, left : left + side] = colour
    return rgb


# Safflower heads


@pytest.mark.parametrize(
    ("colour", "depth_m", "seen"),
    [
        ((24, 200, 200), 0.5, True),
        ((26, 200, 200), 0.5, False),
        ((0, 200, 200), 0.5, True),
        ((173, 200, 200), 0.5, True),
        ((170, 200, 200), 0.5, False),
        ((10, 122, 200), 0.5, True),
        ((10, 116, 200), 0.5, False),
        ((10, 200, 51), 0.5, True),
        ((10, 200, 48), 0.5, False),
        ((10, 200, 200), 0.301, True),
        ((10, 200, 200), 0.299, False),
        ((10, 200, 200), 0.739, True),
        ((10, 200, 200), 0.741, False),
    ],
)
def test_filaments_are_of_a_colour_within_reach(colour, depth_m, seen):
    mask, _ = blooms.filament_mask(plain(of_hsv(*colour)), frame(plain(0), depth_m).depth_m, blooms.BloomSettings())
    assert mask.all() if seen else not mask.any()


def test_a_step_in_depth_parts_filaments():
    for step_m, parts in ((0.0115, 1), (0.0125, 2)):
        depth = np.full((HEIGHT, WIDTH), 0.5, np.float32)
        depth[:, 80:] += step_m
        mask = np.full((HEIGHT, WIDTH), 255, np.uint8)
        assert len(blooms._parts(mask, depth, FOCAL, blooms.BloomSettings())) == parts


@pytest.mark.parametrize(
    ("hue", "value", "stage"),
    [(15, 200, 1), (14, 200, 2), (13, 200, 2), (176, 200, 2), (20, 151, 1), (20, 150, 1), (20, 149, 3), (5, 149, 3)],
)
def test_the_stage_is_told_by_the_filaments_colour(hue, value, stage):
    pixels = np.tile(np.array([hue, 200, value], np.uint8), (9, 1))
    assert blooms._stage(pixels, blooms.BloomSettings()) == stage


def tufts(*middles: tuple[int, int]) -> Any:
    """Discs of fresh filaments on green, so near that a pixel is 1.6 mm wide; and how far everything is."""
    rgb, depth = plain((60, 110, 45)), np.full((HEIGHT, WIDTH), 0.42, np.float32)
    for middle in middles:
        cv2.circle(rgb, middle, 12, of_hsv(20, 220, 220), -1)
        cv2.circle(depth, middle, 12, 0.32, -1)
    return rgb, depth


def test_a_head_is_where_and_as_large_as_it_shows():
    """Less than the average tuft's 10.8 cm2; the centre lies 6 mm below what is seen, right to a 25th of a pixel."""
    rgb = square(plain((60, 60, 60)), of_hsv(20, 220, 220), 40, 90, 12)
    found = blooms.detect(frame(rgb, 0.5))
    area = 144.0 * (0.5 / FOCAL) ** 2
    middle = [0.506 * (95.5 - 80.0) / FOCAL, -0.506 * (45.5 - 60.0) / FOCAL, 1.0 - 0.506]
    assert found.position == pytest.approx(np.array([middle]), abs=1e-4)
    assert found.stage.tolist() == [1]
    assert found.spread_m == pytest.approx(0.04785 * np.sqrt(area / 1.08e-3), rel=1e-6)
    assert found.confidence == pytest.approx([min(area / 1.08e-3, 1.0)])
    assert blooms.detect(frame(square(plain((60, 60, 60)), of_hsv(20, 220, 220), 40, 90, 14), 0.5)).confidence == [1.0]


def test_smaller_patches_are_no_heads():
    for side, heads in ((3, 0), (4, 1)):
        rgb = square(plain((60, 60, 60)), of_hsv(20, 220, 220), 40, 90, side)
        assert (side**2 * (0.5 / FOCAL) ** 2 > 6e-5) == bool(heads)
        assert len(blooms.detect(frame(rgb, 0.5)).stage) == heads


def test_tufts_that_touch_are_parted():
    for apart, heads in ((6, 1), (23, 2)):
        found = blooms.detect(frame(*tufts((60, 60), (60 + apart, 60))))
        assert len(found.stage) == heads
        if heads == 2:
            assert np.sort(found.position[:, 0]) == pytest.approx(np.array([-20.0, 3.0]) / FOCAL * 0.326, abs=3e-3)


@pytest.mark.parametrize("leaf", [np.s_[:, 62:], np.s_[55:66, :]], ids=["half", "band"])
def test_what_a_leaf_leaves_of_a_tuft_says_where_the_whole_is(leaf):
    """What lies 10 mm nearer hides: the half that shows is no tuft of its own, nor are two pieces two."""
    rgb, depth = tufts((60, 60))
    whole = blooms.detect(frame(rgb, depth))
    rgb[leaf], depth[leaf] = (60, 140, 45), 0.31
    found = blooms.detect(frame(rgb, depth))
    assert len(found.stage) == 1
    assert found.position == pytest.approx(whole.position, abs=2e-3)
    assert found.spread_m == pytest.approx(whole.spread_m, rel=0.1)
    assert found.confidence[0] < 0.75 * whole.confidence[0]
    # Lying deeper it would hide nothing: less shows of what is as wide as before, or of two.
    depth[leaf] = 0.42
    deep = blooms.detect(frame(rgb, depth))
    assert np.abs(deep.spread_m - whole.spread_m).min() > 0.1 * whole.spread_m[0]


# Trays


@pytest.mark.parametrize(
    ("middle", "area", "height", "yellow", "report"),
    [
        (0.079, 0.5, 0.9, 0.0, trays.EMPTY),
        (0.081, 0.5, 0.9, 0.0, trays.HEALTHY),
        (0.5, 0.184, 0.9, 0.0, trays.POOR),
        (0.5, 0.186, 0.9, 0.0, trays.HEALTHY),
        (0.5, 0.5, 0.464, 0.0, trays.POOR),
        (0.5, 0.5, 0.466, 0.0, trays.HEALTHY),
        (0.5, 0.5, 0.9, 0.299, trays.HEALTHY),
        (0.5, 0.5, 0.9, 0.301, trays.POOR),
        (0.079, 0.1, 0.1, 0.9, trays.EMPTY),
    ],
)
def test_cells_are_told_apart_by_four_thresholds(middle, area, height, yellow, report):
    look = trays.CellLook(*(np.array([value]) for value in (middle, area, height, yellow)))
    assert trays.decide(look).tolist() == [report]


def row(depth_m: float = 0.9) -> Any:
    """A cell under the middle of the picture, as wide as 40 pixels, and one beside it; both of the nursery's pitch."""
    pitch = 40.0 / FOCAL * depth_m
    return trays.Cells(np.array([[0.0, 0.0, 0.1], [pitch, 0.0, 0.1]]), pitch, pitch)


@pytest.mark.parametrize(
    ("colour", "leaf", "yellow"),
    [
        ((80, 140, 60), True, 0.0),
        ((100, 111, 100), False, 0.0),
        ((100, 118, 100), True, 0.0),
        ((30, 59, 30), False, 0.0),
        ((30, 63, 30), True, 0.0),
        (of_hsv(36, 200, 200), True, 1.0),
        (of_hsv(38, 200, 200), True, 0.0),
    ],
)
def test_leaves_are_green_bright_and_yellow_by_their_hue(colour, leaf, yellow):
    look = trays.look_at_cells(frame(plain(colour), 0.9), row())
    assert look.area == pytest.approx([1.0 if leaf else 0.0] * 2, abs=0.06)
    assert look.middle == pytest.approx([1.0 if leaf else 0.0] * 2, abs=0.06)
    assert look.yellow == pytest.approx([yellow] * 2)


def test_leaves_count_where_they_are():
    """A leaf of 11 x 11 pixels, 10 off the first cell's middle: outside the disc of 6.4 pixels, inside the cell."""
    rgb = square(plain((90, 80, 70)), (60, 160, 50), 55, 85, 11)
    look = trays.look_at_cells(frame(rgb, 0.9), row())
    # Blurred, it is a pixel wider on every side, but for its corners; opened by 2 x 2, it lies a pixel farther on.
    leaf = [(y, x) for y, x in np.ndindex(13, 13) if (y, x) not in ((0, 0), (0, 12), (12, 0), (12, 12))]
    near = sum((y - 5) ** 2 + (x + 5) ** 2 <= 6.4**2 for y, x in leaf)
    assert look.area == pytest.approx([165.0 / 1600.0, 0.0], abs=1e-6)
    assert look.middle == pytest.approx([near / (np.pi * 6.4**2), 0.0], abs=1e-6)
    centred = trays.look_at_cells(frame(square(plain((90, 80, 70)), (60, 160, 50), 55, 75, 11), 0.9), row())
    near = sum((y - 5) ** 2 + (x - 5) ** 2 <= 6.4**2 for y, x in leaf)
    assert centred.middle == pytest.approx([near / (np.pi * 6.4**2), 0.0], abs=1e-6)


def test_a_seedling_is_as_high_as_its_own_leaves():
    """Nineteen of twenty pixels within 14 of the middle lie below its height; a neighbour's tip beyond is none."""
    rgb, depth = square(plain((90, 80, 70)), (60, 160, 50), 50, 70, 20), np.full((HEIGHT, WIDTH), 0.9, np.float32)
    depth[50:72, 70:92], depth[51:72, 82:84] = 0.87, 0.84
    rgb, depth[55:62, 97:104] = square(rgb, (60, 160, 50), 55, 97, 7), 0.80
    look = trays.look_at_cells(frame(rgb, depth), row())
    pitch = 40.0 / FOCAL * 0.9
    # Cells lie at 0.9 m, and 18 mm of what is over them is stem; two columns of twenty are higher than the rest.
    assert look.height[0] == pytest.approx((0.06 - 0.018) / pitch, abs=1e-6)
    depth[51:72, 82:84], depth[60:62, 80:82] = 0.87, 0.84
    look = trays.look_at_cells(frame(rgb, depth), row())
    assert look.height[0] == pytest.approx((0.03 - 0.018) / pitch, abs=1e-6)
    assert trays.look_at_cells(frame(plain((90, 80, 70)), 0.9), row()).height.tolist() == [-np.inf, -np.inf]


# Produce


@pytest.mark.parametrize(
    ("hue", "saturation", "length_m", "grade"),
    [
        (40.0, 0.67, 0.0611, 0),
        (40.0, 0.67, 0.061, 0),
        (40.0, 0.67, 0.0609, 1),
        (50.0, 0.69, 0.05, 2),
        (50.2, 0.69, 0.09, 3),
        (50.1, 0.69, 0.09, 3),
        (60.0, 0.68, 0.09, 3),
    ],
)
def test_grades_of_produce_are_told_by_three_thresholds(hue, saturation, length_m, grade):
    assert produce._grade(produce.ProduceSettings(), hue, saturation, length_m) == grade


@pytest.mark.parametrize(
    ("colour", "above_m", "seen"),
    [
        ((125, 40, 100), 0.02, True),
        ((124, 40, 100), 0.02, False),
        ((40, 125, 100), 0.02, True),
        ((40, 124, 100), 0.02, False),
        ((200, 180, 60), 0.0031, True),
        ((200, 180, 60), 0.0029, False),
    ],
)
def test_produce_is_warm_and_lies_on_the_belt(colour, above_m, seen):
    look = frame(plain(colour), 0.8 - above_m)
    mask = produce.produce_mask(look, produce.Belt(0.2), produce.ProduceSettings())
    assert mask.all() if seen else not mask.any()


@pytest.mark.parametrize("drift", [(1.0, 1.0, 1.0), (1.08, 0.95, 1.0), (0.92, 1.0, 1.05)])
def test_hues_are_those_beside_a_belt_of_the_usual_colour(drift):
    """A fruit of 60 degrees stays one, however far gains drift; where no belt shows they are taken as they are."""
    rgb = np.full((HEIGHT, WIDTH, 3), produce.ProduceSettings().belt_rgb, float)
    rgb[40:80, 60:100] = 180.0, 180.0, 40.0
    look = np.round(rgb * drift).astype(np.uint8)
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[40:80, 60:100] = 1
    gains = produce._gains(look, mask, produce.ProduceSettings())
    assert gains * drift == pytest.approx(np.full(3, (gains * drift).mean()), rel=0.01)
    hue, saturation = produce._colour(look, gains, 40, 60, mask[40:80, 60:100])
    assert hue == pytest.approx(60.0, abs=0.8) and saturation == pytest.approx(1.0 - 40.0 / 180.0, abs=0.01)
    assert produce._gains(look, np.ones_like(mask), produce.ProduceSettings()).tolist() == [1.0, 1.0, 1.0]
    blue = np.array([2.0, 2.0, 250.0], np.uint8) + np.zeros_like(look)
    assert produce._gains(blue, mask, produce.ProduceSettings()) == pytest.approx([1 / 0.85, 1 / 0.85, 1 / 1.15])


# Weeds


@pytest.mark.parametrize(("colour", "plant"), [((100, 122, 100), False), ((100, 123, 100), True), ((8, 10, 8), False)])
def test_plants_are_greener_than_soil(colour, plant):
    """Excess green from 0.14 on; over the sum of the channels, which counts as 30 where it is darker."""
    mask = weeds.plant_mask(plain(colour), weeds.WeedSettings().green, 3)
    assert mask.all() if plant else not mask.any()
    index = (2 * colour[1] - colour[0] - colour[2]) / max(sum(colour), 30)
    assert (index > 0.14) == plant or sum(colour) < 40


def seedlings(shape: Any, context: Any = weeds.MIDDLE_ROW) -> Any:
    """What is found of one green shape on soil, under a camera whose pixels are 0.25 mm wide."""
    rgb = plain((90, 70, 60))
    shape(rgb, (60, 160, 50))
    pose = DOWN.copy()
    pose[2, 3] = 0.05
    return weeds.detect(frame(rgb, 0.05, pose), context)


@pytest.mark.parametrize(("radius", "stage"), [(20, 0), (27, 0), (29, 1), (50, 1)])
def test_stages_of_broadleaves_are_told_by_their_area(radius, stage):
    """Parted at 1.6e-4 m2, which lies between the discs of 27 and 29 pixels: the area is right to 8 %."""
    pixels = np.count_nonzero(cv2.circle(np.zeros((HEIGHT, WIDTH), np.uint8), (80, 60), radius, 1, -1))
    assert (pixels * 2.5e-4**2 > 1.6e-4) == (stage > 0)
    found = seedlings(lambda rgb, green: cv2.circle(rgb, (80, 60), radius, green, -1))
    assert found.stage.tolist() == [stage] and found.species.tolist() == [0] and not found.crop.any()


def test_blades_are_grasses_and_crumbs_are_nothing():
    blade = seedlings(lambda rgb, green: cv2.line(rgb, (40, 60), (120, 60), green, 5))
    assert blade.species.tolist() == [1]
    assert len(seedlings(lambda rgb, green: cv2.circle(rgb, (80, 60), 7, green, -1)).position) == 0
    assert len(seedlings(lambda rgb, green: cv2.circle(rgb, (80, 60), 10, green, -1)).position) == 1
    # What the first or the last row cuts off is whole in another picture.
    assert len(seedlings(lambda rgb, green: cv2.circle(rgb, (80, 0), 20, green, -1)).position) == 0


@pytest.mark.parametrize(
    ("at", "hits", "confirmed"), [((0.0119, 0.0), 1, True), ((0.0121, 0.0), 2, False), ((0.0, 0.0), 1, True)]
)
def test_tracks_join_within_their_gate(at, hits, confirmed):
    tracker = weeds.WeedTracker()
    for cart_m, place in ((0.0, (0.0, 0.0)), (0.05, at)):
        one = np.array([place])
        tracker.update(
            weeds.Seedlings(one, np.zeros(1, int), np.zeros(1, int), np.zeros(1, bool), one, np.ones(1)),
            cart_m,
            (-1.0, 1.0),
        )
    assert len(tracker.tracks) == hits
    assert np.isfinite(tracker.tracks[0].confirmed_m) == confirmed
