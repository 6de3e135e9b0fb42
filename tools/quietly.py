"""Run a long command without its output: `python tools/quietly.py "what it does" "how long" command ...`.

One line says what is done and how long that takes, and how long it took; the output is shown if the command fails. With
VERBOSE=1 in the environment it is shown as it comes. It needs nothing but Python: it runs before anything is installed.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time


def main(what: str, usual: str, *command: str) -> int:
    """The exit code of the command."""
    began = time.monotonic()
    print(f"{what} ({usual}) ...", end=" ", flush=True)
    if os.environ.get("VERBOSE"):
        print(flush=True)
        return subprocess.run(command, check=False).returncode
    with tempfile.TemporaryFile() as output:
        try:
            code = subprocess.run(command, stdout=output, stderr=subprocess.STDOUT, check=False).returncode
        except KeyboardInterrupt:
            print("interrupted", flush=True)
            return 130
        except OSError as error:
            print(f"failed: {error}", flush=True)
            return 127
        print("failed:" if code else f"{time.monotonic() - began:.0f} s", flush=True)
        if code:
            output.seek(0)
            sys.stdout.flush()
            sys.stdout.buffer.write(output.read())
            sys.stdout.flush()
            print(f"{what} failed with exit code {code}: {' '.join(command)}", file=sys.stderr)
        return code


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
