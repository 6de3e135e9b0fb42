"""Model files as mechanisms."""

from __future__ import annotations

from os import PathLike

from ..io import read
from ..options import one_of
from .facade import Mechanism


def load(path: str | PathLike[str], *, base: str = "fixed") -> Mechanism:
    """Read a mechanism from a model file; the suffix says which kind: .toml, .urdf.

    What a reader used, changed and left out stands in `Mechanism.reading`, each with its line. A URDF is drawn with all
    joints at zero; its loops are closed where the file states so in one of the supported forms (docs/robots.md).

    Args:
        path: the file. Nothing in it is run, no other file is opened but a YAML file of the same name beside a URDF.
        base: what becomes of the root of a robot: "fixed" to the ground, or "free" to float.

    Raises:
        MissingFileError: there is no such file.
        FileFormatError: the suffix is not known, or the content is wrong; `line` says where.
        ArgumentError: base is neither of the two.

    >>> import partita as pt
    >>> try:
    ...     pt.load("no-such-file.toml")
    ... except pt.errors.MissingFileError as error:
    ...     print(error.path)
    no-such-file.toml
    """
    mechanism: Mechanism = read(path, Mechanism, one_of("base", base, ("fixed", "free")))
    return mechanism
