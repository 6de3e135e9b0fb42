"""Analyses of one position, or of many: results of `kinematics`, `inverse_dynamics`, `equilibrium`, `linearize`."""

from __future__ import annotations

from .inverse import InverseDynamics

__all__ = ["InverseDynamics"]
