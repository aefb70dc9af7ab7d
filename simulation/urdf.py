"""Small typed builders of URDF text, with inertias worked out from shapes and masses."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Literal
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
JointKind = Literal["fixed", "continuous", "prismatic"]

_ORIGIN: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Colour:
    """A named RGBA colour, every channel in [0, 1]."""

    name: str
    red: float
    green: float
    blue: float
    alpha: float = 1.0


ALUMINIUM = Colour("aluminium", 0.74, 0.76, 0.79)
BLACK = Colour("black", 0.10, 0.10, 0.11)
RUBBER = Colour("rubber", 0.07, 0.07, 0.07)
STEEL = Colour("steel", 0.52, 0.54, 0.57)
WHITE = Colour("white", 0.92, 0.92, 0.90)

ALONG_X: Vector = (0.0, np.pi / 2, 0.0)
"""Turn of a part that is made along z; ``ALONG_Y`` alike."""
ALONG_Y: Vector = (-np.pi / 2, 0.0, 0.0)


@dataclass(frozen=True)
class Box:
    """A cuboid of edges ``size_m`` along x, y, z."""

    size_m: Vector

    @property
    def volume_m3(self) -> float:
        """Volume."""
        return self.size_m[0] * self.size_m[1] * self.size_m[2]

    def unit_inertia(self) -> Array:
        """Principal moments (3,) about the centre for a mass of 1 kg, m2."""
        square = np.square(self.size_m)
        return (np.sum(square) - square) / 12.0

    def element(self) -> ElementTree.Element:
        """The URDF geometry."""
        return ElementTree.Element("box", size=_numbers(self.size_m))


@dataclass(frozen=True)
class Cylinder:
    """A solid cylinder about z."""

    radius_m: float
    length_m: float

    @property
    def volume_m3(self) -> float:
        """Volume."""
        return float(np.pi * self.radius_m**2 * self.length_m)

    def unit_inertia(self) -> Array:
        """Principal moments (3,) about the centre for a mass of 1 kg, m2."""
        across = self.radius_m**2 / 4.0 + self.length_m**2 / 12.0
        return np.array([across, across, self.radius_m**2 / 2.0])

    def element(self) -> ElementTree.Element:
        """The URDF geometry."""
        return ElementTree.Element("cylinder", radius=_number(self.radius_m), length=_number(self.length_m))


@dataclass(frozen=True)
class Sphere:
    """A solid ball."""

    radius_m: float

    @property
    def volume_m3(self) -> float:
        """Volume."""
        return float(4.0 / 3.0 * np.pi * self.radius_m**3)

    def unit_inertia(self) -> Array:
        """Principal moments (3,) about the centre for a mass of 1 kg, m2."""
        return np.full(3, 0.4 * self.radius_m**2)

    def element(self) -> ElementTree.Element:
        """The URDF geometry."""
        return ElementTree.Element("sphere", radius=_number(self.radius_m))


Shape = Box | Cylinder | Sphere


@dataclass(frozen=True)
class Part:
    """A coloured shape fixed in a link's frame.

    Attributes:
        shape: the solid.
        colour: what it is painted with.
        xyz_m: its centre in the link frame.
        rpy_rad: its fixed-axis roll, pitch and yaw in the link frame.
        visible: whether it is drawn; matter that stands for something else is not.
    """

    shape: Shape
    colour: Colour
    xyz_m: Vector = _ORIGIN
    rpy_rad: Vector = _ORIGIN
    visible: bool = True


@dataclass(frozen=True)
class Inertia:
    """Mass properties in a link frame.

    Attributes:
        mass_kg: mass.
        centre_m: centre of mass, (3,).
        tensor_kg_m2: inertia tensor about the centre of mass along the link's axes, (3, 3).
    """

    mass_kg: float
    centre_m: Array
    tensor_kg_m2: Array


@dataclass(frozen=True)
class Link:
    """A rigid body whose mass is spread over its parts by volume.

    There is no collision geometry: a machine's own client holds nothing it could touch, and contact pairs cost time.

    Attributes:
        name: unique in the machine.
        mass_kg: total mass, > 0.
        parts: the solids that it is made of, at least one.
        rotor_inertia_kg_m2: added to the moments about the link's x, y, z: a motor's rotor seen through its gear.
    """

    name: str
    mass_kg: float
    parts: tuple[Part, ...]
    rotor_inertia_kg_m2: Vector = _ORIGIN

    def __post_init__(self) -> None:
        """Check the mass and the parts."""
        if not 0.0 < self.mass_kg < np.inf:
            raise ValueError(f"link {self.name!r}: mass_kg = {self.mass_kg} must be positive and finite")
        if not self.parts:
            raise ValueError(f"link {self.name!r} has no parts: give at least one, its inertia comes from them")
        moments = np.linalg.eigvalsh(self.inertia().tensor_kg_m2)
        if not moments[0] > 0.0 or moments[2] > (1.0 + 1e-9) * (moments[0] + moments[1]):
            # PyBullet answers such a tensor with a warning and an inertia of zero.
            raise ValueError(
                f"link {self.name!r}: principal moments {moments} kg m2 belong to no body (each must be positive and "
                "at most the sum of the others); give rotor_inertia_kg_m2 about all three axes"
            )

    def inertia(self) -> Inertia:
        """Mass properties of the parts at one density, plus the rotor; overlapping parts count twice."""
        volumes = np.array([part.shape.volume_m3 for part in self.parts])
        masses = self.mass_kg * volumes / np.sum(volumes)
        centres = np.array([part.xyz_m for part in self.parts])
        centre = masses @ centres / self.mass_kg
        tensor = np.diag(self.rotor_inertia_kg_m2)
        for part, mass, offset in zip(self.parts, masses, centres - centre, strict=True):
            turn = rotation_matrix(part.rpy_rad)
            tensor += mass * (turn * part.shape.unit_inertia()) @ turn.T
            tensor += mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
        return Inertia(self.mass_kg, centre, tensor)


@dataclass(frozen=True)
class Joint:
    """A connection of two links.

    Attributes:
        name: unique in the machine.
        kind: ``continuous`` and ``prismatic`` joints have no end stops: limits are checked by the kinematics.
        parent: name of the link that is nearer to the base.
        child: name of the link that it carries.
        xyz_m: the child frame's origin in the parent frame at joint position zero.
        rpy_rad: the child frame's fixed-axis roll, pitch and yaw at joint position zero.
        axis: unit axis in the child frame; ignored by fixed joints.
    """

    name: str
    kind: JointKind
    parent: str
    child: str
    xyz_m: Vector = _ORIGIN
    rpy_rad: Vector = _ORIGIN
    axis: Vector = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Robot:
    """A tree of links.

    Attributes:
        name: of the URDF.
        links: the base first.
        joints: one for every link but the base.
    """

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]

    def __post_init__(self) -> None:
        """Check that the joints make one tree."""
        names = [link.name for link in self.links]
        for kind, used in (("link", names), ("joint", [joint.name for joint in self.joints])):
            twice = [name for name, count in Counter(used).items() if count > 1]
            if twice:
                raise ValueError(f"robot {self.name!r}: {kind} name {twice[0]!r} is used more than once")
        known = set(names[:1])
        for joint in self.joints:
            if joint.parent not in known or joint.child in known or joint.child not in names:
                raise ValueError(
                    f"robot {self.name!r}: joint {joint.name!r} ({joint.parent!r} -> {joint.child!r}) must lead from "
                    "a link that is already connected to the base to one that is not; list joints from the base out"
                )
            known.add(joint.child)
        if len(known) != len(names):
            raise ValueError(f"robot {self.name!r}: not connected to the base: {sorted(set(names) - known)}")

    def to_xml(self) -> str:
        """The URDF text; equal robots give equal text."""
        root = ElementTree.Element("robot", name=self.name)
        for link in self.links:
            root.append(_link_element(link))
        for joint in self.joints:
            root.append(_joint_element(joint))
        ElementTree.indent(root)
        return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def rotation_matrix(rpy_rad: ArrayLike) -> Array:
    """Rotation (3, 3) of URDF's fixed-axis roll, pitch, yaw (3,): R = Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy_rad), np.sin(rpy_rad)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _number(value: float) -> str:
    # Seven digits keep the text equal on machines whose last floating-point digits differ; below 1e-12 is rounding.
    return f"{0.0 if abs(value) < 1e-12 else value:.7g}"


def _numbers(values: ArrayLike) -> str:
    return " ".join(_number(float(value)) for value in np.asarray(values, dtype=np.float64))


def _origin(xyz_m: ArrayLike, rpy_rad: ArrayLike = _ORIGIN) -> ElementTree.Element:
    return ElementTree.Element("origin", xyz=_numbers(xyz_m), rpy=_numbers(rpy_rad))


def _link_element(link: Link) -> ElementTree.Element:
    element = ElementTree.Element("link", name=link.name)
    inertia = link.inertia()
    inertial = ElementTree.SubElement(element, "inertial")
    inertial.append(_origin(inertia.centre_m))
    ElementTree.SubElement(inertial, "mass", value=_number(inertia.mass_kg))
    moments = {
        f"i{'xyz'[row]}{'xyz'[column]}": _number(float(inertia.tensor_kg_m2[row, column]))
        for row in range(3)
        for column in range(row, 3)
    }
    ElementTree.SubElement(inertial, "inertia", moments)
    for part in (part for part in link.parts if part.visible):
        visual = ElementTree.SubElement(element, "visual")
        visual.append(_origin(part.xyz_m, part.rpy_rad))
        ElementTree.SubElement(visual, "geometry").append(part.shape.element())
        material = ElementTree.SubElement(visual, "material", name=part.colour.name)
        colour = (part.colour.red, part.colour.green, part.colour.blue, part.colour.alpha)
        ElementTree.SubElement(material, "color", rgba=_numbers(colour))
    return element


def _joint_element(joint: Joint) -> ElementTree.Element:
    element = ElementTree.Element("joint", name=joint.name, type=joint.kind)
    element.append(_origin(joint.xyz_m, joint.rpy_rad))
    ElementTree.SubElement(element, "parent", link=joint.parent)
    ElementTree.SubElement(element, "child", link=joint.child)
    if joint.kind != "fixed":
        ElementTree.SubElement(element, "axis", xyz=_numbers(joint.axis))
    if joint.kind == "prismatic":
        # The format demands limits; lower > upper is how PyBullet is told that there are none.
        ElementTree.SubElement(element, "limit", lower="1", upper="-1", effort="0", velocity="0")
    return element
