"""The browser view, without a browser: it shows the scenes that pictures are painted of, and changes nothing."""

from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fieldgym
from fieldgym.agents import make_policy, reference_policy
from fieldgym.agents.policies.base import act_single
from fieldgym.envs.belief import DONE, OPEN
from fieldgym.rendering.instances import about_z, from_quaternion, instances
from fieldgym.rendering.library import MeshLibrary
from fieldgym.rendering.shapes import box
from fieldgym.simulation.stage import Stage
from fieldgym.viewer import panels
from fieldgym.viewer.choices import choice_of, features, possible, shares
from fieldgym.viewer.mirror import Mirror
from fieldgym.viewer.reel import Reel, Scene
from fieldgym.viewer.seat import Seat
from fieldgym.viewer.turns import parted

OWN = [env_id for env_id in fieldgym.env_ids() if env_id.startswith("fieldgym/")]


def seat_of(env_id: str, name: str = "", **settings: Any) -> Seat:
    env = gym.make(env_id, disable_env_checker=True, render_mode="rgb_array", **{"backend": "analytic", **settings})
    return Seat(env, make_policy(name or reference_policy(env_id), env, 3))


def played(seat: Seat, decisions: int, rate: float = 5.0) -> list[Scene]:
    """Every scene of some decisions from the seed's beginning."""
    scenes = [seat.begin(lambda env: env.reset(seed=4))]
    for _ in range(decisions):
        seat.start(rate)
        now_s, ended = seat.now_s, False
        while not ended:
            now_s += 0.05 + 0.2 * (len(scenes) % 7)
            scene, ended = seat.until(now_s)
            if scene is not None:
                scenes.append(scene)
        last = seat.finish()
        assert last is not None
        scenes.append(last)
    return scenes


class Node:
    """What the browser's scene holds under a name."""

    def __init__(self, owner: dict[str, Any], name: str, **props: Any):
        self.__dict__.update(props)
        self.position = np.zeros(3)
        self.owner, self.name = owner, name
        owner[name] = self

    def remove(self) -> None:
        for name in [name for name in self.owner if name == self.name or name.startswith(f"{self.name}/")]:
            del self.owner[name]


class Page:
    """A stand-in for the browser's scene."""

    def __init__(self) -> None:
        self.nodes: dict[str, Any] = {}

    def add_frame(self, name: str, **props: Any) -> Node:
        return Node(self.nodes, name, **props)

    def add_batched_meshes_simple(self, name: str, vertices: Any, faces: Any, **props: Any) -> Node:
        return Node(self.nodes, name, vertices=vertices, faces=faces, **props)

    def corners(self) -> np.ndarray:
        """Every corner of everything in the page, (n, 3), sorted."""
        found = []
        for name, node in self.nodes.items():
            if not hasattr(node, "vertices"):
                continue
            root = self.nodes["/" + name.split("/")[1]]
            w, x, y, z = node.batched_wxyzs.T
            turn = from_quaternion(np.column_stack([x, y, z, w]))
            if node.batched_scales is not None:
                turn = turn * node.batched_scales[:, None, :]
            place = node.batched_positions + node.position + root.position
            found.append((np.einsum("nij,vj->nvi", turn, node.vertices) + place[:, None]).reshape(-1, 3))
        return in_order(np.concatenate(found))


def in_order(points: np.ndarray) -> np.ndarray:
    return points[np.lexsort(np.round(points, 3).T)]


def drawn(scene: Scene) -> np.ndarray:
    """Every corner of everything that a picture would be painted of, about its middle."""
    found = []
    for things in scene.groups.values():
        for mesh, turn, shift in zip(things.mesh, things.turn, things.shift, strict=True):
            found.append(scene.library.sources[mesh].vertices @ turn.T + shift)
    return in_order(np.concatenate(found) - scene.middle)


@pytest.mark.parametrize("env_id", OWN)
def test_the_page_shows_what_pictures_are_painted_of(env_id: str):
    seat = seat_of(env_id)
    scenes = played(seat, 2, rate=2.0)
    assert len(scenes) > 4
    page = Page()
    mirror = Mirror(page, "/seat0", np.zeros(3))
    for scene in scenes[:: max(1, len(scenes) // 6)]:
        mirror.show(scene)
        shown, wanted = page.corners(), drawn(scene)
        assert shown.shape == wanted.shape
        # Sorting may swap neighbours: sums and extremes tell a thing that is elsewhere or missing.
        np.testing.assert_allclose(shown.sum(axis=0), wanted.sum(axis=0), atol=3e-5 * len(wanted))
        np.testing.assert_allclose(np.sort(shown, axis=0), np.sort(wanted, axis=0), atol=1e-4)
    mirror.remove()
    assert not page.nodes
    seat.close()


def test_a_scene_is_the_one_of_the_picture(monkeypatch: pytest.MonkeyPatch):
    """The stage is asked for a picture at the same moments, with the same things in it, watched or not."""
    painted = []
    monkeypatch.setattr(
        Stage,
        "picture",
        lambda self, camera, *_: painted.append(self.things()) or np.zeros((camera.height, camera.width, 3), np.uint8),
    )
    env = gym.make("fieldgym/HoeWeeding-v0", disable_env_checker=True, backend="analytic", render_mode="rgb_array")
    policy = make_policy("fifo", env, 3)
    inner: Any = env.unwrapped
    observation, _ = env.reset(seed=4)
    inner.view.frame()
    inner.record(lambda _: None, 5.0)
    for _ in range(3):
        observation, *_ = env.step(act_single(policy, observation))
    monkeypatch.undo()
    scenes = played(seat_of("fieldgym/HoeWeeding-v0", "fifo"), 3, rate=5.0)
    for before in (painted[-1], painted[len(painted) // 2]):
        assert any(
            sum(len(things.mesh) for things in scene.groups.values()) == len(before.mesh)
            and all(np.isin(things.shift[:, 0], before.shift[:, 0]).all() for things in scene.groups.values())
            for scene in scenes
        )


@pytest.mark.parametrize("env_id", OWN)
@pytest.mark.parametrize("perception", ["model", "camera"])
def test_watching_changes_nothing(env_id: str, perception: str):
    """Numbers are equal with and without a viewer, to the last bit."""
    seat = seat_of(env_id, perception=perception)
    played(seat, 3)
    env = gym.make(env_id, disable_env_checker=True, backend="analytic", perception=perception)
    policy = make_policy(reference_policy(env_id), env, 3)
    observation, info = env.reset(seed=4)
    for entry in seat.log:
        action = act_single(policy, observation)
        observation, reward, _, _, info = env.step(action)
        assert (entry.action, entry.reward, entry.scorecard) == (action, reward, info["scorecard"])
    for name, values in observation.items():
        assert values.tobytes() == seat.observation[name].tobytes()
    assert seat.now_s == info["scorecard"]["duration_s"]
    assert sum(seat.log[-1].phases_s.values()) == pytest.approx(seat.now_s - seat.log[-2].ended_s)
    seat.close()
    env.close()


def test_turns_come_apart_into_quaternions_and_stretches():
    generator = np.random.default_rng(5)
    quaternions = generator.normal(size=(200, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    quaternions[:4] = np.eye(4)
    stretch = generator.uniform(0.2, 3.0, (200, 3))
    wxyz, scale = parted(from_quaternion(quaternions) * stretch[:, None, :])
    np.testing.assert_allclose(scale, stretch, rtol=1e-9)
    np.testing.assert_allclose(np.abs(np.sum(wxyz[:, [1, 2, 3, 0]] * quaternions, axis=1)), 1.0, rtol=1e-9)


def test_what_moves_as_one_is_sent_as_one():
    library = MeshLibrary()
    mesh = library.add(box((0.1, 0.1, 0.1)))
    things = instances(np.full(5, mesh), np.arange(15.0).reshape(5, 3), about_z(np.arange(5.0)))
    page, middle = Page(), np.zeros(3)
    mirror = Mirror(page, "/seat0", np.zeros(3))
    mirror.show(Scene(library, {"trays": things}, middle, middle, 1.0))
    node = next(node for name, node in page.nodes.items() if name.startswith("/seat0/trays/"))
    before = node.batched_positions
    mirror.show(Scene(library, {"trays": things.moved((0.25, 0.0, 0.0))}, middle, middle, 1.0))
    assert node.batched_positions is before
    np.testing.assert_allclose(node.position, [0.25, 0.0, 0.0], atol=1e-5)
    apart = things.moved((0.25, 0.0, 0.0))
    apart.shift[2] += 0.5
    mirror.show(Scene(library, {"trays": apart}, middle, middle, 1.0))
    np.testing.assert_allclose(node.batched_positions + node.position, apart.shift, atol=1e-4)
    mirror.show(Scene(library, {}, middle, middle, 1.0))
    assert list(page.nodes) == ["/seat0"]


def test_a_reel_hands_on_what_fails():
    def act(hand: Any) -> None:
        for _ in range(50):
            hand(SimpleNamespace())
        raise ValueError("the machine is stuck")

    reel = Reel(act)
    assert reel.next() is not None
    with pytest.raises(ValueError, match="the machine is stuck"):
        reel.result()
    assert reel.next() is None


def test_panels_hold_no_markup_of_others():
    seat = seat_of("fieldgym/LaserWeeding-v0")
    played(seat, 2)
    page = panels.scores(["<b>mine"], [seat.scorecard], None) + panels.decisions(seat.log) + panels.strip(seat.log)
    assert "<b>mine" not in page and "&lt;b&gt;mine" in page
    assert page.count("s</span>") >= 2
    times, rows = panels.course([seat.log], seat.now_s)
    assert rows[0][-1] == seat.scorecard["net_rate"] and times[-1] == seat.now_s


@pytest.mark.parametrize("env_id", OWN)
def test_what_is_believed_is_near_what_is_true(env_id: str):
    """With perfect reports every mark is at a true target; a taken slot has a mark, an empty one has none."""
    seat = seat_of(env_id, perception="perfect")
    seat.begin(lambda env: env.reset(seed=4))
    for _ in range(12):
        seat.start(1.0)
        seat.finish()
        belief = seat.belief
        assert belief is not None
        taken = seat.observation["candidates"].reshape(seat.layout.candidates, seat.layout.features)[:, 0] > 0.5
        np.testing.assert_array_equal(np.isfinite(belief.slot_m[:, 0]), taken)
        near = 1e-6
        if "Sorting" in env_id:
            # It says where its platform would be: a tool's length over the item, aside by what that leans at most.
            unwrapped: Any = seat.env.unwrapped
            machine = unwrapped.core.config.machine
            near += machine.sorter.tool_m * np.sin(machine.tilt_limit_rad)
        for ends in (belief.slot_m, belief.to_m):
            if ends is not None and taken.any():
                away = np.linalg.norm(ends[taken][:, None] - belief.true_m[None], axis=-1).min(axis=1)
                assert away.max() < near
    seat.close()


def test_done_targets_are_told_from_open_ones():
    seat = seat_of("fieldgym/LaserWeeding-v0", perception="perfect")
    seat.begin(lambda env: env.reset(seed=4))
    while seat.scorecard["done"] < 3:
        seat.start(1.0)
        seat.finish()
    assert seat.belief is not None
    assert np.count_nonzero(seat.belief.stands == DONE) == seat.scorecard["done"]
    assert np.count_nonzero(seat.belief.stands == OPEN) > 3
    seat.close()


@pytest.mark.parametrize("env_id", OWN)
def test_every_action_has_a_name_of_its_own(env_id: str):
    seat = seat_of(env_id)
    seat.begin(lambda env: env.reset(seed=4))
    layout, belief = seat.layout, seat.belief
    texts = {choice_of(action, layout, belief).text for action in range(layout.actions)}
    assert len(texts) == layout.actions
    legal = possible(seat.observation, layout, belief)
    assert sorted(legal.values()) == np.flatnonzero(seat.observation["action_mask"]).tolist()
    names = [name for name, _, _ in features(seat.observation, layout, belief, 0)] if belief is not None else []
    assert tuple(names) == seat.env.unwrapped.core.candidate_features  # type: ignore[attr-defined]
    seat.close()


def test_an_action_by_hand_is_carried_out_in_the_policys_place():
    seat = seat_of("fieldgym/LaserWeeding-v0")
    seat.begin(lambda env: env.reset(seed=4))
    while seat.choice == seat.layout.actions - 1:
        seat.start(1.0)
        seat.finish()
    assert seat.choice is not None and choice_of(seat.choice, seat.layout, seat.belief).slot is not None
    seat.start(1.0, seat.layout.actions - 1)
    seat.finish()
    assert seat.log[-1].action == seat.layout.actions - 1 and seat.log[-1].by_hand and not seat.log[0].by_hand
    assert seat.log[-1].text.startswith("wait")
    seat.close()


def test_a_learned_policy_says_how_sure_it_is():
    seat = seat_of("fieldgym/LaserWeeding-v0", "learned")
    seat.begin(lambda env: env.reset(seed=4))
    weights = shares(seat.policy, seat.observation)
    assert weights is not None and weights.sum() == pytest.approx(1.0) and weights.argmax() == seat.choice
    assert not weights[seat.observation["action_mask"] == 0].any()
    assert shares(make_policy("fifo", seat.env, 0), seat.observation) is None
    seat.close()
