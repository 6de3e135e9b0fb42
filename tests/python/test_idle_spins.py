"""Idle spins: rotations that move no other body and on which no load depends, whatever the joints that leave them."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from oracle.comparison import frames_of
from oracle.maximal import Maximal
from oracle.reading import drawing_of
from other_words import of, rewritten
from test_zoo import OTHERS
from zoo.judging import poses_at

import partita as pt
from partita.catalogue import zoo

FOOT, HEAD = np.array([0.0, 0.0, 0.0]), np.array([0.3, 0.2, 1.0])
ALONG = (HEAD - FOOT) / np.linalg.norm(HEAD - FOOT)
ACROSS = np.cross(ALONG, (0, 0, 1.0)) / np.linalg.norm(np.cross(ALONG, (0, 0, 1.0)))
ROUND = (0.01, 0.1, 0.1)


def spins(m: pt.Mechanism) -> list[tuple[list[str], list[str]]]:
    """Bodies and joints of each idle spin, sorted."""
    found = m.report().to_dict()["idle"]
    return sorted((item["bodies"], sorted(item["joints"])) for item in found)


def bench() -> pt.Mechanism:
    """A plate on a slide, which a leg from the ground holds."""
    m = pt.Mechanism("bench", gravity=(0, 0, -9.81))
    m.add_body("plate", mass=2.0, inertia=(1, 1, 1), position=HEAD)
    m.add_prismatic("guide", m.ground, "plate", point=HEAD, axis=(0, 0, 1))
    return m


def part(m: pt.Mechanism, name: str, at: Any, aside: float = 0.0) -> None:
    """A bar along the leg, its centre of mass `aside` of the line."""
    axes = np.column_stack([ALONG, ACROSS, np.cross(ALONG, ACROSS)])
    m.add_body(name, mass=1.0, inertia=ROUND, position=at, com=(0, aside, 0), orientation=axes)


def halves(m: pt.Mechanism, aside: float = 0.0) -> pt.Mechanism:
    """The two halves of a leg, and the ball on top."""
    part(m, "lower", 0.75 * FOOT + 0.25 * HEAD)
    part(m, "upper", 0.25 * FOOT + 0.75 * HEAD, aside)
    m.add_spherical("head", "upper", "plate", point=HEAD)
    return m


def ball_slide_ball(slide: str = "prismatic", **more: float) -> pt.Mechanism:
    m = halves(bench(), **more)
    m.add_spherical("foot", m.ground, "lower", point=FOOT)
    getattr(m, f"add_{slide}")("leg", "lower", "upper", point=0.5 * (FOOT + HEAD), axis=ALONG)
    return m


def universal_cylinder_ball() -> pt.Mechanism:
    m = halves(bench())
    m.add_universal("foot", m.ground, "lower", point=FOOT, axis1=ACROSS, axis2=np.cross(ALONG, ACROSS))
    m.add_cylindrical("leg", "lower", "upper", point=0.5 * (FOOT + HEAD), axis=ALONG)
    return m


def universal_slide_ball() -> pt.Mechanism:
    m = halves(bench())
    m.add_universal("foot", m.ground, "lower", point=FOOT, axis1=ACROSS, axis2=np.cross(ALONG, ACROSS))
    m.add_prismatic("leg", "lower", "upper", point=0.5 * (FOOT + HEAD), axis=ALONG)
    return m


def ball_and_strut(inside: float = 0.0) -> pt.Mechanism:
    """A bar with a ball below, its upper end held by three distances to the ground."""
    m = pt.Mechanism("bar and struts", gravity=(0, 0, -9.81))
    part(m, "bar", 0.5 * (FOOT + HEAD))
    m.add_spherical("foot", m.ground, "bar", point=FOOT)
    end = (0.5 * np.linalg.norm(HEAD - FOOT), inside, 0)
    m.add_distance("strut", m.ground, HEAD + ACROSS, "bar", end)
    return m


def rod_on_two_lines(thin: bool = False) -> pt.Mechanism:
    m = pt.Mechanism("trammel", gravity=(0, 0, -9.81))
    if thin:
        m.add_rod("rod", start=(1, 0, 0), end=(0, 1, 0.5), mass=1.0)
    else:
        m.add_body("rod", mass=1.0, inertia=(0.1, 0.1, 0.1), position=(0.5, 0.5, 0.25))
    m.add_point_on_line("first", m.ground, "rod", point=(1, 0, 0), axis=(1, 0, 0))
    m.add_point_on_line("second", m.ground, "rod", point=(0, 1, 0.5), axis=(0, 1, 0.2))
    return m


def hinge_and_ball_on_its_axis() -> pt.Mechanism:
    m = pt.Mechanism("leg of one length", gravity=(0, 0, -9.81))
    # its weight, off the ball, rotates it in its plane
    m.add_body("plate", mass=2.0, inertia=(1, 1, 1), position=HEAD, com=(0, 0.3, 0))
    m.add_planar("guide", m.ground, "plate", point=HEAD, normal=(1, 0, 0))
    part(m, "fork", FOOT)
    part(m, "pin", 0.5 * (FOOT + HEAD))
    m.add_spherical("foot", m.ground, "fork", point=FOOT)
    m.add_revolute("bearing", "fork", "pin", point=0.5 * (FOOT + HEAD), axis=ALONG)
    m.add_spherical("head", "pin", "plate", point=HEAD)
    return m


IDLE: dict[str, tuple[Callable[[], pt.Mechanism], list[tuple[list[str], list[str]]]]] = {
    "ball, slide, ball": (ball_slide_ball, [(["lower", "upper"], ["foot", "head"])]),
    "ball, cylinder, ball": (
        lambda: ball_slide_ball("cylindrical"),
        [(["lower"], ["foot", "leg"]), (["upper"], ["head", "leg"])],
    ),
    "universal, cylinder, ball": (universal_cylinder_ball, [(["upper"], ["head", "leg"])]),
    "universal, slide, ball": (universal_slide_ball, []),
    "ball and distance": (ball_and_strut, [(["bar"], ["foot", "strut"])]),
    "ball and distance off the line": (lambda: ball_and_strut(0.1), []),
    "rod on two lines": (rod_on_two_lines, [(["rod"], ["first", "second"])]),
    "hinge and ball": (
        hinge_and_ball_on_its_axis, [(["fork"], ["bearing", "foot"]), (["pin"], ["bearing", "head"])],
    ),
    "centre of mass off the line": (lambda: ball_slide_ball(aside=0.05), []),
}  # fmt: skip


@pytest.mark.parametrize("name", IDLE)
def test_what_spins_idly(name: str) -> None:
    drawn, expected = IDLE[name]
    m = drawn()
    assert spins(m) == expected
    if expected:
        words = " ".join(str(m.report()).split())
        assert f"{len(expected)} degree{'s' * (len(expected) > 1)} of freedom " in words and " idle: " in words


@pytest.mark.parametrize("name", IDLE)
def test_the_independent_program_finds_the_same_spins_in_any_position(name: str) -> None:
    """With all other bodies and all centres of mass at rest each set of bodies has this one motion, as drawn and after
    a while; where nothing spins idly, no set of bodies has one but at single moments, such as the one drawn."""
    drawn, expected = IDLE[name]
    m = drawn()
    run = m.simulate(0.3, t_eval=[0.0, 0.3])
    assert run.success and np.ptp(run.q, axis=0).max() > 0.01
    drawing = drawing_of(m)
    program = Maximal(drawing, frames_of(drawing, run))
    names = [b.name for b in drawing.bodies]
    every = [list(which) for n in range(len(names)) for which in combinations(names, n + 1)]
    for i in range(2) if expected else [1]:
        poses = poses_at(drawing, run, i)
        for bodies in every if not expected else [which for which, _ in expected]:
            assert program.motions_of(poses, bodies, about_centres=True) == bool(expected), bodies


@pytest.mark.parametrize("what", ["spring", "torque", "drive"])
def test_a_spin_that_is_acted_on_is_not_idle(what: str) -> None:
    m = ball_slide_ball("cylindrical")
    if what == "spring":
        m.add_spring("pull", m.ground, (1, 0, 0), "upper", (0, 0.1, 0), stiffness=10.0)
    elif what == "torque":
        m.add_torque("leg", 0.1, coordinate=1)
    else:
        m.add_drive("leg", 0.0, coordinate=1)
    # the torque and the drive act between the halves, which still spin as one
    assert (
        spins(m)
        == {
            "spring": [(["lower"], ["foot", "leg"])],
            "torque": [(["lower", "upper"], ["foot", "head"])],
            "drive": [(["lower", "upper"], ["foot", "head"])],
        }[what]
    )


def test_a_force_along_a_slide_does_not_act_on_the_spin() -> None:
    m = ball_slide_ball("cylindrical")
    m.add_torsion_spring("leg", stiffness=100.0, coordinate=0)
    assert len(spins(m)) == 2


def test_a_door_and_a_flywheel_are_not_idle() -> None:
    m = pt.Mechanism("door", gravity=(0, 0, -9.81))
    m.add_body("leaf", mass=20.0, inertia=(5, 4, 1), com=(0.4, 0, 0))
    m.add_spherical("lower", m.ground, "leaf", point=(0, 0, -0.8))
    m.add_joint("upper", m.ground, "leaf", free=("z", "rx", "ry", "rz"), point=(0, 0, 0.8))
    assert spins(m) == []
    m = pt.Mechanism("flywheel")
    m.add_body("wheel", mass=20.0, inertia=(5, 5, 1))
    m.add_revolute("bearing", m.ground, "wheel", point=(0, 0, -0.8))
    m.add_spherical("pivot", m.ground, "wheel", point=(0, 0, 0.8))
    assert spins(m) == []


@pytest.mark.parametrize("name", sorted([*zoo.ENTRIES, *OTHERS]))
def test_the_zoo_spins_as_theory_says(name: str) -> None:
    """Groups of one idle motion each, which the independent program confirms (`zoo.judging`)."""
    entry = pt.catalogue.entry(name)
    truth = OTHERS.get(name) or entry.truth
    assert truth is not None
    found = entry.mechanism().report().to_dict()["idle"]
    assert sorted(" + ".join(item["bodies"]) for item in found) == sorted(truth.idle)


def test_a_thin_rod_on_two_lines_is_held_from_spinning() -> None:
    thin, thick = rod_on_two_lines(thin=True), rod_on_two_lines()
    assert thin.report().to_dict()["idle"][0]["held"] and not thick.report().to_dict()["idle"][0]["held"]
    run = thin.simulate(0.5, rtol=1e-9)
    assert run.success and run.certificate.verdict == "valid"
    assert any("rod is held from spinning" in note for note in run.notes)
    line = run.joint("second").point - run.joint("first").point
    assert np.abs(np.sum(run.body("rod").angular_velocity * line, axis=1)).max() < 1e-9


def test_idle_spins_turn_with_the_drawing() -> None:
    d, rng = of(pt.catalogue.load("stewart-sps")), np.random.default_rng(2)
    assert spins(rewritten(d, "turned", rng).build()) == spins(d.build())
