"""Models with other parameters: what changes, what stays, what is refused."""

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from moved_drawings import as_typed

import partita as pt
from partita.builder.compiled import CompiledModel
from partita.errors import ArgumentError, DescriptionError


def driven_crank(
    mass: float = 2.0, stiffness: float = 5.0, pin: float = 3.0, gravity: float = -9.81, sprung: bool = True
) -> pt.Mechanism:
    """A four-bar with a spring and a torsion spring, its third pin at (pin, 1)."""
    m = pt.Mechanism("four-bar", gravity=(0, gravity, 0))
    bodies = [
        m.add_body(name, mass=mass if name == "coupler" else 1.0, inertia=(0.1, 0.1, 0.2), com=(0.2, 0.1, 0))
        for name in ("crank", "coupler", "rocker")
    ]
    ends = [m.ground, *bodies, m.ground]
    points = [(0, 0, 0), (0, 1, 0), (pin, 1.5, 0), (2.5, 0, 0)]
    for name, parent, child, point in zip("ABCD", ends[:-1], ends[1:], points, strict=True):
        if name == "D":
            parent, child = child, parent
        m.add_revolute(name, parent, child, point=point)
    m.add_spring("spring", m.ground, (1, -1, 0), bodies[1], (0.3, 0, 0), stiffness=stiffness, length=0.5)
    if sprung:
        m.add_torsion_spring("A", stiffness=2.0, damping=0.1)
    return m


STATE = ([0.3, -0.2, 0.4], [0.5, -1.0, 0.7])


def everything(model: CompiledModel) -> list[np.ndarray]:
    q, v = STATE
    return [
        model.mass_matrix(q),
        model.forces(q, v),
        model.constraints(q),
        model.jacobian(q),
        model.bias(q, v),
    ]


@as_typed
def test_the_same_as_a_new_mechanism() -> None:
    model = driven_crank().compile()
    changed = model.with_parameters(
        {"coupler.mass": 3.5, "spring.stiffness": 8.0, "C.point": (3.2, 1.5, 0), "gravity": (0, -1.62, 0)}
    )
    anew = driven_crank(mass=3.5, stiffness=8.0, pin=3.2, gravity=-1.62).compile()
    for x, y in zip(everything(changed), everything(anew), strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-13, atol=1e-13)  # sums of a few products
    assert changed.names == model.names and changed.row_names == model.row_names
    assert changed.parameters["coupler.mass"] == 3.5 and model.parameters["coupler.mass"] == 2.0
    assert changed.parameters["C.point"] == [3.2, 1.5, 0.0]
    assert changed.mobility == 1


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_run_with_other_parameters_is_the_run_of_another_mechanism(coordinates: str) -> None:
    """In absolute coordinates without the torsion spring, which needs a joint's coordinate."""
    sprung = coordinates == "relative"
    changes = {"coupler.mass": 3.5, "spring.stiffness": 8.0, "C.point": (3.2, 1.5, 0), "gravity": (0, -1.62, 0)}
    drawn = driven_crank(sprung=sprung)
    other = driven_crank(mass=3.5, stiffness=8.0, pin=3.2, gravity=-1.62, sprung=sprung)
    before = drawn.assemble().q
    state = drawn.assemble(targets={"A": 0.2}, rates={"A": 2.0}, parameters=changes)
    runs = [
        drawn.simulate(0.7, initial=state, coordinates=coordinates, parameters=changes, rtol=1e-11),
        other.simulate(0.7, initial=state, coordinates=coordinates, rtol=1e-11),
    ]
    assert all(run.success and run.certificate.verdict == "valid" for run in runs)
    for x, y in zip(*[(run.q, run.joint("C").force, run.energy.total) for run in runs], strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-8, atol=1e-8)  # both within the tolerance of the motion
    np.testing.assert_array_equal(drawn.assemble().q, before)


def test_a_start_that_the_parameters_open_is_refused_and_unknown_ones_are_refused() -> None:
    m = driven_crank()
    start = m.assemble(targets={"A": 0.5})
    with pytest.raises(ArgumentError, match=r"initial state violates .* C\.y has a closure error"):
        m.simulate(0.01, initial=start, parameters={"C.point": (3.2, 1.5, 0)})
    with pytest.raises(DescriptionError, match=r"rod\.mass"):
        m.simulate(0.1, parameters={"rod.mass": 1.0})
    with pytest.raises(DescriptionError, match=r"rod\.mass"):
        m.assemble(parameters={"rod.mass": 1.0})


def test_changes_add_up_and_travel() -> None:
    first = driven_crank().compile().with_parameters({"coupler.mass": 3.5})
    both = first.with_parameters({"gravity": [0, -1.0, 0]})
    assert both.parameters["coupler.mass"] == 3.5
    assert copy.deepcopy(both) is both
    for x, y in zip(everything(both), everything(pickle.loads(pickle.dumps(both))), strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"coupler.weight": 1.0}, "there is no such parameter"),
        ({"C.point": 1.0}, "it has 3 numbers, 1 were given"),
        ({"coupler.mass": -1.0}, "negative"),
        ({"coupler.mass": float("nan")}, "not finite"),
        ({"coupler.inertia": np.diag([1.0, 1.0, 9.0])}, "no distribution of mass"),
    ],
)
def test_what_cannot_be_is_refused(changes: dict[str, object], words: str) -> None:
    with pytest.raises(DescriptionError, match=words):
        driven_crank().compile().with_parameters(changes)  # type: ignore[arg-type]


def test_what_is_no_number_is_refused() -> None:
    with pytest.raises(ArgumentError, match="made of real numbers"):
        driven_crank().compile().with_parameters({"coupler.mass": "heavy"})


def coupled(**different: Any) -> pt.Mechanism:
    """Every kind of coupling with numbers, and a screw, in one mechanism in space."""
    given = {"ratio": -2.0, "radius": 0.2, "radius1": 0.1, "radius2": 0.3, "factors": [1.0, 1.0, -2.0], "offset": 0.0}
    given |= {"length": 1.0, "point1": (0.0, 0.0, 0.0), "point2": (0.0, 0.1, 0.0), "pitch": 0.02}
    given |= {"disc": 0.5, "center": (0.0, 0.0, 0.0), "point": (0.0, 0.0, 0.0)}
    x: dict[str, Any] = given | different
    m = pt.Mechanism("couplings", gravity=(0, 0, -9.81))
    for i in range(1, 9):
        wheel = m.add_body(f"wheel {i}", mass=1.0, inertia=(0.1 * i, 0.2, 0.2 + 0.1 * i), position=(i, 0, 0))
        m.add_revolute(f"A{i}", m.ground, wheel, point=(i, 0, 0), axis=(0.6, 0, 0.8) if i == 2 else (0, 0, 1))
    rack, nut, bob, coin = (
        m.add_body(name, mass=2.0, inertia=(0.3, 0.4, 0.5), position=at)
        for name, at in (("rack", (0, 2, 0)), ("nut", (0, 3, 0)), ("bob", (1, 4, 0)), ("coin", (0, 5, 0.5)))
    )
    m.add_prismatic("R", m.ground, rack, axis=(1, 0, 0))
    m.add_screw("nut", m.ground, nut, point=(0, 3, 0), axis=(0, 0.6, 0.8), pitch=x["pitch"])
    m.add_gear("A1", "A2", x["ratio"], name="gear")
    m.add_belt("A3", "A4", x["radius1"], x["radius2"], crossed=True, name="belt")
    m.add_rack("A5", "R", x["radius"], name="rack")
    m.add_coupler("sum", ["A6", "A7", "A8"], x["factors"], x["offset"])
    m.add_distance("wire", m.ground, x["point1"], bob, x["point2"], x["length"])
    m.add_rolling("coin", coin, x["disc"], center=x["center"], axis=(0, 1, 0), point=x["point"], normal=(0, 0, 1))
    return m


OTHERS: dict[str, tuple[str, Any]] = {
    "gear.ratio": ("ratio", 3.0),
    "belt.radius1": ("radius1", 0.2),
    "belt.radius2": ("radius2", 0.25),
    "rack.radius": ("radius", -0.3),
    "sum.factors": ("factors", [1.0, 2.0, -3.0]),
    "sum.offset": ("offset", 0.1),
    "wire.length": ("length", 1.2),
    "wire.point1": ("point1", (0.2, 3.0, -0.1)),
    "wire.point2": ("point2", (0.1, 0.2, 0.3)),
    "nut.pitch": ("pitch", -0.5),
    "coin.radius": ("disc", 0.7),
    "coin.center": ("center", (0.0, 0.1, 0.02)),
    "coin.point": ("point", (0.0, 1.0, -0.2)),
}
"""Parameter: by which argument it is drawn, and another value of it."""


@as_typed
@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_numbers_of_couplings_are_those_of_a_new_mechanism(coordinates: str) -> None:
    """Bit for bit, one by one and all at once, at states with whole turns."""
    model = coupled().compile(coordinates=coordinates)
    drawn = coupled().compile(coordinates=coordinates).parameters
    assert {name for name in drawn if name.split(".")[0] in ("gear", "belt", "sum", "wire", "coin")} < {
        *OTHERS, "coin.mass", "coin.com", "coin.inertia"
    }  # fmt: skip
    rng = np.random.default_rng(3)
    q, v = 4.0 * rng.standard_normal(model.core.nq), rng.standard_normal(model.core.nv)

    def numbers(model: CompiledModel) -> list[np.ndarray]:
        return [model.constraints(q), model.jacobian(q), model.bias(q, v), model.forces(q, v)]

    every = {name: value for name, (_, value) in OTHERS.items()}
    for changes in ({}, every, *({name: value} for name, value in every.items())):
        anew = coupled(**{OTHERS[name][0]: value for name, value in changes.items()}).compile(coordinates=coordinates)
        changed = model.with_parameters(changes)
        for x, y in zip(numbers(changed), numbers(anew), strict=True):
            np.testing.assert_array_equal(x, y)
        assert changed.parameters == anew.parameters and changed.row_names == anew.row_names
        assert not changes or any((x != y).any() for x, y in zip(numbers(changed), numbers(model), strict=True))


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_run_with_other_ratios_is_that_of_another_drawing(coordinates: str) -> None:
    changes = {"gear.ratio": 3.0, "nut.pitch": "-50 cm", "rack.radius": "-300 mm"}
    runs = [
        m.simulate(0.05, coordinates=coordinates, parameters=parameters, rtol=1e-9)
        for m, parameters in ((coupled(), changes), (coupled(ratio=3.0, pitch=-0.5, radius=-0.3), None))
    ]
    assert all(run.success for run in runs)
    for x, y in zip(*[(run.q, run.v, run.coupling("gear").effort) for run in runs], strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *((name, np.full(np.shape(value), np.nan)) for name, (_, value) in OTHERS.items()),
        ("gear.ratio", 0.0),
        ("belt.radius1", -0.1),
        ("belt.radius2", 0.0),
        ("rack.radius", 0.0),
        ("sum.factors", [1.0, 0.0, 1.0]),
        ("wire.length", -1.0),
        ("nut.pitch", 0.0),
        ("coin.radius", -0.5),
    ],
)
def test_what_drawing_refuses_of_couplings_is_refused(name: str, value: Any) -> None:
    owner = name.split(".")[0]
    with pytest.raises(DescriptionError) as drawn:
        coupled(**{OTHERS[name][0]: value})
    with pytest.raises(DescriptionError) as changed:
        coupled().compile().with_parameters({name: value})
    assert all(f'"{owner}"' in str(error.value) for error in (drawn, changed))


def test_a_ratio_that_takes_whole_turns_away_is_refused() -> None:
    """In absolute coordinates in space turns are known up to a common divisor: that of 1 and 0.31416 is too small."""
    model = coupled().compile(coordinates="absolute")
    with pytest.raises(DescriptionError, match=r'coupling "gear": .* rates instead of positions.* build'):
        model.with_parameters({"gear.ratio": 0.31416})
    assert coupled().compile().with_parameters({"gear.ratio": 0.31416}).parameters["gear.ratio"] == 0.31416


def test_numbers_of_drives_are_those_of_a_new_mechanism() -> None:
    def arm(at: float, rate: float) -> pt.Mechanism:
        m = pt.Mechanism("arm")
        one = m.add_rod("one", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
        two = m.add_rod("two", start=(1, 0, 0), end=(2, 0, 0), mass=1.0)
        three = m.add_rod("three", start=(2, 0, 0), end=(3, 0, 0), mass=1.0)
        m.add_revolute("A", m.ground, one, point=(0, 0, 0))
        m.add_revolute("B", one, two, point=(1, 0, 0))
        m.add_revolute("C", two, three, point=(2, 0, 0))
        m.add_drive("A", position=at, name="hold")
        m.add_drive("B", velocity=rate, name="motor")
        return m

    numbers = {"hold.position": 0.4, "motor.velocity": -2.0}
    known, new = arm(0.1, 1.0), arm(0.4, -2.0)
    assert known.compile().parameters["motor.velocity"] == 1.0
    run = known.simulate(0.3, parameters=numbers)
    other = new.simulate(0.3)
    assert np.array_equal(run.q, other.q) and np.array_equal(run.v, other.v)
    assert run.q[-1, 0] == pytest.approx(0.4, abs=1e-12)
    # in degrees a second, too
    assert known.compile().with_parameters({"motor.velocity": "180 deg/s"}).parameters["motor.velocity"] == np.pi


def test_an_equilibrium_over_the_position_that_a_drive_holds() -> None:
    m = pt.Mechanism("arm")
    one = m.add_rod("one", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    two = m.add_rod("two", start=(1, 0, 0), end=(2, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, one, point=(0, 0, 0))
    m.add_revolute("B", one, two, point=(1, 0, 0))
    m.add_torsion_spring("B", stiffness=30.0)
    m.add_drive("A", position=0.3, name="hold")
    path = m.equilibrium(along={"hold.position": [0.3, 0.8]})
    for held, one_state in zip((0.3, 0.8), path.states, strict=True):
        bend = one_state.position("B")
        assert 30.0 * bend == pytest.approx(-0.5 * 9.81 * np.cos(held + bend), abs=1e-9)
