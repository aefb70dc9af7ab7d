"""Motion laws and paths under velocity, acceleration and jerk limits. NumPy only."""

from .laws import QUINTIC, SEPTIC, MotionSample, PolynomialLaw
from .paths import PathSample, StoppedPath, gate_corners

__all__ = ["QUINTIC", "SEPTIC", "MotionSample", "PathSample", "PolynomialLaw", "StoppedPath", "gate_corners"]
