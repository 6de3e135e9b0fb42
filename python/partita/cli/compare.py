"""`partita compare`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ..errors import ArgumentError, MissingFileError
from ..progress import has_bars
from .interruption import so_far
from .models import open_model

INTERRUPTED = 130


def compare(arguments: argparse.Namespace) -> int:
    """Run all formulations, print the table, write what was asked for. Runs that fail are told in the table."""
    _check_outputs(arguments)
    opened = open_model(arguments.model)
    if arguments.time is None and opened.entry is None:
        raise ArgumentError(f"{arguments.model}: a model file has no length of its own; add --time 10", argument="time")
    watched = has_bars() and sys.stderr.isatty()
    found = so_far(
        lambda: opened.mechanism.compare(
            arguments.time or (opened.entry.duration if opened.entry else None),
            initial=opened.initial(arguments.coordinates),
            formulations=arguments.formulations,
            selections=arguments.rules,
            corrections=arguments.correction,
            coordinates=arguments.coordinates,
            rtol=arguments.rtol,
            atol=arguments.atol,
            method=arguments.method,
            baumgarte=arguments.baumgarte,
            window=arguments.window,
            progress=watched,
        )
    )
    print(found)
    if arguments.csv:
        print(f"wrote {found.to_csv(arguments.csv)}")
    if arguments.plot:
        found.plot(arguments.plot)
        print(f"wrote {arguments.plot}")
    if (arguments.work_precision or arguments.tolerances) and not found.interrupted:
        given = {} if arguments.tolerances is None else {"tolerances": arguments.tolerances}
        ladder = so_far(lambda: found.work_precision(progress=watched, **given))
        print(f"\n{ladder}")
        if arguments.work_precision:
            ladder.plot(arguments.work_precision)
            print(f"wrote {arguments.work_precision}")
        return INTERRUPTED if ladder.interrupted else 0
    return INTERRUPTED if found.interrupted else 0


def _check_outputs(arguments: argparse.Namespace) -> None:
    """Find out before the runs, not after, that their figures could not be written."""
    from ..plots import figure_path

    for path in (arguments.plot, arguments.work_precision):
        if path:
            figure_path(path)
    folder = Path(arguments.csv).parent if arguments.csv else Path()
    if not folder.is_dir():
        raise MissingFileError(
            f"cannot write {arguments.csv!r}: the folder {str(folder)!r} does not exist; make it first",
            path=str(folder),
        )
