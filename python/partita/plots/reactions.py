"""Size of the reaction of every joint over time."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ..result_view import LOAD_UNITS, ResultView, least
from ..tolerance import NEGLIGIBLE
from .abscissa import Abscissa, abscissa
from .events import mark_events
from .style import COLOURS, LIMIT, Canvas, dressed, empty, legend, level, wrapped

PARTS = {"force": (slice(0, 3), "Forces of the joints", "|force| [N]"),
         "moment": (slice(3, 6), "Moments of the joints", "|moment| [N m]")}  # fmt: skip


def draw_reactions(result: ResultView, canvas: Canvas, x: Abscissa | None = None) -> None:
    """|force| and |moment| of each joint; of many joints, the most loaded. Dashed and marked * where it is not
    unique."""
    shown = [key for key in PARTS if carries(result, key)]
    panels = canvas.subplots(max(1, len(shown)), 1, sharex=True, squeeze=False)[:, 0]
    notes = {
        draw_loads(result, ax, key, x, names=ax is panels[0])
        for ax, key in zip(panels, shown or ["force"], strict=True)
    } - {""}
    for upper in panels[:-1]:
        upper.set_xlabel("")
    if len(shown) == 1:  # an empty panel would take half of the space to say the same
        notes.add(f"no joint carries a {next(key for key in PARTS if key not in shown)}")
    if notes:
        canvas.supxlabel("; ".join(sorted(notes)), fontsize=8, color="#555555")


def carries(result: ResultView, key: str) -> bool:
    """Whether any joint has a force, or a moment, above rounding."""
    if not result.names.joints:
        return False
    return float(np.nanmax(np.abs(result.at_once.reactions[key]), initial=0.0)) > least(result, LOAD_UNITS[key])


def draw_loads(result: ResultView, ax: Axes, key: str, x: Abscissa | None = None, names: bool = False) -> str:
    """|force| or |moment| of the most loaded joints in one panel, with a note on those that are not unique; with
    `names` those of events.

    A joint is marked only where an indeterminate part of its load is nonzero, and only if other joints are not: a star
    on every line would have no meaning.
    """
    x = x or abscissa(result, None)
    part, title, label = PARTS[key]
    dressed(ax, title, label)
    x.dress(ax)
    if not result.names.joints:
        empty(ax, "no joints")
        return ""
    size, small = np.linalg.norm(result.at_once.reactions[key], axis=2), least(result, LOAD_UNITS[key])
    peak = np.nanmax(size, axis=0, initial=0.0)
    if not carries(result, key):
        empty(ax, f"no joint carries a {key}")
        return ""
    own = np.einsum("tjab,tja->tjb", result.at_once.reactions["joint_rotation"], result.at_once.reactions[key])
    along = np.asarray(result.at_once.determined[1].all(axis=0), dtype=bool)
    openly = np.nanmax(np.abs(own) * ~along[:, part], axis=(0, 2), initial=0.0) > np.maximum(small, NEGLIGIBLE * peak)
    loaded = [int(j) for j in np.argsort(-peak, kind="stable")[:LIMIT]]
    loaded = sorted(j for j in loaded if peak[j] > small) or sorted(loaded)
    everywhere = all(openly[j] for j in loaded)
    for n, j in enumerate(loaded):
        star = " *" if openly[j] and not everywhere else ""
        name = wrapped(result.names.joints[j]) + star
        x.plot(ax, size[:, j], "--" if openly[j] else "-", color=COLOURS[n], lw=1.2, label=name)
    legend(ax, len(loaded), size.shape[1], "shown")
    level(ax, size, small)
    if x.is_time:
        mark_events(ax, result, names=names)
    if not any(openly[j] for j in loaded):
        return ""
    rule = "shared by least squares"
    if everywhere:
        return f"dashed or hollow: no {key} here is unique, {rule}"
    return f"* and dashed or hollow: not unique (redundant constraints), {rule}"
