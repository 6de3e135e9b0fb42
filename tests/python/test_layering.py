"""Imports go down, never up or sideways.

    python/partita
    partita-py | partita-fmu | partita (the face of the crates)
    partita-analysis
    partita-integrate | partita-model
    partita-system | partita-compiled
    partita-math

The Rust half reads the manifests and the sources of the crates, the Python half the imports of the package. Inside a
crate, and inside the package, the graph of imports has no circle: between modules, and between the rooms they stand in.
"""

import ast
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CRATES = ROOT / "crates"
PACKAGE = ROOT / "python" / "partita"

FLOOR = {
    "math": 0,
    "system": 1,
    "compiled": 1,
    "integrate": 2,
    "model": 2,
    "analysis": 3,
    "py": 4,
    "fmu": 4,
    "web": 4,
    "face": 4,
    "tests": 4,
    "tests-hand": 4,
}
"""Floor of each crate; a crate sees the floors below its own and nothing beside it. Nothing stands on tests."""

ONLY_IN = {"pyo3": {"py"}, "numpy": {"py"}, "faer": {"math", "system", "analysis"}}
"""Crates from outside that belong to certain floors: Python stays at the door, linear algebra below."""

WITHOUT_CIRCLES = ("analysis", "compiled", "fmu", "integrate", "math", "model", "py", "system")
"""Crates whose rooms are held to it that none uses itself by way of others."""

CORE_USERS = {"__init__", "builder", "io", "options", "partition", "results", "sweep", "system"}
"""The modules of the package that talk to the compiled core; the others work on what these return."""

USE = re.compile(r"\bpartita_(\w+)(?=\s*(?:::|;|as\b))")
"""`partita_math::dense`, `use partita_math;`, `use partita_math as math`."""

LEAVES = {"errors", "numeric", "units"}
"""Modules that know nothing of the rest of the package, errors and numbers excepted."""

MECHANICS = {"scipy.linalg", "scipy.sparse", "scipy.integrate", "scipy.optimize"}
"""Solving belongs to the core. The catalogue alone may, to compare the core with an independent answer."""

SOLVERS = {"solve", "inv", "pinv", "lstsq", "qr", "cholesky", "matrix_rank"}
"""Names of numpy.linalg that solve equations. Norms, nearest rotations and planes of best fit are geometry."""


def folder(crate: str) -> Path:
    return CRATES / ("partita" if crate == "face" else f"partita-{crate}")


def crate_names() -> list[str]:
    names = (path.parent.name for path in CRATES.glob("*/Cargo.toml"))
    return sorted("face" if name == "partita" else name.removeprefix("partita-") for name in names)


def dependencies(crate: str) -> set[str]:
    """Names under every dependency table of a crate's manifest, tests' and targets' included."""
    names: set[str] = set()
    inside = False
    for line in (folder(crate) / "Cargo.toml").read_text("utf-8").splitlines():
        if line.startswith("["):
            table = line.strip().strip("[]")
            inside = table.endswith("dependencies")
            if match := re.search(r"dependencies\.([\w-]+)$", table):
                names.add(match[1])
        elif inside and (match := re.match(r"([\w-]+)\s*[.=]", line)):
            names.add(match[1])
    return names


def rust_sources(crate: str) -> list[Path]:
    return sorted(folder(crate).rglob("*.rs"))


def without_comments(source: str) -> str:
    """Rust without its comments: prose may name any floor."""
    return re.sub(r"//[^\n]*|/\*.*?\*/", "", source, flags=re.DOTALL)


def python_modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def room(path: Path) -> str:
    """First name below `partita`: "results" for results/joint.py, "units" for units.py."""
    first = path.relative_to(PACKAGE).parts[0]
    return first.removesuffix(".py")


@cache
def tree_of(path: Path) -> ast.Module:
    """What stands in a module; many tests look at all of them."""
    return ast.parse(path.read_text("utf-8"), filename=str(path))


def imported(path: Path) -> Iterator[tuple[int, str]]:
    """(line, dotted name) of everything a module imports, relative imports resolved."""
    package = ("partita", *path.relative_to(PACKAGE).parts[:-1])
    for node in ast.walk(tree_of(path)):
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


def circle(graph: Mapping[str, set[str]]) -> list[str]:
    """A circle of the graph, from a node back to itself; empty if there is none."""
    left = {node: {other for other in others if other != node} for node, others in graph.items()}
    while True:
        ends = {node for node, others in left.items() if not others & left.keys()}
        if not ends:
            break
        left = {node: others for node, others in left.items() if node not in ends}
    if not left:
        return []
    path = [min(left)]
    while path[-1] not in path[:-1]:
        path.append(min(left[path[-1]] & left.keys()))
    return path[path.index(path[-1]) :]


def between_rooms(graph: Mapping[str, set[str]], room_of: Mapping[str, str]) -> dict[str, set[str]]:
    """The graph of the rooms in which the nodes of a graph stand."""
    rooms: dict[str, set[str]] = {room: set() for room in room_of.values()}
    for node, others in graph.items():
        rooms[room_of[node]] |= {room_of[other] for other in others}
    return rooms


@cache
def package_graph() -> dict[str, set[str]]:
    """Modules of the package and what each imports of it: late imports and those for types alone count as well."""
    names = {dotted(path): path for path in python_modules()}
    graph: dict[str, set[str]] = {}
    for module, path in names.items():
        wanted = [name for _, name in imported(path) if below(name, "partita") and not below(name, "partita._core")]
        graph[module] = {longest_known(name, names) for name in wanted}
    return graph


def dotted(path: Path) -> str:
    """Dotted name of a module: "partita.results" for results/__init__.py."""
    parts = ["partita", *path.relative_to(PACKAGE).with_suffix("").parts]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def longest_known(name: str, known: Mapping[str, Path]) -> str:
    """The module that a dotted name leads to; the rest of the name is something in it."""
    while name not in known:
        name = name.rpartition(".")[0]
    return name


@cache
def crate_graph(crate: str) -> dict[str, set[str]]:
    """Rooms of a crate (files and folders in src) and those that each uses, unit tests left out."""
    source = CRATES / f"partita-{crate}" / "src"
    files = {path: crate_room(path, source) for path in source.rglob("*.rs") if path.name not in ("lib.rs", "main.rs")}
    rooms = set(files.values())
    handed_on = re_exports((source / "lib.rs").read_text("utf-8"), rooms)
    graph: dict[str, set[str]] = {room: set() for room in rooms}
    for path, here in files.items():
        text = without_tests(without_comments(path.read_text("utf-8")))
        names = {handed_on.get(name, name) for name in crate_names_used(text, module_depth(path, source))}
        graph[here] |= names & rooms
    return graph


def crate_room(path: Path, source: Path) -> str:
    return path.relative_to(source).parts[0].removesuffix(".rs")


def module_depth(path: Path, source: Path) -> int:
    """How many `super` lead from a module to the root of its crate."""
    parts = path.relative_to(source).with_suffix("").parts
    return len(parts) - (parts[-1] == "mod")


def re_exports(root: str, rooms: set[str]) -> dict[str, str]:
    """Names that the root of a crate hands on, with the room that each comes from."""
    found: dict[str, str] = {}
    for room_name, names in re.findall(r"pub use (?:crate::)?(\w+)::([^;]*);", without_comments(root)):
        if room_name in rooms:
            found |= dict.fromkeys(re.findall(r"\w+", names), room_name)
    return found


def without_tests(source: str) -> str:
    """Rust without its unit tests, which stand last in a file."""
    return re.split(r"#\[cfg\(test\)\]\s*(?:pub(?:\(crate\))? )?mod \w+ \{", source)[0]


def crate_names_used(source: str, depth: int) -> set[str]:
    """First names of all paths that begin at the root of the crate, those in braces included."""
    root = r"(?<![\w:])(?:crate|" + "::".join(["super"] * depth) + r")::"
    found = set(re.findall(root + r"(\w+)", source))
    for match in re.finditer(root + r"\{", source):
        level, names = 1, ""
        for letter in source[match.end() :]:
            level += (letter == "{") - (letter == "}")
            if level == 0:
                break
            names += letter if level == 1 else ""
        found |= {name[0] for item in names.split(",") if (name := re.findall(r"\w+", item))}
    return found


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
        if below(name, "partita")
        and not any(below(name, f"partita.{leaf}") for leaf in ("errors", "numeric", room(path)))
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
        # the integral of a prescribed acceleration over time is no mechanics, nor are the equations between the ends of
        # whole runs
        if room(path) == "catalogue" or path.name in ("integrals.py", "algebra.py"):
            continue
        wrong += [
            f"{where(path, line)}: {name}"
            for line, name in imported(path)
            if any(below(name, module) for module in MECHANICS)
        ]
        wrong += [
            f"{where(path, node.lineno)}: linalg.{node.attr}"
            for node in ast.walk(tree_of(path))
            if isinstance(node, ast.Attribute)
            and node.attr in SOLVERS
            and getattr(node.value, "attr", getattr(node.value, "id", "")) == "linalg"
        ]
    assert not wrong, wrong


def test_assertions_of_the_core_are_those_that_are_shipped() -> None:
    """Tests are built as it is shipped, and would run no other ones."""
    assert not [p for p in CRATES.rglob("*.rs") if "debug_assert" in p.read_text("utf-8")]


def test_no_module_of_the_package_imports_itself_by_way_of_others() -> None:
    assert not circle(package_graph())


def test_no_room_of_the_package_imports_itself_by_way_of_others() -> None:
    graph = package_graph()
    assert not circle(between_rooms(graph, {name: (*name.split("."), "__init__")[1] for name in graph}))


@pytest.mark.parametrize("crate", WITHOUT_CIRCLES)
def test_no_room_of_a_crate_uses_itself_by_way_of_others(crate: str) -> None:
    assert not circle(crate_graph(crate))


def test_a_circle_is_found_and_a_path_is_not() -> None:
    assert circle({"a": {"b"}, "b": {"c"}, "c": set()}) == []
    assert circle({"a": {"b"}, "b": {"c", "d"}, "c": {"b"}, "d": set()}) == ["b", "c", "b"]
    assert circle({"a": {"a"}}) == []


def test_paths_from_the_root_of_a_crate_are_found() -> None:
    source = "use crate::{one, two::{Deep, other}, three::X as Y};\nlet x = crate::four::f(super::super::five::G);"
    assert crate_names_used(source, 2) == {"one", "two", "three", "four", "five"}


def test_every_room_that_the_pages_name_exists() -> None:
    text = "".join((ROOT / page).read_text("utf-8") for page in ("ARCHITECTURE.md", "docs/modules.md"))
    named = re.findall(
        r"`((?:crates/)?(?:partita-\w+/src|python/partita|docs|examples|benches|tools)/?[\w./-]*)`", text
    )
    missing = [name for name in named if not ((ROOT / name).exists() or (CRATES / name).exists())]
    assert len(named) > 20
    assert not missing
    assert all(len(line) <= 120 for line in (ROOT / "docs" / "modules.md").read_text("utf-8").splitlines())


def methods(text: str) -> dict[str, int]:
    """Number of methods, required and provided, of each trait of a source."""
    found = {}
    for head in re.finditer(r"^(?:pub(?:\(\w+\))? )?trait (\w+)[^{;]*\{", text, re.MULTILINE):
        depth, end = 1, head.end()
        while depth:
            depth += {"{": 1, "}": -1}.get(text[end], 0)
            end += 1
        found[head[1]] = len(re.findall(r"^    (?:const )?fn ", text[head.end() : end], re.MULTILINE))
    return found


def test_a_trait_has_one_duty() -> None:
    """Twelve methods at the most."""
    counted = {}
    for path in sorted((ROOT / "crates").glob("*/src/**/*.rs")):
        counted |= methods(path.read_text(encoding="utf-8"))
    assert counted
    assert not {name: count for name, count in counted.items() if count > 12}


def core_sources() -> dict[str, str]:
    """The core's sources without their tests, by their paths below `crates`."""
    paths = sorted(
        p for p in CRATES.glob("*/src/**/*.rs") if not p.relative_to(CRATES).parts[0].startswith("partita-tests")
    )
    kept = [p for p in paths if p.name != "tests.rs"]
    return {p.relative_to(CRATES).as_posix(): without_tests(p.read_text("utf-8")) for p in kept}


def test_one_loop_closes_positions_and_one_follows_curves() -> None:
    """Who needs a closed position hands its linear step to `close`, who needs a path its tangent to `follow`."""
    sources = core_sources()
    loops = r"fn \w+<[^>]*: (?:\w+::)*(Linearization|Curve)\b"
    homes = {(name, found) for name, text in sources.items() for found in re.findall(loops, text)}
    manifold = "partita-system/src/manifold"
    assert homes == {(f"{manifold}/close.rs", "Linearization"), (f"{manifold}/follow.rs", "Curve")}
    # linear steps of whole systems: asked for by what the loop calls, or once by what corrects a step
    steps = r"\.(?:dependent_step|move_dependent|pivoted_least_norm)\(|\bpivoted_least_norm\("
    defined = ("partita-math/src/factor.rs", "partita-system/src/reduction/")
    asked = {name for name, text in sources.items() if re.search(steps, text) and not name.startswith(defined)}
    assert asked == {f"{manifold}/kept_rows.rs", f"{manifold}/truncated.rs"}


RANKED = {
    "partita-system/src/rank/exact.rs": "the verdict on a mechanism",
    "partita-system/src/start.rs": "systems of which none was made: equations by hand, rolling",
    "partita-system/src/reduction/rows.rs": "which of the rows serve, their number known",
    "partita-model/src/loop_closure/instant.rs": "rows within the columns of a block of a closing, columns for rows",
    "partita-analysis/src/mobility.rs": "which of several drives come too late, their number known",
    "partita-analysis/src/poses/continuation.rs": "which goals of a pose are free of each other",
    "partita-analysis/src/matrices.rs": "a matrix handed in without a mechanism",
}
"""Which files request independent rows, and of what."""


def test_rank_is_decided_in_one_room() -> None:
    ranks = r"\b(?:independent_rows|preferred_rows|weighed_rows)\("
    asked = {name for name, text in core_sources().items() if re.search(ranks, text)}
    assert asked - {"partita-math/src/rank.rs"} == set(RANKED)
