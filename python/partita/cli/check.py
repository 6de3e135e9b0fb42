"""`partita check`: a lint for model files: what was read, whether it closes, its mobility, likely mistakes."""

from __future__ import annotations

import argparse
from typing import Any

from ..errors import AssemblyError, SingularityError
from .models import open_as_asked
from .printing import print_json

HELD, BROKEN = 0, 1


def check(arguments: argparse.Namespace) -> int:
    """Print the findings on a model file; return 1 if its loops do not close."""
    mechanism = open_as_asked(arguments.model, arguments).mechanism
    found: dict[str, Any] = {"reading": None if mechanism.reading is None else mechanism.reading.to_dict()}
    try:
        found["report"] = mechanism.report().to_dict()
        found["closes"], found["why"] = True, None
    except (AssemblyError, SingularityError) as error:
        found["report"], found["closes"], found["why"] = None, False, error.message
    if arguments.json:
        print_json(found)
    else:
        if mechanism.reading is not None:
            print(mechanism.reading)
        print(*_words(found), sep="\n")
    return HELD if found["closes"] else BROKEN


def _words(found: dict[str, Any]) -> list[str]:
    report = found["report"]
    if report is None:
        return [f"does not close: {found['why']}"]
    words = [f"degrees of freedom: {report['mobility']}"]
    if report["idle"]:
        words.append(f"  of which idle: {len(report['idle'])}")
    redundant = report["joint_rows"] - report["joint_rank"]
    words.append(f"redundant constraints: {redundant} of {report['joint_rows']}")
    if report["geometric_errors"]:
        words.append(f"geometric error: {report['geometric_error']:.2e} (radians, and fractions of the size)")
    if report["remedies"]:
        remedies = ", ".join(f"{x['is']} {x['joint']} by {x['by']}" for x in report["remedies"])
        words.append(f"  remedy: with {remedies} replaced nothing is redundant, and nothing else moves")
    words += [f"look at: {remark}" for remark in (*report["suspicious"], *report["notes"])]
    return words
