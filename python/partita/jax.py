"""Runs as functions of JAX, with derivatives backwards through the steps (extra `jax`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .errors import ArgumentError
from .extras import extra
from .mechanism.through import Passed, through


def simulate(
    mechanism: Any,
    by: Mapping[Any, Any],
    of: Any,
    *,
    duration: float,
    t_eval: Any = None,
    **options: Any,
) -> Any:
    """Run a mechanism with numbers of JAX, and return what is observed as an array that `grad`, `jit` and `vmap` take.

    The run is that of `Mechanism.simulate`, called from JAX on the host; `grad` goes back through its steps once, whatever
    the number of numbers, through loops, exchanges of coordinates, events and impacts. JAX computes in double precision
    where `jax.config.update("jax_enable_x64", True)` was called, which this requires. Prefer `Mechanism.to_jax` for the
    equations alone, which then run on an accelerator; members of `vmap` run one after the other here.

    Args:
        mechanism: a `Mechanism`.
        by: number -> array: a parameter such as "crank.mass", a length such as "coupler.length" [m], `pt.start("A")`,
            `pt.start_rate("A")`.
        of: a sensor, a joint or an expression of sensors whose value is a number, or several.
        duration: of the run [s].
        t_eval: times at which they are observed (nt,); None: the end alone.
        options: of `simulate` (`initial`, `events`, `rtol`, `method`, ...), and `held` (see `Result.sensitivities`).

    Returns:
        An array (nt, number of observables).

    Raises:
        MissingDependencyError: JAX is not installed.
        ArgumentError: JAX computes in single precision, or something has no derivative.
        IntegrationError: the run ends early.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> import jax                                                                      # doctest: +SKIP
    >>> import partita.jax
    >>> jax.config.update("jax_enable_x64", True)                                       # doctest: +SKIP
    >>> def angle(w):
    ...     return partita.jax.simulate(m, {pt.start_rate("A"): w}, "A", duration=1.0)[0, 0]
    >>> jax.grad(angle)(0.5)                                                            # doctest: +SKIP
    """
    jax = extra("jax", "jax", "partita.jax.simulate")
    if not jax.config.jax_enable_x64:
        raise ArgumentError(
            'JAX computes in single precision, which loops and tolerances do not allow; call jax.config.update('
            '"jax_enable_x64", True) before',
            argument="by",
        )
    keys = list(by)
    made = through(mechanism, keys, of, duration, t_eval, options)
    numbers = jax.numpy
    values = [numbers.asarray(by[key], dtype=numbers.float64) for key in keys]
    shape = jax.ShapeDtypeStruct(made.shape, np.float64)
    # the last run, which the way back follows
    last: dict[bytes, Passed] = {}

    def passed(inputs: list[Any]) -> Passed:
        arrays = [np.asarray(x, dtype=float) for x in inputs]
        key = b"".join(x.tobytes() for x in arrays)
        if key not in last:
            found = made.forward(arrays)
            last.clear()
            last[key] = found
        return last[key]

    def there(*inputs: Any) -> Any:
        return np.ascontiguousarray(passed(list(inputs)).values)

    def back(weights: Any, *inputs: Any) -> Any:
        return tuple(made.back(passed(list(inputs)), np.asarray(weights)))

    @jax.custom_vjp
    def run(*inputs: Any) -> Any:
        return jax.pure_callback(there, shape, *inputs, vmap_method="sequential")

    def run_forward(*inputs: Any) -> Any:
        return run(*inputs), inputs

    def run_backward(inputs: Any, weights: Any) -> Any:
        shapes = tuple(jax.ShapeDtypeStruct(x.shape, np.float64) for x in inputs)
        return jax.pure_callback(back, shapes, weights, *inputs, vmap_method="sequential")

    run.defvjp(run_forward, run_backward)
    return run(*values)
