"""The command `partita`: simulate, compare, report, check, assemble, equilibrium, modes, inverse, list, new, watch,
bench, plot, view, convert, draw, mcp, completion.

Exit codes: 0 done; 1 the run stopped early (its results are still written); 2 bad usage or an error, reported in one
message on stderr; 130 interrupted (what was computed until then is still written)."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from ..errors import PartitaError
from .arguments import parser

__all__ = ["main"]

FAILED, MISUSED, INTERRUPTED = 1, 2, 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line `argv` (default: that of the process) and return its exit code.

    >>> from partita.cli import main
    >>> main(["simulate", "no-such-mechanism"])
    2
    """
    try:
        arguments = parser().parse_args(argv)
    except SystemExit as ending:  # argparse has told the user already
        return ending.code if isinstance(ending.code, int) else MISUSED
    try:
        code: int = arguments.run(arguments)
        sys.stdout.flush()
        return code
    except PartitaError as error:
        return complain(str(error))
    except KeyboardInterrupt:
        print("partita: interrupted; nothing more was written", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader of our output has gone, as in `partita list | head -1`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except OSError as error:
        where = f" {error.filename!r}" if error.filename else ""
        return complain(f"cannot use the file{where}: {error.strerror or error}")


def complain(message: str) -> int:
    """One clear message on stderr."""
    print(f"partita: error: {message}", file=sys.stderr)
    return MISUSED
