"""Quaternions against rotation matrices and against what they are for."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fieldgym.mechanisms.rotations import euler_from_rotation, rotation_from_euler
from fieldgym.motion.orientation import (
    LEVEL,
    angle_between,
    axes,
    conjugate,
    euler_angles,
    from_euler,
    product,
    slerp,
    tilted,
)

ANGLES = st.tuples(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0))


@given(ANGLES)
def test_euler_angles_agree_with_the_mechanisms(angles):
    quaternion = from_euler(np.array(angles))
    assert axes(quaternion) == pytest.approx(rotation_from_euler(np.array(angles)), abs=1e-12)
    assert rotation_from_euler(euler_angles(quaternion)) == pytest.approx(axes(quaternion), abs=1e-7)
    assert euler_from_rotation(axes(quaternion)) == pytest.approx(euler_angles(quaternion), abs=1e-6)


@given(ANGLES, ANGLES)
def test_products_turn_one_after_the_other(first, second):
    a, b = from_euler(np.array(first)), from_euler(np.array(second))
    assert axes(product(a, b)) == pytest.approx(axes(a) @ axes(b), abs=1e-12)
    assert product(a, conjugate(a)) == pytest.approx(LEVEL, abs=1e-12)
    cosine = 0.5 * (np.trace(axes(a).T @ axes(b)) - 1.0)
    assert np.cos(angle_between(a, b)) == pytest.approx(cosine, abs=1e-9)


@given(ANGLES)
def test_the_axes_are_the_matrix_of_the_quaternion(angles):
    quaternion = from_euler(np.array(angles))
    back = Rotation.from_matrix(axes(quaternion)).as_quat()[[3, 0, 1, 2]]
    assert float(angle_between(back, quaternion)) < 1e-7


@given(ANGLES, ANGLES, st.floats(0.0, 1.0))
def test_slerp_turns_at_a_constant_rate_about_one_axis(first, second, share):
    a, b = from_euler(np.array(first)), from_euler(np.array(second))
    between = slerp(a, b, share)
    whole = float(angle_between(a, b))
    assert np.linalg.norm(between) == pytest.approx(1.0)
    assert float(angle_between(a, between)) == pytest.approx(share * whole, abs=1e-6)
    assert float(angle_between(between, b)) == pytest.approx((1.0 - share) * whole, abs=1e-6)


@given(st.floats(0.0, 1.0), st.floats(-3.0, 3.0), st.floats(-1.5, 1.5))
def test_tilted_leans_where_it_should_and_yaws_before(tilt, azimuth, yaw):
    turned = axes(tilted(tilt, azimuth, yaw))
    lean = np.sin(tilt) * np.array([np.cos(azimuth), np.sin(azimuth)])
    assert turned[:, 2] == pytest.approx([*lean, np.cos(tilt)], abs=1e-12)
    axis = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    # What lies along the tilt's own axis is turned by the yaw alone.
    back = axes(tilted(0.0, 0.0, yaw)).T @ axis
    assert turned @ back == pytest.approx(axis, abs=1e-12)


def test_batches_keep_their_shape():
    assert tilted(np.zeros((2, 3)), 0.0, 0.1).shape == (2, 3, 4)
    assert tilted(0.0, 0.0, 0.1).shape == (4,)
    assert slerp(LEVEL, tilted(0.1, 0.0, 0.2), np.linspace(0, 1, 5)).shape == (5, 4)
    assert slerp(LEVEL, LEVEL, 0.3) == pytest.approx(LEVEL)
