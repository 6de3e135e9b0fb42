"""Thousands of poses in one call: each on the branch of one state, or reported with what is missing."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from typing import Any

import numpy as np
import pytest
from drawings import four_bar, parallelogram
from moved_drawings import as_typed
from numpy.typing import NDArray
from test_large import pressed_after

import partita as pt
from partita.errors import ArgumentError, AssemblyError, UnknownNameError
from partita.mechanism.poses import Poses

Array = NDArray[np.float64]

POINTS = {"a": (0.0, 0.0), "b": (-0.3, 0.8), "c": (0.5, 1.7), "d": (1.3, 0.8), "e": (1.0, 0.0)}


def five_bar(scale: float = 1.0, askew: float = 0.0) -> pt.Mechanism:
    """Two motors on the ground, A and E; two rods that meet at C. `askew`: axes this far from parallel [rad]."""
    m = pt.Mechanism("five-bar")
    at = {name: scale * np.array([*p, 0.0]) for name, p in POINTS.items()}
    rods = {n: m.add_rod(n, start=at[n[0]], end=at[n[1]], mass=1.0) for n in ("ab", "bc", "dc", "ed")}
    axes = [(0, 0, 1), (askew, 0, 1), (0, 0, 1), (0, askew, 1), (0, 0, 1)]
    joints = (("A", m.ground, "ab"), ("B", "ab", "bc"), ("C", "bc", "dc"), ("D", "ed", "dc"), ("E", m.ground, "ed"))
    for (name, parent, child), axis in zip(joints, axes, strict=True):
        m.add_revolute(name, rods.get(parent, m.ground), rods[child], point=at[name.lower()], axis=axis)
    return m


def turned(x: Array, angle: Array) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * x[0] - s * x[1], s * x[0] + c * x[1]], axis=-1)


def pins(angles: Array, side: float) -> tuple[Array, Array]:
    """Where C is, right or left of the way from B to D, for motors turned by `angles` (n, 2), NaN where BC and DC do
    not meet; and by how much they miss each other."""
    p = {name: np.array(x) for name, x in POINTS.items()}
    b = p["a"] + turned(p["b"] - p["a"], angles[:, 0])
    d = p["e"] + turned(p["d"] - p["e"], angles[:, 1])
    r, s = np.linalg.norm(p["c"] - p["b"]), np.linalg.norm(p["c"] - p["d"])
    offset = d - b
    far = np.linalg.norm(offset, axis=1)
    along = (far**2 + r**2 - s**2) / (2 * far)
    with np.errstate(invalid="ignore"):
        across = side * np.sqrt(r**2 - along**2)
    normal = np.stack([-offset[:, 1], offset[:, 0]], axis=1)
    c = b + (along[:, None] * offset + across[:, None] * normal) / far[:, None]
    return c, np.maximum(far - (r + s), abs(r - s) - far)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e3])
def test_five_bar_against_its_closed_form(scale: float) -> None:
    """Each pose where its two rods meet, on the side of the drawing; the others open by what the rods are too short."""
    angles = np.random.default_rng(7).uniform(-1.3, 1.3, (500, 2))
    m = five_bar(scale)
    poses = m.assemble_many({"A": angles[:, 0], "E": angles[:, 1]})
    expected, missing = pins(angles, 1.0)
    assert np.array_equal(poses.ok, missing < 0) and 20 < np.sum(~poses.ok) < 250
    c = poses.body("bc").point((scale * np.hypot(0.8, 0.9), 0, 0))[:, :2]
    np.testing.assert_allclose(c[poses.ok] / scale, expected[poses.ok], rtol=0, atol=2e-12)
    np.testing.assert_allclose(poses.shortfall[~poses.ok] / scale, missing[~poses.ok], rtol=1e-9, atol=1e-12)
    assert set(poses.status) == {"closed", "open"} and np.isnan(poses.q[~poses.ok]).all()
    assert poses.q[poses.ok][:, poses.names.index("A")].tolist() == angles[poses.ok, 0].tolist()
    i = next(iter(poses.reasons))
    for word in ('"B"', '"C"', '"D"', f"A = {angles[i, 0]:.6f}", f"E = {angles[i, 1]:.6f}", "keeps a closure error of"):
        assert word in poses.reasons[i]
    # the straight way ends where the rods just reach
    ends = np.stack([poses.reached["A"], poses.reached["E"]], axis=1)[~poses.ok]
    assert np.abs(pins(ends, 1.0)[1]).max() < 1e-5


def test_the_other_branch_by_name_and_by_state() -> None:
    m = five_bar()
    angles = np.random.default_rng(8).uniform(-0.5, 0.5, (50, 2))
    targets = {"A": angles[:, 0], "E": angles[:, 1]}
    here, there = m.assemblies(inputs=["A", "E"])
    assert {here.branch, there.branch} == {"+", "-"}
    for one, side in ((here, 1.0), (there, -1.0)):
        expected = pins(angles, side)[0]
        by_state, by_name = m.assemble_many(targets, near=one.state), m.assemble_many(targets, branch=one.branch)
        for poses in (by_state, by_name):
            assert poses.ok.all()
            c = poses.body("bc").point((np.hypot(0.8, 0.9), 0, 0))[:, :2]
            np.testing.assert_allclose(c, expected, rtol=0, atol=1e-12)
            assert poses.branch is not None and list(poses.branch.values()) == [1 if one.branch == "+" else -1]
        single = m.assemble({"A": angles[0, 0], "E": angles[0, 1]}, branch=one.branch)
        assert single.q == pytest.approx(by_name.q[0], abs=1e-13)
    # the name is that of the same side wherever the motors stand
    for i in range(5):
        assert m.assemblies(near=m.assemble_many(targets)[i], inputs=["A", "E"])[0].branch == here.branch
    with pytest.raises(ArgumentError, match=r"no branch '\+-'.*RRR dyad"):
        m.assemble_many(targets, branch="+-")
    with pytest.raises(ArgumentError, match="must be signs"):
        m.assemble({"A": 0.1}, branch="up")


def ankle(scale: float = 1.0, ball: bool = True, solid: float = 0.0) -> pt.Mechanism:
    """A platform on a universal joint, moved by two cranks and two rods in space, slender or solid."""
    m = pt.Mechanism("ankle")
    p = m.add_body("platform", mass=1, inertia=(0.01, 0.01, 0.01))
    m.add_universal("U", m.ground, p, point=(0, 0, 0), axis1=(1, 0, 0), axis2=(0, 1, 0))
    for side, name in ((1, "L"), (-1, "R")):
        c, e, f = (scale * x for x in leg(side))
        crank = m.add_rod("crank" + name, start=c, end=e, mass=0.1)
        m.add_revolute("M" + name, m.ground, crank, point=c, axis=(0, 1, 0))
        if solid:
            rod = m.add_body("rod" + name, mass=0.1, inertia=(solid,) * 3, position=(e + f) / 2)
        else:
            rod = m.add_rod("rod" + name, start=e, end=f, mass=0.1)
        m.add_spherical("S" + name, crank, rod, point=e)
        if ball:
            m.add_spherical("T" + name, rod, p, point=f)
        else:
            m.add_universal("T" + name, rod, p, point=f, axis1=(1, 0, 0), axis2=(0, 1, 0))
    return m


def leg(side: int) -> tuple[Array, Array, Array]:
    """Motor, crank's end and platform's point of one side."""
    c = np.array([-0.05, 0.06 * side, 0.25])
    return c, c + np.array([-0.05, 0, 0]), np.array([-0.06, 0.05 * side, 0.02])


def about(axis: int, angle: Array) -> Array:
    """Rotations (n, 3, 3) about x or y."""
    r = np.zeros((len(angle), 3, 3))
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    r[:, axis, axis] = 1.0
    r[:, i, i] = r[:, j, j] = np.cos(angle)
    r[:, i, j], r[:, j, i] = -np.sin(angle), np.sin(angle)
    return r


def gaps(u: Array, motors: Array) -> Array:
    """By how much the rods are stretched (n, 2), for angles of the universal joint and of the motors."""
    turn = about(0, u[:, 0]) @ about(1, u[:, 1])
    found = []
    for k, side in enumerate((1, -1)):
        c, e, f = leg(side)
        crank = c + about(1, motors[:, k]) @ (e - c)
        found.append(np.linalg.norm(turn @ f - crank, axis=1) - np.linalg.norm(f - e))
    return np.stack(found, axis=1)


def slopes(u: Array, motors: Array) -> Array:
    """Determinants (n,) of the derivatives of `gaps` by the universal joint: their sign is the branch."""
    h = 1e-6
    d = [(gaps(u + h * e, motors) - gaps(u - h * e, motors)) / (2 * h) for e in np.eye(2)]
    return d[0][:, 0] * d[1][:, 1] - d[0][:, 1] * d[1][:, 0]


@pytest.mark.parametrize(("scale", "ball"), [(1.0, True), (1.0, False), (1e-5, True), (1e4, False)])
def test_an_ankle_against_its_rods(scale: float, ball: bool) -> None:
    """No closed form from the motors: the rods have their lengths, and the determinant its sign, at every pose."""
    motors = np.random.default_rng(3).uniform(-1.1, 1.1, (300, 2))
    m = ankle(scale, ball)
    poses = m.assemble_many({"ML": motors[:, 0], "MR": motors[:, 1]})
    assert poses.branch is None and 200 < poses.ok.sum() < 300
    u = poses.joint("U")
    np.testing.assert_allclose(gaps(u[poses.ok], motors[poses.ok]), 0.0, atol=1e-13)
    drawn = slopes(np.zeros((1, 2)), np.zeros((1, 2)))
    assert np.all(np.sign(slopes(u[poses.ok], motors[poses.ok])) == np.sign(drawn))
    # each is where a walk in small steps leads that only looks at the gaps
    some = np.flatnonzero(poses.ok)[:20]
    here = np.zeros((len(some), 2))
    for part in np.linspace(0, 1, 101)[1:]:
        here = newton(here, part * motors[some])
    np.testing.assert_allclose(u[some], here, atol=1e-10)
    # the rest is open: nowhere on the branch, nor near it, do the rods have their lengths
    for i in np.flatnonzero(~poses.ok)[:10]:
        assert poses.status[i] in ("open", "other branch")
        assert "U" in poses.reasons[i] and "ML" in poses.reasons[i]
        end = np.array([poses.reached["ML"][i], poses.reached["MR"][i]])
        assert np.all((end - 0.0) * motors[i] >= 0) and np.all(np.abs(end) < np.abs(motors[i]))
    for i in np.flatnonzero(poses.status == "open")[:5]:
        grid = np.linspace(-1.5, 1.5, 121)
        all_u = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
        worst = np.abs(gaps(all_u, np.broadcast_to(motors[i], all_u.shape))).max(axis=1)
        best = newton(all_u[np.argsort(worst)[:40]], np.broadcast_to(motors[i], (40, 2)))
        left = np.abs(gaps(best, np.broadcast_to(motors[i], (40, 2)))).max(axis=1)
        closed = best[(left < 1e-12) & (np.sign(slopes(best, np.broadcast_to(motors[i], (40, 2)))) == np.sign(drawn))]
        assert len(closed[np.abs(closed).max(axis=1) < 1.0]) == 0
        assert poses.shortfall[i] > 0


def newton(u: Array, motors: Array) -> Array:
    """`gaps` closed from u; rows of NaN where that leads nowhere."""
    h = 1e-6
    for _ in range(8):
        d = np.stack([(gaps(u + h * e, motors) - gaps(u - h * e, motors)) / (2 * h) for e in np.eye(2)], axis=-1)
        step = np.linalg.solve(d, gaps(u, motors)[..., None])[..., 0]
        u = u - step * np.minimum(1.0, 0.3 / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-300))
    return u


@as_typed
@pytest.mark.parametrize("name", ["five-bar", "ankle"])
def test_each_pose_depends_on_itself_alone(name: str) -> None:
    """Not on the others, on their order, nor on how many cores share them."""
    m, joints = (five_bar(), ("A", "E")) if name == "five-bar" else (ankle(), ("ML", "MR"))
    angles = np.random.default_rng(5).uniform(-1.2, 1.2, (600, 2))

    def ask(which: Any) -> Poses:
        return m.assemble_many({joint: angles[which, k] for k, joint in enumerate(joints)})

    whole = ask(slice(None))
    order = np.random.default_rng(6).permutation(len(angles))
    mixed = ask(order)
    for what in ("q", "status", "shortfall", "shortfall_angle", "detour"):
        np.testing.assert_array_equal(getattr(whole, what)[order], getattr(mixed, what))
    for i in (0, 17, 599):
        np.testing.assert_array_equal(ask([i]).q[0], whole.q[i])
    assert {int(order[i]): words for i, words in mixed.reasons.items()} == whole.reasons
    code = (
        "import os, sys; os.sched_setaffinity(0, {0}); sys.path.insert(0, sys.argv[1])\n"
        "import numpy as np, test_assemble_many as x\n"
        f"m = x.{'five_bar' if name == 'five-bar' else 'ankle'}()\n"
        "a = np.random.default_rng(5).uniform(-1.2, 1.2, (600, 2))\n"
        f"sys.stdout.write(m.assemble_many({{'{joints[0]}': a[:, 0], '{joints[1]}': a[:, 1]}}).q.tobytes().hex())"
    )
    if hasattr(os, "sched_setaffinity"):
        here = os.path.dirname(__file__)
        one_core = subprocess.run([sys.executable, "-c", code, here], capture_output=True, text=True, check=True)
        assert one_core.stdout == whole.q.tobytes().hex()


def test_many_turns_are_counted_along() -> None:
    """A crank turned five times takes the joints that turn with it along, as a walk there does."""
    m = pt.catalogue.load("grashof-four-bar")
    crank = m.compile().names[0]
    angles = np.array([-31.0, 0.3, 9.0, 31.0])
    poses = m.assemble_many({crank: angles})
    for i, angle in enumerate(angles):
        state = None
        for part in np.linspace(0, angle, int(abs(angle) / 0.2) + 2)[1:]:
            state = m.assemble({crank: part}, near=state)
        assert state is not None
        np.testing.assert_allclose(poses.q[i], state.q, rtol=0, atol=1e-11)


def test_joints_that_close_loops_and_points() -> None:
    """Any joint and any point serves: the poses are those that `assemble` finds one by one."""
    m = five_bar()
    c = np.hypot(0.8, 0.9)
    points = np.array([[0.5, 1.7], [0.6, 1.5], [0.3, 1.6], [0.5, 0.9], [0.5, 2.6]])
    poses = m.assemble_many({("bc", (c, 0, 0), "xy"): points})
    assert poses.ok.tolist() == [True, True, True, True, False]
    np.testing.assert_allclose(poses.body("bc").point((c, 0, 0))[:4, :2], points[:4], rtol=0, atol=1e-12)
    assert "point (1.20416, 0, 0) of bc in y" in poses.reasons[4]
    # the same in whole, the component that the plane leaves no choice about included
    whole = m.assemble_many({("bc", (c, 0, 0)): np.column_stack([points[:4], np.zeros(4)])})
    np.testing.assert_allclose(whole.q, poses.q[:4], rtol=0, atol=1e-12)
    off = m.assemble_many({("bc", (c, 0, 0)): [[0.5, 1.7, 0.1]]})
    assert off.status.tolist() == ["contradiction"] and "in z is 0.000000 m, not 0.100000" in off.reasons[0]
    by_joint = m.assemble_many({"C": [0.2, -0.3], "A": 0.1})
    assert by_joint.ok.all() and by_joint.joint("C") == pytest.approx([0.2, -0.3], abs=1e-12)
    for i, angle in enumerate((0.2, -0.3)):
        np.testing.assert_allclose(by_joint.q[i], m.assemble({"C": angle, "A": 0.1}).q, rtol=0, atol=1e-10)


def test_obstacles_are_reported() -> None:
    """A target beyond the position where a parallelogram can fold, in closed form and by continuation; one beyond a
    limit; targets that one degree of freedom cannot meet; a branch on which one of two loops cannot close."""
    m = parallelogram(1.0)
    for joint in ("A", "C"):  # by closed forms, and by following
        poses = m.assemble_many({joint: [-0.2, -1.5, 0.9]})
        assert (poses.branch is None) == (joint == "C")
        assert poses.status.tolist() == ["closed", "singular", "closed"], joint
        assert "singular position" in poses.reasons[1]
        # -1 rad from the drawing, where the bars lie in a line
        assert poses.reached[joint][1] == pytest.approx(-1.0, abs=1e-4)
    # a crank that cannot turn round: from its range to the mirrored one no motion leads, though the loop closes there
    rocking = four_bar([(0, 0), (0.0, 1.05), (0.75, 1.9), (1.0, 0.0)])
    ends = rocking.assemble_many({"A": np.linspace(-6.0, 6.0, 49)})
    assert set(ends.status) >= {"closed", "open"}
    closed = np.flatnonzero(ends.ok)
    assert np.array_equal(closed, np.arange(closed[0], closed[-1] + 1)) and "other branch" in ends.status
    assert any("no motion on this branch leads there" in words for words in ends.reasons.values())
    contradicting = m.assemble_many({"A": [0.1, 0.1], "D": [0.1, 0.3]})
    assert contradicting.status.tolist() == ["closed", "contradiction"]
    assert "with A = 0.100000 on this branch D is 0.100000 rad, not 0.300000" in contradicting.reasons[1]
    watt = pt.catalogue.load("watt-six-bar")
    crank = watt.assemblies().found[0].state.names[0]
    angles = np.linspace(-3.0, 3.0, 61)
    for one in watt.assemblies(inputs=[crank]):
        found = watt.assemble_many({crank: angles}, near=one.state)
        assert found.ok.any()
        for i in np.flatnonzero(found.ok)[::7]:
            assert watt.assemblies(near=found[i], inputs=[crank])[0].branch == one.branch


def test_axes_nearly_parallel() -> None:
    """Axes 1e-6 off are a mechanism in space whose loops close by their lengths still; the poses are near those in the
    plane."""
    angles = np.random.default_rng(2).uniform(-0.4, 0.4, (40, 2))
    targets = {"A": angles[:, 0], "E": angles[:, 1]}
    plane = five_bar().assemble_many(targets)
    try:
        poses = five_bar(askew=1e-6).assemble_many(targets)
    except pt.errors.PartitaError as error:
        assert "mobility" in str(error) or "open" in str(error)
        return
    assert plane.ok.all()
    np.testing.assert_allclose(poses.q[poses.ok], plane.q[poses.ok], rtol=0, atol=1e-4)
    assert all(poses.reasons[i] for i in np.flatnonzero(~poses.ok))


def test_prescribed_motion_stands_at_its_time() -> None:
    m = five_bar()
    m.add_drive("E", position=lambda t: 0.2 * t)
    poses = m.assemble_many({"A": [0.1, 0.2]}, t=1.5)
    assert poses.ok.all() and poses.joint("E") == pytest.approx([0.3, 0.3], abs=1e-14)
    assert poses.near.t == 1.5 and poses[0].t == 1.5


def test_a_pose_is_a_state() -> None:
    m = five_bar()
    poses = m.assemble_many({"A": [0.1, 1.2, 0.2], "E": [0.0, -1.2, 0.1]})
    assert len(poses) == 3 and repr(poses) == "<3 poses: 2 closed, 1 open>"
    run = m.simulate(0.01, initial=poses[0])
    assert run.success
    with pytest.raises(AssemblyError, match=r"pose 1: A = 1.2.* keeps a closure error of") as caught:
        poses[1]
    assert caught.value.residual == poses.shortfall[1] > 0
    with pytest.raises(IndexError):
        poses.state(3)
    with pytest.raises(ArgumentError, match="integer"):
        poses.state("first")  # type: ignore[arg-type]
    assert poses[-1].q.tolist() == poses.q[2].tolist()
    assert poses.body("ground").position.shape == (3, 3)
    with pytest.raises(UnknownNameError):
        poses.body("wheel")
    with pytest.raises(UnknownNameError):
        poses.joint("Z")


@pytest.mark.parametrize(
    ("targets", "error", "words"),
    [
        ({}, ArgumentError, "empty"),
        (None, ArgumentError, "dict"),
        ([{"A": 1.0}], ArgumentError, "dict"),
        ({"A": [0.1, float("nan")]}, ArgumentError, "pose 1"),
        ({"A": [0.1, float("inf")]}, ArgumentError, "finite"),
        ({"A": ["x"]}, ArgumentError, "numbers"),
        ({"A": [0.1, 0.2], "E": [0.1, 0.2, 0.3]}, ArgumentError, "different numbers of poses"),
        ({"A": [[0.1, 0.2]]}, ArgumentError, "shape"),
        ({"Q": [0.1]}, UnknownNameError, "neither a joint nor a coordinate"),
        ({("wheel", (0, 0, 0)): [[0, 0, 0]]}, UnknownNameError, "no body"),
        ({("bc", (0, 0)): [[0, 0, 0]]}, ArgumentError, "three finite numbers"),
        ({("bc", (0, 0, 0), "xw"): [[0, 0]]}, ArgumentError, "letters of 'xyz'"),
        ({("bc", (0, 0, 0)): [[0, 0]]}, ArgumentError, "shape"),
        ({"A": 1e9}, ArgumentError, "ten thousand"),
    ],
)
def test_bad_targets_are_refused(targets: Any, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        five_bar().assemble_many(targets)


def test_no_poses_and_one() -> None:
    m = five_bar()
    none = m.assemble_many({"A": [], "E": []})
    assert len(none) == 0 and none.q.shape == (0, 4) and none.reasons == {} and none.body("bc").position.shape == (0, 3)
    assert len(m.assemble_many({"A": 0.1, "E": 0.0})) == 1
    assert m.assemble_many({"A": [0.1, 0.2], "E": 0.0}).ok.tolist() == [True, True]


def test_control_c_ends_it() -> None:
    m = ankle()
    rng = np.random.default_rng(1)
    motors = rng.uniform(-0.8, 0.8, (2, 200_000))
    assert threading.current_thread() is threading.main_thread()
    with pressed_after(0.3) as when, pytest.raises(KeyboardInterrupt):
        m.assemble_many({"ML": motors[0], "MR": motors[1]})
    assert time.monotonic() - when[0] < 1.0


@pytest.mark.parametrize("crank", [1.0, 1.05])
def test_poses_do_not_depend_on_each_other(crank: float) -> None:
    """Poses of one goal share the path to them; each is that which is found alone, to the last bit, also beyond limits
    and where the farthest one lies far away."""
    m = four_bar([(0, 0), (0.0, crank), (0.75, 1.9), (1.0, 0.0)])
    angles = np.array([0.0, 0.04, 0.1, 0.1 + 1e-12, -0.1, 0.37, -0.9, 1.4, 2.0, -2.5, 3.1, 6.0, -6.0, 8.8, -40.0])
    together = m.assemble_many({"A": angles})
    for i, angle in enumerate(angles):
        alone = m.assemble_many({"A": [angle]})
        assert alone.status[0] == together.status[i] and alone.reached["A"][0] == together.reached["A"][i]
        assert np.array_equal(alone.q[0], together.q[i], equal_nan=True)
        assert alone.reasons.get(0) == together.reasons.get(i)
