"""Analyses of one position, or of many: results of `kinematics`, `inverse_dynamics`, `equilibrium`, `linearize`."""

from __future__ import annotations

from ..results.joint import JointKinematics
from .equilibrium import Equilibrium
from .inverse import InverseDynamics
from .kinematics import DeadPoint, Kinematics, Limit, PointMotion
from .linear import Linearization
from .modes import Mode, Modes

__all__ = [
    "DeadPoint",
    "Equilibrium",
    "InverseDynamics",
    "JointKinematics",
    "Kinematics",
    "Limit",
    "Linearization",
    "Mode",
    "Modes",
    "PointMotion",
]
