"""Analyses of one position, or of many: results of `kinematics`, `inverse_dynamics`, `equilibrium`, `linearize`."""
