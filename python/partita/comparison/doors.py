"""Interface of a comparison: `Mechanism.compare`, and `partita.compare` for a `System`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..builder.compiled import Equations
from ..errors import ArgumentError
from ..numeric import shown
from ..options import METHODS, count, one_of, output_times, positive, tolerance
from ..results import Result
from ..state import State
from ..system import System, simulate
from ..tangent import TangentVelocities
from .bench import OUTPUTS, Bench
from .cases import cases
from .comparison import Comparison, carry_out


class Mechanical(Protocol):
    """The comparison of a mechanism."""

    @property
    def name(self) -> str: ...
    @property
    def compile(self) -> Callable[[str], Equations]: ...
    @property
    def assemble(self) -> Callable[..., State]: ...
    @property
    def simulate(self) -> Callable[..., Result]: ...


def compare_mechanism(
    self: Mechanical,
    duration: float | None = None,
    *,
    initial: State | None = None,
    formulations: Iterable[str] | None = None,
    selections: Iterable[str] | None = None,
    corrections: Iterable[str] | None = None,
    rtol: float = 1e-8,
    atol: float = 1e-10,
    method: str = "dop853",
    baumgarte: tuple[float, float] | None = None,
    window: float | None = None,
    tangent: TangentVelocities | None = None,
    max_steps: int | None = None,
    coordinates: str = "relative",
    reference: Result | None = None,
    progress: Any = False,
) -> Comparison:
    """Run every formulation, and "projective" with every rule of choice, from one initial state; one row for each.

    It takes as long as all runs together; the dense formulations cost O(n^3) per evaluation. Ctrl-C keeps the finished
    rows. A run that fails has the reason in its row and does not stop the others.

    Args:
        duration: length of the runs [s]; None: that of `reference`.
        initial: state to start from, as for `simulate`; None: the drawing, assembled, at rest.
        formulations: names as for `simulate`, or of rows ("svd: each step"); None: all, with all variants: frozen
            tangent velocities also renewed at each step, "wehage-haug" also with complete pivoting. A row that needs an
            argument that was not given says which.
        selections: rules for "projective"; None: all.
        corrections: corrections of "projective" after each step, one row for each; None: all if neither
            formulations nor selections are given, otherwise the default.
        rtol, atol, method, coordinates: as for `simulate`, for all runs.
        baumgarte, window, tangent: arguments of "baumgarte", the rule "persistence" and "user-tangent".
        max_steps: after this number of steps a run stops with status "max-steps"; None: ten times the number of the
            reference (fifty times for methods of lower order), at least 2000, which only runs exceed that creep towards
            a position they cannot pass.
        reference: a finished run of this mechanism from the same initial state, from which errors are measured, at its
            outputs; None: "projective" with "dop853" at rtol 1e-13, or at the tightest tolerance that finishes.
        progress: True: a progress bar on the terminal (needs tqdm); or a function of the completed fraction, 0 to 1.

    Raises:
        ArgumentError: an unknown name, no duration, or a reference that did not finish. Errors of `assemble`.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> found = m.compare(0.1, formulations=["projective"], selections=["collective"])
    >>> found.row("projective").status
    'finished'
    """
    start = initial if initial is not None else self.assemble(coordinates=coordinates)
    simulate = partial(self.simulate, initial=start, coordinates=coordinates)
    given = {"baumgarte": baumgarte, "window": window, "tangent": tangent}
    chosen = cases(formulations, selections, given, corrections)
    model = self.compile(coordinates)
    bench = _bench(self.name, simulate, model, start, duration, reference, rtol, atol, method, max_steps, tangent)
    return carry_out(bench, chosen, reference, progress)


def compare(
    system: System,
    duration: float | None = None,
    q0: ArrayLike | None = None,
    v0: ArrayLike | None = None,
    *,
    initial: State | None = None,
    t0: float = 0.0,
    formulations: Iterable[str] | None = None,
    selections: Iterable[str] | None = None,
    corrections: Iterable[str] | None = None,
    rtol: float = 1e-8,
    atol: float = 1e-10,
    method: str = "dop853",
    baumgarte: tuple[float, float] | None = None,
    window: float | None = None,
    tangent: TangentVelocities | None = None,
    max_steps: int | None = None,
    reference: Result | None = None,
    progress: Any = False,
) -> Comparison:
    """Compare formulations on a `System`, from q0 and v0 (n,) at t0 or from `initial`.

    For a mechanism call its own `compare`. Errors are the largest differences of a coordinate; energies are not known.
    Other options, result and errors are those of `Mechanism.compare`.

    >>> import numpy as np
    >>> import partita as pt
    >>> ring = pt.System(
    ...     n=2,
    ...     mass=np.eye(2),
    ...     forces=(0.0, -9.81),
    ...     constraints=lambda t, q: [0.5 * (q @ q - 1.0)],
    ...     jacobian=lambda t, q: [q],
    ...     bias=lambda t, q, v: [v @ v],
    ... )
    >>> found = pt.compare(ring, 0.5, [1.0, 0.0], [0.0, 0.0], formulations=["projective"], selections=["collective"])
    >>> found.row("projective").error < 1e-7
    True
    """
    if not isinstance(system, System):
        hint = "; call its own method: mechanism.compare(duration)" if hasattr(system, "compare") else ""
        raise ArgumentError(f"compare works on a System, not on {type(system).__name__}{hint}", argument="system")
    if initial is not None:
        start, run = initial, partial(simulate, system, initial=initial)
    else:
        if q0 is None or v0 is None:
            missing = "q0" if q0 is None else "v0"
            raise ArgumentError(
                f"{missing} is missing: the runs need coordinates and velocities to start", argument=missing
            )
        start = State(t0, q0, v0, names=system.names)
        run = partial(simulate, system, q0=q0, v0=v0, t0=t0)
    given = {"baumgarte": baumgarte, "window": window, "tangent": tangent}
    chosen = cases(formulations, selections, given, corrections)
    bench = _bench("system", run, system, start, duration, reference, rtol, atol, method, max_steps, tangent)
    return carry_out(bench, chosen, reference, progress)


def _bench(
    title: str,
    simulate: Any,
    equations: Equations,
    start: State,
    duration: float | None,
    reference: Result | None,
    rtol: float,
    atol: float,
    method: str,
    max_steps: int | None,
    tangent: TangentVelocities | None,
) -> Bench:
    """Checked once for all runs, so that a wrong argument is an error and not a table of failures."""
    if not isinstance(start, State):
        raise ArgumentError(
            f"initial must be a State as assemble() returns it, not {type(start).__name__}", argument="initial"
        )
    if reference is not None and not isinstance(reference, Result):
        raise ArgumentError(f"reference must be the Result of a run, not {shown(reference)}", argument="reference")
    if max_steps is not None:
        count(max_steps)
    if reference is not None and not reference.success:
        raise ArgumentError(
            f"reference must be a run that finished; this one ended with {reference.status!r}: {reference.message}",
            argument="reference",
        )
    if duration is None:
        if reference is None:
            raise ArgumentError("give a duration [s], such as 10.0", argument="duration")
        duration = float(reference.t[-1]) - start.t
    span = positive("duration", duration, "s")
    wanted = np.linspace(start.t, start.t + span, OUTPUTS) if reference is None else reference.t
    return Bench(
        title=title,
        simulate=partial(simulate, duration=span),
        equations=equations,
        t_eval=output_times(wanted, start.t, start.t + span),
        duration=span,
        rtol=tolerance("rtol", rtol),
        atol=tolerance("atol", atol),
        method=one_of("method", method, METHODS),
        max_steps=max_steps,
        tangent=tangent,
    )
