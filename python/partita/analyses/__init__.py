"""Analyses of one position, or of many: results of `kinematics`, `inverse_dynamics`, `equilibrium`, `linearize`."""

from __future__ import annotations

from .kinematics import DeadPoint, Kinematics, Limit, PointMotion

__all__ = ["DeadPoint", "Kinematics", "Limit", "PointMotion"]
