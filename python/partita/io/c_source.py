"""The text of equations in C: a header, and a file with the recorded functions and those made of them."""

from __future__ import annotations

import re
from collections.abc import Sequence

from .. import _core

_PRODUCT = """\
{head}
{{
    double matrix[{size}];
    const int refused = {matrix}(q, matrix);
    for (int i = 0; i < {rows}; i++) {{
        {result}[i] = 0.0;
        for (int j = 0; j < {columns}; j++)
            {result}[i] += matrix[{entry}] * {factor}[j];
    }}
    return refused;
}}
"""

_MARGIN = """\
{head}
{{
    double a[{size}], lengths2[{n}], largest = 0.0;
    const int refused = {matrix}(q, a, lengths2);
    for (int i = 0; i < {n}; i++)
        for (int j = 0; j < {n}; j++)
            a[{n} * i + j] *= sqrt(lengths2[i] * lengths2[j]);
    /* Jacobi's rotations: eight rounds leave nothing beside the diagonal */
    for (int round = 0; round < 8; round++)
        for (int i = 0; i < {n}; i++)
            for (int j = i + 1; j < {n}; j++) {{
                const double half = 0.5 * (a[{n} * j + j] - a[{n} * i + i]), b = a[{n} * i + j];
                const double whole = fabs(half) + hypot(half, b);
                const double t = whole == 0.0 ? 0.0 : (half < 0.0 ? -b : b) / whole;
                const double c = 1.0 / sqrt(1.0 + t * t), s = t * c;
                for (int l = 0; l < {n}; l++) {{
                    const double x = a[{n} * l + i], y = a[{n} * l + j];
                    a[{n} * l + i] = c * x - s * y;
                    a[{n} * l + j] = s * x + c * y;
                }}
                for (int l = 0; l < {n}; l++) {{
                    const double x = a[{n} * i + l], y = a[{n} * j + l];
                    a[{n} * i + l] = c * x - s * y;
                    a[{n} * j + l] = s * x + c * y;
                }}
            }}
    for (int i = 0; i < {n}; i++)
        largest = fmax(largest, a[{n} * i + i]);
    *margin = 1.0 / sqrt(largest);
    return refused;
}}
"""

_ABOUT = {
    "accelerations": "All accelerations at (t, q, v); v as the constraints allow.",
    "rates": "Rates of the coordinates.",
    "to_joints": "Positions of the joints from those of the actuators. q: a position near by, then the one found.",
    "to_actuators": "Positions of the actuators from those of the joints. q: a position near by, then the one found.",
    "jacobian": "Rates of the joints (rows) per rate of each actuator (columns).",
    "inverse_jacobian": "Rates of the actuators (rows) per rate of each joint (columns).",
    "inertia": "Mass matrix in the rates of the actuators; lengths2: 1 over what each moves with all joints open.",
    "joint_rates": "Rates of the joints from those of the actuators.",
    "actuator_rates": "Rates of the actuators from those of the joints.",
    "actuator_torques": "Efforts of the actuators that do what these efforts on the joints do.",
    "joint_torques": "Efforts on the joints that do what these efforts of the actuators do.",
    "margin": "Distance from a position where the actuators cannot cause every motion: 1 best, 0 there.",
}


class CSource:
    """A file in C and its header."""

    def __init__(
        self,
        title: str,
        prefix: str,
        velocities: Sequence[str],
        start: Sequence[float],
        driving: list[int] | None,
        wanted: list[int],
        functions: list[tuple[str, str, str, int]],
    ) -> None:
        self.title, self.prefix, self.velocities, self.start = title, prefix, velocities, start
        self.driving, self.wanted = driving or [], wanted
        self.names = [name for name, *_ in functions]
        self.made = [(head, text) for _, head, text, _ in functions]
        if driving is not None:
            self._products()

    def _products(self) -> None:
        k, p, prefix = len(self.driving), len(self.wanted), self.prefix
        nq = len(self.start)

        def product(name: str, matrix: str, factor: tuple[str, int], result: tuple[str, int], *, turned: bool) -> None:
            head = (
                f"int {prefix}_{name}(const double q[{nq}], const double {factor[0]}[{factor[1]}], "
                f"double {result[0]}[{result[1]}])"
            )
            rows, columns = result[1], factor[1]
            entry = f"{rows} * j + i" if turned else f"{columns} * i + j"
            text = _PRODUCT.format(
                head=head, size=k * p, matrix=f"{prefix}_{matrix}", rows=rows, columns=columns, entry=entry,
                result=result[0], factor=factor[0],
            )  # fmt: skip
            self.made.append((head, text))

        product("joint_rates", "jacobian", ("actuator_rates", k), ("joint_rates", p), turned=False)
        product("actuator_torques", "jacobian", ("joint_torques", p), ("actuator_torques", k), turned=True)
        if f"{prefix}_inverse_jacobian" in self.names:
            product("actuator_rates", "inverse_jacobian", ("joint_rates", p), ("actuator_rates", k), turned=False)
            product("joint_torques", "inverse_jacobian", ("actuator_torques", k), ("joint_torques", p), turned=True)
        head = f"int {prefix}_margin(const double q[{nq}], double *margin)"
        self.made.append((head, _MARGIN.format(head=head, size=k * k, n=k, matrix=f"{prefix}_inertia")))

    def _about(self, head: str) -> str:
        name = head.split("(", 1)[0].split()[-1]
        return _ABOUT.get(name.removeprefix(f"{self.prefix}_"), "")

    def _preface(self) -> str:
        title = re.sub(r"[^\x20-\x7e]|\*/|/\*", "?", self.title)
        return f"/* {title}: written by Partita {_core.version()}. SI units and radians. */\n"

    def _listed(self, indices: list[int]) -> str:
        names = [re.sub(r"[^\x20-\x7e]|\*/|/\*", "?", self.velocities[i]) for i in indices]
        return ", ".join(names)

    def header(self) -> str:
        """The declarations."""
        guard = f"{self.prefix.upper()}_H"
        nq, nv = len(self.start), len(self.velocities)
        lines = [self._preface(), f"#ifndef {guard}", f"#define {guard}", "", "#ifdef __cplusplus", 'extern "C" {']
        lines += ["#endif", ""]
        if self.driving:
            lines += [
                f"/* actuators: {self._listed(self.driving)} */",
                f"/* joints: {self._listed(self.wanted)} */",
                "",
            ]
        else:
            lines += [f"/* velocities: {self._listed(list(range(nv)))} */", ""]
        lines += ["/* The position where this was made. */", f"extern const double {self.prefix}_start[{nq}];", ""]
        lines += [
            "/* 0; 1 where the coordinates or the branch of a loop do not serve, and the results are of no use. */"
        ]
        for head, _ in self.made:
            lines += [f"/* {self._about(head)} */", f"{head};"]
        lines += ["", "#ifdef __cplusplus", "}", "#endif", "", "#endif", ""]
        return "\n".join(lines)

    def source(self, header: str) -> str:
        """The definitions."""
        numbers = ", ".join(repr(float(x)) for x in self.start)
        start = f"const double {self.prefix}_start[{len(self.start)}] = {{{numbers}}};\n"
        parts = [self._preface() + f'#include "{header}"\n#include <math.h>\n', start]
        return "\n".join([*parts, *(text for _, text in self.made)])
