"""All tests as other processors run them: held to older instructions, and with drawings in other last digits.

    python tools/processors/suite.py [sse2] [avx2] [avx512] [moved-1] [moved-2] [-- arguments of pytest]

With `sse2`, `avx2` and `avx512` a program that asks for the processor's instructions is told of no wider ones
(`held.c`; Linux, x86-64, with a kernel and a processor that can trap the question), so that lanes, NumPy and its linear
algebra run as they do there. `moved-SEED` moves every number of a drawing by one unit in its last place
(tests/python/moved_drawings.py).
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "out" / "processors"
SETS = ("sse2", "avx2", "avx512")
ALL = (*SETS, "moved-1", "moved-2")


def library() -> Path:
    """The library that holds a process to an instruction set, compiled."""
    made = OUT / "held.so"
    OUT.mkdir(parents=True, exist_ok=True)
    source = Path(__file__).with_name("held.c")
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-Wall", "-Wextra", "-Werror", source, "-o", made], check=True)
    return made


def environment(name: str) -> dict[str, str]:
    """The variables by which a run of the tests differs from an ordinary one."""
    if name in SETS:
        return {"HELD_TO": name, "LD_PRELOAD": str(library())}
    if name.startswith("moved-"):
        return {"PARTITA_MOVED_DRAWINGS": name.removeprefix("moved-")}
    raise SystemExit(f"{name!r} is none of {', '.join(ALL)}; any number may follow moved-")


def tested(name: str, arguments: list[str]) -> bool:
    """Whether all tests pass; the tests of the core too, where drawings are not what differs."""
    here = {key: value for key, value in os.environ.items() if not key.startswith("OPENBLAS_CORE")}
    other = environment(name)
    # what traps the question is a signal that Python's own handler of faults would take for its own
    pytest = [sys.executable, "-m", "pytest", "-q", "-p", "no:faulthandler", *arguments]
    passed = subprocess.run(pytest, cwd=ROOT, env={**here, **other}, check=False).returncode == 0
    if name in SETS and not arguments:
        runner = " ".join(["env", *(f"{key}={value}" for key, value in other.items())])
        target = "CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUNNER"
        core = ["cargo", "test", "--release", "--workspace", "--locked", "--quiet"]
        passed &= subprocess.run(core, cwd=ROOT, env={**here, target: runner}, check=False).returncode == 0
    return passed


def main() -> int:
    words = sys.argv[1:]
    cut = words.index("--") if "--" in words else len(words)
    names, arguments = words[:cut] or list(ALL), words[cut + 1 :]
    if set(names) & set(SETS) and (sys.platform != "linux" or platform.machine() != "x86_64"):
        raise SystemExit("instructions are held on Linux and x86-64 only; moved-1 and moved-2 run everywhere")
    failed = [name for name in names if not tested(name, arguments)]
    print(f"tests failed with {', '.join(failed)}" if failed else f"all tests passed with {', '.join(names)}")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
