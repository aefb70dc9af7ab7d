"""Machines are drawn where PyBullet puts their links, in any pose; a hose reaches from end to end."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fieldgym.envs.sorting.config import SortingConfig
from fieldgym.envs.sorting.scene import SorterScene
from fieldgym.envs.weeding.tools.hoe.config import HoeWeedingConfig
from fieldgym.envs.weeding.tools.hoe.scene import HoeScene
from fieldgym.motion.orientation import axes
from fieldgym.rendering.library import MeshLibrary
from fieldgym.simulation.hoe import HoeMachine
from fieldgym.simulation.hose import Hose
from fieldgym.simulation.looks import MachineLooks
from fieldgym.simulation.picker import PickerMachine
from fieldgym.simulation.picker_model import JOINTS, PickerParameters, picker_joints, picker_robot
from fieldgym.simulation.prrs_looks import PrrsLooks
from fieldgym.simulation.sorter import SorterMachine
from fieldgym.simulation.urdf import Box, Colour, Joint, Link, Part, Robot
from fieldgym.simulation.weeder import WeederMachine
from fieldgym.simulation.weeder_model import JOINTS as WEEDER_JOINTS
from fieldgym.simulation.weeder_model import WeederParameters, weeder_joints, weeder_robot


def agree(looks: MachineLooks, turn: np.ndarray, shift: np.ndarray, pose: Callable) -> None:
    for k, link in enumerate(looks.links):
        place, quaternion = pose(link)
        assert shift[k] == pytest.approx(place, abs=2e-6), link
        assert turn[k] == pytest.approx(axes(quaternion[[3, 0, 1, 2]]), abs=2e-6), link


@pytest.mark.parametrize(("cart", "tool"), [(0.0, (0.10, -0.30)), (2.3, (0.16, -0.36))])
def test_the_picker_is_drawn_where_it_stands(cart, tool):
    parameters = PickerParameters()
    looks = MachineLooks(MeshLibrary(), [picker_robot(parameters)])
    joints = picker_joints(parameters, np.array([cart]), np.array([tool]))[0]
    _, turn, shift = looks.place(joints[[JOINTS.index(name) for name in looks.joints]])
    with PickerMachine(parameters) as machine:
        machine.place(cart, tool)
        agree(looks, turn, shift, machine._machine.pose)


def test_the_laser_is_drawn_where_it_stands():
    parameters = WeederParameters()
    looks = MachineLooks(MeshLibrary(), [weeder_robot(parameters)])
    pose = parameters.mechanism.home_pose + np.array([0.05, 0.02, 0.10, -0.15])
    joints = weeder_joints(parameters, np.array([1.2]), pose[None])[0]
    _, turn, shift = looks.place(joints[[WEEDER_JOINTS.index(name) for name in looks.joints]])
    with WeederMachine(parameters) as machine:
        machine.reset(1.2, pose)
        agree(looks, turn, shift, machine._machine.pose)


@pytest.mark.parametrize("kind", [SorterMachine, HoeMachine])
def test_the_3_prrs_is_drawn_where_it_stands(kind, monkeypatch):
    with kind() as machine:
        looks, placed = PrrsLooks(MeshLibrary(), machine.parameters), []
        place = looks._looks.place
        monkeypatch.setattr(looks._looks, "place", lambda *arguments: placed.append(place(*arguments)) or placed[-1])
        pose = machine.parameters.mechanism.home_pose + np.array([0.04, -0.05, 0.02, 0.08, -0.06, 0.3])
        machine.place(pose)
        looks.place(pose)
        agree(looks._looks, placed[0][1], placed[0][2], machine._machine.pose)
        # A cart takes everything along.
        ahead = looks.place(pose, 2.0).shift - placed[0][0].shift
        assert ahead == pytest.approx(np.tile([2.0, 0.0, 0.0], (len(ahead), 1)), abs=1e-9)


def test_joints_turn_and_slide_about_any_axis():
    """A tree with a fixed turn, a skew hinge and a skew slide, against SciPy's rotations."""
    grey, axis = Colour("grey", 0.5, 0.5, 0.5), (2.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0)
    links = tuple(Link(name, 1.0, (Part(Box((0.1, 0.2, 0.3)), grey),)) for name in "abcd")
    joints = (
        Joint("fix", "fixed", "a", "b", (0.1, 0.2, 0.3), (0.3, -0.4, 0.5)),
        Joint("hinge", "continuous", "b", "c", (0.0, 0.5, 0.0), (0.1, 0.2, 0.3), axis),
        Joint("slide", "prismatic", "c", "d", (0.0, 0.0, 0.4), (-0.2, 0.0, 0.7), axis),
    )
    looks = MachineLooks(MeshLibrary(), [Robot("skew", links, joints)])
    assert looks.joints == ("hinge", "slide") and looks.links == ("a", "b", "c", "d")
    base = Rotation.from_euler("xyz", (0.5, 0.6, 0.7)).as_matrix(), np.array([1.0, 2.0, 3.0])
    parts, turn, shift = looks.place([0.8, -0.25], {"a": base})
    for k, joint in enumerate(joints, 1):
        rest = Rotation.from_euler("xyz", joint.rpy_rad)
        own = {"hinge": Rotation.from_rotvec(0.8 * np.array(axis))}.get(joint.name, Rotation.identity())
        slid = -0.25 * np.array(axis) if joint.name == "slide" else np.zeros(3)
        place = shift[k - 1] + turn[k - 1] @ (np.array(joint.xyz_m) + rest.apply(slid))
        assert turn[k] == pytest.approx(turn[k - 1] @ (rest * own).as_matrix(), abs=1e-12)
        assert shift[k] == pytest.approx(place, abs=1e-12)
    assert parts.shift == pytest.approx(shift, abs=1e-9) and parts.turn == pytest.approx(turn, abs=1e-9)
    with pytest.raises(ValueError, match="hinge"):
        looks.place([0.0])


def test_poses_that_are_none_are_refused():
    looks = PrrsLooks(MeshLibrary(), HoeMachine().parameters)
    for pose in ([np.nan] * 6, [3.0, 0.0, 0.0, 0.0, 0.0, 0.0]):
        with pytest.raises(ValueError, match="finite metres"):
            looks.place(pose)


def test_pads_close_on_the_grip_and_the_blade_is_in_the_ground():
    config = SortingConfig()
    scene = SorterScene(config)
    pose = np.array([0.03, -0.02, 0.04, 0.0, 0.0, 0.4])
    scene.set_machine(pose, 0.02)
    pads = scene.stage.things("pads").shift
    sorter = config.machine.sorter
    grip = pose[:3] + np.array([0.0, 0.0, sorter.origin_height_m - sorter.tool_m])
    assert pads.mean(axis=0) == pytest.approx(grip, abs=1e-6)
    assert np.linalg.norm(pads[0] - pads[1]) == pytest.approx(0.04, abs=1e-6)
    hoe = HoeWeedingConfig()
    field = HoeScene(hoe, hoe.parameters)
    field.set_machine(1.0, np.zeros(6))
    meshes, parts = field.stage.library.meshes, field.stage.things("machine")
    lowest = (parts.shift[:, 2] + meshes.centre[parts.mesh, 2] - meshes.radius[parts.mesh]).min()
    assert lowest < hoe.parameters.lowest_tip_m + 1e-6


def test_a_hose_runs_from_end_to_end_without_a_gap():
    library = MeshLibrary()
    hose = Hose(library, 0.75, 0.016, (0.9, 0.9, 0.9))
    start, end = np.array([0.0, 0.1, 0.5]), np.array([-0.3, 0.2, 1.0])
    things = hose.lay(start, (0.0, 0.0, 0.2), end, (0.1, 0.0, 0.0))
    half = library.meshes.radius[0] - 0.016
    tips = [things.shift + sign * half * things.turn[:, :, 2] for sign in (-1.0, 1.0)]
    assert np.linalg.norm(tips[0][0] - start) < 0.02 and np.linalg.norm(tips[1][-1] - end) < 0.02
    assert np.linalg.norm(np.diff(things.shift, axis=0), axis=1).max() < 2.0 * half
