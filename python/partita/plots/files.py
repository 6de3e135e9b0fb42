"""Where a figure is saved."""

from __future__ import annotations

import os
from pathlib import Path

from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.figure import Figure

from ..errors import FileFormatError, MissingFileError

PathLike = str | os.PathLike[str]


def save_figure(figure: Figure, path: PathLike) -> Path:
    """Save in the format of the ending; errors of `figure_path`."""
    target = figure_path(path)
    figure.savefig(target)
    return target


def figure_path(path: PathLike) -> Path:
    """`path` when a figure can be written there: `FileFormatError` for an ending that matplotlib does not write,
    `MissingFileError` when the folder does not exist."""
    target = Path(path)
    endings = sorted(FigureCanvasBase.get_supported_filetypes())
    if target.suffix.lower().lstrip(".") not in endings:
        raise FileFormatError(
            f"cannot save a figure to {str(target)!r}: the ending {target.suffix!r} is not one of {', '.join(endings)}",
            path=str(target),
            line=None,
        )
    if not target.parent.is_dir():
        raise MissingFileError(
            f"cannot save a figure to {str(target)!r}: the folder {str(target.parent)!r} does not exist; make it first",
            path=str(target.parent),
        )
    return target
