"""From many places to a few numbers, the worst places, and a heat map."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from panostitch.model.score import MEASURES, Places, Score, Worst
from panostitch.scoring.places import STEP

Floats = NDArray[np.float64]

WORST = 10
APART = 8 * STEP  # px between two of the worst places, at least


def summary(places: Places) -> Score:
    """The score of these places."""
    fault = places.fault
    displacement = places.displacement[np.isfinite(places.displacement)]
    return Score(
        total=_rms(fault),
        displacement=float(np.median(displacement)) if len(displacement) else None,
        displacement_p95=float(np.quantile(displacement, 0.95)) if len(displacement) else None,
        colour=_rms(places.colour),
        structure=_rms(places.structure),
        ghost=_rms(places.ghost),
        blur=_rms(places.blur),
        places=len(places),
        known=len(displacement) / max(1, len(places)),
        worst=worst_of(places),
    )


def _rms(values: Floats) -> float | None:
    known = values[np.isfinite(values)]
    return float(np.sqrt((known**2).mean())) if len(known) else None


def worst_of(places: Places) -> tuple[Worst, ...]:
    """The worst places, apart from each other."""
    fault = np.nan_to_num(places.fault)
    chosen: list[int] = []
    for n in np.argsort(-fault, kind="stable"):
        if len(chosen) == WORST or not fault[n]:
            break
        if all(np.hypot(*(places.xy[n] - places.xy[k])) >= APART for k in chosen):
            chosen.append(int(n))
    return tuple(_worst(places, n) for n in chosen)


def _worst(places: Places, n: int) -> Worst:
    x, y = places.xy[n]
    values = (float(getattr(places, name)[n]) for name in MEASURES)
    return Worst(float(x), float(y), float(places.fault[n]), *(v if np.isfinite(v) else None for v in values))


def joined(parts: Sequence[Places]) -> Places:
    """All places of several sets."""
    return Places(
        np.vstack([np.zeros((0, 2)), *(part.xy for part in parts)]),
        *(np.concatenate([np.zeros(0), *(getattr(part, name) for part in parts)]) for name in MEASURES),
    )
