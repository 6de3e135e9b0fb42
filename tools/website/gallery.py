"""The gallery: every mechanism of the catalogue with its picture, its facts and its animated page."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from partita import catalogue
from partita.errors import PartitaError
from partita.plots.measure import draw_measure
from partita.plots.style import COLOURS, dressed, new_figure
from partita.results import Result
from partita.viewer import scene
from partita.viewer.pose import Pose
from partita.viewer.stage import Stage

Points = NDArray[np.float64]
ANSWERED = "With published or closed-form answers"
SIZE = (440, 300)
"""Pixels of a picture of the gallery, twice those on a screen."""
WORDS = 96
"""Rows of a film's picture that hold its title and its scales: cut off."""
BAR, SHOWN, MOST_TIMES = 0.05, 0.3, 20.0
"""A mechanism flatter than the first number is shown in part: as flat as the second, at most so many times as large."""
QUALITY, OUTPUTS = "quality", 121


def build(folder: Path, live: Path, only: tuple[str, ...] | None = None) -> None:
    """Pages into `folder`, animated pages into `live`; `only` some of the mechanisms."""
    folder.mkdir(parents=True, exist_ok=True)
    live.mkdir(parents=True, exist_ok=True)
    cards: dict[str, list[str]] = {}
    names: list[str] = []
    for theme, members in themes().items():
        for name in members:
            if only is None or name in only:
                cards.setdefault(theme, []).append(_mechanism(name, folder, live))
                names.append(name)
    parts = ["# Gallery", INTRODUCTION]
    parts += [f'## {theme}\n\n<div class="gallery">\n{"".join(shown)}</div>' for theme, shown in cards.items()]
    listed = "\n".join(names)
    parts.append(f"```{{toctree}}\n:hidden:\n\n{listed}\n```")
    (folder / "index.md").write_text("\n\n".join([*parts, ""]), encoding="utf-8")


INTRODUCTION = (
    "Every mechanism of the [catalogue](../catalogue.md), drawn and run when these pages were made. Open one to play "
    "its motion: drag to turn, wheel to zoom, slide through time. The pages ask for no network."
)


def themes() -> dict[str, list[str]]:
    """Theme -> names; all entries of the catalogue, each once."""
    found = {theme: list(members) for theme, members in catalogue.zoo.THEMES.items()}
    return {ANSWERED: [name for name in catalogue.names() if name not in catalogue.zoo.ENTRIES], **found}


def _mechanism(name: str, folder: Path, live: Path) -> str:
    """Write the pages of one mechanism; its card."""
    entry = catalogue.entry(name)
    run = entry.simulate()
    run.to_html(live / f"{name}.html")
    picture(run, live / f"{name}.png")
    judged = []
    if run.independent.shape[1] and not entry.has_events:  # else all is prescribed, or is so at times
        over = quality(entry, run, folder / QUALITY / f"{name}.png")
        judged = [
            f"[The measure](../measure.md) of each velocity and the quality of the choice over {over}:",
            f"![rho of the velocities with the chosen ones on top; volume, sigma and sqrt(mu)]({QUALITY}/{name}.png)",
        ]
    title = entry.title[0].upper() + entry.title[1:]
    summary = run.summary
    facts = [
        ("bodies, joints", f"{len(summary['bodies'])}, {len(summary['joints'])}"),
        ("degrees of freedom", str(entry.mechanism().compile().mobility)),
        ("redundant constraints", str(len(summary["removed"]))),
        ("run", f"{entry.duration:g} s, {run.certificate.verdict}"),
        ("largest closure error", f"{run.certificate.closure:.1e}"),
    ]
    if run.certificate.energy_balance is not None:
        facts.append(("energy balance", f"{run.certificate.energy_balance:.1e}"))
    why = [f"{entry.truth.why[0].upper()}{entry.truth.why[1:]}."] if entry.truth else []
    text = [
        f"# {name}",
        f"{title}.",
        f'<iframe class="live" src="../live/{name}.html#play" title="{escape(name)} in motion" '
        'loading="lazy"></iframe>',
        f'<p><a href="../live/{name}.html">The animated page alone</a></p>',
        "| | |\n|---|---|\n" + "\n".join(f"| {what} | {value} |" for what, value in facts),
        *why,
        *([entry.notes] if entry.notes else []),
        *judged,
        f"Source: {entry.source}.",
        f'```python\nimport partita as pt\n\nentry = pt.catalogue.entry("{name}")\nrun = entry.simulate()\n'
        f'run.to_html("{name}.html")\n```',
    ]
    (folder / f"{name}.md").write_text("\n\n".join([*text, ""]), encoding="utf-8")
    return (
        f'<a class="card" href="{name}.html"><img src="../live/{name}.png" alt="" width="{SIZE[0]}" height="{SIZE[1]}">'
        f"<b>{escape(name)}</b><span>{escape(entry.title)}</span></a>\n"
    )


def turn(run: Result) -> tuple[float, str]:
    """When the first hinge has made a whole turn, and what it is; the whole run where none does."""
    found = [(float(run.t[-1]), f"the run of {run.t[-1]:g} s")]
    for joint in run.summary["joints"]:
        angle = run.joint(joint["name"]).position
        if joint["kind"] == "revolute" and angle.shape[1] == 1:
            far = np.flatnonzero(np.abs(angle[:, 0] - angle[0, 0]) >= 2.0 * np.pi)
            found += [(float(run.t[far[0]]), f"the first turn of {joint['name']}")] if len(far) else []
    return min(found)


def quality(entry: catalogue.Entry, run: Result, path: Path) -> str:
    """Draw rho, volume, sigma and sqrt(mu) over one turn; what it is over, in words."""
    end, words = turn(run)
    m = entry.mechanism()
    shown = m.simulate(end, initial=entry.initial(m), t_eval=np.linspace(0.0, end, OUTPUTS), **entry.options)
    k = shown.independent.shape[1]
    figure = new_figure(8.6, 2.6 if k <= 3 else 3.6)  # more bands on top of the measure leave less room below
    grid = figure.add_gridspec(1, 2, width_ratios=[1.3, 1.0])
    draw_measure(shown, figure, grid[0])
    ax = dressed(figure.add_subplot(grid[1]), "Quality of the choice", "")
    lines = {"volume": volumes(shown), "σ": shown.sigma, "√μ": shown.sqrt_mu}
    for n, (label, values) in enumerate(lines.items()):
        ax.plot(shown.t, values, ("-", "--", ":")[n], color=COLOURS[n], lw=1.3, label=label)
    ax.set_ylim(-0.03, 1.05)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False)
    for each in figure.axes:
        each.xaxis.set_major_locator(MaxNLocator(5))
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path)
    return words


def volumes(run: Result) -> Points:
    """Volume of the choice at each output; NaN at singular positions."""

    def volume(output: int) -> float:
        try:
            return run.geometry(output).volume
        except PartitaError:
            return float("nan")

    return np.array([volume(output) for output in range(len(run.t))])


def picture(run: Result, path: Path) -> None:
    """The mechanism as its page shows it, a third of the way through its run, into a small image.

    Of one that is so long that it would be a bar, the middle is shown, larger.
    """
    drawn = scene.describe(run, None, packed=False)
    pose, frame = Pose(drawn), len(run.t) // 3
    wide, high = SIZE
    stage = Stage(pose, (wide, high + WORDS), forces=False, factor=1.0)
    cloud = pose.extent(stage.follows) @ np.array([stage.right, stage.up]).T
    across, tall = np.ptp(cloud, axis=0)
    if 0.0 < tall < BAR * across:
        times = min(SHOWN * across / tall, MOST_TIMES)
        stage = Stage(pose, (round(times * wide), high + WORDS), forces=False, factor=1.0)
    image = stage.picture(frame)
    left, top = (image.width - wide) // 2, WORDS // 2
    image.crop((left, top, left + wide, top + high)).quantize(64).save(path, optimize=True)
