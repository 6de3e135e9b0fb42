"""Results of a mechanism are the same in any frame, units and order, and in both kinds of coordinates."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from oracle.drawing import Drawing
from other_words import REWRITTEN, by_chance, differences, of, rewritten
from test_drawing_tolerance import bennett, five_bar, four_bar, three_cranks

import partita as pt
from partita.errors import DescriptionError, SingularityError

DRAWN: dict[str, Callable[[], pt.Mechanism]] = {
    "four-bar, a little off": lambda: four_bar(1e-5),
    "four-bar, off by three tolerances": lambda: four_bar(3e-4),
    "four-bar, off by ten tolerances": lambda: four_bar(1e-3),
    "five-bar, off by three tolerances": lambda: five_bar(3e-4),
    "cranks, off by two tolerances": lambda: three_cranks(2e-4),
    "bennett, off by a tolerance": lambda: bennett(1e-4),
    "bennett, off by ten": lambda: bennett(1e-3),
    "sarrus": lambda: pt.catalogue.load("sarrus"),
    "double-cardan": lambda: pt.catalogue.load("double-cardan"),
    "spatial-four-bar": lambda: pt.catalogue.load("spatial-four-bar"),
}
CHANCE = (0, 2, 4, 8, 9, 12, 14, 20, 114)
"""Mechanisms drawn by chance: parallelograms, planes, groups of parallel axes, loops in space, drives."""

REFUSED = {6, 11, 13, 16, 30, 36}
"""Of the first forty, those that cannot start as drawn."""


def drawing(name: str | int) -> Drawing:
    if isinstance(name, int):
        return by_chance(name)
    return of(DRAWN[name]())


@pytest.mark.parametrize("name", [*DRAWN, *CHANCE])
def test_every_verdict_is_the_same(name: str | int) -> None:
    assert differences(drawing(name), 3) == []


@pytest.mark.parametrize("name", ["four-bar, off by three tolerances", "bennett, off by a tolerance", "sarrus", 4])
def test_measures_and_runs_are_the_same(name: str | int) -> None:
    """The measure rho of each joint, whichever way it is drawn, and what a short run and its certificate say."""
    d = drawing(name)
    rng = np.random.default_rng(5)

    def measures(x: Drawing) -> Any:
        names = [j.name for j in x.joints]
        m = x.build()
        lines = m.report().to_dict()["coordinates"]
        rho = {line["name"].split(".")[0]: line["rho"] for line in lines}
        run = m.simulate(0.05 * x.time)
        return [rho.get(n) for n in names], (run.status, run.certificate.verdict, len(run.notes)), run

    rho, reported, run = measures(d)
    for how in ("turned", "shifted", "millimetres", "kilometres and tonnes", "swapped"):
        again, words, other = measures(rewritten(d, how, rng))
        assert words == reported, how
        if how != "swapped":  # another tree has other coordinates
            # which rows are left out of a drawing that misfits may differ, and the measures with it by as much
            assert again == pytest.approx(rho, abs=5.0 * d.build().drawing_tolerance), how
        assert other.certificate.geometric_error == pytest.approx(
            run.certificate.geometric_error, rel=2e-1, abs=1e-12
        ), how


@pytest.mark.parametrize("how", REWRITTEN)
def test_a_singular_position_is_one_whatever_the_words(how: str) -> None:
    d = of(_in_line())
    other = rewritten(d, how, np.random.default_rng(1))
    found = other.build().report().to_dict()["singular"]
    assert (found["here"], found["beside"], len(found["branches"])) == (2, 1, 2)
    with pytest.raises(SingularityError, match="2 branches meet"):
        other.build().simulate(0.1)


@pytest.mark.parametrize("seed", sorted(set(range(40)) - REFUSED))
def test_reactions_in_joint_axes_turn_with_the_drawing(seed: int) -> None:
    """Components along the joint's own axes, and which of them are determined, know nothing of the world's axes."""
    d, rng = by_chance(seed), np.random.default_rng(seed)
    run = d.build().simulate(0.01 * d.time, t_eval=[0.0])
    for _ in range(2):
        other = rewritten(d, "turned", rng).build().simulate(0.01 * d.time, t_eval=[0.0])
        views = [[r.joint(j.name).in_frame("joint") for r in (run, other)] for j in d.joints]
        # without gravity nothing loads a mechanism at rest
        size = d.mass * d.size / d.time**2
        size = max(size, *(np.abs(one.force).max() + np.abs(one.moment).max() / d.size for one, _ in views))
        for one, two in views:
            assert (one.determined_at == two.determined_at).all(), one.name
            assert np.abs(one.force - two.force).max() < 1e-7 * size, one.name
            assert np.abs(one.moment - two.moment).max() < 1e-7 * size * d.size, one.name


def test_the_axes_of_a_joint_are_laid_by_its_bodies() -> None:
    """x is the x axis of the parent across the joint's axis, of the child where the parent is the ground; y where x is
    nearly along it; a planar joint slides along them."""
    tilt = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    tilt *= np.linalg.det(tilt)
    m = pt.Mechanism("axes", gravity=(0, 0, 0))
    one = m.add_body("one", mass=1.0, inertia=(1, 1, 1), orientation=tilt)
    two = m.add_body("two", mass=1.0, inertia=(1, 1, 1), position=(1, 0, 0))
    m.add_planar("table", m.ground, one, point=(0, 0, 0), normal=tilt[:, 2])
    m.add_revolute("hinge", one, two, point=(1, 0, 0), axis=tilt @ (0.95, 0.0, np.sqrt(1 - 0.95**2)))
    run = m.simulate(0.1, initial=m.assemble(rates={"table": (1.0, 0.0, 0.0)}), t_eval=[0.0])
    axes = dict(zip(run.names.joints, run.at_once.reactions["joint_rotation"][0], strict=True))
    assert axes["table"] == pytest.approx(tilt, abs=1e-14)
    assert axes["hinge"][:, 0] == pytest.approx(tilt[:, 1], abs=1e-14)
    assert run.body("one").velocity[0] == pytest.approx(tilt[:, 0], abs=1e-14)


def _in_line() -> pt.Mechanism:
    m = pt.Mechanism("parallelogram in line")
    at = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (4.0, 0.0, 0.0), (3.0, 0.0, 0.0)]
    rods = [m.add_rod(f"rod{i}", start=at[i], end=at[i + 1], mass=1.0) for i in range(3)]
    for name, parent, child, point in zip("ABC", [m.ground, *rods[:-1]], rods, at, strict=False):
        m.add_revolute(name, parent, child, point=point)
    m.add_revolute("D", m.ground, rods[-1], point=at[-1])
    return m


def test_the_size_of_a_mechanism_does_not_depend_on_its_frame() -> None:
    """Undetermined reactions are shared by forces and moments over a length: the same shares along any axes."""
    d = of(four_bar(0.0))
    run = d.build().simulate(0.1)
    turned = rewritten(d, "turned", np.random.default_rng(4))
    other = turned.build().simulate(0.1)
    for name in "ABCD":
        for x, y in ((run, other),):
            force, there = (np.linalg.norm(r.joint(name).force, axis=1) for r in (x, y))
            moment, turn = (np.linalg.norm(r.joint(name).moment, axis=1) for r in (x, y))
            scale = max(force.max(), moment.max())
            assert np.abs(force - there).max() < 1e-6 * scale
            assert np.abs(moment - turn).max() < 1e-6 * scale


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("also", ["", "revolute"])
def test_what_is_welded_is_refused_in_any_coordinates(coordinates: str, also: str) -> None:
    m = pt.Mechanism("block")
    m.add_body("block", mass=1.0, inertia=(1, 1, 1), position=(0, 0, 0))
    m.add_body("lid", mass=1.0, inertia=(1, 1, 1), position=(0, 0, 1))
    if also:
        m.add_revolute("hinge", m.ground, "lid", point=(0, 0, 1))
    m.add_fixed("weld", "lid", "block", point=(0, 0, 0.5))
    if not also:
        assert m.compile(coordinates=coordinates).mobility == 6
    m.add_fixed("foot", m.ground, "block", point=(0, 0, 0))
    with pytest.raises(DescriptionError, match="nothing can move: every body is fixed to the ground"):
        m.report(coordinates=coordinates)
