"""The equations in the rates of actuators, against the reduced equations, inverse dynamics and differences."""

from typing import Any

import numpy as np
import pytest
from test_assemble_many import ankle
from test_inverse_dynamics import Moved, engine, moving, straight, wanted

import partita as pt
from partita.errors import ArgumentError, UnknownNameError


def a_set(name: str) -> tuple[pt.Mechanism, pt.Result, Moved, list[str]]:
    """A mechanism in motion, other accelerations, and a regular set of actuators of tree and closing joints."""
    m, motors, start = moving(name)
    run = m.simulate(0.2, initial=start, t_eval=[0.0, 0.2])
    path, rng = wanted(m, run), np.random.default_rng(5)
    for _ in range(200):
        chosen = [str(one) for one in rng.permutation(list(motors))[: m.compile().mobility]]
        if m.inverse_dynamics(path, chosen).margin.min() > 1e-2:
            return m, run, path, chosen
    raise AssertionError("no regular set")


@pytest.mark.parametrize("name", ["five-bar", "three-rrr", "delta"])
def test_efforts_are_those_of_inverse_dynamics(name: str) -> None:
    """tau = M w' + bias for w' of any motion; rates and ratios are those of the state."""
    m, run, path, chosen = a_set(name)
    d = m.inverse_dynamics(path, chosen)
    free = m.inverse_dynamics(Moved(run.t, run.q, run.v, run.vdot, run.names), chosen)
    model = m.compile()
    for row in range(2):
        a = model.actuated(run.state(run.t[row]), chosen)
        scale = 1.0 + np.abs(a.bias).max()
        assert np.abs(a.ratios @ a.rates - run.v[row]).max() < 1e-12 * (1.0 + np.abs(run.v[row]).max())
        assert np.abs(d.rates[row] - a.rates).max() < 1e-12 * (1.0 + np.abs(a.rates).max())
        assert a.margin == pytest.approx(d.margin[row], rel=1e-9)
        # v' = R w' + what does not depend on w'
        more = np.linalg.lstsq(a.ratios, path.vdot[row] - run.vdot[row], rcond=None)[0]
        assert np.abs(a.M @ more - (d.efforts[row] - free.efforts[row])).max() < 1e-9 * np.abs(d.efforts[row]).max()
        # the free motion: no effort acts, so that w' = -M^-1 bias; by differences of second order
        h = 1e-4
        start = run.state(run.t[row])
        near = m.simulate(2 * h, initial=start, t_eval=start.t + h * np.arange(3), rtol=1e-12, atol=1e-13)
        rates = [model.actuated(near.state(t), chosen).rates for t in near.t]
        growth = (-3 * rates[0] + 4 * rates[1] - rates[2]) / (2 * h)
        assert np.abs(a.efforts(growth)).max() < 1e-5 * scale


def test_independent_coordinates_as_actuators_give_the_reduced_equations() -> None:
    m, _, start = moving("three-rrr")
    model = m.compile()
    i = model.at(start.q, start.v)
    a = model.actuated(start, [model.velocity_names[j] for j in i.independent])
    assert np.abs(a.M - i.M_d).max() < 1e-12 * np.abs(i.M_d).max()
    assert np.abs(a.bias + i.h_d).max() < 1e-12 * (1.0 + np.abs(i.h_d).max())
    assert np.abs(a.ratios - i.D.T).max() < 1e-12
    assert (a.reflected == np.diag(a.M)).all()


@pytest.mark.parametrize("chosen", ["A", "C", "D", "gas.x"])
def test_ratios_jacobians_and_gravity_are_derivatives(chosen: str) -> None:
    """Of positions and of the potential energy, by central differences along the motion."""
    m = engine()
    model = m.compile()
    at = [m.assemble(targets={"A": 0.8 + x}) for x in (-1e-5, 0.0, 1e-5)]
    a = model.actuated(at[1], [chosen])
    q = np.array([s.q for s in at])
    still = np.zeros_like(q)
    t = np.zeros(3)
    along = {"gas.x": "D"}.get(chosen, chosen)

    def course(joint: str) -> Any:
        return model.core.motion(t, q, still).joints(["ABCD".index(joint)])["joint_position"][:, 0]

    step = course(along)[2] - course(along)[0]
    for joint in "ABCD":
        ratio = (course(joint)[2] - course(joint)[0]) / step
        assert a.ratio(joint)[0] == pytest.approx(ratio, rel=1e-7, abs=1e-7)
    rod = model.core.motion(t, q, still).bodies([1])
    point = rod["body_position"][:, 0] + rod["body_rotation"][:, 0] @ np.array([0.02, 0.01, 0.0])
    found = a.jacobian(("rod", (0.02, 0.01, 0.0)))
    assert np.abs(found[:3, 0] - (point[2] - point[0]) / step).max() < 1e-6
    weight = model.core.motion(t, q, still).energies()["potential"]
    assert a.gravity[0] == pytest.approx((weight[2] - weight[0]) / step, rel=1e-6)
    assert np.abs(a.at(at[2]).M - model.actuated(at[2], [chosen]).M).max() < 1e-12


@pytest.mark.parametrize("solid", [0.0, 2e-4])
@pytest.mark.parametrize("motors", [("ML", "MR"), ("U.turn1", "MR")])
def test_idle_spins_of_rods_need_no_actuator(solid: float, motors: tuple[str, str]) -> None:
    """A platform moved by rods between balls: as with universal joints, and as it moves by itself."""
    m = ankle(solid=solid)
    model, start = m.compile(), m.assemble({"ML": 0.1, "MR": -0.2}, rates={"ML": 1.0, "MR": -2.0})
    a = model.actuated(start, motors)
    assert a.M.shape == (2, 2) and a.rates == pytest.approx(
        [start.velocity("ML") if motors[0] == "ML" else a.rates[0], -2.0], abs=1e-12
    )
    if solid == 0.0:
        held = ankle(ball=False)
        b = held.compile().actuated(held.assemble({"ML": 0.1, "MR": -0.2}, rates={"ML": 1.0, "MR": -2.0}), motors)
        assert np.abs(a.M - b.M).max() < 1e-12 * b.M.max() and a.bias == pytest.approx(b.bias, rel=1e-10)
        assert a.ratio("ML") == pytest.approx(b.ratio("ML"), abs=1e-12)
        assert a.jacobian("platform") == pytest.approx(b.jacobian("platform"), abs=1e-12)
    h = 1e-4
    near = m.simulate(2 * h, initial=start, t_eval=h * np.arange(3), rtol=1e-12, atol=1e-13)
    rates = [model.actuated(near.state(t), motors).rates for t in near.t]
    growth = (-3 * rates[0] + 4 * rates[1] - rates[2]) / (2 * h)
    assert np.abs(a.efforts(growth)).max() < 1e-5 * np.abs(a.bias).max()
    with pytest.raises(ArgumentError, match="but 2 degrees of freedom beside 2 idle rotations; name 2"):
        model.actuated(start, ["ML"])


def test_bad_input_is_refused() -> None:
    m, state = straight()
    model = m.compile()
    with pytest.raises(ArgumentError, match="A, E cannot cause every motion"):
        model.actuated(state, ("A", "E"))
    with pytest.raises(ArgumentError, match="there is 1 actuator, but 2 degrees of freedom; name 2"):
        model.actuated(state, ["A"])
    with pytest.raises(UnknownNameError, match="F"):
        model.actuated(state, ["A", "F"])
    with pytest.raises(ArgumentError, match="must be a State of this model"):
        model.actuated(m.convert(state, "absolute"), ("A", "B"))
    a = model.actuated(state, ("A", "B"))
    with pytest.raises(ArgumentError, match="must be 2 finite numbers, one for each of A, B"):
        a.efforts([1.0])
    with pytest.raises(ArgumentError, match="three finite numbers"):
        a.jacobian(("bc", (1.0,)))
    with pytest.raises(UnknownNameError):
        a.ratio("Z")
    assert repr(a).startswith("<Actuated by A, B: reflected inertia A ")
