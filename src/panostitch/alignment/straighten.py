"""Which way is up: the horizon is levelled by the photographer's own habits.

People hold a camera level far better than they hold it upright: the x axes of the cameras are all nearly horizontal,
whatever their pitch (Brown & Lowe 2007, section 5). Two things are added. Some photos are taken with the camera on its
side, where it is the y axis that is level, and some are not level at all: each photo chooses the axis that fits, and
the loss is robust (Cauchy). And photos that agree to a tenth of a degree are from a tripod or a gimbal and are believed
to as much; a weak belief that cameras look at the horizon settles only what is left open.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry import rotation
from panostitch.model.camera import Camera

Floats = NDArray[np.float64]

HAND, TRIPOD = np.deg2rad(2.0), np.deg2rad(0.1)  # how far from level cameras are
PITCH_SPREAD = np.deg2rad(25.0)
# Costs, as differences of -2 log likelihood.
ON_ITS_SIDE = 6.0  # a camera on its side among upright ones, or the reverse: one in twenty
ALL_ON_SIDE = 10.0  # a whole set: one in 150, for the metadata usually turn such photos upright
LEVELLED = 8.0  # a set from a tripod: one in fifty
TURNED = np.sin(np.deg2rad(10.0)) ** 2  # mean square of the level axes off their mean: photos over some 35 degrees
STEPS = 50
CONVERGED = 1e-12
STARTS = 24  # photos whose own axes are tried as the vertical
REFINED = 3  # of all starts
NEARLY = 0.8  # of the widest gap of a ring: as good a place to open it


@dataclass(frozen=True)
class _Axes:
    """Axes (n, 3) of the cameras in the world."""

    right: Floats
    down: Floats
    forward: Floats


@dataclass(frozen=True)
class _Habit:
    """How the photos were taken: spread (radians) of the roll, and whether most cameras were on their side."""

    spread: float
    sideways: bool


def straighten(cameras: Sequence[Camera]) -> tuple[Camera, ...]:
    """The cameras in a world whose y axis points down and whose z axis points at the middle of the view."""
    rows = np.array([camera.cam_from_world for camera in cameras])
    return centre(cameras, _vertical(_Axes(rows[:, 0], rows[:, 1], rows[:, 2])))


def _vertical(axes: _Axes) -> Floats:
    """The downward direction (3,) that the habits of photographers make the most likely."""
    found = []
    for habit in _habits(axes):
        likely = sorted(_starts(axes), key=partial(_cost, axes, habit))[:REFINED]
        found += [(habit, _refined(axes, habit, start)) for start in likely]
    vertical = min(found, key=lambda pair: _cost(axes, *pair))[1]
    on_side = _on_side(axes, vertical)
    # Only upright photos know up from down. Of a set on its side most cameras store the top of the view on the left.
    towards = axes.right.sum(0) if on_side.all() else axes.down[~on_side].sum(0)
    return -vertical if vertical @ towards < 0 else vertical


def _habits(axes: _Axes) -> list[_Habit]:
    """The habits that may explain the photos. A column of them, turned about one level axis, proves no tripod: its
    vertical is open, and some would suit all photos by chance."""
    found = []
    for sideways, level in ((False, axes.right), (True, axes.down)):
        turned = np.linalg.eigvalsh(level.T @ level)[1] > TURNED * len(level)
        found += [_Habit(float(spread), sideways) for spread in ((HAND, TRIPOD) if turned else (HAND,))]
    return found


def _starts(axes: _Axes) -> list[Floats]:
    """Verticals to start from: what suits all photos, and what suits one."""
    every = np.unique(np.linspace(0, len(axes.right) - 1, STARTS).round().astype(int))
    gaze = axes.forward.T @ axes.forward / PITCH_SPREAD**2
    return [
        *(_flattest(level.T @ level / HAND**2 + gaze) for level in (axes.right, axes.down)),
        *axes.down[every],
        *axes.right[every],
    ]


def _flattest(spread: Floats) -> Floats:
    """The direction (3,) in which a sum of squares (3, 3) is least."""
    return np.asarray(np.linalg.eigh(spread)[1][:, 0])


def _refined(axes: _Axes, habit: _Habit, vertical: Floats) -> Floats:
    """The vertical by iteratively reweighted least squares; each photo is level along its x or its y axis."""
    for _ in range(STEPS):
        on_side = _on_side(axes, vertical, habit)
        level = np.where(on_side[:, None], axes.down, axes.right)
        weight = 1 / (habit.spread**2 + (level @ vertical) ** 2 / 2)
        spread = (level * weight[:, None]).T @ level + axes.forward.T @ axes.forward / PITCH_SPREAD**2
        better = _flattest(spread)
        better = better if better @ vertical >= 0 else -better
        if np.abs(better - vertical).max() < CONVERGED:
            break
        vertical = better
    return vertical


def _losses(axes: _Axes, vertical: Floats, habit: _Habit) -> tuple[Floats, Floats]:
    """Cost (n,) of each photo if it is upright, and if it is on its side: near level the square, beyond a logarithm."""
    upright, on_side = (
        2 * np.log1p((level @ vertical) ** 2 / habit.spread**2 / 2) for level in (axes.right, axes.down)
    )
    return upright + ON_ITS_SIDE * habit.sideways, on_side + ON_ITS_SIDE * (not habit.sideways)


def _on_side(axes: _Axes, vertical: Floats, habit: _Habit | None = None) -> NDArray[np.bool_]:
    """Which cameras (n,) are on their side: by habit, or simply by what is nearer."""
    if habit is None:
        return np.asarray(np.abs(axes.down @ vertical) < np.abs(axes.right @ vertical))
    upright, on_side = _losses(axes, vertical, habit)
    return np.asarray(on_side < upright)


def _cost(axes: _Axes, habit: _Habit, vertical: Floats) -> float:
    """-2 log likelihood."""
    losses = np.minimum(*_losses(axes, vertical, habit))
    gaze = float(((axes.forward @ vertical) ** 2).sum()) / PITCH_SPREAD**2
    # A narrower spread is a higher peak of the density, for all photos but the two that any vertical suits.
    peak = 2 * max(len(axes.right) - 2, 0) * np.log(habit.spread / HAND)
    rare = ALL_ON_SIDE * habit.sideways + LEVELLED * (habit.spread < HAND)
    return float(losses.sum() + gaze + peak + rare)


def centre(cameras: Sequence[Camera], down: Floats) -> tuple[Camera, ...]:
    """The cameras in a world with this y axis, looking along z at the middle of the directions they cover."""
    forward = np.array([camera.cam_from_world[2] for camera in cameras])
    level = forward - np.outer(forward @ down, down)
    middle = level.sum(0)
    if np.linalg.norm(middle) < 0.2 * len(cameras):
        middle = _opposite_of_opening(level, down)  # a ring has no middle
    z = middle / max(float(np.linalg.norm(middle)), 1e-12)
    old_from_new = rotation.nearest(np.column_stack([np.cross(down, z), down, z]))
    return tuple(camera.turned(old_from_new) for camera in cameras)


def _opposite_of_opening(level: Floats, down: Floats) -> Floats:
    """The direction opposite to where a ring of directions (n, 3) opens.

    That is, of the gaps that are nearly as wide as any, where the series of photos begins: which of them is the widest
    by a hair would be left to chance.
    """
    x = level[0] / max(float(np.linalg.norm(level[0])), 1e-12)
    y = np.cross(down, x)
    angles = np.arctan2(level @ y, level @ x)
    order = np.argsort(angles, kind="stable")
    starts, behind = angles[order], np.roll(order, -1)
    gaps = np.diff(np.append(starts, starts[0] + 2 * np.pi))
    earlier, later = np.minimum(order, behind), np.maximum(order, behind)
    nearly = np.flatnonzero(gaps > NEARLY * gaps.max())
    chosen = min(nearly, key=lambda n: (earlier[n], -later[n]))
    away = starts[chosen] + gaps[chosen] / 2 + np.pi
    return np.asarray(np.cos(away) * x + np.sin(away) * y)
