"""What a drawing misfits by is a matter of the loops that misfit: what hangs beside them, of
whatever size, the coordinates, and how far guides stand from where they were drawn have no say in it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from test_drawing_tolerance import BOTH, Z, bar

import partita as pt
from partita.errors import ArgumentError, AssemblyError


def block(m: pt.Mechanism, name: str, at: tuple[float, float, float], size: float) -> None:
    m.add_body(name, mass=size**3, inertia=(0.1 * size**5,) * 3, position=size * np.array(at))


def guides(m: pt.Mechanism, off: float, size: float) -> str:
    """One carriage on two guides, out of parallel by `off` rad."""
    block(m, "carriage", (0.5, 0.2, 0.0), size)
    m.add_prismatic("s1", m.ground, "carriage", point=(0, 0, 0), axis=(1, 0, 0))
    axis = (np.cos(off), np.sin(off), 0.0)
    m.add_prismatic("s2", m.ground, "carriage", point=size * np.array((0.2, 0.7, 0.0)), axis=axis)
    return "carriage"


def table(m: pt.Mechanism, off: float, size: float) -> str:
    """A carriage on a carriage in space, two guides each."""
    block(m, "low", (0.5, 0.2, 0.0), size)
    block(m, "high", (0.7, 0.2, 0.3), size)
    m.add_prismatic("s1", m.ground, "low", point=(0, 0, 0), axis=(1, 0, 0))
    axis = (np.cos(off), 0.6 * np.sin(off), 0.8 * np.sin(off))
    m.add_prismatic("s2", m.ground, "low", point=size * np.array((0.2, 0.7, 0.0)), axis=axis)
    m.add_prismatic("t1", "low", "high", point=size * np.array((0.2, 0.7, 0.1)), axis=(0.1, 0.2, 1.0))
    m.add_prismatic("t2", "low", "high", point=size * np.array((0.9, 0.1, 0.1)), axis=(0.1, 0.2, 1.0))
    return "high"


def hinges(m: pt.Mechanism, off: float, size: float, name: str = "") -> str:
    """A four-bar with one hinge tilted."""
    a, b, c, d = (size * np.array(p) for p in ((0, 0, 0), (0, 0.3, 0), (0.8, 0.7, 0), (1.0, 0, 0)))
    bar(m, f"crank{name}", a, b, 0.3 * size**3)
    bar(m, f"coupler{name}", b, c, 0.9 * size**3)
    bar(m, f"rocker{name}", d, c, 0.7 * size**3)
    m.add_revolute(f"A{name}", m.ground, f"crank{name}", point=a, axis=Z)
    m.add_revolute(f"B{name}", f"crank{name}", f"coupler{name}", point=b, axis=Z)
    m.add_revolute(f"C{name}", f"coupler{name}", f"rocker{name}", point=c, axis=(np.sin(off), 0, np.cos(off)))
    m.add_revolute(f"D{name}", m.ground, f"rocker{name}", point=d, axis=Z)
    return f"coupler{name}"


def door(m: pt.Mechanism, off: float, size: float) -> str:
    """Two hinges of one door."""
    block(m, "door", (0.5, 0.0, 1.0), size)
    m.add_revolute("low", m.ground, "door", point=(0, 0, 0), axis=Z)
    axis = (np.sin(off), 0.0, np.cos(off))
    m.add_revolute("high", m.ground, "door", point=size * np.array((0, 0, 1.8)), axis=axis)
    return "door"


def chain(m: pt.Mechanism, on: Any, size: float) -> None:
    """Six loose links."""
    for i in range(6):
        m.add_body(
            f"link{i}", mass=size**3, inertia=(0.1 * size**5,) * 3, position=size * np.array((3.5 + i, 0.1 * i, 0))
        )
        m.add_revolute(
            f"pin{i}", on, f"link{i}", point=size * np.array((3.0 + i, 0.1 * i, 0)), axis=(0.2 * i, 0.1, 1.0)
        )
        on = f"link{i}"


def beside(m: pt.Mechanism, what: str, size: float, on: str) -> int:
    """What else there is, and its degrees of freedom."""
    if what == "a pendulum":
        block(m, "pendulum", (1.5, 2.2, 0.0), size)
        m.add_revolute("pivot", m.ground, "pendulum", point=size * np.array((1.5, 3.0, 0.0)), axis=Z)
        return 1
    if what == "a huge chain":
        chain(m, m.ground, 50.0 * size)
        return 6
    if what == "a tiny chain on it":
        chain(m, on, 0.02 * size)
        return 6
    if what == "a loop that fits":
        hinges(m, 0.0, 3.0 * size, " of its own")
        return 1
    return 0


BESIDE = ["nothing", "a pendulum", "a huge chain", "a tiny chain on it", "a loop that fits"]


def drawn(make: Callable[..., str], off: float, what: str = "nothing", size: float = 1.0) -> tuple[pt.Mechanism, int]:
    m = pt.Mechanism("drawn", gravity=(0.3 * size, -9.81 * size, 0.2 * size))
    return m, beside(m, what, size, make(m, off, size))


@pytest.mark.parametrize(("make", "dof"), [(guides, 1), (table, 2), (hinges, 1), (door, 1)])
def test_one_verdict_whatever_else_there_is(make: Callable[..., str], dof: int) -> None:
    for off in (1e-6, 1e-4, 3e-3):
        known = drawn(make, off)[0].report().to_dict()
        assert (
            known["mobility"] == dof - (off > 2e-4) and known["geometric_errors"] and known["geometric_error"] > 0.0
        ), off
        for what in BESIDE:
            m, more = drawn(make, off, what)
            for coordinates in BOTH:
                found = m.report(coordinates=coordinates).to_dict()
                assert found["mobility"] == known["mobility"] + more, (off, what, coordinates)
                assert found["geometric_error"] == pytest.approx(known["geometric_error"], rel=1e-6), (
                    off,
                    what,
                    coordinates,
                )


@pytest.mark.parametrize("make", [guides, table, hinges, door])
def test_one_outcome_in_both_kinds_of_coordinates(make: Callable[..., str]) -> None:
    for off, what, size in (
        (1e-6, "a pendulum", 1.0),
        (1e-4, "nothing", 1e-3),
        (1e-4, "a loop that fits", 1.0),
        (4e-3, "a pendulum", 1.0),
    ):
        m, _ = drawn(make, off, what, size)
        runs = [m.simulate(0.05, coordinates=coordinates) for coordinates in BOTH]
        for run in runs:
            assert run.success and run.certificate.verdict == "valid", (off, what, run.certificate.findings)
            assert run.certificate.newton_euler < 1e-9
            assert any("the geometry is inexact" in note for note in run.notes) == (off < 1e-3)
        name = next(iter(m.bodies))
        apart = np.abs(runs[0].body(name).position[-1] - runs[1].body(name).position[-1]).max()
        assert apart < (30.0 * off if off < 1e-3 else 1e-9) * size


def test_of_two_loops_each_has_its_own_tolerance() -> None:
    """One within it and one beyond: the one is repaired, the other a structure."""
    for off, other, dof in ((1e-5, 1e-5, 2), (1e-5, 4e-3, 1), (4e-3, 1e-5, 1), (4e-3, 4e-3, 0), (0.0, 6e-4, 1)):
        m = pt.Mechanism("two")
        guides(m, off, 1.0)
        block(m, "second", (4.5, 0.2, 1.0), 1.0)
        m.add_prismatic("t1", m.ground, "second", point=(4, 0, 1), axis=(0.0, 1.0, 0.0))
        m.add_prismatic("t2", m.ground, "second", point=(4.7, 0.2, 1), axis=(np.sin(other), np.cos(other), 0.0))
        for coordinates in BOTH:
            assert m.compile(coordinates=coordinates).mobility == dof, (off, other, coordinates)


@pytest.mark.parametrize("pendulum", [False, True])
@pytest.mark.parametrize("off", [1e-3, 4e-3, 1e-2])
def test_guides_that_meet_far_from_where_they_were_drawn(off: float, pendulum: bool) -> None:
    """Of two guides, out of parallel and apart, the carriage can only stand where they meet: there they are as long as
    that, and out of parallel they lock it."""
    apart = 0.05
    m = pt.Mechanism("apart", gravity=(0.1, -1.0, 0.2))
    block(m, "carriage", (0.5, 0.2, 0.0), 1.0)
    block(m, "frame", (0.1, 0.9, 0.0), 1.0)
    m.add_fixed("seat", m.ground, "frame", point=(0, 1, 0))
    m.add_prismatic("s1", "carriage", m.ground, point=(0, 0, 0), axis=(1, 0, 0))
    axis, there = (np.cos(off), np.sin(off), 0.0), (0.2, 0.7 + apart, 0.0)
    m.add_prismatic("s2", "carriage", "frame", point=(0.2, 0.7, 0.0), axis=axis, child_point=there)
    if pendulum:
        beside(m, "a pendulum", 1.0, "carriage")
    ends = []
    for coordinates in BOTH:
        found = m.report(coordinates=coordinates).to_dict()
        assert found["mobility"] == int(pendulum) and found["geometric_errors"]
        assert "out of parallel" in " ".join(m.report(coordinates=coordinates).split())
        run = m.simulate(0.1, coordinates=coordinates)
        assert run.success and run.certificate.verdict == "valid", run.certificate.findings
        assert run.certificate.newton_euler < 1e-9
        ends.append(run.body("carriage").position)
        assert np.abs(ends[-1][-1] - ends[-1][0]).max() < 1e-9  # held
    assert np.abs(ends[0] - ends[1]).max() < 1e-6
    assert abs(ends[0][0, 0] - 0.5) == pytest.approx(apart / np.tan(off), rel=1e-6)


@pytest.mark.parametrize("ends", ["fixed", "hinged", "one hinged"])
def test_the_width_of_a_gantry_has_no_say(ends: str) -> None:
    """A beam on two small carriages: guides out of parallel are so however far apart they are, and what is bridged
    balances."""
    for wide in (0.3, 60.0):
        for off, dof in ((1e-4, 1), (1e-3, 0)):
            m = pt.Mechanism("gantry", gravity=(0.1, -1.0, 0.2))
            for name, at in (("left", 0.0), ("beam", 0.5 * wide), ("right", wide)):
                m.add_body(name, mass=1.0, inertia=(0.1,) * 3, position=(0.0, at, 0.0))
            m.add_prismatic("s1", m.ground, "left", point=(0, 0, 0), axis=(1, 0, 0))
            m.add_prismatic("s2", m.ground, "right", point=(0, wide, 0), axis=(1.0, 0.6 * off, 0.8 * off))
            for name, parent, child, at in (("f1", "left", "beam", 0.1), ("f2", "beam", "right", wide - 0.1)):
                if ends == "fixed" or (ends, name) == ("one hinged", "f2"):
                    m.add_fixed(name, parent, child, point=(0, at, 0))
                else:  # along the guides: a hinge upright would leave a beam that is a dead position for ever
                    axis = (1.0, 0, 0) if ends == "hinged" else (0, 0, 1.0)
                    m.add_revolute(name, parent, child, point=(0, at, 0), axis=axis)
            for coordinates in BOTH:
                found = m.report(coordinates=coordinates).to_dict()
                assert found["mobility"] == dof, (wide, off, coordinates)
                run = m.simulate(0.05, coordinates=coordinates)
                assert run.success and run.certificate.verdict == "valid", (wide, off, run.certificate.findings)


def lift(stages: int, tilt: float) -> pt.Mechanism:
    """A scissor lift between a hinge and a shoe on a rail, in one block of loops; its axes are out of parallel."""
    rng = np.random.default_rng(stages)
    m = pt.Mechanism("lift", gravity=(0, -9.81, 0))
    width, height = 0.8, 0.3

    def axis() -> Any:
        return np.array(Z) + tilt * rng.standard_normal(3)

    for i in range(stages):
        middle = (width / 2, height * (i + 0.5), 0)
        for name in (f"a{i}", f"b{i}"):
            m.add_body(name, mass=1, inertia=(0.05, 0.05, 0.05), position=middle)
        m.add_revolute(f"M{i}", f"a{i}", f"b{i}", point=middle, axis=axis())
        if i:
            m.add_revolute(f"L{i}", f"b{i - 1}", f"a{i}", point=(0, height * i, 0), axis=axis())
            m.add_revolute(f"R{i}", f"a{i - 1}", f"b{i}", point=(width, height * i, 0), axis=axis())
    m.add_revolute("foot", m.ground, "a0", point=(0, 0, 0), axis=axis())
    m.add_body("shoe", mass=0.5, inertia=(0.01, 0.01, 0.01), position=(width, 0, 0))
    m.add_prismatic("rail", m.ground, "shoe", point=(width, 0, 0), axis=(1, 0, 0))
    m.add_revolute("pin", "shoe", "b0", point=(width, 0, 0), axis=axis())
    return m


@pytest.mark.parametrize("coordinates", BOTH)
@pytest.mark.parametrize("stages", [5, 16, 40])
def test_a_plane_drawing_is_made_plane_whatever_its_size(stages: int, coordinates: Any) -> None:
    exact = lift(stages, 0.0).simulate(0.1, t_eval=[0.1], coordinates=coordinates)
    for tilt in (1e-8, 1e-6, 3e-5):
        found = lift(stages, tilt)
        assert found.compile(coordinates=coordinates).mobility == 1
        run = found.simulate(0.1, t_eval=[0.1], coordinates=coordinates)
        assert run.certificate.verdict == "valid"
        np.testing.assert_allclose(run.joint("rail").position, exact.joint("rail").position, rtol=1e-6, atol=tilt**2)
        assert 0.1 * tilt < run.certificate.geometric_error < 10 * tilt


def wheels(count: int, off: float, tolerance: float = 1e-4) -> pt.Mechanism:
    """Wheels side by side, coupled by one rod, with pins out of place: a change of frames would make them move."""
    rng = np.random.default_rng(count)
    m = pt.Mechanism("wheels", gravity=(0, -9.81, 0), drawing_tolerance=tolerance)
    m.add_body("rod", mass=3, inertia=(0.1, 0.1, 0.1), position=(count / 2, 0.3, 0))
    for i in range(count):
        m.add_body(f"wheel{i}", mass=1, inertia=(0.05, 0.05, 0.05), position=(i + 0.05, 0.02, 0))
        m.add_revolute(f"A{i}", m.ground, f"wheel{i}", point=(i, 0, 0), axis=Z)
        at = np.array((i + 0.1, 0.3, 0)) + off * rng.standard_normal(3)
        m.add_revolute(f"P{i}", f"wheel{i}", "rod", point=at, axis=Z)
    return m


@pytest.mark.parametrize("coordinates", BOTH)
def test_a_large_block_with_an_error_that_is_not_repaired_is_refused_by_name(coordinates: Any) -> None:
    for off in (0.0, 3e-5):
        assert wheels(5, off).compile(coordinates=coordinates).mobility == 1
    assert wheels(25, 0.0).compile(coordinates=coordinates).mobility == 1
    for off in (1e-6, 3e-5):
        with pytest.raises((ArgumentError, AssemblyError), match=r'joint "P\d+" nearly follows .* drawing_tolerance'):
            wheels(25, off).simulate(0.1, coordinates=coordinates)


def test_a_smaller_tolerance_makes_a_large_block_a_structure() -> None:
    for off in (1e-6, 3e-5):
        assert wheels(25, off, 1e-7).compile().mobility == 0
