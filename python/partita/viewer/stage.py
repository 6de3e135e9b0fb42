"""The mechanism in a film, drawn with Pillow; the camera is fixed or follows."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..tolerance import EQUAL, HALFWAY_ALONG, LEAST_DIVISOR, NEARLY_ALONG, VISIBLE
from .geometry import hull
from .pose import Pose
from .scenery import scenery
from .sheet import (
    BODIES,
    EDGE,
    FOOT,
    FORCE,
    GROUND,
    INK,
    JOINT,
    LOAD,
    PAPER,
    QUIET,
    SPRING,
    TRACE,
    Colour,
    Sheet,
    shade,
)  # fmt: skip

FloatArray = NDArray[np.float64]

FINER = 2
"""Pictures are drawn larger by this factor and reduced: edges become smooth."""
MOST_ARROW = 1.5
"""A longer arrow is cut, and marked. Scale: multiples of a large one. Reason: it would leave the picture."""

FACELESS = 0.05
"""Spokes of a face that is seen at less are not drawn. Scale: cosine between its normal and the line of sight.
Reason: they would cover each other."""
EYE = 0.4
"""A hinge whose axis is nearer to the line of sight has an eye on its face. Scale: cosine of the angle. Reason: there
the face is seen."""
DOT = 2.5
"""Hinges of a smaller radius are dots. Scale: pixels. Reason: fewer show no face."""
MICROMETRES = 1e-3
"""Shorter lengths are written in micrometres. Scale: m. Reason: whole numbers up to a millimetre."""
HOLLOW, LONGER = "hollow: not unique, shared by least squares", "double stroke: arrow longer than drawn"


def hanging(a: FloatArray, b: FloatArray, length: float, down: FloatArray) -> FloatArray:
    """A rope of this length between two points (n, 3): straight where taut, else hanging by what it has to spare."""
    distance = float(np.linalg.norm(b - a))
    spare = max(0.0, length - distance)
    sag = min(0.5 * length, np.sqrt(0.375 * max(distance, 0.25 * length) * spare))
    s = np.linspace(0.0, 1.0, 17 if spare else 2)[:, None]
    return np.asarray(a + s * (b - a) + 4.0 * sag * s * (1.0 - s) * down)


def font_of(size: int) -> Any:
    """Matplotlib's font, which has signs and letters of many alphabets; that of Pillow prints boxes for most."""
    from PIL import ImageFont

    with suppress(ImportError, OSError):
        import matplotlib

        return ImageFont.truetype(str(Path(matplotlib.get_data_path(), "fonts", "ttf", "DejaVuSans.ttf")), size)
    return ImageFont.load_default(size=size)


class Stage:
    """The mechanism in front of a fixed camera."""

    def __init__(self, pose: Pose, size: tuple[int, int], forces: bool, factor: float) -> None:
        self.pose, self.scene, self.forces = pose, pose.scene, forces
        self.width, self.height = size[0] * FINER, size[1] * FINER
        self.size = size
        self.factor = factor
        self.font = font_of(max(11, min(18, size[1] // 36)) * FINER)
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
        """Depth towards the viewer, in steps; objects at the same depth keep the order in which they were drawn."""
        z = float(np.mean(np.asarray(points, dtype=float) @ self.back))
        return float(np.round(z / (0.5 * self.radius)))

    def colour(self, body: int) -> Colour:
        return GROUND if body < 0 else BODIES[body % len(BODIES)]

    def picture(self, frame: int) -> Any:
        from PIL import Image, ImageDraw

        if self.follows is not None:
            self.origin = self.follows[frame]
        image = Image.new("RGB", (self.width, self.height), PAPER)
        sheet = Sheet(ImageDraw.Draw(image))
        for stroke in self.strokes:
            if len(stroke) > 1:
                sheet.line(self.at(stroke), TRACE, 1.2 * FINER)
            else:
                sheet.circle(self.at(stroke[0]), 1.2 * FINER, TRACE)
        scenery(self, sheet, frame, FINER)
        self.couplings(sheet, frame)
        self.bodies(sheet, frame)
        self.springs(sheet, frame)
        self.joints(sheet, frame)
        sheet.paint()
        reported = self.arrows(sheet, frame) if self.forces else set()
        for point in self.scene["points"]:
            x, y = self.at(self.pose.placed(frame, point["body"], point["at"]))
            d = 4.0 * FINER
            sheet.polygon([(x - d, y), (x, y - d), (x + d, y), (x, y + d)], INK, PAPER, FINER)
        self.words(sheet, frame, reported)
        return image.resize(self.size, Image.Resampling.LANCZOS)

    # ---- parts

    def rod(self, sheet: Sheet, a: FloatArray, b: FloatArray, radius: float, colour: Colour) -> None:
        pieces = 1 if self.scene["flat"] else max(1, min(10, int(np.ceil(np.linalg.norm(b - a) / (5 * radius)))))
        width = max(1.6 * FINER, 2.0 * radius * self.scale)
        for i in range(pieces):
            ends = [a + (b - a) * i / pieces, a + (b - a) * (i + 1) / pieces]

            def draw(ends: Any = ends, i: int = i) -> None:
                pixels = self.at(ends)
                offset = pixels[1] - pixels[0]
                unit = offset / (np.hypot(*offset) or 1.0)
                normal = np.array([-unit[1], unit[0]])
                normal = -normal if normal.sum() > 0 else normal
                outer = [end for end, last in ((pixels[0], i == 0), (pixels[1], i == pieces - 1)) if last]
                for wide, colour_, over in ((width + 2 * FINER, shade(colour, -0.45), 0.0), (width, colour, FINER)):
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
                        [strip[0] + half, strip[1] + half, strip[1] - half, strip[0] - half], shade(colour, 0.4)
                    )

            sheet.add(self.depth(ends), draw)

    def ball(self, sheet: Sheet, centre: FloatArray, radius: float, colour: Colour, lift: float = 0.0) -> None:
        r = max(1.6 * FINER, radius * self.scale)

        def draw() -> None:
            x, y = self.at(centre)
            sheet.circle((x, y), r, shade(colour, -0.08), EDGE, 1.2 * FINER)
            sheet.circle((x - 0.28 * r, y - 0.28 * r), 0.45 * r, shade(colour, 0.35))

        sheet.add(self.depth([centre]) + 2 * lift / self.radius, draw)

    def faces(self, sheet: Sheet, rings: list[FloatArray], colour: Colour, lift: float = 0.0) -> None:
        """Flat faces of a convex solid, corners around an outward normal or its opposite."""
        middle = np.mean(np.concatenate(rings), axis=0)
        for ring in rings:
            normal = np.cross(ring[1] - ring[0], ring[2] - ring[0])
            normal = normal / (np.linalg.norm(normal) or 1.0)
            if normal @ (ring.mean(axis=0) - middle) < 0:
                normal = -normal
            light = float(normal @ self.back)
            if light > VISIBLE:
                sheet.add(
                    self.depth([middle]) + 2 * lift / self.radius,
                    partial(self.disc, sheet, ring, shade(colour, -0.25 + 0.45 * light), EDGE),
                )

    def box(self, sheet: Sheet, centre: FloatArray, axes: Any, half: Any, colour: Colour, lift: float = 0.0) -> None:
        rings = []
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            for side in (-1, 1):
                middle = centre + side * half[k] * axes[k]
                rings.append(np.array([middle + a * half[i] * axes[i] + b * half[j] * axes[j]
                                       for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))]))  # fmt: skip
        self.faces(sheet, rings, colour, lift)

    def drum(
        self, sheet: Sheet, centre: FloatArray, axis: FloatArray, radius: float, half: float, colour: Colour,
        lift: float = 0.0,
    ) -> FloatArray:  # fmt: skip
        """A cylinder; returns the centre of the visible face."""
        facing = axis if axis @ self.back >= 0 else -axis
        u = np.cross(facing, [1.0, 0, 0] if abs(facing[0]) < HALFWAY_ALONG else [0, 1.0, 0])
        u /= np.linalg.norm(u)
        v = np.cross(facing, u)
        angle = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
        rim = radius * (np.outer(np.cos(angle), u) + np.outer(np.sin(angle), v))
        near, far = centre + half * facing + rim, centre - half * facing + rim

        def draw() -> None:
            a, b = self.at(near), self.at(far)
            both = np.concatenate([a, b])
            sheet.polygon(both[hull(both)], None, EDGE, 2.2 * FINER)
            for k in range(len(angle)):  # the side, quad by quad, then the face over it
                m = (k + 1) % len(angle)
                sheet.polygon([a[k], a[m], b[m], b[k]], shade(colour, -0.2))
            sheet.polygon(b, shade(colour, -0.2))
            sheet.polygon(a, colour, EDGE, 1.1 * FINER)

        sheet.add(self.depth([centre]) + 2 * lift / self.radius, draw)
        return centre + half * facing

    def bodies(self, sheet: Sheet, frame: int) -> None:
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

    def plate(self, sheet: Sheet, points: FloatArray, colour: Colour) -> None:
        pixels = self.at(points)
        width = max(1.0, 2.0 * self.radius * self.scale)
        sheet.line([*pixels, pixels[0]], shade(colour, -0.45), width + 2 * FINER)
        sheet.line([*pixels, pixels[0]], shade(colour, 0.25), width)
        sheet.polygon(pixels, shade(colour, 0.25))

    def solid(self, sheet: Sheet, frame: int, body: int, part: Mapping[str, Any]) -> None:
        pose, colour, kind = self.pose, self.colour(body), part["kind"]
        if kind == "mesh":
            points = pose.placed(frame, body, np.reshape(part["points"], (-1, 3)))
            pixels, corners = self.at(points), points[np.reshape(part["faces"], (-1, 3))]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            light = (normals @ self.back) / np.maximum(np.linalg.norm(normals, axis=1), LEAST_DIVISOR)
            light = np.maximum(light, 0.0) if part.get("closed") else np.abs(light)
            far = corners.mean(axis=1) @ self.back / (0.5 * self.radius)
            for face, z, lit in zip(np.reshape(part["faces"], (-1, 3)), far, light, strict=True):
                if part.get("closed") and lit <= 0.0:
                    continue  # the far side
                lit_colour = shade(colour, -0.35 + 0.66 * float(lit))
                sheet.add(float(z), partial(sheet.polygon, pixels[face], lit_colour, lit_colour))
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
                first = np.cross(own, [1.0, 0, 0] if abs(own[0]) < HALFWAY_ALONG else [0, 1.0, 0])
                self.spokes(sheet, centre, face, axis, pose.turned(frame, body, first / np.linalg.norm(first)),
                            part["radius"], 5 if kind == "wheel" else 1)  # fmt: skip

    def spokes(
        self, sheet: Sheet, centre: FloatArray, face: FloatArray, axis: FloatArray, first: FloatArray, radius: float,
        count: int, lift: float = 0.0,
    ) -> None:  # fmt: skip
        if abs(axis @ self.back) < FACELESS:
            return
        second, angles = np.cross(axis, first), 2.0 * np.pi * np.arange(count) / count
        ends = [face + 0.86 * radius * (np.cos(a) * first + np.sin(a) * second) for a in angles]
        width = max(1.2 * FINER, 0.05 * radius * self.scale)

        def draw() -> None:
            for end in ends:
                sheet.line(self.at([face, end]), EDGE, width)

        sheet.add(self.depth([centre]) + 2 * lift / self.radius, draw)

    def couplings(self, sheet: Sheet, frame: int) -> None:
        pose, scene, back = self.pose, self.scene, -6.0 * self.radius
        for wheel in scene["wheels"]:
            body = wheel["body"]
            centre = pose.placed(frame, body, np.array(wheel["center"]))
            axis, first = (pose.turned(frame, body, np.array(wheel[word])) for word in ("axis", "first"))
            colour = shade(GROUND, 0.3) if wheel["ring"] else self.colour(body)
            outline, face = pose.teeth(wheel, centre, axis, first, self.back)
            deep = self.depth([centre]) + 2 * back / self.radius
            if wheel["ring"]:
                rim = pose.rim(wheel, centre, axis, first)
                sheet.add(deep - 20, partial(self.disc, sheet, rim, colour, EDGE))
                sheet.add(deep - 20, partial(self.disc, sheet, outline, PAPER, EDGE))
                continue
            sheet.add(deep, partial(self.disc, sheet, outline - 2.0 * (face - centre), shade(colour, -0.3), None))
            sheet.add(deep, partial(self.disc, sheet, outline, colour, EDGE))
            self.spokes(sheet, centre, face, axis, first, 0.8 * wheel["radius"], 1 if wheel["teeth"] else 5, back)
        for line in scene["lines"]:
            points = pose.placed(frame, line["body"], np.array(line["points"]))
            deep = self.depth(points) + 2 * back / self.radius
            colour = SPRING if line["look"] == "belt" else shade(self.colour(line["body"]), -0.3)

            def draw(points: Any = points, line: Any = line, colour: Any = colour) -> None:
                pixels = [*self.at(points)] + ([self.at(points[0])] if line["closed"] else [])
                if line["look"] == "cam" and line["closed"]:
                    sheet.polygon(pixels, self.colour(line["body"]), EDGE, 1.2 * FINER)
                else:
                    sheet.line(pixels, colour, (3.0 if line["look"] == "belt" else 2.0) * FINER)

            sheet.add(deep, draw)
        for rod in scene["rods"]:
            ends = [pose.placed(frame, rod[f"body{i}"], np.array(rod[f"point{i}"])) for i in (1, 2)]
            self.rods(sheet, ends[0], ends[1], rod["rods"])
        for a, b in scene["links"]:
            p, q = (self.at(pose.seat(frame, j)) for j in (a, b))
            for s in np.arange(0.0, 1.0, 0.04):
                sheet.line([p + s * (q - p), p + (s + 0.012) * (q - p)], QUIET, 1.3 * FINER)

    def disc(self, sheet: Sheet, points: FloatArray, fill: Colour, edge: Colour | None) -> None:
        sheet.polygon(self.at(points), fill, edge, FINER)

    def springs(self, sheet: Sheet, frame: int) -> None:
        for spring in self.scene["springs"]:
            ends = [self.pose.placed(frame, spring[f"body{i}"], np.array(spring[f"point{i}"])) for i in (1, 2)]
            for i in (1, 2):
                if spring[f"body{i}"] < 0:
                    self.support(sheet, ends[i - 1], 2.6 * self.radius)

            if "rods" in spring:
                self.rods(sheet, ends[0], ends[1], spring["rods"])
                continue
            if "rope" in spring:
                line = self.at(hanging(ends[0], ends[1], spring["rope"], -np.array(self.scene["view"]["up"])))
                sheet.add(self.depth(ends), partial(sheet.line, list(line), SPRING, 1.7 * FINER))
                continue

            def draw(ends: Any = ends) -> None:
                p, q = self.at(ends)
                offset = q - p
                across = (
                    np.array([-offset[1], offset[0]])
                    / (np.hypot(*offset) or 1.0)
                    * max(2.5 * FINER, 1.5 * self.radius * self.scale)
                )
                steps = [p, p + 0.12 * offset]
                steps += [p + (0.12 + 0.76 * (i + 0.5) / 16) * offset + (1 - 2 * (i % 2)) * -across for i in range(16)]
                sheet.line([*steps, p + 0.88 * offset, q], SPRING, 1.7 * FINER)

            sheet.add(self.depth(ends), draw)

    def rods(self, sheet: Sheet, a: FloatArray, b: FloatArray, pieces: Any) -> None:
        """Rods along the line from a to b: where each begins and ends from a, None at b, and its radius."""
        along = (b - a) / (np.linalg.norm(b - a) or 1.0)
        for start, end, radius in pieces:
            first, last = (b if x is None else a + x * along for x in (start, end))
            self.rod(sheet, first, last, radius * self.radius, SPRING)

    def support(self, sheet: Sheet, point: FloatArray, size: float) -> None:
        r = size * self.scale

        def draw() -> None:
            x, y = self.at(point)
            sheet.polygon([(x, y), (x - 0.62 * r, y + r), (x + 0.62 * r, y + r)], FOOT, GROUND, 1.3 * FINER)
            self.hatch(sheet, np.array((x - r, y + r)), np.array((x + r, y + r)), r)

        if r > 4 * FINER:
            sheet.add(self.depth([point]) - 2 * size / self.radius, draw)

    def hatch(self, sheet: Sheet, p: FloatArray, q: FloatArray, r: float) -> None:
        sheet.ground(*((p, q) if q[0] >= p[0] else (q, p)), r, FINER)

    def joints(self, sheet: Sheet, frame: int) -> None:
        pose, r = self.pose, self.radius
        for j, joint in enumerate(self.scene["joints"]):
            point = pose.seat(frame, j)
            if not np.isfinite(point).all() or joint["kind"] == "free":
                continue
            axis = None if joint["axis"] is None else pose.turned(frame, joint["parent"], np.array(joint["axis"]))
            if joint["rail"]:
                ends = pose.placed(frame, joint["parent"], np.array(joint["rail"]))

                def rail(ends: Any = ends, grounded: bool = joint["parent"] < 0) -> None:
                    p, q = self.at(ends)
                    sheet.line([p, q], GROUND, max(1.5 * FINER, 0.5 * r * self.scale))
                    if grounded:
                        offset = (q - p) / (np.hypot(*(q - p)) or 1.0)
                        low = (
                            np.array([-offset[1], offset[0]]) * (1.0 if offset[0] >= 0 else -1.0) * 1.6 * r * self.scale
                        )
                        self.hatch(sheet, p + low, q + low, 3.4 * r * self.scale)

                sheet.add(self.depth(ends) - 2, rail)
            held = joint["parent"] < 0 and joint["atParent"] is not None and not joint["rail"]
            if joint["child"] < 0 or held:  # the ground holds the point
                self.support(sheet, point, 3.4 * r)
            self.glyph(sheet, joint, point, axis)

    def glyph(self, sheet: Sheet, joint: Mapping[str, Any], point: FloatArray, axis: FloatArray | None) -> None:
        r, kind, lift = self.radius, joint["kind"], 2.5 * self.radius
        if kind in ("prismatic", "planar") and axis is not None:
            back = np.array(self.scene["view"]["back"])
            wanted = back if abs(back @ axis) < NEARLY_ALONG else np.array(self.scene["view"]["up"])
            across = wanted - (wanted @ axis) * axis
            across /= np.linalg.norm(across)
            half = (3.0 * r, 1.8 * r, 1.8 * r) if kind == "prismatic" else (0.4 * r, 2.6 * r, 2.6 * r)
            colour, lift = (self.colour(joint["child"]), lift) if kind == "prismatic" else (JOINT, -lift)
            self.box(sheet, point, np.array([axis, across, np.cross(axis, across)]), half, colour, lift)
        elif kind == "fixed":
            self.box(sheet, point, np.eye(3), (r, r, r), GROUND, lift)
        elif kind in ("revolute", "cylindrical", "screw") and axis is not None and r * self.scale > DOT * FINER:
            wide, long = (1.35, 1.5) if kind == "revolute" else (1.8, 3.4)
            face = self.drum(sheet, point, axis, wide * r, long * r, JOINT, lift)
            if kind == "revolute" and abs(axis @ self.back) > EYE:
                eye = max(FINER, 0.4 * r * self.scale)
                sheet.add(self.depth([point]) + 2 * lift / r, lambda: sheet.circle(self.at(face), eye, EDGE))
        else:
            self.ball(sheet, point, (1.2 if kind == "revolute" else 1.7) * r, JOINT, lift)

    def arrows(self, sheet: Sheet, frame: int) -> set[str]:
        """Forces and loads, with notes on hollow arrows and arrows longer than drawn."""
        reported: set[str] = set()
        if not self.unit > 0:
            return reported
        for start, force, colour, is_open in self.pose.pushes(frame, FORCE, LOAD):
            size = float(np.linalg.norm(force))
            if not np.isfinite(start).all() or not size > 0:
                continue
            p, q = self.at([start, start + force / size * min(MOST_ARROW, size / self.unit) * self.arrow])
            long = float(np.hypot(*(q - p)))
            if long < 3 * FINER:
                continue
            u, h = (q - p) / long, min(11.0 * FINER, 0.5 * long)
            side, end = np.array([-u[1], u[0]]), q - 0.8 * h * u
            sheet.line([p, end], PAPER, 4.5 * FINER)
            dashes = max(1, round((long - h) / (9.0 * FINER))) if is_open else 1
            for k in range(dashes):
                first, last = (p + (end - p) * (k + x) / dashes for x in (0.0, 0.55 if is_open else 1.0))
                sheet.line([first, last], colour, 2.2 * FINER)
            head = [q, q - h * u + 0.38 * h * side, q - h * u - 0.38 * h * side]
            sheet.polygon(head, PAPER if is_open else colour, colour, 1.6 * FINER)
            if is_open:
                reported.add(HOLLOW)
            if size > MOST_ARROW * self.unit * (1.0 + EQUAL):
                reported.add(LONGER)
                for shift in (-2.5, 2.5):
                    at = p + 0.55 * (end - p) + shift * FINER * u
                    stroke = [at - 6 * FINER * side, at + 6 * FINER * side]
                    sheet.line(stroke, PAPER, 4.0 * FINER)
                    sheet.line(stroke, colour, 1.6 * FINER)
        return reported

    def words(self, sheet: Sheet, frame: int, reported: set[str]) -> None:
        """Title, time and how fast it runs above; a length, a force and what is `reported` of arrows below."""
        margin = 14 * FINER
        sheet.draw.text((margin, 10 * FINER), self.fitted(sheet, self.scene["title"], 0.6), fill=INK, font=self.font)
        pace = "" if abs(self.factor - 1.0) < EQUAL else f"   {self.factor:.2g}×"
        verdict = self.scene["verdict"]
        text = f"t = {self.pose.t[frame]:.{self.digits()}f} s{pace}"
        width = sheet.draw.textlength(text, font=self.font)
        sheet.draw.text((self.width - margin - width, 10 * FINER), text, fill=INK, font=self.font)
        if verdict is not None:  # the seal, under the time
            word, colour = f"run: {verdict}", LOAD if verdict == "valid" else FORCE
            place = (self.width - margin - sheet.draw.textlength(word, font=self.font), 30 * FINER)
            sheet.draw.text(place, word, fill=colour, font=self.font)
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
            label = f"{1e6 * value:g} µm" if unit == "m" and value < MICROMETRES else f"{value:g} {unit}"
            ends = sheet.draw.textbbox((0, 0), label, font=self.font)
            at = (right - length - ends[2] - 8 * FINER, y - (ends[1] + ends[3]) / 2)
            sheet.draw.text(at, label, fill=colour, font=self.font)
            y -= 20 * FINER
        for text in sorted(reported):
            label = self.fitted(sheet, text, 0.9)
            right = self.width - margin - sheet.draw.textlength(label, font=self.font)
            ends = sheet.draw.textbbox((0, 0), label, font=self.font)
            sheet.draw.text((right, y - (ends[1] + ends[3]) / 2), label, fill=FORCE, font=self.font)
            y -= 20 * FINER

    def fitted(self, sheet: Sheet, text: str, part: float) -> str:
        while len(text) > 4 and sheet.draw.textlength(text, font=self.font) > part * self.width:
            text = text[:-2].rstrip("…") + "…"
        return text

    def digits(self) -> int:
        duration = float(self.pose.t[-1] - self.pose.t[0])
        return 2 if duration <= 0 else int(np.clip(np.ceil(-np.log10(duration)) + 3, 0, 9))
