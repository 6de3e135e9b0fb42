"""Where a figure is saved."""

from __future__ import annotations

import os
from io import BytesIO
from pathlib import Path

from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.figure import Figure

from ..errors import FileFormatError
from ..files import put, target

PathLike = str | os.PathLike[str]


def save_figure(figure: Figure, path: PathLike) -> Path:
    """Save in the format of the ending; raises the errors of `figure_path`, and `FileFormatError` on a full disk."""
    where = figure_path(path)
    stream = BytesIO()
    figure.savefig(stream, format=where.suffix.lower().lstrip("."))
    return put(where, stream.getvalue())


def figure_path(path: PathLike) -> Path:
    """`path` when a figure can be written there: `FileFormatError` for an ending that matplotlib does not write,
    `MissingFileError` when the folder does not exist."""
    where = target(path, "a figure ")
    endings = sorted(FigureCanvasBase.get_supported_filetypes())
    if where.suffix.lower().lstrip(".") not in endings:
        raise FileFormatError(
            f"cannot save a figure to {str(where)!r}: the ending {where.suffix!r} is not one of {', '.join(endings)}",
            path=str(where),
            line=None,
        )
    return where
