"""The ten tools: what each does and which arguments it takes, as JSON Schema."""

from __future__ import annotations

from typing import Any

from ...options import METHODS
from .limits import MEMBERS, OUTPUTS, TEXT

_NAME = {"type": "string", "minLength": 1, "maxLength": 300}
MODELS: dict[str, Any] = {
    "model": {
        "type": "string",
        "maxLength": TEXT,
        "description": "the mechanism as TOML text; describe without a model shows an example",
    },
    "file": _NAME | {"description": "a model file in the folder of the server, by its relative path"},
    "catalogue": _NAME | {"description": "a mechanism of the catalogue by its name, such as four-bar"},
}
"""Arguments that name the mechanism; a call has one of them."""

_SETTINGS: dict[str, Any] = {
    "type": "object",
    "maxProperties": 100,
    "additionalProperties": {
        "anyOf": [
            {"type": "number"},
            {"type": "string", "maxLength": 100},
            {"type": "array", "items": {"type": "number"}, "maxItems": 7},
        ],
        "description": "a number [SI], text with its unit, or a list of numbers",
    },
}
_START: dict[str, Any] = {
    "targets": _SETTINGS
    | {"description": "joint -> position at the start [rad or m], or text with its unit: '30 deg'"},
    "rates": _SETTINGS | {"description": "joint -> velocity at the start [rad/s or m/s], or text: '60 rpm'"},
}
_RUN: dict[str, Any] = {
    "duration": {
        "anyOf": [{"type": "number", "exclusiveMinimum": 0}, {"type": "string", "maxLength": 100}],
        "description": "length of the run [s], or text: '500 ms'; a catalogue name has a default",
    },
    "outputs": {
        "type": "integer",
        "minimum": 2,
        "maximum": OUTPUTS,
        "description": f"number of evenly spaced outputs (default 101, at most {OUTPUTS})",
    },
    "rtol": {"type": "number", "exclusiveMinimum": 0, "description": "relative tolerance (default 1e-8)"},
    "atol": {"type": "number", "exclusiveMinimum": 0, "description": "absolute tolerance (default 1e-10)"},
    "method": {"enum": list(METHODS), "description": "integrator (default dop853; stiff mechanisms: radau or auto)"},
}
_FORMAT = {"enum": ["png", "svg"], "description": "default png"}
_JOINTS = {"type": "array", "items": _NAME, "maxItems": 100, "description": "names of joints (default: all)"}


def _schema(*groups: dict[str, Any], **own: Any) -> dict[str, Any]:
    """An object with these properties and no others. That a call names one model is checked beside: assistants refuse
    alternatives at the top of a schema."""
    properties: dict[str, Any] = {}
    for group in (MODELS, *groups, own):
        properties |= group
    return {"type": "object", "properties": properties, "additionalProperties": False}


TOOLS: dict[str, tuple[str, dict[str, Any]]] = {
    "describe": (
        "Elements, coordinates and parameters of a mechanism. Without a model: the files of the folder, the catalogue, "
        "an example of a model in TOML, and the limits of a call.",
        _schema(),
    ),
    "check": (
        "Look for mistakes before a run: loops that do not close, points in wrong axes, bodies that nothing holds, "
        "redundant constraints and which joints to replace.",
        _schema(),
    ),
    "draw": (
        "Picture of a mechanism in one position. Where its loops do not close it is drawn as given, with the gaps.",
        _schema(_START, format=_FORMAT),
    ),
    "assemble": ("Close the loops: positions and velocities of all coordinates.", _schema(_START)),
    "run": (
        "Simulate: coordinates and velocities over time, with the certificate of the run, its verdict (valid, suspect "
        "or invalid) and its notes.",
        _schema(_START, _RUN),
    ),
    "report": (
        "Mobility, redundancy with remedies, choice of coordinates, and which reactions are determined.",
        _schema(_START),
    ),
    "reactions": (
        "Simulate, and return for each joint the largest reaction force [N] and moment [N m], in world axes, when they "
        "occur, and which components are determined (the others have no unique value, and do not count).",
        _schema(_START, _RUN, joints=_JOINTS, series={"type": "boolean", "description": "also values over time"}),
    ),
    "sweep": (
        "Simulate every member of a grid of parameters (named as by describe, such as crank.mass): verdict and largest "
        "reaction of each joint. A member that fails says why; the others go on.",
        _schema(
            _START,
            _RUN,
            joints=_JOINTS,
            parameters={
                "type": "object",
                "minProperties": 1,
                "maxProperties": 8,
                "additionalProperties": {
                    "type": "array",
                    "items": {"type": "number"},
                    "minItems": 1,
                    "maxItems": MEMBERS,
                    "uniqueItems": True,
                },
                "description": f"parameter -> values (SI); at most {MEMBERS} members in all",
            },
        ),
    ),
    "plot": (
        "Simulate, and plot: overview, coordinates, velocities, accelerations, reactions, energy, measure, closure, or "
        "a joint or sensor by name.",
        _schema(_START, _RUN, what={"type": "array", "items": _NAME, "maxItems": 8}, format=_FORMAT),
    ),
    "export": (
        "Write the mechanism as toml, urdf, html (a page that moves if a duration is given) or c (its accelerations). "
        "Returns the text, or writes new files into the folder if `to` is given.",
        _schema(
            _START,
            _RUN,
            format={"enum": ["toml", "urdf", "html", "c"]},
            to=_NAME | {"description": "name of a file in the folder of the server that does not exist yet"},
        ),
    ),
}
for _tool, _required in (("sweep", ["parameters"]), ("export", ["format"])):
    TOOLS[_tool][1]["required"] = _required
