"""`Mechanism.placement`: which joints to drive, or to measure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import options as run_options
from ..analyses.placement import PlacedSet, Placement, apart, margins_of, order, ranked, separation, typical
from ..analyses.singularities import body_at, joint_at
from ..analyses.workspace import Workspace
from ..builder.actuators import Actuator, actuators_of
from ..builder.maps import ActuatedModel
from ..errors import ArgumentError
from ..numeric import shown
from ..tolerance import EQUAL
from .models import Modelled, compile
from .ranges import keys_of

FloatArray = NDArray[np.float64]
ACTUATORS, ENCODERS = "actuators", "encoders"
CLOSE = 1e-3
"""Readings nearer to each other do not tell two assemblies apart. Scale: rad; lengths of the mechanism. Reason: the
accuracy of an encoder."""


def placement(self: Modelled, count: int, among: Any = None, *, over: Workspace, of: str = ACTUATORS) -> Placement:
    """Rank all sets of so many actuators, or encoders, by their worst margin over the positions of a workspace.

    Of actuators the margin is that of `inverse_dynamics`: 0 where a motion escapes them. Of encoders it is the same of
    what they measure: 0 where the mechanism moves while they all rest. With one encoder for each degree of freedom
    several assemblies may have the same readings; `further` is the encoder that helps most beside the best set.

    Args:
        count: members of a set: at least as many as degrees of freedom.
        among: candidates, as actuators in `inverse_dynamics`; encoders are coordinates of joints; None: all coordinates
            of joints.
        over: a workspace of this mechanism; for encoders with `assemblies=True`, so that the readings of different
            assemblies are compared as well.
        of: "actuators" or "encoders".

    Returns:
        `Placement`: all sets, the best first, or of very many the best.

    Raises:
        ArgumentError: there are too few candidates, `count` is below the degrees of freedom, or `over` belongs to
            another mechanism.

    >>> import numpy as np
    >>> import partita as pt
    >>> m = pt.catalogue.load("five-bar")
    >>> w = m.workspace({"A": np.linspace(-0.5, 0.5, 5), "E": np.linspace(-0.5, 0.5, 5)})
    >>> len(m.placement(2, over=w))                               # ten pairs of five joints
    10
    """
    run_options.one_of("of", of, (ACTUATORS, ENCODERS))
    model = _model_of(self, over)
    if isinstance(count, bool) or not isinstance(count, int | np.integer):
        raise ArgumentError(f"count must be a whole number, not {shown(count)}", argument="count")
    summary = compile(self, model.coordinates).summary
    wanted = _joints(summary) if among is None else keys_of("among", among)
    chosen = actuators_of(self._description, summary, wanted)
    dof, idle = model.core.degrees_of_freedom(over._start.t, over._start.q)
    if count < dof - idle:
        raise ArgumentError(
            f"count = {count}: the mechanism has {dof - idle} degrees of freedom, and fewer {of} leave a motion out "
            f"everywhere; give at least {dof - idle}",
            argument="count",
        )
    if count > len(chosen):
        raise ArgumentError(
            f"count = {count}: there are {len(chosen)} candidates; name more in among, or give a smaller count",
            argument="count",
        )
    rows = over.q.reshape(-1, over.q.shape[-1])
    scaled, _, length = ActuatedModel(model, chosen).effects(over._start.t, rows)
    readings = _readings(over, chosen, length) if of == ENCODERS else None
    where = np.flatnonzero(np.isfinite(scaled).all(axis=(1, 2)))
    if not len(where):
        raise ArgumentError("over: the workspace has no position in which the constraints are regular", argument="over")
    scaled = scaled[where]
    found, total, exhaustive = ranked(scaled, int(count), dof - idle)
    names = [each.name for each in chosen]

    def placed(which: Sequence[int], margins: FloatArray) -> PlacedSet:
        worst = int(np.argmin(margins))
        index = np.unravel_index(where[worst], over.reached.shape)
        return PlacedSet(
            names=tuple(names[i] for i in which),
            worst=float(margins[worst]),
            typical=typical(margins),
            at=tuple(int(i) for i in index),
            separation=float("nan") if readings is None else separation(readings, which),
        )

    sets = tuple(placed(which, margins) for which, margins in found)
    further, notes = None, list[str]()
    if of == ENCODERS:
        further = _further(scaled, found[0][0], dof - idle, readings, placed)
        notes = _notes(over, sets[0], further)
    return Placement(over.title, of, sets, total, exhaustive, len(where), further, tuple(notes))


def _model_of(self: Modelled, over: Any) -> Any:
    if not isinstance(over, Workspace):
        raise ArgumentError(
            f"over must be a Workspace of this mechanism, as workspace returns it, not {shown(over)}", argument="over"
        )
    own = compile(self, over._model.coordinates)
    if own.summary["name"] != over.title or sorted(own.names) != sorted(over._model.names):
        raise ArgumentError(f"over: the workspace is that of {over.title!r}, not of this mechanism", argument="over")
    return over._model


def _joints(summary: Any) -> list[str]:
    """All coordinates of joints that can be driven by themselves."""
    found = []
    for joint in summary["joints"]:
        axes = joint["axes"]
        if joint["q"][1] == len(axes):
            found += [joint["name"]] if len(axes) == 1 else [f"{joint['name']}.{axis}" for axis in axes]
    return found


def _readings(over: Workspace, chosen: list[Actuator], length: float) -> FloatArray | None:
    """Distances of readings between assemblies (pairs, s); None where the assemblies are not known."""
    bad = next((each.name for each in chosen if len(each.along) != 1 or each.along[0]["of"] != "joint"), None)
    if bad is not None:
        raise ArgumentError(
            f"among: {bad!r} is not the coordinate of a joint, which an encoder measures", argument="among"
        )
    if not over.sheets:
        return None
    model, t = over._model, over._start.t
    turns = np.array([each.effort == "N m" for each in chosen])
    readings, positions = [], []
    for sheet in over.sheets.values():
        q = sheet.reshape(-1, sheet.shape[-1])
        columns = []
        for each in chosen:
            values = joint_at(model, t, q, each.along[0]["joint"]).reshape(len(q), -1)
            columns.append(values[:, each.along[0]["coordinate"]] / (1.0 if each.effort == "N m" else length))
        readings.append(np.column_stack(columns))
        bodies = [body["name"] for body in model.summary["bodies"]]
        corners = [(0.0, 0.0, 0.0), (length, 0.0, 0.0), (0.0, length, 0.0)]
        corners_of_bodies = [body_at(model, t, q, body).point(corner) / length for body in bodies for corner in corners]
        positions.append(np.hstack(corners_of_bodies))
    return apart(readings, positions, turns)


def _further(
    scaled: FloatArray, best: tuple[int, ...], k: int, readings: FloatArray | None, placed: Any
) -> PlacedSet | None:
    """The best set with the encoder that helps most: to tell assemblies apart, or else by the margin."""
    rest = [i for i in range(scaled.shape[2]) if i not in best]
    if not rest:
        return None
    sets = [((*best, i), margins_of(scaled, (*best, i), k)) for i in rest]
    if readings is not None and separation(readings, best) < CLOSE:
        which, margins = max(
            sets, key=lambda found: (separation(readings, found[0]), -order(found)[0], -order(found)[1])
        )
    else:
        which, margins = min(sets, key=order)
    made: PlacedSet = placed(which, margins)
    return made


def _notes(over: Workspace, best: PlacedSet, further: PlacedSet | None) -> list[str]:
    notes = []
    names = ", ".join(best.names)
    if np.isnan(best.separation):
        notes.append(
            "whether readings tell assemblies apart is not known: " + "; ".join(over.notes)
            if over.notes
            else "whether readings tell assemblies apart is not known; pass a workspace with assemblies=True"
        )
    elif np.isinf(best.separation):
        notes.append("there is one assembly at each position of the workspace")
    elif best.separation < CLOSE:
        differ = f"differ by {best.separation:.2g}" if best.separation > EQUAL else "are equal"
        notes.append(f"{names} do not tell all assemblies apart: the readings of two {differ}")
    else:
        notes.append(f"{names} tell the assemblies apart: their readings differ by at least {best.separation:.3g}")
    if further is not None:
        gained = f"margin at least {further.worst:.3g} instead of {best.worst:.3g}"
        separated = (
            ""
            if not np.isfinite(further.separation)
            else f", readings of two assemblies at least {further.separation:.3g} apart"
        )
        notes.append(f"the further encoder that helps most: {further.names[-1]} ({gained}{separated})")
    return notes
