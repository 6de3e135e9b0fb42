"""Runs made by hand, for what is drawn of them: bodies given by their poses, and a page's data read back."""

import base64
import json
import re
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from partita.viewer.packing import LEVELS

Z = (0.0, 0.0, 1.0)


@dataclass
class Fake:
    """What the page needs of a result, for bodies given by their poses."""

    t: np.ndarray
    poses: dict[str, tuple[np.ndarray, np.ndarray]]  # origin (nt, 3), rotation (nt, 3, 3)
    joints: list[tuple[str, str, str, str, tuple[float, ...]]]  # name, kind, parent, child, point in the child
    force: float = 5.0
    planar: bool = True
    independent: Any = None
    partitions: list[Any] = field(default_factory=list)
    events: list[Any] = field(default_factory=list)
    gravity: tuple[float, ...] = (0.0, -9.81, 0.0)
    axes: dict[str, tuple[float, ...]] = field(default_factory=dict)
    forces: list[dict[str, Any]] = field(default_factory=list)
    coms: dict[str, tuple[float, ...]] = field(default_factory=dict)
    success: bool = True
    message: str = ""
    has_energy: bool = True
    with_spec: bool = True
    title: str = "fake"
    determined: np.ndarray = field(default_factory=lambda: np.ones(6, dtype=bool))

    def __post_init__(self) -> None:
        nt, nj = len(self.t), len(self.joints)
        names = [j[0] for j in self.joints] or ["q0", "q1"]
        self.names = SimpleNamespace(
            bodies=list(self.poses), joints=[j[0] for j in self.joints], velocities=names, coordinates=names
        )
        phase = 3.0 * self.t[:, None] + np.arange(len(names))
        self.measure = 0.55 + 0.45 * np.sin(phase)
        self.q, self.v, self.vdot = -np.cos(phase) / 3.0, np.sin(phase), 3.0 * np.cos(phase)
        if self.independent is None:
            self.independent = np.zeros((nt, 1), dtype=int)
        self.closure = np.full(nt, 1e-15)
        self.certificate = SimpleNamespace(
            verdict="valid", closure=1e-15, energy_balance=0.0, newton_euler=None, findings=()
        )
        self.sigma = 0.5 + 0.1 * np.sin(self.t)
        self.sqrt_mu = 0.7 + 0.1 * np.cos(self.t)
        kinetic = 1.0 + np.sin(self.t) ** 2
        self.energy = SimpleNamespace(kinetic=kinetic, potential=3.0 - kinetic, total=np.full(nt, 3.0))
        self.summary = {
            "name": self.title,
            "planar": self.planar,
            "joints": [
                {"name": n, "kind": k, "parent": p, "child": c, "state_v": [i, 1]}
                for i, (n, k, p, c, _) in enumerate(self.joints)
            ],
        }
        self.spec = self._spec() if self.with_spec else None
        self._loads = self.force * np.stack([np.cos(self.t), np.sin(2 * self.t), 0 * self.t], axis=1)
        self._phase = 1.0 + np.arange(nj)

    def _spec(self) -> dict[str, Any]:
        return {
            "gravity": list(self.gravity),
            "bodies": [
                {
                    "name": n,
                    "com": list(self.coms.get(n, (0, 0, 0))),
                    "orientation": r[0].tolist(),
                    "shape": {"kind": "auto"},
                }
                for n, (_, r) in self.poses.items()
            ],
            "joints": [{"name": j[0], "axis": list(self.axes.get(j[0], Z))} for j in self.joints],
            "forces": self.forces,
        }

    def body(self, name: str) -> Any:
        position, rotation = self.poses[name]
        rates = np.gradient(rotation, self.t, axis=0) if len(self.t) > 1 else np.zeros_like(rotation)
        spin = rates @ rotation.transpose(0, 2, 1)  # skew: the angular velocity, up to the error of differences
        velocity = np.gradient(position, self.t, axis=0) if len(self.t) > 1 else np.zeros_like(position)
        omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
        return SimpleNamespace(position=position, rotation=rotation, velocity=velocity, angular_velocity=omega)

    def applied_forces(self) -> dict[str, Any]:
        return {}

    def joint(self, name: str) -> Any:
        i = self.names.joints.index(name)
        position, rotation = self.poses[self.joints[i][3]]
        point = position + rotation @ np.array(self.joints[i][4])
        force = self._loads / self._phase[i]
        moment, place = 0.1 * force[:, ::-1], np.zeros((len(self.t), 1))
        found = SimpleNamespace(point=point, position=place, force=force, moment=moment, determined=self.determined)
        found.in_frame = lambda axes: found
        return found


def turned(angle: np.ndarray) -> np.ndarray:
    """Rotations (nt, 3, 3) about z."""
    c, s, one, zero = np.cos(angle), np.sin(angle), np.ones_like(angle), np.zeros_like(angle)
    return np.array([[c, -s, zero], [s, c, zero], [zero, zero, one]]).transpose(2, 0, 1)


def at(x: Any, y: Any, nt: int) -> np.ndarray:
    return np.stack([np.broadcast_to(x, nt), np.broadcast_to(y, nt), np.zeros(nt)], axis=1).astype(float)


def four_bar(nt: int = 50, **options: Any) -> Fake:
    """A crank of 1, a coupler of 3 (with a point off its line), a rocker of 2.5, on a ground of 3."""
    t = np.linspace(0.0, 5.0, nt)
    crank = 1.0 + 2 * np.pi * t / 5.0
    b = at(np.cos(crank), np.sin(crank), nt)
    to_d = np.array([3.0, 0.0, 0.0]) - b
    d = np.linalg.norm(to_d, axis=1)
    coupler = np.arctan2(to_d[:, 1], to_d[:, 0]) + np.arccos((9 + d**2 - 2.5**2) / (6 * d))
    c = b + 3 * at(np.cos(coupler), np.sin(coupler), nt)
    rocker = np.arctan2(c[:, 1], c[:, 0] - 3)
    poses = {
        "crank": (at(0, 0, nt), turned(crank)),
        "coupler": (b, turned(coupler)),
        "rocker": (at(3, 0, nt), turned(rocker)),
    }
    joints = [
        ("A", "revolute", "ground", "crank", (0, 0, 0)),
        ("B", "revolute", "crank", "coupler", (0, 0, 0)),
        ("C", "revolute", "rocker", "coupler", (3, 0, 0)),
        ("D", "revolute", "ground", "rocker", (0, 0, 0)),
    ]
    return Fake(t, poses, joints, **options)


def pendulum(nt: int = 30, **options: Any) -> Fake:
    t = np.linspace(0.0, 2.0, nt)
    poses = {"bob": (at(0, 0, nt), turned(np.sin(t)))}
    return Fake(t, poses, [("A", "revolute", "ground", "bob", (0, 0, 0))], coms={"bob": (0, -1, 0)}, **options)


def data(page: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    scene = json.loads(found[1])
    none = dict.fromkeys(("axis", "axis2", "atParent", "rail", "seat", "seatParent"))
    scene["joints"] = [none | {"open": [False, False]} | joint for joint in scene["joints"]]
    return scene


def unpacked(table: dict[str, Any], frames: int) -> np.ndarray:
    values = np.empty((frames, table["columns"]))
    moving = np.cumsum(table["moving"], dtype=int)
    values[:, np.setdiff1d(np.arange(table["columns"]), moving)] = table["still"] or 0.0
    bytes_ = base64.b64decode(table["data"])
    if "low" in table:
        whole = np.frombuffer(bytes_, "<u2").reshape(frames, -1)
        stored = np.where(whole == LEVELS + 1, np.nan, np.array(table["low"]) + np.array(table["step"]) * whole)
    else:
        stored = np.frombuffer(bytes_, "<f4").reshape(frames, -1)
    values[:, moving] = stored
    return values


def placed(scene: dict[str, Any], joint: int) -> np.ndarray:
    """World points (nt, 3) of a joint, as the page finds them: fixed to its child."""
    body, point = scene["joints"][joint]["child"], np.array(scene["joints"][joint]["at"])
    if body < 0:
        return np.broadcast_to(point, (scene["frames"], 3))
    position = unpacked(scene["tables"]["position"], scene["frames"])[:, 3 * body : 3 * body + 3]
    turn = unpacked(scene["tables"]["turn"], scene["frames"])[:, 4 * body : 4 * body + 4]
    return position + Rotation.from_quat(turn).apply(point)
