"""A run as a film: a GIF, or by ffmpeg an MP4. The mechanism is seen as on its page, in parallel projection."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileFormatError, MissingDependencyError
from ..extras import extra
from ..files import put, target
from ..numeric import shown
from ..readable import Readable, checked_run
from .hints import solids, traced
from .pose import Pose
from .scene import describe

FloatArray = NDArray[np.float64]
Colour = tuple[int, int, int]

MOST_PICTURES = 900
FINER = 2
"""Pictures are drawn so many times larger and made smaller: edges become smooth."""

BODIES: list[Colour] = [
    (0x8F, 0xB0, 0xD0), (0xA3, 0xC4, 0xA0), (0xD3, 0xBD, 0x8C), (0xB3, 0xA6, 0xD0),
    (0x8F, 0xC2, 0xC2), (0xD0, 0xA3, 0xB0), (0xB7, 0xC4, 0x8C), (0xA5, 0xB1, 0xBF),
]  # fmt: skip
PAPER, INK, EDGE, GROUND = (255, 255, 255), (0x1D, 0x27, 0x30), (0x3C, 0x48, 0x54), (0x77, 0x82, 0x8C)
QUIET, SPRING, TRACE, FORCE = (0x56, 0x64, 0x72), (0x4D, 0x5B, 0x68), (0xA9, 0xB9, 0xC8), (0xB3, 0x26, 0x1E)
LOAD, JOINT, FOOT = (0x0B, 0x6E, 0x4F), (0xF4, 0xF6, 0xF8), (0xEE, 0xF1, 0xF4)
PALETTE = [PAPER, INK, EDGE, GROUND, QUIET, SPRING, TRACE, FORCE, LOAD, JOINT, FOOT, *BODIES]


def save_film(
    result: Readable,
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
        raise ArgumentError(f"a film ends in .gif or .mp4, not {shown(where.name)}", argument="path")
    if len(result.t) == 0:
        raise ArgumentError(
            "cannot film a run with no outputs: it stopped before the first one; see result.message", argument="result"
        )
    width, height = _pixels(size)
    if not result.names.bodies:
        raise ArgumentError("a run of a hand-written System has no bodies to film", argument="result")
    extra("PIL", "plots", "a film")
    program = shutil.which("ffmpeg") if ending == ".mp4" else None
    if ending == ".mp4" and program is None:
        raise MissingDependencyError(
            "an MP4 is made by the program ffmpeg, which is not installed; install it, or save a .gif", package="ffmpeg"
        )
    frames, rate, factor = _chosen(result.t, _positive("fps", fps), speed)
    bodies = list(result.names.bodies)
    scene = describe(result, None, solids(shapes, bodies), traced(points, bodies), packed=False)
    stage = _Stage(Pose(scene), (width, height), forces, factor)
    runs = [(frame, len(list(same))) for frame, same in groupby(frames)]  # fewer outputs than pictures stand longer
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
    return int(size[0]) // 2 * 2, int(size[1]) // 2 * 2  # films are made of blocks of two


def _positive(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if isinstance(value, bool) or not np.isfinite(number) or number <= 0.0:
        raise ArgumentError(f"{name} must be a positive number, not {shown(value)}", argument=name)
    return number


def _chosen(t: FloatArray, fps: float, speed: float | None) -> tuple[list[int], float, float]:
    """Outputs shown, pictures a second, and how many times faster than time the film runs.

    In real time where that takes 2 to 20 s, else in ten seconds. Only computed outputs are shown, each nearest its
    time.
    """
    duration = float(t[-1] - t[0])
    if duration == 0.0:
        return [0], fps, 1.0
    factor = _positive("speed", speed) if speed is not None else 1.0 if 2.0 <= duration <= 20.0 else duration / 10.0
    count = max(2, round(duration / factor * fps))
    if count > MOST_PICTURES:
        raise ArgumentError(
            f"the film would have {count} pictures; {MOST_PICTURES} are the most: ask for a larger speed than "
            f"{factor:g} or fewer fps than {fps:g}",
            argument="speed",
        )
    wanted = t[0] + np.arange(count) * factor / fps
    after = np.clip(np.searchsorted(t, wanted), 1, len(t) - 1)
    near = np.where(wanted - t[after - 1] <= t[after] - wanted, after - 1, after)
    return [int(i) for i in near], fps, factor


def _gif(pictures: Iterator[tuple[Any, int]], rate: float) -> bytes:
    """All pictures in the colours of the first ones: a palette of its own for each would flicker."""
    from PIL import Image

    images, counts = zip(*pictures, strict=True)
    width, height = images[0].size
    some = images[:: max(1, len(images) // 4)][:4]
    sheet = Image.new("RGB", (width, height * len(some)))
    for i, image in enumerate(some):
        sheet.paste(image, (0, i * height))
    mixed = sheet.quantize(160, dither=Image.Dither.NONE).getpalette() or []
    shades = [_shade(colour, amount) for colour in BODIES for amount in (-0.45, -0.3, -0.15, 0.0, 0.2, 0.4)]
    own = [*PALETTE, *shades]
    colours = Image.new("P", (1, 1))
    # The colours that are drawn with stay themselves; of mixtures, the paper takes those close to it.
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
        said = done.stderr.decode("utf-8", "replace").strip().splitlines()[-1:] or ["it gave no reason"]
        raise FileFormatError(f'ffmpeg could not write "{where}": {said[0]}', path=str(where))


def _shade(colour: Colour, amount: float) -> Colour:
    """Mixed with white (amount > 0) or black (amount < 0)."""
    other, part = (255, amount) if amount > 0 else (0, -amount)
    return tuple(round(c * (1.0 - part) + other * part) for c in colour)  # type: ignore[return-value]


@dataclass
class _Sheet:
    """What is drawn of one picture, from far to near."""

    draw: Any
    items: list[tuple[float, int, Callable[[], object]]] = field(default_factory=list)

    def add(self, depth: float, item: Callable[[], object]) -> None:
        if np.isfinite(depth):
            self.items.append((depth, len(self.items), item))

    def paint(self) -> None:
        for _, _, item in sorted(self.items, key=lambda item: item[:2]):
            item()
        self.items.clear()

    def line(self, points: Any, colour: Colour, width: float) -> None:
        flat = [(float(x), float(y)) for x, y in points]
        w = max(1, round(width))
        self.draw.line(flat, fill=colour, width=w, joint="curve")
        if w > 2:  # round ends
            for x, y in (flat[0], flat[-1]):
                self.draw.ellipse((x - w / 2 + 0.5, y - w / 2 + 0.5, x + w / 2 - 0.5, y + w / 2 - 0.5), fill=colour)

    def polygon(self, points: Any, fill: Colour | None, edge: Colour | None = None, width: float = 1.0) -> None:
        flat = [(float(x), float(y)) for x, y in points]
        if fill is not None:
            self.draw.polygon(flat, fill=fill)
        if edge is not None:
            self.draw.line([*flat, flat[0]], fill=edge, width=max(1, round(width)), joint="curve")

    def circle(
        self, at: Any, radius: float, fill: Colour | None, edge: Colour | None = None, width: float = 1.0
    ) -> None:
        x, y = float(at[0]), float(at[1])
        box = (x - radius, y - radius, x + radius, y + radius)
        self.draw.ellipse(box, fill=fill, outline=edge, width=max(1, round(width)))


class _Stage:
    """The mechanism before a camera that stands still."""

    def __init__(self, pose: Pose, size: tuple[int, int], forces: bool, factor: float) -> None:
        from PIL import ImageFont

        self.pose, self.scene, self.forces = pose, pose.scene, forces
        self.width, self.height = size[0] * FINER, size[1] * FINER
        self.size = size
        self.factor = factor
        self.font = ImageFont.load_default(size=max(11, min(18, size[1] // 36)) * FINER)
        view = self.scene["view"]
        right, up, back = (np.array(view[name]) for name in ("right", "up", "back"))
        azimuth, elevation = view["azimuth"], view["elevation"]
        level = np.cos(azimuth) * back + np.sin(azimuth) * right
        self.back = np.cos(elevation) * level + np.sin(elevation) * up
        self.right = np.cos(azimuth) * right - np.sin(azimuth) * back
        self.up = np.cross(self.back, self.right)
        self.origin = np.zeros(3)
        self.follows = pose.middle() if pose.travels() else None
        cloud = pose.extent(self.follows)
        self.extent = float(np.linalg.norm(np.ptp(cloud, axis=0))) or self.scene["size"]
        lengths = sorted(
            float(np.ptp(np.array(b["points"]), axis=0).max()) for b in self.scene["bodies"] if len(b["points"]) > 1
        )
        typical = lengths[len(lengths) // 2] if lengths else self.extent
        self.radius = min(0.013 * self.extent, 0.07 * typical) or 0.013 * self.extent
        spare = 3.5 * self.radius
        low = np.array([(cloud @ axis).min() - spare for axis in (self.right, self.up)])
        high = np.array([(cloud @ axis).max() + spare for axis in (self.right, self.up)])
        room = 0.86 * self.width, self.height - FINER * 96
        self.scale = float(min(room[0] / (high[0] - low[0]), room[1] / (high[1] - low[1])))
        self.middle = (low + high) / 2.0
        self.arrow = min(0.2 * self.extent, 1.5 * typical)
        self.unit = pose.typical_force()
        self.strokes = pose.strokes(0.002 * self.extent)

    def at(self, points: Any) -> FloatArray:
        """Pixels of points (..., 3) of the world."""
        p = np.asarray(points, dtype=float) - self.origin
        x = self.width / 2 + self.scale * (p @ self.right - self.middle[0])
        y = self.height / 2 + 6 * FINER - self.scale * (p @ self.up - self.middle[1])
        return np.stack([x, y], axis=-1)

    def depth(self, points: Any) -> float:
        """Towards the viewer, in steps: what is as near as that keeps the order in which it was drawn."""
        z = float(np.mean(np.asarray(points, dtype=float) @ self.back))
        return float(np.round(z / (0.5 * self.radius)))

    def colour(self, body: int) -> Colour:
        return GROUND if body < 0 else BODIES[body % len(BODIES)]

    def picture(self, frame: int) -> Any:
        from PIL import Image, ImageDraw

        if self.follows is not None:
            self.origin = self.follows[frame]
        image = Image.new("RGB", (self.width, self.height), PAPER)
        sheet = _Sheet(ImageDraw.Draw(image))
        for stroke in self.strokes:
            if len(stroke) > 1:
                sheet.line(self.at(stroke), TRACE, 1.2 * FINER)
            else:
                sheet.circle(self.at(stroke[0]), 1.2 * FINER, TRACE)
        self.couplings(sheet, frame)
        self.bodies(sheet, frame)
        self.springs(sheet, frame)
        self.joints(sheet, frame)
        sheet.paint()
        if self.forces:
            self.arrows(sheet, frame)
        for point in self.scene["points"]:
            x, y = self.at(self.pose.placed(frame, point["body"], point["at"]))
            d = 4.0 * FINER
            sheet.polygon([(x - d, y), (x, y - d), (x + d, y), (x, y + d)], INK, PAPER, FINER)
        self.words(sheet, frame)
        return image.resize(self.size, Image.Resampling.LANCZOS)

    # ---- parts

    def rod(self, sheet: _Sheet, a: FloatArray, b: FloatArray, radius: float, colour: Colour) -> None:
        pieces = 1 if self.scene["flat"] else max(1, min(10, int(np.ceil(np.linalg.norm(b - a) / (5 * radius)))))
        width = max(1.6 * FINER, 2.0 * radius * self.scale)
        for i in range(pieces):
            ends = [a + (b - a) * i / pieces, a + (b - a) * (i + 1) / pieces]

            def draw(ends: Any = ends, i: int = i) -> None:
                pixels = self.at(ends)
                way = pixels[1] - pixels[0]
                unit = way / (np.hypot(*way) or 1.0)
                normal = np.array([-unit[1], unit[0]])
                normal = -normal if normal.sum() > 0 else normal
                outer = [end for end, last in ((pixels[0], i == 0), (pixels[1], i == pieces - 1)) if last]
                for wide, colour_, over in ((width + 2 * FINER, _shade(colour, -0.45), 0.0), (width, colour, FINER)):
                    for end in outer:
                        sheet.circle(end, wide / 2, colour_)
                    first = pixels[0] - (0.0 if i == 0 else over) * unit
                    last = pixels[1] + (0.0 if i == pieces - 1 else over) * unit
                    half = wide / 2 * normal
                    sheet.polygon([first + half, last + half, last - half, first - half], colour_)
                if width > 6 * FINER:
                    strip = pixels + 0.2 * width * normal
                    half = 0.14 * width * normal
                    sheet.polygon(
                        [strip[0] + half, strip[1] + half, strip[1] - half, strip[0] - half], _shade(colour, 0.4)
                    )

            sheet.add(self.depth(ends), draw)

    def ball(self, sheet: _Sheet, centre: FloatArray, radius: float, colour: Colour, lift: float = 0.0) -> None:
        r = max(1.6 * FINER, radius * self.scale)

        def draw() -> None:
            x, y = self.at(centre)
            sheet.circle((x, y), r, _shade(colour, -0.08), EDGE, 1.2 * FINER)
            sheet.circle((x - 0.28 * r, y - 0.28 * r), 0.45 * r, _shade(colour, 0.35))

        sheet.add(self.depth([centre]) + 2 * lift / self.radius, draw)

    def faces(self, sheet: _Sheet, rings: list[FloatArray], colour: Colour, lift: float = 0.0) -> None:
        """Flat faces of a convex solid, corners around an outward normal or its opposite."""
        middle = np.mean(np.concatenate(rings), axis=0)
        for ring in rings:
            normal = np.cross(ring[1] - ring[0], ring[2] - ring[0])
            normal = normal / (np.linalg.norm(normal) or 1.0)
            if normal @ (ring.mean(axis=0) - middle) < 0:
                normal = -normal
            light = float(normal @ self.back)
            if light > 1e-3:
                sheet.add(
                    self.depth([middle]) + 2 * lift / self.radius,
                    partial(self.flat, sheet, ring, _shade(colour, -0.25 + 0.45 * light), EDGE),
                )

    def box(self, sheet: _Sheet, centre: FloatArray, axes: Any, half: Any, colour: Colour, lift: float = 0.0) -> None:
        rings = []
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            for side in (-1, 1):
                middle = centre + side * half[k] * axes[k]
                rings.append(np.array([middle + a * half[i] * axes[i] + b * half[j] * axes[j]
                                       for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))]))  # fmt: skip
        self.faces(sheet, rings, colour, lift)

    def drum(
        self, sheet: _Sheet, centre: FloatArray, axis: FloatArray, radius: float, half: float, colour: Colour,
        lift: float = 0.0,
    ) -> FloatArray:  # fmt: skip
        """A cylinder; returns the centre of the face that is seen."""
        facing = axis if axis @ self.back >= 0 else -axis
        u = np.cross(facing, [1.0, 0, 0] if abs(facing[0]) < 0.7 else [0, 1.0, 0])
        u /= np.linalg.norm(u)
        v = np.cross(facing, u)
        angle = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
        rim = radius * (np.outer(np.cos(angle), u) + np.outer(np.sin(angle), v))
        near, far = centre + half * facing + rim, centre - half * facing + rim

        def draw() -> None:
            a, b = self.at(near), self.at(far)
            for k in range(len(angle)):  # the side, quad by quad, then the face over it
                m = (k + 1) % len(angle)
                sheet.polygon([a[k], a[m], b[m], b[k]], _shade(colour, -0.2))
            sheet.polygon(b, _shade(colour, -0.2))
            sheet.polygon(a, colour, EDGE, 1.1 * FINER)

        sheet.add(self.depth([centre]) + 2 * lift / self.radius, draw)
        return centre + half * facing

    def bodies(self, sheet: _Sheet, frame: int) -> None:
        scene, pose, r = self.scene, self.pose, self.radius
        given = {solid["body"] for solid in scene["solids"]} | pose.hidden
        for b, body in enumerate(scene["bodies"]):
            if b in given:
                continue
            colour, points = self.colour(b), pose.placed(frame, b, np.array(body["points"]))
            if body["kind"] == "plate":
                behind = -7 * r if scene["flat"] else 0.0
                sheet.add(
                    self.depth(points) + 2 * behind / r,
                    partial(self.plate, sheet, points, colour),
                )
            elif body["kind"] == "rod":
                self.rod(sheet, points[0], points[1], r, colour)
            elif body["kind"] == "star":
                for tip in points[1:]:
                    self.rod(sheet, points[0], tip, 0.8 * r, colour)
            elif body["kind"] == "frame":
                for tip, after in zip(points, np.roll(points, -1, axis=0), strict=True):
                    self.rod(sheet, tip, after, 0.6 * r, colour)
            elif body["kind"] == "arc":
                for a, c in pose.arcs(points):
                    self.rod(sheet, a, c, 0.8 * r, colour)
            elif body["kind"] == "hammer":
                self.rod(sheet, points[0], points[1], 0.6 * r, colour)
                self.ball(sheet, points[1], 2 * r, colour, r)
            else:
                self.ball(sheet, points[0], 2 * r, colour, r)
        for solid in scene["solids"]:
            for part in solid["parts"]:
                self.solid(sheet, frame, solid["body"], part)

    def plate(self, sheet: _Sheet, points: FloatArray, colour: Colour) -> None:
        pixels = self.at(points)
        width = max(1.0, 2.0 * self.radius * self.scale)
        sheet.line([*pixels, pixels[0]], _shade(colour, -0.45), width + 2 * FINER)
        sheet.line([*pixels, pixels[0]], _shade(colour, 0.25), width)
        sheet.polygon(pixels, _shade(colour, 0.25))

    def solid(self, sheet: _Sheet, frame: int, body: int, part: Mapping[str, Any]) -> None:
        pose, colour, kind = self.pose, self.colour(body), part["kind"]
        if kind == "mesh":
            points = pose.placed(frame, body, np.reshape(part["points"], (-1, 3)))
            pixels, corners = self.at(points), points[np.reshape(part["faces"], (-1, 3))]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            light = np.abs(normals @ self.back) / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
            far = corners.mean(axis=1) @ self.back / (0.5 * self.radius)
            for face, z, lit in zip(np.reshape(part["faces"], (-1, 3)), far, light, strict=True):
                shade = _shade(colour, -0.35 + 0.66 * float(lit))
                sheet.add(float(z), partial(sheet.polygon, pixels[face], shade, shade))
        elif kind == "plate":
            points = pose.placed(frame, body, np.array(part["points"]))
            sheet.add(self.depth(points), lambda: self.plate(sheet, points, colour))
        elif kind == "rod":
            ends = pose.placed(frame, body, np.array([part["start"], part["end"]]))
            self.rod(sheet, ends[0], ends[1], self.radius, colour)
        else:
            centre = pose.placed(frame, body, np.array(part["center"]))
            if kind == "ball":
                self.ball(sheet, centre, part["radius"], colour)
            elif kind == "box":
                axes = pose.turned(frame, body, np.array(part.get("axes") or np.eye(3)))
                self.box(sheet, centre, axes, [x / 2 for x in part["size"]], colour)
            else:
                own = np.array(part["axis"])
                axis = pose.turned(frame, body, own)
                face = self.drum(sheet, centre, axis, part["radius"], part["length"] / 2, colour)
                first = np.cross(own, [1.0, 0, 0] if abs(own[0]) < 0.7 else [0, 1.0, 0])
                self.spokes(sheet, centre, face, axis, pose.turned(frame, body, first / np.linalg.norm(first)),
                            part["radius"], 5 if kind == "wheel" else 1)  # fmt: skip

    def spokes(
        self, sheet: _Sheet, centre: FloatArray, face: FloatArray, axis: FloatArray, first: FloatArray, radius: float,
        count: int, lift: float = 0.0,
    ) -> None:  # fmt: skip
        if abs(axis @ self.back) < 0.05:
            return
        second, angles = np.cross(axis, first), 2.0 * np.pi * np.arange(count) / count
        ends = [face + 0.86 * radius * (np.cos(a) * first + np.sin(a) * second) for a in angles]
        width = max(1.2 * FINER, 0.05 * radius * self.scale)

        def draw() -> None:
            for end in ends:
                sheet.line(self.at([face, end]), EDGE, width)

        sheet.add(self.depth([centre]) + 2 * lift / self.radius, draw)

    def couplings(self, sheet: _Sheet, frame: int) -> None:
        pose, scene, back = self.pose, self.scene, -6.0 * self.radius
        for wheel in scene["wheels"]:
            body = wheel["body"]
            centre = pose.placed(frame, body, np.array(wheel["center"]))
            axis, first = (pose.turned(frame, body, np.array(wheel[word])) for word in ("axis", "first"))
            colour = _shade(GROUND, 0.3) if wheel["ring"] else self.colour(body)
            outline, face = pose.teeth(wheel, centre, axis, first, self.back)
            deep = self.depth([centre]) + 2 * back / self.radius
            if wheel["ring"]:
                rim = pose.rim(wheel, centre, axis, first)
                sheet.add(deep - 20, partial(self.flat, sheet, rim, colour, EDGE))
                sheet.add(deep - 20, partial(self.flat, sheet, outline, PAPER, EDGE))
                continue
            sheet.add(deep, partial(self.flat, sheet, outline - 2.0 * (face - centre), _shade(colour, -0.3), None))
            sheet.add(deep, partial(self.flat, sheet, outline, colour, EDGE))
            self.spokes(sheet, centre, face, axis, first, 0.8 * wheel["radius"], 1 if wheel["teeth"] else 5, back)
        for line in scene["lines"]:
            points = pose.placed(frame, line["body"], np.array(line["points"]))
            deep = self.depth(points) + 2 * back / self.radius
            colour = SPRING if line["look"] == "belt" else _shade(self.colour(line["body"]), -0.3)

            def draw(points: Any = points, line: Any = line, colour: Any = colour) -> None:
                pixels = [*self.at(points)] + ([self.at(points[0])] if line["closed"] else [])
                if line["look"] == "cam" and line["closed"]:
                    sheet.polygon(pixels, self.colour(line["body"]), EDGE, 1.2 * FINER)
                else:
                    sheet.line(pixels, colour, (3.0 if line["look"] == "belt" else 2.0) * FINER)

            sheet.add(deep, draw)
        for rod in scene["rods"]:
            ends = [pose.placed(frame, rod[f"body{i}"], np.array(rod[f"point{i}"])) for i in (1, 2)]
            self.rod(sheet, ends[0], ends[1], 0.55 * self.radius, SPRING)
        for a, b in scene["links"]:
            p, q = (self.at(pose.seat(frame, j)) for j in (a, b))
            for s in np.arange(0.0, 1.0, 0.04):
                sheet.line([p + s * (q - p), p + (s + 0.012) * (q - p)], QUIET, 1.3 * FINER)

    def flat(self, sheet: _Sheet, points: FloatArray, fill: Colour, edge: Colour | None) -> None:
        sheet.polygon(self.at(points), fill, edge, FINER)

    def springs(self, sheet: _Sheet, frame: int) -> None:
        for spring in self.scene["springs"]:
            ends = [self.pose.placed(frame, spring[f"body{i}"], np.array(spring[f"point{i}"])) for i in (1, 2)]
            for i in (1, 2):
                if spring[f"body{i}"] < 0:
                    self.support(sheet, ends[i - 1], 2.6 * self.radius)

            def draw(ends: Any = ends) -> None:
                p, q = self.at(ends)
                way = q - p
                across = (
                    np.array([-way[1], way[0]])
                    / (np.hypot(*way) or 1.0)
                    * max(2.5 * FINER, 1.5 * self.radius * self.scale)
                )
                steps = [p, p + 0.12 * way]
                steps += [p + (0.12 + 0.76 * (i + 0.5) / 16) * way + (1 - 2 * (i % 2)) * -across for i in range(16)]
                sheet.line([*steps, p + 0.88 * way, q], SPRING, 1.7 * FINER)

            sheet.add(self.depth(ends), draw)

    def support(self, sheet: _Sheet, point: FloatArray, size: float) -> None:
        r = size * self.scale

        def draw() -> None:
            x, y = self.at(point)
            sheet.polygon([(x, y), (x - 0.62 * r, y + r), (x + 0.62 * r, y + r)], FOOT, GROUND, 1.3 * FINER)
            self.hatch(sheet, np.array((x - r, y + r)), np.array((x + r, y + r)), r)

        if r > 4 * FINER:
            sheet.add(self.depth([point]) - 2 * size / self.radius, draw)

    def hatch(self, sheet: _Sheet, p: FloatArray, q: FloatArray, r: float) -> None:
        sheet.line([p, q], GROUND, 1.5 * FINER)
        way = q - p
        whole = float(np.hypot(*way))
        if whole < FINER:
            return
        along = way / whole
        side = 1.0 if along[0] >= 0 else -1.0
        count = max(2, min(60, round(whole / (0.4 * r))))
        turn = np.array([-side * (along[0] + along[1]), side * (along[0] - along[1])]) * 0.38 * r
        for i in range(count):
            at = p + way * (i + 0.8) / count
            sheet.line([at, at + turn], GROUND, 1.0 * FINER)

    def joints(self, sheet: _Sheet, frame: int) -> None:
        pose, r = self.pose, self.radius
        for j, joint in enumerate(self.scene["joints"]):
            point = pose.seat(frame, j)
            if not np.isfinite(point).all() or joint["kind"] == "free":
                continue
            grounded = joint["parent"] < 0 or joint["child"] < 0
            axis = None if joint["axis"] is None else pose.turned(frame, joint["parent"], np.array(joint["axis"]))
            if joint["rail"]:
                ends = pose.placed(frame, joint["parent"], np.array(joint["rail"]))

                def rail(ends: Any = ends, grounded: bool = grounded) -> None:
                    p, q = self.at(ends)
                    sheet.line([p, q], GROUND, max(1.5 * FINER, 0.5 * r * self.scale))
                    if grounded:
                        way = (q - p) / (np.hypot(*(q - p)) or 1.0)
                        low = np.array([-way[1], way[0]]) * (1.0 if way[0] >= 0 else -1.0) * 1.6 * r * self.scale
                        self.hatch(sheet, p + low, q + low, 3.4 * r * self.scale)

                sheet.add(self.depth(ends) - 2, rail)
            elif grounded and joint["atParent"]:
                self.support(sheet, point, 3.4 * r)
            self.glyph(sheet, joint, point, axis)

    def glyph(self, sheet: _Sheet, joint: Mapping[str, Any], point: FloatArray, axis: FloatArray | None) -> None:
        r, kind, lift = self.radius, joint["kind"], 2.5 * self.radius
        if kind in ("prismatic", "planar") and axis is not None:
            back = np.array(self.scene["view"]["back"])
            wanted = back if abs(back @ axis) < 0.9 else np.array(self.scene["view"]["up"])
            across = wanted - (wanted @ axis) * axis
            across /= np.linalg.norm(across)
            half = (3.0 * r, 1.8 * r, 1.8 * r) if kind == "prismatic" else (0.4 * r, 2.6 * r, 2.6 * r)
            colour = self.colour(joint["child"]) if kind == "prismatic" else JOINT
            self.box(sheet, point, np.array([axis, across, np.cross(axis, across)]), half, colour, lift)
        elif kind == "fixed":
            self.box(sheet, point, np.eye(3), (r, r, r), GROUND, lift)
        elif kind in ("revolute", "cylindrical", "screw") and axis is not None and r * self.scale > 2.5 * FINER:
            wide, long = (1.35, 1.5) if kind == "revolute" else (1.8, 3.4)
            face = self.drum(sheet, point, axis, wide * r, long * r, JOINT, lift)
            if kind == "revolute" and abs(axis @ self.back) > 0.4:
                eye = max(FINER, 0.4 * r * self.scale)
                sheet.add(self.depth([point]) + 2 * lift / r, lambda: sheet.circle(self.at(face), eye, EDGE))
        else:
            self.ball(sheet, point, (1.2 if kind == "revolute" else 1.7) * r, JOINT, lift)

    def arrows(self, sheet: _Sheet, frame: int) -> None:
        if not self.unit > 0:
            return
        for start, force, colour in self.pose.pushes(frame, FORCE, LOAD):
            size = float(np.linalg.norm(force))
            if not np.isfinite(start).all() or not size > 0:
                continue
            p, q = self.at([start, start + force / size * min(1.5, size / self.unit) * self.arrow])
            long = float(np.hypot(*(q - p)))
            if long < 3 * FINER:
                continue
            u, h = (q - p) / long, min(11.0 * FINER, 0.5 * long)
            side = np.array([-u[1], u[0]])
            sheet.line([p, q - 0.8 * h * u], PAPER, 4.5 * FINER)
            sheet.line([p, q - 0.8 * h * u], colour, 2.2 * FINER)
            sheet.polygon([q, q - h * u + 0.38 * h * side, q - h * u - 0.38 * h * side], colour)

    def words(self, sheet: _Sheet, frame: int) -> None:
        """Title, time and how fast it runs above; a length and a force below."""
        margin = 14 * FINER
        sheet.draw.text((margin, 10 * FINER), self.fitted(sheet, self.scene["title"], 0.6), fill=INK, font=self.font)
        pace = "" if abs(self.factor - 1.0) < 1e-9 else f"   {self.factor:.2g}×"
        text = f"t = {self.pose.t[frame]:.{self.digits()}f} s{pace}"
        width = sheet.draw.textlength(text, font=self.font)
        sheet.draw.text((self.width - margin - width, 10 * FINER), text, fill=INK, font=self.font)
        rows = [(1.0 / self.scale, INK, "m")]
        if self.forces and self.unit > 0:
            rows.append((self.unit / (self.arrow * self.scale), FORCE, "N"))
        y = self.height - 16 * FINER
        for per_pixel, colour, unit in rows:
            most = 110 * FINER * per_pixel
            power = 10.0 ** np.floor(np.log10(most))
            value = next(power * k for k in (5.0, 2.0, 1.0) if power * k <= most)
            length = value / per_pixel
            right = self.width - margin
            sheet.line([(right - length, y), (right, y)], colour, 2 * FINER)
            said = f"{value:g} {unit}"
            ends = sheet.draw.textbbox((0, 0), said, font=self.font)
            at = (right - length - ends[2] - 8 * FINER, y - (ends[1] + ends[3]) / 2)
            sheet.draw.text(at, said, fill=colour, font=self.font)
            y -= 20 * FINER

    def fitted(self, sheet: _Sheet, text: str, part: float) -> str:
        while len(text) > 4 and sheet.draw.textlength(text, font=self.font) > part * self.width:
            text = text[:-2].rstrip("…") + "…"
        return text

    def digits(self) -> int:
        duration = float(self.pose.t[-1] - self.pose.t[0])
        return 2 if duration <= 0 else int(np.clip(np.ceil(-np.log10(duration)) + 3, 0, 9))
