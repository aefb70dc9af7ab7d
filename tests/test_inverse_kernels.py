"""Compiled inverse kinematics held to the same formulas in NumPy, and single poses to batches, bit for bit."""

import numpy as np
import pytest

from fieldgym.kernels import compiled
from fieldgym.kernels.angles import arctangent, sine_cosine
from fieldgym.mechanisms import FiveBar, ThreePRRS, ThreeUPSRPU, TranslationalFiveBar
from fieldgym.mechanisms.prrs_legs import RADIAL, TANGENTIAL

TILT = np.deg2rad(14.0)
SORTER = [-0.1, -0.1, 0.0, -0.2, -0.2, -0.7], [0.1, 0.1, 0.1, 0.2, 0.2, 0.7]
WEEDER = [-0.1, 0.5, -TILT, -TILT], [0.1, 0.7, TILT, TILT]
CASES = {
    "five-bar": (FiveBar.safflower(), [0.15, -0.51], [0.43, -0.22]),
    "five-bar, out of reach": (FiveBar.safflower(), [-0.1, -0.7], [0.7, 0.2]),
    "unequal": (FiveBar.from_lengths(0.16, 0.33, 0.05, 0.04, 0.36, 0.19, 0.55), [0.15, -0.51], [0.43, -0.22]),
    "transplanter": (TranslationalFiveBar.transplanter(), [-0.30, -0.66], [0.30, -0.51]),
    "weeder": (ThreeUPSRPU.weeder(), *WEEDER),
    "paper's weeder": (ThreeUPSRPU.published(paper_orientation=True), *WEEDER),
    "sorter": (ThreePRRS.sorter(), *SORTER),
    "sorter, out of reach": (ThreePRRS.sorter(), [-0.3, -0.3, 0.0] + [-0.5] * 3, [0.3, 0.3, 0.1] + [0.5] * 3),
    "published 3-PRRS": (ThreePRRS.published(), [-0.02, -0.02, 0.05] + [-0.1] * 3, [0.02, 0.02, 0.1] + [0.1] * 3),
}


def poses_of(name, count=20_000, seed=0):
    machine, low, high = CASES[name]
    return machine, np.random.default_rng(seed).uniform(low, high, (count, len(low)))


def inverse_in_numpy(machine, poses):
    with np.errstate(invalid="ignore"):
        if isinstance(machine, ThreeUPSRPU):
            return leg_lengths(machine, poses)
        return sliders_and_drives(machine, poses) if isinstance(machine, ThreePRRS) else arm_angles(machine, poses)


def arm_angles(machine, poses):
    angles = []
    for leg in machine._legs:
        x, y = poses[:, 0] + (leg.wrist_x_m - leg.motor_x_m), poses[:, 1] + machine._drop_m
        square = x * x + y * y
        scale = 0.5 / leg.arm_m
        reach = square * scale + (leg.arm_m * leg.arm_m - leg.forearm_m * leg.forearm_m) * scale
        root = leg.side * np.sqrt(square - reach * reach)
        turned = (y >= leg.arm_m - leg.forearm_m - 0.02 * leg.arm_m) & (leg.side * x > 0.0)
        tangent = np.where(turned, (y + reach) / (root + x), (root - x) / (y - reach))
        angles.append(2.0 * np.arctan(tangent) - 0.5 * np.pi)
    return np.stack(angles, axis=-1)


def leg_lengths(machine, poses):
    x, z, alpha, beta = poses.T
    sa, ca, sb, cb = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    at, zero = machine.attachments, np.zeros_like(x)
    if machine.paper_orientation:
        rows = [[cb, zero, sb], [sa * sb, ca, -sa * cb], [-ca * sb, sa, ca * cb]]
        centre = np.stack([x, at.radius_m * sa * sb, z], axis=-1)
    else:
        rows = [[cb, sa * sb, ca * sb], [zero, ca, -sa], [-sb, sa * cb, ca * cb]]
        centre = np.stack([x, zero, z], axis=-1)
    rotation = np.moveaxis(np.array(rows), -1, 0)
    joints = centre[:, None] + np.einsum("nij,kj->nki", rotation, at.platform)
    return np.linalg.norm(joints - at.base, axis=-1)


def sliders_and_drives(machine, poses):
    (sa, sb, sg), (ca, cb, cg) = np.sin(poses[:, 3:]).T, np.cos(poses[:, 3:]).T
    axes = np.array([[cg * cb, cg * sb * sa - sg * ca], [sg * cb, sg * sb * sa + cg * ca], [-sb, cb * sa]])
    sliders, drives = [], []
    for leg in range(3):
        place = machine.platform_radius_m * RADIAL[:2, leg]
        dx, dy, height = np.einsum("ijn,j->in", axes, place) + poses[:, :3].T
        dx, dy = (
            dx - 0.5 * machine.base_diameter_m * RADIAL[0, leg],
            dy - 0.5 * machine.base_diameter_m * RADIAL[1, leg],
        )
        drop = np.sqrt(machine.link_m**2 - dx * dx - dy * dy)
        sliders.append(height + drop)
        drives.append(np.arctan((dx * TANGENTIAL[0, leg] + dy * TANGENTIAL[1, leg]) / drop))
    return np.stack(sliders + drives, axis=-1)


@pytest.mark.parametrize("name", CASES)
def test_machine_code_says_what_the_formula_in_numpy_says(name):
    machine, poses = poses_of(name)
    found, wanted = machine.inverse(poses), inverse_in_numpy(machine, poses)
    assert np.array_equal(np.isnan(found), np.isnan(wanted))
    # An angle is measured from the hanging arm, where rounding is that of pi / 2. Near a stretched leg the square root
    # of a difference keeps half the digits, whichever way it is written.
    error, size = np.abs(found - wanted), np.maximum(np.abs(wanted), 0.5 * np.pi)
    assert np.nanmax(error) < 1e-6
    if "out of reach" not in name:
        firm = np.isfinite(error).all(axis=-1) if isinstance(machine, ThreeUPSRPU) else machine.reachable(poses)
        assert firm.sum() > 1000
        assert (error[firm] <= 2.0 * np.spacing(size[firm])).all()


@pytest.mark.parametrize("name", CASES)
def test_a_pose_by_itself_is_the_batchs_bit_for_bit(name):
    machine, poses = poses_of(name, 600)
    batch = machine.inverse(poses)
    for row in (0, 1, 254, 255, 256, 257, 511, 512, 599):
        assert machine.inverse(poses[row]).tobytes() == batch[row].tobytes()
        assert machine.inverse(poses[row].tolist()).tobytes() == batch[row].tobytes()
        assert machine.inverse(poses[row : row + 1]).tobytes() == batch[row].tobytes()


@pytest.mark.parametrize("name", ["five-bar", "weeder", "sorter"])
def test_strided_locked_and_empty_poses_are_taken(name):
    machine, poses = poses_of(name, 40)
    poses = poses[np.isfinite(machine.inverse(poses)).all(axis=-1)][:32]
    wanted = machine.inverse(poses)
    locked = poses.copy()
    locked.setflags(write=False)
    assert np.array_equal(machine.inverse(locked), wanted) and np.array_equal(machine.inverse(locked[3]), wanted[3])
    columns = np.asfortranarray(poses)
    assert np.array_equal(machine.inverse(columns), wanted) and np.array_equal(machine.inverse(columns[3]), wanted[3])
    assert np.array_equal(machine.inverse(poses[::-2]), wanted[::-2])
    assert np.array_equal(machine.inverse(poses.reshape(4, 8, -1)), wanted.reshape(4, 8, -1))
    assert machine.inverse(poses[:0]).shape == (0, poses.shape[1])


@compiled
def all_sines(angles, sines, cosines):
    for i in range(len(angles)):
        sines[i], cosines[i] = sine_cosine(angles[i])


@compiled
def all_arctangents(rises, runs, angles):
    for i in range(len(rises)):
        angles[i] = arctangent(rises[i], runs[i])


def units(found, wanted):
    """Largest distance in units in the last place of values that are known better."""
    return float(np.max(np.abs(found.astype(np.longdouble) - wanted) / np.spacing(np.abs(found))))


@pytest.mark.parametrize("size", [1e-9, 0.7, 3.0, 100.0, 1e4])
def test_sines_and_cosines_are_true_to_two_units_in_the_last_place(size):
    angles = np.random.default_rng(0).uniform(-size, size, 50_000)
    sines, cosines = np.empty_like(angles), np.empty_like(angles)
    all_sines(angles, sines, cosines)
    exact = angles.astype(np.longdouble)
    assert units(sines, np.sin(exact)) < 2.0 and units(cosines, np.cos(exact)) < 2.0


def test_sines_and_cosines_of_what_has_none_are_nan_and_zero_is_exact():
    angles = np.array([0.0, -0.0, np.nan, np.inf, -np.inf])
    sines, cosines = np.empty(5), np.empty(5)
    all_sines(angles, sines, cosines)
    assert np.array_equal(sines[:2], [0.0, 0.0]) and np.array_equal(cosines[:2], [1.0, 1.0])
    assert np.isnan(sines[2:]).all() and np.isnan(cosines[2:]).all()


def test_arctangents_are_true_to_two_units_in_the_last_place():
    generator = np.random.default_rng(0)
    rises, runs = generator.normal(size=(2, 50_000)) * 10.0 ** generator.uniform(-6.0, 6.0, (2, 50_000))
    angles = np.empty_like(rises)
    all_arctangents(rises, runs, angles)
    assert units(angles, np.arctan(rises.astype(np.longdouble) / runs.astype(np.longdouble))) < 2.0


def test_arctangents_on_the_axes():
    rises, runs = np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0, np.nan]), np.array([2.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0])
    angles = np.empty_like(rises)
    all_arctangents(rises, runs, angles)
    quarter = 0.5 * np.pi
    assert np.array_equal(angles[:5], [0.0, quarter, -quarter, 0.5 * quarter, -0.5 * quarter])
    assert np.isnan(angles[5:]).all()
