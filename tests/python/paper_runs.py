"""The scripts of examples/paper, each run once for all tests."""

from __future__ import annotations

import importlib
import sys
import tempfile
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
SCRIPTS = ROOT / "examples" / "paper"

if str(SCRIPTS) not in sys.path:
    sys.path.insert(0, str(SCRIPTS))


@cache
def folder() -> Path:
    """Where the figures go."""
    return Path(tempfile.mkdtemp(prefix="partita-paper-"))


@cache
def numbers(name: str) -> dict[str, float]:
    """What the script found. The full form of "switching" differs from the short one in timing more often, only."""
    found: dict[str, float] = importlib.import_module(name).main(name == "switching", folder())
    return found
