"""Optional packages: imported on first use, and named together with their extra where they are missing."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from typing import Any

from .errors import MissingDependencyError, PartitaError


def check_not_ending() -> None:
    """Refuse to compute when the interpreter ends and cannot import what NumPy still wants."""
    if sys.meta_path is None:
        raise PartitaError(
            "the interpreter is ending, so nothing can be computed; compute before, in atexit.register or a with block"
        )


def extra(package: str, name: str, purpose: str) -> Any:
    """The module `package`, which comes with the extra `name` and which `purpose` needs; else
    `MissingDependencyError`."""
    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise missing(package, name, purpose) from error


def wanted(packages: tuple[str, ...], name: str, purpose: str) -> None:
    """The same check without importing: before a long run, not after."""
    for package in packages:
        try:
            found = importlib.util.find_spec(package)
        except ValueError:  # a module without a specification is installed all the same
            continue
        if found is None:
            raise missing(package, name, purpose)


def missing(package: str, name: str, purpose: str) -> MissingDependencyError:
    """The error for an optional package that is not installed."""
    package = package.partition(".")[0]
    return MissingDependencyError(
        f"{purpose} needs {package}, which is not installed; pip install 'partita[{name}]'", package=package
    )
