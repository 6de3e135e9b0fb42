"""`python -m geometry_study [family] [N] [seed]`: a table, and the seeds of what went wrong."""

from __future__ import annotations

import os
import sys

for library in ("OPENBLAS", "MKL", "OMP"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

from .study import main  # noqa: E402

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
