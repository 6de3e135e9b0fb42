"""Joints that events part: what follows is the motion of the mechanism drawn without them."""

import importlib.util
import itertools
import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawings import GENERAL, four_bar
from numpy.typing import NDArray

import partita as pt
from partita.errors import ArgumentError, DescriptionError, UnknownNameError

Array = NDArray[np.float64]
TIGHT: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12}
COORDINATES = pytest.mark.parametrize("coordinates", ["relative", "absolute"])
G = 9.81
DOWN = np.array([0.0, -G, 0.0])


def at(time: float, *joints: str, name: str = "go") -> pt.Event:
    """An event that releases joints at a time."""
    return pt.Event(name, lambda t, state: t - time, then=[pt.Release(joint) for joint in joints])


def known(run: pt.Result, outputs: Any) -> Any:
    """Which reaction components are determined at these outputs, by joints."""
    return run.at_once.determined[0][outputs].all(axis=(0, 2))


def balanced(run: pt.Result, error: float = 1e-9) -> bool:
    """Valid, and the energy is that of the start and of the work."""
    balance = run.energy.total - run.energy.work
    return run.certificate.verdict == "valid" and bool(np.ptp(balance) < error * (1.0 + np.abs(balance).max()))


def bob_on_a_rod(joint: str = "fixed") -> pt.Mechanism:
    m = pt.Mechanism("thrower", gravity=(0, -G, 0))
    rod = m.add_rod("rod", start=(0, 0, 0), end=(0, -1.0, 0), mass=1.0)
    bob = m.add_body("bob", mass=0.5, inertia=(0.011, 0.017, 0.023), position=(0, -1, 0))
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    if joint == "fixed":
        m.add_fixed("J", rod, bob)
    else:
        m.add_revolute("J", rod, bob, point=(0, -1, 0))
    return m


@COORDINATES
@pytest.mark.parametrize("joint", ["fixed", "revolute"])
def test_a_pendulum_bob_that_is_released_flies_a_parabola(coordinates: str, joint: str) -> None:
    m = bob_on_a_rod(joint)
    start = m.assemble({"A": -1.2}, rates={"A": 0.5})
    go = pt.Event("go", "A", value=0.3, direction=1, then=pt.Release("J"))
    run = m.simulate(2.0, initial=start, coordinates=coordinates, events=[go], **TIGHT)
    (record,) = run.events
    assert (record.kind, record.name, record.energy_lost) == ("release", "go", 0.0)
    assert record.before.position("A") == pytest.approx(0.3, abs=1e-12)
    assert (record.after.v == record.before.v).all() and (record.after.q == record.before.q).all()
    # the rate from the balance of energy of a rod with a bob
    inertia = 1.0 / 3.0 + 0.5 + (0.023 if joint == "fixed" else 0.0)
    rise = (0.5 + 0.5) * G * (math.cos(0.3) - math.cos(1.2))
    rate = math.sqrt(0.25 + 2.0 * rise / inertia)
    assert record.after.velocity("A") == pytest.approx(rate, rel=1e-11)
    late, bob = run.t > record.t, run.body("bob")
    s = (run.t[late] - record.t)[:, None]
    first = np.array([math.sin(0.3), -math.cos(0.3), 0.0])
    speed = rate * np.array([math.cos(0.3), math.sin(0.3), 0.0])
    assert np.abs(bob.position[late] - (first + speed * s + 0.5 * DOWN * s**2)).max() < 1e-10
    spin = rate if joint == "fixed" else record.after.velocity("A") + record.after.velocity("J")
    assert np.abs(bob.angular_velocity[late] - [0.0, 0.0, spin]).max() < 1e-10
    gone = run.joint("J")
    assert not gone.force[late].any() and not gone.moment[late].any() and gone.force[~late].any()
    assert known(run, late).all() and balanced(run)
    assert coordinates == "absolute" or "without" in "".join(run.notes)


@COORDINATES
def test_momentum_of_two_bodies_that_part_in_space(coordinates: str) -> None:
    """They tumble on one ball joint, free of forces; then each keeps its momentum, and its angular momentum."""
    m = pt.Mechanism("pair", gravity=(0, 0, 0))
    one = m.add_body("one", mass=2.0, com=(0.1, 0, 0), inertia=(0.3, 0.2, 0.4))
    two = m.add_body("two", mass=1.5, com=(0, 0.2, 0.1), inertia=(0.1, 0.25, 0.2), position=(1, 0, 0))
    m.add_free("F", m.ground, one)
    m.add_spherical("S", one, two, point=(0.5, 0, 0))
    start = m.assemble(rates={"F": (0.1, -0.2, 0.3, 0.7, 1.1, -0.4), "S": (0.9, -1.3, 0.5)})
    run = m.simulate(2.0, initial=start, coordinates=coordinates, events=[at(0.8, "S")], **TIGHT)
    late = run.t > 0.8

    def momenta(name: str, mass: float, com: Any, inertia: Any) -> tuple[Array, Array]:
        body = run.body(name)
        arm = np.einsum("tij,j->ti", body.rotation, np.array(com, dtype=float))
        speed = body.velocity + np.cross(body.angular_velocity, arm)
        turned = np.einsum("tij,j,tkj,tk->ti", body.rotation, inertia, body.rotation, body.angular_velocity)
        return mass * speed, turned + np.cross(body.position + arm, mass * speed)

    of = [momenta("one", 2.0, (0.1, 0, 0), (0.3, 0.2, 0.4)), momenta("two", 1.5, (0, 0.2, 0.1), (0.1, 0.25, 0.2))]
    for total in (of[0][0] + of[1][0], of[0][1] + of[1][1]):
        assert np.ptp(total, axis=0).max() < 1e-9
    for linear, angular in of:
        assert np.ptp(linear[late], axis=0).max() < 1e-9 < np.ptp(linear[~late], axis=0).max()
        assert np.ptp(angular[late], axis=0).max() < 1e-9 < np.ptp(angular[~late], axis=0).max()
    assert balanced(run) and not run.joint("S").force[late].any()


def four_bar_without(*missing: str) -> pt.Mechanism:
    """A four-bar A, B, C, D, without some of its joints, and without bodies that none holds."""
    m = pt.Mechanism("bar", gravity=(0, -G, 0))
    a, b, c, d = (0, 0, 0), (0.3, 0.5, 0), (1.2, 0.8, 0), (1.0, 0, 0)
    joints = [name for name in "ABCD" if name not in missing]
    bars = {"crank": (a, b, 1.0, "AB"), "coupler": (b, c, 2.0, "BC"), "rocker": (c, d, 1.5, "CD")}
    body: dict[str, Any] = {"": m.ground}
    for name, (start, end, mass, held) in bars.items():
        if any(joint in held for joint in joints):
            body[name] = m.add_rod(name, start=start, end=end, mass=mass)
    pairs = {"A": ("", "crank", a), "B": ("crank", "coupler", b), "C": ("coupler", "rocker", c), "D": ("", "rocker", d)}
    for joint in joints:
        parent, child, point = pairs[joint]
        m.add_revolute(joint, body[parent], body[child], point=point)
    return m


@COORDINATES
@pytest.mark.parametrize("lost", ["A", "B", "C", "D"])
def test_a_four_bar_that_loses_a_pin_goes_on_as_two_pendulums(coordinates: str, lost: str) -> None:
    m, rest = four_bar_without(), four_bar_without(lost)
    start = m.assemble(rates={"A": 1.0})
    run = m.simulate(1.2, initial=start, coordinates=coordinates, events=[at(0.5, lost)], **TIGHT)
    assert run.success and [record.kind for record in run.events] == ["release"]
    after = run.events[0].after
    others = [joint for joint in "ABCD" if joint != lost]
    begin = rest.assemble({j: after.position(j) for j in others}, rates={j: after.velocity(j) for j in others}, t=0.5)
    own = rest.simulate(0.7, initial=begin, t_eval=run.t[run.t > 0.5], **TIGHT)
    late = run.t > 0.5
    for joint in others:
        assert np.abs(run.joint(joint).angle[late] - own.joint(joint).angle).max() < 1e-9
        assert np.abs(run.joint(joint).force[late] - own.joint(joint).force).max() < 1e-7
        assert np.abs(run.joint(joint).acceleration[late] - own.joint(joint).acceleration).max() < 1e-7
    # out of the plane a four-bar is redundant, what remains is not
    assert not known(run, ~late).any() and known(run, late).all()
    ranks = run.certificate.rank
    assert len(ranks) == 2 and ranks[0] - ranks[1] == 2 and balanced(run)
    assert not run.joint(lost).force[late].any() and not run.joint(lost).moment[late].any()
    augmented = run.reactions_by("augmented")
    assert np.abs(augmented["force"] - run.at_once.reactions["force"]).max() < 1e-7


def three_cranks(*missing: str) -> pt.Mechanism:
    """A platform on three parallel cranks of equal length, one of them redundant."""
    m = pt.Mechanism("platform", gravity=(0, -G, 0))
    turn = 0.6
    tip = np.array([math.sin(turn), -math.cos(turn), 0.0]) * 0.8
    x = (-1.0, 0.1, 1.0)
    plate = m.add_rod("plate", start=(-1.0 + tip[0], tip[1], 0), end=(1.0 + tip[0], tip[1], 0), mass=3.0)
    for i in range(3):
        base = np.array([x[i], 0.0, 0.0])
        crank = m.add_rod(f"crank{i}", start=base, end=base + tip, mass=0.5 + 0.2 * i)
        m.add_revolute(f"A{i}", m.ground, crank, point=base)
        if f"B{i}" not in missing:
            m.add_revolute(f"B{i}", crank, plate, point=base + tip)
    return m


@COORDINATES
def test_a_loop_with_redundant_rows_loses_one(coordinates: str) -> None:
    m, rest = three_cranks(), three_cranks("B1")
    start = m.assemble(coordinates=coordinates)
    run = m.simulate(1.5, initial=start, coordinates=coordinates, events=[at(0.6, "B1")], **TIGHT)
    assert run.success and balanced(run)
    late, after = run.t > 0.6, run.events[0].after
    angles = {j: after.position(j) for j in ("A0", "A1")}
    begin = rest.assemble(angles, rates={j: after.velocity(j) for j in ("A0", "A1")}, t=0.6)
    own = rest.simulate(0.9, initial=begin, t_eval=run.t[late], **TIGHT)
    for joint in ("A0", "A1", "A2"):
        assert np.abs(run.joint(joint).angle[late] - own.joint(joint).angle).max() < 1e-9
    # forces in the plane: of three cranks only sums are determined, of two all
    flags = np.asarray(run.at_once.determined[0][:, :, :2].all(axis=2))
    assert not flags[run.t < 0.599][:, :2].any() and flags[late].all()
    assert np.abs(run.joint("A0").force[late][:, :2] - own.joint("A0").force[:, :2]).max() < 1e-7


def bennett(*missing: str) -> pt.Mechanism:
    """An overconstrained loop of four hinges in space, or what remains of it."""
    m = pt.Mechanism("bennett", gravity=(0.3, -2.0, -G))
    a, b = 0.5, 0.8
    alpha = 0.5
    beta = math.asin(b / a * math.sin(alpha))
    turn, lengths, twists = 0.9, (a, b, a, b), (alpha, beta, alpha, beta)
    half = math.tan(turn / 2.0)
    other = 2.0 * math.atan(math.sin((beta + alpha) / 2.0) / (math.sin((beta - alpha) / 2.0) * half))
    turns = (turn, other, -turn, -other)
    frame, frames = np.eye(4), []
    for theta, length, twist in zip(turns, lengths, twists, strict=True):
        c, s, ca, sa = math.cos(theta), math.sin(theta), math.cos(twist), math.sin(twist)
        frames.append(frame)
        step = np.array(
            [[c, -s * ca, s * sa, length * c], [s, c * ca, -c * sa, length * s], [0, sa, ca, 0], [0, 0, 0, 1]]
        )
        frame = frame @ step
    assert np.abs(frame - np.eye(4)).max() < 1e-12
    bodies = [m.ground]
    for i in range(3):
        middle = 0.5 * (frames[i][:3, 3] + frames[i + 1][:3, 3]) + [0.02, 0.05, -0.03]
        inertia = (0.02, 0.03 + 0.01 * i, 0.04)
        bodies.append(m.add_body(f"L{i}", mass=1.0 + 0.3 * i, inertia=inertia, position=middle))
    for i in range(4):
        if f"H{i}" not in missing:
            m.add_revolute(f"H{i}", bodies[i], bodies[(i + 1) % 4], point=frames[i][:3, 3], axis=frames[i][:3, 2])
    return m


@COORDINATES
@pytest.mark.parametrize("lost", ["H1", "H3"])
def test_an_overconstrained_loop_in_space_opens_to_a_chain(coordinates: str, lost: str) -> None:
    m, rest = bennett(), bennett(lost)
    start = m.assemble(rates={"H0": 0.8}, coordinates="relative")
    run = m.simulate(0.6, initial=start, coordinates=coordinates, events=[at(0.3, lost)], **TIGHT)
    assert run.success and balanced(run) and len(run.certificate.rank) == 2
    late = run.t > 0.3
    after = run.events[0].after
    others = [f"H{i}" for i in range(4) if f"H{i}" != lost]
    begin = rest.assemble({j: after.position(j) for j in others}, rates={j: after.velocity(j) for j in others}, t=0.3)
    own = rest.simulate(0.3, initial=begin, t_eval=run.t[late], **TIGHT)
    for body in ("L0", "L1", "L2"):
        assert np.abs(run.body(body).position[late] - own.body(body).position).max() < 1e-8
        assert np.abs(run.body(body).rotation[late] - own.body(body).rotation).max() < 1e-8
    for joint in others:
        assert np.abs(run.joint(joint).force[late] - own.joint(joint).force).max() < 1e-6
    assert not known(run, ~late).all() and known(run, late).all()


JOINTS: dict[str, Callable[[pt.Mechanism, Any, Any], Any]] = {
    "fixed": lambda m, a, b: m.add_fixed("J", a, b),
    "revolute": lambda m, a, b: m.add_revolute("J", a, b, point=(1, 0, 0), axis=(0, 1, 1)),
    "prismatic": lambda m, a, b: m.add_prismatic("J", a, b, axis=(1, 2, 0)),
    "cylindrical": lambda m, a, b: m.add_cylindrical("J", a, b, point=(1, 0, 0), axis=(1, 0, 1)),
    "spherical": lambda m, a, b: m.add_spherical("J", a, b, point=(1, 0, 0)),
    "universal": lambda m, a, b: m.add_universal("J", a, b, point=(1, 0, 0), axis1=(0, 1, 0), axis2=(0, 0, 1)),
    "planar": lambda m, a, b: m.add_planar("J", a, b, point=(1, 0, 0), normal=(0, 1, 1)),
    "screw": lambda m, a, b: m.add_screw("J", a, b, point=(1, 0, 0), axis=(1, 0, 0), pitch=0.3),
}


@COORDINATES
@pytest.mark.parametrize("kind", JOINTS)
def test_every_kind_of_joint_parts(coordinates: str, kind: str) -> None:
    """A body on an arm in space: its centre of mass falls, and it keeps its angular momentum."""
    m = pt.Mechanism(kind, gravity=(0, -G, 0))
    arm = m.add_body("arm", mass=2.0, com=(0.5, 0, 0), inertia=(0.1, 0.3, 0.3))
    load = m.add_body("load", mass=0.7, inertia=(0.02, 0.05, 0.04), position=(1.1, 0.1, 0))
    m.add_spherical("S", m.ground, arm, point=(0, 0, 0))
    JOINTS[kind](m, arm, load)
    start = m.assemble(rates={"S": (0.4, -0.8, 1.5)})
    run = m.simulate(1.0, initial=start, coordinates=coordinates, events=[at(0.4, "J")], **TIGHT)
    assert run.success and balanced(run), run.message
    after, late = run.events[0].after, run.t > 0.4
    assert (after.v == run.events[0].before.v).all()
    body = run.body("load")
    i = int(np.argmax(late))
    s = (run.t[late] - run.t[i])[:, None]
    fall = body.position[i] + body.velocity[i] * s + 0.5 * DOWN * s**2
    assert np.abs(body.position[late] - fall).max() < 1e-10
    turned = np.einsum("tij,j,tkj,tk->ti", body.rotation, [0.02, 0.05, 0.04], body.rotation, body.angular_velocity)
    assert np.ptp(turned[late], axis=0).max() < 1e-9
    assert not run.at_once.reactions["force"][late][:, list(run.names.joints).index("J")].any()


def catapult() -> pt.Mechanism:
    """A beam with a counterweight, a sling and a shot that leaves it; the ground is 3 m below the axle."""
    m = pt.Mechanism("trebuchet", gravity=(0, -G, 0))
    beam = m.add_rod("beam", start=(-1.0, 0, 0), end=(3.0, 0, 0), mass=8.0)
    weight = m.add_body("weight", mass=120.0, inertia=(3, 3, 3), position=(-1.0, -0.8, 0))
    sling = m.add_rod("sling", start=(3.0, 0, 0), end=(1.0, 0, 0), mass=0.2)
    shot = m.add_body("shot", mass=1.5, inertia=(2e-3, 2e-3, 2e-3), position=(1.0, 0, 0))
    m.add_revolute("axle", m.ground, beam, point=(0, 0, 0))
    m.add_revolute("hanger", beam, weight, point=(-1.0, 0, 0))
    m.add_revolute("tip", beam, sling, point=(3.0, 0, 0))
    m.add_fixed("pouch", sling, shot)
    return m


@COORDINATES
def test_the_range_of_a_trebuchet_is_that_of_ballistics(coordinates: str) -> None:
    m = catapult()
    start = m.assemble({"axle": -0.7, "tip": 0.5})
    gate = pt.Event("release", "tip", value=2.6, direction=1, once=True, then=pt.Release("pouch"))
    height = pt.Along("ground", (0, -3.0, 0), (0, 1, 0), "shot", (0, 0, 0))
    lands = pt.Event("lands", height, direction=-1, then=pt.Stop(0.4))
    run = m.simulate(8.0, initial=start, coordinates=coordinates, events=[gate, lands], **TIGHT)
    assert run.success, run.message
    (away,) = run.events["release"]
    hit = run.events["lands"][0]
    thrown = m.simulate(away.t, initial=start, t_eval=[away.t], **TIGHT).body("shot")
    (x, y, _), (vx, vy, _) = thrown.position[0], thrown.velocity[0]
    flight = (vy + math.sqrt(vy**2 + 2.0 * G * (y + 3.0))) / G
    assert hit.t == pytest.approx(away.t + flight, rel=1e-10)
    i = int(np.argmax(run.t > hit.t))
    landed = run.body("shot").position[i, 0] - run.body("shot").velocity[i, 0] * (run.t[i] - hit.t)
    assert landed == pytest.approx(x + vx * flight, rel=1e-9)
    # it bounces as a ball does; nothing reaches the beam any more
    down = vy - G * flight
    assert hit.kind == "impact" and hit.energy_lost == pytest.approx(0.5 * 1.5 * down**2 * (1.0 - 0.16), rel=1e-9)
    assert hit.impulses["stop lands"].effort == pytest.approx(-1.5 * 1.4 * down, rel=1e-9)
    passed = [np.abs(hit.impulses[joint].force).max() for joint in ("axle", "hanger", "tip")]
    assert max(passed) < 1e-10 * abs(hit.impulses["stop lands"].effort) and not hit.impulses["pouch"].force.any()
    assert balanced(run)


@COORDINATES
def test_impulses_do_not_pass_a_joint_that_is_apart(coordinates: str) -> None:
    """The rocker of a four-bar that lost its pin hits a stop: the crank and the coupler go on."""
    m, alone = four_bar_without(), four_bar_without("A", "B", "C")
    start = m.assemble(rates={"A": 1.0})
    free = m.simulate(0.5, initial=start, events=[at(0.3, "C")], **TIGHT)
    angle = free.joint("D").angle
    side = 1 if angle[-1] > angle[free.t > 0.3][0] else -1
    stop = pt.Event("stop", "D", value=float(angle[-1]), direction=side, then=pt.Stop(0.5))
    run = m.simulate(1.0, initial=start, coordinates=coordinates, events=[at(0.3, "C"), stop], **TIGHT)
    hit = run.events["stop"][0]
    assert hit.kind == "impact" and hit.t == pytest.approx(0.5, abs=1e-9)
    assert max(np.abs(hit.impulses[joint].force).max() for joint in "AB") < 1e-12 < abs(hit.impulses["D"].force[0])
    assert not hit.impulses["C"].force.any() and not hit.impulses["C"].moment.any()
    assert hit.impulses["C"].determined.all()
    for joint in "AB":
        assert hit.after.velocity(joint) == pytest.approx(hit.before.velocity(joint), abs=1e-12)
    # a rod on its hinge: the impulse along the angle
    inertia = 1.5 * (0.2**2 + 0.8**2) / 3.0
    jump = hit.after.velocity("D") - hit.before.velocity("D")
    assert hit.impulses["stop stop"].effort == pytest.approx(inertia * jump, rel=1e-9)
    assert jump == pytest.approx(-1.5 * hit.before.velocity("D"), rel=1e-9)
    assert balanced(run) and alone.simulate(0.1).success


@COORDINATES
def test_parting_and_an_impact_at_one_instant(coordinates: str) -> None:
    """The bob leaves where the rod hits its stop: it keeps its velocity, and the rod bounces alone."""
    m = bob_on_a_rod()
    start = m.assemble({"A": -1.2})
    both = [
        pt.Event("stop", "A", value=0.2, direction=1, then=[pt.Stop(0.5), pt.Release("J")]),
        pt.Event("seen", "A", value=0.2, direction=1),
    ]
    run = m.simulate(1.0, initial=start, coordinates=coordinates, events=both, **TIGHT)
    first = next(record for record in run.events if record.kind == "impact")
    assert {record.kind for record in run.events if record.t == first.t} == {"impact", "release", "crossing"}
    rate = first.before.velocity("A")
    assert first.after.velocity("A") == pytest.approx(-0.5 * rate, rel=1e-10)
    assert first.impulses["stop stop"].effort == pytest.approx(-1.5 * rate / 3.0, rel=1e-9)
    assert not first.impulses["J"].force.any()
    i = int(np.argmax(run.t > first.t))
    velocity = run.body("bob").velocity[i] - DOWN * (run.t[i] - first.t)
    assert np.abs(velocity - rate * np.array([math.cos(0.2), math.sin(0.2), 0.0])).max() < 1e-9
    assert balanced(run)


@COORDINATES
def test_several_joints_part_one_after_the_other(coordinates: str) -> None:
    """A four-bar falls apart; what is parted stays parted, and a second time does nothing."""
    m = four_bar_without()
    start = m.assemble(rates={"A": 1.0})
    events = [
        at(0.2, "C", name="one"),
        at(0.4, "A", "C", name="two"),
        at(0.5, "A", "C", name="again"),
        at(0.6, "B", "D", name="last"),
    ]
    run = m.simulate(0.9, initial=start, coordinates=coordinates, events=events, **TIGHT)
    assert [(record.name, record.kind) for record in run.events] == [
        ("one", "release"),
        ("two", "release"),
        ("last", "release"),
    ]
    late = run.t > 0.6
    assert not run.at_once.reactions["force"][late].any() and balanced(run)
    i = int(np.argmax(late))
    s = (run.t[late] - run.t[i])[:, None]
    for name, length in (
        ("crank", math.hypot(0.3, 0.5)),
        ("coupler", math.hypot(0.9, 0.3)),
        ("rocker", math.hypot(0.2, 0.8)),
    ):
        body = run.body(name)
        arm = 0.5 * length * body.rotation[:, :, 0]
        centre = body.position + arm
        speed = body.velocity[i] + np.cross(body.angular_velocity[i], arm[i])
        assert np.abs(centre[late] - (centre[i] + speed * s + 0.5 * DOWN * s**2)).max() < 1e-9
    assert run.certificate.rank[-1] == 0
    backwards = m.simulate(0.9, initial=start, coordinates=coordinates, events=events[::-1], **TIGHT)
    assert np.abs(backwards.q[-1] - run.q[-1]).max() < 1e-12


def test_what_is_locked_anywhere_is_freed_not_parted() -> None:
    m = bob_on_a_rod("revolute")
    start = m.assemble({"A": -1.2})
    lock = pt.Event("lock", lambda t, state: t - 5.0, then=pt.Lock("J"))
    for more in ({"events": [at(0.3, "J"), lock]}, {"events": [at(0.3, "J")], "locked": ["J"]}):
        run = m.simulate(1.0, initial=start, **more, **TIGHT)
        assert run.success and run.joint("J").force[-1].any()
        assert list(run.names.coordinates) == ["A", "J"]


@COORDINATES
def test_a_run_goes_on_from_a_state_after_a_release(coordinates: str, tmp_path: Path) -> None:
    m = bob_on_a_rod("revolute")
    start = m.assemble({"A": -1.2}, rates={"J": 1.0})
    go = pt.Event("go", "A", value=0.3, direction=1, then=pt.Release("J"))
    options: dict[str, Any] = {"coordinates": coordinates, **TIGHT}
    whole = m.simulate(2.0, initial=start, events=[go], **options)
    one = m.simulate(1.0, initial=start, events=[go], **options)
    again = m.simulate(1.0, initial=one.state(), parted=["J"], events=[go], **options)
    assert again.success and not again.events and not again.joint("J").force.any()
    assert np.abs(again.q[-1] - whole.q[-1]).max() < 1e-11 and balanced(again)
    for initial in (pickle.loads(pickle.dumps(one.state())), one.state()):
        for other in ("relative", "absolute"):
            run = m.simulate(1.0, initial=initial, parted="J", coordinates=other, **TIGHT)
            assert np.abs(run.body("bob").position[-1] - whole.body("bob").position[-1]).max() < 1e-11
            with pytest.raises(ArgumentError, match=r"joint 'J' is apart .* parted=\['J'\]"):
                m.simulate(1.0, initial=initial, coordinates=other)
    with pytest.raises(ArgumentError, match="'J' is apart"):
        m.convert(one.state(), "relative")
    # before it parts the joint is closed: any run may start there
    before = whole.events[0].before
    plain = m.simulate(0.5, initial=before, coordinates=coordinates, **TIGHT)
    usual = m.simulate(before.t + 0.5, initial=start, coordinates=coordinates, **TIGHT)
    assert plain.success and np.abs(plain.q[-1] - usual.q[-1]).max() < 1e-9
    assert m.convert(before, "relative").position("J") == pytest.approx(before.position("J"), abs=1e-12)
    # stored
    for name in ("run.json", "run.nc"):
        whole.save(tmp_path / name)
        read = pt.load_result(tmp_path / name)
        assert (read.joint("J").force == whole.joint("J").force).all()
        assert (read.at_once.determined[0] == whole.at_once.determined[0]).all()
        assert read.events[0].kind == "release" and read.certificate.rank == whole.certificate.rank
        assert m.simulate(1.0, initial=read.state(), parted=["J"], **TIGHT).success


def test_parameters_change_a_run_that_parts() -> None:
    m = bob_on_a_rod()
    start = m.assemble({"A": -1.2})
    go = pt.Event("go", "A", value=0.3, direction=1, then=pt.Release("J"))
    run = m.simulate(1.5, initial=start, events=[go], parameters={"bob.mass": 2.0}, **TIGHT)
    inertia = 1.0 / 3.0 + 2.0 + 0.023
    rate = math.sqrt(2.0 * 2.5 * G * (math.cos(0.3) - math.cos(1.2)) / inertia)
    assert run.events[0].after.velocity("A") == pytest.approx(rate, rel=1e-10) and balanced(run)


@COORDINATES
def test_a_rod_that_spins_about_its_own_axis_cannot_be_parted(coordinates: str) -> None:
    """It has no inertia about it: how it goes on is not determined. At rest about it, it is."""
    m = pt.Mechanism("drum", gravity=(0, -G, 0))
    drum = m.add_body("drum", mass=1.0, inertia=(0.1, 0.1, 0.1))
    rod = m.add_rod("rod", start=(0, 0, 0), end=(0, 0, 1), mass=1.0)
    m.add_revolute("A", m.ground, drum, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_fixed("J", drum, rod)
    start = m.assemble(rates={"A": 3.0})
    run = m.simulate(1.0, initial=start, coordinates=coordinates, events=[at(0.5, "J")])
    assert not run.success and run.t[-1] <= 0.5 and "inertia" in run.message
    still = m.simulate(1.0, coordinates=coordinates, events=[at(0.5, "J")], **TIGHT)
    assert still.success and still.body("rod").position[-1, 1] == pytest.approx(-0.5 * G * 0.25, rel=1e-10)


def random_mechanism(rng: np.random.Generator, missing: str = "") -> pt.Mechanism:
    """Bodies in space, each on an earlier one by a joint of some kind, and a distance that closes a loop."""
    m = pt.Mechanism("random", gravity=(0.5, -2.0, -5.0))
    bodies: list[Any] = [m.ground]
    count = int(rng.integers(2, 5))
    for i in range(count):
        place = rng.uniform(-1.0, 1.0, 3)
        moments = rng.uniform(0.05, 0.1, 3)
        mass, com = float(rng.uniform(0.5, 2.0)), rng.uniform(-0.2, 0.2, 3)
        body = m.add_body(f"b{i}", mass=mass, com=com, inertia=moments, position=place)
        on = bodies[int(rng.integers(0, len(bodies)))]
        kind, point, axis = int(rng.integers(0, 4)), rng.uniform(-1.0, 1.0, 3), rng.uniform(-1.0, 1.0, 3)
        name = f"j{i}"
        if name != missing:
            add: Any = (m.add_revolute, m.add_cylindrical, m.add_spherical, m.add_prismatic)[kind]
            given: dict[str, Any] = {} if kind == 3 else {"point": point}
            add(name, on, body, **given, **({} if kind == 2 else {"axis": axis}))
        bodies.append(body)
    if rng.integers(0, 2):
        m.add_distance("link", bodies[0], (2.0, 0, 0), bodies[-1], bodies[-1].at((0.1, 0.2, 0)))
    return m


@pytest.mark.parametrize("seed", range(16))
def test_what_follows_is_the_motion_of_the_mechanism_without_the_joint(seed: int) -> None:
    m = random_mechanism(np.random.default_rng(seed))
    rng = np.random.default_rng(1000 + seed)
    lost = f"j{int(rng.integers(0, len(m.bodies)))}"
    rest = random_mechanism(np.random.default_rng(seed), lost)
    rates = {m.compile().velocity_names[0]: float(rng.uniform(-1.0, 1.0))}
    start = m.assemble(rates=rates)
    found = []
    for coordinates in ("relative", "absolute"):
        run = m.simulate(0.8, initial=start, coordinates=coordinates, events=[at(0.35, lost)], **TIGHT)
        assert run.success and balanced(run, 1e-8), (lost, run.message)
        found.append(run)
    relative, absolute = found
    for body in m.bodies:
        assert np.abs(relative.body(body).position - absolute.body(body).position).max() < 1e-8
    after = absolute.events[0].after
    assert after.names == rest.assemble(coordinates="absolute").names
    begin = pt.State(after.t, after.q, after.v, names=after.names, velocity_names=after.velocity_names)
    late = absolute.t > 0.35
    own = rest.simulate(0.45, initial=begin, coordinates="absolute", t_eval=absolute.t[late], **TIGHT)
    assert np.abs(own.q - absolute.q[late]).max() < 1e-8
    for joint in rest.joints:
        assert np.abs(own.joint(joint).force - relative.joint(joint).force[late]).max() < 1e-6


def chained(more: Callable[[pt.Mechanism], Any]) -> pt.Mechanism:
    m = bob_on_a_rod("revolute")
    more(m)
    return m


@pytest.mark.parametrize(
    ("more", "who"),
    [
        (lambda m: m.add_torsion_spring("spring", "J", stiffness=1.0), 'load "spring"'),
        (lambda m: m.add_friction("J", name="rub", dynamic=0.1, stick_velocity=0.01), 'load "rub"'),
        (lambda m: m.add_torque("J", 1.0, name="motor"), 'load "motor"'),
        (lambda m: m.add_drive("J", velocity=1.0, name="turner"), 'drive "turner"'),
        (lambda m: m.add_gear("gear", "A", "J", ratio=2.0), 'coupling "gear"'),
        (lambda m: m.add_rotor("rotor", "J", inertia=0.1, ratio=2.0), 'rotor "rotor"'),
    ],
)
def test_what_acts_along_a_joint_that_parts_is_refused_by_name(more: Any, who: str) -> None:
    with pytest.raises(DescriptionError, match="J") as raised:
        chained(more).simulate(1.0, events=[at(0.5, "J")])
    message = str(raised.value)
    assert 'event "go"' in message and '"J"' in message and who in message


def test_refused() -> None:
    m = bob_on_a_rod("revolute")
    with pytest.raises(UnknownNameError, match="nowhere"):
        m.simulate(1.0, events=[at(0.5, "nowhere")])
    stop = pt.Event("stop", "J", value=0.5, direction=1, then=pt.Stop())
    kick = pt.Event("kick", lambda t, state: t - 0.3, then=pt.SetRates({"J": 1.0}))
    for event in (stop, kick):
        with pytest.raises(DescriptionError, match=f'event "{event.name}".*"J".*event "go" parts'):
            m.simulate(1.0, events=[at(0.5, "J"), event])
    with pytest.raises(ArgumentError, match="'J' is both locked and parted"):
        m.simulate(1.0, parted=["J"], locked=["J"])
    with pytest.raises(UnknownNameError):
        m.simulate(1.0, parted=["nowhere"])
    with pytest.raises(ArgumentError, match="parted must be a list of joints"):
        m.simulate(1.0, parted=3)  # type: ignore[arg-type]
    pushed = m.add_sensor("pushed", "A", "force")
    with pytest.raises(DescriptionError, match=r'event "hard".*sensor of accelerations or forces'):
        m.simulate(1.0, events=[at(0.5, "J"), pt.Event("hard", pushed[1], value=3.0)])
    free = pt.Mechanism("free", gravity=(0, 0, -G))
    ball = free.add_body("ball", mass=1.0, inertia=(1, 1, 1))
    free.add_free("F", free.ground, ball)
    with pytest.raises(DescriptionError, match='"F", which constrains nothing'):
        free.simulate(1.0, events=[at(0.5, "F")])


def test_sensors_and_observing_events_go_on_across_a_release() -> None:
    m = four_bar(GENERAL)
    angle = m.add_sensor("angle", "C", "position")
    start = m.assemble()
    seen: list[float] = []

    def far(t: float, state: Any) -> float:
        seen.append(state.sensor("angle"))
        return float(state.position("C")) - 1e6

    run = m.simulate(1.0, initial=start, events=[at(0.4, "C"), pt.Event("far", far)], **TIGHT)
    assert run.success and np.isfinite(seen).all()
    assert np.abs(run.sensor(angle.name).values - run.joint("C").angle).max() < 1e-12
    bodies = [run.body(name).angular_velocity[:, 2] for name in m.bodies]
    rates = [a - b for a, b in itertools.permutations(bodies, 2)]
    late = run.t > 0.4
    assert min(np.abs(run.joint("C").velocity.ravel() - rate)[late].max() for rate in rates) < 1e-9


def test_the_example_meets_its_known_throws(capsys: pytest.CaptureFixture[str]) -> None:
    root = Path(__file__).parents[2]
    found = importlib.util.spec_from_file_location("trebuchet_example", root / "examples" / "trebuchet.py")
    assert found is not None and found.loader is not None
    example = importlib.util.module_from_spec(found)
    found.loader.exec_module(example)
    assert example.main() == 0
    lines = capsys.readouterr().out.splitlines()
    throws = [line.split() for line in lines[1:-1]]
    assert len(throws) == 3 and max(float(words[-1]) for words in throws) < 1e-10
    farthest = max(float(words[3]) for words in throws)
    assert f"throws {farthest:.0f} m" in (root / "docs" / "events.md").read_text("utf-8")
