"""Mode unification: one general function in place of two over-specific ones (§3.2.5)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.discovery import Scale, identified
from relgym.clustering.em import Cluster
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import Mode
from relgym.config import ClusteringConfig
from relgym.numeric.stepwise import LinearFit, forward_stepwise
from relgym.scene.objects import Target

__all__ = ["covering", "unified"]

SIDE = 60
"""At most this many examples of each side are regressed; the function is then checked on all."""


def covering(
    general: Cluster,
    table: ExampleTable,
    rows: NDArray[np.integer],
    y: NDArray[np.float64],
    scale: Scale,
    config: ClusteringConfig,
) -> bool:
    """Whether a function explains the given examples, *and* its terms act on them.

    A function all of whose terms vanish on the examples says nothing of them: bouncing (``v' = -0.9 v``) doesn't
    swallow sliding (``v' = 0`` where v = 0).
    """
    if not len(rows):
        return True
    error, _ = general.errors(table, rows, y, scale)
    if (error <= scale.tolerance).mean() < config.unify_ratio:
        return False
    return bool((np.abs(y) > scale.tolerance).mean() >= 0.5) or general.mode.parameters == 0


def unified(
    table: ExampleTable,
    rows: NDArray[np.integer],
    y: NDArray[np.float64],
    new: NDArray[np.intp],
    old: NDArray[np.intp],
    *,
    target: Target,
    scale: Scale,
    config: ClusteringConfig,
    simpler_than: tuple[Mode, Mode],
) -> tuple[int, LinearFit] | None:
    """A function that explains both sides, as (signature, fit on its columns), or None.

    Parameters
    ----------
    table, rows, y
        The examples: their rows in the table and their target values.
    new, old
        Numbers of the examples of the new and of the existing mode.
    simpler_than
        The two modes; the unified function must need fewer parameters than both together.
    """
    signatures = table.signature_ids[rows]
    shared = np.intersect1d(signatures[new], signatures[old])
    if not len(shared):
        return None
    signature = int(max(shared, key=lambda s: (signatures[new] == s).sum()))
    sides = [_spread(side[signatures[side] == signature]) for side in (new, old)]
    slots = table.signatures[signature]
    order = slots.preference(target.property)
    pooled = np.concatenate(sides)
    allowed = simpler_than[0].parameters + simpler_than[1].parameters
    for width in dict.fromkeys([slots.own, len(order)]):
        if config.own_only and width > slots.own:
            continue
        x = table.x[rows[pooled]][:, order[:width]]
        fit = forward_stepwise(x, y[pooled], sigma=scale.sigma, max_terms=min(config.max_terms, allowed))
        if fit.terms >= allowed or np.abs(y[pooled] - fit.predict(x)).max() > scale.tolerance:
            continue
        everyone = np.concatenate([side[signatures[side] == signature] for side in (new, old)])
        x = table.x[rows[everyone]][:, order[:width]]
        found = identified(x, y[everyone], fit, scale=scale, support=config.support)
        if found is None or found.fit.terms >= allowed:
            continue
        split = int((signatures[new] == signature).sum())
        shares = (found.inliers[:split].mean(), found.inliers[split:].mean())
        acts = [np.abs(y[side]) > scale.tolerance for side in sides]
        if min(shares) >= config.unify_ratio and min(a.mean() for a in acts) >= 0.5:
            pairs = sorted((int(order[c]), w) for c, w in zip(found.fit.columns, found.fit.weights, strict=True))
            fit = LinearFit(
                tuple(c for c, _ in pairs), tuple(w for _, w in pairs), found.fit.intercept, found.fit.rss
            )
            return signature, fit
    return None


def _spread(examples: NDArray[np.intp]) -> NDArray[np.intp]:
    if len(examples) <= SIDE:
        return examples
    return examples[np.linspace(0, len(examples) - 1, SIDE).astype(np.intp)]
