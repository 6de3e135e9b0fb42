"""Events: when something passes a value, and the state there."""

import importlib.util
import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawings import parallelogram

import partita as pt
from partita.errors import ArgumentError, DescriptionError, EvaluationError, UnknownNameError


def rocker() -> pt.Mechanism:
    """A four-bar of which no joint turns fully: d = 1, l = 0.7, 0.8, 0.75, uniform rods of 1 kg/m, no gravity."""
    m = pt.Mechanism("rocker", gravity=(0, 0, 0))
    crank, coupler, follower = 0.7, 0.8, 0.75
    p, d = np.array([crank, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    apart = 1.0 - crank
    along = (coupler**2 - follower**2 + apart**2) / (2.0 * apart)
    q = p + np.array([along, math.sqrt(coupler**2 - along**2), 0.0])
    rods = [
        m.add_rod("crank", start=(0, 0, 0), end=p, mass=crank),
        m.add_rod("coupler", start=p, end=q, mass=coupler),
        m.add_rod("rocker", start=d, end=q, mass=follower),
    ]
    m.add_revolute("A", m.ground, rods[0], point=(0, 0, 0))
    m.add_revolute("B", rods[0], rods[1], point=p)
    m.add_revolute("C", rods[1], rods[2], point=q)
    m.add_revolute("D", m.ground, rods[2], point=d)
    return m


def pendulum(rate: float = 0.0) -> tuple[pt.Mechanism, pt.State]:
    """A point mass at 1 m that hangs at rest, or starts with this rate."""
    m = pt.Mechanism("pendulum", gravity=(0, -9.81, 0))
    bob = m.add_body("bob", mass=1.0, com=(0, -1, 0), inertia=np.zeros((3, 3)))
    m.add_revolute("A", m.ground, bob, point=(0, 0, 0))
    return m, m.assemble(rates={"A": rate})


def oscillators(rates: tuple[float, float] = (0.0, 0.0)) -> tuple[pt.Mechanism, pt.State]:
    """x = cos t and y = cos 3t."""
    m = pt.Mechanism("oscillators", gravity=(0, 0, 0))
    for name, stiffness in (("x", 1.0), ("y", 9.0)):
        body = m.add_body(name, mass=1.0, inertia=(1.0, 1.0, 1.0))
        slide = m.add_prismatic(name, m.ground, body, axis=(1, 0, 0))
        m.add_torsion_spring(slide, stiffness=stiffness, name=f"spring of {name}")
    return m, m.assemble({"x": 1.0, "y": 1.0})


ROCKER = (
    ("D turns back", 0.0885725444957202765064139991875, 1),
    ("1", 0.170107745559522858964332075921, 1),
    ("A turns back", 0.448201055991215170339037738839, -1),
    ("1", 0.630095764912336944846289862012, -1),
    ("0", 0.861337692577341956029751089995, -1),
    ("D turns back", 0.949910237073062232536165089183, -1),
    ("-1", 1.03144543813686481499408316592, -1),
    ("A turns back", 1.30953874856855712636878882883, 1),
    ("-1", 1.49143345748967890087604095201, 1),
    ("0", 1.72267538515468391205950217999, 1),
)
"""Times of the rocker that starts with 3 rad/s, by quadrature in the crank's angle in 50 digits, with their
directions."""


def rocker_events(**options: Any) -> list[pt.Event]:
    angles = [pt.Event(str(x), "A", value=x, **options) for x in (1, 0, -1)]
    return [*angles, *(pt.Event(f"{joint} turns back", joint, reads="velocity", **options) for joint in "AD")]


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize(("rtol", "error"), [(1e-6, 1e-6), (1e-9, 3e-9), (1e-12, 1e-11)])
def test_events_in_a_run_that_changes_its_coordinates(coordinates: str, rtol: float, error: float) -> None:
    m = rocker()
    start = m.assemble(rates={"A": 3.0}, coordinates=coordinates)
    few = m.simulate(
        1.8, initial=start, coordinates=coordinates, rtol=rtol, atol=rtol, events=rocker_events(), t_eval=[1.8]
    )
    assert few.counters["switches"] >= 8
    assert [(record.name, record.direction) for record in few.events] == [(name, sign) for name, _, sign in ROCKER]
    assert np.allclose(few.events.t, [t for _, t, _ in ROCKER], rtol=0.0, atol=error)
    for record in few.events:
        assert record.kind == "crossing" and record.before is record.after
        if record.name in ("0", "1", "-1") and coordinates == "relative":
            assert abs(record.before.position("A") - float(record.name)) < 1e-12


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_run_is_the_same_to_the_bit_whether_it_is_observed(compiled: bool, coordinates: str) -> None:
    m = rocker()
    start = m.assemble(rates={"A": 3.0}, coordinates=coordinates)
    common: dict[str, Any] = {"initial": start, "compiled": compiled, "coordinates": coordinates}
    alone, seen = m.simulate(5.0, **common), m.simulate(5.0, events=rocker_events(), **common)
    assert alone.q.tobytes() == seen.q.tobytes() and alone.v.tobytes() == seen.v.tobytes()
    assert alone.counters["steps"] == seen.counters["steps"] and len(seen.events) > 20
    assert seen.success and seen.status == "finished"


def test_the_state_at_an_event_is_that_of_the_run_there() -> None:
    m = rocker()
    run = m.simulate(1.8, initial=m.assemble(rates={"A": 3.0}), events=rocker_events())
    for record in run.events:
        there = run.state(record.t)
        assert np.allclose(there.q, record.before.q, rtol=0.0, atol=1e-13)
        if record.t < 1.7:
            again = m.simulate(0.1, initial=record.after, t_eval=[record.t + 0.1])
            assert np.allclose(again.q[-1], run.state(record.t + 0.1).q, rtol=0.0, atol=1e-7)


def test_events_at_one_instant_are_all_there_in_the_order_in_which_they_were_given() -> None:
    m, start = oscillators()
    events = [pt.Event("y", "y"), pt.Event("x", "x")]
    run = m.simulate(9.0, initial=start, events=events, rtol=1e-12, atol=1e-12)
    x = [(2 * i + 1) * math.pi / 2 for i in range(3)]
    y = [(2 * i + 1) * math.pi / 6 for i in range(9)]
    assert np.allclose(run.events["y"].t, [t for t in y if t < 9.0], rtol=0.0, atol=1e-11)
    assert np.allclose(run.events["x"].t, x, rtol=0.0, atol=1e-11)
    # two names for one thing are one instant
    twice = [pt.Event("b", "x"), pt.Event("a", lambda t, state: state.position("x")), pt.Event("c", "x", direction=-1)]
    found = m.simulate(9.0, initial=start, events=twice).events
    assert [record.name for record in found] == ["b", "a", "c", "b", "a", "b", "a", "c"]
    assert [len({record.t for record in found if abs(record.t - t) < 1e-3}) for t in x] == [1, 1, 1]


PAIRS = (
    (0.99, 0.485535753374171413377314694913, 0.584033046905173009021550818418),
    (0.9999, 0.529862154926156445002085088590, 0.539706645353187977396780424741),
    (0.999999, 0.534292178225870036986580251476, 0.535276622053474385412285261855),
    (0.999999999, 0.534768834716885629550116462259, 0.534799965562458792848749051072),
    (0.999999999999, 0.534783907917784746680836144343, 0.534784892361559675718029368988),
)
"""When a pendulum of amplitude 1 passes an angle on its way up and on its way down: by quadrature in 45 digits."""
FAST = 3.00320974273644409815770933462
"""Its rate at the bottom [rad/s]."""


@pytest.mark.parametrize("python", [False, True])
@pytest.mark.parametrize(("angle", "up", "down"), PAIRS)
def test_two_crossings_within_one_step_are_both_found(angle: float, up: float, down: float, python: bool) -> None:
    m, start = pendulum(FAST)

    def above(t: float, state: pt.State) -> Any:
        return state.position("A") - angle

    run = m.simulate(
        1.0, initial=start, rtol=1e-13, atol=1e-13, events=[above if python else pt.Event("above", "A", value=angle)]
    )
    assert [record.direction for record in run.events] == [1, -1]
    # where the pair is close, its distance is as exact as the root of the rounding of the angle
    apart = 2e-14 / (down - up) + 1e-11
    assert np.allclose(run.events.t, [up, down], rtol=0.0, atol=apart), run.events.t - [up, down]


def test_a_touch_is_nothing_or_both_and_slightly_faster_is_both() -> None:
    m, start = pendulum(2.43938811233649624865878161556)  # turns back at 0.8
    touched = m.simulate(1.0, initial=start, rtol=1e-12, atol=1e-12, events=[pt.Event("touch", "A", value=0.8)]).events
    assert [record.direction for record in touched] in ([], [1, -1])
    assert all(abs(record.t - 0.522345282886298529899774234248) < 1e-5 for record in touched)
    m, start = pendulum(2.43939055172460858515503027434)
    passed = m.simulate(1.0, initial=start, rtol=1e-12, atol=1e-12, events=[pt.Event("pass", "A", value=0.8)]).events
    assert np.allclose(passed.t, [0.521855107541922239319477729021, 0.522835549683319445192649707075], atol=1e-9)


@pytest.mark.parametrize("rate", [1.0, -1.0])
@pytest.mark.parametrize("python", [False, True])
def test_a_start_on_the_value_is_no_event_and_an_end_is_one(rate: float, python: bool) -> None:
    m, start = pendulum(rate)
    event = pt.Event("bottom", (lambda t, state: state.position("A")) if python else "A")
    run = m.simulate(5.0, initial=start, events=[event], rtol=1e-11, atol=1e-11)
    half = run.events[0].t
    assert run.events[0].direction == -math.copysign(1, rate) and half > 0.9
    # from an event on it is not found again
    on = m.simulate(5.0 - half, initial=run.events[0].after, events=[event], rtol=1e-11, atol=1e-11)
    assert np.allclose(on.events.t, run.events.t[1:], rtol=0.0, atol=1e-9)
    assert [record.direction for record in on.events] == [record.direction for record in run.events][1:]


def test_an_event_exactly_at_an_output_at_a_step_and_at_the_end() -> None:
    m = pt.Mechanism("bead", gravity=(0, 0, 0))
    bead = m.add_body("bead", mass=1.0, inertia=(1.0, 1.0, 1.0))
    m.add_prismatic("x", m.ground, bead, axis=(1, 0, 0))
    start = m.assemble({"x": 1.0}, rates={"x": -2.0})
    for step in (None, 0.25, 0.125, 0.1):
        run = m.simulate(1.0, initial=start, t_eval=[0, 0.25, 0.5, 0.75, 1], events=[pt.Event("zero", "x")], step=step)
        assert run.t.tolist() == [0, 0.25, 0.5, 0.75, 1] and np.allclose(run.events.t, [0.5], rtol=0.0, atol=1e-13)
    ends = m.simulate(0.5, initial=start, events=[pt.Event("zero", "x")])
    assert np.allclose(ends.events.t, [0.5], rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("step", [None, 0.01])
def test_a_terminal_event_is_the_last_output_and_a_success(step: float | None) -> None:
    m, start = pendulum(FAST)
    event = pt.Event("half", "A", value=0.5, direction=-1, terminal=2)
    times = np.linspace(0, 10, 101)
    whole = m.simulate(
        10.0,
        initial=start,
        t_eval=times,
        rtol=1e-11,
        atol=1e-11,
        step=step,
        events=[pt.Event("half", "A", value=0.5, direction=-1)],
    )
    run = m.simulate(10.0, initial=start, t_eval=times, rtol=1e-11, atol=1e-11, step=step, events=[event])
    assert run.success and run.status == "event" and '"half"' in run.message
    assert len(run.events) == 2 and run.t[-1] == run.events[-1].t and (run.t[:-1] == times[: len(run.t) - 1]).all()
    assert abs(run.t[-1] - whole.events[1].t) < (1e-9 if step is None else 1e-7)
    assert abs(run.state().position("A") - 0.5) < 1e-11
    assert run.certificate.verdict == "valid"


def test_directions_once_and_functions_of_scipy() -> None:
    m, start = pendulum(FAST)

    def at_half(t: float, state: Any) -> Any:
        return state.position("A") - 0.5

    at_half.direction = -1.0  # type: ignore[attr-defined]
    events = [
        pt.Event("both", "A", value=0.5),
        pt.Event("up", "A", value=0.5, direction=1),
        pt.Event("first", "A", value=0.5, once=True),
        pt.Event("never", "A", value=2.0),
        at_half,
    ]
    found = m.simulate(5.0, initial=start, events=events).events
    assert found["both"].t.tolist() == sorted([*found["up"].t, *found["at_half"].t])
    assert found["first"].t.tolist() == found["both"].t[:1].tolist() and len(found["never"]) == 0
    assert all(record.direction == 1 for record in found["up"])
    assert np.allclose(found["at_half"].t, found["both"].t[1::2], rtol=0.0, atol=1e-12)
    with pytest.raises(UnknownNameError, match="did you mean 'never'"):
        found["nevr"]


def test_measures_sensors_and_functions_of_them_agree() -> None:
    m = pt.catalogue.load("four-bar")
    gap = pt.Distance("ground", (0.1, 0.2, 0), "coupler", (0, 0, 0))
    near = m.add_sensor("near", gap, "position")
    rate = m.add_sensor("rate", gap, "velocity")
    force = m.add_sensor("force", "A", "force")
    run = m.simulate(2.0, rtol=1e-11, atol=1e-11)
    middle = float(np.mean(run.sensor("near").values))
    events = [
        pt.Event("measure", gap, value=middle),
        pt.Event("sensor", near, value=middle),
        pt.Event("by name", "near", value=middle),
        pt.Event("expression", 2.0 * near - middle, value=middle),
        pt.Event("function", lambda t, state: state.sensor("near") - middle),
        pt.Event("rate of the measure", gap, reads="velocity"),
        pt.Event("rate", rate),
        pt.Event("force", force[1], value=float(np.mean(run.sensor("force").values[:, 1]))),
    ]
    found = m.simulate(2.0, rtol=1e-11, atol=1e-11, events=events)
    assert len(found.events["measure"]) >= 2
    for name in ("sensor", "by name", "expression", "function"):
        assert np.allclose(found.events[name].t, found.events["measure"].t, rtol=0.0, atol=1e-11)
    assert np.allclose(found.events["rate"].t, found.events["rate of the measure"].t, rtol=0.0, atol=1e-12)
    extremes = [m.simulate(0.1, initial=record.after).sensor("rate").values[0] for record in found.events["rate"]]
    assert np.allclose(extremes, 0.0, atol=1e-10)
    pulled = found.events["force"]
    assert len(pulled) >= 2
    for record in pulled:
        there = m.simulate(0.1, initial=record.after).sensor("force").values[0, 1]
        assert abs(there - events[-1].value) < 1e-8


@pytest.mark.parametrize("depth", [10, 24, 49, 60, 98])
def test_expressions_of_any_depth_are_followed(depth: int) -> None:
    """f -> f + 0.01 f, often: the angle times a number."""
    m, state = pendulum(3.0)
    angle = m.add_sensor("angle", "A", "position")
    deep = angle
    for _ in range(depth):
        deep = deep + 0.01 * angle
    deep_run = m.simulate(0.5, initial=state, events=[pt.Event("deep", deep, value=0.5 * (1.0 + 0.01 * depth))])
    shallow = m.simulate(0.5, initial=state, events=[pt.Event("plain", "A", value=0.5)])
    assert deep_run.events.t == pytest.approx(shallow.events.t, rel=1e-12) and len(shallow.events) == 1
    for _ in range(101 - depth):
        deep = deep + 0.01 * angle
    with pytest.raises(DescriptionError, match="nested more than 100 deep"):
        m.simulate(0.5, initial=state, events=[pt.Event("deeper", deep)])


def test_an_angle_of_a_joint_that_closes_a_loop_is_followed_over_whole_turns() -> None:
    m = pt.catalogue.load("spatial-four-bar")
    names = m.compile().summary["joints"]
    cut = next(joint["name"] for joint in names if not joint["tree"] and joint["axes"] == ["turn"])
    free = m.simulate(3.0, rtol=1e-10, atol=1e-10, t_eval=np.linspace(0.0, 3.0, 3001))
    angle = free.joint(cut).angle
    levels = np.linspace(angle.min(), angle.max(), 7)[1:-1]
    found = m.simulate(3.0, rtol=1e-10, atol=1e-10, events=[pt.Event(f"{x:.3f}", cut, value=float(x)) for x in levels])
    for level, name in zip(levels, found.events.names, strict=True):
        above = angle > level
        crossings = np.flatnonzero(above[1:] != above[:-1])
        assert len(found.events[name]) == len(crossings)
        assert np.allclose(found.events[name].t, free.t[crossings], rtol=0.0, atol=1.1e-3)


@pytest.mark.parametrize("method", ["rk4", "dop853"])
@pytest.mark.parametrize("substeps", [1, 3])
def test_a_stepper_finds_what_a_run_finds_and_its_steps_end_at_their_times(method: str, substeps: int) -> None:
    m = rocker()
    start = m.assemble(rates={"A": 3.0})
    plain, sim = (
        m.stepper(0.01, initial=start, method=method, substeps=substeps, events=events)
        for events in (None, rocker_events())
    )
    found = []
    for i in range(180):
        assert plain.step().q.tobytes() == sim.step().q.tobytes()
        assert sim.time == pytest.approx(0.01 * (i + 1), abs=1e-12)
        assert all(sim.time - 0.01 - 1e-12 < record.t <= sim.time for record in sim.events)
        found += [(record.name, record.t) for record in sim.events]
    assert [name for name, _ in found] == [name for name, _, _ in ROCKER]
    run = m.simulate(1.8, initial=start, method=method, step=0.01 / substeps, events=rocker_events())
    assert np.allclose([t for _, t in found], run.events.t, rtol=0.0, atol=1e-12)
    assert [(record.name, record.t) for record in sim.result().events] == found
    sim.reset()
    again = []
    for _ in range(180):
        sim.step()
        again += [(record.name, record.t) for record in sim.events]
    assert again == found


def test_a_stepper_sees_inputs_that_change_at_its_steps() -> None:
    """A mass that is pushed to and fro by a force that jumps at every step: v = 0 where the impulse is zero."""
    m = pt.Mechanism("mass", gravity=(0, 0, 0))
    body = m.add_body("mass", mass=1.0, inertia=(1.0, 1.0, 1.0))
    slide = m.add_prismatic("x", m.ground, body, axis=(1, 0, 0))
    m.add_torque(slide, 0.0, name="push")
    sim = m.stepper(0.1, inputs=["push"], events=[pt.Event("stands", "x", reads="velocity")])
    v, t, expected, found = 0.0, 0.0, [], []
    for noise in np.random.default_rng(3).uniform(-5.0, 5.0, 100):
        force = float(noise) - 8.0 * v
        sim.step([force])
        if v != 0.0 and v * (v + 0.1 * force) < 0.0:
            expected.append(t - v / force)
        v, t = v + 0.1 * force, t + 0.1
        found += sim.events.t.tolist()
    assert len(found) > 10 and np.allclose(found, expected, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("suffix", [".nc", ".mat", ".zarr", ".json", ".parquet", ".csv"])
def test_stored_results_have_their_events(tmp_path: Path, suffix: str) -> None:
    run = rocker().simulate(1.8, initial=rocker().assemble(rates={"A": 3.0}), events=rocker_events())
    run.save(tmp_path / f"run{suffix}")
    read = pt.load_result(tmp_path / f"run{suffix}")
    assert read.events.names == run.events.names
    assert [(x.name, x.t, x.kind, x.direction) for x in read.events] == [
        (x.name, x.t, x.kind, x.direction) for x in run.events
    ]
    assert all((x.before.q == y.before.q).all() for x, y in zip(read.events, run.events, strict=True))
    copied = pickle.loads(pickle.dumps(run))
    assert copied.events.t.tolist() == run.events.t.tolist() and repr(copied.events) == repr(run.events)


def test_functions_that_fail_are_named_and_what_was_computed_stays() -> None:
    m, start = pendulum(FAST)

    def breaks(t: float, state: Any) -> float:
        if t > 0.5:
            raise ZeroDivisionError("no more")
        return 1.0

    run = m.simulate(2.0, initial=start, events=[pt.Event("breaks", breaks), pt.Event("zero", "A")])
    assert not run.success and 0.3 < run.t[-1] <= 0.5 and '"breaks"' in run.message and "no more" in run.message
    assert isinstance(run.error, EvaluationError) and isinstance(run.error.__cause__, ZeroDivisionError)
    for value, word in (("high", "number"), (math.nan, "finite"), ([1.0, 2.0], "number")):
        run = m.simulate(2.0, initial=start, events=[pt.Event("odd", lambda t, state, value=value: value)])
        assert not run.success and '"odd"' in run.message and word in run.message, run.message


def test_more_events_than_allowed_end_the_run_with_their_names() -> None:
    m, start = oscillators()
    with pt.limits.raised(events=10):
        run = m.simulate(100.0, initial=start, events=[pt.Event("y", "y")])
    assert not run.success and len(run.events) == 10
    assert '"y"' in run.message and '"events"' in run.message and "10" in run.message


def test_bad_events_are_refused_by_name() -> None:
    m, _ = pendulum()
    force = pt.Mechanism("other").add_body("b", mass=1.0, inertia=(1.0, 1.0, 1.0))
    for make, words in (
        (lambda: pt.Event("", "A"), "printable"),
        (lambda: pt.Event("e", "A", direction=2), "direction"),
        (lambda: pt.Event("e", "A", direction=True), "direction"),
        (lambda: pt.Event("e", "A", terminal=0.5), "terminal"),
        (lambda: pt.Event("e", "A", terminal=-1), "terminal"),
        (lambda: pt.Event("e", "A", value=math.inf), "finite"),
        (lambda: pt.Event("e", "A", value="1"), "number"),
        (lambda: pt.Event("e", "A", reads="speed"), "reads"),
        (lambda: pt.Event("e", "A", once=1), "once"),
        (lambda: m.simulate(1.0, events=pt.Event("e", "A")), "list"),
        (lambda: m.simulate(1.0, events=["A"]), "pt.Event"),
        (lambda: m.simulate(1.0, events=[pt.Event("e", "A"), pt.Event("e", "A")]), "two events"),
        (lambda: m.stepper(0.1, events=[pt.Event("e", "A", terminal=True)]), "terminal"),
    ):
        with pytest.raises(ArgumentError, match=words):
            make()
    for of, words in (
        (3.0, "cannot follow"),
        (pt.Coordinate("A", 1), 'joint "A"'),
        (force, "cannot follow"),
        (pt.Distance("ground", (0, 0, 0), "bib", (0, 0, 0)), "bob"),
    ):
        with pytest.raises((DescriptionError, UnknownNameError), match=words):
            m.simulate(1.0, events=[pt.Event("e", of)])
    with pytest.raises(UnknownNameError, match="B"):
        m.simulate(1.0, events=[pt.Event("e", "B")])


def test_a_start_at_a_singular_position_says_from_when_on_events_are_looked_for() -> None:
    m = parallelogram(angle=0.0)
    start = m.assemble(rates={"A": 2.0, "D": 2.0})
    run = m.simulate(1.0, initial=start, events=[pt.Event("one", "A", value=1.0)])
    assert len(run.events) == 1 and any("events were looked for from" in note for note in run.notes)


def test_systems_given_by_matrices_have_events_of_functions() -> None:
    spring = pt.System(1, mass=[[1.0]], forces=lambda t, q, v: -4.0 * q)
    events = [pt.Event("zero", lambda t, state: state.q[0]), pt.Event("turns", lambda t, state: state.v[0], terminal=3)]
    run = pt.simulate(spring, 10.0, [1.0], [0.0], rtol=1e-12, atol=1e-12, events=events)
    assert run.status == "event" and run.success
    assert np.allclose(run.events["zero"].t, (0.5 + np.arange(3)) * math.pi / 2, rtol=0.0, atol=1e-11)
    # a start at rest is no event
    assert np.allclose(run.events["turns"].t, np.arange(1, 4) * math.pi / 2, rtol=0.0, atol=1e-11)
    with pytest.raises(ArgumentError, match="no joints"):
        pt.simulate(spring, 1.0, [1.0], [0.0], events=[pt.Event("e", "A")])


def test_events_in_a_dataset_are_a_table(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    m = rocker()
    run = m.simulate(1.8, initial=m.assemble(rates={"A": 3.0}), events=rocker_events())
    run.save(tmp_path / "run.nc")
    with xarray.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as stored:
        for found in (run.to_xarray(), stored):
            assert found.event_t.dims == ("event",) and found.event_t.attrs["units"] == "s"
            assert found.event_t.values.tolist() == run.events.t.tolist()
            assert found.event_name.values.tolist() == [event.name for event in run.events]
            assert found.event_direction.values.tolist() == [event.direction for event in run.events]
            turns = found.event_t.where(found.event_name == "A turns back", drop=True)
            assert turns.values.tolist() == run.events["A turns back"].t.tolist()
    for events in (None, [pt.Event("far", "A", value=9.0)]):
        assert "event" not in m.simulate(0.1, events=events).to_xarray().dims


def test_events_as_text_are_short_and_escaped() -> None:
    m, start = oscillators()
    evil = "<b>y</b> & co"
    run = m.simulate(60.0, initial=start, events=[pt.Event(evil, "y"), pt.Event("far", "x", value=9.0)])
    assert len(run.events) == 57
    page = run.events._repr_html_()
    assert "<b>y" not in page and "&lt;b&gt;y&lt;/b&gt; &amp; co, falling" in page and page.startswith("<table>")
    assert "57 events" in page and "33 more" in page and "far" in page and page.count("<tr>") == 26
    lines = repr(run.events).splitlines()
    assert len(lines) == 25 and "33 later" in lines[-1] and evil in lines[0]
    assert "57: &lt;b&gt;y" in run._repr_html_() and "49 more" in run._repr_html_()
    assert "events" not in m.simulate(0.1)._repr_html_()
    one = m.simulate(1.0, initial=start, events=[pt.Event("y", "y")]).events
    assert "1 event<" in one._repr_html_() and "did not happen" not in one._repr_html_()


def test_a_result_says_where_its_events_are() -> None:
    m, _ = pendulum()
    run = m.simulate(0.1)
    assert "events" in dir(run) and len(run.events) == 0 and "no events" in repr(run.events)
    for name in ("t_events", "y_events", "event", "crossings"):
        with pytest.raises(AttributeError, match=r"run\.events"):
            getattr(run, name)


def test_a_member_of_an_ensemble_has_the_events_of_its_run() -> None:
    m = rocker()
    states = [m.assemble(rates={"A": rate}) for rate in (2.0, 3.0, 4.0)]
    found = m.ensemble(states=states, t_eval=[0.0, 0.9, 1.8])
    assert len(found.result(1).events) == 0
    run = found.result(1, events=rocker_events())
    assert [(event.name, event.direction) for event in run.events] == [(name, sign) for name, _, sign in ROCKER]
    # without forces the motion is the same at every rate, sooner or later
    for i, rate in enumerate((2.0, 3.0)):
        times = found.result(i, events=rocker_events()).events.t
        assert np.allclose(times * rate / 3.0, [t for _, t, _ in ROCKER][: len(times)], rtol=0.0, atol=1e-6)
    end = found.result(2, events=[pt.Event("end", "A", value=1.0, direction=-1, terminal=True)])
    assert end.status == "event" and end.t.tolist() == [0.0, end.events[0].t]
    with pytest.raises(UnknownNameError, match="B"):
        found.result(0, events=[pt.Event("e", "Bx")])


def quarter(stiffness: float) -> dict[str, float]:
    """When a mass on a spring that starts at 1 is first at 0, by the core and by a function."""
    m = pt.Mechanism("mass", gravity=(0, 0, 0))
    body = m.add_body("mass", mass=1.0, inertia=(1.0, 1.0, 1.0))
    m.add_torsion_spring(m.add_prismatic("x", m.ground, body, axis=(1, 0, 0)), stiffness=stiffness)
    start = m.assemble({"x": 1.0})
    events = [pt.Event("zero", "x"), pt.Event("same", lambda t, state: state.position("x"), terminal=True)]
    run = m.simulate(10.0, initial=start, events=events, rtol=1e-11, atol=1e-11)
    return {"first": run.events["zero"].t[0], "end": run.t[-1], "count": float(len(run.events))}


@pytest.mark.parametrize("executor", [None, "threads", "processes"])
def test_runs_of_a_sweep_have_events(executor: str | None) -> None:
    pytest.importorskip("xarray")
    stiffness = np.array([0.5, 1.0, 2.0, 4.0])
    found = pt.sweep(quarter, {"stiffness": stiffness}, executor=executor, workers=None if executor is None else 2)
    assert np.allclose(found["first"], 0.5 * math.pi / np.sqrt(stiffness), rtol=0.0, atol=1e-10)
    assert (found["end"] == found["first"]).all() and (found["count"] == 2).all()


def test_the_example_meets_its_known_times(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And the picture of docs/events.md is the one that it draws."""
    pytest.importorskip("matplotlib")
    root = Path(__file__).parents[2]
    found = importlib.util.spec_from_file_location("events_example", root / "examples" / "events.py")
    assert found is not None and found.loader is not None
    example = importlib.util.module_from_spec(found)
    found.loader.exec_module(example)
    assert example.main(tmp_path) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(example.ANSWERS) + 2 == 15
    assert max(abs(float(line.split()[-1])) for line in lines[1:-1]) < 1e-11
    assert "thirteen to\nbetter than 1e-12 s" in (root / "docs" / "events.md").read_text("utf-8")
    drawn, shown = ((folder / "events.svg").read_text("utf-8") for folder in (tmp_path, root / "docs" / "pictures"))
    assert 0.8 < len(drawn) / len(shown) < 1.25 and len(shown) < 150_000
    for danger in ("<script", "http://localhost", "foreignObject", "onload"):
        assert danger not in shown


def test_an_event_in_the_first_step_is_found_wherever_in_it_it_lies() -> None:
    """What the search for its zero comes near to is not a start on the value."""
    m = pt.catalogue.load("punch-press")
    whole = m.simulate(0.06, initial=m.assemble({"main": 1.5}, {"main": 12.0}), rtol=1e-12, atol=1e-13)
    for joint in ("main", "guide", "big end"):
        when = 0.0497
        event = pt.Event("there", joint, value=float(whole.state(when).position(joint)))
        for part in (0.02, 0.2, 0.4, 0.6, 0.8, 0.9, 0.98):
            for step in (4e-4, 2e-3):
                start = whole.state(when - part * step)
                run = m.simulate(3.0 * step, initial=start, events=[event], max_step=step, rtol=1e-10, atol=1e-12)
                assert run.events.t == pytest.approx([when], abs=1e-11), (joint, part, step)
