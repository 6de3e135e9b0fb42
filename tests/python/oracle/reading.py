"""A mechanism of the public face as the independent program reads it: from its description, by nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import partita as pt

from .drawing import Array, Body, Coupling, Drawing, Drive, Joint, Load, Spring, Torque, Torsion


def drawing_of(m: pt.Mechanism, drives: tuple[Drive, ...] = (), known: Mapping[str, Coupling] | None = None) -> Drawing:
    """Closed drawings with numbers for values; of `drives` the functions are given, since a description has none, and
    of couplings by a function all of them, as `known`.

    Constant speeds are read.
    """
    spec = m.to_spec()
    bodies = tuple(body(item) for item in spec["bodies"])
    joints = tuple(joint(item, {b.name: b for b in bodies}) for item in spec["joints"])
    reported = known or {}
    couplings = tuple(
        reported.get(item["name"]) or Coupling(item["name"], item["kind"], item) for item in spec["couplings"]
    )
    points = np.array([*(b.position for b in bodies), *(j.point for j in joints)])
    radius = max((c.data["radius"] for c in couplings if c.kind == "roll"), default=0.0)
    size = max(radius, float(np.linalg.norm(np.ptp(points, axis=0))))
    drives = drives or tuple(map(constant_speed, spec["drives"]))
    return Drawing(
        np.array(spec["gravity"]), bodies, joints, tuple(map(force, spec["forces"])), drives,
        size=size or 1.0, mass=max((b.mass for b in bodies), default=1.0), words=spec["name"],
        couplings=couplings,
    )  # fmt: skip


def body(item: dict[str, Any]) -> Body:
    numbers = {key: np.array(item[key]) for key in ("inertia", "com", "position")}
    return Body(item["name"], item["mass"], rotation=np.array(item["orientation"]), **numbers)


def joint(item: dict[str, Any], bodies: dict[str, Body]) -> Joint:
    """`point` may be left out: the child's origin."""
    assert "child_point" not in item and "child_axis" not in item, "only closed drawings are read"
    assert "followers" not in item, "functions of a joint are not read"
    child = bodies.get(item["child"])
    at = np.array(item["point"]) if item.get("point") is not None else child.position if child else np.zeros(3)
    free, cut = tuple(item.get("free", ())), item.get("cut", "auto")
    bent = np.array(item["child_frame"]) if item["kind"] == "constant_velocity" and "child_frame" in item else None
    return Joint(
        item["name"], item["kind"], item["parent"], item["child"], at, axes(item), free, cut,
        pitch=item.get("pitch", 0.0), bent=bent,
    )  # fmt: skip


def constant_speed(item: dict[str, Any]) -> Drive:
    """Of one coordinate of a joint."""
    assert item["level"] == "velocity" and item["measure"]["of"] == "joint", "only speeds of joints are read"
    measure = item["measure"]
    return Drive(item["name"], measure["joint"], measure["coordinate"], item["motion"]["constant"], 0.0, 0.0)


def axes(item: dict[str, Any]) -> Array:
    """Columns: an axis, two axes, or a frame."""
    if "axis2" in item:
        return np.column_stack([item["axis"], item["axis2"]])
    if "axis" in item:
        return np.array(item["axis"])[:, None]
    return np.array(item["frame"]) if "frame" in item else np.eye(3)


def force(item: dict[str, Any]) -> Any:
    kind = item["kind"]
    if kind == "spring":
        ends = {key: np.array(item[key]) for key in ("point1", "point2")}
        return Spring(
            item["name"], item["body1"], ends["point1"], item["body2"], ends["point2"],
            item["stiffness"], item["damping"], item["length"],
        )  # fmt: skip
    if kind == "torsion_spring":
        return Torsion(
            item["name"], item["joint"], item["coordinate"], item["stiffness"], item["damping"], item["angle"]
        )
    if kind == "torque":
        return Torque(item["name"], item["joint"], item["coordinate"], item["value"]["constant"])
    assert kind == "force", f"{kind} is not read"
    value = np.array([component["constant"] for component in item["value"]])
    return Load(item["name"], item["body"], value, np.array(item["point"]), item["axes"])
