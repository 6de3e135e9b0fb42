"""The equations in symbols of SymPy."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import ArgumentError
from ..extras import extra
from ..numeric import shown
from .recorded import Array, Recorded, Replayed
from .tape import Entry

MOST_WRITTEN = 200_000
"""Operations of all formulas written out, at most. Reason: a hundred pages; the squeezer of seven bodies has 3600."""
MOST_SIMPLIFIED = 4000
"""Operations of a formula that is simplified, at most. Reason: products of sums are multiplied out first, which takes
seconds from there on."""
MOST_DISPLAYED = 8000
"""Operations of the formulas that a notebook displays of its own accord, at most. Reason: browsers need seconds for
more."""
DIGITS = 12
"""Significant digits of a number in formulas. Reason: a constant that the core has computed is exact to 15 or 16."""
NO_NUMBER = 1e-14
"""Constants below this are 0. Scale: the numbers of a mechanism in SI units. Reason: cosines of right angles and
differences of equal numbers are rounding errors of numbers of size 1."""
SHORT = 8
"""Numbers with at most so many characters are written as fractions."""
_FIELDS = {"mass": "m", "inertia": "I", "com": "c", "stiffness": "k", "damping": "d", "length": "l", "radius": "r"}
_AXES = "xyz"


class SympyEquations(Replayed):
    r"""Equations of motion in symbols, made by `Mechanism.to_sympy`: M v' = h + C^T lambda, C v + a = 0, C v' + b = 0,
    Phi = 0. A notebook displays them as formulas.

    Attributes:
        M: mass matrix (nv, nv). h: applied and velocity-dependent forces (nv, 1).
        C: constraint Jacobian (rows, nv). a, b: (rows, 1). Phi: closure errors (holonomic rows, 1).
        qdot: q' = N(q) v (nq, 1).
        t, q, v, vdot, multipliers: symbols; all but t are lists.
        u: symbols of the inputs, in the order of `inputs`.
        symbols: parameter -> its symbols or numbers, a list of as many as it has.
        values: symbol -> present value of every symbol that stands for a parameter or an input, for `subs`."""

    M: Any
    h: Any
    C: Any
    a: Any
    b: Any
    Phi: Any
    qdot: Any

    def __init__(self, recorded: Recorded, chosen: Mapping[str, Any], present: Mapping[str, Array], neat: bool) -> None:
        sp = extra("sympy", "sympy", "to_sympy")
        super().__init__(recorded, 0.0)
        self._sympy, self._rows = sp, recorded.rows
        tape = recorded.tapes["residual"]
        written = tape.written()
        self._written = sum(written)
        if self._written > MOST_WRITTEN:
            raise ArgumentError(
                f"the equations of {recorded.mechanism!r} have {self._written:.1g} operations when they are written "
                f"out (at most {MOST_WRITTEN}): no page holds them. export_casadi and to_jax take any mechanism",
                argument="mechanism",
            )
        self.t = sp.Symbol("t", real=True)
        self.q = [self._real("q", name) for name in self.q_names]
        is_rate = len(self.q_names) == len(self.v_names)
        self.v = [self._real(r"\dot{q}" if is_rate else "v", name) for name in self.v_names]
        self.vdot = [self._real(r"\ddot{q}" if is_rate else r"\dot{v}", name) for name in self.v_names]
        self.multipliers = [self._real(r"\lambda", str(i + 1)) for i in range(len(recorded.rows))]
        self.u = [self._real("u", name) for name in self.inputs]
        self.values: dict[Any, float] = dict(zip(self.u, recorded.u0.tolist(), strict=True))
        self.symbols: dict[str, list[Any]] = {}
        numbers = list[Any]()
        for name, values in present.items():
            self.symbols[name] = self._symbols(name, values, chosen[name])
            numbers += self.symbols[name]
        inputs = [self.t, *self.q, *self.v, *self.u, *numbers]
        entries = tape.replayed([int(i) for i in tape.outputs], inputs, self._applied)
        nv = len(self.v_names)
        for name, (first, size) in tape.spans.items():
            sizes = written[first : first + size]
            neatly = [neat and count <= MOST_SIMPLIFIED for count in sizes]
            own = [
                self._neat(x) if one else self._plain(x)
                for x, one in zip(entries[first : first + size], neatly, strict=True)
            ]
            rows, columns = (size // nv, nv) if name in ("M", "C") else (size, 1)
            setattr(self, "Phi" if name == "phi" else name, sp.Matrix(rows, columns, own))

    def _real(self, letter: str, name: str) -> Any:
        return self._sympy.Symbol(_indexed(letter, name), real=True)

    def _symbols(self, name: str, values: Array, wanted: Any) -> list[Any]:
        """A symbol or a number for each number of a parameter."""
        sp = self._sympy
        if wanted is not None:
            given = (
                list(wanted) if isinstance(wanted, Sequence | np.ndarray) and not isinstance(wanted, str) else [wanted]
            )
            if len(given) != len(values):
                raise ArgumentError(
                    f"symbols: {name} has {len(values)} numbers, {shown(wanted)} has {len(given)}", argument="symbols"
                )
            made = []
            for x, value in zip(given, values.tolist(), strict=True):
                sign = -1 if isinstance(x, str) and x.startswith("-") else 1
                symbol = sp.Symbol(x.removeprefix("-"), real=True) if isinstance(x, str) else sp.sympify(x)
                if symbol.is_Symbol:
                    self.values[symbol] = sign * value
                made.append(sign * symbol)
            return made
        owner, _, field = name.rpartition(".")
        # what is 0 in the drawing stays 0, and the one direction of gravity gives its sign
        made = []
        for i, value in enumerate(values.tolist()):
            if value == 0.0:
                made.append(sp.Integer(0))
                continue
            letter, index = _FIELDS.get(field, field) if owner else "g", owner
            if len(values) == 3 and np.count_nonzero(values) > 1:
                index = f"{owner} {_AXES[i]}".strip()
            elif len(values) == 9:
                i, k = sorted(divmod(i, 3))
                index = f"{owner} {_AXES[i]}{_AXES[k]}"
            elif len(values) not in (1, 3):
                index = f"{owner} {i + 1}"
            positive = (not owner or field in ("mass", "stiffness", "length", "radius")) or None
            symbol = sp.Symbol(_indexed(letter, index), real=True, **({"positive": True} if positive else {}))
            falls = not owner and value < 0.0
            self.values[symbol] = -value if falls else value
            made.append(-symbol if falls else symbol)
        return made

    def _exact(self, x: Any) -> Any:
        """A float as the fraction that its digits are: sums of such cancel without rounding."""
        return self._sympy.Rational(repr(x)) if isinstance(x, float) else self._sympy.sympify(x)

    def _rounded(self, x: Any) -> Any:
        """Fractions as short decimal fractions or as floats; what is no number but rounding is left out."""
        sp, found = self._sympy, dict[Any, Any]()
        for number in x.atoms(sp.Rational):
            if abs(number) < NO_NUMBER:
                found[number] = sp.Integer(0)
            elif len(str(number)) > SHORT:
                text = f"{float(number):.{DIGITS}g}"
                found[number] = sp.Rational(text) if len(text) <= SHORT else sp.Float(number, DIGITS)
        return x.xreplace(found)

    def _plain(self, x: Any) -> Any:
        return self._rounded(self._exact(x))

    def _neat(self, x: Any) -> Any:
        """Products of sines and cosines as those of sums of angles, then what all terms have in common before them."""
        sp = self._sympy
        fu = extra("sympy.simplify.fu", "sympy", "to_sympy")
        summed = sp.expand(fu.TR8(sp.expand(self._exact(x))))
        return sp.factor_terms(self._rounded(summed), clear=False)

    def _applied(self, entry: Entry, operands: list[Any], _: bool) -> Any:
        exact = [[self._exact(y) for y in x] if isinstance(x, list) else self._exact(x) for x in operands]
        return applied(self._sympy, entry, exact, self._exact(entry.constant))

    def formulas(self, digits: int = 4) -> list[str]:
        """The equations as LaTeX, formula by formula: M v' = h; with constraints the equations in short, then each of
        their matrices. Decimal numbers are shown with so many digits; the attributes hold more."""
        sp = self._sympy

        def write(matrix: Any) -> str:
            shown = matrix.xreplace({x: sp.Float(x, digits) for x in matrix.atoms(sp.Float)})
            return str(sp.latex(shown, mat_str="bmatrix", mat_delim=""))

        vdot = sp.Matrix(self.vdot)
        if not self.multipliers:
            return [f"{write(self.M)} {write(vdot)} = {write(self.h)}"]
        moves = any(x != 0 for x in self.a)
        conditions = [r"\Phi = 0"] if self.Phi.rows else []
        conditions += [r"C\,v + a = 0"] if moves else []
        first = r",\quad ".join([r"M\,\dot v = h + C^T \lambda", *conditions, r"C\,\dot v + b = 0"])
        named = {r"\dot v": vdot, "M": self.M, "h": self.h, "C": self.C, r"\Phi": self.Phi, "a": self.a, "b": self.b}
        left_out = {name for name, matrix in named.items() if not matrix.rows or (name == "a" and not moves)}
        return [first, *(f"{name} = {write(x)}" for name, x in named.items() if name not in left_out)]

    def latex(self, digits: int = 4) -> str:
        """The formulas below each other."""
        formulas = self.formulas(digits)
        if len(formulas) == 1:
            return formulas[0]
        return r"\begin{aligned} & " + r" \\ & ".join(formulas) + r" \end{aligned}"

    def _repr_latex_(self) -> str | None:
        text = self.latex() if self._written <= MOST_DISPLAYED else None
        return text and f"$\\displaystyle {text}$"


def _indexed(letter: str, name: str) -> str:
    """The name of a symbol as SymPy prints it without change."""
    if not name:
        return letter
    words = re.sub(r"([\\{}$&#_^%~])", " ", name).strip()
    return rf"{letter}_{{\mathrm{{{words}}}}}".replace(" ", r"\ ") if len(words) > 1 else f"{letter}_{{{words}}}"


def applied(sp: Any, entry: Entry, x: list[Any], c: Any) -> Any:
    """One operation over expressions."""
    match entry.operation:
        case "add":
            return x[0] + x[1]
        case "sub":
            return x[0] - x[1]
        case "mul":
            return x[0] * x[1]
        case "div":
            return x[0] / x[1]
        case "over_or_zero":
            return sp.Piecewise((0, sp.Eq(x[1], 0)), (x[0] / x[1], True))
        case "neg":
            return -x[0]
        case "sqrt":
            return sp.sqrt(x[0])
        case "power":
            return x[0] ** c
        case "sin":
            return sp.sin(x[0])
        case "cos":
            return sp.cos(x[0])
        case "atan2":
            return sp.atan2(x[0], x[1])
        case "hypot":
            return sp.sqrt(x[0] ** 2 + x[1] ** 2)
        case "abs":
            return sp.Abs(x[0])
        case "round":
            return sp.sign(x[0]) * sp.floor(sp.Abs(x[0]) + sp.Rational(1, 2))
        case "max":
            return sp.Max(x[0], x[1])
        case "min":
            return sp.Min(x[0], x[1])
        case "where_positive":
            return sp.Piecewise((x[1], x[0] > 0), (x[2], True))
        case "reached":
            return sp.Piecewise((1, x[0] >= c), (-1, True))
        case "scale":
            return x[0] * c
        case "interval":
            at, breaks, numbers = x
            pieces = [(number, at < end) for number, end in zip(numbers, breaks, strict=False)]
            return sp.Piecewise(*pieces, (numbers[-1], True))
    raise AssertionError(f"the core records {entry.operation!r}, which has no form here")
