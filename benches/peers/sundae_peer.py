"""SUNDIALS by scikit-sundae: CVODE (BDF) and IDA on Partita's equations in C, dense Jacobians by differences."""

from __future__ import annotations

import sys
from importlib.metadata import version
from time import perf_counter
from typing import Any

import numpy as np
from sksundae.cvode import CVODE
from sksundae.ida import IDA
from stiff_rates import MOST, Known, Rates, Tried

STEPS = 2_000_000
LONGEST = 10.0


def cvode(known: Known, rates: Rates, rtol: float) -> Any:
    options = {"method": "BDF", "rtol": rtol, "atol": rtol / 100.0, "max_num_steps": STEPS}
    solver = CVODE(lambda t, y, dy: rates.into(t, y, dy), **options)
    return solver.solve(np.array([0.0, known.duration]), np.array(known.y0))


def ida(known: Known, rates: Rates, rtol: float) -> Any:
    y0 = np.array(known.y0)
    f = np.empty(len(y0))

    def residual(t: float, y: np.ndarray, dy: np.ndarray, to: np.ndarray) -> None:
        rates.into(t, y, f)
        np.subtract(dy, f, out=to)

    solver = IDA(residual, rtol=rtol, atol=rtol / 100.0, max_num_steps=STEPS)
    return solver.solve(np.array([0.0, known.duration]), y0, rates(0.0, y0))


def tried(known: Known) -> list[Tried]:
    found = []
    each = Rates(known).each()
    for kind, run in (("CVODE, BDF", cvode), ("IDA", ida)):
        for exponent in range(3, 13):
            rates, rtol = Rates(known), 10.0**-exponent
            start = perf_counter()
            try:
                y = run(known, rates, rtol).y[-1]
            except Exception as error:
                print(kind, rtol, error, file=sys.stderr)
                if rates.calls > MOST:
                    break
                continue
            seconds, calls = perf_counter() - start, rates.calls
            found.append(Tried(kind, f"rtol {rtol:.0e}", seconds, known.error(y), calls, 0, calls, calls * each))
            if seconds > LONGEST:
                break
    return found


if __name__ == "__main__":
    import json
    from dataclasses import asdict

    done = tried(Known.read(sys.argv[1]))
    print(
        json.dumps({"peer": f"SUNDIALS, scikit-sundae {version('scikit-sundae')}", "tried": [asdict(x) for x in done]})
    )
