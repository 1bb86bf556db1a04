"""Why a link between two photos failed, or is weak."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """What was found out about two photos (names).

    photo:    the one that is explained
    partner:  the one with which it came nearest to a link
    cause:    a name in `diagnosis.CAUSES`
    evidence: what speaks for that, in words
    next:     what to try
    culprit:  the photo that is to blame; empty where it is both or none
    overlap:  share of the smaller photo that both show, 0 to 1; None where it cannot be told
    weak:     they are linked all the same, and nothing else holds the panorama together there
    """

    photo: str
    partner: str
    cause: str
    evidence: str
    next: str
    culprit: str = ""
    overlap: float | None = None
    weak: bool = False
