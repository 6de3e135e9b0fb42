"""Ropes: they pull and never push, exactly from where they are taut."""

from __future__ import annotations

from math import atan2, cos, pi, sin, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt

G = 9.81


def hoist(stiffness: float = 2000.0, length: float = 1.5, **law: float) -> pt.Mechanism:
    """A load of 2 kg on an upright guide falls from 1 m below its anchor into a rope."""
    m = pt.Mechanism("hoist", gravity=(0, -G, 0))
    load = m.add_body("load", mass=2.0, inertia=(0.01, 0.01, 0.01), position=(0, -1, 0))
    m.add_prismatic("guide", m.ground, load, axis=(0, 1, 0))
    m.add_rope("rope", m.ground, (0, 0, 0), load, (0, 0, 0), stiffness=stiffness, length=length, **law)
    return m


def fallen(t: float, stiffness: float = 2000.0) -> float:
    """Where the load is: half a metre of fall, half a swing about the point of rest, and so on."""
    w, fall = sqrt(stiffness / 2.0), sqrt(2 * 0.5 / G)
    speed, rest = G * fall, G / w**2
    size, phase = np.hypot(rest, speed / w), atan2(-rest, speed / w)
    taut = (pi - 2 * phase) / w
    t %= 2 * fall + taut
    if t <= fall:
        return -0.5 * G * t**2
    if t <= fall + taut:
        return -0.5 - rest - size * sin(w * (t - fall) + phase)
    up = t - fall - taut
    return -0.5 + speed * up - 0.5 * G * up**2


@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10])
@pytest.mark.parametrize("outputs", [2, 21, 201])
def test_a_load_that_falls_into_a_rope(rtol: float, outputs: int) -> None:
    t = np.linspace(0.0, 2.3, outputs)
    run = hoist().simulate(2.3, t_eval=t, rtol=rtol, atol=rtol / 100)
    assert run.success, run.message
    found = run.joint("guide").displacement
    assert np.abs(found - [fallen(x) for x in t]).max() < 100 * rtol
    assert np.abs(run.energy.relative_balance).max() < 1e3 * rtol
    force = run.force("rope").force
    assert force.shape[0] == outputs and (force[found > -0.5 + 1e-9] == 0.0).all()


def test_a_rope_that_is_taut_for_an_instant_is_not_stepped_over() -> None:
    """Thrown up half a millimetre farther than the rope is long: taut for 15 ms of a flight that takes few steps."""
    m = pt.Mechanism("thrown", gravity=(0, -G, 0))
    load = m.add_body("load", mass=1.0, inertia=(0.01, 0.01, 0.01), position=(0, 0.2, 0))
    m.add_prismatic("guide", m.ground, load, axis=(0, 1, 0))
    m.add_rope("rope", m.ground, (0, 0, 0), load, (0, 0, 0), stiffness=4e4, length=1.0)
    w, speed, meets = 200.0, sqrt(2 * G * 0.8005), sqrt(2 * G * 0.0005)
    taut = 2 / w * np.arctan(meets * w / G)
    end = 0.7
    late = end - (speed - meets) / G - taut
    wanted = 0.8 - meets * late - 0.5 * G * late**2
    for rtol in (1e-4, 1e-8):
        for outputs in (2, 51):
            start = m.assemble(rates={"guide": speed})
            run = m.simulate(end, t_eval=np.linspace(0, end, outputs), initial=start, rtol=rtol, atol=rtol / 100)
            assert run.success
            assert run.joint("guide").displacement[-1] == pytest.approx(wanted, abs=100 * rtol * 0.05)


def test_a_rope_never_pushes_and_damping_takes_energy() -> None:
    run = hoist(damping=0.3).simulate(3.0, t_eval=np.linspace(0.0, 3.0, 301))
    assert run.success
    energy = run.energy.total
    assert energy[-1] < energy[0] - 1.0 and (np.diff(energy) < 1e-6).all()
    assert run.joint("guide").displacement.min() > fallen(0.33) - 0.1


def three(kind: str) -> pt.Mechanism:
    """Two bodies with a rope between points off their centres, in space."""
    m = pt.Mechanism("three", gravity=(0.3, -G, 0.4))
    a = m.add_body("a", mass=1.0, inertia=(0.02, 0.03, 0.04), position=(0, 0, 0))
    b = m.add_body("b", mass=0.6, inertia=(0.01, 0.02, 0.02), com=(0.1, 0, 0), position=(0.8, 0.1, 0.2))
    m.add_spherical("A", m.ground, a, point=(0, 0, 0))
    m.add_free("B", m.ground, b)
    law = {"stiffness": 300.0, "damping": 0.05}
    if kind == "rope":
        m.add_rope("R", a, (0.3, 0.1, 0), b, (0, 0, 0.1), length=0.45, **law)
    else:

        def pull(t: float, one: Any, other: Any) -> Any:
            apart = other.position - one.position
            far = np.linalg.norm(apart)
            stretch, rate = far - 0.45, apart @ (other.velocity - one.velocity) / far
            tension = max(0.0, 300.0 * stretch * (1.0 + 0.05 * rate)) if stretch > 0 else 0.0
            return tension * apart / far, -tension * apart / far

        ends = [(a, (0.3, 0.1, 0)), (b, (0, 0, 0.1))]
        m.add_force_law("R", pull, sees=ends, on=ends)
    return m


def test_a_rope_is_the_force_law_that_says_the_same() -> None:
    rope, law = three("rope"), three("law")
    rng = np.random.default_rng(3)
    model, other = rope.compile(), law.compile()
    taut = 0
    for _ in range(20):
        start = rope.assemble(rates={"A": rng.normal(size=3), "B": rng.normal(size=6)})
        q = start.q.copy()
        q[4:7] += rng.normal(size=3) * 0.3
        found, wanted = model.acceleration(q, start.v)[0], other.acceleration(q, start.v)[0]
        assert np.abs(found - wanted).max() < 1e-11 * (1.0 + np.abs(wanted).max())
        taut += bool(np.abs(found - wanted).max() == 0.0)
    run = rope.simulate(1.5, rtol=1e-9, atol=1e-11)
    absolute = rope.simulate(1.5, rtol=1e-9, atol=1e-11, coordinates="absolute")
    assert run.success and absolute.success
    assert np.abs(run.body("b").position[-1] - absolute.body("b").position[-1]).max() < 1e-6
    assert run.certificate.verdict == "valid"


def test_a_pendulum_on_a_rope_swings_as_one_on_a_rod() -> None:
    """A stiff rope that stays taut; in the plane, and the same out of it."""
    periods = []
    for axis in ((0, 0, 1), (0, 0.6, 0.8)):
        m = pt.Mechanism("pendulum", gravity=(0, -G, 0))
        start = (1.0 + G * cos(0.3) / 1e5) * np.array([sin(0.3), -cos(0.3), 0.0])  # stretched by what hangs in it
        bob = m.add_body("bob", mass=1.0, inertia=(1e-4, 1e-4, 1e-4), position=start)
        m.add_planar("P", m.ground, bob, point=start, normal=(0, 0, 1)) if axis[1] == 0 else m.add_free(
            "P", m.ground, bob
        )
        m.add_rope("R", m.ground, (0, 0, 0), bob, (0, 0, 0), stiffness=1e5, length=1.0)
        run = m.simulate(2.0, t_eval=np.linspace(0, 2, 201), rtol=1e-8, atol=1e-10)
        assert run.success
        x = run.body("bob").position[:, 0]
        crossing = np.nonzero((x[:-1] > 0) & (x[1:] <= 0))[0][0]
        periods.append(4 * np.interp(0.0, [x[crossing + 1], x[crossing]], [run.t[crossing + 1], run.t[crossing]]))
    assert periods[0] == pytest.approx(2 * pi / sqrt(G) * (1 + 0.3**2 / 16), rel=2e-3)
    assert periods[1] == pytest.approx(periods[0], rel=1e-6)


def test_equilibrium_and_frequency_of_what_hangs_in_a_rope() -> None:
    m = hoist()
    found = m.equilibrium(m.assemble(targets={"guide": -0.52}))
    assert found.state.q[0] == pytest.approx(-0.5 - 2.0 * G / 2000.0, abs=1e-9)
    modes = m.linearize(found.state).modes()
    assert modes.frequency[0] == pytest.approx(sqrt(1000.0) / (2 * pi), rel=1e-9)


def test_files_changes_and_parameters(tmp_path: Path) -> None:
    m = hoist(exponent=1.5, damping=0.1)
    m.save(tmp_path / "hoist.toml")
    again = pt.load(tmp_path / "hoist.toml")
    assert again.forces["rope"].length == 1.5 and again.forces["rope"].exponent == 1.5
    assert np.array_equal(again.simulate(1.0).q, m.simulate(1.0).q)
    m.forces["rope"].length = 1.2
    assert m.simulate(0.5).joint("guide").displacement.min() > -0.4
    assert "rope.length" in dict(m.compile().parameters)
    drawn = pt.Mechanism("drawn")
    box = drawn.add_body("box", mass=1.0, inertia=(1, 1, 1), position=(0, -2, 0))
    drawn.add_free("F", drawn.ground, box)
    assert drawn.add_rope("R", drawn.ground, (0, 0, 0), box, (0, 0, 0), stiffness=10.0).length is None
    assert drawn.compile().with_parameters({"R.length": 1.0}) is not None


def test_bad_ropes_are_named() -> None:
    m = hoist()
    load = m.bodies["load"]

    def bad(match: str, *ends: Any, **law: Any) -> None:
        with pytest.raises(pt.errors.PartitaError, match=match):
            m.add_rope("bad", *(ends or (m.ground, (0, 0, 0), load, (0, 0, 0))), **{"stiffness": 1.0, **law})

    bad("both ends are on", load, (0, 0, 0), load, (1, 0, 0))
    bad("length", length=0.0)
    bad("length", m.ground, (0, -1, 0), load, (0, 0, 0))
    bad("stiffness", stiffness=-1.0)
    bad("damping", damping=-1.0)
    bad("exponent", exponent=0.5)
    bad("stiffness", stiffness=float("nan"))
    assert list(m.forces) == ["rope"]


def test_a_step_of_fixed_length_that_hides_a_taut_rope_is_reported() -> None:
    m = hoist(stiffness=2e5)
    run = m.simulate(0.75, t_eval=[0.0, 0.75], method="rk4", step=0.375)
    assert not run.success
