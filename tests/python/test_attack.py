"""Every public call with nonsense in each of its arguments: a typed error in a sentence, or a sound answer.

An answer counts as right when it is finite and, for a run, when a run that says `success` is finite and closed.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import math
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest
from thorough import THOROUGH

import partita as pt
from partita import cli, plots, results, viewer
from partita.comparison import Comparison
from partita.errors import ArgumentError, PartitaError

NAN, INF = math.nan, math.inf

NUMBERS: list[Any] = [NAN, INF, -INF, 1e308, -1e308, 1e-308, 1e160, 1e-170, 0.0, -1.0, 10**400, True, 1 + 2j]
ARRAYS: list[Any] = [
    [],
    (),
    [NAN] * 3,
    [INF, 0.0, 0.0],
    [1e308] * 3,
    [1e-170, 0.0, 0.0],
    [1e-308] * 3,
    [0.0] * 3,
    [1.0, 2.0],
    [-1.0, 1.0, 1.0],
    [[1.0, 2.0], [3.0]],
    [1j, 0.0, 0.0],
    [True, False, True],
    ["1", "2", "3"],
    [None] * 3,
    [10**400, 0.0, 0.0],
    np.array(1.0),
    np.zeros((3, 3)),
    np.full((3, 3), 1e308),
    np.full((3, 3), NAN),
    np.eye(3) * 1e-170,
    np.ones((2, 2, 2)),
    np.array(["a"]),
    np.array([object()]),
]
OTHERS: list[Any] = [
    None, "x", "", " ", "\0", "A", "q0", "ground", b"x", object(), {}, {"x": 1.0}, {"A": NAN}, {"A": "x"}, {1: 2},
    set(), range(0), lambda: 1.0, lambda *a: 1.0, lambda *a: None, int, Ellipsis, slice(1), np.datetime64("2020-01-01"),
    {"A": 10**400}, ["A", "A"], ["x"], [1], "3 kg", ["1 mm", "2 rad", "3 kg"], "1e399 m", "5 N/m s",
]  # fmt: skip

Call = tuple[Callable[..., Any], dict[str, Any]]
ORIGIN, X, Y, Z = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def mechanism() -> pt.Mechanism:
    m = pt.Mechanism("m")
    rod = m.add_rod("rod", start=ORIGIN, end=X, mass=1.0)
    m.add_body("box", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(2.0, 0.0, 0.0))
    m.add_revolute("A", m.ground, rod, point=ORIGIN)
    m.add_planar("P", m.ground, "box")
    return m


def pendulum() -> pt.Mechanism:
    m = pt.Mechanism("pendulum")
    m.add_revolute("A", m.ground, m.add_rod("rod", start=ORIGIN, end=X, mass=1.0), point=ORIGIN)
    m.add_sensor("angle", "A", "position")
    return m


def shaker() -> pt.Mechanism:
    """A mass on a spring, shaken."""
    m = pt.Mechanism("shaker", gravity=None)
    m.add_prismatic("S", m.ground, m.add_body("mass", mass=1.0, inertia=(1.0, 1.0, 1.0)), axis=X)
    m.add_torsion_spring("S", stiffness=4.0, damping=0.4)
    m.add_force("mass", (lambda t, state: np.cos(3.0 * t), 0, 0))
    return m


def cycled(m: pt.Mechanism, given: dict[str, Any]) -> Any:
    """The multipliers of a cycle whose runs may not take long."""
    with pt.limits.raised(cycle_steps=5000):
        return m.cycle(**given).multipliers.real


def solid() -> Any:
    return mechanism().add_solid("s", pt.shapes.Sphere(0.1), material="steel")


def loop() -> pt.Mechanism:
    return pt.catalogue.load("four-bar")


def drawn_nowhere(**given: Any) -> None:
    """`draw` without a browser, closed at once."""
    with mock.patch("webbrowser.open"):
        pt.draw(**given).close()


def shown_nowhere(**arguments: Any) -> Any:
    """The page of a mechanism, without a browser."""
    with mock.patch("webbrowser.open"):
        return loop().show(**arguments)


def driven(measure: Any) -> Any:
    """A drive of what is read."""
    return mechanism().add_drive(measure, velocity=1.0)


def acted(m: pt.Mechanism, action: Any) -> Any:
    """A run in which the crank passes an angle, and this is done."""
    return m.simulate(0.02, max_steps=50, events=[pt.Event("e", "A", value=-1e-4, direction=-1, then=action)])


def ring(**change: Any) -> pt.System:
    functions: dict[str, Any] = {
        "n": 2,
        "mass": np.eye(2),
        "forces": (0.0, -9.81),
        "constraints": lambda t, q: [0.5 * (q @ q - 1.0)],
        "jacobian": lambda t, q: [q],
        "bias": lambda t, q, v: [v @ v],
        **change,
    }
    return pt.System(**functions)


def built() -> dict[str, Callable[[], Call]]:
    """Calls that describe."""
    two = {"name": "J", "parent": "rod", "child": "box", "point": X}
    axis = {"axis": Z, "child_point": (1.0, 0.0, 0.1), "child_axis": Z, "cut": "auto"}
    cases: dict[str, dict[str, Any]] = {
        "add_rod": {"name": "r", "start": ORIGIN, "end": X, "mass": 1.0, "gravity": True},
        "add_body": {
            "name": "b",
            "mass": 1.0,
            "inertia": (1.0, 1.0, 1.0),
            "com": ORIGIN,
            "position": ORIGIN,
            "orientation": np.eye(3),
            "gravity": True,
        },
        "add_solid": {
            "name": "s",
            "shape": pt.shapes.Disc(0.1, 0.02),
            "density": 7850.0,
            "position": ORIGIN,
            "orientation": np.eye(3),
            "gravity": True,
        },
        "add_revolute": {**two, **axis},
        "add_prismatic": {**two, **axis},
        "add_cylindrical": {**two, **axis},
        "add_spherical": {**two, "child_point": X, "cut": "auto"},
        "add_universal": {**two, "axis1": X, "axis2": Y, "child_point": X, "cut": "auto"},
        "add_planar": {**two, "normal": Z, "child_point": X, "child_axis": Z, "cut": "auto"},
        "add_fixed": {**two, "child_point": X, "cut": "auto"},
        "add_free": {**two, "cut": "auto"},
        "add_joint": {**two, "free": ("x", "rz"), "frame": np.eye(3), "child_point": X, "cut": "auto"},
        "add_custom_joint": {
            **two,
            "free": ("rz",),
            "follows": {"x": lambda rz: rz},
            "frame": np.eye(3),
            "cut": "auto",
        },
        "add_screw": {**two, **axis, "pitch": 0.1},
        "add_constant_velocity": {**two, "axis": X, "child_point": X, "child_axis": X},
        "add_point_on_line": {**two, **axis},
        "add_point_on_plane": {**two, "normal": Z, "child_point": X, "child_axis": Z, "cut": "auto"},
        "add_parallel": {**two, "axis": Z, "child_frame": np.eye(3), "cut": "auto"},
        "add_perpendicular": {**two, "axis1": X, "axis2": Y, "child_frame": np.eye(3), "cut": "auto"},
        "add_orientation": {**two, "child_frame": np.eye(3), "cut": "auto"},
        "add_pin_slot": {**two, "axis1": X, "axis2": Y, "child_point": X, "child_frame": np.eye(3), "cut": "auto"},
        "add_coupler": {"name": "c", "terms": ["A", "P"], "factors": (1.0, 2.0), "offset": 0.0, "word": "coupler"},
        "add_rotor": {"joint": "A", "inertia": 1e-3, "ratio": 5.0, "coordinate": 0, "name": "r"},
        "add_gear": {"joint1": "A", "joint2": "P", "ratio": 2.0, "coordinate1": 0, "coordinate2": 2, "name": "g"},
        "add_belt": {"pulley1": "A", "pulley2": "P", "radius1": 1.0, "radius2": 2.0, "crossed": True, "name": "b"},
        "add_rack": {"pinion": "A", "slide": "P", "radius": 1.0, "coordinate1": 0, "coordinate2": 1, "name": "r"},
        "add_distance": {
            "name": "d",
            "body1": "rod",
            "point1": ORIGIN,
            "body2": "box",
            "point2": Y,
            "length": 1.0,
        },
        "add_cam": {
            "follower": "P",
            "cam": "A",
            "law": lambda x: 0.1 * np.sin(x),
            "periodic": False,
            "name": "c",
            "word": "cam",
        },
        "add_point_on_curve": {
            "name": "c",
            "body1": "rod",
            "body2": "box",
            "point2": ORIGIN,
            "curve": lambda x: 0.1 * x**2,
            "origin": X,
            "x_axis": X,
            "y_axis": Y,
            "polar": False,
        },
        "add_rolling": {
            "name": "r",
            "body": "box",
            "radius": 1.0,
            "center": ORIGIN,
            "axis": Z,
            "ball": False,
            "on": "ground",
            "point": (0.0, -1.0, 0.0),
            "normal": Y,
            "slips": False,
        },
        "add_constraint": {
            "name": "c",
            "function": lambda t, x, y: x - y,
            "of": ["A", "P"],
            "gradient": lambda t, x, y: (1.0, -1.0),
            "level": "position",
            "word": "constraint",
        },
        "add_drive": {
            "joint": "A",
            "position": lambda t: 0.1 * np.sin(t),
            "velocity": lambda t: 0.1 * np.cos(t),
            "acceleration": lambda t: -0.1 * np.sin(t),
            "coordinate": 0,
            "name": "d",
        },
        "add_compliance": {"joint": "A", "translation": 1e-8, "rotation": (0.0, 1e-6, 0.0)},
        "add_torque": {
            "joint": "A",
            "value": ([0.0, 1.0], [0.0, 1.0]),
            "over": "P",
            "periodic": False,
            "coordinate": 0,
            "name": "t",
        },
        "add_force": {"body": "rod", "force": X, "point": ORIGIN, "axes": "world", "name": "f"},
        "add_spring": {
            "name": "s",
            "body1": "rod",
            "point1": ORIGIN,
            "body2": "ground",
            "point2": Y,
            "stiffness": 1.0,
            "damping": 0.1,
            "length": 1.0,
        },
        "add_torsion_spring": {
            "joint": "A",
            "stiffness": 1.0,
            "damping": 0.1,
            "angle": 0.1,
            "coordinate": 0,
            "name": "ts",
        },
        "add_bushing": {
            "name": "bu",
            "body1": "rod",
            "body2": "box",
            "point": X,
            "stiffness": (1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
            "damping": 0.1 * np.eye(6),
            "frame": np.eye(3),
        },
        "add_friction": {
            "joint": "A",
            "dynamic": 0.1,
            "stick_velocity": 0.1,
            "static": 0.2,
            "coefficient": None,
            "static_coefficient": None,
            "radius": None,
            "length": None,
            "collar": None,
            "preload": 0.0,
            "coordinate": 0,
            "name": "fr",
        },
        "add_stop": {
            "joint": "A",
            "stiffness": 1.0,
            "lower": -0.1,
            "upper": 0.1,
            "damping": 0.1,
            "exponent": 1.5,
            "restitution": None,
            "coordinate": 0,
            "name": "st",
        },
        "add_freewheel": {"joint": "A", "free": 1, "coordinate": 0, "name": "fw"},
        "add_latch": {"joint": "A", "at": 0.5, "direction": 1, "coordinate": 0, "name": "la"},
        "add_brake": {"joint": "A", "torque": 1.0, "static": 1.2, "coordinate": 0, "name": "br"},
        "add_gas_spring": {
            "joint": "A",
            "force": 1.0,
            "length": 0.5,
            "exponent": 1.3,
            "coordinate": 0,
            "name": "gs",
        },
        "add_contact": {
            "name": "co",
            "body1": "box",
            "point1": ORIGIN,
            "body2": "ground",
            "point2": ORIGIN,
            "radius1": 0.5,
            "normal": Y,
            "radius2": None,
            "stiffness": 10.0,
            "exponent": 1.5,
            "damping": 0.1,
            "friction": 0.2,
            "static_friction": 0.3,
            "stick_velocity": 0.1,
        },
        "add_rope": {
            "name": "ro",
            "body1": "box",
            "point1": ORIGIN,
            "body2": "ground",
            "point2": Y,
            "stiffness": 10.0,
            "length": 0.5,
            "exponent": 1.5,
            "damping": 0.1,
            "restitution": None,
        },
        "add_gas_strut": {
            "name": "gs",
            "body1": "box",
            "point1": ORIGIN,
            "body2": "ground",
            "point2": Y,
            "force": 10.0,
            "progression": 1.3,
            "stroke": 0.2,
            "length": 0.5,
            "exponent": 1.4,
            "damping": 0.1,
            "end_stiffness": 100.0,
        },
        "add_tyre": {
            "name": "ty",
            "body": "box",
            "center": ORIGIN,
            "axis": Z,
            "radius": 0.5,
            "normal": Y,
            "stiffness": 10.0,
            "ground": "ground",
            "point": ORIGIN,
            "damping": 0.1,
            "friction": 0.5,
            "longitudinal": 1.0,
            "lateral": 1.0,
            "slow_speed": 0.1,
        },
        "add_force_law": {
            "name": "fl",
            "function": lambda t, *seen: (0.0, 0.1, 0.0),
            "on": ["box"],
            "sees": ["A", "rod", ("box", X)],
        },
        "add_sensor": {
            "name": "se",
            "of": ("box", X),
            "reads": "acceleration",
            "axes": "rod",
            "coordinate": None,
            "unit": "g",
            "text": "of the box",
        },
        "add_imu": {"name": "imu", "of": ("box", X), "axes": "rod"},
    }

    specs: set[tuple[str, str]] = set()

    def already_run(method: str, m: pt.Mechanism, name: Any) -> bool:
        """Whether this mechanism has run before, but for the name of what was added."""
        spec = repr(m.to_spec()).replace(repr(name), "a name")
        known = (method, spec) in specs
        specs.add((method, spec))
        return known

    def make(name: str, arguments: dict[str, Any]) -> Callable[[], Call]:
        def call() -> Call:
            m = mechanism()

            def add_and_run(**given: Any) -> Any:
                getattr(m, name)(**given)
                if not THOROUGH and already_run(name, m, given.get("name")):
                    return None
                run = m.simulate(1e-3, t_eval=[0.0, 1e-3], max_steps=20)
                return run, [run.sensor(each).values for each in run.sensors]

            return add_and_run, arguments

        return call

    return {f"Mechanism.{name}": make(name, arguments) for name, arguments in cases.items()}


def assembled(poses: Any) -> Any:
    """Coordinates of the poses that were assembled; the others are NaN, and have a reason."""
    assert np.isnan(poses.q[~poses.ok]).all() and sorted(poses.reasons) == np.flatnonzero(~poses.ok).tolist()
    return poses.q[poses.ok]


def members(found: Any) -> Any:
    """Coordinates of the members that succeeded; the others have a message."""
    assert sorted(found.messages) == np.flatnonzero(~found.success).tolist()
    return found.q[found.success]


def needed(d: Any) -> Any:
    """Efforts at the instants that have them; the others are NaN, and say why."""
    assert np.isnan(d.efforts).any(axis=1).nonzero()[0].tolist() == sorted(d.gaps)
    return np.delete(d.efforts, sorted(d.gaps), axis=0)


def abs_of(x: float) -> float:
    """A model for sweeps."""
    return abs(x)


def asked() -> dict[str, Callable[[], Call]]:
    """Calls that compute."""
    m = loop()
    state = m.assemble(rates={"A": 1.0})
    sprung = loop()
    sprung.add_torsion_spring("A", stiffness=10.0, name="s")
    sprung_state = sprung.assemble()
    model = m.compile()
    run = m.simulate(0.01, t_eval=[0.0, 0.01], initial=state)
    tip = mechanism()
    tip.add_sensor("tip", ("rod", X), "acceleration")
    motor = mechanism()
    motor.add_torque("A", 0.0, name="motor")
    motor.add_sensor("angle", "A", "position")
    sim = motor.stepper(1e-3, record=False)
    sensed = tip.simulate(0.01, t_eval=[0.0, 0.01])
    s = ring()
    user_run = pt.simulate(s, 0.01, [1.0, 0.0], [0.0, 0.0], t_eval=[0.0, 0.01])
    q, v = state.q, state.v
    options: dict[str, Any] = {
        "duration": 0.01,
        "t_eval": [0.0, 0.01],
        "rtol": 1e-6,
        "atol": 1e-8,
        "method": "dop853",
        "progress": False,
        "correction": "partition",
        "switch_threshold": 1.25,
        "step": None,
        "max_step": 0.1,
        "max_steps": 50,
        "independent": None,
        "solver": pt.Solver(),
    }
    compare = {
        "duration": 0.01,
        "formulations": ["projective"],
        "selections": ["collective"],
        "rtol": 1e-6,
        "atol": 1e-8,
        "method": "dop853",
        "baumgarte": None,
        "window": None,
        "tangent": None,
        "max_steps": 50,
        "reference": None,  # given below: to make one takes time
        "progress": False,
    }
    at = {"q": q, "v": v, "t": 0.0}
    joint, body = run.joint("A"), run.body("crank")
    matrices = {"M": np.eye(2), "C": [[3.0, 4.0]]}
    swinging, shaken = pendulum(), shaker()
    ticks = np.linspace(0.0, 1.0, 50)
    log = {"t": ticks, "A": 0.5 * np.sin(3.0 * ticks), "effort.A": np.cos(3.0 * ticks)}
    equations = {
        "inputs": [],
        "parameters": ["rod.mass"],
        "outputs": ["rod.position"],
        "independent": None,
        "initial": None,
        "closing_rate": 0.0,
    }
    calls: dict[str, Call] = {
        "Mechanism": (pt.Mechanism, {"name": "m", "gravity": ORIGIN}),
        "State": (pt.State, {"t": 0.0, "q": [1.0], "v": [1.0], "names": ["a"], "velocity_names": ["a"]}),
        "State.position": (state.position, {"joint": "A"}),
        "State.velocity": (state.velocity, {"joint": "A"}),
        "System": (pt.System, {"n": 1, "mass": [[1.0]], "forces": [1.0], "names": ["a"], "closing": None}),
        "System.functions": (
            lambda **given: pt.simulate(ring(**given), 0.01, [1.0, 0.0], [0.0, 0.0], max_steps=50),
            {
                "mass": np.eye(2),
                "forces": (0.0, 1.0),
                "constraints": None,
                "jacobian": None,
                "constraint_rate": None,
                "bias": None,
                "lengths": None,
                "check_derivatives": True,
            },
        ),
        "Event": (
            lambda **given: m.simulate(0.02, max_steps=50, events=[pt.Event(**given)]),
            {
                "name": "e",
                "of": "A",
                "value": 1e-3,
                "reads": "position",
                "direction": 1,
                "terminal": False,
                "once": False,
                "then": (),
            },
        ),
        "Lock": (lambda **given: acted(m, pt.Lock(**given)), {"joint": "A", "coordinate": 0}),
        "Release": (lambda **given: acted(m, pt.Release(**given)), {"joint": "A"}),
        "SetRates": (lambda **given: acted(m, pt.SetRates(**given)), {"rates": {"A": 1.0}}),
        "SetInput": (lambda **given: acted(m, pt.SetInput(**given)), {"name": "to", "value": 1.0}),
        "Stop": (lambda **given: acted(m, pt.Stop(**given)), {"restitution": 0.5}),
        "Coordinate": (lambda **given: driven(pt.Coordinate(**given)), {"joint": "A", "coordinate": 0}),
        "Distance": (
            lambda **given: driven(pt.Distance(**given)),
            {"body1": "rod", "point1": ORIGIN, "body2": "box", "point2": X},
        ),
        "Along": (
            lambda **given: driven(pt.Along(**given)),
            {"body1": "rod", "point1": ORIGIN, "axis": X, "body2": "box", "point2": X},
        ),
        "Cosine": (
            lambda **given: driven(pt.Cosine(**given)),
            {"body1": "rod", "axis1": X, "body2": "box", "axis2": X},
        ),
        "System.assemble": (s.assemble, {"q0": [1.0, 0.1], "v0": [0.0, 1.0], "t": 0.0, "tolerance": 1e-12}),
        "System.summary": (s.summary, {"t": 0.0, "q": [1.0, 0.0]}),
        "System.at": (s.at, {"q": [1.0, 0.0], "v": [0.0, 1.0], "t": 0.0}),
        "simulate": (pt.simulate, {"system": s, "q0": [1.0, 0.0], "v0": [0.0, 0.0], "t0": 0.0, **options}),
        "simulate.initial": (pt.simulate, {"system": s, "duration": 0.01, "initial": s.assemble([1.0, 0.0])}),
        "integral, peak, at_end, start, start_rate": (
            lambda **given: tuple(
                swinging.gradient(
                    pt.integral(given["integral"]) + pt.peak(given["peak"]) + pt.at_end(given["at_end"]),
                    by=["rod.mass", pt.start(given["start"]), pt.start_rate(given["start_rate"]), pt.end_time],
                    duration=0.05,
                    rtol=1e-6,
                    atol=1e-8,
                ).by.values()
            ),
            {"integral": "A", "peak": "A", "at_end": "A", "start": "A", "start_rate": "A"},
        ),
        "lengths": (
            lambda **given: tuple(np.array(x) for x in pt.lengths(**given).values()),
            {"mechanism": m, "wanted": {"coupler.length": 0.9}},
        ),
        "Mechanism.gradient": (
            lambda **given: tuple(swinging.gradient(**given).by.values()),
            {
                "of": "A",
                "by": ["rod.mass"],
                "duration": 0.05,
                "held": None,
                "initial": None,
                "events": None,
                "parameters": None,
                "method": "auto",
                "second": False,
                "check": False,
                "rtol": 1e-6,
                "atol": 1e-8,
                "options": None,
            },
        ),
        "Result.sensitivities": (
            lambda **given: (lambda found: tuple(found.position("A").values()))(run.sensitivities(**given)),
            {"by": ["crank.mass"], "held": ["A"]},
        ),
        "Mechanism.cycle": (
            lambda **given: cycled(shaken, given),
            {
                "period": None,
                "along": None,
                "initial": None,
                "periods": 1,
                "guess": None,
                "settle": None,
                "by": None,
                "parameters": None,
            },
        ),
        "Mechanism.identifiability": (
            lambda **given: Exact(swinging.identifiability(**given).labels),
            {
                "motion": "any",
                "by": None,
                "actuators": ["A"],
                "measured": None,
                "near": None,
                "parameters": None,
            },
        ),
        "Mechanism.identify": (
            lambda **given: Exact(swinging.identify(**given).estimates.values()),
            {
                "data": log,
                "by": None,
                "actuators": ["A"],
                "measured": None,
                "positions": None,
                "noise": None,
                "cutoff": None,
                "near": None,
                "parameters": None,
            },
        ),
        "Mechanism.identify.column": (
            lambda **given: Exact(swinging.identify({**log, **given}, actuators=["A"]).estimates.values()),
            {"t": log["t"], "A": log["A"]},
        ),
        "Mechanism.export_casadi": (lambda **given: Exact([swinging.export_casadi(**given)]), equations),
        "Mechanism.to_jax": (lambda **given: Exact([swinging.to_jax(**given)]), equations),
        "Mechanism.to_sympy": (
            lambda **given: Exact([swinging.to_sympy(**given)]),
            {"symbols": ["rod.mass"], "inputs": [], "initial": None, "simplify": False},
        ),
        "TangentVelocities": (
            pt.TangentVelocities,
            {"directions": lambda t, q: [[-q[1], q[0]]], "offset": None, "bias": None},
        ),
        "compare": (  # what it shares with Mechanism.compare is attacked there, where a run takes less time
            lambda **given: pt.compare(**{**compare, **given}),
            {"system": s, "q0": [1.0, 0.0], "v0": [0.0, 0.0], "initial": None, "t0": 0.0, "reference": user_run},
        ),
        "Solver": (
            lambda **given: m.simulate(0.01, t_eval=[0.0, 0.01], solver=pt.Solver(**given)),
            {
                "formulation": "projective",
                "selection": "collective",
                "weights": None,
                "window": None,
                "baumgarte": None,
                "renew": 0.5,
                "tangent": None,
            },
        ),
        "Mechanism.simulate": (
            m.simulate,
            {**options, "initial": state, "coordinates": "relative", "parameters": None},
        ),
        "Mechanism.assemble": (
            m.assemble,
            {
                "targets": {"A": 0.1},
                "rates": {"A": 1.0},
                "near": None,
                "fixed": (),
                "guess": {"A": 0.05},
                "branch": None,
                "t": 0.0,
                "tolerance": 1e-9,
                "coordinates": "relative",
                "parameters": {"gravity": (0, -1.0, 0)},
            },
        ),
        "Mechanism.assemble.levels": (m.assemble, {"targets": [{"A": 0.1}, {}], "fixed": ["A"]}),
        "Mechanism.assemble.point": (
            lambda value: m.assemble([{}, {("crank", ORIGIN, "xy"): value}]),
            {"value": (0.1, 0.2)},
        ),
        "Mechanism.assemble_many": (
            lambda **given: assembled(m.assemble_many(**given)),
            {"targets": {"A": [0.1, 0.2]}, "near": None, "branch": None, "t": 0.0},
        ),
        "Mechanism.assemble_many.value": (
            lambda joint, point: assembled(m.assemble_many({"A": joint, ("crank", X, "x"): point})),
            {"joint": [0.1], "point": 0.1},
        ),
        "Mechanism.ensemble": (
            lambda **given: members(m.ensemble(**given)),
            {
                "states": [m.assemble(), m.assemble(rates={"A": 1.0})],
                "parameters": {"crank.mass": [1.0, 2.0]},
                "t_eval": [0.0, 0.01],
                "rtol": 1e-6,
                "atol": 1e-8,
                "workers": 1,
                "store": None,
                "progress": False,
            },
        ),
        "Mechanism.ensemble.value": (
            lambda mass, gravity: members(
                m.ensemble(parameters={"crank.mass": mass, "gravity": gravity}, t_eval=[0.01])
            ),
            {"mass": [1.0, 2.0], "gravity": [[0.0, -9.81, 0.0], [0.0, -1.0, 0.0]]},
        ),
        "Mechanism.inverse_dynamics": (
            lambda **given: needed(m.inverse_dynamics(**given)),
            {
                "motion": run,
                "actuators": ["A"],
                "weights": {"A": 2.0},
                "limits": {"A": 10.0},
                "preload": {"A": 1.0},
                "initial": None,
                "parameters": None,
            },
        ),
        "Mechanism.inverse_dynamics.course": (
            lambda **given: needed(m.inverse_dynamics((given["t"], {"A": given["course"]}), initial=given["initial"])),
            {"t": [0.0, 0.1], "course": [0.0, 0.1], "initial": state},
        ),
        "InverseDynamics.effort": (m.inverse_dynamics(run, ["A"]).effort, {"actuator": "A"}),
        "Model.actuated": (
            lambda **given: (lambda a: (a.M, a.bias))(model.actuated(**given)),
            {"state": state, "actuators": ["A"]},
        ),
        "Mechanism.kinematics": (
            m.kinematics,
            {
                "targets": {"A": [0.1, 0.2]},
                "rates": {"A": 1.0},
                "accelerations": {"A": 0.5},
                "branch": None,
                "near": state,
                "t": 0.0,
                "coordinates": "relative",
                "parameters": None,
            },
        ),
        "Mechanism.singularities": (
            m.singularities,
            {
                "grid": {"A": [0.1, 0.2]},
                "of": ["A"],
                "kind": "actuators",
                "branch": None,
                "near": state,
                "coordinates": "relative",
                "parameters": None,
            },
        ),
        "Mechanism.workspace": (
            m.workspace,
            {
                "grid": {"A": [0.1, 0.2]},
                "of": ("crank", ORIGIN),
                "actuators": ["A"],
                "outputs": ["A"],
                "assemblies": False,
                "branch": None,
                "near": state,
                "coordinates": "relative",
                "parameters": None,
            },
        ),
        "Mechanism.placement": (
            m.placement,
            {"count": 1, "among": ["A"], "over": m.workspace({"A": [0.1, 0.2]}), "of": "actuators"},
        ),
        "Mechanism.equilibrium": (
            m.equilibrium,
            {"near": state, "along": None, "stable": True, "t": 0.0, "coordinates": "relative", "parameters": None},
        ),
        "Mechanism.equilibrium.along": (
            lambda **given: m.equilibrium(along={"rocker.mass": given["values"], "coupler.mass": given["beside"]}),
            {"values": [1.0, 1.1], "beside": [1.0, 1.1]},
        ),
        "Mechanism.preload": (
            lambda **given: sprung.preload(**given),
            {
                "unknown": ["s.angle"],
                "at": sprung_state,
                "t": 0.0,
                "coordinates": "relative",
                "parameters": None,
            },
        ),
        "Mechanism.equilibria": (
            m.equilibria,
            {"starts": 2, "seed": 1, "near": state, "coordinates": "relative", "parameters": None},
        ),
        "Mechanism.linearize": (
            m.linearize,
            {
                "at": state,
                "inputs": ["A"],
                "outputs": ["A"],
                "independent": ["A"],
                "coordinates": "relative",
                "parameters": None,
            },
        ),
        "Mechanism.assemblies": (
            m.assemblies,
            {"targets": {"A": 0.1}, "rates": {"A": 1.0}, "near": None, "inputs": ["A"], "t": 0.0},
        ),
        "Elements.get": (lambda name: m.joints[name].kind, {"name": "A"}),
        "Elements.remove": (lambda name: loop().joints.remove(name), {"name": "A"}),
        "Body.mass": (lambda value: setattr(loop().bodies["crank"], "mass", value), {"value": 1.0}),
        "Body.start": (lambda value: setattr(loop().bodies["crank"], "start", value), {"value": X}),
        "Joint.change": (
            lambda point, axis: loop().joints["A"].change(point=point, axis=axis),
            {"point": X, "axis": Z},
        ),
        "Joint.point": (lambda value: setattr(loop().joints["A"], "point", value), {"value": X}),
        "Joint.parent": (lambda value: setattr(loop().joints["A"], "parent", value), {"value": "ground"}),
        "Joint.compliance": (lambda value: setattr(loop().joints["A"], "compliance", value), {"value": [1e-8] * 6}),
        "Mechanism.convert": (m.convert, {"state": state, "coordinates": "absolute"}),
        "Mechanism.compile": (m.compile, {"coordinates": "relative"}),
        "Mechanism.report": (m.report, {"state": state, "coordinates": "relative"}),
        "Mechanism.compare": (m.compare, {**compare, "initial": state, "coordinates": "relative", "reference": run}),
        "Model.with_parameters": (model.with_parameters, {"changes": {"crank.mass": 1.0}}),
        "Model.with_parameters.value": (
            lambda value: model.with_parameters({"crank.mass": value}).mass_matrix(q),
            {"value": 1.0},
        ),
        "Model.with_parameters.point": (
            lambda value: model.with_parameters({"A.point": value}).constraints(q),
            {"value": ORIGIN},
        ),
        "System.evaluation_costs": (
            lambda **given: Exact(s.evaluation_costs(**given)),
            {
                "options": [user_run.options],
                "steps": [0.01],
                "t": [0.0],
                "q": [[1.0, 0.0]],
                "v": [[0.0, 1.0]],
                "tangent": None,
            },
        ),
        "Model.operation_counts": (model.operation_counts, {"q": list(state.q), "t": 0.0, "inputs": ["A"]}),
        "Model.evaluation_costs": (
            lambda **given: Exact(model.evaluation_costs(**given)),
            {
                "options": [run.options],
                "steps": [0.01],
                "t": [0.0],
                "q": [list(state.q)],
                "v": [list(state.v)],
                "tangent": None,
            },
        ),
        "partition.measure": (pt.partition.measure, matrices),
        "partition.choose": (
            pt.partition.choose,
            {**matrices, "selection": "collective", "threshold": 1.0, "weights": None, "fixed": None},
        ),
        "partition.geometry": (pt.partition.geometry, {**matrices, "independent": [0]}),
        "shapes.Disc": (pt.shapes.Disc, {"radius": 0.1, "thickness": 0.02}),
        "shapes.Cylinder": (pt.shapes.Cylinder, {"radius": 0.1, "length": 0.2, "inner_radius": 0.05}),
        "shapes.Box": (pt.shapes.Box, {"size": (0.1, 0.2, 0.3)}),
        "shapes.Sphere": (pt.shapes.Sphere, {"radius": 0.1}),
        "shapes.Plate": (
            pt.shapes.Plate,
            {"outline": [(0, 0), (1, 0), (1, 1), (0, 1)], "thickness": 0.1, "holes": [((0.5, 0.5), 0.1)]},
        ),
        "shapes.Plate.hole": (
            lambda center, radius: pt.shapes.Plate(((0, 0), 1.0), 0.1, holes=[(center, radius)]),
            {"center": (0.1, 0.2), "radius": 0.1},
        ),
        "shapes.Revolution": (pt.shapes.Revolution, {"profile": [(0, 0), (0.1, 0), (0, 0.2)]}),
        "shapes.Sum": (pt.shapes.Sum, {"parts": pt.shapes.Sphere(0.1).at().parts}),
        "Shape.at": (pt.shapes.Sphere(0.1).at, {"position": X, "orientation": np.eye(3)}),
        "Mechanism.add_solid.material": (
            lambda material, mass: mechanism().add_solid("s", pt.shapes.Sphere(0.1), material=material, mass=mass),
            {"material": "steel", "mass": None},
        ),
        "Body.shape": (lambda value: setattr(solid(), "shape", value), {"value": pt.shapes.Sphere(0.2)}),
        "units.convert": (lambda **given: Exact([pt.units.convert(**given)]), {"value": 1.0, "unit": "m", "to": "mm"}),
        "catalogue.load": (pt.catalogue.load, {"name": "n-four-bar", "loops": 2}),
        "catalogue.entry": (pt.catalogue.entry, {"name": "n-four-bar", "loops": 2}),
        "catalogue.about": (pt.catalogue.about, {"name": "four-bar"}),
        "Entry.simulate": (pt.catalogue.entry("four-bar").simulate, {"rtol": 1e-6, "max_steps": 20}),
        "Result.joint": (run.joint, {"name": "A"}),
        "Result.body": (run.body, {"name": "crank"}),
        "Result.sensor": (lambda name: sensed.sensor(name).values, {"name": "tip"}),
        "Result.state": (run.state, {"t": 0.005}),
        "Mechanism.stepper": (
            lambda **given: tip.stepper(**given).step().q,
            {
                "dt": 1e-3,
                "inputs": [],
                "initial": None,
                "method": "rk4",
                "substeps": 2,
                "coordinates": "relative",
                "switch_threshold": 1.25,
                "parameters": None,
                "record": True,
            },
        ),
        "Stepper.step": (lambda u: sim.step(u).q, {"u": [1.0]}),
        "Stepper.reset": (lambda initial: sim.reset(initial).q, {"initial": None}),
        "Stepper.sensor": (lambda name: sim.sensor(name), {"name": "angle"}),
        "Stepper.joint": (lambda name: sim.joint(name).position, {"name": "A"}),
        "Result.drive": (lambda name: run.drive(name).effort, {"name": "none"}),
        "Result.reactions_by": (run.reactions_by, {"route": "recursion"}),
        "Result.self_stresses": (lambda output: run.self_stresses(output).wrenches, {"output": 0}),
        "JointResult.directions": (lambda output: tuple(joint.directions(output)), {"output": 0}),
        "JointResult.in_frame": (joint.in_frame, {"axes": np.eye(3)}),
        "BodyResult.point": (body.point, {"point": X}),
        "BodyResult.point_velocity": (body.point_velocity, {"point": X}),
        "Result.plot": (
            lambda what, x, ax, points: run.plot(what, x=x, ax=ax, points=points),
            {"what": "energy", "x": None, "ax": None, "points": None},
        ),
        "plots.plot_joint": (plots.plot_joint, {"result": run, "name": "A", "axes": "world"}),
        "plots.plot": (lambda result: plots.plot(result, "energy"), {"result": run}),
        "viewer.html": (viewer.html, {"result": run, "title": "t"}),
        "Result.to_html": (
            lambda shapes, points: viewer.html(run, shapes=shapes, points=points),
            {"shapes": {"ground": {"kind": "ball", "radius": 1.0}}, "points": {"P": ("ground", X)}},
        ),
        "Result.save_animation": (
            run.save_animation,
            {
                "path": "none/x.gif",
                "fps": 10.0,
                "speed": None,
                "size": (320, 240),
                "forces": True,
                "shapes": None,
                "points": None,
            },
        ),
        "Mechanism.to_playground": (
            loop().to_playground,
            {"path": "none/x.html", "initial": None, "title": "t", "speed": 1.0},
        ),
        "Mechanism.export_c": (
            loop().export_c,
            {"path": "none/x.c", "actuators": ["A"], "joints": ["B"], "initial": None, "name": "x"},
        ),
        "Mechanism.to_fmu": (
            loop().to_fmu,
            {
                "path": "none/x.fmu",
                "inputs": ["A"],
                "outputs": ["A"],
                "parameters": ["gravity"],
                "initial": None,
                "duration": 1.0,
                "communication_step": 0.1,
                "rtol": 1e-8,
                "atol": 1e-10,
                "method": "dop853",
                "solver": None,
                "version": "3.0",
            },
        ),
        "Mechanism.to_html": (
            loop().to_html,
            {"path": "none/x.html", "title": "t", "state": None, "shapes": None, "points": None},
        ),
        "Mechanism.show": (
            shown_nowhere,
            {"title": "t", "state": None, "shapes": {"crank": {"kind": "ball", "radius": 0.1}}, "points": None},
        ),
        "Mechanism.plot": (
            loop().plot,
            {"path": None, "state": None, "ax": None, "shapes": None, "points": {"P": ("crank", ORIGIN)}},
        ),
        "table": (pt.table, {"function": lambda t: t, "start": 0.0, "end": 1.0, "tolerance": 1e-6}),
        "draw": (drawn_nowhere, {"port": 0, "browser": False}),
        "Mechanism.check": (loop().check, {"state": None}),
        "Body.at": (loop().bodies["crank"].at, {"point": X}),
        "Body.world": (loop().bodies["crank"].world, {"point": X}),
        "Mechanism.save": (loop().save, {"path": "none/x.urdf", "strict": True}),
        "load": (pt.load, {"path": "none.toml", "base": "fixed"}),
        "sweep": (
            pt.sweep,
            {
                "model": abs_of,
                "parameters": {"x": [1.0]},
                "executor": None,
                "workers": 1,
                "batch": "auto",
                "store": None,
            },
        ),
        "samples": (pt.samples, {"ranges": {"x": (0.0, 1.0)}, "count": 2, "sampler": "halton", "seed": 0}),
        "load_sweep": (pt.load_sweep, {"path": "none"}),
        "load_result": (pt.load_result, {"path": "none.json"}),
    }
    for name in ("mass_matrix", "constraints", "jacobian", "measure", "rate"):
        calls[f"Model.{name}"] = (getattr(model, name), {"q": q, "t": 0.0})
        calls[f"System.{name}"] = (getattr(s, name), {"q": [1.0, 0.0], "t": 0.0})
    for name in ("forces", "bias", "acceleration", "at"):
        calls[f"Model.{name}"] = (getattr(model, name), at)
        calls[f"System.{name}"] = (getattr(s, name), {"q": [1.0, 0.0], "v": [0.0, 1.0], "t": 0.0})

    return {name: (lambda call=call: call) for name, call in calls.items()}  # type: ignore[misc]


ASKED = asked()
CALLS = {**built(), **ASKED}


class Exact(tuple[Any, ...]):
    """An answer that may contain the input, NaN included."""


def numbers_of(answer: Any) -> Iterator[np.ndarray]:
    if isinstance(answer, np.ndarray) and answer.dtype.kind == "f":
        yield answer
    elif isinstance(answer, tuple):
        for item in answer:
            yield from numbers_of(item)
    elif isinstance(answer, pt.State):
        yield answer.q
        yield answer.v


def wrong(answer: Any) -> str:
    """What is wrong with an answer, in words."""
    if isinstance(answer, results.Result):
        if answer.success and not (np.isfinite(answer.q).all() and np.isfinite(answer.v).all()):
            return "a run that is not finite says success"
        scale = 1.0 + float(np.max(np.abs(answer.q), initial=0.0))
        if answer.success and not float(np.max(answer.closure, initial=0.0)) <= 1e-6 * scale:
            return f"a run that is open by {np.max(answer.closure):.1e} says success"
    elif isinstance(answer, Comparison | Exact):
        return ""
    elif not all(np.isfinite(array).all() for array in numbers_of(answer)):
        return f"the answer is not finite: {answer!r}"
    return ""


def attack1(function: Callable[..., Any], arguments: dict[str, Any], name: str, value: Any) -> Iterator[str]:
    """Say what came out that should not."""
    with warnings.catch_warnings(), contextlib.redirect_stderr(io.StringIO()):
        warnings.simplefilter("error", RuntimeWarning)
        try:
            fault = wrong(function(**{**arguments, name: value}))
        except PartitaError as error:
            fault = "" if len(str(error)) > 15 and " " in str(error) else f"no sentence: {error}"
            if "internal error" in str(error):
                fault = str(error)
            if isinstance(error, ArgumentError) and not error.argument:
                fault = f"names no argument: {error}"
        except Exception as error:
            fault = f"{type(error).__name__}: {error}"
            if isinstance(error, TypeError) and callable(value):
                fault = ""  # of the user's function, called with arguments that it does not take
    if fault:
        yield f"{name}={value!r:.60}: {fault}"


def nonsense_for(place: int, count: int) -> list[Any]:
    """All numbers, and of the rest every second value where the next argument meets the others."""
    rest = [*ARRAYS, *OTHERS]
    return [*NUMBERS, *(rest if THOROUGH or count == 1 else rest[place % 2 :: 2])]


@pytest.mark.parametrize("name", CALLS)
def test_nonsense_in_each_argument(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    function, arguments = CALLS[name]()
    found: list[str] = []
    for place, key in enumerate(arguments):
        for value in nonsense_for(place, len(arguments)):
            if name.startswith("Mechanism.add_"):  # descriptions grow: each attempt starts from a new one
                function = CALLS[name]()[0]
            found += attack1(function, arguments, key, value)
    assert not found, f"{len(found)} of {name}:\n" + "\n".join(found)


COMMANDS: list[list[str]] = [
    ["simulate", "four-bar", "--time", "x"],
    ["simulate", "four-bar", "--time", "nan"],
    ["simulate", "four-bar", "--time", "inf"],
    ["simulate", "four-bar", "--time", "-1"],
    ["simulate", "four-bar", "--time", "0"],
    ["simulate", "four-bar", "--time", "1", "--rtol", "nan"],
    ["simulate", "four-bar", "--time", "1", "--outputs", "0"],
    ["simulate", "four-bar", "--time", "1", "--outputs", "-5"],
    ["simulate", "four-bar", "--time", "1", "--outputs", "1e9"],
    ["simulate", "four-bar", "--target", "A=nan"],
    ["simulate", "four-bar", "--target", "=1"],
    ["simulate", "four-bar", "--rate", "A=1e308"],
    ["simulate", "four-bar", "--save", "none/x.nc"],
    ["simulate", "four-bar", "--save", "."],
    ["simulate", ""],
    ["simulate", "\0"],
    ["report", "."],
    ["report", "y" * 5000],
    ["plot", "none.nc"],
    ["view", "none.json"],
    ["convert", "a.toml", "b.toml"],
    ["convert", "four-bar", "none/b.toml"],
    [""],
    ["\0"],
]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: " ".join(c)[:40].replace("\0", "0") or "empty")
def test_nonsense_on_the_command_line(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    code = cli.main(command)
    printed = capsys.readouterr().err
    assert code == 2 and "partita" in printed and "Traceback" not in printed and "internal error" not in printed


def test_every_public_name_is_attacked() -> None:
    """What is added to the package is added here."""
    covered = " ".join(CALLS)
    quiet = {"errors", "end_time", "catalogue", "limits", "partition", "units", "__version__"}
    missing = [name for name in pt.__all__ if name not in quiet and name not in covered]
    for kind, word in ((pt.Mechanism, "Mechanism"), (pt.System, "System"), (type(loop().compile()), "Model")):
        for name, value in inspect.getmembers(kind, inspect.isfunction):
            takes = list(inspect.signature(value).parameters) != ["self"]
            if not name.startswith("_") and takes and f"{word}.{name}" not in CALLS:
                missing.append(f"{word}.{name}")
    assert not missing, missing
