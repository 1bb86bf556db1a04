"""Which photos look alike, by one short vector for each: VLAD with words trained on the photos themselves.

Jegou et al., CVPR 2010; intra-normalised: Arandjelovic & Zisserman, CVPR 2013. Bits count as +1 and -1.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from panostitch.matching.brute_force import floats
from panostitch.matching.neighbours import Descriptors

Floats = NDArray[np.float32]

WORDS = 64
ROUNDS = 12  # of k-means; the words have settled as far as retrieval notices
SAMPLE = 20_000  # descriptors that the words are trained on


def best_partners(descriptors: Sequence[Descriptors], count: int, *, seed: int) -> list[tuple[int, int]]:
    """Pairs (i, j), i < j, sorted: each photo with the `count` others whose vectors are most like its own.

    Ties go to the photo that comes first.
    """
    vectors = vlad(descriptors, seed=seed)
    alike = vectors @ vectors.T
    np.fill_diagonal(alike, -np.inf)
    # the same two photos must compare the same whichever way round, to the last bit
    alike = np.maximum(alike, alike.T).round(6)
    best = np.argsort(-alike, axis=1, kind="stable")[:, : min(count, len(alike) - 1)]
    return sorted({(min(i, int(j)), max(i, int(j))) for i, row in enumerate(best) for j in row})


def vlad(descriptors: Sequence[Descriptors], *, seed: int) -> Floats:
    """A vector (n, words * d) of unit length for each photo; zero for a photo without features."""
    rows = [floats(one) for one in descriptors]
    if not any(len(one) for one in rows):
        return np.zeros((len(rows), 1), np.float32)
    words = train_words(np.concatenate(rows), seed=seed)
    return np.stack([_vlad_of(one, words) for one in rows])


def train_words(descriptors: Floats, *, seed: int) -> Floats:
    """Centres (k, d) of k-means on a sample of the descriptors (n, d); fewer than WORDS where there are fewer."""
    rng = np.random.default_rng(seed)
    sample = descriptors[np.sort(rng.permutation(len(descriptors))[:SAMPLE])]
    words = sample[np.sort(rng.permutation(len(sample))[:WORDS])].copy()
    for _ in range(ROUNDS):
        word = _nearest(sample, words)
        sums = np.zeros_like(words)
        np.add.at(sums, word, sample)
        count = np.bincount(word, minlength=len(words))
        used = count > 0
        words[used] = sums[used] / count[used, None]
    return words


def _nearest(rows: Floats, words: Floats) -> NDArray[np.intp]:
    return np.asarray((rows @ words.T - (words**2).sum(1) / 2).argmax(1))


def _vlad_of(rows: Floats, words: Floats) -> Floats:
    """Sums of what is left of each descriptor beside its word, each of unit length, and so the whole."""
    sums = np.zeros_like(words)
    if len(rows):
        word = _nearest(rows, words)
        np.add.at(sums, word, rows - words[word])
    sums /= np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), np.float32(1e-12))
    vector = sums.ravel()
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-12), np.float32)
