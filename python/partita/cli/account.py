"""The summary of a run that the command line prints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..naming import listed
from ..options import SELECTIONS, TANGENTS, WHOLE
from ..results.partition_log import switches_of

if TYPE_CHECKING:
    from ..results import Result

LINES = 12
BY_MEASURE = ("collective", "greedy", "individual")
_TANGENT, _WHOLE = "none independent, tangent velocities integrated", "none independent, all accelerations integrated"
INTEGRATED = {
    **dict.fromkeys((*TANGENTS, "tangent-space", "user-tangent"), _TANGENT),
    **dict.fromkeys(WHOLE, _WHOLE),
}
"""Variables integrated by formulations without independent coordinates, in words."""


def account(result: Result, measured: Sequence[str] = ()) -> str:
    """Choice of coordinates, switches, certificate, counters and, if given, errors against known answers."""
    span = f"{result.t[-1] - result.t[0]:g} s, " if len(result.t) else ""
    options = result.options
    how = ", ".join(str(options[key]) for key in ("method", "formulation", "coordinates") if key in options)
    tolerances = ", ".join(f"{key} {options[key]:g}" for key in ("rtol", "atol") if key in options)
    work = ", ".join(f"{value} {key.replace('_', ' ')}" for key, value in result.counters.items())
    parts = [
        f"{result.title}: {span}{len(result.t)} outputs ({', '.join(part for part in (how, tolerances) if part)})",
        *choice(result),
        *switches(result),
        "Certificate",
        *(f"  {line}" for line in str(result.certificate).splitlines()),
        "Work",
        f"  {work or 'not counted'}",
    ]
    if measured:
        parts += ["Against known answers", *(f"  {line}" for line in measured)]
    return "\n".join(parts)


def choice(result: Result) -> list[str]:
    """The coordinates at the first output: their measure, and which were independent."""
    if len(result.t) == 0 or result.measure.shape[1] == 0:
        return []
    rho, names = result.measure[0], result.names.velocities
    integrated = INTEGRATED.get(str(result.options.get("formulation")))
    chosen = {int(i) for i in result.independent[0]} if integrated is None else set()
    total = len(rho)
    reported = integrated or f"{len(chosen)} of {total} independent, {_chooser(result)}"
    lines = [f"Coordinates at t = {result.t[0]:g} s: {reported}"]
    order = sorted(range(total), key=lambda i: (i not in chosen, -rho[i] if np.isfinite(rho[i]) else 0.0))
    width = max(len(names[i]) for i in order[:LINES])
    for i in order[:LINES]:
        mark = "  independent" if i in chosen else ""
        lines.append(f"  {names[i]:<{width}}  rho = {rho[i]:.6f}{mark}")
    if total > LINES:
        lines.append(f"  and {total - LINES} more")
    return lines


def _chooser(result: Result) -> str:
    """The origin of the choice of independent coordinates."""
    rule = result.options.get("selection") or SELECTIONS[0]
    if result.options.get("independent"):
        return "as asked for"
    return "chosen by the measure rho" if rule in BY_MEASURE else f"chosen by the rule {rule}"


def switches(result: Result) -> list[str]:
    """The switches during the run."""
    changes = [change for change in result.partitions if change.is_switch]
    if not changes:
        return ["Switches: none"]
    count = switches_of(result)
    lines = [f"Switches: {count}", *(f"  {change}" for change in changes[:LINES])]
    if count > LINES:
        ever = sorted({name for change in changes for name in change.entering})
        lines.append(f"  and {count - LINES} more; entered at some time: {listed(ever)}")
    return lines
