"""A mechanism as a page on which it runs: `Mechanism.to_playground`."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from pathlib import Path

from .. import options as run_options
from ..errors import ArgumentError
from ..files import put, target
from ..io.toml_writer import document, numbers_of
from ..naming import Names, coordinate_units
from ..numeric import shown
from ..playground import PULL, Program, changeable, functions_of, held, html, program
from ..state import State
from ..viewer.page import DRAWS
from ..viewer.still import scene_of
from .models import Modelled, layout_of
from .seen import still
from .set_valued import without_holding
from .solve import assemble, convert


def to_playground(
    self: Modelled,
    path: str | PathLike[str],
    *,
    initial: State | None = None,
    title: str | None = None,
    speed: float | None = None,
) -> Path:
    """Write a page (one HTML file) on which the mechanism runs: change lengths, masses, springs, gravity and drives,
    pull a link, and the page computes the motion with the equations of the core.

    Prefer it for experiments, in teaching or when discussing a design; `Result.to_html` shows one computed run with its
    reactions. The page loads nothing and needs neither Python nor a network. Changes can be taken back, shared by the
    address of the page, and saved as a model file or a Python script.

    Args:
        path: the file, such as "four-bar.html"; an existing one is replaced.
        initial: state to start from; None: the drawing, assembled, at rest.
        title: title of the page; None: the name of the mechanism.
        speed: simulated seconds per second of real time; None: 1, or so slow that a turn can be followed. It can be
            changed on the page.

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
    pace = None if speed is None else run_options.positive("speed", speed)
    page = playground_page(self, initial, title, pace)
    return put(where, page.encode("utf-8"))


def playground_page(
    self: Modelled, initial: State | None = None, title: str | None = None, speed: float | None = None
) -> str:
    """The page as text. Arguments and errors are those of `to_playground`."""
    name = self.name if title is None else title
    start = _start(self, initial)
    made = recorded(self, start)
    solids = {body.name: numbers_of(body) for body in self._description.bodies.values() if body.solid is not None}
    seen = {"scene": scene_of(still(self, start), name), "toml": _file(self), "solids": solids}
    return html(made, name, seen, speed, ("partita.viewer", DRAWS))


def _start(self: Modelled, initial: State | None) -> State:
    return assemble(self) if initial is None else convert(self, initial, "relative")


def _file(self: Modelled) -> str:
    """The model file in which the page puts the numbers that were changed: bodies with inertias of their own, joints
    with their points on both bodies."""
    wide = changed(self)
    description = wide._description
    for name, body in description.bodies.items():
        description.bodies[name] = replace(body, rod=None)
    for name in [force for force in description.forces if force.startswith(PULL)]:
        del description.forces[name]
    description.sensors.clear()
    return document(wide)


def recorded(self: Modelled, initial: State | None) -> Program:
    """The program of the page."""
    start = _start(self, initial)
    without_holding(self, "a playground")
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
    made = program(model, State(start.t, q, v, layout=layout), drives, functions)
    names = Names.from_summary(model.summary, model.core.nq, model.core.nv, model.core.rows)
    q_units, v_units = coordinate_units(model.summary, names)
    made.about["units"] = dict(zip(names.velocities, v_units, strict=True))
    made.about["plain"] = [
        [name, i, unit]
        for i, (name, unit) in enumerate(zip(names.coordinates, q_units, strict=True))
        if unit in ("rad", "m")
    ]
    return made


def changed(self: Modelled) -> Modelled:
    """The mechanism with the elements that a page may change."""
    wide = Modelled(self.name, (0.0, 0.0, 0.0), self.drawing_tolerance)
    wide._description = changeable(self._description)
    return wide
