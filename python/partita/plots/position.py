"""A mechanism in one position, true to scale, with the names of its joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..numeric import shown
from ..tolerance import EQUAL
from .files import PathLike, save_figure
from .style import new_figure, plain

FloatArray = NDArray[np.float64]

MOST_NAMES = 40
"""Joints that are named in the picture: more names would cover it."""
ALIGNED = 1.0 - EQUAL
"""A direction of the picture nearer to an axis of the world is named by it. Scale: cosine of the angle. Reason: a
rotated axis has rounding."""


class PictureView(Protocol):
    """Input: an image, where its pixels are [m], and names with their places."""

    @property
    def image(self) -> Any: ...
    @property
    def across(self) -> tuple[float, float]: ...
    @property
    def up(self) -> tuple[float, float]: ...
    @property
    def axes(self) -> tuple[FloatArray, FloatArray]: ...
    @property
    def labels(self) -> Mapping[str, tuple[float, float]]: ...


def plot_position(
    title: str, picture: PictureView, warning: str = "", path: PathLike | None = None, ax: Any = None
) -> Figure:
    """The picture in axes in metres, into `ax` where it is given."""
    if ax is not None and not isinstance(ax, Axes):
        raise ArgumentError(f"ax must be axes of matplotlib, not {shown(ax)}", argument="ax")
    axes: Axes = new_figure(7.5, 5.6).subplots() if ax is None else ax
    axes.imshow(np.asarray(picture.image), extent=(*picture.across, *picture.up), interpolation="antialiased")
    names = {name: place for name, place in picture.labels.items() if name}
    shift = 0.012 * (picture.across[1] - picture.across[0])
    for name, (x, y) in list(names.items())[:MOST_NAMES]:
        axes.annotate(plain(name), (x + shift, y + shift), fontsize=8, color="#1d2730")
    axes.set_title(plain(title), loc="left", fontsize=10, fontweight="bold")
    axes.set_xlabel(f"{_named(picture.axes[0])} [m]", fontsize=9)
    axes.set_ylabel(f"{_named(picture.axes[1])} [m]", fontsize=9)
    axes.tick_params(labelsize=8)
    if warning:
        axes.text(0.5, -0.14, plain(warning), transform=axes.transAxes, ha="center", va="top", fontsize=8,
                  color="#b3261e", wrap=True)  # fmt: skip
    figure = axes.get_figure(root=True)
    assert isinstance(figure, Figure)
    if path is not None:
        save_figure(figure, path)
    return figure


def _named(direction: FloatArray) -> str:
    """An axis of the world, or a direction of the view."""
    i = int(np.abs(direction).argmax())
    if abs(direction[i]) < ALIGNED:
        return "in the view"
    return f"{'' if direction[i] > 0 else '-'}{'xyz'[i]}"
