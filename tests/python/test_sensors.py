"""Sensors: closed forms, differences, balances of power, both kinds of coordinates, force laws, files."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builder_parts import pendulum
from catalogue_runs import entry_of
from force_mechanisms import everything

import partita as pt
from partita.errors import ArgumentError, DescriptionError, EvaluationError, FileFormatError, UnknownNameError

G = 9.81


# --- closed forms -----------------------------------------------------------------------------------------------------


def test_the_sensors_of_a_pendulum_are_its_closed_forms() -> None:
    """A uniform rod of length 1 hung by its end: theta'' = -1.5 g cos(theta) of theta from the horizontal."""
    m = pendulum()
    tip = m.add_sensor("tip", ("rod", (1, 0, 0)), "acceleration")
    m.add_sensor("felt", ("rod", (1, 0, 0)), "acceleration", axes="rod")
    m.add_sensor("spin", "rod", "angular_velocity")
    m.add_sensor("growth", "rod", "angular_acceleration")
    m.add_sensor("turned", "rod", "rotation")
    m.add_sensor("angle", "A", "position")
    m.add_sensor("held", "A", "force", axes="joint")
    m.add_sensor("size", tip.norm())
    run = m.simulate(1.5, rtol=1e-12, atol=1e-13)
    read = lambda name: run.sensor(name).values  # noqa: E731
    theta, rate = run.q[:, 0], run.v[:, 0]
    growth = -1.5 * G * np.cos(theta)
    o = np.zeros_like(theta)
    along, across = np.array([np.cos(theta), np.sin(theta), o]).T, np.array([-np.sin(theta), np.cos(theta), o]).T
    exact = growth[:, None] * across - (rate**2)[:, None] * along
    assert np.abs(read("tip") - exact).max() < 1e-9
    assert np.abs(read("felt") - np.array([-(rate**2), growth, o]).T).max() < 1e-9
    assert np.abs(read("size") - np.hypot(rate**2, growth)).max() < 1e-9
    assert np.abs(read("spin")[:, 2] - rate).max() < 1e-14
    assert np.abs(read("growth")[:, 2] - growth).max() < 1e-9
    assert np.abs(read("turned")[:, :, 0] - along).max() < 1e-14
    assert np.array_equal(read("angle"), theta)
    # energy: rate^2 = -3 g sin(theta), from rest at the horizontal
    assert np.abs(rate**2 + 3 * G * np.sin(theta)).max() < 1e-9
    # Newton for the centre of mass, half-way
    held = run.joint("A").force
    assert np.abs(held - (0.5 * exact - [0.0, -G, 0.0])).max() < 1e-9
    axes = run.joint("A").in_frame("joint").force
    assert np.array_equal(read("held"), axes)


def test_the_sensors_of_a_suspension_are_those_of_a_damped_oscillator() -> None:
    mass, k, c, start = 300.0, 2.0e4, 1.5e3, 0.05
    m = pt.Mechanism("quarter car", gravity=(0, 0, 0))
    body = m.add_body("body", mass=mass, inertia=(1, 1, 1), position=(0, 1.0 + start, 0))
    m.add_prismatic("slide", m.ground, body, axis=(0, 1, 0))
    strut = m.add_spring("strut", m.ground, (0, 0, 0), body, (0, 0, 0), stiffness=k, damping=c, length=1.0)
    force, rate = m.add_sensor("force", strut, "force"), m.add_sensor("rate", strut, "rate")
    m.add_sensor("length", strut, "length")
    m.add_sensor("energy", strut, "energy")
    m.add_sensor("power", strut, "power")
    m.add_sensor("same power", -force * rate, unit="W")
    m.add_sensor("seat", (body, (0.3, 0.2, 0.1)), "acceleration")
    m.add_sensor("gap", pt.Distance(m.ground, (0, 0, 0), body, (0, 0, 0)), "acceleration")
    run = m.simulate(1.0, rtol=1e-13, atol=1e-14)
    delta = c / (2 * mass)
    omega = math.sqrt(k / mass - delta**2)
    t = run.t
    x = start * np.exp(-delta * t) * (np.cos(omega * t) + delta / omega * np.sin(omega * t))
    v = -start * np.exp(-delta * t) * (omega + delta**2 / omega) * np.sin(omega * t)
    a = -(k * x + c * v) / mass
    exact = {
        "length": 1.0 + x,
        "rate": v,
        "force": k * x + c * v,
        "energy": 0.5 * k * x**2,
        "power": -(k * x + c * v) * v,
        "same power": -(k * x + c * v) * v,
        "gap": a,
    }
    for name, values in exact.items():
        error = np.abs(run.sensor(name).values - values).max() / max(1.0, float(np.abs(values).max()))
        assert error < 1e-9, name
    assert np.abs(run.sensor("seat").values - np.outer(a, [0, 1, 0])).max() < 1e-9
    units = {name: run.sensor(name).unit for name in run.sensors}
    assert units == {
        "force": "N", "rate": "m/s", "length": "m", "energy": "J", "power": "W", "same power": "W", "seat": "m/s^2",
        "gap": "m/s^2",
    }  # fmt: skip


# --- identities -------------------------------------------------------------------------------------------------------


POINT = (0.3, -0.2, 0.1)
WORDS = ("position", "velocity", "acceleration")


def differences(values: Any, h: float) -> Any:
    """The first derivative in the middle of seven values, of order 6."""
    return (values[6] - values[0] - 9.0 * (values[5] - values[1]) + 45.0 * (values[4] - values[2])) / (60.0 * h)


@pytest.mark.parametrize("name", pt.catalogue.names())
def test_velocities_and_accelerations_are_derivatives_on_every_entry(name: str) -> None:
    """Differences of order 6 of what sensors read at seven outputs: their own error is h^6 times a seventh derivative,
    and what is left of the run's tolerance over h, both below 1e-6 of the largest rate here; 1e-5 where a
    cam's curve has a third derivative that jumps."""
    entry = entry_of(name, 3) if name == "n-four-bar" else entry_of(name)
    m = entry.build()
    sensed: list[str] = []
    for body in list(m.bodies)[:: max(1, len(m.bodies) // 2)]:
        for word in WORDS:
            m.add_sensor(f"{body} {word}", (body, POINT), word)
            m.add_sensor(f"gap of {body} {word}", pt.Distance("ground", (0.1, 5.0, 7.0), body, POINT), word)
        sensed += [body, f"gap of {body}"]
    for joint in m.to_spec()["joints"][-2:]:
        if joint["kind"] in ("revolute", "prismatic", "cylindrical", "universal", "planar"):
            for word in WORDS:
                m.add_sensor(f"joint {joint['name']} {word}", pt.Coordinate(joint["name"]), word)
            sensed.append(f"joint {joint['name']}")
    start = entry.start(m)
    h = min(2e-4 * entry.duration, 0.01 / float(np.abs(start.v).max(initial=1e-9)))
    middle = 12 * h
    times = middle + h * np.arange(-3, 4)
    options = {**entry.options, "rtol": 1e-12, "atol": 1e-13}
    run = m.simulate(
        20 * h, initial=start, t_eval=start.t + times, **{k: v for k, v in options.items() if k != "coordinates"}
    )
    assert run.success, run.message
    for one in sensed:
        x, v, a = (run.sensor(f"{one} {word}").values for word in WORDS)
        for value, rate in ((x, v), (v, a)):
            scale = np.abs(rate).max() + np.abs(value).max() / entry.duration
            assert (
                np.abs(differences(value, h) - rate[3]).max()
                <= (1e-5 if m.couplings and name.startswith("cam") else 1e-6) * scale
            ), one


def balance(run: Any, names: tuple[list[str], list[str], list[str]]) -> Any:
    """Rate of the kinetic energy less the power of gravity and of all loads, over the largest of them."""
    bodies, loads, drives = names
    spec = {body["name"]: body for body in run.spec["bodies"]}
    parts = []
    for name in bodies:
        body = spec[name]
        read = lambda word, name=name: run.sensor(f"{name} {word}").values  # noqa: E731
        spin, growth, turned = read("angular_velocity"), read("angular_acceleration"), read("rotation")
        inertia = turned @ np.array(body["inertia"]) @ np.swapaxes(turned, 1, 2)
        moment = np.einsum("tij,tj->ti", inertia, growth)  # the gyroscopic part does no work
        parts.append(body["mass"] * np.sum(read("acceleration") * read("velocity"), axis=1))
        parts.append(np.sum(moment * spin, axis=1))
        parts.append(-body["mass"] * read("velocity") @ np.array(run.spec["gravity"]))
    parts += [-run.sensor(f"{name} power").values for name in (*loads, *drives)]
    return np.abs(sum(parts)).max() / np.abs(parts).max(), np.abs(parts).max(axis=1)


def with_power(m: pt.Mechanism) -> tuple[list[str], list[str], list[str]]:
    """Sensors of all that a balance of power needs."""
    for body in m.to_spec()["bodies"]:
        for word in ("velocity", "acceleration"):
            m.add_sensor(f"{body['name']} {word}", (body["name"], body["com"]), word)
        for word in ("rotation", "angular_velocity", "angular_acceleration"):
            m.add_sensor(f"{body['name']} {word}", {"body": body["name"]}, word)
    for kind, names in (("force", m.forces), ("drive", m.drives)):
        for name in names:
            m.add_sensor(f"{name} power", {kind: name}, "power")
    return list(m.bodies), list(m.forces), list(m.drives)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_the_power_of_all_forces_is_the_growth_of_the_kinetic_energy(coordinates: str) -> None:
    """Bushing, friction, stops, contact, tyre, a law, springs, torques: in space, exact at every output."""
    m = everything()
    m.add_spring("spring", m.ground, (0.2, 1.0, 0.3), "b", (0.2, 0.1, 0), stiffness=30.0, damping=2.0, length=0.5)
    m.add_torsion_spring("A", stiffness=3.0, damping=0.1, coordinate=1, name="torsion")
    m.add_torque("B", lambda t, state: -0.3 * state.velocity("B")[0], coordinate=0, name="function")
    m.add_torque("B", ([0.0, 2.0], [0.5, 0.2]), coordinate=1, name="table")
    m.add_force("b", (([0.0, 2.0], [0.0, 3.0]), 0.0, 1.0), (0.1, 0.2, 0.3), axes="body", name="push")
    names = with_power(m)
    start = m.assemble(rates={"A": (0.4, 1.0), "B": (0.5, -0.7)})
    run = m.simulate(1.2, initial=start, coordinates=coordinates, t_eval=np.linspace(0.0, 1.2, 13), rtol=1e-8)
    error, sizes = balance(run, names)
    assert error < 1e-12
    assert (sizes[6:] > 0.0).all(), "every load does something"


def test_the_power_of_a_drive_is_in_the_balance_of_a_closed_loop() -> None:
    m = pt.catalogue.load("four-bar")
    m.add_drive(
        pt.Distance("ground", (3.0, 1.0, 0.0), list(m.bodies)[1], (0.1, 0, 0)),
        velocity=([0.0, 1.0], [0.1, 0.3]),
        name="rope",
    )
    m.add_spring("S", m.ground, (0, 0.5, 0), list(m.bodies)[1], (0.1, 0, 0), stiffness=50.0)
    names = with_power(m)
    run = m.simulate(0.3, t_eval=[0.0, 0.1, 0.3])
    error, sizes = balance(run, names)
    assert error < 1e-12
    assert sizes[-1] > 0.0


SPATIAL = "spatial-four-bar"


@pytest.mark.parametrize("name", ["four-bar-spring", SPATIAL, "double-wishbone"])
def test_sensors_do_not_know_in_which_coordinates_a_run_was_computed(name: str) -> None:
    """All that can be read, of tree joints and of those that close loops, within what the two runs differ by."""
    entry = entry_of(name)
    m = entry.build()
    for joint in m.to_spec()["joints"]:
        words = ["force", "moment"]
        if joint["kind"] in ("revolute", "prismatic"):
            words += [*WORDS, "drive"]
            m.add_torsion_spring(joint["name"], stiffness=0.7, damping=0.1, name=f"at {joint['name']}")
            m.add_sensor(f"effort at {joint['name']}", {"force": f"at {joint['name']}"}, "effort")
        for word in words:
            m.add_sensor(f"{word} of {joint['name']}", {"joint": joint["name"]}, word)
    for body in m.bodies:
        for word in (*WORDS, "rotation", "angular_velocity", "angular_acceleration"):
            m.add_sensor(
                f"{body} {word}", {"body": body}, word, axes=None if word == "rotation" else next(iter(m.bodies))
            )
    for force in m.to_spec()["forces"]:
        if force["kind"] == "spring":
            for word in ("length", "rate", "force", "power", "energy"):
                m.add_sensor(f"{force['name']} {word}", {"force": force["name"]}, word)
    start = entry.start(m)
    times = start.t + 0.01 * entry.duration * np.arange(3)
    one, other = (
        m.simulate(0.02 * entry.duration, initial=start, coordinates=c, t_eval=times, rtol=1e-12, atol=1e-13)
        for c in ("relative", "absolute")
    )
    for sensor in one.sensors:
        x, y = one.sensor(sensor).values, other.sensor(sensor).values
        assert one.sensor(sensor).unit == other.sensor(sensor).unit
        assert np.abs(x - y).max() <= 1e-7 * max(1.0, float(np.abs(x).max())), sensor


# --- expressions and functions ----------------------------------------------------------------------------------------


def test_expressions_and_functions_say_the_same() -> None:
    m = pendulum()
    a = m.add_sensor("a", ("rod", (1, 0, 0)), "acceleration")
    v = m.add_sensor("v", ("rod", (1, 0, 0)), "velocity")
    w = m.add_sensor("w", "A", "velocity")
    pairs = {
        "sum": (a + 2.0 * a - a / 4.0, lambda t, a, v, w: 2.75 * a),
        "product": (w * v, lambda t, a, v, w: w * v),
        "dot": (a.dot(v), lambda t, a, v, w: float(a @ v)),
        "norm": ((-a).norm(), lambda t, a, v, w: np.linalg.norm(a)),
        "component": (a[1] - 1.0, lambda t, a, v, w: a[1] - 1.0),
        "quotient": (1.0 / (w * w + 1.0), lambda t, a, v, w: 1.0 / (w * w + 1.0)),
        "size": (w.norm(), lambda t, a, v, w: abs(w)),
    }
    for name, (expression, function) in pairs.items():
        m.add_sensor(name, expression)
        m.add_sensor(f"{name} by function", [a, v, "w"], function=function, unit="x")
    run = m.simulate(1.0)
    for name in pairs:
        x, y = run.sensor(name).values, run.sensor(f"{name} by function").values
        assert x.shape == y.shape
        assert np.abs(x - y).max() < 1e-12 * max(1.0, float(np.abs(x).max())), name
    assert run.sensor("sum").unit == "m/s^2"
    assert run.sensor("dot").unit == "m/s^2 m/s"


# --- force laws -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("name", ["four-bar", SPATIAL])
def test_a_law_that_reads_sensors_moves_as_one_that_sees(name: str, coordinates: str) -> None:
    """Air drag on a point in the axes of its body, by sensors and by what a law is handed."""

    def drawn(by_sensors: bool, force: Any) -> tuple[pt.Mechanism, str]:
        m = entry_of(name).build()
        body = list(m.bodies)[1]
        if by_sensors:
            slow = m.add_sensor("speed", (body, POINT), "velocity", axes=body)
            m.add_sensor("twice", 2.0 * slow)
            m.add_sensor("far", pt.Distance("ground", (0, 0, 5.0), body, POINT), "velocity")
            m.add_sensor("felt", (body, POINT), "acceleration")
        force(m, body)
        return m, body

    def read(m: pt.Mechanism, body: str) -> None:
        m.add_force(
            body,
            lambda t, s: -0.25 * s.sensor("twice") + [0, 0.1 * s.sensor("far"), 0],
            axes="body",
            point=POINT,
            name="drag",
        )

    def seen(m: pt.Mechanism, body: str) -> None:
        def drag(t: float, p: Any, b: Any) -> Any:
            own = b.rotation.T @ p.velocity
            gap = p.position - np.array([0, 0, 5.0])
            return b.rotation @ (-0.5 * own + [0, 0.1 * (gap @ p.velocity) / np.linalg.norm(gap), 0])

        m.add_force_law("drag", drag, on=[(body, POINT)], sees=[(body, POINT), body])

    runs = []
    for by_sensors, force in ((True, read), (False, seen)):
        m, _ = drawn(by_sensors, force)
        entry = entry_of(name)
        start = entry.start(m)
        runs.append(
            m.simulate(
                0.02 * entry.duration,
                initial=start,
                coordinates=coordinates,
                t_eval=[0.02 * entry.duration],
                rtol=1e-10,
            )
        )
    one, other = runs
    assert one.success
    assert np.abs(one.q - other.q).max() < 1e-10
    assert np.abs(one.sensor("felt").values).max() > 0.0


def test_a_law_reads_what_parameters_make_of_a_mechanism() -> None:
    """A hinge that was moved: the law sees the body where it is."""
    seen: list[float] = []
    m = pendulum()
    m.add_sensor("height", ("rod", (1, 0, 0)), "position")
    m.add_force("rod", lambda t, s: (seen.append(s.sensor("height")[1]), (0, 0, 0))[1])
    run = m.simulate(0.5, t_eval=[0.5], parameters={"A.point": (0.25, 0, 0)}, rtol=1e-10)
    assert seen[-1] == pytest.approx(run.sensor("height").values[-1, 1], abs=1e-9)
    assert run.body("rod").point((0.25, 0, 0))[-1] == pytest.approx([0.25, 0, 0], abs=1e-12)


@pytest.mark.parametrize(
    ("add", "words"),
    [
        (lambda m: m.add_sensor("x", ("rod", (1, 0, 0)), "acceleration"), "acceleration"),
        (lambda m: m.add_sensor("x", "A", "force"), "reads a force"),
        (
            lambda m: m.add_sensor(
                "x", m.add_spring("S", m.ground, (0, 1, 0), "rod", (1, 0, 0), stiffness=1.0), "force"
            ),
            "reads a force",
        ),
        (lambda m: m.add_sensor("x", 2.0 * m.add_sensor("y", "A", "acceleration")), "acceleration"),
        (lambda m: m.add_sensor("other", "A", "position"), "no sensor named .x."),
        (
            lambda m: m.add_sensor(
                "x",
                m.add_joint("J", "rod", m.add_body("ball", mass=1, inertia=(1, 1, 1)), free=("rx", "ry", "rz")),
                "velocity",
            ),
            "slide or an angle",
        ),
    ],
)
def test_a_law_that_reads_its_own_effect_is_refused_with_the_reason(add: Any, words: str) -> None:
    m = pendulum()
    add(m)
    m.add_torque("A", lambda t, state: state.sensor("x"))
    with pytest.raises((ArgumentError, UnknownNameError, EvaluationError), match=words):
        run = m.simulate(0.1)
        raise run.error
    with pytest.raises(ArgumentError, match=r"run\.sensor"):
        m.assemble().sensor("x")


# --- parameters, files, plots -----------------------------------------------------------------------------------------


def test_springs_are_read_with_the_parameters_of_the_run() -> None:
    m = pendulum()
    spring = m.add_spring("S", m.ground, (0, 1, 0), "rod", (1, 0, 0), stiffness=1.0, damping=0.3, length=0.5)
    for word in ("length", "rate", "force"):
        m.add_sensor(word, spring, word)
    changed = {"S.point2": (0.5, 0.2, 0), "S.stiffness": 7.0}
    run = m.simulate(0.3, parameters=changed)
    gap = run.body("rod").point((0.5, 0.2, 0)) - [0, 1, 0]
    length = np.linalg.norm(gap, axis=1)
    rate = np.sum(gap * run.body("rod").point_velocity((0.5, 0.2, 0)), axis=1) / length
    assert np.abs(run.sensor("length").values - length).max() < 1e-14
    assert np.abs(run.sensor("rate").values - rate).max() < 1e-13
    assert np.abs(run.sensor("force").values - 7.0 * (length - 0.5) - 0.3 * rate).max() < 1e-12


def full() -> pt.Mechanism:
    m = pendulum()
    tip = m.add_sensor("tip", ("rod", (1, 0, 0)), "acceleration", axes="rod")
    m.add_sensor("tip_name", tip.norm() * 2.0, unit="g", text="twice the size")
    m.add_sensor("tip name", "A", "position")
    m.add_sensor("turned", {"body": "rod"}, "rotation")
    m.add_sensor("gap", pt.Distance("ground", (0, 1, 0), "rod", (1, 0, 0)), "velocity")
    m.add_spring("S", m.ground, (0, 1, 0), "rod", (1, 0, 0), stiffness=1.0)
    m.add_sensor("pull", "S", "force")
    return m


def test_a_file_brings_all_sensors_back(tmp_path: Path) -> None:
    m = full()
    m.save(tmp_path / "x.toml")
    again = pt.load(tmp_path / "x.toml")
    assert again._description.sensors == m._description.sensors
    run, other = m.simulate(0.2), again.simulate(0.2)
    for name in m.sensors:
        assert np.array_equal(run.sensor(name).values, other.sensor(name).values)
    m.add_sensor("function", ["tip"], function=lambda t, x: x)
    with pytest.raises(DescriptionError, match='sensor "function": it is a Python function'):
        m.save(tmp_path / "y.toml")


def test_a_stored_result_and_a_pickled_one_know_what_sensors_read(tmp_path: Path) -> None:
    m = full()
    m.add_sensor("function", ["tip"], function=lambda t, x: x[:2])
    run = m.simulate(0.2)
    others = [pickle.loads(pickle.dumps(run))]
    for name in ("x.json", "x.csv", "x.nc", "x.zarr", "x.parquet", "x.mat"):
        run.save(tmp_path / name)
        others.append(pt.load_result(tmp_path / name))
    head = (tmp_path / "x.csv").read_text().splitlines()[0]
    assert "sensor.tip.x [m/s^2]" in head
    assert "sensor.tip_name [g]" in head
    assert run.sensor("turned").values.shape == (201, 3, 3)
    assert run.sensor("function").values.shape == (201, 2)
    for other in others:
        assert other.sensors == run.sensors
        assert other.units == run.units
        for name in run.sensors:
            one, stored = run.sensor(name), other.sensor(name)
            assert np.array_equal(one.values, stored.values)
            assert (one.unit, one.text) == (stored.unit, stored.text)
    assert [run.units[name] for name in ("sensor_tip", "sensor_tip_name_", "sensor_pull")] == ["m/s^2", "g", "N"]
    assert run.plot("tip", "pull", "turned").get_axes()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('name = "s"\nof = { body = "rod" }\nreads = "speed"', "line .*reads is 'speed'"),
        ('name = "s"\nof = { body = "rud" }\nreads = "position"', 'no body "rud"; did you mean "rod"'),
        ('name = "s"\nof = { body = "rod", joint = "A" }\nreads = "position"', "must have one key"),
        ('name = "s"\nof = { expression = ["sum", "nothing", 1.0] }', "no sensor 'nothing'"),
        ('name = "s"\nof = { expression = ["power", 1.0, 2.0] }', "begins with one of"),
        ('name = "s"\nof = { rod = "A" }', '"rod" is not a key'),
        ('name = "s"\nreads = "position"', 'has no "of"'),
    ],
)
def test_a_bad_sensor_in_a_file_is_reported_with_its_line(tmp_path: Path, text: str, words: str) -> None:
    pendulum().save(tmp_path / "x.toml")
    path = tmp_path / "bad.toml"
    path.write_text((tmp_path / "x.toml").read_text().split("# as saved")[0] + "[[sensor]]\n" + text + "\n")
    with pytest.raises(FileFormatError, match=words):
        pt.load(path)


@pytest.mark.parametrize(
    ("add", "words"),
    [
        (lambda m: m.add_sensor("tip", "A", "position"), "already a sensor of this name"),
        (lambda m: m.add_sensor("x", "A"), "quantity to read of the joint: position"),
        (lambda m: m.add_sensor("x", "A", "angle"), "must be one of"),
        (lambda m: m.add_sensor("x", "A", "position", coordinate=1), "integer, 0"),
        (lambda m: m.add_sensor("x", "A", "position", axes="joint"), "not a vector"),
        (lambda m: m.add_sensor("x", ("rod", (1, 0)), "position"), "3 numbers"),
        (lambda m: m.add_sensor("x", ("rod", (1, 0, math.nan)), "position"), "NaN"),
        (lambda m: m.add_sensor("x", ("rod", ("1 kg", 0, 0)), "position"), "the point is a length"),
        (lambda m: m.add_sensor("x", m.sensors["tip"] * "2 mm"), "no sensor '2 mm'"),
        (lambda m: m.add_sensor("x", m.add_sensor("y", "A", "velocity"), "position"), "expression is complete"),
        (lambda m: m.add_sensor("x", pendulum().add_sensor("y", "A", "velocity")), "belongs to the mechanism"),
        (lambda m: m.add_sensor("x", ["tip"], function=3), "must be a function"),
        (lambda m: m.add_sensor("x", 3.0), "cannot read"),
        (lambda m: m.add_sensor("x", {"expression": ["sum", "tip"]}), "has 2 operands, not 1"),
        (lambda m: m.add_sensor("x", {"expression": ["sum", "tip", math.inf]}), "finite"),
        (lambda m: m.add_sensor("x", "A", "position", unit=3), "unit must be"),
    ],
)
def test_a_sensor_that_cannot_be_is_refused(add: Any, words: str) -> None:
    m = pendulum()
    m.add_sensor("tip", ("rod", (1, 0, 0)), "position")
    with pytest.raises((DescriptionError, UnknownNameError), match=words):
        add(m)


def test_what_has_no_sense_is_reported_when_it_is_read() -> None:
    m = pendulum()
    tip = m.add_sensor("tip", ("rod", (1, 0, 0)), "position")
    m.add_sensor("fourth", tip[3])
    m.add_sensor("dot", tip.dot(2.0))
    m.add_sensor("bad", [tip], function=lambda t, x: "no")
    m.add_sensor("nan", [tip], function=lambda t, x: math.nan)
    run = m.simulate(0.1)
    with pytest.raises(ArgumentError, match="no component 3"):
        run.sensor("fourth")
    with pytest.raises(ArgumentError, match="two vectors"):
        run.sensor("dot")
    with pytest.raises(EvaluationError, match='sensor "bad" at t = 0 s'):
        run.sensor("bad")
    with pytest.raises(EvaluationError, match="returned nan"):
        run.sensor("nan")
    with pytest.raises(UnknownNameError, match="did you mean 'tip'"):
        run.sensor("tipp")
    with pytest.raises(UnknownNameError, match='did you mean "rod"'):
        m.add_sensor("x", "rid", "position")


def test_sensors_change_nothing_of_a_motion() -> None:
    bare, sensed = entry_of("four-bar").build(), entry_of("four-bar").build()
    for body in sensed.bodies:
        sensed.add_sensor(body, {"body": body}, "acceleration")
    assert np.array_equal(bare.simulate(0.2).q, sensed.simulate(0.2).q)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_law_that_reads_a_joint_by_sensors_is_the_spring_and_damper(coordinates: str) -> None:
    """Position and velocity of several joints: each law gets its own numbers."""

    def drawn(by_sensors: bool) -> pt.Mechanism:
        m = pt.Mechanism("two levers", gravity=(0.0, -9.81, 0.0))
        for name, x, stiffness, damping in (("A", 0.0, 20.0, 0.7), ("B", 2.0, 30.0, 0.2)):
            m.add_rod(f"rod {name}", start=(x, 0, 0), end=(x + 1.0, 0, 0), mass=1.0)
            m.add_revolute(name, m.ground, f"rod {name}", point=(x, 0, 0))
            if not by_sensors:
                m.add_torsion_spring(name, stiffness=stiffness, damping=damping)
                continue
            m.add_sensor(f"angle {name}", name, "position")
            m.add_sensor(f"rate {name}", name, "velocity")
            m.add_torque(name, lambda t, s, n=name, k=stiffness, c=damping: -(
                k * s.sensor(f"angle {n}") + c * s.sensor(f"rate {n}")))  # fmt: skip
        return m

    runs = [drawn(by).simulate(0.5, coordinates=coordinates, rtol=1e-10, t_eval=[0.0, 0.5]) for by in (True, False)]
    for name in "AB":
        np.testing.assert_allclose(*(run.joint(name).position for run in runs), atol=1e-8)


def test_sensors_with_long_names_are_stored_for_matlab(tmp_path: Path) -> None:
    """MATLAB reads 63 characters of a name; two that differ behind them stay two, in every format."""
    m = full()
    long = "the_distance_of_the_tool_of_the_left_arm_from_the_plane_of_the_table_"
    for ending in ("a", "b", "name"):
        m.add_sensor(long + ending, ["tip"], function=lambda t, x: x[:2])
    run = m.simulate(0.1)
    for name in ("x.mat", "x.json", "x.nc"):
        run.save(tmp_path / name)
        again = pt.load_result(tmp_path / name)
        for ending in ("a", "b", "name"):
            assert np.array_equal(again.sensor(long + ending).values, run.sensor(long + ending).values)
    variables = [item["variable"] for item in run.summary["sensors"]]
    assert len(set(variables)) == len(variables) and max(map(len, variables)) <= 53
