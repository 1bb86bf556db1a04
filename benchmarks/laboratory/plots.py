"""Plots as small SVG files, the same bytes for the same numbers."""

from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from panostitch.debug.ink import colour
from report import Plot

STYLE = {
    "svg.fonttype": "none",  # letters stay letters: small files that can be searched
    "svg.hashsalt": "laboratory",
    "font.family": "sans-serif",
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "legend.frameon": False,
    "legend.fontsize": 8,
}
SIZE = (6.8, 4.0)  # inches
MARKS = "osD^vPX*"


def draw(plot: Plot, path: Path) -> None:
    """Write a plot as SVG."""
    with mpl.rc_context(STYLE):
        figure = Figure(SIZE, layout="constrained")
        axes = figure.add_subplot(title=plot.title, xlabel=plot.x_label, ylabel=plot.y_label)
        for n, series in enumerate(plot.series):
            ink = tuple(value / 255 for value in colour(n))
            style = {"linestyle": "--"} if series.theory else {"marker": MARKS[n % len(MARKS)], "markersize": 4}
            axes.plot(series.x, series.y, label=series.label, color=ink, linewidth=1.5, **style)
        if plot.log_x:
            axes.set_xscale("log")
        if plot.log_y:
            axes.set_yscale("log")
        axes.legend()
        figure.patch.set_facecolor("white")
        figure.savefig(path, metadata={"Date": None, "Creator": None})
