"""Regions on lattices: connected parts, enclosed voids, and boundaries traced with their holes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .batching import Array

_BISECTIONS = 30


def bisected(holds: Callable[[Array], np.ndarray], inner: Array, outer: Array, times: int) -> Array:
    """The last places, as ``inner``, where something still holds on the way to ``outer``, where it does not.

    Args:
        holds: maps places to booleans (n,).
        inner: where it holds, (n,) or (n, k).
        outer: where it does not.
        times: how often the stretch between them is halved.
    """
    for _ in range(times):
        middle = 0.5 * (inner + outer)
        good = holds(middle).reshape(-1, *[1] * (middle.ndim - 1))
        inner, outer = np.where(good, middle, inner), np.where(good, outer, middle)
    return inner


def label_regions(mask: np.ndarray, wrap: tuple[int, ...] = ()) -> np.ndarray:
    """Number the connected parts of a boolean lattice of any dimension (neighbours share a face).

    Args:
        mask: lattice of booleans.
        wrap: axes whose last cells touch the first ones.

    Returns:
        Integers of the same shape: 0 where ``mask`` is false, parts numbered 1, 2, ... in the order of their first
        cells.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    cells = np.arange(mask.size).reshape(mask.shape)
    edges = []
    for axis in range(mask.ndim):
        count = mask.shape[axis] - (0 if axis in wrap else 1)
        first = np.take(cells, np.arange(count), axis)
        second = np.take(cells, np.arange(1, count + 1), axis, mode="wrap")
        both = mask.reshape(-1)[first] & mask.reshape(-1)[second]
        edges.append(np.stack([first[both], second[both]]))
    left, right = np.concatenate(edges, axis=1)
    graph = coo_array((np.ones(len(left), bool), (left, right)), shape=(mask.size, mask.size))
    _, part = connected_components(graph, directed=False)
    labels = np.zeros(mask.shape, dtype=int)
    labels[mask] = np.unique(part.reshape(mask.shape)[mask], return_inverse=True)[1].reshape(-1) + 1
    return labels


def enclosed_voids(mask: np.ndarray) -> np.ndarray:
    """Cells in each void of a lattice that has no way out to its rim, largest first; empty if there is none.

    In the plane a void is a hole; in space it is a cavity (a tunnel is open at its ends: look at plane sections).
    """
    labels = label_regions(~np.pad(mask, 1))
    # The padding makes the outside one part, and it holds the first cell.
    counts = np.bincount(labels.reshape(-1))[2:]
    return np.sort(counts)[::-1]


def boundary_loops(reachable: Callable[[Array], np.ndarray], x: Array, y: Array) -> list[Array]:
    """Trace the boundary of a plane region: marching squares with the crossings bisected.

    Args:
        reachable: maps positions (n, 2) to booleans (n,).
        x: lattice coordinates, increasing, (nx,); the region must not touch the lattice's rim.
        y: lattice coordinates, increasing, (ny,).

    Returns:
        Closed loops (m, 2) without the repeated first point: outer boundaries anticlockwise, holes clockwise.

    Raises:
        ValueError: the region touches the rim.
    """
    lattice = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    inside = reachable(lattice.reshape(-1, 2)).reshape(len(x), len(y))
    if inside[[0, -1]].any() or inside[:, [0, -1]].any():
        raise ValueError(f"the region touches the rim of the lattice {x[0]}..{x[-1]} by {y[0]}..{y[-1]}: widen it")
    across, up = inside[1:] != inside[:-1], inside[:, 1:] != inside[:, :-1]
    # Crossings are numbered: first those on lattice lines along x, then those along y.
    number_x = np.full(across.shape, -1)
    number_x[across] = np.arange(np.count_nonzero(across))
    number_y = np.full(up.shape, -1)
    number_y[up] = np.count_nonzero(across) + np.arange(np.count_nonzero(up))
    starts = np.concatenate([lattice[:-1][across], lattice[:, :-1][up]])
    ends = np.concatenate([lattice[1:][across], lattice[:, 1:][up]])
    start_inside = np.concatenate([inside[:-1][across], inside[:, :-1][up]])
    inner = np.where(start_inside[:, None], starts, ends)
    outer = np.where(start_inside[:, None], ends, starts)
    edge = bisected(reachable, inner, outer, _BISECTIONS) if len(inner) else inner
    return [edge[loop] for loop in _follow(_links(inside, number_x, number_y))]


def _links(inside: np.ndarray, number_x: np.ndarray, number_y: np.ndarray) -> dict[int, int]:
    """For each crossing the next one, the region on the left hand."""
    follow: dict[int, int] = {}
    code = inside[:-1, :-1] * 1 + inside[1:, :-1] * 2 + inside[1:, 1:] * 4 + inside[:-1, 1:] * 8
    # Edges of a cell: bottom, right, top, left; a step leaves the region on its left. The two saddles keep their
    # reachable corners apart.
    table = {
        1: ((0, 3),), 2: ((1, 0),), 4: ((2, 1),), 8: ((3, 2),),
        3: ((1, 3),), 6: ((2, 0),), 12: ((3, 1),), 9: ((0, 2),),
        7: ((2, 3),), 14: ((3, 0),), 13: ((0, 1),), 11: ((1, 2),),
        5: ((0, 3), (2, 1)), 10: ((1, 0), (3, 2)),
    }  # fmt: skip
    for i, j in np.argwhere((code > 0) & (code < 15)):
        edge = (number_x[i, j], number_y[i + 1, j], number_x[i, j + 1], number_y[i, j])
        for start, end in table[int(code[i, j])]:
            follow[int(edge[start])] = int(edge[end])
    return follow


def _follow(links: dict[int, int]) -> list[list[int]]:
    loops = []
    while links:
        first = next(iter(links))
        loop, here = [first], links.pop(first)
        while here != first:
            loop.append(here)
            here = links.pop(here)
        loops.append(loop)
    return loops
