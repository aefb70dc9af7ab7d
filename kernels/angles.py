"""Sines, cosines and arctangents in plain arithmetic, without a branch.

A compiler makes vectors of loops over them, where a call of the C library is one number at a time; and their last bit
depends on no library and no processor. Coefficients are fdlibm's (Sun Microsystems, 1993: k_sin.c, k_cos.c, s_atan.c);
each result is within 2 units in the last place.
"""

from __future__ import annotations

import math

from .compiling import compiled

_ROUND = 6755399441055744.0
"""1.5 times 2^52: what is added to it is rounded to a whole number, halves to even."""
_QUARTERS = 6.36619772367581382433e-01
"""2 / pi."""
_QUARTER_HEAD = 1.57079632673412561417e00
"""The first 33 bits of pi / 2: up to 2^20 of them are exact."""
_QUARTER_TAIL = 6.07710050650619224932e-11


@compiled
def sine_cosine(angle_rad: float) -> tuple[float, float]:
    """Sine and cosine of an angle of at most a million radians; NaN for what is not finite."""
    quarters = (angle_rad * _QUARTERS + _ROUND) - _ROUND
    rest = (angle_rad - quarters * _QUARTER_HEAD) - quarters * _QUARTER_TAIL
    turn = quarters - 4.0 * ((quarters * 0.25 + _ROUND) - _ROUND)
    z = rest * rest
    s = 1.58969099521155010221e-10
    s = s * z - 2.50507602534068634195e-08
    s = s * z + 2.75573137070700676789e-06
    s = s * z - 1.98412698298579493134e-04
    s = s * z + 8.33333333332248946124e-03
    s = s * z - 1.66666666666666324348e-01
    sine = rest + rest * (z * s)
    c = -1.13596475577881948265e-11
    c = c * z + 2.08757232129817482790e-09
    c = c * z - 2.75573143513906633035e-07
    c = c * z + 2.48015872894767294178e-05
    c = c * z - 1.38888888888741095749e-03
    c = c * z + 4.16666666666666019037e-02
    half = 0.5 * z
    near = 1.0 - half
    cosine = near + (((1.0 - near) - half) + z * (z * c))
    odd = (turn == 1.0) | (turn == -1.0)
    first = cosine if odd else sine
    second = sine if odd else cosine
    return (
        -first if (turn < 0.0) | (turn == 2.0) else first,
        -second if (turn > 0.0) | (turn == -2.0) else second,
    )


@compiled
def arctangent(rise: float, run: float) -> float:
    """The angle in [-pi/2, pi/2] whose tangent is ``rise / run``, rad; NaN for 0 / 0."""
    a, b = abs(rise), abs(run)
    steep = a > 2.4375 * b
    middle = a > 0.4375 * b
    upper = -b if steep else (a - b if middle else a)
    lower = a if steep else (a + b if middle else b)
    head = 1.57079632679489655800e00 if steep else (7.85398163397448278999e-01 if middle else 0.0)
    tail = 6.12323399573676603587e-17 if steep else (3.06161699786838301793e-17 if middle else 0.0)
    t = upper / lower
    z = t * t
    w = z * z
    even = 1.62858201153657823623e-02
    even = even * w + 4.97687799461593236017e-02
    even = even * w + 6.66107313738753120669e-02
    even = even * w + 9.09088713343650656196e-02
    even = even * w + 1.42857142725034663711e-01
    even = even * w + 3.33333333333329318027e-01
    odd = -3.65315727442169155270e-02
    odd = odd * w - 5.83357013379057348645e-02
    odd = odd * w - 7.69187620504482999495e-02
    odd = odd * w - 1.11111104054623557880e-01
    odd = odd * w - 1.99999999998764832476e-01
    angle = head - ((t * (even * z + odd * w) - tail) - t)
    return -angle if (rise < 0.0) != (run < 0.0) else angle


@compiled
def bearing(rise: float, run: float) -> float:
    """The direction in [-pi, pi] of a way that is ``run`` along and ``rise`` across, rad; 0 of none."""
    if rise == 0.0 and run == 0.0:
        return 0.0
    angle = arctangent(rise, run)
    if run < 0.0:
        return angle + math.pi if rise >= 0.0 else angle - math.pi
    return angle
