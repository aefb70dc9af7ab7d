"""The machines as MJCF: the same masses and points as the URDFs', and the same motions in another engine."""

from xml.etree import ElementTree

import numpy as np
import pytest

from fieldgym.scripts import compare_engines
from fieldgym.simulation.mjcf import quaternion, to_mjcf
from fieldgym.simulation.urdf import rotation_matrix

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'fieldgym[test]'")

NAMES = tuple(compare_engines.CASES)
ALWAYS = ("weeder", "transplanter")
"""One machine in space and one in a plane; the others once a night."""


@pytest.mark.parametrize("name", NAMES)
def test_the_trees_are_the_urdfs(name):
    """Masses, centres, moments, joints, pinned points and limits, read back from what MuJoCo makes of the text."""
    assembly = compare_engines.CASES[name]().assembly
    model = mujoco.MjModel.from_xml_string(to_mjcf(assembly, 1e-3))
    links = [link for part in assembly.parts for link in part.robot.links]
    assert model.nbody == len(links) + 1
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for link in links:
        body, inertia = model.body(link.name), link.inertia()
        np.testing.assert_allclose(body.mass, inertia.mass_kg, rtol=1e-9)
        np.testing.assert_allclose(body.ipos, inertia.centre_m, atol=1e-9)
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, body.iquat)
        turn = turn.reshape(3, 3)
        np.testing.assert_allclose((turn * body.inertia) @ turn.T, inertia.tensor_kg_m2, rtol=1e-6, atol=1e-9)
    moving = {joint.name for part in assembly.parts for joint in part.robot.joints if joint.kind != "fixed"}
    free = {part.robot.links[0].name for part in assembly.parts if not part.fixed}
    assert {model.joint(number).name for number in range(model.njnt)} == moving | free
    for number, motor in enumerate(assembly.motors):
        assert model.actuator(number).name == motor.joint
        np.testing.assert_allclose(model.actuator(number).forcerange, [-motor.limit, motor.limit], rtol=1e-9)
        np.testing.assert_allclose(model.joint(motor.joint).damping, motor.damping)
    assert model.neq == len(assembly.closures) and model.opt.gravity[2] == pytest.approx(-9.81)


@pytest.mark.parametrize("name", NAMES)
def test_the_closed_form_closes_the_loops(name):
    """Placed by the mechanism's joints, the pinned points meet and the tool is where the closed form says."""
    case = compare_engines.CASES[name]()
    motion = case.draw(np.random.default_rng(3))
    model = mujoco.MjModel.from_xml_string(to_mjcf(case.assembly, 1e-3))
    data = mujoco.MjData(model)
    for row in (0, -1):
        data.qpos[[model.joint(joint).qposadr[0] for joint in case.names]] = motion.joints[row]
        if motion.free is not None:
            if row == -1:
                continue
            at = model.joint("platform").qposadr[0]
            data.qpos[at : at + 7] = np.concatenate(motion.free)
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(data.body("platform").xpos, motion.tool[row], atol=1e-9)
        for number in range(len(case.assembly.closures)):
            apart = data.site(f"first{number}").xpos - data.site(f"second{number}").xpos
            assert np.linalg.norm(apart) < 1e-9


def test_turned_parts_are_turned_alike():
    """A link's parts in MuJoCo's frame and in the URDF's."""
    assembly = compare_engines.CASES["weeder"]().assembly
    model = mujoco.MjModel.from_xml_string(to_mjcf(assembly, 1e-3))
    platform = next(link for link in assembly.parts[0].robot.links if link.name == "platform")
    first = model.body("platform").geomadr[0]
    for number, part in enumerate(part for part in platform.parts if part.visible):
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.geom(first + number).quat)
        np.testing.assert_allclose(turn.reshape(3, 3), rotation_matrix(part.rpy_rad), atol=1e-9)
        np.testing.assert_allclose(model.geom(first + number).pos, part.xyz_m, atol=1e-9)
    for rpy in np.random.default_rng(0).uniform(-3.0, 3.0, (20, 3)):
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, quaternion(rpy))
        np.testing.assert_allclose(turn.reshape(3, 3), rotation_matrix(rpy), atol=1e-12)
    text = ElementTree.fromstring(to_mjcf(assembly, 1e-3))
    assert len(text.findall(".//connect")) == 3 and text.get("model") == "weeder"


def check(found: compare_engines.Outcome) -> None:
    assert found.loop_m < 1e-5
    assert found.path_m < 5e-5 and found.engines_m < 5e-5
    assert found.cycle < 1e-3
    assert found.effort < 0.05


def test_one_motion_is_the_same_in_both_engines():
    check(compare_engines.compare("transplanter", 1))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.long] * (name not in ALWAYS)) for name in NAMES]
)
def test_twenty_motions_are_the_same_in_both_engines(name):
    check(compare_engines.compare(name, 20))


def test_another_machine_would_show(monkeypatch):
    """Forearms a tenth of a millimetre longer in MuJoCo than in the closed form."""
    case = compare_engines.CASES["transplanter"]()
    longer = case.parameters.__class__(physics_hz=compare_engines.PYBULLET_HZ)
    motion = case.draw(np.random.default_rng(0))
    text = to_mjcf(case.assembly, 1.0 / (compare_engines.PYBULLET_HZ * compare_engines.FINER))
    reach = f"{longer.arm.forearm_m:.12g}"
    monkeypatch.setattr(
        compare_engines,
        "to_mjcf",
        lambda *_: text.replace(f'pos="0 {reach} 0"', f'pos="0 {longer.arm.forearm_m + 1e-4} 0"'),
    )
    ((tool, _, _),) = compare_engines.in_mujoco(case, [motion])
    assert np.linalg.norm(tool - motion.tool, axis=1).max() > 5e-5


def test_arrival_is_found_between_two_samples():
    tool = np.zeros((11, 3))
    tool[:, 0] = np.linspace(-0.01, 0.0, 11)
    # The last half millimetre begins in the middle of the last step.
    assert compare_engines.arrival(tool, 0.1) == pytest.approx(0.95)
