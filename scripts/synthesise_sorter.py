"""Find the 3-PRRS of the sorting cell and of the hoe: ``python -m fieldgym.scripts.synthesise_sorter``.

The sorter hangs over a belt 0.3 m wide. Required:

- gripping: every point of a cylinder 0.30 m across and 0.10 m high, with a yaw up to +-45 deg and, at the same time, a
  tilt up to 15 deg towards any side (more tilt with less yaw, and near the middle, is what the limits leave);
- placing: level, a cylinder 0.40 m across and 0.10 m high, so that bins beside the belt are within reach;
- limits: spherical joints up to 55 deg, just under what the paper's workspace needs (assumed); links at least 30 mm
  apart (bars of 25 mm, assumed); a platform circle of 160 mm, which takes a gripper (assumed); sliders no closer
  together than the platform's joints.

The hoe hangs over a crop row. Required, level and under the same limits: a box 0.36 m along the row, 0.43 m across and
0.10 m high, for a band of 0.40 m, a window of 0.28 m, and what following and stirring add.

Among the layouts on a raster of 5 mm in l and 10 mm in D the one with the shortest links is taken; ties go to the
largest smallest singular value (speeds of joints per speed of the platform) over the required set. The slider range is
what the required set uses, rounded outwards to 5 mm, with the cylinders standing on z = 0.

It ends with what the chosen sorter reaches: the largest radius about the axis at half the cylinders' height, for every
tilt direction and every yaw up to the given one, and where yaw and tilt end on the axis.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fieldgym.mechanisms import ThreePRRS

PLATFORM_DIAMETER_M = 0.160
CONE_RAD = np.deg2rad(55.0)
LINK_CLEARANCE_M = 0.030
MIN_PLATFORM_LOCK = 0.25
GRIP_RADIUS_M, PLACE_RADIUS_M, HEIGHT_M = 0.15, 0.20, 0.10
TILT_RAD, YAW_RAD = np.deg2rad(15.0), np.deg2rad(45.0)
HOE_HALF_LENGTH_M, HOE_HALF_WIDTH_M = 0.18, 0.215
TILTS_DEG, YAWS_DEG, STEP_M = (0, 15, 20, 30, 40), (0, 45, 60), 0.005
_ANY_SLIDER_M = (-10.0, 10.0)


class Candidate(NamedTuple):
    """A layout and its figures over the required set."""

    machine: ThreePRRS
    smallest_singular_value: float
    largest_condition_number: float
    smallest_lock: float


def required_poses() -> np.ndarray:
    """Poses at z = 0 that span the required set, shape (n, 6); only the sliders see the height."""
    return np.concatenate([_poses(GRIP_RADIUS_M, TILT_RAD, YAW_RAD), _poses(PLACE_RADIUS_M, 0.0, 0.0)])


def required_hoe_poses() -> np.ndarray:
    """The same for the hoe."""
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 13) * HOE_HALF_LENGTH_M, np.linspace(-1.0, 1.0, 13) * HOE_HALF_WIDTH_M)
    poses = np.zeros((x.size, 6))
    poses[:, 0], poses[:, 1] = x.ravel(), y.ravel()
    return poses


def evaluate(link_m: float, base_diameter_m: float, poses: np.ndarray) -> Candidate | None:
    """A layout with the slider range that it needs, or None where it breaks a limit."""
    free = ThreePRRS(
        link_m, base_diameter_m, PLATFORM_DIAMETER_M, _ANY_SLIDER_M, CONE_RAD, LINK_CLEARANCE_M, MIN_PLATFORM_LOCK
    )
    if not free.reachable(poses).all():
        return None
    sliders = free.inverse(poses)[:, :3]
    low = np.floor(sliders.min() / 0.005) * 0.005
    high = np.ceil((sliders.max() + HEIGHT_M) / 0.005) * 0.005
    machine = replace(free, slider_range_m=(round(float(low), 3), round(float(high), 3)))
    conditioning = machine.conditioning(poses)
    lock = machine.margins(poses)["platform_lock"].min() + MIN_PLATFORM_LOCK
    return Candidate(machine, float(conditioning.smallest.min()), float(conditioning.number.max()), float(lock))


def synthesise(poses: np.ndarray) -> list[Candidate]:
    """All layouts with the shortest links for required poses (n, 6) at z = 0, best first.

    Raises:
        ValueError: no layout of the raster holds the required set.
    """
    for link_mm in range(200, 601, 5):
        found = [
            candidate
            for base_mm in range(int(PLATFORM_DIAMETER_M * 1000), 2 * link_mm, 10)
            if (candidate := evaluate(link_mm / 1000, base_mm / 1000, poses)) is not None
        ]
        if found:
            return sorted(found, key=lambda candidate: -candidate.smallest_singular_value)
    raise ValueError("no layout with links up to 0.6 m holds the required set: relax it or widen the raster")


def main() -> None:
    """Print the layouts with the shortest links."""
    print("           l mm   D mm   d mm  sliders mm  smallest s.v.  condition  lock")
    for name, poses in (("sorter", required_poses()), ("hoe", required_hoe_poses())):
        for candidate in synthesise(poses):
            machine = candidate.machine
            low, high = (round(1000 * limit) for limit in machine.slider_range_m)
            lengths = (machine.link_m, machine.base_diameter_m, machine.platform_diameter_m)
            print(
                f"{name:>8}",
                *(f"{1000 * length:6.0f}" for length in lengths),
                f"{low:6d}..{high}",
                f"{candidate.smallest_singular_value:10.3f}",
                f"{candidate.largest_condition_number:13.2f}",
                f"{candidate.smallest_lock:7.3f}",
            )
    sorter = ThreePRRS.sorter()
    print("reach in m  yaw 0  +-45 deg  +-60 deg")
    for tilt_deg in TILTS_DEG:
        row = (reach_m(sorter, np.deg2rad(tilt_deg), np.deg2rad(yaw_deg)) for yaw_deg in YAWS_DEG)
        print(f"tilt {tilt_deg:2d} deg ", *(f"{radius_m:8.3f}" for radius_m in row))
    for name, column in (("yaw", 5), ("tilt", 3)):
        print(f"on the axis {name} ends at {last_deg(sorter, column)} deg")


def reach_m(machine: ThreePRRS, tilt_rad: float, yaw_rad: float) -> float:
    """Largest radius, in steps of 5 mm, all around which a tilt to any side goes with every yaw up to ``yaw_rad``."""
    radius_m = 0.0
    while machine.reachable(_around(radius_m + STEP_M, tilt_rad, yaw_rad)).all():
        radius_m += STEP_M
    return radius_m


def last_deg(machine: ThreePRRS, column: int) -> int:
    """The last whole degree of a turn on the axis."""
    poses = np.zeros((91, 6))
    poses[:, 2], poses[:, column] = 0.5 * HEIGHT_M, np.deg2rad(np.arange(91))
    return int(np.flatnonzero(~machine.reachable(poses))[0]) - 1


def _around(radius_m: float, tilt_rad: float, yaw_rad: float) -> np.ndarray:
    azimuths = np.deg2rad(np.arange(0.0, 360.0, 10.0))
    circle = np.stack([np.cos(azimuths), np.sin(azimuths)], axis=-1)
    poses = np.zeros((36, 36, 13, 6))
    poses[..., :2], poses[..., 2] = radius_m * circle[:, None, None], 0.5 * HEIGHT_M
    poses[..., 3:5], poses[..., 5] = tilt_rad * circle[:, None], np.linspace(-yaw_rad, yaw_rad, 13)
    return poses.reshape(-1, 6)


def _poses(radius_m: float, tilt_rad: float, yaw_rad: float) -> np.ndarray:
    azimuths = np.deg2rad(np.arange(0.0, 360.0, 10.0))
    circle = np.stack([np.cos(azimuths), np.sin(azimuths)], axis=-1)
    places = np.concatenate([[[0.0, 0.0]], 0.5 * radius_m * circle, radius_m * circle])
    tilts = np.concatenate([[[0.0, 0.0]], tilt_rad * circle[::3]]) if tilt_rad else np.zeros((1, 2))
    yaws = np.linspace(-yaw_rad, yaw_rad, 7) if yaw_rad else np.zeros(1)
    turns = np.array([(*tilt, yaw) for tilt in tilts for yaw in yaws])
    poses = np.zeros((len(places), len(turns), 6))
    poses[..., :2] = places[:, None]
    poses[..., 3:] = turns
    return poses.reshape(-1, 6)


if __name__ == "__main__":
    main()
