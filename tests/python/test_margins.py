"""Margins of actuators depend on nothing but the mechanism, its position and the actuators."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from oracle import chance
from oracle.drawing import Drawing
from thorough import either

import partita as pt

ROUNDING = 1e-10


def ram(cut: str = "", order: int = 1) -> pt.Mechanism:
    """A crank moved by a ram between two points; one joint closes the loop."""
    m = pt.Mechanism("ram")
    m.add_rod("crank", (0, 0, 0), (0, 1, 0), mass=2.0)
    m.add_rod("barrel", (0.5, 2, 0), (0.25, 1.5, 0), mass=1.0)
    m.add_rod("piston", (0.25, 1.5, 0), (0, 1, 0), mass=1.0)
    joints = [
        ("add_revolute", "A", (m.ground, "crank"), (0, 0, 0), (0, 0, 1)),
        ("add_revolute", "O", (m.ground, "barrel"), (0.5, 2, 0), (0, 0, 1)),
        ("add_revolute", "P", ("crank", "piston"), (0, 1, 0), (0, 0, 1)),
        ("add_prismatic", "ram", ("barrel", "piston"), (0.25, 1.5, 0), (0.5, 1, 0)),
    ]
    for method, name, bodies, point, axis in joints[::order]:
        getattr(m, method)(name, *bodies, point=point, axis=axis, cut="always" if name == cut else "auto")
    return m


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("cut", ["", "A", "O", "P", "ram"])
def test_the_dead_centre_of_a_ram_is_found_whatever_is_cut(cut: str, coordinates: str) -> None:
    for kind in ("actuators", "outputs"):
        found = ram(cut).singularities({"A": [-1.5, 1.5]}, of=("ram",), kind=kind, coordinates=coordinates)
        at = found.points.goals["A"]
        assert len(at) and np.abs(at - -np.arctan(0.5 / 2.0)).max() < 1e-12


def test_a_ram_loses_its_margin_as_its_effort_grows() -> None:
    """Power is the same along every path: the effort of the ram is that of the crank over the ratio of their rates."""
    m = ram()
    here, near, nearer = (m.assemble({"A": -np.arctan(0.25) + off}) for off in (0.5, 1e-2, 1e-4))
    margins = [m.inverse_dynamics(state, ["ram"]).margin[0] for state in (here, near, nearer)]
    assert margins[0] > 0.2 and margins[1] / margins[2] == pytest.approx(100.0, rel=0.02)
    efforts = [abs(m.inverse_dynamics(state, ["ram"]).efforts[0, 0]) for state in (near, nearer)]
    assert efforts[1] / efforts[0] == pytest.approx(100.0, rel=0.1)


def test_a_rod_pushed_along_itself_has_no_margin() -> None:
    m = pt.Mechanism("pushed", gravity=(0, -9.81, 0))
    m.add_rod("rod", (0, 0, 0), (1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, "rod", point=(0, 0, 0), axis=(0, 0, 1))
    m.add_force("rod", (0.0, 1.0, 0.0), point=(1.0, 0.0, 0.0), name="push")
    margins = {}
    for angle in (0.0, -1.5, -np.pi / 2.0 + 1e-9):
        margins[angle] = m.inverse_dynamics(m.assemble({"A": angle}), ["push.y"]).margin[0]
    # a free rod: |k|^2 = 1 / m + (l/2)^2 / J at the angle, J = m l^2 / 12; the hinged one has m l^2 / 3
    for angle, margin in margins.items():
        c = np.cos(angle)
        assert margin == pytest.approx(np.sqrt(3.0 * c * c / (1.0 + 3.0 * c * c)), abs=1e-9)


def test_mirrored_pairs_of_a_five_bar_rank_alike() -> None:
    """Symmetric about the middle: what holds for a pair holds for its mirror image."""

    def five_bar(cut: str, order: int) -> pt.Mechanism:
        m = pt.Mechanism("five-bar", gravity=(0, -9.81, 0))
        at = [(-0.2, 0, 0), (-0.4, 0.3, 0), (0, 0.6, 0), (0.4, 0.3, 0), (0.2, 0, 0)]
        for name, a, b in zip("abcd", at, at[1:], strict=False):
            m.add_rod(name, a, b, mass=1.0)
        bodies = [(m.ground, "a"), ("a", "b"), ("b", "c"), ("c", "d"), (m.ground, "d")]
        for name, pair, point in [*zip("ABCDE", bodies, at, strict=True)][::order]:
            m.add_revolute(name, *pair, point=point, axis=(0, 0, 1), cut="always" if name == cut else "auto")
        return m

    seen: dict[tuple[str, str], set[float]] = {}
    for cut in ("", *"ABCDE"):
        for order in (1, -1):
            m = five_bar(cut, order)
            for coordinates in ("relative", "absolute"):
                state = m.assemble(coordinates=coordinates)
                for pair in [
                    ("A", "B"),
                    ("E", "D"),
                    ("A", "E"),
                    ("A", "D"),
                    ("E", "B"),
                    ("B", "D"),
                    ("A", "C"),
                    ("E", "C"),
                ]:
                    margin = float(m.inverse_dynamics(state, pair).margin[0])
                    seen.setdefault(pair, set()).add(margin)
    mirrored = {"A": "E", "B": "D", "C": "C", "D": "B", "E": "A"}
    for pair, margins in seen.items():
        assert max(margins) - min(margins) < ROUNDING
        other = seen.get((mirrored[pair[0]], mirrored[pair[1]]), margins)
        assert max(other) == pytest.approx(max(margins), abs=ROUNDING)


def margin(d: Drawing, names: list[str], coordinates: str) -> tuple[float, np.ndarray]:
    """At the assembled position, and the distances of its bodies from each other over the size."""
    m = d.build()
    d_inverse = m.inverse_dynamics(m.convert(m.assemble(), coordinates), names)
    at = np.array([d_inverse.body(name).position[0] for name in sorted(b.name for b in d.bodies)])
    return float(d_inverse.margin[0]), np.linalg.norm(at[:, None] - at[None], axis=2) / d.size


def others(d: Drawing, rng: Any) -> dict[str, tuple[Drawing, str]]:
    """The same in other words."""
    found = {
        "absolute": (d, "absolute"), "another order": (chance.shuffled(rng, d), "relative"),
        "turned": (d.turned(chance.rotation(rng)), "relative"), "other units": (d.scaled(10.0, 0.01, 3.0), "relative"),
    }  # fmt: skip
    for i, chosen in enumerate(d.joints):
        joints = (replace(j, cut="always" if k == i else "auto") for k, j in enumerate(d.joints))
        found[f"{chosen.name} closes"] = (replace(d, joints=tuple(joints)), "relative")
    return found


@pytest.mark.parametrize("part", range(4))
def test_margins_depend_on_no_cut_no_coordinates_no_order_no_units(part: int) -> None:
    compared = 0
    for seed in range(part, either(60, 1000), 4):
        d, rng = replace(chance.mechanism(seed), drives=(), forces=()), np.random.default_rng([seed, 5])
        names = [j.name for j in d.joints if j.kind in ("revolute", "prismatic")]
        try:
            k = d.build().compile().mobility
            if not 0 < k <= min(len(names), 4):
                continue
            chosen = [str(name) for name in rng.permutation(names)[:k]]
            wanted, apart = margin(d, chosen, "relative")
        except pt.errors.PartitaError:
            continue  # drawn so that nothing moves, or nothing closes
        assert wanted <= 1.0 + ROUNDING
        for words, (other, coordinates) in others(d, rng).items():
            found, there = margin(other, chosen, coordinates)
            if np.abs(there - apart).max() > ROUNDING:  # an open drawing, which is assembled elsewhere in other words
                assert words != "absolute"
                continue
            assert found == pytest.approx(wanted, abs=ROUNDING), (seed, words, chosen)
            compared += 1
    assert compared > 20


def shared(d: Drawing, coordinates: str) -> tuple[np.ndarray, dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Positions of the bodies at the start, reactions over the largest, and which components are determined."""
    m = d.build()
    state = m.convert(m.assemble(), coordinates)
    run = m.simulate(1e-3, t_eval=[0.0], initial=state, coordinates=coordinates, rtol=1e-10, atol=1e-12)
    if not run.success:  # a load that spins what has no inertia, say
        raise pt.errors.EvaluationError(run.message)
    points = np.array([run.body(name).position[0] for name in sorted(b.name for b in d.bodies)]) / d.size
    joints = {j.name: run.joint(j.name) for j in d.joints}
    largest = max((float(np.abs(j.force[0]).max()) for j in joints.values()), default=0.0) or 1.0
    loads = {name: np.concatenate([j.force[0], j.moment[0] / d.size]) / largest for name, j in joints.items()}
    return points, loads, {name: np.asarray(j.determined) for name, j in joints.items()}


@pytest.mark.parametrize("part", range(2))
def test_shares_and_flags_of_reactions_depend_on_no_cut_no_coordinates_no_order(part: int) -> None:
    """At one position: where a drawing is open, another tree assembles it elsewhere, which is not compared."""
    compared = 0
    for seed in range(part, either(60, 400), 2):
        d, rng = replace(chance.mechanism(seed), drives=()), np.random.default_rng([seed, 5])
        try:
            points, loads, flags = shared(d, "relative")
        except pt.errors.PartitaError:
            continue  # nothing moves, or nothing closes
        same = others(d, rng)
        chosen = ["absolute", "another order", *list(same)[4:][:: max(1, len(d.joints) - 1)]]
        for words in chosen:
            try:
                there, found, marked = shared(*same[words])
            except pt.errors.PartitaError:
                continue
            if np.abs(there - points).max() > ROUNDING:
                assert words != "absolute"
                continue
            compared += 1
            for name in loads:
                assert (marked[name] == flags[name]).all(), (seed, words, name)
                assert np.abs(found[name] - loads[name]).max() < 1e-8, (seed, words, name)
    assert compared > 40
