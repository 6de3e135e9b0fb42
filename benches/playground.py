"""What a frame of a playground costs: the page's own scripts in Node, a sixtieth of a second of motion at a time."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
from dataclasses import dataclass

from many_dof import MECHANISMS

import partita as pt
from partita.mechanism.playground import recorded
from partita.playground.page import COMPUTES, text
from partita.state import State
from partita.webpage import part_of

AIM = 8e-3
"""Seconds of a frame: half of a sixtieth of a second, the rest is for drawing."""
FRAMES = 120

SCRIPT = """
(async () => {
  const motion = makeMotion(await loadProgram(module), about);
  motion.reset(about.start);
  const frames = (count) => {
    const took = [];
    for (let i = 0; i < count; i++) {
      const from = process.cpuUsage();
      motion.advance(motion.t + frame);
      const { user, system } = process.cpuUsage(from);
      took.push((user + system) / 1e3);
    }
    return took;
  };
  const first = frames(1)[0];
  frames(count);
  const before = motion.evaluations, took = frames(count).sort((x, z) => x - z);
  console.log(JSON.stringify({
    seconds: took[count >> 1] / 1e3, first: first / 1e3, evaluations: (motion.evaluations - before) / count,
  }));
})();
"""


@dataclass(frozen=True)
class Frame:
    """CPU seconds of the median frame and of the first, evaluations of a frame, bytes of the module."""

    seconds: float
    first: float
    evaluations: float
    module: int


def mechanisms() -> dict[str, tuple[pt.Mechanism, State | None, float]]:
    """Each with its start and the speed at which its page is looked at."""
    chain = MECHANISMS["four-bar chain"](40)
    return {
        "four-bar": (pt.catalogue.load("four-bar"), None, 1.0),
        "Andrews' squeezer": (pt.catalogue.load("andrews-squeezer"), None, 0.01),
        "chain of 40 loops": (chain, chain.assemble(rates={"P0": -1.0}), 1.0),
        "40 four-bars side by side": (MECHANISMS["side by side"](40), None, 1.0),
        "40 five-bar loops": (MECHANISMS["five-bar loops"](40), None, 1.0),
        "40 four-bars in series": (MECHANISMS["in series"](40), None, 0.1),
    }


def frame_costs() -> dict[str, Frame]:
    """Measured; empty where there is no Node."""
    node = shutil.which("node")
    if node is None:
        return {}
    found = {}
    for title, (mechanism, initial, speed) in mechanisms().items():
        made = recorded(mechanism, initial)
        scripts = "\n".join((part_of("partita", "tolerance.js"), *map(text, COMPUTES)))
        given = {
            "about": made.about,
            "module": base64.b64encode(made.module).decode("ascii"),
            "frame": speed / 60.0,
            "count": FRAMES,
        }
        head = "\n".join(f"const {name} = {json.dumps(value)};" for name, value in given.items())
        done = subprocess.run(
            [node, "-"], input=f"{head}\n{scripts}\n{SCRIPT}", capture_output=True, text=True, check=True
        )
        found[title] = Frame(**json.loads(done.stdout), module=len(made.module))
    return found
