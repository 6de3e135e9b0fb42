"""A drawing to which elements are added, one module per kind of element."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..state import Layout
from . import bodies as body_room
from . import changes
from . import compliances as compliance_room
from . import contacts as contact_room
from . import couplings as coupling_room
from . import drives as drive_room
from . import forces as force_room
from . import laws as law_room
from . import loads as load_room
from . import primitives as primitive_room
from . import rotors as rotor_room
from . import sensors as sensor_room
from .elements import Elements
from .explained import explain
from .joint_loads import JointLoads
from .joints import NamedJoints
from .one_way import OneWayLaws
from .records import Body, Coupling, Drive, Force, Handle, Joint, Rotor
from .sensors import Sensor
from .spec import Writer
from .two_point import TwoPointLoads


class Builder(NamedJoints, JointLoads, OneWayLaws, TwoPointLoads):
    """All `add_...` methods."""

    add_body = body_room.add_body
    add_rod = body_room.add_rod
    add_solid = body_room.add_solid

    add_screw = primitive_room.add_screw
    add_custom_joint = primitive_room.add_custom_joint
    add_constant_velocity = primitive_room.add_constant_velocity
    add_point_on_line = primitive_room.add_point_on_line
    add_point_on_plane = primitive_room.add_point_on_plane
    add_parallel = primitive_room.add_parallel
    add_perpendicular = primitive_room.add_perpendicular
    add_orientation = primitive_room.add_orientation

    add_coupler = coupling_room.add_coupler
    add_gear = coupling_room.add_gear
    add_belt = coupling_room.add_belt
    add_rack = coupling_room.add_rack
    add_distance = coupling_room.add_distance
    add_cam = coupling_room.add_cam
    add_point_on_curve = coupling_room.add_point_on_curve
    add_rolling = coupling_room.add_rolling
    add_constraint = coupling_room.add_constraint

    add_rotor = rotor_room.add_rotor
    add_compliance = compliance_room.add_compliance
    add_drive = drive_room.add_drive
    add_torque = force_room.add_torque
    add_force = force_room.add_force
    add_bushing = load_room.add_bushing
    add_contact = contact_room.add_contact
    add_tyre = contact_room.add_tyre
    add_force_law = law_room.add_force_law

    add_sensor = sensor_room.add_sensor
    add_imu = sensor_room.add_imu

    @property
    def bodies(self) -> Elements[Body]:
        """The bodies by name, in the order in which they were added."""
        return Elements(self, Body, "body")

    @property
    def joints(self) -> Elements[Joint]:
        """The joints by name."""
        return Elements(self, Joint, "joint")

    @property
    def couplings(self) -> Elements[Coupling]:
        """The couplings by name."""
        return Elements(self, Coupling, "coupling")

    @property
    def rotors(self) -> Elements[Rotor]:
        """The rotors by name."""
        return Elements(self, Rotor, "rotor")

    @property
    def drives(self) -> Elements[Drive]:
        """The drives by name."""
        return Elements(self, Drive, "drive")

    @property
    def forces(self) -> Elements[Force]:
        """The springs, torques and forces by name."""
        return Elements(self, Force, "force")

    @property
    def sensors(self) -> Elements[Sensor]:
        """The sensors by name."""
        return Elements(self, Sensor, "sensor")

    def _read(self, handle: Handle, word: str) -> Any:
        return changes.read(self, handle, word)

    def _change(self, handle: Handle, arguments: Mapping[str, Any]) -> None:
        changes.change(self, handle, arguments)

    def _content(self, handle: Handle) -> str:
        return changes.content(self, handle)

    def _words(self, handle: Handle) -> list[str]:
        return changes.words(self, handle)

    def to_spec(self) -> dict[str, Any]:
        """The description as plain data, as the core compiles it (version 1): lists, numbers and text only.

        Tables appear as piecewise cubics; a Python function appears as {"function": i}, its number in order.
        """
        return Writer(self._description, Layout()).spec()


explain(Builder)
