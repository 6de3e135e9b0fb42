"""The ten mechanisms of examples/solids.py: their known numbers, and every body beside fine meshes of its parts."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita import shapes
from partita.shapes import Box, Cylinder, Disc, Extrusion, Plate, Revolution, Shape, Shell, Sphere, Sum

Array = Any
AROUND = 5000
"""Corners of a circle: its area is right to (2 pi / 5000)^2 / 6 = 3e-7."""


@pytest.fixture(scope="module")
def example() -> ModuleType:
    found = importlib.util.spec_from_file_location(
        "solids_example", Path(__file__).parents[2] / "examples" / "solids.py"
    )
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def ring(figure: Any) -> Array:
    """Corners counterclockwise."""
    if isinstance(figure[1], float):
        angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
        return np.array(figure[0]) + figure[1] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corners = np.array(figure)
    after = np.roll(corners, -1, axis=0)
    turns = (corners[:, 0] * after[:, 1] - corners[:, 1] * after[:, 0]).sum() > 0
    return corners if turns else corners[::-1]


def prism(figure: Any, low: float, high: float) -> Array:
    """Triangles (m, 3, 3) around a prism; its ends by fans from their first corners, whose signs are right by the
    divergence theorem."""
    around = ring(figure)
    below, above = (np.hstack([around, np.full((len(around), 1), z)]) for z in (low, high))
    after, over = np.roll(below, -1, axis=0), np.roll(above, -1, axis=0)
    cap = [np.stack([np.broadcast_to(end[0], end[1:-1].shape), end[1:-1], end[2:]], axis=1) for end in (below, above)]
    return np.concatenate(
        [cap[0][:, ::-1], cap[1], np.stack([below, after, over], 1), np.stack([below, over, above], 1)]
    )


def turned(profile: Any, around: int = AROUND) -> Array:
    """Triangles around a turned part."""
    corners, angle = ring(profile), 2.0 * np.pi * np.arange(around + 1) / around
    rows = np.stack([np.outer(corners[:, 0], np.cos(angle)), np.outer(corners[:, 0], np.sin(angle)),
                     np.broadcast_to(corners[:, 1:], (len(corners), len(angle)))], axis=2)  # fmt: skip
    after = np.roll(rows, -1, axis=0)
    a, b, c, d = rows[:, :-1], rows[:, 1:], after[:, 1:], after[:, :-1]
    return np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3, 3), np.stack([a, c, d], 2).reshape(-1, 3, 3)])


def meshes(shape: Shape) -> list[tuple[float, Array]]:
    """Triangles with the sign of what they enclose."""
    match shape:
        case Sum(parts):
            return [
                (-sign if part.hole else sign, three @ np.array(part.orientation).T + np.array(part.position))
                for part in parts
                for sign, three in meshes(part.shape)
            ]
        case Disc(radius, length) | Cylinder(radius, length, 0.0):
            return [(1.0, prism(((0.0, 0.0), radius), -length / 2, length / 2))]
        case Cylinder(radius, length, inner):
            return [
                (sign, prism(((0.0, 0.0), r), -length / 2, length / 2)) for sign, r in ((1.0, radius), (-1.0, inner))
            ]
        case Box((x, y, z)):
            return [(1.0, prism([(-x / 2, -y / 2), (x / 2, -y / 2), (x / 2, y / 2), (-x / 2, y / 2)], -z / 2, z / 2))]
        case Plate(outline, thick, holes):
            return [
                (sign, prism(f, -thick / 2, thick / 2)) for sign, f in ((1.0, outline), *((-1.0, h) for h in holes))
            ]
        case Extrusion(outline, length, holes):
            return [(sign, prism(f, 0.0, length)) for sign, f in ((1.0, outline), *((-1.0, h) for h in holes))]
        case Revolution(profile):
            return [(1.0, turned(profile))]
        case Sphere(radius):
            rows = {n: radius * np.exp(1j * np.pi * (np.arange(n + 1) / n - 0.5)) for n in (100, 200)}
            coarse, fine = (turned(np.stack([p.real, p.imag], axis=1), 2 * n) for n, p in rows.items())
            return [(4.0 / 3.0, fine), (-1.0 / 3.0, coarse)]  # the error of second order is gone
        case Shell(Box(size), wall):
            return meshes(Box(size)) + [(-1.0, three) for _, three in meshes(Box([side - 2 * wall for side in size]))]
    raise AssertionError(shape)


def moments(shape: Shape) -> tuple[float, Array, Array]:
    """Volume, first and second moments about the origin, over tetrahedra from there."""
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for sign, three in meshes(shape):
        each = sign * np.linalg.det(three) / 6.0
        corners = three.sum(axis=1)
        volume += each.sum()
        first += each @ corners / 4.0
        for points in (*three.transpose(1, 0, 2), corners):
            second += (each[:, None] * points).T @ points / 20.0
    return volume, first, second


def test_ten_mechanisms_know_their_numbers(example: ModuleType, tmp_path: Path, capsys: Any) -> None:
    assert example.main(None) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 11 and max(float(line.split()[-1]) for line in lines[:-1]) < 1e-10


def test_their_bodies_are_those_of_fine_meshes(example: ModuleType) -> None:
    count = 0
    for make in example.CASES:
        m: pt.Mechanism = make().mechanism
        for body in m.bodies.values():
            volume, first, second = moments(body.shape)
            middle, size = first / volume, max(map(float, np.ptp(body.shape.skin.points, axis=0)))
            central = second - volume * np.outer(middle, middle)
            inertia = body.density * (np.trace(central) * np.eye(3) - central)
            assert body.mass == pytest.approx(body.density * volume, rel=1e-6)
            assert np.abs(body.com - middle).max() < 1e-6 * size
            assert np.abs(body.inertia - inertia).max() < 1e-6 * inertia.max()
            count += 1
    assert count == 15 and {"steel", "brass", "oak"} <= set(shapes.MATERIALS)
