"""Bodies made of shapes: closed forms against integrals found otherwise, sums, files, changes, pictures."""

from __future__ import annotations

import copy
import pickle
from collections import Counter
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita import shapes
from partita.errors import ArgumentError, DescriptionError, FileFormatError, UnknownNameError
from partita.io.toml_writer import document
from partita.shapes import Box, Cylinder, Disc, Extrusion, Plate, Revolution, Shape, Shell, Sphere
from partita.viewer.hints import solids
from partita.viewer.scene import describe

Array = Any
EXACT = 1e-12
"""Closed forms against quadrature of as many digits, relative."""
AT, WEIGHT = np.polynomial.legendre.leggauss(12)
L_SHAPE = [(0.0, 0.0), (0.2, 0.0), (0.2, 0.05), (0.06, 0.05), (0.06, 0.15), (0.0, 0.15)]
NOTCHED = [(0.03, -0.02), (0.1, -0.03), (0.08, 0.01), (0.11, 0.05), (0.04, 0.06), (0.06, 0.02)]


def lengths(a: float, b: float) -> tuple[Array, Array]:
    """Nodes and weights of Gauss in an interval."""
    return 0.5 * (a + b) + 0.5 * (b - a) * AT, 0.5 * (b - a) * WEIGHT


def summed(points: Array, weights: Array) -> tuple[float, Array, Array]:
    """Volume, centroid, and inertia about it, of points with weights."""
    volume = float(weights.sum())
    middle = weights @ points / volume
    out = points - middle
    second = np.einsum("n,ni,nj->ij", weights, out, out)
    return volume, middle, np.trace(second) * np.eye(3) - second


def of_tube(radius: float, inner: float, length: float) -> tuple[float, Array, Array]:
    """By quadrature in cylindrical coordinates; sums around are exact."""
    (r, wr), (z, wz) = lengths(inner, radius), lengths(-0.5 * length, 0.5 * length)
    angle = np.arange(12) * np.pi / 6
    R, A, Z = np.meshgrid(r, angle, z, indexing="ij")
    weights = (wr * r)[:, None, None] * np.full(12, np.pi / 6)[None, :, None] * wz
    return summed(np.stack([R * np.cos(A), R * np.sin(A), Z], axis=-1).reshape(-1, 3), weights.ravel())


def of_ball(radius: float) -> tuple[float, Array, Array]:
    (r, wr), (c, wc) = lengths(0.0, radius), lengths(-1.0, 1.0)
    angle = np.arange(12) * np.pi / 6
    R, A, C = np.meshgrid(r, angle, c, indexing="ij")
    out = R * np.sqrt(1.0 - C**2)
    weights = (wr * r**2)[:, None, None] * np.full(12, np.pi / 6)[None, :, None] * wc
    return summed(np.stack([out * np.cos(A), out * np.sin(A), R * C], axis=-1).reshape(-1, 3), weights.ravel())


def of_box(size: tuple[float, float, float]) -> tuple[float, Array, Array]:
    (x, wx), (y, wy), (z, wz) = (lengths(-0.5 * side, 0.5 * side) for side in size)
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    return summed(points, np.einsum("i,j,k->ijk", wx, wy, wz).ravel())


def of_surface(shape: Shape) -> tuple[float, Array, Array]:
    """By the divergence theorem: a tetrahedron from one corner to each triangle, integrated by its corners."""
    origin = shape.skin.points[0]
    a, b, c = ((shape.skin.points - origin)[shape.skin.faces[:, k]] for k in range(3))
    each = np.einsum("ni,ni->n", a, np.cross(b, c)) / 6.0
    volume = float(each.sum())
    corner_sum = a + b + c
    middle = each @ corner_sum / (4.0 * volume)
    second = sum(np.einsum("n,ni,nj->ij", each / 20.0, p, p) for p in (a, b, c, corner_sum))
    second = second - volume * np.outer(middle, middle)
    return volume, origin + middle, np.trace(second) * np.eye(3) - second


def of_profile(profile: list[tuple[float, float]]) -> tuple[float, Array, Array]:
    """A turned part, by quadrature over the triangles of a fan, with their signs, and around."""
    ring, angle = np.array(profile), np.arange(12) * np.pi / 6
    points, weights = [], []
    u, wu = lengths(0.0, 1.0)
    for k in range(1, len(ring) - 1):
        p, q = ring[k] - ring[0], ring[k + 1] - ring[0]
        signed = p[0] * q[1] - p[1] * q[0]
        for s, ws in zip(u, wu, strict=True):
            for t, wt in zip(u, wu, strict=True):
                r, z = ring[0] + s * (1 - t) * p + s * t * q
                points += [(r * np.cos(a), r * np.sin(a), z) for a in angle]
                weights += [signed * s * ws * wt * r * np.pi / 6] * len(angle)
    found = np.array(weights)
    return summed(np.array(points), found if found.sum() > 0 else -found)


def agree(shape: Shape, found: tuple[float, Array, Array], within: float = EXACT) -> None:
    volume, middle, inertia = found
    size = float(np.ptp(shape.skin.points, axis=0).max())
    assert shape.volume == pytest.approx(volume, rel=within)
    assert np.abs(shape.centroid - middle).max() < within * size
    assert np.abs(shape.inertia - inertia).max() < within * np.abs(inertia).max()


def moved(found: tuple[float, Array, Array], z: float) -> tuple[float, Array, Array]:
    """The same body farther along z."""
    return found[0], found[1] + [0.0, 0.0, z], found[2]


def without(whole: tuple[float, Array, Array], part: tuple[float, Array, Array]) -> tuple[float, Array, Array]:
    """A body and what is taken off it, by parallel axes."""
    volume = whole[0] - part[0]
    middle = (whole[0] * whole[1] - part[0] * part[1]) / volume

    def about(body: tuple[float, Array, Array]) -> Array:
        out = body[1] - middle
        return body[2] + body[0] * (out @ out * np.eye(3) - np.outer(out, out))

    return volume, middle, about(whole) - about(part)


CLOSED_FORMS = [
    (Disc(0.13, 0.02), of_tube(0.13, 0.0, 0.02)),
    (Cylinder(0.02, 0.3), of_tube(0.02, 0.0, 0.3)),
    (Cylinder(0.05, 0.11, 0.049), of_tube(0.05, 0.049, 0.11)),
    (Sphere(0.07), of_ball(0.07)),
    (Box((0.1, 0.2, 0.35)), of_box((0.1, 0.2, 0.35))),
    (Plate(((0.0, 0.0), 0.13), 0.02), of_tube(0.13, 0.0, 0.02)),
    (Plate(((0.0, 0.0), 0.05), 0.11, holes=[((0.0, 0.0), 0.049)]), of_tube(0.05, 0.049, 0.11)),
    (Extrusion(((0.0, 0.0), 0.05), 0.11, holes=[((0.0, 0.0), 0.049)]), moved(of_tube(0.05, 0.049, 0.11), 0.055)),
    (Revolution(NOTCHED), of_profile(NOTCHED)),
    (Revolution([(0, 0), (0.03, 0), (0, 0.1)]), of_profile([(0, 0), (0.03, 0), (0, 0.1)])),
]


@pytest.mark.parametrize(("shape", "found"), CLOSED_FORMS, ids=lambda x: getattr(x, "word", ""))
def test_closed_forms_are_the_integrals(shape: Shape, found: tuple[float, Array, Array]) -> None:
    agree(shape, found)


@pytest.mark.parametrize(
    "shape",
    [
        Box((0.1, 0.2, 0.35)),
        Plate(L_SHAPE, 0.01),
        Plate(L_SHAPE[::-1], 0.01, holes=[[(0.01, 0.01), (0.05, 0.012), (0.03, 0.04)]]),
        Box((0.1, 0.2, 0.35)).at((1.0, 2.0, 3.0), (1.0, 0.2, -0.4, 0.6)),
        Box((0.1, 0.2, 0.3)) + Plate(L_SHAPE, 0.01).at((0.3, 0.1, -0.2), (0.3, 0.2, 0.1, 0.9)),
        Extrusion(L_SHAPE, 0.3, holes=[[(0.01, 0.01), (0.05, 0.012), (0.03, 0.04)]]),
    ],
    ids=lambda shape: shape.word,
)
def test_bodies_of_plane_faces_by_the_divergence_theorem(shape: Shape) -> None:
    agree(shape, of_surface(shape))


def test_shells_are_their_walls() -> None:
    """The hollow found by hand: concentric, of parallel faces, a cone by similar triangles."""
    wall = 0.004
    agree(Shell(Sphere(0.07), wall), without(of_ball(0.07), of_ball(0.066)))
    agree(Shell(Disc(0.13, 0.02), wall), without(of_tube(0.13, 0.0, 0.02), of_tube(0.126, 0.0, 0.012)))
    agree(Shell(Cylinder(0.05, 0.11, 0.02), wall), without(of_tube(0.05, 0.02, 0.11), of_tube(0.046, 0.024, 0.102)))
    agree(Shell(Box((0.1, 0.2, 0.3)), wall), without(of_box((0.1, 0.2, 0.3)), of_box((0.092, 0.192, 0.292))))
    inner = [(0.004, 0.004), (0.196, 0.004), (0.196, 0.046), (0.056, 0.046), (0.056, 0.146), (0.004, 0.146)]
    beam = without(of_surface(Extrusion(L_SHAPE, 0.3)), moved(of_surface(Extrusion(inner, 0.292)), wall))
    for outline in (L_SHAPE, L_SHAPE[::-1]):
        agree(Shell(Extrusion(outline, 0.3), wall), beam)
        agree(Shell(Plate(outline, 0.3), wall), moved(beam, -0.15))
    radius, height = 0.03, 0.1
    foot = radius * (1.0 - wall / height) - wall * np.hypot(radius, height) / height
    hollow = of_profile([(0, wall), (foot, wall), (0, wall + foot * height / radius)])
    agree(
        Shell(Revolution([(0, 0), (radius, 0), (0, height)]), wall),
        without(of_profile([(0, 0), (0.03, 0), (0, 0.1)]), hollow),
    )
    flanged = Shell(Plate(((0, 0), 0.1), 0.02, holes=[((0.04, 0.03), 0.02)]), wall)
    bored = Plate(((0, 0), 0.096), 0.012, holes=[((0.04, 0.03), 0.024)])
    assert flanged.volume == pytest.approx(flanged.shape.volume - bored.volume, rel=EXACT)
    assert (
        not flanged.contains(np.array([[-0.05, 0.0, 0.0]]))[0] and flanged.contains(np.array([[-0.05, 0.0, 0.009]]))[0]
    )


def test_an_origin_far_away_costs_no_digits() -> None:
    """Beyond those of the coordinates themselves: a thousand times the size is a power of two here."""
    near = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.5, 0.25)]
    far = [(x + 1024.0, y - 1024.0) for x, y in near]
    one, other = Plate(near, 0.5), Plate(far, 0.5)
    assert other.volume == pytest.approx(one.volume, rel=EXACT)
    assert np.abs(other.inertia - one.inertia).max() < EXACT * one.inertia.max()
    assert np.abs(other.centroid - one.centroid - [1024.0, -1024.0, 0.0]).max() < 1024 * EXACT


def test_textbook_values() -> None:
    """Mass 3, as in tables of moments of inertia."""

    def of(shape: Shape) -> list[float]:
        return (3.0 / shape.volume * np.diag(shape.inertia)).tolist()

    assert of(Disc(0.2, 1e-9))[:1] == pytest.approx([3 * 0.2**2 / 4], rel=EXACT)
    assert of(Disc(0.2, 0.1)) == pytest.approx([3 * (3 * 0.2**2 + 0.1**2) / 12] * 2 + [3 * 0.2**2 / 2], rel=EXACT)
    assert of(Sphere(0.2)) == pytest.approx([0.4 * 3 * 0.2**2] * 3, rel=EXACT)
    cone = Revolution([(0, 0), (0.3, 0), (0, 0.8)])
    across = 3 * (3 / 20 * 0.3**2 + 3 / 80 * 0.8**2)
    assert of(cone) == pytest.approx([across, across, 0.3 * 3 * 0.3**2], rel=EXACT)
    assert cone.centroid[2] == pytest.approx(0.2, rel=EXACT)


def test_parallel_axes_and_holes() -> None:
    """A hole out of the middle: by hand (Steiner), as a plate and as a difference."""
    plate = Plate(((0.0, 0.0), 0.1), 0.02, holes=[((0.04, 0.03), 0.02)])
    taken = Disc(0.1, 0.02) - Disc(0.02, 0.02).at((0.04, 0.03, 0.0))
    whole, part = np.pi * 0.1**2 * 0.02, np.pi * 0.02**2 * 0.02
    middle = -part * np.array([0.04, 0.03, 0.0]) / (whole - part)
    axial = 0.5 * whole * 0.1**2 - 0.5 * part * 0.02**2 - part * 0.05**2 - (whole - part) * (middle @ middle)
    for shape in (plate, taken):
        assert shape.volume == pytest.approx(whole - part, rel=EXACT)
        assert shape.centroid == pytest.approx(middle, rel=EXACT)
        assert shape.inertia[2, 2] == pytest.approx(axial, rel=EXACT)
    assert np.abs(plate.inertia - taken.inertia).max() < EXACT * axial
    tube = Cylinder(0.05, 0.2) - Cylinder(0.03, 0.2)
    assert np.abs(tube.inertia - Cylinder(0.05, 0.2, 0.03).inertia).max() < EXACT * tube.inertia.max()


def test_a_sum_is_placed_as_a_whole() -> None:
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    hammer = Box((0.02, 0.3, 0.02)) + Box((0.1, 0.04, 0.04)).at((0.0, 0.17, 0.0))
    moved = hammer.at((1.0, 2.0, 3.0), turn)
    assert moved.centroid == pytest.approx(turn @ hammer.centroid + [1.0, 2.0, 3.0], rel=EXACT)
    assert np.abs(moved.inertia - turn @ hammer.inertia @ turn.T).max() < EXACT * hammer.inertia.max()
    back = moved.at(-turn.T @ np.array([1.0, 2.0, 3.0]), turn.T)
    assert back.centroid == pytest.approx(hammer.centroid, abs=EXACT)
    assert hammer == Box((0.02, 0.3, 0.02)) + Box((0.1, 0.04, 0.04)).at((0.0, 0.17, 0.0))
    assert hash(hammer) == hash(copy.deepcopy(hammer)) and pickle.loads(pickle.dumps(hammer)) == hammer


@pytest.mark.parametrize(
    "shape",
    [
        Disc(0.1, 0.02),
        Cylinder(0.1, 0.2, 0.05),
        Sphere(0.1),
        Box((0.1, 0.2, 0.3)),
        Plate(L_SHAPE, 0.01, [((0.03, 0.03), 0.01), ((0.15, 0.025), 0.01), [(0.02, 0.07), (0.04, 0.08), (0.03, 0.1)]]),
        Plate(
            ((0.0, 0.0), 0.1), 0.01, [((0.06 * np.cos(a), 0.06 * np.sin(a)), 0.02) for a in np.arange(6) * np.pi / 3]
        ),
        Revolution(NOTCHED),
        Revolution([(0, 0), (0.03, 0), (0, 0.1)]),
    ],
    ids=lambda shape: shape.word,
)
def test_surfaces_are_closed_and_look_outwards(shape: Shape) -> None:
    edges = Counter((int(f[i]), int(f[(i + 1) % 3])) for f in shape.skin.faces for i in range(3))
    assert set(edges.values()) == {1} and all((b, a) in edges for a, b in edges)
    volume = of_surface(shape)[0]
    # polygons of 48 corners in circles: sin(2 pi / 48) / (2 pi / 48) of the area, once, or twice in a ball
    assert 0.99 * shape.volume < volume < 1.01 * shape.volume
    drawn = next(iter(shapes.drawn(shape)))
    if drawn["kind"] == "mesh":
        a, b, c = (np.reshape(drawn["points"], (-1, 3))[np.reshape(drawn["faces"], (-1, 3))[:, k]] for k in range(3))
        assert np.einsum("ni,ni->", a, np.cross(b, c)) / 6.0 == pytest.approx(volume, rel=1e-6)


def test_sizes_have_units() -> None:
    assert Disc("20 mm", "0.5 cm") == Disc(0.02, 0.005)
    assert Box(("1 in", 0.1, "10 cm")) == Box((0.0254, 0.1, 0.1))
    assert Plate((("1 cm", 0), "5 cm"), "2 mm", [(("1 cm", "1 mm"), "1 cm")]) == Plate(
        ((0.01, 0.0), 0.05), 0.002, [((0.01, 0.001), 0.01)]
    )
    assert Revolution([("1 cm", 0), ("2 cm", 0), ("2 cm", "1 cm")]) == Revolution([(0.01, 0), (0.02, 0), (0.02, 0.01)])
    assert Sphere(1).at(("1 mm", 0, 0)) == Sphere(1.0).at((0.001, 0, 0))


SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Disc(-0.1, 1), r'shape "Disc": radius is -0.1 m; it must be greater than 0'),
        (lambda: Disc(0.1, 0), "thickness is 0 m"),
        (lambda: Disc("3 kg", 1), "radius is a length"),
        (lambda: Disc(True, 1), "radius must be made of real numbers"),
        (lambda: Cylinder(0.1, 1, 0.1), "inner_radius is 0.1 m and radius 0.1 m"),
        (lambda: Box((1, 2)), "size must be 3 numbers"),
        (lambda: Box((1, 2, 0)), r"size\[2\] is 0 m"),
        (lambda: Sphere(float("nan")), "give finite numbers"),
        (lambda: Plate([(0, 0), (1, 1), (1, 0), (0, 1)], 1), "the edges from corner 0 and from corner 2 meet"),
        (lambda: Plate([(0, 0), (1, 0), (2, 0)], 1), "no area"),
        (lambda: Plate([(0, 0), (1, 0), (1, 1), (0, 0)], 1), "corner 3 twice in a row"),
        (lambda: Plate([(0, 0), (1, 0)], 1), "three or more corners"),
        (lambda: Plate(SQUARE, 1, [((0.9, 0.5), 0.2)]), r"holes\[0\] is not inside the outline"),
        (lambda: Plate(SQUARE, 1, [((0.3, 0.5), 0.15), ((0.5, 0.5), 0.1)]), r"holes\[0\] and holes\[1\] overlap"),
        (lambda: Plate(SQUARE, 1, [((0.5, 0.5), 0.3), ((0.5, 0.5), 0.1)]), "overlap"),
        (
            lambda: Plate(SQUARE, 1, [[(0.1, 0.1), (0.9, 0.1), (0.5, 0.9)], [(0.4, 0.2), (0.6, 0.2), (0.5, 0.4)]]),
            "overlap",
        ),
        (lambda: Plate(SQUARE, 1, [[(0.1, 0.1), (0.9, 0.1), (0.5, 1.2)]]), "not inside"),
        (lambda: Plate(SQUARE, 1, 3), "holes must be a list"),
        (lambda: Extrusion([(0, 0), (1, 1), (1, 0), (0, 1)], 1), "Extrusion.*meet"),
        (lambda: Extrusion(SQUARE, 0), "length is 0 m"),
        (lambda: Extrusion(SQUARE, 1, [((0.9, 0.5), 0.2)]), r"Extrusion.*holes\[0\] is not inside"),
        (lambda: Shell(Sphere(1), 1), "walls of 1 m meet"),
        (lambda: Shell(Extrusion(L_SHAPE, 1), 0.026), "walls of 0.026 m meet"),
        (lambda: Shell(Revolution(NOTCHED), 0.02), "walls of 0.02 m meet"),
        (lambda: Shell(Sphere(1), 0), "thickness is 0 m"),
        (lambda: Shell(Sphere(1) + Sphere(1), 0.1), "must be one of Disc, Cylinder.*shape - hollow"),
        (lambda: Shell(3, 0.1), "must be one of Disc, Cylinder"),
        (lambda: Revolution([(-1, 0), (1, 0), (0, 1)]), "distance from the axis"),
        (lambda: Revolution([(0, 0), (1, 1), (1, 0), (0, 1)]), "meet"),
        (lambda: Box((1, 1, 1)) - Cylinder(0.1, 1.1), "the hole Cylinder at .* is not inside one of its parts"),
        (lambda: Cylinder(0.2, 1, 0.1) - Cylinder(0.15, 1), "not inside"),
        (lambda: Box((1, 1, 1)) - Disc(0.1, 1) - Disc(0.1, 1).at((0.05, 0, 0)), "would be taken off twice"),
        (lambda: Box((1, 1, 1)) - Box((1, 1, 1)), "nothing remains"),
        (lambda: Sphere(1).at((0, 0)), "position must be 3 numbers"),
        (lambda: Sphere(1).at((0, 0, 0), np.diag([1.0, 1.0, -1.0])), "reflection"),
        (lambda: Sphere(1).at((0, 0, 0), np.ones((3, 3))), "not a rotation"),
        (lambda: Sphere(1).at((0, 0, 0), (0, 0, 0, 0)), "zero quaternion"),
    ],
)
def test_errors_name_the_shape_and_what_is_wrong(make: Any, message: str) -> None:
    with pytest.raises(DescriptionError, match=message) as error:
        make()
    assert error.value.element == "shape" and error.value.name in str(error.value)


def test_holes_that_touch_the_surface_are_holes() -> None:
    """A groove around a shaft, one at its end, a slot along a block."""
    shaft = Cylinder(0.02, 0.1)
    for groove in (Cylinder(0.02, 0.01, 0.015), Cylinder(0.02, 0.01, 0.015).at((0, 0, 0.045))):
        assert (shaft - groove).volume == pytest.approx(
            np.pi * (0.02**2 * 0.1 - (0.02**2 - 0.015**2) * 0.01), rel=EXACT
        )
    assert (Box((1, 1, 1)) - Box((0.2, 1, 0.3)).at((0, 0, 0.35))).volume == pytest.approx(0.94, rel=EXACT)


def test_shapes_are_added_to_shapes_alone() -> None:
    with pytest.raises(TypeError):
        Sphere(1) + 3  # type: ignore[operator]
    with pytest.raises(TypeError):
        Sphere(1) - "hole"  # type: ignore[operator]


def flywheel() -> pt.Mechanism:
    """All kinds of shapes."""
    m = pt.Mechanism("flywheel", gravity="-y")
    web = Plate(((0, 0), "0.1 m"), "10 mm", holes=[((0.06, 0), 0.01), ((-0.06, 0), 0.01)])
    rim = Cylinder(0.12, 0.03, 0.1)
    m.add_solid("wheel", web + rim, material="cast iron", position=(0, 0, 0.1))
    m.add_solid("block", Box((0.1, 0.1, 0.04)) - Disc(0.02, 0.04), density="2.7 g/cm^3", position=(0.3, 0, 0))
    m.add_solid("knob", Sphere("15 mm"), mass="30 g", position=(0, 0.2, 0), gravity=False)
    m.add_solid("top", Revolution([(0, 0), (0.02, 0.05), (0, 0.06)]), material="oak", orientation=(1, 0.2, 0.3, 0.1))
    m.add_solid("bar", Plate(L_SHAPE, 0.005), material="Aluminium", position=(0, -0.3, 0))
    m.add_solid("beam", Extrusion(L_SHAPE, 0.3, [((0.03, 0.03), 0.01)]), material="PVC", position=(0, -0.3, 0.2))
    m.add_solid("float", Shell(Sphere("3 cm"), "1 mm"), material="brass", position=(0.5, 0, 0))
    for i, name in enumerate(m.bodies):
        m.add_revolute(f"J{i}", m.ground, name, point=m.bodies[name].position)
    return m


def test_a_body_has_mass_centre_and_inertia_of_its_shape() -> None:
    m = pt.Mechanism("one")
    shape = Plate(L_SHAPE, 0.01, holes=[((0.03, 0.03), 0.01)])
    body = m.add_solid("bracket", shape, material="Steel", position=(1, 2, 3), orientation=(1, 0, 0, 1))
    assert body.mass == pytest.approx(7850 * shape.volume, rel=1e-15) and body.density == 7850.0
    assert body.material == "steel" and body.kind == "solid" and body.shape is shape
    assert np.array_equal(body.com, shape.centroid)
    assert np.abs(body.inertia - 7850 * shape.inertia).max() <= EXACT * body.inertia.max()
    plain = pt.Mechanism("one")
    plain.add_body("bracket", body.mass, body.inertia, body.com, body.position, body.orientation)
    spec, other = m.to_spec()["bodies"][0], plain.to_spec()["bodies"][0]
    assert {**spec, "shape": 0} == {**other, "shape": 0}
    assert m.add_solid("again", shape, mass=2.0).density == pytest.approx(2.0 / shape.volume, rel=1e-15)


@pytest.mark.parametrize(
    ("given", "kind", "message"),
    [
        ({}, DescriptionError, "one of material, density and mass, not none"),
        ({"mass": 1.0, "material": "steel"}, DescriptionError, "not material and mass"),
        ({"material": "stel"}, UnknownNameError, 'no material "stel"; did you mean "steel"'),
        ({"material": "xyz"}, UnknownNameError, "known materials: steel"),
        ({"material": 7850.0}, DescriptionError, 'a name such as "steel"'),
        ({"density": 0.0}, DescriptionError, "density is 0; it must be greater than 0"),
        ({"density": "3 kg"}, DescriptionError, "density"),
        ({"mass": -1.0}, DescriptionError, "mass is -1"),
    ],
)
def test_mass_is_given_once(given: dict[str, Any], kind: type[Exception], message: str) -> None:
    m = pt.Mechanism("one")
    with pytest.raises(kind, match=message):
        m.add_solid("s", Sphere(0.1), **given)
    assert not m.bodies


def test_what_is_no_shape_is_refused() -> None:
    with pytest.raises(DescriptionError, match=r"shape must be a value of partita\.shapes"):
        pt.Mechanism("one").add_solid("s", {"kind": "ball", "radius": 1}, mass=1.0)  # type: ignore[arg-type]


def test_changes_compute_all_again() -> None:
    m = flywheel()
    knob = m.bodies["knob"]
    knob.material = "brass"
    assert knob.mass == pytest.approx(8500 * Sphere(0.015).volume, rel=1e-15) and knob.density == 8500.0
    knob.shape = Sphere(0.03)
    assert knob.mass == pytest.approx(8500 * Sphere(0.03).volume, rel=1e-15) and knob.material == "brass"
    knob.mass = 1.0
    assert knob.material is None and knob.inertia[0, 0] == pytest.approx(0.4 * 0.03**2, rel=EXACT)
    with pytest.raises(DescriptionError, match="inertia follows from shape and one of material, density and mass"):
        knob.inertia = (1, 1, 1)
    with pytest.raises(DescriptionError, match="not material and mass"):
        knob.change(mass=1.0, material="steel")
    assert knob.mass == 1.0 and "solid, shape=Sphere(radius=0.03), mass=1" in repr(knob)


def test_saved_and_loaded_to_the_bit(tmp_path: Path) -> None:
    m = flywheel()
    m.save(tmp_path / "flywheel.toml")
    again = pt.load(tmp_path / "flywheel.toml")
    assert document(again) == document(m) and again.to_spec() == m.to_spec()
    assert [again.bodies[name].shape for name in again.bodies] == [m.bodies[name].shape for name in m.bodies]
    assert copy.deepcopy(m).to_spec() == m.to_spec() == pickle.loads(pickle.dumps(m)).to_spec()


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ('"sphere", radius = 0.015', '"spere"', 26, 'no shape of type "spere"; did you mean "sphere"'),
        ("radius = 0.015", "radius = -1", 26, "radius is -1"),
        ("radius = 0.015", "radius = 0.0", 24, 'shape "Sphere": radius is 0 m'),
        ("radius = 0.015", "radii = 0.0", 26, '"radii" is not a key of sphere shape; did you mean "radius"'),
        ("mass = 0.03\n", "", 24, "one of material, density and mass, not none"),
        ('"oak"', '"ok"', 31, 'did you mean "oak"'),
    ],
)
def test_files_are_refused_with_their_line(old: str, new: str, line: int, message: str, tmp_path: Path) -> None:
    text = document(flywheel())
    assert text.count(old) == 1
    path = tmp_path / "bad.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(FileFormatError, match=message) as error:
        pt.load(path)
    assert error.value.line == line


def test_a_disc_swings_with_its_period() -> None:
    """T = 2 pi sqrt((R^2/2 + d^2) / (g d)) for small motions about an axle at d from its centre."""
    radius, away = 0.2, 0.15
    m = pt.Mechanism("pendulum")
    disc = m.add_solid("disc", Disc(radius, "1 cm"), material="brass", position=(0, -away, 0))
    m.add_revolute("A", m.ground, disc, point=(0, 0, 0))
    modes = m.linearize(m.equilibrium()).modes()
    period = 2 * np.pi * np.sqrt((radius**2 / 2 + away**2) / (9.81 * away))
    assert 1.0 / modes[0].frequency == pytest.approx(period, rel=1e-9)


def scene_of(m: pt.Mechanism, **given: Any) -> dict[str, Any]:
    return describe(m.simulate(0.01), None, **given)


def test_bodies_are_drawn_as_their_shapes() -> None:
    m = flywheel()
    parts = {solid["body"]: solid["parts"] for solid in scene_of(m)["solids"]}
    names = list(m.bodies)
    kinds = {names[body]: [part["kind"] for part in found] for body, found in parts.items()}
    assert kinds == {
        "wheel": ["mesh", "mesh"], "block": ["mesh"], "knob": ["ball"], "top": ["mesh"], "bar": ["mesh"],
        "beam": ["mesh"], "float": ["ball"],
    }  # fmt: skip
    assert parts[names.index("knob")] == [{"kind": "ball", "radius": 0.015, "center": [0.0, 0.0, 0.0]}]
    for body, found in parts.items():
        low, high = m.bodies[names[body]].shape.bounds
        for part in found:
            points = np.reshape(part["points"], (-1, 3)) if part["kind"] == "mesh" else np.zeros((1, 3))
            assert (points >= low - 1e-9).all() and (points <= high + 1e-9).all()


def test_holes_are_open() -> None:
    """No triangle across a hole, and all of the rest is covered: of a plate, and of a drilled block."""
    for shape, middle, radius in [
        (Plate(SQUARE, 0.1, [((0.7, 0.6), 0.1)]), (0.7, 0.6), 0.1),
        (Box((1, 1, 0.1)) - Disc(0.1, 0.1).at((0.2, -0.3, 0), (0, 1, 0, 0)), (0.2, -0.3), 0.1),
    ]:
        (part,) = shapes.drawn(shape)
        points, faces = np.reshape(part["points"], (-1, 3)), np.reshape(part["faces"], (-1, 3))
        cap = faces[(points[faces][:, :, 2] > 0.049).all(axis=1)]
        a, b, c = (points[cap[:, k]][:, :2] for k in range(3))
        areas = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
        assert (areas >= -1e-12).all()
        assert areas.sum() == pytest.approx(1 - 10 * radius**2 * np.sin(np.pi / 10), rel=1e-6)
        center = (a + b + c) / 3
        assert (np.linalg.norm(center - middle, axis=1) > 0.99 * radius).all()


@pytest.mark.parametrize(
    "shape",
    [
        Box((1, 1, 1)) - Box((0.2, 0.3, 0.5)).at((0, 0, 0.25)),
        Box((1, 1, 1)) - Box((0.2, 0.3, 0.5)).at((0.25, 0, 0), [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]),
        Extrusion(SQUARE, 2) - Box((0.2, 0.3, 0.5)).at((0.5, 0.5, 0.25)) - Box((0.1, 0.1, 2)).at((0.2, 0.2, 1)),
        Plate(SQUARE, 2, [[(0.1, 0.1), (0.2, 0.1), (0.1, 0.2)]]) - Box((0.4, 0.4, 1)).at((0.5, 0.5, -0.5)),
    ],
    ids=["above", "along x", "below", "plate"],
)  # fmt: skip
def test_holes_that_do_not_go_through_are_drawn(shape: Shape) -> None:
    """Of plane faces, so that the volume inside what is drawn is that of the shape."""
    (part,) = shapes.drawn(shape)
    points, faces = np.reshape(part["points"], (-1, 3)), np.reshape(part["faces"], (-1, 3))
    a, b, c = (points[faces[:, k]] for k in range(3))
    assert part["kind"] == "mesh" and part["closed"]
    assert np.einsum("ni,ni->", a, np.cross(b, c)) / 6.0 == pytest.approx(shape.volume, rel=1e-7)


def test_what_is_not_seen_and_slots_are_not_drawn() -> None:
    slot = Box((1, 1, 1)) - Box((0.2, 1, 0.3)).at((0, 0, 0.35))
    for shape in (slot, Box((1, 1, 1)) - Cylinder(0.1, 0.5), Shell(Box((1, 1, 1)), 0.1)):
        assert [part["kind"] for part in shapes.drawn(shape)] == ["box"]


def test_a_stored_run_is_drawn_with_its_shapes(tmp_path: Path) -> None:
    run = flywheel().simulate(0.01)
    run.save(tmp_path / "run.json")
    again = pt.load_result(tmp_path / "run.json")
    assert describe(again, None)["solids"] == describe(run, None)["solids"]
    again.to_html(tmp_path / "run.html")
    assert '"closed":true' in (tmp_path / "run.html").read_text("utf-8")


@pytest.mark.parametrize(
    "form",
    [{}, {"type": "disc"}, {"type": "sum"}, {"type": "sum", "parts": []}, {"type": "sum", "parts": [{"shape": 3}]},
     {"type": "box", "size": [1, 2]}, {"type": "cone", "radius": 1}, {"type": "plate", "outline": 3, "thickness": 1},
     {"type": "plate", "outline": {"radius": 1}, "thickness": 1}, {"type": "sphere", "radius": 1, "length": 2}, 3],
    ids=str,
)  # fmt: skip
def test_a_stored_run_with_another_form_is_refused(form: Any, tmp_path: Path) -> None:
    run = flywheel().simulate(0.01)
    run.save(tmp_path / "run.json")
    again = pt.load_result(tmp_path / "run.json")
    again.spec["bodies"][2]["shape"]["form"] = form
    with pytest.raises((FileFormatError, DescriptionError)):
        describe(again, None)


def test_many_holes_and_corners_take_no_time() -> None:
    """A sieve of 400 holes, a rack of 8000 corners, a hundred holes one after the other: a second each, not minutes."""
    began = monotonic()
    sieve = Plate([(0, 0), (1, 0), (1, 1), (0, 1)], 0.01, [((0.05 * i + 0.025, 0.05 * j + 0.025), 0.01)
                                                           for i in range(20) for j in range(20)])  # fmt: skip
    assert sieve.volume == pytest.approx((1 - 400 * np.pi * 0.01**2) * 0.01, rel=EXACT)
    teeth = [(0.001 * i, 0.02 + 0.001 * (i % 2)) for i in range(8000)]
    rack = Plate([(0, 0), (7.999, 0), *teeth[::-1]], 0.01)
    assert rack.volume == pytest.approx(7.999 * 0.0205 * 0.01, rel=1e-9)
    board: Shape = Box((1, 1, 0.01))
    for i in range(10):
        for j in range(10):
            board = board - Disc(0.01, 0.01).at((0.1 * i - 0.45, 0.1 * j - 0.45, 0))
    assert board.volume == pytest.approx(0.01 * (1 - 100 * np.pi * 0.01**2), rel=EXACT)
    assert [part["kind"] for part in shapes.drawn(board)] == ["mesh"]
    assert monotonic() - began < 30.0


def test_viewers_take_shapes() -> None:
    found = solids({"rod": [Disc(0.1, 0.02), {"kind": "ball", "radius": 0.1}], "ground": Box((1, 2, 3))}, ["rod"])
    assert [part["kind"] for part in found[0]] == ["cylinder", "ball"] and found[-1][0]["size"] == [1.0, 2.0, 3.0]
    with pytest.raises(ArgumentError, match=r"a value of partita\.shapes, or"):
        solids({"rod": 3}, ["rod"])


def test_many_triangles_are_reduced() -> None:
    angle = np.linspace(0, 2 * np.pi, 4001)[:-1]
    gear = Plate(np.stack([(1 + 0.1 * np.sin(40 * angle)) * f(angle) for f in (np.cos, np.sin)], axis=1), 0.1)
    (part,) = solids({"rod": gear}, ["rod"])[0]
    assert len(part["faces"]) // 3 <= 6000 < part["of"]


def test_materials_are_plausible() -> None:
    assert shapes.MATERIALS["steel"] == 7850.0 and shapes.MATERIALS["aluminium"] == shapes.MATERIALS["aluminum"]
    assert all(100.0 < density < 25000.0 for density in shapes.MATERIALS.values())
    with pytest.raises(TypeError):
        shapes.MATERIALS["steel"] = 1.0  # type: ignore[index]
