"""`partita simulate`."""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, DoubtfulResultWarning, MissingFileError
from ..progress import has_bars
from ..results.save import checked_path
from .account import account
from .interruption import so_far
from .models import Opened, open_model

if TYPE_CHECKING:
    from ..results import Result
    from ..state import State

_OPTIONS = (
    "rtol",
    "atol",
    "method",
    "formulation",
    "coordinates",
    "selection",
    "independent",
    "window",
    "correction",
    "baumgarte",
)
"""Of `Mechanism.simulate`; what is not given is left to the entry of the catalogue, then to the defaults."""


def simulate(arguments: argparse.Namespace) -> int:
    """Run, write what was asked for, print what was found; the exit code tells how the run ended."""
    _check_outputs(arguments)
    opened = open_model(arguments.model)
    if arguments.time is None and opened.entry is None:
        raise ArgumentError(f"{arguments.model}: a model file has no length of its own; add --time 10", argument="time")
    start = _start(opened, arguments)
    result = _run(opened, start, arguments)
    written = _write(result, arguments)
    if not arguments.quiet:
        print(account(result, _measured(opened, result, arguments)))
        for path in written:
            print(f"wrote {path}")
    if result.certificate.verdict == "doubtful":
        print("partita: the result is doubtful; its certificate says why", file=sys.stderr)
    if result.success:
        return 0
    if result.status == "broken":
        print(f"partita: {result.message}", file=sys.stderr)
        return 1
    reached = f"t = {result.t[-1]:.6g} s" if len(result.t) else "the start"
    print(f"partita: the run stopped after {reached} ({result.status}): {result.message}", file=sys.stderr)
    return 130 if result.status == "interrupted" else 1


def _check_outputs(arguments: argparse.Namespace) -> None:
    """Find out before a long run, not after, that its results could not be written."""
    if arguments.save:
        checked_path(arguments.save)
    if arguments.plot:
        from ..plots import figure_path

        figure_path(arguments.plot)
    folder = Path(arguments.html).parent if arguments.html else Path()
    if not folder.is_dir():
        raise MissingFileError(
            f"cannot write {arguments.html!r}: the folder {str(folder)!r} does not exist; make it first",
            path=str(folder),
        )


def _start(opened: Opened, arguments: argparse.Namespace) -> State | None:
    """The state to start from: that of the catalogue, with the targets and rates asked for."""
    targets, rates = _settings(arguments.target), _settings(arguments.rate)
    near = opened.initial(arguments.coordinates)
    if not targets and not rates:
        return near
    return opened.mechanism.assemble(targets, rates, near, coordinates=arguments.coordinates)


def _settings(pairs: list[tuple[str, list[float]]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, values in pairs:
        if name in found:
            raise ArgumentError(f"{name!r} is set twice; give it once", argument="target")
        found[name] = values if len(values) > 1 else values[0]
    return found


def _run(opened: Opened, start: State | None, arguments: argparse.Namespace) -> Result:
    options: dict[str, Any] = dict(opened.entry.options) if opened.entry else {}
    for name in _OPTIONS:
        if getattr(arguments, name) is not None:
            options[name] = getattr(arguments, name)
    duration = arguments.time or (opened.entry.duration if opened.entry else 0.0)
    progress = not arguments.quiet and has_bars() and sys.stderr.isatty()
    warnings.simplefilter("ignore", DoubtfulResultWarning)  # told in a line of its own
    times = _outputs(opened, start, duration, arguments)
    return so_far(
        lambda: opened.mechanism.simulate(duration, t_eval=times, initial=start, progress=progress, **options)
    )


def _outputs(
    opened: Opened, start: State | None, duration: float, arguments: argparse.Namespace
) -> NDArray[np.float64]:
    """Equally spaced; for the published run of an entry also the instants that its checks look at."""
    if opened.entry and duration == opened.entry.duration:
        return opened.entry.t_eval(arguments.outputs)
    t0 = start.t if start is not None else 0.0
    return np.linspace(t0, t0 + duration, arguments.outputs)


def _measured(opened: Opened, result: Result, arguments: argparse.Namespace) -> list[str]:
    """Errors against the published numbers, when the run was the published one."""
    entry = opened.entry
    own = entry is not None and (arguments.time or entry.duration) == entry.duration
    if entry is None or not own or arguments.target or arguments.rate or not result.success:
        return []
    return [str(measurement) for measurement in entry.measure(result)]


def _write(result: Result, arguments: argparse.Namespace) -> list[Path]:
    """Every file asked for, also for a run that stopped early."""
    if len(result.t) == 0:
        return []
    writers: list[tuple[str | None, Callable[[str], object]]] = [
        (arguments.save, result.save),
        (arguments.plot, lambda path: result.plot(path=path)),
        (arguments.html, result.to_html),
    ]
    written = []
    for path, write in writers:
        if path:
            write(path)
            written.append(Path(path))
    return written
