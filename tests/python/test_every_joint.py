"""Every joint alike: in the tree, closing a loop, in absolute coordinates, the same wishes give the same motion."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.errors import AssemblyError, ContradictionError
from partita.results import load_result

AXIS = (1.0, 2.0, 2.0)
KINDS: dict[str, tuple[str, dict[str, Any], int]] = {
    "revolute": ("add_revolute", {"axis": AXIS}, 1),
    "prismatic": ("add_prismatic", {"axis": AXIS}, 1),
    "cylindrical": ("add_cylindrical", {"axis": AXIS}, 2),
    "universal": ("add_universal", {"axis1": (1.0, 0.0, 0.5), "axis2": (0.0, 1.0, 0.2)}, 2),
    "planar": ("add_planar", {"normal": AXIS}, 3),
    "pin_slot": ("add_pin_slot", {"axis1": AXIS, "axis2": (2.0, 1.0, -2.0)}, 2),
    "screw": ("add_screw", {"axis": AXIS, "pitch": 0.3}, 2),
    "generic": ("add_joint", {"free": ("x", "rz")}, 2),
}


def effort(name: str, coordinate: int) -> Callable[[float, Any], float]:
    def law(t: float, state: Any) -> float:
        x, v = (np.atleast_1d(part(name))[coordinate] for part in (state.position, state.velocity))
        return float(0.3 * np.sin(x) - 0.1 * v + 0.2 * t)

    return law


WISHES: dict[str, Callable[[pt.Mechanism, int], Any]] = {
    "drive of position": lambda m, c: m.add_drive("J", position=lambda t: 0.3 * t * t, coordinate=c),
    "drive of velocity": lambda m, c: m.add_drive("J", velocity=lambda t: 0.6 * t, coordinate=c),
    "drive of acceleration": lambda m, c: m.add_drive("J", acceleration=0.6, coordinate=c),
    "spring": lambda m, c: m.add_torsion_spring("J", stiffness=3.0, damping=0.2, angle=0.1, coordinate=c),
    "torque": lambda m, c: m.add_torque("J", 0.7, coordinate=c),
    "torque over time": lambda m, c: m.add_torque("J", ([0.0, 1.0], [0.0, 1.0]), coordinate=c),
    "torque over itself": lambda m, c: m.add_torque("J", ([-9, 9], [-9, 9]), over=pt.Coordinate("J", c), coordinate=c),
    "torque by a function": lambda m, c: m.add_torque("J", effort("J", c), coordinate=c),
    "friction": lambda m, c: m.add_friction("J", 0.4, stick_velocity=0.1, coordinate=c),
    "stop": lambda m, c: m.add_stop("J", upper=0.05, stiffness=100.0, coordinate=c),
    "gas spring": lambda m, c: m.add_gas_spring("J", force=-0.4, length=9.0, coordinate=c),
}


def mechanism(kind: str, where: str) -> pt.Mechanism:
    m = pt.Mechanism(kind, gravity=(1.0, -9.0, 2.0))
    m.add_body("body", mass=1.5, inertia=(0.1, 0.2, 0.25), com=(0.2, -0.1, 0.15))
    method, given, _ = KINDS[kind]
    if where == "cut":
        # a joint that constrains nothing carries the body, so that this one closes a loop
        m.add_free("carrier", m.ground, "body", cut="never")
    getattr(m, method)(
        "J", m.ground, "body", point=(0.1, 0.2, 0.0), cut="always" if where == "cut" else "auto", **given
    )
    return m


def seen(m: pt.Mechanism, where: str, **options: Any) -> tuple[Any, ...]:
    coordinates = "absolute" if where == "absolute" else "relative"
    run = m.simulate(0.8, t_eval=[0.0, 0.4, 0.8], coordinates=coordinates, rtol=1e-10, atol=1e-11, **options)
    assert run.success, run.message
    joint = run.joint("J")
    motion = joint.position, joint.velocity, joint.acceleration
    return *motion, joint.force, joint.moment, joint.drive, run.energy.kinetic


CASES = [(kind, c) for kind, (_, _, count) in KINDS.items() for c in range(count)]


@pytest.mark.parametrize("wish", list(WISHES))
def test_what_acts_and_drives(wish: str) -> None:
    for kind, coordinate in CASES:
        runs = {}
        for where in ("tree", "cut", "absolute"):
            m = mechanism(kind, where)
            WISHES[wish](m, coordinate)
            try:
                runs[where] = seen(m, where)
            except Exception as error:
                raise AssertionError(f"{kind} {coordinate} {where}: {type(error).__name__} {error}") from error
        for where in ("cut", "absolute"):
            words = ["position", "velocity", "acceleration", "force", "moment", "drive", "kinetic"]
            for what, x, y in zip(words, runs["tree"], runs[where], strict=True):
                # of forces of some tens of newtons, what the tolerances of the runs let
                assert np.abs(x - y).max() < 1e-6, (kind, coordinate, where, what, np.abs(x - y).max())


ALL_KINDS: dict[str, tuple[str, dict[str, Any], int]] = {
    **KINDS,
    "spherical": ("add_spherical", {}, 3),
    "free": ("add_free", {}, 6),
}


def moving(kind: str, where: str) -> pt.Mechanism:
    """The joint between two bodies that both move, and between the ground and the first a joint of another kind."""
    m = pt.Mechanism(kind, gravity=(1.0, -9.0, 2.0))
    m.add_body("first", mass=2.0, inertia=(0.3, 0.2, 0.4), com=(0.1, 0.1, -0.2))
    m.add_revolute("hinge", m.ground, "first", point=(0.0, 0.3, 0.1), axis=(0.2, 0.3, 1.0))
    m.add_body("body", mass=1.5, inertia=(0.1, 0.2, 0.25), com=(0.2, -0.1, 0.15))
    if where == "cut":
        m.add_free("carrier", m.ground, "body", cut="never")
    parent, child = ("body", "first") if where == "backwards" else ("first", "body")
    method, given, _ = ALL_KINDS[kind]
    geometry = {} if kind == "free" else {"point": (0.1, 0.2, 0.0)}
    getattr(m, method)("J", parent, child, **geometry, cut="always" if where == "cut" else "auto", **given)
    return m


def turning(coordinate: int, name: str) -> Callable[[float, Any], float]:
    """An effort that looks at slides and turns; the sign of a quaternion says nothing."""

    def law(t: float, state: Any) -> float:
        x, v = state.position(name), state.velocity(name)
        slide = np.sin(x[coordinate]) if len(v) == 6 and coordinate < 3 else 0.0
        return float(0.3 * x[-4] * x[-3 + coordinate % 3] - 0.1 * v[coordinate] + 0.1 * slide + 0.2 * t)

    return law


@pytest.mark.parametrize(("kind", "count"), [("spherical", 3), ("free", 6)])
def test_efforts_on_turns_about_all_axes(kind: str, count: int) -> None:
    """About the axes of the child, wherever the joint stands; so do functions see it."""
    for coordinate in range(count):
        seen_at = []
        for where in ("tree", "cut", "absolute"):
            m = moving(kind, where)
            m.add_torque("J", turning(coordinate, "J"), coordinate=coordinate, name="law")
            m.add_torque("J", 0.3, coordinate=(coordinate + 1) % count, name="constant")
            seen_at.append(seen(m, where))
        for where, found in zip(("cut", "absolute"), seen_at[1:], strict=True):
            for x, y in zip(seen_at[0][1:], found[1:], strict=True):
                assert np.abs(x - y).max() < 1e-8, (kind, coordinate, where)


def spatial() -> pt.Mechanism:
    """A hinge that may turn on and on, and what it carries turns out of its plane."""
    m = pt.Mechanism("spatial", gravity=(0.0, -9.81, 0.0))
    m.add_body("body", mass=1.0, inertia=(0.1, 0.2, 0.3), com=(0.1, 0.2, 0.05))
    m.add_revolute("J", m.ground, "body", point=(0.0, 0.0, 0.0), axis=AXIS)
    m.add_body("more", mass=0.2, inertia=(0.01, 0.02, 0.03), com=(0.1, 0.2, 0.25))
    m.add_revolute("K", "body", "more", point=(0.2, 0.1, 0.0), axis=(1.0, 0.0, 0.3))
    return m


TURNS: dict[str, tuple[Callable[[pt.Mechanism], Any], bool]] = {
    "gas force of two strokes": (lambda m: over(m, 2.0 * np.pi, True), True),
    "thrice a turn": (lambda m: over(m, 2.0 * np.pi / 3.0, True), True),
    "gas force of four strokes": (lambda m: over(m, 4.0 * np.pi, True), False),
    "period that is no part of a turn": (lambda m: over(m, 3.0, True), False),
    "table of many turns": (lambda m: over(m, 40.0, False), False),
    "end behind": (lambda m: m.add_stop("J", lower=-1.0, stiffness=10.0), False),
    "end more than half a turn ahead": (lambda m: m.add_stop("J", upper=5.0, stiffness=10.0), False),
    "spring wound at the start": (lambda m: m.add_torsion_spring("J", stiffness=2.0, angle=-3.911), False),
}


def over(m: pt.Mechanism, period: float, periodic: bool) -> None:
    angles = np.linspace(0.0 if periodic else -period, period, 9)
    efforts = 0.5 * np.sin(2.0 * np.pi * angles / period)
    efforts[-1] = efforts[0]
    m.add_torque("J", (angles, efforts), over=pt.Coordinate("J", 0), periodic=periodic)


@pytest.mark.parametrize("what", list(TURNS))
def test_turns_that_are_not_known_are_refused_where_they_matter(what: str) -> None:
    """Off the pose an angle is known up to whole turns: the same motion as in the tree, or a word that says so."""
    add, known = TURNS[what]
    m = spatial()
    add(m)
    start = m.assemble(rates={"J": 12.0})
    options: Any = {"rtol": 1e-10, "t_eval": np.linspace(0.0, 1.0, 41)}
    tree = m.simulate(1.0, initial=start, **options)
    assert tree.success and np.abs(tree.joint("J").position).max() > 3.2
    try:
        run = m.simulate(1.0, initial=spatial().convert(start, "absolute"), coordinates="absolute", **options)
    except pt.errors.DescriptionError as error:
        assert not known and "half a turn" in str(error), error
        return
    assert run.success == known, run.message
    rows = len(run.t)
    assert np.abs(run.joint("J").position - tree.joint("J").position[:rows]).max() < 1e-6
    if not known:
        assert "half a turn" in run.message and "J" in run.message


def test_quaternions_do_not_jump() -> None:
    """A body that turns more than once: the same quaternions in the tree and read off the pose."""
    for kind in ("spherical", "free"):
        turns = []
        for where in ("tree", "cut", "absolute"):
            m = moving(kind, where)
            m.add_drive("J", velocity=lambda t: 7.0 * t, coordinate=ALL_KINDS[kind][2] - 1)
            coordinates = "absolute" if where == "absolute" else "relative"
            run = m.simulate(3.0, t_eval=np.linspace(0.0, 3.0, 121), coordinates=coordinates, rtol=1e-8)
            assert run.success, run.message
            turns.append(run.joint("J").position[:, -4:])
        steps = np.abs(np.diff(turns[1], axis=0)).max()
        assert steps < 0.4, "half a turn of 21 rad/s over 25 ms"
        for found in turns[1:]:
            assert np.abs(found - turns[0]).max() < 1e-5


@pytest.mark.parametrize("where", ["tree", "cut", "absolute", "backwards"])
def test_functions_see_every_joint_as_the_run_reports_it(where: str) -> None:
    for kind in ALL_KINDS:
        m = moving(kind, where)
        views: dict[float, list[Any]] = {}

        def look(t: float, state: Any, views: dict[float, list[Any]] = views) -> float:
            views[t] = [np.atleast_1d(part("J")).copy() for part in (state.position, state.velocity)]
            return 0.0

        m.add_torque("hinge", look)
        coordinates = "absolute" if where == "absolute" else "relative"
        start = m.assemble(rates={"hinge": 1.5}, coordinates=coordinates)
        run = m.simulate(0.3, initial=start, t_eval=[0.0, 0.3], coordinates=coordinates)
        joint = run.joint("J")
        for i, t in enumerate(run.t):
            position, velocity = views[t]
            if kind in ("spherical", "free"):
                position = np.append(position[:-4], position[-4:] * np.sign(position[-4:] @ joint.position[i][-4:]))
            assert np.abs(position - joint.position[i]).max() < 1e-12, (kind, where)
            assert np.abs(velocity - joint.velocity[i]).max() < 1e-12, (kind, where)


@pytest.mark.parametrize("where", ["tree", "cut", "absolute", "backwards"])
def test_accelerations_are_the_derivatives_of_velocities(where: str) -> None:
    """Differences of order 4 of the velocities that the run returns, of every kind of joint."""
    h = 1e-3
    for kind in ALL_KINDS:
        m = moving(kind, where)
        coordinates = "absolute" if where == "absolute" else "relative"
        rates = {"hinge": 1.5}
        start = m.assemble(rates=rates, coordinates=coordinates)
        span = 0.2 + np.arange(-2, 3) * h
        run = m.simulate(0.3, initial=start, t_eval=[0.0, *span, 0.3], coordinates=coordinates, rtol=1e-11, atol=1e-12)
        assert run.success, (kind, run.message)
        for name in run.names.joints:
            joint = run.joint(name)
            v = joint.velocity[1:-1]
            slope = (v[0] - 8.0 * v[1] + 8.0 * v[3] - v[4]) / (12.0 * h)
            size = 1.0 + np.abs(joint.acceleration).max()
            # rounding of velocities over h, and the fifth derivative times h^4
            assert np.abs(joint.acceleration[3] - slope).max() < 1e-7 * size, (kind, where, name)
            assert joint.acceleration.shape == joint.velocity.shape
        assert np.abs(run.joint("J").acceleration).max() > 1e-2, kind


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_accelerations_of_a_slider_crank_in_closed_form(coordinates: str) -> None:
    """Crank at a constant rate: of the slide x = r cos a + sqrt(l^2 - r^2 sin^2 a), in metres and in micrometres."""
    for size in (1.0, 1e-6, 1e3):
        r, rod, rate = 0.3 * size, 1.0 * size, 2.0
        m = pt.Mechanism("slider-crank")
        m.add_rod("crank", start=(0, 0, 0), end=(r, 0, 0), mass=1.0)
        m.add_rod("rod", start=(r, 0, 0), end=(r + rod, 0, 0), mass=1.0)
        m.add_body("piston", mass=1.0, inertia=(size**2, size**2, size**2), position=(r + rod, 0, 0))
        m.add_revolute("A", m.ground, "crank", point=(0, 0, 0))
        m.add_revolute("B", "crank", "rod", point=(r, 0, 0))
        m.add_revolute("C", "rod", "piston", point=(r + rod, 0, 0))
        m.add_prismatic("S", m.ground, "piston", axis=(1, 0, 0))
        m.add_drive("A", position=lambda t: 2.0 * t)
        run = m.simulate(1.0, t_eval=np.linspace(0, 1, 6), coordinates=coordinates)
        assert run.success, run.message
        a = rate * run.t
        s, c = r * np.sin(a), r * np.cos(a)
        root = np.sqrt(rod**2 - s**2)
        x2 = -(rate**2) * (c + (c**2 - s**2) / root + s**2 * c**2 / root**3)
        assert np.abs(run.joint("S").acceleration[:, 0] - x2).max() < 1e-8 * size * rate**2, size
        assert np.abs(run.joint("A").acceleration).max() < 1e-8
        beta = rate**2 * s / root * (1.0 - (c / root) ** 2)  # of the rod in the frame: sin(b) = -s / l
        assert np.abs(run.joint("C").acceleration[:, 0] + beta).max() < 1e-7


def test_accelerations_travel_with_the_result(tmp_path: Path) -> None:
    run = pt.catalogue.load("rssr").simulate(0.3, t_eval=[0.0, 0.1, 0.3])
    all_at_once = run.at_once.joint_accelerations
    for name, about in zip(run.names.joints, run.summary["joints"], strict=True):
        first, count = about["v"]
        assert np.array_equal(run.joint(name).acceleration, all_at_once[:, first : first + count])
    for file in ("run.json", "run.nc"):
        run.save(tmp_path / file)
        back = load_result(tmp_path / file)
        assert all(np.array_equal(back.joint(n).acceleration, run.joint(n).acceleration) for n in run.names.joints)
    sent = pickle.loads(pickle.dumps(run.joint(run.names.joints[0])))
    assert np.array_equal(sent.acceleration, run.joint(run.names.joints[0]).acceleration)
    stored = run.to_xarray()["joint_acceleration"]
    assert stored.dims == ("t", "joint_freedom") and np.array_equal(stored.values, all_at_once)
    run.save(tmp_path / "run.csv")
    assert ".acceleration [" in (tmp_path / "run.csv").read_text(encoding="utf-8").split("\n", 1)[0]


def test_angles_in_the_plane_count_for_reactions_too() -> None:
    """A curve over several turns, of a joint that closes a loop: reactions as with the joint in the tree."""
    runs = []
    for where in ("relative", "absolute"):
        m = pt.Mechanism("winding", gravity=(0, 0, 0))
        m.add_body("arm", mass=1.0, inertia=(1, 1, 2.0), com=(0.5, 0, 0))
        m.add_revolute("J", m.ground, "arm", point=(0, 0, 0))
        m.add_torque("J", ([-30.0, 30.0], [60.0, -60.0]), over="J")
        m.add_torque("J", lambda t, state: -0.1 * state.position("J"), name="second")
        start = m.assemble(rates={"J": 9.0}, coordinates=where)
        runs.append(m.simulate(2.0, initial=start, t_eval=np.linspace(0, 2, 9), coordinates=where, rtol=1e-11))
    tree, cut = (run.joint("J") for run in runs)
    # more than a whole turn; the angle is that of an oscillator
    angle = 9.0 / np.sqrt(2.1 / 2.25) * np.sin(np.sqrt(2.1 / 2.25) * runs[0].t)
    assert angle.max() > 2.0 * np.pi
    for joint in (tree, cut):
        assert np.abs(joint.position[:, 0] - angle).max() < 1e-7
        assert np.abs(joint.force - tree.force).max() < 1e-6 and np.abs(joint.moment - tree.moment).max() < 1e-6


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_drives_that_contradict_are_refused_or_end_the_run(coordinates: str) -> None:
    """Two drives of one degree of freedom, of a joint and of a displacement, of positions and of rates."""

    def slider(**second: Any) -> pt.Mechanism:
        m = pt.Mechanism("over-driven", gravity=(0, 0, -9.81))
        m.add_body("block", mass=2.0, inertia=(1, 1, 1))
        m.add_prismatic("S", m.ground, "block", axis=(0, 0, 1))
        m.add_drive("S", position=lambda t: 0.1 * t * t)
        m.add_drive(pt.Along(m.ground, (0, 0, 0), (0, 0, 1), "block", (0, 0, 0)), **second)
        return m

    with pytest.raises(AssemblyError, match="do not fit"):
        slider(position=lambda t: 0.1 * t * t + 0.01).simulate(1.0, coordinates=coordinates)
    for second in ({"velocity": lambda t: 0.3 * t}, {"velocity": lambda t: 0.2 * t + 0.1}):
        with pytest.raises(ContradictionError, match="contradicts the drive of S"):
            slider(**second).simulate(1.0, coordinates=coordinates)
    late = slider(position=lambda t: 0.1 * t * t + 0.1 * np.maximum(t - 0.5, 0) ** 3)
    run = late.simulate(1.0, coordinates=coordinates)
    assert not run.success and "contradicts the drive of S" in run.message
