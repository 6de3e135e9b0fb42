"""A compiled model: constant equations (S1)-(S5) that can be evaluated at any state."""

from __future__ import annotations

import gc
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..errors import ArgumentError, DescriptionError, EvaluationError
from ..instant import Instant
from ..numeric import floats, shown
from ..sensing import SensorRecord
from ..state import Layout, State, finite_time
from ..units.door import SI, QuantityError, in_si
from .actuated import Actuated
from .actuators import Actuator, actuators_of, for_core
from .checks import Element, shape_of
from .costs import evaluation_costs
from .parameter_units import parameter_unit
from .records import Description
from .spec import Writer

Array = NDArray[np.float64]


class Equations:
    """M v' = h + C^T lambda with Phi = 0, evaluated by the core. nq coordinates, nv velocities, `rows`
    constraint rows.

    Every method takes q (nq,), some v (nv,), and the time t [s] where something depends on it, and returns new arrays.
    Raises `ArgumentError` if an array has another shape or contains NaN, `EvaluationError` if a user function fails.
    """

    def __init__(self, core: _core.Model | _core.System, names: list[str], velocity_names: list[str]) -> None:
        self._core = core
        self._names, self._velocity_names = names, velocity_names

    @property
    def names(self) -> list[str]:
        """Names of the coordinates q."""
        return list(self._names)

    @property
    def velocity_names(self) -> list[str]:
        """Names of the velocities v; the same as `names` unless there are quaternions."""
        return list(self._velocity_names)

    def mass_matrix(self, q: ArrayLike, *, t: float = 0.0) -> Array:
        """M (nv, nv), symmetric. Dense: costs O(nv^2), which a run avoids."""
        return _finite("the mass matrix", self._core.mass_matrix(finite_time(t), self._q(q)), t)

    def forces(self, q: ArrayLike, v: ArrayLike, *, t: float = 0.0) -> Array:
        """h (nv,): applied and velocity-dependent forces, the right side of (S1) without constraint
        forces."""
        self._of_one_value()
        return _finite("the forces", self._core.forces(finite_time(t), self._q(q), self._v(v)), t)

    def constraints(self, q: ArrayLike, *, t: float = 0.0) -> Array:
        """Phi: the closure errors (S3); zero in an assembled state."""
        return _finite("the constraints", self._core.constraints(finite_time(t), self._q(q)), t)

    def jacobian(self, q: ArrayLike, *, t: float = 0.0) -> Array:
        """C (rows, nv) of C v + a = 0 (S4)."""
        return _finite("the jacobian", self._core.jacobian(finite_time(t), self._q(q)), t)

    def rate(self, q: ArrayLike, *, t: float = 0.0) -> Array:
        """a (rows,) of C v + a = 0 (S4): zero unless a motion is prescribed."""
        return _finite("the constraint rate", self._core.rate(finite_time(t), self._q(q)), t)

    def bias(self, q: ArrayLike, v: ArrayLike, *, t: float = 0.0) -> Array:
        """b (rows,) of C v' + b = 0 (S5)."""
        return _finite("the bias", self._core.bias(finite_time(t), self._q(q), self._v(v)), t)

    def acceleration(self, q: ArrayLike, v: ArrayLike, *, t: float = 0.0) -> tuple[Array, Array]:
        """v' (nv,) and multipliers (rows,) that satisfy (S1) and (S5). The state must satisfy the
        constraints."""
        self._of_one_value()
        vdot, multipliers = self._core.acceleration(finite_time(t), self._q(q), self._v(v))
        return _finite("the acceleration", vdot, t), _finite("a multiplier", multipliers, t)

    def _of_one_value(self) -> None:
        """Refuse forces at a state where one of them has several values there."""
        found = None if isinstance(self._core, _core.System) else self._core.set_valued
        if found is not None:
            name, what = found
            raise DescriptionError(
                f'force "{name}" is {what}; what it does at one state is not known, only simulate, steppers '
                "and FMUs follow it",
                element="force",
                name=name,
            )

    def measure(self, q: ArrayLike, *, t: float = 0.0) -> Array:
        """Projective measure rho (nv,) of every velocity (P4), without units.

        Its mobility with the loops closed, relative to that with the loops cut open: 1 = not restricted, 0 =
        locked.
        """
        return _finite("the measure", self._core.measure(finite_time(t), self._q(q)), t)

    def at(self, q: ArrayLike, v: ArrayLike | None = None, t: float = 0.0) -> Instant:
        """Return every term of the equations and of their reduction at one instant, with the best choice of
        coordinates.

        For inspection, teaching and checking; dense, O(nv^3). `q` must satisfy the constraints, and so must `v`; None:
        at rest except for prescribed motion.

        Raises `SingularityError` at a singular position.

        >>> import numpy as np
        >>> import partita as pt
        >>> m = pt.catalogue.load("four-bar")
        >>> state = m.assemble(rates={"A": 2.0})
        >>> i = m.compile().at(state.q, state.v)
        >>> i.D.shape, bool(np.abs(i.D @ i.C.T).max() < 1e-12)
        ((1, 3), True)
        >>> bool(np.allclose(i.M @ i.vdot, i.h + i.C.T @ i.multipliers))
        True
        """
        self._of_one_value()
        position, time = self._q(q), finite_time(t)
        speeds = None if v is None else self._v(v)
        return Instant.from_core(time, position, self._core.at(time, position, speeds))

    def evaluation_costs(
        self,
        options: Sequence[Mapping[str, Any]],
        steps: Sequence[float],
        t: ArrayLike,
        q: ArrayLike,
        v: ArrayLike,
        tangent: Any = None,
    ) -> list[float]:
        """Measure the time of one evaluation of the accelerations alone [s], for formulations side by side.

        `compare` shows it as a column. The evaluations are those of the stages of a step from each of the states (t, q,
        v), one per row; at each state the formulations take turns in batches of about 40 us, and the fastest of 25
        counts, so that other loads of the machine do not favour any of them. It takes a millisecond for each
        formulation and state.

        Args:
            options: list of options of runs, in the form of `Result.options`.
            steps: typical step length of each run [s].
            t, q, v: closed states (nt,), (nt, nq), (nt, nv).
            tangent: `TangentVelocities` for "user-tangent".

        The time is NaN for a formulation that cannot be evaluated at any of the states.
        """
        return evaluation_costs(self._core, options, steps, (t, q, v), tangent)

    def _q(self, q: ArrayLike) -> Array:
        return checked("q", q, self._core.nq, self._names)

    def _v(self, v: ArrayLike) -> Array:
        return checked("v", v, self._core.nv, self._velocity_names)


class CompiledModel(Equations):
    """A mechanism compiled into equations by `Mechanism.compile`; immutable. A copy is the object itself; pickling
    stores the description, which is compiled again.

    `with_parameters` returns the same mechanism with other masses, points, stiffnesses, ... at a fraction of the cost.

    Attributes:
        summary: names, sizes and layout as plain data.
        coordinates: "relative" or "absolute".
        description: what was compiled, as JSON.
        notes: remarks of the compiler: redundant rows left out, derivatives computed by differences, ...

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=3.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> m.compile().mass_matrix([0.0]).round(12).tolist()   # m L^2 / 3
    [[1.0]]
    """

    def __init__(
        self,
        core: _core.Model,
        summary: dict[str, Any],
        coordinates: str,
        notes: list[list[str]],
        description: str,
        drawn: Description,
        changes: Mapping[str, list[float]] | None = None,
    ) -> None:
        super().__init__(core, list(summary["coordinates"]), list(summary["velocities"]))
        self.core, self.description, self._drawn = core, description, drawn
        self._changes: dict[str, list[float]] = dict(changes or {})
        self.summary, self.coordinates = summary, coordinates
        self._notes = notes
        self._at_rest: State | None = None  # the assembled drawing, computed on first use

    @property
    def notes(self) -> list[str]:
        """Notes of the compiler and the builder, as sentences."""
        return list(self._sentences)

    @cached_property
    def _sentences(self) -> tuple[str, ...]:
        return (*self.summary.get("notes", []), *(note for notes in self._notes for note in notes))

    @property
    def sensors(self) -> Mapping[str, SensorRecord]:
        """Sensors of the description, by name."""
        return self._drawn.sensors

    @property
    def row_names(self) -> list[str]:
        """Names of the constraint rows, such as "D.x"."""
        return list(self.summary["rows_names"])

    @property
    def mobility(self) -> int:
        """Number of independent velocities in the assembled position."""
        return self.core.mobility

    @property
    def parameters(self) -> dict[str, float | list[float]]:
        """All parameters that `with_parameters` accepts, by name, with their current values (SI).

        "gravity" (3), "BODY.mass", "BODY.com" (3, body axes), "BODY.inertia" (9, row by row, about the centre of mass),
        "JOINT.point" (3, world of the drawing), "SPRING.stiffness", ".damping", ".length", ".point1", ".point2",
        "TORSION.stiffness", ".damping", ".angle", "TORQUE.value", "FORCE.value", "FORCE.point"; values only where they
        are constants. "BUSHING.stiffness" and ".damping" (36, row by row), ".point1", ".point2"; for friction, stops,
        contacts and tyres the numbers, named after the arguments, except exponents. "GEAR.ratio", "RACK.radius",
        "BELT.radius1", ".radius2", "DISTANCE.length", ".point1", ".point2", "SCREW.pitch", "ROLLING.radius", ".center",
        ".point", and "COUPLER.factors", ".offset" of what was added by `add_coupler`; "DRIVE.position" and
        "DRIVE.velocity" of drives that are numbers; curves, tables and functions are not parameters.
        """
        return {name: x[0] if len(x) == 1 else x for name, x in self.core.parameters()}

    def with_parameters(self, changes: Mapping[str, ArrayLike]) -> CompiledModel:
        """Return the same mechanism with other parameters (see `parameters`), without compiling it again: bodies,
        joints, coordinates and constraint rows stay the same.

        Every number changes only itself: a new mass leaves the inertia unchanged; the point of a joint moves on both of
        its bodies, which stay where they are drawn. Prefer it to a new mechanism in sweeps and gradients.

        Raises `DescriptionError` for unknown names, wrong counts, numbers that no body, coupling or screw can have,
        points that would move a planar mechanism out of its plane, and factors with which a spatial coupling would
        constrain only rates instead of positions (see `add_coupler`); `ArgumentError` for a value that is not a number.

        >>> import partita as pt
        >>> m = pt.Mechanism("pendulum")
        >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=3.0)
        >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
        >>> model = m.compile()
        >>> model.with_parameters({"A.point": (0.5, 0, 0)}).mass_matrix([0.0]).round(12).tolist()   # m L^2 / 12
        [[0.25]]
        """
        if not isinstance(changes, Mapping):
            message = f"changes must be a dict of names and numbers, not {shown(changes)}"
            raise ArgumentError(message, argument="changes")
        new = dict(self._changes)
        for name, values in changes.items():
            try:
                given = in_si(str(name), values, _shaped(values, parameter_unit(self._drawn, str(name))))
                new[str(name)] = floats(given).ravel().tolist()
            except QuantityError as error:
                raise ArgumentError(str(error), argument="changes") from error
            except TypeError as error:
                message = f"{name} must be a number or an array of numbers, not {shown(values)}"
                raise ArgumentError(message, argument="changes") from error
        core = self.core.with_parameters([(str(name), new[str(name)]) for name in changes])
        return CompiledModel(core, self.summary, self.coordinates, self._notes, core.description, self._drawn, new)

    def _with_more_drives(
        self, drives: Sequence[Mapping[str, Any]], holding: Mapping[str, Sequence[str]]
    ) -> CompiledModel:
        """The same mechanism in the same coordinates with more drives, as plain data; for events that hold joints, and
        for the forces `holding` them by these drives."""
        core = self.core.with_more_drives(json.dumps(list(drives)))
        with uncollected():
            summary = json.loads(core.summary)
        # mobility, and which rows are redundant, are those where nothing is held
        always = ("mobility", "rank", "joint_rows", "joint_rank", "removed", "notes", "geometric_error", "repaired")
        summary |= {key: self.summary[key] for key in always}
        summary["holding"] = {name: list(names) for name, names in holding.items()}
        return CompiledModel(core, summary, self.coordinates, self._notes, core.description, self._drawn)

    def operation_counts(
        self, q: ArrayLike, *, t: float = 0.0, inputs: Sequence[str] | None = None
    ) -> dict[str, dict[str, int]]:
        """Count the arithmetic operations of one evaluation of the rates, for "projective", "explicit-closing" and one
        "iteration" of Newton's method for the dependent coordinates, (34).

        The evaluation is recorded: equal operations count once, those without influence on the rates not at all. Unlike
        times, the counts are the same on every machine. The kinds are "sums", "products", "quotients" (roots included),
        "functions" (sines, cosines, angles), "cases" (roundings, the larger of two numbers) and "total".

        Args:
            q: a position that satisfies the constraints, in joint coordinates.
            t: the time [s], if a motion is prescribed.
            inputs: names of the independent velocities; None: those with which the most loops close in closed form.

        Raises `ArgumentError` where the loops cannot all be closed in closed form, and for Python functions, which
        cannot be recorded.

        >>> import partita as pt
        >>> m = pt.catalogue.load("four-bar")
        >>> counts = m.compile().operation_counts(m.assemble().q, inputs=["A"])
        >>> counts["projective"]["total"] < counts["explicit-closing"]["total"]
        True
        """
        own = None
        if inputs is not None:
            listed = isinstance(inputs, (list, tuple))
            if not listed or any(not isinstance(x, str) or x not in self._velocity_names for x in inputs):
                message = f"inputs must be names of velocities ({', '.join(self._velocity_names)}), not {shown(inputs)}"
                raise ArgumentError(message, argument="inputs")
            own = sorted({self._velocity_names.index(name) for name in inputs})
        return self.core.operation_counts(finite_time(t), self._q(q), own)

    def _stepping(self, *arguments: Any) -> _core.Stepper:
        """The stepper of the core behind `Mechanism.stepper`; for tools."""
        return _core.Stepper(self.core, *arguments)

    def _taped(self, *arguments: Any) -> tuple[dict[str, tuple[Any, ...]], list[int], list[str]]:
        """The tapes of the core behind `Mechanism.to_jax` and its like; for tools."""
        return _core.tapes(self.core, *arguments)

    def actuated(self, state: State, actuators: Any) -> Actuated:
        """The equations of motion in the rates of as many actuators as degrees of freedom: mass matrix, bias, gravity,
        transmission ratios, Jacobians and margin at one state. For control and drive design; drives are left out.

        An evaluation costs that of the accelerations, and no matrix of nv x nv is made. `Actuated.at` evaluates at
        another state with the same set-up.

        Args:
            state: as `assemble` returns it.
            actuators: names or handles, as in `Mechanism.inverse_dynamics`.

        Raises `ArgumentError` for another number of actuators than degrees of freedom, and at a state where they cannot
        cause every motion (type II singularity); `UnknownNameError` for an unknown name.

        >>> import partita as pt
        >>> m = pt.Mechanism("pendulum")
        >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=3.0)
        >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
        >>> a = m.compile().actuated(m.assemble(), [hinge])
        >>> a.M.round(12).tolist(), a.gravity.round(12).tolist()    # m L^2 / 3, m g L / 2
        ([[1.0]], [14.715])
        """
        self._of_one_value()
        self._of_this(state)
        core, chosen = self._with_actuators(actuators)
        return Actuated(self, core.at(state.t, state.q), tuple(each.name for each in chosen), state)

    def _of_this(self, state: Any) -> None:
        """Refuse a state of another model."""
        if not isinstance(state, State) or not (state.is_of(self.summary) or not state.names):
            raise ArgumentError(
                f"state must be a State of this model ({self.coordinates} coordinates), as assemble returns it, not "
                f"{shown(state)}",
                argument="state",
            )

    def _with_actuators(self, wanted: Any) -> tuple[_core.Inverse, list[Actuator]]:
        """The mechanism with actuators, and these; for tools."""
        chosen = actuators_of(self._drawn, self.summary, wanted)
        return _core.Inverse(self.core, *for_core(self.description, chosen)), chosen

    def _actuator(self, wanted: Any) -> Actuator:
        """One actuator, with what it acts along; for tools."""
        return actuators_of(self._drawn, self.summary, [wanted])[0]

    def _laid_out(self, layout: Layout) -> Layout:
        """The layout for states of this model: they know the joints that are not part of them."""
        return layout.reading(self.core, self.summary)

    def __reduce__(self) -> Any:
        """Pickled as its description, and compiled again when loaded."""
        return _again, (self._drawn, self.coordinates, self._changes)

    def __copy__(self) -> CompiledModel:
        """Itself: a model never changes."""
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> CompiledModel:
        return self

    def __repr__(self) -> str:
        core = self.core
        return (
            f"CompiledModel({self.summary['name']!r}: {core.nq} coordinates, {core.nv} velocities, "
            f"{core.rows} constraint rows of rank "
            f"{core.rank}, mobility {core.mobility})"
        )


def compile_description(
    description: Description, coordinates: str, parting: Sequence[str] = ()
) -> tuple[CompiledModel, Layout]:
    """Compile a description that will not change any more; also the layout of its states. Joints that events of a run
    may part (`parting`) are cut."""
    if not description.bodies:
        Element("mechanism", description.name).fail("it has no bodies; add some with add_body, add_rod or add_solid")
    layout = Layout()
    writer = Writer(description, layout)
    text = writer.text()
    core = _core.Model(text, writer.functions, coordinates)
    if parting:
        core = core.that_parts(list(parting))
    with uncollected():
        summary = json.loads(core.summary)
        layout.fill(summary)
    model = CompiledModel(core, summary, coordinates, writer.notes, text, description)
    return model, model._laid_out(layout)


@contextmanager
def uncollected() -> Iterator[None]:
    """Disable the search for cycles while plain data is made: it would scan all objects again and again, and a long
    chain has a hundred thousand entries."""
    runs = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if runs:
            gc.enable()


def _again(
    description: Description, coordinates: str, changes: Mapping[str, list[float]] | None = None
) -> CompiledModel:
    model = compile_description(description, coordinates)[0]
    return model.with_parameters(changes) if changes else model


def _shaped(values: Any, unit: SI) -> SI:
    """The units of 36 numbers row by row, in rows if the numbers are given in rows."""
    if isinstance(unit, str) or len(shape_of(values) or ()) != 2:
        return unit
    return [unit[6 * i : 6 * i + 6] for i in range(6)]


def _finite(what: str, answer: Array, t: float) -> Array:
    """A single number as the result."""
    if not np.isfinite(answer).all():
        raise EvaluationError(
            f"{what} is not finite at t = {t:g} s: q or v are so large that the computation overflows",
            t=t,
            where=what,
        )
    return answer


def checked(what: str, values: ArrayLike, size: int, names: list[str]) -> Array:
    """`values` as a flat, finite, contiguous float array of `size` numbers."""
    try:
        array = floats(values)
    except TypeError as error:
        raise ArgumentError(f"{what} must be an array of numbers, not {shown(values)}", argument=what) from error
    if array.ndim != 1 or array.size != size:
        raise ArgumentError(
            f"{what} has shape {array.shape}; it must be a flat array of {size} numbers: {', '.join(names)}",
            argument=what,
        )
    if not np.all(np.isfinite(array)):
        bad = int(np.argmin(np.isfinite(array)))
        raise ArgumentError(f"{what}[{bad}] ({names[bad]}) is {array[bad]}; give finite numbers", argument=what)
    return array
