"""A mechanism in a browser while it moves, drawn by viser: bodies are frames, and only frames are sent again."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from io import StringIO
from time import monotonic
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..extras import extra
from ..numeric import shown
from ..result_view import ResultView
from ..tolerance import LONG_ROUNDING
from .hints import solids
from .scene import describe

FloatArray = NDArray[np.float64]

RATE = 60.0
"""Pictures in a second of the wall clock; steps between two of them are not sent."""
SLENDER = 0.012
"""Radius of a rod over the size of the mechanism."""
HUES = ((47, 127, 184), (210, 105, 30), (61, 154, 80), (181, 72, 126), (138, 111, 201), (165, 138, 31))
PIN, HELD, PALE = (240, 240, 240), (60, 60, 60), (150, 150, 150)
AWAY = 1.5
"""Distance of the eye from the middle of the mechanism, over its size."""


class Poses(NamedTuple):
    """Poses of all bodies at an instant."""

    t: float
    position: FloatArray  # (nb, 3)
    rotation: FloatArray  # (nb, 3, 3)


class LiveView:
    """A page that follows a stepper, made by `Stepper.show`. In a notebook it shows itself; elsewhere open its `url`.

    It is served by this process as long as the process lives or until `close`; `with sim.show() as view:` closes it.
    """

    def __init__(self, at: ResultView, now: Callable[[], Poses], shapes: Any, host: str, port: int) -> None:
        viser = extra("viser", "live", "a live view")
        _checked(host, port)
        bodies = list(at.names.bodies)
        drawn = describe(at, None, solids(shapes, bodies))
        self._now, self._lock = now, threading.Lock()
        self._wanted, self._busy, self._closed = False, False, False
        self._last, self._sent = -np.inf, 0
        with redirect_stdout(StringIO()):  # viser prints its start and stop messages in a frame
            self._server = viser.ViserServer(host=host, port=int(port), label=drawn["title"], verbose=False)
        self._host = host
        self._scene = _Drawing(self._server, drawn, _middle(at))
        self._send()

    @property
    def url(self) -> str:
        """Address of the page; the port is the next free one from the requested one on."""
        host = "localhost" if self._host in ("127.0.0.1", "0.0.0.0", "::") else self._host
        return f"http://{host}:{self._server.get_port()}"

    @property
    def time(self) -> float:
        """Time of the displayed state [s]."""
        return self._scene.time

    @property
    def poses(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        """The displayed state: of each body its position [m] and its attitude, a quaternion, scalar first."""
        return self._scene.poses()

    @property
    def sent(self) -> int:
        """Number of frames sent."""
        return self._sent

    def update(self) -> None:
        """Show the current state of the stepper. `step` and `reset` do this themselves, up to 60 times per second."""
        if not self._closed:
            self._send()

    def close(self) -> None:
        """Close the page; the stepper continues."""
        with self._lock:
            if not self._closed:
                self._closed = True
                with redirect_stdout(StringIO()):
                    self._server.stop()

    def moved(self) -> None:
        """The stepper has advanced: show it now, or as soon as the next frame is due."""
        with self._lock:
            if self._closed or self._busy:
                self._wanted = True
                return
            left = self._last + 1.0 / RATE - monotonic()
            if left > 0.0:
                # The previous frame is too recent: the last step of a burst is shown when the next frame is due.
                self._busy, self._wanted = True, False
                later = threading.Timer(left, self._due)
                later.daemon = True
                later.start()
                return
        self._send()

    def _due(self) -> None:
        with self._lock:
            self._busy = False
        self.update()

    def _send(self) -> None:
        poses = self._now()
        with self._lock:
            if self._closed:
                return
            self._last, self._sent = monotonic(), self._sent + 1
            self._scene.put(poses)

    def __enter__(self) -> LiveView:
        return self

    def __exit__(self, *ended: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        """The page in a frame."""
        return (
            f'<iframe src="{self.url}" style="width:100%;height:480px;border:1px solid #8888" '
            f'title="live view"></iframe><p><a href="{self.url}" target="_blank">{self.url}</a></p>'
        )

    def __repr__(self) -> str:
        where = "closed" if self._closed else self.url
        return f"<live view at {where}, t = {self.time:g} s>"


class _Drawing:
    """The objects in the scene of the server, and their motion."""

    def __init__(self, server: Any, drawn: Mapping[str, Any], middle: FloatArray) -> None:
        self._server, self._scene = server, server.scene
        self._size = float(drawn["size"])
        self._thick = SLENDER * self._size
        self.time = 0.0
        self._names = [str(body["name"]) for body in drawn["bodies"]]
        self._frames = [
            self._scene.add_frame(f"/bodies/{number} {_plain(name)}", show_axes=False)
            for number, name in enumerate(self._names)
        ]
        solid = {each["body"]: each["parts"] for each in drawn["solids"]}
        for number, body in enumerate(drawn["bodies"]):
            if number not in solid:
                self._body(number, body)
        for number, parts in solid.items():
            for i, part in enumerate(parts):
                self._solid(f"{self._room(number)}/solid {i}", part, HUES[number % len(HUES)] if number >= 0 else PALE)
        for joint in drawn["joints"]:
            self._joint(joint)
        self._springs = [(spring, self._spring(i, spring)) for i, spring in enumerate(drawn["springs"])]
        self._clock = server.gui.add_text("t [s]", initial_value="0", disabled=True)
        self._look(drawn["view"], middle)

    def put(self, poses: Poses) -> None:
        """Move all objects; unchanged ones are not sent."""
        self.time = poses.t
        turns = _quaternions(poses.rotation)
        with self._server.atomic():
            for frame, position, turn in zip(self._frames, poses.position, turns, strict=True):
                frame.position, frame.wxyz = position, turn
            for spring, line in self._springs:
                line.points = np.array([[_end(spring, end, poses) for end in (1, 2)]], dtype=np.float32)
            self._clock.value = f"{poses.t:.3f}"

    def poses(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        return {
            name: (np.array(frame.position, dtype=float), np.array(frame.wxyz, dtype=float))
            for name, frame in zip(self._names, self._frames, strict=True)
        }

    def _room(self, body: int) -> str:
        return f"/bodies/{body} {_plain(self._names[body])}" if body >= 0 else "/ground"

    def _body(self, number: int, body: Mapping[str, Any]) -> None:
        room, colour, points = self._room(number), HUES[number % len(HUES)], np.array(body["points"], dtype=float)
        if body["kind"] in ("plate", "frame"):
            if body["kind"] == "plate":
                fan = np.array([(0, i, i + 1) for i in range(1, len(points) - 1)])
                self._scene.add_mesh_simple(f"{room}/plate", points, fan, color=colour, opacity=0.5, side="double")
            for i, point in enumerate(points):
                self._rod(f"{room}/edge {i}", point, points[(i + 1) % len(points)], colour)
        elif len(points) == 1:
            self._ball(f"{room}/ball", points[0], 3.0 * self._thick, colour)
        elif body["kind"] == "rod":
            self._rod(f"{room}/rod", points[0], points[1], colour)
        else:
            for i, point in enumerate(points[1:]):
                self._rod(f"{room}/ray {i}", points[0], point, colour)
            if body["kind"] == "hammer":
                self._ball(f"{room}/head", points[1], 3.0 * self._thick, colour)

    def _joint(self, joint: Mapping[str, Any]) -> None:
        """A pin where the joint is, a ball where it has no axis; those of the ground are dark. Slides have a rail."""
        kind, parent, child = joint["kind"], int(joint["parent"]), int(joint["child"])
        if kind == "free":
            return
        name, colour = _plain(joint["name"]), HELD if parent < 0 or child < 0 else PIN
        if kind == "revolute" and joint["axis"] is not None and joint["atParent"] is not None:
            at, half = np.array(joint["atParent"]), 3.0 * self._thick * np.array(joint["axis"])
            self._rod(f"{self._room(parent)}/{name}", at - half, at + half, colour, 1.7 * self._thick)
        else:
            self._ball(f"{self._room(child)}/{name}", np.array(joint["at"], dtype=float), 1.9 * self._thick, colour)
        if joint["rail"] is not None:
            start, end = np.array(joint["rail"], dtype=float)
            self._rod(f"{self._room(parent)}/rail {name}", start, end, HELD, 0.4 * self._thick)

    def _spring(self, number: int, spring: Mapping[str, Any]) -> Any:
        return self._scene.add_line_segments(
            f"/springs/{number} {_plain(spring['name'])}", np.zeros((1, 2, 3), dtype=np.float32), (200, 60, 60),
            thickness=self._thick,
        )  # fmt: skip

    def _solid(self, name: str, part: Mapping[str, Any], colour: tuple[int, int, int]) -> None:
        if part["kind"] == "rod":
            self._rod(name, np.array(part["start"]), np.array(part["end"]), colour)
        elif part["kind"] == "plate":
            points = np.array(part["points"], dtype=float)
            fan = np.array([(0, i, i + 1) for i in range(1, len(points) - 1)])
            self._scene.add_mesh_simple(name, points, fan, color=colour, side="double")
        elif part["kind"] == "ball":
            self._ball(name, np.array(part["center"]), part["radius"], colour)
        elif part["kind"] == "mesh":
            points, faces = np.reshape(part["points"], (-1, 3)), np.reshape(part["faces"], (-1, 3))
            self._scene.add_mesh_simple(name, points, faces, color=colour, flat_shading=True, side="double")
        elif part["kind"] == "box":
            axes = np.array(part.get("axes") or np.eye(3), dtype=float)
            turn = tuple(_quaternions(axes.T[None])[0])
            size, place = tuple(part["size"]), tuple(part["center"])
            self._scene.add_box(name, color=colour, dimensions=size, position=place, wxyz=turn)
        else:
            half = 0.5 * part["length"] * np.array(part["axis"], dtype=float)
            middle = np.array(part["center"], dtype=float)
            self._rod(name, middle - half, middle + half, colour, part["radius"])

    def _ball(self, name: str, at: FloatArray, radius: float, colour: tuple[int, int, int]) -> None:
        self._scene.add_icosphere(name, radius=radius, color=colour, position=tuple(at))

    def _rod(
        self, name: str, start: FloatArray, end: FloatArray, colour: tuple[int, int, int], radius: float | None = None
    ) -> None:
        along = end - start
        self._scene.add_cylinder(
            name,
            radius=radius or self._thick,
            height=float(np.linalg.norm(along)),
            color=colour,
            radial_segments=16,
            position=tuple(0.5 * (start + end)),
            wxyz=tuple(_from_z(along)),
        )

    def _look(self, view: Mapping[str, Any], middle: FloatArray) -> None:
        """Use the view of the animated page of a run."""
        right, up, back = (np.array(view[key], dtype=float) for key in ("right", "up", "back"))
        azimuth, elevation = float(view["azimuth"]), float(view["elevation"])
        towards = np.cos(elevation) * (np.cos(azimuth) * back + np.sin(azimuth) * right) + np.sin(elevation) * up
        self._scene.set_up_direction(tuple(up))
        camera = self._server.initial_camera
        camera.look_at, camera.up = tuple(middle), tuple(up)
        camera.position = tuple(middle + AWAY * self._size * towards)


def _checked(host: Any, port: Any) -> None:
    """Refuse addresses from which no page can be served: the server would wait without end."""
    if not isinstance(host, str) or not host:
        raise ArgumentError(f'host is {shown(host)}; it must be a name such as "127.0.0.1"', argument="host")
    if isinstance(port, bool) or not isinstance(port, int | np.integer) or not 0 <= port <= 65535:
        raise ArgumentError(f"port is {shown(port)}; it must be an integer, 0 to 65535", argument="port")
    try:
        socket.create_server((host, 0)).close()
    except (OSError, UnicodeError) as error:
        raise ArgumentError(
            f'host is "{host}", which is not an address of this machine ({error}); "127.0.0.1" is always one',
            argument="host",
        ) from error


def _end(spring: Mapping[str, Any], end: int, poses: Poses) -> FloatArray:
    body, point = int(spring[f"body{end}"]), np.array(spring[f"point{end}"], dtype=float)
    return point if body < 0 else poses.position[body] + poses.rotation[body] @ point


def _middle(at: ResultView) -> FloatArray:
    """The middle of the box around bodies and joints."""
    points = [at.body(name).position[0] for name in at.names.bodies]
    points += [at.joint(name).point[0] for name in at.names.joints]
    found = np.array(points, dtype=float).reshape(-1, 3)
    found = found[np.isfinite(found).all(axis=1)]
    middle: FloatArray = 0.5 * (found.min(axis=0) + found.max(axis=0)) if len(found) else np.zeros(3)
    return middle


def _plain(name: str) -> str:
    """A name as one step of a path."""
    return str(name).replace("/", "|")


def _from_z(along: FloatArray) -> FloatArray:
    """The quaternion that rotates z into a direction, scalar first."""
    length = float(np.linalg.norm(along))
    x, y, z = along / length if length > 0.0 else (0.0, 0.0, 1.0)
    if z < LONG_ROUNDING - 1.0:
        return np.array([0.0, 1.0, 0.0, 0.0])
    quaternion = np.array([1.0 + z, -y, x, 0.0])
    turned: FloatArray = quaternion / np.linalg.norm(quaternion)
    return turned


def _quaternions(rotation: FloatArray) -> FloatArray:
    """Rotations (nb, 3, 3) as quaternions, scalar first."""
    if not len(rotation):
        return np.empty((0, 4))
    from scipy.spatial.transform import Rotation  # takes longer to import than all of Partita

    turns: FloatArray = Rotation.from_matrix(rotation).as_quat()
    return turns[:, [3, 0, 1, 2]]
