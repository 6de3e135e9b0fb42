"""The equations in CasADi, JAX and SymPy, with the packages themselves, against the core."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from thorough import either

import partita as pt
from partita.replay import for_casadi, for_jax, for_sympy
from partita.replay.tape import OPERANDS, Entry

casadi = pytest.importorskip("casadi")
jax = pytest.importorskip("jax")
sympy = pytest.importorskip("sympy")

import jax.numpy as jnp  # noqa: E402

Numbers = np.ndarray[Any, np.dtype[np.float64]]
VALUES = 1e-12
"""Of what is evaluated by the same operations in another order of a compiler. Scale: the largest number beside it."""
SLOPES = 1e-9

TEN = (
    "planar-pendulum", "four-bar-spring", "andrews-squeezer", "spatial-four-bar", "heavy-top", "double-wishbone",
    "screw-press", "three-rrr", "rolling-ball", "car-axis",
)  # fmt: skip
"""Planar and in space, with quaternions, springs, gears, rolling, motions prescribed by functions of time."""
HOLONOMIC = tuple(name for name in TEN if name not in ("rolling-ball", "car-axis"))


@pytest.fixture(autouse=True)
def in_64_bits() -> None:
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_platforms", "cpu")


def near(found: Any, known: Any, tolerance: float) -> bool:
    found, known = np.asarray(found, dtype=float).ravel(), np.asarray(known, dtype=float).ravel()
    assert found.shape == known.shape
    return bool(np.abs(found - known).max(initial=0.0) <= tolerance * max(1.0, np.abs(known).max(initial=0.0)))


def moving(m: pt.Mechanism) -> list[pt.State]:
    """Closed states of a motion, its velocities drawn by chance at the start."""
    start, rng = m.assemble(), np.random.default_rng(4)
    f = m.export_casadi()
    x = np.concatenate([start.q, rng.normal(size=len(f.independent))])
    v = np.array(f.velocities(start.t, x, [], [])).ravel()
    run = m.simulate(0.02, initial=pt.State(start.t, start.q, v, start.names, start.velocity_names))
    return [run.state(float(t)) for t in (run.t[0], run.t[-1])]


@pytest.mark.parametrize("name", TEN)
def test_rates_and_outputs_are_those_of_the_core(name: str) -> None:
    m = pt.catalogue.load(name)
    model, f = (
        m.compile(),
        m.export_casadi(outputs=["v", "vdot", "phi", "energy.kinetic", "energy.potential", "excess"]),
    )
    g = m.to_jax(outputs=["v", "energy.kinetic"])
    for state in moving(m):
        x, nq = f.state(state), len(state.q)
        vdot, _ = model.acceleration(state.q, state.v, t=state.t)
        own = [f.v_names.index(name) for name in f.independent]
        known = np.concatenate([np.zeros(nq), vdot[own]])
        v, a, phi, kinetic, potential, excess = (np.array(y).ravel() for y in f.further(state.t, x, [], []))
        residual = f.residual(state.t, state.q, state.v, [], [])
        known[:nq] = np.array(residual[-1]).ravel()
        assert near(f.rates(state.t, x, [], []), known, VALUES)
        assert near(v, state.v, 1e-9) and near(a, vdot, VALUES) and excess[0] <= 0.0  # a run closes v to 1e-10
        assert near(phi, model.constraints(state.q, t=state.t), VALUES)
        run = m.simulate(1e-6, initial=state)
        assert near(kinetic, run.energy.kinetic[0], VALUES) and near(potential, run.energy.potential[0], VALUES)
        M, h, C, a, b = (np.array(y) for y in residual[:5])
        assert near(M, model.mass_matrix(state.q, t=state.t), VALUES)
        assert near(h, model.forces(state.q, state.v, t=state.t), VALUES)
        assert near(C, model.jacobian(state.q, t=state.t), VALUES)
        assert near(a, model.rate(state.q, t=state.t), VALUES)
        assert near(b, model.bias(state.q, state.v, t=state.t), VALUES)
    assert near(g.rates(state.t, x), known, VALUES)
    further = g.further(state.t, x)
    assert near(further["v"], v, VALUES) and near(further["energy.kinetic"], kinetic, VALUES)


@pytest.mark.parametrize("name", HOLONOMIC)
def test_derivatives_are_those_of_the_linearised_equations(name: str) -> None:
    m = pt.catalogue.load(name)
    state = moving(m)[1]
    f = m.export_casadi(initial=state)
    known = m.linearize(state, independent=f.independent)
    x, nq, k = f.state(state), len(f.q_names), len(f.independent)
    jacobian = f.velocities.jacobian()(state.t, x, [], [], casadi.DM())[1]
    D = np.array(jacobian)[:, nq:]
    N = np.column_stack([np.array(f.residual(0.0, state.q, column, [], [])[-1]).ravel() for column in D.T])
    slope = np.array(f.rates.jacobian()(state.t, x, [], [], casadi.DM())[1])[nq:]
    lower = np.column_stack([slope[:, :nq] @ N, slope[:, nq:]])
    assert near(lower, known.A[k:], SLOPES)
    # along one direction, by JAX
    g, along = m.to_jax(initial=state), np.random.default_rng(2).normal(size=2 * k)
    direction = jnp.asarray(np.concatenate([N @ along[:k], along[k:]]))
    _, change = jax.jvp(lambda x: g.rates(state.t, x), (jnp.asarray(x),), (direction,))
    assert near(change[nq:], known.A[k:] @ along, SLOPES)


def central(f: Any, x: Numbers, h: float) -> Numbers:
    """Differences of eighth order."""
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    columns = []
    for e in np.eye(len(x)):
        columns.append(sum(w * (f(x + i * h * e) - f(x - i * h * e)) for i, w in weights.items()) / h)
    return np.column_stack(columns)


def test_derivatives_with_parameters_and_inputs_are_differences_of_the_core() -> None:
    m = pt.catalogue.load("four-bar-spring")
    model, state = m.compile(), moving(m)[1]
    spring = next(name for name in model.parameters if name.endswith(".stiffness"))
    names = ["coupler.mass", "gravity", spring]
    f = m.export_casadi(inputs=["A"], parameters=names, initial=state)
    g = m.to_jax(inputs=["A"], parameters=names, initial=state)
    assert f.parameters == ("coupler.mass", "gravity.x", "gravity.y", "gravity.z", spring)
    assert np.array_equal(f.p0, np.concatenate([np.ravel(model.parameters[name]) for name in names]))
    own = [f.v_names.index(name) for name in f.independent]

    def rates(p: Numbers) -> Numbers:
        changed = model.with_parameters({"coupler.mass": p[0], "gravity": p[1:4], spring: p[4]})
        return changed.acceleration(state.q, state.v, t=state.t)[0][own]

    x, nq = f.state(state), len(f.q_names)
    known = central(lambda p: rates(f.p0 * p), np.ones(5), 0.02) / np.where(f.p0 == 0.0, np.inf, f.p0)
    slope = np.array(f.rates.jacobian()(state.t, x, f.u0, f.p0, casadi.DM())[3])[nq:]
    slope[:, f.p0 == 0.0] = 0.0  # gravity across the plane and along it, which the scaled differences leave out
    assert near(slope, known, SLOPES)
    along = np.where(f.p0 == 0.0, 0.0, 1.0 + np.arange(5))
    _, change = jax.jvp(lambda p: g.rates(state.t, x, p=p), (jnp.asarray(f.p0),), (jnp.asarray(along),))
    assert near(change[nq:], known @ along, SLOPES)
    # an effort on A acts as the actuator of the core does
    B = np.array(f.rates.jacobian()(state.t, x, f.u0, f.p0, casadi.DM())[2])[nq:]
    linear = m.linearize(state, inputs=["A"], independent=f.independent)
    assert near(B, linear.B[len(own) :], SLOPES)


def test_drives_and_components_of_forces_are_inputs() -> None:
    t = np.linspace(0.0, 1.0, 21)
    m = pt.catalogue.load("five-bar")
    first, second = m.compile().velocity_names[:2]
    m.add_drive(first, (t, 0.3 * np.sin(2.0 * t)), name="lift")
    m.add_force(next(iter(m.bodies)), (1.0, 2.0, 0.0), name="push")
    known = m.simulate(0.4, t_eval=[0.0, 0.2, 0.4])
    f = m.export_casadi(inputs=["lift", "push.y"])
    assert f.inputs == ("lift", "lift.rate", "lift.acceleration", "push.y") and f.u0[3] == 2.0
    row = m.compile().velocity_names.index(first)
    for i in range(3):
        state, vdot = known.state(float(known.t[i])), known.vdot[i]
        u = [state.q[row], state.v[row], vdot[row], 2.0]
        assert near(f.velocities(state.t, f.state(state), u, []), state.v, 1e-9)
        own = [f.v_names.index(name) for name in f.independent]
        assert near(f.rates(state.t, f.state(state), u, [])[len(state.q) :], vdot[own], 1e-8)
    assert first not in f.independent and second in f.v_names
    # a drive of a rate: its rate and acceleration
    other = pt.catalogue.load("five-bar")
    other.add_drive(first, velocity=1.5, name="motor")
    g = other.export_casadi(inputs=["motor"])
    assert g.inputs == ("motor", "motor.acceleration") and np.array_equal(g.u0, [1.5, 0.0])
    v = np.array(g.velocities(0.0, g.x0, [0.7, 0.0], [])).ravel()
    assert v[g.v_names.index(first)] == pytest.approx(0.7, abs=VALUES)
    # no degree of freedom is left: x is q, and the multiplier of the drive is its effort
    whole = pt.catalogue.load("four-bar")
    whole.add_drive("A", (t, 0.3 * np.sin(2.0 * t)), name="motor")
    run = whole.simulate(0.4, t_eval=[0.0, 0.4])
    k = whole.export_casadi(inputs=["motor"], outputs=["multipliers"])
    state, i = run.state(0.4), k.q_names.index("A")
    assert k.independent == () and k.state_names == k.q_names
    u = [state.q[i], state.v[i], run.vdot[-1][i]]
    assert near(k.rates(0.4, state.q, u, []), state.v, 1e-9)
    effort = np.array(k.further(0.4, state.q, u, [])).ravel()[-1]
    assert effort == pytest.approx(np.ravel(run.drive("motor").effort)[-1], abs=1e-8)


def test_every_operation_of_the_core_has_a_form() -> None:
    """Over CasADi, SymPy and JAX: a recording holds nothing that one of them could not replay."""
    m = pt.catalogue.load("four-bar")
    operations = m.compile()._taped(0.0, m.assemble().q, [], [], [], [], None, "[]")[2]
    assert len(set(operations)) == len(operations) > 20
    for name in operations:
        if name in ("input", "constant"):
            continue
        entry = Entry(100, name, (0, 1, 2)[: OPERANDS[name]], 2.0)
        for applied, package, symbol, last in (
            (for_casadi.applied, casadi, casadi.SX.sym, False),
            (for_sympy.applied, sympy, sympy.Symbol, sympy.Float(2.0)),
        ):
            x: list[Any] = [symbol(letter) for letter in "xyz"]
            if name == "interval":
                x[1:] = [1.0], [2.0, 3.0]
            assert applied(package, entry, x, last) is not None, name
        assert name == "interval" or name in for_jax._LINES


def test_sensors_are_outputs() -> None:
    """Rates, measures, forces, vectors and expressions, those of a run; what cannot be one is named."""
    m = pt.catalogue.load("four-bar")
    rate = m.add_sensor("rate", "D", "velocity")
    along = m.add_sensor("along", pt.Along("ground", (0, 0, 0), (1, 0, 0), "coupler", (0.1, 0, 0)), "velocity")
    m.add_sensor("pin", "D", "force")
    m.add_sensor("both", 2.0 * rate - along * along)
    names = ["both", "pin", "v", "along", "rate"]
    state = m.assemble({"A": 0.3}, {"A": 5.0})
    run = m.simulate(1e-6, initial=state)
    f, g = m.export_casadi(outputs=names, initial=state), m.to_jax(outputs=names, initial=state)
    values = f.further(state.t, f.state(state), [], [])
    of_jax = g.further(state.t, g.state(state))
    for name, value in zip(names, values, strict=True):
        if name != "v":
            wanted = np.asarray(run.sensor(name).values[0])
            assert near(np.array(value).reshape(wanted.shape), wanted, 1e-9), name
            assert near(np.asarray(of_jax[name]), wanted, 1e-9), name
    m.add_sensor("turning", "coupler", "angular_velocity")
    with pytest.raises(pt.errors.ArgumentError, match='"turning" reads'):
        m.export_casadi(outputs=["turning"])


def test_reactions_are_those_of_a_run_and_those_not_determined_are_refused() -> None:
    m = pt.catalogue.load("spatial-four-bar")
    state = moving(m)[0]
    joint = next(iter(m.joints))
    run = m.simulate(1e-6, initial=state)
    determined = np.asarray(run.joint(joint).determined)
    body = next(iter(m.bodies))
    axes = [i for i in range(3) if determined[i]]
    f = m.export_casadi(outputs=[f"{joint}.force.{'xyz'[i]}" for i in axes] + [f"{body}.position", f"{body}.rotation"])
    *force, position, rotation = f.further(state.t, f.state(state), [], [])
    assert near(np.array([float(x) for x in force]), run.joint(joint).force[0][axes], 1e-9)
    assert near(position, run.body(body).position[0], VALUES)
    assert near(np.array(rotation), run.body(body).rotation[0], VALUES)
    planar = pt.catalogue.load("four-bar")
    with pytest.raises(pt.errors.ArgumentError, match=r"force of joint 'D' along z.*D\.force\.x, D\.force\.y"):
        planar.export_casadi(outputs=["D.force"])


def test_one_correction_squares_the_error() -> None:
    m = pt.catalogue.load("double-wishbone")
    f, g, model = m.export_casadi(), m.to_jax(), m.compile()
    off = f.x0.copy()
    off[: len(f.q_names)] += 1e-3 * np.random.default_rng(3).normal(size=len(f.q_names))
    errors, x = [], off
    for _ in range(4):
        errors.append(np.abs(model.constraints(x[: len(f.q_names)])).max())
        x = np.array(f.close(0.0, x, [], [])).ravel()
    assert errors[1] < 100.0 * errors[0] ** 2 and errors[3] < 1e-14
    assert near(g.close(0.0, off), f.close(0.0, off, [], []), VALUES)
    with pytest.raises(pt.errors.ArgumentError, match="shape"):
        g.close(0.0, off[1:])


def stopped_ball() -> pt.Mechanism:
    """A ball over a plane, with friction, on a slide with a stop and a spring by a table of time."""
    m = pt.Mechanism("ball", gravity="-z")
    ball = m.add_body("ball", mass=1.0, inertia=(0.01, 0.01, 0.01), com=(0, 0, 0.5))
    m.add_free("flight", m.ground, ball, point=(0, 0, 0.5))
    m.add_contact("floor", ball, (0, 0, 0.5), m.ground, (0, 0, 0), normal=(0, 0, 1), radius1=0.2, stiffness=1e4,
                  friction=0.4, stick_velocity=1e-2)  # fmt: skip
    return m


def test_no_choice_makes_a_derivative_that_is_no_number() -> None:
    m = stopped_ball()
    f, g = m.export_casadi(), m.to_jax()
    nq = len(f.q_names)
    for height, falls in ((0.5, True), (0.19, False)):
        # at rest, where slip has no direction
        x = f.x0.copy()
        x[f.q_names.index("flight.z")] += height - 0.5
        slope = np.array(f.rates.jacobian()(0.0, x, [], [], casadi.DM())[1])
        row = nq + f.independent.index("flight.z")
        assert np.isfinite(slope).all()
        assert (abs(slope[row, f.q_names.index("flight.z")]) < 1e-9) == falls  # the floor stiffens it, or is not there
        _, back = jax.vjp(lambda x: g.rates(0.0, x), jnp.asarray(x))
        weights = np.random.default_rng(1).normal(size=len(x))
        assert near(back(jnp.asarray(weights))[0], weights @ slope, SLOPES)


def test_a_tyre_has_the_slopes_of_the_core() -> None:
    m = pt.Mechanism("wheel", gravity="-z")
    wheel = m.add_body("wheel", mass=10.0, inertia=(0.2, 0.4, 0.2), position=(0, 0, 0.29))
    m.add_free("flight", m.ground, wheel, point=(0, 0, 0.29))
    m.add_tyre("tyre", wheel, center=(0, 0, 0), axis=(0, 1, 0), radius=0.3, normal=(0, 0, 1), stiffness=2e4,
               damping=0.1, friction=0.8, longitudinal=5e3, lateral=3e3, slow_speed=0.1)  # fmt: skip
    f, g, model = m.export_casadi(), m.to_jax(), m.compile()
    for v in (np.zeros(6), np.array([1.0, 0.1, 0.0, 0.1, 3.0, 0.2])):
        q, x = f.x0[:7], np.concatenate([f.x0[:7], v])
        known = model.acceleration(q, v)[0]
        assert near(f.rates(0.0, x, [], [])[7:], known, VALUES) and near(g.rates(0.0, x)[7:], known, VALUES)
        slope = np.array(f.rates.jacobian()(0.0, x, [], [], casadi.DM())[1])
        assert np.isfinite(slope).all()
        if v.any():
            differences = central(lambda v, q=q: model.acceleration(q, v)[0], v, 1e-2)
            assert near(slope[7:, 7:], differences, 1e-7)  # the slip is stiff


def test_tables_are_followed_with_their_slopes() -> None:
    m = pt.catalogue.load("planar-pendulum")
    t = np.linspace(0.0, 1.0, 7)
    m.add_torque(next(iter(m.joints)), (t, np.cos(5.0 * t)), name="push")
    f, g, model = m.export_casadi(), m.to_jax(), m.compile()
    for at in (-0.1, 0.0, 0.3, 1.0 / 6.0, 0.99, 1.0):
        known = model.acceleration(f.x0[:1], f.x0[1:], t=max(at, 0.0))[0] if 0.0 <= at <= 1.0 else None
        if known is not None:
            assert near(f.rates(at, f.x0, [], [])[1], known, VALUES) and near(g.rates(at, f.x0)[1], known, VALUES)
    times = jnp.linspace(0.0, 1.0, 40)
    compiled = jax.jit(g.rates)
    one_by_one = [float(compiled(t, f.x0)[1]) for t in times]
    assert near(jax.vmap(lambda t: g.rates(t, f.x0)[1])(times), one_by_one, VALUES)
    slope = jax.jacfwd(lambda t: g.rates(t, f.x0)[1])(0.37)
    h = 1e-3
    rates = [model.acceleration(f.x0[:1], f.x0[1:], t=0.37 + i * h)[0][0] for i in (-2, -1, 1, 2)]
    assert slope == pytest.approx((rates[0] - 8 * rates[1] + 8 * rates[2] - rates[3]) / (12 * h), abs=SLOPES)


def test_members_side_by_side_are_those_of_an_ensemble() -> None:
    """Steps of fixed length of order four, all members at once; the step is so short that its error is below 1e-8."""
    m = pt.catalogue.load("four-bar")
    count, end, steps = either(200, 10_000), 0.2, 200
    states = [m.assemble(rates={"A": rate}) for rate in np.linspace(-3.0, 3.0, count)]
    masses = np.linspace(0.5, 1.5, count)
    f = m.to_jax(parameters=["coupler.mass"])
    h = end / steps

    def one(x: Any, p: Any) -> Any:
        def step(x: Any, i: Any) -> Any:
            t = i * h
            k1 = f.rates(t, x, p=p)
            k2 = f.rates(t + h / 2, x + h / 2 * k1, p=p)
            k3 = f.rates(t + h / 2, x + h / 2 * k2, p=p)
            k4 = f.rates(t + h, x + h * k3, p=p)
            return f.close(t + h, x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), p=p), None

        return jax.lax.scan(step, x, jnp.arange(steps))[0]

    starts = jnp.asarray(np.array([f.state(state) for state in states]))
    ends = np.asarray(jax.jit(jax.vmap(one))(starts, jnp.asarray(masses[:, None])))
    known = m.ensemble(states=states, parameters={"coupler.mass": masses}, t_eval=[0.0, end], rtol=1e-10, atol=1e-12)
    own = [f.v_names.index(name) for name in f.independent]
    assert known.success.all()
    assert near(ends, np.hstack([known.q[:, -1], known.v[:, -1][:, own]]), 1e-7)


def test_an_integrator_of_casadi_follows_a_run() -> None:
    m = pt.catalogue.load("four-bar")
    state = m.assemble(rates={"A": 3.0})
    f = m.export_casadi(closing_rate=50.0)
    integrator = casadi.integrator("F", "cvodes", f.dae, 0.0, 0.3, {"reltol": 1e-10, "abstol": 1e-12})
    x = np.array(integrator(x0=f.state(state))["xf"]).ravel()
    run = m.simulate(0.3, initial=state, rtol=1e-10, atol=1e-12)
    assert near(x, f.state(run.state()), 1e-7)
    # the error of a start that is off decays at this rate
    off = f.state(state)
    off[1] += 1e-4
    x = np.array(integrator(x0=off)["xf"]).ravel()
    assert np.abs(m.compile().constraints(x[:3])).max() < 1e-4 * np.exp(-50.0 * 0.3) * 10.0


def test_symbols_of_a_pendulum_are_those_of_the_textbook() -> None:
    m = pt.Mechanism("pendulum", gravity="-y")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=3.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    a, g, mass, inertia = sympy.symbols("a g m I", real=True)
    given = {"gravity": (0, "-g", 0), "rod.mass": "m", "rod.com": (a, 0, 0), "rod.inertia": [0] * 8 + ["I"]}
    f = m.to_sympy(symbols=given)
    assert sympy.Matrix([[inertia + mass * a**2]]) == f.M
    assert f.h == sympy.Matrix([[-mass * g * a * sympy.cos(f.q[0])]])
    assert f.Phi.shape == (0, 1) and f.values == {g: 9.81, mass: 3.0, a: 0.5, inertia: 0.25}
    assert f._repr_latex_() == (
        r"$\displaystyle \begin{bmatrix}I + a^{2} m\end{bmatrix} \begin{bmatrix}\ddot{q}_{A}\end{bmatrix} = "
        r"\begin{bmatrix}- a g m \cos{\left(q_{A} \right)}\end{bmatrix}$"
    )


def test_formulas_name_each_matrix_and_show_few_digits() -> None:
    f = pt.catalogue.load("four-bar").to_sympy()
    first, *named = f.formulas()
    assert first == r"M\,\dot v = h + C^T \lambda,\quad \Phi = 0,\quad C\,\dot v + b = 0"
    assert [text.partition(" = ")[0] for text in named] == [r"\dot v", "M", "h", "C", r"\Phi", "b"]
    assert all(text in f.latex() for text in named) and "0.1388 m_" in named[1]
    assert "0.13877 m_" in f.formulas(6)[2]


@pytest.mark.parametrize("name", ["four-bar", "slider-crank", "screw-press", "spatial-four-bar"])
@pytest.mark.parametrize("simplify", [True, False])
def test_symbols_have_the_numbers_of_the_core(name: str, simplify: bool) -> None:
    m = pt.catalogue.load(name)
    model, state, f = m.compile(), moving(m)[1], m.to_sympy(simplify=simplify)
    values = {**f.values, f.t: state.t, **dict(zip(f.q, state.q, strict=True))}
    values |= dict(zip(f.v, state.v, strict=True))
    known = {
        "M": model.mass_matrix(state.q), "h": model.forces(state.q, state.v), "C": model.jacobian(state.q),
        "a": model.rate(state.q), "b": model.bias(state.q, state.v), "Phi": model.constraints(state.q),
    }  # fmt: skip
    for part, numbers in known.items():
        written = getattr(f, part)
        found = np.array(written.subs(values).evalf(), dtype=float) if written.shape[0] else np.zeros(0)
        assert near(found, numbers, 1e-9), part  # formulas have 12 digits


def test_what_no_page_holds_is_refused_and_what_no_notebook_shows_is_not_shown() -> None:
    with pytest.raises(pt.errors.ArgumentError, match="written out"):
        pt.catalogue.load("stewart-ups").to_sympy()
    f = pt.catalogue.load("heavy-top").to_sympy()
    assert f.M.shape == (3, 3) and f._repr_latex_() is None


def sets_off(t: float, state: Any) -> float:
    return 1.0


def test_what_cannot_be_recorded_is_named() -> None:
    m = pt.catalogue.load("four-bar")
    m.add_torque("A", sets_off, name="own law")
    with pytest.raises(pt.errors.DescriptionError, match=r"own law.*cannot be recorded"):
        m.export_casadi()
    m = pt.catalogue.load("four-bar")
    for arguments, words in (
        ({"inputs": ["E"]}, "E"),
        ({"parameters": ["crank.masses"]}, "crank.mass"),
        ({"outputs": ["D.fors"]}, "D.force"),
    ):
        with pytest.raises(pt.errors.UnknownNameError, match=words):
            m.to_jax(**arguments)
    for arguments, words in (
        ({"inputs": "A"}, "list of names"),
        ({"inputs": ["A", "A"]}, "twice"),
        ({"closing_rate": -1.0}, "closing_rate"),
        ({"independent": ["A", "B"]}, "degrees of freedom"),
        ({"initial": 3.0}, "State"),
    ):
        with pytest.raises(pt.errors.ArgumentError, match=words):
            m.export_casadi(**arguments)
    m.add_drive("A", velocity=1.0, name="motor")
    with pytest.raises(pt.errors.ArgumentError, match="'A' is driven by 'motor'"):
        m.export_casadi(inputs=["A"])
    light = pt.catalogue.load("planar-pendulum")
    tip = light.add_body("tip", mass=0.0, inertia=(0, 0, 0), position=(1, 0, 0))
    light.add_revolute("spins", next(iter(light.bodies)), tip, point=(1, 0, 0))
    with pytest.raises(pt.errors.DescriptionError, match="mass or a moment of inertia"):
        light.to_sympy()
    with pytest.raises(pt.errors.ArgumentError, match="state must be"):
        m.export_casadi().state(pt.catalogue.load("andrews-squeezer").assemble())
    with pytest.raises(pt.errors.ArgumentError, match="32 bits"):
        jax.config.update("jax_enable_x64", False)
        m.to_jax()


def test_missing_packages_are_named_with_their_extras() -> None:
    program = """
import sys
import partita as pt
m = pt.catalogue.load("planar-pendulum")
for package, call in (("casadi", m.export_casadi), ("jax", m.to_jax), ("sympy", m.to_sympy)):
    sys.modules[package] = None
    try:
        call()
    except pt.errors.MissingDependencyError as error:
        assert error.package == package and f"pip install 'partita[{package}]'" in str(error), error
    else:
        raise AssertionError("no error")
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
