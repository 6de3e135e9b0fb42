"""Figures of twelve mechanisms side by side on one sheet, to be looked at: `python tools/contact_sheet.py WORD`."""

import argparse
from io import BytesIO
from pathlib import Path

import matplotlib.image as mpimg
import numpy as np
from matplotlib.figure import Figure

import partita as pt

# Each with the joint whose angle or travel an engineer would put along the bottom.
TWELVE = {
    "four-bar": "A", "slider-crank": "", "engine-inline-four": "main", "engine-v-twin": "main", "andrews-squeezer": "O",
    "double-wishbone": "lower hinge", "stewart-ups": "", "bennett": "A", "jansen-leg": "", "five-bar": "",
    "scissor-lift": "", "whitworth": "",
}  # fmt: skip


def main() -> None:
    """Run the twelve, draw each, and put the pictures on one sheet in out/."""
    parser = argparse.ArgumentParser(description="figures of twelve mechanisms on one sheet")
    parser.add_argument("word", nargs="?", default="overview", help="a word of run.plot")
    parser.add_argument("--over", action="store_true", help="over the angle of the crank in the place of time")
    parser.add_argument("--out", type=Path, default=Path("out/contact-sheet.png"))
    options = parser.parse_args()
    pictures = []
    for name, crank in TWELVE.items():
        run = pt.catalogue.entry(name).simulate()
        leading = crank or _turning(run)
        run = _turns(name, run, leading)
        x = leading if options.over else None
        stream = BytesIO()
        run.plot(options.word, x=x).savefig(stream, format="png", dpi=60)
        stream.seek(0)
        pictures.append(mpimg.imread(stream))
    height, width = (max(p.shape[i] for p in pictures) for i in (0, 1))
    sheet = Figure(figsize=(3 * width / 100, 4 * height / 100), dpi=100)
    for n, picture in enumerate(pictures):
        ax = sheet.add_axes(((n % 3) / 3, 1 - (n // 3 + 1) / 4, 1 / 3, 1 / 4))
        ax.imshow(picture)
        ax.set_axis_off()
    options.out.parent.mkdir(parents=True, exist_ok=True)
    sheet.savefig(options.out)
    print(options.out)


def _turns(name: str, run: pt.results.Result, leading: str) -> pt.results.Result:
    """The same run up to its first three turns, as more would fill a band, or until it has come to rest."""
    angle = run.joint(leading).position[:, 0]
    past = np.flatnonzero(np.abs(angle - angle[0]) > 6 * np.pi)
    speed = np.abs(run.v).max(axis=1)
    alive = np.flatnonzero(speed > 0.02 * speed.max())
    end = float(run.t[past[0]] if len(past) else 1.2 * run.t[alive[-1]])
    if end >= run.t[-1]:
        return run
    entry = pt.catalogue.entry(name)
    return pt.catalogue.load(name).simulate(
        end, initial=run.state(0.0), t_eval=np.linspace(0, end, 721), **entry.options
    )


def _turning(run: pt.results.Result) -> str:
    """The joint with one coordinate that goes farthest."""
    single = [name for name in run.names.joints if run.joint(name).position.shape[1] == 1]
    return max(single, key=lambda name: float(run.joint(name).position.max() - run.joint(name).position.min()))


if __name__ == "__main__":
    main()
