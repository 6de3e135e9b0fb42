"""Robots' files (URDF with loops beside it), exact and rounded: all assemble, have one mobility, and run.

The folder of their folders is named by the environment variable GEOMETRY_STUDY_ROBOTS.
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
import time
import warnings
from pathlib import Path

import partita as pt

PLACES = re.compile(r'\b(xyz|rpy)="([^"]*)"')
DIGITS = (None, 6, 5, 4)


def rounded(folder: Path, digits: int | None, to: Path) -> Path:
    """A copy of the folder with every place and every angle rounded."""
    shutil.copytree(folder, to)
    path = to / "robot.urdf"
    if digits is not None:

        def fewer(found: re.Match[str]) -> str:
            return f'{found[1]}="{" ".join(f"{float(x):.{digits}f}" for x in found[2].split())}"'

        path.write_text(PLACES.sub(fewer, path.read_text()))
    return path


def study() -> bool:
    """A line for each robot and kind of coordinates; true if all of them agree and run."""
    held = True
    for folder in sorted(p for p in Path(os.environ["GEOMETRY_STUDY_ROBOTS"]).iterdir() if p.is_dir()):
        for coordinates in ("relative", "absolute"):
            reported, faults, began = [], [], time.process_time()
            for digits in DIGITS:
                with tempfile.TemporaryDirectory() as temporary, warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    try:
                        m = pt.load(rounded(folder, digits, Path(temporary) / "robot"))
                        reported.append(m.compile(coordinates=coordinates).mobility)
                        report = m.report(coordinates=coordinates).to_dict()["mobility"]
                        start = m.assemble(coordinates=coordinates)
                        run = m.simulate(0.2, initial=start, coordinates=coordinates)
                        if report != reported[-1]:
                            faults.append(f"{digits or 'all'} digits: report {report}, model {reported[-1]}")
                        if run.certificate.verdict != "valid" or not run.success:
                            faults.append(f"{digits or 'all'} digits: {run.certificate.verdict}, {run.message}"[:160])
                    except pt.errors.PartitaError as error:
                        faults.append(f"{digits or 'all'} digits: {type(error).__name__}: {error}"[:200])
            if len(set(reported)) != 1:
                faults.append("mobilities differ")
            held = held and not faults
            seconds = time.process_time() - began
            print(
                f"{folder.name} {coordinates}: mobility {reported}, {seconds:.1f} s; {'; '.join(faults) or 'right'}",
                flush=True,
            )
    return held
