"""MJCF, through MuJoCo's own parser and compiler; loops are its equalities `connect`, `weld` and `joint`.

Two `connect` between the same bodies join two points, which is a hinge on the line through them; three are a weld.
`mjcf_table` lists what becomes of each element and attribute; what acts is reported by its compiled value. Files that
the model names must lie in its own folder or below, or in the root that the caller names: they are checked before
MuJoCo opens anything.
"""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

import numpy as np

from ..errors import MissingDependencyError
from ..files import get
from ..limits import exceeded
from ..products import matmul, norm
from ..tolerance import EQUAL_IN_SIX_DIGITS
from . import closings
from .format_table import content, remark
from .mjcf_counts import check, check_compiled, check_numbers
from .mjcf_looks import looks_of
from .mjcf_table import (
    ACTUATORS,
    CONTACT,
    FLUID,
    FRICTION,
    HIGHER,
    LIMITS,
    MJCF,
    MOTOR,
    ROPE,
    ROTOR,
    SERVO,
    TENDON,
    YIELD,
)
from .reading import Reading, Remark
from .request import Request
from .robot import Array, Effort, Joint, Link, Loop, Robot, Spring, Tie, placed, rotation_of
from .xmltree import Element, parse, refuse

_FOLDERS = ("meshdir", "texturedir", "assetdir")
_LOOKS = ("texture", "skin")
"""Elements whose files are never opened: what they look like moves nothing."""
_BESIDE = ("include", "model")
"""Elements that name files beside the model, whatever its folders of others."""
_FILES = ("file", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")
_NAMES = ("name", "class", "childclass", "model")


def read(path: Path, request: Request) -> Robot:
    """The robot in a file. Raises `FileFormatError` with the line of what is wrong."""
    path = Path(os.path.normpath(path))
    named = _Named(path.parent, request.root)
    found = _looked_at(path, (), named)
    named.stay()
    if found.tag != "mujoco":
        found.fail("is not <mujoco>: this is not MJCF")
    try:
        import mujoco
    except ImportError as error:
        raise MissingDependencyError(
            f'"{path}" is MJCF, which is read by MuJoCo\'s own parser: pip install partita[mujoco]', package="mujoco"
        ) from error
    if not hasattr(mujoco, "MjVfs"):
        raise MissingDependencyError(
            f'"{path}" is MJCF, which is read by MuJoCo 4 or later: pip install -U mujoco', package="mujoco"
        )
    check(found)
    for other in named.attached:
        check(other)
    reading = Reading(path, "MJCF")
    model = _compiled(mujoco, path, reading)
    for root in (found, *named.attached):
        MJCF.visit(root, reading, cut=False)
    return _Reader(mujoco, model, found, reading, request).robot()


def _compiled(mujoco: Any, path: Path, reading: Reading) -> Any:
    """The model that MuJoCo makes of the file, whose textures and skins it never opens; its warnings are remarks, where
    it would print them and write a log."""
    messages: list[str] = []
    called = str(path) if path.suffix == ".xml" else f"{path}.xml"  # by which MuJoCo knows that it is MJCF
    before = mujoco.get_mju_user_warning() if hasattr(mujoco, "get_mju_user_warning") else None
    mujoco.set_mju_user_warning(messages.append)
    try:
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always")
            spec = _parsed(mujoco, path, called)
            for texture in spec.textures:
                texture.file, texture.cubefiles = "", [""] * len(texture.cubefiles)
                texture.builtin, texture.width, texture.height = mujoco.mjtBuiltin.mjBUILTIN_FLAT, 1, 1
            for skin in list(spec.skins):
                spec.delete(skin)
            model = spec.compile()
        messages += [str(warning.message) for warning in heard]
    except (ValueError, RuntimeError) as error:
        message = " ".join(str(error).replace(called, str(path)).split())
        refuse(path, _line(message), f"MuJoCo cannot read it: {message}")
    finally:
        mujoco.set_mju_user_warning(before)
        for warning in messages:
            words = " ".join(warning.replace(called, str(path)).split())
            reading.changed.append(Remark(_line(words), f"MuJoCo warns: {words}"))
    check_compiled(mujoco, model, path)
    return model


def _parsed(mujoco: Any, path: Path, called: str) -> Any:
    """What the file specifies, by the name by which MuJoCo knows that it is MJCF."""
    if called == str(path):
        return mujoco.MjSpec.from_file(called)
    with mujoco.MjVfs() as files:
        files[called] = get(path, "model_bytes")
        return mujoco.MjSpec.from_file(called, vfs=files)


@dataclass
class _Named:
    """Files that a model names, and the folders in which they may lie."""

    folder: Path
    root: Path
    files: list[tuple[Element, str]] = field(default_factory=list)
    folders: list[str] = field(default_factory=list)
    included: int = 0
    attached: list[Element] = field(default_factory=list)

    def add(self, element: Element, key: str) -> None:
        """The file or folder that an attribute names, if it does."""
        name = element.get(key)
        if element.tag in _LOOKS or key == "texturedir":
            return
        if PurePosixPath(name).is_absolute() or PureWindowsPath(name).anchor != "":
            element.fail(f'names the file "{name}", an absolute path, which leads out of the folder of the model')
        if name and key in _FOLDERS:
            self.folders.append(name)
        elif name:
            self.files.append((element, name))

    def within(self, element: Element) -> list[str]:
        """The folders in which the file of an element may lie, relative to the model."""
        own = [] if element.tag in _BESIDE else self.folders
        return ["", *own] if not own or element.tag == "flexcomp" else own

    def stay(self) -> None:
        """Refuse names and links that lead out of the root."""
        for element, name in self.files:
            for inner in self.within(element):
                place = self.folder.resolve() / inner.replace("\\", "/") / name.replace("\\", "/")
                if not Path(os.path.normpath(place)).is_relative_to(self.root):
                    element.fail(f'names the file "{name}", which leads out of {self._root()}')
                if not place.resolve().is_relative_to(self.root):
                    element.fail(f'names the file "{name}", a link that leads out of {self._root()}')

    def _root(self) -> str:
        own = self.root == self.folder.resolve()
        words = "the folder of the model" if own else f'the root "{self.root}"'
        return f'{words}; root="..." in partita.load names a wider one'


def _looked_at(path: Path, including: tuple[Path, ...], named: _Named) -> Element:
    """The root of a file whose includes stay within the root, and are expanded; `including` lists those around it."""
    root = parse(path)
    try:
        get(path, "model_bytes").decode("utf-8")
    except UnicodeDecodeError as error:
        refuse(path, None, f"it is not UTF-8, the encoding that MuJoCo reads: {error.reason}")
    waiting = [root]
    while waiting:
        element = waiting.pop()
        check_numbers(element, _NAMES)
        for key in (*_FILES, *_FOLDERS):
            named.add(element, key)
        inside, own = list[Element](), list[Element]()
        for child in element.children:
            if child.tag in ("include", "model"):
                other = _included(child, path, including, named)
                if child.tag == "include":
                    inside += other.children
                    continue
                named.attached.append(other)
            inside.append(child)
            own.append(child)
        element.children = inside
        waiting += own
    return root


def _included(at: Element, path: Path, including: tuple[Path, ...], named: _Named) -> Element:
    """The root of the file that an element names: one that is included, or a model of which parts are attached."""
    more = [*(key for key in at.attributes if key != "file"), *(child.tag for child in at.children)]
    if at.tag == "include" and more:
        at.fail(f'has "{more[0]}"; it takes a file alone')
    name = at.must("file")  # MuJoCo 4.0 hangs after a model without one
    named.add(at, "file")
    inner = Path(os.path.normpath(named.folder / name))
    named.included += 1
    named.stay()
    if inner in (*including, path):
        at.fail(f'includes "{name}", which includes this file: the includes are circular')
    if (words := exceeded("includes", named.included, "included files")) is not None:
        at.fail(f"is one too many: the model has {words}")
    if not inner.is_file():
        at.fail(f'includes "{name}", which does not exist')
    own = at.tag == "model"  # names files from its own folder, includes do so from that of the model
    within = _Named(inner.parent, named.root, included=named.included) if own else named
    root = _looked_at(inner, (*including, path), within)
    within.stay()
    named.included = within.included
    named.attached += within.attached if own else []
    odd = [key for key in root.attributes if key != "model"]
    if not own and odd:
        root.fail(f'has the attribute "{odd[0]}", which a file that is included does not take')
    return root


def _line(message: str) -> int | None:
    words = message.replace(",", " ").replace("Line number=", "line ").split()
    at = next((i for i, word in enumerate(words[:-1]) if word.lower() == "line"), None)
    found = int(words[at + 1]) if at is not None and words[at + 1].isdigit() else 0
    return found or None  # MuJoCo says 0 where it does not know


@dataclass(frozen=True)
class _Held:
    """A point of two bodies joined by a connect."""

    name: str
    points: tuple[Array, Array]
    at: Element


class _Reader:
    def __init__(self, mujoco: Any, model: Any, root: Element, reading: Reading, request: Request) -> None:
        self.mujoco, self.model, self.root = mujoco, model, root
        self.named: dict[tuple[str, str], Element] = {}
        waiting = [root]
        while waiting:
            element = waiting.pop()
            waiting += element.children
            self.named.setdefault((element.tag, element.get("name")), element)
        name = root.get("model") or reading.path.stem
        gravity = np.zeros(3) if self.off("gravity") else model.opt.gravity
        self.made = Robot(name, reading, request, gravity=tuple(gravity.tolist()), gimbals=True)
        self.joint_names: dict[int, str] = {}
        self.geared: dict[int, tuple[float, float]] = {}

    def off(self, *flags: str) -> bool:
        """Whether the file disables one of these; constraints are all that is not a joint or a spring."""
        bits = (getattr(self.mujoco.mjtDisableBit, f"mjDSBL_{flag.upper()}", 0) for flag in flags)
        return any(int(self.model.opt.disableflags) & int(bit) for bit in bits)

    def name(self, kind: str, i: int) -> str:
        """Its name, or its kind and number where it has none."""
        kinds = self.mujoco.mjtObj
        of: dict[str, Any] = {"body": kinds.mjOBJ_BODY, "joint": kinds.mjOBJ_JOINT, "equality": kinds.mjOBJ_EQUALITY}
        of["tendon"], of["actuator"] = kinds.mjOBJ_TENDON, kinds.mjOBJ_ACTUATOR
        return self.mujoco.mj_id2name(self.model, of[kind], i) or f"{kind} {i}"

    def at(self, *tags: str, name: str) -> Element:
        """The element of that name in the file; else the root."""
        return next((self.named[tag, name] for tag in tags if (tag, name) in self.named), self.root)

    def remark(self, remarks: list[Remark], at: Element, text: str, name: str = "", kind: str = "") -> None:
        found = Remark(None, text, name, kind) if at is self.root else remark(self.made.reading, at, text, name, kind)
        remarks.append(found)

    def dropped(self, at: Element, text: str, name: str, kind: str = "motion") -> None:
        """Something that the model lacks."""
        self.remark(self.made.reading.dropped, at, text, name, kind)

    def robot(self) -> Robot:
        m, robot = self.model, self.made
        self.gears()
        robot.links["world"] = Link("world", 0.0, np.zeros(3), np.zeros((3, 3)), self.root)
        for i in range(1, m.nbody):
            self.body(i)
        self.equalities()
        self.ends()
        for i in range(m.ntendon):
            self.tendon(i)
        robot.reading.used.append(Remark(None, f"{m.nbody - 1} bodies, {m.njnt} joints, {m.neq} equalities"))
        self.world()
        return robot

    def gears(self) -> None:
        """Rotors and dampers of actuators, which act behind their gears at joints."""
        m, kinds = self.model, self.mujoco.mjtJoint
        written = self.written(ACTUATORS)
        count = len(m.actuator_trnid)
        for i in range(count):
            called = f'actuator "{self.name("actuator", i)}"'
            at = written[i] if len(written) == count else self.at(*ACTUATORS, name=self.name("actuator", i))
            armature = self.value("actuator_armature", i)
            damping = self.law(called, at, "", i, "actuator_damping", i)[1] + self.induced(i)
            exerts = self.exerts(i)
            self.dropped(at, SERVO if exerts else MOTOR, self.described(at, called), "motion" if exerts else "bounds")
            if armature == 0.0 and damping == 0.0:
                continue
            output = int(m.actuator_outadr[i]) if hasattr(m, "actuator_outadr") else i
            j, ratio = int(m.actuator_trnid[i, 0]), float(m.actuator_gear[output, 0])
            along = int(m.actuator_trntype[i]) == int(self.mujoco.mjtTrn.mjTRN_JOINT)
            if along and int(m.jnt_type[j]) in (int(kinds.mjJNT_HINGE), int(kinds.mjJNT_SLIDE)):
                before = self.geared.get(j, (0.0, 0.0))
                self.geared[j] = (before[0] + ratio**2 * armature, before[1] + ratio**2 * damping)
            else:
                self.dropped(at, ROTOR, f"{called} armature {armature:g}, damping {damping:g}")

    def induced(self, i: int) -> float:
        """The damping of a plain electric motor at zero voltage: constant^2 / resistance; 0 of other actuators."""
        if self.exerts(i) or self.law_of("Bias", "bias", i) != "DCMOTOR":
            return 0.0
        resistance, constant = (float(x) for x in self.model.actuator_gainprm[i][:2])
        return constant**2 / resistance if resistance > 0.0 else 0.0

    def law_of(self, kind: str, key: str, i: int) -> str:
        """The name by which MuJoCo knows the gain, bias or dynamics of an actuator."""
        found = getattr(self.mujoco, f"mjt{kind}")(int(getattr(self.model, f"actuator_{key}type")[i]))
        return str(found.name).rpartition("_")[2]

    def exerts(self, i: int) -> bool:
        """Whether an actuator does more at zero control than its rotor and its damping say."""
        m, bias = self.model, self.law_of("Bias", "bias", i)
        plugin = getattr(m, "actuator_plugin", None)
        if plugin is not None and int(plugin[i]) >= 0:
            return True
        if bias == "DCMOTOR":  # beyond resistance and constant: a controller, inductance, cogging, friction, heat
            more = (m.actuator_gainprm[i][2:], m.actuator_biasprm[i], m.actuator_dynprm[i])
            return any(bool(np.any(numbers)) for numbers in more)
        return bool(np.any(m.actuator_biasprm[i])) if bias == "AFFINE" else bias != "NONE"

    def written(self, tags: tuple[str, ...]) -> list[Element]:
        """Elements inside <actuator> with these tags, in the order of the file."""
        found, waiting = list[Element](), [self.root]
        while waiting:
            element = waiting.pop()
            found += [child for child in element.children if child.tag in tags and element.tag == "actuator"]
            waiting += reversed(element.children)
        return found

    def world(self) -> None:
        """What acts on all bodies, or between those that touch."""
        m, option = self.model, self.model.opt
        fluid = {"density": option.density, "viscosity": option.viscosity}
        if any(fluid.values()):
            fluid["wind"] = " ".join(f"{x:g}" for x in option.wind)
            self.dropped(self.root, FLUID, ", ".join(f"{key} {value:}" for key, value in fluid.items()))
        touching = int(np.count_nonzero(m.geom_contype | m.geom_conaffinity)) if m.ngeom else 0
        if touching and not self.off("contact", "constraint"):
            self.dropped(self.root, CONTACT, f"{touching} geoms", "bounds")
        robot, (looks, lost) = self.made, looks_of(self.mujoco, m, self.link)
        robot.looks += looks
        for kind, count in lost.items():
            self.dropped(self.root, "has no shape that could be drawn", f"{kind} of {count} geoms", "looks")

    def body(self, i: int) -> None:
        m, robot = self.model, self.made
        name = self.name("body", i)
        axes = rotation_of(m.body_iquat[i])
        inertia = matmul(matmul(axes, np.diag(m.body_inertia[i])), axes.T)
        at = self.at("body", name=name)
        link = Link(name, float(m.body_mass[i]), m.body_ipos[i].copy(), 0.5 * (inertia + inertia.T), at)
        held = float(m.body_gravcomp[i])
        link.gravity = held != 1.0
        if held not in (0.0, 1.0):
            self.dropped(at, "gravity acts on a body fully or not at all", f'body "{name}" gravcomp {held:g}')
        parent = "world" if m.body_parentid[i] == 0 else self.name("body", m.body_parentid[i])
        pose = placed(m.body_pos[i], rotation_of(m.body_quat[i]))
        first, count = int(m.body_jntadr[i]), int(m.body_jntnum[i])
        if count == 0:
            robot.joints[f"{name} on {parent}"] = Joint(
                f"{name} on {parent}", "fixed", parent, name, pose, np.array([1.0, 0.0, 0.0]), at
            )
        for j in range(first, first + count):
            last = j == first + count - 1
            child = name if last else f"{name} before {self.name('joint', j + 1)}"
            if not last:
                robot.links[child] = Link(child, 0.0, np.zeros(3), np.zeros((3, 3)), at)
            self.joint(j, parent, child, pose)
            parent, pose = child, np.eye(4)
        robot.links[name] = link

    def joint(self, j: int, parent: str, child: str, pose: Array) -> None:
        m, kinds, robot = self.model, self.mujoco.mjtJoint, self.made
        name, kind = self.name("joint", j), int(m.jnt_type[j])
        self.joint_names[j] = name
        at = self.at("joint", "freejoint", name=name)
        words = {kinds.mjJNT_FREE: "free", kinds.mjJNT_BALL: "spherical", kinds.mjJNT_SLIDE: "prismatic"}
        found = Joint(name, words.get(kind, "revolute"), parent, child, pose, m.jnt_axis[j].copy(), at)
        if found.kind != "free":
            found.point = m.jnt_pos[j].copy()
        d, q, called = int(m.jnt_dofadr[j]), int(m.jnt_qposadr[j]), f'joint "{name}"'
        stiffness, damping = self.law(called, at, "jnt_stiffness", j, "dof_damping", d)
        geared = self.geared.get(j, (0.0, 0.0))
        damping += geared[1]
        rotor = float(m.dof_armature[d]) + geared[0]
        if found.kind in ("revolute", "prismatic"):
            effort = Effort(stiffness, damping, float(m.qpos_spring[q] - m.qpos0[q]), rotor=rotor)
            found.efforts = [] if effort.is_empty else [effort]
        elif stiffness != 0.0 or damping != 0.0:
            text = "a spring and a damper would act, of a joint that has no single coordinate: add_bushing"
            self.dropped(at, text, f"{called} stiffness {stiffness:g}, damping {damping:g}")
        if stiffness != 0.0 and (bound := self.value("jnt_springyield", j)) != 0.0:
            self.dropped(at, YIELD, f"{called} springyield {bound:g}")
        if rotor != 0.0 and not found.efforts:
            self.dropped(at, ROTOR, f"{called} armature {rotor:g}")
        if m.dof_frictionloss[d] != 0.0 and not self.off("frictionloss", "constraint"):
            self.dropped(at, FRICTION, f"{called} frictionloss {m.dof_frictionloss[d]:g}")
        if m.jnt_limited[j] and not self.off("limit", "constraint"):
            low, high = m.jnt_range[j]
            self.dropped(at, LIMITS, f"{called} range {low:g} to {high:g}", "bounds")
        robot.joints[name] = found

    def value(self, key: str, i: int) -> float:
        """The first number of a field of the compiled model; 0 where this version of MuJoCo has no such field."""
        found = getattr(self.model, key, None)
        return 0.0 if found is None else float(np.asarray(found[i]).flat[0])

    def law(self, called: str, at: Element, spring: str, i: int, damper: str, j: int) -> tuple[float, float]:
        """Stiffness and damping; what they would be of higher order is reported."""
        found = []
        for key, at_index, flag in ((spring, i, "spring"), (damper, j, "damper")):
            active = not self.off(flag, "passive")
            found.append(self.value(key, at_index) if active else 0.0)
            higher = getattr(self.model, f"{key}poly", None)
            if active and higher is not None and np.any(higher[at_index]):
                word = key.partition("_")[2]
                more = " ".join(f"{x:g}" for x in higher[at_index])
                text = f"the {word} would change with the deflection or speed; its first number is used alone"
                self.dropped(at, text, f"{called} {word} {found[-1]:g} {more}")
        return found[0], found[1]

    def tendon(self, i: int) -> None:
        """A tendon between two sites is a spring; others are reported."""
        m, site = self.model, self.mujoco.mjtWrap.mjWRAP_SITE
        first, count = int(m.tendon_adr[i]), int(m.tendon_num[i])
        name, rest = self.name("tendon", i), m.tendon_lengthspring[i]
        at, called = self.at("spatial", "fixed", name=name), f'tendon "{name}"'
        stiffness, damping = self.law(called, at, "tendon_stiffness", i, "tendon_damping", i)
        if m.tendon_limited[i] and not self.off("limit", "constraint"):
            low, high = m.tendon_range[i]
            self.dropped(at, ROPE, f"{called} range {low:g} to {high:g}", "bounds")
        if m.tendon_frictionloss[i] != 0.0 and not self.off("frictionloss", "constraint"):
            self.dropped(at, FRICTION, f"{called} frictionloss {m.tendon_frictionloss[i]:g}")
        if (rotor := self.value("tendon_armature", i)) != 0.0:
            self.dropped(at, ROTOR, f"{called} armature {rotor:g}")
        if stiffness != 0.0 and (bound := self.value("tendon_springyield", i)) != 0.0:
            self.dropped(at, YIELD, f"{called} springyield {bound:g}")
        if stiffness == 0.0 and damping == 0.0:
            self.dropped(at, "without stiffness and damping it only guides or measures", called, "other")
            return
        ends = m.wrap_objid[first : first + count]
        straight = count == 2 and all(m.wrap_type[first : first + 2] == site)
        if not straight or rest[0] != rest[1] or m.site_bodyid[ends[0]] == m.site_bodyid[ends[1]]:
            law = f"stiffness {stiffness:g}, damping {damping:g}, springlength {rest[0]:g} {rest[1]:g}"
            self.dropped(at, TENDON, f"{self.described(at, called)}: {law}, {count} points or joints")
            return
        one, other = ((self.link(int(m.site_bodyid[end])), m.site_pos[end].copy()) for end in ends)
        self.made.springs.append(Spring(name, one, other, stiffness, damping, float(rest[0])))
        self.remark(self.made.reading.used, at, "a spring between two points", called)

    def equalities(self) -> None:
        m, kinds, robot = self.model, self.mujoco.mjtEq, self.made
        connects: dict[tuple[str, str], list[_Held]] = {}
        for i in range(m.neq):
            name, kind = self.name("equality", i), int(m.eq_type[i])
            tags = {kinds.mjEQ_CONNECT: "connect", kinds.mjEQ_WELD: "weld", kinds.mjEQ_JOINT: "joint"}
            at = self.at(*([tags[kind]] if kind in tags else ["tendon", "flex", "flexvert", "flexstrain"]), name=name)
            if not m.eq_active0[i] or self.off("equality", "constraint"):
                text = "not active in the file, so it holds nothing"
                self.remark(robot.reading.changed, at, text, self.described(at, f'equality "{name}"'))
            elif kind == kinds.mjEQ_JOINT:
                self.tie(i, name, at)
            elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
                first, second = self.frames(i, kind == kinds.mjEQ_WELD)
                if kind == kinds.mjEQ_WELD:
                    robot.loops.append(Loop(name, "fixed", first, second, at))
                else:
                    pair = connects.setdefault((first[0], second[0]), [])
                    pair.append(_Held(name, (first[1][:3, 3], second[1][:3, 3]), at))
            else:
                text = "tendons or flexible bodies would depend on each other"
                self.dropped(at, text, self.described(at, f'equality "{name}"'))
        for bodies, held in connects.items():
            self.connect(bodies, held)

    def ends(self) -> None:
        """Sites that are named as ends of loops, where no equality holds their bodies together: reported as open."""
        m, site = self.model, self.mujoco.mjtObj.mjOBJ_SITE
        held = {frozenset((loop.first[0], loop.second[0])) for loop in self.made.loops}
        named: dict[str, tuple[str, Array]] = {}
        for i in range(m.nsite):
            name = self.mujoco.mj_id2name(m, site, i)
            if name and closings.is_closing(name):
                named[name] = self.link(int(m.site_bodyid[i])), placed(m.site_pos[i], np.eye(3))
        for pair in closings.named(self.made, named).values():
            if frozenset(named[name][0] for name in pair) not in held:
                self.made.frames.update((name, named[name]) for name in pair)

    def described(self, at: Element, called: str) -> str:
        """An element as the file has it."""
        return called if at is self.root else content(at)

    def frames(self, i: int, weld: bool) -> tuple[tuple[str, Array], tuple[str, Array]]:
        """The two frames of a connect or a weld, each with its body."""
        m, data = self.model, self.model.eq_data[i]
        one, other = int(m.eq_obj1id[i]), int(m.eq_obj2id[i])
        if m.eq_objtype[i] == self.mujoco.mjtObj.mjOBJ_SITE:
            sites = [
                (int(m.site_bodyid[s]), placed(m.site_pos[s], rotation_of(m.site_quat[s]) if weld else np.eye(3)))
                for s in (one, other)
            ]
            return (self.link(sites[0][0]), sites[0][1]), (self.link(sites[1][0]), sites[1][1])
        if weld:
            here, there = placed(data[3:6], rotation_of(data[6:10])), placed(data[0:3], np.eye(3))
        else:
            here, there = placed(data[0:3], np.eye(3)), placed(data[3:6], np.eye(3))
        return (self.link(one), here), (self.link(other), there)

    def link(self, i: int) -> str:
        return "world" if i == 0 else self.name("body", i)

    def connect(self, bodies: tuple[str, str], held: list[_Held]) -> None:
        """Points of two bodies joined together: one is a ball joint, two are a hinge, three are a weld."""
        robot, first = self.made, held[0]
        apart = np.array([x.points[0] - first.points[0] for x in held])
        size = float(np.max(np.linalg.norm(apart, axis=1)))
        count = int(np.sum(np.linalg.svd(apart, compute_uv=False) > EQUAL_IN_SIX_DIGITS * size)) if size > 0.0 else 0
        far = held[int(np.argmax(np.linalg.norm(apart, axis=1)))]
        frames = []
        for side in (0, 1):
            axis, beside = far.points[side] - first.points[side], None
            if count > 1:
                others = [x.points[side] - first.points[side] for x in held]
                beside = others[int(np.argmax([norm(np.cross(axis, other)) for other in others]))]
            frames.append(placed(first.points[side], _along(axis, beside) if count else np.eye(3)))
        kind = ("spherical", "revolute", "fixed")[min(count, 2)]
        ends = ((bodies[0], frames[0]), (bodies[1], frames[1]))
        robot.loops.append(Loop(first.name, kind, ends[0], ends[1], first.at, np.array([1.0, 0.0, 0.0])))
        if count:
            names, what = " and ".join(x.name for x in held), ("", "a line: a hinge", "a plane: a weld")[min(count, 2)]
            self.remark(robot.reading.changed, first.at, f"{names} join points of {what}, {first.name}")

    def tie(self, i: int, name: str, at: Element) -> None:
        """A joint that follows another one: y = a0 + a1 x + ..., both relative to the drawn position."""
        m, robot = self.model, self.made
        one, other, data = int(m.eq_obj1id[i]), int(m.eq_obj2id[i]), m.eq_data[i]
        follower = self.name("joint", one)
        if np.any(data[2:5]):
            self.dropped(at, HIGHER, self.described(at, f'equality "{name}"'))
        elif other < 0 or data[1] == 0.0:
            text = f'joint "{follower}" would stay at {data[0]:g}: add_drive'
            self.dropped(at, text, self.described(at, f'equality "{name}"'))
        else:
            leader = self.name("joint", other)
            robot.ties.append(Tie(name, [follower, leader], [1.0, -float(data[1])], float(data[0]), at))


def _along(axis: Array, beside: Array | None = None) -> Array:
    """A rotation whose x is along an axis, and whose y is towards another direction."""
    x = axis / norm(axis)
    other = np.eye(3)[int(np.argmin(np.abs(x)))] if beside is None else beside
    z = np.cross(x, other)
    z /= norm(z)
    return np.column_stack([x, np.cross(z, x), z])
