"""The core inside pages, python/partita/_web/partita_web.wasm: `python tools/web_module.py`.

It needs Rust's target wasm32-unknown-unknown, which rustup adds by network. Where it cannot be had, one line says so
and nothing is built: pages that need it are then refused with the reason, and their tests are skipped.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGET = "wasm32-unknown-unknown"
MODULE = ROOT / "python" / "partita" / "_web" / "partita_web.wasm"
PATIENCE = 120
"""Seconds that rustup may take to add the target."""


def main() -> int:
    """Build the module and put it in place."""
    if not has_target():
        print(f"Rust has no target {TARGET} here and rustup cannot add it: pages that hold the core are not built")
        return 0
    folder = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    command = ["cargo", "build", "--profile", "web", "--locked", "-p", "partita-web", "--target", TARGET]
    code = subprocess.run([*command, "--target-dir", str(folder)], cwd=ROOT, check=False).returncode
    if code == 0:
        MODULE.parent.mkdir(exist_ok=True)
        draft = MODULE.with_suffix(".draft")
        shutil.copyfile(folder / TARGET / "web" / MODULE.name, draft)
        draft.replace(MODULE)
    return code


def has_target() -> bool:
    """Whether Rust compiles for pages, once rustup was asked to add the target."""
    if installed():
        return True
    if shutil.which("rustup") is None:
        return False
    try:
        subprocess.run(
            ["rustup", "target", "add", TARGET], cwd=ROOT, check=False, timeout=PATIENCE, capture_output=True
        )
    except subprocess.TimeoutExpired:
        return False
    return installed()


def installed() -> bool:
    """Whether the libraries of the target are there."""
    asked = ["rustc", "--print", "target-libdir", "--target", TARGET]
    found = subprocess.run(asked, cwd=ROOT, check=False, capture_output=True, text=True)
    return found.returncode == 0 and any(Path(found.stdout.strip()).glob("libstd-*.rlib"))


if __name__ == "__main__":
    sys.exit(main())
