"""Extras say how large they are: the table of docs/dependencies.md beside what is installed here."""

from __future__ import annotations

import importlib.metadata
import re
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
METADATA = importlib.metadata.metadata("partita")
MEGABYTE = 1e6


def required(names: list[str], extras: frozenset[str], found: dict[str, float]) -> dict[str, float]:
    """Distributions that these requirements bring, and their sizes [MB]."""
    for text in names:
        need = Requirement(text)
        wanted = extras | {""}
        if need.marker is not None and not any(need.marker.evaluate({"extra": extra}) for extra in wanted):
            continue
        name = need.name.lower().replace("_", "-")
        own = frozenset(need.extras)
        if name != "partita" and name in found:
            continue
        distribution = importlib.metadata.distribution(name)
        if name != "partita":
            files = [file.locate() for file in distribution.files or ()]
            found[name] = sum(Path(str(f)).stat().st_size for f in files if Path(str(f)).is_file()) / MEGABYTE
        required(distribution.requires or [], own, found)
    return found


@pytest.mark.skipif(sys.platform != "linux", reason="the table states the sizes of packages for Linux")
def test_the_table_of_sizes_is_that_of_what_is_installed() -> None:
    page = (ROOT / "docs" / "dependencies.md").read_text("utf-8")
    lines = re.findall(r"^\| usual .*\n\|.*\n\|.*$", page, re.MULTILINE)[0].split("\n")
    names, sizes = ([cell.strip() for cell in line.strip("|").split("|")] for line in (lines[0], lines[2]))
    assert set(names) == set(METADATA.get_all("Provides-Extra") or ())
    base = required(["numpy", "scipy"], frozenset(), {})
    for name, stated in zip(names, sizes, strict=True):
        try:
            found = required([f"partita[{name}]"], frozenset(), {})
        except importlib.metadata.PackageNotFoundError:
            continue  # an extra that the tests do without
        added = sum(size for package, size in found.items() if package not in base)
        assert 0.6 * added - 2.0 <= float(stated) <= 1.7 * added + 2.0, (name, stated, added)
