"""Model files: `read` and `save`, by the suffix of the path."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any

from .. import limits
from ..builder import Builder
from ..errors import ArgumentError, FileFormatError
from ..files import place, target
from . import (
    mjcf,
    mjcf_writer,
    repair,
    robot,
    robot_builder,
    sdf,
    toml,
    urdf,
    urdf_writer,
    usd,
    usd_stage,
    usd_writer,
    writing_table,
)
from .reading import Reading, Remark, RemarkGroup
from .request import Request, request
from .toml import Maker
from .writing import Writing
from .xmltree import parse

__all__ = ["Reading", "Remark", "RemarkGroup", "Writing", "read", "save"]


def _robot(of: Callable[[Path, Request], robot.Robot]) -> Callable[[Path, Maker, Request], Any]:
    """A reader of robots' files as one of mechanisms."""

    def read(path: Path, make: Maker, request: Request) -> Any:
        found = of(path, request)
        limits.refuse_above("bodies", len(found.links), str(path))
        _loops_of(found.reading.kind, request)
        more = {} if found.drawing_tolerance is None else {"drawing_tolerance": found.drawing_tolerance}
        mechanism: Any = make(found.name, found.gravity, **more)
        robot_builder.build(found, mechanism)
        mechanism.reading = found.reading
        return mechanism

    return read


def _loops_of(kind: str, request: Request) -> None:
    """Refuse a list of loops for a format whose files state their own."""
    if request.loops is not None and kind not in ("URDF", "SDFormat"):
        raise ArgumentError(
            f"loops lists the loop closures of URDF and SDFormat; {kind} states its own", argument="loops"
        )


def _xml(path: Path, request: Request) -> robot.Robot:
    """A robot in XML whose suffix does not say in which format."""
    root = parse(path)
    of = {"robot": urdf.read, "mujoco": mjcf.read, "sdf": sdf.read}.get(root.tag)
    if of is None:
        root.fail("is neither <robot> (URDF), nor <mujoco> (MJCF), nor <sdf>")
    return of(path, request)


def _toml(path: Path, make: Maker, request: Request) -> Any:
    _loops_of("TOML", request)
    reading = Reading(path, "TOML", used=[Remark(None, "everything")])

    def opened(name: str) -> Path:
        found, why = request.found(path, name)
        if found is None:
            raise FileFormatError(f'the mesh "{name}" is not opened: {why}', path=str(path), line=None)
        return found

    mechanism: Any = toml.read(path, make, repair.of_reading(reading) if request.inertia == "repair" else None, opened)
    mechanism.reading = reading
    return mechanism


def _whole(mechanism: Builder, path: Path, strict: bool) -> Writing:
    report = Writing(path, "TOML")
    writing_table.visit(mechanism._description, report)
    report.judge(strict)
    toml.write(mechanism, path)
    report.files.append(path)
    return report


# A new format is a module with `read` and, if it can hold a whole mechanism, `write`, and one line here.
_READERS: dict[str, Callable[[Path, Maker, Request], Any]] = {
    ".toml": _toml,
    ".urdf": _robot(urdf.read),
    ".mjcf": _robot(mjcf.read),
    ".sdf": _robot(sdf.read),
    ".xml": _robot(_xml),
    **dict.fromkeys(usd_stage.SUFFIXES, _robot(usd.read)),
}
_WRITERS: dict[str, Callable[[Builder, Path, bool], Writing]] = {
    ".toml": _whole,
    ".urdf": urdf_writer.write,
    ".mjcf": mjcf_writer.write,
    ".xml": mjcf_writer.write,
    **dict.fromkeys(usd_stage.SUFFIXES, usd_writer.write),
}


def read(path: str | PathLike[str], make: Maker, **asked: Any) -> Any:
    """What `make(name, gravity)` made, filled from a model file; see `partita.load`, whose other arguments `asked`
    are."""
    where = place(path)
    reader: Callable[[Path, Maker, Request], Any] = _by_suffix(_READERS, where, "read")
    return reader(where, make, request(where, **asked))


def save(mechanism: Builder, path: str | PathLike[str], strict: bool = False) -> Writing:
    """Write a mechanism to a model file; see `Mechanism.save`."""
    where = place(path)
    writer: Callable[[Builder, Path, bool], Writing] = _by_suffix(_WRITERS, where, "written")
    target(where)
    return writer(mechanism, where, strict)


def _by_suffix(table: dict[str, Any], path: Path, verb: str) -> Any:
    found = table.get(path.suffix.lower())
    if found is None:
        shown = f'the suffix "{path.suffix}" is not known' if path.suffix else "the name has no suffix"
        if path.suffix.lower() == ".xacro":
            shown = "it is a xacro, from which the model is made: xacro FILE > robot.urdf"
        raise FileFormatError(
            f'"{path}": {shown}; files that can be {verb}: {", ".join(table)}', path=str(path), line=None
        )
    return found
