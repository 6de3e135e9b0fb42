"""Contacts and stops between evaluations: none is stepped over, whatever the tolerance and the outputs.

The reference takes steps of a twentieth of the time of a contact, so that no step could miss one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
import pytest

import partita as pt


@dataclass
class Case:
    """A drawing, its start, how long it moves, and a time that no contact undercuts."""

    mechanism: pt.Mechanism
    start: pt.State
    time: float
    contact: float


def duration(mass: float, stiffness: float, speed: float) -> float:
    """Of an elastic contact with the exponent 3/2."""
    return float(3.2 * (mass / stiffness) ** 0.4 / speed**0.2)


def ball(m: pt.Mechanism, name: str, mass: float, radius: float, position: tuple[float, float, float]) -> pt.Body:
    """A free solid ball."""
    body = m.add_body(name, mass=mass, inertia=[0.4 * mass * radius**2] * 3, position=position)
    m.add_free(f"free {name}", m.ground, body)
    return body


def balls(rng: np.random.Generator, beside: float | None = None) -> Case:
    """One ball flies onto another."""
    m = pt.Mechanism("balls", gravity=(0, 0, 0))
    (r1, r2), (m1, m2) = rng.uniform(0.02, 0.08, 2), rng.uniform(0.05, 1.0, 2)
    distance, speed, stiffness = rng.uniform(0.3, 2.0), rng.uniform(0.5, 20.0), 10 ** rng.uniform(5, 8)
    offset = rng.uniform(-1.2, 1.2) * (r1 + r2) if beside is None else beside * (r1 + r2)
    a, b = ball(m, "a", m1, r1, (-distance, offset, 0.0)), ball(m, "b", m2, r2, (0.0, 0.0, 0.0))
    m.add_contact("c", a, (0, 0, 0), b, (0, 0, 0), radius1=r1, radius2=r2, stiffness=stiffness)
    start = m.assemble(rates={"free a": [speed, 0, 0, 0, 0, 0]})
    return Case(m, start, 2 * distance / speed, duration(m1 * m2 / (m1 + m2), stiffness, speed))


def pin(rng: np.random.Generator) -> Case:
    """A pendulum swings onto a pin."""
    m = pt.Mechanism("pin", gravity=(0, -9.81, 0))
    length, angle, at = rng.uniform(0.3, 1.5), rng.uniform(0.3, 2.5), rng.uniform(-1.0, 0.2)
    ball_radius, pin_radius = rng.uniform(0.01, 0.05), rng.uniform(0.005, 0.03)
    rod = m.add_rod("rod", start=(0, 0, 0), end=(length * np.sin(angle), -length * np.cos(angle), 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0), axis=(0, 0, 1))
    far = length + rng.uniform(-0.9, 0.9) * (ball_radius + pin_radius)
    stiffness = 10 ** rng.uniform(4.5, 7.5)
    m.add_contact(
        "c",
        rod,
        (length, 0, 0),
        m.ground,
        (far * np.sin(at), -far * np.cos(at), 0),
        radius1=ball_radius,
        radius2=pin_radius,
        stiffness=stiffness,
    )
    return Case(m, m.assemble(), rng.uniform(1.0, 3.0), duration(0.3, stiffness, sqrt(2 * 9.81 * length)))


def glancing(rng: np.random.Generator) -> Case:
    """Three balls, the first of which may touch both others."""
    m = pt.Mechanism("three", gravity=(0, 0, 0))
    stiffness, speed, radii = 10 ** rng.uniform(5, 7.5), rng.uniform(1, 15), rng.uniform(0.03, 0.08, 3)
    points = [
        (-1.0, rng.uniform(-0.08, 0.08), 0.0),
        (0.0, 0.0, 0.0),
        (rng.uniform(0.3, 0.8), rng.uniform(-0.15, 0.15), 0.0),
    ]
    bodies = [ball(m, str(i), rng.uniform(0.05, 0.5), radii[i], points[i]) for i in range(3)]
    for i, j in ((1, 0), (2, 0), (2, 1)):
        of = {"radius1": radii[i], "radius2": radii[j], "stiffness": stiffness}
        m.add_contact(f"{i} {j}", bodies[i], (0, 0, 0), bodies[j], (0, 0, 0), **of)
    start = m.assemble(rates={"free 0": [speed, 0, 0, 0, 0, 0]})
    return Case(m, start, 4 / speed, duration(0.1, stiffness, speed))


def arms(rng: np.random.Generator) -> Case:
    """Two arms that turn freely and strike each other with their tips: where both move alike at the ends of a step,
    they are far faster against each other inside it."""
    m = pt.Mechanism("arms", gravity=(0, 0, 0))
    apart, radii = rng.uniform(1.85, 1.99), rng.uniform(0.02, 0.05, 2)
    a = m.add_rod("a", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    b = m.add_rod("b", start=(apart, 0, 0), end=(apart, -1, 0), mass=2.0)
    m.add_revolute("A", m.ground, a, point=(0, 0, 0))
    m.add_revolute("B", m.ground, b, point=(apart, 0, 0))
    stiffness = 10 ** rng.uniform(5.5, 7)
    m.add_contact("c", a, (1, 0, 0), b, (1, 0, 0), radius1=radii[0], radius2=radii[1], stiffness=stiffness)
    rates = {"A": rng.uniform(5, 30), "B": -rng.uniform(5, 30)}
    return Case(m, m.assemble(rates=rates), rng.uniform(1, 2), duration(0.5, stiffness, 40.0))


def whip(rng: np.random.Generator) -> Case:
    """A double pendulum whose tip strikes a ball as it is flung past it."""
    m = pt.Mechanism("whip", gravity=(0, -9.81, 0))
    lengths, masses = rng.uniform(0.3, 0.8, 2), (rng.uniform(1, 3), rng.uniform(0.05, 0.3))
    joint = (lengths[0], 0.0, 0.0)
    inner = m.add_rod("inner", start=(0, 0, 0), end=joint, mass=masses[0])
    outer = m.add_rod("outer", start=joint, end=(lengths.sum(), 0, 0), mass=masses[1])
    m.add_revolute("A", m.ground, inner, point=(0, 0, 0))
    m.add_revolute("B", inner, outer, point=joint)
    angle, far, radius = rng.uniform(0, 2 * pi), rng.uniform(0.7, 1.05) * lengths.sum(), rng.uniform(0.01, 0.04)
    centre = (far * np.cos(angle), far * np.sin(angle), 0.0)
    stiffness = 10 ** rng.uniform(5, 7)
    of = {"radius1": radius, "radius2": radius, "stiffness": stiffness}
    m.add_contact("c", outer, (lengths[1], 0, 0), m.ground, centre, **of)
    rates = {"A": rng.uniform(-12, 12), "B": rng.uniform(-25, 25)}
    return Case(m, m.assemble(rates=rates), 0.4, duration(0.1, stiffness, 15.0))


@pytest.mark.parametrize("draw", [balls, pin, glancing], ids=lambda f: f.__name__)
def test_no_contact_is_stepped_over(draw: Callable[[np.random.Generator], Case]) -> None:
    for seed in range(6):
        case = draw(np.random.default_rng(seed))
        m, start, end = case.mechanism, case.start, case.time
        tight = {"rtol": 1e-11, "atol": 1e-13, "max_step": case.contact / 20}
        reference = m.simulate(end, t_eval=[end], initial=start, **tight)
        for rtol in (1e-4, 1e-7):
            for outputs in (2, 21, 201):
                run = m.simulate(end, t_eval=np.linspace(0, end, outputs), initial=start, rtol=rtol, atol=rtol / 100)
                assert run.success and run.certificate.verdict != "invalid", (seed, rtol, outputs, run.message)
                error = np.abs(run.v[-1] - reference.v[-1]).max() / np.abs(reference.v).max()
                assert error < 300 * rtol, (seed, rtol, outputs, error)  # what glancing contacts make of a tolerance


def test_the_end_of_a_contact_is_as_exact_as_its_start() -> None:
    """At a corner of the force an estimate of high order is the square of a small number, by chance far too small."""
    case = pin(np.random.default_rng([134, 1]))
    m, end = case.mechanism, case.time
    tight = {"rtol": 1e-11, "atol": 1e-13, "max_step": case.contact / 100}
    reference = m.simulate(end, t_eval=[end], initial=case.start, **tight)
    for rtol in np.geomspace(1e-8, 1e-7, 41):
        run = m.simulate(end, t_eval=[end], initial=case.start, rtol=rtol, atol=rtol / 100)
        assert run.certificate.verdict == "valid"
        assert abs(run.v[-1, 0] - reference.v[-1, 0]) < 100 * rtol, rtol


def test_balls_that_meet_head_on_exchange_their_momentum() -> None:
    for seed in range(3):
        case = balls(np.random.default_rng(seed), beside=0.0)
        run = case.mechanism.simulate(case.time, t_eval=[0.0, case.time], initial=case.start, rtol=1e-9, atol=1e-12)
        m1, m2 = (case.mechanism.bodies[name].mass for name in ("a", "b"))
        before = run.v[0, 0]
        after = np.array([(m1 - m2) * before, 2 * m1 * before]) / (m1 + m2)
        assert np.allclose(run.v[-1][[0, 6]], after, rtol=1e-7)


def test_a_driven_body_strikes_one_at_rest() -> None:
    """All that is independent stands still at the touch; off what is driven at v a block leaves with 2 v."""
    m = pt.Mechanism("ram", gravity=(0, 0, 0))
    ram = m.add_body("ram", mass=1.0, inertia=(1e-3, 1e-3, 1e-3), position=(-1.0, 0, 0))
    block = m.add_body("block", mass=1.0, inertia=(1e-3, 1e-3, 1e-3))
    for name, body in (("R", ram), ("B", block)):
        m.add_prismatic(name, m.ground, body, point=(0, 0, 0), axis=(1, 0, 0))
    m.add_drive("R", velocity=3.0)
    m.add_contact("c", ram, (0, 0, 0), block, (0, 0, 0), radius1=0.05, radius2=0.05, stiffness=1e8)
    for outputs in (2, 101):
        run = m.simulate(0.6, t_eval=np.linspace(0, 0.6, outputs), initial=m.assemble(rates={"R": 3.0}))
        assert run.success, run.message
        assert run.joint("B").velocity[-1, 0] == pytest.approx(6.0, rel=1e-6)


def bouncing_disc(**stop: float) -> pt.Mechanism:
    """A disc that turns freely between two stiff ends."""
    m = pt.Mechanism("disc", gravity=(0, 0, 0))
    disc = m.add_body("disc", mass=1.0, inertia=(1e-2, 1e-2, 2e-2))
    m.add_revolute("A", m.ground, disc, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_stop("A", name="ends", **stop)
    return m


def test_a_stop_is_met_where_it_is() -> None:
    """Free between the ends, half a swing of the stiffness 4e4 N m/rad on 2e-2 kg m^2 in each (7 ms)."""
    m = bouncing_disc(lower=-1.0, upper=1.0, stiffness=4e4, exponent=1.0)
    start = m.assemble(rates={"A": 10.0})
    half = pi * sqrt(2e-2 / 4e4)
    period = 2 * (0.2 + half)
    for outputs in (2, 21, 201):
        t = np.linspace(0.0, 7 * period, outputs)
        run = m.simulate(t[-1], t_eval=t, initial=start, rtol=1e-6, atol=1e-8)
        assert run.success
        assert abs(run.joint("A").position[-1, 0]) < 1e-4
        assert abs(run.joint("A").velocity[-1, 0] - 10.0) < 1e-3


def test_a_step_of_fixed_length_that_hides_a_contact_is_reported() -> None:
    case = balls(np.random.default_rng(1), beside=0.0)
    end = 0.8 * case.time  # no stage of its two steps lies between 0.42 and 0.58 of the time, where the balls overlap
    run = case.mechanism.simulate(end, t_eval=[end], initial=case.start, method="rk4", step=end / 2)
    assert not run.success
    assert 'contact "c"' in run.message and "within one step" in run.message
    sim = case.mechanism.stepper(end, initial=case.start)
    with pytest.raises(pt.errors.PartitaError, match='contact "c"'):
        for _ in range(2):
            sim.step()


@pytest.mark.parametrize("outputs", [1, 2, 9])
def test_energy_that_a_step_of_fixed_length_gains_invalidates_whatever_is_recorded(outputs: int) -> None:
    """A stage of a step lies where the balls overlap almost wholly, all others outside: they fly apart a thousand times
    as fast. An only output has nothing before it but the start."""
    case = balls(np.random.default_rng(1), beside=1e-6)
    t_eval = np.linspace(0.0, case.time, outputs + 1)[1:]
    for steps in (3, 5):
        run = case.mechanism.simulate(
            case.time, t_eval=t_eval, initial=case.start, method="rk4", step=case.time / steps
        )
        assert np.abs(run.v[-1]).max() > 1e3 * np.abs(case.start.v).max()
        assert run.status == "invalid" and "energy balance" in run.message


def test_a_contact_too_soft_for_its_bodies_is_noted() -> None:
    m = pt.Mechanism("soft", gravity=(0, 0, 0))
    a, b = ball(m, "a", 1.0, 0.05, (-0.5, 0.0, 0.0)), ball(m, "b", 1.0, 0.05, (0.0, 0.0, 0.0))
    m.add_contact("c", a, (0, 0, 0), b, (0, 0, 0), radius1=0.05, radius2=0.05, stiffness=1e3)
    held = 1e3 * 0.1**2.5 / 2.5  # all it can store; at 1 m/s the relative motion has 0.25 J
    fast = m.simulate(1.0, initial=m.assemble(rates={"free a": [3.0, 0, 0, 0, 0, 0]}))
    assert fast.success and any("too soft" in note and f"{held:.5f}"[:6] in note for note in fast.notes)
    slow = m.simulate(1.0, initial=m.assemble(rates={"free a": [1.0, 0, 0, 0, 0, 0]}))
    assert slow.success and not any("too soft" in note for note in slow.notes)


@pytest.mark.parametrize("draw", [arms, whip], ids=lambda f: f.__name__)
def test_what_is_faster_inside_a_step_than_at_its_ends_touches(draw: Callable[[np.random.Generator], Case]) -> None:
    """No contact may be missed: the first one of each motion is compared, since errors grow with each."""
    for seed in range(12):
        case = draw(np.random.default_rng([3, seed]))
        m, start = case.mechanism, case.start
        # from contact to contact: the gap of a run in short steps tells when the first one ends
        t = np.linspace(0, case.time, 2001)
        fine = m.simulate(case.time, t_eval=t, initial=start, rtol=1e-10, atol=1e-12, max_step=case.contact / 4)
        loads = np.linalg.norm(fine.force("c").force, axis=1)
        touched = np.flatnonzero(loads > 0)
        first = touched[0] if len(touched) else len(t) - 2
        after = np.flatnonzero(loads[first:] == 0)
        end = t[min(first + after[0] + 1, len(t) - 1)] if len(after) else t[-1]
        reference = m.simulate(end, t_eval=[end], initial=start, rtol=1e-11, atol=1e-13, max_step=case.contact / 20)
        for outputs in (2, 201):
            run = m.simulate(end, t_eval=np.linspace(0, end, outputs), initial=start)
            error = np.abs(run.v[-1] - reference.v[-1]).max() / np.abs(reference.v).max()
            assert run.success and error < 1e-3, (seed, outputs, error)


def test_two_arms_strike_each_other_twice() -> None:
    m = pt.Mechanism("arms", gravity=(0, 0, 0))
    a = m.add_rod("a", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    b = m.add_rod("b", start=(1.9, 0, 0), end=(1.9, -1, 0), mass=2.0)
    m.add_revolute("A", m.ground, a, point=(0, 0, 0))
    m.add_revolute("B", m.ground, b, point=(1.9, 0, 0))
    radii = {"radius1": 0.02, "radius2": 0.03813182853730587}
    m.add_contact("c", a, (1, 0, 0), b, (1, 0, 0), **radii, stiffness=1194861.1041387145)
    start = m.assemble(rates={"A": 23.735581638913793, "B": -24.556790688748762})
    end = 2.195533431651355
    for outputs in (2, 201):
        run = m.simulate(end, t_eval=np.linspace(0, end, outputs), initial=start)
        assert run.success and run.certificate.verdict == "valid"
        # steps of a thousandth of a second, at the tolerance 1e-11
        assert np.allclose(run.v[-1], [27.72046459, -22.37214358], rtol=1e-4)
