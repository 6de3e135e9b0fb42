"""Couplings in six coordinates for each body: what they forbid, row by row.

A reading (a coordinate of a joint, a distance) is a row over all accelerations, a constant, and its rate; a condition
between readings is the same sum of their rows. Rolling is that the body's point of contact rests.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .drawing import Array, Coupling, unit


@dataclass(frozen=True)
class Reading:
    """x'' = row . accelerations + rest, x', x, and whether it is a length."""

    row: Array
    rest: float
    rate: float
    value: float
    length: bool


@dataclass(frozen=True)
class Condition:
    """row . accelerations + rest = 0; how fast it opens, how far (0 where whole turns are not known)."""

    row: Array
    rest: float
    opens: float
    gap: float
    length: bool


def conditions(
    c: Coupling, n: int, read: Callable[[dict[str, Any]], Reading], sides: dict[str, Any], t: float
) -> list[Condition]:
    """What a coupling says at a time. `read` knows the coordinates of joints, `sides` the bodies."""
    data = c.data
    if c.kind == "roll":
        return rolling(data, n, sides)
    terms = [MEASURES[item["of"]](item, n, sides) if item["of"] in MEASURES else read(item) for item in data["terms"]]
    length = any(x.length for x in terms)
    if c.kind in CURVED:
        return [CURVED[c.kind](c, terms, t)]
    if c.kind == "linear":
        weights, gap = data["factors"], 0.0
        if len(terms) == 1 and length:
            gap = weights[0] * terms[0].value - data["offset"]
    elif c.kind == "cam":
        value, slope, bend = data["law"](terms[1].value)
        weights, gap = [1.0, -slope], terms[0].value - value if data["counted"] else 0.0
    else:
        assert c.kind == "curve" and data["periodic"], f"{c.kind} is not read"
        y, slope, bend = spline(data["curve"], terms[1].value)
        weights, gap = [1.0, -slope], terms[0].value - y
    row, rest, opens = (
        sum(f * getattr(x, what) for f, x in zip(weights, terms, strict=True)) for what in ("row", "rest", "rate")
    )
    if c.kind in ("curve", "cam"):
        rest -= bend * terms[1].rate ** 2
    return [Condition(np.asarray(row), float(rest), float(opens), gap, length)]


def follower(c: Coupling, terms: list[Reading], t: float) -> Condition:
    """The first term follows a function of the others, and one of time: x1 = f(x2, ...) + a (sin(w t + p) - sin p)."""
    x = [term.value for term in terms[1:]]
    rates = np.array([term.rate for term in terms[1:]])
    value, slopes, second = c.data["law"].derivatives(np.array(x))
    a, w, p = c.data["swing"]
    row = terms[0].row - sum(f * term.row for f, term in zip(slopes, terms[1:], strict=True))
    rest = terms[0].rest - sum(f * term.rest for f, term in zip(slopes, terms[1:], strict=True))
    rest += -rates @ second @ rates + a * w**2 * np.sin(w * t + p)
    opens = terms[0].rate - slopes @ rates - a * w * np.cos(w * t + p)
    gap = terms[0].value - value - a * (np.sin(w * t + p) - np.sin(p))
    return Condition(row, float(rest), float(opens), float(gap), terms[0].length)


def rates_only(c: Coupling, terms: list[Reading], t: float) -> Condition:
    """Of rates, with coefficients that are functions of the terms: g1 x1' + g2 x2' + ... + g0 = 0."""
    x, rates = np.array([term.value for term in terms]), np.array([term.rate for term in terms])
    found = [law.derivatives(x) for law in c.data["laws"]]
    weights = [value for value, _, _ in found]
    row = sum(g * term.row for g, term in zip(weights, terms, strict=False))
    rest = sum(g * term.rest for g, term in zip(weights, terms, strict=False))
    # of each coefficient how it changes along the motion, times what it belongs to
    rest += sum(float(slopes @ rates) * by for (_, slopes, _), by in zip(found, [*rates, 1.0], strict=False))
    opens = sum(g * by for g, by in zip(weights, [*rates, 1.0], strict=False))
    return Condition(np.asarray(row), float(rest), float(opens), 0.0, terms[0].length)


def outline(c: Coupling, terms: list[Reading], t: float) -> Condition:
    """The distance of (x, y) from the origin is the radius of a closed curve at its angle."""
    x, y = terms
    far, angle = float(np.hypot(x.value, y.value)), float(np.arctan2(y.value, x.value))
    radius, slope, bend = c.data["curve"].derivatives(angle)
    away = (x.value * x.rate + y.value * y.rate) / far
    turning = (x.value * y.rate - y.value * x.rate) / far**2
    # second derivatives of both, less those along x and y
    rest_away = (x.rate**2 + y.rate**2 - away**2) / far
    rest_turning = -2.0 * away * turning / far
    along = np.array([x.value, y.value]) / far - slope * np.array([-y.value, x.value]) / far**2
    row = along[0] * x.row + along[1] * y.row
    rest = along[0] * x.rest + along[1] * y.rest + rest_away - slope * rest_turning - bend * turning**2
    return Condition(row, float(rest), float(away - slope * turning), far - radius, True)


CURVED = {"follower": follower, "rates": rates_only, "outline": outline}


def distance(item: dict[str, Any], n: int, sides: dict[str, Any]) -> Reading:
    """Of the second point from the first."""
    ends = []
    for i in (1, 2):
        side = sides[item[f"body{i}"]]
        arm = side.pose.rotation @ np.array(item[f"point{i}"])
        w, x = side.pose.w, side.pose.x + arm
        own = np.cross(w, np.cross(w, x - side.centre))
        ends.append((side, x, side.pose.u + np.cross(w, arm), own))
    (one, x1, u1, own1), (other, x2, u2, own2) = ends
    along, far, rate = unit(x2 - x1), float(np.linalg.norm(x2 - x1)), u2 - u1
    across = rate - along * (along @ rate)
    row = moved(n, other, x2, along) - moved(n, one, x1, along)
    return Reading(row, float(along @ (own2 - own1) + across @ across / far), float(along @ rate), far, True)


def along(item: dict[str, Any], n: int, sides: dict[str, Any]) -> Reading:
    """Of the second point from the first, along an axis of the first body."""
    one, other = sides[item["body1"]], sides[item["body2"]]
    (x1, u1, own1), (x2, u2, own2) = (motion(side, item[f"point{i}"]) for i, side in ((1, one), (2, other)))
    a = one.pose.rotation @ unit(np.array(item["axis"]))
    turning, gap, rate = np.cross(one.pose.w, a), x2 - x1, u2 - u1
    row = moved(n, other, x2, a) - moved(n, one, x1, a) + turned(n, one, np.cross(a, gap))
    rest = a @ (own2 - own1) + 2.0 * turning @ rate + np.cross(one.pose.w, turning) @ gap
    return Reading(row, float(rest), float(turning @ gap + a @ rate), float(a @ gap), True)


def cosine(item: dict[str, Any], n: int, sides: dict[str, Any]) -> Reading:
    """Of the angle between axes of two bodies."""
    one, other = sides[item["body1"]], sides[item["body2"]]
    a, b = (side.pose.rotation @ unit(np.array(item[f"axis{i}"])) for i, side in ((1, one), (2, other)))
    a1, b1 = np.cross(one.pose.w, a), np.cross(other.pose.w, b)
    row = turned(n, one, np.cross(a, b)) + turned(n, other, np.cross(b, a))
    rest = np.cross(one.pose.w, a1) @ b + a @ np.cross(other.pose.w, b1) + 2.0 * a1 @ b1
    return Reading(row, float(rest), float(a1 @ b + a @ b1), float(a @ b), False)


def motion(side: Any, point: Any) -> tuple[Array, Array, Array]:
    """Place and velocity of a point of a body; what of its acceleration follows from the angular velocity."""
    arm = side.pose.rotation @ np.array(point)
    w, x = side.pose.w, side.pose.x + arm
    return x, side.pose.u + np.cross(w, arm), np.cross(w, np.cross(w, x - side.centre))


def turned(n: int, side: Any, axis: Array) -> Array:
    """The row of a body's angular acceleration along an axis."""
    row = np.zeros(n)
    if side.at is not None:
        row[side.at + 3 : side.at + 6] = axis
    return row


MEASURES = {"distance": distance, "along": along, "cosine": cosine}


def moved(n: int, side: Any, point: Array, axis: Array) -> Array:
    """The row of a point of a body along an axis."""
    row = np.zeros(n)
    if side.at is not None:
        row[side.at : side.at + 3] = axis
        row[side.at + 3 : side.at + 6] = np.cross(point - side.centre, axis)
    return row


def rolling(data: dict[str, Any], n: int, sides: dict[str, Any]) -> list[Condition]:
    """Along the normal, then along two directions in the plane, which the ground carries."""
    assert data["on"] == "ground" and not data["slips"], "only rolling on the ground is read"
    side, normal, radius = sides[data["body"]], unit(np.array(data["normal"])), data["radius"]
    w, turn = side.pose.w, side.pose.rotation
    arm = turn @ np.array(data["center"])
    down, sinking = -radius * normal, np.zeros(3)
    if data["axis"] is not None:
        a = turn @ unit(np.array(data["axis"]))
        turning = np.cross(w, a)
        m, m1 = normal - a * (a @ normal), -turning * (a @ normal) - a * (turning @ normal)
        e = unit(m)
        down, sinking = -radius * e, -radius * (m1 - e * (e @ m1)) / np.linalg.norm(m)
    centre = side.pose.x + arm
    point = centre + down
    # d/dt (velocity of the centre + w x down): the place of contact moves about the centre by `sinking`
    rest = np.cross(w, np.cross(w, centre - side.centre)) + np.cross(w, sinking)
    velocity = side.pose.u + np.cross(w, arm + down)
    gap = float(normal @ (point - np.array(data["point"])))
    axes = (normal, *np.linalg.svd(normal[None])[2][1:])
    return [
        Condition(moved(n, side, point, t), float(t @ rest), float(t @ velocity), gap if k == 0 else 0.0, True)
        for k, t in enumerate(axes)
    ]


def spline(curve: dict[str, Any], x: float) -> tuple[float, float, float]:
    """Value, slope and bend of a periodic curve of cubics, highest power first."""
    breaks, coefficients = np.array(curve["breaks"]), np.array(curve["coefficients"])
    x = breaks[0] + (x - breaks[0]) % (breaks[-1] - breaks[0])
    i = int(np.clip(np.searchsorted(breaks, x, side="right") - 1, 0, len(coefficients) - 1))
    p = np.poly1d(coefficients[i])
    at = x - breaks[i]
    return float(p(at)), float(p.deriv()(at)), float(p.deriv(2)(at))
