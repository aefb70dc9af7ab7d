"""Closed-form kinematics, statics, workspaces and accuracy of the parallel mechanisms. NumPy only."""

from .dynamics import LinkMasses
from .errors import UnreachablePoseError
from .five_bar import FiveBar
from .spatial_workspace import SpatialWorkspace
from .three_prrs import ThreePRRS
from .three_ups_rpu import ThreeUPSRPU
from .translational_five_bar import TranslationalFiveBar
from .workspace import PlanarWorkspace

__all__ = [
    "FiveBar",
    "LinkMasses",
    "PlanarWorkspace",
    "SpatialWorkspace",
    "ThreePRRS",
    "ThreeUPSRPU",
    "TranslationalFiveBar",
    "UnreachablePoseError",
]
