"""Bodies: `Mechanism.add_body`, `Mechanism.add_rod` and `Mechanism.add_solid`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..numeric import shown
from ..shapes import MATERIALS, Shape
from ..units import Quantity
from . import frames
from .checks import Array, Element, find, name_of, number, switch, vector
from .drawing import Drawing
from .records import GROUND, Body, BodyRecord, Description, Handle, Solid


def add_body(
    self: Drawing,
    name: str,
    mass: Quantity,
    inertia: ArrayLike,
    com: ArrayLike = (0.0, 0.0, 0.0),
    position: ArrayLike = (0.0, 0.0, 0.0),
    orientation: Any = None,
    gravity: bool = True,
) -> Body:
    """Add a rigid body of known mass and inertia. For a straight uniform bar prefer `add_rod`, for a disc, a plate, a
    box and their like `add_solid`, which computes both.

    Args:
        name: unique among the bodies; "ground" is reserved.
        mass: [kg], not negative.
        inertia: about the centre of mass, in body axes [kg m^2]: (Ixx, Iyy, Izz) or a symmetric 3x3 matrix.
            Principal moments must be physically possible (none negative, none larger than the sum of the other two, to
            1e-6 of the largest). All zeros make a point mass.
        com: centre of mass in body axes [m].
        position: of the body's origin in the world, as drawn [m].
        orientation: body axes in the world, as drawn: None (parallel to the world), a 3x3 rotation whose
            columns are the body axes, a quaternion (w, x, y, z) of any length, or a SciPy `Rotation`. A matrix may
            deviate from orthonormal by 1e-9; the nearest rotation is used.
        gravity: False: gravity does not act on this body.

    Returns:
        A handle; other methods accept the handle or the name.

    Raises:
        DescriptionError: a number is impossible, or the name is taken.

    >>> import partita as pt
    >>> m = pt.Mechanism("top")
    >>> top = m.add_body("top", mass=0.2, inertia=(1e-4, 1e-4, 1.5e-4), com=(0, 0, 0.05))
    >>> top.name
    'top'
    """
    element = name_of("body", name, self._description.bodies, (GROUND,))
    record = BodyRecord(
        name=name,
        mass=number(element, "mass", mass, "kg", least=0.0),
        inertia=frames.inertia(element, inertia),
        com=vector(element, "com", com, "m"),
        position=vector(element, "position", position, "m"),
        rotation=frames.rotation(element, "orientation", orientation),
        gravity=switch(element, "gravity", gravity),
    )
    self._description.store(self._description.bodies, record)
    return Body(name, self)


def add_rod(self: Drawing, name: str, start: ArrayLike, end: ArrayLike, mass: Quantity, gravity: bool = True) -> Body:
    """Add a uniform slender rod between two points of the world as drawn.

    Its frame has the origin at `start` and x towards `end`. z stays as near to the world's z as possible, so
    that a rod drawn in the x-y plane turns about its own z; only for rods within 26 degrees of the world's z
    does y stay near the world's y instead. Its inertia about the centre is (0, m L^2/12, m L^2/12), with none about its
    own axis. The spin of a rod between two balls about its line is therefore held, unless a force, a drive or a
    coupling depends on it; where the spin matters, use `add_body` with the axial inertia.

    Args:
        name: unique among the bodies.
        start, end: two different points in the world [m].
        mass: [kg], not negative. Zero makes a massless link; then every motion must move mass elsewhere.
        gravity: False: gravity does not act on this rod.

    Raises:
        DescriptionError: a number is impossible, the rod has no length, or the name is taken.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> m.add_rod("rod", start=(0, 0, 0), end=(3, 4, 0), mass=2.0).name
    'rod'
    >>> m.to_spec()["bodies"][0]["com"]
    [2.5, 0.0, 0.0]
    """
    element = name_of("body", name, self._description.bodies, (GROUND,))
    first, last = vector(element, "start", start, "m"), vector(element, "end", end, "m")
    length, rotation = frames.along(element, first, last)
    weight = number(element, "mass", mass, "kg", least=0.0)
    moment = weight * length**2 / 12.0
    record = BodyRecord(
        name=name,
        mass=weight,
        inertia=np.diag([0.0, moment, moment]),
        com=np.array([0.5 * length, 0.0, 0.0]),
        position=first,
        rotation=rotation,
        rod=(first, last, length),
        gravity=switch(element, "gravity", gravity),
    )
    self._description.store(self._description.bodies, record)
    return Body(name, self)


def add_solid(
    self: Drawing,
    name: str,
    shape: Shape,
    *,
    material: str | None = None,
    density: Quantity | None = None,
    mass: Quantity | None = None,
    position: ArrayLike = (0.0, 0.0, 0.0),
    orientation: Any = None,
    gravity: bool = True,
) -> Body:
    """Add a body of a shape: its mass, centre of mass and inertia are computed, and it is drawn so.

    Args:
        name: unique among the bodies.
        shape: a value of `partita.shapes`, such as `pt.shapes.Disc(radius, thickness)`, or a sum of these. Its origin
            and axes are those of the body.
        material: "steel", "aluminium", "PLA" and others; `pt.shapes.MATERIALS` has their densities.
        density: [kg/m^3], instead of a material.
        mass: [kg], instead of a material, spread evenly over the shape.
        position: of the body's origin in the world, as drawn [m].
        orientation: body axes in the world, as drawn: None (parallel to the world), a 3x3 rotation whose
            columns are the body axes, a quaternion (w, x, y, z) of any length, or a SciPy `Rotation`.
        gravity: False: gravity does not act on this body.

    Raises:
        DescriptionError: not one of material, density and mass is given, a number is impossible, or the name is taken.
        UnknownNameError: there is no such material.

    >>> import partita as pt
    >>> m = pt.Mechanism("flywheel")
    >>> wheel = m.add_solid("wheel", pt.shapes.Disc("100 mm", "20 mm"), material="steel")
    >>> print(f"{wheel.mass:.6f} kg, {wheel.inertia[2, 2]:.6f} kg m^2")
    4.932300 kg, 0.024662 kg m^2
    """
    element = name_of("body", name, self._description.bodies, (GROUND,))
    if not isinstance(shape, Shape):
        element.fail(f"shape must be a value of partita.shapes, such as pt.shapes.Disc(0.1, 0.02), not {shown(shape)}")
    solid = _made_of(element, shape, {"material": material, "density": density, "mass": mass})
    weight = float(solid.value) if solid.word == "mass" else shape.volume * density_of(solid)
    record = BodyRecord(
        name=name,
        mass=number(element, "mass", weight, "kg", least=0.0),
        inertia=frames.inertia(element, (weight / shape.volume) * shape.inertia),
        com=vector(element, "com", shape.centroid, "m"),
        position=vector(element, "position", position, "m"),
        rotation=frames.rotation(element, "orientation", orientation),
        gravity=switch(element, "gravity", gravity),
        solid=solid,
    )
    self._description.store(self._description.bodies, record)
    return Body(name, self)


_MATERIALS = {name.lower(): name for name in MATERIALS}


def _made_of(element: Element, shape: Shape, choices: dict[str, Any]) -> Solid:
    """The one that is given."""
    known = [word for word, value in choices.items() if value is not None]
    if len(known) != 1:
        which = "none" if not known else f"{', '.join(known[:-1])} and {known[-1]}"
        element.fail(f"give one of material, density and mass, not {which}: each determines the mass of the shape")
    word = known[0]
    value = choices[word]
    if word == "material":
        if not isinstance(value, str):
            element.fail(f'material must be a name such as "steel", not {shown(value)}')
        if value.strip().lower() in _MATERIALS:
            return Solid(shape, word, _MATERIALS[value.strip().lower()])
        find("material", value, MATERIALS, where=f'body "{element.name}": ')
    unit = "kg" if word == "mass" else "kg/m^3"
    least, above = (0.0, None) if word == "mass" else (None, 0.0)
    return Solid(shape, word, number(element, word, value, unit, least=least, above=above))


def density_of(solid: Solid) -> float:
    """Density, however the mass was given."""
    if isinstance(solid.value, str):
        return MATERIALS[solid.value]
    return solid.value if solid.word == "density" else solid.value / solid.shape.volume


def radius_of(element: Element, what: str, value: Any) -> Any:
    """The radius of a shape that is given in place of it; anything else unchanged."""
    if not isinstance(value, Shape):
        return value
    found = getattr(getattr(value, "shape", value), "radius", None)  # of a shell that of its outer shape
    if found is None:
        about = f"{what} is a {type(value).__name__}, which has no radius"
        element.fail(f"{about}; give a Sphere, a Disc, a Cylinder or a number in metres")
    return found


def resolve(mechanism: Drawing, asker: Element, what: str, body: Body | str, *, ground: bool = True) -> str:
    """Name of the body given by a handle or a name."""
    name = own_name(mechanism, asker, what, body, Body)
    if name == GROUND:
        if not ground:
            asker.fail(f"{what} is the ground, which does not move; name a body")
        return name
    more = (GROUND,) if ground else ()
    return find("body", name, mechanism._description.bodies, *more, where=f'{asker.kind} "{asker.name}": {what}: ')


def own_name(mechanism: Drawing, asker: Element, what: str, item: Any, kind: type[Handle]) -> str:
    """Name of a handle of this mechanism, or the name itself."""
    if isinstance(item, str):
        return item
    if not isinstance(item, kind):
        asker.fail(
            f"{what} must be a {kind.__name__.lower()} of this mechanism or its name, not "
            f"{type(item).__name__} {item!r}"
        )
    if item.mechanism is not mechanism:
        asker.fail(f'{what} "{item.name}" belongs to the mechanism "{item.mechanism.name}", not to "{mechanism.name}"')
    return item.name


def to_world(description: Description, body: str, point: Array) -> Array:
    """World position, as drawn, of a point given in the axes of `body` (of the world for the ground)."""
    return point if body == GROUND else description.bodies[body].to_world(point)
