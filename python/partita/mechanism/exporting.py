"""The method `export_c`: equations of motion, or the map between actuators and joints, as a file in C."""

from __future__ import annotations

import re
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from ..builder.compiled import CompiledModel
from ..errors import ArgumentError, FileFormatError
from ..files import put, target
from ..io.c_source import CSource
from ..naming import index_of
from ..numeric import shown
from ..state import State
from .models import Modelled, layout_of
from .set_valued import without_holding
from .solve import assemble, convert

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,40}")


def export_c(
    self: Modelled,
    path: str | PathLike[str],
    *,
    actuators: Sequence[Any] | None = None,
    joints: Sequence[Any] | None = None,
    initial: State | None = None,
    name: str | None = None,
) -> Path:
    """Write the equations as a file in C with a header beside it (.h): plain C99 that needs nothing but `math.h`,
    allocates nothing and has no state of its own.

    Prefer it for controllers and for programs in other languages; `to_fmu` holds the whole mechanism with its changes
    of coordinates. Without `actuators` there are two functions, NAME the name of the file:

    * `NAME_accelerations(t, q, v, vdot)`: all accelerations, v as the constraints allow;
    * `NAME_rates(q, v, qdot)`: rates of the coordinates.

    With `actuators`, as many as the mechanism has degrees of freedom (idle rotations of rods between balls aside), the
    map between them and `joints`, such as the motors and the axes of a parallel ankle. `q` is the whole position: on
    entry one near by (`NAME_start` holds the first), on return the one found.

    * `NAME_to_joints(actuators, q, joints)` and `NAME_to_actuators(joints, q, actuators)`: positions, in closed form
      where there is one, else by Newton's method, at most seven steps;
    * `NAME_jacobian(q, jacobian)`: rates of the joints per rate of each actuator, and `NAME_inverse_jacobian`;
    * `NAME_joint_rates`, `NAME_actuator_rates`, `NAME_actuator_torques`, `NAME_joint_torques`: by these;
    * `NAME_inertia(q, inertia, lengths2)`: mass matrix in the rates of the actuators (their reflected inertia), and 1
      over the inertia or mass that each moves with all joints open;
    * `NAME_margin(q, margin)`: distance from a position where the actuators cannot cause every motion: 0 there, at
      most 1. Bodies without mass or inertia count as they are, where `inverse_dynamics` gives them a little.

    `NAME_to_actuators`, `NAME_inverse_jacobian` and what uses them exist where there are as many joints as actuators.
    Each function returns 0, or 1 where its choice of coordinates does not serve or a loop does not close: then its
    results are of no use. The choice and the branch of each loop are those of `initial`.

    Args:
        path: the file, "ankle.c".
        actuators: names or handles of joints, or of their coordinates ("ankle.turn1"); drives are left out.
        joints: the same, for the other side of the map; None: all other coordinates of tree joints.
        initial: a state on the branch of the loops; None: the drawing, assembled.
        name: what the names of the functions begin with; None: that of the file.

    Returns:
        The path of the file.

    Raises:
        ArgumentError: the velocities named do not determine the position, or not so many are needed; a name that is
            none in C; elements that call Python functions, and friction that follows reactions.
        UnknownNameError: no such joint. AssemblyError: the loops do not close. SingularityError: a singular position.
        FileFormatError, MissingFileError: the file cannot be written, or its name does not end in .c.

    It takes milliseconds; a file has some three operations a line. Lengths in metres, angles in radians.

    >>> import os, tempfile
    >>> import partita as pt
    >>> m = pt.catalogue.load("parallel-ankle")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = m.export_c(os.path.join(folder, "ankle.c"), actuators=["motor l", "motor r"], joints=["ankle"])
    ...     sorted(each.name for each in path.parent.iterdir())
    ['ankle.c', 'ankle.h']
    """
    where = target(path, "equations in C ")
    if where.suffix.lower() != ".c":
        raise FileFormatError(f"{where.name!r} must end in .c", path=str(where), line=None)
    prefix = _prefix(where.stem if name is None else name, name is None)
    if initial is not None and not isinstance(initial, State):
        raise ArgumentError(f"initial must be a State, not {type(initial).__name__}", argument="initial")
    if joints is not None and actuators is None:
        raise ArgumentError("joints are the other side of a map from actuators: name actuators too", argument="joints")
    start = assemble(self) if initial is None else convert(self, initial, "relative")
    without_holding(self, "C source")
    model = layout_of(self, "relative")[0]
    driving = None if actuators is None else _velocities(model, actuators, "actuators")
    if driving is None:
        wanted = []
    elif joints is None:
        wanted = [i for i in _single(model) if i not in driving]
    else:
        wanted = _velocities(model, joints, "joints")
    functions = model.core.c_functions(prefix, start.t, start.q, driving, wanted)
    text = CSource(self.name, prefix, model.velocity_names, start.q.tolist(), driving, wanted, functions)
    put(where.with_suffix(".h"), text.header().encode("utf-8"))
    return put(where, text.source(where.with_suffix(".h").name).encode("utf-8"))


def _prefix(given: Any, of_the_file: bool) -> str:
    """What the names of the functions begin with."""
    if isinstance(given, str) and of_the_file:
        given = re.sub(r"[^A-Za-z0-9_]", "_", given)
    if not isinstance(given, str) or not _NAME.fullmatch(given):
        raise ArgumentError(
            f"the names of functions in C cannot begin with {shown(given)}; give name= as letters, digits and _, a "
            "letter first",
            argument="name",
        )
    return given


def _single(model: CompiledModel) -> list[int]:
    """Velocities of tree joints with one coordinate each."""
    joints = [each for each in model.summary["joints"] if each["tree"] and each["q"][1] == each["v"][1]]
    return sorted(i for each in joints for i in range(each["state_v"][0], sum(each["state_v"])))


def _velocities(model: CompiledModel, wanted: Any, argument: str) -> list[int]:
    """Velocities of joints or of their coordinates, by name."""
    if isinstance(wanted, str) or not isinstance(wanted, Sequence) or not wanted:
        raise ArgumentError(f"{argument} must be a list of joints, not {shown(wanted)}", argument=argument)
    joints = {each["name"]: each for each in model.summary["joints"]}
    found: list[int] = []
    for each in wanted:
        text = str(each)
        if text in joints:
            first, count = joints[text]["state_v"] if joints[text]["tree"] else (0, 0)
            if count == 0:
                raise ArgumentError(
                    f'{argument}: joint "{text}" has no coordinate of its own, since it is where a loop is cut; add it '
                    'with cut="never"',
                    argument=argument,
                )
            found.extend(range(first, first + count))
        else:
            found.append(index_of(text, list(model.velocity_names), "joint or coordinate"))
    twice = [model.velocity_names[i] for i in found if found.count(i) > 1]
    if twice:
        raise ArgumentError(f"{argument}: {twice[0]!r} is named twice", argument=argument)
    return found
