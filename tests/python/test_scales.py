"""Free of scale, from watches to planets: lengths and gravity in any unit give the same angles, in the same steps."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import usd_files

import partita as pt
from partita.viewer.couplings import _Artist, pictures
from partita.viewer.packing import _chosen


def four_bar(unit: float) -> pt.Mechanism:
    """Drawn open: the rocker's end is 0.4 units from the coupler's."""
    m = pt.Mechanism("four-bar", gravity=(0, -9.81 * unit, 0))
    at = unit * np.array([[0.0, 0.0, 0.0], [0.0, 0.4, 0.0], [0.9, 0.5, 0.0], [1.2, 0.7, 0.0], [1.0, 0.0, 0.0]])
    crank = m.add_rod("crank", start=at[0], end=at[1], mass=0.3)
    coupler = m.add_rod("coupler", start=at[1], end=at[2], mass=0.5)
    rocker = m.add_rod("rocker", start=at[4], end=at[3], mass=0.4)
    m.add_revolute("A", m.ground, crank, point=at[0])
    m.add_revolute("B", crank, coupler, point=at[1])
    m.add_revolute("D", m.ground, rocker, point=at[4])
    m.add_revolute("C", coupler, rocker, point=at[2], child_point=at[3])
    return m


def slider_crank(unit: float) -> pt.Mechanism:
    m = pt.Mechanism("slider-crank", gravity=(0, -9.81 * unit, 0))
    at = unit * np.array([[0.0, 0.0, 0.0], [0.2, 0.2, 0.0], [1.1, 0.1, 0.0]])
    crank = m.add_rod("crank", start=at[0], end=at[1], mass=0.3)
    rod = m.add_rod("rod", start=at[1], end=at[2], mass=0.5)
    slider = m.add_body("slider", mass=0.2, inertia=np.full(3, 0.01) * unit**2, position=at[2])
    m.add_revolute("A", m.ground, crank, point=at[0])
    m.add_revolute("B", crank, rod, point=at[1])
    m.add_revolute("C", rod, slider, point=at[2])
    m.add_prismatic("S", m.ground, slider, point=at[2], axis=(1, 0, 0))
    m.add_spring("spring", m.ground, (1.5 * unit, 0.1 * unit, 0), slider, (0, 0, 0), stiffness=4.0, length=0.3 * unit)
    return m


def rssr(unit: float) -> pt.Mechanism:
    m = pt.Mechanism("RSSR", gravity=(0, 0, -9.81 * unit))
    at = unit * np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.1], [0.9, 0.2, 1.1], [1.2, 0.0, 0.2]])
    ball = np.array([0.02, 0.03, 0.04]) * unit**2
    crank = m.add_body("crank", mass=1.0, inertia=ball, position=at[0], com=0.5 * at[1])
    rod = m.add_body("rod", mass=0.5, inertia=ball, position=at[1], com=0.5 * (at[2] - at[1]))
    rocker = m.add_body("rocker", mass=0.7, inertia=ball, position=at[3], com=0.5 * (at[2] - at[3]))
    m.add_revolute("A", m.ground, crank, point=at[0])
    m.add_spherical("B", crank, rod, point=at[1])
    m.add_spherical("C", rod, rocker, point=at[2])
    m.add_revolute("D", m.ground, rocker, point=at[3], axis=(0.2, 1.0, 0.3))
    return m


MECHANISMS = (four_bar, slider_crank, rssr)


def answers(make: Any, unit: float) -> dict[str, Any]:
    """Results of a mechanism in angles, counts and texts."""
    m = make(unit)
    state = m.assemble(targets={"A": 0.3}, rates={"A": 1.5})
    run = m.simulate(1.0, initial=state, t_eval=(0.5, 1.0))
    assert run.success, run.message
    assert run.closure.max() < 1e-14 * max(1.0, unit)
    turns = [i for i, name in enumerate(m.compile().names) if name != "S"]
    return {
        "assembled": state.q[turns],
        "q": run.q[:, turns],
        "v": run.joint("A").velocity,
        "force": run.joint("A").force / unit,
        "counters": run.counters,
        # how far conditions stood open, in parts of their own size
        "gaps": run.record.gaps,
        "assembly": (state.assembly["iterations"], state.assembly["target_steps"]),
        # the scales of the coordinates, the last column, are in SI
        "report": re.sub(r"(?m)^(  \S+ +[\d.]+ +(?:independent|follows)) .*$", r"\1", m.report(state)),
    }


@pytest.mark.parametrize("make", MECHANISMS)
@pytest.mark.parametrize("power", [-20, 20])
def test_powers_of_two_change_no_digit(make: Any, power: int) -> None:
    one, other = answers(make, 1.0), answers(make, 2.0**power)
    for key, value in one.items():
        np.testing.assert_equal(other[key], value, err_msg=key)


@pytest.mark.parametrize("make", MECHANISMS)
@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_micrometres_and_a_thousand_kilometres(make: Any, unit: float) -> None:
    """A unit that is no power of two rounds every length; a run of a second multiplies that by less than a thousand."""
    one, other = answers(make, 1.0), answers(make, unit)
    for key in ("assembled", "q", "v", "force"):
        assert other[key] == pytest.approx(one[key], rel=1e-12, abs=1e-12 * np.max(np.abs(one[key]))), key
    for key in ("counters", "report"):
        assert other[key] == one[key], key


@pytest.mark.parametrize("unit", [1.0, 1e-2, 1e-4, 1e-5, 1e-6, 1e-7])
def test_links_far_below_the_tolerance_of_their_bodies_are_not_folded_into_one_point(unit: float) -> None:
    """Three links of a tenth cannot span one; centres of mass lie 0.1 m off, so that all of it may be below the drawing
    tolerance. What is small is still drawn: it is refused, not moved together."""
    m = pt.Mechanism("short")
    for name, at in (("crank", (0, 0, 0)), ("coupler", (0, 0.1 * unit, 0)), ("rocker", (unit, 0, 0))):
        m.add_body(name, mass=1.0, inertia=(0.1, 0.1, 0.08), com=(0.1, 0.05, 0.02), position=at)
    m.add_revolute("A", m.ground, "crank", (0, 0, 0))
    m.add_revolute("B", "crank", "coupler", (0, 0.1 * unit, 0))
    m.add_revolute("D", m.ground, "rocker", (unit, 0, 0))
    m.add_revolute("C", "coupler", "rocker", (0.1 * unit, 0.1 * unit, 0), child_point=(unit, 0.1 * unit, 0))
    with pytest.raises(pt.errors.AssemblyError, match="lengths do not fit"):
        m.simulate(0.1)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("off", [0.0, 1e-17, 1e-12, -1e-9, 1e-6])
def test_a_centre_of_mass_that_is_off_by_rounding_is_no_length(off: float, coordinates: str) -> None:
    """A free rod whose centre of mass was computed: its length is not the rounding; alone and with a welded one."""
    for welded in (False, True):
        m = pt.Mechanism("rod")
        m.add_body("rod", mass=4.32, inertia=(0.0026, 0.52, 0.52), com=(off, 0, 0))
        m.add_free("F", m.ground, "rod")
        if welded:
            m.add_body("other", mass=1.0, inertia=(0.001, 0.1, 0.1), position=(0, 0.5 * off, 0))
            m.add_fixed("W", "rod", "other")
        run = m.simulate(0.1, t_eval=[0.0, 0.1], coordinates=coordinates)
        assert run.success and run.certificate.verdict == "valid"
        assert run.body("rod").position[-1, 1] == pytest.approx(-9.81 * 0.1**2 / 2, rel=1e-9)


SIZES = [(1e-5, 1e-9), (1.0, 1.0), (1e5, 1e9)]
"""Lengths [m] and masses [kg] of a micro-mechanism, of one on a table and of one as large as a country."""


def sized(unit: float, mass: float) -> pt.Mechanism:
    """A slider-crank with these lengths and masses, under its own gravity."""
    m = pt.Mechanism("slider-crank", gravity=(0, -9.81 * unit, 0))
    at = unit * np.array([[0.0, 0.0, 0.0], [0.2, 0.2, 0.0], [1.1, 0.1, 0.0]])
    crank = m.add_rod("crank", start=at[0], end=at[1], mass=0.3 * mass)
    rod = m.add_rod("rod", start=at[1], end=at[2], mass=0.5 * mass)
    slider = m.add_body("slider", mass=0.2 * mass, inertia=np.full(3, 0.01) * mass * unit**2, position=at[2])
    m.add_revolute("A", m.ground, crank, point=at[0])
    m.add_revolute("B", crank, rod, point=at[1])
    m.add_revolute("C", rod, slider, point=at[2])
    m.add_prismatic("S", m.ground, slider, point=at[2], axis=(1, 0, 0))
    return m


@pytest.mark.parametrize(("unit", "mass"), SIZES)
def test_a_state_that_accelerates_does_at_every_size(unit: float, mass: float) -> None:
    """A mass on a stiff spring, pushed by its weight: 9.81 lengths per square second beside 1e12 per square second."""
    m = pt.Mechanism("pushed", gravity=(-9.81 * unit, 0, 0))
    block = m.add_body("block", mass=mass, inertia=np.full(3, 0.01) * mass * unit**2, com=(0, 0.1 * unit, 0))
    m.add_prismatic("S", m.ground, block, axis=(1, 0, 0))
    m.add_spring("spring", m.ground, (-unit, 0, 0), block, (0, 0, 0), stiffness=1e6 * mass, length=unit)
    with pytest.raises(pt.errors.ArgumentError, match="not steady: it accelerates"):
        m.linearize().modes()
    assert m.linearize(m.equilibrium(stable=True)).modes().frequency[0] == pytest.approx(1e3 / (2 * np.pi), rel=1e-4)


@pytest.mark.parametrize(("unit", "mass"), SIZES)
def test_closure_errors_are_seen_at_every_size(unit: float, mass: float) -> None:
    """Dots above the lower edge of the panel, where zero is drawn, and below its middle."""
    run = sized(unit, mass).simulate(1.0)
    assert run.success
    figure = run.plot("closure")
    (ax,) = figure.axes
    low, high = ax.get_ylim()
    positions = np.array(ax.get_lines()[0].get_ydata())
    inside = (positions > low) & (positions < np.sqrt(low * high) * 10.0)
    assert inside.mean() > 0.5, (low, high, positions.max())


@pytest.mark.parametrize(("unit", "mass"), SIZES)
def test_reactions_are_seen_at_every_size(unit: float, mass: float) -> None:
    """Forces are drawn where there are some, however small."""
    run = sized(unit, mass).simulate(1.0)
    forces = run.plot("reactions").axes[0]
    drawn = [line.get_label().partition(" ")[0] for line in forces.get_lines()]
    assert {"A", "B", "C", "S"} <= set(drawn)
    low, high = forces.get_ylim()
    largest = max(float(np.linalg.norm(run.joint(name).force, axis=1).max()) for name in "ABCS")
    assert 0.5 * (high - low) < largest < high


@pytest.mark.parametrize(("unit", "mass"), SIZES)
def test_two_belts_on_one_shaft_share_a_pulley_where_they_are_one(unit: float, mass: float) -> None:
    """A quarter of the width apart they are two, whatever that is in metres."""
    m = pt.Mechanism("belts")
    names = []
    for i, (x, z) in enumerate(((0.0, 0.0), (1.0, 0.0), (2.0, 0.0))):
        inertia = np.full(3, 0.01) * mass * unit**2
        wheel = m.add_body(f"wheel {i}", mass=mass, inertia=inertia, position=(x * unit, 0, z * unit))
        names.append(m.add_revolute(f"A{i}", m.ground, wheel, point=(x * unit, 0, z * unit)).name)
    m.add_belt("A0", "A1", radius1=0.1 * unit, radius2=0.2 * unit)
    m.add_belt("A1", "A2", radius1=0.2 * unit, radius2=0.3 * unit)
    spec = m.to_spec()
    found = pictures(spec, [f"wheel {i}" for i in range(3)], names, {}, 2.0 * unit)
    radii = np.array([wheel["radius"] for wheel in found.wheels]) / unit
    assert radii == pytest.approx([0.2, 0.1, 0.3, 0.2])
    artist = _Artist(spec, [f"wheel {i}" for i in range(3)], names, {}, 2.0 * unit)
    seats = {artist.seat(turn) for turn in artist.turns.values()}
    assert len(seats) == 3
    one = artist.turns["A1"]
    moved = replace(one, point=one.point + np.array([1e-12 * unit, 0.0, 0.0]))
    apart = replace(one, point=one.point + np.array([1e-6 * unit, 0.0, 0.0]))
    assert artist.seat(moved) == artist.seat(one) != artist.seat(apart)


@pytest.mark.parametrize("power", [-40, -17, 17])
def test_a_page_keeps_the_same_outputs_at_every_size(power: int) -> None:
    """Those that stray from the lines between others, and of equal ones those that are spread evenly."""
    t = np.linspace(0.0, 1.0, 1000)
    table = np.column_stack([np.abs(t - 0.5003), np.where(t > 0.2502, 1.0, 0.0)])
    frames, stray = _chosen(2.0**power * table, len(t), 100)
    wanted, whole = _chosen(table, len(t), 100)
    assert np.array_equal(frames, wanted) and stray == 2.0**power * whole


@pytest.mark.parametrize(("unit", "mass"), SIZES)
def test_links_of_a_small_robot_are_bodies(unit: float, mass: float, tmp_path: Path) -> None:
    """The root, which has mass, and a link at a fixed joint; one of a billionth of the heaviest is a frame."""

    def link(name: str, of: float, inertia: float) -> str:
        moments = " ".join(f'{key}="{inertia if key[1] == key[2] else 0.0}"' for key in ("ixx", "iyy", "izz", "ixy"))
        moments += ' ixz="0" iyz="0"'
        return f'<link name="{name}"><inertial><mass value="{of}"/><inertia {moments}/></inertial></link>'

    def hinged(kind: str, name: str, parent: str, child: str) -> str:
        ends = f'<parent link="{parent}"/><child link="{child}"/><axis xyz="0 0 1"/>'
        return f'<joint name="{name}" type="{kind}">{ends}<origin xyz="{unit} 0 0"/></joint>'

    inertia = 0.01 * mass * unit**2
    parts = (
        link("base", mass, inertia), link("arm", mass, inertia), hinged("continuous", "A", "base", "arm"),
        link("tool", 0.5 * mass, 0.0), hinged("fixed", "T", "arm", "tool"),
        link("mark", 1e-10 * mass, 0.0), hinged("fixed", "F", "arm", "mark"),
    )  # fmt: skip
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r">{"".join(parts)}</robot>', "utf-8")
    bodies = set(pt.load(path).bodies)
    assert bodies - {"mark"} == {"base", "arm", "tool"} and ("mark" in bodies) == (1e-10 * mass > 1e-9)


@pytest.mark.parametrize("unit", [1e-5, 1.0, 1e5])
def test_a_gap_of_a_stage_is_one_at_every_size(unit: float, tmp_path: Path) -> None:
    """A tenth of the mechanism is open, and six digits are closed."""
    pytest.importorskip("pxr")
    scene = usd_files.prim("PhysicsScene", "scene")
    for gap, is_open in ((0.1, True), (1e-8, False)):
        frames = usd_files.points(f"({unit!r}, 0, 0)", f"({gap * unit!r}, 0, 0)")
        body = usd_files.body("a", usd_files.at(unit, 0, 0))
        joint = usd_files.joint("SphericalJoint", "A", ("", "a"), frames)
        path = usd_files.put(tmp_path, usd_files.usd(scene, body, joint))
        text = " ".join(group.text for group in pt.load(path).remarks)
        assert ("not closed as drawn" in text) == is_open, (gap, text)
