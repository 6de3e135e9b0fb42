"""What must not depend on the processor: lanes, code and levels, held to older instructions (tools/processors)."""

from __future__ import annotations

import importlib.util
import json
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from moved_drawings import MOVED, moved

import partita as pt

PLACE = Path(__file__).resolve().parents[2] / "tools" / "processors" / "suite.py"


def tool() -> Any:
    found = importlib.util.spec_from_file_location("processors_suite", PLACE)
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


PROGRAM = """
import hashlib, json, numpy, partita as pt
from numpy._core._multiarray_umath import __cpu_features__ as has
m = pt.catalogue.load("four-bar")
s = [m.assemble(rates={"A": w}) for w in (1.0, 2.0, 3.0, -1.5, 0.5)]
many = m.ensemble(states=s, t_eval=[0.0, 0.2])
one = [m.simulate(0.2, initial=s[1], t_eval=[0.0, 0.2], compiled=c).q for c in (True, False)]
hashes = [hashlib.sha256(x.tobytes()).hexdigest() for x in (many.q, *one)]
print(json.dumps([[k for k in ("AVX2", "AVX512F") if has[k]], *hashes]))
"""


@pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64", reason="instructions are held on Linux only"
)
@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler here")
def test_lanes_code_and_levels_have_the_same_bits_with_older_instructions() -> None:
    found: dict[str, Any] = {}
    for name in tool().SETS:
        run = subprocess.run(
            [sys.executable, "-c", PROGRAM],
            env={**os.environ, **tool().environment(name)},
            capture_output=True,
            text=True,
        )
        if run.returncode == 3 and "cannot trap CPUID" in run.stderr:
            pytest.skip("this kernel or processor cannot trap CPUID")
        assert run.returncode == 0, run.stderr
        found[name] = json.loads(run.stdout)
    assert found["sse2"][0] == [] and "AVX512F" not in found["avx2"][0]
    assert found["sse2"][1:] == found["avx2"][1:] == found["avx512"][1:]


def test_a_moved_drawing_has_other_last_digits_and_nothing_else() -> None:
    text = pt.catalogue.load("andrews-squeezer").compile().description
    one, again, two = moved(text, "1"), moved(text, "1"), moved(text, "2")
    assert one == again != two

    def compare(drawn: Any, other: Any, key: str = "") -> int:
        if isinstance(drawn, dict):
            assert drawn.keys() == other.keys()
            return sum(compare(drawn[k], other[k], k) for k in drawn)
        if isinstance(drawn, list):
            assert len(drawn) == len(other)
            return sum(compare(x, y, key) for x, y in zip(drawn, other, strict=True))
        if isinstance(drawn, float) and drawn and key in MOVED:
            assert abs(other - drawn) <= np.spacing(abs(drawn)) and other != drawn
            return 1
        assert drawn == other
        return 0

    drawn, other = json.loads(text), json.loads(one)
    if os.environ.get("PARTITA_MOVED_DRAWINGS") is None:
        assert compare({**drawn, "bodies": [{**b, "shape": 0} for b in drawn["bodies"]]},
                       {**other, "bodies": [{**b, "shape": 0} for b in other["bodies"]]}) > 50  # fmt: skip
    inertia = np.array([body["inertia"] for body in other["bodies"]])
    assert np.array_equal(inertia, inertia.transpose(0, 2, 1))
