"""The list of deliberate errors stays true to the sources: a text that has moved on would spoil nothing."""

import importlib
import re
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


def tool() -> ModuleType:
    """The tool, from its folder, where the list lies beside it."""
    folder = str(ROOT / "tools")
    if folder not in sys.path:
        sys.path.insert(0, folder)
    return importlib.import_module("deliberate_errors")


ERRORS = tool().ERRORS


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: error.name)
def test_an_error_changes_one_place(error) -> None:
    text = (ROOT / error.file).read_text("utf-8")
    assert text.count(error.old) == 1
    assert error.new != error.old
    # what takes its place is no comment: something is computed otherwise
    line = next(line for line in text.splitlines() if error.old.splitlines()[0] in line)
    assert not line.lstrip().startswith(("//", "#"))


def test_errors_are_distinguished() -> None:
    assert [name for name, count in Counter(error.name for error in ERRORS).items() if count > 1] == []
    assert all(re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", error.name) for error in ERRORS)
    assert len(ERRORS) >= 150
    rooms = ("sensing", "/io/", "/coupling", "couplings.py", "/measurement", "/force/", "relations.py")
    assert sum(any(room in error.file for room in rooms) for error in ERRORS) >= 60


@pytest.mark.parametrize("tests", sorted({tests for error in ERRORS for tests in error.seen_by}))
def test_the_tests_that_should_see_it_are_there(tests: str) -> None:
    kind, *rest = tests.split()
    if kind in ("python", "docstrings"):
        folder = ROOT / ("tests/python" if kind == "python" else "python/partita")
        assert rest and all((folder / name).is_file() for name in rest)
        return
    if kind == "lib":
        return
    sources = ROOT / "crates" / ("partita-tests" if kind == "whole" else "partita-tests-hand") / "src"
    for name in rest or [""]:
        path = name.split("::") if kind == "whole" else [kind, name]
        assert (sources / "/".join(path)).is_dir() or (sources / f"{'/'.join(path)}.rs").is_file()


def test_a_text_that_is_not_there_once_is_refused() -> None:
    module = tool()
    error = module.Error("name", "", "file.rs", "a + b", "a - b", ())
    assert module.spoil(error, "x = a + b;") == "x = a - b;"
    for text in ("x = a;", "x = a + b; y = a + b;"):
        with pytest.raises(SystemExit, match="must be once"):
            module.spoil(error, text)


SOURCE = """
const SIZE: [f64; 2] = [1.0, 2.0]; // { no body
impl<'a> Known<'a> {
    /// A brace in a comment: {
    fn two(&'a self, x: [f64; 2]) -> [f64; 2] {
        let each = |i: usize| { let y = x[i]; y + 1.0 };
        [each(0), each(1)]
    }
}
const fn fixed() -> usize { 3 }
fn three() -> usize { fn inner() -> usize { 4 } inner() - '}'.len_utf8() }
"""


@pytest.mark.parametrize(
    ("old", "new", "joined"),
    [
        ("y + 1.0", "y - 1.0", True),
        ("each(0), each(1)", "each(1), each(0)", True),
        ("{ 4 }", "{ 5 }", True),
        ("2.0]; //", "3.0]; //", False),
        ("{ 3 }", "{ 2 }", False),
    ],
)
def test_errors_in_functions_share_a_build(old: str, new: str, joined: bool) -> None:
    """The source with a choice is the old one, or the spoilt one, once the choice is made."""
    tool()
    module = importlib.import_module("errors_together")
    error = tool().Error("name", "", "file.rs", old, new, ())
    text, found = module.together(SOURCE, [(7, error)], "crates/partita-model/src/file.rs")
    assert [one for one, _ in found] == [error] * joined
    if not joined:
        assert text == SOURCE
        return
    ((_, body),) = found
    choice = text[body.begin : body.end].removeprefix("{ if partita_math::deliberate(7) ").removesuffix(" }")
    size = (len(choice) - len(" else ") - (len(new) - len(old))) // 2
    spoilt, right = choice[: -size - len(" else ")], choice[-size:]
    assert text[: body.begin] + right + text[body.end :] == SOURCE
    assert spoilt == right.replace(old, new) != right
