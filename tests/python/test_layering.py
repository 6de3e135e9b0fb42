"""Imports go down, never up or sideways.

    python/partita
    partita-py
    partita-analysis
    partita-integrate | partita-model
    partita-system
    partita-math

The Rust half reads the manifests and the sources of the crates, the Python half the imports of the package.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CRATES = ROOT / "crates"
PACKAGE = ROOT / "python" / "partita"

FLOOR = {"math": 0, "system": 1, "integrate": 2, "model": 2, "analysis": 3, "py": 4}
"""Floor of each crate; a crate sees the floors below its own and nothing beside it."""

ONLY_IN = {"pyo3": {"py"}, "numpy": {"py"}, "faer": {"math", "system", "analysis"}}
"""Crates from outside that belong to certain floors: Python stays at the door, linear algebra below."""

CORE_USERS = {"__init__", "builder", "io", "partition", "results", "system"}
"""The modules of the package that talk to the compiled core; the others work on what these hand out."""

USE = re.compile(r"\bpartita_(\w+)(?=\s*(?:::|;|as\b))")
"""`partita_math::dense`, `use partita_math;`, `use partita_math as math`."""

LEAVES = {"errors", "units"}
"""Modules that know nothing of the rest of the package, errors excepted."""

MECHANICS = {"scipy.linalg", "scipy.sparse", "scipy.integrate", "scipy.optimize"}
"""Solving belongs to the core. The catalogue alone may, to compare the core with an independent answer."""

SOLVERS = {"solve", "inv", "pinv", "lstsq", "qr", "cholesky", "matrix_rank"}
"""Names of numpy.linalg that solve equations. Norms, nearest rotations and planes of best fit are geometry."""


def crate_names() -> list[str]:
    return sorted(path.parent.name.removeprefix("partita-") for path in CRATES.glob("*/Cargo.toml"))


def dependencies(crate: str) -> set[str]:
    """Names under every dependency table of a crate's manifest, tests' and targets' included."""
    names: set[str] = set()
    inside = False
    for line in (CRATES / f"partita-{crate}" / "Cargo.toml").read_text("utf-8").splitlines():
        if line.startswith("["):
            table = line.strip().strip("[]")
            inside = table.endswith("dependencies")
            if match := re.search(r"dependencies\.([\w-]+)$", table):
                names.add(match[1])
        elif inside and (match := re.match(r"([\w-]+)\s*[.=]", line)):
            names.add(match[1])
    return names


def rust_sources(crate: str) -> list[Path]:
    return sorted((CRATES / f"partita-{crate}").rglob("*.rs"))


def without_comments(source: str) -> str:
    """Rust without its comments: prose may name any floor."""
    return re.sub(r"//[^\n]*|/\*.*?\*/", "", source, flags=re.DOTALL)


def python_modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def room(path: Path) -> str:
    """First name below `partita`: "results" for results/joint.py, "units" for units.py."""
    first = path.relative_to(PACKAGE).parts[0]
    return first.removesuffix(".py")


def imported(path: Path) -> Iterator[tuple[int, str]]:
    """(line, dotted name) of everything a module imports, relative imports resolved."""
    package = ("partita", *path.relative_to(PACKAGE).parts[:-1])
    for node in ast.walk(ast.parse(path.read_text("utf-8"), filename=str(path))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            start = ".".join([*base, *([node.module] if node.module else [])])
            yield from ((node.lineno, f"{start}.{alias.name}") for alias in node.names)


def below(name: str, prefix: str) -> bool:
    return name == prefix or name.startswith(prefix + ".")


def where(path: Path, line: int) -> str:
    return f"{path.relative_to(ROOT)}:{line}"


def test_every_crate_has_a_floor() -> None:
    assert crate_names() == sorted(FLOOR)


@pytest.mark.parametrize("crate", sorted(FLOOR))
def test_manifest_asks_only_for_lower_floors(crate: str) -> None:
    wanted = {name.removeprefix("partita-") for name in dependencies(crate) if name.startswith("partita-")}
    wrong = {name for name in wanted if FLOOR[name] >= FLOOR[crate]}
    assert not wrong, f"partita-{crate} asks for {sorted(wrong)}, which are not below it"


@pytest.mark.parametrize("crate", sorted(FLOOR))
def test_sources_use_only_lower_floors(crate: str) -> None:
    assert rust_sources(crate), f"partita-{crate} has no sources"
    wrong = [
        f"{path.relative_to(ROOT)}: partita_{name}"
        for path in rust_sources(crate)
        for name in set(USE.findall(without_comments(path.read_text("utf-8"))))
        if name in FLOOR and name != crate and FLOOR[name] >= FLOOR[crate]
    ]
    assert not wrong, wrong


@pytest.mark.parametrize("crate", sorted(FLOOR))
def test_outside_crates_stay_on_their_floors(crate: str) -> None:
    wrong = [name for name in dependencies(crate) if name in ONLY_IN and crate not in ONLY_IN[name]]
    assert not wrong, f"partita-{crate} asks for {wrong}"


def test_only_the_doors_import_the_core() -> None:
    wrong = [
        where(path, line)
        for path in python_modules()
        if room(path) not in CORE_USERS
        for line, name in imported(path)
        if below(name, "partita._core")
    ]
    assert not wrong, wrong


def test_leaves_import_nothing_of_the_package() -> None:
    wrong = [
        f"{where(path, line)}: {name}"
        for path in python_modules()
        if room(path) in LEAVES
        for line, name in imported(path)
        if below(name, "partita") and not below(name, "partita.errors")
    ]
    assert not wrong, wrong


def test_nothing_below_imports_the_command_line() -> None:
    wrong = [
        where(path, line)
        for path in python_modules()
        if room(path) not in {"cli", "__main__"}
        for line, name in imported(path)
        if below(name, "partita.cli")
    ]
    assert not wrong, wrong


def test_the_package_solves_nothing_itself() -> None:
    wrong = []
    for path in python_modules():
        if room(path) == "catalogue":
            continue
        wrong += [
            f"{where(path, line)}: {name}"
            for line, name in imported(path)
            if any(below(name, module) for module in MECHANICS)
        ]
        wrong += [
            f"{where(path, node.lineno)}: linalg.{node.attr}"
            for node in ast.walk(ast.parse(path.read_text("utf-8")))
            if isinstance(node, ast.Attribute)
            and node.attr in SOLVERS
            and getattr(node.value, "attr", getattr(node.value, "id", "")) == "linalg"
        ]
    assert not wrong, wrong
