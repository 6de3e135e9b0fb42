"""An FMU as another program runs it: unpacked, loaded, and called by its C functions alone."""

from __future__ import annotations

import ctypes
import json
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path
from typing import Any

STEP = 0.02
"""A communication step, if none is given [s]."""


class Instance:
    """One instance of an FMU; `messages` is what it logged."""

    def __init__(self, path: Path, folder: Path, guid: str | None = None) -> None:
        with zipfile.ZipFile(path) as packed:
            packed.extractall(folder)
            binary = next(n for n in packed.namelist() if n.startswith("binaries/"))
            self.model = json.loads(packed.read("resources/model.json"))
            described = ElementTree.fromstring(packed.read("modelDescription.xml"))
        variables = described.iter("ScalarVariable")
        self.references = {str(x.get("name")): int(str(x.get("valueReference"))) for x in variables}
        self.messages: list[str] = []
        kind = ctypes.CFUNCTYPE(
            None, *[ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p]
        )

        def log(_: Any, __: bytes, status: int, category: bytes, message: bytes) -> None:
            self.messages.append(message.decode())

        self.logger = kind(log)
        self.callbacks = (ctypes.c_void_p * 5)(ctypes.cast(self.logger, ctypes.c_void_p).value, None, None, None, None)
        self.library = ctypes.CDLL(str(folder / binary))
        make = self.library.fmi2Instantiate
        make.restype = ctypes.c_void_p
        uri = (folder / "resources").as_uri()
        guid = self.model["guid"] if guid is None else guid
        self.at = make(b"it", 1, guid.encode(), uri.encode(), ctypes.byref(self.callbacks), 0, 1)

    def call(self, name: str, *arguments: Any) -> int:
        return int(getattr(self.library, name)(ctypes.c_void_p(self.at), *arguments))

    def begin(self, t: float = 0.0) -> None:
        assert self.call("fmi2SetupExperiment", 0, ctypes.c_double(0), ctypes.c_double(t), 0, ctypes.c_double(0)) == 0
        assert self.call("fmi2EnterInitializationMode") == 0
        assert self.call("fmi2ExitInitializationMode") == 0

    def step(self, t: float, step: float = STEP) -> int:
        return self.call("fmi2DoStep", ctypes.c_double(t), ctypes.c_double(step), 1)

    def set(self, reference: int, value: float) -> int:
        return self.call(
            "fmi2SetReal", (ctypes.c_uint * 1)(reference), ctypes.c_size_t(1), (ctypes.c_double * 1)(value)
        )

    def get(self, *references: int) -> list[float]:
        values = (ctypes.c_double * len(references))()
        count = ctypes.c_size_t(len(references))
        assert self.call("fmi2GetReal", (ctypes.c_uint * len(references))(*references), count, values) == 0, (
            self.messages
        )
        return list(values)

    def free(self) -> None:
        if self.at:
            self.library.fmi2FreeInstance(ctypes.c_void_p(self.at))
            self.at = None
