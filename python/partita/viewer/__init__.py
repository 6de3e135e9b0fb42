"""One self-contained HTML page per run: the mechanism in motion, its reactions, its coordinates.

The page holds everything it needs, opens from disk without a network, and asks for nothing. It shows the
mechanism in 3-D (drag to turn, wheel to zoom), the reaction of every joint as an arrow, and the projective
measure of every coordinate as a bar that moves with time, the independent ones marked.

Modules: `scene` selects what is drawn, `geometry` the shapes of bodies and the view, `couplings` the shapes of gears,
belts, cams and rolling bodies, `hints` and `meshes` shapes given by the user or a file, `curves` the plots, `packing`
thins and stores the arrays, `page` assembles the page. The drawing itself is plain JavaScript beside these files,
inlined in the order of `page.SCRIPTS`. `film` chooses the outputs and writes the file; `stage` draws them with Pillow
on a `sheet`, placed by `pose`. `live` shows a stepper in viser.
"""

from __future__ import annotations

from .live import LiveView
from .page import html, write_html

__all__ = ["html", "write_html", "LiveView"]
