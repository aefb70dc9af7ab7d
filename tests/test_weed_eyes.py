"""The learned eyes: convolutions against plain sums, stems on painted answers, both cameras on rendered pictures."""

from types import SimpleNamespace
from typing import Any

import cv2
import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.agents.policies.weeding_outlook import outlook
from fieldgym.envs.weeding.eyes import ClassicalEyes, LearnedEyes, eyes_of, net_of, smaller
from fieldgym.envs.weeding.perception import PerceptionModel, uncorrected
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.scene import WeederScene
from fieldgym.envs.weeding.view import FrontCamera
from fieldgym.perception.convolutions import add_cut, apart, colours_apart, concluded, each, halving, mixed
from fieldgym.perception.frames import CameraPose, Frame
from fieldgym.perception.stems import (
    ANSWERS,
    CROP,
    FIRST_KIND,
    OFFSET_X,
    OFFSET_Y,
    WEED,
    StemNet,
    shapes,
    stems_in,
)
from fieldgym.perception.weeds import on_plane

RNG = np.random.default_rng(3)
STRIP = 7.5e-6
"""Look of the strip whose number is 7."""


def floats(*shape):
    return RNG.normal(size=shape).astype(np.float32)


def correlated(picture, weight, reach=1):
    """A 3 x 3 correlation of (c, h, w) with (o, c, 3, 3), summed place by place in double precision."""
    c, h, w = picture.shape
    wide = np.zeros((c, h + 2 * reach, w + 2 * reach))
    wide[:, reach:-reach, reach:-reach] = picture
    out = np.zeros((len(weight), h, w))
    for i in range(3):
        for j in range(3):
            seen = wide[:, i * reach : i * reach + h, j * reach : j * reach + w]
            out += np.einsum("oc,chw->ohw", weight[:, :, i, j].astype(float), seen)
    return out


def test_halving_is_every_other_place_of_a_convolution():
    picture, weight, bias = floats(3, 12, 16), floats(4, 3, 3, 3), floats(4)
    expected = np.maximum(correlated(picture, weight)[:, ::2, ::2] + bias[:, None, None], 0.0)
    assert np.abs(halving(*apart(picture), weight, bias) - expected).max() < 1e-5


@pytest.mark.parametrize("reach", [1, 4, 8])
def test_each_channel_is_convolved_by_itself_with_taps_apart(reach):
    picture, weight = floats(5, 11, 20), floats(5, 3, 3)
    full = np.zeros((5, 5, 3, 3))
    full[np.arange(5), np.arange(5)] = weight
    assert np.abs(each(picture, weight, reach) - correlated(picture, full, reach)).max() < 1e-5


def test_mixing_is_a_matrix_product_beyond_a_block_of_places_too():
    places, weight, bias = floats(6, 700), floats(4, 6), floats(4)
    assert np.abs(mixed(places, weight, bias) - (weight @ places + bias[:, None])).max() < 1e-5


def test_adding_keeps_what_is_positive():
    one, two = floats(2, 30), floats(2, 30)
    sums = one.copy()
    add_cut(sums, two)
    assert np.array_equal(sums, one + np.maximum(two, 0.0))


def test_the_last_layers_see_a_doubled_picture_over_a_fine_one():
    coarse, fine, near = floats(2, 7, 9), floats(4, 14, 18), floats(6, 3, 3)
    head, head_bias, answer, answer_bias = floats(4, 6), floats(4), floats(2, 4), floats(2)
    large = [cv2.resize(plane, (18, 14), interpolation=cv2.INTER_LINEAR) for plane in coarse]
    seen = each(np.concatenate([np.stack(large), fine]), near, 1).reshape(6, -1)
    expected = answer @ np.maximum(head @ seen + head_bias[:, None], 0.0) + answer_bias[:, None]
    found = concluded(coarse, fine, near, head, head_bias, answer, answer_bias)
    assert np.abs(found - expected.reshape(2, 14, 18)).max() < 1e-4


def test_colours_come_apart_as_the_network_takes_them():
    rgb = RNG.integers(0, 256, (4, 6, 3), dtype=np.uint8)
    even, odd = colours_apart(rgb, 76.5, 51.0)
    scaled = (rgb.transpose(2, 0, 1) - 76.5) / 51.0
    assert np.abs(even - scaled[..., ::2]).max() < 1e-6 and np.abs(odd - scaled[..., 1::2]).max() < 1e-6


def random_weights(widths=(4, 6, 4, 6)):
    return {name: 0.3 * floats(*shape) for name, shape in shapes(*widths).items()}


def test_the_network_computes_what_pytorch_computes():
    torch = pytest.importorskip("torch")
    from fieldgym.scripts.train_weed_eyes import Net

    torch.manual_seed(1)
    net = Net()
    rgb = RNG.integers(0, 256, (48, 64, 3), dtype=np.uint8)
    with torch.no_grad():
        # Norms that have seen something, and that scale and shift.
        for norm in net.norm.values():
            torch.nn.init.uniform_(norm.get_parameter("weight"), 0.5, 1.5)
            torch.nn.init.uniform_(norm.get_parameter("bias"), -0.3, 0.3)
        net(torch.randn(4, 3, 48, 64))
        net.eval()
        expected = net(torch.from_numpy((rgb.transpose(2, 0, 1)[None] - np.float32(76.5)) / np.float32(51.0)))[0]
    assert np.abs(StemNet(net.weights()).answers(rgb) - expected.numpy()).max() < 2e-5


def test_weights_that_do_not_fit_are_refused():
    weights = random_weights()
    StemNet(weights)
    with pytest.raises(ValueError, match=r"'up\.bias'"):
        StemNet({name: values for name, values in weights.items() if name != "up.bias"})
    with pytest.raises(ValueError, match=r"'look2\.weight' is \(6, 3\)"):
        StemNet(weights | {"look2.weight": floats(6, 3)})
    weights["mix0.bias"][0] = np.nan
    with pytest.raises(ValueError, match="finite"):
        StemNet(weights)


def painted(*stems, plane=WEED):
    """Answers that tell of stems (column, row, odds, kind), with an offset of (0.3, -0.4) about each."""
    answers = np.zeros((ANSWERS, 30, 40), np.float32)
    answers[:2] = -9.0
    answers[OFFSET_X], answers[OFFSET_Y] = 0.3, -0.4
    for x, y, odds, kind in stems:
        answers[plane, y, x] = odds
        answers[plane, y, x + 1] = odds - 1.0
        answers[FIRST_KIND + kind, y, x] = 2.0
    return answers


def test_stems_are_told_of_with_offset_kind_and_probability_the_likeliest_first():
    found = stems_in(painted((10, 8, 0.5, 4), (25, 20, 3.0, 2)), WEED, 0.5, 1.6)
    assert found.kind.tolist() == [2, 4]
    assert found.pixel == pytest.approx(2.0 * np.array([[25.3, 19.6], [10.3, 7.6]]) + 0.5, abs=1e-5)
    assert found.score == pytest.approx(1.0 / (1.0 + np.exp([-3.0, -0.5])), abs=1e-6)
    assert not len(stems_in(painted((10, 8, 0.5, 4)), CROP, 0.5, 1.6).pixel)


def test_of_two_stems_too_near_the_likelier_stays_and_equals_are_one():
    assert stems_in(painted((10, 8, 1.0, 0), (12, 8, 2.0, 1)), WEED, 0.5, 2.5).kind.tolist() == [1]
    assert len(stems_in(painted((10, 8, 1.0, 0), (12, 8, 2.0, 1)), WEED, 0.5, 1.6).pixel) == 2
    flat = painted()
    flat[WEED, 4:7, 4:7] = 1.0
    assert len(stems_in(flat, WEED, 0.5, 0.5).pixel) == 1


def test_a_smaller_frame_looks_at_the_same_ground():
    camera = CameraPose(
        np.array([[500.0, 0.0, 60.0], [0.0, 500.0, 40.0], [0.0, 0.0, 1.0]]),
        np.array([[0.0, -1.0, 0.0, 0.1], [-1.0, 0.0, 0.0, 0.2], [0.0, 0.0, -1.0, 0.8], [0.0, 0.0, 0.0, 1.0]]),
    )
    rgb = np.zeros((80, 120, 3), np.uint8)
    rgb[20:22, 60:62] = 200
    small = smaller(Frame(rgb, np.zeros((80, 120), np.float32), camera), 2)
    assert small.rgb.shape == (40, 60, 3) and small.rgb[10, 30, 0] == 200
    there = on_plane(np.array([[30.0, 10.0]]), *small.camera, 0.0)
    assert there == pytest.approx(on_plane(np.array([[60.5, 20.5]]), *camera, 0.0), abs=1e-12)


@pytest.fixture(scope="module")
def scene():
    config = WeedingConfig(pictures="easy")
    made = WeederScene(config, config.parameters)
    yield made
    made.close()


KINDS = [(x, y, s, g) for s, y in ((0, 0.11), (1, -0.11)) for g, x in ((0, -0.1), (1, 0.0), (2, 0.1))]


def show(scene, weeds, crop=((5.0, 0.0),)):
    table = np.array(weeds, float).reshape(-1, 4)
    kinds = table[:, 2:].astype(np.int64)
    scene.load(table[:, :2], kinds[:, 0], kinds[:, 1], np.linspace(0.1, 0.9, len(table)), np.array(crop), STRIP)


def test_each_kind_that_stands_alone_becomes_one_track_at_its_stem(scene):
    show(scene, KINDS, crop=[(0.0, 0.0)])
    front = FrontCamera(scene, 0.0, 0.0, eyes_of("learned"))
    front.drive(-0.55)
    tracks = [t for t in front.tracker.tracks if np.isfinite(t.confirmed_m) and not t.is_doubtful]
    crop, weed = ([t for t in tracks if t.is_crop == taken] for taken in (True, False))
    assert len(crop) == 1 and np.hypot(*crop[0].place) < 0.006
    assert len(weed) == len(KINDS)
    for x, y, species, stage in KINDS:
        gaps = [np.hypot(*(t.place - [x, y])) for t in weed]
        nearest = weed[int(np.argmin(gaps))]
        assert min(gaps) < 0.0025, (species, stage)
        assert np.argwhere(nearest.votes == nearest.votes.max()).tolist() == [[species, stage]]


def test_the_learned_tool_camera_aims_at_the_stem_it_was_sent_to(scene):
    show(scene, KINDS)
    reach, eyes = scene.config.reach, eyes_of("learned")
    for x, y, species, stage in KINDS:
        off_m = []
        for beside in ((0.007, -0.002), (-0.004, 0.001), (0.001, 0.001)):
            told = np.array([x, y]) + beside
            centre = np.array([told[0] - 0.02, 0.0, reach.target_height_m + reach.gap_m])
            seen = eyes.tool(scene.look_tool(centre, told), told, 0.008)
            assert seen is not None, (species, stage)
            off_m.append(np.hypot(*(seen - [x, y])))
        assert np.median(off_m) < 0.0015, (species, stage)
    away = np.array([0.05, 0.0])
    assert eyes.tool(scene.look_tool(np.array([0.03, 0.0, 0.87]), away), away, 0.008) is None


def test_of_two_stems_the_tool_camera_takes_the_nearer_unless_it_is_unlikely():
    net: Any = SimpleNamespace(answers=lambda rgb: answers)
    eyes = LearnedEyes(net, net)
    camera = CameraPose(
        np.array([[1000.0, 0.0, 40.0], [0.0, 1000.0, 30.0], [0.0, 0.0, 1.0]]),
        np.array([[0.0, -1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.5], [0.0, 0.0, 0.0, 1.0]]),
    )
    frame = Frame(np.zeros((120, 160, 3), np.uint8), np.zeros((0, 0), np.float32), camera)
    near, far = (10, 8), (14, 8)
    place = {at: on_plane(4.0 * np.array([at]) + [1.2 + 1.5, -1.6 + 1.5], *camera, 0.006)[0] for at in (near, far)}
    told = 0.8 * place[near] + 0.2 * place[far]
    answers = painted((*near, 1.0, 3), (*far, 2.0, 3))
    assert eyes.tool(frame, told, 0.008) == pytest.approx(place[near], abs=1e-4)
    answers = painted((*near, -1.5, 3), (*far, 4.0, 3))
    assert eyes.tool(frame, told, 0.008) == pytest.approx(place[far], abs=1e-4)


def test_the_odometry_learns_from_what_the_tool_camera_sees():
    scene: Any = SimpleNamespace(config=WeedingConfig(), standing=None)
    plant = np.array([2.0, 0.1])
    for eyes, left in ((LearnedEyes(*[net_of("front")] * 2), 0.0), (ClassicalEyes(), 0.0065)):
        front = FrontCamera(scene, -0.45, 0.01, eyes)
        for _ in range(5):
            front.heed(1.0, 1.65, front.place(plant, 1.0, 1.65), plant)
        assert front.place(plant, 1.0, 1.65) - plant == pytest.approx([left, 0.0], abs=1e-9)


def test_eyes_are_chosen_by_keyword():
    env: Any = gym.make("fieldgym/LaserWeeding-v0", backend="analytic", perception="camera", eyes="classical").unwrapped
    assert env.core.config.eyes == "classical" and type(env.view.eyes) is ClassicalEyes
    env.close()
    env = gym.make("fieldgym/LaserWeeding-v0", backend="analytic", perception="camera").unwrapped
    assert env.core.config.pictures == "field" and type(env.view.eyes) is LearnedEyes
    env.close()
    fits = [PerceptionModel.measured(e, p) for e in ("classical", "learned") for p in ("easy", "field")]
    assert len(set(fits)) == 4
    for env_id, fit in (("fieldgym/LaserWeeding-v0", fits[3]), ("fieldgym/HoeWeeding-v0", uncorrected(fits[3]))):
        env = gym.make(env_id, backend="analytic").unwrapped
        assert env.core.perception == fit == outlook(env.core.config).perception
        env = gym.make(env_id, backend="analytic", eyes="classical").unwrapped
        assert env.core.perception == outlook(env.core.config).perception != fit
    with pytest.raises(ValueError, match=r"perception = 'model' has no fit to eyes = 'learned' and pictures = 'odd'"):
        PerceptionModel.measured("learned", "odd")
    with pytest.raises(ValueError, match=r"eyes.*'classical' or 'learned'"):
        gym.make("fieldgym/HoeWeeding-v0", backend="analytic", eyes="sharp")
