"""One vocabulary: names in the code use the words of the field, not those that the project once made up.

A textbook's word for each is given beside it.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

PARTS = {
    "gauge": "measurement", "gauges": "measurements", "grip": "reaction friction", "grips": "reaction friction",
    "misfit": "geometric error", "misfits": "geometric errors", "bridged": "relaxed", "meant": "repaired, nominal",
    "told": "reported", "tell": "report", "tells": "reports", "freedoms": "degrees of freedom, dof",
    "doubtful": "suspect", "cures": "remedies", "cure": "remedy", "journal": "history, solution log",
    "openness": "closure error", "openings": "closure errors", "exchanges": "switches",
    "ways": "branches", "walks": "continuations", "horizon": "time domain", "knots": "breakpoints",
    "desk": "worker", "readable": "ResultView", "flatness": "planarity",
}  # fmt: skip
"""Words that no part of a name may be."""

WHOLE = {
    "way": "branch, path, offset", "walk": "continuation, visit", "launch": "singular start",
    "departure": "singular start, deviation", "passage": "crossing", "trail": "crossing, checkpoint",
    "seam": "crossing", "hand": "user system", "by_hand": "user_system", "place_rs": "zero position",
    "carry": "transfer", "reach": "characteristic displacement", "flat": "planar", "holds": "valid",
    "broken": "invalid", "words_rs": "messages", "Place": "say of what", "Push": "PointForce",
    "Acts": "ForceApplication", "Stand": "RepairedModel", "Walk": "say what it does", "corners_rs": "discontinuities",
    "Freedom": "degree of freedom", "Tell": "report", "said": "arguments, remark, message, report",
    "places": "positions, points, indices", "Room": "scratch", "Asked": "say of what", "Given": "say of what",
    "Found": "say of what", "Seen": "say of what", "Looked": "examined", "Kept": "stored, log", "Others": "say of what",
    "Noted": "recorded", "Everything": "all", "Left": "say of what",
}  # fmt: skip
"""Words that a name may not consist of; `_rs` stands for a file."""


def parts(name: str) -> list[str]:
    """The words of `snake_case` and `CamelCase`."""
    return [part.lower() for part in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)]


RUST = re.compile(
    r"\b(?:fn|struct|enum|trait|type|const|static|mod|let(?: mut)?|for|ref(?: mut)?) +(?:r#)?([A-Za-z_]\w*)"
    r"|^\s*(?:pub(?:\([^)]*\))? +)?([a-z_]\w*): |[|(,] *(?:mut )?([a-z_]\w*): ",
    re.MULTILINE,
)
"""What a line of Rust defines: items, bindings, fields and parameters."""

SCRIPT = re.compile(r"\b(?:function|class|const|let|get|set) +([A-Za-z_]\w*)")


def sources(*endings: str) -> list[Path]:
    folders = ("crates", "python", "tests", "tools", "benches", "examples")
    found = (path for folder in folders for ending in endings for path in (ROOT / folder).rglob(f"*{ending}"))
    return sorted(path for path in found if "target" not in path.parts)


def code(source: str) -> str:
    """Without comments and strings, which may use any word."""
    return re.sub(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\])*"', '""', source, flags=re.DOTALL)


def python_names(source: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.id if isinstance(node, ast.Name) else node.attr


def names(path: Path) -> set[str]:
    """Every name that a file defines, and its own."""
    source = path.read_text("utf-8")
    own = f"{path.stem}_rs"
    if path.suffix in (".py", ".pyi"):
        return {own, *python_names(source)}
    found = (RUST if path.suffix == ".rs" else SCRIPT).findall(code(source))
    return {own, *(name for item in found for name in ([item] if isinstance(item, str) else item) if name)}


@cache
def homemade(name: str) -> str | None:
    """The textbook's word for a name that uses a homemade one."""
    plain = name.removesuffix("_rs")
    if name in WHOLE or plain in WHOLE:
        return WHOLE.get(name) or WHOLE[plain]
    return next((PARTS[part] for part in parts(plain) if part in PARTS), None)


def test_names_are_those_of_the_field() -> None:
    wrong = {}
    for path in sources(".rs", ".py", ".pyi", ".js"):
        for name in names(path):
            better = homemade(name)
            if better and not (name.startswith("test_") and name in WHOLE):
                wrong[f"{path.relative_to(ROOT)}: {name}"] = better
    assert not wrong, wrong


@pytest.mark.parametrize(
    ("name", "refused"),
    [("misfit_size", True), ("DoubtfulVerdict", True), ("MEANT", True), ("way", True), ("half_way", False),
     ("degrees_of_freedom", False), ("total", False), ("words_rs", True), ("words", False), ("stellar", False)],
)  # fmt: skip
def test_a_homemade_word_is_seen_in_any_case_and_position(name: str, refused: bool) -> None:
    assert (homemade(name) is not None) == refused


def test_definitions_of_every_kind_are_seen() -> None:
    rust = (
        "pub fn one(two: f64) { let three = |four: u8| 1; }\n"
        "struct Five {\n    pub six: f64,\n}\nconst SEVEN: u8 = 1; // told"
    )
    assert {name for item in RUST.findall(code(rust)) for name in item if name} == {
        "one", "two", "three", "four", "Five", "six", "SEVEN",
    }  # fmt: skip
    python = "class One:\n    two: int\n    def three(self, four): self.five = 1\nsix = 'told'\n"
    assert set(python_names(python)) == {"One", "two", "three", "self", "four", "five", "six"}
