"""Conditions that say nothing new: their rank, and which reactions follow from the motion all the same."""

from __future__ import annotations

import numpy as np
import pytest

import partita as pt

L = 1.0
PINS = {"P1": (0.0, 0.0), "P2": (1.5, 0.0), "P3": (3.0, 0.0)}
LEAN = np.array([0.6, 0.8])
"""Direction of the three parallel cranks."""


def swing_with_pendulum() -> pt.Mechanism:
    """A coupler on three parallel cranks, one more than it needs, and a pendulum that hangs on it."""
    m = pt.Mechanism("swing", gravity=(0, -9.81, 0))
    tops = {name: np.array(pin) + LEAN for name, pin in PINS.items()}
    m.add_rod("coupler", start=(*tops["P1"], 0), end=(*tops["P3"], 0), mass=2.0)
    for i, (name, pin) in enumerate(PINS.items(), 1):
        m.add_rod(f"crank{i}", start=(*pin, 0), end=(*tops[name], 0), mass=1.0)
        m.add_revolute(name, m.ground, f"crank{i}", point=(*pin, 0))
        m.add_revolute(f"T{i}", f"crank{i}", "coupler", point=(*tops[name], 0))
    hang = tops["P2"]
    m.add_rod("bob", start=(*hang, 0), end=(hang[0] + 0.3, hang[1] - 0.9, 0), mass=0.5)
    m.add_revolute("H", "coupler", "bob", point=(*hang, 0))
    return m


def pin_rows(points: dict[str, tuple[tuple[int, np.ndarray], ...]], bodies: int) -> np.ndarray:
    """Rows of pins in the plane: each joins points at arms r of bodies with x, y and angle; -1: the ground."""
    rows = []
    for ends in points.values():
        block = np.zeros((2, 3 * bodies))
        for sign, (body, arm) in zip((1.0, -1.0), ends, strict=True):
            if body >= 0:
                block[:, 3 * body : 3 * body + 3] += sign * np.array([[1, 0, -arm[1]], [0, 1, arm[0]]])
        rows.append(block)
    return np.vstack(rows)


def test_rank_of_a_swing_with_a_pendulum_and_what_is_unique() -> None:
    """15 coordinates of five bodies in the plane, 14 conditions of rank 13: only the pendulum's pin is unique.

    By hand: rows of pins in x, y and angles; a reaction is unique where no self-stress of the pins has a part in it.
    """
    centre = {"coupler": np.array([1.5, 0.0]) + LEAN, "bob": np.array([1.5, 0.0]) + LEAN + [0.15, -0.45]}
    arms: dict[str, tuple[tuple[int, np.ndarray], ...]] = {}
    for i, pin in enumerate(PINS.values(), 1):
        middle = np.array(pin) + 0.5 * LEAN
        arms[f"P{i}"] = ((i, np.array(pin) - middle), (-1, np.zeros(2)))
        arms[f"T{i}"] = ((0, np.array(pin) + LEAN - centre["coupler"]), (i, 0.5 * LEAN))
    hang = np.array(PINS["P2"]) + LEAN
    arms["H"] = ((0, hang - centre["coupler"]), (4, hang - centre["bob"]))
    rows = pin_rows(arms, 5)
    assert rows.shape == (14, 15) and np.linalg.matrix_rank(rows) == 13
    mass = np.diag([2, 2, 0.75, *([1, 1, 1 / 12] * 3), 0.5, 0.5, 0.0375])
    geometry = pt.partition.geometry(mass, rows)
    assert len(geometry.rows) == 13 and len(geometry.S) == 2
    _, _, right = np.linalg.svd(rows.T)
    self_stress = right[13]
    touched = {name: bool(np.abs(self_stress[2 * i : 2 * i + 2]).max() > 1e-9) for i, name in enumerate(arms)}
    assert [name for name, hit in touched.items() if not hit] == ["H"]

    m = swing_with_pendulum()
    start = m.assemble(rates={"P1": 1.0, "H": -2.0})
    whole = [m.simulate(1.0, initial=start, coordinates=c, rtol=1e-10) for c in ("relative", "absolute")]
    for run in whole:
        assert (
            run.success
            and run.v.shape[1] - np.linalg.matrix_rank(m.compile(run.options["coordinates"]).jacobian(run.q[0])) == 2
        )
        for name, hit in touched.items():
            assert run.joint(name).determined[:2].all() == (not hit), name
        # as if one crank fewer carried it: what is unique does not depend on what is left out
        lighter = run.joint("H").force
        np.testing.assert_allclose(lighter, whole[0].joint("H").force, atol=1e-6)


def test_universal_joint_in_a_planar_loop() -> None:
    """Three hinges and a universal joint: the loop has a condition too many by two, not by three as with four hinges.

    By the null space of the constraints' own rows in absolute coordinates: a component is unique where it has no part.
    """
    m = pt.Mechanism("loop", gravity=(0, -9.81, 0))
    a, b, c, d = (0, 0, 0), (0.15, 0.26, 0), (0.84, 0.68, 0), (1, 0, 0)
    m.add_rod("crank", start=a, end=b, mass=0.3)
    m.add_rod("coupler", start=b, end=c, mass=0.8)
    m.add_body("rocker", mass=0.7, inertia=(0.01, 0.03, 0.03), com=(0.92, 0.34, 0))  # a thin rod has none about itself
    m.add_revolute("A", m.ground, "crank", point=a)
    m.add_revolute("B", "crank", "coupler", point=b)
    m.add_revolute("C", "coupler", "rocker", point=c)
    m.add_universal("D", m.ground, "rocker", point=d, axis1=(0, 0, 1), axis2=(1, 0, 0))
    model = m.compile("absolute")
    start = m.convert(m.assemble(rates={"A": 2.0}), "absolute")
    rows = model.jacobian(start.q)
    rank = np.linalg.matrix_rank(rows, tol=1e-9)
    assert rows.shape == (19, 18) and rank == 17  # 3 x 5 + 4 conditions, one degree of freedom
    run = m.simulate(0.5, initial=m.assemble(rates={"A": 2.0}), rtol=1e-10)
    assert run.success
    for name in "ABCD":
        assert run.joint(name).determined[:2].all(), name  # forces in the plane follow from the motion
        assert not run.joint(name).determined[2], name  # forces across it do not: any could carry them


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("bearings", [0.0, 0.3])
def test_what_is_determined_of_a_double_cardan_shaft(bearings: float, coordinates: str) -> None:
    """At 12 rad/s: the middle spins about a line at rest, faster and slower; the motor changes its energy alone, and
    a cross takes no moment about its pins, so that its moment is along their common normal."""
    bend, rate, inertia = 0.5, 12.0, 0.2
    along = np.array([np.cos(bend), np.sin(bend), 0.0])
    beside = np.array([-np.sin(bend), np.cos(bend), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    m = pt.Mechanism("double Cardan", gravity=(0.0, -9.81, 0.0))
    about = (inertia, 0.1, 0.1)
    m.add_body("in", mass=1.0, inertia=about)
    m.add_body("middle", 1.0, about, position=0.5 * along, orientation=np.array([along, beside, up]).T)
    m.add_body("out", mass=1.0, inertia=about, position=along)
    m.add_revolute("A", m.ground, "in", point=(-bearings, 0, 0), axis=(1, 0, 0))
    m.add_universal("U", "in", "middle", point=(0, 0, 0), axis1=up, axis2=beside)
    m.add_universal("V", "middle", "out", point=along, axis1=beside, axis2=up)
    m.add_revolute("B", m.ground, "out", point=along + bearings * np.eye(3)[0], axis=(1, 0, 0))
    m.add_drive("A", velocity=rate, name="motor")
    t = np.linspace(0.0, 1.0, 41)
    run = m.simulate(1.0, t_eval=t, coordinates=coordinates, rtol=1e-11, atol=1e-13)
    assert run.success and run.joint("U").determined[3:].all()
    angle, bent = rate * t, np.sin(bend) ** 2
    share = 1.0 - bent * np.sin(angle) ** 2
    spin = rate * np.cos(bend) / share
    faster = rate**2 * np.cos(bend) * bent * np.sin(2.0 * angle) / share**2
    effort = inertia * spin * faster / rate
    first = np.stack([0.0 * angle, -np.sin(angle), np.cos(angle)], axis=1)
    normal = np.cross(first, np.cross(first, along))  # of both pins: the second is across the middle
    assert run.drive("motor").effort[:, 0] == pytest.approx(effort, abs=1e-10)
    moment = normal * (effort / normal[:, 0])[:, None]
    np.testing.assert_allclose(run.joint("U").moment, moment, rtol=0.0, atol=1e-8)
