"""Logs of measurements: tables of columns by name, as results are exported, and the motion that they hold."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..builder.compiled import CompiledModel
from ..errors import ArgumentError, FileFormatError, MissingFileError
from ..naming import coordinate_axes, listed
from ..numeric import floats, shown
from ..units import convert

Array = NDArray[np.float64]
_TIMES = ("t", "time")
_LEVELS = {"position": 0, "velocity": 1, "acceleration": 2}
_STATE = {"q": 0, "v": 1, "vdot": 2}
_COMPONENTS = tuple(f"{what}.{axis}" for what in ("force", "moment") for axis in "xyz")
_TITLE = re.compile(r"^(?P<name>.*?)(?: \[(?P<unit>[^\]]*)\])?$")
_ACCOUNT = "partita"
"""The column of a stored result in which its description stands."""
FILTER_ORDER = 4
"""Order of the low-pass filter: two passes of this order."""
SETTLING = 6.0
"""Periods of the cut-off in which the filter settles at each end of a log: accelerations of what it makes of a sudden
start have decayed to a thousandth by then."""
UNEVEN = 1e-3
"""Times of a log are even up to this. Scale: fraction of the mean step. Reason: clocks of controllers jitter by less; a
lost sample is a whole step."""
SPLINE_DEGREE = 5
"""Degree of the spline whose derivatives are rates and accelerations: the second one is smooth."""
FULL_BAND = 0.8
"""Samples of filtered data that are kept, of those without loss: the rest of the band between the cut-off and the half
of the sampling rate is where the filter falls."""


@dataclass(frozen=True)
class Channel:
    """What a column measures: its name, unit, and what it is for the core."""

    name: str
    unit: str
    core: dict[str, Any]


def table_of(what: str, data: Any) -> dict[str, Array]:
    """Columns by name: of a dict, a DataFrame (its index as time), a Dataset, a table with units in brackets (CSV)."""
    if isinstance(data, (str, os.PathLike)):
        return _of_csv(what, Path(data))
    if hasattr(data, "data_vars"):
        return _checked(what, _of_dataset(data))
    if hasattr(data, "columns") and hasattr(data, "index"):
        columns = {str(name): np.asarray(data[name]) for name in data.columns}
        if not set(_TIMES) & set(columns):
            columns = {"t": np.asarray(data.index), **columns}
        return _checked(what, columns)
    if isinstance(data, Mapping):
        return _checked(what, {str(name): values for name, values in data.items()})
    raise ArgumentError(
        f"{what} must be a dict of columns, a DataFrame, a Dataset or the path of a CSV file, not {shown(data)}",
        argument=what,
    )


def _checked(what: str, columns: Mapping[str, Any]) -> dict[str, Array]:
    found: dict[str, Array] = {}
    for name, values in columns.items():
        if getattr(getattr(values, "dtype", None), "kind", "") == "b":
            continue  # verdicts beside the numbers
        try:
            found[name] = np.atleast_1d(floats(values))
        except TypeError:
            if name in _TIMES or _is_channel(name):
                raise ArgumentError(
                    f"{what}[{name!r}] must be an array of numbers in SI units, not {shown(values)}", argument=what
                ) from None
            continue  # words beside the numbers
    lengths = {name: len(x) for name, x in found.items() if x.ndim == 1}
    single = {name: x for name, x in found.items() if x.ndim == 1}
    if not lengths:
        raise ArgumentError(f"{what} has no columns of numbers", argument=what)
    count = max(lengths.values())
    for name, x in single.items():
        if len(x) not in (1, count):
            raise ArgumentError(
                f"{what}[{name!r}] has {len(x)} values, other columns have {count}; give one for each instant",
                argument=what,
            )
    return {name: np.broadcast_to(x, count).astype(float) for name, x in single.items()}


def _is_channel(name: str) -> bool:
    return name.startswith(("joint.", "effort.", "ground."))


def _of_csv(what: str, path: Path) -> dict[str, Array]:
    if not path.is_file():
        raise MissingFileError(f"{what}: there is no file {path}", path=str(path))
    before = csv.field_size_limit(path.stat().st_size + 1)
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileFormatError(f"{what}: {path} is no table of text: {error}", path=str(path)) from error
    finally:
        csv.field_size_limit(before)
    titles = rows[0] if rows else []
    columns = {}
    for i, title in enumerate(titles):
        match = _TITLE.match(title.strip())
        name, unit = (match["name"], match["unit"]) if match else (title, None)
        if name == _ACCOUNT:
            continue
        try:
            values = np.array([float(row[i]) for row in rows[1:] if row])
        except (ValueError, IndexError) as error:
            raise FileFormatError(
                f"{what}: column {title!r} of {path} has an entry that is no number: {error}", path=str(path)
            ) from error
        columns[name] = values if unit is None or unit in _SI else np.asarray(convert(values, unit, _si_of(unit)))
    return _checked(what, columns)


_SI = ("", "1", "s", "m", "rad", "N", "N m", "m/s", "rad/s", "m/s^2", "rad/s^2")


def _si_of(unit: str) -> str:
    """The SI unit of the same kind."""
    for wanted in _SI[2:]:
        try:
            convert(1.0, unit, wanted)
        except ArgumentError:
            continue
        return wanted
    return unit


def _of_dataset(data: Any) -> dict[str, Any]:
    """One column for each label: "effort.A", "joint.A.position"."""
    found: dict[str, Any] = {}
    for word in _TIMES:
        if word in data.coords:
            found["t"] = np.asarray(data.coords[word])
            break
    for name, array in data.data_vars.items():
        values = np.asarray(array)
        axes = list(array.dims[1:])
        if values.ndim == 1:
            found[str(name)] = values
        elif values.ndim == 2 and axes[0] in data.coords:
            for i, label in enumerate(np.asarray(data.coords[axes[0]]).tolist()):
                found[_titled(str(name), str(label))] = values[:, i]
    return found


def _titled(name: str, label: str) -> str:
    kind, _, word = name.partition("_")
    return f"joint.{label}.{word}" if kind == "joint" and word in _LEVELS else f"{name}.{label}"


@dataclass(frozen=True)
class Courses:
    """Measured coordinates over time: positions (nt,), and rates and accelerations where they are columns."""

    name: str
    levels: tuple[Array | None, Array | None, Array | None]


def courses_of(columns: Mapping[str, Array], model: CompiledModel) -> dict[str, Courses]:
    """Coordinates of joints in a table, by name."""
    known = {}
    for joint in model.summary["joints"]:
        axes = coordinate_axes(joint)
        for axis in axes:
            known[joint["name"] if len(axes) == 1 else f"{joint['name']}.{axis}"] = True
    found: dict[str, list[Array | None]] = {}
    for name, values in columns.items():
        coordinate, level = _coordinate(name)
        if coordinate in known:
            levels = found.setdefault(coordinate, [None, None, None])
            if levels[level] is None:
                levels[level] = values
    return {name: Courses(name, (a[0], a[1], a[2])) for name, a in found.items() if a[0] is not None}


def _coordinate(name: str) -> tuple[str, int]:
    """The coordinate that a column is of, and its level."""
    first, _, rest = name.partition(".")
    if first in _STATE and rest:
        return rest, _STATE[first]
    middle, _, last = rest.rpartition(".")
    if first == "joint" and last in _LEVELS:
        return middle, _LEVELS[last]
    return name, 0


def channel_of(name: str, actuators: Sequence[Any], model: CompiledModel) -> Channel | None:
    """What a column of this name measures; None for one that is no effort and no force."""
    first, _, rest = name.partition(".")
    middle, _, last = rest.rpartition(".")
    efforts = {each.name: i for i, each in enumerate(actuators)}
    wanted = rest if first == "effort" else middle if first == "joint" and last == "drive" else None
    if wanted in efforts:
        i = efforts[wanted]
        return Channel(name, actuators[i].effort, {"effort": i})
    if first == "ground" and rest in _COMPONENTS:
        return Channel(name, _unit(rest), {"ground": _COMPONENTS.index(rest)})
    for number, joint in enumerate(model.summary["joints"]):
        prefix = f"joint.{joint['name']}."
        if name.startswith(prefix) and (component := name[len(prefix) :]) in _COMPONENTS:
            return Channel(name, _unit(component), {"joint": [number, _COMPONENTS.index(component)]})
    return None


def _unit(component: str) -> str:
    return "N" if component.startswith("force") else "N m"


def times_of(columns: Mapping[str, Array]) -> Array | None:
    """The column of times."""
    return next((columns[word] for word in _TIMES if word in columns), None)


@dataclass(frozen=True)
class Filter:
    """Two passes of a low-pass filter over evenly sampled columns, and every so many samples of what is left."""

    coefficients: Array
    every: int
    settled: int
    """Samples at each end in which the filter settles; they are left out."""
    gain: float
    """What it leaves of the standard deviation of white noise."""

    @property
    def widened(self) -> float:
        """Standard deviations of estimates by the kept samples are larger by this than those by as many independent
        ones, for regressors that vary slowly: the noise density at low frequencies over the mean density."""
        return float(1.0 / (self.gain * np.sqrt(self.every)))

    def smooth(self, values: Array) -> Array:
        """Filtered along the first axis, as long as before."""
        from scipy.signal import sosfiltfilt

        return np.asarray(sosfiltfilt(self.coefficients, values, axis=0))

    def kept(self, count: int) -> slice:
        """The samples that are kept of a filtered column."""
        return slice(self.settled, count - self.settled, self.every)


def filter_of(t: Array | None, cutoff: float) -> Filter:
    """A filter for this cut-off [Hz]."""
    from scipy.signal import butter

    if t is None or len(t) < 2 or not np.ptp(np.diff(t)) <= UNEVEN * np.mean(np.diff(t)) or t[0] == t[1]:
        raise ArgumentError(
            "cutoff: a filter needs times at even steps; resample the data, or leave cutoff out", argument="cutoff"
        )
    step = float(np.mean(np.diff(t)))
    highest = 0.5 / step
    if not 0.0 < cutoff < highest:
        raise ArgumentError(
            f"cutoff is {cutoff:g} Hz; the data, sampled at {1.0 / step:.6g} Hz, have nothing above {highest:.6g} Hz",
            argument="cutoff",
        )
    # samples that are left out at each end, and of which one is kept; floats, for they may be larger than any integer
    settled, every = np.ceil(SETTLING / (cutoff * step)), max(1.0, FULL_BAND / (2.0 * cutoff * step) // 1.0)
    if len(t) <= 2 * settled + 2 * every:
        raise ArgumentError(
            f"cutoff is {cutoff:g} Hz, and the data last {t[-1] - t[0]:.3g} s: nothing is left after the filter has "
            "settled; give longer data, or a higher cutoff",
            argument="cutoff",
        )
    sections = np.asarray(butter(FILTER_ORDER, 2.0 * cutoff * step, output="sos"))
    impulse = np.zeros(2 * int(settled) + 1)
    impulse[int(settled)] = 1.0
    gain = float(np.linalg.norm(Filter(sections, int(every), int(settled), 1.0).smooth(impulse)))
    return Filter(sections, int(every), int(settled), gain)


def differentiated(t: Array, position: Array) -> tuple[Array, Array]:
    """Rates and accelerations at the times, of an interpolating spline."""
    from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(t, position, k=SPLINE_DEGREE)
    return np.asarray(spline.derivative(1)(t)), np.asarray(spline.derivative(2)(t))


def describe(names: Sequence[str]) -> str:
    """Names in a sentence."""
    return listed(list(names)) if names else "none"
