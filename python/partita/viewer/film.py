"""A run as a film: a GIF, or by ffmpeg an MP4. The mechanism is seen as on its page, in parallel projection."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileFormatError, MissingDependencyError
from ..extras import extra
from ..files import put, target
from ..numeric import shown
from ..result_view import ResultView, checked_run
from .hints import solids, traced
from .pose import Pose
from .scene import describe
from .sheet import BODIES, PALETTE, PAPER, shade
from .stage import Stage

FloatArray = NDArray[np.float64]

TOO_SHORT = 2.0
"""Shorter runs are shown slower. Scale: s. Reason: less cannot be followed."""
TOO_LONG = 20.0
"""Longer runs are shown faster. Scale: s. Reason: more is not watched."""
MOST_PICTURES = 900


def save_film(
    result: ResultView,
    path: str | os.PathLike[str],
    *,
    fps: float = 20.0,
    speed: float | None = None,
    size: tuple[int, int] = (800, 600),
    forces: bool = True,
    shapes: Mapping[str, Any] | None = None,
    points: Mapping[str, Any] | None = None,
) -> Path:
    """See `Result.save_animation`."""
    checked_run(result)
    where = target(path, "a film ")
    ending = where.suffix.lower()
    if ending not in (".gif", ".mp4"):
        raise ArgumentError(f"the name of a film must end in .gif or .mp4, not {shown(where.name)}", argument="path")
    if len(result.t) == 0:
        raise ArgumentError(
            "cannot film a run with no outputs: it stopped before the first one; see result.message", argument="result"
        )
    width, height = _pixels(size)
    if not result.names.bodies:
        raise ArgumentError("a run of a user-defined System has no bodies to film", argument="result")
    extra("PIL", "plots", "a film")
    program = shutil.which("ffmpeg") if ending == ".mp4" else None
    if ending == ".mp4" and program is None:
        raise MissingDependencyError(
            "an MP4 is made by the program ffmpeg, which is not installed; install it, or save a .gif", package="ffmpeg"
        )
    frames, rate, factor = _chosen(result.t, _positive("fps", fps), speed)
    bodies = list(result.names.bodies)
    scene = describe(result, None, solids(shapes, bodies), traced(points, bodies), packed=False)
    stage = Stage(Pose(scene), (width, height), forces, factor)
    runs = [(frame, len(list(same))) for frame, same in groupby(frames)]  # an output may fill several frames
    pictures = ((stage.picture(frame), count) for frame, count in runs)
    if program is not None:
        _mp4(program, where, pictures, (width, height), rate)
        return where
    return put(where, _gif(pictures, rate))


def _pixels(size: Any) -> tuple[int, int]:
    whole = isinstance(size, tuple | list) and len(size) == 2 and all(isinstance(x, int) for x in size)
    if not whole or not all(120 <= x <= 4000 for x in size):
        raise ArgumentError(
            f"size must be (width, height), two whole numbers of pixels from 120 to 4000, not {shown(size)}",
            argument="size",
        )
    return int(size[0]) // 2 * 2, int(size[1]) // 2 * 2  # video encoders need even numbers of pixels


def _positive(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if isinstance(value, bool) or not np.isfinite(number) or number <= 0.0:
        raise ArgumentError(f"{name} must be a positive number, not {shown(value)}", argument=name)
    return number


def _chosen(t: FloatArray, fps: float, speed: float | None) -> tuple[list[int], float, float]:
    """Outputs shown, frames per second, and the speed of the film relative to real time.

    In real time where that takes 2 to 20 s, else in ten seconds. Only computed outputs are shown, each nearest its
    time.
    """
    duration = float(t[-1] - t[0])
    if duration == 0.0:
        return [0], fps, 1.0
    factor = (
        _positive("speed", speed)
        if speed is not None
        else 1.0
        if TOO_SHORT <= duration <= TOO_LONG
        else duration / 10.0
    )
    count = max(2, round(duration / factor * fps))
    if count > MOST_PICTURES:
        raise ArgumentError(
            f"the film would have {count} pictures; at most {MOST_PICTURES} are allowed: ask for a larger speed than "
            f"{factor:g} or fewer fps than {fps:g}",
            argument="speed",
        )
    wanted = t[0] + np.arange(count) * factor / fps
    after = np.clip(np.searchsorted(t, wanted), 1, len(t) - 1)
    near = np.where(wanted - t[after - 1] <= t[after] - wanted, after - 1, after)
    return [int(i) for i in near], fps, factor


def _gif(pictures: Iterator[tuple[Any, int]], rate: float) -> bytes:
    """All frames with the palette of the first ones: a separate palette for each frame would flicker."""
    from PIL import Image

    images, counts = zip(*pictures, strict=True)
    width, height = images[0].size
    some = images[:: max(1, len(images) // 4)][:4]
    sheet = Image.new("RGB", (width, height * len(some)))
    for i, image in enumerate(some):
        sheet.paste(image, (0, i * height))
    mixed = sheet.quantize(160, dither=Image.Dither.NONE).getpalette() or []
    shades = [shade(colour, amount) for colour in BODIES for amount in (-0.45, -0.3, -0.15, 0.0, 0.2, 0.4)]
    own = [*PALETTE, *shades]
    colours = Image.new("P", (1, 1))
    # Drawing colours are kept exactly; blended colours close to the background become the background.
    near = [
        c for c in zip(*[iter(mixed)] * 3, strict=True) if max(abs(a - b) for a, b in zip(c, PAPER, strict=True)) > 9
    ]
    table = [channel for colour in [*own, *near][:256] for channel in colour]
    colours.putpalette(table + table[:3] * (256 - len(table) // 3))
    few = [image.quantize(palette=colours, dither=Image.Dither.NONE) for image in images]
    stream = io.BytesIO()
    # A GIF counts hundredths of a second.
    every = max(20, round(100.0 / rate) * 10)
    times = [every * count for count in counts]
    few[0].save(stream, "GIF", save_all=True, append_images=few[1:], duration=times, loop=0, optimize=False)
    return stream.getvalue()


def _mp4(program: str, where: Path, pictures: Iterator[tuple[Any, int]], size: tuple[int, int], rate: float) -> None:
    command = [program, "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}",
               "-r", f"{rate:g}", "-i", "-", "-pix_fmt", "yuv420p", "-movflags", "+faststart", str(where)]  # fmt: skip
    data = b"".join(image.tobytes() * count for image, count in pictures)
    done = subprocess.run(command, input=data, capture_output=True, check=False)
    if done.returncode != 0:
        reason = done.stderr.decode("utf-8", "replace").strip().splitlines()[-1:] or ["it gave no reason"]
        raise FileFormatError(f'ffmpeg could not write "{where}": {reason[0]}', path=str(where))
