"""Why photos are left out, and which links are weak: evidence first, then the cause.

Nothing is looked at where all photos are well linked, so good runs cost nothing.
"""

from collections.abc import Sequence
from functools import partial
from statistics import median

from panostitch.diagnosis.advice import advice
from panostitch.diagnosis.causes import CAUSES, PLAIN, Case, judge
from panostitch.diagnosis.left_out import explain_left_out
from panostitch.diagnosis.looks import Look, look_at
from panostitch.diagnosis.pairs import PairEvidence, compare
from panostitch.diagnosis.questions import Question, questions
from panostitch.errors import InputError
from panostitch.features import detect_one, rungs
from panostitch.model.features import Features
from panostitch.model.finding import Finding
from panostitch.model.match import Rejection
from panostitch.model.photo import Photo
from panostitch.options import FeatureOptions, Options
from panostitch.recognition import Recognition
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.trace import Trace, silent

__all__ = ["CAUSES", "advice", "diagnose", "explain_left_out"]

Pair = tuple[int, int]
Seen = tuple[Features, Look]


def diagnose(
    recognition: Recognition, options: Options, *, run: Executor = serial, trace: Trace = silent
) -> tuple[Finding, ...]:
    """What keeps apart what stayed apart, and makes links weak; a finding for each photo, group and weak link."""
    photos = recognition.photos
    asked = questions(photos, recognition.links, recognition.groups)
    if not asked:
        return ()
    members = sorted({n for one in asked for n in (one.photo, *one.partners)})
    # the key points of the first further attempt: more than matching has seen, at a price that is paid but for failures
    see = partial(_see, options=rungs(options.features)[0])
    found = run.map(see, [photos[n] for n in members], label="Looking for causes")
    seen = {n: one for n, one in zip(members, found, strict=True) if one}
    refuted = {(k.i, k.j) for k in recognition.links if isinstance(k, Rejection) and k.inliers and not k.needed}
    pairs = sorted({_sorted(one.photo, n) for one in asked for n in one.partners if {one.photo, n} <= seen.keys()})
    work = partial(_evidence, photos, seen, refuted=refuted, options=options)
    evidence = dict(zip(pairs, run.map(work, pairs, label="Comparing"), strict=True))
    findings = []
    for one in asked:
        pair = _telling(one, evidence)
        if pair is None:
            continue
        finding = _finding(recognition, one, pair, seen, evidence[pair])
        if finding is None:
            continue
        findings.append(finding)
        i, j = pair
        trace(
            "diagnosis.explained",
            photos=(photos[i], photos[j]),
            features=(seen[i][0], seen[j][0]),
            matches=evidence[pair].matches,
            agree=evidence[pair].agree,
            finding=finding,
        )
    return tuple(findings)


def _see(photo: Photo, *, options: FeatureOptions) -> Seen | None:
    try:
        features = detect_one(photo, options)
        return features, look_at(photo, features)
    except InputError:
        return None


def _evidence(
    photos: Sequence[Photo], seen: dict[int, Seen], pair: Pair, *, refuted: set[Pair], options: Options
) -> PairEvidence:
    i, j = pair
    matching = options.matching
    return compare(
        (seen[i][0], seen[j][0]),
        (photos[i].size, photos[j].size),
        ratio=matching.ratio,
        threshold=matching.ransac_threshold,
        seed=matching.seed,
        refuted=pair in refuted,
    )


def _telling(question: Question, evidence: dict[Pair, PairEvidence]) -> Pair | None:
    """The pair of a question that says most: that agrees most, or else the likeliest."""
    pairs = [pair for n in question.partners if (pair := _sorted(question.photo, n)) in evidence]
    return min(pairs, key=lambda pair: (not evidence[pair].agreeing, evidence[pair].chance), default=None)


def _finding(
    recognition: Recognition, question: Question, pair: Pair, seen: dict[int, Seen], evidence: PairEvidence
) -> Finding | None:
    """The cause of a question; None where there is nothing to explain: groups of different scenes, sound links."""
    first, second = question.photo, sum(pair) - question.photo
    alone = set(recognition.groups.singles)
    suspects = (0, 1) if second in alone or question.weak else (0,)
    case = Case(
        names=(recognition.photos[first].name, recognition.photos[second].name),
        looks=(seen[first][1], seen[second][1]),
        suspects=suspects,
        peers=(_peers(first, seen), _peers(second, seen)),
        pair=evidence,
    )
    cause, verdict, advice = judge(case)
    if cause in ("different scene", "unknown") and first not in alone:
        return None
    culprit = "" if verdict.culprit is None else case.names[verdict.culprit]
    return Finding(*case.names, cause, verdict.words, advice, culprit, evidence.overlap, question.weak)


def _peers(photo: int, seen: dict[int, Seen]) -> float:
    """Sharpness of the other photos that were looked at; of noise on plain walls nothing can be told."""
    others = [look.coarse for n, (_, look) in seen.items() if n != photo and look.texture >= PLAIN]
    return median(others) if others else 0.0


def _sorted(a: int, b: int) -> Pair:
    return (a, b) if a < b else (b, a)
