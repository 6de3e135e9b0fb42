"""Model files against an evaluation of their own numbers that shares nothing with the readers.

A tree drawn by chance, its frames and principal axes turned anywhere, is written as URDF, SDFormat and MJCF; a small
program for each format, of XML and rotations about axes alone, says where the links are for any coordinates, and what
they weigh. The same programs read what Partita writes.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import partita as pt

from .comparison import Verdict
from .coupled import plain
from .drawing import Array, unit
from .maximal import about

SAME = 1e-11
LEAST = 1e-14
"""kg m^2: what MJCF adds to bodies that have none."""


@dataclass
class Solid:
    """A link in the world: frame, mass, centre of mass and inertia about it."""

    transform: Array
    mass: float
    centre: Array
    inertia: Array


@dataclass
class Branch:
    """A link and the joint that carries it."""

    name: str
    parent: str
    kind: str
    transform: Array
    axes: list[Array]
    mass: float
    at: Array
    principal: Array
    q: list[float] = field(default_factory=list)


def frame(xyz: Any, rotation: Array) -> Array:
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = rotation, np.asarray(xyz, dtype=float)
    return found


def of_rpy(rpy: Any) -> Array:
    """About the fixed axes x, y and z, in this order."""
    x, y, z = np.eye(3)
    return about(z, rpy[2]) @ about(y, rpy[1]) @ about(x, rpy[0])


def of_quaternion(wxyz: Any) -> Array:
    w, *v = np.asarray(wxyz, dtype=float) / np.linalg.norm(wxyz)
    angle = 2.0 * float(np.arctan2(np.linalg.norm(v), w))
    return np.eye(3) if angle == 0.0 else about(unit(np.array(v)), angle)


def words(values: Any) -> str:
    return " ".join(repr(float(x)) for x in np.ravel(values))


def numbers(text: str | None, otherwise: str) -> Array:
    return np.array([float(x) for x in (text or otherwise).split()])


def tree(rng: Any, kinds: tuple[str, ...], count: int) -> list[Branch]:
    """Links by chance, each on a joint of an earlier one; inertias in principal axes that are turned anywhere."""
    found: list[Branch] = []
    for i in range(count):
        kind = str(rng.choice(kinds))
        edges = rng.uniform(0.1, 0.6, size=3)
        mass = float(rng.uniform(0.2, 3.0))
        parent = "base" if i == 0 else str(rng.choice(["base", *(b.name for b in found)]))
        axes = [unit(rng.normal(size=3))]
        if kind == "universal":
            axes.append(unit(np.cross(axes[0], rng.normal(size=3))))
        q = [float(x) for x in rng.uniform(-0.9, 0.9, size=len(axes) * (kind != "fixed"))]
        found.append(Branch(
            f"link{i}", parent, kind, frame(rng.normal(size=3), of_rpy(rng.uniform(-3.0, 3.0, size=3))), axes, mass,
            frame(0.3 * rng.normal(size=3), of_rpy(rng.uniform(-3.0, 3.0, size=3))),
            np.diag(mass * (edges @ edges - edges**2) / 12.0), q,
        ))  # fmt: skip
    return found


def angles_of(r: Array) -> Array:
    """Roll, pitch and yaw of a rotation."""
    return np.array([np.arctan2(r[2, 1], r[2, 2]), -np.arcsin(r[2, 0]), np.arctan2(r[1, 0], r[0, 0])])


def quaternion_of(r: Array) -> Array:
    """(w, x, y, z), of a rotation by less than half a turn."""
    angle = np.arccos(np.clip((np.trace(r) - 1.0) / 2.0, -1.0, 1.0))
    v = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / (2.0 * np.sin(angle))
    return np.array([np.cos(angle / 2.0), *np.sin(angle / 2.0) * v])


def turned_inertia(rng: Any, b: Branch) -> tuple[Array, Array]:
    """The inertia's frame, and the moments along its axes: a part of the turn in each."""
    share = of_rpy(rng.uniform(-3.0, 3.0, size=3))
    transform = frame(b.at[:3, 3], b.at[:3, :3] @ share.T)
    return transform, share @ b.principal @ share.T


MOMENTS = (("ixx", 0, 0), ("ixy", 0, 1), ("ixz", 0, 2), ("iyy", 1, 1), ("iyz", 1, 2), ("izz", 2, 2))


def as_urdf(rng: Any, branches: list[Branch]) -> str:
    out = ['<robot name="chance"><link name="base"/>']
    for b in branches:
        transform, moments = turned_inertia(rng, b)
        inertia = " ".join(f'{name}="{float(moments[i, j])!r}"' for name, i, j in MOMENTS)
        turn = words(angles_of(transform[:3, :3]))
        out.append(
            f'<link name="{b.name}"><inertial><origin xyz="{words(transform[:3, 3])}" rpy="{turn}"/>'
            f'<mass value="{b.mass!r}"/><inertia {inertia}/></inertial></link>'
            f'<joint name="j {b.name}" type="{b.kind}"><parent link="{b.parent}"/><child link="{b.name}"/>'
            f'<origin xyz="{words(b.transform[:3, 3])}" rpy="{words(angles_of(b.transform[:3, :3]))}"/>'
            f'<axis xyz="{words(1.7 * b.axes[0])}"/></joint>'
        )
    return "\n".join([*out, "</robot>"])


def as_sdf(rng: Any, branches: list[Branch]) -> str:
    """Poses by angles, degrees or quaternions; links by their parent or the model; axes by the joint, link or model."""
    world = {"base": np.eye(4)}
    out = ['<sdf version="1.9"><world name="w"><gravity>0.3 -0.2 -9.81</gravity><model name="chance">']

    def pose(transform: Array, relative: str = "") -> str:
        attribute = f' relative_to="{relative}"' if relative else ""
        form = int(rng.integers(3))
        if form == 0:
            return f"<pose{attribute}>{words(transform[:3, 3])} {words(angles_of(transform[:3, :3]))}</pose>"
        if form == 1:
            degrees = np.degrees(angles_of(transform[:3, :3]))
            return f'<pose{attribute} degrees="true">{words(transform[:3, 3])} {words(degrees)}</pose>'
        w, *xyz = quaternion_of(transform[:3, :3])
        return f'<pose{attribute} rotation_format="quat_xyzw">{words(transform[:3, 3])} {words([*xyz, w])}</pose>'

    for b in branches:
        world[b.name] = world[b.parent] @ b.transform
        base = str(rng.choice(["", b.parent])) if b.parent != "base" else ""
        inside = np.linalg.inv(world[base] if base else np.eye(4)) @ world[b.name]
        transform, moments = turned_inertia(rng, b)
        inertia = "".join(f"<{name}>{float(moments[i, j])!r}</{name}>" for name, i, j in MOMENTS)
        out.append(
            f'<link name="{b.name}">{pose(inside, base)}<inertial>{pose(transform)}<mass>{b.mass!r}</mass>'
            f"<inertia>{inertia}</inertia></inertial></link>"
        )
        own = of_rpy(rng.uniform(-3.0, 3.0, size=3)) if rng.random() < 0.7 else np.eye(3)
        turned, at = own != np.eye(3), frame(np.zeros(3), own)
        axes = []
        for k, axis in enumerate(b.axes):
            by = str(rng.choice(["", b.name, "__model__"]))
            seen = {"": own, b.name: np.eye(3), "__model__": world[b.name][:3, :3].T}[by]
            attribute = f' expressed_in="{by}"' if by else ""
            tag = "axis" if k == 0 else "axis2"
            axes.append(f"<{tag}><xyz{attribute}>{words(1.7 * seen.T @ axis)}</xyz></{tag}>")
        parent, turns = "world" if b.parent == "base" else b.parent, "".join(axes) if b.kind != "fixed" else ""
        out.append(
            f'<joint name="j {b.name}" type="{b.kind}"><parent>{parent}</parent>'
            f"<child>{b.name}</child>{pose(at) if turned.any() else ''}{turns}</joint>"
        )
    return "\n".join([*out, "</model></world></sdf>"])


def as_mjcf(rng: Any, branches: list[Branch]) -> str:
    """Hinges and slides whose points are anywhere, inertias by principal axes or in full."""
    children: dict[str, list[Branch]] = {}
    for b in branches:
        children.setdefault(b.parent, []).append(b)

    def body(b: Branch) -> str:
        point = 0.4 * rng.normal(size=3) * (b.kind == "hinge")
        moments = np.diag(b.principal)
        inertial = f'<inertial pos="{words(b.at[:3, 3])}" mass="{b.mass!r}" '
        if rng.random() < 0.5:
            inertial += f'quat="{words(quaternion_of(b.at[:3, :3]))}" diaginertia="{words(moments)}"/>'
        else:
            full = b.at[:3, :3] @ b.principal @ b.at[:3, :3].T
            order = [full[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
            inertial += f'fullinertia="{words(order)}"/>'
        joint = f'<joint name="j {b.name}" type="{b.kind}" axis="{words(1.7 * b.axes[0])}" pos="{words(point)}"/>'
        inner = "".join(map(body, children.get(b.name, [])))
        return (
            f'<body name="{b.name}" pos="{words(b.transform[:3, 3])}" '
            f'quat="{words(quaternion_of(b.transform[:3, :3]))}">'
            f"{joint if b.kind != 'fixed' else ''}{inertial}{inner}</body>"
        )

    return f'<mujoco model="chance"><compiler autolimits="true"/><worldbody>{"".join(map(body, children["base"]))}' \
           "</worldbody></mujoco>"  # fmt: skip


def moved(kind: str, axes: list[Array], q: list[float]) -> Array:
    """What a joint does to the frame of its child, in its own frame."""
    found = np.eye(4)
    for axis, x in zip(axes, q, strict=False):
        slides = kind in ("prismatic", "slide")
        found = found @ (frame(x * unit(axis), np.eye(3)) if slides else frame(np.zeros(3), about(unit(axis), x)))
    return found


def solid(transform: Array, mass: float, inside: Array, moments: Array) -> Solid:
    there = transform @ inside
    turn = there[:3, :3]
    return Solid(transform, mass, there[:3, 3], turn @ moments @ turn.T)


Solids = dict[str, Solid]
Coordinates = dict[str, list[float]]


def from_urdf(text: str, q: Coordinates) -> Solids:
    root = ET.fromstring(text)
    into = {j.find("child").get("link"): j for j in root.iter("joint") if j.find("child") is not None}  # type: ignore[union-attr]

    def origin(item: Any) -> Array:
        found = item.find("origin")
        if found is None:
            return np.eye(4)
        return frame(numbers(found.get("xyz"), "0 0 0"), of_rpy(numbers(found.get("rpy"), "0 0 0")))

    def transform(link: str) -> Array:
        if link not in into:
            return np.eye(4)
        joint = into[link]
        axis = joint.find("axis")
        axes = [numbers(axis.get("xyz") if axis is not None else None, "1 0 0")]
        kind = str(joint.get("type"))
        before = transform(str(joint.find("parent").get("link")))  # type: ignore[union-attr]
        return before @ origin(joint) @ moved(kind, axes, q.get(str(joint.get("name")), []))

    found: Solids = {}
    for link in root.iter("link"):
        inertial = link.find("inertial")
        name = str(link.get("name"))
        if inertial is None:
            continue
        of = inertial.find("inertia").attrib  # type: ignore[union-attr]
        moments = np.zeros((3, 3))
        for key, i, j in MOMENTS:
            moments[i, j] = moments[j, i] = float(of.get(key, 0.0))
        mass = float(inertial.find("mass").get("value"))  # type: ignore[union-attr,arg-type]
        found[name] = solid(transform(name), mass, origin(inertial), moments)
    return found


def from_sdf(text: str, q: Coordinates) -> Solids:
    model = next(ET.fromstring(text).iter("model"))
    links = {str(x.get("name")): x for x in model.findall("link")}
    into = {str(j.findtext("child")): j for j in model.findall("joint")}

    def pose(item: Any) -> Array:
        found = item.find("pose")
        if found is None:
            return np.eye(4)
        x = numbers(found.text, "0 0 0 0 0 0")
        if found.get("rotation_format") == "quat_xyzw":
            return frame(x[:3], of_quaternion([x[6], *x[3:6]]))
        return frame(x[:3], of_rpy(np.radians(x[3:]) if found.get("degrees") == "true" else x[3:]))

    def drawn(name: str) -> Array:
        found = links[name].find("pose")
        base = found.get("relative_to") if found is not None else None
        return (drawn(base) if base else np.eye(4)) @ pose(links[name])

    def transform(name: str) -> Array:
        joint = into[name]
        parent = str(joint.findtext("parent"))
        here = pose(joint)
        axes = []
        for axis in [*joint.findall("axis"), *joint.findall("axis2")]:
            xyz = axis.find("xyz")
            by = xyz.get("expressed_in")  # type: ignore[union-attr]
            turn = {None: np.eye(3), "__model__": (drawn(name) @ here)[:3, :3].T, name: here[:3, :3].T}[by]
            axes.append(turn @ numbers(xyz.text, "0 0 1"))  # type: ignore[union-attr]
        step = here @ moved(str(joint.get("type")), axes, q.get(str(joint.get("name")), [])) @ np.linalg.inv(here)
        if parent == "world":
            return drawn(name) @ step
        return transform(parent) @ np.linalg.inv(drawn(parent)) @ drawn(name) @ step

    found: Solids = {}
    for name, link in links.items():
        inertial: Any = link.find("inertial")
        moments = np.zeros((3, 3))
        for key, i, j in MOMENTS:
            moments[i, j] = moments[j, i] = float(inertial.find("inertia").findtext(key))
        found[name] = solid(transform(name), float(inertial.findtext("mass")), pose(inertial), moments)
    return found


def from_mjcf(text: str, q: Coordinates) -> Solids:
    found: Solids = {}

    def visit(item: Any, before: Array) -> None:
        for body in item.findall("body"):
            turn = of_quaternion(numbers(body.get("quat"), "1 0 0 0"))
            transform = before @ frame(numbers(body.get("pos"), "0 0 0"), turn)
            for joint in body.findall("joint"):
                axes, at = [numbers(joint.get("axis"), "0 0 1")], frame(numbers(joint.get("pos"), "0 0 0"), np.eye(3))
                step = moved(joint.get("type", "hinge"), axes, q.get(joint.get("name"), []))
                transform = transform @ at @ step @ np.linalg.inv(at)
            inertial = body.find("inertial")
            if inertial is not None:
                inside = frame(
                    numbers(inertial.get("pos"), "0 0 0"), of_quaternion(numbers(inertial.get("quat"), "1 0 0 0"))
                )
                if inertial.get("diaginertia"):
                    moments = np.diag(numbers(inertial.get("diaginertia"), ""))
                else:
                    a, b, c, d, e, f = numbers(inertial.get("fullinertia"), "0 0 0 0 0 0")
                    moments = np.array([[a, d, e], [d, b, f], [e, f, c]])
                found[body.get("name")] = solid(transform, float(inertial.get("mass")), inside, moments)
            visit(body, transform)

    visit(ET.fromstring(text).find("worldbody"), np.eye(4))
    return found


Writer = Callable[[Any, list[Branch]], str]
Evaluation = Callable[[str, Coordinates], Solids]
FORMATS: dict[str, tuple[Writer, Evaluation, tuple[str, ...]]] = {
    ".urdf": (as_urdf, from_urdf, ("revolute", "continuous", "prismatic", "fixed")),
    ".sdf": (as_sdf, from_sdf, ("revolute", "continuous", "prismatic", "fixed", "universal")),
    ".mjcf": (as_mjcf, from_mjcf, ("hinge", "slide", "fixed")),
}


def held(m: pt.Mechanism, wanted: Solids, run: Any, verdict: Verdict, what: str) -> None:
    """Every link where it is and what it weighs."""
    described = {b["name"]: b for b in m.to_spec()["bodies"]}
    for name, link in wanted.items():
        if name not in described:
            if link.mass > 1e-9:
                verdict.wrong.append(f"{what}: {name} is not there")
            continue
        b, body = described[name], run.body(name)
        turn, origin = body.rotation[0], body.position[0]
        scale = max(float(np.abs(link.inertia).max()), 1e-300)
        verdict.seen("frame", float(np.abs(turn - link.transform[:3, :3]).max()), SAME, f"{what}, {name}")
        verdict.seen("origin", float(np.abs(origin - link.transform[:3, 3]).max()), 10 * SAME, f"{what}, {name}")
        centre = origin + turn @ np.array(b["com"])
        verdict.seen("centre of mass", float(np.abs(centre - link.centre).max()), 10 * SAME, f"{what}, {name}")
        verdict.seen("mass", abs(b["mass"] - link.mass) / link.mass, SAME, f"{what}, {name}")
        inertia = turn @ np.array(b["inertia"]) @ turn.T
        verdict.seen("inertia", float(np.abs(inertia - link.inertia).max()) / scale, 1e2 * SAME, f"{what}, {name}")


def compare_file(seed: int, suffix: str, folder: Path) -> Verdict:
    """A file by chance, read by Partita and by the small program, at coordinates and speeds by chance."""
    verdict, rng = Verdict(), np.random.default_rng(seed)
    writer, evaluation, kinds = FORMATS[suffix]
    branches = tree(rng, kinds, int(rng.integers(1, 7)))
    text = writer(rng, branches)
    path = folder / f"chance{suffix}"
    path.write_text(text, "utf-8")
    if all(b.kind == "fixed" for b in branches):
        verdict.counts["nothing moves"] += 1
        return verdict
    m = pt.load(path)
    at: Coordinates = {f"j {b.name}": b.q for b in branches if b.q}
    speeds: Coordinates = {name: [float(x) for x in rng.normal(size=len(q))] for name, q in at.items()}
    joints = set(m.joints)
    given = {name: q[0] if len(q) == 1 else q for name, q in at.items() if name in joints}
    rates = {name: v[0] if len(v) == 1 else v for name, v in speeds.items() if name in joints}
    if len(given) < len(at):
        verdict.wrong.append(f"{suffix}: joints {sorted(set(at) - joints)} are not there")
    run = m.simulate(1e-3, t_eval=[0.0, 1e-3], initial=m.assemble(given, rates=rates))
    held(m, evaluation(text, at), run, verdict, suffix)
    energies(m, lambda h: evaluation(text, {n: [x + h * v for x, v in zip(q, speeds[n], strict=True)]
                                            for n, q in at.items()}), run, verdict, suffix)  # fmt: skip
    return verdict


def energies(m: pt.Mechanism, path: Callable[[float], Solids], run: Any, verdict: Verdict, what: str) -> None:
    """The kinetic energy by differences of where the links are: masses, inertias, axes and signs in one number."""
    h = 1e-5
    before, now, after = path(-h), path(0.0), path(h)
    total = 0.0
    for name, link in now.items():
        u = (after[name].centre - before[name].centre) / (2.0 * h)
        spin = (after[name].transform[:3, :3] - before[name].transform[:3, :3]) @ link.transform[:3, :3].T / (2.0 * h)
        w = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
        total += 0.5 * link.mass * float(u @ u) + 0.5 * float(w @ link.inertia @ w)
    mine = float(run.energy.kinetic[0])
    verdict.seen("kinetic energy", abs(mine - total) / max(total, 1e-9), 1e-7, what)


def compare_written(drawing: Any, suffix: str, folder: Path) -> Verdict:
    """A mechanism by chance written by Partita: by the small program its links stand as drawn."""
    verdict = Verdict()
    m = drawing.build()
    path = folder / f"written{suffix}"
    try:
        m.save(path)
    except pt.errors.PartitaError as error:
        verdict.counts[f"refused: {type(error).__name__}"] += 1
        return verdict
    wanted = {
        b.name: Solid(frame(b.position, b.rotation), b.mass, b.position + b.rotation @ b.com,
                      b.rotation @ b.inertia @ b.rotation.T)
        for b in drawing.bodies
    }  # fmt: skip
    found = FORMATS[suffix][1](path.read_text("utf-8"), {})
    size = drawing.size
    for name, link in wanted.items():
        if name not in found:
            verdict.wrong.append(f"written {suffix}: {name} is not there")
            continue
        # what closes a loop by a chain of joints carries a part of its body, welded to the rest
        parts = [x for part, x in found.items() if part == name or part.startswith(f"{name} half at ")]
        mass = sum(x.mass for x in parts)
        centre = sum(x.mass * x.centre for x in parts) / mass
        arms = [x.centre - centre for x in parts]
        inertia = sum(
            x.inertia + x.mass * (r @ r * np.eye(3) - np.outer(r, r)) for x, r in zip(parts, arms, strict=True)
        )
        other, words = Solid(found[name].transform, mass, centre, inertia), f"written {suffix}, {name}"
        scale = max(float(np.abs(link.inertia).max()), link.mass * size**2 * 1e-6)
        verdict.seen("centre as drawn", float(np.abs(other.centre - link.centre).max()) / size, 1e-9, words)
        verdict.seen("mass as drawn", abs(other.mass - link.mass) / link.mass, 1e-12, words)
        # MuJoCo requires a moment of inertia, which Partita reports
        off = max(float(np.abs(other.inertia - link.inertia).max()) - LEAST * (suffix == ".mjcf"), 0.0)
        verdict.seen("inertia as drawn", off / scale, 1e-9, words)
    return verdict


def compare_toml(drawing: Any, folder: Path) -> Verdict:
    """A native file has the same content to the last digit."""
    verdict = Verdict()
    m = drawing.build()
    path = folder / "chance.toml"
    try:
        m.save(path)
    except pt.errors.PartitaError as error:
        verdict.counts[f"refused: {type(error).__name__}"] += 1
        return verdict
    again, before = pt.load(path).to_spec(), m.to_spec()
    verdict.counts["native files"] += 1
    if again != before:
        parts = [key for key in before if again.get(key) != before[key]]
        verdict.wrong.append(f"native file: {', '.join(parts)} differ")
    return verdict


def compare_all(seed: int, folder: Path) -> Verdict:
    """A number in every format, read and written."""
    total, drawing = Verdict(), plain(seed)
    mechanical = replace(drawing, forces=())
    found = [compare_file(seed, suffix, folder) for suffix in FORMATS]
    found += [compare_written(mechanical, suffix, folder) for suffix in (".urdf", ".mjcf")]
    for verdict in (*found, compare_toml(drawing, folder)):
        total.wrong += verdict.wrong
        total.counts += verdict.counts
        for what, error in verdict.worst.items():
            total.worst[what] = max(total.worst.get(what, 0.0), error)
    return total
