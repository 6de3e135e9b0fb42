"""`partita check`: a lint for model files: what was read, whether it closes, its mobility, likely mistakes."""

from __future__ import annotations

import argparse

from .models import open_as_asked
from .printing import print_json

HELD, BROKEN = 0, 1


def check(arguments: argparse.Namespace) -> int:
    """Print the findings on a model file; return 1 if its loops do not close."""
    found = open_as_asked(arguments.model, arguments).mechanism.check()
    if arguments.json:
        print_json(found.to_dict())
    else:
        if found.reading is not None:
            print(found.reading)
        print(found)
    return HELD if found.closes else BROKEN
