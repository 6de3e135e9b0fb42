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

from ..errors import MissingFileError, SuspectResultWarning
from ..progress import has_bars
from ..results.save import checked_path
from ..solver import grouped
from .account import account
from .interruption import so_far
from .models import Opened, length_of, open_as_asked, start_of
from .printing import print_json

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
    """Run, write the requested files and print the summary; the exit code states how the run ended."""
    _check_outputs(arguments)
    opened = open_as_asked(arguments.model, arguments)
    duration = length_of(opened, arguments.model, arguments.time)
    start = start_of(opened, arguments.target, arguments.rate, arguments.coordinates)
    result = _run(opened, start, duration, arguments)
    written = _write(result, arguments)
    if arguments.json:
        print_json(_found(opened, result, arguments) | {"written": [str(path) for path in written]})
    elif not arguments.quiet:
        print(account(result, _measured(opened, result, arguments)))
        for path in written:
            print(f"wrote {path}")
    if result.certificate.verdict == "suspect":
        print("partita: the result is suspect; see its certificate", file=sys.stderr)
    if result.success:
        return 0
    if result.status == "invalid":
        print(f"partita: {result.message}", file=sys.stderr)
        return 1
    reached = f"t = {result.t[-1]:.6g} s" if len(result.t) else "the start"
    print(f"partita: the run stopped after {reached} ({result.status}): {result.message}", file=sys.stderr)
    return 130 if result.status == "interrupted" else 1


def _check_outputs(arguments: argparse.Namespace) -> None:
    """Check before a long run, not after, that its results can be written."""
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


def _run(opened: Opened, start: State | None, duration: float, arguments: argparse.Namespace) -> Result:
    options: dict[str, Any] = dict(opened.entry.options) if opened.entry else {}
    for name in _OPTIONS:
        if getattr(arguments, name) is not None:
            options[name] = getattr(arguments, name)
    progress = not arguments.quiet and has_bars() and sys.stderr.isatty()
    warnings.simplefilter("ignore", SuspectResultWarning)  # reported in a separate line
    times = _outputs(opened, start, duration, arguments)
    return so_far(
        lambda: opened.mechanism.simulate(duration, t_eval=times, initial=start, progress=progress, **grouped(options))
    )


def _outputs(
    opened: Opened, start: State | None, duration: float, arguments: argparse.Namespace
) -> NDArray[np.float64]:
    """Equally spaced; for the published run of an entry also the times of its checks."""
    if opened.entry and duration == opened.entry.duration:
        return opened.entry.t_eval(arguments.outputs)
    t0 = start.t if start is not None else 0.0
    return np.linspace(t0, t0 + duration, arguments.outputs)


def _found(opened: Opened, result: Result, arguments: argparse.Namespace) -> dict[str, Any]:
    """The account as data."""
    return {
        "title": result.title,
        "status": result.status,
        "success": result.success,
        "message": result.message,
        "t": [result.t[0], result.t[-1]] if len(result.t) else [],
        "outputs": len(result.t),
        "options": dict(result.options),
        "partitions": result.partitions,
        "certificate": result.certificate,
        "verdict": result.certificate.verdict,
        "work": result.counters,
        "measured": _measured(opened, result, arguments),
    }


def _measured(opened: Opened, result: Result, arguments: argparse.Namespace) -> list[str]:
    """Errors against the published numbers, when the run was the published one."""
    entry = opened.entry
    own = entry is not None and (arguments.time or entry.duration) == entry.duration
    if entry is None or not own or arguments.target or arguments.rate or not result.success:
        return []
    return [str(measurement) for measurement in entry.measure(result)]


def _write(result: Result, arguments: argparse.Namespace) -> list[Path]:
    """Every requested file, also for a run that stopped early."""
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
