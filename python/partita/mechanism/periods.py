"""The period of prescribed motions and of loads over time: when they repeat."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..builder.compiled import CompiledModel
from ..builder.records import DriveRecord, ForceRecord, TorqueRecord
from ..builder.values import Constant, Cubics, Function, Table
from ..errors import ArgumentError
from ..naming import joint_units
from ..state import State
from ..tolerance import EQUAL, EQUAL_IN_SIX_DIGITS
from .algebra import integral

Array = NDArray[np.float64]

REPEATS = 1e-7
"""A prescribed motion that comes back within this repeats. Scale: fraction of the range of the motion and of its
derivatives. Reason: derivatives of functions may be differences, with seven digits."""
NEAR_RETURN = 0.05
"""A motion that comes back within this may repeat there: the time is refined. Scale: as of `REPEATS`. Reason: samples
lie a hundredth of a cycle apart."""
SAMPLES = 1024
"""Samples of a function in which its period is sought, in a span that begins with the first and grows fourfold."""
FIRST_SPAN, SPANS, WIDER = 1e-4, 12, 4.0
REFINEMENTS, DIFFERENCE = 6, 1e-5
"""Iterations in which the time is refined, and the step of their slopes in fractions of it."""
MOST_TURNS = 64
"""Cycles of a rate after which the position must have come back by whole turns."""
MOST_CYCLES = 1000
"""Largest number of cycles of one drive in the common cycle of several."""


class Repeat(NamedTuple):
    """What repeats, and after how many seconds."""

    name: str
    period: float


Known = dict[str, float | None]
"""Periods of functions and tables, which no parameter changes."""


def repeats(model: CompiledModel, start: State, only: str | None = None, known: Known | None = None) -> list[Repeat]:
    """The periods of all drives that move and of loads that are tables over time, or of one of them."""
    drawn = model._drawn
    known = {} if known is None else known
    found = []
    for name, drive in drawn.drives.items():
        if only in (None, name, drive.measure.get("joint")):
            if name in known:
                period = known[name]
            else:
                period = _of_drive(model, drive, start.t)
            if not isinstance(drive.motion, Constant):
                known[name] = period
            found += [] if period is None else [Repeat(f'drive "{name}"', period)]
    for name, force in drawn.forces.items():
        if only in (None, name) and isinstance(force, TorqueRecord | ForceRecord):
            values = force.value if isinstance(force.value, tuple) else (force.value,)
            if isinstance(force, TorqueRecord) and force.over is not None:
                continue
            for value in values:
                if isinstance(value, Table | Cubics):
                    found.append(Repeat(f'force "{name}"', _of_table(f'force "{name}"', value, angle=False, level=2)))
    return found


def common(found: list[Repeat]) -> float:
    """The shortest time in which all of them repeat."""
    period = found[0].period
    for one in found[1:]:
        ratio = Fraction(one.period / period).limit_denominator(MOST_CYCLES)
        whole = ratio.numerator / ratio.denominator
        if not ratio.numerator or abs(whole - one.period / period) > EQUAL * whole or ratio.numerator > MOST_CYCLES:
            raise ArgumentError(
                f"{found[0].name} repeats every {found[0].period:.9g} s and {one.name} every {one.period:.9g} s, which "
                f"have no common period of fewer than {MOST_CYCLES} cycles; give period= in seconds, or drive them at "
                "rates in a ratio of small whole numbers",
                argument="period",
            )
        period *= ratio.numerator
    return period


def _is_angle(model: CompiledModel, drive: DriveRecord) -> bool:
    """Whether what it prescribes is an angle whose whole turns do not count."""
    if drive.measure["of"] != "joint":
        return False
    joint = next(j for j in model.summary["joints"] if j["name"] == drive.measure["joint"])
    return joint_units(joint)[1][int(drive.measure["coordinate"])] == "rad"


def _of_drive(model: CompiledModel, drive: Any, t: float) -> float | None:
    """None of one that stands still."""
    what = f'drive "{drive.name}"'
    angle = _is_angle(model, drive)
    value = drive.motion
    if isinstance(value, Constant):
        number = model._changes.get(f"{drive.name}.{drive.level}", [value.value])[0]
        if drive.level == "position" or number == 0.0:
            return None
        if drive.level == "velocity" and angle:
            return 2.0 * np.pi / abs(number)
        where = "accelerates for ever" if drive.level == "acceleration" else "moves on in one direction for ever"
        raise ArgumentError(
            f"{what} {where}, so nothing repeats; prescribe a motion that comes back",
            argument="period",
        )
    if isinstance(value, Table | Cubics):
        return _of_table(what, value, angle, {"position": 0, "velocity": 1, "acceleration": 2}[drive.level])
    if isinstance(value, Function):
        return _of_function(what, value.call.bind(None), t, angle, drive.level)  # type: ignore[arg-type]
    raise ArgumentError(
        f"{what} prescribes a pose, whose period is not sought; give period= in seconds",
        argument="period",
    )


def _of_table(what: str, value: Table | Cubics, angle: bool, level: int) -> float:
    """A table repeats if it ends as it begins."""
    from scipy.interpolate import PPoly

    spec = value.spec()["table"]
    breaks = np.array(spec["breaks"])
    curve = PPoly(np.array(spec["coefficients"]).T, breaks)
    size = float(np.ptp(curve(breaks))) or 1.0
    step = float(curve(breaks[-1]) - curve(breaks[0]))
    if angle and level == 0:
        step -= 2.0 * np.pi * round(step / (2.0 * np.pi))
    if abs(step) > EQUAL_IN_SIX_DIGITS * size:
        raise ArgumentError(
            f"{what} is a table from t = {breaks[0]:g} to {breaks[-1]:g} s that ends {step:.3g} from where it begins, "
            "so it does not repeat after its length; give period= in seconds, or a table that ends as it begins",
            argument="period",
        )
    return float(breaks[-1] - breaks[0])


def _of_function(what: str, f: Callable[[float], Any], t: float, angle: bool, level: str) -> float | None:
    """The time after which the motion is the same, found by comparing it with its start."""

    def seen(times: Array) -> Array:
        rows = np.array([np.ravel(f(float(x)))[:3] for x in times])
        if level == "position" and angle:
            return np.column_stack([np.cos(rows[:, 0]), np.sin(rows[:, 0]), rows[:, 1:]])
        return rows

    found = repeating(seen, t)
    if found is None:
        raise ArgumentError(
            f"{what}: no time was found after which its motion repeats; give period= in seconds", argument="period"
        )
    if found == 0.0:
        return None
    if level != "velocity":
        return found
    return found * _turns(what, lambda x: float(np.ravel(f(x))[0]), t, found, angle)


def _turns(what: str, rate: Callable[[float], float], t: float, period: float, angle: bool) -> int:
    """Cycles of a rate after which the position has come back."""
    size = max(abs(rate(t + i * period / MOST_TURNS)) for i in range(MOST_TURNS)) * period
    advance = integral(rate, t, t + period, EQUAL * size, MOST_CYCLES)
    for count in range(1, MOST_TURNS + 1):
        off = count * advance
        off -= 2.0 * np.pi * round(off / (2.0 * np.pi)) if angle else 0.0
        if abs(off) <= EQUAL_IN_SIX_DIGITS * size:
            return count
    raise ArgumentError(
        f"{what} has a rate that repeats every {period:.6g} s, in which the position advances by {advance:.6g}: it "
        f"does not come back within {MOST_TURNS} cycles; prescribe a position that repeats",
        argument="period",
    )


def repeating(seen: Callable[[Array], Array], t: float) -> float | None:
    """The shortest time after which all columns of a function of times are what they were; 0 where they never change,
    None where none was found."""
    span = FIRST_SPAN
    first = seen(np.array([t]))[0]
    for _ in range(SPANS):
        times = t + np.linspace(0.0, span, SAMPLES)
        rows = seen(times)
        sizes = np.ptp(rows, axis=0)
        still = sizes <= REPEATS * np.abs(rows).max(axis=0)
        if np.all(still):
            span *= WIDER
            continue
        scales = np.where(still, np.inf, sizes)
        away = np.abs((rows - first) / scales).max(axis=1)
        for i in _returns(away):
            period = _refined(seen, t, scales, float(times[i] - t), float(times[2] - t))
            probes = t + period * np.linspace(0.0, 1.0, MOST_TURNS)
            off = np.abs((seen(probes + period) - seen(probes)) / scales).max()
            if off <= REPEATS:
                return float(period)
        span *= WIDER
    return 0.0 if np.all(still) else None


def _returns(away: Array) -> Iterator[int]:
    """Minima of a distance that was large before."""
    left = np.flatnonzero(away > NEAR_RETURN)
    for i in range(int(left[0]) if len(left) else len(away), len(away) - 1):
        if away[i] <= NEAR_RETURN and away[i] <= away[i - 1] and away[i] < away[i + 1]:
            yield i


def _refined(seen: Callable[[Array], Array], t: float, scales: Array, guess: float, width: float) -> float:
    """The time after which all of the motion is nearest to itself: least squares over a cycle."""
    probes = t + guess * np.linspace(0.0, 1.0, MOST_TURNS)
    own = np.isfinite(scales)
    first, period = seen(probes)[:, own] / scales[own], guess
    for _ in range(REFINEMENTS):
        step = DIFFERENCE * guess
        ahead, back = (seen(probes + period + sign * step)[:, own] / scales[own] for sign in (1.0, -1.0))
        slope, off = (ahead - back) / (2.0 * step), 0.5 * (ahead + back) - first
        change = float(np.sum(slope * off) / np.sum(slope * slope))
        if abs(period - change - guess) > width:
            break
        period -= change
    return period
