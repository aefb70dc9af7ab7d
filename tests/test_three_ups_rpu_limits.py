"""The 3UPS-RPU platform's limits: each is told by its name, margins are measured at the joints, nonsense is refused."""

import dataclasses
import math

import numpy as np
import pytest

from fieldgym.mechanisms import ThreeUPSRPU, UnreachablePoseError


@pytest.mark.parametrize(
    ("limit", "pose"),
    [
        ("leg2_retracted", [0.0, 0.36, 0.0, 0.0]),
        ("leg1_extended", [0.0, 0.9, 0.0, 0.0]),
        ("universal1", [-0.25, 0.5, 0.0, 0.0]),
        ("universal4", [0.0, 0.6, 0.0, -0.9]),
        ("platform_tilt", [0.0, 0.6, 0.3, 0.3]),
    ],
)
def test_beyond_a_limit(limit: str, pose: list[float]) -> None:
    machine = ThreeUPSRPU.weeder()
    margins = machine.margins(pose)
    assert margins[limit] < 0.0
    assert not machine.reachable(pose)
    assert np.all(np.isfinite(machine.inverse(pose)))
    broken = [name for name, margin in margins.items() if margin < 0.0]
    with pytest.raises(UnreachablePoseError) as caught:
        machine.inverse(np.stack([machine.home_pose, pose]), strict=True)
    assert caught.value.limit == broken[0] and caught.value.index == (1,)
    assert caught.value.margin == margins[broken[0]]


@pytest.mark.parametrize(
    ("limit", "change"),
    [("clearance", {"leg_distance_m": 0.5}), ("regularity", {"min_singular_value": 0.9})],
)
def test_stricter_limits_close_the_home_pose(limit: str, change: dict) -> None:
    machine = dataclasses.replace(ThreeUPSRPU.weeder(), **change)
    assert [name for name, margin in machine.margins(machine.home_pose).items() if margin < 0.0] == [limit]
    assert not machine.reachable(machine.home_pose)
    with pytest.raises(UnreachablePoseError, match=f"limit '{limit}' is violated by"):
        machine.inverse(machine.home_pose, strict=True)


def test_margins_are_measured_at_the_joints() -> None:
    machine, pose = ThreeUPSRPU.weeder(), np.array([0.03, 0.62, 0.1, -0.2])
    chains, margins = machine.chains(pose), machine.margins(pose)
    for leg in range(4):
        low, high = machine.stroke_m[leg]
        assert margins[f"leg{leg + 1}_retracted"] == pytest.approx(chains.length[leg] - low, abs=1e-15)
        assert margins[f"leg{leg + 1}_extended"] == pytest.approx(high - chains.length[leg], abs=1e-15)
        normal = chains.rotation[:, 2] if leg == 3 else np.array([0.0, 0.0, 1.0])
        tilt = math.atan2(np.linalg.norm(np.cross(normal, chains.direction[leg])), normal @ chains.direction[leg])
        assert margins[f"universal{leg + 1}"] == pytest.approx(math.radians(50.0) - tilt, abs=1e-12)
    assert margins["platform_tilt"] == pytest.approx(math.radians(20.0) - math.acos(math.cos(0.1) * math.cos(0.2)))
    share = np.linspace(0.0, 1.0, 401)[:, None]
    points = [chains.base[leg] + share * (chains.platform[leg] - chains.base[leg]) for leg in range(4)]
    nearest = min(np.linalg.norm(points[i][:, None] - points[j], axis=-1).min() for i in range(4) for j in range(i))
    assert margins["clearance"] == pytest.approx(nearest - 0.15, abs=1e-3)
    singular = np.linalg.svd(machine.rate_map(pose) / [1.0, 1.0, 0.3, 0.3], compute_uv=False)
    assert machine.conditioning(pose).smallest <= singular[-1] + 1e-12


def test_nan_is_passed_on_and_never_reachable() -> None:
    machine = ThreeUPSRPU.weeder()
    poses = np.array([machine.home_pose, [0.0, np.nan, 0.0, 0.0]])
    assert np.isnan(machine.inverse(poses)[1]).all() and np.isfinite(machine.inverse(poses)[0]).all()
    np.testing.assert_array_equal(machine.reachable(poses), [True, False])
    assert np.isnan(machine.conditioning(poses).smallest[1])
    assert np.isnan(machine.statics(poses, np.ones(6))[1]).all()
    assert np.isnan(machine.null_twist(poses)).all()
    with pytest.raises(UnreachablePoseError):
        machine.inverse(poses, strict=True)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"base_radius_m": -0.4}, "r_a = -0.4"),
        ({"platform_angles_rad": (0.0, 1.0, 2.0, 3.0)}, r"platform_angles_rad\[3\] = 3.0"),
        ({"base_angles_rad": (0.0, 1.0)}, "four finite azimuths"),
        ({"stroke_m": ((0.5, 0.4),) * 4}, "0 < shortest < longest"),
        ({"max_universal_tilt_rad": 2.0}, "max_universal_tilt_rad = 2.0 rad"),
        ({"leg_distance_m": -0.1}, "leg_distance_m = -0.1"),
    ],
)
def test_impossible_parameters_are_named(change: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(ThreeUPSRPU.weeder(), **change)
