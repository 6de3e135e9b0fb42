"""Gas struts: the forces of their data sheet at both ends of the stroke, an exact energy, stops."""

from __future__ import annotations

import json
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt

F1, K, STROKE, LENGTH, N = 400.0, 1.35, 0.2, 0.5, 1.3
SHEET = {"force": F1, "progression": K, "stroke": STROKE, "length": LENGTH}
COLUMN = STROKE / (1.0 - K ** (-1.0 / N))


def lift(mass: float = 45.0, at: float = 0.4, gravity: float = 9.81, **law: Any) -> pt.Mechanism:
    """A load on an upright guide above the foot of a strut, drawn at a length of the strut."""
    m = pt.Mechanism("lift", gravity=(0, -gravity, 0))
    load = m.add_body("load", mass=mass, inertia=(0.1, 0.1, 0.1), position=(0, at, 0))
    m.add_prismatic("guide", m.ground, load, axis=(0, 1, 0))
    m.add_gas_strut("strut", m.ground, (0, 0, 0), load, (0, 0, 0), **{**SHEET, **law})
    return m


def push(length: Any) -> Any:
    """The force at a length."""
    return F1 * (1.0 - (LENGTH - length) / COLUMN) ** -N


def stored(length: Any) -> Any:
    """The energy that is released from there on."""
    return F1 * COLUMN / (N - 1.0) * (1.0 - (LENGTH - length) / COLUMN) ** (1.0 - N)


@pytest.mark.parametrize(("length", "force"), [(LENGTH, F1), (LENGTH - STROKE, K * F1), (0.37, float(push(0.37)))])
def test_the_forces_of_the_data_sheet(length: float, force: float) -> None:
    run = lift(at=length).simulate(0.01, t_eval=[0.0])
    assert run.force("strut").force[0] == pytest.approx([0.0, -force, 0.0], rel=1e-12)  # on the ground
    assert run.force("strut").energy[0] == pytest.approx(stored(length), rel=1e-12)


def test_the_work_of_the_gas_is_the_energy_of_what_it_lifts() -> None:
    """Without gravity the energy between two lengths becomes speed; with it the account closes."""
    run = lift(gravity=0.0, at=0.3).simulate(0.05, t_eval=np.linspace(0, 0.05, 11), rtol=1e-10, atol=1e-12)
    length = 0.3 + run.joint("guide").displacement
    speed = np.sqrt(2.0 / 45.0 * (stored(0.3) - stored(length)))
    assert np.abs(run.joint("guide").velocity[:, 0] - speed).max() < 1e-9
    swing = lift().simulate(2.0, rtol=1e-9, atol=1e-11)
    assert swing.energy.relative_balance < 1e-8 and np.ptp(swing.energy.total) < 1e-6
    assert np.ptp(swing.joint("guide").displacement) > 0.02
    assert swing.certificate.verdict == "valid"


def test_damping_takes_what_it_is_said_to() -> None:
    run = lift(damping=150.0).simulate(3.0, t_eval=np.linspace(0, 3, 301), rtol=1e-9, atol=1e-11)
    lost = np.trapezoid(150.0 * run.joint("guide").velocity[:, 0] ** 2, run.t)
    assert run.energy.total[0] - run.energy.total[-1] == pytest.approx(lost, rel=1e-3) and lost > 0.2
    assert (np.diff(run.energy.total) < 1e-9).all() and run.energy.relative_balance < 1e-8


def test_rest_and_frequency() -> None:
    weight = float(push(0.42))
    m = lift(mass=weight / 9.81)
    found = m.equilibrium(m.assemble(targets={"guide": 0.01}))
    assert 0.4 + found.state.q[0] == pytest.approx(0.42, abs=1e-9)
    slope = N * F1 / COLUMN * (1.0 - (LENGTH - 0.42) / COLUMN) ** (-N - 1.0)
    assert m.linearize(found.state).modes().frequency[0] == pytest.approx(sqrt(slope * 9.81 / weight) / (2 * pi))


def test_stops_hold_it_within_its_stroke() -> None:
    """A light load flies up to full extension, a heavy one falls to full compression; steps end at the stops."""
    for mass, stop, sign in ((20.0, LENGTH, 1.0), (90.0, LENGTH - STROKE, -1.0)):
        run = lift(mass=mass, end_stiffness=1e6).simulate(1.5, t_eval=np.linspace(0, 1.5, 301), rtol=1e-8, atol=1e-10)
        assert run.success and run.energy.relative_balance < 1e-5
        beyond = sign * (0.4 + run.joint("guide").displacement - stop)
        assert 0.0 < beyond.max() < 0.02
        free = sign * (0.4 + lift(mass=mass).simulate(0.4).joint("guide").displacement - stop)
        assert free.max() > 0.05
    hidden = lift(mass=20.0, end_stiffness=1e8).simulate(0.6, t_eval=[0.0, 0.6], method="rk4", step=0.3)
    assert not hidden.success and 'gas strut "strut"' in hidden.message


def test_a_strut_is_the_force_law_that_says_the_same() -> None:
    """Between two bodies in space, off their centres, in both kinds of coordinates."""

    def pair(strut: bool) -> pt.Mechanism:
        m = pt.Mechanism("pair", gravity=(0.3, -9.81, 0.4))
        a = m.add_body("a", mass=1.0, inertia=(0.02, 0.03, 0.04))
        b = m.add_body("b", mass=0.6, inertia=(0.01, 0.02, 0.02), com=(0.1, 0, 0), position=(0.6, 0.1, 0.2))
        m.add_spherical("A", m.ground, a, point=(0, 0, 0))
        m.add_free("B", m.ground, b)
        ends = [(a, (0.3, 0.1, 0)), (b, (0, 0, 0.1))]
        if strut:
            m.add_gas_strut("S", *ends[0], *ends[1], **SHEET, damping=2.0)
            return m

        def law(t: float, one: Any, other: Any) -> Any:
            apart = other.position - one.position
            far = np.linalg.norm(apart)
            pull = 2.0 * (apart @ (other.velocity - one.velocity)) / far - push(far)
            return pull * apart / far, -pull * apart / far

        m.add_force_law("S", law, sees=ends, on=ends)
        return m

    strut, model, other = pair(True), pair(True).compile(), pair(False).compile()
    rng = np.random.default_rng(5)
    for _ in range(10):
        start = strut.assemble(rates={"A": rng.normal(size=3), "B": rng.normal(size=6)})
        found, wanted = model.acceleration(start.q, start.v)[0], other.acceleration(start.q, start.v)[0]
        assert np.abs(found - wanted).max() < 1e-11 * np.abs(wanted).max()
    run, absolute = (strut.simulate(0.1, rtol=1e-9, atol=1e-11, coordinates=x) for x in ("relative", "absolute"))
    assert np.abs(run.body("b").position[-1] - absolute.body("b").position[-1]).max() < 1e-6


def test_files_changes_parameters_and_pictures(tmp_path: Path) -> None:
    m = lift(damping="0.1 kN s/m", end_stiffness="1 kN/mm")
    m.save(tmp_path / "lift.toml")
    again = pt.load(tmp_path / "lift.toml")
    assert again.to_spec() == m.to_spec() and json.loads(json.dumps(m.to_spec())) == m.to_spec()
    assert np.array_equal(again.simulate(1.0).q, m.simulate(1.0).q)
    assert (again.forces["strut"].damping, again.forces["strut"].exponent) == (100.0, 1.3)
    text = (tmp_path / "lift.toml").read_text("utf-8")
    assert "[[gas_strut]]" in text and "exponent" not in text
    names = dict(m.compile().parameters)
    assert {f"strut.{x}" for x in ("force", "progression", "stroke", "length", "damping", "end_stiffness")} <= set(
        names
    )
    still = np.zeros(1), np.zeros(1)
    stiffer = m.compile().with_parameters({"strut.force": "0.5 kN", "strut.progression": 1.5})
    m.forces["strut"].change(force=500.0, progression=1.5)
    assert np.array_equal(stiffer.acceleration(*still)[0], m.compile().acceleration(*still)[0])
    assert lift(length=None, at=0.45).forces["strut"].length is None
    page = tmp_path / "lift.html"
    again.simulate(0.1).to_html(page)
    assert '"rods":[[0,0.3,0.9],[0.3,null,0.4]]' in page.read_text("utf-8").replace("0.0,", "0,")


def test_bad_struts_are_named() -> None:
    for word, value in (
        ("force", 0.0), ("force", -1.0), ("progression", 1.0), ("stroke", 0.0), ("stroke", 0.5), ("length", 0.1),
        ("exponent", 1.0), ("damping", -1.0), ("end_stiffness", -1.0), ("force", float("nan")),
    ):  # fmt: skip
        with pytest.raises(pt.errors.PartitaError, match="stroke" if word == "length" else word):
            lift(**{word: value})
    m = lift()
    with pytest.raises(pt.errors.PartitaError, match="both ends are on"):
        m.add_gas_strut("bad", m.bodies["load"], (0, 0, 0), m.bodies["load"], (1, 0, 0), **SHEET)
    assert list(m.forces) == ["strut"]
