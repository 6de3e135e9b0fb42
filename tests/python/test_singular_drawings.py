"""Drawings in singular positions: the report states which branches meet and how to draw each; so do refusals."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.errors import ArgumentError, SingularityError

Point = tuple[float, float, float]


def linkage(*points: Point, unit: float = 1.0) -> pt.Mechanism:
    """Rods from point to point, the first and the last pivots on the ground."""
    m = pt.Mechanism("linkage")
    at = [(unit * x, unit * y, unit * z) for x, y, z in points]
    rods = [m.add_rod(f"rod{i}", start=at[i], end=at[i + 1], mass=1.0) for i in range(len(at) - 1)]
    axis = (0.0, 0.0, 1.0)
    if any(z for _, _, z in points):
        axis = (0.0, -math.sin(0.4), math.cos(0.4))
    for name, parent, child, point in zip("ABCDEF", [m.ground, *rods[:-1]], rods, at, strict=False):
        m.add_revolute(name, parent, child, point=point, axis=axis)
    m.add_revolute("Z", m.ground, rods[-1], point=at[-1], axis=axis)
    return m


def line(*along: float) -> list[Point]:
    """Points in a line that is inclined in the plane."""
    return [(0.8 * x, 0.6 * x, 0.0) for x in along]


def singular(m: pt.Mechanism, **options: Any) -> dict[str, Any]:
    return dict(m.report(**options).to_dict()["singular"])


# links in line; what closes to second order, by hand: with the signed links a, b, c and their turns alpha, beta, gamma,
# a alpha + b beta + c gamma = 0 and a alpha^2 + b beta^2 + c gamma^2 = 0
LINKAGES = {
    "parallelogram": (0.0, 1.0, 4.0, 3.0),
    "rhombus": (0.0, 1.0, 2.0, 1.0),
    "folded rhombus": (0.0, 1.0, 0.0, 1.0),
    "deltoid": (0.0, 2.0, 1.0, 3.0),
    "unequal": (0.0, 1.0, 3.5, 2.0),
}


def ahead(rates: list[float]) -> tuple[float, ...]:
    """Over the largest, the first that is not zero ahead."""
    x = np.array(rates) / rates[np.argmax(np.abs(rates))]
    return tuple(float(x) for x in np.round(np.sign(x[np.nonzero(np.abs(x) > 1e-9)[0][0]]) * x, 5) + 0.0)


def user_defined(along: tuple[float, ...]) -> set[tuple[float, ...]]:
    """Rates of crank, rocker and coupler on both lines."""
    a, b, c = np.diff(along)
    # beta follows from the first equation and makes the second a quadratic form in alpha and gamma
    aa, ag, gg = a + a * a / b, 2.0 * a * c / b, c + c * c / b
    if abs(gg) < 1e-12:
        lines = [(0.0, 1.0), (-ag, aa)]
    else:
        lines = [(1.0, (-ag + sign * math.sqrt(ag * ag - 4.0 * aa * gg)) / (2.0 * gg)) for sign in (1.0, -1.0)]
    return {ahead([alpha, gamma, -(a * alpha + c * gamma) / b]) for alpha, gamma in lines}


@pytest.mark.parametrize("name", LINKAGES)
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e3])
def test_two_branches_meet_where_all_links_are_in_line(name: str, unit: float) -> None:
    along = LINKAGES[name]
    m = linkage(*line(*along), unit=unit)
    found = singular(m)
    assert (found["here"], found["beside"], found["structure"], found["many"]) == (2, 1, False, False)
    rates = [branch["rates"] for branch in found["branches"]]
    turns = [(of.get("A", 0.0), of.get("Z", 0.0), of.get("A", 0.0) + of.get("B", 0.0)) for of in rates]
    assert len(rates) == 2 and {ahead(list(x)) for x in turns} == user_defined(along)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e3])
def test_three_links_that_just_reach_are_a_structure(unit: float) -> None:
    found = singular(linkage(*line(0.0, 1.0, 2.0, 3.0), unit=unit))
    assert (found["here"], found["beside"], found["structure"]) == (2, 0, True)


def test_each_branch_can_be_drawn_and_started_in_both_directions() -> None:
    for name in ("parallelogram", "rhombus", "folded rhombus", "deltoid"):
        m = linkage(*line(*LINKAGES[name]))
        for branch in singular(m)["branches"]:
            for sign in (1.0, -1.0):
                guess = {joint: sign * x for joint, x in branch["guess"].items()}
                start = m.assemble(guess=guess)
                for joint in ("A", "B", "Z"):
                    assert abs(start.position(joint) - guess.get(joint, 0.0)) < 2e-3, (name, joint)
                assert m.simulate(0.01, initial=start).success, name


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("apart", [1e-4, 3e-4, 1e-3, 1e-2])
def test_rates_that_hold_together_beside_it(apart: float, coordinates: str) -> None:
    """One rate more than degrees of freedom: a parallelogram has its cranks turn alike however near it is to the flat
    position, where the position is known to rounding and the rates to that over the square of the distance."""
    m = linkage(*line(*LINKAGES["parallelogram"]))
    guess, rates = {"A": apart, "B": -apart, "Z": apart}, {"A": 2.0, "B": -2.0, "Z": 2.0}
    start = m.assemble(guess=guess, rates=rates, coordinates=coordinates)
    run = m.simulate(0.01, initial=start, coordinates=coordinates)
    for joint, rate in rates.items():
        assert run.joint(joint).velocity[0].item() == pytest.approx(rate, abs=2e-13 / apart**2 + 1e-9)


def test_rates_that_nearly_hold_together_are_reported_with_their_digits() -> None:
    m = linkage(*line(*LINKAGES["parallelogram"]))
    with pytest.raises(ArgumentError, match=r"A = 2 \(possible: 2\.00000\d*[1-9]\d*\)") as reported:
        m.assemble(guess={"A": 0.3, "B": -0.3, "Z": 0.3}, rates={"A": 2.0, "Z": 2.000001})
    assert "are incompatible" in str(reported.value)


def test_the_report_goes_on_beside_it() -> None:
    report = linkage(*line(*LINKAGES["parallelogram"])).report()
    found = report.to_dict()
    assert (found["mobility"], found["degrees_of_freedom"], found["joint_rank"]) == (1, 1, 17)
    assert found["singular"]["described"] and found["notes"] == []
    assert "2 degrees of freedom here and 1 next to it, where 2 branches meet" in " ".join(str(report).split())
    assert "on the first branch" in report.markdown
    assert linkage((0, 0, 0), (0.2, 1, 0), (3, 1.5, 0), (3, 0, 0)).report().to_dict()["singular"] is None


def test_a_structure_that_only_seems_mobile() -> None:
    m = linkage(*line(0.0, 1.0, 3.0))
    report = m.report()
    found = report.to_dict()["singular"]
    assert (found["here"], found["beside"], found["structure"], found["branches"]) == (1, 0, True, [])
    assert "instantaneous" in " ".join(str(report).split()) and "independent" not in str(report)
    # with a pendulum that does move
    rod = m.add_rod("bob", start=(0, 5, 0), end=(1, 5, 0), mass=1.0)
    m.add_revolute("P", m.ground, rod, point=(0, 5, 0))
    found = singular(m)
    assert (found["here"], found["beside"], found["structure"]) == (2, 1, False)
    assert "1 of them instantaneous" in found["words"]
    with pytest.raises(SingularityError, match="instantaneous"):
        m.simulate(0.1)


def test_free_motions_beside_a_change_point_count_on_each_branch() -> None:
    m = linkage(*line(*LINKAGES["parallelogram"]))
    rod = m.add_rod("bob", start=(0, 5, 0), end=(1, 5, 0), mass=1.0)
    m.add_revolute("P", m.ground, rod, point=(0, 5, 0))
    found = singular(m)
    assert (found["here"], found["beside"]) == (3, 2) and found["many"]
    assert all(branch["mobility"] == 2 for branch in found["branches"])


def test_two_parallelograms_in_line_have_four_branches() -> None:
    m = linkage(*line(*LINKAGES["parallelogram"]))
    other = [(x + 9.0, y, 0.0) for x, y, _ in line(0.0, 1.0, 3.0, 2.0)]
    rods = [m.add_rod(f"more{i}", start=other[i], end=other[i + 1], mass=1.0) for i in range(3)]
    m.add_revolute("E", m.ground, rods[0], point=other[0])
    m.add_revolute("F", rods[0], rods[1], point=other[1])
    m.add_revolute("G", rods[1], rods[2], point=other[2])
    m.add_revolute("H", m.ground, rods[2], point=other[3])
    found = singular(m)
    assert (found["here"], found["beside"], found["structure"]) == (4, 2, False)


def test_an_inclined_plane_in_space() -> None:
    c, s = math.cos(0.4), math.sin(0.4)
    points = [(0.8 * x, 0.6 * x * c, 0.6 * x * s) for x in LINKAGES["parallelogram"]]
    found = singular(linkage(*points))
    assert (found["here"], found["beside"], len(found["branches"])) == (2, 1, 2)


def test_refusals_report_the_branches() -> None:
    m = linkage(*line(*LINKAGES["rhombus"]))
    for coordinates in ("relative", "absolute"):
        with pytest.raises(SingularityError, match="2 branches meet: rates") as reported:
            m.simulate(0.1, coordinates=coordinates)
        assert "start a little away from it" in str(reported.value)
    with pytest.raises(SingularityError, match="2 branches meet"):
        m.assemble(rates={"A": 1.0})


def crank_slider(**drive: Any) -> pt.Mechanism:
    m = pt.Mechanism("slider-crank")
    b, c = (1.0, 0.0, 0.0), (4.0, 0.0, 0.0)
    crank = m.add_rod("crank", start=(0, 0, 0), end=b, mass=1.0)
    rod = m.add_rod("rod", start=b, end=c, mass=1.0)
    slider = m.add_body("slider", mass=1.0, com=c, inertia=(0.1, 0.1, 0.1))
    m.add_revolute("A", m.ground, crank, point=(0, 0, 0))
    m.add_revolute("B", crank, rod, point=b)
    m.add_prismatic("S", m.ground, slider, point=c, axis=(1, 0, 0))
    m.add_revolute("C", rod, slider, point=c)
    if drive:
        m.add_drive("S", **drive)
    return m


@pytest.mark.parametrize("course", [lambda t: -0.2 * t, lambda t: -0.2 * t * t, lambda t: 0.2 * t])
def test_a_slider_driven_in_dead_centre(course: Any) -> None:
    m = crank_slider(position=course)
    with pytest.raises(
        SingularityError, match=r"a dead centre: .* does not determine here in which direction"
    ) as reported:
        m.simulate(0.1)
    assert "drive a joint that is not at its dead centre" in str(reported.value)
    report = m.report()
    assert report.to_dict()["singular"]["beside"] == 1 and "dead centre" in str(report)


def test_without_the_drive_a_dead_centre_is_no_singular_position() -> None:
    report = crank_slider().report().to_dict()
    assert report["singular"] is None and report["dead"] == ["S"]


def test_a_drive_does_not_hide_the_branches() -> None:
    m = linkage(*line(*LINKAGES["parallelogram"]))
    m.add_drive("A", position=lambda t: 0.3 * t)
    found = m.report().to_dict()
    assert len(found["singular"]["branches"]) == 2 and not found["singular"]["described"]
    assert (found["degrees_of_freedom"], found["mobility"]) == (1, 0)
    with pytest.raises(SingularityError, match="2 branches meet"):
        m.simulate(0.1)


@pytest.mark.parametrize("angle", [0.003, 0.01, 0.02, 0.05, 0.08, 0.1, 0.15, 0.3])
def test_near_a_change_point_no_geometric_error_is_reported(angle: float) -> None:
    """What is weak because a singular position is near is no fault of the drawing."""
    m, b = pt.Mechanism("parallelogram"), (np.cos(angle), np.sin(angle), 0.0)
    c = (3.0 + b[0], b[1], 0.0)
    for name, start, end in (("crank", (0, 0, 0), b), ("coupler", b, c), ("rocker", (3, 0, 0), c)):
        m.add_rod(name, start=start, end=end, mass=1.0)
    m.add_revolute("A", m.ground, "crank", point=(0, 0, 0))
    m.add_revolute("B", "crank", "coupler", point=b)
    m.add_revolute("C", "coupler", "rocker", point=c)
    m.add_revolute("D", m.ground, "rocker", point=(3, 0, 0))
    report = " ".join(m.report().split())
    assert "geometric error" not in report and "1 degree of freedom" in report
