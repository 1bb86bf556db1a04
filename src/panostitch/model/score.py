"""How good a panorama is, in numbers: what is wrong with it at each place, along each seam, and as a whole."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MEASURES = ("displacement", "colour", "structure", "ghost", "blur")
# Of each measure, what can just be seen when one looks at the pixels: the unit of a place's fault.
VISIBLE = {"displacement": 1.0, "colour": 2.0, "structure": 4.0, "ghost": 4.0, "blur": 0.5}


@dataclass(frozen=True)
class Places:
    """What is wrong at n places of a picture; NaN where nothing can be said.

    xy:           (n, 2) px of the picture
    displacement: (n,) px by which the two sides of the place are shifted against each other
    colour:       (n,) CIEDE2000 by which their colours differ more than those of a photo do
    structure:    (n,) grey levels, rms, that are not as in any one photo
    ghost:        (n,) grey levels, rms, of a second photo that shines through
    blur:         (n,) share of the finest contrast that the sharpest photo has and the picture lacks
    """

    xy: Floats
    displacement: Floats
    colour: Floats
    structure: Floats
    ghost: Floats
    blur: Floats

    def __len__(self) -> int:
        return len(self.xy)

    @property
    def fault(self) -> Floats:
        """All measures together (n,), each in what can just be seen: 0 is perfect; NaN where nothing is known.

        Of a displacement of more than that only the root counts: what it breaks shows in the structure, and in grass
        nobody sees it.
        """
        moved = np.where(self.displacement > 1, np.sqrt(self.displacement), self.displacement)
        measures = np.stack([moved, *(getattr(self, name) for name in MEASURES[1:])])
        shares = measures / np.array(list(VISIBLE.values()))[:, None]
        known = np.isfinite(shares).any(0)
        return np.where(known, np.sqrt(np.nansum(shares**2, axis=0)), np.nan)

    def take(self, index: NDArray[np.integer[Any]] | NDArray[np.bool_]) -> "Places":
        """Those with these indices."""
        return Places(self.xy[index], *(getattr(self, name)[index] for name in MEASURES))


@dataclass(frozen=True)
class Worst:
    """One place of a picture; measures as in `Places`, None where nothing can be said."""

    x: float
    y: float
    fault: float
    displacement: float | None
    colour: float | None
    structure: float | None
    ghost: float | None
    blur: float | None


@dataclass(frozen=True)
class Score:
    """Many places in a few numbers; 0 is perfect, None means that nothing can be said.

    total:        root mean square of the places' faults
    displacement, displacement_p95: px, median and 95th percentile
    colour, structure, ghost, blur: root mean square, in the units of `Places`
    places:       how many there are
    known:        share of them at which the displacement is known
    worst:        the worst places, apart from each other, the worst first
    """

    total: float | None
    displacement: float | None
    displacement_p95: float | None
    colour: float | None
    structure: float | None
    ghost: float | None
    blur: float | None
    places: int
    known: float
    worst: tuple[Worst, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return asdict(self)


@dataclass(frozen=True)
class SeamScore:
    """The seam between two photos (names); places lie on the canvas.

    length: px
    """

    first: str
    second: str
    length: float
    score: Score

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return asdict(self)
