"""Mechanisms that several test files build."""

import partita as pt


def pendulum() -> pt.Mechanism:
    """A uniform rod of 1 m and 1 kg on a hinge at the origin, drawn along x."""
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    return m
