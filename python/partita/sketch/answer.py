"""What the core says about a drawing, for the page: degrees of freedom, messages, gaps, files."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import DescriptionError, PartitaError
from ..io.toml_writer import document
from ..mechanism import Mechanism
from ..mechanism.seen import still
from .calls import carriers, mechanism_of, script_of
from .drawing import Drawing


def answer(drawing: Drawing) -> dict[str, Any]:
    """The findings. `kind`: "empty", "moves", "rigid", "open" (it does not assemble) or "refused" (it has no meaning).

    `closed` has the nodes once the loops are closed, where bars have other lengths than drawn; `gaps` what stays open
    where they cannot be closed.
    """
    found: dict[str, Any] = {
        "kind": "empty", "message": "Draw a bar: press where it begins, drag to where it ends.", "redundancy": "",
        "remarks": [], "mobility": None, "gaps": [], "closed": None, "toml": None, "python": None,
    }  # fmt: skip
    if not drawing.bars and not drawing.slides:
        return found
    try:
        m = mechanism_of(drawing)
        found["toml"], found["python"] = document(m), script_of(drawing)
        return found | judged(m, drawing)
    except PartitaError as error:
        return found | {"kind": "refused", "message": error.message}


def judged(m: Mechanism, drawing: Drawing) -> dict[str, Any]:
    """Whether it closes and moves."""
    checked = m.check()
    if not checked.closes or checked.report is None:
        shown = still(m, None)
        gaps = [{"label": gap.label, "points": [list(map(float, p[:2])) for p in gap.ends]} for gap in shown.gaps]
        return {"kind": "open", "message": checked.why, "remarks": list(checked.remarks), "gaps": gaps}
    report = checked.report.to_dict()
    mobility = int(report["mobility"])
    driven = len(drawing.motors)
    moves = mobility > 0 or driven > 0
    words = f"{mobility} degree{'' if mobility == 1 else 's'} of freedom"
    if driven:
        words += f" besides {driven} motor{'' if driven == 1 else 's'}"
    if not moves:
        words = "Rigid: 0 degrees of freedom. Remove a bar or a ground to let it move"
    lengths = any(bar.length is not None for bar in drawing.bars)
    return {
        "kind": "moves" if moves else "rigid",
        "message": f"{words}.",
        "redundancy": report["redundancy"],
        "remarks": list(checked.remarks),
        "mobility": mobility,
        "closed": node_positions(m, drawing) if lengths else None,
    }


def node_positions(m: Mechanism, drawing: Drawing) -> dict[str, list[float]]:
    """Where the nodes of the drawing are once the loops are closed."""
    shown, found = still(m, None), {}
    for node, (body, at) in carriers(drawing).items():
        point = np.array([*at, 0.0])
        if body in shown.bodies:
            local = np.array(m.bodies[body].world(point)[1])
            pose = shown.bodies[body]
            point = pose.position[0] + pose.rotation[0] @ local
        found[str(node)] = [float(point[0]), float(point[1])]
    return found


def runs(drawing: Drawing) -> Mechanism:
    """The mechanism, where there is something that can run.

    Raises what the core finds wrong with it.
    """
    if not drawing.bars and not drawing.slides:
        raise DescriptionError("there is nothing to run; draw a bar first", element="mechanism", name="drawing")
    return mechanism_of(drawing)
