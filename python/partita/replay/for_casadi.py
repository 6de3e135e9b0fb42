"""The equations as functions of CasADi."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cached_property
from math import prod
from typing import Any

from ..extras import extra
from .recorded import Recorded, Replayed
from .tape import Entry

_RESIDUAL = ("M", "h", "C", "a", "b", "phi", "qdot")


class CasadiEquations(Replayed):
    """Equations of motion as CasADi functions, made by `Mechanism.export_casadi`. All are expanded (SX), so CasADi
    takes their derivatives of any order itself, and `generate` writes C.

    The state x = (q, v_I) holds all coordinates and the independent velocities: `rates` is an ordinary differential
    equation whose solutions stay closed if they begin closed.

    Attributes:
        rates: Function (t, x, u, p) -> xdot = (q', v_I').
        velocities: Function (t, x, u, p) -> v, all velocities (nv,).
        close: Function (t, x, u, p) -> x with one Newton correction of the dependent coordinates (34), quaternions of
            unit length.
        further: Function (t, x, u, p) -> the outputs requested, each named with _ for what is no letter or digit.
        residual: Function (t, q, v, u, p) -> M, h, C, a, b, phi, qdot: M v' = h + C^T lambda, C v + a = 0,
            C v' + b = 0, phi = 0. q and v are all coordinates and velocities, as variables with constraints.
        dae: {"t", "x", "u", "p", "ode"} for `casadi.integrator`.

    Names, sizes and present values are those of `Replayed`: `q_names`, `v_names`, `independent`, `state_names`,
    `inputs`, `parameters`, `outputs`, `t0`, `x0`, `u0`, `p0`, and `state(state)` is the x of a `State`."""

    def __init__(self, recorded: Recorded, closing_rate: float = 0.0) -> None:
        self._casadi = extra("casadi", "casadi", "export_casadi")
        super().__init__(recorded, closing_rate)

    @cached_property
    def _arguments(self) -> dict[str, Any]:
        sym = self._casadi.SX.sym
        return {name: sym(name, 1 if size is None else size) for name, size in self._recorded.sizes.items()}

    def _scalars(self, names: Sequence[str]) -> list[Any]:
        return [x for name in names for x in self._casadi.vertsplit(self._arguments[name])]

    def _function(self, name: str, arguments: Sequence[str], results: dict[str, Any]) -> Any:
        given = [self._arguments[x] for x in arguments]
        return self._casadi.Function(name, given, list(results.values()), list(arguments), list(results))

    def _column(self, values: Sequence[Any]) -> Any:
        return self._casadi.vertcat(*values) if values else self._casadi.SX(0, 1)

    def _replayed(self, tape_name: str, wanted: list[int]) -> list[Any]:
        names = ("t", "q", "v", "u", "p") if tape_name == "residual" else ("t", "x", "u", "p")
        return self._recorded.tapes[tape_name].replayed(wanted, self._scalars(names), self._applied)

    def _applied(self, entry: Entry, x: list[Any], unselected: bool) -> Any:
        return applied(self._casadi, entry, x, unselected)

    def _of_motion(self, *parts: str) -> list[list[Any]]:
        tape = self._recorded.tapes["motion"]
        entries = [tape.of_part(part) for part in parts]
        values = iter(self._replayed("motion", [i for part in entries for i in part]))
        return [[next(values) for _ in part] for part in entries]

    @cached_property
    def dae(self) -> dict[str, Any]:
        """t, x, u, p and ode = x', as `casadi.integrator` takes them."""
        motion = dict(zip(("qdot", "udot", "closing"), self._of_motion("qdot", "udot", "closing"), strict=True))
        qdot = motion["qdot"]
        if self._closing_rate:
            qdot = [x + self._closing_rate * back for x, back in zip(qdot, motion["closing"], strict=True)]
        ode = [*qdot, *motion["udot"]]
        return {**{name: self._arguments[name] for name in ("t", "x", "u", "p")}, "ode": self._column(ode)}

    @cached_property
    def rates(self) -> Any:
        """(t, x, u, p) -> x'."""
        return self._function("rates", ("t", "x", "u", "p"), {"xdot": self.dae["ode"]})

    @cached_property
    def velocities(self) -> Any:
        """(t, x, u, p) -> v."""
        return self._function("velocities", ("t", "x", "u", "p"), {"v": self._column(self._of_motion("v")[0])})

    @cached_property
    def close(self) -> Any:
        """(t, x, u, p) -> x, closed better."""
        q = self._replayed("closed", self._recorded.tapes["closed"].of_part("q"))
        rest = self._arguments["x"][len(q) :]
        return self._function("close", ("t", "x", "u", "p"), {"closed": self._casadi.vertcat(*q, rest)})

    @cached_property
    def further(self) -> Any:
        """(t, x, u, p) -> the outputs requested."""
        results = dict[str, Any]()
        parts = dict.fromkeys(output.part for output in self._recorded.outputs)
        values = dict(zip(parts, self._of_motion(*parts), strict=True))
        for output in self._recorded.outputs:
            column = self._column(values[output.part][output.first : output.first + prod(output.shape)])
            if len(output.shape) == 2:
                column = self._casadi.reshape(column, output.shape[1], output.shape[0]).T
            results[_identifier(output.name, results)] = column
        return self._function("further", ("t", "x", "u", "p"), results)

    @cached_property
    def residual(self) -> Any:
        """(t, q, v, u, p) -> M, h, C, a, b, phi, qdot."""
        tape, nv = self._recorded.tapes["residual"], len(self.v_names)
        entries = {part: tape.of_part(part) for part in _RESIDUAL}
        values = iter(self._replayed("residual", [i for part in entries.values() for i in part]))
        results = {part: self._column([next(values) for _ in own]) for part, own in entries.items()}
        for part in ("M", "C"):
            rows = len(entries[part]) // nv
            results[part] = self._casadi.sparsify(self._casadi.reshape(results[part], nv, rows).T)
        return self._function("residual", ("t", "q", "v", "u", "p"), results)


def _identifier(name: str, taken: dict[str, Any]) -> str:
    """A name as CasADi takes it: letters, digits and single underscores, a letter first."""
    found = re.sub(r"_+", "_", re.sub(r"[^A-Za-z0-9]", "_", name)).strip("_")
    found = found if found[:1].isalpha() else f"y_{found}".rstrip("_")
    number, free = 2, found
    while free in taken:
        free, number = f"{found}_{number}", number + 1
    return free


def applied(ca: Any, entry: Entry, x: list[Any], unselected: bool) -> Any:
    """One operation over SX. Where a choice leaves a value aside that has no derivative, 0 times that would be no
    number: such operands are replaced before."""
    match entry.operation:
        case "add":
            return x[0] + x[1]
        case "sub":
            return x[0] - x[1]
        case "mul":
            return x[0] * x[1]
        case "div" if unselected:
            zero = x[1] == 0
            return ca.if_else(zero, ca.inf, x[0] / ca.if_else(zero, 1, x[1]))
        case "div":
            return x[0] / x[1]
        case "over_or_zero":
            zero = x[1] == 0
            return ca.if_else(zero, 0, x[0] / ca.if_else(zero, 1, x[1]))
        case "neg":
            return -x[0]
        case "sqrt":
            return _root(ca, x[0])
        case "power":
            positive = x[0] > 0
            return ca.if_else(positive, ca.if_else(positive, x[0], 1) ** entry.constant, 0)
        case "sin":
            return ca.sin(x[0])
        case "cos":
            return ca.cos(x[0])
        case "atan2":
            zero = ca.logic_and(x[0] == 0, x[1] == 0)
            return ca.atan2(x[0], ca.if_else(zero, 1, x[1]))
        case "hypot":
            return _root(ca, x[0] * x[0] + x[1] * x[1])
        case "abs":
            return ca.fabs(x[0])
        case "round":
            return ca.sign(x[0]) * ca.floor(ca.fabs(x[0]) + 0.5)
        case "max":
            return ca.fmax(x[0], x[1])
        case "min":
            return ca.fmin(x[0], x[1])
        case "where_positive":
            return ca.if_else(x[0] > 0, x[1], x[2])
        case "reached":
            return ca.if_else(x[0] >= entry.constant, 1, -1)
        case "scale":
            return x[0] * entry.constant
        case "interval":
            at, breaks, (found, *numbers) = x
            for start, number in zip(breaks, numbers, strict=True):
                found = ca.if_else(at >= start, number, found)
            return found
    raise AssertionError(f"the core records {entry.operation!r}, which has no form here")


def _root(ca: Any, x: Any) -> Any:
    """The square root, with the slope 0 at 0."""
    zero = x == 0
    return ca.if_else(zero, 0, ca.sqrt(ca.if_else(zero, 1, x)))
