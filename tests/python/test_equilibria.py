"""Families of equilibria, preloads, and all equilibria of a mechanism: closed forms and independent solvers."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, root

import partita as pt
from partita.catalogue import spring_four_bar as diagonal
from partita.errors import ArgumentError, DescriptionError


def column(stiffness: float = 3.0, lean: float = 0.0) -> pt.Mechanism:
    """A bar of 1 m on a torsion spring, pressed from above: stiffness (angle - lean) = F sin(angle)."""
    m = pt.Mechanism("column", gravity=None)
    bar = m.add_rod("bar", start=(0, 0, 0), end=(0, 1, 0), mass=1.0)
    m.add_revolute("foot", m.ground, bar, point=(0, 0, 0))
    m.add_torsion_spring("foot", stiffness=stiffness, angle=lean, name="s")
    m.add_force(bar, (0, -1.0, 0), (1, 0, 0), name="load")
    return m


def pressed(*forces: float) -> dict[str, list[tuple[float, float, float]]]:
    return {"load.value": [(0.0, -force, 0.0) for force in forces]}


SPAN, RISE, STIFF = 1.0, 0.4, 1000.0
LENGTH = math.hypot(SPAN, RISE)


def truss() -> pt.Mechanism:
    """Two springs from a slider to the ground, unstressed as drawn, and a load: the truss of von Mises."""
    m = pt.Mechanism("truss", gravity=None)
    block = m.add_body("block", mass=1.0, inertia=(1, 1, 1), position=(0, RISE, 0))
    m.add_prismatic("slide", m.ground, block, point=(0, RISE, 0), axis=(0, 1, 0))
    for name, side in (("left", -SPAN), ("right", SPAN)):
        m.add_spring(name, m.ground, (side, 0, 0), block, (0, 0, 0), stiffness=STIFF, length=LENGTH)
    m.add_force(block, (0, 0, 0), name="load")
    return m


def load(height: float) -> float:
    return 2 * STIFF * (LENGTH / math.hypot(SPAN, height) - 1) * height


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_truss_snaps_through_at_its_closed_form(coordinates):
    m = truss()
    path = m.equilibrium(along=pressed(0, 10, 20, 30), coordinates=coordinates)
    length = (LENGTH * SPAN**2) ** (1 / 3)
    top = math.sqrt(length**2 - SPAN**2)
    assert [fold.value for fold in path.folds] == pytest.approx([-load(top), load(top)], rel=1e-12)
    core = m.compile(coordinates).core

    def height(state: pt.State) -> float:
        return float(core.motion(np.zeros(1), state.q[None], state.v[None]).bodies([0])["body_position"][0, 0, 1])

    assert [height(fold.state) for fold in path.folds] == pytest.approx([top, -top], abs=1e-12)
    assert [fold.unstable for fold in path.folds] == [(0, 1), (1, 0)]
    # 0, 10 and 20 N three times each, 30 N on the other side alone
    assert path.which.tolist() == [0, 1, 2, 2, 1, 0, 0, 1, 2, 3]
    assert path.stable.tolist() == [True] * 3 + [False] * 3 + [True] * 4
    for e, value in zip(path, path.values, strict=True):
        assert load(height(e.state)) == pytest.approx(-value, abs=1e-10)
    assert len(path.at(-10.0)) == 3 and len(path.at(-30.0)) == 1
    # beyond the fold the load pushes it to the other side, at the height with the same load
    there = path.folds[0].snaps_to
    assert there is not None and there.stable
    assert load(height(there.state)) == pytest.approx(load(top), rel=1e-9)
    assert height(there.state) < -top


def test_a_column_buckles_at_its_closed_form():
    """F L = c; on the buckled branch F = c angle / sin(angle)."""
    m = column()
    path = m.equilibrium(along=pressed(1.0, 2.0, 5.0))
    (point,) = path.branch_points
    assert point.value == pytest.approx(-3.0, rel=1e-12) and point.motion == "foot"
    assert not path.folds and path.stable.tolist() == [True, True, False]
    start = m.equilibrium(m.assemble({"foot": 0.9}), stable=True, parameters={"load.value": (0, -5.0, 0)})
    path = m.equilibrium(start, along=pressed(5.0, 4.0, 3.2))
    wanted = [brentq(lambda a, f=f: 3.0 * a / math.sin(a) - f, 1e-3, 3.0) for f in (5.0, 4.0, 3.2)]
    # it crosses the straight position and leans to the other side
    assert path.position("foot") == pytest.approx(wanted + [-a for a in reversed(wanted)], rel=1e-12)
    assert [point.value for point in path.branch_points] == pytest.approx([-3.0], rel=1e-9)
    assert not path.folds and all(path.stable)


def test_an_imperfect_column_bends_without_branching():
    path = column(lean=0.05).equilibrium(along=pressed(0.0, 2.0, 3.0, 4.0))
    assert not path.branch_points and not path.folds and all(path.stable)
    wanted = [brentq(lambda a, f=f: 3.0 * (a - 0.05) - f * math.sin(a), 0.0, 3.0) for f in (0.0, 2.0, 3.0, 4.0)]
    assert path.position("foot") == pytest.approx(wanted, rel=1e-12)


def watt(stiffness: float = 1.0) -> pt.Mechanism:
    """Two bars of length 1 on torsion springs of the ground, joined by a short link under a load: a Watt chain."""
    m = pt.Mechanism("Watt chain")
    ends = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.4, 0.0), (2.0, 0.4, 0.0)]
    left = m.add_rod("left", start=ends[0], end=ends[1], mass=1.0)
    link = m.add_rod("link", start=ends[1], end=ends[2], mass=0.5)
    right = m.add_rod("right", start=ends[3], end=ends[2], mass=1.5)
    m.add_revolute("A", m.ground, left, point=ends[0])
    m.add_revolute("B", left, link, point=ends[1])
    m.add_revolute("C", link, right, point=ends[2])
    m.add_revolute("D", m.ground, right, point=ends[3])
    m.add_torsion_spring("A", stiffness=20.0, name="s")
    return m


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_family_closed_by_a_loop_is_that_of_single_searches(coordinates):
    m = watt()
    values = [0.0, 0.3, 0.6, 0.9]
    path = m.equilibrium(along={"s.angle": values}, stable=True, coordinates=coordinates)
    assert path.which.tolist() == [0, 1, 2, 3]
    for value, e in zip(values, path, strict=True):
        alone = m.equilibrium(e.state, parameters={"s.angle": value}, coordinates=coordinates)
        assert alone.iterations == 0 and alone.state.q == pytest.approx(e.state.q, abs=1e-12)
        assert e.joint("C").force == pytest.approx(alone.joint("C").force, abs=1e-9)


def test_a_parameter_may_move_joints():
    """The distance of the pins of a four-bar: positions and forces are those of a mechanism drawn so."""
    m = diagonal.build()
    path = m.equilibrium(along={"D.point": [(1.0, 0, 0), (1.05, 0, 0), (1.2, 0, 0)]})
    assert len(path) == 3 and path.asked == pytest.approx([1.0, 1.05, 1.2])
    assert path.parameter == "D.point[0]"
    for x, e in zip(path.values, path, strict=True):
        model = m.compile().with_parameters({"D.point": (x, 0, 0)})
        assert np.abs(model.constraints(e.state.q)).max() < 1e-12
        vdot, _ = model.acceleration(e.state.q, e.state.v)
        assert np.abs(vdot).max() < 1e-9


def test_a_coupler_holds_a_joint_over_a_range():
    """A drive has no parameter; the offset of a coupler of one joint holds a position that a family runs over."""
    m = watt()
    m.add_coupler("hold", ["A"], [1.0])
    path = m.equilibrium(along={"hold.offset": [0.0, 0.1, 0.2]})
    assert np.abs(path.position("A")) == pytest.approx([0.0, 0.1, 0.2], abs=1e-12)


def test_a_closed_family_ends_where_it_began():
    """Gravity that turns carries a pendulum around; by half of the circle the parameter turns back."""
    m = pt.Mechanism("pendulum")
    bar = m.add_rod("bar", start=(0, 0, 0), end=(0, -1, 0), mass=1.0)
    m.add_revolute("A", m.ground, bar, point=(0, 0, 0))
    m.add_force(bar, (0.0, 0.0, 0.0), (1, 0, 0), axes="body", name="side")
    # across the bar it holds it at m g sin(angle) / 2 = F, up to a fold at a quarter turn
    path = m.equilibrium(along={"side.value": [(0, 0.0, 0), (0, 2.0, 0), (0, 6.0, 0)]})
    assert [abs(fold.value) for fold in path.folds] == pytest.approx([9.81 / 2, 9.81 / 2], rel=1e-12)
    assert path.ends[1] == "it comes back to its start"
    assert path.which.tolist().count(0) == 2 and path.which.tolist().count(1) == 2
    for e, force in zip(path, path.values, strict=True):
        assert abs(9.81 / 2 * math.sin(e.state.position("A"))) == pytest.approx(force, abs=1e-10)


def test_several_numbers_change_together_and_have_units():
    """Both springs of the truss: half of the way of both is what one number is for each."""
    m = truss()
    m.add_force("block", (0, -10.0, 0), name="weight")
    together = m.equilibrium(along={"left.stiffness": ["1 N/mm", "2 N/mm"], "right.stiffness": [1000.0, 2000.0]})
    assert together.asked.tolist() == [0.0, 1.0] and together.parameter.endswith("(fraction)")
    for stiffness, e in zip((1000.0, 2000.0), together, strict=True):
        height = e.state.position("slide") + RISE
        assert load(height) * stiffness / STIFF == pytest.approx(10.0, rel=1e-10)


def test_what_is_no_line_is_refused():
    m = column()
    for along, words in [
        ({"load.value": [(0, 0, 0), (1, 1, 0), (2, 0, 0)]}, "do not lie on a straight line .row 1 is off"),
        ({"s.stiffness": [1.0]}, "at least two"),
        ({"s.stiffness": [1.0, 1.0]}, "given twice"),
        ({"s.stiffness": [1.0, 2.0], "s.angle": [0.0, 0.1, 0.2]}, "s.angle has 3 values, s.stiffness has 2"),
        ({"s.stiffness": "soft"}, "no unit 'soft'"),
        ([], "dict of parameters"),
        ({}, "dict of parameters"),
    ]:
        with pytest.raises(ArgumentError, match=words):
            m.equilibrium(along=along)
    with pytest.raises(DescriptionError, match="no such parameter"):
        m.equilibrium(along={"s.hardness": [1.0, 2.0]})
    path = m.equilibrium(along={"s.stiffness": [3.0, 4.0]})
    with pytest.raises(ArgumentError, match="none of the values"):
        path.at(5.0)
    with pytest.raises(IndexError):
        path[2]
    with pytest.raises(ArgumentError, match="number of an entry"):
        path["first"]


def test_a_family_ends_where_the_model_refuses_its_parameter():
    path = column().equilibrium(along={"bar.mass": [1.0, 0.5, 0.2]})
    assert path.which.tolist() == [0, 1, 2]
    assert "mass" in path.ends[1]


def test_a_family_as_figure_and_dataset(tmp_path):
    path = truss().equilibrium(along=pressed(0, 10, 30))
    figure = path.plot(path=tmp_path / "family.png")
    ax = figure.axes[0]
    assert ax.get_xlabel() == "load.value[1]" and ax.get_ylabel() == "slide"
    assert [text.get_text() for text in ax.get_legend().get_texts()][:3] == ["stable", "unstable", "fold"]
    data = path.to_xarray()
    assert data.q.dims == ("entry", "coordinate") and data.sizes["fold"] == 2
    assert data.stable.values.tolist() == [1, 1, 0, 0, 1, 1, 1]
    assert "folds at" in repr(path) and "fold 1" in path._repr_html_()


def test_a_preload_has_its_closed_form():
    """A bar held level by a torsion spring and by one to the ground."""
    m = pt.Mechanism("lamp")
    arm = m.add_rod("arm", start=(0, 0, 0), end=(1, 0, 0), mass=2.0)
    m.add_revolute("A", m.ground, arm, point=(0, 0, 0))
    m.add_spring("spring", m.ground, (0, 1, 0), arm, (1, 0, 0), stiffness=400.0, length=1.0)
    found = m.preload(["spring.length"])
    # its pull times the arm of 1/sqrt(2) m carries half of the weight
    pull = 2 * 9.81 / 2 * math.sqrt(2)
    assert found == {"spring.length": pytest.approx(math.sqrt(2) - pull / 400.0, rel=1e-13)}
    e = m.equilibrium(parameters=found)
    assert e.iterations == 0 and abs(e.state.position("A")) < 1e-13


def test_of_many_preloads_the_least_one_is_taken():
    """Equal springs take equal parts; the numbers do not depend on units that a mechanism is drawn in."""
    m = watt()
    m.add_torsion_spring("D", stiffness=20.0, name="other")
    m.add_spring("coil", m.ground, (1, 2, 0), "link", (0.2, 0, 0), stiffness=50.0, length=1.5)
    present = m.compile().parameters
    names = ["s.angle", "other.angle", "coil.length"]
    found = m.preload(names)
    e = m.equilibrium(parameters=found)
    assert e.iterations == 0 and np.abs(e.state.q).max() < 1e-12
    assert e.stable == m.equilibrium(e.state, parameters=found).stable
    # least of all: moving along what changes nothing makes it longer, in radians and lengths of a bar
    changes = np.array([found[name] - present[name] for name in names])

    def effort(at: np.ndarray) -> float:
        given = {name: present[name] + x for name, x in zip(names, at, strict=True)}
        model = m.compile().with_parameters(given)
        return float(model.at(np.zeros(model.core.nq)).h_d[0])

    base = effort(np.zeros(3))
    slope = np.array([effort(one) - base for one in np.eye(3)])
    assert slope @ changes == pytest.approx(-base, rel=1e-12)
    # d / scale^2 is along the slope: the angles have the same scale
    assert changes[0] / slope[0] == pytest.approx(changes[1] / slope[1], rel=1e-10)


def test_a_preload_that_cannot_hold_is_refused_with_what_is_left():
    m = pt.Mechanism("chain")
    a = m.add_rod("a", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    b = m.add_rod("b", start=(1, 0, 0), end=(2, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, a, point=(0, 0, 0))
    m.add_revolute("B", a, b, point=(1, 0, 0))
    m.add_torsion_spring("A", stiffness=100.0, name="s")
    with pytest.raises(ArgumentError, match=r"s.angle cannot hold .* they change 1 of the efforts along 2 degrees"):
        m.preload(["s.angle"])
    m.add_torsion_spring("B", stiffness=100.0, name="second")
    assert m.preload(["s.angle", "second.angle"]) == {
        "s.angle": pytest.approx(2 * 9.81 / 100), "second.angle": pytest.approx(9.81 / 2 / 100),
    }  # fmt: skip
    for unknown, words in [
        (["a.mass"], "a.mass is no load .its unit is kg"),
        ([], "at least one"),
        ("s.angle", "list of names"),
    ]:
        with pytest.raises(ArgumentError, match=words):
            m.preload(unknown)
    with pytest.raises(DescriptionError, match="no such parameter"):
        m.preload(["s.angel"])
    with pytest.raises(ArgumentError, match="moves joints"):
        w = watt()
        w.preload(["B.point"], at=w.assemble({"A": 0.1}))


def stationary(potential, low: float, high: float) -> list[float]:
    """Where a potential of one angle is stationary: sign changes of its slope on a fine grid, refined."""
    h = 1e-4

    def slope(x: float) -> float:
        return (potential(x - 2 * h) - 8 * potential(x - h) + 8 * potential(x + h) - potential(x + 2 * h)) / (12 * h)

    grid = np.linspace(low, high, 2001)
    values = np.array([slope(x) for x in grid])
    return [
        brentq(slope, a, b)
        for a, b, one, two in zip(grid, grid[1:], values, values[1:], strict=False)
        if one * two < 0.0
    ]


def test_all_equilibria_of_a_rhombus_on_its_three_branches():
    """Equal bars close in three ways, which meet where all bars are in line: as a parallelogram, with the rocker on the
    ground, or with the crank on it."""
    m = diagonal.build()
    masses = [m.compile().parameters[f"{name}.mass"] for name in ("crank", "coupler", "rocker")]
    spring = m.compile().parameters

    def potential(b: np.ndarray, c: np.ndarray) -> float:
        a, d = np.zeros(2), np.array([1.0, 0.0])
        heights = [(a + b)[1] / 2, (b + c)[1] / 2, (c + d)[1] / 2]
        weight = 9.81 * float(np.dot(masses, heights))
        return weight + spring["diagonal.stiffness"] / 2 * (np.hypot(*c) - spring["diagonal.length"]) ** 2

    def at(x: float) -> np.ndarray:
        return np.array([math.cos(x), math.sin(x)])

    one = np.array([1.0, 0.0])
    beside = 1e-3
    wanted = []
    for branch in (
        lambda x: potential(at(x), at(x) + one),
        lambda x: potential(at(x), np.zeros(2)),
        lambda x: potential(one, one + at(x)),
    ):
        for low, high in ((beside, math.pi - beside), (-math.pi + beside, -beside)):
            wanted += [branch(x) for x in stationary(branch, low, high)]
    found = [e.potential for e in m.equilibria(200)]
    away = [one for one in wanted if not any(abs(one - e) < 1e-6 for e in found)]
    assert len(wanted) >= 6 and not away, (wanted, found)


def test_all_equilibria_of_a_five_bar_that_an_independent_solver_finds():
    """By the angles of its cranks and the side of its knee: 200 starts of SciPy's root finder on both sides."""
    p, e = np.array([0.0, 0.0]), np.array([1.0, 0.0])
    lengths, masses = (0.6, 0.9, 0.95, 0.65), (1.0, 1.3, 1.6, 1.9)
    hook, stiffness, natural = np.array([0.5, 2.0]), 30.0, 0.5

    def knee(b, d, side):
        line = d - b
        square = line[0] ** 2 + line[1] ** 2
        along = (square + lengths[1] ** 2 - lengths[2] ** 2) / (2 * square)
        off = side * np.sqrt(lengths[1] ** 2 / square - along**2)
        return b + along * line + off * np.array([-line[1], line[0]])

    def potential(x, side):
        b = p + lengths[0] * np.array([np.cos(x[0]), np.sin(x[0])])
        d = e + lengths[3] * np.array([np.cos(x[1]), np.sin(x[1])])
        c = knee(b, d, side)
        heights = [(p + b)[1] / 2, (b + c)[1] / 2, (c + d)[1] / 2, (d + e)[1] / 2]
        pull = hook - c
        return (
            9.81 * sum(w * h for w, h in zip(masses, heights, strict=True))
            + stiffness / 2 * (np.sqrt(pull[0] ** 2 + pull[1] ** 2) - natural) ** 2
        )

    def gradient(x, side):
        # complex steps: exact to rounding
        return [potential(np.array(x, dtype=complex) + 1e-30j * one, side).imag / 1e-30 for one in np.eye(2)]

    x0 = np.array([1.9, 1.2])
    b = p + lengths[0] * np.array([math.cos(x0[0]), math.sin(x0[0])])
    d = e + lengths[3] * np.array([math.cos(x0[1]), math.sin(x0[1])])
    c = knee(b, d, 1)
    m = pt.Mechanism("five-bar")
    spots = [np.append(one, 0.0) for one in (p, b, c, d, e)]
    bars = [m.add_rod(f"bar {i}", start=spots[i], end=spots[i + 1], mass=masses[i]) for i in range(4)]
    for name, one, two, at in zip("PBCDE", [m.ground, *bars], [*bars, m.ground], spots, strict=True):
        m.add_revolute(name, one, two, point=at)
    m.add_spring(
        "coil", m.ground, np.append(hook, 0.0), bars[1], (lengths[1], 0, 0), stiffness=stiffness, length=natural
    )

    wanted = []
    random = np.random.default_rng(1)
    with np.errstate(invalid="ignore"):
        for side in (1, -1):
            for _ in range(100):
                got = root(gradient, random.uniform(-math.pi, math.pi, 2), args=(side,), tol=1e-13)
                if not np.abs(gradient(got.x, side)).max() < 1e-8:
                    continue
                height = float(potential(got.x, side))
                if not any(abs(height - other) < 1e-7 for other in wanted):
                    wanted.append(height)
    found = [e.potential for e in m.equilibria(40)]
    offset = wanted[0] - min(found, key=lambda one: abs(one - wanted[0]))
    assert abs(offset) < 1e-6
    away = [one for one in wanted if not any(abs(one - e) < 1e-6 for e in found)]
    assert len(wanted) >= 6 and not away, (sorted(wanted), found)


def test_a_known_equilibrium_is_not_found_again():
    """From near the bottom of a pendulum: Newton's method finds it, and beside it the top."""
    m = pt.Mechanism("pendulum")
    bar = m.add_rod("bar", start=(0, 0, 0), end=(0, -1, 0), mass=1.0)
    m.add_revolute("A", m.ground, bar, point=(0, 0, 0))
    core = m.compile().core
    none = np.zeros((0, 1))
    first = core.equilibrium(0.0, np.array([0.3]), False, none)["q"]
    assert first == pytest.approx([0.0], abs=1e-12)
    second = core.equilibrium(0.0, np.array([0.3]), False, first[None])["q"]
    assert math.cos(second[0]) == pytest.approx(-1.0, abs=1e-12)
    with pytest.raises(ArgumentError, match="no equilibrium was found from here after"):
        core.equilibrium(0.0, np.array([0.3]), False, np.array([first, second]))


def test_deflation_finds_what_the_first_search_does_not():
    """A double pendulum has four equilibria; few starts find all of them."""
    m = pt.Mechanism("double")
    a = m.add_rod("a", start=(0, 0, 0), end=(0, -1, 0), mass=1.0)
    b = m.add_rod("b", start=(0, -1, 0), end=(0, -2, 0), mass=1.0)
    m.add_revolute("A", m.ground, a, point=(0, 0, 0))
    m.add_revolute("B", a, b, point=(0, -1, 0))
    assert [e.stable for e in m.equilibria(10)] == [True, False, False, False]


def beside_its_anchor(at: tuple[float, float], anchor: tuple[float, float, float] = (0.3, -0.2, 0.0)) -> Any:
    """A double pendulum held by a spring in compression, and its state this far from the spring's length 0."""
    m = pt.Mechanism("double pendulum")
    m.add_rod("a", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_rod("b", start=(1, 0, 0), end=(2, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, "a", point=(0, 0, 0))
    m.add_revolute("B", "a", "b", point=(1, 0, 0))
    m.add_spring("S", m.ground, anchor, "b", m.bodies["b"].world((2, 0, 0)), stiffness=300.0, length=0.9)
    half = math.acos(0.5 * math.hypot(*anchor))
    return m, {"A": math.atan2(anchor[1], anchor[0]) + half + at[0], "B": -2.0 * half + at[1]}


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_soft_direction_beside_a_stiff_one_is_no_rest(coordinates: str) -> None:
    """At a spring length of 1e-7 the force turns with the least displacement across: a stiffness of 1e9, beside which
    that along the spring, 300 N/m, is rounding, and still 270 N act along it."""
    for size in (1e-6, 2e-7, 1e-8):
        for x, y in ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (-0.3, 0.8)):
            m, angles = beside_its_anchor((size * x, size * y))
            try:
                found = m.equilibrium(m.assemble(angles, coordinates=coordinates), coordinates=coordinates)
            except ArgumentError as error:
                assert "no equilibrium was found from here" in str(error)
                continue
            model = m.compile(coordinates=coordinates)
            assert np.max(np.abs(model.at(found.state.q, found.state.v, 0.0).vdot)) < 1e-6


def test_drives_that_rest_but_accelerate_have_no_equilibrium() -> None:
    m = pt.Mechanism("lift")
    m.add_body("cart", mass=1.0, inertia=(1, 1, 1))
    m.add_rod("rod", start=(0, 0, 0), end=(0, -1, 0), mass=1.0)
    m.add_prismatic("S", m.ground, "cart", axis=(1, 0, 0))
    m.add_revolute("A", "cart", "rod", point=(0, 0, 0))
    m.add_drive("S", position=lambda t: 0.1 * (1.0 - np.cos(5.0 * t)))
    for coordinates in ("relative", "absolute"):
        with pytest.raises(ArgumentError, match="rest at t = 0 s, but accelerate"):
            m.equilibrium(m.assemble(coordinates=coordinates), coordinates=coordinates)
        assert not m.linearize(m.assemble(coordinates=coordinates)).steady
    m.drives["drive of S"].change(position=0.1)
    assert m.equilibrium().state.position("A") == pytest.approx(0.0, abs=1e-9)
    assert m.linearize(m.equilibrium().state).steady


def pressed_on_a_stop(mass: float, length: float, drawn: float, exponent: float, stiffness: float = 2000.0) -> Any:
    """A pendulum between compliant stops, and the effort along its angle."""
    m = pt.Mechanism("pendulum")
    m.add_rod("bar", start=(0, 0, 0), end=(length * math.cos(drawn), length * math.sin(drawn), 0), mass=mass)
    m.add_revolute("A", m.ground, "bar", point=(0, 0, 0))
    m.add_stop("A", lower=-0.5, upper=0.15, stiffness=stiffness, exponent=exponent)

    def effort(angle: float) -> float:
        stop = stiffness * (max(-0.5 - angle, 0.0) ** exponent - max(angle - 0.15, 0.0) ** exponent)
        return -mass * 9.81 * length / 2 * math.cos(angle + drawn) + stop

    return m, effort


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_what_rests_on_a_stop_is_found_without_asking_for_stability(coordinates: str) -> None:
    """Newton's method knows nothing of a stop before it touches it: forces lead on from where they are least."""
    for mass, length, drawn, exponent, low, high in (
        (4.106, 0.389, 0.538, 2.0, -1.0, -0.5),
        (1.764, 0.774, 2.508, 1.5, 0.15, 0.5),
        (0.899, 0.359, 2.301, 1.0, 0.15, 0.5),
        (4.106, 0.389, math.pi - 0.538, 2.0, 0.15, 1.0),
    ):
        m, effort = pressed_on_a_stop(mass, length, drawn, exponent)
        found = m.equilibrium(m.assemble(coordinates=coordinates), coordinates=coordinates)
        assert found.stable
        assert found.state.position("A") == pytest.approx(brentq(effort, low, high), abs=1e-9)
    m, _ = pressed_on_a_stop(4.106, 0.389, 0.538, 2.0)
    assert m.equilibrium().state.position("A") == pytest.approx(-0.562578, abs=1e-6)
    # nothing holds a slide that is pushed: still refused, and at once
    slide = pt.Mechanism("slide")
    slide.add_body("block", mass=1.0, inertia=(1, 1, 1))
    slide.add_prismatic("S", slide.ground, "block", axis=(0, 1, 0))
    with pytest.raises(ArgumentError, match="no equilibrium was found"):
        slide.equilibrium()


@pytest.mark.parametrize(
    "values", [(-3.0, -1.0, 0.0, 1.0, 3.0), (3.0, 1.0, 0.0, -1.0, -3.0), (0.0, -4.0, 4.0, 1.0, 2.0)]
)
@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_family_over_a_torque_closes_after_a_turn(values: tuple[float, ...], coordinates: str) -> None:
    """m g l / 2 cos(angle) = torque, twice on each turn; a damper winds up nothing, a torsion spring does."""
    m = pt.Mechanism("pendulum")
    m.add_rod("bar", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, "bar", point=(0, 0, 0))
    m.add_torque("A", 0.0, name="T")
    m.add_torsion_spring("A", stiffness=0.0, damping=0.3, name="damper")
    path = m.equilibrium(along={"T.value": values}, coordinates=coordinates)
    assert sorted(abs(fold.value) for fold in path.folds) == pytest.approx([4.905, 4.905], rel=1e-9)
    assert path.ends[1] == "it comes back to its start" and len(path) == 10
    for e, torque in zip(path, path.values, strict=True):
        assert 4.905 * math.cos(e.state.position("A")) == pytest.approx(torque, abs=1e-9)
    m.forces["damper"].change(stiffness=0.1)
    wound = m.equilibrium(along={"T.value": values}, coordinates=coordinates)
    assert wound.ends[1] != "it comes back to its start" and len(wound) > 10


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_of_a_continuum_of_equilibria_one_is_listed(coordinates: str) -> None:
    """A slide that nothing holds above a pendulum; a ring of lengths of a spring; a free four-bar on two circuits."""
    m = pt.Mechanism("cart")
    m.add_body("cart", mass=1.0, inertia=(1, 1, 1))
    m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_prismatic("S", m.ground, "cart", axis=(1, 0, 0))
    m.add_revolute("A", "cart", "rod", point=(0, 0, 0))
    found = m.equilibria(10, coordinates=coordinates)
    assert [e.indifferent for e in found] == [1, 1] and [e.stable for e in found] == [None, False]
    ring = pt.Mechanism("ring", gravity=None)
    ring.add_body("bead", mass=1.0, inertia=(1, 1, 1), position=(0.7, 0, 0))
    ring.add_planar("P", ring.ground, "bead")
    ring.add_spring("s", ring.ground, (0, 0, 0), "bead", (0, 0, 0), stiffness=100.0, length=0.5)
    assert [e.indifferent for e in ring.equilibria(10, coordinates=coordinates)] == [2]
    free = pt.Mechanism("four-bar", gravity=None)
    spots = [(0, 0, 0), (0.3, 0.2, 0), (1.1, 0.9, 0), (1.2, 0, 0)]
    bars = [free.add_rod(f"bar {i}", start=spots[i], end=spots[i + 1], mass=1.0) for i in range(3)]
    for name, one, two, at in zip("ABCD", [free.ground, *bars], [*bars, free.ground], spots, strict=True):
        free.add_revolute(name, one, two, point=at)
    assert len(free.equilibria(12, coordinates=coordinates)) == 2


@pytest.mark.parametrize("drawn", [0.5, 0.0, -0.5])
@pytest.mark.parametrize("length", [0.02, 0.3])
def test_a_short_body_on_a_long_slide_has_all_its_equilibria(length: float, drawn: float) -> None:
    """The spring tells how far they are apart, not the body: +-0.5 and the middle; of a table over x: both."""

    def slide() -> pt.Mechanism:
        m = pt.Mechanism("slide", gravity=None)
        m.add_rod("rod", start=(drawn, 0, 0), end=(drawn + length, 0, 0), mass=1.0)
        m.add_prismatic("P", m.ground, "rod", axis=(1, 0, 0))
        return m

    m = slide()
    m.add_spring("s", m.ground, (0, 0.3, 0), "rod", (0, 0, 0), stiffness=100.0, length=math.hypot(0.5, 0.3))
    found = sorted(e.state.position("P") + drawn for e in m.equilibria(30))
    assert found == pytest.approx([-0.5, 0.0, 0.5], abs=1e-9)
    m = slide()
    x = np.linspace(-2.0, 2.0, 401)
    m.add_torque("P", (x - drawn, 0.25 - x**2), over=pt.Coordinate("P"))
    found = sorted(e.state.position("P") + drawn for e in m.equilibria(30))
    assert found == pytest.approx([-0.5, 0.5], abs=1e-9)


def test_equilibria_say_where_they_are() -> None:
    found = [repr(e) for e in pt.catalogue.load("four-bar").equilibria(20)]
    assert len(set(found)) == len(found) > 1
    assert all(text.startswith("<Equilibrium at A = ") for text in found)


def test_a_five_bar_has_twelve_equilibria() -> None:
    """Some beside each other, where starts used to take hundreds of evaluations to fail."""
    assert len(pt.catalogue.load("five-bar").equilibria(60)) == 12
