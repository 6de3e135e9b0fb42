"""`partita compare`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ..errors import ArgumentError, MissingFileError
from ..progress import has_bars
from .interruption import so_far
from .models import Opened, length_of, open_model
from .printing import print_json

INTERRUPTED = 130


def compare(arguments: argparse.Namespace) -> int:
    """Run all formulations on each mechanism, print the tables and write the requested files. Failed runs are marked in
    the tables."""
    _check_outputs(arguments)
    # all are opened before the first run, so that an unknown name is an error and not the end of a long table
    opened = {word: open_model(word) for word in arguments.models}
    lengths = {word: length_of(model, word, arguments.time) for word, model in opened.items()}
    all_reported: list[dict[str, object]] = []
    for word, model in opened.items():
        if all_reported and not arguments.json:
            print()
        reported = _compare_one(arguments, word, model, lengths[word])
        all_reported.append(reported)
        if reported["interrupted"]:
            break
    if arguments.json:
        print_json(all_reported[0] if len(opened) == 1 else {"comparisons": all_reported})
    return INTERRUPTED if all_reported[-1]["interrupted"] else 0


def _compare_one(arguments: argparse.Namespace, word: str, opened: Opened, duration: float) -> dict[str, object]:
    """The comparison on one mechanism, printed and written."""
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
    reported: dict[str, object] = {"model": word, "duration": duration, "rows": found.rows}
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
    if not arguments.json:
        for path in written:
            print(f"wrote {path}")
    return reported | {"interrupted": interrupted, "written": written}


def _check_outputs(arguments: argparse.Namespace) -> None:
    """Check before the runs, not after, that their figures can be written."""
    files = {"--plot": arguments.plot, "--work-precision": arguments.work_precision, "--csv": arguments.csv}
    asked = [option for option, path in files.items() if path]
    if asked and len(arguments.models) > 1:
        raise ArgumentError(
            f"{asked[0]} writes one file, and {len(arguments.models)} mechanisms are named; compare them one by one",
            argument=asked[0].lstrip("-"),
        )
    figures = [path for path in (arguments.plot, arguments.work_precision) if path]
    if figures:
        from ..plots import figure_path  # needs matplotlib, which the tables do without

        for path in figures:
            figure_path(path)
    folder = Path(arguments.csv).parent if arguments.csv else Path()
    if not folder.is_dir():
        raise MissingFileError(
            f"cannot write {arguments.csv!r}: the folder {str(folder)!r} does not exist; make it first",
            path=str(folder),
        )
