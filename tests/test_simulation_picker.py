"""The picker in PyBullet: it tracks, it closes, it repeats itself, and its motors have limits."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from fieldgym.mechanisms import UnreachablePoseError
from fieldgym.motion import StoppedPath
from fieldgym.perception.frames import Camera
from fieldgym.simulation.client import PhysicsClient, pybullet
from fieldgym.simulation.looks import MachineLooks
from fieldgym.simulation.picker import PickerMachine, fastest_gate, measure_tracking
from fieldgym.simulation.picker_model import FRAME, PickerParameters, picker_joints, picker_robot
from fieldgym.simulation.stage import Stage
from fieldgym.simulation.urdf import Box, Cylinder, rotation_matrix

PARAMETERS = PickerParameters()
MIDDLE_U = 0.5 * PARAMETERS.five_bar.base_m
LIMIT_M = 0.3e-3


def short_motion() -> tuple[np.ndarray, np.ndarray]:
    """A small rise and traverse with the cart moving: cart (n,), tool (n, 2)."""
    corners = [[MIDDLE_U, -0.40], [MIDDLE_U, -0.32], [MIDDLE_U + 0.08, -0.32]]
    path = StoppedPath.under_limits(corners, PARAMETERS.tool_velocity_m_s, PARAMETERS.tool_acceleration_m_s2)
    cart = StoppedPath.under_limits([[0.2], [0.25]], PARAMETERS.cart_velocity_m_s, PARAMETERS.cart_acceleration_m_s2)
    time = np.arange(int(max(path.duration_s, cart.duration_s) * PARAMETERS.physics_hz) + 2) / PARAMETERS.physics_hz
    return cart.sample(time).position[:, 0], path.sample(time).position


def states(machine: PickerMachine) -> list[tuple[float, float]]:
    """Position and velocity of every joint, exact."""
    count = pybullet.getNumJoints(machine.body_id, physicsClientId=machine.client.id)
    joints = pybullet.getJointStates(machine.body_id, range(count), physicsClientId=machine.client.id)
    return [joint[:2] for joint in joints]


@pytest.fixture
def machine() -> Iterator[PickerMachine]:
    with PickerMachine() as made:
        yield made


def test_the_fastest_gate_is_tracked_closed_and_within_the_motors() -> None:
    report = measure_tracking()
    print(report)
    assert report.measured
    assert report.arm_error_m < LIMIT_M
    assert report.cart_error_m < LIMIT_M
    assert report.closure_error_m < LIMIT_M
    assert not report.saturated.any()
    assert np.all(report.peak_effort > 0.0)


def test_the_fastest_gate_uses_the_limits_inside_the_workspace() -> None:
    # Sampled finely, so that the corners where the tool rests are among the samples.
    parameters = replace(PARAMETERS, physics_hz=960.0)
    cart, tool = fastest_gate(parameters)
    assert PARAMETERS.five_bar.reachable(tool).all()
    assert np.ptp(cart) == pytest.approx(0.45)
    assert (tool[:, 1].min(), tool[:, 1].max()) == (pytest.approx(-0.46), pytest.approx(-0.28))
    assert np.ptp(tool[:, 0]) == pytest.approx(0.26)
    rate, push = (
        np.linalg.norm(np.diff(tool, order, axis=0), axis=1).max() * parameters.physics_hz**order for order in (1, 2)
    )
    assert push == pytest.approx(PARAMETERS.tool_acceleration_m_s2, rel=0.02)
    assert rate <= PARAMETERS.tool_velocity_m_s
    assert np.abs(np.diff(cart)).max() * parameters.physics_hz == pytest.approx(PARAMETERS.cart_velocity_m_s, rel=0.01)


def test_the_tracking_error_is_seen() -> None:
    coarse = measure_tracking(replace(PARAMETERS, physics_hz=60.0))
    fine = measure_tracking()
    assert coarse.arm_error_m > 2.0 * fine.arm_error_m


def test_torque_agrees_with_the_statics_of_the_paper(machine: PickerMachine) -> None:
    # Held still, the arms carry the tool, the forearms and themselves: virtual work gives the motor torques.
    bar = PARAMETERS.five_bar
    tool = np.array([MIDDLE_U + 0.03, -0.38])
    machine.reset(0.0, tool)
    report = machine.run(np.zeros(240), np.broadcast_to(tool, (240, 2)))
    step = 1e-6

    def potential(position: np.ndarray) -> float:
        chains = bar.chains(position)
        height = PARAMETERS.tool_mass_kg * (position[1] + platform_centre)
        for near, far in ((chains.b, chains.c), (chains.e, chains.d)):
            height += 0.5 * PARAMETERS.arm_mass_kg * near[1] + 0.5 * PARAMETERS.forearm_mass_kg * (near[1] + far[1])
        return 9.81 * height

    platform = pybullet.getNumJoints(machine.body_id, physicsClientId=machine.client.id) - 1
    info = pybullet.getDynamicsInfo(machine.body_id, platform, physicsClientId=machine.client.id)
    platform_centre = info[3][2]
    slope = [(potential(tool + d) - potential(tool - d)) / (2 * step) for d in step * np.eye(2)]
    expected = -bar.statics(tool, slope)
    np.testing.assert_allclose(report.peak_effort[1:], np.abs(expected), rtol=5e-3)


def test_two_clients_agree_to_the_bit() -> None:
    cart, tool = short_motion()
    with PickerMachine() as first, PickerMachine() as second:
        for each in (first, second):
            each.reset(cart[0], tool[0])
            each.run(cart, tool)
        assert states(first) == states(second)


def test_reset_is_as_good_as_new_to_the_bit() -> None:
    cart, tool = short_motion()
    with PickerMachine() as used, PickerMachine() as fresh:
        used.reset(1.0, tool[-1])
        used.run(np.full(50, 1.0), np.broadcast_to(tool[-1], (50, 2)))
        for each in (used, fresh):
            each.reset(cart[0], tool[0])
            each.run(cart, tool)
        assert states(used) == states(fresh)


def test_measuring_changes_nothing(machine: PickerMachine) -> None:
    cart, tool = short_motion()
    machine.reset(cart[0], tool[0])
    plain = machine.run(cart, tool)
    ended = states(machine)
    machine.reset(cart[0], tool[0])
    measured = machine.run(cart, tool, measure=True)
    assert states(machine) == ended
    np.testing.assert_array_equal(plain.final_tool_m, measured.final_tool_m)
    assert plain.arm_error_m <= measured.arm_error_m
    assert (plain.measured, measured.measured) == (False, True)


def test_the_report_of_a_motion(machine: PickerMachine) -> None:
    cart, tool = short_motion()
    machine.reset(cart[0], tool[0])
    rows: list[int] = []
    report = machine.run(cart, tool, rows.append)
    assert rows == list(range(1, len(cart)))
    assert report.duration_s == pytest.approx((len(cart) - 1) / PARAMETERS.physics_hz)
    wanted = [0.25, MIDDLE_U + 0.08 - 0.5 * PARAMETERS.five_bar.base_m, PARAMETERS.motor_height_m - 0.32]
    np.testing.assert_allclose(report.final_tool_m, wanted, atol=LIMIT_M)
    np.testing.assert_array_equal(report.final_tool_m, machine.tool_world())
    assert report.final_error_m < LIMIT_M


def test_a_motion_of_one_row_does_nothing(machine: PickerMachine) -> None:
    machine.reset(0.0, [MIDDLE_U, -0.4])
    report = machine.run([0.0], [[MIDDLE_U, -0.4]])
    assert report.duration_s == 0.0
    assert report.final_error_m < 1e-6


@pytest.mark.parametrize(
    ("change", "motors"),
    [({"arm_torque_limit_n_m": 0.5}, [False, True, True]), ({"cart_force_limit_n": 2.0}, [True, False, False])],
)
def test_weak_motors_saturate_and_fall_behind(change: dict[str, float], motors: list[bool]) -> None:
    report = measure_tracking(replace(PARAMETERS, **change))
    assert report.saturated.tolist() == motors
    limits = np.array([PARAMETERS.cart_force_limit_n, *[PARAMETERS.arm_torque_limit_n_m] * 2])
    for name, value in change.items():
        limits[[0] if name.startswith("cart") else [1, 2]] = value
    assert np.all(report.peak_effort <= limits * (1 + 1e-6))
    assert max(report.cart_error_m, report.arm_error_m) > 10 * LIMIT_M


@pytest.mark.parametrize(
    ("cart_x_m", "tool"), [(0.0, (MIDDLE_U, -0.27)), (3.2, (MIDDLE_U + 0.1, -0.40)), (-1.0, (MIDDLE_U - 0.12, -0.35))]
)
def test_placing_needs_no_step(machine: PickerMachine, cart_x_m: float, tool: tuple[float, float]) -> None:
    machine.place(cart_x_m, tool)
    wanted = [cart_x_m, tool[0] - MIDDLE_U, PARAMETERS.motor_height_m + tool[1]]
    np.testing.assert_allclose(machine.tool_world(), wanted, atol=1e-6)
    report = machine.run([cart_x_m], [tool])
    assert report.closure_error_m < 1e-6


def test_a_reset_machine_holds_its_pose_while_others_step(machine: PickerMachine) -> None:
    machine.reset(0.4, [MIDDLE_U, -0.35])
    before = machine.tool_world()
    for _ in range(100):
        machine.client.step()
    np.testing.assert_allclose(machine.tool_world(), before, atol=LIMIT_M)


def test_other_parameters_make_another_machine() -> None:
    high = replace(PARAMETERS, motor_height_m=1.05)
    report = measure_tracking(high)
    assert report.final_tool_m[2] == pytest.approx(1.05 - 0.46, abs=LIMIT_M)
    assert report.closure_error_m < LIMIT_M


def test_a_lent_world_is_left_as_it_was() -> None:
    with PhysicsClient() as client:
        machine = PickerMachine(client=client)
        assert pybullet.getNumBodies(physicsClientId=client.id) == 1
        machine.close()
        machine.close()
        assert not client.closed
        assert pybullet.getNumBodies(physicsClientId=client.id) == 0
        assert pybullet.getNumConstraints(physicsClientId=client.id) == 0
        client.step()


def test_a_world_of_its_own_is_closed_with_it() -> None:
    machine = PickerMachine()
    assert pybullet.getNumBodies(physicsClientId=machine.client.id) == 1
    assert not pybullet.getVisualShapeData(machine.body_id, physicsClientId=machine.client.id)
    machine.close()
    machine.close()
    assert machine.client.closed


def test_the_machine_is_as_wide_and_its_frame_as_high_as_published() -> None:
    (frame,) = (link for link in picker_robot(PARAMETERS).links if link.name == "frame")
    boxes = []
    for part in frame.parts:
        match part.shape:
            case Box(size_m):
                half = 0.5 * np.array(size_m)
            case Cylinder(radius, length):
                half = np.array([radius, radius, 0.5 * length])
            case _:
                pytest.fail("the frame is made of boxes and cylinders")
        reach = np.abs(rotation_matrix(part.rpy_rad)) @ half
        boxes.append((np.array(part.xyz_m) - reach, np.array(part.xyz_m) + reach, part.colour))
    width = max(high[1] for _, high, _ in boxes) - min(low[1] for low, _, _ in boxes)
    assert width == pytest.approx(1.2, abs=0.002)
    assert max(high[2] for _, high, colour in boxes if colour == FRAME) == pytest.approx(1.3)
    assert min(low[2] for low, _, _ in boxes) == pytest.approx(0.0, abs=1e-9)


def test_nothing_of_the_machine_stands_in_the_cameras_view() -> None:
    """The cone from the camera that holds a stop's window at head height, with the arm parked high."""
    stage = Stage()
    looks = MachineLooks(stage.library, [picker_robot(PARAMETERS)])
    joints = picker_joints(PARAMETERS, np.zeros(1), np.array([[MIDDLE_U, -0.27]]))[0]
    stage.put("machine", looks.place(joints)[0])
    eye = np.array([PARAMETERS.camera_ahead_m, 0.0, PARAMETERS.motor_height_m + PARAMETERS.camera_above_motors_m])
    frame = stage.look(Camera(128, 128, np.deg2rad(60.0), 0.005, 3.0), eye, eye - [0.0, 0.0, 1.0], (0.0, 1.0, 0.0))
    across = np.linspace(-1.0, 1.0, 21)
    x, y = np.meshgrid(0.225 * across, 0.17 * across)
    focal = frame.camera.intrinsics[0, 0]
    column, row = (64.0 + focal * x / 0.48).round().astype(int), (63.0 - focal * y / 0.48).round().astype(int)
    assert np.all(frame.depth_m[row, column] > 1.2), "something of the machine hides the heads"
    assert frame.depth_m.min() < 1.2, "the machine is there"


def test_trajectories_that_cannot_be_followed_are_refused(machine: PickerMachine) -> None:
    here = [MIDDLE_U, -0.4]
    machine.reset(0.0, here)
    with pytest.raises(ValueError, match="starts 50"):
        machine.run([0.05, 0.05], [here, here])
    with pytest.raises(ValueError, match="expected"):
        machine.run([0.0, 0.0], [here])
    with pytest.raises(ValueError, match="expected"):
        machine.run([], np.empty((0, 2)))
    with pytest.raises(ValueError, match="NaN"):
        machine.run([0.0, float("nan")], [here, here])
    with pytest.raises(UnreachablePoseError):
        machine.run([0.0, 0.0], [here, [MIDDLE_U, -2.0]])
    with pytest.raises(UnreachablePoseError):
        machine.place(0.0, [MIDDLE_U, 2.0])
    np.testing.assert_allclose(machine.tool_world(), [0.0, 0.0, PARAMETERS.motor_height_m - 0.4], atol=1e-6)


def test_a_world_of_another_rate_cannot_move_the_machine() -> None:
    with PhysicsClient(100.0) as client, PickerMachine(client=client) as machine:
        machine.place(0.0, [MIDDLE_U, -0.4])
        with pytest.raises(ValueError, match="100"):
            machine.run([0.0], [[MIDDLE_U, -0.4]])


@pytest.mark.parametrize("name", ["physics_hz", "arm_torque_limit_n_m", "tool_mass_kg", "cart_velocity_m_s"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_parameters_must_be_positive(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        replace(PARAMETERS, **{name: value})
