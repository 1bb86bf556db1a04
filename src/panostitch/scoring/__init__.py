"""How good a panorama is, seam by seam or as a finished picture, by one rule (`places`)."""

from panostitch.scoring.picture import judge
from panostitch.scoring.seams import score_seams
from panostitch.scoring.summary import summary

__all__ = ["judge", "score_seams", "summary"]
