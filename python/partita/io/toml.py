"""Model files in TOML: read here, written in `toml_writer`; the keys are those of the published JSON Schema.

    [mechanism]
    partita = 1
    name = "pendulum"

    [[rod]]
    name = "rod"
    start = [0.0, 0.0, 0.0]
    end = [1.0, 0.0, 0.0]
    mass = 1.0

    [[joint]]
    name = "A"
    type = "revolute"
    parent = "ground"
    child = "rod"
    point = [0.0, 0.0, 0.0]

Each table is a call of the `add_...` method of the same name, its keys are the arguments. Bodies are made
before joints, joints before drives and forces, and among themselves in the order of the file.
"""

from __future__ import annotations

import gc
import json
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from operator import itemgetter
from pathlib import Path
from typing import Any

from .. import _core, limits
from ..builder import Builder
from ..builder.points import as_given
from ..builder.sampled import JoinedTable
from ..errors import (
    ArgumentError,
    ChangedFileWarning,
    DescriptionError,
    EvaluationError,
    FileFormatError,
    UnknownNameError,
)
from ..files import BLANK, get, intact, other, put, sealed
from ..shapes import shape_of
from . import schema
from .toml_writer import document

Maker = Callable[..., Builder]
"""Makes an empty mechanism of a name and, if given, a gravity: `Mechanism` itself."""

SEAL = "# as saved by partita (delete this line after editing): "

# Tables whose elements are created together, in the order of the file. All other tables of the schema are forces;
# sensors come last.
_STAGES = (
    ("body", "rod", "solid"),
    ("joint",),
    ("compliance",),
    ("coupler", "gear", "belt", "rack", "distance", "cam", "point_on_curve", "rolling"),
    ("rotor",),
    ("drive",),
)
_LAST = ("mechanism", "sensor")


Mend = Callable[[dict[str, Any]], dict[str, Any]]
"""Changes the arguments of a body before it is made."""


Opened = Callable[[str], Path]
"""The file of some name that a model file refers to."""


def read(path: Path, make: Maker, mend: Mend | None = None, opened: Opened | None = None) -> Any:
    """The mechanism in a TOML file. Raises `FileFormatError` with the line of what is wrong."""
    content = get(path, "model_bytes")
    if (kind := other(content)) is not None:
        raise FileFormatError(f'"{path}": {kind}', path=str(path), line=None)
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise FileFormatError(f'"{path}" cannot be read as UTF-8 text: {error}', path=str(path), line=None) from error
    mechanism = parse(text, make, str(path), mend, opened)
    if intact(content) is True:
        as_given(mechanism._description)
    if intact(content) is False:
        warnings.warn(
            f'"{path}" is not as it was saved (the checksum in its last line does not agree): it was edited, or '
            "damaged. Delete that line if you have edited it; otherwise use another copy",
            ChangedFileWarning,
            stacklevel=4,
        )
    return mechanism


def parse(text: str, make: Maker, path: str = "text", mend: Mend | None = None, opened: Opened | None = None) -> Any:
    """The mechanism in a TOML text; `path` is named in errors, `opened` finds files of meshes."""
    if len(text) > limits.limit("marks"):
        limits.refuse_above("marks", _marks(text.encode("utf-8", "replace")), path)
    with _growing():
        content, begins = _core.parse_toml(text, path)
        file = _File(path, text, json.loads(content), json.loads(begins))
        return file.mechanism(make, mend, opened)


_NO_MARKS = bytes(sorted(set(range(256)) - set(b"\n[]{}=,#.")))


def _marks(content: bytes) -> int:
    """Marks that take memory while TOML is read: separators, brackets, and points between parts of keys, which have no
    separator between them as those of numbers do."""
    marks = content.translate(None, _NO_MARKS)
    return len(marks) - marks.count(b".") + 2 * marks.count(b"..")


@contextmanager
def _growing() -> Iterator[None]:
    """Disable the search for circular garbage: reading creates none, and repeated searches would take a third of the
    time."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


def write(mechanism: Builder, path: Path) -> None:
    """Write a mechanism to a TOML file."""
    text = f"{document(mechanism, path.parent)}\n{SEAL}{BLANK}\n"
    put(path, sealed(text.encode("utf-8")))


class _File:
    """The content of a file, and where the members of each list in it begin."""

    def __init__(self, path: str, text: str, content: dict[str, Any], begins: dict[str, list[int]]) -> None:
        self.path, self.text, self.content, self.begins = path, text, content, begins

    def mechanism(self, make: Maker, mend: Mend | None, opened: Opened | None) -> Any:
        """Check the content by the schema, then pass it to the object that `make` makes."""
        try:
            schema.check(self.content)
        except schema.Mismatch as error:
            raise self._error(error.pointer, error.sentence) from error
        head = self.content["mechanism"]
        mechanism = self._call(
            "/mechanism",
            make,
            {key: _argument(head[key]) for key in ("name", "gravity", "drawing_tolerance") if key in head},
        )
        others = {kind for kinds in (*_STAGES, _LAST) for kind in kinds}
        forces = tuple(kind for kind in schema.load()["properties"] if kind not in others)
        for tables in (*_STAGES, forces, ("sensor",)):
            for kind, pointer, item in self._in_order(tables):
                method, arguments = _call_of(kind, item)
                if kind == "solid":
                    arguments["shape"] = self._call(pointer, shape_of, {"plain": arguments["shape"], "opened": opened})
                if mend is not None and kind == "body":
                    arguments = mend(arguments)
                self._call(pointer, getattr(mechanism, method), arguments)
        return mechanism

    def _in_order(self, tables: tuple[str, ...]) -> Iterator[tuple[str, str, dict[str, Any]]]:
        """Tables of these kinds in the order of the file."""
        found = [
            (begin, kind, f"/{kind}/{index}", item)
            for kind in tables
            for index, (item, begin) in enumerate(
                zip(self.content.get(kind, []), self.begins.get(kind, []), strict=True)
            )
        ]
        for _, kind, pointer, item in sorted(found, key=itemgetter(0)):
            yield kind, pointer, item

    def _call(self, pointer: str, function: Any, arguments: dict[str, Any]) -> Any:
        """Call the builder; its errors are reported with the line."""
        try:
            return function(**arguments)
        except (DescriptionError, UnknownNameError, ArgumentError, EvaluationError, FileFormatError) as error:
            raise self._error(pointer, error.message) from error

    def _error(self, pointer: str, sentence: str) -> FileFormatError:
        line = _core.toml_line(self.text, pointer)
        location = f'"{self.path}", line {line}' if line is not None else f'"{self.path}"'
        return FileFormatError(f"{location}: {sentence}", path=self.path, line=line)


def _call_of(kind: str, item: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """Method and arguments of a table."""
    arguments = {key: _argument(value) for key, value in item.items()}
    if kind == "joint":
        word = arguments.pop("type")
        return "add_joint" if word == "generic" else f"add_{word}", arguments
    if kind == "drive" and isinstance(arguments.get("pose"), dict):
        word = arguments["pose"].pop("interpolation", None)
        arguments |= {} if word is None else {"interpolation": word}
    return f"add_{kind}", arguments


def _argument(value: Any) -> Any:
    """A table {times, values} or {x, y} as the pair that the builder takes; anything else unchanged."""
    if isinstance(value, dict):
        for first, second in (("times", "values"), ("x", "y")):
            if first in value and second in value:
                pair = value[first], value[second]
                # "curve" is the former word, with one value
                word = "spline" if value.get("curve") == "smooth" else value.get("interpolation")
                return pair if word is None else JoinedTable(*pair, word)
        return {key: _argument(item) for key, item in value.items()}
    return [_argument(item) for item in value] if isinstance(value, list) else value
