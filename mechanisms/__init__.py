"""Closed-form kinematics, statics, workspaces and accuracy of the parallel mechanisms. NumPy only."""

from .errors import UnreachablePoseError
from .five_bar import FiveBar
from .spatial_workspace import SpatialWorkspace
from .three_prrs import ThreePRRS
from .three_ups_rpu import ThreeUPSRPU
from .workspace import PlanarWorkspace

__all__ = ["FiveBar", "PlanarWorkspace", "SpatialWorkspace", "ThreePRRS", "ThreeUPSRPU", "UnreachablePoseError"]
