"""The transplanter in PyBullet: it tracks and closes, its torques are those of the inverse dynamics, it looks whole."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fieldgym.mechanisms import UnreachablePoseError
from fieldgym.motion import GATE_STYLES, Gate
from fieldgym.rendering.library import MeshLibrary
from fieldgym.simulation.client import PhysicsClient
from fieldgym.simulation.looks import MachineLooks
from fieldgym.simulation.transplanter import TransplanterMachine, full_gate, measure_tracking
from fieldgym.simulation.transplanter_model import (
    TransplanterParameters,
    looks_joints,
    transplanter_joints,
    transplanter_robot,
)

PARAMETERS = TransplanterParameters()
LIMIT_M = 0.5e-3
PAYLOAD_KG = 0.3


def gate(style: Any) -> Gate:
    return Gate(style, 4.5, 60.0, 0.0 if style.startswith("stop") else 0.05)


@pytest.mark.parametrize("style", GATE_STYLES)
def test_the_full_gate_at_full_speed_is_tracked_and_stays_closed(style):
    report = measure_tracking(gate(style), PARAMETERS, PAYLOAD_KG)
    assert report.tracking_error_m < LIMIT_M and report.closure_error_m < LIMIT_M
    assert report.measured and not report.saturated.any()
    assert report.final_error_m < 1e-4


@pytest.mark.parametrize("payload_kg", [0.0, PAYLOAD_KG])
def test_motor_torques_are_those_of_the_inverse_dynamics(payload_kg):
    """Within 5 % of the peak at every step: the law's acceleration is continuous, so steps can be compared."""
    report = measure_tracking(gate("stop-quintic"), PARAMETERS, payload_kg)
    position, velocity, acceleration = full_gate(PARAMETERS, gate("stop-quintic"))
    wanted = PARAMETERS.arm.inverse_dynamics(position, velocity, acceleration, payload_kg)
    # The step that leaves row k changes the velocity as the acceleration at row k does.
    error = report.torque_n_m - wanted[:-1]
    assert np.abs(error).max() < 0.05 * np.abs(wanted).max()
    assert np.abs(report.torque_n_m).max() == pytest.approx(np.abs(wanted).max(), rel=0.01)


def test_the_machine_holds_the_published_payload_as_statics_say():
    with TransplanterMachine(PARAMETERS) as machine:
        here = [0.12, -0.60]
        machine.reset(here)
        machine.carry(PAYLOAD_KG)
        report = machine.run(np.tile(here, (100, 1)), measure=True)
    wanted = PARAMETERS.arm.inverse_dynamics(here, [0.0, 0.0], [0.0, 0.0], PAYLOAD_KG)
    assert report.torque_n_m[-1] == pytest.approx(wanted, rel=0.05)
    bare = PARAMETERS.arm.inverse_dynamics(here, [0.0, 0.0], [0.0, 0.0], 0.0)
    statics = PARAMETERS.arm.statics(here, [0.0, -PAYLOAD_KG * 9.81])
    assert np.abs(wanted - bare) == pytest.approx(np.abs(statics), rel=1e-6)


def test_weak_motors_saturate_and_say_so():
    weak = replace(PARAMETERS, torque_limit_n_m=25.0)
    report = measure_tracking(gate("stop-quintic"), weak, PAYLOAD_KG)
    assert report.saturated.any() and report.tracking_error_m > LIMIT_M
    assert np.abs(report.torque_n_m).max() <= 25.0 * (1.0 + 1e-6)


def test_motions_repeat_bit_for_bit():
    positions = full_gate(PARAMETERS, gate("stop-quintic"))[0][:80]
    ends = []
    for _ in range(2):
        with TransplanterMachine(PARAMETERS) as machine:
            for _ in range(2):
                machine.reset(positions[0])
                ends.append(machine.run(positions).final_tool_m)
    assert all(np.array_equal(end, ends[0]) for end in ends)


def test_the_urdf_carries_the_masses_of_the_mechanism():
    robot = transplanter_robot(PARAMETERS)
    masses = PARAMETERS.arm.masses
    assert masses is not None
    links = {link.name: link.inertia() for link in robot.links}
    assert links["forearm1"].mass_kg == masses.forearm_kg
    assert links["platform"].mass_kg == masses.platform_kg
    arm = links["arm1"]
    reach = PARAMETERS.arm.arm_m
    about_motor = arm.tensor_kg_m2[0, 0] + arm.mass_kg * arm.centre_m[1] ** 2
    wanted = masses.arm_kg * reach**2 / 3.0 + masses.elbow_kg * reach**2 + masses.rotor_inertia_kg_m2
    assert about_motor == pytest.approx(wanted, rel=0.01)


@pytest.mark.parametrize("tool", [[0.0, -0.6], [-0.3, -0.66], [0.3, -0.66], [-0.3, -0.51], [0.3, -0.51]])
def test_parallelograms_keep_bracket_and_platform_upright_and_close(tool):
    """In the machine that is shown, every bar ends where the next part begins."""
    robot, library = transplanter_robot(PARAMETERS, looks=True), MeshLibrary()
    looks = MachineLooks(library, [robot])
    joints = looks_joints(transplanter_joints(PARAMETERS, np.array([tool]))[0], 1.0)
    _, turn, shift = looks.place([joints[name] for name in looks.joints])
    state = {joint.name: (shift[k], turn[k]) for joint in robot.joints for k in [looks.links.index(joint.child)]}
    state["platform"] = state["slide_v"]
    arm = PARAMETERS.arm

    def end(name: str, point: tuple[float, float, float]) -> np.ndarray:
        place, turn = state[name]
        return place + turn @ np.array(point)

    platform = state["platform"][0]
    height = PARAMETERS.motor_height_m
    assert platform == pytest.approx([0.0, tool[0], height + tool[1]], abs=1e-6)
    for leg, side in ((1, 1.0), (2, -1.0)):
        wrist = platform + np.array([0.0, side * PARAMETERS.half_platform_m, 0.0])
        assert end(f"forearm{leg}", (0.0, arm.forearm_m, 0.0)) == pytest.approx(wrist, abs=1e-6)
        assert state[f"bracket{leg}"][1] == pytest.approx(np.eye(3), abs=1e-6)
        upper = state[f"bracket{leg}"][0] + np.array([0.0, 0.0, 0.060])
        assert end(f"arm_bar{leg}", (0.0, arm.arm_m, 0.0)) == pytest.approx(upper, abs=1e-6)
        lower = wrist + np.array([0.0, side * 0.055, 0.0])
        assert end(f"forearm_bar{leg}", (0.0, arm.forearm_m, 0.0)) == pytest.approx(lower, abs=1e-6)


def test_trajectories_that_cannot_be_followed_are_refused():
    with TransplanterMachine() as machine:
        here = [0.0, -0.6]
        machine.reset(here)
        with pytest.raises(ValueError, match="starts 50"):
            machine.run([[0.05, -0.6]] * 2)
        with pytest.raises(ValueError, match="expected"):
            machine.run(np.empty((0, 2)))
        with pytest.raises(ValueError, match="NaN"):
            machine.run([here, [float("nan"), -0.6]])
        with pytest.raises(UnreachablePoseError):
            machine.run([here, [0.0, -2.0]])
        with pytest.raises(ValueError, match="payload_kg"):
            machine.carry(-0.1)
    with PhysicsClient(100.0) as client, TransplanterMachine(client=client) as machine:
        with pytest.raises(ValueError, match="100"):
            machine.run([[0.0, -0.66]])


@pytest.mark.parametrize("name", ["physics_hz", "torque_limit_n_m", "motor_height_m", "gripper_drop_m"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_parameters_must_be_positive(name, value):
    with pytest.raises(ValueError, match=name):
        replace(PARAMETERS, **{name: value})
