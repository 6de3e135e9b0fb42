"""Save the figures of these scripts and print their numbers."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from matplotlib.figure import Figure

FOLDER = Path("out") / "paper"

Numbers = dict[str, float]
Main = Callable[[bool, Path], Numbers]


def finish(title: str, figure: Figure, path: Path, found: Mapping[str, float]) -> None:
    """Save the figure and print the numbers."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    print(title)
    width = max(map(len, found))
    for name, value in found.items():
        print(f"  {name:<{width}}  {value:.6g}")
    print(f"  {path}")


def run(main: Main) -> None:
    """The script from the command line: `python NAME.py [--short] [FOLDER]`."""
    words = [word for word in sys.argv[1:] if word != "--short"]
    main("--short" in sys.argv, Path(words[0]) if words else FOLDER)
