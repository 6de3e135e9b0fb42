"""Joints of one's own: directions that follow others, in trees, in loops and in absolute coordinates."""

import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.errors import DescriptionError, EvaluationError

WHERE = ("tree", "loop", "absolute")
TIMES = np.linspace(0.0, 0.6, 7)
TIGHT: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-13, "t_eval": TIMES}
PITCH = 0.3


def carried(m: pt.Mechanism, where: str) -> dict[str, Any]:
    """How the joint stands: where it closes a loop, a free joint carries the body."""
    if where != "loop":
        return {}
    m.add_free("carrier", m.ground, "b", cut="never")
    return {"cut": "always"}


def body(where: str, gravity: Any = (0.5, -2.0, 1.0)) -> tuple[pt.Mechanism, dict[str, Any]]:
    m = pt.Mechanism("own", gravity=gravity)
    m.add_body("b", mass=1.7, inertia=(0.2, 0.3, 0.4), com=(0.1, 0.2, 0.05))
    return m, carried(m, where)


def simulated(m: pt.Mechanism, where: str, rates: dict[str, float] | None = None) -> Any:
    coordinates = "absolute" if where == "absolute" else "relative"
    start = m.assemble(rates=rates or {}, coordinates=coordinates)
    run = m.simulate(float(TIMES[-1]), initial=start, coordinates=coordinates, **TIGHT)
    assert run.success, run.message
    return run


def same(one: Any, other: Any, joint: str, within: float) -> None:
    for what in ("position", "velocity", "acceleration", "force", "moment"):
        found, wanted = (getattr(run.joint(joint), what) for run in (one, other))
        size = max(1.0, float(np.max(np.abs(wanted))))
        assert found.shape == wanted.shape
        assert np.max(np.abs(found - wanted)) < within * size, what


@pytest.mark.parametrize("where", WHERE)
def test_a_screw_of_ones_own_is_the_screw(where: str) -> None:
    runs = []
    for own in (True, False):
        m, how = body(where)
        if own:
            follows = {"z": lambda rz: rz * (PITCH / math.tau)}
            m.add_custom_joint("J", m.ground, "b", point=(0, 0, 0), free=["rz"], follows=follows, **how)
        else:
            m.add_screw("J", m.ground, "b", point=(0, 0, 0), axis=(0, 0, 1), pitch=PITCH, **how)
        m.add_torque("J", 0.4, coordinate=1)
        m.add_torsion_spring("J", stiffness=3.0, damping=0.1, coordinate=1)
        runs.append(simulated(m, where))
    same(*runs, "J", 1e-11)


@pytest.mark.parametrize("where", WHERE)
def test_a_follower_is_a_constraint_between_the_coordinates(where: str) -> None:
    """The motion is that of a generic joint with a condition; the joint's reaction contains that of the condition."""
    law: Callable[..., Any] = lambda x, rz: 0.2 * np.sin(rz) + 0.3 * x**2  # noqa: E731
    runs = []
    for own in (True, False):
        m, how = body(where)
        if own:
            m.add_custom_joint("J", m.ground, "b", point=(0, 0, 0), free=["rz", "x"], follows={"y": law}, **how)
        else:
            m.add_joint("J", m.ground, "b", point=(0, 0, 0), free=["x", "y", "rz"], **how)
            of = [pt.Coordinate("J", 1), pt.Coordinate("J", 0), pt.Coordinate("J", 2)]
            m.add_constraint("law", lambda t, y, x, rz: y - law(x, rz), of=of)
        runs.append(simulated(m, where))
    for what in ("position", "velocity", "acceleration"):
        assert getattr(runs[0].joint("J"), what) == pytest.approx(getattr(runs[1].joint("J"), what), abs=1e-10)
    energy = runs[0].energy
    assert np.ptp(energy.total - energy.work) < 1e-9


@pytest.mark.parametrize("where", WHERE)
def test_a_bead_on_a_curve_and_the_force_that_holds_it(where: str) -> None:
    """With y = f(x): x'' (1 + f'^2) = -f' (g + f'' x'^2), and the reaction is m (x'', y'' + g)."""
    m, g = pt.Mechanism("bead", gravity=(0, -9.81, 0)), 9.81
    m.add_body("b", mass=0.7, inertia=(1e-3, 1e-3, 1e-3))
    law = {"y": lambda x: 0.6 * x**2 + 0.1 * x}
    m.add_custom_joint("J", m.ground, "b", point=(0, 0, 0), free=["x"], follows=law, **carried(m, where))
    run = simulated(m, where, {})
    joint = run.joint("J")
    x, v = joint.position[:, 0], joint.velocity[:, 0]
    slope, bend = 1.2 * x + 0.1, 1.2
    acceleration = -slope * (g + bend * v**2) / (1.0 + slope**2)
    up = slope * acceleration + bend * v**2
    assert np.ptp(x) > 0.05
    assert joint.acceleration[:, :2] == pytest.approx(np.stack([acceleration, up], axis=1), abs=1e-9)
    force = 0.7 * np.stack([acceleration, up + g, 0.0 * x], axis=1)
    assert joint.force == pytest.approx(force, abs=1e-8)
    assert run.energy.work == pytest.approx(np.zeros(len(x)), abs=1e-10)
    assert np.ptp(run.energy.total) < 1e-9


def test_a_turn_that_follows_a_turn_moves_alike_wherever_the_joint_stands() -> None:
    """And a function that takes plain numbers only is differentiated by differences, with a note."""
    runs = []
    for where in WHERE:
        m, how = body(where)
        law: Any = (lambda rx: 0.4 * math.sin(rx)) if where == "tree" else (lambda rx: 0.4 * np.sin(rx))
        m.add_custom_joint("J", m.ground, "b", point=(0.1, 0, 0), free=["rx"], follows={"rz": law}, **how)
        runs.append(simulated(m, where, {}))
        notes = m.compile().notes
        assert any('joint "J": the function could not be differentiated' in note for note in notes) == (where == "tree")
    for run in runs[1:]:
        same(run, runs[0], "J", 2e-8)


def test_what_a_joint_of_ones_own_refuses(tmp_path: Path) -> None:
    def add(free: Any, follows: Any) -> Any:
        m = pt.Mechanism("own")
        m.add_body("b", mass=1.0, inertia=(1, 1, 1))
        m.add_custom_joint("J", m.ground, "b", free=free, follows=follows)
        return m

    same_way: dict[str, Any] = {"x": lambda y: y}
    for free, follows, words in (
        (["rx", "ry"], {"rz": lambda rx, ry: rx}, "all three axes"),
        (["x"], {"x": lambda x: x}, "both free and dependent"),
        (["y"], {}, "use add_joint"),
        (["y"], {"x": 1.0}, "by a function"),
        (["y"], {"x": lambda y: y + 1.0}, "must be 0 there"),
        (["y"], {"w": lambda y: y}, "must be one of"),
        (["q"], same_way, "must be one of"),
    ):
        with pytest.raises(DescriptionError, match=words):
            add(free, follows)
    with pytest.raises(EvaluationError, match='joint "J"'):
        add(["y"], {"x": lambda y: "far"})
    m = add(["y"], same_way)
    with pytest.raises(DescriptionError, match='joint "J": x follow'):
        m.save(tmp_path / "own.toml")
    with pytest.raises(DescriptionError, match='"J"'):
        pickle.dumps(m)


def half(y: Any) -> Any:
    return 0.5 * y


def test_it_is_read_changed_and_pickled_as_others_are() -> None:
    m = pt.Mechanism("own")
    m.add_body("b", mass=1.0, inertia=(1, 1, 1))
    joint = m.add_custom_joint("J", m.ground, "b", free=["y"], follows={"x": half})
    assert (joint.free, joint.follows["x"], joint.kind) == (("y",), half, "custom")
    twin = pickle.loads(pickle.dumps(m))
    joint.follows = {"x": lambda y: y}
    for which, slope in ((m, 1.0), (twin, 0.5)):
        run = which.simulate(0.2)
        assert run.joint("J").position[-1, 0] == pytest.approx(slope * run.joint("J").position[-1, 1], abs=1e-9)
