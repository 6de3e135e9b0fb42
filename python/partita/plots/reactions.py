"""Size of the reaction of every joint over time."""

from __future__ import annotations

import numpy as np

from ..readable import Readable
from .joint import level
from .style import COLOURS, LIMIT, Canvas, dressed, empty, legend, shortened


def draw_reactions(result: Readable, canvas: Canvas) -> None:
    """|force| and |moment| of each joint; of many joints, the most loaded. Marked * when not all is unique, dashed
    where what is not unique carries load."""
    upper, lower = canvas.subplots(2, 1, sharex=True)
    dressed(upper, "Forces of the joints", "|force| [N]", time_axis=False)
    dressed(lower, "Moments of the joints", "|moment| [N m]")
    if not result.names.joints:
        for ax in (upper, lower):
            empty(ax, "no joints")
        return
    unique = np.asarray(result.determined[0].all(axis=0), dtype=bool)
    along = np.asarray(result.determined[1].all(axis=0), dtype=bool)
    for ax, key, part in ((upper, "force", slice(0, 3)), (lower, "moment", slice(3, 6))):
        size = np.linalg.norm(result.reactions[key], axis=2)
        peak = np.max(size, axis=0, initial=0.0)
        own = np.einsum("tjab,tja->tjb", result.reactions["joint_rotation"], result.reactions[key])
        loaded_openly = np.max(np.abs(own) * ~along[:, part], axis=(0, 2), initial=0.0) > 1e-9 * peak
        loaded = sorted(int(j) for j in np.argsort(-peak, kind="stable")[:LIMIT])
        for n, j in enumerate(loaded):
            star = "" if unique[j, part].all() else " *"
            dash = "--" if loaded_openly[j] else "-"
            name = shortened(result.names.joints[j]) + star
            ax.plot(result.t, size[:, j], dash, color=COLOURS[n], lw=1.2, label=name)
        legend(ax, len(loaded), size.shape[1], "shown")
        level(ax, size)
    if not unique.all():
        words = "* not all is unique (redundant constraints); dashed: what is not carries load, shared by least squares"
        canvas.supxlabel(words, fontsize=8, color="#555555")
