"""Why two photos are not linked: each cause knows what speaks for it, and what to try.

The order matters: what spoils a photo spoils all evidence about pairs, so it is asked first.
"""

from collections.abc import Callable
from dataclasses import dataclass

from panostitch.diagnosis.looks import Look
from panostitch.diagnosis.pairs import PairEvidence
from panostitch.model.photo import natural_key

LOST = 0.5  # of a photo is white or black
LOST_MORE = 0.4  # than of the other one
FAR_APART = 3.0  # EV between photos of which neither is burnt out
SOFT = 0.45  # of the strength of edges over 12 px is left over 4 px; sharp photos keep 0.6 and more
SOFTER = 0.6  # of what the other photos keep
ALL_SOFT = 0.22  # no photo that is sharp keeps so little
PLAIN = 0.12  # of a photo has structure
SAME = 0.65  # of the key points look like others of the same photo; of faces of buildings about a third does
NARROW = 0.15  # of the smaller photo in the overlap
ONE_CAMERA = 0.8  # of what moves together is explained by one moving camera, whatever its depth
NOT_FLAT = 1.5  # times as many as one homography explains
FEW_WAYS = 3  # in which things move, from where on they move by themselves
CLUSTERED = 0.5  # of the spread of random matches


@dataclass(frozen=True)
class Case:
    """Two photos that are not linked, or hardly.

    names, looks: of the two
    suspects:     numbers (0, 1) of those that may be to blame: a photo that is linked to others is not
    peers:        what the sharpness of each is held against: `coarse` of the other photos
    pair:         the two together
    """

    names: tuple[str, str]
    looks: tuple[Look, Look]
    suspects: tuple[int, ...]
    peers: tuple[float, float]
    pair: PairEvidence


@dataclass(frozen=True)
class Verdict:
    """What speaks for a cause, in words, and the number of the photo that is to blame; None for both or neither."""

    words: str
    culprit: int | None = None


@dataclass(frozen=True)
class Cause:
    """What speaks for a cause, None if nothing does; and what to try: {photo} is the photo to blame, or the first."""

    evidence: Callable[[Case], Verdict | None]
    next: str


def _exposure(case: Case) -> Verdict | None:
    for n in case.suspects:
        look, other, name, partner = case.looks[n], case.looks[1 - n], case.names[n], case.names[1 - n]
        lost, kept = max((look.burnt, other.burnt), (look.black, other.black))
        if lost >= LOST and lost - kept >= LOST_MORE:
            what = "burnt out" if look.burnt >= look.black else "black"
            return Verdict(f"{lost:.0%} of {name} is {what}, {kept:.0%} of {partner}", n)
        if abs(look.light - other.light) >= FAR_APART:
            lighter = "brighter" if look.light > other.light else "darker"
            return Verdict(f"{name} is {abs(look.light - other.light):.1f} EV {lighter} than {partner}", n)
    return None


def _blur(case: Case) -> Verdict | None:
    for n in case.suspects:
        coarse, peer = case.looks[n].coarse, case.peers[n]
        if coarse < ALL_SOFT or (coarse < SOFT and coarse < SOFTER * peer):
            elsewhere = f", {peer:.0%} elsewhere" if peer > coarse else ""
            return Verdict(f"edges of {case.names[n]} keep {coarse:.0%} of their strength close up{elsewhere}", n)
    return None


def _no_texture(case: Case) -> Verdict | None:
    for n in case.suspects:
        if case.looks[n].texture < PLAIN:
            return Verdict(f"{1 - case.looks[n].texture:.0%} of {case.names[n]} is plain", n)
    return None


def _repeated_pattern(case: Case) -> Verdict | None:
    if case.pair.refuted:
        return Verdict("they match, but all other photos put them elsewhere: two things that look alike")
    for n in case.suspects:
        if case.looks[n].twins >= SAME:
            return Verdict(f"{case.looks[n].twins:.0%} of the key points of {case.names[n]} look like others in it", n)
    return None


def _too_little_overlap(case: Case) -> Verdict | None:
    overlap = case.pair.overlap
    if overlap is None or overlap >= NARROW:
        return None
    return Verdict(f"they have about {max(overlap, 0.01):.0%} in common, where {case.pair.agreeing} matches agree")


def _parallax(case: Case) -> Verdict | None:
    pair = case.pair
    if pair.epipolar < max(ONE_CAMERA * sum(pair.motions), NOT_FLAT * pair.flat) or not pair.motions:
        return None
    return Verdict(f"the camera has moved: near and far things shift apart, {pair.flat} of {pair.epipolar} together")


def _moving_subject(case: Case) -> Verdict | None:
    pair = case.pair
    if len(pair.motions) >= FEW_WAYS:
        return Verdict(f"what both show has moved in {len(pair.motions)} ways, each its own")
    if pair.agreeing and pair.spread < CLUSTERED:
        return Verdict("they agree in a small part of what both show; the rest has changed")
    return None


def _different_scene(case: Case) -> Verdict | None:
    if case.pair.agreeing:
        return None
    return Verdict(f"nothing in {case.names[0]} agrees with another photo beyond chance")


def _unknown(case: Case) -> Verdict:
    return Verdict(f"{case.pair.agreeing} matches agree, too few for a sound link, and nothing stands out")


CAUSES: dict[str, Cause] = {
    "exposure": Cause(_exposure, "expose all photos alike: lock exposure before the first one"),
    "blur": Cause(_blur, "take {photo} again, or leave it out with --exclude {photo}"),
    "no texture": Cause(
        _no_texture, "take {photo} again with more beside the plain part, or leave it out with --exclude {photo}"
    ),
    "repeated pattern": Cause(
        _repeated_pattern, "let the overlap show something that is there but once: a corner, a sign, the sky line"
    ),
    "too little overlap": Cause(_too_little_overlap, "take one more photo between {first} and {second}"),
    "parallax": Cause(_parallax, "turn the camera about its lens instead of moving it, or keep near things out"),
    "moving subject": Cause(
        _moving_subject, "take them again when less moves, or leave one out with --exclude {photo}"
    ),
    "different scene": Cause(
        _different_scene, "leave it out with --exclude {photo}; if it belongs here, take a photo between"
    ),
    "unknown": Cause(_unknown, "look at the matches with --debug-dir; try another --detector or --work-megapixels"),
}


def judge(case: Case) -> tuple[str, Verdict, str]:
    """The cause of a case, what speaks for it, and what to try."""
    for name, cause in CAUSES.items():
        verdict = cause.evidence(case)
        if verdict:
            photo = case.names[verdict.culprit or 0]
            first, second = sorted(case.names, key=natural_key)
            return name, verdict, cause.next.format(photo=photo, first=first, second=second)
    raise AssertionError("the last cause always speaks")
