"""Plots as small SVG files, the same bytes for the same numbers."""

from pathlib import Path

import matplotlib as mpl
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

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
SIZE = (6.8, 4.4)  # inches
COLUMNS = 3  # of the legend
FEW_DECADES = 200  # from the least to the largest value: up to here 2 and 5 are written too
THEORY = {"linestyle": "--", "color": "black", "zorder": 5}
MARKS = "osD^vPX*"


def draw(plot: Plot, path: Path) -> None:
    """Write a plot as SVG."""
    with mpl.rc_context(STYLE):
        figure = Figure(SIZE, layout="constrained", facecolor="white")
        axes = figure.add_subplot(title=plot.title, xlabel=plot.x_label, ylabel=plot.y_label)
        for n, series in enumerate(plot.series):
            ink = tuple(value / 255 for value in colour(n))
            style = {"marker": MARKS[n % len(MARKS)], "markersize": 4, "color": ink}
            axes.plot(series.x, series.y, label=series.label, linewidth=1.5, **(THEORY if series.theory else style))
        if plot.log_x:
            axes.set_xscale("log")
            plain_decades(axes.xaxis)
        if plot.log_y:
            axes.set_yscale("log")
            plain_decades(axes.yaxis)
        figure.legend(loc="outside lower center", ncols=COLUMNS)
        figure.savefig(path, metadata={"Date": None, "Creator": None})


def plain_decades(axis: Axis) -> None:
    """Plain numbers on a logarithmic axis."""
    low, high = axis.get_view_interval()
    steps = (1, 2, 5) if high / low < FEW_DECADES else (1,)
    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
