"""Motion laws for kernels. Apart from the room's other modules: Numba is imported only where kernels are."""

from __future__ import annotations

from ..kernels import compiled
from . import laws

shortest = compiled(laws.shortest)
"""``motion.laws.shortest`` of one stroke."""
