"""The stub of the compiled core names what the binary has, with the same parameters in the same order."""

import ast
import inspect
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import partita
from partita import _core

STUB = Path(partita.__file__).with_name("_core.pyi")
TREE = ast.parse(STUB.read_text("utf-8"), filename=str(STUB))
CLASSES = {node.name: node for node in TREE.body if isinstance(node, ast.ClassDef)}
FUNCTIONS = {node.name: node for node in TREE.body if isinstance(node, ast.FunctionDef)}
WORDS = {node.target.id for node in TREE.body if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)}
"""Lists of words that the core hands out."""


def is_property(node: ast.FunctionDef) -> bool:
    return any(isinstance(mark, ast.Name) and mark.id == "property" for mark in node.decorator_list)


def members(node: ast.ClassDef) -> dict[str, ast.FunctionDef]:
    return {item.name: item for item in node.body if isinstance(item, ast.FunctionDef)}


def written(node: ast.FunctionDef) -> list[tuple[str, bool]]:
    """(name, has a default) of each parameter of the stub, `self` left out."""
    names = [argument.arg for argument in node.args.posonlyargs + node.args.args]
    optional = len(names) - len(node.args.defaults)
    listed = [(name, index >= optional) for index, name in enumerate(names) if name != "self"]
    keyword = zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
    return listed + [(argument.arg, default is not None) for argument, default in keyword]


def compiled(thing: Any) -> list[tuple[str, bool]]:
    """The same of what the binary says about itself."""
    parameters = inspect.signature(thing).parameters.values()
    return [(p.name, p.default is not inspect.Parameter.empty) for p in parameters if p.name != "self"]


def public(thing: ModuleType | type) -> set[str]:
    return {name for name in vars(thing) if not name.startswith("_")}


def test_same_names_in_the_module() -> None:
    assert public(_core) == set(CLASSES) | set(FUNCTIONS) | WORDS
    for name in WORDS:
        words = getattr(_core, name)
        assert isinstance(words, tuple)
        assert all(isinstance(word, str) for word in words)


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_function_signature(name: str) -> None:
    assert compiled(getattr(_core, name)) == written(FUNCTIONS[name])


@pytest.mark.parametrize("name", sorted(CLASSES))
def test_same_names_in_the_class(name: str) -> None:
    assert public(getattr(_core, name)) == {item for item in members(CLASSES[name]) if not item.startswith("_")}


@pytest.mark.parametrize("name", sorted(CLASSES))
def test_class_signatures(name: str) -> None:
    found = getattr(_core, name)
    for member, node in members(CLASSES[name]).items():
        if member == "__init__":
            assert compiled(found) == written(node), f"{name}()"
        elif is_property(node):
            assert inspect.isgetsetdescriptor(vars(found)[member]), f"{name}.{member} is a property in the stub"
        else:
            assert compiled(vars(found)[member]) == written(node), f"{name}.{member}"
