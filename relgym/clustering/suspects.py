"""Modes among examples that others explain by chance: through noise, few of a rare mode's examples are left over.

Deviation from the thesis
-------------------------
The thesis looks for modes among what none explains (§3.2.2). Where the noise is a tenth of what the numbers are, a
ball that leaves a ramp at nearly its old speed is explained by ``v' = v``, at nearly none by ``v' = 0``; what no mode
explains are a dozen of sixty bounces. What gives them away is where they are: in relational states whose examples are
explained *badly*. There, all examples are looked at, and a function is believed if the examples' likelihood says so.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.discovery import Scale
from relgym.config.constants import DRAWS, ENOUGH, EVIDENCE, MOST_ROWS, ROUNDED, TYPICAL, VERIFYING
from relgym.numeric.ransac import draw_samples
from relgym.numeric.stepwise import LinearFit, least_squares

__all__ = ["Evidence", "likeliest", "suspects"]


def suspects(strata: NDArray[np.integer], errors: NDArray[np.float64], scale: Scale) -> NDArray[np.intp]:
    """Examples of relational states in which the known modes' errors are larger than the noise explains, oldest first.

    Their errors' mean square is twice the noise's variance, or twice what is usual where noise was underrated. They are
    at most `MOST_ROWS`, the newest.

    Parameters
    ----------
    strata
        Relational state of each example, shape ``(n,)``.
    errors
        Least error of any mode, likewise; infinite where none applies.
    scale
        Noise.
    """
    square = np.square(np.minimum(errors, scale.tail) / scale.sigma)
    _, state, count = np.unique(strata, return_inverse=True, return_counts=True)
    usual = max(1.0, float(np.median(square)) / TYPICAL**2) if len(square) else 1.0
    badly = np.bincount(state, weights=square) >= 2.0 * usual * count
    found: NDArray[np.intp] = np.flatnonzero(badly[state])[-MOST_ROWS:]
    return found


class Evidence:
    """How much likelier a further mode makes examples, in bits, each being as likely its as another's.

    Were the examples none of its, the odds against a gain of k bits would be at least 2^k to 1, whatever the known
    modes' distribution: the mixture's likelihood over theirs is an e-value (Grünwald, de Heide and Koolen 2024). What
    it takes to state a function comes off: half the logarithm of the number of examples and the choice of a column for
    each weight, and as many examples as it has weights, which it would fit anyhow.

    Parameters
    ----------
    x, y
        Rows ``(n, d)`` and responses.
    known
        Least error of any known mode, shape ``(n,)``.
    scale
        Noise.
    spread
        Range of the target's values: an example that no mode explains lies anywhere in it.
    """

    def __init__(
        self,
        x: NDArray[np.float64],
        y: NDArray[np.float64],
        known: NDArray[np.float64],
        *,
        scale: Scale,
        spread: float,
    ) -> None:
        self.x, self.y = x, y
        self._sigma, self._tolerance = scale.sigma, scale.tolerance
        self._anywhere = -np.log2(max(spread / (scale.sigma * np.sqrt(2.0 * np.pi)), 1.0))
        self._known = self._likelihood(known)

    def _likelihood(self, errors: NDArray[np.float64]) -> NDArray[np.float64]:
        """In bits, relative to an error of zero."""
        bits = -np.square(errors / self._sigma) / (2.0 * np.log(2.0))
        likelihood: NDArray[np.float64] = np.maximum(bits, self._anywhere)
        return likelihood

    def close(self, fit: LinearFit) -> NDArray[np.bool_]:
        """Which examples a function explains well enough to be determined by them."""
        near: NDArray[np.bool_] = np.abs(self.y - fit.predict(self.x)) <= self._tolerance
        return near

    def of(self, fit: LinearFit) -> float:
        """Bits for a function, less those that it takes to state it."""
        ratio = self._likelihood(np.abs(self.y - fit.predict(self.x))) - self._known
        bits = np.log2(0.5 + 0.5 * np.exp2(ratio))
        own = np.sort(bits)[len(bits) - min(fit.terms, len(bits)) :]
        choice = len(fit.columns) * np.log2(max(self.x.shape[1], 1))
        return float(bits.sum() - own.sum() - choice - 0.5 * fit.terms * np.log2(len(bits)))


def likeliest(
    evidence: Evidence,
    strata: NDArray[np.integer],
    *,
    rng: np.random.Generator,
    draws: int,
    most: int,
) -> LinearFit | None:
    """The function of most evidence among random samples' functions and their refinements; None if none convinces.

    Parameters
    ----------
    evidence
        Of the suspects.
    strata
        Their relational states, shape ``(n,)``.
    rng
        Draws the samples.
    draws
        Functions tried on samples: about so many in all, of `ENOUGH` samples to `DRAWS`.
    most
        Most columns of a function.

    Notes
    -----
    Cost O(draws * n); functions of samples have two columns at most, refinements may have more.
    """
    x, y = evidence.x, evidence.y
    width = x.shape[1]
    widest = min(2, most, width)
    sets = [columns for terms in range(widest + 1) for columns in combinations(range(width), terms)]
    forms = [(columns, constant) for columns in sets for constant in (True, False) if columns or constant]
    size = widest + 1 + VERIFYING
    if len(y) < 2 * size:
        return None
    samples = int(np.clip(draws // len(forms), ENOUGH, DRAWS))
    best, bits = None, -np.inf
    for sample in draw_samples(len(y), size, samples, rng=rng, strata=strata):
        for columns, constant in forms:
            fit = least_squares(x[sample], y[sample], columns, intercept=constant)
            if (now := evidence.of(fit)) > bits:
                best, bits = fit, now
    if best is None:
        return None
    best, bits = _refined(evidence, best, bits, most)
    return best if bits >= EVIDENCE else None


def _refined(evidence: Evidence, fit: LinearFit, bits: float, most: int) -> tuple[LinearFit, float]:
    """Refit, with a column more or less, on the examples explained, as long as there is more evidence for it."""
    width = evidence.x.shape[1]
    while True:
        rows = evidence.close(fit)
        columns = set(fit.columns)
        sets = [columns, *(columns - {c} for c in columns), *(columns | {c} for c in range(width))]
        better = fit
        for chosen in dict.fromkeys(tuple(sorted(s)) for s in sets if len(s) <= most):
            for constant in (True, False):
                if (not chosen and not constant) or rows.sum() <= len(chosen) + constant:
                    continue
                other = least_squares(evidence.x[rows], evidence.y[rows], chosen, intercept=constant)
                if (now := evidence.of(other)) > bits + ROUNDED:
                    better, bits = other, now
        if better is fit:
            return fit, bits
        fit = better
