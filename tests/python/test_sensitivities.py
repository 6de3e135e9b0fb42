"""Derivatives of runs: against closed forms, 28 digits by quadrature, and each other."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import partita as pt
from partita.errors import ArgumentError, DescriptionError, SuspectResultWarning

# The crank-rocker with links 1, 0.3, 0.9, 0.7 m, uniform rods of 1 kg/m, from crank angle 1 rad at 6 rad/s after 2 s:
# angle and rate of the crank, and their derivatives, by quadrature of the energy integral in 70 digits, without time
# stepping.
END = (17.668925658046344, 11.218479201474437)
BY = {
    "d": (8.706772805797662, -64.04094146519823),
    "l1": (-11.145026189460262, 74.8502809942802),
    "l2": (-5.5068251671715265, 34.160911956526114),
    "l3": (-4.353135026321914, 40.47387445931792),
    "m1": (0.7364667699141274, -3.9249396278969506),
    "m2": (-0.0018149467537655916, -0.21290799571460714),
    "m3": (0.51709515268842, -3.8414680329391793),
    "s1": (-0.4226598389764072, 4.32708479815118),
    "s2": (-0.7135282462356455, 2.572918372159577),
    "s3": (-1.1361880852120527, 6.900003170310757),
    "J1": (-42.124297306770266, 270.5992011987796),
    "J2": (-3.840044520199824, 28.77260237010161),
    "J3": (-8.858687308526093, 59.52220096403721),
    "g": (0.4673568917382606, -3.0406530303259296),
    "start": (16.476013170657236, -121.10978769689741),
    "rate": (2.2112360311740336, -16.213332642542515),
    "end": (11.218479201474437, -84.07804375586213),
}
# Second derivatives of the angle by l1, l2, m2, g and the start rate.
HESSIAN = np.array(
    [
        [15.497431591236507, 4.651775537092315, 3.0200353761609517, 2.3069766993945744, 17.406279857739804],
        [4.651775537092315, -14.13364327592471, 2.846405041861946, 0.4064000361774227, 10.058042533875199],
        [3.0200353761609517, 2.846405041861946, 0.010110943047193776, -0.03441266679911597, 0.04156008852824017],
        [2.3069766993945744, 0.4064000361774227, -0.03441266679911597, -0.1594739532051622, -0.6478568137071831],
        [17.406279857739804, 10.058042533875199, 0.04156008852824017, -0.6478568137071831, -3.654491771887355],
    ]
)
# The largest force in the rocker's pin on the ground over the run, and its derivatives.
PEAK = 32.19772702003933
PEAK_BY = {
    "l1": 193.8506748686167,
    "l2": 75.1563414985007,
    "l3": -59.21674990070604,
    "m2": 23.43690411627877,
    "m3": 19.62528024582919,
    "J2": -52.46800111038196,
    "g": 1.9743563797446406,
}


def four_bar() -> tuple[pt.Mechanism, dict[str, Any]]:
    """The crank-rocker, and what each of its numbers is here: a parameter and the direction in which it changes."""
    origin, ground = np.zeros(3), np.array([1.0, 0.0, 0.0])
    crank = 0.3 * np.array([np.cos(1.0), np.sin(1.0), 0.0])
    gap = ground - crank
    length = float(np.linalg.norm(gap))
    along = (0.9**2 - 0.7**2 + length**2) / (2 * length)
    normal = np.array([-gap[1], gap[0], 0.0]) / length
    joint = crank + gap / length * along + normal * np.sqrt(0.9**2 - along**2)
    m = pt.Mechanism("four-bar", gravity=(0, -9.81, 0))
    links = {
        "crank": (origin, crank, 0.3, 0.15, 0.00225),
        "coupler": (crank, joint, 0.9, 0.45, 0.06075),
        "rocker": (ground, joint, 0.7, 0.35, 0.7 * 0.49 / 12),
    }
    made, by = {}, {}
    for i, (name, (near, far, mass, s, inertia)) in enumerate(links.items(), 1):
        unit = (far - near) / np.linalg.norm(far - near)
        made[name] = m.add_body(name, mass=mass, com=tuple(near + s * unit), inertia=np.diag([inertia] * 3))
        by |= {f"l{i}": f"{name}.length", f"m{i}": f"{name}.mass"}
        by |= {f"s{i}": (f"{name}.com", unit), f"J{i}": (f"{name}.inertia", np.diag([0.0, 0.0, 1.0]))}
    z = (0, 0, 1)
    m.add_revolute("O", "ground", made["crank"], point=tuple(origin), axis=z)
    m.add_revolute("A", made["crank"], made["coupler"], point=tuple(crank), axis=z)
    m.add_revolute("B", made["coupler"], made["rocker"], point=tuple(joint), axis=z)
    m.add_revolute("D", "ground", made["rocker"], point=tuple(ground), axis=z)
    by |= {"g": ("gravity", np.array([0.0, -1.0, 0.0])), "start": pt.start("O"), "rate": pt.start_rate("O")}
    return m, by | {"end": pt.end_time}


def keys(by: dict[str, Any], names: Any) -> list[Any]:
    """What is differentiated by."""
    return [by[name][0] if isinstance(by[name], tuple) else by[name] for name in names]


def along(found: Any, number: Any) -> float:
    """The derivative in the direction of a number."""
    if isinstance(number, tuple):
        return float(np.sum(np.asarray(found[number[0]]) * number[1]))
    return float(found[number])


@pytest.mark.parametrize("method", ["forward", "adjoint"])
@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_derivatives_of_a_four_bar_have_nine_digits(method: str, coordinates: str) -> None:
    m, by = four_bar()
    m.add_sensor("w", "O", "velocity")
    start = m.assemble({"O": 0.0}, {"O": 6.0})
    names = [name for name in BY if name != "d"]
    for i, of in enumerate(("O", "w")):
        g = m.gradient(
            of, by=keys(by, names), duration=2.0, initial=start, method=method, rtol=1e-13, atol=1e-14,
            options={"coordinates": coordinates},
        )  # fmt: skip
        assert g.method == method
        assert_allclose(g.value + (1.0 if i == 0 else 0.0), END[i], rtol=1e-10)
        for name in names:
            # a derivative next to zero, by m2, has the digits of what cancels in it
            assert_allclose(along(g.by, by[name]), BY[name][i], rtol=1e-9, atol=1e-11)


def test_second_derivatives_and_a_largest_force() -> None:
    m, by = four_bar()
    force = m.add_sensor("pin", "D", "force")
    start = m.assemble({"O": 0.0}, {"O": 6.0})
    names = ("l1", "l2", "m2", "g", "rate")
    g = m.gradient("O", by=keys(by, names), duration=2.0, initial=start, second=True, rtol=1e-13, atol=1e-14)
    kept = [0, 1, 2, 4, 6]  # of gravity its second component, which falls
    signs = np.array([1.0, 1.0, 1.0, -1.0, 1.0])
    assert g.hessian is not None and g.hessian_error is not None and g.hessian_error < 1e-6
    assert_allclose(g.hessian[np.ix_(kept, kept)] * np.outer(signs, signs), HESSIAN, rtol=1e-7, atol=1e-8)
    peak = m.gradient(pt.peak(force.norm()), by=keys(by, PEAK_BY), duration=2.0, initial=start, rtol=1e-13, atol=1e-14)
    assert_allclose(peak.value, PEAK, rtol=1e-10)
    for name, right in PEAK_BY.items():
        assert_allclose(along(peak.by, by[name]), right, rtol=1e-8)


def oscillator(mass: float = 2.0, stiffness: float = 50.0, damping: float = 0.6) -> pt.Mechanism:
    """A mass on a spring along x, at rest where x = 0."""
    m = pt.Mechanism("oscillator", gravity=None)
    block = m.add_body("block", mass=mass, inertia=np.eye(3))
    m.add_prismatic("slide", "ground", block, point=(0, 0, 0), axis=(1, 0, 0))
    m.add_spring("s", "ground", (-1, 0, 0), block, (0, 0, 0), stiffness=stiffness, damping=damping, length=1.0)
    return m


def damped(t: Any, mass: Any, stiffness: Any, damping: Any, x0: Any, v0: Any) -> Any:
    """Its motion in closed form; of complex numbers for derivatives without cancellation."""
    decay = damping / (2 * mass)
    w = np.sqrt(stiffness / mass - decay**2)
    return np.exp(-decay * t) * (x0 * np.cos(w * t) + (v0 + decay * x0) / w * np.sin(w * t))


@pytest.mark.parametrize(
    ("method", "rtol", "damping"),
    [("dop853", 1e-11, 0.6), ("radau", 1e-11, 12.0), ("adams", 1e-11, 0.6), ("auto", 1e-11, 0.6)],
)
def test_derivatives_along_a_run_are_those_of_a_closed_form(method: str, rtol: float, damping: float) -> None:
    m = oscillator(damping=damping)
    times = np.linspace(0.0, 2.0, 41)
    start = m.assemble({"slide": 0.1}, {"slide": 0.3})
    with warnings.catch_warnings():  # the work of the damper, of which radau controls no error, is less exact
        warnings.simplefilter("ignore", SuspectResultWarning)
        run = m.simulate(2.0, t_eval=times, initial=start, method=method, rtol=rtol, atol=0.1 * rtol)
    s = run.sensitivities(["block.mass", "s.stiffness", "s.damping", pt.start("slide"), pt.start_rate("slide")])
    numbers = [2.0, 50.0, damping, 0.1, 0.3]
    tiny = 1e-30
    for i, key in enumerate(s.by):
        moved = [x + (1j * tiny if j == i else 0.0) for j, x in enumerate(numbers)]
        right = damped(times, *moved).imag / tiny
        assert_allclose(s.position("slide", by=key), right, rtol=0, atol=300 * rtol * max(1.0, np.abs(right).max()))


def fallen(height: Any, speed: Any, gravity: Any, restitution: float, duration: float) -> tuple[Any, Any, list[Any]]:
    """Height and speed of a ball that bounces, and when it does, in closed form."""
    t, bounces = 0.0, []
    while True:
        root = np.sqrt(speed * speed + 2.0 * gravity * height)
        down = (speed + root) / gravity
        if np.real(t + down) > duration:
            left = duration - t
            return height + speed * left - 0.5 * gravity * left**2, speed - gravity * left, bounces
        t = t + down
        bounces.append(t)
        height, speed = 0.0, restitution * root


@pytest.mark.parametrize("method", ["forward", "adjoint"])
def test_derivatives_go_through_impacts(method: str) -> None:
    m = pt.Mechanism("ball", gravity=(0, 0, -9.81))
    ball = m.add_body("ball", mass=0.4, inertia=np.eye(3) * 1e-3)
    m.add_prismatic("z", "ground", ball, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_sensor("v", "z", "velocity")
    stop = pt.Event("floor", "z", value=0.0, direction=-1, then=pt.Stop(restitution=0.8))
    start = m.assemble({"z": 0.9}, {"z": 0.2})
    by = [pt.start("z"), pt.start_rate("z"), "gravity", "ball.mass"]
    tiny = 1e-30
    moved = [
        fallen(*(x + (1j * tiny if j == i else 0.0) for j, x in enumerate((0.9, 0.2, 9.81))), 0.8, 2.0)
        for i in range(3)
    ]
    assert len(moved[0][2]) == 3
    for of, right in (
        ("z", [x[0] for x in moved]),
        ("v", [x[1] for x in moved]),
        ("t:floor", [x[2][0] for x in moved]),
    ):
        g = m.gradient(of, by=by, duration=2.0, initial=start, events=[stop], method=method, rtol=1e-12, atol=1e-13)
        assert len(g.run.events) == 3
        found = [g.by[by[0]], g.by[by[1]], -g.by["gravity"][2]]
        assert_allclose(found, [x.imag / tiny for x in right], rtol=1e-9)
        assert_allclose(g.by["ball.mass"], 0.0, atol=1e-9)


def test_a_run_that_an_event_ends_moves_its_end() -> None:
    m = pt.Mechanism("fall", gravity=(0, 0, -9.81))
    ball = m.add_body("ball", mass=0.4, inertia=np.eye(3) * 1e-3)
    m.add_prismatic("z", "ground", ball, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_sensor("v", "z", "velocity")
    floor = pt.Event("floor", "z", value=0.0, direction=-1, terminal=True)
    start = m.assemble({"z": 0.9}, {"z": 0.0})
    for method in ("forward", "adjoint"):
        g = m.gradient(
            pt.at_end("v") + 3.0 * pt.integral("z") * pt.integral("z"), by=[pt.start("z"), pt.end_time], duration=2.0,
            initial=start, events=[floor], method=method,
        )  # fmt: skip
        # v = -sqrt(2 g h), integral of the height = 2/3 h t, t = sqrt(2 h / g)
        h, gravity = 0.9, 9.81
        area = 2 / 3 * h * np.sqrt(2 * h / gravity)
        assert_allclose(g.value, -np.sqrt(2 * gravity * h) + 3 * area**2, rtol=1e-9)
        assert_allclose(g.by[pt.start("z")], -np.sqrt(gravity / (2 * h)) + 6 * area * 1.5 * area / h, rtol=1e-8)
        assert_allclose(g.by[pt.end_time], 0.0, atol=1e-12)


def driven(name: str) -> tuple[pt.Mechanism, dict[str, Any]]:
    """A mechanism of the catalogue with a start that moves, and how its gradient is asked for."""
    m = pt.catalogue.load(name)
    return m, {"by": [p for p in m.compile().parameters if p.endswith((".mass", ".com"))][:6]}


CASES: dict[str, tuple[str, float]] = {
    "antiparallelogram": ("A", 1.0),
    "five-bar": ("A", 1.0),
    "ratchet-wrench": ("handle", 1.5),
    "delta": ("shoulder 1", 0.2),
    "rolling-ball": ("flight", 0.5),
    "jansen-leg": ("crank", 0.5),
    "stewart-ups": ("pose", 0.2),
    "double-four-bar": ("A", 0.5),
    "spatial-four-bar": ("A", 0.5),
    "trebuchet": ("arm", 0.6),
}


@pytest.mark.parametrize("name", CASES)
def test_forwards_and_backwards_agree(name: str) -> None:
    m, asked = driven(name)
    joint = m.simulate(1e-3).names.joints[0]
    found = [m.gradient(joint, duration=CASES[name][1], method=method, **asked) for method in ("forward", "adjoint")]
    assert [g.method for g in found] == ["forward", "adjoint"]
    size = np.abs(found[0].vector).max()
    assert size > 1e-6
    assert_allclose(found[1].vector, found[0].vector, rtol=0, atol=1e-11 * size)


def test_locks_and_releases() -> None:
    m = pt.Mechanism("double pendulum", gravity=(0, -9.81, 0))
    a = m.add_rod("a", start=(0, 0, 0), end=(0.6, 0, 0), mass=1.0)
    b = m.add_rod("b", start=(0.6, 0, 0), end=(1.1, 0, 0), mass=0.7)
    m.add_revolute("A", "ground", a, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_revolute("B", a, b, point=(0.6, 0, 0), axis=(0, 0, 1))
    events = [
        pt.Event("lock", "A", value=-0.8, direction=-1, then=pt.Lock("B"), once=True),
        pt.Event("release", "A", value=-1.9, direction=-1, then=pt.Release("B"), once=True),
    ]
    asked: dict[str, Any] = {
        "by": ["a.mass", "b.mass", "b.com", pt.start("A"), pt.start("B"), pt.start_rate("B"), pt.end_time],
        "duration": 1.4,
        "initial": m.assemble({"A": 0.2, "B": 0.3}),
        "events": events,
    }
    forward, back = (m.gradient("B", method=method, **asked) for method in ("forward", "adjoint"))
    assert len(forward.run.events) == 2
    assert_allclose(back.vector, forward.vector, rtol=0, atol=1e-11 * np.abs(forward.vector).max())
    checked = m.gradient("B", method="forward", check=True, **asked)
    assert checked.agrees is not None and checked.agrees < 1e-6


def test_a_parallelogram_passes_its_singular_positions_like_the_pendulum_that_it_is() -> None:
    m = pt.catalogue.load("parallelogram")
    joint = m.simulate(1e-3).names.joints[0]
    start = m.assemble({joint: 0.3}, {joint: 6.0})
    by = [pt.start(joint), pt.start_rate(joint)]
    g = m.gradient(joint, by=by, duration=1.3, initial=start, rtol=1e-12, atol=1e-13)
    assert any("singular positions of the mechanism were crossed" in note for note in g.run.notes)
    # its inertia does not depend on the angle: energy at two positions gives inertia and weight of the pendulum
    energy = g.run.energy
    w, q = (np.ravel(x) for x in (g.run.joint(joint).velocity, g.run.joint(joint).angle))
    inertia = float(np.median(2.0 * energy.kinetic / w**2))
    assert_allclose(2.0 * energy.kinetic, inertia * w**2, rtol=1e-8)
    table = np.column_stack([np.cos(q), np.sin(q), np.ones_like(q)])
    (c, s, _), *_ = np.linalg.lstsq(table, energy.potential, rcond=None)
    weight, phase = float(np.hypot(c, s)), float(np.arctan2(s, c))
    pendulum, heavy = pt.Mechanism("pendulum", gravity=(0, -9.81, 0)), 100.0
    length = weight / (9.81 * heavy)
    arm = (np.sin(phase) * length, np.cos(phase) * length, 0.0)
    rod = pendulum.add_body("rod", mass=heavy, com=arm, inertia=np.eye(3) * (inertia - heavy * length**2))
    pendulum.add_revolute("A", "ground", rod, point=(0, 0, 0), axis=(0, 0, 1))
    right = pendulum.gradient(
        "A", by=[pt.start("A"), pt.start_rate("A")], duration=1.3, initial=pendulum.assemble({"A": 0.3}, {"A": 6.0}),
        rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    assert_allclose(g.vector, right.vector, rtol=1e-6)


@pytest.mark.parametrize(("method", "order", "steps"), [("rk4", 4, (160, 320, 640)), ("bs23", 3, (200, 400, 800))])
def test_derivatives_have_the_order_of_the_method(method: str, order: int, steps: tuple[int, ...]) -> None:
    m, by = four_bar()
    start = m.assemble({"O": 0.0}, {"O": 6.0})
    names, errors = ("l2", "m1", "start"), []
    for count in steps:
        g = m.gradient(
            "O", by=keys(by, names), duration=2.0, initial=start, options={"method": method, "step": 2.0 / count}
        )
        errors.append([abs(along(g.by, by[name]) - BY[name][0]) for name in names])
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert rates[-1].min() > order - 0.4


def test_what_has_no_derivative_is_named() -> None:
    m = oscillator()
    start = m.assemble({"slide": 0.1}, {"slide": 0.0})
    laws = oscillator()
    laws.add_torque("law", "slide", lambda t, state: -0.1 * state.velocity("slide"))
    with pytest.raises(DescriptionError, match=r'"law".*function of Python'):
        laws.gradient("slide", by="block.mass", duration=0.5, initial=laws.assemble({"slide": 0.1}))
    with pytest.raises(ArgumentError, match="no events are looked for"):
        m.gradient("t:top", by="block.mass", duration=0.5, initial=start)
    with pytest.raises(ArgumentError, match="is held"):
        four_bar()[0].gradient("O", by=pt.start("B"), held="O", duration=0.1)
    with pytest.raises(ArgumentError, match="degrees of freedom"):
        four_bar()[0].gradient("O", by="crank.mass", held=("O", "A"), duration=0.1)
    stored = pt.catalogue.load("delta")
    stored.add_sensor("pin", stored.simulate(1e-3).names.joints[1], "acceleration")
    with pytest.raises(ArgumentError, match="of which derivatives are not computed"):
        stored.gradient("pin", by="gravity", duration=0.01)


def test_an_event_that_only_touches_ends_derivatives() -> None:
    m = pt.Mechanism("throw", gravity=(0, 0, -10.0))
    ball = m.add_body("ball", mass=1.0, inertia=np.eye(3))
    m.add_prismatic("z", "ground", ball, point=(0, 0, 0), axis=(0, 0, 1))
    start = m.assemble({"z": 0.0}, {"z": 5.0})
    # thrown up to 1.25 m: a ceiling a billionth below is touched
    ceiling = pt.Event("ceiling", "z", value=1.25 - 1e-13, direction=1, then=pt.Stop(restitution=0.5))
    run = m.simulate(1.0, initial=start, events=[ceiling], rtol=1e-12, atol=1e-13)
    if not len(run.events):
        pytest.skip("rounding decides whether what touches is found")
    with pytest.raises(ArgumentError, match=r'"ceiling".*only touches'):
        m.gradient("z", by=pt.start_rate("z"), duration=1.0, initial=start, events=[ceiling])


def test_the_cheaper_way_is_taken() -> None:
    """By the steps of all passes: few go forwards, many numbers or a long run backwards."""
    m = pt.catalogue.load("four-bar")
    masses = [f"{body}.mass" for body in ("crank", "coupler", "rocker")]
    every = [*masses, *(f"{body}.com" for body in ("crank", "coupler", "rocker")), "gravity", "A.point", "D.point"]
    taken = [m.gradient("D", by=by, duration=d) for by, d in ((masses, 0.1), (masses, 10.0), (every, 2.0))]
    assert [len(g.by) for g in taken] == [3, 3, 9]
    assert [g.method for g in taken] == ["forward", "adjoint", "adjoint"]
    assert taken[0].run.counters["steps"] < 30 < 300 < taken[1].run.counters["steps"]
