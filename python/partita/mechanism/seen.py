"""A mechanism seen without a run: `Mechanism.show`, `to_html`, `plot`, and its display in a notebook."""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import notebook
from ..builder.bodies import to_world
from ..builder.compiled import CompiledModel
from ..builder.gaps import point_of, size_of
from ..builder.records import Description, JointRecord
from ..errors import ArgumentError, PartitaError
from ..extras import extra
from ..files import put, target
from ..numeric import shown
from ..state import State
from ..tolerance import EQUAL
from ..webpage import Page, opened
from .models import Modelled, layout_of
from .solve import _fitting, assemble

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..viewer.still import Gap, Still

FloatArray = NDArray[np.float64]

SIZE = (900, 640)
"""Pixels of a picture in a figure."""
SMALL_SIZE = (480, 320)
"""Pixels of the picture in a notebook."""
MOST_PAINTED = 200
"""Bodies of a mechanism whose picture a notebook shows without being asked: it is painted in less than a second."""


def to_html(
    self: Modelled,
    path: str | os.PathLike[str],
    title: str | None = None,
    *,
    state: State | None = None,
    shapes: Mapping[str, Any] | None = None,
    points: Mapping[str, Any] | None = None,
) -> Path:
    """Write one page with the mechanism in one position, before any run. It opens from disk without a network.

    Prefer it to look at a drawing; `Result.to_html` shows a run. Where the loops of the drawing do not close, the page
    shows the bodies as drawn, the gap between the two points of each open joint with its length, and the reason.

    Args:
        path: the file, such as "four-bar.html"; an existing one is replaced.
        title: None: the name of the mechanism.
        state: the position; None: the drawing, assembled.
        shapes, points: as in `Result.to_html`.

    Raises:
        ArgumentError: the state belongs to another mechanism, or a shape or point is invalid. DescriptionError: there
            is no body. MissingFileError, FileFormatError: the file cannot be written.

    >>> import os, tempfile
    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     m.to_html(os.path.join(folder, "four-bar.html")).name
    'four-bar.html'
    """
    where = target(path, "a page ")
    return put(where, still_text(self, title, state, shapes, points).encode("utf-8"))


def show(
    self: Modelled,
    title: str | None = None,
    *,
    state: State | None = None,
    shapes: Mapping[str, Any] | None = None,
    points: Mapping[str, Any] | None = None,
) -> Page:
    """Show the mechanism in one position: in the browser, or in a notebook below the cell.

    The page is that of `to_html`, in a temporary file. Arguments and errors are those of `to_html`.

    Returns:
        The page, whose `path` is the file.

    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> page = m.show()                                             # doctest: +SKIP
    """
    return opened(still_text(self, title, state, shapes, points))


def plot(
    self: Modelled,
    path: str | os.PathLike[str] | None = None,
    *,
    state: State | None = None,
    ax: Axes | None = None,
    shapes: Mapping[str, Any] | None = None,
    points: Mapping[str, Any] | None = None,
) -> Figure:
    """Draw the mechanism in one position as a Matplotlib figure, true to scale, with the names of its joints.

    Where the loops of the drawing do not close, it is drawn as it is, with the gaps. Nothing is shown on the screen; in
    a notebook the figure displays itself.

    Args:
        path: save the figure too.
        state, shapes, points: as in `to_html`.
        ax: existing Matplotlib axes to draw into.

    Needs the extra "plots". Errors are those of `to_html`.

    >>> import partita as pt
    >>> figure = pt.catalogue.load("four-bar").plot()
    >>> figure.axes[0].get_xlabel()
    'x [m]'
    """
    from ..plots.position import plot_position
    from ..viewer.hints import looking
    from ..viewer.still import picture

    found = still(self, state)
    if not found.bodies:
        raise _nothing(self)
    drawn = looking(shapes, self._looks(), lambda seen: picture(found, SIZE, "", seen, points))
    return plot_position(found.title, drawn, found.message, path, ax)


def _repr_html_(self: Modelled) -> str:
    """A small picture and a table, in a notebook; never an error."""
    d = self._description
    rows = [("bodies", notebook.names(list(d.bodies))), ("joints", notebook.names(list(d.joints)))]
    rows += [
        (word, notebook.names(list(names)))
        for word, names in (("couplings", d.couplings), ("drives", d.drives), ("forces", d.forces))
        if names
    ]
    image = ""
    if d.bodies:
        try:
            found = still(self, None)
            freedom = found.summary.get("mobility")
            if found.message:
                rows.append(("does not close", found.message))
            elif freedom is not None:
                rows.append(("degrees of freedom", f"{freedom} besides the drives" if d.drives else f"{freedom}"))
            if len(d.bodies) <= MOST_PAINTED:
                image = _image(found)
        except PartitaError as error:  # a picture needs Pillow
            rows.append(("picture", error.message))
    return image + notebook.table(self.name, rows)


def still(self: Modelled, state: State | None) -> Still:
    """The mechanism in a state, or its drawing: assembled where it can be, else as drawn with its gaps."""
    if state is not None:
        model, _ = layout_of(self, "relative")
        if not (isinstance(state, State) and state.is_of(model.summary)):
            model = layout_of(self, "absolute")[0]
        _fitting("state", state, model)
        return _closed(self, model, state)
    summary: Mapping[str, Any] | None = None
    try:
        model, _ = layout_of(self, "relative")
        summary = model.summary
        return _closed(self, model, assemble(self))
    except PartitaError as error:
        return _as_drawn(self, summary, error.message)


def _closed(self: Modelled, model: CompiledModel, state: State) -> Still:
    from ..viewer.still import Still, StillBody, StillJoint

    summary = model.summary
    t, q, v = np.array([state.t]), state.q[None], state.v[None]
    bodies = model.core.motion(t, q, v).bodies()
    joints = model.core.motion(t, q, v).joints()
    position = np.asarray(bodies["body_position"]).reshape(1, -1, 3)
    rotation = np.asarray(bodies["body_rotation"]).reshape(1, -1, 3, 3)
    point = np.asarray(joints["joint_point"]).reshape(1, -1, 3)
    coordinates = np.asarray(joints["joint_position"])
    spans = [joint["q"] for joint in summary["joints"]]
    quality: dict[str, Any] = {"sigma": np.full(1, np.nan), "sqrt_mu": np.full(1, np.nan)}
    measure, independent = np.full((1, model.core.nv), np.nan), np.zeros((1, 0), dtype=np.int64)
    try:
        instant = model.at(state.q, state.v, state.t)
        measure, independent = instant.rho[None], np.asarray(instant.independent, dtype=np.int64)[None]
        quality = {"sigma": np.array([instant.sigma]), "sqrt_mu": np.array([instant.sqrt_mu])}
    except PartitaError:  # a singular position has no choice of coordinates, but can be seen
        pass
    return Still(
        title=self.name,
        summary=summary,
        spec=self.to_spec(),
        t=t,
        q=q,
        v=v,
        bodies={body["name"]: StillBody(position[:, i], rotation[:, i]) for i, body in enumerate(summary["bodies"])},
        joints={
            joint["name"]: StillJoint(
                joint["kind"], point[:, j], coordinates[:, spans[j][0] : spans[j][0] + spans[j][1]]
            )
            for j, joint in enumerate(summary["joints"])
        },
        closure=np.array([np.max(np.abs(model.constraints(state.q, t=state.t)), initial=0.0)]),
        measure=measure,
        independent=independent,
        **quality,
    )


def _as_drawn(self: Modelled, summary: Mapping[str, Any] | None, reason: str) -> Still:
    from ..viewer.still import Still, StillBody, StillJoint

    d = self._description
    size = size_of(d)
    ends = [end for joint in d.joints.values() for end in _ends(d, joint, size)]
    seen = {
        "name": d.name,
        "planar": bool(summary and summary.get("planar")),
        "bodies": [{"name": name} for name in d.bodies],
        "joints": [{"name": e.name, "kind": e.joint.kind, "parent": e.parent, "child": e.child} for e in ends],
    }
    spec = self.to_spec()
    by_name = {joint["name"]: joint for joint in spec["joints"]}
    spec["joints"] = [{**by_name[e.joint.name], "name": e.name, "parent": e.parent, "child": e.child} for e in ends]
    counts = {joint["name"]: joint["q"][1] for joint in (summary or {}).get("joints", ())}
    nothing = np.full(1, np.nan)
    return Still(
        title=self.name,
        summary=seen,
        spec=spec,
        t=np.zeros(1),
        q=np.zeros((1, 0)),
        v=np.zeros((1, 0)),
        bodies={name: StillBody(body.position[None], body.rotation[None]) for name, body in d.bodies.items()},
        joints={
            e.name: StillJoint(e.joint.kind, e.point[None], np.zeros((1, counts.get(e.joint.name, 1)))) for e in ends
        },
        closure=nothing,
        measure=np.zeros((1, 0)),
        sigma=nothing,
        sqrt_mu=nothing,
        independent=np.zeros((1, 0), dtype=np.int64),
        message=f"As drawn, not assembled: {reason}",
        gaps=_gaps(d, size),
    )


class _End(NamedTuple):
    """A joint, or the end of an open one on one of its bodies, and where it is drawn."""

    name: str
    joint: JointRecord
    parent: str
    child: str
    point: FloatArray


def _open(d: Description, joint: JointRecord, size: float) -> float:
    """Distance between the two points of a joint as drawn; 0 where they are one."""
    if joint.child_point is None:
        return 0.0
    length = float(np.linalg.norm(joint.child_point - point_of(d, joint)))
    return length if length > EQUAL * size else 0.0


def _ends(d: Description, joint: JointRecord, size: float) -> list[_End]:
    """The joint, or where its points are apart, its end on each body."""
    point = point_of(d, joint)
    if joint.child_point is None or not _open(d, joint, size):
        return [_End(joint.name, joint, joint.parent, joint.child, point)]
    return [
        _End(f"{joint.name} on {joint.parent}", joint, joint.parent, joint.parent, point),
        _End(f"{joint.name} on {joint.child}", joint, joint.child, joint.child, joint.child_point),
    ]


def _gaps(d: Description, size: float) -> list[Gap]:
    """Joints whose two points, and distances whose length, differ as drawn."""
    from ..viewer.still import Gap

    found = []
    for joint in d.joints.values():
        if joint.child_point is not None and (length := _open(d, joint, size)):
            found.append(Gap(f"{joint.name}: {length:.4g} m apart", (point_of(d, joint), joint.child_point)))
    for coupling in d.couplings.values():
        asked = coupling.call[1].get("length") if coupling.word == "distance" else None
        if asked is None:
            continue
        term = coupling.terms[0]
        first, second = (to_world(d, term[f"body{i}"], np.array(term[f"point{i}"])) for i in (1, 2))
        drawn = float(np.linalg.norm(second - first))
        if abs(drawn - asked) > EQUAL * max(size, asked):
            found.append(Gap(f"{coupling.name}: {drawn:.4g} m as drawn, {asked:.4g} m asked for", (first, second)))
    return found


def still_text(
    self: Modelled,
    title: str | None = None,
    state: State | None = None,
    shapes: Mapping[str, Any] | None = None,
    points: Mapping[str, Any] | None = None,
) -> str:
    """The page of `to_html` as text. Arguments and errors are those of `to_html`."""
    from ..viewer.hints import looking
    from ..viewer.still import still_page

    if title is not None and not isinstance(title, str):
        raise ArgumentError(f"title must be text, not {shown(title)}", argument="title")
    found = still(self, state)
    if not found.bodies:
        raise _nothing(self)
    return looking(shapes, self._looks(), lambda seen: still_page(found, title, seen, points))


def _nothing(self: Modelled) -> ArgumentError:
    return ArgumentError(
        f'mechanism "{self.name}" has no body to show; add one with add_body, add_rod or add_solid', argument="self"
    )


def _image(found: Still) -> str:
    """The picture as an element of HTML; `MissingDependencyError` without Pillow."""
    from ..viewer.still import picture

    extra("PIL", "plots", "the picture of a mechanism in a notebook")
    stream = io.BytesIO()
    picture(found, SMALL_SIZE, found.title).image.save(stream, "PNG")
    data = base64.b64encode(stream.getvalue()).decode("ascii")
    width, height = SMALL_SIZE
    return f'<img alt="{escape(found.title)}" width="{width}" height="{height}" src="data:image/png;base64,{data}">'
