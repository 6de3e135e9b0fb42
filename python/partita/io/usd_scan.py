"""What USD would compose of a file, found before it does: nesting, prims, and the arcs that multiply them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..limits import exceeded, limit
from .xmltree import refuse

_APART = re.compile(rb'#[^\n]*|"""(?:[^"\\]|\\.|"(?!""))*"""|\'\'\'(?:[^\'\\]|\\.|\'(?!\'\'))*\'\'\'|'
                    rb'"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)*\'|@@@.*?@@@|@[^@\n]*@', re.DOTALL)  # fmt: skip
"""Comments, texts and names of files, in which brackets have no meaning."""
_OPEN, _CLOSE = b"([{", b")]}"
_PIECE = 2**20
_FEW = 64
_OTHERS = bytes(sorted(set(range(256)) - {*_OPEN, *_CLOSE}))


def check_text(content: bytes) -> str | None:
    """The sentence that refuses a text layer by its nesting, or by its texts; else None."""
    deepest, depth, at, most = 0, 0, 0, limit("texts")
    for number, apart in enumerate(_APART.finditer(content)):
        if number >= most and (words := exceeded("texts", number + 1)) is not None:
            return f"has {words}"
        if apart.start() > at:
            depth, deepest = _nested(content[at : apart.start()], depth, deepest)
        at = apart.end()
    while at < len(content):
        depth, deepest = _nested(content[at : at + _PIECE], depth, deepest)
        at += _PIECE
    return None if (words := exceeded("depth", deepest)) is None else f"nests {words}"


def _nested(piece: bytes, depth: int, deepest: int) -> tuple[int, int]:
    """Depth at the end of a piece, and the greatest up to there."""
    brackets = piece.translate(None, _OTHERS)
    if len(brackets) < _FEW:
        for bracket in brackets:
            depth += 1 if bracket in _OPEN else -1
            deepest = max(deepest, depth)
        return depth, deepest
    steps = np.where(np.isin(np.frombuffer(brackets, dtype=np.uint8), list(_OPEN)), 1, -1)
    levels = depth + np.cumsum(steps)
    return int(levels[-1]), max(deepest, int(levels.max()))


@dataclass
class _Spec:
    """What a layer states about a prim: names of children, and where arcs lead, as layer and path."""

    children: list[str] = field(default_factory=list)
    arcs: list[tuple[str, str]] = field(default_factory=list)


Site = tuple[str, str]
"""A layer and a path in it, with its sublayers."""


class Scan:
    """The prims of a stage, counted by the rules of composition with all variants at once."""

    def __init__(self, layers: dict[str, Any], model: Path) -> None:
        self.layers, self.model = layers, model
        self.own: dict[str, dict[str, _Spec]] = {}
        self.stacks: dict[str, dict[str, _Spec]] = {}
        self.resolved: dict[Site, tuple[Site, ...]] = {}
        self.composed = self.stated = 0

    def check(self, root: str) -> None:
        """Refuse a stage of more prims or arcs than the limits allow."""
        most = limit("prims")
        prims, waiting = 0, [self.closed([(root, "")])]
        while waiting:
            sites = waiting.pop()
            for name in self.names(sites):
                prims += 1
                if prims > most:
                    refuse(self.model, None, f"composed, it has {exceeded('prims', prims)}")
                waiting.append(self.below(sites, name))

    def names(self, sites: tuple[Site, ...]) -> Iterator[str]:
        """Children of a prim with these sites."""
        found = (self.spec(site) for site in sites)
        return iter(dict.fromkeys(name for spec in found if spec is not None for name in spec.children))

    def below(self, sites: tuple[Site, ...], name: str) -> tuple[Site, ...]:
        """The sites of a child."""
        return self.closed([(layer, f"{path}/{name}") for layer, path in sites])

    def closed(self, begin: list[Site]) -> tuple[Site, ...]:
        """These sites, as far as a layer states something there, and all to which their arcs lead."""
        found: dict[Site, None] = {}
        waiting = begin[::-1]
        while waiting:
            site = waiting.pop()
            if site in found or (spec := self.spec(site)) is None:
                continue
            found[site] = None
            for arc in reversed(spec.arcs):
                waiting += self.target(arc)
        self.count(len(found) - 1)
        return tuple(found)

    def target(self, arc: Site) -> tuple[Site, ...]:
        """The sites of the prim to which an arc leads, with what arcs of its ancestors bring."""
        if arc not in self.resolved:
            self.resolved[arc] = (arc,)  # circular arcs, which USD refuses
            layer, path = arc
            above = path.rpartition("/")[0]
            if above:
                around: list[Site] = [(layer, "")]
                for name in above.split("/")[1:]:
                    around = [
                        (on, f"{to}/{name}") for one in around for on, to in (one, *self.inherited(one)) if to != path
                    ]
                    self.count(len(around) - 1)
                found = dict.fromkeys([arc, *((on, f"{to}/{path.rpartition('/')[2]}") for on, to in around)])
                self.resolved[arc] = tuple(found)
        return self.resolved[arc]

    def inherited(self, site: Site) -> list[Site]:
        """Where the arcs of a site lead."""
        spec = self.spec(site)
        return [] if spec is None else spec.arcs

    def count(self, more: int) -> None:
        """Add nodes of the composition."""
        self.composed += max(more, 0)
        if (
            words := exceeded("composed", self.composed, "prims by references, payloads, inherits and variants")
        ) is not None:
            refuse(self.model, None, f"its layers compose {words}")

    def spec(self, site: Site) -> _Spec | None:
        """What is stated at a site."""
        layer, path = site
        if layer not in self.stacks:
            self.stacks[layer] = self.stack(layer)
        return self.stacks[layer].get(path)

    def stack(self, layer: str) -> dict[str, _Spec]:
        """A layer and its sublayers as one."""
        found: dict[str, _Spec] = {}
        waiting, seen = [layer], set[str]()
        while waiting:
            one = waiting.pop()
            if one in seen or one not in self.layers:
                continue
            seen.add(one)
            waiting += [self.layers[one].ComputeAbsolutePath(name) for name in self.layers[one].subLayerPaths]
            for path, spec in self.specs(one).items():
                own = found.setdefault(path, _Spec())
                own.children += spec.children
                # an arc within a layer leads to all layers above it too
                own.arcs += [(layer if on == one else on, to) for on, to in spec.arcs]
            if one != layer:
                self.count(len(found))
        return found

    def specs(self, name: str) -> dict[str, _Spec]:
        """What one layer states, by paths without variants."""
        if name in self.own:
            return self.own[name]
        layer = self.layers[name]
        found = {"": _Spec([str(child.name) for child in layer.rootPrims])}
        waiting = [(child, f"/{child.name}") for child in layer.rootPrims]
        while waiting:
            prim, path = waiting.pop()
            self.stated += 1
            if (words := exceeded("prims", self.stated)) is not None:
                refuse(self.model, None, f"it has {words}")
            spec = found.setdefault(path, _Spec())
            spec.arcs += self.arcs(name, layer, prim)
            if prim.HasInfo("variantSetNames"):
                waiting += [(one.primSpec, path) for of in prim.variantSets.values() for one in of.variants.values()]
            for child in prim.nameChildren:
                spec.children.append(str(child.name))
                waiting.append((child, f"{path}/{child.name}"))
        self.own[name] = found
        return found

    def arcs(self, name: str, layer: Any, prim: Any) -> Iterator[Site]:
        """Where the arcs of a prim lead."""
        for key, items in (("references", "referenceList"), ("payload", "payloadList")):
            for item in getattr(prim, items).GetAddedOrExplicitItems() if prim.HasInfo(key) else ():
                to = layer.ComputeAbsolutePath(item.assetPath) if item.assetPath else name
                path = str(item.primPath) if item.primPath else f"/{self._default(to)}"
                yield to, path
        for key, items in (("inheritPaths", "inheritPathList"), ("specializes", "specializesList")):
            for item in getattr(prim, items).GetAddedOrExplicitItems() if prim.HasInfo(key) else ():
                yield name, str(item.MakeAbsolutePath(prim.path).StripAllVariantSelections())

    def _default(self, layer: str) -> str:
        """The prim to which an arc leads that names none."""
        return str(self.layers[layer].defaultPrim).removeprefix("/") if layer in self.layers else ""
