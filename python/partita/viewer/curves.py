"""Curves that can be plotted under the scene: loads of joints, coordinates, sensors, energy."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..naming import coordinate_units
from ..result_view import LOAD_UNITS, ResultView, given, understood
from ..tolerance import NEGLIGIBLE, VISIBLE

FloatArray = NDArray[np.float64]

MOST_COLUMNS = 400
"""More coordinates than this are plotted only where they move most: the page stays small."""
MOST_LINES = 5


def curves(result: ResultView) -> tuple[list[dict[str, Any]], list[int], dict[str, FloatArray]]:
    """Curves of the page, those shown first, and the tables (nt, columns) they are read from."""
    found, tables = _coordinates(result)
    pushed, tables["effort"] = efforts(result)
    found += [
        _curve("drives", f"effort of {drive['name']}", "effort", [i], drive["unit"], [""]) | {"open": drive["open"]}
        for i, drive in enumerate(pushed)
    ]
    known = not given(result)
    found += [
        _load(result, name, what, unit) for name in result.names.joints for what, unit in LOAD_UNITS.items() if known
    ]
    for number, about in enumerate(result.summary.get("sensors", ())):
        values = np.asarray(result.sensor(about["name"]).values, dtype=float).reshape(len(result.t), -1)
        tables[f"sensor{number}"] = values[:, :MOST_LINES]
        count = tables[f"sensor{number}"].shape[1]
        labels = list("xyz") if count == 3 else [""] if count == 1 else [str(i) for i in range(count)]
        found.append(_curve("sensors", about["name"], f"sensor{number}", range(count), _unit(about["unit"]), labels))
    if result.has_energy and known:
        found += [_curve("energy", f"{name} energy", table, [0], "J", [""]) for name, table in ENERGIES]
    return found, _first(result, found), tables


def efforts(result: ResultView) -> tuple[list[dict[str, Any]], FloatArray]:
    """The drives of joints, with the unit of their effort, and these efforts over time (nt, drives)."""
    with understood(result):
        return _efforts(result)


def _efforts(result: ResultView) -> tuple[list[dict[str, Any]], FloatArray]:
    found, columns = [], []
    names = result.names
    v_units = coordinate_units(result.summary, names)[1]
    spans = {joint["name"]: joint.get("state_v") for joint in (result.summary or {}).get("joints", ())}
    for drive in (result.spec or {}).get("drives", ()):
        measure = drive.get("measure", {})
        joint, i = measure.get("joint"), measure.get("coordinate", 0)
        values = np.asarray(getattr(result.joint(joint), "drive", ()), dtype=float) if joint in names.joints else None
        if measure.get("of") != "joint" or values is None or values.ndim != 2 or i >= values.shape[1]:
            continue
        span = spans.get(joint)
        velocity = span[0] + i if span and i < span[1] else None
        unit = "N" if velocity is not None and v_units[velocity] == "m/s" else "N m"
        unique = bool(result.joint(joint).drive_determined[i])
        label = joint if values.shape[1] == 1 else f"{joint}, coordinate {i}"
        found.append({"name": label, "velocity": velocity, "unit": unit, "open": not unique})
        columns.append(values[:, i])
    return found, np.array(columns, dtype=float).reshape(-1, len(result.t)).T


ENERGIES = (("kinetic", "kinetic"), ("potential", "potential"), ("total", "energy"))


def _curve(group: str, name: str, table: str, columns: Any, unit: str, labels: list[str]) -> dict[str, Any]:
    return {
        "group": group, "name": name, "table": table, "columns": [int(i) for i in columns], "unit": unit,
        "labels": labels, "size": False, "open": False,
    }  # fmt: skip


def _coordinates(result: ResultView) -> tuple[list[dict[str, Any]], dict[str, FloatArray]]:
    q, v = np.asarray(result.q, dtype=float), np.asarray(result.v, dtype=float)
    names = result.names
    q_units, v_units = coordinate_units(result.summary, names)
    found, tables = [], {}
    for group, table, values, labels, units in (
        ("coordinates", "q", q, names.coordinates, q_units), ("velocities", "v", v, names.velocities, v_units),
    ):  # fmt: skip
        if table == "v" and given(result):
            continue
        order = np.argsort(-np.ptp(values, axis=0), kind="stable")[: MOST_COLUMNS // 2]
        kept = sorted(int(i) for i in order)
        tables[table] = values[:, kept]
        words = "" if table == "q" else "velocity of "
        for column, i in enumerate(kept):
            found.append(_curve(group, f"{words}{labels[i]}", table, [column], _unit(units[i]), [""]))
    return found, tables


def _load(result: ResultView, name: str, what: str, unit: str) -> dict[str, Any]:
    at = 3 * list(result.names.joints).index(name)
    curve = _curve(f"{what}s of joints", f"{what} in {name}", what, range(at, at + 3), unit, [""])
    return curve | {"size": True, "open": loads_open(result, name)[what == "moment"]}


def _first(result: ResultView, found: list[dict[str, Any]]) -> list[int]:
    """An effort, a coordinate that leads, the joint with the largest force, and the first sensors: three plots; of a
    given motion coordinates."""
    groups = [curve["group"] for curve in found]
    chosen = [i for i, group in enumerate(groups) if group == "drives"][:1]
    if result.independent.size and "velocities" in groups:
        counts = np.bincount(result.independent[result.independent >= 0])
        often = np.flatnonzero(counts == counts.max())
        wanted = f"velocity of {result.names.velocities[often[_moving(np.asarray(result.v)[:, often])[0]]]}"
        chosen += [i for i, curve in enumerate(found) if curve["name"] == wanted][:1]
    sizes = [float(np.nanmax(np.abs(result.joint(name).force), initial=0.0)) for name in result.names.joints]
    if any(sizes):
        wanted = f"force in {result.names.joints[int(np.argmax(sizes))]}"
        chosen += [i for i, curve in enumerate(found) if curve["name"] == wanted][:1]
    chosen += [i for i, group in enumerate(groups) if group == "sensors"][: 3 - len(chosen)]
    chosen += [i for i, group in enumerate(groups) if group == "energy"][: 3 - len(chosen)]
    if chosen or not given(result):
        return chosen
    at = [i for i, group in enumerate(groups) if group == "coordinates"]
    by_name = dict(zip(result.names.coordinates, np.asarray(result.q).T, strict=True))
    return [at[i] for i in _moving(np.array([by_name[found[i]["name"]] for i in at]).T)[:3]] if at else []


def _moving(values: FloatArray) -> list[int]:
    """Columns (nt, n) that change over time, in their order; those that hardly do come after them."""
    spread = np.nan_to_num(np.ptp(values, axis=0))
    return [int(i) for i in np.argsort(spread < VISIBLE * spread.max(initial=0.0), kind="stable")]


def loads_open(result: ResultView, name: str) -> list[bool]:
    """Whether any displayed component of a joint's force and moment is indeterminate (redundant constraints)."""
    joint = result.joint(name).in_frame("joint")
    found = []
    for values, flags in ((joint.force, joint.determined[:3]), (joint.moment, joint.determined[3:])):
        size = float(np.nanmax(np.abs(values), initial=0.0))
        found.append(bool(np.nanmax(np.abs(values[:, ~flags]), initial=0.0) > NEGLIGIBLE * size))
    return found


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit
