"""Partita against an independent program on mechanisms drawn by chance: motion, reactions, what of them is unique."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from oracle import chance
from oracle.comparison import Verdict, compare
from oracle.drawing import GROUND, Drawing
from oracle.maximal import Maximal, Pose
from oracle.study import report

import partita as pt

# Every number is a mechanism, the same on every machine; `make trust` looks at thousands more.
LONG = (47, 49, 77, 81, 92)
"""They take as long as sixty of the others."""
SEEDS = tuple(seed for seed in range(100) if seed not in LONG)
DRAWN = range(300)


@pytest.fixture(scope="module")
def seen() -> dict[int, Verdict]:
    return {seed: compare(chance.mechanism(seed)) for seed in SEEDS}


def test_mechanisms_agree(seen: dict[int, Verdict]) -> None:
    wrong = [seed for seed, verdict in seen.items() if verdict.wrong]
    assert not wrong, "\n\n".join(report(seed, seen[seed]) for seed in wrong[:2])


@pytest.mark.parametrize("seed", [3587, 4740])
def test_exact_hinges_on_two_sets_of_parallel_axes_stay_as_drawn(seed: int) -> None:
    """Axes that are nearly alike by chance are no reason to change a drawing that moves as it stands."""
    drawing = chance.mechanism(seed)
    verdict = compare(drawing)
    assert not verdict.wrong, report(seed, verdict)


@pytest.mark.parametrize("part", [0.1, 0.3, 1.0, 2.0])
def test_a_loop_that_closes_nowhere_is_not_repaired_where_a_slide_ran_far_off(part: float) -> None:
    """A body that slides in a plane, and whose ball joint is drawn off that plane by up to a quarter of the size.

    Assembly without success sends the slide a hundred lengths away; lengths there allow no larger repair.
    """
    drawing = chance.mechanism(3301)
    ball = next(j for j in drawing.joints if j.child_point is not None)
    shifted = replace(ball, child_point=ball.point + part * (ball.child_point - ball.point))
    drawing = replace(drawing, drives=(), joints=tuple(shifted if j is ball else j for j in drawing.joints))
    with pytest.raises(pt.errors.AssemblyError):
        drawing.build().assemble()


def test_the_mechanisms_are_as_intended(seen: dict[int, Verdict]) -> None:
    """Nothing that agrees does so because it was passed over."""
    counts = sum((verdict.counts for verdict in seen.values()), Counter[str]())
    assert counts["relative run"] > 0.75 * len(SEEDS) and counts["absolute run"] > 0.75 * len(SEEDS)
    assert counts["instants"] > 3 * len(SEEDS) and counts["redundant"] > 0.5 * counts["instants"]
    assert counts["acceleration"] > 10 * len(SEEDS) and counts["reaction"] > 14 * len(SEEDS)
    assert counts["flags"] > 270 * len(SEEDS)
    for rare in ("unclear rank", "unclear component", "marked as not determined", "relative stopped"):
        assert counts[rare] <= 0.01 * counts["flags" if "component" in rare else "instants"], rare
    drawings = [chance.mechanism(seed) for seed in DRAWN]
    assert {d.words for d in drawings} == set(chance.WORDS)
    kinds = Counter(j.kind for d in drawings for j in d.joints)
    assert min(kinds[kind] for kind in (*chance.KINDS, "free")) > 5, kinds
    forces = Counter(type(f).__name__ for d in drawings for f in d.forces)
    assert min(forces[kind] for kind in ("Spring", "Load", "Torque", "Torsion")) > 20, forces
    assert sum(bool(d.drives) for d in drawings) > 30
    assert min(d.size for d in drawings) < 0.01 and max(d.size for d in drawings) > 100.0


def test_contradictory_drives_do_not_succeed(seen: dict[int, Verdict]) -> None:
    counts = sum((verdict.counts for verdict in seen.values()), Counter[str]())
    assert counts["contradiction"] > 3
    assert counts["contradiction that succeeds"] == 0


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_door_hangs_on_its_hinge(coordinates: str) -> None:
    """20 kg on a vertical hinge, 0.4 m from its centre of mass: all loads act across its plane."""
    m = pt.Mechanism("door", gravity=(0, 0, -9.81))
    m.add_body("leaf", mass=20.0, inertia=(5.3, 4.3, 1.1), com=(0.4, 0, 0))
    m.add_revolute("hinge", m.ground, "leaf", point=(0, 0, 0))
    run = m.simulate(1.0, t_eval=[0.0, 0.5, 1.0], coordinates=coordinates)
    hinge = run.joint("hinge")
    assert hinge.force == pytest.approx(np.tile([0.0, 0.0, 196.2], (3, 1)), abs=1e-10)
    assert hinge.moment == pytest.approx(np.tile([0.0, -78.48, 0.0], (3, 1)), abs=1e-10)
    assert hinge.determined.all() and run.certificate.newton_euler < 1e-12
    assert run.reactions_by("augmented")["moment"][:, 0] == pytest.approx(hinge.moment, abs=1e-10)


def rolling_door(cut: str = "") -> pt.Mechanism:
    """A door on two hinges in line, in a frame that rolls about an axis across them."""
    m = pt.Mechanism("rolling door", gravity=(0, 0, -9.81))
    m.add_body("frame", mass=30.0, inertia=(6.0, 5.0, 4.0), com=(0.2, 0.1, 0.0))
    m.add_body("leaf", mass=20.0, inertia=(5.3, 4.3, 1.1), com=(0.4, 0, 0))
    m.add_revolute("roll", m.ground, "frame", point=(0, 0, -1), axis=(1, 0, 0))
    for name, z in (("lower", -0.8), ("upper", 0.8)):
        m.add_revolute(name, "frame", "leaf", point=(0, 0, z), cut="always" if name == cut else "auto")
    return m


def test_what_is_open_turns_with_the_frame() -> None:
    """Drawn upright the hinges carry no moment about z for sure; rolled, the world's z lies across them."""
    m = rolling_door()
    run = m.simulate(0.6, t_eval=np.linspace(0.0, 0.6, 7), initial=m.assemble(rates={"roll": 1.5}), rtol=1e-9)
    hinge = run.joint("upper")
    assert hinge.determined_at[0].tolist() == [False] * 5 + [True]
    assert not hinge.determined_at[1:].any() and not hinge.determined.any()
    along = hinge.in_frame("joint")
    assert (along.determined_at == [False] * 5 + [True]).all()
    # the axis of the hinge among axes of one's own, which stay as they are
    turned = hinge.in_frame([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    assert turned.determined_at[0].tolist() == [False, False, False, False, True, False]
    assert not turned.determined_at[1:].any()
    # and as they turn with it
    assert (hinge.in_frame(np.roll(run.at_once.reactions["joint_rotation"][:, 2], 1, axis=2)).determined_at[:, 3]).all()


def sarrus(cut: str = "") -> pt.Mechanism:
    """Two chains of three parallel hinges each; the platform moves along z."""
    m = pt.Mechanism("Sarrus", gravity=(0.3, 0.2, -9.81))
    for name, x, y in (("a", 1.5, 0), ("b", 1.5, 0), ("top", 0, 0), ("c", 0, 1.5), ("d", 0, 1.5)):
        z = {"a": 0.3, "b": 0.9, "top": 1.2, "c": 0.3, "d": 0.9}[name]
        m.add_body(name, mass=1.0, inertia=(0.1, 0.1, 0.1), position=(x, y, z))
    for name, ends, axis, points in (
        ("u", ("a", "b", "top"), (0, 1, 0), ((1, 0, 0), (1.8, 0.2, 0.6), (1, 0, 1.2))),
        ("v", ("c", "d", "top"), (1, 0, 0), ((0, 1, 0), (0.1, 1.8, 0.6), (0, 1, 1.2))),
    ):
        for i, (inner, outer, point) in enumerate(zip((m.ground, *ends), ends, points, strict=False)):
            wish = "always" if f"{name}{i}" == cut else "auto"
            m.add_revolute(f"{name}{i}", inner, outer, point=point, axis=axis, cut=wish)
    return m


@pytest.mark.parametrize("make", [rolling_door, sarrus])
def test_reactions_do_not_depend_on_the_cut(make: Callable[..., pt.Mechanism]) -> None:
    """Each joint cut in turn, and all: the same flags, the same of all that is determined, the same share of the rest.

    And the flags say what self-stresses do: none loads what is called determined, some load each component that is not.
    """
    found = []
    for cut in ("lower", "upper") if make is rolling_door else ("u0", "u1", "u2", "v0", "v1", "v2", "all"):
        m = make(cut)
        rates = {"roll": 1.5} if make is rolling_door else {}
        state, coordinates = m.assemble(rates=rates), "absolute" if cut == "all" else "relative"
        start = m.convert(state, coordinates)
        times = np.linspace(0.0, 0.3, 9)  # the platform falls, well above its base
        run = m.simulate(0.3, t_eval=times, initial=start, rtol=1e-11, atol=1e-12, coordinates=coordinates)
        assert run.success, run.message
        found.append(run)
    bases = [found[0].self_stresses(i) for i in range(9)]
    assert all(len(base) > 0 for base in bases)
    for name in found[0].names.joints:
        for axes in ("world", "joint"):
            views = [run.joint(name).in_frame(axes) for run in found]
            flags = views[0].determined_at
            assert flags.shape == (9, 6) and all(np.array_equal(view.determined_at, flags) for view in views)
            spread = np.ptp([np.hstack([view.force, view.moment]) for view in views], axis=0)
            # integrated on their own: errors of 1e-10 in the motion, forces of 500 N
            assert spread.max() < 1e-6, (name, axes)
            turns = found[0].joint(name)._rotation if axes == "joint" else np.tile(np.eye(3), (9, 1, 1))
            for i, (base, turn) in enumerate(zip(bases, turns, strict=True)):
                loads = np.abs(base.joint(name).reshape(-1, 2, 3) @ turn).reshape(-1, 6).max(axis=0)
                assert np.array_equal(loads < 1e-8, flags[i]), (name, axes, i)


def test_the_independent_program_finds_a_pendulum() -> None:
    """Its own check: a rod on a hinge, released level: 3 g / 2 l, a quarter of its weight on the hinge."""
    d = pendulum()
    still = {"rod": Pose(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))}
    found = Maximal(d, {"A": np.eye(3)}).at(0.0, still)
    assert found.acceleration["rod"][1] == pytest.approx([0.0, 0.0, -1.5 * 9.81 / 2.0])
    assert found.force["A"] == pytest.approx([0.0, 3.0 * 9.81 / 4.0, 0.0])
    assert found.mobility == 1 and found.redundant == 0 and found.gap == 0.0


def pendulum() -> Drawing:
    from oracle.drawing import Body, Joint

    rod = Body("rod", 3.0, np.diag([0.1, 1.0, 1.0]), np.array([1.0, 0, 0]), np.zeros(3), np.eye(3))
    hinge = Joint("A", "revolute", GROUND, "rod", np.zeros(3), np.eye(3)[:, [2, 0, 1]])
    return Drawing(np.array([0.0, -9.81, 0.0]), (rod,), (hinge,))
