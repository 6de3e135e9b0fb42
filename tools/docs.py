"""The pages of docs/: what is generated in them, and how they are rendered.

python tools/docs.py --write          rewrite the generated parts of docs/*.md
python tools/docs.py --render FOLDER  pages as HTML, with the figures that examples/paper and tools/compare_page.py draw
"""

from __future__ import annotations

import argparse
import importlib
import json
import re
import sys
from collections.abc import Callable, Mapping
from html import escape
from pathlib import Path
from typing import Any

import markdown2

from partita import catalogue
from partita.io import schema

TOOLS = Path(__file__).parent
DOCS = TOOLS.parent / "docs"
PAPER = TOOLS.parent / "examples" / "paper"
TESTS = TOOLS.parent / "tests" / "python"
PART = re.compile(r"(<!-- begin (\w[\w-]*)[^\n]*-->\n).*?(<!-- end \2 -->)", flags=re.DOTALL)
# "code-friendly": q_I and v_I are names, not the ends of something in italics
EXTRAS = ["fenced-code-blocks", "tables", "header-ids", "cuddled-lists", "code-friendly"]

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ max-width: 52rem; margin: 0 auto; padding: 1rem; color: #1d2730;
  font: 16px/1.5 system-ui, "Segoe UI", Roboto, Arial, sans-serif; }}
nav {{ border-bottom: 1px solid #d3dae0; padding-bottom: .5rem; }}
nav a {{ margin-right: 1rem; }}
pre, code {{ font: 13.5px/1.45 ui-monospace, Consolas, monospace; background: #f5f7f9; }}
pre {{ padding: .6rem .8rem; overflow-x: auto; border-radius: 5px; }}
img {{ max-width: 100%; }}
table {{ border-collapse: collapse; display: block; overflow-x: auto; }}
th, td {{ border: 1px solid #d3dae0; padding: .25rem .6rem; text-align: left; vertical-align: top; }}
h2, h3 {{ margin-top: 2rem; }}
h1 code, h2 code, h3 code {{ font-size: inherit; background: none; }}
td:first-child, td:nth-child(2) {{ min-width: 4.5rem; }}
{code_style}
</style>
</head>
<body>
<nav><a href="{up}index.html">Partita</a><a href="{up}python/partita.html">Python reference</a>
<a href="{up}rust/partita_system/index.html">Rust reference</a></nav>
{body}
</body>
</html>
"""


def main() -> None:
    """Do what the arguments say."""
    parser = argparse.ArgumentParser(description="Pages of docs/: generated parts, HTML.")
    parser.add_argument("--write", action="store_true", help="rewrite the generated parts")
    parser.add_argument("--render", metavar="FOLDER", type=Path, help="write the pages as HTML")
    arguments = parser.parse_args()
    if arguments.write:
        for page in pages():
            page.write_text(current(page), encoding="utf-8")
    if arguments.render:
        render(arguments.render)


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
    lines += [f"| [{e.name}](#{anchor(e.name)}) | {e.title} |" for e in entries]
    for e in entries:
        options = "".join(f", {key} {value:g}" for key, value in e.options.items())
        lines += ["", f"## {e.name}", "", f"{capital(e.title)}.", "", f"Source: {e.source}.", ""]
        lines += [f"Run: {e.duration:g} s{options}.", "", "| check | within | why so much |", "|---|---|---|"]
        lines += [f"| {check.name} | {check.tolerance:.0e} | {check.reason} |" for check in e.checks]
        if e.notes:
            lines += ["", e.notes]
    return "\n".join([*lines, ""])


def zoo_page() -> str:
    """Every mechanism of the zoo, theme by theme, with what theory says of it."""
    lines: list[str] = []
    for theme, members in catalogue.zoo.THEMES.items():
        lines += ["", f"### {theme}", "", "| name | what | freedoms | redundant | why |", "|---|---|---|---|---|"]
        for make in members.values():
            e = make()
            assert e.truth is not None
            counts = f"{e.truth.mobility} | {e.truth.redundant}"
            lines.append(f"| {e.name} | {e.title} | {counts} | {e.truth.why} ({e.source}) |")
    return "\n".join([*lines, ""])


def schema_page() -> str:
    """Every table of a model file with its keys, as the published schema has them."""
    root = schema.load()
    lines: list[str] = []
    for key, rule in root["properties"].items():
        many = rule.get("type") == "array"
        lines += [f"## `{'[[' if many else '['}{key}{']]' if many else ']'}`", "", rule["description"], ""]
        table = rule["items"] if many else rule
        if "oneOf" not in table:
            lines += keys(table)
            continue
        kinds = [resolved(form) for form in table["oneOf"]]
        lines += ["| type | what |", "|---|---|"]
        lines += [*(f"| `{kind_of(kind)}` | {kind['description']} |" for kind in kinds), ""]
        for kind in kinds:
            lines += [f'### `type = "{kind_of(kind)}"`', "", *keys(kind, without=("type",))]
    value = resolved({"$ref": "#/$defs/table"})
    lines += ["## Tables of values", "", value["description"], "", *keys(value)]
    return "\n".join(lines)


def messages_page() -> str:
    """What is said of broken and odd models."""
    return str(scripts(TESTS, "messages").page())


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


def anchor(heading: str) -> str:
    """The id that a heading gets."""
    return re.sub(r"[^\w-]", "", heading.lower().replace(" ", "-"))


GENERATED: dict[str, Callable[[], str]] = {
    "catalogue": catalogue_page,
    "zoo": zoo_page,
    "model-files": schema_page,
    "messages": messages_page,
    "trust": trust_page,
}


def render(folder: Path, short: bool = False) -> None:
    """Every page as HTML under `folder`, with its figures; `short` draws them from coarser runs."""
    for page in pages():
        target = folder / page.relative_to(DOCS).with_suffix(".html")
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(as_html(page), encoding="utf-8")
    for figure in figures("paper"):
        scripts(PAPER, figure).main(short, folder / "paper")
    for figure in figures("compare"):
        scripts(TOOLS, "compare_page").draw(figure, folder / "compare", short)


def figures(kind: str) -> list[str]:
    """Names of the figures on the pages that stand in the folder `kind`.

    Those of "paper" are drawn by the scripts of examples/paper with their names, those of "compare" by compare_page.py
    for the mechanism with that name.
    """
    text = "".join(page.read_text(encoding="utf-8") for page in pages())
    return list(dict.fromkeys(re.findall(rf"\]\({kind}/([\w-]+)\.png\)", text)))


def scripts(folder: Path, name: str) -> Any:
    """A script of `folder`, whose modules import each other by plain names."""
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))
    return importlib.import_module(name)


def as_html(page: Path) -> str:
    """One page; links to other pages lead to their HTML."""
    from pygments.formatters import HtmlFormatter

    text = page.read_text(encoding="utf-8").replace("```output", "```text")
    body = re.sub(r'href="([^":#]+)\.md(#[^"]*)?"', r'href="\1.html\2"', str(markdown2.markdown(text, extras=EXTRAS)))
    title = next((line.removeprefix("# ") for line in text.splitlines() if line.startswith("# ")), page.stem)
    up = "../" * (len(page.relative_to(DOCS).parts) - 1)
    style = HtmlFormatter(style="default").get_style_defs(".codehilite")
    return PAGE.format(title=escape(title), up=up, body=body, code_style=style)


if __name__ == "__main__":
    main()
