"""URDF builders: inertias obey the laws of mechanics and PyBullet reads the same machine back."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldgym.simulation.client import PhysicsClient, pybullet
from fieldgym.simulation.urdf import Box, Colour, Cylinder, Joint, Link, Part, Robot, Sphere, rotation_matrix

GREY = Colour("grey", 0.5, 0.5, 0.5)
lengths = st.floats(0.01, 2.0)
angles = st.floats(-3.0, 3.0)


def link(*parts: Part, mass: float = 2.0, name: str = "link") -> Link:
    return Link(name, mass, parts)


@given(lengths, lengths, lengths, st.floats(0.1, 0.9))
def test_a_box_cut_in_two_has_the_inertia_of_the_whole(x: float, y: float, z: float, cut: float) -> None:
    whole = link(Part(Box((x, y, z)), GREY)).inertia()
    left = Part(Box((cut * x, y, z)), GREY, (-0.5 * x + 0.5 * cut * x, 0.0, 0.0))
    right = Part(Box(((1 - cut) * x, y, z)), GREY, (0.5 * x - 0.5 * (1 - cut) * x, 0.0, 0.0))
    halves = link(left, right).inertia()
    np.testing.assert_allclose(halves.centre_m, whole.centre_m, atol=1e-12)
    np.testing.assert_allclose(halves.tensor_kg_m2, whole.tensor_kg_m2, rtol=1e-9, atol=1e-12)


@given(angles, angles, angles)
def test_a_turned_part_turns_the_tensor(roll: float, pitch: float, yaw: float) -> None:
    shape = Cylinder(0.1, 0.7)
    turned = link(Part(shape, GREY, (0.3, -0.2, 0.5), (roll, pitch, yaw))).inertia()
    turn = rotation_matrix((roll, pitch, yaw))
    np.testing.assert_allclose(turned.tensor_kg_m2, 2.0 * turn @ np.diag(shape.unit_inertia()) @ turn.T, atol=1e-12)
    np.testing.assert_allclose(turned.centre_m, (0.3, -0.2, 0.5), atol=1e-12)


@pytest.mark.parametrize("shape", [Box((0.2, 0.5, 0.9)), Cylinder(0.2, 0.7), Sphere(0.4)])
def test_shapes_match_their_integrals(shape: Box | Cylinder | Sphere) -> None:
    cells = 121
    axis = (np.arange(cells) + 0.5) / cells - 0.5
    x, y, z = (extent.ravel() for extent in np.meshgrid(axis, axis, axis, indexing="ij"))
    match shape:
        case Box(size_m):
            points = np.stack([x, y, z]) * np.array(size_m)[:, None]
            volume = np.prod(size_m)
        case Cylinder(radius, length):
            points = np.stack([2 * radius * x, 2 * radius * y, length * z])[:, np.hypot(x, y) <= 0.5]
            volume = 4 * radius**2 * length
        case Sphere(radius):
            points = 2 * radius * np.stack([x, y, z])[:, x * x + y * y + z * z <= 0.25]
            volume = 8 * radius**3
    square = np.mean(points**2, axis=1)
    np.testing.assert_allclose(shape.unit_inertia(), np.sum(square) - square, rtol=2e-3)
    assert shape.volume_m3 == pytest.approx(volume * points.shape[1] / cells**3, rel=2e-3)


def test_pybullet_reads_the_masses_and_inertias(tmp_path: Path) -> None:
    base = link(Part(Box((0.1, 0.2, 0.3)), GREY), name="base")
    lopsided = link(
        Part(Box((0.1, 0.4, 0.05)), GREY, (0.1, 0.2, 0.0), (0.3, 0.2, 0.1)),
        Part(Sphere(0.1), GREY, (0.0, 0.4, 0.1)),
        mass=1.7,
        name="lopsided",
    )
    robot = Robot("test", (base, lopsided), (Joint("slide", "prismatic", "base", "lopsided", (0.0, 0.0, 0.3)),))
    path = tmp_path / "test.urdf"
    path.write_text(robot.to_xml())
    with PhysicsClient() as client:
        flags = pybullet.URDF_USE_INERTIA_FROM_FILE
        body = pybullet.loadURDF(str(path), useFixedBase=True, flags=flags, physicsClientId=client.id)
        info = pybullet.getDynamicsInfo(body, 0, physicsClientId=client.id)
    inertia = lopsided.inertia()
    assert info[0] == pytest.approx(1.7)
    np.testing.assert_allclose(info[3], inertia.centre_m, atol=1e-6)
    np.testing.assert_allclose(sorted(info[2]), np.linalg.eigvalsh(inertia.tensor_kg_m2), rtol=1e-5)


def test_invisible_matter_weighs_but_is_not_drawn() -> None:
    hidden = link(Part(Sphere(0.1), GREY, visible=False), name="hidden")
    text = Robot("test", (hidden,), ()).to_xml()
    assert '<mass value="2"' in text
    assert "<visual>" not in text


def test_a_rotor_adds_its_inertia() -> None:
    plain = link(Part(Box((0.1, 0.2, 0.3)), GREY)).inertia().tensor_kg_m2
    geared = Link("link", 2.0, (Part(Box((0.1, 0.2, 0.3)), GREY),), (0.5, 0.6, 0.7)).inertia().tensor_kg_m2
    np.testing.assert_allclose(geared - plain, np.diag([0.5, 0.6, 0.7]), atol=1e-12)


def test_an_impossible_inertia_is_refused_where_pybullet_would_zero_it() -> None:
    with pytest.raises(ValueError, match="all three axes"):
        Link("arm", 0.1, (Part(Box((0.1, 0.2, 0.1)), GREY),), (1.0, 0.0, 0.0))


@pytest.mark.parametrize("mass", [0.0, -1.0, float("nan"), float("inf")])
def test_masses_must_be_positive(mass: float) -> None:
    with pytest.raises(ValueError, match="mass_kg"):
        link(Part(Sphere(0.1), GREY), mass=mass)


def test_a_link_needs_parts() -> None:
    with pytest.raises(ValueError, match="no parts"):
        Link("empty", 1.0, ())


@pytest.mark.parametrize(
    ("links", "joints", "word"),
    [
        (("a", "a"), (), "more than once"),
        (("a", "b"), (), "not connected"),
        (("a", "b", "c"), (("b", "c"), ("a", "b")), "from the base out"),
        (("a", "b"), (("a", "b"), ("a", "b")), "from a link"),
        (("a", "b"), (("a", "elsewhere"),), "from a link"),
    ],
)
def test_what_is_not_one_tree_is_refused(links: tuple, joints: tuple, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        Robot(
            "test",
            tuple(link(Part(Sphere(0.1), GREY), name=name) for name in links),
            tuple(Joint(f"j{number}", "fixed", *pair) for number, pair in enumerate(joints)),
        )
