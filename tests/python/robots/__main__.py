"""`python -m robots FOLDER [--root FOLDER] [--against pinocchio|drake|mujoco]`; returns 1 if one program disagrees."""

import sys

from .study import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
