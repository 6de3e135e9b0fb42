"""Style of all figures: sizes, colours, legends, and how many lines fit."""

from __future__ import annotations

import re
from collections.abc import Sequence
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from ..result_view import ResultView, given

Canvas = Figure | SubFigure

COLOURS = ("#1f6fb4", "#d95f02", "#1b9e77", "#b03060", "#7570b3", "#a6761d", "#e7298a", "#4d4d4d")
LIMIT = len(COLOURS)
_PARTS = re.compile(r"[^\s._:,/-]*[\s._:,/-]*")
_DOLLAR = re.compile(r"(?<!\\)\$")
ROUND_OFF = 1e-13
"""A logarithmic axis of errors reaches this at least. Scale: 1, or what is drawn there. Reason: so that rounding
stays at its lower end."""
CONSTANT = 1e-4
"""Curves that vary by less are drawn as constant. Scale: fraction of their largest value. Reason: what they are is
seen, what they vary by is not asked for."""
FLOOR = 1e-17
"""Drawn instead of an exact zero on a logarithmic axis. Scale: 1, or what is drawn there. Reason: a tenth of a unit
in the last place."""


def new_figure(width: float, height: float) -> Figure:
    """A figure without a window; `savefig` works everywhere."""
    return Figure(figsize=(width, height), dpi=120, layout="constrained", facecolor="white")


def dressed(ax: Axes, title: str, ylabel: str, *, time_axis: bool = True) -> Axes:
    """Title, labels and a quiet grid."""
    ax.set_title(plain(title), loc="left", fontsize=10, fontweight="bold")
    ax.set_ylabel(plain(ylabel), fontsize=9)
    if time_axis:
        ax.set_xlabel("time [s]", fontsize=9)
    ax.tick_params(labelsize=8)
    ax.grid(True, color="#dddddd", linewidth=0.6)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    ax.set_axisbelow(True)
    ax.margins(x=0.0)
    return ax


def legend(ax: Axes, shown: int, total: int, what: str, right: Axes | None = None) -> None:
    """The legend beside the plot, with a note when not all lines are drawn. Lines of axes `right` come last."""
    title = f"{shown} of {total} {what}" if shown < total else None
    both = [ax.get_legend_handles_labels(), *([] if right is None else [right.get_legend_handles_labels()])]
    if shown:
        ax.legend(
            [handle for handles, _ in both for handle in handles],
            [label for _, labels in both for label in labels],
            loc="upper left",
            bbox_to_anchor=(1.0 if right is None else 1.18, 1.0),
            fontsize=8,
            frameon=False,
            title=title,
            title_fontsize=8,
            handlelength=1.4,
        )


def plain(text: str) -> str:
    """`text` that Matplotlib draws as it is: what stands between two "$" would be typeset as a formula. Applied twice,
    it changes nothing more."""
    return _DOLLAR.sub(r"\\$", text)


def wrapped(name: str, limit: int = 22, rows: int = 4) -> str:
    """`name` in lines of at most `limit` letters, for legends, broken behind a space or a sign where there is one;
    drawn as it is. Only of a name that is longer than all `rows` the end is left out."""
    lines = [""]
    for part in _PARTS.findall(name):
        while len(part) > limit:  # without a sign to break at
            lines.append(part[:limit])
            part = part[limit:]
        if len(lines[-1]) + len(part.rstrip()) > limit:
            lines.append("")
        lines[-1] += part
    kept = [line.rstrip() for line in lines if line.strip()]
    if len(kept) > rows:
        kept = [*kept[: rows - 1], f"{kept[rows - 1][: limit - 1]}…"]
    return plain("\n".join(kept))


def positive(values: NDArray[np.float64], size: float = 1.0) -> NDArray[np.float64]:
    """Absolute values fit for a logarithmic axis, beside others of this size."""
    return np.maximum(np.abs(values), FLOOR * size)


def reporting(result: ResultView, values: NDArray[np.float64], limit: int = LIMIT) -> list[int]:
    """Columns worth a line: those most often independent first, then the ones that move most; at most `limit`."""
    total = values.shape[1]
    if total <= limit:
        return list(range(total))
    often = np.bincount(result.independent[result.independent >= 0], minlength=total)[:total]
    ever = [int(i) for i in np.argsort(-often, kind="stable") if often[i]]
    span = np.ptp(values, axis=0) if len(values) else np.zeros(total)
    order = ever + [int(i) for i in np.argsort(-span, kind="stable") if int(i) not in set(ever)]
    return sorted(order[:limit])


def unit_label(units: Sequence[str]) -> str:
    """`[rad]`, or `[m, rad]` when columns differ; empty when none is known."""
    known = sorted({unit for unit in units if unit not in ("", "1")})
    return plain(f" [{', '.join(known)}]") if known else ""


def headline(result: ResultView, canvas: Canvas) -> None:
    """Name of the mechanism and how the run ended, over the whole figure."""
    colour = "#222222" if result.success else "#a01010"
    canvas.suptitle(plain(f"{result.title}{ending(result)}"), fontsize=12, fontweight="bold", color=colour)


def seal(result: ResultView, figure: Figure) -> None:
    """The verdict on the run, in the upper right corner; the certificate says why. Kinematics and modes have none."""
    certificate = None if given(result) else getattr(result, "certificate", None)
    if certificate is None:
        return
    verdict = str(certificate.verdict)
    words = f"run: {verdict}" if verdict == "valid" else f"run: {verdict}, see run.certificate"
    colour = "#0b6e4f" if verdict == "valid" else "#b3261e"
    figure.text(0.995, 0.995, words, ha="right", va="top", fontsize=9, fontweight="bold", color=colour)


def ending(result: ResultView) -> str:
    """A warning for titles when the run stopped early, else nothing."""
    return "" if result.success else f"  (stopped early: {result.status})"


def empty(ax: Axes, why: str) -> None:
    """A panel with nothing to draw has no frame and states the reason, in lines that fit into it."""
    ax.text(
        0.5, 0.5, plain(fill(why, 30)), transform=ax.transAxes, ha="center", va="center", fontsize=9, color="#666666"
    )
    ax.set_xticks([])
    ax.set_yticks([])
    ax.set_xlabel("")
    ax.set_ylabel("")
    for spine in ax.spines.values():
        spine.set_visible(False)


def level(ax: Axes, values: NDArray[np.float64], least: float) -> None:
    """Do not enlarge round-off: where values vary by no more than `least`, or the ten-thousandth part of what they are,
    the axis spans their size, or ten thousand times `least`."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return
    low, high = float(finite.min()), float(finite.max())
    largest = max(abs(low), abs(high))
    if high - low > max(least, CONSTANT * largest):
        return
    spare = max(largest, least / CONSTANT) or 1.0
    ax.set_ylim(low - 0.5 * spare, high + 0.5 * spare)
