"""What a model is, so that a store is not continued with another one: its code and what the code refers to.

Python does not know what a function will call; so a model is its own code, its defaults and closure, and the functions,
classes and constants of its module that this code names, and theirs. What it names of other modules counts by name.
"""

from __future__ import annotations

import functools
import hashlib
import pickle
from collections.abc import Mapping
from types import (
    BuiltinFunctionType,
    CodeType,
    FunctionType,
    GetSetDescriptorType,
    MemberDescriptorType,
    MethodType,
    ModuleType,
)
from typing import Any

import numpy as np


def name_of(model: Any) -> str:
    """A model in messages."""
    while isinstance(model, functools.partial):
        model = model.func
    kind = model if hasattr(model, "__qualname__") else type(model)
    return f"{kind.__module__}.{kind.__qualname__}"


def digest_of(model: Any) -> str:
    """SHA-256 of a model; the same in another process with the same version of Python."""
    digest = _Digest()
    digest.add(model)
    return digest.sha.hexdigest()


class _Digest:
    """Each object that is met is added once; a second time its number stands for it."""

    def __init__(self) -> None:
        self.sha = hashlib.sha256()
        self.known: dict[int, int] = {}
        self.kept: list[Any] = []  # an object that is gone would lend its identity to another one

    def text(self, *words: str) -> None:
        for word in words:
            self.sha.update(f"{len(word)}:{word}".encode("utf-8", "surrogatepass"))

    def add(self, value: Any) -> None:
        """Add a value of any type."""
        if value is None or isinstance(value, (bool, int, float, complex, str, bytes)) or value is Ellipsis:
            self.text(type(value).__name__, repr(value))
            return
        if id(value) in self.known:
            self.text("again", str(self.known[id(value)]))
            return
        self.known[id(value)] = len(self.known)
        self.kept.append(value)
        self._add_object(value)

    def _add_object(self, value: Any) -> None:
        if isinstance(value, (tuple, list)):
            self._all(type(value).__name__, value)
        elif isinstance(value, Mapping):
            self._all("mapping", [part for item in value.items() for part in item])
        elif isinstance(value, (set, frozenset)):
            self._all("set", sorted(value, key=repr))
        elif isinstance(value, CodeType):
            self.text("code", value.co_code.hex())
            self._all("names", [value.co_names, value.co_varnames, value.co_freevars, value.co_cellvars])
            self._all("constants", value.co_consts)
        elif isinstance(value, MethodType):
            self._all("method", [value.__func__, value.__self__])
        elif isinstance(value, FunctionType):
            self._function(value)
        elif isinstance(value, functools.partial):
            self._all("partial", [value.func, value.args, value.keywords])
        elif isinstance(value, type):
            self.text("class", value.__qualname__)
            self._all("members", [part for name, part in vars(value).items() if _counts(name, part)])
        elif isinstance(value, (staticmethod, classmethod)):
            self._all("method", [value.__func__])
        elif isinstance(value, property):
            self._all("property", [value.fget])
        elif callable(getattr(value, "__wrapped__", None)) and not isinstance(value, FunctionType):
            self._all("wrapped", [value.__wrapped__])
        elif isinstance(value, (ModuleType, BuiltinFunctionType)):
            self.text("named", value.__name__)
        elif isinstance(value, np.ndarray) and value.dtype.kind != "O":
            self.text("array", str(value.dtype), str(value.shape), value.tobytes().hex())
        else:
            self._other(value)

    def _all(self, kind: str, parts: Any) -> None:
        self.text(kind, str(len(parts)))
        for part in parts:
            self.add(part)

    def _function(self, function: FunctionType) -> None:
        self.text("function", function.__qualname__)
        cells = [cell.cell_contents for cell in function.__closure__ or () if _is_full(cell)]
        self._all("state", [function.__code__, function.__defaults__, function.__kwdefaults__, cells])
        used = sorted(_names(function.__code__) & function.__globals__.keys())
        for name in used:
            value = function.__globals__[name]
            self.text("global", name)
            if isinstance(value, (FunctionType, type)) and value.__module__ != function.__module__:
                self.text("named", value.__module__ or "", value.__qualname__)
            else:
                self.add(value)

    def _other(self, value: Any) -> None:
        """An object: its class, and its state where that can be written."""
        self.text("object", type(value).__module__, type(value).__qualname__)
        try:
            self.text(hashlib.sha256(pickle.dumps(value, protocol=4)).hexdigest())
        except Exception:
            self.text("state unknown")
        call = getattr(type(value), "__call__", None)  # noqa: B004  # its code is asked for, not whether there is one
        if isinstance(call, FunctionType):
            self.add(call)


def _counts(name: str, part: Any) -> bool:
    """Whether a member of a class is code or a constant, and not what Python puts there."""
    return not isinstance(part, (GetSetDescriptorType, MemberDescriptorType)) and name not in ("__module__", "__doc__")


def _is_full(cell: Any) -> bool:
    try:
        cell.cell_contents  # noqa: B018  # which raises
    except ValueError:
        return False
    return True


def _names(code: CodeType) -> set[str]:
    """Global names that code uses, functions within it included."""
    inner = [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    return {*code.co_names, *(name for one in inner for name in _names(one))}
