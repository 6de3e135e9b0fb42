"""The choice of coordinates and the motion are the same in metres, millimetres and inches.

A slider-crank of 50 and 200 mm with the coordinates crank angle, rod angle and slide: angles and a length compete,
so a criterion that depends on units would choose differently. Everything is computed with numbers in the unit of
length and scaled back to metres afterwards.
"""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import partita as pt
from partita import units
from partita.results import Result
from partita.units import deg, inch, metre, mm

CRANK, ROD = 50 * mm, 200 * mm
CRANK_MASS, ROD_MASS, SLIDER_MASS = 0.4, 0.6, 1.2
GRAVITY, PUSH = 9.81, -5.0  # m/s^2 along -y; N along the slide
CRANK_ANGLE, CRANK_RATE = 60 * deg, 30.0
UNITS = {"m": metre, "mm": mm, "inch": inch}
DEAD_CENTRES = [angle * deg for angle in (-1.0, 0.0, 1.0, 179.0, 180.0, 181.0)]
# Fixed steps: the control of adaptive ones weighs errors in the unit of the coordinate.
FIXED: dict[str, Any] = {"method": "rk4", "step": 5e-4}
SLIDE = 2

Array = NDArray[np.float64]


def system(unit: float) -> pt.System:
    """The three coordinates with a closing condition in x and one in y; lengths in `unit` metres, masses in kg."""
    r, rod, g, push = CRANK / unit, ROD / unit, GRAVITY / unit, PUSH / unit
    coupling = ROD_MASS * r * rod / 2.0

    def mass(t: float, q: Array) -> Array:
        shared = coupling * np.cos(q[0] - q[1])
        crank = (CRANK_MASS / 3.0 + ROD_MASS) * r**2
        return np.array([[crank, shared, 0.0], [shared, ROD_MASS * rod**2 / 3.0, 0.0], [0.0, 0.0, SLIDER_MASS]])

    def forces(t: float, q: Array, v: Array) -> Array:
        swing = coupling * np.sin(q[0] - q[1])
        crank = -swing * v[1] ** 2 - g * (CRANK_MASS / 2.0 + ROD_MASS) * r * np.cos(q[0])
        return np.array([crank, swing * v[0] ** 2 - g * ROD_MASS * rod / 2.0 * np.cos(q[1]), push])

    def constraints(t: float, q: Array) -> Array:
        return np.array([r * np.cos(q[0]) + rod * np.cos(q[1]) - q[2], r * np.sin(q[0]) + rod * np.sin(q[1])])

    def jacobian(t: float, q: Array) -> Array:
        return np.array([
            [-r * np.sin(q[0]), -rod * np.sin(q[1]), -1.0],
            [r * np.cos(q[0]), rod * np.cos(q[1]), 0.0],
        ])  # fmt: skip

    def bias(t: float, q: Array, v: Array) -> Array:
        squares = v[:2] ** 2
        return -np.array([
            r * np.cos(q[0]) * squares[0] + rod * np.cos(q[1]) * squares[1],
            r * np.sin(q[0]) * squares[0] + rod * np.sin(q[1]) * squares[1],
        ])  # fmt: skip

    names = ["crank", "rod", "slide"]
    return pt.System(3, mass, forces, constraints, jacobian, bias=bias, names=names)


def position(crank: float, unit: float) -> Array:
    """Coordinates at a crank angle, the slide in `unit` metres."""
    rod = np.arcsin(-CRANK * np.sin(crank) / ROD)
    return np.array([crank, rod, (CRANK * np.cos(crank) + ROD * np.cos(rod)) / unit])


def mechanism(unit: float, crank_angle: float) -> pt.Mechanism:
    """The same as bodies and joints, drawn at a crank angle with lengths in `unit` metres."""
    slide = position(crank_angle, unit)[SLIDE]
    pin = np.array([np.cos(crank_angle), np.sin(crank_angle), 0.0]) * CRANK / unit
    wrist = np.array([slide, 0.0, 0.0])
    m = pt.Mechanism("slider-crank", gravity=(0, -GRAVITY / unit, 0))
    crank = m.add_rod("crank", start=(0, 0, 0), end=pin, mass=CRANK_MASS)
    rod = m.add_rod("rod", start=pin, end=wrist, mass=ROD_MASS)
    slider = m.add_body("slider", mass=SLIDER_MASS, inertia=(0, 0, 0), position=wrist)
    m.add_revolute("crank", m.ground, crank, point=(0, 0, 0), cut="never")
    m.add_revolute("rod", crank, rod, point=pin, cut="never")
    m.add_revolute("wrist", slider, rod, point=wrist, cut="always")
    m.add_prismatic("slide", m.ground, slider, point=wrist, axis=(1, 0, 0), cut="never")
    m.add_force(slider, force=(PUSH / unit, 0, 0))
    return m


def system_run(unit: float) -> Result:
    s = system(unit)
    q0 = position(CRANK_ANGLE, unit)
    jacobian = s.jacobian(q0)
    v0 = np.array([CRANK_RATE, *np.linalg.solve(jacobian[:, 1:], -jacobian[:, 0] * CRANK_RATE)])
    result = pt.simulate(s, 0.5, q0, v0, t_eval=np.linspace(0.0, 0.5, 51), **FIXED)
    assert result.success, result.message
    return result


def mechanism_run(unit: float) -> Result:
    m = mechanism(unit, CRANK_ANGLE)
    start = m.assemble(rates={"crank": CRANK_RATE})
    result = m.simulate(0.5, initial=start, t_eval=np.linspace(0.0, 0.5, 51), **FIXED)
    assert result.success, result.message
    return result


def choices(result: Result) -> list[tuple[float, tuple[str, ...]]]:
    """When which coordinate was independent."""
    return [(round(change.t, 9), change.independent) for change in result.partitions]


@pytest.mark.parametrize("name", ["mm", "inch"])
def test_choice_and_unit_of_length(name: str) -> None:
    """Measure, quality and choice all around the turn, degree by degree."""
    for crank in np.arange(0.5, 360.0) * deg:
        found = []
        for unit in (metre, UNITS[name]):
            s, q = system(unit), position(crank, unit)
            found.append(pt.partition.choose(s.mass_matrix(q), s.jacobian(q)))
        ours, theirs = found
        assert ours.independent.tolist() == theirs.independent.tolist()
        # The mass matrix has a condition up to 1e5 in metres: 1e-16 times that, with room.
        np.testing.assert_allclose(ours.rho, theirs.rho, rtol=0.0, atol=1e-10)
        np.testing.assert_allclose([ours.sigma, ours.sqrt_mu], [theirs.sigma, theirs.sqrt_mu], rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("unit", UNITS.values(), ids=UNITS)
@pytest.mark.parametrize("crank", DEAD_CENTRES)
def test_slide_near_dead_centre_is_never_chosen(unit: float, crank: float) -> None:
    s, q = system(unit), position(crank, unit)
    choice = pt.partition.choose(s.mass_matrix(q), s.jacobian(q))
    assert SLIDE not in choice.independent
    assert choice.rho[SLIDE] < 0.1 * choice.rho.max()


@pytest.mark.parametrize("unit", UNITS.values(), ids=UNITS)
@pytest.mark.parametrize("crank", DEAD_CENTRES)
def test_slide_of_a_mechanism_near_dead_centre_is_never_chosen(unit: float, crank: float) -> None:
    result = mechanism(unit, crank).simulate(1e-3, **FIXED)
    assert "slide" not in result.partitions[0].independent


@pytest.mark.parametrize("name", ["mm", "inch"])
@pytest.mark.parametrize("run", [system_run, mechanism_run])
def test_trajectory_and_unit_of_length(run: object, name: str) -> None:
    assert callable(run)
    ours, theirs = run(metre), run(UNITS[name])
    column = ours.names.coordinates.index("slide")
    scale = np.ones(ours.q.shape[1])
    scale[column] = UNITS[name]
    # Round-off 1e-16 of angles of 15 rad, growing over 1000 steps of a motion that repeats itself.
    np.testing.assert_allclose(theirs.q * scale, ours.q, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(theirs.v * scale, ours.v, rtol=0.0, atol=1e-9)
    assert choices(theirs) == choices(ours)


def test_system_and_mechanism_move_alike() -> None:
    # RK4 in two coordinate sets (absolute and relative rod angle): both follow the motion to their own error, about
    # (rate times step)^4 per radian = 1e-7 here.
    equations, bodies = system_run(metre), mechanism_run(metre)
    slide = bodies.joint("slide").position[:, 0] + position(CRANK_ANGLE, metre)[SLIDE]
    np.testing.assert_allclose(equations.q[:, SLIDE], slide, rtol=0.0, atol=1e-6)


def test_units_are_what_they_are_agreed_to_be() -> None:
    """Inch, foot and pound by the agreement of 1959, the pound-force by the standard gravity of 1901; all exact."""
    agreed = {
        "inch": 25.4 * units.mm,
        "foot": 12.0 * units.inch,
        "lb": 0.45359237 * units.kg,
        "lbf": units.lb * 9.80665,
        "rpm": units.rev / units.minute,
        "deg": units.rev / 360.0,
        "cm": 10.0 * units.mm,
        "km": 1000.0 * units.metre,
        "gram": units.kg / 1000.0,
        "ms": units.minute / 60_000.0,
        "kN": 1000.0 * units.newton,
    }
    for name, value in agreed.items():
        # products of decimals: a few units in the last place
        assert getattr(units, name) == pytest.approx(value, rel=1e-15, abs=0.0), name
    torque = units.convert(1.0, "lbf inch", "N mm")
    assert torque == pytest.approx(0.45359237 * 9.80665 * 25.4, rel=1e-15, abs=0.0)
    assert units.convert(1.0, "rpm", "deg/s") == pytest.approx(6.0, rel=1e-15, abs=0.0)
