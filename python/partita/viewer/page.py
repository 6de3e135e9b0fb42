"""The page: template, style and scripts of the viewer with one run's data inlined."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from ..errors import ArgumentError
from ..files import put, target
from ..numeric import shown
from ..result_view import ResultView, checked_run, understood
from ..webpage import part_of, whole_page
from .hints import solids, traced
from .scene import describe
from .slim import slim

DRAWS = (
    "data.js", "between.js", "theme.js", "camera.js", "shapes.js", "extent.js", "paths.js", "labels.js", "legends.js",
    "solids.js", "around.js", "scene.js", "tip.js", "pace.js",
    "plots.js",
)  # fmt: skip
"""Scripts without reference to the page of a run: drawing and plots, of playgrounds too."""
SCRIPTS = (*DRAWS, "events.js", "panel.js", "player.js")


def html(
    result: ResultView,
    title: str | None = None,
    *,
    shapes: Mapping[str, Any] | None = None,
    points: Mapping[str, Any] | None = None,
) -> str:
    """The animation of a run as the text of one HTML page.

    Use `write_html` for a file; this is for putting the page elsewhere, such as a notebook or a server.
    The page contains its data, style and scripts, and loads nothing. Lengths are metres, forces newtons.
    At most 1500 outputs are stored, fewer for large mechanisms; the page says so when outputs were left out.
    `title` defaults to the name of the mechanism. Names and titles are escaped: they cannot carry markup.

    `shapes` draws bodies as solids: {body: shape}, a shape or a list of them in body axes [m], each a value of
    `partita.shapes` or one of {"kind": "box", "size": (x, y, z)}, {"kind": "cylinder", "radius": r, "length": l},
    "wheel" with the same words and spokes, {"kind": "ball", "radius": r}, {"kind": "plate", "points": [...]},
    {"kind": "rod", "start": p, "end": p},
    {"kind": "mesh", "file": "part.stl"} (or .obj, .glb, .gltf; `scale` to metres, a number or three; needs the extra
    "meshes"; of large ones as many triangles as can be drawn). All but plates and rods take `center`, cylinders and
    wheels `axis` (z where it is not given), boxes and meshes `axes`, their directions x, y, z. "ground" counts as a
    body. `m.reading.shapes` are those of a robot's file. `points` marks points and traces their paths:
    {name: (body, place in body axes)}. Both change the
    picture only.

    A run of a user-defined `System` has no bodies: its page shows coordinates and read-outs only.

    Raises `ArgumentError` for a result without a single output and for an invalid shape or point, `UnknownNameError`
    with the nearest names for another body, `MissingFileError` and `FileFormatError` for a mesh that does not exist or
    cannot be read. Costs O(outputs x bodies).
    """
    checked_run(result)
    if title is not None and not isinstance(title, str):
        raise ArgumentError(f"title must be text, not {shown(title)}", argument="title")
    if len(result.t) == 0:
        raise ArgumentError(
            "cannot animate a run with no outputs: it stopped before the first one; see result.message",
            argument="result",
        )
    bodies = list(result.names.bodies)
    scene = describe(result, title, solids(shapes, bodies), traced(points, bodies))
    with understood(result):  # numbers that are not finite too
        return whole_page(__package__, scene["title"], slim(scene), SCRIPTS)


def write_html(
    result: ResultView,
    path: str | PathLike[str],
    title: str | None = None,
    *,
    shapes: Mapping[str, Any] | None = None,
    points: Mapping[str, Any] | None = None,
) -> Path:
    """Write the animation of a run to one HTML file that opens from disk, and return its path.

    See `html` for what it shows and holds. An existing file is replaced.

    Raises `MissingFileError` when the folder of `path` does not exist, `FileFormatError` when `path` is a
    folder or cannot be written, `ArgumentError` when the result has no outputs.

    >>> m = partita.catalogue.load("four-bar")                      # doctest: +SKIP
    >>> partita.viewer.write_html(m.simulate(10.0), "four-bar.html")  # doctest: +SKIP
    """
    where = target(path, "a page ")
    return put(where, html(result, title, shapes=shapes, points=points).encode("utf-8"))


def fixed_bytes() -> int:
    """Size of what every page holds: template, style and scripts."""
    return sum(len(part_of(__package__, name).encode("utf-8")) for name in ("page.html", "style.css", *SCRIPTS))
