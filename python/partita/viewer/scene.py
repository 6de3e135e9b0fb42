"""Objects to be drawn: one run as plain data for the page."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..result_view import FEW, ResultView, given, happened, scales, turn_between_outputs, understood
from ..shapes import shape_of
from ..tolerance import EQUAL_IN_SIX_DIGITS, LEAST_DIVISOR, NEGLIGIBLE
from .couplings import Pictures, pictures
from .curves import curves, efforts, loads_open
from .geometry import outline, plane_normal, solid_of, view
from .hints import form, stored
from .motion import Motion, motion_of
from .packing import pack_tables
from .slim import slim
from .surroundings import surroundings

FloatArray = NDArray[np.float64]

SLIDING = ("prismatic", "cylindrical", "screw")
ENOUGH = np.radians(10.0)
"""A rotation from output to output that is perceived as motion."""
MOST_SWITCHES = 2000
MOST_FULL = 400
"""Number of switches described in words; beyond it only their times are marked."""
MARKS = 1000
"""Parts of the run of which each has the mark of one event at most, behind the first `MOST_FULL`."""


def describe(
    result: ResultView,
    title: str | None,
    solids: Mapping[int, list[dict[str, Any]]] | None = None,
    traced: Sequence[dict[str, Any]] = (),
    packed: bool = True,
) -> dict[str, Any]:
    """The scene of a run: names, shapes, joints, springs, loads, first view, log of choices, arrays.

    The arrays are thinned and text for a page or, not `packed`, all there is.
    """
    with understood(result):
        return _described(result, title, solids, traced, packed)


def _described(
    result: ResultView,
    title: str | None,
    solids: Mapping[int, list[dict[str, Any]]] | None,
    traced: Sequence[dict[str, Any]],
    packed: bool,
) -> dict[str, Any]:
    summary = result.summary or {}
    spec = result.spec or {}
    certificate = None if given(result) else result.certificate
    motion = motion_of(result)
    joints = _joints(summary, spec, motion, list(result.names.bodies))
    coordinates = {
        name: np.asarray(result.joint(name).position)[:, 0]
        for name in result.names.joints
        if (spec.get("couplings") or spec.get("forces") or spec.get("drives"))
        and np.asarray(result.joint(name).position).shape[1:] == (1,)
    }
    around = surroundings(spec, list(result.names.bodies), joints, coordinates, motion)
    drawn_couplings = pictures(spec, list(result.names.bodies), list(result.names.joints), coordinates, motion.size)
    _seats(spec, motion, joints)
    bodies = _bodies(result, spec, motion, joints, drawn_couplings)
    guessed = _solids(spec, motion, bodies, joints, drawn_couplings)
    for extra in around.parts:  # a ball that touches is drawn in place of a guessed one
        guessed.pop(extra["body"], None)
    for name, joint in zip(result.names.joints, joints, strict=True):
        joint["open"] = loads_open(result, name)
    drawn, first, plotted = curves(result)
    loads, pushed = _loads(result)
    planar = bool(summary.get("planar", False))
    switches = _switches(result)
    seen = _view(spec, motion, joints, planar)
    scene = {
        "title": title or str(summary.get("name") or "") or "mechanism",
        "warning": "" if result.success else f"The run stopped early: {result.message}",
        "verdict": None if certificate is None else certificate.verdict,
        "certificate": "" if certificate is None else str(certificate),
        "trust": [] if certificate is None else _trust(certificate),
        "outputs": len(result.t),
        "planar": planar,
        "size": motion.size,
        "flat": planar and not (seen["azimuth"] or seen["elevation"]),
        "view": seen,
        "bodies": bodies,
        "joints": joints,
        "solids": [{"body": body, "parts": parts} for body, parts in (guessed | dict(solids or {})).items()],
        "wheels": drawn_couplings.wheels,
        "lines": drawn_couplings.lines,
        "rods": [{**rod, "rods": [[0.0, None, 0.55]]} for rod in drawn_couplings.rods],
        "links": drawn_couplings.links,
        "ground": drawn_couplings.ground,
        "floors": around.floors,
        "parts": around.parts,
        "stops": around.stops,
        "coils": around.coils,
        "motors": around.motors,
        "points": list(traced),
        "loads": loads,
        "springs": _between(spec, list(result.names.bodies)),
        "velocities": list(result.names.velocities),
        "drives": efforts(result)[0],
        "apart": _apart(result),
        "given": given(result),
        "switches": switches,
        "switchCount": len(switches),
        "events": _events(result),
        "scales": scales(result),
        "curves": drawn,
        "firstCurves": first,
    }
    tables = _tables(result, motion) | pushed
    if not packed:
        return scene | {"tables": tables}
    choices = _choices(np.asarray(result.independent))
    others = len(json.dumps([slim(scene), choices], separators=(",", ":")))
    centres = [motion.placed(i, np.array(body["com"])) for i, body in enumerate(bodies)]
    positions = np.concatenate([*centres, motion.point.reshape(len(result.t), -1)], axis=1)
    kept = pack_tables(tables | plotted, others, positions)
    return scene | {
        "frames": len(kept.frames),
        "coarse": kept.coarse,
        "strays": kept.strays / motion.size,
        "independent": _choices(np.asarray(result.independent)[kept.frames]),
        "tables": kept.tables,
    }


FINDINGS = 3
"""Findings in the sidebar; the certificate has all."""


def _trust(certificate: Any) -> list[list[str]]:
    """The numbers of a certificate at a glance, [name, value], then its findings, ["", sentence]."""
    numbers = {
        "closure error": certificate.closure,
        "energy balance": certificate.energy_balance,
        "Newton-Euler": certificate.newton_euler,
    }
    known = [[name, f"{x:.1e}" if x else "0"] for name, x in numbers.items() if x is not None]
    return known + [["", finding.sentence] for finding in certificate.findings[:FINDINGS]]


def _apart(result: ResultView) -> dict[str, Any] | None:
    """The coordinate that rotates too far between outputs for lines, its angle [deg], and a sufficient time step."""
    name, step = turn_between_outputs(result)
    if step <= FEW:
        return None
    usual = float(np.median(np.diff(result.t)))
    return {"name": name, "degrees": float(np.degrees(step)), "step": usual * ENOUGH / step}


def _tables(result: ResultView, motion: Motion) -> dict[str, FloatArray]:
    """Everything that changes with time, each (nt, columns)."""
    nt = len(result.t)
    joints = [result.joint(name) for name in result.names.joints]
    tables = {
        "t": np.asarray(result.t, dtype=float).reshape(nt, 1),
        "position": motion.position.reshape(nt, -1),
        "turn": _quaternions(motion.rotation).reshape(nt, -1),
        "rate": motion.rate,
        "spin": motion.spin,
        "force": np.array([j.force for j in joints], dtype=float).reshape(-1, nt, 3).transpose(1, 0, 2),
        "moment": np.array([j.moment for j in joints], dtype=float).reshape(-1, nt, 3).transpose(1, 0, 2),
        "measure": np.asarray(result.measure, dtype=float).reshape(nt, -1),
    }
    tables |= {"closure": result.closure, "sigma": result.sigma, "sqrt_mu": result.sqrt_mu}
    if result.has_energy and not given(result):
        energy = result.energy
        tables |= {"kinetic": energy.kinetic, "potential": energy.potential, "energy": energy.total}
    return {name: table.reshape(nt, -1) for name, table in tables.items()}


def _quaternions(rotation: FloatArray) -> FloatArray:
    """Rotations (nt, nb, 3, 3) as quaternions (nt, nb, 4), scalar last; values that are not finite become identity."""
    nt, nb = rotation.shape[:2]
    if nb == 0:
        return np.empty((nt, 0, 4))
    whole = np.isfinite(rotation).all(axis=(2, 3), keepdims=True)
    from scipy.spatial.transform import Rotation  # takes longer to import than all of Partita

    turns: FloatArray = Rotation.from_matrix(np.where(whole, rotation, np.eye(3)).reshape(-1, 3, 3)).as_quat()
    return turns.reshape(nt, nb, 4)


def _joints(
    summary: Mapping[str, Any], spec: Mapping[str, Any], motion: Motion, names: list[str]
) -> list[dict[str, Any]]:
    index = {name: i for i, name in enumerate(names)} | {"ground": -1}
    drawn = {joint["name"]: joint for joint in spec.get("joints", ())}
    attitudes = {body["name"]: np.array(body["orientation"], dtype=float) for body in spec.get("bodies", ())}
    found = []
    for j, joint in enumerate(summary.get("joints", ())):
        parent, child = index[joint["parent"]], index[joint["child"]]
        point = motion.point[:, j]
        on_parent, on_child = motion.on_body(parent, point), motion.on_body(child, point)
        axis, axis2 = _axes(drawn.get(joint["name"], {}))
        if axis is not None and parent >= 0:
            axis = attitudes[joint["parent"]].T @ axis
        if axis2 is not None and child >= 0:
            axis2 = attitudes[joint["child"]].T @ axis2
        span = joint.get("state_v")
        found.append(
            {
                "name": joint["name"],
                "kind": joint["kind"],
                "parent": parent,
                "child": child,
                "axis": _listed(axis),
                "axis2": _listed(axis2),
                "velocities": list(range(span[0], span[0] + span[1])) if span else [],
                "at": on_child[0].tolist(),
                # A point fixed on the parent shapes the parent; for a point that slides, a rail does.
                "atParent": on_parent[0].tolist() if _rests(on_parent, motion.size) else None,
                "rail": _rail(on_parent, axis, motion.size) if joint["kind"] in SLIDING else None,
            }
        )
    return found


def _lever(joint: Mapping[str, Any]) -> float:
    """Distance of a hinge from its point, as drawn."""
    return float(np.linalg.norm(np.subtract(joint["seat"], joint["at"]))) if joint["seat"] else 0.0


def _ends(joint: Mapping[str, Any]) -> tuple[int, int]:
    return joint["parent"], joint["child"]


def _seats(spec: Mapping[str, Any], motion: Motion, joints: list[dict[str, Any]]) -> None:
    """Hinges whose axes all intersect in one point are drawn where the axes leave a ball about it: `seat` on the child.

    Reactions stay in the point: the place of a hinge on its axis is a matter of drawing, that of its moment is not.
    """
    records = list(spec.get("bodies", ()))
    groups: list[list[int]] = []
    for j, joint in enumerate(joints):
        joint["seat"] = joint["seatParent"] = None
        if joint["kind"] != "revolute" or joint["axis"] is None or joint["atParent"] is None:
            continue
        for group in groups:
            apart = np.nanmax(np.linalg.norm(motion.point[:, j] - motion.point[:, group[0]], axis=1))
            if apart < EQUAL_IN_SIX_DIGITS * motion.size:
                group.append(j)
                break
        else:
            groups.append([j])
    for group in groups:
        bodies = {body for j in group for body in _ends(joints[j])} - {-1}
        others = [j for j, joint in enumerate(joints) if j not in group and bodies & set(_ends(joint))]
        axes = {j: _world(motion, joints[j]["parent"], joints[j]["axis"]) for j in group}
        first = axes[group[0]]
        if (
            len(group) < 3
            or others
            or len(records) != motion.position.shape[1]
            or all(np.linalg.norm(np.cross(first, axis)) < ONE_LINE for axis in axes.values())
        ):
            continue
        around = {
            b: _world(motion, b, records[b]["com"]) + motion.position[0, b] - motion.point[0, group[0]] for b in bodies
        }
        spread = {b: np.trace(np.array(records[b]["inertia"])) / 3.0 for b in bodies}
        turning = [np.sqrt(2.5 * spread[b] / max(records[b]["mass"], LEAST_DIVISOR)) for b in bodies]
        typical = float(np.median([np.linalg.norm(com) for com in around.values()]))
        radius = 1.4 * typical if typical > OFF_CENTRE * max(turning) else 1.3 * max(turning)
        for j in group:
            joint = joints[j]
            lean = sum((around[b] for b in _ends(joint) if b >= 0), np.zeros(3))
            out = (radius if axes[j] @ lean >= -NEGLIGIBLE * radius else -radius) * axes[j]
            for key, at, body in (("seat", "at", joint["child"]), ("seatParent", "atParent", joint["parent"])):
                turn = np.eye(3) if body < 0 else motion.rotation[0, body]
                joint[key] = (np.array(joint[at]) + turn.T @ out).tolist()


ONE_LINE = 0.05
"""Hinges whose axes differ by less are in one line. Scale: sine of the angle. Reason: three degrees."""


OFF_CENTRE = 0.3
"""Bodies whose centres of mass are farther from the point of their axes lie around it. Scale: fraction of their
radius of gyration. Reason: nearer they turn about themselves."""


def _world(motion: Motion, body: int, direction: Any) -> FloatArray:
    """A direction in axes of a body, in the world at the first output."""
    vector = np.array(direction, dtype=float)
    return vector if body < 0 else np.asarray(motion.rotation[0, body] @ vector)


def _axes(drawn: Mapping[str, Any]) -> tuple[FloatArray | None, FloatArray | None]:
    """Axes of a joint in the world of the drawing, where the description gives them."""
    if drawn.get("frame") is not None:
        frame = np.array(drawn["frame"], dtype=float)
        return frame[:, 2], None
    first, second = drawn.get("axis"), drawn.get("axis2")
    return (
        None if first is None else np.array(first, dtype=float) / np.linalg.norm(first),
        None if second is None else np.array(second, dtype=float) / np.linalg.norm(second),
    )


RESTING = 1e-5
"""Points that move by less rest. Scale: fraction of the size of the mechanism. Reason: far less than a pixel, far
above rounding."""


def _rests(points: FloatArray, size: float) -> bool:
    return bool(np.nanmax(np.abs(points - points[0]), initial=0.0) < RESTING * size)


def _rail(points: FloatArray, axis: FloatArray | None, size: float) -> list[list[float]] | None:
    """Ends of the line on the parent along which a joint slid, a little longer than its travel."""
    if axis is None:
        return None
    travel = (points - points[0]) @ axis
    spare = max(0.08 * size, 0.15 * float(np.ptp(travel)))
    return [(points[0] + s * axis).tolist() for s in (np.nanmin(travel) - spare, np.nanmax(travel) + spare)]


def _bodies(
    result: ResultView, spec: Mapping[str, Any], motion: Motion, joints: list[dict[str, Any]], coupled: Pictures
) -> list[dict[str, Any]]:
    """Shape of every body from the joints and springs on it, its hint, and its centre of mass; points in body axes."""
    drawn = {body["name"]: body for body in spec.get("bodies", ())}
    names = list(result.names.bodies)
    held = [*_between(spec, names), *coupled.rods]
    found = []
    for i, name in enumerate(result.names.bodies):
        given = drawn.get(name, {})
        points: list[list[float]] = []
        for joint in joints:
            if joint["kind"] == "free":
                continue
            if joint["child"] == i:
                points.append(joint["at"])
            if joint["parent"] == i and joint["rail"] is not None:
                points += joint["rail"]
            elif joint["parent"] == i and joint["atParent"] is not None:
                points.append(joint["atParent"])
        for spring in held:
            points += [spring[f"point{end}"] for end in (1, 2) if spring[f"body{end}"] == i]
        shape = given.get("shape") or {}
        if shape.get("kind") == "rod":
            points += [[0.0, 0.0, 0.0], [float(shape["length"]), 0.0, 0.0]]
        com = np.array(given.get("com", (0.0, 0.0, 0.0)), dtype=float)
        seats = [joint["seat" if joint["child"] == i else "seatParent"] for joint in joints if i in _ends(joint)]
        if len(seats) > 1 and None not in seats:
            centre = next(
                joint["at"] if joint["child"] == i else joint["atParent"] for joint in joints if i in _ends(joint)
            )
            found.append({"name": name, "com": com.tolist(), "kind": "arc", "points": [centre, *seats]})
            continue
        figure = outline(np.array(points, dtype=float).reshape(-1, 3), com, motion.size)
        if figure["kind"] == "plate" and any(joint["parent"] == i and joint["rail"] is not None for joint in joints):
            figure["kind"] = "frame"  # a plate from a rail to another point would hide the slider on it
        found.append({"name": name, "com": com.tolist(), **figure})
    return found


HIDDEN = 0.25
"""A body whose points are nearer to each other is drawn as the solid of its inertia. Scale: fraction of that solid.
Reason: its rod would lie in it."""
LARGE = 0.8
"""A solid guessed from an inertia is drawn where it is smaller. Scale: fraction of all there is. Reason: a larger one
covers it."""
SMALL = 0.05
"""A solid guessed from an inertia is drawn also where all else is smaller. Scale: fraction of the solid. Reason:
there is nothing else to see."""


def _solids(
    spec: Mapping[str, Any],
    motion: Motion,
    bodies: list[dict[str, Any]],
    joints: list[dict[str, Any]],
    coupled: Pictures,
) -> dict[int, list[dict[str, Any]]]:
    """Bodies of known shape, rolling bodies, and bodies without known points as uniform solids with their mass and
    inertia."""
    found = dict(coupled.rolling)
    drawn = {body["name"]: body for body in spec.get("bodies", ())}
    files: dict[int, Any] = {}
    for i, body in enumerate(bodies):
        shape = drawn.get(body["name"], {}).get("shape") or {}
        if shape.get("kind") == "solid" and "drawn" in shape:
            files[i] = shape["drawn"]
        elif shape.get("kind") == "solid":
            found[i] = form(shape_of(shape["form"]))
    found |= stored(files)
    wheels = {wheel["body"] for wheel in coupled.wheels if not wheel["ring"]}
    wheels |= {joint["child"] for joint in joints if joint["rail"] is not None}  # a slide is drawn as a block
    wheels |= {line["body"] for line in coupled.lines if line["look"] == "cam"}
    for i, body in enumerate(bodies):
        given = drawn.get(body["name"])
        if not given or "inertia" not in given or i in wheels or i in found or body["kind"] not in ("ball", "hammer"):
            continue
        inertia = np.array(given["inertia"], dtype=float)
        solid = solid_of(float(given["mass"]), np.array(given["com"], dtype=float), inertia)
        if solid is None:
            continue
        extent = 2.0 * float(np.sqrt(2.5 * np.trace(inertia) / 3.0 / given["mass"]))
        ends = [np.array(p) for p in body["points"]]
        lever = float(np.linalg.norm(ends[0] - ends[-1]))
        size = max([motion.size, *(2.0 * _lever(joint) for joint in joints)])
        if lever < HIDDEN * extent and (extent < LARGE * size or size < SMALL * extent):
            found[i] = [solid]
            shafts = [joint for joint in joints if joint["child"] == i and joint["seat"]]
            coupled.rods.extend({"body1": i, "point1": j["seat"], "body2": i, "point2": j["at"]} for j in shafts)
    return found


LOOKS: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
    "spring": lambda force: {},
    "rope": lambda force: {"rope": force["length"]},
    "gas_strut": lambda force: {"rods": [[0.0, tube := force["length"] - force["stroke"], 0.9], [tube, None, 0.4]]},
}
"""Loads between two points as they are drawn: a rope of a length; rods, each with its ends on the line and its radius;
else a spring."""


def _between(spec: Mapping[str, Any], names: list[str]) -> list[dict[str, Any]]:
    """What is drawn between two points: its ends and its look."""
    index = {name: i for i, name in enumerate(names)} | {"ground": -1}
    return [
        {
            "name": force.get("name", ""),
            **{f"body{i}": index[force[f"body{i}"]] for i in (1, 2)},
            **{f"point{i}": list(force[f"point{i}"]) for i in (1, 2)},
            **look(force),
        }
        for kind, look in LOOKS.items()
        for force in spec.get("forces", ())
        if force.get("kind") == kind
    ]


def _loads(result: ResultView) -> tuple[list[str], dict[str, FloatArray]]:
    """Names of the loads that act at a point, and a table (nt, 6) of point and force for each, in the world."""
    names: list[str] = []
    tables: dict[str, FloatArray] = {}
    for name, (point, force) in result.applied_forces().items():
        tables[f"load{len(names)}"] = np.concatenate([point, force], axis=1)
        names.append(name)
    return names, tables


def _view(spec: Mapping[str, Any], motion: Motion, joints: list[dict[str, Any]], planar: bool) -> dict[str, Any]:
    points = np.concatenate([motion.position.reshape(-1, 3), motion.point.reshape(-1, 3)])
    points = points[np.isfinite(points).all(axis=1)][:20_000]
    if len(points) == 0:
        points = np.zeros((1, 3))
    gravity = np.array(spec["gravity"], dtype=float) if spec.get("gravity") is not None else None
    if gravity is not None and not np.any(gravity):
        gravity = None
    normal = None
    if planar:
        turning = [j for j in joints if j["kind"] in ("revolute", "planar") and j["axis"] is not None]
        ground = [j for j in turning if j["parent"] < 0]
        normal = np.array(ground[0]["axis"]) if ground else plane_normal(points)
        if normal is None:
            normal = np.array([0.0, 0.0, 1.0])
    layers = motion.point[0] if motion.point.shape[1] else motion.position[0]
    return view(points, gravity, normal, layers[np.isfinite(layers).all(axis=1)])


def _choices(independent: NDArray[Any]) -> list[list[Any]]:
    """Independent velocities as [first frame, indices], one entry per change."""
    choices: list[list[Any]] = []
    for frame, row in enumerate(independent):
        indices = sorted(int(i) for i in row)
        if not choices or choices[-1][1] != indices:
            choices.append([frame, indices])
    return choices


def _switches(result: ResultView) -> list[dict[str, Any]]:
    """The log of switches; the first choice of a run is not one."""
    changes = [change for change in result.partitions if change.entering or change.leaving]
    return [{"t": float(c.t), "entering": list(c.entering), "leaving": list(c.leaving), "reason": str(c.reason)}
            for c in changes[:MOST_FULL]] + [{"t": float(c.t)} for c in changes[MOST_FULL:MOST_SWITCHES]]  # fmt: skip


def _events(result: ResultView) -> dict[str, Any]:
    """Names, the number of events, and [time, number of the name, direction] of the first ones and of one of each part
    of the run after them, with the impulses of joints [number, x, y, z] where velocities jump."""
    events = happened(result)
    names = list(dict.fromkeys([*getattr(events, "names", ()), *(event.name for event in events)]))
    times = np.array([event.t for event in events], dtype=float)
    shown = list(range(min(len(times), MOST_FULL)))
    if len(times) > MOST_FULL:
        span = float(result.t[-1] - result.t[0]) or 1.0
        parts = np.floor((times[MOST_FULL:] - float(result.t[0])) * (MARKS / span))
        shown += (MOST_FULL + np.unique(parts, return_index=True)[1]).tolist()
    number = {name: i for i, name in enumerate(names)}
    rows: list[list[Any]] = [[float(events[i].t), number[events[i].name], int(events[i].direction)] for i in shown]
    joints = {name: j for j, name in enumerate(result.names.joints)}
    for row, i in zip(rows, shown, strict=True):
        given = getattr(events[i], "impulses", {})
        forces = {joints[name]: x.force for name, x in given.items() if name in joints and x.force is not None}
        if forces:
            row.append([[j, *(float(x) for x in force)] for j, force in forces.items()])
    return {"names": names, "count": len(events), "rows": rows}


def _listed(axis: FloatArray | None) -> list[float] | None:
    return None if axis is None else [float(x) for x in axis]
