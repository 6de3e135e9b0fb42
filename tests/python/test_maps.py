"""Singular curves, workspaces and placements against closed forms.

five-bar   type II: the distal links are in line (B, D and P on a line, or B = D)
           type I: a crank and its link are in line (P on circles about the bases)
3-RRR      type II: the lines of the distal links meet in one point or are parallel (Pluecker coordinates)
           type I: a leg is stretched or folded
four-bar   dead points: coupler and rocker in line; parallelogram: flat
"""

import re
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray

import partita as pt
from partita.errors import ArgumentError, AssemblyError, UnknownNameError

FloatArray = NDArray[np.float64]
TURN = np.linspace(-np.pi, np.pi, 25)
CRANK, ROD, ROD2, CRANK2, BASE = 1.0, 1.2, 1.3, 0.9, 1.1
ANGLES = (2.0, 1.0)
TO_ROUND_OFF = 1e-9


def unit(angle: float) -> FloatArray:
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def meeting(b: FloatArray, d: FloatArray, one: float, two: float) -> FloatArray:
    """Where circles about b and d meet, to the left of the line from b to d."""
    v = d - b
    length = np.linalg.norm(v)
    x = (length**2 + one**2 - two**2) / (2.0 * length)
    across = np.array([-v[1], v[0], 0.0]) / length
    return b + x * v / length + np.sqrt(one**2 - x**2) * across


def five_bar(scale: float = 1.0, turned: float = 0.0) -> pt.Mechanism:
    """A five-bar linkage RRRRR whose cranks A and E are driven; larger, or drawn at an angle."""
    m = pt.Mechanism("five-bar", gravity=None)
    rotation = np.array([unit(turned), unit(turned + np.pi / 2), (0, 0, 1)]).T
    a, e = np.zeros(3), np.array([BASE, 0, 0])
    b, d = a + CRANK * unit(ANGLES[0]), e + CRANK2 * unit(ANGLES[1])
    a, b, c, d, e = (scale * rotation @ x for x in (a, b, meeting(b, d, ROD, ROD2), d, e))
    rods = [m.add_rod(name, start=x, end=y, mass=1.0) for name, x, y in
            (("crank 1", a, b), ("rod 1", b, c), ("rod 2", d, c), ("crank 2", e, d))]  # fmt: skip
    m.add_revolute("A", m.ground, rods[0], point=a)
    m.add_revolute("B", rods[0], rods[1], point=b)
    m.add_revolute("C", rods[1], rods[2], point=c)
    m.add_revolute("D", rods[3], rods[2], point=d)
    m.add_revolute("E", m.ground, rods[3], point=e)
    return m


P = ("rod 1", (ROD, 0.0, 0.0))


def cranks(a: FloatArray, e: FloatArray) -> tuple[FloatArray, FloatArray]:
    """B and D (..., 2) for the coordinates of A and E."""
    a, e = np.asarray(a) + ANGLES[0], np.asarray(e) + ANGLES[1]
    b = CRANK * np.stack([np.cos(a), np.sin(a)], axis=-1)
    d = CRANK2 * np.stack([np.cos(e), np.sin(e)], axis=-1)
    return b, d + np.array([BASE, 0.0])


@cache
def type_two(coordinates: str = "relative") -> pt.analyses.Singularities:
    return five_bar().singularities({"A": TURN, "E": TURN}, of=("A", "E"), coordinates=coordinates)


@cache
def type_one() -> pt.analyses.Singularities:
    return five_bar().singularities({"A": TURN, "E": TURN}, of=[(*P, "xy")], kind="outputs")


def nearest(points: FloatArray, found: pt.analyses.Singularities, keys: tuple[str, ...] = ("A", "E")) -> FloatArray:
    """Distance of each point of the goals, counted within a turn, from the polygons of the curves."""
    least = np.full(len(points), np.inf)
    for curve in found:
        line = np.stack([curve.goals[key] for key in keys], axis=1)
        if curve.closed:
            line = np.vstack([line, line[:1]])
        one, step = line[:-1], np.diff(line, axis=0)
        step = (step + np.pi) % (2 * np.pi) - np.pi
        apart = (points[:, None] - one + np.pi) % (2 * np.pi) - np.pi
        part = np.clip(np.sum(apart * step, axis=2) / np.maximum(np.sum(step**2, axis=1), 1e-300), 0, 1)
        least = np.minimum(least, np.linalg.norm(apart - part[..., None] * step, axis=2).min(axis=1))
    return least


def sign_changes(values: FloatArray, axes: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Points on the lines of a grid between which a function has different signs, by linear interpolation."""
    found = []
    for axis in (0, 1):
        one, two = np.moveaxis(values, axis, 0)[:-1], np.moveaxis(values, axis, 0)[1:]
        i, j = np.nonzero(np.isfinite(one) & np.isfinite(two) & (one * two < 0))
        part = one[i, j] / (one[i, j] - two[i, j])
        along = axes[axis][i] + part * (axes[axis][1] - axes[axis][0])
        pair = (along, axes[1][j]) if axis == 0 else (axes[0][j], along)
        found.append(np.stack(pair, axis=1))
    return np.vstack(found)


def test_five_bar_actuators_are_singular_where_the_distal_links_are_in_line() -> None:
    found = type_two()
    assert len(found) == 4 and all(curve.measure.max() < 1e-12 for curve in found)
    for curve in found:
        b, d = cranks(curve.goals["A"], curve.goals["E"])
        length = np.linalg.norm(b - d, axis=1)
        assert np.abs((length - (ROD + ROD2)) * (length - abs(ROD - ROD2))).max() < TO_ROUND_OFF
        p = curve.path(*P)[:, :2]
        one, two = p - b, p - d
        assert np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).max() < TO_ROUND_OFF


def test_five_bar_every_root_of_the_closed_form_is_on_a_curve() -> None:
    fine = np.linspace(-np.pi, np.pi, 721)
    b, d = cranks(*np.meshgrid(fine, fine, indexing="ij"))
    length = np.linalg.norm(b - d, axis=-1)
    for limit in (ROD + ROD2, abs(ROD - ROD2)):
        roots = sign_changes(length - limit, (fine, fine))
        assert len(roots) and nearest(roots, type_two()).max() < 5e-3


def test_five_bar_outputs_are_singular_on_circles_about_the_bases() -> None:
    found = type_one()
    assert len(found) and all(curve.measure.max() < 1e-12 for curve in found)
    for curve in found:
        p = curve.path(*P)[:, :2]
        one, two = np.linalg.norm(p, axis=1), np.linalg.norm(p - [BASE, 0.0], axis=1)
        legs = [(one - (CRANK + ROD)), (one - abs(CRANK - ROD)), (two - (CRANK2 + ROD2)), (two - abs(CRANK2 - ROD2))]
        assert np.abs(legs).min(axis=0).max() < TO_ROUND_OFF


def test_five_bar_reaches_every_part_of_the_circles() -> None:
    """Points of the circles that both legs reach, with both assemblies of the other leg."""
    found = type_one()
    missing, count = 0.0, 0
    for base, own, other, other_base in (((0.0, 0.0), (CRANK, ROD), (CRANK2, ROD2), (BASE, 0.0)),
                                         ((BASE, 0.0), (CRANK2, ROD2), (CRANK, ROD), (0.0, 0.0))):  # fmt: skip
        for radius in (sum(own), abs(own[0] - own[1])):
            angle = np.linspace(-np.pi, np.pi, 361)
            p = np.array(base) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            far = np.linalg.norm(p - other_base, axis=1)
            p = p[(far < sum(other) - 0.01) & (far > abs(other[0] - other[1]) + 0.01)]
            paths = np.vstack([curve.path(*P)[:, :2] for curve in found])
            apart = np.linalg.norm(p[:, None] - paths[None], axis=2).min(axis=1) if len(p) else np.zeros(1)
            missing, count = max(missing, float(apart.max())), count + len(p)
    assert count > 100 and missing < 0.08


def test_absolute_coordinates_have_the_same_curves() -> None:
    one, two = type_two(), type_two("absolute")
    assert sorted(curve.closed for curve in one) == sorted(curve.closed for curve in two)
    for a, b in ((one, two), (two, one)):
        points = np.vstack([np.stack([curve.goals["A"], curve.goals["E"]], axis=1) for curve in a])
        assert nearest(points[::3], b).max() < 5e-3


def test_curves_depend_neither_on_units_nor_on_how_the_drawing_is_turned() -> None:
    small = np.linspace(-1.0, 1.0, 9)
    grid = {"A": small, "E": small}
    one = five_bar().singularities(grid, of=("A", "E"))
    for other in (five_bar(1000.0), five_bar(0.001), five_bar(1.0, 0.7)):
        two = other.singularities(grid, of=("A", "E"))
        assert len(one) == len(two)
        points = np.vstack([np.stack([curve.goals["A"], curve.goals["E"]], axis=1) for curve in two])
        assert nearest(points, one).max() < 5e-3


def three_rrr() -> pt.Mechanism:
    """A planar platform on three legs with driven cranks 1, 2 and 3."""
    m = pt.Mechanism("3-RRR", gravity=None)
    plate = m.add_body("plate", mass=1.0, inertia=(1, 1, 1), position=(0.1, 0.05, 0))
    for i, (foot, head) in enumerate(zip(FEET, HEADS, strict=True)):
        end = np.array([0.1, 0.05, 0.0]) + head
        knee = meeting(foot, end, LEG[0], LEG[1])
        crank = m.add_rod(f"crank {i + 1}", start=foot, end=knee, mass=1.0)
        rod = m.add_rod(f"rod {i + 1}", start=knee, end=end, mass=1.0)
        m.add_revolute(f"{i + 1}", m.ground, crank, point=foot)
        m.add_revolute(f"knee {i + 1}", crank, rod, point=knee)
        m.add_revolute(f"head {i + 1}", rod, plate, point=end)
    return m


FEET = [1.0 * unit(np.radians(angle)) for angle in (210.0, 330.0, 90.0)]
HEADS = [0.35 * unit(np.radians(angle)) for angle in (200.0, 335.0, 85.0)]
LEG = (0.6, 0.75)
ACROSS = np.linspace(-0.45, 0.45, 13)
POSE = {("plate", (0.0, 0.0, 0.0), "x"): ACROSS, ("plate", (0.0, 0.0, 0.0), "y"): ACROSS, "plate": 0.2}


def pluecker(knees: list[FloatArray], heads: list[FloatArray]) -> FloatArray:
    """Determinant of the lines of the distal links of length one."""
    rows = []
    for knee, head in zip(knees, heads, strict=True):
        s = (head - knee) / LEG[1]
        rows.append(np.stack([s[..., 0], s[..., 1], knee[..., 0] * s[..., 1] - knee[..., 1] * s[..., 0]], axis=-1))
    one, two, three = rows
    return np.asarray(np.sum(one * np.cross(two, three), axis=-1))


def test_planar_platform_actuators_are_singular_where_three_lines_meet() -> None:
    found = three_rrr().singularities(POSE, of=("1", "2", "3"))
    assert len(found) and all(curve.measure.max() < 1e-12 for curve in found)
    for curve in found:
        knees = [curve.path(f"crank {i}", (LEG[0], 0, 0))[:, :2] for i in (1, 2, 3)]
        heads = [curve.path(f"rod {i}", (LEG[1], 0, 0))[:, :2] for i in (1, 2, 3)]
        assert np.abs(pluecker(knees, heads)).max() < TO_ROUND_OFF
    # every root on a fine grid, in all eight working modes
    fine = np.linspace(-0.45, 0.45, 181)
    centre = np.stack(np.meshgrid(fine, fine, indexing="ij"), axis=-1)
    rotation = np.array([[np.cos(0.2), -np.sin(0.2)], [np.sin(0.2), np.cos(0.2)]])
    heads = [centre + rotation @ head[:2] for head in HEADS]
    curves = np.vstack([curve.path("plate")[:, :2] for curve in found])
    count = 0
    for signs in np.ndindex(2, 2, 2):
        knees = []
        for sign, foot, head in zip(signs, FEET, heads, strict=True):
            v = head - foot[:2]
            length = np.linalg.norm(v, axis=-1)
            x = (length**2 + LEG[0] ** 2 - LEG[1] ** 2) / (2 * length)
            with np.errstate(invalid="ignore"):
                h = (2 * sign - 1) * np.sqrt(LEG[0] ** 2 - x**2)
            across = np.stack([-v[..., 1], v[..., 0]], axis=-1)
            knees.append(foot[:2] + (x[..., None] * v + h[..., None] * across) / length[..., None])
        roots = sign_changes(pluecker(knees, heads), (fine, fine))
        count += len(roots)
        if len(roots):
            assert np.linalg.norm(roots[:, None] - curves[None], axis=2).min(axis=1).max() < 0.05
    assert count > 100


def test_planar_platform_outputs_are_singular_where_a_leg_is_stretched() -> None:
    of = [("plate", (0.0, 0.0, 0.0), "xy"), "plate"]
    found = three_rrr().singularities(POSE, of=of, kind="outputs")
    assert len(found)
    for curve in found:
        far = [curve.path(f"rod {i}", (LEG[1], 0, 0)) - FEET[i - 1] for i in (1, 2, 3)]
        length = np.linalg.norm(far, axis=2)
        legs = np.abs((length - sum(LEG)) * (length - abs(LEG[0] - LEG[1])))
        assert legs.min(axis=0).max() < TO_ROUND_OFF


def crank_rocker() -> pt.Mechanism:
    m = pt.Mechanism("four-bar", gravity=None)
    points = [np.zeros(3), np.array([0.0, 0.3, 0.0]), np.array([0.8, 0.7, 0.0]), np.array([1.0, 0.0, 0.0])]
    crank = m.add_rod("crank", start=points[0], end=points[1], mass=1.0)
    coupler = m.add_rod("coupler", start=points[1], end=points[2], mass=1.0)
    rocker = m.add_rod("rocker", start=points[3], end=points[2], mass=1.0)
    bodies = [m.ground, crank, coupler, rocker, m.ground]
    for i, name in enumerate("ABCD"):
        m.add_revolute(name, bodies[i], bodies[i + 1], point=points[i])
    return m


def test_four_bar_has_dead_points_of_its_rocker() -> None:
    m = crank_rocker()
    found = m.singularities({"A": TURN}, of=["D"])
    b, c = np.hypot(0.8, 0.4), np.hypot(0.2, 0.7)
    expected = []
    for sign, closing in ((1.0, 0.3 + b), (-1.0, b - 0.3)):
        # crank and coupler in line: AC = b +- a
        cos = (closing**2 + 1.0 - c**2) / (2 * closing)
        for mirrored in (1.0, -1.0):
            angle = mirrored * np.arccos(cos) + (0.0 if sign > 0 else np.pi)
            expected.append((angle - np.pi / 2 + np.pi) % (2 * np.pi) - np.pi)
    assert np.allclose(found.points.goals["A"], sorted(expected), atol=1e-12)
    assert found.points.measure.max() < 1e-12 and not len(found)
    run = m.kinematics({"A": TURN})
    own = {round(float(point.goals["A"]), 9) for point in run.dead_points if point.joint == "D"}
    assert own <= {round(float(x), 9) for x in found.points.goals["A"]}


def parallelogram(arm: bool) -> pt.Mechanism:
    """A parallelogram linkage; with an arm that carries all of it, its flat positions form curves."""
    m = pt.Mechanism("parallelogram", gravity=None)
    shift = np.array([0.5, 0.0, 0.0])
    base = m.ground
    if arm:
        base = m.add_rod("arm", start=-shift, end=(1.0, 0, 0), mass=1.0)
        m.add_revolute("O", m.ground, base, point=-shift)
    up = 0.6 * unit(1.1)
    one = m.add_rod("one", start=(0, 0, 0), end=up, mass=1.0)
    top = m.add_rod("top", start=up, end=up + 2 * shift, mass=1.0)
    two = m.add_rod("two", start=2 * shift, end=up + 2 * shift, mass=1.0)
    m.add_revolute("A", base, one, point=(0, 0, 0))
    m.add_revolute("B", one, top, point=up)
    m.add_revolute("C", top, two, point=up + 2 * shift)
    m.add_revolute("D", base, two, point=2 * shift)
    return m


def test_constraints_of_a_parallelogram_are_singular_where_it_is_flat() -> None:
    found = parallelogram(False).singularities({"A": TURN}, kind="constraints")
    angle = found.points.goals["A"] + 1.1
    assert len(angle) == 2 and np.abs(np.sin(angle)).max() < TO_ROUND_OFF
    found = parallelogram(True).singularities({"A": TURN, "O": np.linspace(-1.0, 1.0, 5)}, kind="constraints")
    assert len(found) == 2
    for curve in found:
        assert np.abs(np.sin(curve.goals["A"] + 1.1)).max() < TO_ROUND_OFF
        assert np.isclose(np.ptp(curve.goals["O"]), 2.0, atol=1e-6)


def test_margins_of_a_workspace_are_those_of_inverse_dynamics() -> None:
    m, model = five_bar(), five_bar().compile()
    small = np.linspace(-0.25, 0.25, 4)
    w = m.workspace({"A": small, "E": small}, P, actuators=("A", "E"), outputs=[(*P, "xy")], assemblies=True)
    assert w.margin.shape == (4, 4) and w.reached.all() and w.positions is not None and w.outputs is not None
    for index in ((0, 0), (2, 1), (3, 3)):
        state = w.state(*index)
        assert np.isclose(w.margin[index], m.inverse_dynamics(state, ["A", "E"]).margin[0], rtol=1e-12)
        assert np.isclose(w.margin[index], model.actuated(state, ["A", "E"]).margin, rtol=1e-12)
        b, d = cranks(small[index[0]], small[index[1]])
        expected = meeting(np.append(b, 0), np.append(d, 0), ROD, ROD2)
        assert np.allclose(w.positions[index], expected, atol=1e-12)
    assert w.assemblies is not None and (w.assemblies == 2).all()


def test_positions_beyond_the_limit_are_not_reached() -> None:
    w = five_bar().workspace({"A": TURN, "E": TURN}, actuators=("A", "E"), assemblies=True)
    b, d = cranks(*np.meshgrid(TURN, TURN, indexing="ij"))
    length = np.linalg.norm(b - d, axis=-1)
    closes = (length <= ROD + ROD2) & (length >= abs(ROD - ROD2))
    assert (w.reached == closes).all()
    assert w.assemblies is not None and (w.assemblies == 2 * closes).all()
    index = tuple(int(i) for i in np.argwhere(~closes)[0])
    with pytest.raises(AssemblyError, match=re.escape(str(index))):
        w.state(*index)
    assert np.isnan(w.margin[index]) and index in w.reasons


def test_placement_ranks_as_single_margins_do() -> None:
    m = five_bar()
    small = np.linspace(-0.25, 0.25, 3)
    w = m.workspace({"A": small, "E": small})
    p = m.placement(2, over=w)
    assert len(p) == 10 and p.exhaustive
    states = [w.state(i, j) for i in range(3) for j in range(3)]
    own = {pair: min(float(m.inverse_dynamics(state, list(pair)).margin[0]) for state in states)
           for pair in combinations("ABCDE", 2)}  # fmt: skip
    for one in p:
        assert np.isclose(one.worst, own[tuple(sorted(one.names))], rtol=1e-10)
    assert [one.worst for one in p] == sorted((one.worst for one in p), reverse=True)
    assert p.best.names == max(own, key=lambda pair: own[pair])
    three = m.placement(3, over=w)
    assert three.best.worst >= p.best.worst - 1e-12


def test_bounds_find_the_same_sets_as_comparing_all(monkeypatch: pytest.MonkeyPatch) -> None:
    from partita.analyses import placement

    random = np.random.default_rng(4)
    scaled = random.normal(size=(12, 3, 9))
    scaled /= np.linalg.norm(scaled, axis=1, keepdims=True)
    for count in (3, 4):
        every, total, exhaustive = placement.ranked(scaled, count, 3)
        assert exhaustive and total == len(every)
        monkeypatch.setattr(placement, "COMPARED", 0)
        best, _, all_of_them = placement.ranked(scaled, count, 3)
        monkeypatch.undo()
        assert not all_of_them and [which for which, _ in best] == [which for which, _ in every[: len(best)]]


def test_encoders_on_the_cranks_do_not_separate_assemblies() -> None:
    m = five_bar()
    small = np.linspace(-0.25, 0.25, 4)
    w = m.workspace({"A": small, "E": small}, assemblies=True)
    p = m.placement(2, over=w, of="encoders")
    cranks_alone = next(one for one in p if set(one.names) == {"A", "E"})
    assert cranks_alone.separation < 1e-9
    other = next(one for one in p if set(one.names) == {"A", "B"})
    assert other.separation > 0.1
    alone = m.placement(2, ["A", "E", "C"], over=w, of="encoders")
    assert alone.further is not None and alone.further.separation > 0.1
    assert any("further encoder" in note for note in alone.notes)


def test_results_are_shown_and_handed_on() -> None:
    m = five_bar()
    small = np.linspace(-1.0, 1.0, 7)
    grid = {"A": small, "E": small}
    found, w = m.singularities(grid, of=("A", "E")), m.workspace(grid)
    assert "type" not in repr(found) and "curve" in repr(found) and "<table>" in found._repr_html_()
    assert "reached" in repr(w) and "<table>" in w._repr_html_()
    figure = w.plot()
    found.plot(ax=figure.axes[0])
    found.plot(P)
    data = w.to_xarray()
    assert data["margin"].shape == (7, 7)
    points = found.to_xarray()
    assert points["measure"].size == sum(map(len, found)) + len(found.points)
    p = m.placement(2, over=w)
    assert "best" in repr(p) and "<table>" in p._repr_html_()
    p.plot()
    assert found[0].state(0).is_of(m.compile().summary)


SMALL = np.linspace(-0.2, 0.2, 3)
GRID = {"A": SMALL, "E": SMALL}


@pytest.mark.parametrize(
    ("grid", "of", "kind", "words"),
    [
        ({}, ("A", "E"), "actuators", "grid is empty"),
        ({"A": SMALL}, ("A", "E"), "actuators", "1 goal (A) for 2 degrees of freedom; name 1 more"),
        ({"A": SMALL, "E": SMALL, "B": 0.0}, ("A", "E"), "actuators", "leave out 1"),
        ({"A": 0.0, "E": 0.0}, ("A", "E"), "actuators", "nothing varies"),
        ({"A": [], "E": SMALL}, ("A", "E"), "actuators", "is empty"),
        ({"A": [0.0, np.nan], "E": SMALL}, ("A", "E"), "actuators", "[1] is nan"),
        ({"A": [0.0, 0.0], "E": SMALL}, ("A", "E"), "actuators", "0 twice"),
        ({"A": [[0.0, 1.0]], "E": SMALL}, ("A", "E"), "actuators", "shape (1, 2)"),
        ({"A": "x", "E": SMALL}, ("A", "E"), "actuators", "grid['A']"),
        ({(*P, "xy"): SMALL}, ("A", "E"), "actuators", "name each by itself"),
        (GRID, ("A",), "actuators", "of names 1 measurement; 2 are needed"),
        (GRID, ("A", "A"), "actuators", "'A' twice"),
        (GRID, "A", "actuators", "list of names"),
        (GRID, ["A", "A"], "outputs", "'A' twice"),
        (GRID, None, "outputs", "name the outputs"),
        (GRID, (*P, "xy"), "outputs", "in a list"),
        (GRID, [5.0, 6.0], "outputs", "in a list"),
        (GRID, ("A",), "constraints", "leave it out"),
        (GRID, ("A", "E"), "type I", "kind"),
        (5, ("A", "E"), "actuators", "must be a dict"),
    ],
)
def test_bad_requests_are_refused(grid: object, of: object, kind: str, words: str) -> None:
    with pytest.raises(ArgumentError, match=re.escape(words)):
        five_bar().singularities(grid, of=of, kind=kind)  # type: ignore[arg-type]


def test_drives_are_actuators_and_move_nothing() -> None:
    m = five_bar()
    m.add_drive("A", position=lambda t: t)
    m.add_drive("E", position=lambda t: 0.5 * t)
    small = np.linspace(-1.0, 1.0, 9)
    grid = {"A": small, "E": small}
    own, other = m.singularities(grid), five_bar().singularities(grid, of=("A", "E"))
    assert own.of == ("A", "E") and len(own) == len(other) > 0
    assert m.workspace(GRID).reached.all()


def ankle() -> pt.Mechanism:
    """A platform on a universal joint, and two cranks with rods whose ball joints let them spin."""
    m = pt.Mechanism("ankle", gravity=None)
    platform = m.add_body("platform", mass=1.0, inertia=(0.01, 0.01, 0.01))
    m.add_universal("U", m.ground, platform, point=(0, 0, 0), axis1=(1, 0, 0), axis2=(0, 1, 0))
    for side, name in ((1, "L"), (-1, "R")):
        c, e, f = (
            np.array(x) for x in ((-0.05, 0.06 * side, 0.25), (-0.1, 0.06 * side, 0.25), (-0.06, 0.05 * side, 0.02))
        )
        crank = m.add_rod("crank " + name, start=c, end=e, mass=0.1)
        rod = m.add_rod("rod " + name, start=e, end=f, mass=0.1)
        m.add_revolute("M" + name, m.ground, crank, point=c, axis=(0, 1, 0))
        m.add_spherical("S" + name, crank, rod, point=e)
        m.add_spherical("T" + name, rod, platform, point=f)
    return m


def test_rods_that_spin_freely_leave_the_maps_alone() -> None:
    """Actuators are singular where moments of the rods' forces about the axes of the universal joint are parallel."""
    m = ankle()
    grid = {"U.turn1": np.linspace(-0.9, 0.9, 5), "U.turn2": np.linspace(-1.4, 1.4, 5)}
    found = m.singularities(grid, of=("ML", "MR"))
    assert len(found) and all(curve.measure.max() < 1e-12 for curve in found)
    for curve in found:
        axes = (np.array([1.0, 0.0, 0.0]), curve.path("platform", (0, 1.0, 0)) - curve.path("platform"))
        moments = []
        for name, y in (("L", 0.05), ("R", -0.05)):
            head = curve.path("platform", (-0.06, y, 0.02))
            rod = curve.path(f"rod {name}") - head
            moment = np.cross(head, rod / np.linalg.norm(rod, axis=1)[:, None])
            moments.append([np.sum(moment * axis, axis=-1) for axis in axes])
        (a, b), (c, d) = moments
        assert np.abs(a * d - b * c).max() < TO_ROUND_OFF
    w = m.workspace({"ML": SMALL, "MR": SMALL})
    state = w.state(0, 2)
    assert np.isclose(w.margin[0, 2], m.inverse_dynamics(state, ["ML", "MR"]).margin[0], rtol=1e-10)
    assert m.placement(2, ["ML", "MR", "U.turn1", "U.turn2"], over=w).compared == 6


def test_on_one_branch_curves_end_where_it_does() -> None:
    m = five_bar()
    grid = {(*P, "x"): np.linspace(-0.5, 1.5, 9), (*P, "y"): np.linspace(0.3, 2.0, 9)}
    every, one = m.singularities(grid, of=("A", "E")), m.singularities(grid, of=("A", "E"), near=m.assemble())
    assert 0 < sum(map(len, one)) < sum(map(len, every))
    assert any("end of the branch" in curve.ends for curve in one) or len(one) < len(every)
    for curve in one:
        # the knees stay on their sides of the lines from the bases to P
        p = curve.path(*P)
        for crank, base in (("crank 1", np.zeros(3)), ("crank 2", np.array([BASE, 0.0, 0.0]))):
            knee = curve.path("rod 1" if crank == "crank 1" else "rod 2") - base
            side = np.cross(p - base, knee)[:, 2]
            assert (side > -1e-6).all() or (side < 1e-6).all()
    branch = m.singularities({"A": TURN, "E": TURN}, of=("A", "E"), near=m.assemble())
    assert len(branch) and branch.samples < type_two().samples


def test_what_cannot_be_reached_is_refused() -> None:
    m = five_bar()
    far = {(*P, "x"): [5.0, 6.0], (*P, "y"): [5.0, 6.0]}
    with pytest.raises(AssemblyError, match=r"none of .* positions can be reached"):
        m.singularities(far, of=("A", "E"))
    with pytest.raises(AssemblyError, match="none of 4 positions can be reached"):
        m.workspace(far, actuators=("A", "E"))
    with pytest.raises(UnknownNameError):
        m.singularities({"A": SMALL, "nowhere": SMALL}, of=("A", "E"))
    with pytest.raises(ArgumentError, match="Workspace"):
        m.placement(2, over=5)  # type: ignore[arg-type]
    w = m.workspace(GRID)
    for count, words in ((1, "2 degrees of freedom"), (6, "5 candidates"), (2.5, "whole number")):
        with pytest.raises(ArgumentError, match=words):
            m.placement(count, over=w)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="is that of"):
        crank_rocker().placement(1, over=w)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_all_positions_of_a_point_are_found_around_holes(coordinates: str) -> None:
    """The joint between the rods of a five-bar whose rods are shorter than its cranks by parts: two rings meet, and
    straight lines from the drawing cross their holes."""
    left, right = (0.6, 0.9), (0.65, 0.95)
    b, d = np.array([-0.2, 0.6, 0.0]), np.array([1.2, 0.6, 0.0])
    b[:2] *= left[0] / np.linalg.norm(b)
    d[:2] = np.array([1.0, 0.0]) + (d[:2] - [1.0, 0.0]) * right[0] / np.linalg.norm(d[:2] - [1.0, 0.0])
    c = meeting(b, d, left[1], right[1])
    spots = [np.zeros(3), b, c, d, np.array([1.0, 0.0, 0.0])]
    m = pt.Mechanism("five-bar", gravity=None)
    bars = [m.add_rod(f"bar {i}", start=spots[i], end=spots[i + 1], mass=1.0) for i in range(4)]
    for name, one, two, at in zip("ABCDE", [m.ground, *bars], [*bars, m.ground], spots, strict=True):
        m.add_revolute(name, one, two, point=at)
    point = ("bar 1", (0.9, 0.0, 0.0))
    x, y = np.linspace(-0.95, 1.95, 20), np.linspace(-1.55, 1.55, 20)[::-1]
    w = m.workspace({(*point, "x"): x, (*point, "y"): y}, point, actuators=("A", "E"), coordinates=coordinates)
    across, up = np.meshgrid(x, y, indexing="ij")
    possible = np.ones(across.shape, dtype=bool)
    for base, (crank, rod) in ((0.0, left), (1.0, right)):
        size = np.hypot(across - base, up)
        possible &= (size <= crank + rod) & (size >= rod - crank)
    assert (w.reached == possible).all() and 100 < possible.sum() < 300
    assert w.positions is not None
    assert np.abs(w.positions[possible][:, 0] - across[possible]).max() < 1e-10
    assert np.abs(w.positions[possible][:, 1] - up[possible]).max() < 1e-10
    # on the branch of the drawing everywhere: each rod on its side of its crank
    for rod, crank in (("bar 1", "bar 0"), ("bar 2", "bar 3")):
        ends = [w.path(crank, (0, 0, 0)), w.path(rod, (0, 0, 0)), w.path(rod, (0.9, 0, 0))]
        if rod == "bar 2":
            ends = [w.path("bar 3", (right[0], 0, 0)), w.path("bar 3", (0, 0, 0)), w.path("bar 2", (0, 0, 0))]
        arm, rod_arm = (ends[1] - ends[0])[possible], (ends[2] - ends[1])[possible]
        side = arm[:, 0] * rod_arm[:, 1] - arm[:, 1] * rod_arm[:, 0]
        assert (side > 0.0).all() or (side < 0.0).all()
    out = tuple(int(i) for i in np.argwhere(~possible)[0])
    assert "cannot be reached" in w.reasons[out]
