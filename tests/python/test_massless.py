"""Links without mass: closed forms, a held distance in their place, and what is refused for want of any mass."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.errors import ArgumentError, DescriptionError

BOTH = pytest.mark.parametrize("coordinates", ["relative", "absolute"])
FORMULATIONS = [
    "projective",
    "wehage-haug",
    "explicit-closing",
    "svd",
    "qr",
    "gram-schmidt",
    "tangent-space",
    "multipliers",
    "sparse-multipliers",
    "range-space",
    "proximal",
]
G = 9.81
A, B, C, D = np.array([(0, 0, 0), (0.4, 0.9, 0), (2.6, 1.6, 0), (2.2, 0, 0)], dtype=float)
CRANK, BAR, ROCKER = (float(np.linalg.norm(x)) for x in (B - A, C - B, C - D))


def four_bar(coupler: float | None = 0.0, size: float = 1.0, fall: Any = (0, -G, 0)) -> pt.Mechanism:
    """Crank 1 kg, rocker 2 kg, the coupler as heavy as is said; None: a held distance in its place."""
    m = pt.Mechanism("four-bar", gravity=tuple(size * np.array(fall)))
    crank = m.add_rod("crank", size * A, size * B, mass=1.0)
    rocker = m.add_rod("rocker", size * D, size * C, mass=2.0)
    m.add_revolute("A", m.ground, crank, point=size * A)
    m.add_revolute("D", m.ground, rocker, point=size * D)
    if coupler is None:
        m.add_distance("bar", crank, (size * CRANK, 0, 0), rocker, (size * ROCKER, 0, 0))
    else:
        bar = m.add_rod("coupler", size * B, size * C, mass=coupler)
        m.add_revolute("B", crank, bar, point=size * B)
        m.add_revolute("C", rocker, bar, point=size * C)
    return m


def run(m: pt.Mechanism, coordinates: str = "relative", duration: float = 2.0, **options: Any) -> Any:
    rates = options.pop("rates", {"A": 1.5})
    start = m.assemble(rates=rates, coordinates=coordinates)
    # fifty times finer than what is asked of two runs
    settings = {"rtol": 1e-12, "atol": 1e-12, "t_eval": np.linspace(0, duration, 21), **options}
    r = m.simulate(duration, initial=start, coordinates=coordinates, **settings)
    assert r.success, r.message
    assert r.certificate.verdict == "valid", r.certificate
    return r


def turns(r: Any, *joints: str) -> np.ndarray:
    return np.hstack([r.joint(j).position for j in joints])


@pytest.fixture(scope="module")
def tied() -> Any:
    return run(four_bar(None))


def along(r: Any, first: str, last: str) -> np.ndarray:
    """Unit vectors from one joint to another."""
    line = r.joint(last).point - r.joint(first).point
    return line / np.linalg.norm(line, axis=1)[:, None]


@BOTH
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_coupler_without_mass_is_a_held_distance(tied: Any, coordinates: str, formulation: str) -> None:
    if (coordinates, formulation) == ("absolute", "explicit-closing"):
        pytest.skip("explicit closing walks joints of the tree; absolute coordinates have none")
    r = run(four_bar(), coordinates, solver=pt.Solver(formulation))
    assert np.abs(turns(r, "A", "D") - turns(tied, "A", "D")).max() < 1e-10
    tension = tied.coupling("bar").tension
    # it carries force along its line alone, at both ends
    for joint, sign in (("B", -1.0), ("C", 1.0)):
        force = sign * tension[:, None] * along(r, "B", "C")
        assert np.abs(r.joint(joint).force - force).max() < 1e-8 * np.abs(tension).max()


@BOTH
def test_results_converge_to_those_without_mass(tied: Any, coordinates: str) -> None:
    last = turns(tied, "A", "D")
    for mass in (1e-3, 1e-5, 0.9e-6, 1e-7, 1e-9, 1e-12, 1e-15):
        r = run(four_bar(mass), coordinates)
        # two seconds on, thirty times what the coupler weighs beside the crank; what it carries is linear in its mass
        assert np.abs(turns(r, "A", "D") - last).max() < 40.0 * mass + 1e-10, mass


@BOTH
@pytest.mark.parametrize("size", [1e-6, 1e3])
def test_no_size_matters(tied: Any, coordinates: str, size: float) -> None:
    r = run(four_bar(0.0, size), coordinates)
    assert np.abs(turns(r, "A", "D") - turns(tied, "A", "D")).max() < 1e-9


@BOTH
def test_loads_across_the_plane(coordinates: str) -> None:
    """In its plane nothing acts; hinges without pins to hold the rods across it would let go of them."""
    r = run(four_bar(0.0, fall=(0, 0, -G)), coordinates)
    speeds = np.hstack([r.joint(j).velocity for j in ("A", "D")])
    kinetic = speeds**2 @ np.array([CRANK**2 / 6.0, 2.0 * ROCKER**2 / 6.0])
    assert np.abs(kinetic / kinetic[0] - 1.0).max() < 1e-10
    carried = sum(r.joint(j).force[:, 2] for j in ("A", "D"))
    assert carried == pytest.approx(3.0 * G, rel=1e-9)


def slider_crank(rod: float, crank: float = 0.5) -> pt.Mechanism:
    m = pt.Mechanism("slider-crank", gravity=(0, 0, 0))
    web = m.add_body("crank", mass=0.0, inertia=(2, 2, 2))
    bar = m.add_rod("rod", (0, crank, 0), (1.2, crank, 0), mass=rod)
    piston = m.add_body("piston", mass=3.0, inertia=(0, 0, 0), position=(1.2, crank, 0))
    m.add_revolute("A", m.ground, web, point=(0, 0, 0))
    m.add_revolute("B", web, bar, point=(0, crank, 0))
    m.add_revolute("C", bar, piston, point=(1.2, crank, 0))
    m.add_prismatic("D", m.ground, piston, point=(1.2, crank, 0), axis=(1, 0, 0))
    return m


@BOTH
def test_a_slider_crank_on_a_rod_without_mass(coordinates: str) -> None:
    """J phi'^2 + m x'^2 is what it was, x = r cos + sqrt(l^2 - (r sin - r)^2) with the piston offset by r."""
    r = run(slider_crank(0.0), coordinates, rates={"A": 4.0}, duration=3.0)
    angle, rate = r.joint("A").position[:, 0] + np.pi / 2, r.joint("A").velocity[:, 0]
    rise = 0.5 * np.sin(angle) - 0.5
    slope = -0.5 * np.sin(angle) - rise * 0.5 * np.cos(angle) / np.sqrt(1.2**2 - rise**2)
    energy = 2.0 * rate**2 + 3.0 * (slope * rate) ** 2
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-10
    assert np.abs(r.joint("D").velocity[:, 0] - slope * rate).max() < 1e-9
    # what accelerates the piston comes along the rod
    force = r.joint("C").force
    assert np.abs(np.cross(along(r, "B", "C"), force)[:, 2]).max() < 1e-8 * np.abs(force).max()


def double_pendulum(rods: bool) -> pt.Mechanism:
    """Masses in points, on rods without any; or on nothing, with the masses far out in two bodies."""
    m = pt.Mechanism("double", gravity=(0, -G, 0))
    if rods:
        first = m.add_rod("rod 1", (0, 0, 0), (1, 0, 0), mass=0.0)
        upper = m.add_body("upper", mass=1.0, inertia=(0, 0, 0), position=(1, 0, 0))
        second = m.add_rod("rod 2", (1, 0, 0), (1, -0.7, 0), mass=0.0)
        lower = m.add_body("lower", mass=0.4, inertia=(0, 0, 0), position=(1, -0.7, 0))
        m.add_fixed("a", first, upper, point=(1, 0, 0))
        m.add_fixed("b", second, lower, point=(1, -0.7, 0))
    else:
        first = upper = m.add_body("upper", mass=1.0, inertia=(0, 0, 0), com=(1, 0, 0))
        second = m.add_body("lower", mass=0.4, inertia=(0, 0, 0), com=(0, -0.7, 0), position=(1, 0, 0))
    m.add_revolute("A", m.ground, first, point=(0, 0, 0))
    m.add_revolute("B", upper, second, point=(1, 0, 0))
    return m


@BOTH
def test_a_chain_of_links_without_mass(coordinates: str) -> None:
    rates = {"A": 0.5, "B": -1.0}
    r = run(double_pendulum(True), coordinates, rates=rates)
    other = run(double_pendulum(False), "relative", rates=rates)
    assert np.abs(turns(r, "A", "B") - turns(other, "A", "B")).max() < 1e-9
    pull = r.joint("B").force
    assert np.abs(pull - other.joint("B").force).max() < 1e-8
    assert np.abs(np.cross(along(r, "B", "b"), pull)).max() < 1e-8
    angle, rate = turns(r, "A", "B").cumsum(axis=1), np.hstack([r.joint(j).velocity for j in "AB"]).cumsum(axis=1)
    a, b = angle[:, 0], angle[:, 1] - np.pi / 2
    kinetic = 0.7 * rate[:, 0] ** 2 + 0.098 * rate[:, 1] ** 2 + 0.28 * rate[:, 0] * rate[:, 1] * np.cos(a - b)
    energy = kinetic + G * (1.4 * np.sin(a) + 0.28 * np.sin(b))
    assert np.abs(energy - energy[0]).max() < 1e-9


@BOTH
@pytest.mark.parametrize("mass", [0.0, 1.0])
def test_what_moves_no_mass_is_named(coordinates: str, mass: float) -> None:
    """A rod without mass hangs on a pin; one that has its mass in its pin hangs there as well."""
    m = pt.Mechanism("loose", gravity=(0, -G, 0))
    arm = m.add_rod("arm", (0, 0, 0), (1, 0, 0), mass=2.0)
    flag = m.add_body("flag", mass=mass, inertia=(0, 0, 0), position=(1, 0, 0))
    m.add_revolute("A", m.ground, arm, point=(0, 0, 0))
    m.add_revolute("B", arm, flag, point=(1, 0, 0))
    with pytest.raises(DescriptionError, match=r"moves no mass.*involves only .flag., without mass"):
        m.simulate(1.0, coordinates=coordinates)
    assert any("moves no mass" in note for note in m.report(coordinates=coordinates).to_dict()["notes"])


def test_joints_that_turn_without_mass_are_named_with_their_ratio() -> None:
    """A four-bar without any mass beside a pendulum that has some: its only degree of freedom moves nothing."""
    m = four_bar(0.0)
    bob = m.add_rod("bob", (5, 0, 0), (5, -1, 0), mass=1.0)
    m.add_revolute("E", m.ground, bob, point=(5, 0, 0))
    nothing = np.zeros((3, 3))
    light = {f"{name}.{what}": x for name in ("crank", "rocker") for what, x in (("mass", 0.0), ("inertia", nothing))}
    with pytest.raises(DescriptionError) as refused:
        m.simulate(1.0, parameters=light)
    words = str(refused.value)
    assert 'involves only "crank", "rocker" and "coupler"' in words
    rates = m.assemble(rates={"A": 1.0, "E": 0.0})
    start = m.simulate(1e-3, initial=rates, t_eval=[0.0])
    ratio = start.joint("D").velocity[0, 0] / start.joint("B").velocity[0, 0]
    given = {
        part.split(" at ")[0][-1]: float(part.split(" at ")[1].split(" ")[0].rstrip(","))
        for part in words.split(": ")[1].split(" (rad/s")[0].split(", ")
    }
    assert given["D"] / given["B"] == pytest.approx(ratio, abs=2e-4)
    assert "E" not in given


def test_masses_changed_to_nothing_between_runs() -> None:
    m = four_bar(1.5)
    options = {"rtol": 1e-11, "atol": 1e-11, "t_eval": [0.0, 1.0]}
    before = m.simulate(1.0, **options)
    light = m.simulate(1.0, parameters={"coupler.mass": 0.0, "coupler.inertia": np.zeros((3, 3))}, **options)
    drawn = four_bar(0.0).simulate(1.0, **options)
    again = m.simulate(1.0, **options)
    assert np.array_equal(before.q, again.q)
    assert np.abs(turns(light, "A", "D") - turns(drawn, "A", "D")).max() < 1e-10
    heavier = four_bar(0.0).simulate(
        1.0, parameters={"coupler.mass": 1.5, "coupler.inertia": np.diag([0, 1, 1]) * 1.5 * BAR**2 / 12}, **options
    )
    assert np.abs(turns(heavier, "A", "D") - turns(before, "A", "D")).max() < 1e-10


FOOT, TOP, SEAT, PIVOT = np.array([(0, 0, 0), (0.3, 0, 0.4), (1.4, 0.8, 1.1), (1.4, 0.1, 0.3)], dtype=float)


def tie(rod: str, axial: float = 0.0) -> pt.Mechanism:
    """Two arms on pivots and what ties them: a held distance, a rod between balls, or a body with an axial inertia."""
    m = pt.Mechanism("tie", gravity=(0, 0, 0))
    crank = m.add_body("crank", mass=1.0, inertia=(0.03, 0.03, 0.03), com=(0.1, 0, 0.1))
    arm = m.add_body("arm", mass=1.5, inertia=(0.05, 0.05, 0.05), position=PIVOT, com=(0, 0.3, 0.3))
    m.add_revolute("A", m.ground, crank, point=FOOT, axis=(0, 1, 0))
    m.add_revolute("D", m.ground, arm, point=PIVOT, axis=(0.3, 1, 0))
    if rod == "distance":
        m.add_distance("bar", crank, TOP - FOOT, arm, SEAT - PIVOT)
        return m
    if rod == "body":
        line = SEAT - TOP
        length = float(np.linalg.norm(line))
        e = line / length
        across = 0.3 * length**2 / 12.0
        inertia = across * (np.eye(3) - np.outer(e, e)) + axial * np.outer(e, e)
        bar = m.add_body("rod", mass=0.3, inertia=inertia, position=0.5 * (TOP + SEAT))
    else:
        bar = m.add_rod("rod", TOP, SEAT, mass={"thin": 0.3, "massless": 0.0}[rod])
    m.add_spherical("B", crank, bar, point=TOP)
    m.add_spherical("C", arm, bar, point=SEAT)
    return m


def spin(r: Any, joints: tuple[str, str] = ("B", "C"), body: str = "rod") -> np.ndarray:
    return np.einsum("ij,ij->i", r.body(body).angular_velocity, along(r, *joints))


SPATIAL = ["projective", "svd", "gram-schmidt", "multipliers", "sparse-multipliers", "range-space", "proximal"]


@BOTH
@pytest.mark.parametrize("formulation", SPATIAL)
def test_a_rod_without_mass_between_balls_is_a_held_distance(coordinates: str, formulation: str) -> None:
    held = run(tie("distance"), rates={"A": 1.0})
    r = run(tie("massless"), coordinates, rates={"A": 1.0}, solver=pt.Solver(formulation))
    assert np.abs(turns(r, "A", "D") - turns(held, "A", "D")).max() < 1e-10
    tension = held.coupling("bar").tension[:, None]
    assert np.abs(r.joint("B").force + tension * along(r, "B", "C")).max() < 1e-8 * np.abs(tension).max()
    assert np.abs(spin(r)).max() < 1e-10
    assert any("rod is held from spinning" in note for note in r.notes)


@BOTH
def test_a_thin_rod_holds_its_spin_and_feels_nothing_of_it(coordinates: str) -> None:
    thin = run(tie("thin"), coordinates, rates={"A": 1.0})
    assert np.abs(spin(thin)).max() < 1e-10
    # an axial inertia that never turns is not felt either
    for axial in (1e-5, 1e-3):
        thick = run(tie("body", axial), coordinates, rates={"A": 1.0})
        assert np.abs(turns(thin, "A", "D") - turns(thick, "A", "D")).max() < 1e-9
        assert not any("held from spinning" in note for note in thick.notes)
    # what its balls pass on has no moment about the line: Newton and Euler hold for the rod as drawn
    assert thin.certificate.verdict == "valid"
    reported = tie("thin").report(coordinates=coordinates)
    assert "1 degree of freedom is idle: rod spins about its own line" in " ".join(str(reported).split())
    assert "it is held, without inertia about that line" in " ".join(str(reported).split())
    assert reported.to_dict()["mobility"] == 2 and reported.to_dict()["idle"][0]["held"]


def spun(m: pt.Mechanism, rate: float) -> pt.State:
    """At rest but for the rod, which spins about its line as drawn."""
    start = m.assemble(coordinates="absolute")
    names = m.compile("absolute").velocity_names
    line = (SEAT - TOP) / np.linalg.norm(SEAT - TOP)
    # a body's turning velocities stand in axes that are the world's as drawn
    start.v[[names.index(f"rod.w{x}") for x in "xyz"]] += rate * line
    return start


def test_a_spin_with_inertia_goes_on() -> None:
    m = tie("body", 1e-3)
    options = {"coordinates": "absolute", "rtol": 1e-11, "atol": 1e-11, "t_eval": np.linspace(0, 1, 6)}
    r = m.simulate(1.0, initial=spun(m, 5.0), **options)
    assert r.success
    assert np.abs(spin(r) - 5.0).max() < 1e-9
    assert np.abs(r.joint("A").velocity).max() < 1e-9


def test_a_spin_asked_for_is_not_held() -> None:
    m = tie("thin")
    m.add_force("rod", (0, 0, 1), point=(0.5, 0.1, 0))
    with pytest.raises(DescriptionError, match=r"moves no mass.*no inertia: rod about its own line between B and C"):
        m.simulate(0.1)
    with pytest.raises(ArgumentError, match='body "rod" starts with a spin'):
        tie("thin").simulate(0.1, initial=spun(tie("thin"), 1.0), coordinates="absolute")


def delta(forearms: str) -> pt.Mechanism:
    """Clavel's robot: two bars from each arm to the platform, held distances or rods without mass between balls."""
    m = pt.Mechanism("delta", gravity=(0, 0, -G))
    platform = m.add_body("platform", mass=0.4, inertia=(1e-3, 1e-3, 2e-3), position=(0, 0, -0.5))
    for leg in range(3):
        angle = 2.0 * np.pi * leg / 3.0
        out, across = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
        shoulder, seat = 0.2 * out, 0.05 * out + np.array([0, 0, -0.5])
        elbow = 0.45 * out + np.array([0, 0, -0.1])
        arm = m.add_body(
            f"arm {leg}", mass=0.5, inertia=(3e-3, 3e-3, 3e-3), com=0.5 * (elbow - shoulder), position=shoulder
        )
        m.add_revolute(f"A{leg}", m.ground, arm, point=shoulder, axis=across)
        for side in (-0.04, 0.04):
            first, last = elbow + side * across, seat + side * across
            name = f"bar {leg}{'ab'[side > 0]}"
            if forearms == "distance":
                m.add_distance(name, arm, first - shoulder, platform, last - np.array([0, 0, -0.5]))
                continue
            rod = m.add_rod(name, first, last, mass=0.0)
            m.add_spherical(f"upper {name}", arm, rod, point=first)
            m.add_spherical(f"lower {name}", rod, platform, point=last)
    return m


@BOTH
@pytest.mark.parametrize("formulation", ["projective", "multipliers", "proximal"])
def test_a_delta_robot_on_forearms_without_mass(coordinates: str, formulation: str) -> None:
    rates = {"A0": 0.3, "A1": -0.2, "A2": 0.1}
    arms = [f"A{leg}" for leg in range(3)]
    tied = run(delta("distance"), rates=rates, duration=0.15, rtol=1e-10, atol=1e-10)
    r = run(
        delta("rods"), coordinates, rates=rates, duration=0.15, rtol=1e-10, atol=1e-10, solver=pt.Solver(formulation)
    )
    assert np.abs(turns(r, *arms) - turns(tied, *arms)).max() < 1e-8
    for leg in range(3):
        for side in "ab":
            name = f"bar {leg}{side}"
            pull = tied.coupling(name).tension[:, None] * along(r, f"upper {name}", f"lower {name}")
            assert np.abs(r.joint(f"upper {name}").force + pull).max() < 1e-5 * np.abs(pull).max()
            assert np.abs(spin(r, (f"upper {name}", f"lower {name}"), name)).max() < 1e-7
    words = " ".join(str(delta("rods").report()).split())
    assert "6 degrees of freedom are idle" in words and "all are held, without inertia about that line" in words


@pytest.mark.parametrize("mass", [0.0, 1e-12])
def test_many_loops_with_couplers_without_mass(mass: float) -> None:
    """A frame of twelve four-bars that hang below each other: cluster by cluster as with all of M in one matrix."""
    m = pt.Mechanism("curtain", gravity=(0, -G, 0))
    parent, at = m.ground, np.zeros(3)
    for i in range(12):
        right = at + np.array([0.6, 0, 0])
        low, far = at + np.array([0.1, -0.5, 0]), right + np.array([0.15, -0.55, 0])
        left_arm, right_arm = m.add_rod(f"left {i}", at, low, 1.0), m.add_rod(f"right {i}", right, far, 1.0)
        coupler = m.add_rod(f"coupler {i}", low, far, mass)
        m.add_revolute(f"A{i}", parent, left_arm, point=at)
        m.add_revolute(f"D{i}", parent, right_arm, point=right)
        m.add_revolute(f"B{i}", left_arm, coupler, point=low)
        m.add_revolute(f"C{i}", right_arm, coupler, point=far)
        parent, at = right_arm, far
    start = m.assemble(rates={"A0": 1.0})
    settings = {"initial": start, "rtol": 1e-10, "atol": 1e-10, "t_eval": [0.0, 0.2, 0.4]}
    runs = [
        m.simulate(0.4, solver=pt.Solver(f), **settings) for f in ("projective", "sparse-multipliers", "range-space")
    ]
    assert all(r.success and r.certificate.verdict == "valid" for r in runs)
    for r in runs[1:]:
        assert np.abs(r.q - runs[0].q).max() < 1e-9
