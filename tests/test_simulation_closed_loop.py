"""The generic closed-loop machine, on a parallelogram whose motion is known: separate bodies and a free coupler."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fieldgym.simulation.client import PhysicsClient, pybullet
from fieldgym.simulation.closed_loop import Body, ClosedLoopMachine, Closure, Motor
from fieldgym.simulation.urdf import Box, Colour, Cylinder, Joint, Link, Part, Robot

GREY = Colour("grey", 0.5, 0.5, 0.5)
CRANK_M, SPAN_M = 0.2, 0.5
AXIS_X = (1.0, 0.0, 0.0)


def crank(number: int) -> Robot:
    """A crank along y that turns about x."""
    bar = Link(f"crank{number}", 0.4, (Part(Box((0.02, CRANK_M, 0.02)), GREY, (0.0, 0.5 * CRANK_M, 0.0)),))
    ground = Link(f"ground{number}", 1.0, (Part(Box((0.1, 0.1, 0.1)), GREY),))
    joint = Joint(f"turn{number}", "continuous", f"ground{number}", f"crank{number}", axis=AXIS_X)
    return Robot(f"leg{number}", (ground, bar), (joint,))


def coupler() -> Robot:
    """A lopsided bar along y from its own origin: mass frame and link frame differ in place and direction."""
    bar = Part(Box((0.03, SPAN_M, 0.02)), GREY, (0.0, 0.5 * SPAN_M, 0.0))
    load = Part(Cylinder(0.03, 0.1), GREY, (0.0, 0.7 * SPAN_M, -0.05), (0.4, 0.0, 0.0))
    return Robot("coupler", (Link("coupler", 0.8, (bar, load)),), ())


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[ClosedLoopMachine]:
    with PhysicsClient(500.0) as client:
        yield build(client, tmp_path)


def build(client: PhysicsClient, folder: Path, **replaced: Any) -> ClosedLoopMachine:
    bodies = []
    for name, robot, y in (("leg1", crank(1), 0.0), ("leg2", crank(2), SPAN_M), ("coupler", coupler(), 0.0)):
        path = folder / f"{name}.urdf"
        path.write_text(robot.to_xml())
        bodies.append(Body(name, path, (0.0, y, 1.0), fixed_base=name != "coupler"))
    arguments: dict[str, Any] = {
        "closures": [
            Closure("crank1", (0.0, CRANK_M, 0.0), "coupler", (0.0, 0.0, 0.0)),
            Closure("crank2", (0.0, CRANK_M, 0.0), "coupler", (0.0, SPAN_M, 0.0)),
        ],
        "motors": [Motor("turn1", 20.0), Motor("turn2", 20.0)],
    }
    return ClosedLoopMachine(client, bodies, **(arguments | replaced))


def tip(angle: float) -> np.ndarray:
    return np.array([0.0, CRANK_M * np.cos(angle), 1.0 + CRANK_M * np.sin(angle)])


def put(machine: ClosedLoopMachine, angle: float) -> None:
    machine.reset([angle, angle], {"coupler": (coupler_centre(angle), coupler_turn(machine))})


def coupler_turn(machine: ClosedLoopMachine) -> tuple[float, ...]:
    info = pybullet.getDynamicsInfo(machine.body_ids["coupler"], -1, physicsClientId=machine.client.id)
    return info[4]


def coupler_centre(angle: float) -> np.ndarray:
    return tip(angle) + coupler().links[0].inertia().centre_m


def test_joints_of_all_bodies_are_addressed_in_one_order(machine: ClosedLoopMachine) -> None:
    assert machine.joints == ("turn1", "turn2")
    put(machine, -0.7)
    np.testing.assert_allclose(machine.joint_positions(), [-0.7, -0.7])


def test_a_reset_from_the_analytic_pose_closes_the_loop(machine: ClosedLoopMachine) -> None:
    put(machine, -1.1)
    assert machine.closure_error_m() < 1e-6
    np.testing.assert_allclose(machine.point("coupler"), tip(-1.1), atol=1e-6)


def test_an_open_loop_is_measured(machine: ClosedLoopMachine) -> None:
    put(machine, -1.1)
    machine.reset([-1.1, -1.0])
    assert machine.closure_error_m() == pytest.approx(2 * CRANK_M * np.sin(0.05), rel=1e-4)


def test_the_loop_stays_closed_and_the_coupler_follows(machine: ClosedLoopMachine) -> None:
    angles = -0.9 - 0.5 * np.sin(np.linspace(0.0, np.pi, 400)) ** 2
    put(machine, angles[0])
    gaps, errors = [], []

    def look(row: int) -> None:
        gaps.append(machine.closure_error_m())
        errors.append(np.linalg.norm(machine.point("coupler") - tip(angles[row])))

    machine.follow(np.stack([angles, angles], axis=-1), look)
    assert len(gaps) == 399
    assert max(gaps) < 0.3e-3
    assert max(errors) < 0.3e-3


def test_the_motors_carry_the_weight(machine: ClosedLoopMachine) -> None:
    put(machine, 0.0)
    machine.follow(np.zeros((200, 2)))
    efforts = machine.motor_efforts()
    # Both cranks lie level: their own weight acts half-way, the coupler's at the tips, whoever carries how much.
    expected = 9.81 * (2 * 0.4 * 0.5 * CRANK_M + 0.8 * CRANK_M)
    assert np.sum(efforts) == pytest.approx(expected, rel=1e-2)
    assert not machine.saturated(efforts).any()
    assert machine.saturated([20.0, 1.0]).tolist() == [True, False]


def test_free_joints_do_not_brake(tmp_path: Path) -> None:
    with PhysicsClient(500.0, gravity_m_s2=0.0) as client:
        machine = build(client, tmp_path, closures=[], motors=[])
        body = machine.body_ids["leg1"]
        pybullet.resetJointState(body, 0, 0.0, 2.0, physicsClientId=client.id)
        for _ in range(500):
            client.step()
        assert pybullet.getJointState(body, 0, physicsClientId=client.id)[1] == pytest.approx(2.0, rel=1e-6)


def test_hold_keeps_the_pose(machine: ClosedLoopMachine) -> None:
    put(machine, -0.8)
    machine.hold([-0.8, -0.8])
    for _ in range(100):
        machine.client.step()
    np.testing.assert_allclose(machine.point("coupler"), tip(-0.8), atol=0.3e-3)


@pytest.mark.parametrize(
    ("replaced", "word"),
    [
        ({"motors": [Motor("turn3", 1.0)]}, "no joint 'turn3'"),
        ({"closures": [Closure("crank9", (0.0, 0.0, 0.0), "coupler", (0.0, 0.0, 0.0))]}, "no link 'crank9'"),
    ],
)
def test_unknown_names_are_named(tmp_path: Path, replaced: dict, word: str) -> None:
    with PhysicsClient() as client, pytest.raises(ValueError, match=word):
        build(client, tmp_path, **replaced)


@pytest.mark.parametrize("limit", [0.0, -1.0, float("nan"), float("inf")])
def test_motors_have_a_positive_limit(limit: float) -> None:
    with pytest.raises(ValueError, match="'turn1'"):
        Motor("turn1", limit)


def test_names_must_be_unique_across_bodies(tmp_path: Path) -> None:
    path = tmp_path / "leg.urdf"
    path.write_text(crank(1).to_xml())
    with PhysicsClient() as client, pytest.raises(ValueError, match="'ground1'"):
        ClosedLoopMachine(client, [Body("a", path), Body("b", path)], [], [])


def test_bad_targets_are_refused(machine: ClosedLoopMachine) -> None:
    with pytest.raises(ValueError, match="positions"):
        machine.reset([0.0])
    with pytest.raises(ValueError, match="positions"):
        machine.reset([0.0, float("nan")])
    with pytest.raises(ValueError, match="shape"):
        machine.follow(np.zeros((5, 3)))
    with pytest.raises(ValueError, match="row 1"):
        machine.follow([[0.0, 0.0], [0.0, float("nan")]])
    with pytest.raises(ValueError, match="no body"):
        machine.reset([0.0, 0.0], {"nothing": ((0, 0, 0), (0, 0, 0, 1))})


def test_removing_leaves_an_empty_world(machine: ClosedLoopMachine) -> None:
    machine.remove()
    assert pybullet.getNumBodies(physicsClientId=machine.client.id) == 0
    assert pybullet.getNumConstraints(physicsClientId=machine.client.id) == 0
