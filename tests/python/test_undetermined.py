"""Loads that rigid bodies leave open: one rule shares them, whatever was chosen, cut or left out on the way."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.catalogue.bricard import AXES, POINTS

SAME = 1e-9
"""Two runs at rtol 1e-11 differ by some 1e-10 of the forces; the rule itself by round-off."""
TIGHT: dict[str, Any] = {"rtol": 1e-11, "atol": 1e-13, "t_eval": np.linspace(0.0, 1.0, 41)}


def bricard(
    cut: int | None = None,
    order: tuple[int, ...] = tuple(range(6)),
    scale: float = 1.0,
    turn: np.ndarray | None = None,
    shift: np.ndarray | None = None,
) -> pt.Mechanism:
    """The ring of six hinges, one of which may be cut, drawn in any order, size, place."""
    rotation = np.eye(3) if turn is None else turn
    origin = np.zeros(3) if shift is None else shift
    m = pt.Mechanism("ring", gravity=rotation @ (0.0, -9.81 * scale, 0.0))
    rods = ["ground"]
    for i in range(1, 6):
        edge = scale * (POINTS[i] - POINTS[i - 1])
        inertia = np.where(edge != 0.0, 2e-2, 1e-1) * scale**2
        com, at = edge / 2, origin + scale * rotation @ POINTS[i - 1]
        m.add_body(f"rod{i}", mass=1.0, inertia=inertia, com=com, position=at, orientation=rotation)
        rods.append(f"rod{i}")
    ends = [(rods[i], rods[i + 1]) for i in range(5)] + [("ground", "rod5")]
    for i in order:
        cutting = "auto" if cut is None else "always" if i == cut else "never"
        point, axis = origin + scale * rotation @ POINTS[i], rotation @ AXES[i]
        m.add_revolute(f"P{i}", *ends[i], point=point, axis=axis, cut=cutting)
    return m


def wrenches(run: pt.Result, turn: np.ndarray | None = None, scale: float = 1.0) -> np.ndarray:
    """(nt, joints by name, 6): force and moment, turned back and in units of the first size."""
    back = np.eye(3) if turn is None else turn
    names = sorted(run.names.joints)
    return np.stack(
        [np.hstack([run.joint(n).force @ back / scale, run.joint(n).moment @ back / scale**2]) for n in names], axis=1
    )


def about(axis: Any, angle: float) -> np.ndarray:
    """Rotation matrix."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


@pytest.fixture(scope="module")
def usual() -> pt.Result:
    return bricard().simulate(1.0, **TIGHT)


def test_the_same_whatever_is_cut_and_in_all_coordinates(usual: pt.Result) -> None:
    """Before there was a rule a ring's open reactions jumped by their whole size with the joint cut."""
    expected = wrenches(usual)
    size = np.abs(expected).max()
    for cut in range(6):
        run = bricard(cut).simulate(1.0, **TIGHT)
        np.testing.assert_allclose(wrenches(run), expected, atol=SAME * size)
    run = bricard().simulate(1.0, coordinates="absolute", **TIGHT)
    np.testing.assert_allclose(wrenches(run), expected, atol=SAME * size)
    other = run.reactions_by("augmented")
    for key in ("force", "moment"):
        np.testing.assert_allclose(other[key], run.at_once.reactions[key], atol=SAME * size)


def test_the_same_in_any_order_place_frame_and_unit(usual: pt.Result) -> None:
    expected = wrenches(usual)
    size = np.abs(expected).max()
    for order in ((5, 4, 3, 2, 1, 0), (2, 0, 4, 1, 5, 3)):
        run = bricard(order=order).simulate(1.0, **TIGHT)
        np.testing.assert_allclose(wrenches(run), expected, atol=SAME * size)
    turn, shift = about((1, 2, -1), 0.8), np.array([3.0, -1.0, 2.0])
    run = bricard(turn=turn, shift=shift).simulate(1.0, **TIGHT)
    np.testing.assert_allclose(wrenches(run, turn), expected, atol=SAME * size)
    for scale in (1e-6, 1e3):  # micrometres and kilometres
        run = bricard(scale=scale).simulate(1.0, **{**TIGHT, "atol": 1e-11})
        np.testing.assert_allclose(wrenches(run, scale=scale), expected, atol=10 * SAME * size)


def test_least_squares_over_all_joints(usual: pt.Result) -> None:
    """What is returned is perpendicular to all self-stresses in the metric, and determined parts are left alone."""
    found = wrenches(usual)
    for i in (0, 7, 40):
        base = usual.self_stresses(i)
        metric = np.array([1.0, 1.0, 1.0, *[base.length**-2.0] * 3])
        gram = np.einsum("ajc,bjc,c->ab", base.wrenches, base.wrenches, metric)
        np.testing.assert_allclose(gram, np.eye(len(base)), atol=1e-12)
        assert len(base) == 1 and base.joints == usual.names.joints
        np.testing.assert_allclose(
            np.einsum("ajc,jc,c->a", base.wrenches, found[i], metric), 0.0, atol=1e-10 * np.abs(found).max()
        )
    # the same base from another model of the ring
    again = bricard(3).simulate(1.0, coordinates="absolute", **TIGHT).self_stresses(7)
    np.testing.assert_allclose(again.wrenches, usual.self_stresses(7).wrenches, atol=1e-8)
    assert usual.certificate.newton_euler is not None and usual.certificate.newton_euler < 1e-12


def test_smooth_in_time_through_switches_and_renewals() -> None:
    """Second differences fall with the square of the step: nothing jumps where a coordinate or a row is switched."""
    m = bricard()
    start, tight = m.assemble(rates={"P0": 4.0}), {"rtol": 1e-11, "atol": 1e-13}
    bends: list[float] = []
    for nt in (201, 401):
        run = m.simulate(2.0, initial=start, switch_threshold=1.01, t_eval=np.linspace(0.0, 2.0, nt), **tight)
        assert run.certificate.switches > 0
        bends.append(np.abs(np.diff(wrenches(run), 2, axis=0)).max())
    assert 3.0 < bends[0] / bends[1] < 5.0
    fixed = m.simulate(2.0, initial=start, solver=pt.Solver("svd"), t_eval=np.linspace(0.0, 2.0, 401), **tight)
    np.testing.assert_allclose(wrenches(fixed), wrenches(run), atol=1e-7 * np.abs(wrenches(run)).max())


def four_bar(normal: str = "z", tilt: float = 0.0, axes: str = "ABCD") -> pt.Mechanism:
    """Four hinges in a plane, with a load across it on the coupler."""
    turn = about((1, 1, 0), tilt)
    m = pt.Mechanism("four-bar", gravity=turn @ (0, -9.81, 0))
    points = {"A": (0, 0, 0), "B": (0.15, 0.26, 0), "C": (0.84, 0.68, 0), "D": (1, 0, 0)}
    at = {k: turn @ np.array(p) for k, p in points.items()}
    for name, ends in (("crank", "AB"), ("coupler", "BC"), ("rocker", "DC")):
        middle = (at[ends[0]] + at[ends[1]]) / 2
        inertia = turn @ np.diag([0.02, 0.03, 0.04]) @ turn.T
        m.add_body(name, mass=0.5, inertia=inertia, position=middle)
    ends = {"A": ("ground", "crank"), "B": ("crank", "coupler"), "C": ("coupler", "rocker"), "D": ("ground", "rocker")}
    for name in axes:
        m.add_revolute(name, *ends[name], point=at[name], axis=turn @ (0, 0, 1))
    m.add_force("coupler", turn @ (0.0, 0.0, 3.0), point=(0.05, -0.02, 0.0))
    return m


def rows_of_hinges(run: pt.Result, m: pt.Mechanism, i: int) -> tuple[np.ndarray, np.ndarray]:
    """Balance of all bodies at output i by hand: equations (6 nb, 6 nj) for joint wrenches, and the free components."""
    spec = m.to_spec()
    bodies = [b["name"] for b in spec["bodies"]]
    equations = np.zeros((6 * len(bodies), 6 * len(spec["joints"])))
    free = np.zeros((len(spec["joints"]), 6 * len(spec["joints"])))
    for j, joint in enumerate(spec["joints"]):
        point = run.joint(joint["name"]).point[i]
        for body, sign in ((joint["child"], 1.0), (joint["parent"], -1.0)):
            if body == "ground":
                continue
            b = bodies.index(body)
            x, y, z = point - run.body(body).position[i]
            arm = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            equations[6 * b : 6 * b + 3, 6 * j : 6 * j + 3] = sign * np.eye(3)
            equations[6 * b + 3 : 6 * b + 6, 6 * j : 6 * j + 6] = sign * np.hstack([arm, np.eye(3)])
        free[j, 6 * j + 3 : 6 * j + 6] = run.at_once.reactions["joint_rotation"][i, j][:, 2]
    return equations, free


@pytest.mark.parametrize("tilt", [0.0, 0.7])
@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_across_the_plane_too(tilt: float, coordinates: str) -> None:
    """A planar four-bar loaded across its plane, against least squares by hand.

    By hand: the balance of each body is linear in the wrenches of the joints, those along a hinge's axis are zero; of
    all solutions the least, with moments over the length. What the bodies need is read off the returned wrenches, and
    the Newton-Euler residual holds these to the motion.
    """
    m = four_bar(tilt=tilt)
    run = m.simulate(0.5, initial=m.assemble(rates={"A": 2.0}), coordinates=coordinates, t_eval=(0.0, 0.3, 0.5))
    assert run.certificate.newton_euler is not None and run.certificate.newton_euler < 1e-11
    assert run.summary["planar"]
    length = run.self_stresses().length
    per = np.tile([1.0, 1.0, 1.0, length, length, length], 4)
    for i in range(3):
        found = np.stack([np.hstack([run.joint(n).force[i], run.joint(n).moment[i]]) for n in "ABCD"]).reshape(-1)
        equations, free = rows_of_hinges(run, m, i)
        rows = np.vstack([equations, free]) * per
        least = per * np.linalg.lstsq(rows, np.vstack([equations, free]) @ found, rcond=1e-11)[0]
        np.testing.assert_allclose(found, least, atol=1e-9 * np.abs(found).max())
        assert len(run.self_stresses(i)) == 3


def test_relative_and_absolute_agree_across_the_plane() -> None:
    m = four_bar(tilt=0.3)
    start = m.assemble(rates={"A": 2.0})
    runs = [m.simulate(0.5, initial=start, coordinates=c, rtol=1e-11, atol=1e-13) for c in ("relative", "absolute")]
    one, other = (wrenches(run) for run in runs)
    np.testing.assert_allclose(one, other, atol=SAME * np.abs(one).max())


def door(**compliance: Any) -> pt.Mechanism:
    m = pt.Mechanism("door", gravity=(0, 0, -9.81))
    leaf = m.add_body("leaf", mass=20.0, inertia=(5.3, 4.3, 1.1), com=(0.4, 0, 0))
    for name, z in (("low", -0.8), ("middle", 0.1), ("high", 0.8)):
        m.add_revolute(name, m.ground, leaf, point=(0, 0, z))
        if name in compliance:
            m.add_compliance(name, **compliance[name])
    return m


def test_a_door_on_three_elastic_hinges(tmp_path: Path) -> None:
    """Rigid leaf on springs, by hand: displacement x of the leaf from K x = load, forces from it."""
    soft = {"low": 1e-8, "middle": 4e-8, "high": 2e-8}
    bend = {"low": 3e-7, "middle": 1e-7, "high": 2e-7}
    m = door(**{k: {"translation": soft[k], "rotation": bend[k]} for k in soft})
    run = m.simulate(0.1, t_eval=(0.0,))
    stiffness, load = np.zeros((6, 6)), np.array([0, 0, -196.2, 0, 196.2 * 0.4, 0.0])
    maps = {}
    for name, z in (("low", -0.8), ("middle", 0.1), ("high", 0.8)):
        to_point = np.eye(6)
        to_point[:3, 3:] = -np.array([[0, -z, 0], [z, 0, 0], [0, 0, 0]])
        k = np.diag([1 / soft[name]] * 3 + [1 / bend[name]] * 2 + [0.0])
        maps[name] = k @ to_point
        stiffness += to_point.T @ maps[name]
    stiffness[5, 5] = 1.0
    x = np.linalg.solve(stiffness, load)
    for name in soft:
        user_defined = -maps[name] @ x
        found = np.hstack([run.joint(name).force[0], run.joint(name).moment[0]])
        np.testing.assert_allclose(found, user_defined, atol=1e-7)
    m.save(tmp_path / "door.toml")
    again = pt.load(tmp_path / "door.toml").simulate(0.1, t_eval=(0.0,))
    np.testing.assert_array_equal(again.at_once.reactions["force"], run.at_once.reactions["force"])
    # what is not said to give counts as rigid and carries what it can alone
    run = door(low={"translation": 1e-8, "rotation": 1e-7}, high={"translation": 1e-8, "rotation": 1e-7}).simulate(0.1)
    assert abs(run.joint("middle").force[0, 2] - 196.2) < 1e-3
    # without any: each the third part
    plain = door().simulate(0.1)
    for name in soft:
        assert abs(plain.joint(name).force[0, 2] - 65.4) < 1e-9


def test_bad_compliances() -> None:
    m = door()
    for given, words in (
        ({"translation": -1.0}, "at least 0"),
        ({"translation": (1.0, -1.0, 0.0)}, "must not be negative"),
        ({}, "all entries are 0"),
        ({"rotation": np.nan}, "finite"),
    ):
        with pytest.raises(pt.errors.DescriptionError, match=words):
            m.add_compliance("low", **given)
    with pytest.raises(pt.errors.UnknownNameError, match="low"):
        m.add_compliance("lov", translation=1.0)


def test_two_motors_on_one_degree_of_freedom() -> None:
    """A shaft turned at both ends: which motor does the work is open, that together they do it is not."""
    m = pt.Mechanism("shaft", gravity=(0, 0, 0))
    m.add_body("shaft", mass=1.0, inertia=(1.0, 1.0, 0.5))
    for name, z in (("left", -0.5), ("right", 0.5)):
        m.add_revolute(name, m.ground, "shaft", point=(0, 0, z))
    m.add_drive("left", position=lambda t: 0.5 * t * t)
    one = m.simulate(0.5)
    assert one.joint("left").drive_determined.all() and one.joint("right").drive_determined.all()
    assert abs(one.joint("left").drive[-1, 0] - 0.5) < 1e-9
    # a parallelogram both of whose cranks are driven alike
    m = pt.Mechanism("parallelogram")
    points = {"A": (0, 0, 0), "B": (0.3, 0.4, 0), "C": (1.3, 0.4, 0), "D": (1, 0, 0)}
    for name, ends in (("crank", "AB"), ("coupler", "BC"), ("rocker", "DC")):
        m.add_rod(name, start=points[ends[0]], end=points[ends[1]], mass=1.0)
    ends = {"A": ("ground", "crank"), "B": ("crank", "coupler"), "C": ("coupler", "rocker"), "D": ("ground", "rocker")}
    for name, bodies in ends.items():
        m.add_revolute(name, *bodies, point=points[name])
    m.add_drive("A", position=lambda t: 0.3 * t * t, name="first")
    alone = m.simulate(0.5, rtol=1e-11)
    m.add_drive("D", position=lambda t: 0.3 * t * t, name="second")
    both = m.simulate(0.5, rtol=1e-11)
    work = alone.joint("A").drive[:, 0]
    for name in "AD":
        assert not both.joint(name).drive_determined.any()
    assert both.joint("B").drive_determined.all()
    base = both.self_stresses(5)
    assert base.drives == ("first", "second") and (np.abs(base.efforts).max(axis=0) > 1e-3).all()
    # both turn alike, so that the sum does the work of the one motor; of the shares neither is nothing
    shares = np.stack([both.joint(name).drive[:, 0] for name in "AD"])
    np.testing.assert_allclose(shares.sum(axis=0), work, atol=1e-8 * np.abs(work).max())
    assert np.abs(shares).min() > 0.1 * np.abs(work).min()
    absolute = [both.joint(name).determined_at for name in "BC"]
    assert all(flags.shape == (len(both.t), 6) for flags in absolute)


def test_directions_in_the_joints_own_axes() -> None:
    """Two tilted guides: across them all is open, along them nothing; in no axis of the world is a force unique."""
    m = pt.Mechanism("guides", gravity=(0, -9.81, 0))
    m.add_body("block", mass=1.0, inertia=(1, 1, 1))
    for name, y in (("low", -1.0), ("high", 1.0)):
        m.add_prismatic(name, m.ground, "block", point=(0, y, 0), axis=(3, 4, 0))
    joint = m.simulate(0.1).joint("low")
    assert not joint.determined[:2].any()
    found = joint.directions()
    np.testing.assert_allclose(np.abs(found.forces_determined @ (0.6, 0.8, 0)), 1.0)
    for open_, determined in ((found.forces_open, found.forces_determined), (found.moments_open, found[3])):
        both = np.vstack([open_, determined])
        np.testing.assert_allclose(both @ both.T, np.eye(3), atol=1e-12)
    own = joint.in_frame("joint").directions()
    assert np.allclose(np.abs(own.forces_determined), (0, 0, 1))
    tree = pt.catalogue.load("planar-pendulum").simulate(0.1)
    assert len(tree.joint(tree.names.joints[0]).directions().forces_open) == 0
    assert len(tree.self_stresses()) == 0


def test_multipliers_of_an_instant_follow_the_rule() -> None:
    """Of the same ring cut at the same joint: multipliers do not depend on which rows were kept, and still balance."""
    m = bricard(2)
    state = m.assemble(targets={"P0": 0.3}, rates={"P0": 1.0})
    model = m.compile()
    found = model.at(state.q, state.v)
    np.testing.assert_allclose(found.M @ found.vdot, found.h + found.C.T @ found.multipliers, atol=1e-10)
    run = m.simulate(0.0 + 1e-3, initial=state, t_eval=(0.0,))
    rows = found.C.T @ np.diag(np.ones(len(found.multipliers)))
    _, sizes, right = np.linalg.svd(rows)
    null = right[np.sum(sizes > 1e-9) :]
    # the cut joint's force is that of the run
    force = np.array([x for x, name in zip(found.multipliers, model.summary["rows_names"], strict=True)][:3])
    assert len(null) == 1
    np.testing.assert_allclose(np.linalg.norm(force), np.linalg.norm(run.joint("P2").force[0]), rtol=1e-9)


def test_stored_results_report_the_same(tmp_path: Path) -> None:
    run = bricard().simulate(0.1)
    run.save(tmp_path / "run.json")
    again = pt.results.load_result(tmp_path / "run.json")
    np.testing.assert_array_equal(again.joint("P1").force, run.joint("P1").force)
    assert again.joint("P1").drive_determined.tolist() == run.joint("P1").drive_determined.tolist()
    for ask in (again.self_stresses, again.joint("P1").directions):
        with pytest.raises(pt.errors.ArgumentError, match="stored result"):
            ask()
    with pytest.raises(pt.errors.ArgumentError, match="no output"):
        run.self_stresses(10**6)


def test_every_order_of_three_hinges() -> None:
    """A door on three hinges, described in every order."""
    shares = []
    for order in permutations((-0.8, 0.1, 0.8)):
        m = pt.Mechanism("door", gravity=(0, 0, -9.81))
        leaf = m.add_body("leaf", mass=20.0, inertia=(5.3, 4.3, 1.1), com=(0.4, 0, 0))
        for z in order:
            m.add_revolute(f"{z}", m.ground, leaf, point=(0, 0, z))
        shares.append(wrenches(m.simulate(0.2, t_eval=(0.0, 0.2)))[-1])
    for share in shares[1:]:
        np.testing.assert_allclose(share, shares[0], atol=1e-9)


@pytest.mark.parametrize("tilt", [0.0, 1e-7, 1e-6, 1e-5, 3e-5, 1e-4, 1e-2])
def test_a_hinge_line_that_leans_a_little_leaves_what_it_held_determined(tilt: float) -> None:
    """Two sleeves and a ball on one line: only the ball holds along it, however little the line leans from an axis.

    The ball's rows across the line are then small multiples of its row along it.
    """
    line = np.array([0.0, np.sin(tilt), np.cos(tilt)])
    m = pt.Mechanism("door", gravity=(0.0, 0.0, -10.0))
    m.add_body("door", mass=2.0, inertia=(0.1, 0.2, 0.3), com=(0.5, 0.1, 0.2))
    for name, height in (("low", -0.5), ("high", 0.5)):
        m.add_cylindrical(name, m.ground, "door", point=height * line, axis=line)
    m.add_spherical("ball", m.ground, "door", point=0.2 * line)
    run = m.simulate(0.3, initial=m.assemble(rates={"low": (0.0, 2.0)}), rtol=1e-10)
    assert run.success and run.self_stresses(0).wrenches.shape[0] == 6
    for name in ("low", "high"):
        along = run.joint(name).force @ line
        assert np.abs(along).max() < 1e-13 and run.joint(name).in_frame("joint").determined[2], name
    ball = run.joint("ball").force @ line
    assert np.allclose(ball, 20.0 * np.cos(tilt), rtol=0.0, atol=1e-12)
    assert max(np.abs(run.self_stresses(i).joint("ball")[:, :3] @ line).max() for i in range(len(run.t))) < 1e-13


def wheels(order: int, lateral: float = 0.9) -> pt.Mechanism:
    """Two on one axle, hinged to each other; both roll, so that both hold the axle sideways."""
    m = pt.Mechanism("wheels", gravity=(0.0, -9.81, lateral))
    for name, z in (("a", -0.2), ("b", 0.2))[::order]:
        mass = 1.5 if name == "b" else 1.0
        m.add_body(name, mass=mass, inertia=(0.01, 0.01, 0.02), position=(0, 0.2, z))
    parts: list[Callable[[], object]] = [
        lambda: m.add_rolling("ra", "a", radius=0.2),
        lambda: m.add_rolling("rb", "b", radius=0.2),
        lambda: m.add_revolute("H", "a", "b", point=(0.0, 0.2, 0.0), axis=(0, 0, 1)),
    ]
    for add in parts[::order]:
        add()
    return m


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("order", [1, -1])
def test_what_couplings_alone_leave_open_is_shared_by_the_rule(order: int, coordinates: str) -> None:
    """No joint closes a loop: rolling without slip holds each wheel sideways, and the axle carries any part of it."""
    run = wheels(order).simulate(0.1, t_eval=[0.0, 0.1], coordinates=coordinates)
    hinge = run.joint("H")
    fz, mx = hinge.force[-1][2], hinge.moment[-1][0]
    stresses = run.self_stresses()
    assert len(stresses) == 1 and not hinge.determined[[2, 3]].any()
    # balance of b about the axle: mx = -0.2 fz - 0.045, whatever share F of the lateral load its foot takes (its normal
    # force is 15.84 N); of these the least fz^2 + (mx / L)^2 with L^2 = 0.1 m^2
    assert stresses.length == pytest.approx(math.sqrt(0.1), rel=1e-12)
    assert [fz, mx] == pytest.approx([-0.09 / 1.4, -0.045 / 1.4], rel=1e-9)


Gradients = dict[str, tuple[float, float, float]]


def ring_of_gears(m: pt.Mechanism, order: int) -> tuple[Gradients, list[float]]:
    """Three shafts, each geared to both others: the gradients of the gears and the inertias."""
    for i in range(3)[::order]:
        m.add_body(f"w{i}", mass=1.0 + i, inertia=(0.1, 0.1, 0.02 * (i + 1)), position=(0.5 * i, 0, 0))
        m.add_revolute(f"P{i}", m.ground, f"w{i}", point=(0.5 * i, 0, 0))
    for name, ratio in (("01", -2.0), ("12", -0.5), ("02", 1.0))[::order]:
        m.add_gear(f"P{name[0]}", f"P{name[1]}", ratio=ratio, name=name)
    gradients = {"01": (2.0, 1.0, 0.0), "12": (0.0, 0.5, 1.0), "02": (-1.0, 0.0, 1.0)}
    return gradients, [0.02, 0.04, 0.06]


def coupled_slides(m: pt.Mechanism, order: int) -> tuple[Gradients, list[float]]:
    """Three slides and four couplers, of which two would do."""
    for i in range(3)[::order]:
        m.add_body(f"w{i}", mass=1.0 + i, inertia=(0.1, 0.1, 0.1), position=(0, 0.3 * i, 0))
        m.add_prismatic(f"P{i}", m.ground, f"w{i}", point=(0, 0.3 * i, 0), axis=(1, 0, 0))
    gradients = {"01": (1.0, -1.0, 0.0), "12": (0.0, 1.0, -2.0), "02": (3.0, 0.0, -6.0), "all": (1.0, 1.0, -4.0)}
    for name in [*gradients][::order]:
        chosen = [i for i in range(3) if gradients[name][i]]
        m.add_coupler(name, [f"P{i}" for i in chosen], [gradients[name][i] for i in chosen])
    return gradients, [1.0, 2.0, 3.0]


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("draw", [ring_of_gears, coupled_slides])
def test_what_no_joint_feels_is_shared_by_what_couplings_exert(draw: Any, order: int, coordinates: str) -> None:
    """Efforts e of conditions with gradients g put g e on the shafts. Of all that move them so, those with the least
    sum of |g e|^2, whatever was added first, and however long a gradient is."""
    m = pt.Mechanism("coupled", gravity=None)
    gradients, inertias = draw(m, order)
    m.add_torque("P0", 1.3)
    run = m.simulate(0.1, t_eval=[0.0, 0.1], coordinates=coordinates)
    assert run.success
    g = np.array([gradients[name] for name in gradients]).T
    _, _, rows = np.linalg.svd(g.T)
    free = rows[-1]  # the motion that the couplings leave
    change = free * (1.3 * free[0]) / (free * inertias @ free)
    needed = change * inertias - [1.3, 0.0, 0.0]
    sizes = np.linalg.norm(g, axis=0)
    right = np.linalg.lstsq(g / sizes, needed, rcond=1e-10)[0] / sizes
    for name, effort in zip(gradients, right, strict=True):
        found = run.coupling(name)
        assert found.effort[-1].item() == pytest.approx(effort, abs=1e-9) and not np.any(found.determined)
    # and of one instant, by the equations of the shafts
    if coordinates == "relative":
        model, state = m.compile(), m.assemble()
        instant = model.at(state.q, state.v, 0.0)
        assert sorted(instant.multipliers) == pytest.approx(sorted(right), abs=1e-9)
