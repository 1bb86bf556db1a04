"""Which photos belong together: connected components of the verified links (Brown & Lowe 2007)."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from panostitch.model.match import Groups, Link, VerifiedMatch


def find_groups(count: int, links: Sequence[Link]) -> Groups:
    """Groups of linked photos among `count`, largest first, then by their first photo; and those without a link."""
    verified = [link for link in links if isinstance(link, VerifiedMatch)]
    i, j = np.array([(link.i, link.j) for link in verified], np.intp).reshape(-1, 2).T
    graph = coo_array((np.ones(len(verified)), (i, j)), shape=(count, count))
    number, labels = connected_components(graph, directed=False)
    components = [tuple(int(n) for n in np.flatnonzero(labels == label)) for label in range(number)]
    panoramas = sorted((c for c in components if len(c) > 1), key=lambda c: (-len(c), c))
    return Groups(tuple(panoramas), tuple(c[0] for c in components if len(c) == 1))
