"""Errors as plain data that adds up: histograms of their size, and counts of what went wrong, by true mode.

Batches are pooled by adding histograms, so quantiles over all batches need no list of all errors. A bin is a twentieth
of a decade: a quantile is right to 6 %.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.experiments.evaluate import TOLERANCE

__all__ = ["Histogram", "histogram", "mode_score", "pooled", "pooled_scores", "quantile", "target_score"]

Histogram: TypeAlias = list[list[int]]
"""Pairs of bin and count, by bin; bin b holds errors from 10^(b/20) on, the lowest one everything below."""

_PER_DECADE: Final = 20
_LOWEST: Final = -18 * _PER_DECADE
_HIGHEST: Final = 6 * _PER_DECADE

_Floats: TypeAlias = NDArray[np.float64]
_Bools: TypeAlias = NDArray[np.bool_]


def histogram(errors: _Floats) -> Histogram:
    """How many absolute errors lie in which bin; infinite ones and NaN in the highest."""
    clean = np.where(np.isfinite(errors), np.abs(errors), np.inf)
    with np.errstate(divide="ignore"):
        places = np.floor(np.log10(clean) * _PER_DECADE)
    bins, counts = np.unique(np.clip(places, _LOWEST, _HIGHEST).astype(np.int64), return_counts=True)
    return [[int(b), int(n)] for b, n in zip(bins, counts, strict=True)]


def pooled(histograms: Iterable[Histogram]) -> Histogram:
    """All errors of several histograms together."""
    total: Counter[int] = Counter()
    for each in histograms:
        total.update(dict(each))  # type: ignore[arg-type]
    return [[b, total[b]] for b in sorted(total)]


def quantile(errors: Histogram, share: float) -> float:
    """The error that this share of all errors doesn't exceed; 0 in the lowest bin, NaN without errors.

    Examples
    --------
    >>> found = histogram(np.array([0.0, 0.0, 1e-3, 1e-3, 1e-1]))
    >>> quantile(found, 0.25), f"{quantile(found, 0.75):.1e}", f"{quantile(found, 1.0):.1e}"
    (0.0, '1.1e-03', '1.1e-01')
    """
    wanted = share * sum(n for _, n in errors)
    reached = 0
    for place, count in errors:
        reached += count
        if reached >= wanted:
            return 0.0 if place <= _LOWEST else 10.0 ** ((place + 0.5) / _PER_DECADE)
    return math.nan


def mode_score(
    name: str, residual: _Floats, abstained: _Bools, best: _Floats | None, change: _Floats
) -> dict[str, Any]:
    """Score of the examples of one true mode, or of all.

    Parameters
    ----------
    name
        The mode's.
    residual
        Absolute errors, shape ``(n,)``.
    abstained
        Which ones no mode predicted.
    best
        Least absolute error of any learned mode; none for learners without modes.
    change
        How much the value really changed.
    """
    wrong = (residual > TOLERANCE) | abstained
    score: dict[str, Any] = {
        "name": name,
        "examples": len(residual),
        "wrong": int(wrong.sum()),
        "abstained": int(abstained.sum()),
        "change": float(np.abs(change).sum()),
        "sum": float(residual.sum()),
        "errors": histogram(residual),
    }
    if best is not None:
        known = best <= TOLERANCE
        score |= {
            "unlearned": int((wrong & ~known).sum()),
            "misclassified": int((wrong & known).sum()),
            "strict": int((abstained | (residual > best + TOLERANCE)).sum()),
            "literal": int((abstained | (residual > best)).sum()),
            "best": histogram(best),
        }
    return score


def target_score(
    names: tuple[str, ...],
    truth: NDArray[np.int64],
    counted: _Bools,
    residual: _Floats,
    abstained: _Bools,
    best: _Floats | None,
    change: _Floats,
) -> dict[str, Any]:
    """Scores of one target: of all examples, of those that some linear law explains, and by true mode.

    Parameters
    ----------
    names
        Names of the true modes.
    truth
        Number of each example's true mode, -1 where no single one applies.
    counted
        Which examples some linear law explains (`relgym.experiments.evaluate.explicable`).
    residual, abstained, best, change
        As of `mode_score`.
    """

    def score(name: str, part: _Bools) -> dict[str, Any]:
        mine = None if best is None else best[part]
        return mode_score(name, residual[part], abstained[part], mine, change[part])

    numbers = sorted(set(np.unique(truth[counted]).tolist()), key=lambda k: (k < 0, k))
    modes = [
        score("several contacts" if k < 0 else names[k], counted & (truth == k)) | {"mode": k}
        for k in numbers
    ]
    everything = np.ones(len(truth), dtype=np.bool_)
    return {"all": score("all", everything), "counted": score("counted", counted), "modes": modes}


def pooled_scores(scores: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Several batches' scores of the same mode, added up."""
    every = list(scores)
    total: dict[str, Any] = {"name": every[0]["name"]}
    for key in every[0]:
        if key in ("errors", "best"):
            total[key] = pooled(each[key] for each in every)
        elif key not in ("name", "mode"):
            total[key] = sum(each[key] for each in every)
    return total | ({"mode": every[0]["mode"]} if "mode" in every[0] else {})
