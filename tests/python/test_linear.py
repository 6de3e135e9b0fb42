"""Linearised equations, modes and equilibria: closed forms, published numbers, differences of the equations."""

import json
import math
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.analyses.linear import Linearization
from partita.catalogue import spring_four_bar as diagonal
from partita.cli import main
from partita.errors import ArgumentError, UnknownNameError


def pendulum(axis: tuple[float, float, float] = (0, 0, 1)) -> pt.Mechanism:
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(0, -1, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0), axis=axis)
    return m


def test_pendulum_swings_at_its_closed_form():
    modes = pendulum().linearize().modes()
    assert modes.frequency == pytest.approx([math.sqrt(1.5 * 9.81) / (2 * math.pi)], rel=1e-14)
    assert modes.eigenvalues.real.tolist() == [0.0, 0.0]


def test_double_pendulum_against_its_closed_form():
    """Two point masses on massless bars of 1 m: omega^2 = g (2 -+ sqrt 2)."""
    m = pt.Mechanism("double")
    for name, top in (("upper", 0.0), ("lower", -1.0)):
        m.add_body(name, mass=1.0, inertia=(0, 0, 0), position=(0, top - 1.0, 0))
    m.add_revolute("A", m.ground, "upper", point=(0, 0, 0))
    m.add_revolute("B", "upper", "lower", point=(0, -1, 0))
    for coordinates in ("relative", "absolute"):
        modes = m.linearize(coordinates=coordinates).modes()
        wanted = np.sqrt(9.81 * (2 + np.array([-1, 1]) * math.sqrt(2))) / (2 * math.pi)
        assert modes.frequency == pytest.approx(wanted, rel=1e-12), coordinates


def test_four_bar_with_spring_has_the_published_linearisation():
    """Benchmark of the IFToMM library: equilibrium, M, C, K and eigenvalues."""
    m = diagonal.build()
    e = m.equilibrium()
    assert e.state.q == pytest.approx(np.zeros(len(e.state.q)), abs=1e-9)
    assert e.stable
    assert e.eigenvalues[0] == pytest.approx(diagonal.EIGENVALUE, rel=1e-9)
    lin = m.linearize(e, independent=["D"])
    found = float(lin.mass[0, 0]), float(lin.damping[0, 0]), float(lin.stiffness[0, 0])
    assert found == pytest.approx((diagonal.MASS, diagonal.DAMPING, diagonal.STIFFNESS), rel=1e-9)
    # from another drawing, and in absolute coordinates
    away = m.assemble({"D": 0.4})
    for near, coordinates in ((away, "relative"), (m.convert(away, "absolute"), "absolute")):
        e = m.equilibrium(near, coordinates=coordinates)
        assert e.stable and e.eigenvalues[0] == pytest.approx(diagonal.EIGENVALUE, rel=1e-9)


def bicycle(speed: float) -> Linearization:
    m = pt.catalogue.load("whipple-bicycle")
    start = m.assemble(rates={
        "frame": (speed, 0.0, 0.0, 0.0, 0.0, 0.0), "steer": 0.0, "rear axle": -speed / 0.3, "front axle": -speed / 0.35,
    })  # fmt: skip
    return m.linearize(start)


@pytest.mark.parametrize(
    ("speed", "part"),
    [
        (4.292382536341107, lambda values: max(values[values.imag > 0].real, key=abs)),  # weave
        (6.024262015388369, lambda values: max(values[values.imag == 0].real)),  # capsize
    ],
)
def test_bicycle_has_the_published_speeds_of_weave_and_capsize(speed, part):
    """Meijaard, Papadopoulos, Ruina, Schwab 2007: there an eigenvalue has no real part. Its root is that of the
    polynomial through real parts at speeds beside."""
    beside = 0.02 * np.array([-4, -3, -2, -1, 1, 2, 3, 4])
    found = []
    for offset in beside:
        lin = bicycle(speed + float(offset))
        assert lin.steady and lin.A.shape == (10, 10)
        modes = lin.modes()
        # position and heading, the turned wheels, and the speed: of 10, six are zero, by name
        assert modes.zero == 6
        found.append(part(modes.eigenvalues[np.abs(modes.eigenvalues) > 0]))
    fit = np.polynomial.Polynomial.fit(found, beside, 7)
    assert abs(fit(0.0)) < 1e-9 * speed


CATALOGUE = (
    "four-bar",
    "andrews",
    "bricard",
    "delta",
    "slider-crank",
    "car-axis",
    "three-rrr",
    "whipple-bicycle",
    "rolling-ball",
)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("name", CATALOGUE)
def test_a_is_the_derivative_of_the_accelerations(name, coordinates):
    """Of a moving mechanism, by differences of v' at states beside it."""
    m, entry = pt.catalogue.load(name), pt.catalogue.entry(name)
    run = m.simulate(0.05, initial=entry.initial(m), t_eval=[0.05], coordinates=coordinates)
    model = m.compile(coordinates)
    t, q, v = run.t[-1], run.q[-1], run.v[-1]
    found = model.core.linearized(t, q, v, np.zeros((0, len(v))))
    kz = len(found["positions"])
    nx, a = kz + len(found["velocities"]), found["A"]
    ahead, behind = (
        np.array(
            [model.acceleration(found["probe_q"][i], found["probe_v"][i], t=t)[0] for i in range(first, 2 * nx, 2)]
        )
        for first in (0, 1)
    )
    slopes = (ahead - behind) / (2.0 * found["steps"][:, None])
    size = np.abs(found["accelerations"]).max(axis=0)
    assert np.all(np.abs(slopes.T - found["accelerations"][:, :nx]).max(axis=0) < 1e-7 * size.max())
    assert np.allclose(
        a[kz:], found["accelerations"][found["velocities"], :nx], rtol=1e-12, atol=1e-12 * np.abs(a).max()
    )


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_spinning_body_nutates(coordinates):
    """A free symmetric body: 0 twice, +-i spin for its axes, +-i spin (I3 / I1 - 1) for its nutation."""
    m = pt.Mechanism("top", gravity=None)
    top = m.add_body("top", mass=1.0, inertia=(1.0, 1.0, 1.7))
    m.add_spherical("A", m.ground, top, point=(0, 0, 0))
    lin = m.linearize(m.convert(m.assemble(rates={"A": (0, 0, 3.0)}), coordinates), coordinates=coordinates)
    assert lin.steady and not lin.conservative
    wanted = [0, 0, 3j, -3j, 2.1j, -2.1j]
    assert sorted(lin.modes().eigenvalues.imag) == pytest.approx(
        sorted(x.imag for x in map(complex, wanted)), abs=1e-12
    )


@pytest.mark.parametrize(
    ("coordinates", "independent", "turning"),
    [
        ("relative", None, True),
        ("absolute", ["top.wx", "top.wy", "top.wz"], True),
        ("absolute", ["top.x", "top.y", "top.wz"], False),
    ],
)
def test_a_sleeping_top_precesses_in_the_axes_of_the_states(coordinates, independent, turning):
    """I1 p^2 - I3 spin p + m g l = 0 for motions exp(i p t) in space, exp(i (p - spin) t) in axes of the body."""
    m = pt.Mechanism("top", gravity=(0, 0, -9.81))
    top = m.add_body("top", mass=2.0, inertia=(0.3, 0.3, 0.5), position=(0, 0, 0.4))
    m.add_spherical("A", m.ground, top, point=(0, 0, 0))
    state = m.convert(m.assemble(rates={"A": (0, 0, 9.0)}), coordinates)
    found = m.linearize(state, coordinates=coordinates, independent=independent)
    assert found.steady and not found.conservative
    across, weight = 0.3 + 2.0 * 0.4**2, 2.0 * 9.81 * 0.4
    precession = np.roots([across, -0.5 * 9.0, weight]) - (9.0 if turning else 0.0)
    assert sorted(found.modes().eigenvalues.imag) == pytest.approx(sorted([*precession, *-precession, 0, 0]), abs=1e-12)


def test_the_force_of_a_pin_changes_with_state_and_effort():
    """V4: C and D of a reaction, against runs that begin beside the state, or with another torque."""
    m = pt.catalogue.load("four-bar")
    m.add_torque("A", 0.0, name="motor")
    m.add_sensor("pin", m.joints["C"], "force")
    lin = m.linearize(m.assemble({"A": 0.3}, rates={"A": 2.0}), inputs=["A"], independent=["A"])
    assert lin.outputs == ("pin[0]", "pin[1]", "pin[2]")

    def pin(angle: float, rate: float, torque: float = 0.0) -> np.ndarray:
        start = m.assemble({"A": angle}, rates={"A": rate})
        run = m.simulate(1e-3, initial=start, t_eval=[0.0, 1e-3], parameters={"motor.value": torque})
        return run.sensor("pin").values[0]

    h = 1e-5
    columns = (pin(0.3 + h, 2.0) - pin(0.3 - h, 2.0)) / (2 * h), (pin(0.3, 2.0 + h) - pin(0.3, 2.0 - h)) / (2 * h)
    size = np.abs(lin.C).max()
    assert pytest.approx(np.column_stack(columns), abs=1e-7 * size) == lin.C
    assert lin.D[:, 0] == pytest.approx(pin(0.3, 2.0, 1.0) - pin(0.3, 2.0), abs=1e-9 * np.abs(lin.D).max())
    assert lin.y0 == pytest.approx(pin(0.3, 2.0), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("name", ["four-bar-spring", "delta", "three-rrr"])
def test_eigenvalues_are_those_of_absolute_coordinates(name):
    m = pt.catalogue.load(name)
    e = m.equilibrium(stable=True)
    one = m.linearize(e).modes().eigenvalues
    other = m.linearize(m.convert(e.state, "absolute"), coordinates="absolute").modes().eigenvalues
    assert np.sort_complex(one) == pytest.approx(np.sort_complex(other), rel=1e-8, abs=1e-6 * np.abs(one).max())


def test_a_moving_mechanism_has_no_modes():
    m = pt.catalogue.load("four-bar")
    lin = m.linearize(m.assemble(rates={"A": 2.0}))
    assert not lin.steady
    with pytest.raises(ArgumentError, match="not steady: it moves"):
        lin.modes()
    with pytest.raises(ArgumentError, match="not steady: it accelerates"):
        m.linearize().modes()


def test_an_effort_and_a_sensor():
    """Torque on a pendulum, read as an angle and as the force of its pin: closed forms."""
    m = pendulum()
    lin = m.linearize(inputs=["A"], outputs=["A"])
    assert lin.B[:, 0] == pytest.approx([0.0, 3.0], rel=1e-14)
    assert pytest.approx(np.array([[1.0, 0.0]]), abs=1e-9) == lin.C
    system, named = lin.to_scipy(), lin.to_control()
    assert np.array_equal(system.A, lin.A) and np.array_equal(named.B, lin.B)
    assert named.state_labels == ["A", "A'"] and named.input_labels == ["A"] and named.output_labels == ["A"]


def test_equilibria_of_a_double_pendulum():
    m = pt.Mechanism("double")
    a = m.add_rod("a", start=(0, 0, 0), end=(0, -1, 0), mass=1.0)
    b = m.add_rod("b", start=(0, -1, 0), end=(0, -2, 0), mass=1.0)
    m.add_revolute("A", m.ground, a, point=(0, 0, 0))
    m.add_revolute("B", a, b, point=(0, -1, 0))
    found = m.equilibria(30)
    assert [e.stable for e in found] == [True, False, False, False]
    assert found[0].potential < found[1].potential < found[2].potential < found[3].potential


def test_a_stable_equilibrium_is_found_from_the_top():
    """From a saddle itself, where no force shows the way."""
    m = pendulum()
    top = m.assemble({"A": math.pi})
    assert m.equilibrium(top).stable is False
    down = m.equilibrium(top, stable=True)
    assert down.stable and math.cos(down.state.position("A")) == pytest.approx(1.0, abs=1e-12)


def test_neutral_equilibrium_is_named():
    m = pt.Mechanism("turntable", gravity=(0, 0, -9.81))
    disc = m.add_body("disc", mass=1.0, inertia=(1, 1, 2))
    m.add_revolute("A", m.ground, disc, point=(0, 0, 0))
    e = m.equilibrium()
    assert (e.stable, e.indifferent) == (None, 1)
    assert [mode.kind for mode in m.linearize().modes()] == ["zero", "zero"]


def test_no_equilibrium():
    m = pt.Mechanism("falling")
    body = m.add_body("body", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("A", m.ground, body, point=(0, 0, 0), axis=(0, 1, 0))
    with pytest.raises(ArgumentError, match=r"no equilibrium was found .* effort -9.81.* along A is left"):
        m.equilibrium()
    m = pendulum()
    m.add_friction("A", 0.1, stick_velocity=0.01)
    with pytest.raises(ArgumentError, match=r"friction .* whole set of positions"):
        m.equilibrium()
    m = pendulum()
    m.add_drive("A", lambda t: 2.0 * t)
    with pytest.raises(ArgumentError, match="drives move at t = 0"):
        m.equilibrium()


def test_reactions_of_an_equilibrium():
    """A rhombus hung from a spring: the pins carry the weight."""
    m = diagonal.build()
    e = m.equilibrium()
    total = e.joint("A").force + e.joint("D").force
    assert total.shape == (1, 3)
    spring = m.simulate(0.01, initial=e.state, t_eval=[0.0]).joint("A").force[0]
    assert e.joint("A").force[0] == pytest.approx(spring, abs=1e-8)


def test_names_that_are_none():
    m = pendulum()
    with pytest.raises(UnknownNameError):
        m.linearize(inputs=["Z"])
    with pytest.raises(UnknownNameError):
        m.linearize(outputs=["Z"])
    with pytest.raises(ArgumentError, match="list of names"):
        m.linearize(inputs="A")


def test_commands_print_equilibrium_and_modes(tmp_path, capsys):
    assert main(["equilibrium", "four-bar-spring", "--target", "D=20deg"]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("<Equilibrium at ") and ": stable; frequencies 0.3418 Hz" in printed
    assert main(["modes", "four-bar-spring", "--html", str(tmp_path / "mode.html")]) == 0
    printed = capsys.readouterr().out
    assert "0.3418" in printed and "rocker" in printed
    assert (tmp_path / "mode.html").stat().st_size > 10_000
    assert main(["modes", "four-bar-spring", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["zero"] == 0
    assert main(["modes", "whipple-bicycle", "--here"]) == 2  # its start rolls to one side
    assert "not steady" in capsys.readouterr().err


def test_platform_on_six_springs_has_the_frequencies_of_its_stiffness():
    """Unstressed legs along the lines of a Stewart platform: K = sum k J^T J, with J the line coordinates."""
    m = pt.Mechanism("platform", gravity=None)
    inertia = np.diag([0.4, 0.5, 0.8])
    top = m.add_body("top", mass=6.0, inertia=inertia, position=(0, 0, 1.0))
    m.add_free("free", m.ground, top, point=(0, 0, 1.0))
    stiffness = np.zeros((6, 6))
    for i in range(6):
        around, below = math.radians(60 * i + (10 if i % 2 else -10)), math.radians(60 * i + (-20 if i % 2 else 20))
        foot = np.array([1.2 * math.cos(below), 1.2 * math.sin(below), 0.0])
        head = np.array([0.7 * math.cos(around), 0.7 * math.sin(around), 0.0])
        leg = head - foot + np.array([0, 0, 1.0])
        line = leg / np.linalg.norm(leg)
        k = 1000.0 * (1 + i)
        m.add_spring(f"leg {i}", m.ground, foot, top, head, stiffness=k, length=float(np.linalg.norm(leg)))
        gradient = np.concatenate([line, np.cross(head, line)])
        stiffness += k * np.outer(gradient, gradient)
    root = np.diag(1 / np.sqrt([6.0, 6.0, 6.0, 0.4, 0.5, 0.8]))
    wanted = np.sqrt(np.linalg.eigvalsh(root @ stiffness @ root)) / (2 * math.pi)
    e = m.equilibrium()
    assert e.stable and e.indifferent == 0
    for coordinates in ("relative", "absolute"):
        modes = m.linearize(coordinates=coordinates).modes()
        assert modes.frequency == pytest.approx(wanted, rel=1e-9), coordinates


def test_all_equilibria_of_a_crank_rocker_on_both_branches():
    """Against the stationary points of its potential, from the closed form of its positions."""
    a, b, c, d = 0.4, 1.0, 0.8, 1.1
    m = pt.Mechanism("crank-rocker")
    crank = m.add_rod("crank", start=(0, 0, 0), end=(a, 0, 0), mass=1.0)
    far = (a - d) ** 2
    x = (far + c**2 - b**2) / (2 * math.sqrt(far))  # from D towards B
    top = np.array([d - x, math.sqrt(c**2 - x**2), 0.0])
    coupler = m.add_rod("coupler", start=(a, 0, 0), end=top, mass=2.0)
    rocker = m.add_rod("rocker", start=(d, 0, 0), end=top, mass=1.5)
    m.add_revolute("A", m.ground, crank, point=(0, 0, 0))
    m.add_revolute("B", crank, coupler, point=(a, 0, 0))
    m.add_revolute("C", coupler, rocker, point=top)
    m.add_revolute("D", m.ground, rocker, point=(d, 0, 0))
    m.add_torsion_spring("A", stiffness=1.5, angle=0.3)

    def height(angle: np.ndarray, sign: int) -> np.ndarray:
        bx, by = a * np.cos(angle), a * np.sin(angle)
        length = np.hypot(d - bx, -by)
        along = (length**2 + b**2 - c**2) / (2 * length)
        off = sign * np.sqrt(b**2 - along**2)
        cy = by + along * -by / length + off * (d - bx) / length
        return 9.81 * (by / 2 + 2.0 * (by + cy) / 2 + 1.5 * cy / 2) + 0.75 * (angle - 0.3) ** 2

    wanted = []
    angle = np.linspace(-math.pi, math.pi, 200_001)[:-1]
    for sign in (1, -1):
        slope = np.gradient(height(angle, sign), angle)[1:-1]
        wanted += angle[1:-1][:-1][slope[:-1] * slope[1:] < 0].tolist()
    found = m.equilibria(200)
    inside = sorted(e.state.position("A") for e in found if abs(e.state.position("A")) < math.pi - 1e-3)
    # the spring winds: other turns of the crank have equilibria of their own
    assert len(inside) == len(wanted)
    assert inside == pytest.approx(sorted(wanted), abs=1e-4)


def test_an_animated_mode_is_closed_and_claims_no_forces():
    m = pt.catalogue.load("four-bar-spring")
    modes = m.linearize(m.equilibrium()).modes()
    moved = modes._shapes.animated(modes[0].displacements, 0.3, 2.0)
    assert np.abs(moved.q).max() == pytest.approx(0.3, rel=0.1)
    model = m.compile()
    assert max(np.abs(model.constraints(q)).max() for q in moved.q) < 1e-12
    assert np.isnan(moved.joint("C").force).all()


def rotor(across: tuple[float, float]) -> pt.Mechanism:
    """A disc of unequal moments across its axis, in a massless gimbal on springs."""
    m = pt.Mechanism("rotor", gravity=None)
    for name in ("ring", "yoke"):
        m.add_body(name, mass=0.0, inertia=(0, 0, 0))
    m.add_body("disc", mass=1.0, inertia=(*across, 1.5e-3))
    m.add_revolute("a", m.ground, "ring", point=(0, 0, 0), axis=(1, 0, 0))
    m.add_revolute("b", "ring", "yoke", point=(0, 0, 0), axis=(0, 1, 0))
    m.add_revolute("spin", "yoke", "disc", point=(0, 0, 0), axis=(0, 0, 1))
    for joint in "ab":
        m.add_torsion_spring(joint, stiffness=2.0)
    return m


def test_a_rotor_whose_inertia_turns_has_no_modes():
    """Unstable between its critical speeds, 28.3 and 36.5 rad/s, where A at one angle has imaginary eigenvalues."""
    m = rotor((4e-3, 3e-3))
    run = m.simulate(2.0, initial=m.assemble({"a": 1e-5}, rates={"spin": 32.0}))
    assert np.abs(run.joint("a").angle).max() > 50e-5
    driven = rotor((4e-3, 3e-3))
    driven.add_drive("spin", velocity=32.0)
    for moving in (m.linearize(m.assemble(rates={"spin": 32.0})), driven.linearize()):
        assert not moving.steady
        with pytest.raises(ArgumentError, match="not steady: it moves"):
            moving.modes()
    assert m.linearize().steady


@pytest.mark.parametrize("driven", [False, True])
def test_a_symmetric_rotor_has_the_modes_of_a_gyroscope(driven):
    """I p^2 - G p - k = 0 for motions exp(i p t), with G = I3 spin."""
    m = rotor((2e-3, 2e-3))
    if driven:
        m.add_drive("spin", velocity=32.0)
    lin = m.linearize(m.assemble() if driven else m.assemble(rates={"spin": 32.0}))
    assert lin.steady
    values = lin.modes().eigenvalues.imag
    wanted = np.roots([2e-3, -1.5e-3 * 32.0, -2.0])
    assert sorted(values[np.abs(values) > 1e-6]) == pytest.approx(sorted([*wanted, *-wanted]), rel=1e-12)


def test_a_bicycle_described_by_its_wheel_is_refused_with_the_remedy():
    """The axes of the wheel turn, and A with them: its eigenvalues are not those of weave and capsize."""
    m = pt.catalogue.load("whipple-bicycle")
    m.joints.remove("frame")
    m.add_free("wheel", m.ground, "rear wheel")
    turn = -5.0 / 0.3
    start = m.assemble(rates={"wheel": (5.0, 0.0, 0.0, 0.0, turn, 0.0), "rear axle": turn, "front axle": -5.0 / 0.35})
    lin = m.linearize(start)
    assert not lin.steady
    with pytest.raises(ArgumentError, match=r'"wheel\.w[xyz]" is measured in axes that turn .* m\.add_free\("pose"'):
        lin.modes()


def turning(load=None, t0=0.0, **more):
    """A wheel on which a load acts that may depend on time, beside a mass on a spring that rests."""
    m = pt.Mechanism("wheel", gravity=None)
    m.add_body("wheel", mass=1.0, inertia=(1, 1, 1))
    m.add_body("block", mass=1.0, inertia=(1, 1, 1))
    m.add_revolute("A", m.ground, "wheel", point=(0, 0, 0))
    m.add_prismatic("S", m.ground, "block", axis=(1, 0, 0))
    m.add_spring("spring", m.ground, (-1, 0, 0), "block", (0, 0, 0), stiffness=9.0)
    m.add_torsion_spring("A", stiffness=4.0)
    if load is not None:
        m.add_torque("A", load, **more)
    return m


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("t0", [0.0, 0.3])
def test_loads_that_change_with_time_are_not_steady(coordinates, t0):
    times = np.linspace(0.0, 5.0, 101)
    changing = [
        lambda t, s: -(2.0 + np.cos(t)) * s.position("A"),
        lambda t, s: -(2.0 + np.cos(3.0 * t)) * s.velocity("A"),
        lambda t, s: np.sin(t - t0),
        (times, 1.0 - np.cos(2.0 * np.pi * (times - t0))),
        (times, np.maximum(0.0, times - t0 - 0.05)),
    ]
    if coordinates == "absolute":
        changing = changing[2:]
    for load in changing:
        m = turning(load)
        lin = m.linearize(m.assemble(t=t0, coordinates=coordinates), coordinates=coordinates)
        assert not lin.steady, load
        with pytest.raises(ArgumentError, match="not steady"):
            lin.modes()
    lasting = [None, 0.0, (times, 0.0 * times), (times, np.maximum(0.0, times - 4.0))]
    if coordinates == "relative":
        lasting += [lambda t, s: -2.0 * s.position("A"), lambda t, s: -0.1 * s.velocity("A") + 0.0 * t]
    for load in lasting:
        m = turning(load)
        assert m.linearize(m.assemble(t=t0, coordinates=coordinates), coordinates=coordinates).steady, load
    # a load over an angle is none over time
    m = turning(([-1.0, 0.0, 1.0], [1.0, 0.0, -1.0]), over="A")
    assert m.linearize(m.assemble(t=t0, coordinates=coordinates), coordinates=coordinates).steady
    # a steady turn under a torque that is zero at this time alone
    m = turning()
    m.forces.remove(next(force for force in m.forces if force != "spring"))
    m.add_torque("A", lambda t, s: np.sin(t - t0))
    lin = m.linearize(m.assemble(rates={"A": 2.0}, t=t0, coordinates=coordinates), coordinates=coordinates)
    assert not lin.steady


def hanging(extra: Any, drawn: float = 0.0) -> pt.Mechanism:
    """A rod that hangs, with something in its hinge."""
    m = pt.Mechanism("pendulum", gravity=(0, -9.81, 0))
    rod = m.add_rod("rod", start=(0, 0, 0), end=(math.sin(drawn), -math.cos(drawn), 0), mass=1.0)
    extra(m, rod, m.add_revolute("A", m.ground, rod, point=(0, 0, 0)))
    return m


TWO_SIDED = {
    "friction that sticks": (lambda m, r, h: m.add_friction(h, 2.0, stick_velocity=1e-3, name="f"), "sticks"),
    "friction of the bearing": (
        lambda m, r, h: m.add_friction(h, coefficient=0.1, radius=0.02, stick_velocity=1e-3, name="f"),
        "sticks",
    ),
    "an upper stop": (lambda m, r, h: m.add_stop(h, upper=0.0, stiffness=1e4, name="f"), "nothing on one side"),
    "a lower stop": (lambda m, r, h: m.add_stop(h, lower=0.0, upper=1.0, stiffness=1e4, name="f"), "nothing on one"),
    "a rope about to pull": (
        lambda m, r, h: m.add_rope("f", m.ground, (0.5, -1, 0), r, (1, 0, 0), stiffness=1e4, length=0.5),
        "nothing on one side",
    ),
    "a contact": (
        lambda m, r, h: m.add_contact(
            "f", r, (1, 0, 0), m.ground, (-0.1, 0, 0), normal=(1, 0, 0), radius1=0.1, stiffness=1e5, exponent=1.0
        ),
        "nothing on one side",
    ),
    "a table": (
        lambda m, r, h: m.add_torque(
            h, ([-1.0, 0.0, 1.0], [-1.0, 0.0, 5.0]), over=pt.Coordinate(h), interpolation="linear", name="f"
        ),
        "slope jumps",
    ),
}  # fmt: skip


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("name", TWO_SIDED)
def test_what_has_no_derivative_is_refused_by_name(name: str, coordinates: str) -> None:
    """Coulomb friction at rest is no damper, and a stop at its corner has a stiffness on one side alone."""
    extra, words = TWO_SIDED[name]
    m = hanging(extra)
    with pytest.raises(ArgumentError, match=f'no derivative .*"f" .*{words}') as caught:
        m.linearize(m.assemble(coordinates=coordinates), coordinates=coordinates)
    assert caught.value.argument == "at"


BESIDE: dict[str, tuple[Any, float, float]] = {
    # what is added, rate of the hinge, and the right stiffness over the moment of inertia
    "friction that slides": (lambda m, r, h: m.add_friction(h, 2.0, stick_velocity=1e-6, name="f"), 3.0, 0.0),
    "a stop that is free": (lambda m, r, h: m.add_stop(h, upper=1e-3, stiffness=1e4, name="f"), 0.0, 0.0),
    "a stop pressed": (lambda m, r, h: m.add_stop(h, upper=-1e-3, stiffness=1e4, name="f"), 0.0, 3e4),
    "a soft corner": (lambda m, r, h: m.add_stop(h, upper=0.0, stiffness=1e4, exponent=1.5, name="f"), 0.0, 0.0),
    "a smooth table": (
        lambda m, r, h: m.add_torque(h, ([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]), over=pt.Coordinate(h), name="f"),
        0.0, -3.0,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BESIDE)
def test_beside_it_the_derivative_is_the_one_that_holds_there(name: str) -> None:
    extra, rate, added = BESIDE[name]
    m = hanging(extra)
    lin = m.linearize(m.assemble(rates={"A": rate}))
    assert lin.method == "exact"
    assert -lin.A[1, 0] == pytest.approx(1.5 * 9.81 + added, rel=1e-12)
    assert abs(lin.A[1, 1]) < 1e-6


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("mass", [1e-3, 1e-6, 1e-9, 1e-12])
def test_damped_modes_on_a_light_frame_do_not_grow(mass: float, coordinates: str) -> None:
    """A pendulum on a frame held by springs of 10 kN/m with little damping: its own mode decays as the dampers want,
    whatever the frame weighs; that gives frequencies of 1e7 rad/s beside 3.8 rad/s."""
    decay = []
    for damping in (1e-3, 1.0):
        m = pt.Mechanism("frame")
        m.add_body("frame", mass=mass, inertia=(mass * 1e-2,) * 3)
        m.add_planar("S", m.ground, "frame", normal=(0, 0, 1))
        m.add_rod("rod", start=(0, 0, 0), end=(0, -1, 0), mass=1.0)
        m.add_revolute("A", "frame", "rod", point=(0, 0, 0))
        for i, (x, y) in enumerate(((1, 0), (-1, 0), (0, 1))):
            ends = m.ground, (x, y, 0), "frame", (0.1 * x, 0.1 * y, 0)
            m.add_spring(f"s{i}", *ends, stiffness=1e4, length=0.9, damping=damping)
        found = m.linearize(m.equilibrium(stable=True, coordinates=coordinates), coordinates=coordinates).modes()
        slowest = found.eigenvalues[np.argsort(np.abs(found.eigenvalues))[0]]
        assert abs(slowest) == pytest.approx(3.835, abs=1e-3)
        assert found.eigenvalues.real.max() < 0.0
        decay.append(slowest.real)
    # proportional to the damper, to the last digits of what is far below the largest eigenvalue
    assert decay[0] == pytest.approx(-4.05e-10, rel=2e-2) and decay[1] == pytest.approx(1e3 * decay[0], rel=1e-2)
