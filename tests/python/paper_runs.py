"""The scripts of examples/paper, each run once for all tests."""

from __future__ import annotations

import importlib
import sys
import tempfile
from functools import cache
from pathlib import Path

from thorough import either

ROOT = Path(__file__).parents[2]
SCRIPTS = ROOT / "examples" / "paper"

if str(SCRIPTS) not in sys.path:
    sys.path.insert(0, str(SCRIPTS))


SHORT = either(
    {"switching", "four_bar_turn", "frozen", "geometry_four_bar", "geometry_pendulum", "individual", "closing"},
    {"switching"},
)
"""Scripts whose short form finds what is asked for; that of "switching" times less often, only."""


@cache
def folder() -> Path:
    """Where the figures go."""
    return Path(tempfile.mkdtemp(prefix="partita-paper-"))


@cache
def numbers(name: str) -> dict[str, float]:
    """What the script found, in its short form if `SHORT` has it."""
    found: dict[str, float] = importlib.import_module(name).main(name in SHORT, folder())
    return found
