"""The linker of wheels for Linux, zig's: what it links is kept, to be linked again in an order of functions.

python tools/linking.py KEPT SYSTEM ARGUMENT ...

Called by cargo for everything it links, with its arguments. Functions may stand in any order, and a wheel is
compressed: `arranged` puts similar ones beside each other, where deflate, which looks back 32 kB, finds them. The order
is that of the linker's own search (balanced partitioning), the same every time. The binary inside FMUs has the order of
the module, else its difference to it would not be small.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

MODULE, FMU = "lib_core.so", "libpartita_fmu.so"
LINKER = "ld.lld "
"""How the line begins that shows what the compiler calls."""
STAYS = {".rlib", ".a"}
"""Files that are there after the call; cargo removes the others."""
PLACED = re.compile(r":\(\.text\.(?:unlikely\.|hot\.)?(\S+)\)$", flags=re.MULTILINE)
"""A function in the map of a linked file: each has a section of its own, which has its name."""


def main(given: list[str]) -> int:
    """Link as asked; keep the calls of the linker for the two that are shipped."""
    kept, system, *arguments = Path(given[0]), *given[1:]
    command = ["cargo-zigbuild", "zig", "cc", "--", "-fno-sanitize=all", "-target", system, *arguments]
    linked = arguments[arguments.index("-o") + 1] if "-o" in arguments else ""
    name = Path(linked).name
    if name not in (MODULE, FMU):
        return subprocess.run(command, check=False).returncode
    shown = subprocess.run([*command, "-v"], check=False, capture_output=True, text=True)
    if shown.returncode:
        print(shown.stderr, file=sys.stderr)
        return shown.returncode
    keep(kept / name, called(shown.stderr, linked), linked)
    return 0


def called(shown: str, linked: str) -> list[str]:
    """The arguments with which zig's compiler called its linker, from what it showed: where it is called for the first
    time, it links libraries of the system too."""
    lines = [line.split()[1:] for line in shown.splitlines() if line.startswith(LINKER)]
    lines = [line for line in lines if linked in line]
    if len(lines) != 1:
        raise SystemExit(
            f"zig shows no call of its linker for {linked}, so its functions cannot be ordered: look at what "
            "`zig cc -v` shows, and build in a folder without blanks in its name"
        )
    return lines[0]


def keep(folder: Path, call: list[str], linked: str) -> None:
    """Write a call down, without what it makes, and copy the files that will not stay."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    at = call.index(linked)
    call = call[: at - 1] + call[at + 1 :]
    for i, word in enumerate(call):
        path = Path(word)
        if path.is_absolute() and path.is_file() and path.suffix not in STAYS and ".so" not in path.name:
            call[i] = str(shutil.copy(path, folder / f"{i}-{path.name}"))
    (folder / "call.json").write_text(json.dumps(call), "utf-8")


def arranged(kept: Path) -> tuple[Path, Path]:
    """The module and the binary inside FMUs, linked again with their functions in one order."""
    similar = placed(linked(kept, MODULE, "--bp-compression-sort=both"))
    order = kept / "order.txt"
    order.write_text("".join(f"{name}\n" for name in similar), "utf-8")
    for name in (MODULE, FMU):
        linked(kept, name, f"--symbol-ordering-file={order}", "--no-warn-symbol-ordering")
    return kept / MODULE / MODULE, kept / FMU / FMU


def linked(kept: Path, name: str, *options: str) -> str:
    """Link one of the two again, with these options; its map."""
    folder = kept / name
    if not (folder / "call.json").is_file():
        raise SystemExit(f"nothing is kept of how {name} was linked: remove {kept.parents[1]} and build again")
    call = json.loads((folder / "call.json").read_text("utf-8"))
    result = ["-o", str(folder / name), f"--Map={folder / 'map.txt'}"]
    subprocess.run([sys.executable, "-m", "ziglang", "ld.lld", *call, *result, *options], check=True)
    return (folder / "map.txt").read_text("utf-8")


def placed(text: str) -> list[str]:
    """The functions in a map, in their order, each once."""
    return list(dict.fromkeys(PLACED.findall(text)))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
