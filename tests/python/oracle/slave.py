"""An FMU as another program runs it: unpacked, loaded, and called by its C functions alone."""

from __future__ import annotations

import ctypes
import json
import os
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path
from typing import Any

STEP = 0.02
"""A communication step, if none is given [s]."""

Double, Size, Byte, Pointer, Text = ctypes.c_double, ctypes.c_size_t, ctypes.c_uint8, ctypes.c_void_p, ctypes.c_char_p


class Instance:
    """One instance of an FMU of either version; `messages` is what it logged.

    By FMI 3.0 too, `references` has the number of each value; `arrays` are those that are one variable, with their
    lengths, and are read and written whole.
    """

    def __init__(self, path: Path, folder: Path, guid: str | None = None) -> None:
        with zipfile.ZipFile(path) as packed:
            packed.extractall(folder)
            binary = next(n for n in packed.namelist() if n.startswith("binaries/"))
            self.model = json.loads(packed.read("resources/model.json"))
            described = ElementTree.fromstring(packed.read("modelDescription.xml"))
        self.version = described.get("fmiVersion")
        self.arrays: dict[int, int] = {}
        self.references: dict[str, int] = {}
        for x in [*described.iter("ScalarVariable"), *described.iter("Float64")]:
            name, first = str(x.get("name")), int(str(x.get("valueReference")))
            dimension = x.find("Dimension")
            if dimension is None:
                self.references[name] = first
                continue
            size = self.arrays[first] = int(str(dimension.get("start")))
            along = x.get("causality") == "parameter" or name.endswith((".force", ".moment"))
            letters = "xyz" if size == 3 and along else range(size)
            self.references |= {f"{name}.{letter}": first + i for i, letter in enumerate(letters)}
        self.messages: list[str] = []
        self.library = ctypes.CDLL(str(folder / binary))
        guid = self.model["guid"] if guid is None else guid
        made = self._made_2 if self.version == "2.0" else self._made_3
        self.at = made(guid.encode(), folder / "resources")

    def _made_2(self, guid: bytes, resources: Path) -> int | None:
        def log(_: Any, __: bytes, status: int, category: bytes, message: bytes) -> None:
            self.messages.append(message.decode())

        self.logger = ctypes.CFUNCTYPE(None, Pointer, Text, ctypes.c_int, Text, Text)(log)
        self.callbacks = (Pointer * 5)(ctypes.cast(self.logger, Pointer).value, None, None, None, None)
        make = self.library.fmi2Instantiate
        make.restype = Pointer
        return make(b"it", 1, guid, resources.as_uri().encode(), ctypes.byref(self.callbacks), 0, 1)

    def _made_3(self, token: bytes, resources: Path) -> int | None:
        def log(_: Any, status: int, category: bytes, message: bytes) -> None:
            self.messages.append(message.decode())

        self.logger = ctypes.CFUNCTYPE(None, Pointer, ctypes.c_int, Text, Text)(log)
        make = self.library.fmi3InstantiateCoSimulation
        make.restype = Pointer
        flags = [ctypes.c_bool(x) for x in (False, True, False, False)]
        place = f"{resources}{os.sep}".encode()
        return make(b"it", token, place, *flags, None, Size(0), None, self.logger, None)

    def call(self, name: str, *arguments: Any) -> int:
        """The function of this name of FMI 3.0, or the one of FMI 2.0 that does the same."""
        if self.version == "2.0":
            name = name.replace("FMUState", "FMUstate").replace("Deserialize", "DeSerialize")
        function = getattr(self.library, f"fmi{self.version[:1]}{name}")  # type: ignore[index]
        return int(function(Pointer(self.at), *arguments))

    def enter(self, t: float = 0.0, tolerance: float | None = None) -> None:
        """Into the initialisation."""
        given = ctypes.c_int(tolerance is not None)
        times = (given, Double(tolerance or 0.0), Double(t), ctypes.c_int(0), Double(0))
        if self.version == "2.0":
            assert self.call("SetupExperiment", *times) == 0
            assert self.call("EnterInitializationMode") == 0
        else:
            assert self.call("EnterInitializationMode", *times) == 0

    def begin(self, t: float = 0.0) -> None:
        """Through it."""
        self.enter(t)
        assert self.call("ExitInitializationMode") == 0

    def step(self, t: float, step: float = STEP) -> int:
        if self.version == "2.0":
            return self.call("DoStep", Double(t), Double(step), 1)
        flags, reached = [Byte(7) for _ in range(3)], Double()
        status = self.call(
            "DoStep", Double(t), Double(step), ctypes.c_bool(True), *map(ctypes.byref, flags), ctypes.byref(reached)
        )
        if status < 2:
            assert [x.value for x in flags] == [0, 0, 0] and reached.value == t + step
        return status

    def set(self, reference: int, value: float) -> int:
        first, size = self._variable(reference)
        values = [value]
        if size > 1:
            values = self._read([first], size)
            values[reference - first] = value
        return self.write([first], values)

    def write(self, references: list[int], values: list[float]) -> int:
        """Set variables."""
        room = () if self.version == "2.0" else (Size(len(values)),)
        name = "SetReal" if self.version == "2.0" else "SetFloat64"
        return self.call(name, *_references(references), (Double * len(values))(*values), *room)

    def get(self, *references: int) -> list[float]:
        variables = dict(map(self._variable, references))
        values = iter(self._read(list(variables), sum(variables.values())))
        found = {first + i: next(values) for first, size in variables.items() for i in range(size)}
        return [found[reference] for reference in references]

    def _variable(self, reference: int) -> tuple[int, int]:
        """The value reference of the variable that a value is part of, and how many it has."""
        found = [(first, size) for first, size in self.arrays.items() if first <= reference < first + size]
        return found[0] if found else (reference, 1)

    def _read(self, references: list[int], count: int) -> list[float]:
        values = (Double * count)()
        status = self.read(references, values, count)
        assert status == 0, self.messages
        return list(values)

    def read(self, references: list[int] | None, values: Any, count: int) -> int:
        """Get variables, into an array."""
        name = "GetReal" if self.version == "2.0" else "GetFloat64"
        given = (None, Size(1)) if references is None else _references(references)
        return self.call(name, *given, values, *(() if self.version == "2.0" else (Size(count),)))

    def free(self) -> None:
        if self.at:
            free = getattr(self.library, f"fmi{self.version[:1]}FreeInstance")  # type: ignore[index]
            free(Pointer(self.at))
            self.at = None


def _references(references: list[int]) -> tuple[Any, Any]:
    return (ctypes.c_uint32 * len(references))(*references), Size(len(references))
