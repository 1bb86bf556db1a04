"""What to do better next time, in a line or three; nothing where nothing is solid."""

import math

from panostitch.model.alignment import Alignment
from panostitch.model.light import GAMMA
from panostitch.model.panorama import Panorama
from panostitch.model.photo import natural_key

MOST_LINES = 3
JUMP = 2.0  # EV between photos that follow each other; automatic exposure mostly stays below


def advice(alignment: Alignment, panorama: Panorama | None = None) -> list[str]:
    """Lines for the photographer, from what was found out of failed and weak links, and from the light."""
    lines = []
    soft = _culprits(alignment, "blur")
    if soft:
        lines.append(f"{_listed(soft)} {'is' if len(soft) == 1 else 'are'} soft: hold still, focus once and lock it")
    lines += [
        "take one more photo between {} and {}".format(*sorted((finding.photo, finding.partner), key=natural_key))
        for finding in alignment.findings
        if finding.cause == "too little overlap"
    ]
    lines += _jump(alignment, panorama) if panorama else []
    lost = _culprits(alignment, "exposure")
    if lost:
        lines.append(f"the exposure of {_listed(lost)} is far from that of the others: lock it")
    return list(dict.fromkeys(lines))[:MOST_LINES]


def _culprits(alignment: Alignment, cause: str) -> list[str]:
    found = [finding.culprit for finding in alignment.findings if finding.cause == cause and finding.culprit]
    return list(dict.fromkeys(found))


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _jump(alignment: Alignment, panorama: Panorama) -> list[str]:
    """The largest step of the light between photos that are linked and follow each other, if it is large."""
    light = [-GAMMA * math.log2(gain) for gain in panorama.plan.light.brightness]
    steps = [(abs(light[k.j] - light[k.i]), k.i, k.j) for k in alignment.links if abs(k.j - k.i) == 1]
    step, i, j = max(steps, default=(0.0, 0, 0))
    if step < JUMP:
        return []
    first, second = alignment.photos[i].name, alignment.photos[j].name
    return [f"exposure jumps by {step:.1f} EV between {first} and {second}: lock it"]
