"""The facade: `Mechanism`. Its methods live in the rooms of this package, one room per kind of element."""

from __future__ import annotations

from os import PathLike
from typing import Any

from numpy.typing import ArrayLike

from ..comparison import compare_mechanism
from ..state import Layout
from . import bodies as body_room
from . import drives as drive_room
from . import forces as force_room
from . import joints as joint_room
from . import report as report_room
from . import solve
from .assemblies import assemblies
from .checks import name_of, vector
from .compiled import CompiledModel
from .records import GROUND, Body, Description
from .spec import Writer


class Mechanism:
    """Rigid bodies, joints, forces and drives: a description that can be compiled and simulated.

    SI units and radians (see `partita.units`). Data of joints are world data of the drawn position; data of
    bodies are in body axes. Where a loop does not quite close in the drawing, `assemble` closes it.

    Args:
        name: shown in reports and results.
        gravity: acceleration of gravity in world axes [m/s^2].

    Raises:
        DescriptionError: the name is not text or gravity is not three finite numbers.

    >>> import partita as pt
    >>> m = pt.Mechanism("four-bar")
    >>> crank = m.add_rod("crank", start=(0, 0, 0), end=(0, 0.3, 0), mass=0.3)
    >>> coupler = m.add_rod("coupler", start=(0, 0.3, 0), end=(0.8, 0.7, 0), mass=0.9)
    >>> rocker = m.add_rod("rocker", start=(1, 0, 0), end=(0.8, 0.7, 0), mass=0.7)
    >>> a = m.add_revolute("A", m.ground, crank, point=(0, 0, 0))
    >>> b = m.add_revolute("B", crank, coupler, point=(0, 0.3, 0))
    >>> c = m.add_revolute("C", coupler, rocker, point=(0.8, 0.7, 0))
    >>> d = m.add_revolute("D", m.ground, rocker, point=(1, 0, 0))
    >>> m
    Mechanism('four-bar': 3 bodies, 4 joints, 0 drives, 0 forces)
    >>> m.compile().mobility
    1
    """

    def __init__(self, name: str, gravity: ArrayLike = (0.0, -9.81, 0.0)) -> None:
        element = name_of("mechanism", name)
        self._description = Description(element.name, vector(element, "gravity", gravity))
        self._compiled: dict[str, tuple[int, CompiledModel, Layout]] = {}
        self._ground = Body(GROUND, self)

    @property
    def name(self) -> str:
        """The mechanism's name."""
        return self._description.name

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Acceleration of gravity in world axes [m/s^2]."""
        x, y, z = self._description.gravity.tolist()
        return x, y, z

    @property
    def ground(self) -> Body:
        """The world, to be named as a parent or child."""
        return self._ground

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies, in the order in which they were added."""
        return tuple(self._description.bodies)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(self._description.joints)

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""
        return tuple(self._description.drives)

    @property
    def forces(self) -> tuple[str, ...]:
        """Names of the springs, torques and forces."""
        return tuple(self._description.forces)

    add_body = body_room.add_body
    add_rod = body_room.add_rod

    add_revolute = joint_room.add_revolute
    add_prismatic = joint_room.add_prismatic
    add_cylindrical = joint_room.add_cylindrical
    add_spherical = joint_room.add_spherical
    add_universal = joint_room.add_universal
    add_planar = joint_room.add_planar
    add_fixed = joint_room.add_fixed
    add_free = joint_room.add_free
    add_joint = joint_room.add_joint

    add_drive = drive_room.add_drive
    add_spring = force_room.add_spring
    add_torsion_spring = force_room.add_torsion_spring
    add_torque = force_room.add_torque
    add_force = force_room.add_force

    compile = solve.compile
    assemble = solve.assemble
    assemblies = assemblies
    convert = solve.convert
    simulate = solve.simulate
    compare = compare_mechanism
    report = report_room.report

    def to_spec(self) -> dict[str, Any]:
        """The description as plain data, as the core compiles it (version 1): lists, numbers and text only.

        Tables appear as piecewise cubics; a Python function appears as {"function": i}, its number in order.
        """
        return Writer(self, Layout()).spec()

    def save(self, path: str | PathLike[str]) -> None:
        """Write a model file; the suffix says which kind (.toml). `partita.load` reads it back to the last
        bit.

        Raises:
            DescriptionError: a force or drive is a Python function, which a file cannot hold; use a table.
            FileFormatError: no writer for this suffix.

        >>> import os, tempfile
        >>> import partita as pt
        >>> m = pt.Mechanism("pendulum")
        >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     m.save(os.path.join(folder, "pendulum.toml"))
        ...     pt.load(os.path.join(folder, "pendulum.toml")).bodies
        ('rod',)
        """
        from ..io import save

        save(self, path)

    def __repr__(self) -> str:
        d = self._description
        return (
            f"Mechanism({d.name!r}: {len(d.bodies)} bodies, {len(d.joints)} joints, {len(d.drives)} "
            f"drives, {len(d.forces)} forces)"
        )
