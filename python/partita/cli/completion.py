"""`partita completion`: the script by which a shell completes the command line."""

from __future__ import annotations

import argparse

from ..extras import extra


def completion(arguments: argparse.Namespace) -> int:
    """Print the script for a shell."""
    shtab = extra("shtab", "completion", "the completion of command lines")
    print(shtab.complete(arguments.words, shell=arguments.shell))
    return 0
