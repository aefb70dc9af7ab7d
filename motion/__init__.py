"""Motion laws and paths under velocity, acceleration and jerk limits. NumPy only."""

from .curves import Arc, Bezier, CurvedPath, Line, polyline, rounded
from .gates import GATE_STYLES, Gate, GateStyle, OverlappedGate
from .laws import MODIFIED_TRAPEZOID, QUINTIC, SEPTIC, ModifiedTrapezoid, MotionLaw, MotionSample, PolynomialLaw
from .minimum_time import PathMotion, minimum_time
from .paths import PathSample, StoppedPath, gate_corners
from .profiles import SCurve

__all__ = [
    "GATE_STYLES",
    "MODIFIED_TRAPEZOID",
    "QUINTIC",
    "SEPTIC",
    "Arc",
    "Bezier",
    "CurvedPath",
    "Gate",
    "GateStyle",
    "Line",
    "ModifiedTrapezoid",
    "MotionLaw",
    "MotionSample",
    "OverlappedGate",
    "PathMotion",
    "PathSample",
    "PolynomialLaw",
    "SCurve",
    "StoppedPath",
    "gate_corners",
    "minimum_time",
    "polyline",
    "rounded",
]
