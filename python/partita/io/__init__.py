"""Model files: `read` and `save`, by the suffix of the path."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any

from ..builder import Builder
from ..errors import FileFormatError
from ..files import place, target
from . import mjcf, mjcf_writer, robot, robot_builder, sdf, toml, urdf, urdf_writer
from .reading import Reading, Remark, RemarkGroup
from .toml import Maker
from .writing import Writing
from .xmltree import parse

__all__ = ["Reading", "Remark", "RemarkGroup", "Writing", "read", "save"]


def _robot(of: Callable[[Path], robot.Robot]) -> Callable[[Path, Maker, str], Any]:
    """A reader of robots' files as one of mechanisms."""

    def read(path: Path, make: Maker, base: str) -> Any:
        found = of(path)
        more = {} if found.drawing_tolerance is None else {"drawing_tolerance": found.drawing_tolerance}
        mechanism: Any = make(found.name, found.gravity, **more)
        robot_builder.build(found, mechanism, base)
        mechanism.reading = found.reading
        return mechanism

    return read


def _xml(path: Path) -> robot.Robot:
    """A robot in XML whose suffix does not say in which format."""
    root = parse(path)
    of = {"robot": urdf.read, "mujoco": mjcf.read, "sdf": sdf.read}.get(root.tag)
    return of(path) if of is not None else root.fail("is neither <robot> (URDF), nor <mujoco> (MJCF), nor <sdf>")


def _toml(path: Path, make: Maker, base: str) -> Any:
    mechanism: Any = toml.read(path, make)
    mechanism.reading = Reading(path, "TOML", used=[Remark(None, "everything")])
    return mechanism


def _whole(mechanism: Builder, path: Path, strict: bool) -> Writing:
    toml.write(mechanism, path)
    return Writing(path, "TOML", [path])


# A new format is a module with `read` and, if it can hold a whole mechanism, `write`, and one line here.
_READERS: dict[str, Callable[[Path, Maker, str], Any]] = {
    ".toml": _toml,
    ".urdf": _robot(urdf.read),
    ".mjcf": _robot(mjcf.read),
    ".sdf": _robot(sdf.read),
    ".xml": _robot(_xml),
}
_WRITERS: dict[str, Callable[[Builder, Path, bool], Writing]] = {
    ".toml": _whole,
    ".urdf": urdf_writer.write,
    ".mjcf": mjcf_writer.write,
    ".xml": mjcf_writer.write,
}


def read(path: str | PathLike[str], make: Maker, base: str = "fixed") -> Any:
    """What `make(name, gravity)` made, filled from a model file; see `partita.load`."""
    where = place(path)
    reader: Callable[[Path, Maker, str], Any] = _by_suffix(_READERS, where, "read")
    return reader(where, make, base)


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
        raise FileFormatError(
            f'"{path}": {shown}; files that can be {verb}: {", ".join(table)}', path=str(path), line=None
        )
    return found
