"""The one folder in which a server reads and writes."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath

from ...errors import ArgumentError, FileFormatError, MissingFileError
from ...files import place, put
from .limits import FILE, NAMES

SUFFIXES = (".toml", ".urdf", ".sdf", ".mjcf", ".xml", ".usda", ".usd", ".usdc")


@dataclass(frozen=True)
class Folder:
    """A folder, links in its own path resolved."""

    path: Path

    @classmethod
    def of(cls, path: str) -> Folder:
        """The folder of this name; `MissingFileError` if there is none."""
        where = place(path, "root")
        if not where.is_dir():
            raise MissingFileError(f"--root {path!r} is not a folder; make it first, or give another", path=path)
        return cls(where.resolve())

    def inside(self, name: str) -> Path:
        """The path of a file in the folder, links resolved; `ArgumentError` where it leads out of it."""
        place(name, "file")
        posix, windows = PurePosixPath(name), PureWindowsPath(name)
        if posix.is_absolute() or windows.anchor or ".." in (*posix.parts, *windows.parts):
            raise self._outside(name)
        try:
            found = (self.path / name).resolve()
        except (OSError, RuntimeError) as error:  # a circle of links
            raise self._outside(name) from error
        if not found.is_relative_to(self.path):
            raise self._outside(name)
        return found

    def _outside(self, name: str) -> ArgumentError:
        return ArgumentError(
            f"file {name[:200]!r} leads out of the folder of this server; give a path relative to that folder, "
            "without '..' (describe without a model lists its files)",
            argument="file",
        )

    def model(self, name: str) -> Path:
        """A model file that may be read."""
        path = self.inside(name)
        if not path.is_file():
            raise MissingFileError(
                f"there is no file {name[:200]!r} in the folder of this server; describe without a model lists them",
                path=name,
            )
        if path.stat().st_size > FILE:
            raise FileFormatError(
                f"{name!r} has {path.stat().st_size} bytes, more than the {FILE} that are read", path=name, line=None
            )
        return path

    def models(self) -> list[str]:
        """Names of model files, the first few hundred; links to folders are not followed."""
        found: list[str] = []
        for folder, inner, names in os.walk(self.path):
            inner.sort()
            here = Path(folder).relative_to(self.path)
            found += [(here / name).as_posix() for name in sorted(names) if Path(name).suffix.lower() in SUFFIXES]
            if len(found) >= NAMES:
                break
        return found[:NAMES]

    def new(self, name: str, contents: dict[str, bytes]) -> list[str]:
        """Write files side by side, the first of them as `name`; none may exist yet."""
        first = self.inside(name)
        if not first.parent.is_dir():
            raise MissingFileError(f"cannot write {name!r}: its folder does not exist; name another", path=name)
        paths = [first.with_name(own) for own in contents]
        if there := next((path for path in (first, *paths) if os.path.lexists(path)), None):
            raise ArgumentError(
                f"{there.relative_to(self.path).as_posix()!r} exists, and is not replaced; give another name",
                argument="file",
            )
        written = [put(path, content) for path, content in zip(paths, contents.values(), strict=True)]
        return [path.relative_to(self.path).as_posix() for path in written]
