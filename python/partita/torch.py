"""Runs as functions of PyTorch, with derivatives backwards through the steps (extra `torch`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .extras import extra
from .mechanism.through import Passed, Through, through


def simulate(
    mechanism: Any,
    by: Mapping[Any, Any],
    of: Any,
    *,
    duration: float,
    t_eval: Any = None,
    **options: Any,
) -> Any:
    """Run a mechanism with numbers that are tensors, and return what is observed as a tensor that can be differentiated.

    The run is that of `Mechanism.simulate`, in double precision; `backward()` goes back through its steps once, whatever the
    number of numbers, through loops, exchanges of coordinates, events and impacts. Prefer `Mechanism.gradient` without
    PyTorch.

    Args:
        mechanism: a `Mechanism`.
        by: number -> tensor: a parameter such as "crank.mass", a length such as "coupler.length" [m], `pt.start("A")`,
            `pt.start_rate("A")`.
        of: a sensor, a joint or an expression of sensors whose value is a number, or several.
        duration: of the run [s].
        t_eval: times at which they are observed (nt,); None: the end alone.
        options: of `simulate` (`initial`, `events`, `rtol`, `method`, ...), and `held` (see `Result.sensitivities`).

    Returns:
        A tensor (nt, number of observables), double precision.

    Raises:
        MissingDependencyError: PyTorch is not installed.
        IntegrationError: the run ends early.
        ArgumentError: something has no derivative.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> import torch                                                                    # doctest: +SKIP
    >>> import partita.torch
    >>> w = torch.tensor(0.5, dtype=torch.float64, requires_grad=True)                  # doctest: +SKIP
    >>> angle = partita.torch.simulate(m, {pt.start_rate("A"): w}, "A", duration=1.0)   # doctest: +SKIP
    >>> angle.sum().backward()                                                          # doctest: +SKIP
    """
    torch = extra("torch", "torch", "partita.torch.simulate")
    keys = list(by)
    made = through(mechanism, keys, of, duration, t_eval, options)
    tensors = [torch.as_tensor(by[key], dtype=torch.float64) for key in keys]
    return _function(torch, made).apply(*tensors)


def _function(torch: Any, made: Through) -> Any:
    """The run as a function that PyTorch differentiates."""

    class Run(torch.autograd.Function):  # type: ignore[misc,name-defined]
        """One run, and the way back through it."""

        @staticmethod
        def forward(ctx: Any, *values: Any) -> Any:
            passed = made.forward([value.detach().cpu().numpy() for value in values])
            ctx.passed = passed
            ctx.devices = [value.device for value in values]
            return torch.from_numpy(np.ascontiguousarray(passed.values)).to(values[0].device if values else "cpu")

        @staticmethod
        @torch.autograd.function.once_differentiable
        def backward(ctx: Any, weights: Any) -> Any:
            passed: Passed = ctx.passed
            found = made.back(passed, weights.detach().cpu().numpy())
            return tuple(torch.from_numpy(np.asarray(x)).to(d) for x, d in zip(found, ctx.devices, strict=True))

    return Run
