"""The equations as functions of JAX: Python source with one line for each operation, made once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from math import prod
from typing import Any

from ..errors import ArgumentError
from ..extras import extra
from .recorded import Recorded, Replayed
from .tape import Entry, Tape, unselected

_MOTION = ("t", "x", "u", "p")
_RESIDUAL = ("t", "q", "v", "u", "p")

_LINES = {
    "add": "{0} + {1}",
    "sub": "{0} - {1}",
    "mul": "{0} * {1}",
    "div": "{0} / {1}",
    "over_or_zero": "over_or({0}, {1}, 0.0)",
    "neg": "-{0}",
    "sqrt": "root({0})",
    "power": "power({0}, {c})",
    "sin": "jnp.sin({0})",
    "cos": "jnp.cos({0})",
    "atan2": "angle({0}, {1})",
    "hypot": "root({0} * {0} + {1} * {1})",
    "abs": "jnp.abs({0})",
    "round": "jnp.sign({0}) * jnp.floor(jnp.abs({0}) + 0.5)",
    "max": "jnp.maximum({0}, {1})",
    "min": "jnp.minimum({0}, {1})",
    "where_positive": "jnp.where({0} > 0.0, {1}, {2})",
    "reached": "jnp.where({0} >= {c}, 1.0, -1.0)",
    "scale": "{0} * {c}",
}
_UNSELECTED = {"div": "over_or({0}, {1}, jnp.inf)"}


class JaxEquations(Replayed):
    """Equations of motion as pure JAX functions in 64 bits, made by `Mechanism.to_jax`: for `jit`, `vmap`, `grad` and
    engines built on them.

    The state x = (q, v_I) holds all coordinates and the independent velocities: `rates` is an ordinary differential
    equation whose solutions stay closed if they begin closed. u and p may be left out: then they are `u0` and `p0`.

        rates(t, x, u, p)         x' = (q', v_I')
        velocities(t, x, u, p)    v, all velocities (nv,)
        close(t, x, u, p)         x with one Newton correction of the dependent coordinates (34)
        further(t, x, u, p)       the outputs requested: name -> array
        residual(t, q, v, u, p)   M, h, C, a, b, phi, qdot: name -> array

    Names, sizes and present values are those of `Replayed`: `q_names`, `v_names`, `independent`, `state_names`,
    `inputs`, `parameters`, `outputs`, `t0`, `x0`, `u0`, `p0`, and `state(state)` is the x of a `State`."""

    def __init__(self, recorded: Recorded, closing_rate: float = 0.0) -> None:
        jax = extra("jax", "jax", "to_jax")
        self._jnp = extra("jax.numpy", "jax", "to_jax")
        if not jax.config.jax_enable_x64:
            raise ArgumentError(
                "JAX computes with 32 bits, in which loops do not stay closed; before, call "
                'jax.config.update("jax_enable_x64", True)',
                argument="jax_enable_x64",
            )
        super().__init__(recorded, closing_rate)

    def rates(self, t: Any, x: Any, u: Any = None, p: Any = None) -> Any:
        """x' = (q', v_I') at (t, x, u, p)."""
        return self._rates(*self._given(_MOTION, (t, x, u, p)))

    def velocities(self, t: Any, x: Any, u: Any = None, p: Any = None) -> Any:
        """v, all velocities, at (t, x, u, p)."""
        return self._velocities(*self._given(_MOTION, (t, x, u, p)))

    def close(self, t: Any, x: Any, u: Any = None, p: Any = None) -> Any:
        """x with one Newton correction of the dependent coordinates (34) and quaternions of unit length. Its error is
        the square of the one before: once after each step keeps loops closed."""
        given = self._given(_MOTION, (t, x, u, p))
        return self._jnp.concatenate([self._closed(*given), given[1][len(self.q_names) :]])

    def further(self, t: Any, x: Any, u: Any = None, p: Any = None) -> dict[str, Any]:
        """The outputs requested, by name."""
        values = self._further(*self._given(_MOTION, (t, x, u, p)))
        found, first = dict[str, Any](), 0
        for output in self._recorded.outputs:
            count = prod(output.shape)
            found[output.name] = values[first : first + count].reshape(output.shape)
            first += count
        return found

    def residual(self, t: Any, q: Any, v: Any, u: Any = None, p: Any = None) -> dict[str, Any]:
        """M, h, C, a, b, phi and q' = N(q) v of M v' = h + C^T lambda, C v + a = 0, C v' + b = 0, phi = 0."""
        values = self._residual(*self._given(_RESIDUAL, (t, q, v, u, p)))
        found, nv = dict[str, Any](), len(self.v_names)
        for name, (first, count) in self._recorded.tapes["residual"].spans.items():
            values = values[first : first + count]
            found[name] = values.reshape(-1, nv) if name in ("M", "C") else values
        return found

    def _given(self, names: Sequence[str], values: Sequence[Any]) -> list[Any]:
        """The arguments as arrays of their sizes; u and p as recorded where they are None."""
        found = []
        for name, value in zip(names, values, strict=True):
            if value is None and name in ("u", "p"):
                value = self.u0 if name == "u" else self.p0
            array, size = self._jnp.asarray(value), self._recorded.sizes[name]
            shape = () if size is None else (size,)
            if array.shape != shape:
                raise ArgumentError(f"{name} has the shape {array.shape}, not {shape}", argument=name)
            found.append(array)
        return found

    def _made(self, name: str, tape_name: str, entries: Callable[[Tape], list[int]]) -> Any:
        tape = self._recorded.tapes[tape_name]
        names = _RESIDUAL if tape_name == "residual" else _MOTION
        text = source(name, tape, entries(tape), [(x, self._recorded.sizes[x]) for x in names])
        space = helpers(self._jnp)
        for i, table in enumerate(tape.tables):
            # arrays of JAX made while a function is traced would belong to that trace
            space |= {f"breaks{i}": table.breaks, f"rows{i}": table.numbers}
        exec(compile(text, f"<{name} of {self._recorded.mechanism}>", "exec"), space)
        return space[name]

    @cached_property
    def _rates(self) -> Any:
        rate, nq = self._closing_rate, len(self.q_names)

        def entries(tape: Tape) -> list[int]:
            return [i for part in ("qdot", "udot", *(("closing",) if rate else ())) for i in tape.of_part(part)]

        whole = self._made("rates", "motion", entries)
        if not rate:
            return whole
        size = len(self.x0)

        def corrected(t: Any, x: Any, u: Any, p: Any) -> Any:
            values = whole(t, x, u, p)
            return values[:size].at[:nq].add(rate * values[size:])

        return corrected

    @cached_property
    def _velocities(self) -> Any:
        return self._made("velocities", "motion", lambda tape: tape.of_part("v"))

    @cached_property
    def _closed(self) -> Any:
        return self._made("close", "closed", lambda tape: tape.of_part("q"))

    @cached_property
    def _further(self) -> Any:
        def entries(tape: Tape) -> list[int]:
            found = list[int]()
            for output in self._recorded.outputs:
                part = tape.of_part(output.part)
                found += part[output.first : output.first + prod(output.shape)]
            return found

        return self._made("further", "motion", entries)

    @cached_property
    def _residual(self) -> Any:
        return self._made("residual", "residual", lambda tape: [int(i) for i in tape.outputs])


def source(name: str, tape: Tape, wanted: list[int], arguments: Sequence[tuple[str, int | None]]) -> str:
    """A function of these arguments that returns the entries wanted as one array."""
    lines = [f"def {name}({', '.join(x for x, _ in arguments)}):"]
    inputs = list[str]()
    for argument, size in arguments:
        if size is None:
            inputs.append(argument)
        elif size:
            own = [f"{argument}{i}" for i in range(size)]
            lines.append(f"    {', '.join(own)}, = {argument}")
            inputs += own
    entries = list(tape.needed(wanted))
    aside = unselected(entries)
    names, rows = dict[int, str](), dict[tuple[str, int], str]()
    for entry in entries:
        if entry.operation == "input":
            names[entry.number] = inputs[int(entry.constant)]
        elif entry.operation == "constant":
            names[entry.number] = _number(entry.constant)
        elif entry.operation == "interval":
            key = names[entry.operands[0]], entry.table
            if key not in rows:
                rows[key] = f"r{entry.number}"
                lines.append(f"    {rows[key]} = asarray(rows{entry.table})[jnp.sum({key[0]} >= breaks{entry.table})]")
            names[entry.number] = f"e{entry.number}"
            lines.append(f"    e{entry.number} = {rows[key]}[{int(entry.constant)}]")
        else:
            names[entry.number] = f"e{entry.number}"
            lines.append(f"    e{entry.number} = {_line(entry, names, entry.number in aside)}")
    results = ", ".join(f"asarray({names[i]}, float)" for i in wanted)
    lines.append(f"    return jnp.stack([{results}])" if wanted else "    return jnp.zeros(0)")
    return "\n".join(lines) + "\n"


def _number(x: float) -> str:
    text = {float("inf"): "jnp.inf", float("-inf"): "(-jnp.inf)"}.get(x, repr(x) if x == x else "jnp.nan")
    return f"({text})" if text.startswith("-") else text


def _line(entry: Entry, names: dict[int, str], aside: bool) -> str:
    form = _UNSELECTED.get(entry.operation) if aside else None
    operands = [names[i] for i in entry.operands]
    return (form or _LINES[entry.operation]).format(*operands, c=_number(entry.constant))


def helpers(jnp: Any) -> dict[str, Any]:
    """What the source calls. Where a choice leaves a value aside that has no derivative, 0 times that would be no
    number: such operands are replaced before, and the result after."""

    def over_or(x: Any, y: Any, other: float) -> Any:
        zero = y == 0.0
        return jnp.where(zero, other, x / jnp.where(zero, 1.0, y))

    def root(x: Any) -> Any:
        """The slope at 0 is 0."""
        zero = x == 0.0
        return jnp.where(zero, 0.0, jnp.sqrt(jnp.where(zero, 1.0, x)))

    def power(x: Any, exponent: float) -> Any:
        positive = x > 0.0
        return jnp.where(positive, jnp.where(positive, x, 1.0) ** exponent, 0.0)

    def angle(y: Any, x: Any) -> Any:
        zero = (x == 0.0) & (y == 0.0)
        return jnp.arctan2(y, jnp.where(zero, 1.0, x))

    return {"jnp": jnp, "asarray": jnp.asarray, "over_or": over_or, "root": root, "power": power, "angle": angle}
