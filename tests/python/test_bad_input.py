"""Bad input from Python: each kind gives its typed error, whose sentence names the culprit."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.errors import (
    ArgumentError,
    AssemblyError,
    DescriptionError,
    EvaluationError,
    PartitaError,
    UnknownNameError,
)

NAN, INF = float("nan"), float("inf")
ORIGIN = (0.0, 0.0, 0.0)

Case = tuple[str, Callable[[], Any], type[PartitaError], str]


def pendulum() -> pt.Mechanism:
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=ORIGIN, end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=ORIGIN)
    return m


def body(**changes: Any) -> Any:
    data: dict[str, Any] = {"mass": 1.0, "inertia": (1.0, 1.0, 1.0), **changes}
    return pt.Mechanism("m").add_body("box", **data)


def rod(**changes: Any) -> Any:
    return pt.Mechanism("m").add_rod("bar", **{"start": ORIGIN, "end": (1, 0, 0), "mass": 1.0, **changes})


def revolute(**changes: Any) -> Any:
    m = pt.Mechanism("m")
    bar = m.add_rod("bar", start=ORIGIN, end=(1, 0, 0), mass=1.0)
    data: dict[str, Any] = {"name": "hinge", "parent": m.ground, "child": bar, "point": ORIGIN, **changes}
    return m.add_revolute(**data)


def revolutes(*names: str) -> None:
    m = pendulum()
    for name in names:
        m.add_revolute(name, m.ground, "rod", point=ORIGIN)


def spring(**changes: Any) -> Any:
    m = pendulum()
    data: dict[str, Any] = {"stiffness": 10.0, "damping": 0.0, "length": 1.0, **changes}
    return m.add_spring("spring", m.ground, (2, 0, 0), "rod", (1, 0, 0), **data)


def twice(add: Callable[[pt.Mechanism], Any]) -> Any:
    m = pendulum()
    add(m)
    return add(m)


def run(**options: Any) -> Any:
    duration = options.pop("duration", 1.0)
    return pendulum().simulate(duration, **options)


def four_bar(ground: float, lengths: tuple[float, float, float] = (1.0, 0.3, 0.9)) -> pt.Mechanism:
    """Drawn flat and open: crank and coupler from the left pin, rocker from the right one, to be closed at C."""
    m = pt.Mechanism("four-bar")
    crank_end, coupler_end = lengths[0], lengths[0] + lengths[1]
    crank = m.add_rod("crank", start=ORIGIN, end=(0, crank_end, 0), mass=1.0)
    coupler = m.add_rod("coupler", start=(0, crank_end, 0), end=(0, coupler_end, 0), mass=1.0)
    rocker = m.add_rod("rocker", start=(ground, 0, 0), end=(ground, lengths[2], 0), mass=1.0)
    m.add_revolute("A", m.ground, crank, point=ORIGIN, cut="never")
    m.add_revolute("B", crank, coupler, point=(0, crank_end, 0))
    m.add_revolute("D", m.ground, rocker, point=(ground, 0, 0))
    m.add_revolute("C", coupler, rocker, point=(0, coupler_end, 0), child_point=(ground, lengths[2], 0), cut="always")
    return m


def foreign_body() -> Any:
    stranger = pt.Mechanism("stranger").add_rod("bar", start=ORIGIN, end=(1, 0, 0), mass=1.0)
    return revolute(child=stranger)


def mirror() -> np.ndarray:
    return np.diag([1.0, 1.0, -1.0])


DESCRIPTIONS: list[Case] = [
    ("mass NaN", lambda: body(mass=NAN), DescriptionError, "box"),
    ("mass infinite", lambda: body(mass=INF), DescriptionError, "box"),
    ("mass negative", lambda: body(mass=-1.0), DescriptionError, "mass"),
    ("mass text", lambda: body(mass="heavy"), DescriptionError, "mass"),
    ("mass an array", lambda: body(mass=[1.0, 2.0]), DescriptionError, "mass"),
    ("inertia negative", lambda: body(inertia=(1, 1, -1)), DescriptionError, "inertia"),
    ("inertia above the sum of the others", lambda: body(inertia=(1, 1, 3)), DescriptionError, "inertia"),
    ("inertia of two numbers", lambda: body(inertia=(1, 1)), DescriptionError, "inertia"),
    ("inertia empty", lambda: body(inertia=()), DescriptionError, "inertia"),
    ("inertia not symmetric", lambda: body(inertia=[[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]), DescriptionError, "symmetric"),
    ("inertia NaN", lambda: body(inertia=(1, 1, NAN)), DescriptionError, "inertia"),
    ("centre of mass of two numbers", lambda: body(com=(0, 0)), DescriptionError, "com"),
    ("position NaN", lambda: body(position=(0, NAN, 0)), DescriptionError, "position"),
    ("orientation a reflection", lambda: body(orientation=mirror()), DescriptionError, "reflection"),
    ("orientation not orthonormal", lambda: body(orientation=2.0 * np.eye(3)), DescriptionError, "rotation"),
    ("orientation a zero quaternion", lambda: body(orientation=(0, 0, 0, 0)), DescriptionError, "quaternion"),
    ("rod without length", lambda: rod(end=ORIGIN), DescriptionError, "length"),
    ("rod end infinite", lambda: rod(end=(INF, 0, 0)), DescriptionError, "bar"),
    ("rod end of two numbers", lambda: rod(end=(1, 0)), DescriptionError, "end"),
    ("gravity NaN", lambda: pt.Mechanism("m", gravity=(0, NAN, 0)), DescriptionError, "gravity"),
    ("gravity one number", lambda: pt.Mechanism("m", gravity=9.81), DescriptionError, "gravity"),  # type: ignore[arg-type]
    ("mechanism without a name", lambda: pt.Mechanism(""), DescriptionError, "name"),
    ("mechanism without bodies", lambda: pt.Mechanism("m").compile(), DescriptionError, "bodies"),
    ("two bodies of one name", lambda: twice(lambda m: m.add_rod("x", ORIGIN, (1, 0, 0), 1.0)), DescriptionError, "x"),
    ("body named ground", lambda: pendulum().add_rod("ground", ORIGIN, (1, 0, 0), 1.0), DescriptionError, "reserved"),
    ("two joints of one name", lambda: revolutes("J", "J"), DescriptionError, "J"),
    ("joint without a name", lambda: revolute(name=" "), DescriptionError, "name"),
    ("joint axis zero", lambda: revolute(axis=ORIGIN), DescriptionError, "axis"),
    ("joint axis NaN", lambda: revolute(axis=(0, 0, NAN)), DescriptionError, "axis"),
    ("joint point of two numbers", lambda: revolute(point=(0, 0)), DescriptionError, "point"),
    ("joint of a body with itself", lambda: revolute(parent="bar"), DescriptionError, "hinge"),
    ("joint with an unknown body", lambda: revolute(parent="bra"), UnknownNameError, "bar"),
    ("joint with a body of another mechanism", foreign_body, DescriptionError, "stranger"),
    ("joint with an unknown cut", lambda: revolute(cut="maybe"), DescriptionError, "cut"),
    ("generic joint with an unknown direction",
     lambda: pendulum().add_joint("J", "ground", "rod", free=("u",), point=ORIGIN), DescriptionError, "free"),
    ("spring stiffness NaN", lambda: spring(stiffness=NAN), DescriptionError, "stiffness"),
    ("spring length negative", lambda: spring(length=-1.0), DescriptionError, "length"),
    ("spring damping infinite", lambda: spring(damping=INF), DescriptionError, "damping"),
    ("torque on an unknown joint", lambda: pendulum().add_torque("B", value=1.0), UnknownNameError, "A"),
    ("torque NaN", lambda: pendulum().add_torque("A", value=NAN), DescriptionError, "NaN|nan|finite"),
    ("torque on no coordinate", lambda: pendulum().add_torque("A", 1.0, coordinate=1), DescriptionError, "coordinate"),
    ("force of two numbers", lambda: pendulum().add_force("rod", force=(1, 0)), DescriptionError, "force"),
    ("force on the ground", lambda: pendulum().add_force("ground", force=(1, 0, 0)), DescriptionError, "ground"),
    ("table with one time", lambda: pendulum().add_torque("A", value=([0.0], [1.0])), DescriptionError, "table"),
    ("table that goes back", lambda: pendulum().add_torque("A", ([0, 2, 1], [0, 0, 0])), DescriptionError, "incr"),
    ("drive on an unknown joint", lambda: pendulum().add_drive("B", position=lambda t: t), UnknownNameError, "A"),
    ("two drives on one joint", lambda: twice(lambda m: m.add_drive("A", position=lambda t: t)), DescriptionError, "A"),
]  # fmt: skip

CALLS: list[Case] = [
    ("duration NaN", lambda: run(duration=NAN), ArgumentError, "duration"),
    ("duration zero", lambda: run(duration=0.0), ArgumentError, "duration"),
    ("duration negative", lambda: run(duration=-1.0), ArgumentError, "duration"),
    ("duration infinite", lambda: run(duration=INF), ArgumentError, "duration"),
    ("rtol zero", lambda: run(rtol=0.0), ArgumentError, "rtol"),
    ("atol negative", lambda: run(atol=-1e-9), ArgumentError, "atol"),
    ("unknown method", lambda: run(method="dop583"), ArgumentError, "dop853"),
    ("unknown formulation", lambda: run(solver=pt.Solver("magic")), ArgumentError, "formulation"),
    ("unknown coordinates", lambda: run(coordinates="polar"), ArgumentError, "coordinates"),
    ("unknown correction", lambda: run(correction="hope"), ArgumentError, "correction"),
    ("t_eval empty", lambda: run(t_eval=[]), ArgumentError, "t_eval"),
    ("t_eval NaN", lambda: run(t_eval=[0.0, NAN]), ArgumentError, "t_eval"),
    ("t_eval goes back", lambda: run(t_eval=[0.0, 0.5, 0.4]), ArgumentError, "t_eval"),
    ("t_eval outside the run", lambda: run(t_eval=[0.0, 2.0]), ArgumentError, "t_eval"),
    ("t_eval a matrix", lambda: run(t_eval=[[0.0, 1.0]]), ArgumentError, "t_eval"),
    ("step zero", lambda: run(step=0.0), ArgumentError, "step"),
    ("switch below one", lambda: run(switch_threshold=0.5), ArgumentError, "switch_threshold"),
    ("unknown independent velocity", lambda: run(independent=["B"]), UnknownNameError, "A"),
    ("initial state an array", lambda: run(initial=np.zeros(2)), ArgumentError, "initial"),
    ("initial state of another mechanism", lambda: run(initial=four_bar(1.0).assemble()), ArgumentError, "initial"),
    ("state NaN", lambda: pt.State(0.0, [NAN], [0.0]), ArgumentError, "q"),
    ("target of an unknown joint", lambda: pendulum().assemble(targets={"B": 1.0}), UnknownNameError, "A"),
    ("target NaN", lambda: pendulum().assemble(targets={"A": NAN}), ArgumentError, "targets"),
    ("target of two numbers", lambda: pendulum().assemble(targets={"A": [1.0, 2.0]}), ArgumentError, "targets"),
    ("rates a list", lambda: pendulum().assemble(rates=[1.0]), ArgumentError, "rates"),  # type: ignore[arg-type]
    ("coordinates of the wrong length", lambda: pendulum().compile().mass_matrix([0.0, 1.0]), ArgumentError, "q"),
    ("result of an unknown joint", lambda: run().joint("B"), UnknownNameError, "A"),
    ("result of an unknown body", lambda: run().body("rode"), UnknownNameError, "rod"),
    ("M not square", lambda: pt.partition.measure(np.ones((2, 3)), np.ones((1, 3))), ArgumentError, "M"),
    ("M NaN", lambda: pt.partition.measure([[NAN]], [[1.0]]), ArgumentError, "M"),
    ("M not positive", lambda: pt.partition.measure(np.diag([1.0, -1.0]), [[1.0, 1.0]]), ArgumentError, "positive"),
    ("C of other width", lambda: pt.partition.choose(np.eye(2), np.ones((1, 3))), ArgumentError, "C"),
    ("unknown unit", lambda: pt.units.convert(1.0, "m", "furlong"), PartitaError, "furlong"),
]


@pytest.mark.parametrize(("call", "kind", "word"), [c[1:] for c in DESCRIPTIONS], ids=[c[0] for c in DESCRIPTIONS])
def test_bad_description(call: Callable[[], Any], kind: type[PartitaError], word: str) -> None:
    with pytest.raises(kind, match=word):
        call()


@pytest.mark.parametrize(("call", "kind", "word"), [case[1:] for case in CALLS], ids=[c[0] for c in CALLS])
def test_bad_call(call: Callable[[], Any], kind: type[PartitaError], word: str) -> None:
    with pytest.raises(kind, match=word):
        call()


def test_error_carries_its_numbers_and_is_of_its_builtin_kind() -> None:
    with pytest.raises(ValueError) as caught:
        body(mass=-1.0)
    assert isinstance(caught.value, DescriptionError)
    assert (caught.value.element, caught.value.name) == ("body", "box")
    assert "-1" in str(caught.value)


def test_a_refused_element_leaves_no_trace() -> None:
    m = pendulum()
    before = m.to_spec()
    with pytest.raises(DescriptionError):
        m.add_rod("bar", start=ORIGIN, end=(1, 0, 0), mass=NAN)
    with pytest.raises(UnknownNameError):
        m.add_revolute("J", m.ground, "bar", point=ORIGIN)
    assert m.to_spec() == before


def test_lengths_that_cannot_close() -> None:
    """Crank 0.1, coupler 0.1 and rocker 0.1 m never span 1 m of ground: 0.7 m are missing."""
    with pytest.raises(AssemblyError, match="C") as caught:
        four_bar(1.0, (0.1, 0.1, 0.1)).assemble()
    assert caught.value.residual > 0.1
    assert caught.value.iterations > 0


def test_lengths_that_close_from_an_open_drawing() -> None:
    """The same drawing with sound lengths closes: the error above is not for being drawn open."""
    m = four_bar(1.0)
    state = m.assemble()
    assert float(np.max(np.abs(m.compile().constraints(state.q)))) <= 1e-12


def test_target_out_of_reach() -> None:
    """The crank upright is 0 turned; at 90 degrees to the left its end is 2 m from D, coupler and rocker span 1.2 m."""
    m = four_bar(1.0)
    with pytest.raises(AssemblyError) as caught:
        m.assemble(targets={"A": 0.5 * np.pi})
    assert caught.value.residual > 0.1


def test_run_of_an_open_loop_does_not_start() -> None:
    with pytest.raises(AssemblyError):
        four_bar(1.0, (0.1, 0.1, 0.1)).simulate(1.0)


@pytest.mark.parametrize("value", [NAN, INF, "fast", [1.0, 2.0], None], ids=str)
def test_torque_function_that_returns_no_number(value: Any) -> None:
    m = pendulum()
    m.add_torque("A", value=lambda t, state: value)
    with pytest.raises(EvaluationError, match="A") as caught:
        m.simulate(1.0)
    assert caught.value.t == 0.0


def test_drive_function_that_returns_nan() -> None:
    with pytest.raises(EvaluationError, match="A"):
        m = pendulum()
        m.add_drive("A", position=lambda t: NAN)
        m.simulate(1.0)


def test_exception_of_a_users_function_passes_through() -> None:
    def torque(t: float, state: Any) -> float:
        raise KeyError("my own mistake")

    m = pendulum()
    m.add_torque("A", value=torque)
    with pytest.raises(KeyError, match="my own mistake"):
        m.simulate(1.0)


@pytest.mark.parametrize(
    "change",
    [
        {"mass": lambda t, q: np.eye(3)},
        {"mass": lambda t, q: np.array([[1.0, 2.0], [0.0, 1.0]])},
        {"forces": lambda t, q, v: np.array([NAN, 0.0])},
        {"forces": lambda t, q, v: "gravity"},
        {"jacobian": lambda t, q: np.ones((1, 3))},
        {"constraints": lambda t, q: np.zeros(2)},
        {"bias": lambda t, q, v: np.zeros(2)},
    ],
    ids=["mass shape", "mass not symmetric", "forces NaN", "forces text", "jacobian width", "constraints", "bias"],
)
def test_system_function_of_wrong_shape(change: dict[str, Any]) -> None:
    functions: dict[str, Any] = {
        "mass": lambda t, q: np.eye(2),
        "forces": lambda t, q, v: np.array([0.0, -9.81]),
        "constraints": lambda t, q: np.array([0.5 * (q @ q - 1.0)]),
        "jacobian": lambda t, q: q.reshape(1, 2),
        "bias": lambda t, q, v: np.array([v @ v]),
        **change,
    }
    with pytest.raises(EvaluationError, match=next(iter(change))):
        pt.simulate(pt.System(2, **functions), 1.0, [1.0, 0.0], [0.0, 0.0])


def kite(off: float) -> pt.Mechanism:
    """Links a, a, b, b folded: the pin B lies on the pin D but for `off`, so that the crank is locked."""
    m = pt.Mechanism("kite", gravity=ORIGIN)
    d = (np.cos(0.3), np.sin(0.3), 0.0)
    b = (d[0] + off, d[1] + off, 0.0)
    c = (d[0] + 0.7 * np.cos(0.9), d[1] + 0.7 * np.sin(0.9), 0.0)
    m.add_rod("crank", ORIGIN, b, 1.0)
    m.add_rod("coupler", b, c, 1.0)
    m.add_rod("rocker", d, c, 1.0)
    m.add_revolute("A", m.ground, "crank", point=ORIGIN)
    m.add_revolute("B", "crank", "coupler", point=b)
    m.add_revolute("D", m.ground, "rocker", point=d)
    m.add_revolute("C", "coupler", "rocker", point=c, cut="always")
    return m


@pytest.mark.parametrize("off", [0.0, 1e-16, 5e-16, 1e-14, 1e-9])
def test_the_rate_of_a_joint_locked_to_round_off_is_refused(off: float) -> None:
    with pytest.raises(ArgumentError, match="A = 2"):
        kite(off).assemble(rates={"A": 2.0})
    state = kite(off).assemble(rates={"D": 2.0})
    assert np.abs(state.v).max() < 2.1


def test_the_rate_of_a_joint_next_to_a_dead_point_is_had() -> None:
    """What is steep, but no round-off, is given: the speed falls with the distance."""
    near, far = (np.abs(kite(off).assemble(rates={"A": 1.0}).v).max() for off in (1e-5, 1e-4))
    assert near / far == pytest.approx(10.0, rel=0.01)


def test_the_mobility_of_loops_that_do_not_close_is_refused() -> None:
    model = four_bar(5.0).compile()
    with pytest.raises(AssemblyError, match="the mobility needs an assembled position"):
        model.mobility  # noqa: B018
    assert four_bar(1.0).compile().mobility == 1


def test_ambiguous_names_are_refused() -> None:
    for kind in ("revolute", "spherical"):
        m = pendulum()
        m.add_body("plate", mass=1.0, inertia=(1, 1, 1))
        m.add_body("ball", mass=1.0, inertia=(1, 1, 1))
        m.add_planar("P", m.ground, "plate")
        getattr(m, f"add_{kind}")("P.x", "plate", "ball", point=ORIGIN)
        with pytest.raises(DescriptionError, match="rename one") as caught:
            m.compile()
        assert caught.value.name == "P.x"


def test_an_array_without_dimensions_is_no_list() -> None:
    """NumPy makes such arrays of numbers; each argument that takes a list refuses them by its name."""
    m = pt.catalogue.load("four-bar")
    x: Any = np.array(1.0)
    run = m.simulate(0.1)
    for name, call in {
        "fixed": lambda: m.assemble(fixed=x),
        "independent": lambda: m.simulate(0.1, independent=x),
        "inputs": lambda: m.assemblies(inputs=x),
        "states": lambda: m.ensemble(states=x, t_eval=[0, 0.1]),
        "actuators": lambda: m.inverse_dynamics(run, actuators=x),
        "inputs ": lambda: m.stepper(dt=0.01, inputs=x),
        "inputs  ": lambda: m.linearize(inputs=x),
        "outputs": lambda: m.linearize(outputs=x),
        "independent ": lambda: m.linearize(independent=x),
        "unknown": lambda: m.preload(unknown=x),
        "formulations": lambda: m.compare(0.1, formulations=x),
    }.items():
        with pytest.raises(ArgumentError, match=f"{name.strip()} must be a list"):
            call()
    with pytest.raises(DescriptionError, match="force must have three components"):
        m.add_force("crank", x)
    with pytest.raises(ArgumentError, match="names must be a list"):
        pt.State(0.0, [0.0], [0.0], names=x)


@pytest.mark.parametrize("name", ["rtol", "atol"])
@pytest.mark.parametrize("value", [1e308, 2.0, 1.0 + 1e-15])
def test_a_tolerance_that_admits_errors_as_large_as_the_motion_is_refused(name: str, value: float) -> None:
    m = pt.catalogue.load("four-bar")
    with pytest.raises(pt.errors.ArgumentError, match=f"{name} is .* at most 1"):
        m.simulate(1.0, **{name: value})
    with pytest.raises(pt.errors.ArgumentError, match=f"{name} is .* at most 1"):
        m.ensemble(states=[m.assemble()], t_eval=[0.0, 1.0], **{name: value})


def test_functions_that_return_huge_integers_are_refused() -> None:
    for add in (
        lambda m: m.add_torque("A", lambda t, state: 10**400, name="load"),
        lambda m: m.add_force("rod", lambda t, state: (0, 10**400, 0), (1, 0, 0), name="load"),
    ):
        m = pt.Mechanism("pendulum")
        m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
        m.add_revolute("A", m.ground, "rod", point=(0, 0, 0))
        add(m)
        with pytest.raises(pt.errors.EvaluationError, match=r'force "load" at t = 0 s.*an integer beyond 1e308'):
            m.simulate(0.1)
