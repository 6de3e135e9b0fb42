"""The page on which a mechanism is drawn as a file of its own: the core is in it, as a WebAssembly module."""

from __future__ import annotations

import base64
import gzip
from os import PathLike
from pathlib import Path

from ..errors import MissingFileError
from ..files import put, target
from ..viewer.page import DRAWS
from ..webpage import whole_page
from .drawing import EMPTY

MODULE = Path(__file__).parent.parent / "_web" / "partita_web.wasm"
"""The core as `make web` builds it."""
SCRIPTS = ("document.js", "picture.js", "core.js", "meaning.js", "inside.js", "running.js", "controls.js")


def packed_core() -> str:
    """The core as pages hold it: compressed, in base 64. Raises `MissingFileError` where it was not built for pages."""
    if not MODULE.is_file():
        raise MissingFileError(
            "this installation has no core for pages: it was built without Rust's target wasm32-unknown-unknown; in "
            "the folder of the sources `rustup target add wasm32-unknown-unknown` and `make web` build it",
            path=str(MODULE),
        )
    return base64.b64encode(gzip.compress(MODULE.read_bytes(), compresslevel=9, mtime=0)).decode("ascii")


def static_page() -> str:
    """The page as text. Raises as `packed_core`."""
    data = {"drawing": EMPTY, "empty": EMPTY}
    return whole_page(__package__, "Draw a mechanism", data, SCRIPTS, packed_core(), ("partita.viewer", DRAWS))


def write_static_page(path: str | PathLike[str]) -> Path:
    """Write the page on which a planar mechanism is drawn as one file, which computes without Python, a server or a
    network: `partita draw --static draw.html`.

    The core itself is in the page, so what it says and computes is what `Mechanism.report` and `Mechanism.simulate` do.
    Its address holds the mechanism: who opens it has the same one, to the last bit. Prefer `pt.draw()` where the
    mechanism goes on in Python.

    Returns:
        The path.

    Raises:
        MissingFileError: the folder does not exist, or this installation has no core for pages. FileFormatError: the
            file cannot be written.

    >>> from partita.sketch import write_static_page
    >>> write_static_page("draw.html")                              # doctest: +SKIP
    """
    return put(target(path, "a page "), static_page().encode("utf-8"))
