"""FMI 2.0 and 3.0 for co-simulation: the inputs, outputs and parameters of an FMU, and the archive.

The binary is the same in all of them: the core without Python, which reads the mechanism from the resources.
"""

from __future__ import annotations

import difflib
import hashlib
import io
import json
import platform
import re
import sys
import zipfile
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from ..builder.joints import scalars, speeds
from ..builder.parameter_units import parameter_unit
from ..builder.records import Description, JointRecord, LoadRecord, TorqueRecord
from ..builder.spec import Writer
from ..builder.values import Constant, Function
from ..errors import ArgumentError, DescriptionError, MissingDependencyError
from ..files import put
from ..numeric import is_list
from ..state import Layout
from .delta import OtherFileError, applied
from .fmu_description import Described, Variable, arrays, page, xml
from .skeleton import axes_of

BINARIES = Path(__file__).parents[1] / "_fmu"
"""Where the binary is put when Partita is built; in wheels, its difference to the module (see `delta`)."""
_SYSTEMS = {
    "linux": ("linux64", "linux", "libpartita_fmu.so", ".so"),
    "darwin": ("darwin64", "darwin", "libpartita_fmu.dylib", ".dylib"),
}
_WINDOWS = ("win64", "windows", "partita_fmu.dll", ".dll")
"""Of a system: its folder by FMI 2.0, its name by FMI 3.0, the file here, and its suffix."""
_PROCESSORS = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}
_PARTS = ("position", "velocity", "force", "moment", "effort")
_AXES = "xyz"
_DERIVATIVES = ("position", "rate", "acceleration")
_FMI_UNITS = {"N m": "N.m"}
"""Units of parameters whose names in the description are others."""


@dataclass(frozen=True)
class Input:
    """An input: an effort along a joint coordinate, or the position or the rate of a drive, with its derivatives.

    `values` are its variables, each with its name, its unit and its meaning.
    """

    name: str
    kind: str
    values: tuple[tuple[str, str, str], ...]


@dataclass(frozen=True)
class Output:
    """An output: its name, what it is a number of, its unit, its meaning, and its name in the resources."""

    name: str
    of: str
    unit: str
    words: str
    means: Mapping[str, Any]


def prepared(d: Description, names: Iterable[str]) -> tuple[Description, list[Input]]:
    """The mechanism with the elements through which its inputs act; a torque is added for each joint named."""
    copy, found = d.copy(), list[Input]()
    for name in _listed("inputs", names):
        kinds = [
            kind for kind, table in (("force", d.forces), ("drive", d.drives), ("joint", d.joints)) if name in table
        ]
        if len(kinds) != 1:
            known = [n for n, f in d.forces.items() if isinstance(f, TorqueRecord)]
            known += [*d.drives, *(j.name for j in d.joints.values() if scalars(j))]
            why = f"is the name of a {' and of a '.join(kinds)}" if kinds else "is not a torque, drive or joint"
            raise ArgumentError(f'inputs: "{name}" {why}; choose among {", ".join(known)}', argument="inputs")
        if name in {x.name for x in found}:
            raise ArgumentError(f'inputs: "{name}" appears twice', argument="inputs")
        found.append(_input(copy, name, kinds[0]))
    return copy, found


def _listed(argument: str, names: Any) -> list[str]:
    if not is_list(names):
        raise ArgumentError(f"{argument} must be a list of names, not {names!r:.80}", argument=argument)
    listed = [str(name) if hasattr(name, "mechanism") else name for name in names]
    if not all(isinstance(name, str) for name in listed):
        raise ArgumentError(f"{argument} must be a list of names, not {names!r:.80}", argument=argument)
    return listed


def _input(d: Description, name: str, kind: str) -> Input:
    """Add the element through which the input acts."""
    if kind == "drive":
        drive = d.drives[name]
        if drive.measure.get("of") != "joint" or drive.slides or "coordinate" not in drive.measure:
            raise ArgumentError(
                f'inputs: drive "{name}" is not of one joint coordinate; only those can be inputs', argument="inputs"
            )
        joint = d.joints[str(drive.measure["joint"])]
        kind = "position" if drive.level == "position" else "rate"
        kinds = _DERIVATIVES[_DERIVATIVES.index(kind) :]
        values = [
            (
                name if of == kind else f"{name}.{of}",
                _unit(joint, int(drive.measure["coordinate"]), of),
                f"{of} of drive {name} at the beginning of a step",
            )
            for of in kinds
        ]
        return Input(name, kind, tuple(values))
    if kind == "force":
        force = d.forces[name]
        if not isinstance(force, TorqueRecord):
            raise ArgumentError(f'inputs: force "{name}" is not a torque (see add_torque)', argument="inputs")
        start = force.value if isinstance(force.value, Constant) and force.over is None else Constant(0.0)
        d.forces[name] = replace(force, value=start, over=None, periodic=False)
        unit = _unit(d.joints[force.joint], force.coordinate, "effort")
        return Input(name, "effort", ((name, unit, f"effort {name} along joint {force.joint}, held over a step"),))
    joint = d.joints[name]
    if scalars(joint) != 1:
        raise ArgumentError(
            f'inputs: joint "{name}" has {scalars(joint)} slides and angles; add a torque along one of them '
            "(add_torque) and name that torque as input",
            argument="inputs",
        )
    d.store(d.forces, TorqueRecord(_fresh(d.forces, f"input {name}"), name, 0, Constant(0.0)))
    return Input(name, "effort", ((name, _unit(joint, 0, "effort"), f"effort along joint {name}, held over a step"),))


def _fresh(taken: Container[str], wanted: str) -> str:
    name, number = wanted, 1
    while name in taken:
        number += 1
        name = f"{wanted} {number}"
    return name


def _unit(joint: JointRecord, coordinate: int, of: str) -> str:
    kinds = [kind for kind, _ in axes_of(joint)] or ["slide"] * 3
    slide = kinds[min(coordinate, len(kinds) - 1)] == "slide"
    units = {
        "position": ("rad", "m"),
        "rate": ("rad/s", "m/s"),
        "acceleration": ("rad/s^2", "m/s^2"),
        "effort": ("N.m", "N"),
    }
    return units[of][slide]


Held = Mapping[str, tuple[list[int], list[str]]]
"""Elements that hold at times and events, by name: numbers of their events, and the drives by which they hold."""


def outputs_of(d: Description, names: Iterable[str] | None, held: Held) -> list[Output]:
    """What is shown: "A.position", "A.force", ...; "A" is position and velocity of joint A, "energy" both energies;
    "brake.effort", "brake.count", "brake.time" of what holds."""
    if names is None:
        names = [*(name for name, joint in d.joints.items() if _coordinates(joint)), "energy"]
        names += [f"{name}.count" for name in held if name not in d.joints]
    found: list[Output] = []
    for name in _listed("outputs", names):
        new = _of_held(d, name, held) or _outputs(d, name)
        taken = {x.name for x in found}
        if any(x.name in taken for x in new):
            raise ArgumentError(f'outputs: "{name}" appears twice', argument="outputs")
        found += new
    return found


def _of_held(d: Description, name: str, held: Held) -> list[Output]:
    """Of an element that holds at times, or of an event."""
    of, _, part = name.rpartition(".")
    if of not in held or of in d.joints or part not in ("effort", "count", "time"):
        return []
    events, drives = held[of]
    if part == "effort":
        force = d.forces.get(of)
        if force is None or not drives:
            raise ArgumentError(f'outputs: "{of}" carries nothing; it has .count and .time', argument="outputs")
        means = force.arguments if isinstance(force, LoadRecord) else {}
        joint = d.joints.get(str(means.get("joint")))
        unit = "N" if joint is None else _unit(joint, int(means.get("coordinate") or 0), "effort")
        return [Output(name, name, unit, f"what {of} carries", {"what": "carried", "drives": drives})]
    words = f"how often something happened to {of}" if part == "count" else f"when something last happened to {of}"
    unit, what = ("", "count") if part == "count" else ("s", "last")
    return [Output(name, name, unit, words, {"what": what, "events": events})]


def _outputs(d: Description, name: str) -> list[Output]:
    energies = {
        "energy.kinetic": Output("energy.kinetic", "energy.kinetic", "J", "kinetic energy", {"what": "kinetic"}),
        "energy.potential": Output(
            "energy.potential", "energy.potential", "J", "potential energy", {"what": "potential"}
        ),
    }
    if name in d.joints:
        return [x for part in ("position", "velocity") for x in _of_joint(d.joints[name], part)]
    if name == "energy":
        return list(energies.values())
    if name in energies:
        return [energies[name]]
    joint, _, part = name.rpartition(".")
    if joint not in d.joints or part not in _PARTS:
        raise ArgumentError(
            f'outputs: "{name}" is not known; give a joint ({", ".join(d.joints)}), JOINT.position, '
            ".velocity, .force, .moment or .effort, or energy",
            argument="outputs",
        )
    found = _of_joint(d.joints[joint], part)
    if not found:
        raise ArgumentError(f'outputs: joint "{joint}" has no {part}', argument="outputs")
    return found


@dataclass(frozen=True)
class Parameter:
    """A number of a parameter, which the environment sets before the start."""

    name: str
    of: str
    unit: str
    words: str
    start: float
    means: Mapping[str, Any]


def parameters_of(d: Description, names: Iterable[str], known: Mapping[str, Any]) -> list[Parameter]:
    """The numbers of the parameters named; `known` are all parameters with their values."""
    found: list[Parameter] = []
    for name in _listed("parameters", names):
        if name not in known:
            close = difflib.get_close_matches(name, known, n=3) or list(known)[:10]
            raise ArgumentError(
                f'parameters: "{name}" is not one; near it: {", ".join(close)} (m.compile().parameters has all)',
                argument="parameters",
            )
        if any(x.means["name"] == name for x in found):
            raise ArgumentError(f'parameters: "{name}" appears twice', argument="parameters")
        values = np.atleast_1d(np.asarray(known[name], dtype=float))
        unit = parameter_unit(d, name)
        for i, value in enumerate(values):
            part = "" if len(values) == 1 else f".{_AXES[i] if len(values) == 3 else i}"
            own = str(unit if isinstance(unit, str) else unit[i])
            words = f"parameter {name}, set before the start"
            means = {"name": name, "component": i}
            found.append(Parameter(name + part, name, _FMI_UNITS.get(own, own), words, float(value), means))
    return found


def _coordinates(joint: JointRecord) -> list[str]:
    """Units of the coordinates of a joint."""
    kinds = ["slide"] * 3 + ["ball"] if joint.kind == "free" else [kind for kind, _ in axes_of(joint)]
    return [unit for kind in kinds for unit in {"slide": ["m"], "turn": ["rad"], "ball": ["1"] * 4}[kind]]


def _of_joint(joint: JointRecord, part: str) -> list[Output]:
    coordinates = [] if joint.kind == "constant_velocity" else _coordinates(joint)
    if part == "position":
        units = coordinates
    elif part == "velocity":
        units = ["m/s" if unit == "m" else "rad/s" for unit in coordinates]
        units = units[: 0 if joint.kind == "constant_velocity" else speeds(joint)]
    elif part == "effort":
        units = ["N" if unit == "m" else "N.m" for unit in coordinates[: scalars(joint)]]
    else:
        units = ["N" if part == "force" else "N.m"] * 3
    along = part in ("force", "moment")
    words = f"{part} of joint {joint.name}" + (" on its child, world axes" if along else "")
    return [
        Output(
            f"{joint.name}.{part}" + (f".{_AXES[i] if along else i}" if len(units) > 1 else ""),
            f"{joint.name}.{part}",
            unit,
            words,
            {"what": part, "joint": joint.name, "component": i},
        )
        for i, unit in enumerate(units)
    ]


def model_of(d: Description, layout: Layout, inputs: list[Input]) -> dict[str, Any]:
    """The mechanism in the form of the core, its inputs as functions. Refuses Python functions."""
    for drive in d.drives.values():
        if drive.name in {x.name for x in inputs if x.kind != "effort"}:
            d.drives[drive.name] = replace(drive, motion=Constant(0.0), level="position", rate=0.0)
    writer = Writer(d, layout)
    model = writer.spec()
    if writer.functions:
        which = ", ".join(_functions(d)) or "couplings, forces"
        raise DescriptionError(
            f"{len(writer.functions)} Python functions act in {d.name!r} ({which}), which an FMU cannot contain; "
            f"sample them into tables, or turn them into inputs",
            element="mechanism",
            name=d.name,
        )
    for number, one in enumerate(inputs):
        function = {"function": number}
        if one.kind != "effort":
            next(x for x in model["drives"] if x["name"] == one.name)["motion"] = function
        else:
            wanted = one.name if one.name in d.forces else f"input {one.name}"
            next(x for x in model["forces"] if x["name"] == wanted)["value"] = function
    return model


def _functions(d: Description) -> list[str]:
    values = [(x.name, x.motion) for x in d.drives.values()]
    values += [(x.name, x.value) for x in d.forces.values() if isinstance(x, TorqueRecord)]
    return [name for name, value in values if isinstance(value, Function)]


def binary(version: str) -> tuple[str, bytes, str]:
    """Folder in the archive, content and suffix of the binary for this system."""
    folder, system, name, suffix = _SYSTEMS.get(sys.platform, _WINDOWS)
    path = BINARIES / name
    processor = _PROCESSORS.get(platform.machine().lower())
    known = processor == "x86_64" or sys.platform == "darwin" if version == "2.0" else processor is not None
    stored = path.with_name(f"{name}.delta")
    if not (path.is_file() or stored.is_file()) or not known:
        raise MissingDependencyError(
            f"this installation of Partita has no binary for FMUs ({path}); `make fmu` in its sources builds it",
            package="partita",
        )
    content = path.read_bytes() if path.is_file() else _restored(stored)
    return folder if version == "2.0" else f"{processor}-{system}", content, suffix


def _restored(path: Path) -> bytes:
    """The binary of a wheel, from its difference to the module."""
    try:
        import lzma  # a Python may have been compiled without it
    except ImportError as error:
        raise MissingDependencyError(
            f"this Python has no lzma, which unpacks the binary for FMUs ({path}); use one that was compiled with it",
            package="lzma",
        ) from error
    module = Path(str(_core.__file__))
    try:
        return applied(module.read_bytes(), lzma.decompress(path.read_bytes()))
    except (OtherFileError, lzma.LZMAError) as error:
        raise MissingDependencyError(
            f"the binary for FMUs is stored as its difference ({path}) to the module {module}, and {error}: install "
            "Partita again from its wheel; whoever packs it anew, with tools that strip, sign or relocate the module, "
            "builds it with `tools/wheels.py --whole`",
            package="partita",
        ) from error


def variables_of(
    inputs: list[Input], starts: list[list[float]], outputs: list[Output], parameters: list[Parameter], version: str
) -> list[Variable]:
    """All variables: one for each value, and by FMI 3.0 arrays and the time."""
    found = [
        Variable(name, "input", name, unit, words, 0, starts=(start,))
        for x, values in zip(inputs, starts, strict=True)
        for (name, unit, words), start in zip(x.values, values, strict=True)
    ]
    found = [replace(x, number=i) for i, x in enumerate(found)]
    found += [Variable(x.name, "output", x.of, x.unit, x.words, i) for i, x in enumerate(outputs, len(found))]
    found += [
        Variable(x.name, "parameter", x.of, x.unit, x.words, i, starts=(x.start,))
        for i, x in enumerate(parameters, len(found))
    ]
    count = len(found)
    if version == "3.0":
        found = arrays(found)
    names = [x.name for x in found]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ArgumentError(
            f'inputs, outputs and parameters: two variables have the name "{twice}"; rename what is called so in the '
            "mechanism",
            argument="inputs",
        )
    if version == "3.0":
        name = _fresh(names, "time")
        found.append(Variable(name, "independent", name, "s", "time", count))
    return found


def archive(
    path: Path,
    name: str,
    version: str,
    resource: dict[str, Any],
    variables: list[Variable],
    experiment: dict[str, float],
) -> None:
    """Write the FMU. The same mechanism gives the same bytes."""
    folder, content, suffix = binary(version)
    resource = {**resource, "arrays": [[x.number, x.size] for x in variables if x.size > 1]}
    fingerprint = version.encode() + json.dumps(resource).encode() + hashlib.sha256(content).digest()
    digest = hashlib.sha256(fingerprint).hexdigest()
    token = "{" + "-".join(digest[a:b] for a, b in ((0, 8), (8, 12), (12, 16), (16, 20), (20, 32))) + "}"
    identifier = re.sub(r"[^A-Za-z0-9_]", "_", name)
    identifier = identifier if identifier[:1].isalpha() else f"m_{identifier}"
    described = Described(name, token, identifier, experiment, variables)
    members = {
        "modelDescription.xml": xml(described, version).encode("utf-8"),
        "resources/model.json": json.dumps({**resource, "guid": token}).encode(),
        f"binaries/{folder}/{identifier}{suffix}": content,
        "documentation/index.html": page(described, version).encode("utf-8"),
        "documentation/licenses/license.txt": _LICENCE.encode("utf-8"),
    }
    members |= {f"documentation/licenses/{x.name}.txt": x.read_bytes() for x in sorted(BINARIES.glob("LICENSE-*"))}
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w") as packed:
        for member, data in members.items():
            info = zipfile.ZipInfo(member, (1980, 1, 1, 0, 0, 0))
            info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            packed.writestr(info, data, compresslevel=1)
    put(path, whole.getvalue())


_LICENCE = """\
The folder "binaries" holds the compiled core of Partita, which is licensed under the MIT License or the Apache License,
Version 2.0, at your option. It contains Rust libraries under the same licences. The mechanism in the folder "resources"
is its author's.
"""
