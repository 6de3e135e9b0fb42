"""User-defined systems: the equations (S1)-(S5) as Python functions, and their simulation."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from . import options as run_options
from .builder.compiled import Equations, checked
from .errors import ArgumentError, DescriptionError, EvaluationError
from .events import of_functions
from .extras import check_not_ending
from .numeric import floats, is_list, shown
from .solver import Solver
from .state import Layout, State
from .tolerance import EQUAL
from .units import Quantity

if TYPE_CHECKING:
    from .results import Result

Array = NDArray[np.float64]
Function = Callable[..., Any]


class System(Equations):
    """n coordinates with M v' = h + C^T lambda, q' = v, and m constraint rows, given as Python functions.

    For mechanisms prefer `Mechanism`: its equations run without Python and are faster by orders of magnitude.

    Args:
        n: number of coordinates and of velocities.
        mass: f(t, q) -> M (n, n), symmetric and positive definite; or a constant matrix.
        forces: f(t, q, v) -> h (n,); or a constant vector.
        constraints: f(t, q) -> Phi (p,), p <= m (S3).
        jacobian: f(t, q) -> C (m, n) of C v + a = 0 (S4). Its first p rows are dPhi/dq; the others are nonholonomic
            constraints, on velocities only.
        constraint_rate: f(t, q) -> a (m,), dPhi/dt for the first p rows; None: zero.
        bias: f(t, q, v) -> b (m,) of C v' + b = 0 (S5): b = (dC/dt) v + da/dt.
        names: of the coordinates (n,); None: q0, q1, ...
        closing: for the formulation "explicit-closing": a pair (dependent, f) of coordinate names and a
            function f(t, q) -> values (m,) of these coordinates that close the loops for the others in q.
        lengths: characteristic displacement of each coordinate (n,), or one number for all: 1 for an angle, the extent
            of a body for a displacement. Tolerances are relative to it. None: estimated, to a power of ten, from how
            fast the rows of the Jacobian change.
        check_derivatives: compare jacobian, constraint_rate and bias with finite differences of the constraints at the
            start of a run and once more at a later position; False: do not check them.

    Without `jacobian` the system is unconstrained. Each array is checked at every evaluation: a wrong shape
    or NaN raises `EvaluationError` with the time and the name of the function.

    Raises:
        DescriptionError: n, the names or the set of functions is invalid.

    >>> import numpy as np
    >>> import partita as pt
    >>> pendulum = pt.System(
    ...     n=2,
    ...     mass=np.eye(2),
    ...     forces=(0.0, -9.81),
    ...     constraints=lambda t, q: [0.5 * (q @ q - 1.0)],
    ...     jacobian=lambda t, q: [q],
    ...     bias=lambda t, q, v: [v @ v],
    ...     names=["x", "y"],
    ... )
    >>> run = pt.simulate(pendulum, 1.0, q0=[1.0, 0.0], v0=[0.0, 0.0])
    >>> bool(run.closure.max() < 1e-12)
    True
    """

    def __init__(
        self,
        n: int,
        mass: Function | ArrayLike,
        forces: Function | ArrayLike,
        constraints: Function | None = None,
        jacobian: Function | None = None,
        constraint_rate: Function | None = None,
        bias: Function | None = None,
        names: Iterable[str] | None = None,
        closing: tuple[Iterable[str], Function] | None = None,
        lengths: ArrayLike | None = None,
        check_derivatives: bool = True,
    ) -> None:
        if isinstance(n, bool) or not isinstance(n, int | np.integer) or n < 1:
            _refuse(f"n is {shown(n)}; it must be an integer above zero")
        self.n = int(n)
        labels = _names(names, self.n)
        if jacobian is None and any(item is not None for item in (constraints, constraint_rate, bias)):
            _refuse("constraints need their jacobian C (m, n) as well; give jacobian=")
        if jacobian is not None and bias is None:
            _refuse(
                "a jacobian needs bias = (dC/dt) v + da/dt as well; where C and a are constant give "
                "bias=lambda t, q, v: np.zeros(m)"
            )
        self._rows = _Rows(jacobian, self.n)
        core = _core.System(
            self.n,
            _checked("mass", mass, lambda t, q: (self.n, self.n), _symmetric),
            _checked("forces", forces, lambda t, q, v: (self.n,)),
            self._rows.positions(constraints),
            self._rows.jacobian,
            None
            if constraint_rate is None
            else _checked("constraint_rate", constraint_rate, lambda t, q: (self._rows.count(t, q),)),
            _checked("bias", bias if bias is not None else np.zeros(0), lambda t, q, v: (self._rows.count(t, q),)),
            labels,
            None if closing is None else _closing(closing, labels),
            None if lengths is None else _lengths(lengths, self.n),
            _truth("check_derivatives", check_derivatives),
        )
        super().__init__(core, labels, labels)
        self.core = core

    def assemble(
        self, q0: ArrayLike, v0: ArrayLike | None = None, *, t: float = 0.0, tolerance: float = 1e-12
    ) -> State:
        """Compute the state that satisfies the constraints and is nearest to q0 (n,) and v0 (n,) (None: at rest) at
        `t`.

        Raises `AssemblyError` if the constraints cannot be met from there.

        >>> import numpy as np
        >>> import partita as pt
        >>> ring = pt.System(
        ...     n=2,
        ...     mass=np.eye(2),
        ...     forces=(0.0, 0.0),
        ...     constraints=lambda t, q: [q @ q - 1],
        ...     jacobian=lambda t, q: [2 * q],
        ...     bias=lambda t, q, v: [2 * v @ v],
        ... )
        >>> bool(abs(np.linalg.norm(ring.assemble([3.0, 4.0]).q) - 1) < 1e-12)
        True
        """
        q, v = self._q(q0), self._v(np.zeros(self.n) if v0 is None else v0)
        limit = run_options.positive("tolerance", tolerance)
        time = State(t, [], []).t
        closed, speeds, report = self.core.assemble(time, q, v, [], [], limit)
        return State(time, closed, speeds, layout=self._layout(), assembly=json.loads(report))

    def summary(self, t: float, q: ArrayLike) -> dict[str, Any]:
        """Names and sizes as plain data, like the summary of a mechanism (without bodies and joints)."""
        position, t = self._q(q), State(t, [], []).t
        rows = self._rows.count(t, position)
        kept = (
            _core.choose(self.core.mass_matrix(t, position), self.core.jacobian(t, position), 1.0, None)["rows"]
            if rows
            else ()
        )
        rank = len(kept)
        return {
            "name": "system",
            "planar": False,
            "nq": self.n,
            "nv": self.n,
            "rows": rows,
            "rank": rank,
            "mobility": self.n - rank,
            "joint_rows": rows,
            "joint_rank": rank,
            "bodies": [],
            "joints": [],
            "coordinates": self.names,
            "velocities": self.velocity_names,
            "rows_names": [f"constraint {row}" for row in range(rows)],
            "removed": [],
            "notes": [],
        }

    def _layout(self) -> Layout:
        layout = Layout()
        layout.names, layout.velocity_names = self.names, self.velocity_names
        return layout

    def __repr__(self) -> str:
        return f"System({self.n} coordinates: {', '.join(self.names)})"


def simulate(
    system: System,
    duration: Quantity,
    q0: ArrayLike | None = None,
    v0: ArrayLike | None = None,
    *,
    t_eval: ArrayLike | None = None,
    initial: State | None = None,
    t0: float = 0.0,
    rtol: float = 1e-8,
    atol: float = 1e-10,
    method: str = "dop853",
    progress: Any = False,
    correction: str = "partition",
    switch_threshold: float = 1.25,
    step: Quantity | None = None,
    max_step: Quantity | None = None,
    max_steps: int = 10_000_000,
    independent: Iterable[str] | None = None,
    solver: Solver | None = None,
    compiled: bool | str = "auto",
    events: Iterable[Any] | None = None,
) -> Result:
    """Compute the motion of a `System` over `duration` seconds; for a mechanism call its own `simulate`.

    Args:
        system: the equations.
        duration: length of the run [s].
        q0, v0: initial state (n,), which must satisfy the constraints; or give `initial`, a state from
            `System.assemble`.
        t0: initial time [s]; with `initial` its time is used.
        events: a list of `pt.Event` of functions f(t, state), or of such functions.

    The other options, their defaults, the result and the errors are those of `Mechanism.simulate`.

    >>> import numpy as np
    >>> import partita as pt
    >>> spring = pt.System(1, mass=[[1.0]], forces=lambda t, q, v: -4.0 * q)
    >>> run = pt.simulate(spring, 1.0, [1.0], [0.0], rtol=1e-10)
    >>> bool(abs(run.q[-1, 0] - np.cos(2.0)) < 1e-8)
    True
    """
    from .results import Result

    if not isinstance(system, System):
        hint = "; call its own method: mechanism.simulate(duration)" if hasattr(system, "simulate") else ""
        raise ArgumentError(f"simulate works on a System, not on {type(system).__name__}{hint}", argument="system")
    check_not_ending()
    start = _start(system, q0, v0, t0, initial)
    chosen = run_options.options(
        start.t,
        duration,
        system.velocity_names,
        rtol=rtol,
        atol=atol,
        method=method,
        correction=correction,
        switch_threshold=switch_threshold,
        step=step,
        max_step=max_step,
        max_steps=max_steps,
        independent=independent,
        solver=solver,
        compiled=compiled,
    )
    times = run_options.output_times(t_eval, start.t, chosen["t_end"])
    summary = system.summary(start.t, start.q)
    watched = of_functions(events, system._layout())
    followed, names = (None, ()) if watched is None else (watched.core, watched.names)
    raw = run_options.run(system.core, chosen, times, start.q, start.v, progress, solver, followed)
    return Result.from_run(raw, model=system.core, summary=summary, options=dict(chosen), events=names)


def _start(system: System, q0: ArrayLike | None, v0: ArrayLike | None, t0: float, initial: State | None) -> State:
    """The initial state, given in one of two forms."""
    if initial is not None:
        if q0 is not None or v0 is not None:
            raise ArgumentError("give either q0 and v0 or initial, not both", argument="initial")
        if not isinstance(initial, State):
            raise ArgumentError(
                f"initial must be a State, not {type(initial).__name__}; use q0 and v0 for arrays",
                argument="initial",
            )
        t0, q0, v0 = initial.t, initial.q, initial.v
    if q0 is None or v0 is None:
        missing = "q0" if q0 is None else "v0"
        raise ArgumentError(
            f"{missing} is missing: a run needs the coordinates and the velocities at its start",
            argument=missing,
        )
    q, v = checked("q0", q0, system.n, system.names), checked("v0", v0, system.n, system.velocity_names)
    return State(t0, q, v, layout=system._layout())


class _Rows:
    """The number of constraint rows: that of the Jacobian, which must not change."""

    def __init__(self, jacobian: Function | None, n: int) -> None:
        self._function, self._n = jacobian, n
        self._count = 0 if jacobian is None else None
        self._positions: int | None = None

    def jacobian(self, t: float, q: Array) -> Array:
        """C (m, n), checked."""
        if self._function is None:
            return np.zeros((0, self._n))
        array = _array("jacobian", self._function(t, q), t)
        if array.size == 0:
            array = array.reshape(0, self._n)
        rows = array.shape[0] if self._count is None else self._count
        wanted = (rows, self._n)
        if array.shape != wanted:
            raise _evaluation("jacobian", t, f"returned shape {array.shape} instead of {wanted}")
        self._count = array.shape[0]
        return _all_finite("jacobian", array, t)

    def count(self, t: float, q: Array) -> int:
        """m."""
        if self._count is None:
            self.jacobian(t, q)
        return self._count or 0

    def positions(self, constraints: Function | None) -> Function:
        """Phi (p,), checked: p <= m, always the same."""

        def call(t: float, q: Array) -> Array:
            if constraints is None:
                return np.zeros(0)
            array = _array("constraints", constraints(t, q), t)
            rows = self.count(t, q)
            if array.ndim != 1 or array.size > rows or self._positions not in (None, array.size):
                limit = (
                    f"{self._positions}" if self._positions is not None else f"at most {rows}, the rows of the jacobian"
                )
                raise _evaluation("constraints", t, f"returned shape {array.shape}; it must be a flat array of {limit}")
            self._positions = array.size
            return _all_finite("constraints", array, t)

        return call


def _checked(what: str, function: Function | ArrayLike, shape: Function, test: Function | None = None) -> Function:
    """`function` with its result checked at each call; a constant array becomes a function."""
    if not callable(function):
        constant = _constant(what, function)
        if test is not None:
            test(constant, 0.0)
        original: Function = lambda *arguments: constant  # noqa: E731
    else:
        original = function

    def call(t: float, *arguments: Array) -> Array:
        array = _array(what, original(t, *arguments), t)
        wanted = shape(t, *arguments)
        if array.shape != wanted:
            raise _evaluation(what, t, f"returned shape {array.shape} instead of {wanted}")
        _all_finite(what, array, t)
        if test is not None:
            test(array, t)
        return array

    return call


def _closing(closing: Any, labels: list[str]) -> tuple[Function, list[int]]:
    """The function of an explicit closing, checked, and the indices of the coordinates that it gives."""
    try:
        names, function = closing
        names = [names] if isinstance(names, str) else [str(name) for name in names]
    except (TypeError, ValueError):
        _refuse(f"closing must be a pair (names of dependent coordinates, function), not {shown(closing)}")
    dependent = list(names)
    unknown = [name for name in dependent if name not in labels]
    if unknown or len(set(dependent)) != len(dependent) or not dependent or not callable(function):
        _refuse(
            f"closing names {', '.join(dependent) or 'no coordinates'}; they must be different ones of "
            f"{', '.join(labels)}, followed by a function of (t, q)"
        )
    count = len(dependent)
    return _checked("closing", function, lambda t, q: (count,)), [labels.index(name) for name in dependent]


def _lengths(lengths: Any, n: int) -> list[float]:
    """n lengths above zero."""
    try:
        array = np.broadcast_to(floats(lengths), (n,))
    except (TypeError, ValueError):
        _refuse(f"lengths must be a number or {n} numbers, not {shown(lengths)}")
    if not (np.isfinite(array).all() and (array > 0.0).all()):
        _refuse(f"lengths are {shown(array.tolist())}; they must be finite and greater than zero")
    return [float(x) for x in array]


def _truth(what: str, value: Any) -> bool:
    if not isinstance(value, bool | np.bool_):
        _refuse(f"{what} is {shown(value)}; it must be True or False")
    return bool(value)


def _constant(what: str, values: Any) -> Array:
    try:
        array = floats(values)
    except TypeError:
        _refuse(f"{what} must be a function or an array of numbers, not {shown(values)}")
    if not np.isfinite(array).all():
        _refuse(f"{what} contains NaN or infinity; give finite numbers")
    return array


def _array(what: str, values: Any, t: float) -> Array:
    try:
        return floats(values)
    except TypeError as error:
        raise _evaluation(what, t, f"returned {shown(values)}, which is not an array of numbers") from error


def _all_finite(what: str, array: Array, t: float) -> Array:
    if not np.isfinite(array).all():
        where = np.argwhere(~np.isfinite(array))[0].tolist()
        raise _evaluation(what, t, f"returned {array[tuple(where)]} at index {where}")
    return array


def _symmetric(mass: Array, t: float) -> None:
    if mass.ndim == 2 and mass.shape[0] == mass.shape[1]:
        skew = float(np.max(np.abs(mass - mass.T)))
        if skew > EQUAL * float(np.max(np.abs(mass))):
            raise _evaluation(
                "mass",
                t,
                f"returned a matrix that is not symmetric: entries across the diagonal differ by {skew:.3g}",
            )


def _evaluation(what: str, t: float, sentence: str) -> EvaluationError:
    return EvaluationError(f"system function {what} at t = {t:g} s {sentence}", t=t, where=what)


def _names(names: Iterable[str] | None, n: int) -> list[str]:
    """n different names."""
    if names is None:
        return [f"q{i}" for i in range(n)]
    if not is_list(names):
        _refuse(f"names must be a list of {n} different texts, not {shown(names)}")
    labels = [str(name) for name in names]
    if len(labels) != n or len(set(labels)) != n or not all(label.strip() for label in labels):
        _refuse(f"names must be {n} different texts, not {labels}")
    return labels


def _refuse(sentence: str) -> NoReturn:
    raise DescriptionError(f"system: {sentence}", element="system", name="system")
