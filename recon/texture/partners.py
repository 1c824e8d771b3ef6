"""Which images are worth aligning with which."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scipy.sparse import csr_array

GOOD = 0.3
"""Share of the best resolution of a point that is still of use."""


def partners(seen: list[csr_array], count: int) -> list[tuple[int, list[int]]]:
    """Images and those worth matching them with: at most `count` earlier ones that see most of the same points well.

    seen: for every face (images, points), resolution where an image sees a point.
    """
    from scipy import sparse

    shared = None
    for part in seen:
        best = np.asarray(part.max(axis=0).toarray()).ravel()
        table = part.tocoo()
        good = table.data > GOOD * best[table.coords[1]]
        rows, columns = table.coords[0][good], table.coords[1][good]
        flags = sparse.csr_array((np.ones(len(rows), np.int32), (rows, columns)), shape=part.shape)
        common = flags @ flags.T
        shared = common if shared is None else shared + common
    if shared is None:
        return []
    earlier = sparse.csr_array(sparse.tril(shared, k=-1))
    out = []
    for i in range(len(earlier.indptr) - 1):
        row = slice(earlier.indptr[i], earlier.indptr[i + 1])
        others, points = earlier.indices[row], earlier.data[row]
        ranked = np.lexsort((-others, -points))[:count]  # the latest first among equals
        if len(ranked):
            out.append((i, [int(others[k]) for k in ranked]))
    return out
