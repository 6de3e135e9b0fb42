"""Model files as mechanisms."""

from __future__ import annotations

from os import PathLike

from ..io import read
from .facade import Mechanism


def load(
    path: str | PathLike[str],
    *,
    base: str = "fixed",
    loops: str | PathLike[str] | None = None,
    inertia: str | None = None,
    root: str | PathLike[str] | None = None,
    serial_joints: str = "stated",
) -> Mechanism:
    """Read a mechanism from a model file; the suffix says which kind: .toml, .urdf, .sdf, .mjcf, .xml,
    .usda, .usd, .usdc.

    What a reader used, changed and left out stands in `Mechanism.remarks`, with lines; what changes the motion is first
    (docs/formats.md). A URDF is drawn with all joints at zero; its loops are closed where the file states so in one of
    the supported forms (docs/robots.md).

    Args:
        path: the file. Nothing in it is run. Other files are opened only in its folder or below: those that it names,
            and a YAML file beside a URDF that lists its loops.
        base: what becomes of the root of a robot: "fixed" to the ground, or "free" to float.
        loops: the YAML file that lists the loop closures and types of joints of a URDF or an SDFormat file. Default:
            beside a URDF that of the same name, else the only one there whose frames it has.
        inertia: "strict" refuses an inertia that no body can have, "repair" replaces it by the nearest possible one
            and reports it. Default: "repair" for robots' files, "strict" for TOML.
        root: a folder around that of the model, within which the files that it names may lie. Default: its own folder.
        serial_joints: what several joints of USD between the same two bodies are. "stated": they hold all at once, as
            USD has it, unless the file states that they add mobility (`newton:jointsAddMobility`). "auto": where each
            frees what the others lock they are one after the other, as converters from MJCF mean it.

    Raises:
        MissingFileError: there is no such file.
        FileFormatError: the suffix is not known, or the content is wrong; `line` says where.
        ArgumentError: base, inertia or serial_joints is none of its words, the model is not in root, or the format has
            no loops to list.

    >>> import partita as pt
    >>> try:
    ...     pt.load("no-such-file.toml")
    ... except pt.errors.MissingFileError as error:
    ...     print(error.path)
    no-such-file.toml
    """
    asked = {"base": base, "loops": loops, "inertia": inertia, "root": root, "serial_joints": serial_joints}
    mechanism: Mechanism = read(path, Mechanism, **asked)
    return mechanism
