"""The tolerances, read from the sources: for docs/tolerances.md and for the test of their rules.

A constant of floating-point numbers has a comment of three parts. Of a threshold: what it separates, "Scale:" (what it
is a fraction or a multiple of), and "Reason:" (why it has its size). Of a setting, by which an algorithm goes on and
which is compared with nothing (the length of a step, a factor, a damping, a coefficient, a default): what it is,
"Unit:", "Reason:". What several modules share stands in `partita-math/src/tolerance.rs`.

Thresholds of the package have the same three parts, in the string below them (Python) or in the comment above them
(JavaScript); shared ones stand in `partita/tolerance.py` and `.js`. There constants that are compared
with nothing, such as the width of a figure, are no thresholds and need no parts. Entries of the catalogue are examples,
with the accuracy of each beside its value.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CRATES = ROOT / "crates"
SHARED = "math/tolerance"
FLOORS = ("math", "system", "integrate", "model", "analysis", "fmu")
PACKAGE = ROOT / "python" / "partita"
LANGUAGES = {"py": "Python", "js": "JavaScript"}
SMALL_NUMBER, LARGE_NUMBER = 1e-3, 1e9
"""Numbers beyond these are thresholds or guards wherever they stand."""
HARMLESS = (0.0, 1.0)
IN_COMPARISONS = frozenset({"abs", "max", "maximum", "min", "minimum"})
"""Functions whose arguments are compared with what their result is compared with."""

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


def modules() -> Iterator[tuple[str, ast.Module]]:
    """("plots/maps", what stands in it) for the modules of the package, entries of the catalogue left out."""
    for path in sorted(PACKAGE.rglob("*.py")):
        where = path.relative_to(PACKAGE).with_suffix("").as_posix()
        if not where.startswith("catalogue/"):
            yield where, ast.parse(path.read_text("utf-8"))


def scripts() -> Iterator[tuple[str, str]]:
    """("viewer/scene", its text) for the scripts of the pages."""
    for path in sorted(PACKAGE.rglob("*.js")):
        yield path.relative_to(PACKAGE).with_suffix("").as_posix(), path.read_text("utf-8")


def named_values(tree: ast.Module) -> Iterator[tuple[str, ast.expr, str]]:
    """Constants of a module: name, value, the words of the string below."""
    for item, below in zip(tree.body, [*tree.body[1:], None], strict=True):
        words = below.value if isinstance(below, ast.Expr) else None
        comment = words.value if isinstance(words, ast.Constant) and isinstance(words.value, str) else ""
        if not isinstance(item, ast.Assign | ast.AnnAssign) or item.value is None:
            continue
        for target in item.targets if isinstance(item, ast.Assign) else [item.target]:
            for name in ast.walk(target):
                if isinstance(name, ast.Name):
                    yield name.id, item.value, " ".join(comment.split())


def floats_in(node: ast.AST) -> list[float]:
    """Literals of floating-point numbers."""
    return [x.value for x in ast.walk(node) if isinstance(x, ast.Constant) and isinstance(x.value, float)]


def compared_with(node: ast.AST) -> Iterator[ast.AST]:
    """What a side of a comparison consists of, arguments of functions of another kind left out."""
    yield node
    for part in ast.iter_child_nodes(node):
        called = node.func if isinstance(node, ast.Call) else None
        name = getattr(called, "id", getattr(called, "attr", None))
        if called is None or (part is not called and name in IN_COMPARISONS):
            yield from compared_with(part)


def sides(tree: ast.AST) -> Iterator[ast.AST]:
    """Parts of both sides of all comparisons by size."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare) and any(isinstance(x, ast.Lt | ast.LtE | ast.Gt | ast.GtE) for x in node.ops):
            for side in (node.left, *node.comparators):
                yield from compared_with(side)


def nameless(tree: ast.Module) -> list[str]:
    """Lines of a module that compare with a bare number, or contain a very small or large one outside of a constant
    and of the defaults of a function."""
    known = {id(x) for _, value, _ in named_values(tree) for x in ast.walk(value)}
    for node in ast.walk(tree):
        if isinstance(node, ast.arguments):
            known |= {id(x) for value in (*node.defaults, *node.kw_defaults) if value for x in ast.walk(value)}
        if isinstance(node, ast.ClassDef):  # of a field
            known |= {id(x) for item in node.body if isinstance(item, ast.AnnAssign) for x in ast.walk(item)}
    compared = {id(node) for node in sides(tree)}
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, float) and id(node) not in known:
            far = node.value != 0.0 and not SMALL_NUMBER < abs(node.value) < LARGE_NUMBER
            if far or (id(node) in compared and node.value not in HARMLESS):
                found[node.lineno] = f"{node.lineno}: {node.value!r}"
    return [found[line] for line in sorted(found)]


def compared_names(trees: Iterable[ast.Module]) -> set[str]:
    """Names of constants that stand in comparisons."""
    names = (getattr(x, "id", getattr(x, "attr", "")) for tree in trees for x in sides(tree))
    return {name for name in names if name.isupper()}


@cache
def of_package() -> tuple[Constant, ...]:
    """Thresholds of the package: constants of floating-point numbers that are compared, or very small; then those of
    its scripts."""
    trees = list(modules())
    compared = compared_names(tree for _, tree in trees)
    found = [
        Constant(name, ast.unparse(value), comment, f"py/{where}", "")
        for where, tree in trees
        for name, value, comment in named_values(tree)
        if name.isupper()
        and (numbers := floats_in(value))
        and not any(isinstance(x, ast.Dict | ast.DictComp | ast.List | ast.Tuple) for x in ast.walk(value))
        and (name in compared or any(0.0 < abs(x) <= SMALL_NUMBER for x in numbers))
    ]
    return (*found, *(constant for where, text in scripts() for constant in of_script(where, text)))


SCRIPT_CONSTANT = re.compile(r"((?:^[ \t]*//[^\n]*\n)*)^[ \t]*const ([A-Z][A-Z_0-9]*) = ([^;]*);", flags=re.MULTILINE)


def of_script(where: str, text: str) -> Iterator[Constant]:
    """The thresholds of one script: constants that contain a small number."""
    for match in SCRIPT_CONSTANT.finditer(text):
        comment, name, value = match.groups()
        if value[0] not in "[{" and nameless_in_script(f"f({value});"):
            words = " ".join(line.strip().removeprefix("//").strip() for line in comment.splitlines())
            yield Constant(name, " ".join(value.split()), words, f"js/{where}", "")


def nameless_in_script(text: str) -> list[str]:
    """Lines of a script with a small number outside of a constant; words and comments are left out."""
    strings = r"\"(?:[^\"\\\n]|\\.)*\"|'(?:[^'\\\n]|\\.)*'"
    code = re.sub(rf"({strings})|//[^\n]*|/\*.*?\*/", lambda m: '""' if m[1] else "", text, flags=re.DOTALL)
    code = re.sub(r"^[ \t]*const [A-Z][A-Z_0-9]* = [^;]*;", lambda m: "\n" * m[0].count("\n"), code, flags=re.MULTILINE)
    found = (line.strip() for line in code.splitlines())
    return [line for line in found if re.search(r"(?<![\w.])\d[\d.]*e-\d+|(?<![\w.])0?\.00\d+", line)]


def page() -> str:
    """The generated part of docs/tolerances.md."""
    thresholds = [c for c in constants() if not c.is_setting]
    settings = [c for c in constants() if c.is_setting]
    shared = [c for c in thresholds if c.where == SHARED]
    own = len(thresholds) - len(shared)
    count = (
        f"{len(shared)} thresholds are shared, {own} belong to one algorithm; {len(settings)} are settings. The "
        f"package in Python, with its pages, has {len(of_package())} more."
    )
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
    for language, word in LANGUAGES.items():
        own_of = [c for c in of_package() if c.where.startswith(f"{language}/")]
        first = [c for c in own_of if c.where == f"{language}/tolerance"]
        lines += ["", f"## Thresholds in {word}", "", *table(first)]
        for where in dict.fromkeys(c.where for c in own_of if c not in first):
            name = f"{where.partition('/')[2]}.{language}"
            lines += ["", f"### `{name}`", "", *table([c for c in own_of if c.where == where])]
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
