"""Redundant closing rows that turn with a screw: those kept are exchanged for others before they lose rank."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from thorough import THOROUGH, either

import partita as pt

# drawn jacks whose kept rows came to depend on each other within a step: (seed, duration [s])
TURNED = [(237, 10), (1204, 10), (1375, 10), (2004, 10), (2067, 10), (127, 60), (727, 60), (891, 60)]


def turned(w: float, x: float, y: float, z: float) -> NDArray[np.float64]:
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def jack(seed: int, duration: float, prescribed: str = "velocity") -> tuple[pt.Mechanism, tuple[str, int], float]:
    """Two arms on one hinge line, a nut on each, a screw between the nuts, driven; built in a random order.

    Returns it with the joint and coordinate that is driven, and its rate.
    """
    rng = np.random.default_rng(seed)
    quaternion = rng.normal(size=4)
    frame = turned(*(quaternion / np.linalg.norm(quaternion)))
    lengths, phases = rng.uniform(0.3, 0.8, 2), (rng.uniform(0, 0.5), rng.uniform(1.0, 2.0))
    rate, travel = rng.uniform(2, 20), rng.uniform(0.05, 0.15)
    universal, threads = rng.choice(["revolute", "universal"]) == "universal", int(rng.integers(4))
    cut = rng.choice(["auto", "H0", "H1", "N0", "N1", "bearing", "thread"])
    base, weight, order, lines = (
        int(rng.integers(3)),
        rng.uniform(0, 9.81),
        int(rng.integers(4)),
        rng.uniform(-0.2, 0.2, 2),
    )
    two = threads > 1
    pitch = travel / (2 if two else 1) * 2 * np.pi / (rate * duration) * rng.choice([-1, 1])

    def at(*x: float) -> tuple[float, ...]:
        return tuple(frame @ np.asarray(x, float))

    def kept(name: str) -> dict[str, Any]:
        return {"cut": "always"} if name == cut else {}

    ends = [length * np.array((np.cos(f), np.sin(f), 0.0)) for length, f in zip(lengths, phases, strict=True)]
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    m = pt.Mechanism("jack", gravity=at(0, -weight, 0))
    arms = [m.add_body(f"arm {i}", mass=2.0 + i, position=at(*ends[i] / 2), inertia=(0.02, 0.02, 0.04)) for i in (0, 1)]
    nuts = [m.add_body(f"nut {i}", mass=0.3, position=at(*ends[i]), inertia=(1e-3, 1.1e-3, 1.2e-3)) for i in (0, 1)]
    screw = m.add_body("screw", mass=1.0, position=at(*(ends[0] + ends[1]) / 2), inertia=(2e-3, 2.1e-3, 2.2e-3))

    def hinges() -> None:
        for i in (0, 1):
            on = arms[0] if base == 2 and i == 1 else m.ground
            m.add_revolute(f"H{i}", on, arms[i], point=at(0, 0, lines[i]), axis=at(0, 0, 1), **kept(f"H{i}"))

    def carriers() -> None:
        for i in (0, 1):
            shared: dict[str, Any] = {"point": at(*ends[i]), **kept(f"N{i}")}
            if universal:
                across = at(*np.cross(along, (0, 0, 1)))
                m.add_universal(f"N{i}", arms[i], nuts[i], axis1=at(0, 0, 1), axis2=across, **shared)
            else:
                m.add_revolute(f"N{i}", arms[i], nuts[i], axis=at(0, 0, 1), **shared)

    def screws() -> None:
        a, b = (0, 1) if threads % 2 else (1, 0)
        first: dict[str, Any] = {"point": at(*ends[a]), "axis": at(*along), **kept("bearing")}
        if two:
            m.add_screw("bearing", nuts[a], screw, pitch=-pitch, **first)
        else:
            m.add_revolute("bearing", nuts[a], screw, **first)
        m.add_screw("thread", nuts[b], screw, point=at(*ends[b]), axis=at(*along), pitch=pitch, **kept("thread"))

    orders = (
        (hinges, carriers, screws),
        (screws, carriers, hinges),
        (carriers, hinges, screws),
        (carriers, screws, hinges),
    )
    for build in orders[order]:
        build()
    driven = ("bearing", int(two)) if rng.random() < 0.5 else ("thread", 1)
    if prescribed == "velocity":
        m.add_drive(driven[0], velocity=rate, coordinate=driven[1], name="motor")
    else:
        m.add_drive(driven[0], position=lambda t: rate * t, coordinate=driven[1], name="motor")
    if base == 1:
        m.add_drive("H0", velocity=0.0)
    elif base == 2 and rng.random() < 0.5:
        m.add_drive("H0", velocity=0.3)
    return m, driven, rate


def runs_as_driven(m: pt.Mechanism, driven: tuple[str, int], rate: float, duration: float, **options: Any) -> pt.Result:
    run = m.simulate(duration, **options)
    assert run.success, run.message
    assert not [note for note in run.notes if "singular" in note]
    found = run.joint(driven[0]).velocity.reshape(run.t.size, -1)[:, driven[1]]
    assert np.abs(found - rate).max() < 1e-9
    assert np.isfinite(run.multipliers).all()
    return run


@pytest.mark.parametrize(
    ("seed", "duration", "prescribed"),
    [(*one, "velocity") for one in TURNED if THOROUGH or one[0] not in (727, 891)]
    # a position is a function in Python, called at every evaluation of the minute
    + [(*one, "position") for one in TURNED if THOROUGH or one[1] < 60],
)
def test_rows_that_turn_are_no_singular_positions(seed: int, duration: float, prescribed: str) -> None:
    m, driven, rate = jack(seed, duration, prescribed)
    one = runs_as_driven(m, driven, rate, duration, rtol=1e-10, atol=1e-12)
    m, driven, rate = jack(seed, duration, prescribed)
    other = runs_as_driven(m, driven, rate, duration, rtol=1e-10, atol=1e-12, coordinates="absolute")
    efforts = [np.asarray(run.drive("motor").effort) for run in (one, other)]
    np.testing.assert_allclose(efforts[0], efforts[1], rtol=1e-6, atol=1e-6 * np.abs(efforts[1]).max())


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_jacks_drawn_by_chance(coordinates: str) -> None:
    for seed in range(either(20, 60) if coordinates == "relative" else either(5, 15)):
        for duration in (6.0,) if coordinates == "absolute" and not THOROUGH else (6.0, 60.0):
            m, driven, rate = jack(seed, duration)
            runs_as_driven(m, driven, rate, duration, coordinates=coordinates)


@pytest.mark.parametrize("formulation", ["gram-schmidt", "svd", "multipliers", "range-space", "proximal"])
def test_rows_that_turn_in_all_formulations(formulation: str) -> None:
    for seed, duration in TURNED[:5]:
        m, driven, rate = jack(seed, duration)
        runs_as_driven(m, driven, rate, duration, solver=pt.Solver(formulation))


EVERY_VELOCITY = ["multipliers", "sparse-multipliers", "range-space", "proximal"]


@pytest.mark.parametrize("formulation", EVERY_VELOCITY)
def test_all_velocities_of_a_bennett_linkage_have_rows_that_serve(formulation: str) -> None:
    """Five of Bennett's eight conditions say all as drawn; after 0.6 s those five no longer do, and others must."""
    entry = pt.catalogue.entry("bennett")
    m = entry.mechanism()
    found = {
        name: m.simulate(10.0, initial=entry.initial(m), rtol=1e-10, atol=1e-12, solver=pt.Solver(name))
        for name in ("projective", formulation)
    }
    assert all(run.success for run in found.values())
    evaluations = {name: run.counters["evaluations"] for name, run in found.items()}
    assert evaluations[formulation] < 2 * evaluations["projective"]


def cardan() -> tuple[pt.Mechanism, pt.State]:
    """A universal joint between two shafts in bearings: a spherical four-bar, of whose six conditions three say all."""
    m = pt.Mechanism("shaft", gravity=(0, 0, -9.81))
    out = np.array((np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0))
    driving = m.add_body("in", mass=1.0, position=(-0.5, 0, 0), inertia=(0.02, 0.1, 0.1))
    driven = m.add_body("out", mass=1.0, position=tuple(0.5 * out), inertia=(0.02, 0.1, 0.1))
    cross = m.add_body("cross", mass=0.2, position=(0, 0, 0), inertia=(1e-3, 1.1e-3, 1.2e-3))
    m.add_revolute("A", m.ground, driving, point=(-0.5, 0, 0), axis=(1, 0, 0))
    m.add_revolute("B", driving, cross, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_revolute("C", cross, driven, point=(0, 0, 0), axis=tuple(np.cross((0, 0, 1), out)))
    m.add_revolute("D", m.ground, driven, point=tuple(0.5 * out), axis=tuple(out))
    m.add_torsion_spring("A", stiffness=3.0)
    return m, m.assemble(rates={"A": 5.0})


def parallel_machine() -> tuple[pt.Mechanism, pt.State]:
    """A platform on two legs universal-slide-hinge in one plane and one leg ball-slide-hinge, in clean numbers."""
    m = pt.Mechanism("machine", gravity=(0, 0, -9.81))
    platform = m.add_body("platform", mass=5.0, position=(0, 0, -1), inertia=(0.1, 0.1, 0.2))
    legs = [((-0.5, 0, 0), (-0.25, 0, -1)), ((0.5, 0, 0), (0.25, 0, -1)), ((0, 0.6, 0), (0, 0.3, -1))]
    for i, (top, foot) in enumerate(legs):
        along = np.subtract(foot, top) / np.linalg.norm(np.subtract(foot, top))
        about = {"inertia": (0.02, 0.02, 0.01)}
        upper = m.add_body(f"upper {i}", mass=1.0, position=tuple(top + 0.3 * along), **about)
        lower = m.add_body(f"lower {i}", mass=0.8, position=tuple(foot - 0.3 * along), **about)
        if i < 2:
            m.add_universal(f"U{i}", m.ground, upper, point=top, axis1=(1, 0, 0), axis2=(0, 1, 0))
        else:
            m.add_spherical(f"U{i}", m.ground, upper, point=top)
        m.add_prismatic(f"P{i}", upper, lower, point=top, axis=tuple(along))
        m.add_revolute(f"R{i}", lower, platform, point=foot, axis=(0, 1, 0) if i < 2 else (1, 0, 0))
    return m, m.assemble()


def of_catalogue(name: str) -> tuple[pt.Mechanism, pt.State]:
    entry = pt.catalogue.entry(name)
    m = entry.mechanism()
    return m, entry.initial(m)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize(
    "name", ["bennett", "bricard", "sarrus", "goldberg", "myard", "three-rrr", "agile-eye", "cardan", "machine"]
)
def test_overconstrained_mechanisms_in_all_velocities(name: str, coordinates: str) -> None:
    """At the start their accelerations are those of the independent coordinates, and they cost as much."""
    own = {"cardan": cardan, "machine": parallel_machine}
    m, start = own[name]() if name in own else of_catalogue(name)
    times = start.t + np.array([0.0, 0.3])
    for rtol in (1e-5, 1e-8, 1e-10):
        runs = {
            form: m.simulate(
                0.3,
                t_eval=times,
                initial=start,
                rtol=rtol,
                atol=rtol / 100,
                solver=pt.Solver(form),
                coordinates=coordinates,
            )
            for form in ("projective", *EVERY_VELOCITY)
        }
        held = runs["projective"]
        for form, run in runs.items():
            assert run.success, (form, run.message)
            scale = 1.0 + np.abs(held.vdot[0]).max()
            np.testing.assert_allclose(run.vdot[0], held.vdot[0], rtol=0, atol=1e-9 * scale, err_msg=form)
            np.testing.assert_allclose(run.q[-1], held.q[-1], rtol=0, atol=1e4 * rtol, err_msg=form)
            assert run.counters["evaluations"] <= 3 * held.counters["evaluations"], form
