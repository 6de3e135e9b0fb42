"""Model files as mechanisms."""

from __future__ import annotations

from os import PathLike

from ..io import read
from .facade import Mechanism


def load(path: str | PathLike[str]) -> Mechanism:
    """Read a mechanism from a model file; the suffix says which kind: .toml.

    Raises:
        MissingFileError: there is no such file.
        FileFormatError: the suffix is not known, or the content is wrong; `line` says where.

    >>> import partita as pt
    >>> try:
    ...     pt.load("no-such-file.toml")
    ... except pt.errors.MissingFileError as error:
    ...     print(error.path)
    no-such-file.toml
    """
    mechanism: Mechanism = read(path, Mechanism)
    return mechanism
