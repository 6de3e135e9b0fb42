"""One self-contained HTML page per run: the mechanism in motion, its reactions, its coordinates.

The page holds everything it needs, opens from disk without a network, and asks for nothing. It shows the
mechanism in 3-D (drag to turn, wheel to zoom), the reaction of every joint as an arrow, and the projective
measure of every coordinate as a bar that moves with time, the independent ones marked.

Rooms: `scene` says what is to be drawn, `geometry` how bodies look and from where they are seen, `couplings` how
gears, belts, cams and what rolls look, `hints` and `meshes` what a person or a file says of looks, `curves` what can be
plotted, `packing` thins and stores the arrays, `page` puts the page together. The drawing itself is plain JavaScript
beside these files, inlined in the order of `page.SCRIPTS`. `film` chooses the outputs and writes the file; `stage`
draws them with Pillow on a `sheet`, placed by `pose`. `live` shows a stepper in viser.
"""

from __future__ import annotations

from .live import LiveView
from .page import html, write_html

__all__ = ["html", "write_html", "LiveView"]
