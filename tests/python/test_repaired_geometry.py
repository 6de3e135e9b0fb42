"""A drawing that misfits within its tolerance runs as the nearest drawing that fits: through singular positions as the
exact one does, whatever the size of the misfit and the coordinates."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from drawings import EVERY
from numpy.typing import NDArray
from test_contradictions import rockers
from test_drawing_tolerance import BOTH, Z, bar, bennett
from thorough import either, pairs

import partita as pt

Vector = NDArray[np.float64]

PINS = {
    "in line": [(0, 0, 0), (1, 0, 0), (2.5, 0, 0)],
    "in line, in three planes": [(0, 0, 0), (1, 0, 0.4), (2.5, 0, -0.3)],
    "in a triangle": [(0, 0, 0), (1, 0.8, 0.3), (2.5, -0.3, 0)],
}


def cranks(pins: str, turned: dict[str, Vector], off: float = 0.0, unit: float = 1.0) -> pt.Mechanism:
    """Three equal parallel cranks, one of them too many; hinges tilted as given, pins off by up to `off`."""
    rng = np.random.default_rng(3)
    m = pt.Mechanism("cranks", gravity=(0, -9.81 * unit, 0))
    along = unit * np.array([np.cos(0.5), np.sin(0.5), 0.0])
    feet = [unit * np.array(pin, dtype=float) for pin in PINS[pins]]
    bar(m, "coupler", feet[0] + along, feet[2] + along, 1.0)
    for i, foot in enumerate(feet):
        bar(m, f"crank{i}", foot, foot + along, 1.0)
        for name, parent, child, point in (
            (f"A{i}", m.ground, f"crank{i}", foot),
            (f"B{i}", f"crank{i}", "coupler", foot + along),
        ):
            axis = Z + turned.get(name, np.zeros(3))
            there = point + unit * off * rng.uniform(-1.0, 1.0, 3)
            m.add_revolute(name, parent, child, point=point, axis=axis, child_point=there if off else None)
    return m


def path(run: pt.Result) -> Vector:
    return np.stack([run.body(f"crank{i}").position for i in range(3)])


def is_valid(run: pt.Result) -> bool:
    return bool(run.success and run.certificate.verdict == "valid")


@pytest.mark.parametrize(("pins", "tilted", "coordinates"), pairs(PINS, (0, 2), BOTH))
def test_tilted_cranks_fall_through_their_flat_position_as_exact_ones(pins: str, tilted: int, coordinates: str) -> None:
    options: dict[str, Any] = {"coordinates": coordinates, "t_eval": np.linspace(0.0, 2.0, 9)}
    nominal = path(cranks(pins, {}).simulate(2.0, **options))
    assert nominal[0, :, 1].min() < -0.3  # well through it
    for off in (1e-14, 1e-8, 1e-5, 1e-4):
        m = cranks(pins, {f"B{tilted}": off * np.array([1.0, 0.3, 0.0])})
        assert m.compile(coordinates=coordinates).mobility == 1, off
        run = m.simulate(2.0, **options)
        assert is_valid(run), (off, run.message, run.certificate.findings)
        assert np.abs(path(run) - nominal).max() < 10.0 * off + 1e-6, off
        # the loops that run are closed to the last digit, and their reactions balance as if nothing had been wrong
        assert run.certificate.newton_euler < 1e-9 and run.certificate.closure < 1e-9
        assert run.certificate.geometric_error <= 5.0 * off + 1e-11
    for off in (1e-3, 1e-2):
        m = cranks(pins, {f"B{tilted}": off * np.array([1.0, 0.3, 0.0])})
        assert m.compile(coordinates=coordinates).mobility == 0
        assert "out of parallel" in " ".join(m.report(coordinates=coordinates).split())


@pytest.mark.parametrize("unit", [1e-6, 1e3])
def test_of_any_size(unit: float) -> None:
    tilt = {"B0": np.array([1e-5, 0.0, 0.0])}
    for coordinates in BOTH:
        run = cranks("in line, in three planes", tilt, unit=unit).simulate(1.5, coordinates=coordinates)
        assert is_valid(run), run.certificate.findings
        one = cranks("in line, in three planes", {}, unit=unit).simulate(1.5, coordinates=coordinates)
        assert np.abs(path(run) - path(one)).max() < 1e-4 * unit


@pytest.mark.parametrize("formulation", EVERY)
def test_every_formulation(formulation: str) -> None:
    tilt = {"B0": np.array([1e-5, 0.0, 0.0])}
    run = cranks("in a triangle", tilt).simulate(0.3, solver=pt.Solver(formulation))
    nominal = cranks("in a triangle", {}).simulate(0.3, solver=pt.Solver(formulation))
    assert is_valid(run), (run.message, run.certificate.findings)
    assert np.abs(path(run) - path(nominal)).max() < 1e-4


@pytest.mark.parametrize("coordinates", BOTH)
def test_lengths_and_axes_off_together(coordinates: str) -> None:
    """Every hinge off by up to a tolerance in its point and in its axis: what they mean is found by no axis alone."""
    rng = np.random.default_rng(7)
    tilts = {f"{side}{i}": rng.uniform(-1.0, 1.0, 3) for side in "AB" for i in range(3)}
    options: dict[str, Any] = {"coordinates": coordinates, "t_eval": np.linspace(0.0, 2.0, 9)}
    nominal = path(cranks("in a triangle", {}).simulate(2.0, **options))
    for off in (1e-8, 1e-5, 1e-4):
        run = cranks("in a triangle", {name: off * x for name, x in tilts.items()}, off).simulate(2.0, **options)
        assert is_valid(run), (off, run.message, run.certificate.findings)
        assert np.abs(path(run) - nominal).max() < 10.0 * off + 1e-6, off
        assert run.certificate.newton_euler < 1e-9 and run.certificate.closure < 1e-9


@pytest.mark.parametrize("coordinates", BOTH)
@pytest.mark.parametrize("pins", ["in line", "in line, in three planes"])
def test_cranks_in_line_of_unequal_length_fall_as_equal_ones(pins: str, coordinates: str) -> None:
    """A crank off by x turns the coupler by x and opens the loop by its square: a double root, found by no slope."""
    options: dict[str, Any] = {"coordinates": coordinates, "t_eval": np.linspace(0.0, 2.0, 9)}
    nominal = path(cranks(pins, {}).simulate(2.0, **options))
    for off in (1e-14, 1e-12, 1e-9, 1e-7, 1e-5, 1e-4, 2e-4):
        run = cranks(pins, {}, off).simulate(2.0, **options)
        assert is_valid(run), (off, run.message, run.certificate.findings)
        # rounding alone moves what falls through a flat position by 1e-7
        assert np.abs(path(run) - nominal).max() < 3.0 * off + 2e-6, off
        assert run.certificate.geometric_error <= 1.1 * off


@pytest.mark.parametrize("coordinates", BOTH)
def test_a_rocker_that_is_off_falls_as_the_mean_of_all(coordinates: str) -> None:
    """To first order it is closed as drawn: a small one does not show, and turns the platform all the same."""
    options: dict[str, Any] = {"coordinates": coordinates, "t_eval": np.linspace(0.0, 2.0, 9)}
    nominal = rockers(0.0, 1e-4).simulate(2.0, **options).body("platform").position
    for off in (1e-12, 1e-9, 1e-6, 1e-4, 1e-3):
        run = rockers(off, 1e-4).simulate(2.0, **options)
        assert is_valid(run), (off, run.message, run.certificate.findings)
        assert np.abs(run.body("platform").position - nominal).max() < 2.0 * off + 2e-6, off
    assert not rockers(5e-3, 1e-4).simulate(2.0, **options).success


@pytest.mark.parametrize(("number", "tilt"), [(4, 1e-5), (5, 0.0)])
def test_more_cranks_than_three(number: int, tilt: float) -> None:
    def row(off: float) -> pt.Mechanism:
        rng = np.random.default_rng(1)
        m = pt.Mechanism("row", gravity=(0, -9.81, 0))
        along = np.array([np.cos(0.5), np.sin(0.5), 0.0])
        feet = [np.array([x, 0.1 * x, 0.0]) for x in (0.0, 1.0, 2.5, 3.3, 4.9)[:number]]
        bar(m, "coupler", feet[0] + along, feet[-1] + along, 1.0)
        for i, foot in enumerate(feet):
            bar(m, f"crank{i}", foot, foot + along, 1.0)
            for name, parent, child, point in (
                (f"A{i}", m.ground, f"crank{i}", foot),
                (f"B{i}", f"crank{i}", "coupler", foot + along),
            ):
                there, axis = point + off * rng.uniform(-1.0, 1.0, 3), Z + tilt * off * 1e5 * rng.uniform(-1.0, 1.0, 3)
                m.add_revolute(name, parent, child, point=point, axis=axis, child_point=there)
        return m

    for coordinates in BOTH:
        options: dict[str, Any] = {"coordinates": coordinates, "t_eval": np.linspace(0.0, 2.0, 9)}
        nominal = path(row(0.0).simulate(2.0, **options))
        run = row(1e-5).simulate(2.0, **options)
        assert is_valid(run), (run.message, run.certificate.findings)
        assert np.abs(path(run) - nominal).max() < 1e-4


@pytest.mark.parametrize("coordinates", BOTH)
def test_lengths_that_nearly_agree_stay_what_they_are(coordinates: str) -> None:
    """Two cranks and a tilted hinge: what cures the hinge says nothing of the lengths."""
    ends = {}
    for length in (1.0, 1.0002):
        m = pt.Mechanism("nearly a parallelogram", gravity=(0, -9.81, 0))
        top = [np.array([0.4, 0.9, 0.0]), np.array([2.0, 0.0, 0.0]) + length * np.array([0.4, 0.9, 0.0])]
        bar(m, "a", np.zeros(3), top[0], 1.0)
        bar(m, "b", top[0], top[1], 1.0)
        bar(m, "c", top[1], np.array([2.0, 0.0, 0.0]), 1.0)
        m.add_revolute("A", m.ground, "a", point=(0, 0, 0), axis=Z)
        m.add_revolute("B", "a", "b", point=top[0], axis=Z + np.array([1e-6, 0.0, 0.0]))
        m.add_revolute("C", "b", "c", point=top[1], axis=Z)
        m.add_revolute("D", m.ground, "c", point=(2, 0, 0), axis=Z)
        run = m.simulate(0.4, coordinates=coordinates)
        assert is_valid(run) and any("the geometry is inexact" in note for note in run.notes)
        assert run.certificate.geometric_error < 5e-6
        ends[length] = run.body("c").position[-1]
    assert np.abs(ends[1.0002] - ends[1.0]).max() > 5e-5


@pytest.mark.parametrize("coordinates", BOTH)
def test_what_was_changed_is_said(coordinates: str) -> None:
    notes = [
        note for note in bennett(1e-5).simulate(0.1, coordinates=coordinates).notes if "the geometry is inexact" in note
    ]
    assert len(notes) == 1 and "turned by up to" in notes[0]
    assert not any("the geometry is inexact" in note for note in bennett(0.0).simulate(0.1).notes)
    # a run may be taken up where another ended
    m = bennett(1e-5)
    first = m.simulate(0.2, coordinates=coordinates)
    model = m.compile(coordinates=coordinates)
    here = pt.State(0.2, first.q[-1], first.v[-1], names=model.names, velocity_names=model.velocity_names)
    again = m.simulate(0.2, coordinates=coordinates, initial=here)
    whole = m.simulate(0.4, coordinates=coordinates)
    assert is_valid(again) and not any("violates the constraints" in note for note in again.notes)
    assert np.abs(again.body("link1").position[-1] - whole.body("link1").position[-1]).max() < 1e-4


@pytest.mark.parametrize("coordinates", BOTH)
@pytest.mark.parametrize("begun", [0.2, 0.303, 0.6])
def test_a_run_that_goes_on_is_of_the_same_drawing(begun: float, coordinates: str) -> None:
    """Also where the flat position is too near to identify the intended geometry: the fit is found as drawn."""
    m, off = cranks("in line", {}, 1e-5), 1e-5
    whole = path(m.simulate(1.0, coordinates=coordinates, t_eval=[0.0, 1.0]))[:, -1]
    model, first = m.compile(coordinates=coordinates), m.simulate(begun, coordinates=coordinates)
    here = pt.State(begun, first.q[-1], first.v[-1], names=model.names, velocity_names=model.velocity_names)
    again = m.simulate(1.0 - begun, coordinates=coordinates, initial=here)
    assert is_valid(again), (again.message, again.certificate.findings)
    assert np.abs(path(again)[:, -1] - whole).max() < 0.1 * off


@pytest.mark.parametrize("coordinates", BOTH)
def test_a_start_elsewhere_is_reported_as_before(coordinates: str) -> None:
    m = bennett(1e-5)
    start = m.assemble(coordinates=coordinates)
    rng = np.random.default_rng(1)
    v = start.v + 0.1 * rng.normal(size=start.v.size)
    run = m.simulate(0.01, coordinates=coordinates, initial=pt.State(0.0, start.q, v))
    assert any("violates the constraints" in note for note in run.notes)


def delta(digits: int) -> pt.Mechanism:
    """Clavel's robot, each forearm four hinges and two rods; where joints sit on their children is rounded."""
    m = pt.Mechanism("delta", gravity=(0, 0, -9.81))
    under = np.array([0.02, -0.015, -0.61])
    m.add_body("platform", mass=0.35, inertia=(1e-3,) * 3, position=under)
    for leg, angle in enumerate((0.3, 0.3 + 2.0 * np.pi / 3.0, 0.3 + 4.0 * np.pi / 3.0)):
        out, across = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
        shoulder, elbow, seat = 0.18 * out, 0.43 * out + [0, 0, -0.13], 0.07 * out + under
        half = 0.045 * across
        normal = np.cross(across, (seat - elbow) / np.linalg.norm(seat - elbow))
        normal /= np.linalg.norm(normal)
        bar(m, f"arm{leg}", shoulder, elbow, 0.4)
        bar(m, f"upper{leg}", elbow - half, elbow + half, 0.04)
        bar(m, f"lower{leg}", seat - half, seat + half, 0.04)
        hinges = [
            (f"A{leg}", m.ground, f"arm{leg}", shoulder, across),
            (f"B{leg}", f"arm{leg}", f"upper{leg}", elbow, across),
        ]
        for side, name in ((-1, "a"), (1, "b")):
            first, last = elbow + side * half, seat + side * half
            bar(m, f"rod{leg}{name}", first, last, 0.08)
            hinges += [(f"C{leg}{name}", f"upper{leg}", f"rod{leg}{name}", first, normal)]
            hinges += [(f"D{leg}{name}", f"rod{leg}{name}", f"lower{leg}", last, normal)]
        for name, parent, child, point, axis in [*hinges, (f"E{leg}", f"lower{leg}", "platform", seat, across)]:
            there = {"child_point": np.round(point, digits), "child_axis": np.round(axis, digits)}
            m.add_revolute(name, parent, child, point=point, axis=axis, **there)
    return m


@pytest.mark.parametrize(("digits", "coordinates"), [(6, "relative"), *either((), ((4, "relative"),)), (4, "absolute")])
def test_a_delta_robot_that_was_rounded(digits: int, coordinates: str) -> None:
    """Some of its own conditions say little beside the others, what rounding left of redundant ones far less: the
    platform has its three displacements, and turns by no more than was rounded."""
    m, off = delta(digits), 10.0**-digits
    assert m.compile(coordinates=coordinates).mobility == 3
    found = m.report(coordinates=coordinates).to_dict()
    assert found["mobility"] == 3 and 0.0 < found["geometric_error"] < 20.0 * off and found["singular"] is None
    run = m.simulate(0.15, coordinates=coordinates, t_eval=np.linspace(0.0, 0.15, 4))
    assert is_valid(run), (run.message, run.certificate.findings)
    exact = delta(15).simulate(0.15, coordinates=coordinates, t_eval=run.t)
    moved = exact.body("platform").position
    assert np.ptp(moved, axis=0).max() > 0.02
    assert np.abs(run.body("platform").position - moved).max() < 30.0 * off
    turned = run.body("platform").rotation @ np.swapaxes(run.body("platform").rotation[:1], 1, 2)
    assert np.abs(turned - np.eye(3)).max() < 30.0 * off


def drawn_apart(off: float, quarter: float = 1.0) -> pt.Mechanism:
    """Five bars hanging straight down, closed by a weld whose halves are drawn apart and turned.

    A right angle apart, dot products of the weld's axes vanish turned over as well as they do where it fits.
    """
    m = pt.Mechanism("five bars", gravity=(0, 0, -9.81))
    foot, length = 0.15, 0.46
    for side, sign in (("left", -1.0), ("right", 1.0)):
        axis = np.array([1.0, -sign * off, off])
        ends = [np.array([0.0, sign * foot, -k * length]) for k in range(3)]
        bar(m, f"upper {side}", ends[0], ends[1], 1.0)
        bar(m, f"lower {side}", ends[1], ends[2], 1.0)
        m.add_body(f"pin {side}", mass=0.1, inertia=3 * (1e-4,), position=ends[2])
        m.add_revolute(f"hip {side}", m.ground, f"upper {side}", point=ends[0], axis=axis)
        m.add_revolute(f"knee {side}", f"upper {side}", f"lower {side}", point=ends[1], axis=axis)
        m.add_revolute(f"ankle {side}", f"lower {side}", f"pin {side}", point=ends[2], axis=axis)
    angle = quarter * np.pi / 2
    c, s = np.cos(angle), np.sin(angle)
    left, right = ((0.0, sign * foot, -2 * length) for sign in (-1.0, 1.0))
    turned = [[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]]
    m.add_fixed("weld", "pin left", "pin right", left, child_point=right, child_frame=turned)
    return m


@pytest.mark.parametrize("coordinates", BOTH)
@pytest.mark.parametrize("quarter", [1.0, 0.5])
def test_what_is_drawn_far_from_closed_is_mended_where_it_closes(quarter: float, coordinates: str) -> None:
    exact = drawn_apart(0.0, quarter)
    at = {"hip left": 0.05, "hip right": -0.1, "ankle left": 0.0}

    def run_of(m: pt.Mechanism) -> pt.Result:
        start = m.assemble(at, coordinates=coordinates)
        return m.simulate(0.3, initial=start, coordinates=coordinates, t_eval=[0.0, 0.1, 0.3])

    nominal = run_of(exact)
    assert is_valid(nominal)
    for off in (3e-7, 3e-6, 3e-5):
        m = drawn_apart(off, quarter)
        assert m.compile(coordinates=coordinates).mobility == exact.compile(coordinates=coordinates).mobility == 3
        run = run_of(m)
        assert is_valid(run)
        assert 0.1 * off < run.summary["repaired"] < 10 * off
        for name in ("lower left", "lower right"):
            np.testing.assert_allclose(run.body(name).position, nominal.body(name).position, atol=30 * off)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_repaired_mechanism_lists_the_parameters_that_it_takes(coordinates: str) -> None:
    """A Sarrus linkage turned in space and rounded: its repair makes two frames of one, which its drawing has not."""
    turn = np.linalg.qr(np.array([[0.3, -1.0, 0.2], [0.9, 0.4, 0.5], [-0.2, 0.6, 1.1]]))[0]

    def at(*x: float) -> Any:
        return (turn @ x).round(6)

    m = pt.Mechanism("Sarrus", gravity=None)
    m.add_body("top", mass=1.0, inertia=(1, 1, 1), position=at(0.0, 0.0, 1.0))
    for k, along in enumerate(((1.0, 0.0), (0.0, 1.0))):
        low, knee, high = (at(r * along[0], r * along[1], z) for r, z in ((1.0, 0.0), (1.6, 0.5), (1.0, 1.0)))
        axis = at(along[1], along[0], 0.0)
        m.add_rod(f"low {k}", start=low, end=knee, mass=1.0)
        m.add_rod(f"high {k}", start=knee, end=high, mass=1.0)
        m.add_revolute(f"A{k}", m.ground, f"low {k}", point=low, axis=axis)
        m.add_revolute(f"B{k}", f"low {k}", f"high {k}", point=knee, axis=axis)
        m.add_revolute(f"C{k}", f"high {k}", "top", point=high, axis=axis)
    model = m.compile(coordinates)
    assert model.mobility == 1
    assert not any(name.endswith("child_point") for name in model.parameters)
    for name in ("low 0.mass", "A0.point", "C1.point", "top.inertia"):
        assert model.with_parameters({name: model.parameters[name]}).mobility == 1
