"""Analyses of one position, or of many: results of `kinematics`, `inverse_dynamics`, `equilibrium`, `linearize`."""

from __future__ import annotations

from ..results.joint import JointKinematics
from .equilibrium import Equilibrium
from .family import BranchPoint, EquilibriumPath, Fold
from .inverse import InverseDynamics
from .kinematics import DeadPoint, Kinematics, Limit, PointMotion
from .linear import Linearization
from .modes import Mode, Modes

__all__ = [
    "BranchPoint",
    "DeadPoint",
    "Equilibrium",
    "EquilibriumPath",
    "Fold",
    "InverseDynamics",
    "JointKinematics",
    "Kinematics",
    "Limit",
    "Linearization",
    "Mode",
    "Modes",
    "PointMotion",
]
