"""One mechanism of the zoo with springs: A to D moving and at rest, and eigenvalues in both kinds of coordinates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

import partita as pt
from partita.analyses.still import run_of
from partita.builder.compiled import CompiledModel
from partita.errors import PartitaError
from partita.results.run import Run

Array = NDArray[np.float64]

EXACT = 1e-7
"""Entries of A and B and the differences, over the largest entry of their block."""
EXTRAPOLATED = 1e-8
"""Largest error of the differences themselves: what the last extrapolation changes. Three lengths remove errors of the
second and fourth order."""
LENGTHS = (4e-3, 1e-3, 2.5e-4)
"""Longest differences, in characteristic displacements; the sixth power of the first is below rounding. Next to
singular positions derivatives grow, and shorter ones are better."""
SAME = 1e-7
"""Eigenvalues in the two kinds of coordinates, over the largest; zero ones are roots of rounding, 1e-6."""
SENSED = ("position", "velocity", "acceleration")
"""What is read at a point of the last body."""
SPRUNG = 3
"""Joints with a spring."""


@dataclass
class Judged:
    """What was wrong, in words, and the largest differences."""

    name: str
    wrong: list[str] = field(default_factory=list)
    worst: dict[str, float] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)

    def hold(self, what: str, value: float, limit: float) -> None:
        self.worst[what] = max(value, self.worst.get(what, 0.0))
        if not value <= limit:
            self.wrong.append(f"{what}: {value:.1e}, more than {limit:.0e}")


def sprung(name: str) -> tuple[pt.Mechanism, str | None]:
    """The mechanism with springs and dampers in joints and on bodies, and a joint of one coordinate."""
    m = pt.catalogue.entry(name).mechanism()
    driven = {drive.joint for drive in m.drives.values()}
    single = [
        joint
        for joint in m.joints
        if m.joints[joint].kind in ("revolute", "prismatic", "screw") and joint not in driven
    ]
    for i, joint in enumerate(single[:SPRUNG]):
        m.add_torsion_spring(joint, stiffness=30.0 + 7.0 * i, damping=0.4 + 0.1 * i, angle=0.1, name=f"twist {i}")
    bodies = list(m.bodies)
    for i, body in enumerate(dict.fromkeys((bodies[0], bodies[-1]))):
        foot = (0.3, -0.7 + 0.2 * i, 0.4)
        m.add_spring(f"coil {i}", m.ground, foot, body, (0, 0, 0), stiffness=90.0, damping=1.5, length=0.4)
    if single:
        m.add_torque(single[0], 0.0, name="probe")
    for name in SENSED:
        m.add_sensor(name, (bodies[-1], (0.1, 0.2, 0.3)), name)
    return m, single[0] if single else None


def differences(
    model: CompiledModel,
    at: tuple[float, Array, Array],
    found: dict[str, Array],
    value: Callable[[Array, Array], Array],
) -> tuple[Array, Array]:
    """Changes of a value of (q, v) with all states by central differences, extrapolated twice, and how much the last
    time."""
    t, q, v = at
    kz, states = len(found["positions"]), found["A"].shape[0]
    sizes = found["steps"][:states] / np.cbrt(np.finfo(float).eps)

    def beside(j: int, h: float) -> Array:
        moved = model.core.displaced(t, q, h * found["displacements"][:, j][None, :])[0] if j < kz else q
        return value(moved, v + h * found["rates"][:, j])

    def extrapolated(j: int, length: float) -> tuple[Array, Array]:
        slopes = []
        for part in (1.0, 0.5, 0.25):
            h = length * sizes[j] * part
            slopes.append((beside(j, h) - beside(j, -h)) / (2.0 * h))
        once = [(4.0 * b - a) / 3.0 for a, b in pairwise(slopes)]
        twice = (16.0 * once[1] - once[0]) / 15.0
        return twice, twice - once[1]

    size = len(value(q, v))
    columns, changed = np.zeros((size, states)), np.zeros((size, states))
    for j in range(states):
        tried = [extrapolated(j, length) for length in LENGTHS]
        columns[:, j], changed[:, j] = min(tried, key=lambda one: np.abs(one[1]).max(initial=0.0))
    return columns, changed


def measured(judged: Judged, m: pt.Mechanism, state: pt.State, coordinates: str, motor: str | None, word: str) -> None:
    """C and D: position, velocity and acceleration of a point, each over its largest entry."""
    model, at = m.compile(coordinates), (state.t, state.q, state.v)
    lin = m.linearize(state, inputs=[motor] if motor else (), outputs=SENSED, coordinates=coordinates)
    found = model.core.linearized(*at, np.zeros((0, model.core.nv)))

    def read(of: CompiledModel, q: Array, v: Array) -> Array:
        rows = (q[None, :], v[None, :], of.core.acceleration(state.t, q, v)[0][None, :])
        run = run_of(Run, model, np.array([state.t]), *rows, np.zeros((1, model.core.rows)))
        return np.concatenate([run.sensor(name).values[0] for name in SENSED])

    slopes, changed = differences(model, at, found, lambda q, v: read(model, q, v))
    sizes = found["steps"] / np.cbrt(np.finfo(float).eps)
    for i, name in enumerate(SENSED):
        part = slice(3 * i, 3 * i + 3)
        # near a dwell an output all but rests; what is left is the rounding of its value
        whole = max(np.abs(slopes[part] * sizes).max(initial=0.0), 1e-3 * np.abs(lin.y0[part]).max(), 1e-300)
        if np.abs(changed[part] * sizes).max(initial=0.0) / whole <= EXTRAPOLATED:
            off = np.abs((lin.C - slopes)[part] * sizes).max(initial=0.0) / whole
            judged.hold(f"C of {name}, {word}", float(off), EXACT)
        else:
            judged.left_out.append(f"C of {name}, {word}: the differences are not exact enough")
    if motor is not None:
        pushed = read(model.with_parameters({"probe.value": 1.0}), state.q, state.v) - read(model, state.q, state.v)
        size = max(np.abs(pushed).max(initial=0.0), 1e-12 * np.abs(lin.y0).max(initial=0.0) / EXACT, 1e-300)
        judged.hold(f"D, {word}", float(np.abs(lin.D[:, 0] - pushed).max(initial=0.0) / size), EXACT)


def compared(
    judged: Judged, model: CompiledModel, at: tuple[float, Array, Array], motor: str | None, word: str
) -> None:
    """A, B and the number of states at one state."""
    t, q, v = at
    efforts = np.zeros((0, model.core.nv))
    if motor is not None:
        core, _ = model._with_actuators([motor])
        efforts = core.columns(t, q)
    found = model.core.linearized(t, q, v, efforts)
    kz, ku, states = len(found["positions"]), len(found["velocities"]), found["A"].shape[0]
    sizes = found["steps"][:states] / np.cbrt(np.finfo(float).eps)
    jacobian = model.core.jacobian(t, q)
    rank = int(np.linalg.matrix_rank(jacobian, tol=1e-8 * max(1.0, np.abs(jacobian).max(initial=0.0))))
    holonomic = len(model.core.constraints(t, q))
    closing = int(np.linalg.matrix_rank(jacobian[:holonomic], tol=1e-8 * max(1.0, np.abs(jacobian).max(initial=0.0))))
    if (kz, ku, states) != (model.core.nv - closing, model.core.nv - rank, kz + ku):
        judged.wrong.append(
            f"{word}: {kz} + {ku} states of {model.core.nv} velocities with constraints of rank {rank}, "
            f"{closing} of positions"
        )
    exact = found["accelerations"][:, :states]
    slopes, changed = differences(model, at, found, lambda q, v: model.core.acceleration(t, q, v)[0])
    whole = np.abs(exact * sizes).max(initial=0.0)
    for block, what in ((slice(0, kz), "by positions"), (slice(kz, states), "by velocities")):
        # forces may all but vanish along some of the states
        size = max(np.abs((exact * sizes)[:, block]).max(initial=0.0), 1e-3 * whole, 1e-300)
        off = np.abs(((exact - slopes) * sizes)[:, block]).max(initial=0.0) / size
        judged.hold(f"A {what}, {word}", float(off), EXACT)
        judged.hold(
            f"error of differences, {word}",
            float(np.abs((changed * sizes)[:, block]).max(initial=0.0) / size),
            EXTRAPOLATED,
        )
    velocities = np.abs(found["A"][kz:] - exact[found["velocities"]]).max(initial=0.0)
    judged.hold(f"rows of A, {word}", float(velocities / max(np.abs(exact).max(initial=0.0), 1e-300)), 1e-12)
    if motor is not None:
        pushed = model.with_parameters({"probe.value": 1.0}).core.acceleration(t, q, v)[0]
        column = pushed - model.core.acceleration(t, q, v)[0]
        size = np.abs(found["accelerations"][:, states]).max(initial=0.0)
        # an unlucky joint may move nothing; what is left is the rounding of v'
        rounding = 1e-12 * np.abs(pushed).max(initial=0.0)
        off = np.abs(found["accelerations"][:, states] - column).max(initial=0.0)
        judged.hold(f"B, {word}", float(off / max(size, rounding / EXACT, 1e-300)), EXACT)


def eigenvalues(judged: Judged, m: pt.Mechanism) -> None:
    """About an equilibrium: twice as many as degrees of freedom, the same in both kinds of coordinates."""
    try:
        e = m.equilibrium(stable=True)
        away = m.convert(e.state, "absolute")
    except PartitaError as error:
        judged.left_out.append(f"eigenvalues: {error}")
        return
    found = []
    for state, coordinates in ((e.state, "relative"), (away, "absolute")):
        lin = m.linearize(state, outputs=(), coordinates=coordinates)
        if not lin.steady:
            judged.left_out.append(f"eigenvalues: not steady in {coordinates} coordinates")
            return
        found.append(lin.modes().eigenvalues)
    one, other = (values[np.lexsort((values.imag, values.real, np.abs(values).round(6)))] for values in found)
    if len(one) != len(other):
        judged.wrong.append(f"{len(one)} eigenvalues in relative coordinates, {len(other)} in absolute ones")
        return
    size = np.abs(one).max(initial=0.0) or 1.0
    # each to its nearest: a sum of ties has no order
    off = max((float(np.abs(other - value).min()) for value in one), default=0.0)
    judged.hold("eigenvalues, relative and absolute", off / size, SAME if np.abs(one).min(initial=1.0) > 0 else 1e-6)


def study(name: str) -> Judged:
    """Everything of one mechanism."""
    judged = Judged(name)
    m, motor = sprung(name)
    entry = pt.catalogue.entry(name)
    try:
        start = entry.initial(m)
        later = m.simulate(0.05, initial=start, t_eval=[0.0, 0.05], rtol=1e-9, atol=1e-11).state(0.05)
        for coordinates in ("relative", "absolute"):
            model = m.compile(coordinates)
            moving = later if coordinates == "relative" else m.convert(later, coordinates)
            compared(judged, model, (moving.t, moving.q, moving.v), motor, "moving")
            measured(judged, m, moving, coordinates, motor, "moving")
            if not np.any(model.core.rate(moving.t, moving.q)):  # no drive moves
                compared(judged, model, (moving.t, moving.q, np.zeros_like(moving.v)), motor, "at rest")
                still = moving.copy()
                still.v[:] = 0.0
                measured(judged, m, still, coordinates, motor, "at rest")
    except PartitaError as error:
        judged.wrong.append(f"{type(error).__name__}: {error}")
        return judged
    eigenvalues(judged, m)
    return judged
