"""`python tools/robots.py FOLDER`: robots with closed loops, each a folder with `robot.urdf` and `robot.yaml`.

A tree of links in URDF and, beside it, pairs of frames that are one in truth ("6d": the two links are welded there;
"3d": their points coincide). Each robot is read exactly as it stands, then with its placements rounded to six and to
four decimals; it is assembled, asked for its mobility, and runs two seconds from rest under gravity, its root standing
still. What the reader makes of links without mass, of frames and of dummies it says. Then `partita.load` reads it, it
is saved as URDF and as MJCF and read back: how far accelerations are off at rest, in parts of the largest, beside what
the last digit of its joints' points does to them.
"""

from __future__ import annotations

import argparse
import ast
import sys
import tempfile
import warnings
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import partita as pt

Array = NDArray[np.float64]
DUMMY = 1e-9
"""A link of so little mass [kg] at the end of a fixed joint is a frame, no body."""
SECONDS = 2.0
HEAD = f"{'robot':<16}{'decimals':>9}{'mobility':>9}{'redundant':>10}{'open':>9}{'closure':>9}{'energy':>9}  outcome"


@dataclass(frozen=True)
class Link:
    """A link with its inertia about its centre of mass, all in its own frame."""

    name: str
    mass: float
    com: Array
    inertia: Array


@dataclass
class Joint:
    """A joint with the frame of its child in that of its parent."""

    name: str
    kind: str
    parent: str
    child: str
    pose: Array
    axis: Array


@dataclass
class Robot:
    """A tree of links, pairs of frames that coincide, and what was said while reading."""

    name: str
    links: dict[str, Link]
    joints: list[Joint]
    pairs: list[tuple[str, str, str]]
    frames: dict[str, tuple[str, Array]] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)


def numbers(element: ElementTree.Element | None, key: str) -> Array:
    """Three numbers of an attribute; zeros where there is none."""
    words = element.get(key) if element is not None else None
    return np.array([float(word) for word in words.split()]) if words else np.zeros(3)


def turned(rpy: Array) -> Array:
    """The rotation of roll, pitch and yaw about fixed axes."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    return np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ y @ x


def placed(xyz: Array, rotation: Array) -> Array:
    """The frame (4, 4) at a place."""
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = rotation, xyz
    return found


def read(folder: Path, decimals: int | None) -> Robot:
    """The robot in a folder, the placements of its joints rounded."""
    root = ElementTree.parse(folder / "robot.urdf").getroot()
    sidecar = lists(folder / "robot.yaml")
    unknown = sorted(set(sidecar) - {"closed_loop", "type", "name_mot"})
    if unknown:
        raise ValueError(f"{folder / 'robot.yaml'}: {', '.join(unknown)} cannot be read")

    def rounded(x: Array) -> Array:
        return x if decimals is None else np.round(x, decimals)

    links = {}
    for item in root.findall("link"):
        inertial = item.find("inertial")
        mass, com, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
        if inertial is not None:
            origin, moments = inertial.find("origin"), inertial.find("inertia")
            weight = inertial.find("mass")
            mass = float(weight.get("value", 0.0)) if weight is not None else 0.0
            com = numbers(origin, "xyz")
            own = {key: float(moments.get(key, 0.0)) if moments is not None else 0.0
                   for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}  # fmt: skip
            inertia = np.array([[own["ixx"], own["ixy"], own["ixz"]], [own["ixy"], own["iyy"], own["iyz"]],
                                [own["ixz"], own["iyz"], own["izz"]]])  # fmt: skip
            axes = turned(numbers(origin, "rpy"))
            inertia = axes @ inertia @ axes.T
        name = item.get("name", "")
        links[name] = Link(name, mass, com, 0.5 * (inertia + inertia.T))
    joints = []
    for item in root.findall("joint"):
        origin, parent, child = item.find("origin"), item.find("parent"), item.find("child")
        assert parent is not None and child is not None
        pose = placed(rounded(numbers(origin, "xyz")), turned(rounded(numbers(origin, "rpy"))))
        kind = {"continuous": "revolute"}.get(item.get("type", ""), item.get("type", ""))
        axis = numbers(item.find("axis"), "xyz")
        joints.append(Joint(item.get("name", ""), kind, parent.get("link", ""), child.get("link", ""), pose, axis))
    pairs = [(a, b, kind) for (a, b), kind in zip(sidecar["closed_loop"], sidecar["type"], strict=True)]
    robot = Robot(folder.name, links, joints, pairs)
    fold_frames(robot)
    fold_balls(robot)
    heavy = [link.name for link in robot.links.values() if link.mass > 1e5]
    if heavy:
        robot.remarks.append(f"dummies of more than 100 t, taken as they are: {', '.join(heavy)}")
    return robot


def lists(path: Path) -> dict[str, Any]:
    """The sidecar: keys with lists of names, which Python reads as well."""
    lines = [line.partition(":") for line in path.read_text("utf-8").splitlines() if line.strip()]
    return {key.strip(): ast.literal_eval(value.strip()) for key, _, value in lines}


def fold_frames(robot: Robot) -> None:
    """Fixed links at the end of the tree that weigh next to nothing are frames of the links that carry them."""
    parents = {joint.parent for joint in robot.joints}
    for joint in list(robot.joints):
        if joint.kind == "fixed" and joint.child not in parents and robot.links[joint.child].mass <= DUMMY:
            robot.frames[joint.child] = (joint.parent, joint.pose)
            robot.joints.remove(joint)
            del robot.links[joint.child]
    if robot.frames:
        robot.remarks.append(f"{len(robot.frames)} links of no more than {DUMMY:g} kg at fixed joints, taken as frames")
    for joint in robot.joints:
        robot.frames.setdefault(joint.name, (joint.child, np.eye(4)))


def fold_balls(robot: Robot) -> None:
    """Three hinges through one point with massless links between them are a ball joint."""
    into = {joint.child: joint for joint in robot.joints}
    out: dict[str, list[Joint]] = {}
    for joint in robot.joints:
        out.setdefault(joint.parent, []).append(joint)
    balls = 0
    for last in list(robot.joints):
        second = into.get(last.parent)
        first = into.get(second.parent) if second is not None else None
        if second is None or first is None:
            continue
        chain = (first, second, last)
        between = (first.child, second.child)
        apart = max(float(np.linalg.norm(j.pose[:3, 3])) for j in (second, last))
        if any(j.kind != "revolute" for j in chain) or any(robot.links[n].mass > 0.0 for n in between):
            continue
        if any(len(out[n]) != 1 for n in between) or apart > 1e-12:
            continue
        pose = first.pose @ second.pose @ last.pose
        robot.joints[robot.joints.index(last)] = Joint(
            last.name, "spherical", first.parent, last.child, pose, np.zeros(3)
        )
        for j in (first, second):
            robot.joints.remove(j)
            del robot.frames[j.name]
        for n in between:
            del robot.links[n]
        balls += 1
    if balls:
        robot.remarks.append(f"{balls} ball joints, each three hinges with massless links between them")


def build(robot: Robot) -> tuple[pt.Mechanism, float]:
    """The mechanism, closed by welding or joining frames, and the closure error of the drawing there [m].

    Where two links are welded, the one that carries less is drawn where the other's frame puts it, with all it carries;
    its own joint then is where the loop gapes.
    """
    children: dict[str, list[str]] = {}
    for joint in robot.joints:
        children.setdefault(joint.parent, []).append(joint.child)
    root = next(iter(set(robot.links) - {joint.child for joint in robot.joints}))
    into = {joint.child: joint for joint in robot.joints}
    pose: dict[str, Array] = {root: np.eye(4)}

    def outwards(name: str) -> list[str]:
        return [name, *(other for child in children.get(name, []) for other in outwards(child))]

    for name in outwards(root)[1:]:
        pose[name] = pose[into[name].parent] @ into[name].pose
    rough, gap = set[str](), 0.0
    for a, b, kind in robot.pairs:
        (host_a, frame_a), (host_b, frame_b) = robot.frames[a], robot.frames[b]
        gap = max(gap, float(np.linalg.norm((pose[host_a] @ frame_a - pose[host_b] @ frame_b)[:3, 3])))
        if kind != "6d":
            continue
        keeps, moves = (host_a, frame_a), (host_b, frame_b)
        if len(outwards(moves[0])) > len(outwards(keeps[0])) or keeps[0] in outwards(moves[0]):
            keeps, moves = moves, keeps
        there = pose[keeps[0]] @ keeps[1] @ np.linalg.inv(moves[1])
        shift = there @ np.linalg.inv(pose[moves[0]])
        for name in outwards(moves[0]):
            pose[name] = shift @ pose[name]
        rough.add(moves[0])
    m = pt.Mechanism(robot.name, gravity=(0, 0, -9.81))
    for name, link in robot.links.items():
        m.add_body(name, mass=link.mass, inertia=link.inertia, com=link.com, position=pose[name][:3, 3],
                   orientation=nearest(pose[name][:3, :3]))  # fmt: skip
    m.add_fixed("stand", m.ground, root)
    for joint in robot.joints:
        where = pose[joint.parent] @ joint.pose
        point, axis = where[:3, 3], where[:3, :3] @ joint.axis
        open_at: dict[str, Any] = {}
        if joint.child in rough:
            open_at = {"child_point": pose[joint.child][:3, 3], "child_axis": pose[joint.child][:3, :3] @ joint.axis}
        if joint.kind in ("revolute", "prismatic"):
            add = m.add_revolute if joint.kind == "revolute" else m.add_prismatic
            add(joint.name, joint.parent, joint.child, point=point, axis=axis, **open_at)
        elif joint.kind in ("spherical", "fixed"):
            open_at.pop("child_axis", None)
            add_other = m.add_spherical if joint.kind == "spherical" else m.add_fixed
            add_other(joint.name, joint.parent, joint.child, point=point, **open_at)
        else:
            raise ValueError(f"{robot.name}: joint {joint.name} is {joint.kind}, which cannot be read")
    for a, b, kind in robot.pairs:
        (host_a, frame_a), (host_b, frame_b) = robot.frames[a], robot.frames[b]
        here, there = (pose[host_a] @ frame_a)[:3, 3], (pose[host_b] @ frame_b)[:3, 3]
        add_pair = m.add_fixed if kind == "6d" else m.add_spherical
        add_pair(f"{a} = {b}", host_a, host_b, point=here, child_point=there)
    return m, gap


def nearest(rotation: Array) -> Array:
    """The nearest rotation: products of many carry some round-off."""
    left, _, right = np.linalg.svd(rotation)
    return np.asarray(left @ right)


def row(folder: Path, decimals: int | None) -> tuple[str, list[str], bool]:
    """A line of the table, what the reader said, and whether the run succeeded."""
    robot = read(folder, decimals)
    start = f"{robot.name:<16}{'all' if decimals is None else decimals:>9}"
    m, gap = build(robot)
    try:
        still = m.assemble()
        summary = m.compile().summary
        redundant = summary["joint_rows"] - summary["joint_rank"]
        start += f"{summary['mobility']:>9}{redundant:>10}{gap:>9.1e}"
        report = m.report(still)
        robot.remarks += [line[2:] for line in report.splitlines() if line.startswith("- ") and "lengths" in line]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pt.errors.SuspectResultWarning)
            run = m.simulate(SECONDS, initial=still, max_steps=20000)
        closed = float(run.closure.max(initial=0.0))
        balance = run.energy.relative_balance
        words = "success" if run.success else f"{run.status} at {run.t[-1]:.3g} s: {run.message}"
        return f"{start}{closed:>9.1e}{balance:>9.1e}  {words}, {run.certificate.verdict}", robot.remarks, run.success
    except pt.errors.PartitaError as error:
        return f"{start}  {type(error).__name__}: {error}", robot.remarks, False


def written(folder: Path) -> list[str]:
    """Lines on how a robot changes when saved in other formats and read again."""
    faults = []
    with warnings.catch_warnings(), tempfile.TemporaryDirectory() as temporary:
        warnings.simplefilter("ignore")
        m = pt.load(folder / "robot.urdf")
        here = accelerations(m, m.assemble().q, m.compile().names)
        largest = max(abs(x) for x in here.values())
        shaken = pt.load(folder / "robot.urdf")
        rng = np.random.default_rng(1)
        for name, joint in list(shaken._description.joints.items()):
            if joint.point is not None:
                point = joint.point * (1.0 + np.finfo(float).eps * rng.choice([-1.0, 0.0, 1.0], 3))
                shaken._description.joints[name] = replace(joint, point=point)
        models = {"last digit": shaken}
        for suffix in (".urdf", ".mjcf"):
            try:
                m.save(Path(temporary) / f"robot{suffix}", strict=True)
                models[suffix] = pt.load(Path(temporary) / f"robot{suffix}")
            except pt.errors.MissingDependencyError as error:
                faults.append(f"{suffix}: {error}")
        for word, back in models.items():
            there = accelerations(back, m.assemble().q, m.compile().names)
            off = max(abs(there[name] - value) for name, value in here.items()) / largest
            faults.append(f"accelerations off by {off:.1e} of the largest: {word}")
    return faults


def accelerations(m: pt.Mechanism, q: Array, names: list[str]) -> dict[str, float]:
    """By velocity, at rest where coordinates of these names have these values."""
    model, value = m.compile(), dict(zip(names, q.tolist(), strict=True))
    found, _ = model.acceleration([value[name] for name in model.names], np.zeros(len(model.velocity_names)))
    return dict(zip(model.velocity_names, found.tolist(), strict=True))


def main() -> int:
    """Print the table; 1 if a robot read exactly does not run."""
    parser = argparse.ArgumentParser(description="Closed-loop robots from URDF and YAML, read, assembled and run.")
    parser.add_argument("folder", type=Path, help="holds a folder for each robot")
    folder = parser.parse_args().folder
    robots = sorted(path.parent for path in folder.glob("*/robot.urdf"))
    if not robots:
        parser.error(f"{folder} holds no folder with a robot.urdf")
    failed = 0
    print(HEAD)
    for robot in robots:
        for decimals in (None, 6, 4):
            line, remarks, fine = row(robot, decimals)
            failed += decimals is None and not fine
            print(line)
        print(*(f"    {word}" for word in [*remarks, *written(robot)]), sep="\n")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
