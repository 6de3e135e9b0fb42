"""A USD stage as a tree of prims, composed of all its layers, with the values at its first time.

Every layer that a stage names is looked for before USD opens anything: in the folder of the model or below the root
that the caller names. What USD would print is a remark, or refuses the file.
"""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from ..extras import extra
from ..files import get, other
from ..limits import exceeded, limit
from .format_table import APPLIED, COMPILED, DROPPED, LOOKS, NO_EFFECT
from .reading import Reading, Remark
from .request import Request
from .robot import Array
from .usd_scan import Scan, check_text
from .usd_table import OWN, USD
from .xmltree import Element, refuse

SUFFIXES = (".usda", ".usd", ".usdc")
_HEADERS = (b"#usda ", b"#sdf ", b"PXR-USDC")
_BINARY = _HEADERS[2]
_PATIENCE = 60.0
"""USD may take this long to read one layer. Scale: s on the clock. Reason: sixty times what a large one takes, on a
busy machine."""
_EFFORT = 5
_PER_BYTE = 4e-7
"""Processor time that USD may take for each byte, beside `_EFFORT` seconds for its imports. Scale: s. Reason: ten
times the usual."""
_ROOM, _ROOM_PER_BYTE = 10**9, 100
"""Bytes of memory in the same way."""
_ALONE = """
import json, os, sys
out = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
try:
    import resource
except ImportError:
    resource = None
from pxr import Sdf

def bound(kind, most):
    hard = resource.getrlimit(kind)[1]
    resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))

for line in sys.stdin:
    path, effort, room, binary = json.loads(line)
    if resource is not None:
        used = resource.getrusage(resource.RUSAGE_SELF)
        bound(resource.RLIMIT_CPU, int(used.ru_utime + used.ru_stime + effort))
        bound(resource.RLIMIT_DATA, room)
    try:
        layer = Sdf.Layer.FindOrOpen(path)
        if layer and binary:
            layer.ExportToString()
    except MemoryError:
        raise
    except Exception:
        pass  # reported where it is read in earnest
    layer = None
    print("read", file=out, flush=True)
"""
_LETTERS = 400
"""Of a sentence of USD in an error."""
_SHOWN = 3
"""Sentences of USD in an error; the first ones name the cause."""
_AT = re.compile(r"(.*?):(\d+):\d+: ")
"""Where something is wrong in a text, as USD says it."""
_SINGLE = re.compile(r"float|Vec\df|Quatf|Matrix\df")
"""Types of C++ that have single precision."""
_PLAIN = ("Usd", "UsdGeom", "UsdPhysics", "UsdShade", "UsdUtils", "Sdf", "Tf")
_OWNERS = {
    "physxJoint": "PhysxJointAPI",
    "physxRigidBody": "PhysxRigidBodyAPI",
    "physxArticulation": "PhysxArticulationAPI",
    "physxScene": "PhysxSceneAPI",
    "physxMaterial": "PhysxMaterialAPI",
    "physxCollision": "PhysxCollisionAPI",
}
"""Schemas by the first word of their attributes, of those that USD itself does not know; each instance of a schema has
its name as the second word."""
_CONTACT = ("PhysicsCollisionAPI", "PhysicsMeshCollisionAPI")
"""Schemas on which no motion depends where they are not applied."""
_INSTANCES = {"drive": "PhysicsDriveAPI", "limit": "PhysicsLimitAPI", "physxMimicJoint": "PhysxMimicJointAPI"}


@dataclass
class Prim(Element):
    """A prim; `attributes` has as text what `values` has, and is what the table says that is applied."""

    values: dict[str, Any] = field(default_factory=dict)
    world: Array = field(default_factory=lambda: np.eye(4))
    handle: Any = None

    def value(self, key: str) -> Any:
        """The value of an attribute, or None."""
        return self.values.get(key) if key in self.attributes else None

    def real(self, key: str, otherwise: float) -> float:
        """A number, which may be infinite."""
        return float(self.reals(key, (otherwise,))[0])

    def reals(self, key: str, otherwise: Any) -> Array:
        """Numbers, which may be infinite."""
        given = self.value(key)
        if given is None:
            return np.array(otherwise, dtype=float)
        try:
            found = np.array(given, dtype=float).reshape(-1)
        except (TypeError, ValueError):
            found = np.array([np.nan])
        if found.shape != (len(otherwise),) or np.any(np.isnan(found)):
            many = f"{len(otherwise)} numbers" if len(otherwise) > 1 else "a number"
            self.fail(f"has {key} {text(given)}; it takes {many}")
        return found

    def finite(self, key: str, otherwise: Any) -> Array:
        """Finite numbers."""
        found = self.reals(key, otherwise)
        if not np.all(np.isfinite(found)):
            self.fail(f"has {key} {text(self.value(key))}; it takes finite numbers")
        return found

    def flag(self, key: str, otherwise: bool) -> bool:
        """True or false."""
        given = self.value(key)
        return otherwise if given is None else bool(given)

    def has(self, schema: str) -> bool:
        """Whether a schema is applied."""
        return schema in self.attributes

    def fail(self, message: str) -> NoReturn:
        """Refuse the file because of this prim."""
        called = f'{self.tag} "{self.get("name")}"' if self.get("name") else "the stage"
        refuse(self.path, None, f"{called} {message}")


@dataclass
class Stage:
    """The tree of prims, and USD itself. Handles of prims are valid as long as the stage is there."""

    root: Prim
    usd: Any
    handle: Any
    prims: dict[str, Prim]


class _Usd:
    """The modules of USD that are used."""

    def __init__(self) -> None:
        for name in _PLAIN:
            setattr(self, name, extra(f"pxr.{name}", "usd", "reading USD"))

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name)


def text(value: Any) -> str:
    """A value as it stands in remarks; single precision has seven digits."""
    if isinstance(value, bool | str):
        return str(value)
    if isinstance(value, int | float):
        return f"{value:.9g}" if float(np.float32(value)) != value else f"{value:.7g}"
    if isinstance(value, dict):
        return f"{len(value)} keys"
    try:
        items = np.array(value, dtype=float).reshape(-1)
    except (TypeError, ValueError):
        return str(value)
    return " ".join(map(text, items.tolist())) if items.size <= 16 else f"{items.size} numbers"


@contextmanager
def opened(path: Path, request: Request, reading: Reading) -> Iterator[Stage]:
    """The stage in a file, as long as it is read. Raises `FileFormatError`."""
    _checked(path, path)
    usd = _Usd()
    with _heard(usd, path, reading):
        with _Apart(path) as apart:
            kept = [*_layers(usd, _absolute(path), request, reading, apart)]
        Scan({layer.realPath or layer.identifier: layer for layer in kept}, path).check(kept[0].realPath)
        stage = usd.Usd.Stage.Open(kept[0], None)
        if stage is None:
            refuse(path, None, "USD cannot open it")
        errors = [" ".join(str(error).split()) for error in stage.GetCompositionErrors()]
        if errors:
            refuse(path, None, f"its layers do not fit together: {'; '.join(errors[:_SHOWN])}")
        yield _Tree(usd, stage, path, reading).grown()


def _absolute(path: Path) -> Path:
    """The path by which USD knows a layer; what it names lies beside it, though it may be a link itself."""
    return path.parent.resolve() / path.name


def _checked(path: Path, model: Path) -> bytes:
    """The first bytes of a layer; refuses what is not USD by its size and these."""
    content = get(path, "layer_bytes")
    called = "it" if path == model else f"its layer {path.name}"
    if not content.strip():
        refuse(model, None, f"{called} is empty")
    if (kind := other(content)) is not None:
        refuse(model, None, kind if path == model else f"{called}: {kind}")
    if not content.startswith(_HEADERS):
        refuse(model, None, f"{called} is neither text nor binary USD: it begins with {content[:12]!r}")
    if not content.startswith(_BINARY) and (words := check_text(content)) is not None:
        refuse(model, None, f"{called} {words}")
    return content[: len(_BINARY)]


class _Apart:
    """Another process, which reads each layer before this one does: on some files USD ends its process, or hangs."""

    def __init__(self, model: Path) -> None:
        self.model, self.late = model, False
        self.process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> _Apart:
        program = Path(sys.executable or "")
        if program.name.lower().startswith("python"):  # else it is within another program
            self.process = subprocess.Popen(
                [str(program), "-c", _ALONE],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        return self

    def __exit__(self, *ended: object) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.communicate()

    def survived(self, path: Path, size: int, binary: bool) -> None:
        """Refuse a file that breaks it."""
        if self.process is None or self.process.stdin is None or self.process.stdout is None:
            return
        asked = [str(path), _EFFORT + _PER_BYTE * size, int(_ROOM + _ROOM_PER_BYTE * size), binary]
        clock = threading.Timer(_PATIENCE, self._kill)
        clock.start()
        try:
            with suppress(BrokenPipeError):
                self.process.stdin.write(json.dumps(asked).encode() + b"\n")
                self.process.stdin.flush()
            answered = bool(self.process.stdout.readline())
        finally:
            clock.cancel()
        if answered:
            return
        code = self.process.wait()
        if self.late or code == -getattr(signal, "SIGXCPU", 0):
            refuse(self.model, None, f"USD does not end reading {path.name}, within {_PATIENCE:g} s: it is damaged")
        refuse(self.model, None, f"USD breaks down reading {path.name}: the file is damaged, or too large")

    def _kill(self) -> None:
        self.late = True
        if self.process is not None:
            self.process.kill()


@contextmanager
def _heard(usd: Any, path: Path, reading: Reading) -> Iterator[None]:
    """What USD would print or raise: a remark, or a refusal."""
    delegate = usd.UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    except usd.Tf.ErrorException as error:
        words = _messages(error)
        at = _AT.match(words[0])
        line = int(at[2]) if at is not None and at[1] == str(_absolute(path)) else None
        words[0] = words[0][at.end() :] if at is not None and line is not None else words[0]
        refuse(path, line, f"USD cannot read it: {'; '.join(words[:_SHOWN])}")
    finally:
        for one in delegate.TakeUncoalescedDiagnostics():
            with suppress(UnicodeDecodeError):
                reading.changed.append(Remark(None, f"USD says: {' '.join(one.commentary[:_LETTERS].split())}"))
        del delegate


def _messages(error: Any) -> list[str]:
    """What USD says of an error: text of the file may be in it, of any length and in no encoding."""
    try:
        words = [str(one.commentary) for one in error.args] or [str(error)]
    except UnicodeDecodeError:
        words = ["it contains text that is not UTF-8"]
    return [" ".join(one[:_LETTERS].split()) for one in words]


def _layers(usd: Any, first: Path, request: Request, reading: Reading, apart: _Apart) -> Iterator[Any]:
    """The layers of a stage, each opened when it is known where it lies; the first one is the root."""
    waiting, seen, model = [first], {first}, reading.path
    while waiting:
        path = waiting.pop()
        apart.survived(path, path.stat().st_size, _checked(path, model).startswith(_BINARY))
        layer = _as_stored(usd, path, reading)
        if layer is None:
            refuse(model, None, f"USD cannot open {path.name}")
        yield layer
        for asked in layer.GetCompositionAssetDependencies():
            name, _ = usd.Sdf.Layer.SplitIdentifier(asked)
            if not name:
                continue  # another prim of the same layer
            called = f'the layer "{name}", which {path.name} names,'
            if Path(name).suffix.lower() not in SUFFIXES:
                refuse(model, None, f"{called} is not read: read are {', '.join(SUFFIXES)}")
            found, why = request.found(path, name)
            if found is None or not found.is_file():
                refuse(model, None, f"{called} is not read: {why or 'it is a folder'}")
            if found not in seen:
                seen.add(found)
                waiting.append(found)
            if (words := exceeded("files", len(seen))) is not None:
                refuse(model, None, f"it is made of {words}")


def _as_stored(usd: Any, path: Path, reading: Reading) -> Any:
    """A layer as it is on disk, though USD shares with all of a process what was opened before."""
    layer = usd.Sdf.Layer.Find(str(path))
    if layer is None:
        return usd.Sdf.Layer.FindOrOpen(str(path))
    if layer.dirty:
        words = f"{path.name} is open in this process with changes that are not stored; they are read"
        reading.changed.append(Remark(None, words))
    else:
        layer.Reload(True)
    return layer


class _Tree:
    """The prims of a stage."""

    def __init__(self, usd: Any, stage: Any, path: Path, reading: Reading) -> None:
        self.usd, self.stage, self.path, self.reading = usd, stage, path, reading
        self.time = usd.Usd.TimeCode.EarliestTime()
        self.transforms = usd.UsdGeom.XformCache(self.time)
        self.registry = usd.Usd.SchemaRegistry()
        self.prims: dict[str, Prim] = {}
        items = [item for found in USD.contexts.values() for item in found]
        self.named = {item.name.removeprefix("@") for item in items}
        self.acting = {item.name.removeprefix("@") for item in items if item.rule in (APPLIED, COMPILED)}
        self.silent = {item.name.removeprefix("@") for item in items if item.rule in (LOOKS, NO_EFFECT)}
        self.owners = {
            key: schema
            for schema in self.named
            if schema.startswith("Physics") and (found := self.registry.FindAppliedAPIPrimDefinition(schema))
            for key in found.GetPropertyNames()
        }
        self.plain = set(self.registry.FindAppliedAPIPrimDefinition("PhysicsRigidBodyAPI").GetPropertyNames())

    def grown(self) -> Stage:
        """The tree, as deep as the limits allow."""
        pseudo = self.stage.GetPseudoRoot()
        root = Prim("stage", {}, None, self.path)
        layer = self.stage.GetRootLayer().pseudoRoot
        for key in layer.ListInfoKeys():
            try:
                root.values[key] = layer.GetInfo(key)
            except TypeError:  # offsets of layers have no form in Python
                root.values[key] = ""
            root.attributes[key] = text(root.values[key])
        every = self.usd.Usd.TraverseInstanceProxies(self.usd.Usd.PrimAllPrimsPredicate)
        waiting, deepest = [(pseudo, root, 0)], limit("depth")
        while waiting:
            handle, prim, depth = waiting.pop()
            if depth > deepest:
                prim.fail(f"is nested {exceeded('depth', depth)}")
            if (words := exceeded("prims", len(self.prims))) is not None:
                refuse(self.path, None, f"it has {words}")
            for child in handle.GetFilteredChildren(every):
                if not child.IsAbstract() and self.is_part(child):
                    inner = self.prim(child)
                    prim.children.append(inner)
                    waiting.append((child, inner, depth + 1))
        return Stage(root, self.usd, self.stage, self.prims)

    def is_part(self, handle: Any) -> bool:
        """Whether a prim is a part of the scene; one that is not is reported."""
        if handle.IsActive() and handle.IsDefined():
            return True
        why = "not active in the file" if not handle.IsActive() else "only changes a prim that is not there"
        self.reading.changed.append(
            Remark(None, f"{why}, so it is left out", f'{handle.GetTypeName() or "Prim"} "{handle.GetPath()}"')
        )
        return False

    def prim(self, handle: Any) -> Prim:
        """A prim with what it says itself."""
        kind, name = str(handle.GetTypeName()), str(handle.GetPath())
        tag = kind if kind in self.named else "Prim"
        if kind and tag == "Prim" and not self.registry.FindConcretePrimDefinition(kind):
            self.reading.dropped.append(
                Remark(None, "a type not known to USD; what is inside is read", f'{kind} "{name}"', "unknown")
            )
        found = Prim(tag, {"name": name}, None, self.path, handle=handle)
        try:
            found.world = np.array(self.transforms.GetLocalToWorldTransform(handle)).T
        except self.usd.Tf.ErrorException as error:
            found.fail(f"has transforms that USD cannot read: {_messages(error)[0]}")
        if any(handle.HasAuthoredMetadata(key) for key in ("clips", "clipSets")):
            found.fail("has value clips, which are not read: they may open any file")
        applied = {str(x) for x in (*handle.GetAppliedSchemas(), *handle.GetPrimTypeInfo().GetAppliedAPISchemas())}
        for schema in sorted(applied):
            family = schema.partition(":")[0]
            if schema in self.named or not self.registry.FindAppliedAPIPrimDefinition(family):
                found.attributes[schema] = ""
        own = set(handle.GetPrimDefinition().GetPropertyNames())
        for item in handle.GetAuthoredProperties():
            self.property(found, item, applied, own)
        self.prims[name] = found
        return found

    def property(self, prim: Prim, item: Any, applied: set[str], own: set[str]) -> None:
        """One attribute or relationship."""
        key = str(item.GetName())
        if key in own and key not in self.named:
            return  # of a schema that says nothing of mechanics
        if isinstance(item, self.usd.Usd.Relationship):
            value: Any = [str(path) for path in item.GetForwardedTargets()]
            prim.values[key], prim.attributes[key] = value, ", ".join(value)
        else:
            value = item.Get(self.time)
            if value is None:
                return
            many = hasattr(value, "__len__") and not isinstance(value, str) and len(value) > 16
            single = _SINGLE.search(str(item.GetTypeName().cppTypeName)) is not None
            prim.values[key] = value if many else plain(value, single)
            prim.attributes[key] = f"{len(value)} values" if many else text(prim.values[key])
            if item.ValueMightBeTimeVarying() and not self.looks(key):
                words = "it changes with time in the file; its first value is used"
                self.reading.dropped.append(Remark(None, words, f'{prim.tag} "{prim.get("name")}" {key}'))
        owner = self.owner(key)
        if owner and owner not in applied and key not in own:
            known = USD.items("any").get(prim.tag)
            item = USD.items("prim" if known is None else known.context).get(f"@{key}")
            acts = item is not None and item.rule in (APPLIED, COMPILED, DROPPED) and owner not in _CONTACT
            moves = acts and item is not None and not item.is_default(prim.attributes[key])
            words = f"without {owner}, which is not applied here, it means nothing to USD"
            name = f'{prim.tag} "{prim.get("name")}" {key} {prim.attributes[key]}'
            self.reading.dropped.append(Remark(None, words, name, "motion" if moves else "other"))
            del prim.attributes[key]

    def looks(self, key: str) -> bool:
        """Whether a change of this moves nothing."""
        return key in self.silent or f"{key.partition(':')[0]}:" in self.silent

    def owner(self, key: str) -> str:
        """The schema that gives an attribute its meaning, where it is one that must be applied."""
        first, _, rest = key.partition(":")
        if first in _INSTANCES:
            return f"{_INSTANCES[first]}:{rest.partition(':')[0]}"
        return self.owners.get(key, _OWNERS.get(first, ""))


def plain(value: Any, single: bool) -> Any:
    """A value of USD as numbers or text. A quaternion has its real part first."""
    if isinstance(value, bool | str):
        return value
    if isinstance(value, int | float):
        return decimal(value) if single else value
    if hasattr(value, "imaginary"):
        value = [value.real, *value.imaginary]
    try:
        found = np.array(value, dtype=float)
    except (TypeError, ValueError):
        return str(value)
    return np.vectorize(decimal, otypes=[float])(found).tolist() if single else found.tolist()


def decimal(value: float) -> float:
    """The number with the fewest digits that is this one in single precision: what a text had in seven digits."""
    return float(str(np.float32(value)))


def own(key: str) -> str:
    """Its name."""
    return f"{OWN}:{key.rpartition(':')[2]}"
