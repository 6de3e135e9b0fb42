"""Data of a page: the recorded equations of a mechanism, its numbers, and those that users may change."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from ..builder.compiled import CompiledModel
from ..builder.measures import measure_unit
from ..builder.records import Description, LoadRecord
from ..builder.values import Constant
from ..errors import DescriptionError
from ..state import State
from ..tolerance import LONG_ROUNDING

PULL = "pull "
"""The springs of the pointer, one for each body, are named by this and the body."""

SITED = ("revolute", "spherical", "universal", "constant_velocity")
"""Joints whose points on both bodies coincide: lengths are measured between these."""
MOVABLE = (*SITED, "prismatic", "cylindrical")
LOOSE = 1e-6
"""Redundant constraints that are violated by less are satisfied on a page. Scale: size of the row. Reason: as `OPEN`
of the core."""
MOST_NUMBERS = 9
_BOUNDS = {
    "ratio": {"ratio": "not"},
    "radius": {"radius": "not"},
    "radii": {"radius1": "above", "radius2": "above"},
    "length": {"length": "above"},
    "factors": {"factors": "not"},
    "roll": {"radius": "above"},
}


@dataclass(frozen=True)
class Program:
    """The recorded equations: `module` is WebAssembly, `about` contains all other data of the page."""

    module: bytes
    about: dict[str, Any]


def changeable(description: Description) -> Description:
    """The description with the changes that a page allows: the position of each joint on its child, and a spring of
    zero stiffness for each body, from the pointer to a point of it."""
    changed = description.copy()
    for name, joint in description.joints.items():
        if (
            joint.kind in MOVABLE
            and joint.point is not None
            and joint.child_point is None
            and joint.child_frame is None
        ):
            changed.joints[name] = replace(joint, child_point=np.array(joint.point, dtype=float))
    for name in description.bodies:
        spring = f"{PULL}{name}"
        if spring in description.forces:
            raise DescriptionError(
                f'force "{spring}": a playground gives this name to the spring of the pointer; choose another',
                element="force",
                name=spring,
            )
        ends = {"body1": "ground", "point1": np.zeros(3), "body2": name, "point2": np.zeros(3)}
        means = {**ends, "stiffness": 0.0, "damping": 0.0, "length": 0.0}
        changed.store(changed.forces, LoadRecord(spring, "spring", means, means))
    return changed


def held(description: Description, compiled: CompiledModel, t: float) -> tuple[Description, list[dict[str, Any]]]:
    """The description with its drives held at their values at t, and the prescribed motions, which the page
    computes."""
    drawn = json.loads(compiled.description)
    rows = list(compiled.summary["drive_rows"])
    changed, found = description.copy(), list[dict[str, Any]]()
    for number, drive in enumerate(drawn["drives"]):
        name, motion = drive["name"], drive.get("motion", {})
        if "constant" not in motion and "table" not in motion:
            _refuse(
                "drive", name, "it is a Python function or a spatial rotation, which a page cannot compute; use a table"
            )
        joint = next((j for j in compiled.summary["joints"] if j["name"] == drive["measure"].get("joint")), None)
        if drive["level"] == "position" and joint is not None and not joint["tree"]:
            _refuse("drive", name, "its joint closes a loop, where whole turns are not known; drive another joint")
        table = motion.get("table", {"breaks": [], "coefficients": []})
        value = float(motion.get("constant", 0.0))
        recorded = value if drive["level"] == "position" else 0.0
        if table["breaks"] and drive["level"] == "position":
            recorded = _cubic(table, t)
        changed.drives[name] = replace(changed.drives[name], motion=Constant(recorded), level=drive["level"], rate=0.0)
        found.append(
            {
                "name": name,
                "row": rows[number],
                "level": drive["level"],
                "unit": measure_unit(description, drive["measure"]),
                "value": value,
                "recorded": recorded,
                **table,
            }
        )
    return changed, found


def program(model: CompiledModel, state: State, drives: list[dict[str, Any]], functions: list[str]) -> Program:
    """Record the equations of a model that has been made `changeable` and `held`, from a closed state."""
    if functions:
        _refuse("mechanism", str(model.summary["name"]), f"{', '.join(functions)} cannot be computed by a page")
    drawn = json.loads(model.description)
    known = model.core.parameters()
    normal = plane_of(model.summary, drawn)
    massless = {body["name"] for body in drawn["bodies"] if body["mass"] == 0.0}
    names = [name for name, _ in known]
    prescribed = {f"{drive['name']}.{drive['level']}" for drive in drives}  # the page has these among its drives
    chosen = [
        (name, values)
        for name, values in known
        if len(values) <= MOST_NUMBERS
        and names.count(name) == 1
        and name not in prescribed
        and not (name.rpartition(".")[0] in massless and name.rpartition(".")[2] in ("mass", "com", "inertia"))
    ]
    module, reported = model.core.recorded([name for name, _ in chosen], state.t, state.q)
    about = json.loads(reported)
    about |= {
        "drives": drives,
        "values": {name: list(values) for name, values in chosen if name in about["parameters"]},
        "bounds": bounds(drawn),
        "start": {"t": state.t, "q": state.q.tolist(), "v": state.v.tolist()},
        "lengths": lengths(drawn, normal),
        "loose": LOOSE,
        "normal": None if normal is None else normal.tolist(),
        "loops": loops(model.summary),
        "bodies": [body["name"] for body in drawn["bodies"]],
        "joints": [
            {key: joint.get(key) for key in ("name", "kind", "parent", "child", "axis")} for joint in drawn["joints"]
        ],
        "springs": [
            {key: force[key] for key in ("name", "body1", "body2")}
            for force in drawn["forces"]
            if force["kind"] == "spring" and not force["name"].startswith(PULL)
        ],
    }
    return Program(module, about)


def bounds(drawn: Mapping[str, Any]) -> dict[str, str]:
    """Numbers of couplings, rotors and screws that the builder refuses, by parameter: up to 0 ("above"), or 0
    ("not")."""
    found = {f"{joint['name']}.pitch": "not" for joint in drawn["joints"] if joint["kind"] == "screw"}
    for rotor in drawn.get("rotors", ()):
        found |= {f"{rotor['name']}.inertia": "above", f"{rotor['name']}.ratio": "not"}
    for coupling in drawn["couplings"]:
        given = coupling.get("said", "factors" if coupling["kind"] == "linear" else coupling["kind"])
        kind = given if isinstance(given, str) else next(iter(given))
        for word, bound in _BOUNDS.get(kind, {}).items():
            found[f"{coupling['name']}.{word}"] = bound
    return found


def functions_of(compiled: CompiledModel) -> list[str]:
    """Descriptions of the elements that call Python functions, which a page cannot run."""
    drawn = json.loads(compiled.description)
    found = []
    for table, word in (("forces", "force"), ("drives", "drive"), ("couplings", "coupling")):
        found += [f'{word} "{x.get("name", "")}"' for x in drawn.get(table, ()) if _calls(x)]
    return found


def _calls(x: Any) -> bool:
    if isinstance(x, Mapping):
        return any((key == "function" and value is not None) or _calls(value) for key, value in x.items())
    return isinstance(x, list) and any(_calls(value) for value in x)


def plane_of(summary: Mapping[str, Any], drawn: Mapping[str, Any]) -> NDArray[np.float64] | None:
    """Unit normal of the plane of a planar mechanism; None if it is spatial or has no rotation."""
    axes = [joint["axis"] for joint in drawn["joints"] if joint["kind"] == "revolute" and joint.get("axis") is not None]
    if not summary.get("planar") or not axes:
        return None
    axis = np.array(axes[0], dtype=float)
    normal: NDArray[np.float64] = axis / np.linalg.norm(axis)
    return normal


def loops(summary: Mapping[str, Any]) -> dict[str, list[str]]:
    """The bodies of the loop that each joint off the tree closes, in order: from its parent round to its child."""
    beside = dict[str, list[str]]()
    for joint in summary["joints"]:
        if joint["tree"]:
            beside.setdefault(joint["parent"], []).append(joint["child"])
            beside.setdefault(joint["child"], []).append(joint["parent"])
    found = {}
    for joint in summary["joints"]:
        if joint["tree"]:
            continue
        came, waiting = {joint["child"]: ""}, [joint["child"]]
        while waiting:
            body = waiting.pop()
            for other in beside.get(body, ()):
                if other not in came:
                    came[other] = body
                    waiting.append(other)
        path = [joint["parent"]]
        while came.get(path[-1]):
            path.append(came[path[-1]])
        found[joint["name"]] = path
    return found


def lengths(drawn: Mapping[str, Any], normal: NDArray[np.float64] | None) -> list[dict[str, Any]]:
    """Lengths of bodies between their joints, in the plane of a planar mechanism: from the first joint of a body to
    each of its other joints. `moves` is the parameter that changes by `along` per metre of length, relative to
    `origin`."""
    found = []
    for body in ("ground", *(b["name"] for b in drawn["bodies"])):
        sites = list[tuple[str, str, list[float]]]()
        for joint in drawn["joints"]:
            if joint["kind"] not in SITED or joint.get("child_point") is None:
                continue
            # a joint belongs to its child: a body's own frame begins there
            if joint["child"] == body:
                sites.insert(0, (joint["name"], f"{joint['name']}.child_point", joint["child_point"]))
            elif joint["parent"] == body:
                sites.append((joint["name"], f"{joint['name']}.point", joint["point"]))
        for name, parameter, point in sites[1:]:
            line = np.subtract(point, sites[0][2])
            if normal is not None:
                line = line - (line @ normal) * normal
            size = float(np.linalg.norm(line))
            if size > LONG_ROUNDING * float(np.abs([point, sites[0][2]]).max()):
                what = "length" if len(sites) == 2 else f"{sites[0][0]} to {name}"
                along = (line / size).tolist()
                found.append(
                    {
                        "body": body,
                        "what": what,
                        "origin": sites[0][1],
                        "moves": parameter,
                        "along": along,
                        "drawn": size,
                    }
                )
    return found


def _cubic(table: Mapping[str, Any], t: float) -> float:
    """A piecewise cubic at t; its outer pieces extend beyond the table."""
    i = int(np.clip(np.searchsorted(table["breaks"], t, side="right") - 1, 0, len(table["coefficients"]) - 1))
    return float(np.polyval(table["coefficients"][i], t - table["breaks"][i]))


def _refuse(element: str, name: str, why: str) -> NoReturn:
    raise DescriptionError(f'{element} "{name}": {why}', element=element, name=name)
