"""Files with one element or attribute more or less, or another number: nothing may be ignored in silence.

`python tests/python/mutations.py` makes every change of every file in `format_files`. Of what is added, which no format
knows, a reader must say something, or refuse the file; of what is taken away either the model changes, or what is said
of it, unless the format's table says that nothing depends on it or that its default was written there. A number that is
applied, made another one, changes the model or what is said.
"""

from __future__ import annotations

import copy
import json
import shutil
import sys
import tempfile
import warnings
import xml.etree.ElementTree as ET
import xml.parsers.expat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import partita as pt
from partita.io import format_table, mjcf_table, sdf_table, urdf_table
from partita.io.format_table import APPLIED, COMPILED, LOOKS, NO_EFFECT, Item, Table

FILES = Path(__file__).parent / "format_files"
TABLES = {".urdf": urdf_table.URDF, ".sdf": sdf_table.SDF, ".mjcf": mjcf_table.MJCF, ".xml": mjcf_table.MJCF}
WALKED = (APPLIED, COMPILED, LOOKS)
"""Rules of elements that are described by their contexts."""
UNKNOWN = "unheard_of"
WITH = {"included.xml": "machine.mjcf", "part.xml": "machine.mjcf", "part.sdf": "nested-1.12.sdf"}
"""Files that are read with another one."""
WITHIN = {"disabled.mjcf": "option", "unconstrained.mjcf": "option", "compiler.mjcf": "compiler"}
"""Files of which one element is changed: it disables or replaces what the others say."""


@dataclass
class Described:
    """An element of a file: its number in the order of the file, and the items of the table on the way to it."""

    number: int
    element: ET.Element
    items: dict[str, Item]
    covered: bool

    def item(self, name: str) -> Item | None:
        return self.items.get(name)


@dataclass(frozen=True)
class Mutation:
    """A change of a file at one element."""

    file: str
    number: int
    verb: str
    name: str = ""

    def __str__(self) -> str:
        return f"{self.file}: {self.verb} {self.name} at element {self.number}"


def parsed(path: Path) -> ET.Element:
    """The root of a file, its names as they are written: namespaces are no matter of these formats."""
    builder, parser = ET.TreeBuilder(), xml.parsers.expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler = builder.data
    parser.Parse(path.read_bytes(), True)
    return builder.close()


def described(path: Path) -> list[Described]:
    """All elements of a file."""
    root = parsed(path)
    table, version = TABLES[path.suffix], format_table.number(root.get("version", "") if path.suffix == ".sdf" else "")
    found: list[Described] = []

    def descend(element: ET.Element, context: str, covered: bool) -> None:
        items = {} if covered else dict(table.items(context, element.get("type", ""), version or None))
        found.append(Described(len(found), element, items, covered))
        for child in element:
            item = items.get(child.tag)
            inside = item is not None and item.rule in WALKED and item.context in table.contexts
            # what is not walked is reported or refused as a whole, or nothing depends on it
            silent = item is not None and item.rule in (LOOKS, NO_EFFECT) and not inside
            descend(child, item.context if inside and item else "", covered or silent)

    descend(root, table.root, False)
    return found


def mutations(path: Path) -> Iterator[Mutation]:
    """Every change of a file of which something must be heard."""
    found = described(path)
    within = next((x for x in found if x.element.tag == WITHIN.get(path.name)), found[0])
    chosen = set(map(id, within.element.iter()))
    above = {id(child): one for one in found for child in one.element}
    for one in found:
        if one.covered or id(one.element) not in chosen:
            continue
        yield Mutation(path.name, one.number, "add element")
        yield Mutation(path.name, one.number, "add attribute")
        texts = {"#": one.element.text or "", **{f"@{key}": value for key, value in one.element.attrib.items()}}
        for name, value in texts.items():
            item = one.item(name)
            if item is not None and item.rule in (APPLIED, COMPILED) and _numbers(value):
                yield Mutation(path.name, one.number, "change number", name)
        for key, value in one.element.attrib.items():
            if not key.startswith("xmlns") and not _silent(one.item(f"@{key}"), value):
                yield Mutation(path.name, one.number, "remove attribute", key)
        parent = above.get(id(one.element))
        if parent is None:
            continue
        leaf = not len(one.element) and not one.element.attrib
        if not _silent(parent.item(one.element.tag), (one.element.text or "") if leaf else "\0"):
            yield Mutation(path.name, one.number, "remove element", one.element.tag)


def _numbers(text: str) -> list[float]:
    """The numbers of a text that is made of them."""
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return []


def _changed(text: str) -> str:
    """Other numbers: an axis is turned, and what is positive stays so."""
    return " ".join(repr(1.1 * x + 0.013 * (i + 1)) for i, x in enumerate(_numbers(text)))


def _silent(item: Item | None, value: str) -> bool:
    return item is not None and (item.rule in (LOOKS, NO_EFFECT) or item.is_default(value))


def mutated(path: Path, mutation: Mutation) -> str:
    """The text of the changed file."""
    root = copy.deepcopy(parsed(path))
    elements = list(root.iter())
    element = elements[mutation.number]
    if mutation.verb == "add element":
        ET.SubElement(element, UNKNOWN)
    elif mutation.verb == "add attribute":
        element.set(UNKNOWN, "1")
    elif mutation.name == "#":
        element.text = _changed(element.text or "")
    elif mutation.verb == "change number":
        element.set(mutation.name[1:], _changed(element.attrib[mutation.name[1:]]))
    elif mutation.verb == "remove attribute":
        del element.attrib[mutation.name]
    else:
        next(parent for parent in elements if element in list(parent)).remove(element)
    return ET.tostring(root, encoding="unicode")


def heard(path: Path) -> str:
    """The model in a file with what is said of it, as text; or that it is refused."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            m = pt.load(path)
        except pt.errors.PartitaError as error:
            return f"refused: {error}"
    remarks = [(group.kind, group.text, sorted(group.names)) for group in m.remarks if group.kind != "used"]
    assert m.reading is not None
    return json.dumps([m.to_spec(), m.reading.shapes, remarks], sort_keys=True, default=lambda array: array.tolist())


def silent(files: list[Path], chosen: slice) -> tuple[int, list[str]]:
    """How many changes were made, and those of which nothing is heard."""
    asked, found = 0, []
    with tempfile.TemporaryDirectory() as folder:
        copied = Path(folder) / "files"
        shutil.copytree(FILES, copied)
        before = {
            name: heard(copied / name) for name in dict.fromkeys(WITH.get(path.name, path.name) for path in files)
        }
        wrong = [f"{name} is {text}" for name, text in before.items() if text.startswith("refused")]
        for path in files:
            loaded = copied / WITH.get(path.name, path.name)
            original = path.read_text("utf-8")
            for mutation in [*mutations(path)][chosen]:
                asked += 1
                (copied / path.name).write_text(mutated(path, mutation), "utf-8")
                if heard(loaded) == before[loaded.name]:
                    found.append(str(mutation))
            (copied / path.name).write_text(original, "utf-8")
    return asked, wrong + found


def unused(table: Table, files: list[Path]) -> list[str]:
    """Items of a table of which something must be heard, and that no file has. MuJoCo's compiler reads MJCF itself."""
    wanted = {
        f"{context}: {item.name}"
        for context, items in table.contexts.items()
        for item in items
        if item.rule not in (LOOKS, NO_EFFECT, format_table.REFUSED)
    }
    for path in files:
        root = parsed(path)
        waiting = [(root, table.root)]
        while waiting:
            element, context = waiting.pop()
            contexts = (context, f"{context}[{element.get('type', '')}]")
            names = [*(f"@{key}" for key in element.attrib), *(["#"] if (element.text or "").strip() else [])]
            wanted -= {f"{one}: {name}" for one in contexts for name in (*names, *(child.tag for child in element))}
            for child in element:
                item = table.items(context, element.get("type", "")).get(child.tag)
                if item is not None:
                    waiting.append((child, item.context))
    return sorted(wanted)


def main() -> None:
    """Every change of every file."""
    files = sorted(path for path in FILES.iterdir() if path.is_file())
    asked, found = silent(files, slice(None))
    print(*found, f"{asked} changes, {len(found)} unheard", sep="\n")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
