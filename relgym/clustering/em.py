"""Expectation and maximisation: which mode explains an example, and fitting a mode to its examples (§3.2.4).

Deviation from the thesis
-------------------------
A Gaussian density decides between modes only where residuals differ by more than the noise. Residuals within
it are ties: the thesis let rounding decide between ``v' = v`` and ``v' = 0`` for a resting ball and called
that unprincipled. Here the mode with fewest parameters wins, then the one with more examples, then the older
one.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.discovery import Scale
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import Mode
from relgym.clustering.roles import Binding, bind
from relgym.config.constants import FEWEST, MOST_ROWS
from relgym.numeric.stepwise import LinearFit, eliminate_backward, least_squares, with_unit

__all__ = ["Cluster", "preferred", "refit", "role_matrix"]


@dataclass(frozen=False, slots=True)
class Cluster:
    """A mode at work: its function laid over the signatures seen, and when it was last fitted."""

    mode: Mode
    fitted: int = 1
    unfitted: int = 0
    _bindings: dict[int, Binding | None] = field(default_factory=dict)

    def binding(self, table: ExampleTable, signature: int) -> Binding | None:
        """The mode over one signature of the table; None if its roles can't be filled there."""
        if signature not in self._bindings:
            self._bindings[signature] = bind(self.mode, table.signatures[signature])
        return self._bindings[signature]

    def errors(
        self, table: ExampleTable, rows: NDArray[np.integer], y: NDArray[np.float64], scale: Scale
    ) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Smallest absolute residual of each example over all role assignments, and that assignment's number.

        Infinite where no assignment is legal.
        """
        error = np.full(len(rows), np.inf)
        assignment = np.zeros(len(rows), dtype=np.intp)
        ids = table.signature_ids[rows]
        for signature in np.unique(ids):
            if (binding := self.binding(table, int(signature))) is not None:
                part = np.flatnonzero(ids == signature)
                error[part], assignment[part] = binding.closest(table.x[rows[part]], y[part], scale.sigma)
        return error, assignment

    def error_one(self, table: ExampleTable, row: int, x: list[float], y: float, scale: Scale) -> float:
        """`errors` of one example, whose row of the table is ``x``; the same bits."""
        binding = self.binding(table, int(table.signature_ids[row]))
        if binding is None:
            return np.inf
        return binding.closest_one(x, y, scale.sigma)[0] if binding.open else abs(binding.value(x) - y)

    def closest_one(self, table: ExampleTable, row: int, y: float, scale: Scale) -> tuple[float, int]:
        """`errors` of one example by the number of its row: the smallest residual, and the assignment's number."""
        binding = self.binding(table, int(table.signature_ids[row]))
        if binding is None:
            return np.inf, 0
        return binding.closest_one(table.x[row].tolist(), y, scale.sigma)

    def idle(self, table: ExampleTable, rows: NDArray[np.integer], tolerance: float) -> NDArray[np.bool_]:
        """Where the own role's terms all vanish and no other object has a say, shape ``(n,)``."""
        still = np.full(len(rows), not any(r.terms for r in self.mode.open_roles))
        for signature in np.unique(table.signature_ids[rows]):
            part = np.flatnonzero(table.signature_ids[rows] == signature)
            slots = table.signatures[int(signature)]
            for prop, weight in self.mode.roles[0].terms:
                column = slots.values(table.x[rows[part]], slots.column(0, prop))
                still[part] &= np.abs(weight * column) <= tolerance
        return still


def preferred(
    fitting: list[int],
    errors: dict[int, float],
    clusters: dict[int, Cluster],
    scale: Scale,
) -> int:
    """The mode an example is assigned to, among those that explain it (E-step)."""
    if len(fitting) == 1:
        return fitting[0]

    def key(i: int) -> tuple[float, int, int, int]:
        cluster = clusters[i]
        surprise = 0.0 if errors[i] <= scale.surprising else errors[i]
        return (surprise, cluster.mode.parameters, -(cluster.fitted + cluster.unfitted), i)

    return min(fitting, key=key)


def role_matrix(
    mode: Mode, table: ExampleTable, rows: NDArray[np.integer], assignment: NDArray[np.intp], cluster: Cluster
) -> NDArray[np.float64]:
    """Regression rows of a mode: one column per weight, each read from the object that is bound to the role.

    Columns stand in the order of the roles and their terms.
    """
    width = sum(len(role.terms) for role in mode.roles)
    x = np.zeros((len(rows), width))
    ids = table.signature_ids[rows]
    for signature in np.unique(ids):
        binding = cluster.binding(table, int(signature))
        if binding is None:
            continue
        slots = table.signatures[int(signature)]
        for k in np.unique(assignment[ids == signature]):
            part = np.flatnonzero((ids == signature) & (assignment == k))
            played = (0, *binding.roles_of(int(k)))
            columns = [
                slots.column(slot, prop)
                for slot, role in zip(played, mode.roles, strict=True)
                for prop, _ in role.terms
            ]
            x[part] = slots.matrix(table.x[rows[part]], columns)
    return x


def refit(
    cluster: Cluster, table: ExampleTable, rows: NDArray[np.integer], y: NDArray[np.float64], scale: Scale
) -> Cluster:
    """M-step: least squares on the mode's examples under their role assignments, needless terms dropped.

    The old function stays where the new one would lose an example that it explains.
    """
    done = replace(cluster, fitted=max(1, len(rows)), unfitted=0)
    if len(rows) < FEWEST:
        return done
    if len(rows) > MOST_ROWS:
        pick = np.linspace(0, len(rows) - 1, MOST_ROWS).astype(np.intp)
        rows, y = rows[pick], y[pick]
    mode = cluster.mode
    _, assignment = cluster.errors(table, rows, y, scale)
    x = role_matrix(mode, table, rows, assignment, cluster)
    # What counts from the present value does so: a weight of 1 isn't fitted, else it takes in what is small beside it.
    kept = [k for k, term in enumerate(mode.roles[0].terms) if term == (mode.target.property, 1.0)]
    others, rest = np.delete(x, kept, axis=1), y - x[:, kept].sum(axis=1)
    fit = least_squares(others, rest, tuple(range(others.shape[1])), intercept=mode.intercept != 0.0)
    fit = with_unit(eliminate_backward(others, rest, fit, sigma=scale.sigma), *kept)
    if np.abs(y - fit.predict(x)).max() > scale.tolerance:
        return done
    residual = float(np.sqrt(fit.rss / max(1, len(y) - fit.terms)))
    better = replace(_with_weights(mode, fit), sigma=residual)
    return Cluster(better, fitted=done.fitted, unfitted=0)


def _with_weights(mode: Mode, fit: LinearFit) -> Mode:
    weights = dict(zip(fit.columns, fit.weights, strict=True))
    roles, at = [], 0
    for role in mode.roles:
        terms = tuple((p, weights[at + k]) for k, (p, _) in enumerate(role.terms) if at + k in weights)
        at += len(role.terms)
        roles.append(replace(role, terms=terms))
    own, others = roles[0], sorted(r for r in roles[1:] if r.terms)
    return replace(mode, roles=(own, *others), intercept=fit.intercept)
