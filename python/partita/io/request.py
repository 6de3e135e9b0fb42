"""What the caller of `partita.load` asks of a reader, and the files it may open."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..errors import ArgumentError
from ..files import place
from ..options import BASES, INERTIAS, SERIALS, one_of


@dataclass(frozen=True)
class Request:
    """Arguments of `partita.load`.

    Attributes:
        base: what becomes of the root of a robot, "fixed" or "free".
        loops: the file that lists its loop closures, where it is not found by its name.
        inertia: whether an inertia that no body can have is repaired, or refused.
        serial_joints: whether joints between the same two bodies are read one after the other where the file states so
            ("stated"), or wherever each frees what the others lock ("auto").
        root: the folder outside which no file is opened; that of the model unless the caller names one.
    """

    base: str
    inertia: str
    root: Path
    loops: Path | None = None
    serial_joints: str = SERIALS[0]

    def found(self, model: Path, name: str) -> tuple[Path | None, str]:
        """The file or folder that a model names, or None and the reason.

        `package://NAME/rest` and `model://NAME/rest` are looked for as NAME/rest and as rest, in the folder of the
        model and those around it, up to the root; other names in the folder of the model alone.
        """
        scheme, _, rest = name.rpartition("://")
        if scheme not in ("", "file", "package", "model"):
            return None, f"it is at {scheme}://; nothing is downloaded"
        here = model.parent.resolve()
        around = [here, *(folder for folder in here.parents if folder.is_relative_to(self.root))]
        tried = [here / rest]
        if scheme in ("package", "model"):
            tried = [folder / one for one in (rest, rest.partition("/")[2]) if one for folder in around]
        inside = [path for path in (one.resolve() for one in tried) if rest and path.is_relative_to(self.root)]
        existing = next((path for path in inside if path.exists()), None)
        if existing is not None:
            return existing, ""
        wider = 'root="..." in partita.load names a wider one'
        where = f'the folder "{self.root}"'
        return None, f"there is no such file in {where}; {wider}" if inside else f"it lies outside {where}; {wider}"


def request(
    path: Path,
    base: str = "fixed",
    inertia: str | None = None,
    root: object = None,
    loops: object = None,
    serial_joints: str = SERIALS[0],
) -> Request:
    """The arguments, checked for the model in this file."""
    own = path.suffix.lower() == ".toml"
    folder = path.parent.resolve() if root is None else place(root, "root").resolve()
    if not path.parent.resolve().is_relative_to(folder):
        raise ArgumentError(f'root "{folder}" must be a folder that the model "{path}" lies in', argument="root")
    chosen = ("strict" if own else "repair") if inertia is None else one_of("inertia", inertia, INERTIAS)
    listed = None if loops is None else place(loops, "loops")
    serial = one_of("serial_joints", serial_joints, SERIALS)
    return Request(one_of("base", base, BASES), chosen, folder, listed, serial)
