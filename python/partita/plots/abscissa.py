"""The abscissa of a figure: time, or any coordinate, joint or sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..naming import coordinate_units, index_of, joint_units
from ..numeric import shown
from ..result_view import FEW, ResultView, turn_between_outputs
from ..tolerance import EQUAL
from .style import plain

FloatArray = NDArray[np.float64]


MOST_DEGREES = 8.0
"""Between outputs farther apart no line is drawn over a turn. Scale: degrees. Reason: the line would cut corners that
are seen."""


ONE_TURN = 370.0
"""Angles that vary by more are reduced to one turn. Scale: degrees. Reason: a turn, and the part beyond it that is
seen."""
FULL_TURN = math.tau * (1.0 - EQUAL)
"""A crank that rotates by less makes no turn. Scale: rad. Reason: a turn, but for its rounding: a run of one may end
short of it."""


@dataclass(frozen=True)
class Abscissa:
    """Numbers (nt,) of the abscissa, and where a line must be broken because a new turn begins."""

    values: FloatArray
    label: str
    breaks: NDArray[np.bool_]  # (nt,): whether the line from the previous output to this one is omitted
    is_time: bool = False
    apart: bool = False
    """Whether outputs are so far apart in time that lines between them would misrepresent the motion."""

    def plot(self, ax: Axes, y: FloatArray, *form: str, **style: Any) -> None:
        """A line of `y` (nt,) over these numbers, broken where a new turn begins; dots where outputs are far apart."""
        if self.is_sparse:
            style_of_line = style.get("ls", "-")
            colour, hollow = style.get("color"), "--" in form or style_of_line not in ("-", "solid")
            look: dict[str, Any] = {
                "marker": "o",
                "ms": 2.6,
                "mew": 0.7,
                "mfc": "none" if hollow else colour,
                "mec": colour,
            }
            ax.plot(self.values, y, ls="none", color=colour, label=style.get("label"), **look)
            return
        if len(self.values) == 1:  # a single output makes no line
            style = {**style, "marker": "o", "ms": 4}
        at = np.flatnonzero(self.breaks)
        ax.plot(np.insert(self.values, at, np.nan), np.insert(np.asarray(y, dtype=float), at, np.nan), *form, **style)

    @property
    def is_sparse(self) -> bool:
        """Whether so few outputs fall on a turn that lines between them would cut corners."""
        if self.is_time:
            return self.apart
        steps = np.abs(np.diff(self.values))[~self.breaks[1:]]
        return bool(self.breaks.any() and steps.size and np.nanmedian(steps) > MOST_DEGREES)

    def dress(self, ax: Axes) -> None:
        """The label below `ax`."""
        ax.set_xlabel(plain(self.label), fontsize=9)


def abscissa(result: ResultView, x: Any) -> Abscissa:
    """Time for None; otherwise the coordinate, joint or sensor `x`, with angles in degrees, reduced to one turn."""
    if x is None:
        name, step = turn_between_outputs(result)
        label = (
            f"time [s]; {plain(name)} turns {np.degrees(step):.0f} deg between outputs" if step > FEW else "time [s]"
        )
        return Abscissa(result.t, label, np.zeros(len(result.t), dtype=bool), is_time=True, apart=step > FEW)
    x = getattr(x, "name", x)
    sensors = [item["name"] for item in result.summary.get("sensors", ())]
    known = [*result.names.coordinates, *result.names.joints, *sensors]
    if not isinstance(x, str):
        raise ArgumentError(f"x must be the name of a coordinate, joint or sensor, not {shown(x)}", argument="x")
    name = known[index_of(x, known, "coordinate, joint or sensor")]
    values, unit = _numbers(result, name)
    if unit != "rad":
        return Abscissa(
            values, f"{name}{f' [{unit}]' if unit not in ('', '1') else ''}", np.zeros(len(values), dtype=bool)
        )
    degrees = np.degrees(values)
    finite = degrees[np.isfinite(degrees)]
    if not finite.size or float(finite.max() - finite.min()) <= ONE_TURN:
        return Abscissa(degrees, f"{name} [deg]", np.zeros(len(values), dtype=bool))
    turn = np.floor(degrees / 360.0)
    return Abscissa(degrees - 360.0 * turn, f"{name} [deg], every turn", np.diff(turn, prepend=turn[:1]) != 0.0)


def crank(result: ResultView) -> str | None:
    """The first joint that rotates steadily about a single axis through at least one turn; None if there is none."""
    for about in result.summary.get("joints", ()):
        if joint_units(about)[0] != ["rad"]:
            continue
        angle = np.asarray(result.joint(about["name"]).position)[:, 0]
        if float(np.ptp(angle) if len(angle) and np.isfinite(angle).all() else 0.0) >= FULL_TURN:
            return str(about["name"])
    return None


def _numbers(result: ResultView, name: str) -> tuple[FloatArray, str]:
    if name in result.names.coordinates:
        i = list(result.names.coordinates).index(name)
        return np.asarray(result.q[:, i]), coordinate_units(result.summary, result.names)[0][i]
    if name in result.names.joints:
        about = result.summary["joints"][list(result.names.joints).index(name)]
        values, units = np.asarray(result.joint(name).position), joint_units(about)[0]
        if values.ndim != 2 or values.shape[1] != 1:
            raise ArgumentError(
                f"x: joint {name!r} has {values.shape[-1]} coordinates; name one of them, such as a sensor of it, or "
                f"a joint with one coordinate",
                argument="x",
            )
        return values[:, 0], units[0]
    read = result.sensor(name)
    if read.values.ndim != 1:
        raise ArgumentError(
            f"x: sensor {name!r} reads {read.values.shape[1:]} numbers at once; make a sensor of one of them, [0]",
            argument="x",
        )
    return np.asarray(read.values, dtype=float), read.unit
