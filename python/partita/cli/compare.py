"""`partita compare`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ..errors import MissingFileError
from ..progress import has_bars
from .interruption import so_far
from .models import length_of, open_model
from .printing import print_json

INTERRUPTED = 130


def compare(arguments: argparse.Namespace) -> int:
    """Run all formulations, print the table and write the requested files. Failed runs are marked in the table."""
    _check_outputs(arguments)
    opened = open_model(arguments.model)
    duration = length_of(opened, arguments.model, arguments.time)
    watched = has_bars() and sys.stderr.isatty()
    found = so_far(
        lambda: opened.mechanism.compare(
            duration,
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
    reported: dict[str, object] = {"model": arguments.model, "duration": duration, "rows": found.rows}
    written = []
    if not arguments.json:
        print(found)
    if arguments.csv:
        written.append(str(found.to_csv(arguments.csv)))
    if arguments.plot:
        found.plot(arguments.plot)
        written.append(arguments.plot)
    interrupted = found.interrupted
    if (arguments.work_precision or arguments.tolerances) and not interrupted:
        given = {} if arguments.tolerances is None else {"tolerances": arguments.tolerances}
        ladder = so_far(lambda: found.work_precision(progress=watched, **given))
        reported["work_precision"], interrupted = ladder.points, ladder.interrupted
        if not arguments.json:
            print(f"\n{ladder}")
        if arguments.work_precision:
            ladder.plot(arguments.work_precision)
            written.append(arguments.work_precision)
    if arguments.json:
        print_json(reported | {"interrupted": interrupted, "written": written})
    else:
        for path in written:
            print(f"wrote {path}")
    return INTERRUPTED if interrupted else 0


def _check_outputs(arguments: argparse.Namespace) -> None:
    """Check before the runs, not after, that their figures can be written."""
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
