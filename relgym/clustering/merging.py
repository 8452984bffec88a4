"""What a new mode absorbs: unification with the known ones, as long as it succeeds (§3.2.5, Figure 3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.discovery import Scale
from relgym.clustering.em import Cluster
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import Mode
from relgym.clustering.roles import identify_roles
from relgym.clustering.unification import covering, unified, unified_family
from relgym.config import ClusteringConfig
from relgym.config.constants import FEWEST
from relgym.numeric.stepwise import LinearFit
from relgym.scene.objects import Target

__all__ = ["Known", "generalise"]


@dataclass(frozen=True, slots=True)
class Known:
    """What a target's clusterer knows: its examples (`AssignmentLog`), the modes they are assigned to, settings."""

    table: ExampleTable
    rows: NDArray[np.int64]
    y: NDArray[np.float64]
    labels: NDArray[np.int32]
    clusters: dict[int, Cluster]
    target: Target
    scale: Scale
    config: ClusteringConfig

    def cluster(self, fit: LinearFit, signature: int) -> Cluster:
        """A mode, still without an id, of a function on a signature's columns."""
        roles = identify_roles(fit, self.table.signatures[signature])
        return Cluster(Mode(0, self.target, roles, fit.intercept, sigma=self.scale.sigma))

    def members(self, mode: int) -> NDArray[np.intp]:
        """Numbers of the examples assigned to a mode."""
        return np.flatnonzero(self.labels == mode)


@dataclass(frozen=True, slots=True)
class _Widened:
    """A function that became more general: its examples, and the modes it absorbed on the way."""

    cluster: Cluster
    members: NDArray[np.intp]
    absorbed: tuple[int, ...] = ()

    def wider(self, cluster: Cluster, members: NDArray[np.intp], *gone: int) -> _Widened:
        return _Widened(cluster, np.concatenate([self.members, members]), (*self.absorbed, *gone))


def generalise(
    known: Known, cluster: Cluster, members: NDArray[np.intp], *, rng: np.random.Generator
) -> tuple[Cluster, tuple[int, ...]]:
    """Unify a new mode with the known ones: the general function, and the modes that it replaces.

    Parameters
    ----------
    known
        Unchanged.
    cluster, members
        The new mode and the examples that it explains so far.

    Notes
    -----
    Every round absorbs a mode, so it ends after as many rounds as there are modes.
    """
    state = _pairwise(known, _Widened(cluster, members))
    family = _with_family(known, state, rng)
    if family is not None:
        state = _pairwise(known, family)
    return state.cluster, state.absorbed


def _pairwise(known: Known, state: _Widened) -> _Widened:
    """Unify with one mode after the other, as long as there is one."""
    while (wider := _with_one(known, state)) is not None:
        state = wider
    return state


def _with_one(known: Known, state: _Widened) -> _Widened | None:
    """Unify with the largest mode possible."""
    alternatives = [i for i in known.clusters if i not in state.absorbed]
    for i in sorted(alternatives, key=lambda k: (-len(known.members(k)), k)):
        theirs, lasting = known.members(i), known.clusters[i].mode.persists
        # Persistence is more general than a constant, even where there is hardly another value.
        if not (lasting and state.cluster.mode.constant) and covering(
            state.cluster, known.table, known.rows[theirs], known.y[theirs], known.scale, known.config
        ):
            return state.wider(state.cluster, theirs, i)
        general = unified(
            known.table,
            known.rows,
            known.y,
            state.members,
            theirs,
            target=known.target,
            scale=known.scale,
            config=known.config,
            simpler_than=(state.cluster.mode, known.clusters[i].mode),
        )
        if general is not None:
            return state.wider(known.cluster(general[1], general[0]), theirs, i)
    return None


def _with_family(known: Known, state: _Widened, rng: np.random.Generator) -> _Widened | None:
    """Unify with all modes that differ in their constant only."""
    mode = state.cluster.mode
    siblings = [
        i
        for i, c in sorted(known.clusters.items())
        if i not in state.absorbed and c.mode.intercept != 0.0 and c.mode.same_function(mode, constant=False)
    ]
    if mode.intercept == 0.0 or any(r.terms for r in mode.open_roles) or len(siblings) < FEWEST:
        return None
    families = [known.members(i) for i in siblings]
    found = unified_family(
        known.table,
        known.rows,
        known.y,
        [*families, state.members],
        mode.roles[0].terms,
        target=known.target,
        scale=known.scale,
        config=known.config,
        rng=rng,
    )
    if found is None or len(siblings) not in found[2]:
        return None
    signature, fit, which = found
    chosen = [k for k in which if k < len(siblings)]
    theirs = np.concatenate([families[k] for k in chosen])
    return state.wider(known.cluster(fit, signature), theirs, *(siblings[k] for k in chosen))
