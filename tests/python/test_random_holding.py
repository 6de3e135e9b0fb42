"""Random mechanisms with several elements that hold at times: what each carries, how it moves, and the accounts."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from thorough import either

import partita as pt
from partita.errors import ArgumentError

KINDS = ("chain", "slider-crank", "five-bar", "parallelogram")


def drawing(kind: str, rng: np.random.Generator) -> tuple[pt.Mechanism, list[str], list[str]]:
    """A planar mechanism, its joints, and those whose rates are free."""
    m = pt.Mechanism(kind, gravity=(0, -9.81, 0))

    def link(name: str, start: Any, end: Any) -> pt.Body:
        middle = 0.5 * (np.array(start) + np.array(end))
        inertia = (0.06, 0.06, rng.uniform(0.02, 0.1))
        return m.add_body(name, mass=rng.uniform(0.3, 1.5), inertia=inertia, position=tuple(middle))

    def at(x: float, y: float, length: float, angle: float) -> tuple[float, float, float]:
        return x + length * math.cos(angle), y + length * math.sin(angle), 0.0

    origin = (0.0, 0.0, 0.0)
    if kind == "chain":
        parent, x = m.ground, origin
        for i in range(3):
            end = at(x[0], x[1], rng.uniform(0.3, 0.6), rng.uniform(0, 2 * math.pi))
            body = link(f"link {i}", x, end)
            if i == 1 and rng.random() < 0.4:
                m.add_prismatic(f"J{i}", parent, body, point=x, axis=tuple(np.subtract(end, x)))
            else:
                m.add_revolute(f"J{i}", parent, body, point=x)
            parent, x = body, end
        return m, ["J0", "J1", "J2"], ["J0", "J1", "J2"]
    if kind == "slider-crank":
        pin = at(0, 0, 0.3, rng.uniform(0.4, 2.7))
        wrist = (pin[0] + math.sqrt(rng.uniform(0.6, 1.0) ** 2 - pin[1] ** 2), 0.0, 0.0)
        crank, rod, slider = link("crank", origin, pin), link("rod", pin, wrist), link("slider", wrist, wrist)
        m.add_revolute("A", m.ground, crank, point=origin)
        m.add_revolute("B", crank, rod, point=pin)
        m.add_revolute("C", rod, slider, point=wrist)
        m.add_prismatic("S", m.ground, slider, point=wrist, axis=(1, 0, 0))
        return m, ["A", "B", "C", "S"], ["A"]
    if kind == "five-bar":
        left, right = at(0, 0, 0.5, rng.uniform(1.2, 2.2)), at(1, 0, 0.5, rng.uniform(0.8, 1.9))
        between = np.subtract(right, left)
        apart = float(np.hypot(between[0], between[1]))
        height = math.sqrt(max(0.8, 0.55 * apart) ** 2 - 0.25 * apart**2)
        up = np.array([-between[1], between[0], 0.0]) / apart
        top = tuple(np.array(left) + 0.5 * between + height * up)
        ends = {"a": (origin, left), "b": (left, top), "c": (right, top), "d": ((1.0, 0.0, 0.0), right)}
        bodies = {name: link(name, *both) for name, both in ends.items()}
        m.add_revolute("A", m.ground, bodies["a"], point=origin)
        m.add_revolute("B", bodies["a"], bodies["b"], point=left)
        m.add_revolute("C", bodies["b"], bodies["c"], point=top)
        m.add_revolute("D", bodies["d"], bodies["c"], point=right)
        m.add_revolute("E", m.ground, bodies["d"], point=(1, 0, 0))
        return m, ["A", "B", "C", "D", "E"], ["A", "E"]
    arm = np.array(at(0, 0, 0.4, rng.uniform(0.5, 2.6)))
    hinges = [np.array([x, 0.0, 0.0]) for x in (0.0, 0.5, 1.2)]
    bar = link("bar", hinges[0] + arm, hinges[2] + arm)
    for i, point in enumerate(hinges):
        crank = link(f"crank {i}", point, point + arm)
        m.add_revolute(f"O{i}", m.ground, crank, point=tuple(point))
        m.add_revolute(f"P{i}", crank, bar, point=tuple(point + arm))
    return m, [f"{end}{i}" for end in "OP" for i in range(3)], ["O0"]


def elements(joints: list[str], rng: np.random.Generator) -> list[tuple[str, str, dict[str, Any]]]:
    """Kind, joint and arguments of two to four elements."""
    found: list[tuple[str, str, dict[str, Any]]] = []
    for _ in range(rng.integers(2, 5)):
        kind, joint = rng.choice(["friction", "friction", "freewheel", "stop"]), str(rng.choice(joints))
        if kind == "friction":
            dynamic = rng.uniform(0.1, 3.0)
            found.append((kind, joint, {"dynamic": dynamic, "static": dynamic * rng.choice([1.0, 1.0, 1.5])}))
        elif not any(other[:2] == (kind, joint) for other in found):
            sense, bound = int(rng.choice([-1, 1])), rng.uniform(0.05, 0.8)
            stop = {"restitution": rng.choice([0.0, 0.5]), "upper" if sense > 0 else "lower": sense * bound}
            found.append((kind, joint, {"free": sense} if kind == "freewheel" else stop))
    return found


def run_of(seed: int, backwards: bool = False) -> tuple[pt.Result, list[tuple[str, str, dict[str, Any]]]]:
    rng = np.random.default_rng(seed)
    m, joints, free = drawing(KINDS[seed % len(KINDS)], rng)
    found = elements(joints, rng)
    for i in list(range(len(found)))[:: -1 if backwards else 1]:
        kind, joint, arguments = found[i]
        add: Any = {"friction": m.add_friction, "freewheel": m.add_freewheel, "stop": m.add_stop}[kind]
        add(joint, **arguments, name=f"{kind} {i}")
    coordinates = "absolute" if rng.random() < 0.3 else "relative"
    still = rng.random() < 0.2
    start = m.assemble(rates={name: 0.0 if still else 2.0 * rng.normal() for name in free}, coordinates=coordinates)
    times = np.linspace(0.0, 0.5, 26)
    run = m.simulate(0.5, initial=start, coordinates=coordinates, t_eval=times, rtol=1e-9, atol=1e-9)
    return run, found


@pytest.mark.parametrize("seed", range(either(48, 160)))
def test_what_holds_obeys_its_law_at_every_output(seed: int) -> None:
    """Friction never carries more than it can and resists the motion; freewheels and stops push, on the free side;
    energy never grows; motion does not depend on the order in which elements were added."""
    try:
        run, found = run_of(seed)
    except ArgumentError as error:
        # several combinations with more at rest than in motion, of which none holds
        assert "cannot be decided" in str(error)
        return
    for i, (kind, joint, law) in enumerate(found):
        effort = run.force(f"{kind} {i}").effort
        rate, position = np.ravel(run.joint(joint).velocity), np.ravel(run.joint(joint).position)
        if kind == "friction":
            assert np.abs(effort).max() <= law["static"] * (1.0 + 1e-8)
            slips = np.abs(rate) > 1e-6
            assert effort[slips] == pytest.approx(-law["dynamic"] * np.sign(rate[slips]), rel=1e-9)
        elif kind == "freewheel":
            assert (law["free"] * rate).min() > -1e-7 and (law["free"] * effort).min() > -1e-7
            assert np.abs(effort * rate).max() < 1e-6
        else:
            sense, bound = (1, law["upper"]) if "upper" in law else (-1, law["lower"])
            assert (sense * (position - bound)).max() < 1e-8 and (sense * effort).max() < 1e-7
            assert np.abs(effort * (position - bound)).max() < 1e-6
    total = run.energy.total
    assert np.diff(total).max() < 1e-7 * (1.0 + np.abs(total).max())
    assert np.ptp(total - run.energy.work) < 1e-6 * (1.0 + np.abs(total).max())
    # where it cannot go on it says why
    if not run.success:
        assert "singular" in run.message or "decided" in run.message, run.message
    again, _ = run_of(seed, backwards=True)
    assert again.success == run.success
    assert again.q == pytest.approx(run.q, abs=1e-5)
