"""Points given in the axes of a body or in the world of the drawing, and remarks on those that seem mistaken."""

from __future__ import annotations

import copy
import logging
import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import partita as pt
from partita.builder.points import misplaced
from partita.builder.records import Point

P, X, TURN = (0.3, -0.2, 0.1), (1.0, 2.0, 3.0), Rotation.from_rotvec((0.4, -0.5, 0.9))
WORLD = tuple((TURN.apply(P) + X).tolist())


def drawn() -> tuple[pt.Mechanism, Any, Any]:
    """Two bodies, the first turned and off the origin, each on a joint of its own."""
    m = pt.Mechanism("pair")
    arm = m.add_body("arm", mass=1.0, inertia=(1, 1, 1), position=X, orientation=TURN)
    other = m.add_body("other", mass=1.0, inertia=(1, 1, 1), position=(-1, 0, 0))
    m.add_spherical("A", m.ground, arm, point=X)
    m.add_spherical("B", m.ground, other, point=(-1, 0, 0))
    return m, arm, other


def law(t: float, seen: Any) -> Any:
    return -seen.position


ELEMENTS: dict[str, Callable[[pt.Mechanism, Any, Any, Any], Any]] = {
    "spring": lambda m, arm, other, p: m.add_spring("S", arm, p, other, (0, 0, 0), stiffness=5.0),
    "spring, second": lambda m, arm, other, p: m.add_spring("S", other, (0, 0, 0), arm, p, stiffness=5.0),
    "distance": lambda m, arm, other, p: m.add_distance("D", arm, p, other, (0, 0, 0)),
    "measure": lambda m, arm, other, p: m.add_sensor("D", pt.Along(arm, p, (1, 0, 0), other, (0, 0, 0)), "position"),
    "contact": lambda m, arm, other, p: m.add_contact(
        "C", arm, p, m.ground, (0, 0, 0), radius1=0.1, stiffness=1e3, normal=(0, 1, 0)
    ),
    "tyre": lambda m, arm, other, p: m.add_tyre(
        "T", arm, center=p, axis=(0, 0, 1), radius=0.1, normal=(0, 1, 0), stiffness=1e3
    ),
    "rope": lambda m, arm, other, p: m.add_rope("W", arm, p, other, (0, 0, 0), stiffness=5.0, length=0.1),
    "strut": lambda m, arm, other, p: m.add_gas_strut(
        "W", arm, p, other, (0, 0, 0), force=5.0, progression=1.3, stroke=0.05, length=0.1
    ),
    "force": lambda m, arm, other, p: m.add_force(arm, (1, 2, 3), p),
    "rolling": lambda m, arm, other, p: m.add_rolling("R", arm, 0.5, center=p, slips=True),
    "curve": lambda m, arm, other, p: m.add_point_on_curve("G", m.ground, arm, p, lambda x: x**2),
    "sensor": lambda m, arm, other, p: m.add_sensor("p", (arm, p), "position"),
    "law": lambda m, arm, other, p: m.add_force_law("L", law, sees=[(arm, p)], on=[(arm, p)]),
    "joint": lambda m, arm, other, p: m.add_spherical("J", arm, other, point=p),
    "bushing": lambda m, arm, other, p: m.add_bushing("U", arm, other, p, stiffness=(1, 1, 1, 1, 1, 1)),
}
IN_WORLD = ("joint", "bushing")
"""Elements whose plain points are in the world of the drawing."""


@pytest.mark.parametrize("kind", ELEMENTS)
def test_a_point_said_explicitly_is_the_plain_one(kind: str) -> None:
    specs = []
    for form in ("plain", "at", "world"):
        m, arm, other = drawn()
        plain = WORLD if kind in IN_WORLD else P
        ELEMENTS[kind](m, arm, other, {"plain": plain, "at": arm.at(P), "world": arm.world(WORLD)}[form])
        specs.append(m.to_spec())
    for other_spec in specs[1:]:
        assert str(other_spec).replace(" ", "")[:200] == str(specs[0]).replace(" ", "")[:200]
        assert _close(other_spec, specs[0])


def _close(a: Any, b: Any) -> bool:
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(_close(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(_close(x, y) for x, y in zip(a, b, strict=True))
    return math.isclose(a, b, rel_tol=1e-12, abs_tol=1e-12) if isinstance(a, float) else bool(a == b)


@pytest.mark.parametrize("kind", [kind for kind in ELEMENTS if kind not in IN_WORLD])
def test_a_point_of_another_body_is_refused(kind: str) -> None:
    m, arm, other = drawn()
    before = m.to_spec()
    with pytest.raises(pt.errors.DescriptionError, match='is a point of "other", but the body beside it is "arm"'):
        ELEMENTS[kind](m, arm, other, other.at(P))
    assert m.to_spec() == before


def test_the_ground_and_units() -> None:
    m, arm, _ = drawn()
    assert m.ground.at((1, 2, 3)) == m.ground.world((1, 2, 3)) == Point("ground", (1.0, 2.0, 3.0))
    assert arm.at(("100 mm", 0, "2 cm")) == arm.at((0.1, 0, 0.02))
    assert repr(arm.at((0.5, 0, 0))) == "arm.at((0.5, 0, 0))"
    point = arm.world(X)
    assert np.allclose(point.coordinates, 0.0, atol=1e-15)
    assert pickle.loads(pickle.dumps(point)) == copy.deepcopy(point) == point
    for bad in ((1, 2), "x", (1, 2, math.nan), None):
        with pytest.raises(pt.errors.DescriptionError, match='body "arm": the point'):
            arm.at(bad)
    with pytest.raises(pt.errors.DescriptionError, match="must be made of real numbers"):
        m.add_body("third", mass=1.0, inertia=(1, 1, 1), position=arm.at(P))


def test_points_as_targets_and_in_results() -> None:
    m, arm, _ = drawn()
    goal = (1.2, 2.1, 3.2)
    found = [m.assemble({key: goal[:2]}) for key in ((arm, P, "xy"), (*arm.at(P), "xy"), (*arm.world(WORLD), "xy"))]
    assert np.allclose(found[0].q, found[1].q, atol=1e-9) and np.allclose(found[0].q, found[2].q, atol=1e-9)
    run = m.simulate(0.1)
    body = run.body("arm")
    assert np.array_equal(body.point(arm.at(P)), body.point(P))
    assert np.array_equal(body.point_acceleration(arm.at(P)), body.point_acceleration(P))
    with pytest.raises(pt.errors.ArgumentError, match='one of "ground", but the body is "arm"'):
        body.point(m.ground.at(P))
    run.plot("paths", points={"P": arm.at(P)})


def test_a_point_follows_its_body_when_that_is_drawn_elsewhere() -> None:
    m = pt.Mechanism("swing")
    rod = m.add_rod("rod", start=(2, 0, 0), end=(3, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(2, 0, 0))
    spring = m.add_spring("S", m.ground, (3, 1, 0), rod, rod.world((3, 0, 0)), stiffness=100.0)
    rod.change(start=(4, 0, 0), end=(4, 1, 0))
    assert spring.point2.tolist() == [1.0, 0.0, 0.0] and rod.at((1, 0, 0)) == rod.world((4, 1, 0))


def swing(point: Any) -> pt.Mechanism:
    m = pt.Mechanism("swing")
    rod = m.add_rod("rod", start=(2, 0, 0), end=(3, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(2, 0, 0))
    m.add_spring("S", m.ground, (3, 1, 0), rod, point(rod) if callable(point) else point, stiffness=100.0)
    return m


def test_a_world_point_given_in_body_axes_is_remarked_on(caplog: pytest.LogCaptureFixture) -> None:
    m = swing((3, 0, 0))
    found = m.check()
    (remark,) = found
    assert remark == (
        'force "S": point2 (3, 0, 0) is in the axes of "rod", where it lies outside of the body; as a point of the '
        'world it would lie on it: if that is meant, give m.bodies["rod"].world((3, 0, 0)), else .at((3, 0, 0))'
    )
    assert found and remark in str(found) and found.to_dict()["remarks"] == [remark]
    with caplog.at_level(logging.WARNING, logger="partita"):
        run = m.simulate(0.01)
        m.simulate(0.01)
    assert remark in run.notes
    assert [record.message for record in caplog.records] == [remark]  # once for one description


def test_both_remedies_of_the_remark_silence_it() -> None:
    for point in (lambda rod: rod.world((3, 0, 0)), lambda rod: rod.at((3, 0, 0)), (1, 0, 0)):
        m = swing(point)
        assert not m.check() and not list(m.check()) and not m.simulate(0.01).notes
    m = swing(lambda rod: rod.at((3, 0, 0)))
    m.forces["S"].stiffness = 50.0  # another argument: the point stays explicit
    assert not m.check()
    m.bodies["rod"].mass = 2.0
    assert not m.check()
    m.forces["S"].point2 = (3, 0, 0)
    assert m.check()
    m.forces["S"].point2 = m.bodies["rod"].at((3, 0, 0))
    assert not m.check() and not copy.deepcopy(m).check()


@pytest.mark.parametrize("name", pt.catalogue.names())
def test_nothing_of_the_catalogue_is_remarked_on(name: str) -> None:
    m = pt.catalogue.load(name)
    assert m._remarks() == ()


def test_a_body_that_nothing_holds_is_remarked_on(caplog: pytest.LogCaptureFixture) -> None:
    m = swing((1, 0, 0))
    m.add_body("stone", mass=1.0, inertia=(1, 1, 1), position=(9, 0, 0))
    m.add_sensor("height", ("stone", (0, 0, 0)), "position")
    (remark,) = m.check()
    assert remark.startswith(
        'body "stone" is connected to nothing: no joint, coupling or force acts on it; add a joint'
    )
    with caplog.at_level(logging.WARNING, logger="partita"):
        assert remark in m.simulate(0.01).notes
    assert [record.message for record in caplog.records] == [remark]
    m.add_free("stone floats", m.ground, "stone")
    assert not [one for one in m.check() if "connected" in one]
    m.joints.remove("stone floats")
    m.add_spring("T", m.ground, (0, 0, 0), "stone", (0, 0, 0), stiffness=1.0)
    assert not [one for one in m.check() if "connected to nothing" in one]
    alone = pt.Mechanism("stone")
    alone.add_body("stone", mass=1.0, inertia=(1, 1, 1))
    assert not alone.simulate(0.1).notes


def test_a_check_of_a_drawing_that_does_not_close() -> None:
    m = swing((3, 0, 0))
    m.add_distance("W", m.ground, (0, 9, 0), "rod", (1, 0, 0), length=1.0)
    found = m.check()
    assert not found.closes and found.report is None and found.why is not None
    assert "does not close: " in str(found) and found.remarks[0].startswith('force "S"') and found


def test_targets_that_look_like_degrees(caplog: pytest.LogCaptureFixture) -> None:
    m = swing((1, 0, 0))
    with caplog.at_level(logging.WARNING, logger="partita"):
        state = m.assemble({"A": 30})
    words = "targets['A'] is 30 rad, 4.8 turns; if degrees are meant, write '30 deg'"
    assert [record.message for record in caplog.records] == [words]
    assert state.assembly is not None and state.assembly["remarks"] == [words]
    caplog.clear()
    for fine in ({"A": "30 deg"}, {"A": "1800 deg"}, {"A": 4.0 * math.pi}, {"A": np.float64(1.0)}):
        found = m.assemble(fine)
        assert found.assembly is not None and found.assembly["remarks"] == []
    assert not caplog.records
    m.add_distance("W", m.ground, (3, 1, 0), "rod", (1, 0, 0))
    with pytest.raises(pt.errors.AssemblyError, match=r"suspicious: .*if degrees are meant, write '45 deg'"):
        m.assemble({"A": 45})


def test_an_orientation_alone_as_a_target() -> None:
    m, arm, _ = drawn()
    wanted = Rotation.from_rotvec([(0.1, 0.2, 0.3), (0.5, -0.2, 0.6)])
    state = m.assemble({(arm, "rotation"): wanted[0]})
    pose = m.assemble_many({("arm", "rotation"): wanted})
    assert pose.ok.all() and np.allclose(pose.body("arm").rotation, wanted.as_matrix(), atol=1e-9)
    assert np.allclose(pose[0].q[:4], state.q[:4], atol=1e-9) or np.allclose(pose[0].q[:4], -state.q[:4], atol=1e-9)
    study = m.kinematics(
        {("arm", "rotation"): wanted, ("other", "rotation"): Rotation.identity()},
        rates={("arm", "rotation"): (0, 0, "60 rpm"), ("other", "rotation"): (0, 0, 0)},
    )
    assert np.allclose(study.body("arm").angular_velocity, (0, 0, 2 * math.pi), atol=1e-9)
    with pytest.raises(pt.errors.ArgumentError, match="orientation must be a 3x3 rotation matrix"):
        m.assemble({(arm, "rotation"): 1.0})
    with pytest.raises(pt.errors.ArgumentError, match="the rotation of a body is a target of assemble"):
        m.assemble(fixed=[(arm, "rotation")])
    with pytest.raises(pt.errors.UnknownNameError, match="there is no body 'A'"):
        m.assemble({("A", "rotation"): np.eye(3)})


def test_gravity_by_its_direction_and_set_later() -> None:
    for word, axis, sign in (("-z", 2, -1), ("x", 0, 1), ("+y", 1, 1)):
        expected = [0.0, 0.0, 0.0]
        expected[axis] = sign * 9.81
        assert pt.Mechanism("m", gravity=word).gravity == tuple(expected)
    for bad in ("-w", "--z", "z-", "", "down", "9.81 m/s^2"):
        with pytest.raises(pt.errors.DescriptionError, match="a direction such as '-z'"):
            pt.Mechanism("m", gravity=bad)
    m = swing((1, 0, 0))
    model = m.compile()
    m.gravity = (0, "-1.62 m/s^2", 0)
    assert m.gravity == (0.0, -1.62, 0.0) and m.compile() is not model
    fresh = pt.Mechanism("swing", gravity=(0, -1.62, 0))
    rod = fresh.add_rod("rod", start=(2, 0, 0), end=(3, 0, 0), mass=1.0)
    fresh.add_revolute("A", fresh.ground, rod, point=(2, 0, 0))
    fresh.add_spring("S", fresh.ground, (3, 1, 0), rod, (1, 0, 0), stiffness=100.0)
    assert m.to_spec() == fresh.to_spec()
    m.gravity = ([0.0, 1.0], np.zeros((2, 3)))
    assert m.gravity == (0.0, 0.0, 0.0) and any(force["kind"] == "gravity" for force in m.to_spec()["forces"])
    m.gravity = None
    assert not any(force["kind"] == "gravity" for force in m.to_spec()["forces"])
    with pytest.raises(pt.errors.DescriptionError, match='mechanism "swing": gravity'):
        m.gravity = (1, 2)
    assert m.gravity == (0.0, 0.0, 0.0)


def test_axes_by_their_names() -> None:
    for word, axis in (("z", (0, 0, 1)), ("-x", (-1, 0, 0)), ("+y", (0, 1, 0))):
        specs = []
        for given in (word, axis):
            m, arm, other = drawn()
            m.add_revolute("J", arm, other, point=X, axis=given)
            m.add_universal("U", arm, other, point=X, axis1=given, axis2=np.roll(axis, 1))
            m.add_contact("C", arm, P, m.ground, (0, 0, 0), radius1=0.1, stiffness=1e3, normal=given)
            specs.append(m.to_spec())
        assert specs[0] == specs[1]
    m, arm, other = drawn()
    with pytest.raises(pt.errors.DescriptionError, match="axis is 'up'; give three numbers such as"):
        m.add_revolute("J", arm, other, point=X, axis="up")


def test_a_saved_mechanism_keeps_what_was_said_of_its_points(tmp_path: Path) -> None:
    """A force beyond the end of a rod, at a place that the rod would have in the world: right as it was given."""
    m = pt.Mechanism("overhang")
    rod = m.add_rod("rod", start=(1, 0, 0), end=(3, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(1, 0, 0))
    m.add_force(rod, (0, 1, 0), rod.at((2.6, 0, 0)), name="F")
    m.add_sensor("tip", rod.at((2.6, 0, 0)), "position")
    assert not misplaced(m._description)
    m.save(tmp_path / "m.toml")
    assert not misplaced(pt.load(tmp_path / "m.toml")._description)
    # of a file that was written by hand nobody knows
    text = (tmp_path / "m.toml").read_text()
    (tmp_path / "hand.toml").write_text(text[: text.rindex("# as saved")])
    assert len(misplaced(pt.load(tmp_path / "hand.toml")._description)) == 2
