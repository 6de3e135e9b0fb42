"""The pages of docs/: what is generated in them, and the site that is made of them.

python tools/docs.py --write          rewrite the generated parts of docs/*.md and of the schema of model files
python tools/docs.py --render FOLDER  the site, with the figures that examples/paper and tools/*_page.py draw
python tools/docs.py --links FOLDER   whether every link of a rendered site leads somewhere, and nothing is fetched
python tools/docs.py --look FOLDER    a rendered site in Chromium: nothing cut or pale, search, animated pages
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import json
import re
import sys
from collections.abc import Callable, Mapping
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from partita import catalogue
from partita.builder.declaration import LOADS
from partita.io import mjcf_table, schema, sdf_table, urdf_table, usd_table, writing_table
from partita.io.format_table import Item
from partita.shapes import MATERIALS

TOOLS = Path(__file__).parent
DOCS = TOOLS.parent / "docs"
PAPER = TOOLS.parent / "examples" / "paper"
TESTS = TOOLS.parent / "tests" / "python"
PART = re.compile(r"(<!-- begin (\w[\w-]*)[^\n]*-->\n).*?(<!-- end \2 -->)", flags=re.DOTALL)


def main() -> None:
    """Do what the arguments say."""
    parser = argparse.ArgumentParser(description="Pages of docs/: generated parts, the site.")
    parser.add_argument("--write", action="store_true", help="rewrite the generated parts")
    parser.add_argument("--render", metavar="FOLDER", type=Path, help="write the site")
    parser.add_argument("--links", metavar="FOLDER", type=Path, help="check the links of a site")
    parser.add_argument(
        "--look", metavar="FOLDER", type=Path, help="open a site in Chromium and ask what a reader sees"
    )
    parser.add_argument("--shots", metavar="FOLDER", type=Path, help="with --look: save pictures of the pages there")
    arguments = parser.parse_args()
    if arguments.write:
        schema.PATH.write_text(scripts(TOOLS, "elements").current(), encoding="utf-8")
        schema.load.cache_clear()
        for page in pages():
            page.write_text(current(page), encoding="utf-8")
    if arguments.render:
        render(arguments.render)
    if arguments.links:
        broken_links = scripts(TOOLS, "website.links").broken_links(arguments.links)
        sys.exit("\n".join(broken_links) if broken_links else None)
    if arguments.look:
        look(arguments.look, arguments.shots)


def pages() -> list[Path]:
    """All pages, those of the decisions included."""
    return sorted(DOCS.rglob("*.md"))


def current(page: Path) -> str:
    """The text of a page with its generated parts as they should be."""
    text = page.read_text(encoding="utf-8")
    return PART.sub(lambda part: f"{part[1]}\n{GENERATED[part[2]]()}\n{part[3]}", text)


def catalogue_page() -> str:
    """A table of all entries, then each of them."""
    entries = [catalogue.entry(name) for name in catalogue.names() if name not in catalogue.zoo.ENTRIES]
    lines = ["| name | what |", "|---|---|"]
    anchor = scripts(TOOLS, "website.labels").anchor
    lines += [f"| [{e.name}](#{anchor(e.name)}) | {e.title} |" for e in entries]
    for e in entries:
        lines += ["", f"## {e.name}", "", f"{capital(e.title)}.", "", f"Source: {e.source}.", ""]
        lines += [f"Run: {e.settings}.", "", "| check | within | why so much |", "|---|---|---|"]
        lines += [f"| {check.name} | {check.tolerance:.0e} | {check.reason} |" for check in e.checks]
        if e.notes:
            lines += ["", e.notes]
    return "\n".join([*lines, ""])


def zoo_page() -> str:
    """Every mechanism of the zoo, theme by theme, with the theory of each."""
    lines: list[str] = []
    for theme, members in catalogue.zoo.THEMES.items():
        lines += [
            "",
            f"### {theme}",
            "",
            "| name | what | degrees of freedom | redundant | why |",
            "|---|---|---|---|---|",
        ]
        for make in members.values():
            e = make()
            assert e.truth is not None
            counts = f"{e.truth.mobility} | {e.truth.redundant}"
            lines.append(f"| {e.name} | {e.title} | {counts} | {e.truth.why} ({e.source}) |")
    return "\n".join([*lines, ""])


def materials_page() -> str:
    """The densities of materials, those of one density together."""
    names: dict[float, list[str]] = {}
    for name, density in MATERIALS.items():
        names.setdefault(density, []).append(name)
    lines = ["| material | kg/m^3 |", "|---|---|"]
    return "\n".join([*lines, *(f"| {', '.join(same)} | {density:g} |" for density, same in names.items())])


def schema_page() -> str:
    """Every table of a model file with its keys, as the published schema has them."""
    root = schema.load()
    lines: list[str] = []
    for key, rule in root["properties"].items():
        many = rule.get("type") == "array"
        lines += [f"## `{'[[' if many else '['}{key}{']]' if many else ']'}`", "", rule["description"], ""]
        if (load := LOADS.get(key)) is not None and load.lost:
            lines += [f"Files of other formats lack it: {load.lost}.", ""]
        table = rule["items"] if many else rule
        if "oneOf" not in table:
            lines += keys(table)
            continue
        kinds = [resolved(form) for form in table["oneOf"]]
        lines += ["| type | what |", "|---|---|"]
        lines += [*(f"| `{kind_of(kind)}` | {kind['description']} |" for kind in kinds), ""]
        for kind in kinds:
            lines += [f'### `type = "{kind_of(kind)}"`', "", *keys(kind, without=("type",))]
    lines += ["## Shapes", "", resolved({"$ref": "#/$defs/shape"})["description"], ""]
    for form in resolved({"$ref": "#/$defs/shape"})["oneOf"]:
        kind = resolved(form)
        lines += [f'### `type = "{kind_of(kind)}"`', "", kind["description"], "", *keys(kind, without=("type",))]
    lines += ["A part of a sum:", "", *keys(resolved({"$ref": "#/$defs/part"}))]
    value = resolved({"$ref": "#/$defs/table"})
    lines += ["## Tables of values", "", value["description"], "", *keys(value)]
    return "\n".join(lines)


def formats_page() -> str:
    """The tables by which robots' files are read."""
    lines: list[str] = []
    for table in (urdf_table.URDF, sdf_table.SDF, mjcf_table.MJCF, usd_table.USD):
        lines += ["", f"## {table.kind}", "", "| in | item | rule | what it does |", "|---|---|---|---|"]
        for context, items in table.contexts.items():
            shown = context.replace("[", " of type ").removesuffix("]")
            rows: dict[tuple[str, str], list[str]] = {}
            if context in table.like:
                lines.append(f"| {shown} | all of {table.like[context]} | | |")
            for found in items:
                rows.setdefault((found.rule, found.effect), []).append(item(found))
            lines += [f"| {shown} | {', '.join(names)} | {rule} | {effect} |" for (rule, effect), names in rows.items()]
    return "\n".join([*lines, ""])


def written_page() -> str:
    """The table by which files are written; elements of one fate together. What other formats lack without a loss of
    their own is said where the keys of each load are."""
    rows: dict[tuple[str, ...], list[str]] = {}
    lost = {kind.replace("_", " ") for kind, load in LOADS.items() if load.lost}
    for kind, fates in writing_table.TABLE.items():
        if kind not in lost:
            rows.setdefault(tuple(str(fates[name]) for name in writing_table.FORMATS), []).append(kind)
    head = ["| element", *writing_table.FORMATS]
    lines = ["", f"{' | '.join(head)} |", f"{'|---' * len(head)}|"]
    lines += [f"| {', '.join(kinds)} | {' | '.join(fates)} |" for fates, kinds in rows.items()]
    lines.append(
        "| any other load: see its part of [model files](model-files.md) | dropped | dropped | dropped | written |"
    )
    return "\n".join([*lines, "", ""])


def item(found: Item) -> str:
    """An item of a table of a format."""
    default = f" ({' or '.join(found.defaults)})" if found.defaults is not None else ""
    since, until = (".".join(map(str, bound)) for bound in (found.since, found.until))
    versions = f" [{since} to {until}]" if since and until else f" [from {since}]" if since else ""
    versions = f" [up to {until}]" if until and not since else versions
    name = "text" if found.name == "#" else f"`{found.name}{'*' if found.many else ''}`"
    return f"{name}{default}{versions}"


def messages_page() -> str:
    """What is said of broken and odd models."""
    return str(scripts(TESTS, "messages").page())


def tolerances_page() -> str:
    """Every threshold of the core with its meaning, its scale and its reason."""
    return str(scripts(TESTS, "tolerances").page())


def labels_page() -> str:
    """Every label of the theory with a link to its place, page by page."""
    labels = scripts(TOOLS, "website.labels")
    rows: dict[Path, list[str]] = {}
    for label, page, heading in labels.targets():
        rows.setdefault(page, []).append(f"[({label})]({page.name}#{labels.anchor(heading)})")
    lines = ["", "| page | labels |", "|---|---|"]
    for page, links in rows.items():
        title = page.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")
        lines.append(f"| [{title}]({page.name}) | {', '.join(links)} |")
    return "\n".join([*lines, ""])


def trust_page() -> str:
    """The cases that the tests ask, class by class, with what comes out of them."""
    trust = scripts(TESTS, "trust")
    return str(trust.page.tables(trust.CLASSES))


def keys(table: Mapping[str, Any], without: tuple[str, ...] = ()) -> list[str]:
    """Rows of a table of keys; needed ones first come as the schema lists them."""
    needed = table.get("required", ())
    lines = ["| key | value | needed | meaning |", "|---|---|---|---|"]
    for name, rule in table["properties"].items():
        if name not in without:
            mark = "yes" if name in needed else ""
            lines.append(f"| `{name}` | {escape(form(rule), quote=False)} | {mark} | {rule['description']} |")
    return [*lines, ""]


def form(rule: Mapping[str, Any]) -> str:
    """The kind of value in words."""
    rule = {**resolved(rule), **{key: value for key, value in rule.items() if key != "$ref"}}
    if "enum" in rule:
        return ", ".join(f"`{json.dumps(value)}`" for value in rule["enum"])
    words = {"number": "a number", "integer": "an integer", "string": "text", "object": "a table"}
    return str(rule.get("title") or words[rule["type"]])


def resolved(rule: Mapping[str, Any]) -> Mapping[str, Any]:
    """The schema that a $ref stands for."""
    found: Mapping[str, Any] = schema.load()["$defs"][rule["$ref"].rpartition("/")[2]] if "$ref" in rule else rule
    return found


def kind_of(joint: Mapping[str, Any]) -> str:
    """The word for a kind of joint."""
    return str(joint["properties"]["type"]["const"])


def capital(text: str) -> str:
    """`text` as the beginning of a sentence."""
    return text[0].upper() + text[1:]


def sympy_page(number: int) -> str:
    """The formulas of the mechanism that a block of the page on SymPy makes, after the blocks before it."""
    names: dict[str, Any] = {}
    for code in re.findall(r"```python\n(.*?)```", (DOCS / "sympy.md").read_text("utf-8"), re.DOTALL)[: number + 1]:
        with contextlib.redirect_stdout(io.StringIO()):
            exec(code, names)
    return "\n".join(f"```math\n{formula}\n```" for formula in names["f"].formulas())


GENERATED: dict[str, Callable[[], str]] = {
    "catalogue": catalogue_page,
    "zoo": zoo_page,
    "model-files": schema_page,
    "formats": formats_page,
    "written": written_page,
    "messages": messages_page,
    "trust": trust_page,
    "tolerances": tolerances_page,
    "materials": materials_page,
    "labels": labels_page,
    "sympy-pendulum": lambda: sympy_page(0),
    "sympy-four-bar": lambda: sympy_page(1),
}


def render(folder: Path) -> None:
    """The site, by Sphinx; a warning is an error."""
    from sphinx.cmd.build import build_main

    with TemporaryDirectory() as work:
        sources = Path(work) / "sources"
        sources.mkdir()
        stage(sources)
        options = ["-q", "-W", "--keep-going", "-j", "auto", "-d", f"{work}/read"]
        if status := build_main([*options, "-b", "html", str(sources), str(folder)]):
            sys.exit(status)


def look(site: Path, shots: Path | None) -> None:
    """A browser opens the site; what it finds ends the program."""
    chromium = scripts(TESTS, "chromium")
    if chromium.PROGRAM is None:
        print("There is no Chromium here: nobody looked at the site.", file=sys.stderr)
        return
    found = scripts(TOOLS, "website.seen").faults(site, chromium, shots)
    sys.exit("\n".join(found) if found else None)


def stage(folder: Path, short: bool = False, only: tuple[str, ...] | None = None) -> None:
    """What Sphinx renders, put into `folder`; `short` draws figures from coarser runs, `only` some of the gallery."""

    def draw(into: Path) -> None:
        for figure in figures("paper"):
            scripts(PAPER, figure).main(short, into / "paper")
        for figure in figures("compare"):
            scripts(TOOLS, "compare_page").draw(figure, into / "compare", short)
        for figure in figures("maps"):
            scripts(TOOLS, "maps_page").draw(figure, into / "maps", short)

    scripts(TOOLS, "website.stage").stage(folder, draw, only)


def figures(kind: str) -> list[str]:
    """Names of the figures on the pages that stand in the folder `kind`.

    Those of "paper" are drawn by the scripts of examples/paper with their names, those of "compare" by compare_page.py
    for the mechanism with that name, those of "maps" by maps_page.py.
    """
    text = "".join(page.read_text(encoding="utf-8") for page in pages())
    return list(dict.fromkeys(re.findall(rf"\]\({kind}/([\w-]+)\.png\)", text)))


def scripts(folder: Path, name: str) -> Any:
    """A script of `folder`, whose modules import each other by plain names."""
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))
    return importlib.import_module(name)


if __name__ == "__main__":
    main()
