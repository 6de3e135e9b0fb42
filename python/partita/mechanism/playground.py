"""A mechanism as a page on which it runs: `Mechanism.to_playground`."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .. import options as run_options
from ..errors import ArgumentError
from ..files import put, target
from ..numeric import shown
from ..playground import Program, changeable, functions_of, held, html, program
from ..state import State
from ..viewer.geometry import view
from .models import Modelled, layout_of
from .solve import assemble, convert


def to_playground(
    self: Modelled,
    path: str | PathLike[str],
    *,
    initial: State | None = None,
    title: str | None = None,
    speed: float = 1.0,
) -> Path:
    """Write a page (one HTML file) on which the mechanism runs: change lengths, masses, springs, gravity and drives,
    pull a link, and the page computes the motion with the equations of the core.

    Prefer it for experiments, in teaching or when discussing a design; `Result.to_html` shows one computed run with its
    reactions. The page loads nothing and needs neither Python nor a network.

    Args:
        path: the file, such as "four-bar.html"; an existing one is replaced.
        initial: state to start from; None: the drawing, assembled, at rest.
        title: title of the page; None: the name of the mechanism.
        speed: simulated seconds per second of real time; it can be changed on the page.

    Returns:
        The path.

    Raises:
        DescriptionError: the mechanism contains something that a page cannot compute, which is named: Python functions,
            reaction-dependent friction, drives of spatial rotations.
        AssemblyError: its loops cannot be closed. SingularityError: it starts in a singular position.
        ArgumentError: the state belongs to another mechanism, or speed or title is invalid.
        MissingFileError, FileFormatError: the file cannot be written.

    The equations are recorded with their parameters as inputs and emitted as WebAssembly; choice of coordinates, steps
    (orders 5 and 8, error controlled to 1e-8) and closing are those of docs/playground.md. Each number changes only
    itself: a longer link keeps its mass and inertia. It takes less than a second and half a megabyte for a hundred
    bodies.

    >>> import os, tempfile
    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     m.to_playground(os.path.join(folder, "four-bar.html")).name
    'four-bar.html'
    """
    where = target(path, "a page ")
    if title is not None and not isinstance(title, str):
        raise ArgumentError(f"title must be text, not {shown(title)}", argument="title")
    if initial is not None and not isinstance(initial, State):
        raise ArgumentError(f"initial must be a State, not {type(initial).__name__}", argument="initial")
    pace = run_options.positive("speed", speed)
    made = recorded(self, initial)
    seen = {"planar": bool(layout_of(self, "relative")[0].summary.get("planar")), **_view(self)}
    page = html(made, self.name if title is None else title, seen, pace)
    return put(where, page.encode("utf-8"))


def recorded(self: Modelled, initial: State | None) -> Program:
    """The program of the page."""
    start = assemble(self) if initial is None else convert(self, initial, "relative")
    own = layout_of(self, "relative")[0]
    functions = functions_of(own)
    wide = changed(self)
    description, drives = held(wide._description, own, start.t)
    still = Modelled(self.name, (0.0, 0.0, 0.0), self.drawing_tolerance)
    still._description = description
    model, layout = layout_of(still, "relative")
    q, v = start.q, start.v
    if start.names != model.names:
        q, v = model.core.transferred(own.core, start.q, start.v)
    return program(model, State(start.t, q, v, layout=layout), drives, functions)


def changed(self: Modelled) -> Modelled:
    """The mechanism with the elements that a page may change."""
    wide = Modelled(self.name, (0.0, 0.0, 0.0), self.drawing_tolerance)
    wide._description = changeable(self._description)
    return wide


def _view(self: Modelled) -> dict[str, Any]:
    """View direction: along the common normal of a planar mechanism, else oblique."""
    model = layout_of(self, "relative")[0]
    description = self._description
    points = [joint.point for joint in description.joints.values() if joint.point is not None]
    cloud = np.array(points, dtype=float).reshape(-1, 3) if points else np.zeros((1, 3))
    gravity = np.array(description.gravity, dtype=float)
    normal = None
    if model.summary.get("planar"):
        axes = [
            j.geometry["axis"] for j in description.joints.values() if j.kind == "revolute" and "axis" in j.geometry
        ]
        normal = np.array(axes[0], dtype=float) if axes else np.array([0.0, 0.0, 1.0])
    return view(cloud, gravity if np.any(gravity) else None, normal)
