"""Clustering (§3.2, Figure 3.2): new modes by RANSAC, unification, expectation maximisation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.mode import NOISE, Role
from relgym.clustering.population import ClusterReport
from relgym.scene.objects import SceneLayout
from relgym.thesis.examples import Arrangement, Examples
from relgym.thesis.modes import Cluster, roles_of
from relgym.thesis.ransac import Union, search, varied
from relgym.thesis.regression import fit
from relgym.thesis.settings import ThesisSettings

__all__ = ["Clusterer"]

Floats = NDArray[np.float64]
Rows = NDArray[np.intp]

_FIRST = 256

_ONE = 2.0**53
"""One part in so many is what a number in double precision just below 1 differs from 1 by."""

_GROWTH = 20
"""Noise grows by such a part between two searches: some 120 of them until there are 16,000 examples of it."""


class Clusterer:
    """Modes of one target, and which of them each example belongs to.

    Parameters
    ----------
    settings
        Constants and rules.

    Attributes
    ----------
    examples
        All examples so far.
    clusters
        The modes, in the order in which they were found.
    changed
        Modes whose members or functions changed since somebody asked.
    """

    def __init__(self, settings: ThesisSettings) -> None:
        self.settings = settings
        self.examples = Examples()
        self.clusters: list[Cluster] = []
        self._rng = np.random.default_rng(settings.seed)
        self._tolerance = settings.inlier_stds * settings.noise_variance**0.5
        self._units = _ONE / (2.0 * settings.noise_variance)
        self._labels = np.zeros(_FIRST, dtype=np.int64)
        self._next = NOISE + 1
        self._noise: set[int] = set()
        self._wait = settings.min_examples
        self._errors: dict[int, Floats] = {}

    @property
    def labels(self) -> NDArray[np.int64]:
        """Mode of each example; `NOISE` if none, shape ``(count,)``."""
        return self._labels[: self.examples.count]

    @property
    def noise(self) -> int:
        """How many examples no mode explains."""
        return len(self._noise)

    def members(self, number: int) -> Rows:
        """Numbers of a mode's examples."""
        return np.flatnonzero(self.labels == number)

    # ------------------------------------------------------------------ Figure 3.2
    def learn_one(self, layout: SceneLayout, target: int, x: Floats, y: float) -> ClusterReport:
        """Take up an example.

        Parameters
        ----------
        layout, target
            The scene's layout and the object whose property is predicted.
        x, y
            State vector, and the property's next value.

        Returns
        -------
        The mode it belongs to, and what became of the modes.
        """
        group = self.examples.number_of(layout, target)
        number = self.examples.add(group, x, y)
        arrangement, row = self.examples.arrangements[group], x.tolist()
        if number == len(self._labels):
            self._labels = np.concatenate([self._labels, np.zeros_like(self._labels)])
            self._errors = {k: np.concatenate([e, np.empty_like(e)]) for k, e in self._errors.items()}
        errors, known = [], [cluster.number for cluster in self.clusters]
        for cluster in self.clusters:
            errors.append(cluster.error(arrangement, row, y))
            self._errors[cluster.number][number] = errors[-1]
        self._labels[number] = self._likeliest(np.array([errors]))[0]
        if self._labels[number] == NOISE:
            self._noise.add(number)
            for _ in range(self.settings.em_iterations):
                if not self._discover():
                    break
        now = [cluster.number for cluster in self.clusters]
        return ClusterReport(
            int(self._labels[number]),
            tuple(k for k in now if self._errors[k][number] <= self._tolerance),
            tuple(k for k in now if k not in known),
            tuple(k for k in known if k not in now),
        )

    def _likeliest(self, errors: Floats) -> NDArray[np.int64]:
        """The mode under which each example is likeliest, of errors of shape ``(n, modes)``; `NOISE` if none is near.

        ``exp(-error² / 2σ²)`` in double precision: what is off by no more than rounding is 1 for every mode, and of
        equals the oldest has the example.
        """
        if not self.clusters:
            return np.full(len(errors), NOISE)
        number = np.rint(errors**2 * self._units).argmin(axis=1)
        near = errors[np.arange(len(errors)), number] <= self._tolerance
        return np.where(near, np.array([c.number for c in self.clusters])[number], NOISE)

    # ------------------------------------------------------------------ §3.2.2
    def _discover(self) -> bool:
        """Look for a mode in the noise, unify it with another one, and let EM converge; whether there was one."""
        if len(self._noise) < self._wait:
            return False
        noise = np.array(sorted(self._noise), dtype=np.intp)
        # Samples are drawn by chance: one search may miss what the next one finds. But where nothing fits, as with too
        # small a σ, a search for every example would take hours.
        self._wait = len(self._noise) + max(1, len(self._noise) // _GROWTH)
        found = self._constant(noise) if self.settings.constants else None
        found = found or self._line(noise)
        if found is None:
            return False
        waited = self._wait
        self._wait = self.settings.min_examples
        cluster, members = found
        known = {c.number for c in self.clusters}
        # A unified mode is a new one, so that it is unified with what is left: of three flights at three speeds any two
        # are too few for one function.
        while (unified := self._unified(cluster, members)) is not None:
            cluster, members = unified, self.members(unified.number)
        if cluster not in self.clusters:
            self._add(cluster)
            self._move(members, cluster.number)
            self._refit(cluster)
        self._converge()
        if {c.number for c in self.clusters} <= known:  # EM gave its examples away: more of them may keep it
            self._wait = waited
            return False
        return True

    def _constant(self, noise: Rows) -> tuple[Cluster, Rows] | None:
        """The program's first step: the most examples with exactly the same value."""
        values, counts = np.unique(self.examples.y[noise], return_counts=True)
        best = int(counts.argmax())
        if counts[best] < self.settings.min_examples:
            return None
        group = int(self.examples.groups[noise[0]])
        arrangement = self.examples.arrangements[group]
        own = Role(arrangement.layout.types[arrangement.target].name, ())
        members = noise[self.examples.y[noise] == values[best]]
        return Cluster(self._next, (own,), float(values[best])), members

    def _line(self, noise: Rows) -> tuple[Cluster, Rows] | None:
        """A line through at least T examples of an arrangement."""
        for group, arrangement in enumerate(self.examples.arrangements):
            rows = noise[self.examples.groups[noise] == group]
            if len(rows) < self.settings.min_examples:
                continue
            x, y = self.examples.x(group, rows), self.examples.y[rows]
            found = search(x, y, self.settings, self._rng)
            if found.line is not None and found.size >= self.settings.min_examples:
                roles = roles_of(found.line, arrangement)
                return Cluster(self._next, roles, found.line.intercept), rows[found.inliers]
        return None

    # ------------------------------------------------------------------ §3.2.5
    def _unified(self, new: Cluster, members: Rows) -> Cluster | None:
        """Replace a mode and another one by one function for the examples of both; none if there is no such."""
        for old in self.clusters:
            general = None if old is new else self._general(old, new, members)
            if general is None or not _occam(general, old, new):
                continue
            both = np.concatenate([self.members(old.number), members])
            # It stands where the older one stood: of modes that explain an example equally well the first one has it.
            place = min(self.clusters.index(each) for each in (old, new) if each in self.clusters)
            for each in (old, new):
                if each in self.clusters:
                    self._drop(each)
            self._add(general, place)
            fits = self._errors[general.number][both] <= self._tolerance
            self._move(both[fits], general.number)
            self._move(both[~fits], NOISE)
            self._refit(general)
            return general
        return None

    def _own(self, cluster: Cluster, members: Rows) -> NDArray[np.bool_]:
        """Which of a mode's examples no other one explains; all of them if these alone would found no mode."""
        others = [self._errors[c.number][members] for c in self.clusters if c is not cluster]
        if not others:
            return np.ones(len(members), dtype=np.bool_)
        own: NDArray[np.bool_] = np.min(others, axis=0) > self._tolerance
        return own if own.sum() >= self.settings.min_examples else np.ones(len(members), dtype=np.bool_)

    def _general(self, first: Cluster, second: Cluster, new: Rows) -> Cluster | None:
        """A function for most of both, of the target and of objects that are alone of their type."""
        old = self.members(first.number)
        rows = np.concatenate([old, new])
        counted = np.concatenate([self._own(first, old), self._own(second, new)])
        groups = np.unique(self.examples.groups[rows]).tolist()
        arrangements = [self.examples.arrangements[g] for g in groups]
        shared = _shared(arrangements)
        x = np.empty((len(rows), sum(len(a) for a in shared[0])))
        for group, columns in zip(groups, shared, strict=True):
            here = self.examples.groups[rows] == group
            flat = [c for part in columns for c in part]
            x[here] = self.examples.x(group, rows[here])[:, flat]
        ratio = self.settings.unify_ratio
        united = Union(len(old), counted, ratio)
        found = search(x, self.examples.y[rows], self.settings, self._rng, united)
        if found.line is None:
            return None
        flat = [c for part in shared[0] for c in part]
        roles = roles_of(found.line, arrangements[0], flat)
        return Cluster(self._next, roles, found.line.intercept)

    # ------------------------------------------------------------------ §3.2.4
    def _converge(self) -> None:
        """E-steps and M-steps until no example changes its mode."""
        for _ in range(self.settings.em_iterations):
            lost = self._assign()
            stale = lost if self.settings.refit_after_loss else set()
            refitted = [self._refit(c) for c in list(self.clusters) if c.number in stale]
            gone = [c for c in self.clusters if len(self.members(c.number)) < self.settings.least_members]
            for cluster in gone:
                self._move(self.members(cluster.number), NOISE)
                self._drop(cluster)
            if not any(refitted) and not gone:
                return

    def _assign(self) -> set[int]:
        """E-step. Modes that lost an example; one that takes an example explains it, and needs no other function."""
        n = self.examples.count
        if not self.clusters:
            return set()
        errors = np.stack([self._errors[c.number][:n] for c in self.clusters], axis=1)
        after = self._likeliest(errors)
        moved = np.flatnonzero(after != self.labels)
        lost = set(self.labels[moved].tolist()) - {NOISE}
        for number in np.unique(after[moved]).tolist():
            self._move(moved[after[moved] == number], number)
        return lost

    def _refit(self, cluster: Cluster) -> bool:
        """M-step: fit the function to all its examples, each under its best casting; whether it changed.

        Forward-stepwise regression may miss the function that the examples lie on: one that explains fewer of them than
        the present one isn't taken, so that likelihood never falls; nor one of what merely differs between two scenes.
        """
        members = self.members(cluster.number)
        if len(members) < self.settings.sample:
            return False
        parts_x, parts_y = [], []
        first: tuple[Arrangement, list[int]] | None = None
        for group in np.unique(self.examples.groups[members]).tolist():
            arrangement = self.examples.arrangements[group]
            rows = members[self.examples.groups[members] == group]
            x, y = self.examples.x(group, rows), self.examples.y[rows]
            number = cluster.cast(arrangement, x, y)
            for k, casting in enumerate(cluster.castings(arrangement)):
                columns = [c for i in casting.objects for c in arrangement.columns(i)]
                here = number == k
                if here.any():
                    parts_x.append(x[here][:, columns])
                    parts_y.append(y[here])
                    first = first or (arrangement, columns)
        assert first is not None, "a mode with examples has castings"
        x = np.concatenate(parts_x)
        line = fit(x, np.concatenate(parts_y), self.settings.noise_variance)
        if not varied(x[:, list(line.columns)]):
            return False
        old, errors = (cluster.roles, cluster.intercept), self._errors[cluster.number]
        if not cluster.become(roles_of(line, first[0], first[1]), line.intercept):
            return False
        fitted = int((errors[members] <= self._tolerance).sum())
        self._errors[cluster.number] = np.empty_like(errors)
        self._measure(cluster)
        if int((self._errors[cluster.number][members] <= self._tolerance).sum()) >= fitted:
            return True
        cluster.become(*old)
        self._errors[cluster.number] = errors
        return False

    # ------------------------------------------------------------------ bookkeeping
    def _add(self, cluster: Cluster, place: int | None = None) -> None:
        self.clusters.insert(len(self.clusters) if place is None else place, cluster)
        self._next = cluster.number + 1
        self._errors[cluster.number] = np.empty(len(self._labels))
        self._measure(cluster)

    def _measure(self, cluster: Cluster) -> None:
        """Errors of all examples under a mode's function."""
        for group, arrangement in enumerate(self.examples.arrangements):
            numbers, x = self.examples.rows(group)
            self._errors[cluster.number][numbers] = cluster.errors(arrangement, x, self.examples.y[numbers])

    def _drop(self, cluster: Cluster) -> None:
        self.clusters.remove(cluster)
        del self._errors[cluster.number]

    def _move(self, rows: Rows, number: int) -> None:
        self._labels[rows] = number
        if number == NOISE:
            self._noise.update(rows.tolist())
        else:
            self._noise.difference_update(rows.tolist())


def _occam(general: Cluster, old: Cluster, new: Cluster) -> bool:
    """Whether one function is simpler than two, and no more special than either.

    ``-0.9 v`` covers what doesn't move, but ``v' = 0`` says it with less; and of two scenes anything that differs
    between them tells left from right.
    """
    parameters = old.parameters, new.parameters
    return general.parameters <= max(parameters) and general.parameters < sum(parameters)


def _shared(arrangements: list[Arrangement]) -> list[list[range]]:
    """For each arrangement the columns of the target and of the types that are alone in all of them, in one order."""
    alone = [{a.layout.types[i].name: i for i in a.alone() if i != a.target} for a in arrangements]
    names = sorted(set.intersection(*(set(found) for found in alone)))
    return [
        [a.columns(a.target), *(a.columns(found[name]) for name in names)]
        for a, found in zip(arrangements, alone, strict=True)
    ]
