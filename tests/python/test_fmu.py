"""FMUs as other programs see them: FMPy finds no fault, and steps agree with `simulate`."""

import ctypes
import json
import sys
import xml.etree.ElementTree as ElementTree
import zipfile
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from catalogue_runs import WITHOUT_EVENTS
from geometry_study import misdrawn
from oracle.slave import STEP, Instance
from thorough import either

import partita as pt
from partita.io import fmu as archive
from partita.io.fmu_description import VERSIONS

if not list(archive.BINARIES.glob("*partita_fmu*")):
    pytest.skip("the binary for FMUs is not built (make fmu)", allow_module_level=True)

TIMES = np.linspace(0.0, 1.0, 51)


def four_bar(torque: Any = 0.0) -> pt.Mechanism:
    """The four-bar of the catalogue, with a motor at its crank."""
    m = pt.catalogue.load("four-bar")
    m.add_torque("A", value=torque, name="motor")
    return m


def written(m: pt.Mechanism, folder: Path, **options: Any) -> Path:
    return m.to_fmu(folder / "model.fmu", rtol=1e-11, atol=1e-13, **options)


@pytest.fixture(params=VERSIONS)
def version(request: pytest.FixtureRequest) -> str:
    """Of FMI."""
    return str(request.param)


@pytest.fixture
def opened(tmp_path: Path) -> Iterator[Any]:
    """Opens FMUs, and frees them."""
    made: list[Instance] = []

    def make(path: Path, guid: str | None = None) -> Instance:
        made.append(Instance(path, tmp_path / f"unpacked {len(made)} é", guid))
        return made[-1]

    yield make
    for one in made:
        one.free()


def test_fmpy_finds_nothing_and_runs_it(version: str, tmp_path: Path) -> None:
    """Co-simulation with a constant torque is the run: coordinates, rates, reactions and energies to 1e-8."""
    fmpy = pytest.importorskip("fmpy", reason="fmpy is no pinned tool; the others run FMUs by ctypes")
    from fmpy.validation import validate_fmu

    path = written(four_bar(), tmp_path, inputs=["motor"], outputs=["A", "C", "D.force", "A.moment", "energy"],
                   version=version)  # fmt: skip
    assert validate_fmu(str(path)) == []
    reported = fmpy.read_model_description(str(path), validate=True)
    assert reported.fmiVersion == version
    assert [x.name for x in reported.modelVariables][:3] == ["motor", "A.position", "A.velocity"]
    names = [x.name for x in reported.modelVariables if x.causality == "output"]
    found = fmpy.simulate_fmu(str(path), stop_time=1.0, step_size=STEP, output_interval=STEP, output=names,
                              start_values={"motor": 0.8})  # fmt: skip
    r = four_bar(0.8).simulate(1.0, t_eval=TIMES, rtol=1e-11, atol=1e-13)
    assert np.abs(found["time"] - TIMES).max() < 1e-9
    a, c, d = (r.joint(name) for name in "ACD")
    wanted = {
        "A.position": a.position[:, 0],
        "A.velocity": a.velocity[:, 0],
        "C.position": c.position[:, 0],
        "C.velocity": c.velocity[:, 0],
        **in_version(version, "D.force", d.force),
        **in_version(version, "A.moment", a.moment),
        "energy.kinetic": r.energy.kinetic,
        # a torque that is the same for ever has a potential; one that is an input does work
        "energy.potential": r.energy.potential + 0.8 * (a.position[:, 0] - a.position[0, 0]),
    }
    assert set(wanted) == set(names)
    for name, values in wanted.items():
        assert np.abs(found[name] - values).max() < 1e-8 * max(1.0, np.abs(values).max()), name


@pytest.mark.parametrize("name", either(["slider-crank", "stewart-ups"], WITHOUT_EVENTS))
def test_fmpy_finds_nothing_in_the_catalogue(name: str, tmp_path: Path) -> None:
    """And steps both versions alike, to the last bit."""
    fmpy = pytest.importorskip("fmpy", reason="fmpy is no pinned tool; the others run FMUs by ctypes")
    from fmpy.validation import validate_fmu

    m, found = pt.catalogue.load(name), []
    parameters = list(m.compile().parameters)[:6]
    for version in VERSIONS:
        path = tmp_path / f"{version}.fmu"
        try:
            m.to_fmu(path, parameters=parameters, version=version)
        except pt.errors.DescriptionError as error:
            assert "Python functions" in str(error)
            return
        assert validate_fmu(str(path)) == []
        steps = fmpy.simulate_fmu(str(path), stop_time=3 * STEP, step_size=STEP, output_interval=STEP)
        found.append(np.column_stack([steps[x].reshape(len(steps), -1) for x in steps.dtype.names]))
    assert found[0].shape[0] == 4 and np.array_equal(*found)


def in_version(version: str, name: str, values: Any) -> dict[str, Any]:
    """The three numbers as the version has them: as variables alone, or as an array."""
    if version == "3.0":
        return {name: values if isinstance(values, np.ndarray) else list(values)}
    return {f"{name}.{axis}": np.asarray(values)[..., i] for i, axis in enumerate("xyz")}


@pytest.mark.parametrize("seed", [0, 2, 10, 18, 26, 34, 42])
def test_a_misdrawn_mechanism_is_the_same_one_in_an_fmu(seed: int, tmp_path: Path, opened: Any) -> None:
    """Run, stepper and FMU of what was repaired end in one position."""
    case = misdrawn.case(seed)
    m = case.drawn.mechanism("it")
    start = m.assemble(rates=case.rates or None)
    steps = 4
    times = np.linspace(0.0, 0.25 * case.span, steps + 1)
    run = m.simulate(times[-1], t_eval=times, initial=start, rtol=1e-11, atol=1e-13)
    assert run.success and run.summary["repaired"] > 0
    stepper = m.stepper(times[1] / 50, initial=start)
    for _ in range(50 * steps):
        stepper.step()
    hinges = [j.name for j in case.drawn.joints if j.kind == "revolute"]
    one = opened(written(m, tmp_path, outputs=hinges, initial=start))
    one.begin()
    for t in times[:-1]:
        assert one.step(float(t), float(times[1])) == 0, one.messages
    for i, hinge in enumerate(hinges):
        position = [float(x.joint(hinge).position[-1, 0]) for x in (run, stepper.result())]
        assert np.abs(np.array(position) - one.get(2 * i)).max() < 1e-7, hinge


def test_inputs_that_change_act_over_their_steps(version: str, tmp_path: Path, opened: Any) -> None:
    """Efforts are held: the same bits as of runs one after the other, each with its own torque."""
    one = opened(written(four_bar(), tmp_path, inputs=["motor"], outputs=["A", "D.force"], version=version))
    one.begin()
    step = 1.0 / 64.0  # so that times are sums without rounding
    state, m = four_bar().assemble(), four_bar()
    for k in range(5):
        torque = float(np.sin(3.0 * k))
        assert one.set(0, torque) == 0 and one.step(k * step, step) == 0, one.messages
        r = m.simulate(step, initial=state, t_eval=[k * step, (k + 1) * step], rtol=1e-11, atol=1e-13,
                       parameters={"motor.value": torque})  # fmt: skip
        state = r.state()
        wanted = [r.joint("A").position[-1, 0], r.joint("A").velocity[-1, 0], *r.joint("D").force[-1]]
        assert one.get(1, 2, 3, 4, 5) == wanted
    assert one.get(0) == [torque]


def test_a_joint_and_a_drive_as_inputs(version: str, tmp_path: Path, opened: Any) -> None:
    """The rate of a drive of velocities varies linearly; its effort is that of the same run with a function."""
    m = pt.catalogue.load("four-bar")
    m.add_drive("A", velocity=1.0, name="crank")
    one = opened(written(m, tmp_path, inputs=["crank", "D"], outputs=["A", "A.effort"], version=version))
    one.begin(5.0)
    assert abs(one.get(0)[0] - 1.0) < 1e-12
    angle = one.get(3)[0]
    for k, rate in enumerate((1.0, 1.5, 0.5)):
        before = one.get(4)[0]
        for reference, value in enumerate((before, (rate - before) / STEP, 0.3)):
            assert one.set(reference, value) == 0
        assert one.step(5.0 + k * STEP) == 0, one.messages
        angle += 0.5 * (before + rate) * STEP
        assert np.abs(np.array(one.get(3, 4)) - (angle, rate)).max() < 1e-12
    other = pt.catalogue.load("four-bar")
    growth = -1.0 / STEP
    first = angle - 0.5 * (1.5 + 0.5) * STEP
    drawn = other.assemble()
    other.add_drive("A", lambda t: first + 1.5 * t + 0.5 * growth * t * t, name="crank")
    other.add_torque("D", value=0.3)
    start = other.assemble(near=drawn)
    r = other.simulate(STEP, initial=start, rtol=1e-11, atol=1e-13)
    effort = one.get(5)[0]
    assert abs(r.joint("A").drive[-1, 0] - effort) < 1e-7 * max(1.0, abs(effort))


def lift(driven: bool = True) -> pt.Mechanism:
    """1 kg on a slide, moved by a drive of positions."""
    m = pt.Mechanism("lift", gravity=(0, 0, -9.81))
    load = m.add_body("load", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("S", m.ground, load, point=(0, 0, 0), axis=(0, 0, 1))
    if driven:
        m.add_drive("S", position=0.0, name="lift")
    return m


def stroke(t: float) -> tuple[float, float, float]:
    """A motion of 10 mm from rest, with its rate and its acceleration."""
    w = 10 * np.pi
    return 0.01 * (1 - np.cos(w * t)), 0.01 * w * np.sin(w * t), 0.01 * w * w * np.cos(w * t)


def derivatives(one: Instance, orders: dict[int, float]) -> int:
    """Set derivatives of the first input (FMI 2.0)."""
    count = len(orders)
    references, kinds = (ctypes.c_uint32 * count)(*[0] * count), (ctypes.c_int * count)(*orders)
    values = (ctypes.c_double * count)(*orders.values())
    return one.call("SetRealInputDerivatives", references, ctypes.c_size_t(count), kinds, values)


@pytest.mark.parametrize("given", ["variables", "derivatives", "positions alone"])
def test_a_drive_follows_positions_with_their_derivatives(given: str, tmp_path: Path, opened: Any) -> None:
    """At steps of 10 ms it is where the input says, within h^3 / 6 of the third derivative, and accelerates within h of
    it; positions alone are a step late."""
    one, step, worst, wrong = (
        opened(written(lift(), tmp_path, inputs=["lift"], outputs=["S", "S.effort"])),
        0.01,
        0.0,
        0.0,
    )
    assert [*one.references][:3] == ["lift", "lift.rate", "lift.acceleration"]
    one.begin()
    for k in range(40):
        position, rate, growth = stroke(k * step)
        assert one.set(0, position) == 0
        if given == "variables":
            assert one.set(1, rate) == 0 and one.set(2, growth) == 0
        elif given == "derivatives":
            assert derivatives(one, {1: rate, 2: growth}) == 0
        assert one.step(k * step, step) == 0, one.messages
        position, rate, growth = stroke((k + 1) * step)
        worst = max(worst, abs(one.get(3)[0] - position))
        if k > 1:
            wrong = max(wrong, abs(one.get(5)[0] - 9.81 - growth))
    third = 0.01 * (10 * np.pi) ** 3 * step**3 / 6
    if given == "positions alone":
        assert 0.9 * step * 0.01 * 10 * np.pi < worst < 1.1 * step * 0.01 * 10 * np.pi
    else:
        assert worst < 1.01 * third and wrong < 6.06 * third / step**2


def test_derivatives_of_inputs_are_checked(tmp_path: Path, opened: Any) -> None:
    m = lift()
    m.add_torque("S", value=0.0, name="push")
    one = opened(written(m, tmp_path, inputs=["lift"], outputs=["S"]))
    one.begin()
    for orders, words in (({3: 1.0}, "up to order 2, not 3"), ({0: 1.0}, "up to order 2, not 0"),
                          ({-1: 1.0}, "negative"), ({1: np.nan}, "derivative 1 of value 0 is NaN")):  # fmt: skip
        assert derivatives(one, orders) == 3 and words in one.messages[-1], one.messages
    push = opened(written(four_bar(), tmp_path, inputs=["motor"], outputs=["A", "A.effort"]))
    push.begin()
    assert derivatives(push, {1: 3.0}) == 0 and push.step(0.0) == 0
    assert derivatives(push, {2: 3.0}) == 3 and "up to order 1" in push.messages[-1]


def test_an_effort_with_a_derivative_varies_over_the_step(tmp_path: Path, opened: Any) -> None:
    """Half a ramp more: velocity = integral of 2 + 3 t over 1 kg."""
    one = opened(written(lift(driven=False), tmp_path, inputs=["S"], outputs=["S"]))
    one.begin()
    assert one.set(0, 9.81 + 2.0) == 0 and derivatives(one, {1: 3.0}) == 0 and one.step(0.0, 0.5) == 0
    assert one.get(2)[0] == pytest.approx(2 * 0.5 + 3 * 0.5**2 / 2, rel=1e-9)


def test_a_state_is_come_back_to(version: str, tmp_path: Path, opened: Any) -> None:
    one = opened(written(four_bar(), tmp_path, inputs=["motor"], outputs=["A"], version=version))
    one.begin()
    assert one.set(0, 0.5) == 0 and one.step(0.0) == 0
    kept = ctypes.c_void_p()
    assert one.call("GetFMUState", ctypes.byref(kept)) == 0
    assert one.step(STEP) == 0
    there = one.get(1, 2)
    assert one.call("SetFMUState", kept) == 0
    assert one.step(STEP) == 0 and one.get(1, 2) == there
    assert one.call("FreeFMUState", ctypes.byref(kept)) == 0 and not kept.value
    assert one.call("Reset") == 0
    one.begin()
    assert one.get(0) == [0.0]


def test_a_tolerance_lasts_until_reset(version: str, tmp_path: Path, opened: Any) -> None:
    path = written(swinging(), tmp_path, outputs=["A"], version=version)
    one, other, wanted = opened(path), opened(path), []
    for instance in (one, other):
        instance.begin()
        assert instance.step(0.0, 0.5) == 0
        wanted.append(instance.get(0, 1))
    assert wanted[0] == wanted[1] and one.call("Reset") == 0
    one.enter(tolerance=1e-3)
    assert one.call("ExitInitializationMode") == one.step(0.0, 0.5) == 0 and one.get(0, 1) != wanted[0]
    assert one.call("Reset") == 0
    one.begin()
    assert one.step(0.0, 0.5) == 0 and one.get(0, 1) == wanted[0]


def swinging() -> pt.Mechanism:
    """A four-bar with a spring, at rest; it swings by its weight."""
    m = pt.catalogue.load("four-bar")
    m.add_torsion_spring("D", stiffness=0.4, damping=0.1, angle=0.2, name="spring")
    return m


PARAMETERS = ["gravity", "crank.mass", "D.point", "spring.stiffness"]
CHANGES = {"gravity": (0.5, -3.0, 0.0), "crank.mass": 2.5, "D.point": None, "spring.stiffness": 3.0}


def changes_of(m: pt.Mechanism) -> dict[str, Any]:
    """Other values: gravity, a mass, a length and a stiffness."""
    point = np.add(m.compile().parameters["D.point"], (0.05, -0.02, 0.0))
    return {**CHANGES, "D.point": point.tolist()}


def test_two_instances_with_other_parameters_are_native_runs(version: str, tmp_path: Path, opened: Any) -> None:
    """Each instance its own; a saved state has the parameters, and Reset returns to those of the file."""
    m = swinging()
    path = written(m, tmp_path, outputs=["A", "D.force", "energy"], parameters=PARAMETERS, version=version)
    changes = changes_of(m)
    runs = [m.simulate(0.1, t_eval=np.linspace(0, 0.1, 6), rtol=1e-11, atol=1e-13, parameters=given)
            for given in ({}, changes)]  # fmt: skip
    assert np.abs(runs[0].joint("A").position - runs[1].joint("A").position).max() > 1e-4
    both = [opened(path), opened(path)]
    for name, value in changes.items():
        for part, number in zip((["", ".x", ".y", ".z"])[np.ndim(value) :], np.ravel(value), strict=False):
            assert both[1].set(both[1].references[name + part], float(number)) == 0
    for one in both:
        one.begin()
    names = list(both[0].references)[:7]
    numbers = [both[0].references[name] for name in names]

    def wanted(run: Any, k: int) -> list[float]:
        joint = run.joint("A")
        return [joint.position[k, 0], joint.velocity[k, 0], *run.joint("D").force[k], run.energy.kinetic[k],
                run.energy.potential[k]]  # fmt: skip

    for k in range(5):
        for one, run in zip(both, runs, strict=True):
            found = np.array(one.get(*numbers))
            assert np.abs(found - wanted(run, k)).max() < 1e-8 * max(1.0, np.abs(found).max()), (k, names)
            assert one.step(k * STEP) == 0, one.messages
    mass = both[1].references["crank.mass"]
    assert both[1].get(mass) == [2.5] and both[0].get(mass) != [2.5]
    assert both[1].set(mass, 1.0) == 3 and "not allowed" in both[1].messages[-1]
    kept = ctypes.c_void_p()
    assert both[1].call("GetFMUState", ctypes.byref(kept)) == 0
    there = both[1].get(*numbers)
    assert both[1].call("Reset") == 0 and both[1].get(mass) == both[0].get(mass)
    both[1].begin()
    assert np.abs(np.array(both[1].get(*numbers)) - wanted(runs[0], 0)).max() < 1e-8
    assert both[1].call("SetFMUState", kept) == 0 and both[1].get(*numbers, mass) == [*there, 2.5]
    assert both[1].call("FreeFMUState", ctypes.byref(kept)) == 0


def test_fmpy_sets_parameters(version: str, tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy", reason="fmpy is no pinned tool; the others run FMUs by ctypes")
    from fmpy.validation import validate_fmu

    m = swinging()
    path = written(m, tmp_path, outputs=["A"], parameters=PARAMETERS, version=version)
    assert validate_fmu(str(path)) == []
    changes = changes_of(m)
    starts: dict[str, Any] = {}
    for name, value in changes.items():
        starts |= in_version(version, name, value) if np.ndim(value) else {name: value}
    for given, start in (({}, {}), (changes, starts)):
        found = fmpy.simulate_fmu(str(path), stop_time=1.0, step_size=STEP, output_interval=STEP, start_values=start,
                                  output=["A.position"])  # fmt: skip
        run = m.simulate(1.0, t_eval=TIMES, rtol=1e-11, atol=1e-13, parameters=given)
        assert np.abs(found["A.position"] - run.joint("A").position[:, 0]).max() < 1e-8


def test_both_versions_give_the_same_bits(tmp_path: Path, opened: Any) -> None:
    """Parameters, inputs that change, and a state that goes from the one to the other."""
    m = swinging()
    m.add_torque("A", value=0.0, name="motor")
    both = []
    for version in VERSIONS:
        (folder := tmp_path / version).mkdir()
        path = written(m, folder, inputs=["motor"], outputs=["A", "D.force", "energy"], parameters=PARAMETERS,
                       version=version)  # fmt: skip
        both.append(opened(path))
    two, three = both
    names = list(two.references)
    assert [x for x in three.references if x != "time"] == names and two.version < three.version == "3.0"
    assert set(three.arrays.values()) == {3} and not two.arrays
    point = changes_of(m)["D.point"]
    for one in both:
        for axis, value in zip("xyz", point, strict=True):
            assert one.set(one.references[f"D.point.{axis}"], value) == 0
        one.begin(2.0)
    time = three.references["time"]
    for k in range(4):
        t = 2.0 + k * STEP
        assert three.get(time) == [t]
        for one in both:
            assert one.set(0, np.cos(k)) == 0 and one.step(t) == 0, one.messages
        numbers = [two.references[name] for name in names]
        assert two.get(*numbers) == three.get(*(three.references[name] for name in names))


def test_arrays_are_read_and_written_whole(tmp_path: Path, opened: Any) -> None:
    """By their sizes; numbers of one quantity that have two units stay alone."""
    m = pt.Mechanism("box")
    m.add_body("box", mass=2.0, inertia=[0.1, 0.2, 0.3])
    m.add_free("F", "ground", "box", point=(0.0, 0.0, 0.0))
    one = opened(written(m, tmp_path, outputs=["F", "energy"], parameters=["gravity", "box.mass"], version="3.0"))
    gravity, energy = one.references["gravity.x"], one.references["energy.kinetic"]
    assert one.arrays == {gravity: 3} and {f"F.position.{i}" for i in range(7)} <= set(one.references)
    assert one.write([gravity], [0.0, 0.0]) == 3 and "have 3 values, not 2" in one.messages[-1]
    assert one.write([gravity + 1], [0.0]) == 3 and "is in the array" in one.messages[-1]
    assert one.write([gravity, one.references["box.mass"]], [0.0, 0.0, -2.0, 3.0]) == 0
    one.begin()
    assert one.step(0.0, 0.5) == 0
    # falling from rest: m g^2 t^2 / 2
    assert abs(one.get(energy)[0] - 0.5 * 3.0 * (2.0 * 0.5) ** 2) < 1e-8
    values = (ctypes.c_double * 4)()
    assert one.read([gravity, energy], values, 4) == 0 and list(values)[:3] == [0.0, 0.0, -2.0]
    assert one.read([gravity], values, 4) == one.read([gravity], values, 1) == 3
    assert one.write([one.references["time"]], [1.0]) == 3


def test_a_saved_state_is_taken_to_another_instance(version: str, tmp_path: Path, opened: Any) -> None:
    """As bytes: the same steps follow, to the last bit; other bytes are refused."""
    m = swinging()
    m.add_torque("A", value=0.0, name="motor")
    path = written(m, tmp_path, inputs=["motor"], outputs=["A", "D.force"], parameters=["crank.mass"], version=version)
    one, other = opened(path), opened(path)
    mass = one.references["crank.mass"]
    assert one.set(mass, 1.5) == 0
    one.begin()
    assert one.set(0, 0.4) == 0 and one.step(0.0) == 0
    kept, size = ctypes.c_void_p(), ctypes.c_size_t()
    assert one.call("GetFMUState", ctypes.byref(kept)) == 0
    assert one.call("SerializedFMUStateSize", kept, ctypes.byref(size)) == 0
    content = ctypes.create_string_buffer(size.value)
    assert one.call("SerializeFMUState", kept, content, ctypes.c_size_t(size.value - 1)) == 3
    assert one.call("SerializeFMUState", kept, content, size) == 0
    read = ctypes.c_void_p()
    for spoilt in (b"", content.raw[:-1], content.raw + b"x", content.raw.replace(b"{", b"[", 1)):
        assert other.call("DeserializeFMUState", spoilt, ctypes.c_size_t(len(spoilt)), ctypes.byref(read)) == 3
        assert not read.value
    assert "not a state of this model" in other.messages[-1]
    assert other.call("DeserializeFMUState", content, size, ctypes.byref(read)) == 0
    assert other.call("SetFMUState", read) == 0
    shown = (0, 1, 2, 3, 4, 5, mass)
    assert other.get(*shown) == one.get(*shown)
    for k in (1, 2):
        assert one.step(k * STEP) == other.step(k * STEP) == 0 and other.get(*shown) == one.get(*shown)
    for instance, state in ((one, kept), (other, read)):
        assert instance.call("FreeFMUState", ctypes.byref(state)) == 0


def test_parameters_that_cannot_be_are_refused(version: str, tmp_path: Path, opened: Any) -> None:
    """When the initialisation ends, in the words of the native refusal; with better numbers it ends."""
    one = opened(written(swinging(), tmp_path, parameters=PARAMETERS, version=version))
    mass = one.references["crank.mass"]
    with pytest.raises(pt.errors.DescriptionError) as native:
        swinging().compile().with_parameters({"crank.mass": -1.0})
    assert one.set(mass, -1.0) == 0
    one.enter()
    assert one.call("ExitInitializationMode") == 3 and str(native.value) in one.messages[-1], one.messages
    assert one.set(mass, float("nan")) == 3 and one.set(99, 1.0) == 3
    assert one.set(mass, 1.0) == 0 and one.call("ExitInitializationMode") == 0 and one.step(0.0) == 0


def test_what_goes_wrong_is_said(version: str, tmp_path: Path, opened: Any) -> None:
    path = written(four_bar(), tmp_path, inputs=["motor"], outputs=["A"], version=version)
    assert not opened(path, guid="{other}").at
    one = opened(path)
    assert one.step(0.0) == 3 and "not allowed" in one.messages[-1]
    one.begin()
    reached = one.get(1, 2)
    for t, step, words in (
        (1.0, STEP, "the model is at t = 0"),
        (0.0, -1.0, "a step of -1"),
        (0.0, float("nan"), "NaN"),
    ):
        assert one.step(t, step) == 2 and words in one.messages[-1], one.messages
    assert one.set(0, float("inf")) == 3 and one.set(1, 1.0) == 3 and "not an input" in one.messages[-1]
    assert one.read([99], (ctypes.c_double * 1)(), 1) == one.read(None, None, 1) == 3
    number = "GetInteger" if version == "2.0" else "GetInt32"
    assert one.call(number, None, ctypes.c_size_t(0), None, ctypes.c_size_t(0)) == 0
    assert one.call(number, (ctypes.c_uint * 1)(0), ctypes.c_size_t(1), None, ctypes.c_size_t(1)) == 3
    assert "64 bits" in one.messages[-1]
    assert one.set(0, 1e300) == 0 and one.step(0.0) != 0
    assert one.get(1, 2) == reached  # it stays where it was
    assert one.set(0, 0.0) == 0 and one.step(0.0) == 0
    at, one.at = one.at, None
    assert one.step(STEP) == 3
    one.at = at


def test_a_percent_sign_is_no_format(version: str, tmp_path: Path, opened: Any) -> None:
    """A percent sign in a name arrives as it is by FMI 3.0, and doubled, for it is read as a format, by FMI 2.0."""
    m = four_bar()
    one = opened(written(m, tmp_path, version=version), guid="100%s")
    assert not one.at and ("100%s" if version == "3.0" else "100%%s") in one.messages[-1]


FUNCTIONS_3 = """
GetVersion SetDebugLogging InstantiateModelExchange InstantiateCoSimulation InstantiateScheduledExecution FreeInstance
EnterInitializationMode ExitInitializationMode EnterEventMode Terminate Reset
GetFloat32 GetFloat64 GetInt8 GetUInt8 GetInt16 GetUInt16 GetInt32 GetUInt32 GetInt64 GetUInt64 GetBoolean GetString
GetBinary GetClock
SetFloat32 SetFloat64 SetInt8 SetUInt8 SetInt16 SetUInt16 SetInt32 SetUInt32 SetInt64 SetUInt64 SetBoolean SetString
SetBinary SetClock
GetNumberOfVariableDependencies GetVariableDependencies
GetFMUState SetFMUState FreeFMUState SerializedFMUStateSize SerializeFMUState DeserializeFMUState
GetDirectionalDerivative GetAdjointDerivative EnterConfigurationMode ExitConfigurationMode
GetIntervalDecimal GetIntervalFraction GetShiftDecimal GetShiftFraction
SetIntervalDecimal SetIntervalFraction SetShiftDecimal SetShiftFraction
EvaluateDiscreteStates UpdateDiscreteStates EnterContinuousTimeMode CompletedIntegratorStep SetTime SetContinuousStates
GetContinuousStateDerivatives GetEventIndicators GetContinuousStates GetNominalsOfContinuousStates
GetNumberOfEventIndicators GetNumberOfContinuousStates
EnterStepMode GetOutputDerivatives DoStep ActivateModelPartition
"""
"""All functions of FMI 3.0, which an FMU of any kind must have."""


def test_all_functions_of_fmi_3_are_there(tmp_path: Path, opened: Any) -> None:
    """Without an instance each is an error; what this kind of FMU has not is an error that says so."""
    one = opened(written(four_bar(), tmp_path, inputs=["motor"], outputs=["A"], version="3.0"))
    one.begin()
    names = FUNCTIONS_3.split()
    start, nothing = one.get(0, 1, 2), [ctypes.c_void_p()] * 10
    one.library.fmi3GetVersion.restype = ctypes.c_char_p
    assert one.library.fmi3GetVersion() == b"3.0"
    for name in names:
        function = getattr(one.library, f"fmi3{name}")
        if name.startswith("Instantiate"):
            function.restype = ctypes.c_void_p
            assert function(*nothing, None, None) is None
        elif name not in ("GetVersion", "FreeInstance"):
            assert function(*nothing) == 3, name
    unsupported = [name for name in names if "Derivative" in name or name.endswith(("States", "Mode", "Decimal"))]
    unsupported += ["GetNumberOfVariableDependencies", "SetTime", "GetEventIndicators", "ActivateModelPartition"]
    for name in unsupported:
        if "InitializationMode" not in name:
            assert one.call(name, *nothing) == 3 and "does not support" in one.messages[-1], name
            assert name in one.messages[-1]
    assert one.get(0, 1, 2) == start and one.step(0.0) == 0


def test_other_kinds_and_event_modes_are_refused(tmp_path: Path, opened: Any) -> None:
    one = opened(written(four_bar(), tmp_path, version="3.0"))
    for name, words in (("ModelExchange", "co-simulation only"), ("ScheduledExecution", "co-simulation only"),
                        ("CoSimulation", "no event mode")):  # fmt: skip
        make = getattr(one.library, f"fmi3Instantiate{name}")
        make.restype = ctypes.c_void_p
        token, place = one.model["guid"].encode(), f"{tmp_path / 'unpacked 0 é' / 'resources'}/".encode()
        flags = [ctypes.c_bool(x) for x in ((False, True, True, False) if name == "CoSimulation" else (False, True))]
        more = (None, ctypes.c_size_t(0)) if name == "CoSimulation" else ()
        assert make(b"it", token, place, *flags, *more, None, one.logger, None, None, None) is None
        assert words in one.messages[-1]


@pytest.mark.parametrize("damage", ["", "{", '{"fmu": 1}', None])
def test_damaged_resources_are_refused(damage: str | None, tmp_path: Path, opened: Any) -> None:
    path = written(four_bar(), tmp_path, inputs=["motor"])
    with zipfile.ZipFile(path) as packed:
        members = {name: packed.read(name) for name in packed.namelist()}
    with zipfile.ZipFile(path, "w") as packed:
        for name, content in members.items():
            if name.endswith(".json"):
                reported = json.loads(content)
                reported["start"]["q"] = []
                content = json.dumps(reported).encode() if damage is None else damage.encode()
            packed.writestr(name, content)
    if damage is None:
        one = opened(path)
        assert not one.at and "0 coordinates" in one.messages[-1]
    else:
        with pytest.raises((json.JSONDecodeError, KeyError)):
            opened(path)
        (tmp_path / "unpacked 0 é" / "x").write_text("x")


def test_the_same_mechanism_gives_the_same_bytes(tmp_path: Path) -> None:
    one = written(four_bar(), tmp_path, inputs=["motor"]).read_bytes()
    assert written(four_bar(), tmp_path, inputs=["motor"]).read_bytes() == one


TAGS = ["CoSimulation", "UnitDefinitions", "LogCategories", "DefaultExperiment", "ModelVariables", "ModelStructure"]
MEMBERS = ["modelDescription.xml", "resources", "binaries", "documentation"]


def test_the_description_is_one(tmp_path: Path) -> None:
    """What the standard requires of it, without its schema: order, references, indices, names in any letters."""
    m = four_bar()
    m.add_torque("B", value=0.25, name='a "b" & <c> é')
    path = written(m, tmp_path, inputs=["motor", 'a "b" & <c> é', "D"])
    with zipfile.ZipFile(path) as packed:
        root = ElementTree.fromstring(packed.read("modelDescription.xml"))
        names = packed.namelist()
        assert list(dict.fromkeys(n.partition("/")[0] for n in names)) == MEMBERS
        assert {f"documentation/licenses/{x}.txt" for x in ("license", "LICENSE-MIT", "LICENSE-APACHE")} < set(names)
        page = packed.read("documentation/index.html").decode()
        assert all(escape(x) in page for x in ('a "b" & <c> é', "A.position", "effort motor"))
    assert [child.tag for child in root] == TAGS
    variables = list(root.iterfind("ModelVariables/ScalarVariable"))
    assert [int(x.get("valueReference", -1)) for x in variables] == list(range(len(variables)))
    assert len({x.get("name") for x in variables}) == len(variables) == 3 + 8 + 2
    starts = [x.find("Real").get("start") for x in variables if x.get("causality") == "input"]  # type: ignore[union-attr]
    assert starts == ["0.0", "0.25", "0.0"] and variables[1].get("name") == 'a "b" & <c> é'
    units = {x.get("name") for x in root.iterfind("UnitDefinitions/Unit")}
    assert {x.find("Real").get("unit") for x in variables} <= units  # type: ignore[union-attr]
    for part in ("Outputs", "InitialUnknowns"):
        indices = [int(x.get("index", 0)) for x in root.iterfind(f"ModelStructure/{part}/Unknown")]
        assert indices == [i for i, x in enumerate(variables, 1) if x.get("causality") == "output"]


def test_two_variables_of_one_name_are_refused(version: str, tmp_path: Path) -> None:
    m = four_bar()
    m.add_torque("B", value=0.25, name="A.position")
    with pytest.raises(pt.errors.ArgumentError, match=r'two variables have the name "A\.position"'):
        written(m, tmp_path, inputs=["A.position"], outputs=["A"], version=version)
    written(m, tmp_path, inputs=["A.position"], outputs=["D"], version=version)


def test_the_description_of_fmi_3_is_one(tmp_path: Path) -> None:
    """Typed variables, arrays with their dimensions, the time, and the structure by references."""
    m = four_bar()
    m.add_torque("B", value=0.25, name="time")
    parameters = ["gravity", "crank.mass"]
    path = written(
        m, tmp_path, inputs=["motor", "time"], outputs=["A", "D.force"], parameters=parameters, version="3.0"
    )
    with zipfile.ZipFile(path) as packed:
        root = ElementTree.fromstring(packed.read("modelDescription.xml"))
        assert list(dict.fromkeys(n.partition("/")[0] for n in packed.namelist())) == MEMBERS
        system = {"linux": "linux", "darwin": "darwin"}.get(sys.platform, "windows")
        assert {n.split("/")[1] for n in packed.namelist() if n.startswith("binaries")} < {
            f"{processor}-{system}" for processor in ("x86_64", "aarch64")
        }
        assert root.get("instantiationToken") == json.loads(packed.read("resources/model.json"))["guid"]
    assert [child.tag for child in root] == TAGS and root.get("fmiVersion") == "3.0"
    variables = {str(x.get("name")): x for x in root.iterfind("ModelVariables/Float64")}
    sizes = {name: [y.get("start") for y in x.iterfind("Dimension")] for name, x in variables.items()}
    alone: dict[str, list[str]] = {name: [] for name in ("motor", "time", "A.position", "A.velocity")}
    assert sizes == {**alone, "D.force": ["3"], "gravity": ["3"], "crank.mass": [], "time 2": []}
    assert [int(x.get("valueReference", -1)) for x in variables.values()] == [0, 1, 2, 3, 4, 7, 10, 11]
    assert variables["gravity"].get("start") == "0.0 -9.81 0.0" and variables["gravity"].get("unit") == "m/s^2"
    assert [name for name, x in variables.items() if x.get("causality") == "independent"] == ["time 2"]
    outputs = [x.get("valueReference") for x in variables.values() if x.get("causality") == "output"]
    for part in ("Output", "InitialUnknown"):
        assert [x.get("valueReference") for x in root.iterfind(f"ModelStructure/{part}")] == outputs
    units = {x.get("name") for x in root.iterfind("UnitDefinitions/Unit")}
    assert {x.get("unit") for x in variables.values()} <= units


BAD = [
    ({"inputs": ["nothing"]}, "is not a torque, drive or joint"),
    ({"inputs": "motor"}, "list of names"),
    ({"inputs": ["motor", "motor"]}, "twice"),
    ({"inputs": [1.0]}, "list of names"),
    ({"outputs": ["A.colour"]}, "is not known"),
    ({"outputs": ["A", "A.position"]}, "twice"),
    ({"parameters": ["crank.mas"]}, "near it: crank.mass"),
    ({"parameters": ["gravity", "gravity"]}, "appears twice"),
    ({"parameters": "gravity"}, "list of names"),
    ({"inputs": ["motor"], "parameters": ["motor.value"]}, "is not one"),
    ({"duration": -1.0}, "duration"),
    ({"communication_step": 0.0}, "communication_step"),
    ({"initial": 1.0}, "State"),
    ({"version": "2"}, "'2' is not known; choose one of '2.0', '3.0'"),
    ({"version": 3.0}, "3.0 is not known"),
]


@pytest.mark.parametrize(("options", "words"), BAD)
def test_bad_arguments(options: dict[str, Any], words: str, tmp_path: Path) -> None:
    with pytest.raises(pt.errors.ArgumentError, match=words):
        four_bar().to_fmu(tmp_path / "x.fmu", **options)
    with pytest.raises(pt.errors.ArgumentError, match=r"\.fmu"):
        four_bar().to_fmu(tmp_path / "x.zip")
    with pytest.raises(pt.errors.DescriptionError, match="Python functions"):
        four_bar(lambda t, state: t).to_fmu(tmp_path / "x.fmu")
    assert not list(tmp_path.iterdir())
