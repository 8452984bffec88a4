"""Which row of a table is which object, when rows are sorted anew at every step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["matched"]


def matched(rows: NDArray[np.float64], expected: NDArray[np.float64], farthest: float) -> NDArray[np.intp]:
    """The assignment of rows to expected objects with the smallest sum of squared distances (Kuhn 1955).

    Parameters
    ----------
    rows
        What is there, shape ``(n, d)``, in units in which 1 is far.
    expected
        What was expected, shape ``(m, d)``.
    farthest
        A row farther than this from every free object is news.

    Returns
    -------
    Index of each row's object, shape ``(n,)``; -1 for news.

    Notes
    -----
    Cost: O(n² m) at worst, microseconds for a dozen rows.
    """
    chosen = np.full(len(rows), -1, dtype=np.intp)
    if not len(rows) or not len(expected):
        return chosen
    # Imported here: half of scipy's import time.
    from scipy.optimize import linear_sum_assignment

    squares = ((rows[:, None, :] - expected[None, :, :]) ** 2).sum(axis=2)
    # A pair farther apart costs what leaving both alone costs: it is never worth displacing a good pair.
    costs = np.minimum(squares, farthest * farthest)
    for row, column in zip(*linear_sum_assignment(costs), strict=True):
        if squares[row, column] <= farthest * farthest:
            chosen[row] = column
    return chosen
