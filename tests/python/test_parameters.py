"""Models with other parameters: what changes, what stays, what is refused."""

import copy
import pickle

import numpy as np
import pytest

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
    assert all(run.success and run.certificate.verdict == "holds" for run in runs)
    for x, y in zip(*[(run.q, run.joint("C").force, run.energy.total) for run in runs], strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-8, atol=1e-8)  # both within the tolerance of the motion
    np.testing.assert_array_equal(drawn.assemble().q, before)


def test_a_start_that_the_parameters_open_is_refused_and_unknown_ones_are_refused() -> None:
    m = driven_crank()
    start = m.assemble(targets={"A": 0.5})
    with pytest.raises(ArgumentError, match=r"start does not satisfy .* C\.y is open"):
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
