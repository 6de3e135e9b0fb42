"""The tolerances of the core, read from the sources: for docs/tolerances.md and for the test of their rules.

A constant of floating-point numbers has a comment of three parts. Of a threshold: what it separates, "Scale:" (what it
is a fraction or a multiple of), and "Reason:" (why it has its size). Of a setting, by which an algorithm goes on and
which is compared with nothing (the length of a step, a factor, a damping, a coefficient, a default): what it is,
"Unit:", "Reason:". What several modules share stands in `partita-math/src/tolerance.rs`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CRATES = ROOT / "crates"
SHARED = "math/tolerance"
FLOORS = ("math", "system", "integrate", "model", "analysis", "fmu")

CONSTANT = re.compile(
    r"((?:^[ \t]*///[^\n]*\n)*)^[ \t]*(?:pub(?:\([^)]*\))? )?const ([A-Z][A-Z_0-9]*): ([^=]*?) =\s*([^;]*);",
    flags=re.MULTILINE,
)
NUMBERS = re.compile(r"f64|\[f64; \d+\]|\((?:f64(?:, )?)+\)")
PARTS = re.compile(r"(?P<meaning>.+?\.) (?P<kind>Scale|Unit): (?P<scale>.+?)\. Reason: (?P<reason>.+)\.")
UNIT_TESTS = re.compile(r"#\[cfg\(test\)\]\s*(?:pub(?:\(crate\))? )?mod \w+ \{")
TEST_MODULE = re.compile(r"#\[cfg\(test\)\]\s*(?:pub(?:\(crate\))? )?mod (\w+);")
SCIENTIFIC = re.compile(r"(?<![\w.])\d[\d_.]*e-?\d+")
SMALL = re.compile(r"[<>]=?\s*-?(0\.0\d+)|\.(?:max|min)\((0\.0\d+)\)")
DECIMAL = re.compile(r"(?<![\w.])\d+\.\d+(?![\w.])")
SIGNATURE = re.compile(r"\bfn\b|\bimpl\b|->")
NAMED = re.compile(rf"const [A-Z_0-9]+: (?:{NUMBERS.pattern}) =[^;]*;")
COMPARISON = re.compile(r"(?<![-=<>])\s[<>]=?\s")
CLAUSE = re.compile(r"&&|\|\||[{}?,;]")
GROUP = re.compile(r"^// ---- (.+)$", flags=re.MULTILINE)


@dataclass(frozen=True)
class Constant:
    """A constant of floating-point numbers with the parts of its comment."""

    name: str
    value: str
    comment: str
    where: str
    group: str

    @property
    def parts(self) -> tuple[str, str, str] | None:
        """Meaning, scale or unit, and reason; None where the comment lacks one of them."""
        found = PARTS.fullmatch(self.comment)
        return (found["meaning"], found["scale"], found["reason"]) if found else None

    @property
    def is_setting(self) -> bool:
        """Does an algorithm go on by it, so that it separates nothing?"""
        found = PARTS.fullmatch(self.comment)
        return found is not None and found["kind"] == "Unit"


def sources() -> Iterator[tuple[str, str]]:
    """("system/rank/exact", its text without unit tests) for all files of the floors, in their order."""
    for floor in FLOORS:
        root = CRATES / f"partita-{floor}" / "src"
        texts = {path: path.read_text("utf-8") for path in sorted(root.rglob("*.rs"))}
        tests = {
            (path.parent if path.name in ("lib.rs", "mod.rs") else path.with_suffix("")) / name
            for path, text in texts.items()
            for name in TEST_MODULE.findall(text)
        }
        for path, text in texts.items():
            if not any(test == path.with_suffix("") or test in path.parents for test in tests):
                yield f"{floor}/{path.relative_to(root).with_suffix('').as_posix()}", UNIT_TESTS.split(text)[0]


@cache
def constants() -> tuple[Constant, ...]:
    """All constants of floating-point numbers, in the order of the floors and of their files."""
    return tuple(found for where, text in sources() for found in in_text(where, text))


def in_text(where: str, text: str) -> Iterator[Constant]:
    """The constants of one file."""
    for match in CONSTANT.finditer(text):
        comment, name, kind, value = match.groups()
        if NUMBERS.fullmatch(kind):
            words = " ".join(line.strip().removeprefix("///").strip() for line in comment.splitlines())
            groups = GROUP.findall(text[: match.start(2)])
            yield Constant(name, " ".join(value.split()), words, where, groups[-1] if groups else "")


def bare_literals(text: str) -> list[str]:
    """Lines with a literal that is compared with or stands in scientific notation, constants and words left out."""
    code = re.sub(r'"(?:[^"\\]|\\.)*"', '""', re.sub(r"//[^\n]*", "", text), flags=re.DOTALL)
    code = NAMED.sub("", code)
    return [line.strip() for line in code.splitlines() if SCIENTIFIC.search(line) or SMALL.search(line)]


def compared_literals(text: str) -> list[str]:
    """Clauses that compare with a multiple or a fraction: with numbers other than 0 and 1."""
    code = re.sub(r'"(?:[^"\\]|\\.)*"', '""', re.sub(r"//[^\n]*", "", text), flags=re.DOTALL)
    clauses = (part.strip() for line in code.splitlines() for part in CLAUSE.split(line))
    compared = (part for part in clauses if COMPARISON.search(f" {part} ") and not SIGNATURE.search(part))
    return [part for part in compared if any(float(x) not in (0.0, 1.0) for x in DECIMAL.findall(part))]


def comparisons(names: list[str], text: str) -> list[str]:
    """Clauses of a source in which one of these constants stands beside a comparison."""
    used = re.compile(rf"\b(?:{'|'.join(names)})\b(?!\.len)")
    lines = (line for line in re.sub(r"//[^\n]*", "", text).splitlines() if used.search(line))
    clauses = (part.strip() for line in lines for part in CLAUSE.split(line))
    return [part for part in clauses if used.search(part) and COMPARISON.search(f" {part} ")]


def page() -> str:
    """The generated part of docs/tolerances.md."""
    thresholds = [c for c in constants() if not c.is_setting]
    settings = [c for c in constants() if c.is_setting]
    shared = [c for c in thresholds if c.where == SHARED]
    own = len(thresholds) - len(shared)
    count = f"{len(shared)} thresholds are shared, {own} belong to one algorithm; {len(settings)} are settings."
    lines = [count, "", "## Shared thresholds"]
    for group in dict.fromkeys(c.group for c in shared):
        lines += ["", f"### {group[0].upper()}{group[1:]}", "", *table([c for c in shared if c.group == group])]
    for floor, found in by_floor([c for c in thresholds if c.where != SHARED]):
        lines += ["", f"## Thresholds of one algorithm: `partita-{floor}`"]
        for where in dict.fromkeys(c.where for c in found):
            lines += ["", f"### `{where.partition('/')[2]}`", "", *table([c for c in found if c.where == where])]
    lines += ["", "## Settings"]
    for floor, found in by_floor(settings):
        lines += ["", f"### Settings of `partita-{floor}`", "", *table(found, "unit")]
    return "\n".join([*lines, ""])


def by_floor(found: list[Constant]) -> Iterator[tuple[str, list[Constant]]]:
    """Constants floor by floor, floors without any left out."""
    for floor in FLOORS:
        if own := [c for c in found if c.where.startswith(f"{floor}/")]:
            yield floor, own


def table(rows: list[Constant], measure: str = "scale") -> list[str]:
    """Rows of a table of constants."""
    lines = [f"| name | value | meaning | {measure} | reason |", "|---|---|---|---|---|"]
    for c in rows:
        meaning, scale, reason = (cell(part) for part in c.parts or (c.comment, "", ""))
        lines.append(f"| `{c.name}` | `{c.value}` | {meaning} | {scale} | {reason} |")
    return lines


def cell(text: str) -> str:
    """Words of a comment as they stand in a table: links to names as names."""
    text = re.sub(r"\[`(?:\w+::)*(\w+)`\](?:\([^)]*\))?", r"`\1`", text)
    return escape(text, quote=False).replace("|", "\\|").replace("*", "\\*")
