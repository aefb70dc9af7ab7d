"""Plants that differ: seedlings and crop plants of single leaves, each plant grown from the one number of its looks.

Lengths [assumed] are about those that floras print of seedlings, cotyledons of 5-15 mm and first leaves of 10-30 mm,
with a spread from plant to plant; colours [assumed] are spread about the hues of leaves in daylight.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels.elementary import exp
from ...rendering.instances import about_z
from ...rendering.library import MeshLibrary
from ...rendering.shapes import Mesh, flat_shaded
from ..core import Array

VARIANTS = 4
"""Meshes of each leaf shape: how it curls, bends aside, and what was eaten of it."""
_GOLDEN = 2.399
_ALONG = 8
"""Pieces of a leaf along its vein."""
_WITHERED = (0.46, 0.44, 0.20)
"""Old leaves turn towards this."""


class Leaf(NamedTuple):
    """A shape of leaf, one long and one wide.

    Attributes:
        broadest: where along it it is broadest.
        blunt: exponent of its outline; small is blunt.
        teeth: notches of its edge, 0 for a smooth one.
        cut: share of its half width that a notch takes.
        stalk: share of its length that is stalk.
        fold: rise of its edges over its vein, in half widths.
    """

    broadest: float = 0.5
    blunt: float = 0.7
    teeth: int = 0
    cut: float = 0.0
    stalk: float = 0.0
    fold: float = 0.15


class Growth(NamedTuple):
    """A kind of plant.

    Attributes:
        name: of the species, Latin.
        share: of the plants of its species index.
        seed_leaf: shape of its cotyledons; none for a grass.
        leaf: shape of the leaves that follow.
        seed_leaf_m: length and width of a cotyledon.
        leaf_m: length and width of the leaves, by stage.
        leaves: fewest and most, by stage, cotyledons apart.
        turn_rad: from leaf to leaf.
        rise: height of a leaf's arch in parts of its length, fewest and most.
        colour: red, green, blue of a leaf.
    """

    name: str
    share: float
    seed_leaf: str
    leaf: str
    seed_leaf_m: tuple[float, float]
    leaf_m: tuple[tuple[float, float], ...]
    leaves: tuple[tuple[int, int], ...]
    turn_rad: float
    rise: tuple[float, float]
    colour: tuple[float, float, float]


LEAVES = {
    "oval": Leaf(),
    "strap": Leaf(0.5, 0.45),
    "rhomb": Leaf(0.42, 1.0, 3, 0.25, 0.15),
    "pointed": Leaf(0.38, 0.8, 0, 0.0, 0.25),
    "lance": Leaf(0.6, 0.9, 0, 0.0, 0.05),
    "arrow": Leaf(0.25, 0.75, 1, 0.1, 0.2),
    "feather": Leaf(0.5, 0.6, 6, 0.75, 0.1, 0.05),
    "round": Leaf(0.45, 0.5, 4, 0.2, 0.15),
    "blade": Leaf(0.08, 0.35, 0, 0.0, 0.0, 0.35),
    "beet": Leaf(0.55, 0.65, 4, 0.08, 0.25, 0.2),
    "maize": Leaf(0.3, 0.5, 0, 0.0, 0.0, 0.3),
}

BROADLEAVES = (
    Growth("Chenopodium album", 0.26, "strap", "rhomb", (0.009, 0.0032), ((0.0, 0.0), (0.016, 0.010), (0.027, 0.016)),
           ((0, 0), (2, 2), (3, 5)), 0.5 * np.pi, (0.15, 0.40), (0.37, 0.50, 0.31)),
    Growth("Stellaria media", 0.18, "pointed", "pointed", (0.008, 0.0035), ((0.0, 0.0), (0.013, 0.008), (0.020, 0.011)),
           ((0, 0), (2, 3), (4, 6)), 0.5 * np.pi, (0.10, 0.35), (0.34, 0.51, 0.22)),
    Growth("Galium aparine", 0.14, "oval", "lance", (0.012, 0.0075), ((0.0, 0.0), (0.012, 0.004), (0.018, 0.005)),
           ((0, 0), (3, 4), (5, 8)), 0.5 * np.pi, (0.10, 0.30), (0.31, 0.47, 0.21)),
    Growth("Fallopia convolvulus", 0.16, "lance", "arrow", (0.014, 0.0042), ((0.0, 0.0), (0.019, 0.012), (0.03, 0.018)),
           ((0, 0), (1, 2), (3, 4)), _GOLDEN, (0.15, 0.35), (0.34, 0.46, 0.23)),
    Growth("Matricaria inodora", 0.14, "oval", "feather", (0.005, 0.002), ((0.0, 0.0), (0.016, 0.009), (0.026, 0.013)),
           ((0, 0), (2, 3), (4, 6)), _GOLDEN, (0.05, 0.25), (0.36, 0.51, 0.24)),
    Growth("Veronica persica", 0.12, "oval", "round", (0.008, 0.0050), ((0.0, 0.0), (0.012, 0.011), (0.018, 0.016)),
           ((0, 0), (2, 2), (3, 4)), 0.5 * np.pi, (0.10, 0.30), (0.30, 0.46, 0.21)),
)  # fmt: skip
GRASSES = (
    Growth("Alopecurus myosuroides", 0.40, "", "blade", (0.0, 0.0), ((0.024, 0.0022), (0.038, 0.0028), (0.056, 0.0036)),
           ((1, 1), (2, 2), (3, 5)), 0.9 * np.pi, (0.45, 0.85), (0.38, 0.53, 0.28)),
    Growth("Echinochloa crus-galli", 0.35, "", "blade", (0.0, 0.0), ((0.022, 0.0034), (0.036, 0.0048), (0.056, 0.0062)),
           ((1, 1), (2, 2), (3, 5)), 0.9 * np.pi, (0.35, 0.75), (0.40, 0.54, 0.26)),
    Growth("Poa annua", 0.25, "", "blade", (0.0, 0.0), ((0.017, 0.0018), (0.026, 0.0022), (0.036, 0.0026)),
           ((1, 1), (2, 3), (4, 7)), 0.8 * np.pi, (0.30, 0.70), (0.36, 0.54, 0.26)),
)  # fmt: skip
CROPS = {
    "beet": Growth("Beta vulgaris", 1.0, "strap", "beet", (0.022, 0.008), ((0.055, 0.029),), ((4, 8),), _GOLDEN,
                   (0.35, 0.75), (0.27, 0.43, 0.22)),
    "maize": Growth("Zea mays", 1.0, "", "maize", (0.0, 0.0), ((0.090, 0.016),), ((3, 5),), 0.95 * np.pi,
                    (0.60, 1.00), (0.33, 0.49, 0.22)),
}  # fmt: skip

_SIZE, _LEAF_SIZE, _COLOUR, _LEAF_COLOUR = 0.18, 0.12, 0.09, 0.05
"""Spread, as logarithms, of a plant's size, of its leaves' about it, of its colours, of its leaves' about them."""
_OLD = 0.06
"""Share of the leaves that wither."""


class Foliage(NamedTuple):
    """Leaves of plants, k of them, before their plants are put in place.

    Attributes:
        plant: (k,), index of the plant.
        mesh: (k,), number in the library.
        turn: (k, 3, 3), with the leaf's length, width and height as scales.
        shift: (k, 3), metres from the plant's place.
        colour: (k, 3), in [0, 1].
    """

    plant: NDArray[np.int64]
    mesh: NDArray[np.int64]
    turn: Array
    shift: Array
    colour: Array


def together(one: Foliage, other: Foliage) -> Foliage:
    """The leaves of both."""
    return Foliage(
        np.concatenate([one.plant, other.plant]),
        np.concatenate([one.mesh, other.mesh]),
        np.concatenate([one.turn, other.turn]),
        np.concatenate([one.shift, other.shift]),
        np.concatenate([one.colour, other.colour]),
    )


def leaf_mesh(leaf: Leaf, variant: int) -> Mesh:
    """A leaf along +x, one long, one wide, arched by one: how it curls, bends aside and is eaten is the variant's."""
    rng = np.random.default_rng(977 + 31 * variant)
    t = np.linspace(0.0, 1.0, _ALONG * max(1, leaf.teeth // 2) + 1)
    power = np.log(0.5) / np.log(leaf.broadest)
    half = 0.5 * np.sin(np.pi * np.clip(t, 1e-3, 1.0 - 1e-3) ** power) ** leaf.blunt
    if leaf.teeth:
        half *= 1.0 - leaf.cut * (0.5 - 0.5 * np.cos(2.0 * np.pi * leaf.teeth * t))
    half = np.where(t < leaf.stalk, 0.06, half)
    half[-1] = 0.01
    curl, aside = rng.uniform(0.7, 1.6), rng.uniform(-0.12, 0.12) * (variant > 0)
    left, right = half.copy(), half.copy()
    if variant == VARIANTS - 1 and leaf.teeth:
        # Something has eaten of one edge.
        bite = np.abs(t - rng.uniform(0.45, 0.75)) < 0.12
        left[bite] *= 0.25
    rise = t - curl * t**2
    vein = np.stack([t, aside * t**2, rise], axis=-1)
    zero = np.zeros_like(t)
    up = np.stack([vein + np.stack([zero, side, leaf.fold * np.abs(side)], -1) for side in (left, -right)])
    i, n = np.arange(len(t) - 1), len(t)
    vertices = np.concatenate([vein, up[0], up[1]])
    faces = np.concatenate(
        [
            np.stack([i, i + 1, n + i + 1], -1),
            np.stack([i, n + i + 1, n + i], -1),
            np.stack([i, 2 * n + i + 1, i + 1], -1),
            np.stack([i, 2 * n + i, 2 * n + i + 1], -1),
        ]
    )
    return flat_shaded(vertices, faces, two_sided=True)


class Nursery:
    """Grows plants out of the leaves of a library."""

    def __init__(self, library: MeshLibrary, crop: str):
        """Add the meshes of all leaves."""
        shapes = ("beet", "maize") if not crop else tuple(LEAVES)
        self._mesh = {
            name: [library.add(leaf_mesh(LEAVES[name], variant)) for variant in range(VARIANTS)] for name in shapes
        }
        self._crop = CROPS[crop]

    def weeds(self, species: NDArray[np.int64], stage: NDArray[np.int64], look: Array) -> Foliage:
        """Weeds (n,) from the uniform numbers of their looks."""
        parts = []
        for plant, (kind, old, lot) in enumerate(zip(species.tolist(), stage.tolist(), look.tolist(), strict=True)):
            rng = np.random.default_rng(int(lot * 2.0**53))
            grown = BROADLEAVES if kind == 0 else GRASSES
            share = np.cumsum([growth.share for growth in grown])
            growth = grown[int(np.searchsorted(share, rng.random() * share[-1]))]
            parts.append(self._plant(plant, growth, old, rng))
        return _joined(parts)

    def crops(self, look: Array) -> Foliage:
        """Crop plants (n,) from the uniform numbers of their looks."""
        rngs = [np.random.default_rng(int(lot * 2.0**53)) for lot in look.tolist()]
        return _joined([self._plant(plant, self._crop, 0, rng) for plant, rng in enumerate(rngs)])

    def _plant(self, plant: int, growth: Growth, stage: int, rng: np.random.Generator) -> Foliage:
        size, tone = exp(_SIZE * rng.standard_normal()), exp(_COLOUR * rng.standard_normal(3))
        fewest, most = growth.leaves[stage]
        later, start = int(rng.integers(fewest, most + 1)), rng.uniform(0.0, 2.0 * np.pi)
        seed_leaves = 2 if growth.seed_leaf else 0
        n = seed_leaves + later
        order = np.arange(n)
        is_seed = order < seed_leaves
        age = np.where(is_seed, 0.0, (order - seed_leaves) / max(later, 1))
        long_m, wide_m = growth.leaf_m[stage]
        # Younger leaves, further in, are shorter and stand more upright.
        length = np.where(is_seed, growth.seed_leaf_m[0], long_m * (1.0 - 0.45 * age * (later > 2)))
        width = np.where(is_seed, growth.seed_leaf_m[1], wide_m * (1.0 - 0.35 * age * (later > 2)))
        length *= size * exp(_LEAF_SIZE * rng.standard_normal(n))
        width *= size * exp(_LEAF_SIZE * rng.standard_normal(n))
        around = np.where(
            is_seed, np.pi * order, 0.5 * np.pi * (seed_leaves > 0) + growth.turn_rad * (order - seed_leaves)
        )
        # Opposite leaves come in pairs that stand across each other.
        if seed_leaves and abs(growth.turn_rad - 0.5 * np.pi) < 1e-9:
            pair, side = np.divmod(order - seed_leaves, 2)
            around = np.where(is_seed, around, 0.5 * np.pi * (pair + 1) + np.pi * side)
        around = start + around + 0.14 * rng.standard_normal(n)
        low, high = growth.rise
        rise = length * (low + (high - low) * np.clip(age + 0.25 * rng.standard_normal(n), 0.0, 1.0))
        rise = np.where(is_seed, 0.25 * length, rise)
        height = np.where(is_seed, 0.004, 0.005 + 0.006 * np.clip(age, 0.0, 1.0)) * size
        turn = about_z(around) * np.stack([length, width, rise], axis=-1)[:, None, :]
        colour = np.array(growth.colour) * tone * exp(_LEAF_COLOUR * rng.standard_normal((n, 3)))
        withered = (rng.random(n) < _OLD)[:, None] * rng.uniform(0.3, 0.8, (n, 1))
        colour = np.clip((1.0 - withered) * colour + withered * np.array(_WITHERED), 0.0, 1.0)
        meshes = [self._mesh[growth.seed_leaf if seed else growth.leaf] for seed in is_seed.tolist()]
        mesh = np.array([m[v] for m, v in zip(meshes, rng.integers(0, VARIANTS, n).tolist(), strict=True)], np.int64)
        shift = np.column_stack([np.zeros((n, 2)), height])
        return Foliage(np.full(n, plant), mesh, turn, shift, colour)


def _joined(parts: list[Foliage]) -> Foliage:
    if not parts:
        none = np.zeros(0, np.int64)
        return Foliage(none, none, np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros((0, 3)))
    return Foliage(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
