"""Mode unification: one general function in place of two over-specific ones (§3.2.5)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.discovery import Scale, identified
from relgym.clustering.em import Cluster
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import Mode
from relgym.config import ClusteringConfig
from relgym.config.constants import FIRST, MAJORITY, VERIFYING
from relgym.numeric.ransac import consensus
from relgym.numeric.stepwise import LinearFit, forward_stepwise, least_squares, with_unit
from relgym.scene.objects import Target

__all__ = ["covering", "reordered", "unified", "unified_family"]


def covering(
    general: Cluster,
    table: ExampleTable,
    rows: NDArray[np.integer],
    y: NDArray[np.float64],
    scale: Scale,
    config: ClusteringConfig,
) -> bool:
    """Whether a function explains the given examples, *and* its terms act on them.

    A function all of whose terms vanish on the examples says nothing of them: bouncing (``v' = -0.9 v``)
    doesn't swallow sliding (``v' = 0`` where v = 0).
    """
    if not len(rows):
        return True
    error, _ = general.errors(table, rows, y, scale)
    if (error <= scale.tolerance).mean() < config.unify_ratio:
        return False
    return bool((np.abs(y) > scale.tolerance).mean() >= MAJORITY) or general.mode.parameters == 0


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
    order, stages = slots.preference(target)
    pooled = np.concatenate(sides)
    allowed = simpler_than[0].parameters + simpler_than[1].parameters
    everyone = [side[signatures[side] == signature] for side in (new, old)]
    own = slots.column(0, target.property)
    if own in order and _persist(table.x[:, own], rows, y, everyone, scale):
        return signature, LinearFit((own,), (1.0,), 0.0, 0.0)
    if min((np.abs(y[side]) > scale.tolerance).mean() for side in sides) < MAJORITY:
        return None  # on one side whatever is multiplied by nothing would do
    for width in stages[:1] if config.own_only else stages:
        x = slots.matrix(table.x[rows[pooled]], order[:width])
        fit = _fitted(x, y[pooled], scale, config, allowed)
        if fit is None and own in order:
            fit = _fitted(x, y[pooled], scale, config, allowed, changes=True)
        if fit is None:
            continue
        both = np.concatenate(everyone)
        x = slots.matrix(table.x[rows[both]], order[:width])
        found = identified(x, y[both], fit, scale=scale, support=config.support)
        if found is None or found.fit.terms >= allowed:
            continue
        shares = [part.mean() for part in np.split(found.inliers, [len(everyone[0])])]
        if min(shares) >= config.unify_ratio:
            return signature, reordered(found.fit, order)
    return None


def _fitted(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    scale: Scale,
    config: ClusteringConfig,
    allowed: int,
    *,
    changes: bool = False,
) -> LinearFit | None:
    """A function of fewer than the allowed terms that explains all responses, or None.

    Of `changes`: one of how they differ from the first column, the property's present value. What little a large number
    changes by is lost where all of it is fitted: an odometer's way since the last step. It may be the difference of two
    columns that are nearly alike, which is found only with others that are needless then.
    """
    if changes:
        fit = forward_stepwise(x[:, 1:], y - x[:, 0], sigma=scale.sigma, max_terms=config.max_terms - 1)
        fit = with_unit(fit, 0)
    else:
        fit = forward_stepwise(x, y, sigma=scale.sigma, max_terms=min(config.max_terms, allowed))
    return fit if fit.terms < allowed and np.abs(y - fit.predict(x)).max() <= scale.tolerance else None


def _persist(
    present: NDArray[np.float64],
    rows: NDArray[np.integer],
    y: NDArray[np.float64],
    sides: list[NDArray[np.intp]],
    scale: Scale,
) -> bool:
    """Whether on each side the property mostly keeps its value, and isn't at rest on both.

    Of two constants ``v' = c`` this is the general law (§3.2.5), and 0 is one of them as well. It has no parameter to
    be fitted, so that examples which a side owes to something else (v arrives at c) can't spoil it: they are left, and
    may found modes of their own.
    """
    kept = [(np.abs(y[side] - present[rows[side]]) <= scale.tolerance).mean() for side in sides]
    moving = [(np.abs(y[side]) > scale.tolerance).mean() for side in sides]
    return bool(min(kept) >= MAJORITY and max(moving) >= MAJORITY)


def unified_family(
    table: ExampleTable,
    rows: NDArray[np.integer],
    y: NDArray[np.float64],
    families: list[NDArray[np.intp]],
    shared: tuple[tuple[str, float], ...],
    *,
    target: Target,
    scale: Scale,
    config: ClusteringConfig,
    rng: np.random.Generator,
) -> tuple[int, LinearFit, list[int]] | None:
    """A function that explains several over-specific modes at once: (signature, fit, which of them), or None.

    Where something is constant while an episode lasts, each episode teaches a mode of its own that differs from
    the others in its constant only. No two of them determine how the constant depends on what; many do. Each
    mode counts as one example here, and consensus is sought among them.

    Parameters
    ----------
    families
        Numbers of the examples of each mode.
    shared
        Terms of the target's own role that they all have.
    """
    middle = np.array([members[len(members) // 2] for members in families])
    signature = int(table.signature_ids[rows[middle[-1]]])
    usable = np.flatnonzero(table.signature_ids[rows[middle]] == signature)
    slots = table.signatures[signature]
    order, stages = slots.preference(target)
    own = {slots.column(0, prop): weight for prop, weight in shared}
    part = middle[usable]
    x = table.x[rows[part]]
    constants = y[part] - sum(weight * slots.values(x, column) for column, weight in own.items())
    for width in stages[:2][-1:]:
        columns = np.array([c for c in order[:width] if c not in own], dtype=np.intp)
        for terms in range(1, min(len(columns), config.max_terms) + 1):
            found = consensus(
                slots.matrix(x, columns),
                constants,
                sigma=scale.sigma,
                tolerance=scale.tolerance,
                terms=terms,
                size=terms + 1 + VERIFYING,
                draws=2 * config.draws,
                rng=rng,
                anchors=np.array([len(usable) - 1]),
                misfit=scale.misfit,
            )
            if found is None or found.size < found.fit.terms + 1 + VERIFYING:
                continue
            which = [int(k) for k in usable[found.inliers]]
            pooled = np.concatenate([_spread(families[k]) for k in which])
            used = np.array([*own, *(int(columns[c]) for c in found.fit.columns)], dtype=np.intp)
            pool = slots.matrix(table.x[rows[pooled]], used)
            whole = least_squares(pool, y[pooled], tuple(range(len(used))))
            checked = identified(pool, y[pooled], whole, scale=scale, support=config.support)
            if checked is not None and checked.inliers.mean() >= config.unify_ratio:
                return signature, reordered(checked.fit, used), which
    return None


def reordered(fit: LinearFit, order: NDArray[np.intp]) -> LinearFit:
    """The same function on columns before they were put in order of preference."""
    pairs = sorted((int(order[c]), w) for c, w in zip(fit.columns, fit.weights, strict=True))
    return LinearFit(tuple(c for c, _ in pairs), tuple(w for _, w in pairs), fit.intercept, fit.rss)


def _spread(examples: NDArray[np.intp]) -> NDArray[np.intp]:
    if len(examples) <= FIRST:
        return examples
    return examples[np.linspace(0, len(examples) - 1, FIRST).astype(np.intp)]
