"""Analyses of one position, or of many: results of `kinematics`, `inverse_dynamics`, `equilibrium`, `cycle`,
`linearize`, `singularities`, `workspace`, `placement`, `identify`."""

from __future__ import annotations

from ..results.joint import JointKinematics
from .cycle import Cycle, CycleDerivative
from .cycles import Bifurcation, CycleFamily
from .equilibrium import Equilibrium
from .family import BranchPoint, EquilibriumPath, Fold
from .identification import Combination, Identifiability, Identification
from .inverse import InverseDynamics
from .kinematics import DeadPoint, Kinematics, Limit, PointMotion
from .linear import Linearization
from .modes import Mode, Modes
from .placement import PlacedSet, Placement
from .singularities import SingularCurve, Singularities
from .workspace import Workspace

__all__ = [
    "Bifurcation",
    "BranchPoint",
    "Cycle",
    "CycleDerivative",
    "CycleFamily",
    "Combination",
    "DeadPoint",
    "Equilibrium",
    "EquilibriumPath",
    "Fold",
    "Identifiability",
    "Identification",
    "InverseDynamics",
    "JointKinematics",
    "Kinematics",
    "Limit",
    "Linearization",
    "Mode",
    "Modes",
    "PlacedSet",
    "Placement",
    "PointMotion",
    "SingularCurve",
    "Singularities",
    "Workspace",
]
