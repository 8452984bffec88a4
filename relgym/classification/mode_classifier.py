"""Which mode holds? One-against-one voting of binary classifiers, learned one example at a time (§3.4)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.classification.binary import BinaryClassifier
from relgym.classification.examples import NOISE, Bools, Example, ExampleBatch, Floats, Vocabulary
from relgym.classification.exemplars import Exemplars
from relgym.classification.familiarity import Familiarity, situations, used_by
from relgym.classification.learning import Lesson
from relgym.classification.owners import Owners
from relgym.classification.pairs import PairState, covered_by, pair_labels
from relgym.classification.ranking import Ranking, RankingBatch, Verdict
from relgym.classification.rows import RowPool
from relgym.classification.views import Context, Scope, View
from relgym.classification.voting import Voting
from relgym.config import ClassificationConfig
from relgym.config.constants import ROUNDED, ROUNDINGS

__all__ = ["ModeClassifier"]


class ModeClassifier:
    """Ranks modes by the votes of all pairs' classifiers.

    Parameters
    ----------
    vocabulary
        Names of what examples hold.
    config
        Settings.
    pool
        Holds own features of the examples that are remembered: see `Exemplars`.

    Attributes
    ----------
    exemplars
        The examples it remembers.
    counts
        Examples seen of each mode, by id.

    Notes
    -----
    Online use: `observe` every example, `sync` when the modes change, `refresh` with a budget of work now and
    then. Agreeing examples only update counts; a pair becomes stale when an example contradicts it (design
    §5). All votes are integers, so that `rank` and `rank_batch` agree bit for bit whatever the order of
    summation.
    """

    def __init__(
        self, vocabulary: Vocabulary, config: ClassificationConfig, pool: RowPool | None = None
    ) -> None:
        self.vocabulary = vocabulary
        self.config = config
        self.exemplars = Exemplars(vocabulary, config, pool)
        self.counts: dict[int, float] = {}
        self._pairs: dict[tuple[int, int], PairState] = {}
        self._view: tuple[int, View, Floats] | None = None
        self._seen: Familiarity | None = None
        self._owners = Owners({}, ())
        self._reset_caches()

    @property
    def modes(self) -> tuple[int, ...]:
        """Mode ids, in the order in which `values` and `fits` are given."""
        return self.exemplars.modes

    @property
    def classifiers(self) -> tuple[BinaryClassifier, ...]:
        """All pairs' classifiers, in the order of their mode ids."""
        return tuple(pair.classifier for pair in self._pairs.values())

    @property
    def stale(self) -> tuple[tuple[int, int], ...]:
        """Pairs that wait to be learned anew, the most contradicted first."""
        return tuple(p.modes for p in sorted(self._pairs.values(), key=lambda p: p.urgency) if p.stale)

    @property
    def waits(self) -> bool:
        """Whether there are pairs that wait to be learned anew."""
        return any([pair.stale for pair in self._pairs.values()])

    @property
    def flawless(self) -> set[int]:
        """Modes that are told from all others without an error among the examples that are remembered."""
        return set(self.modes).difference(*self._doubtful)

    def alternatives(self, mode: int) -> set[int]:
        """Modes that one isn't told from without an error among the examples that are remembered."""
        return {other for pair in self._doubtful if mode in pair for other in pair if other != mode}

    @property
    def _doubtful(self) -> list[tuple[int, int]]:
        """Pairs that aren't told apart without an error."""
        return [pair.modes for pair in self._pairs.values() if pair.errors > 0 or pair.stale]

    @property
    def relations(self) -> frozenset[str]:
        """Names of the binary relations that clauses ask for: `rank_batch` needs no others."""
        used = self._familiarity().used
        return frozenset(self.vocabulary.relations[column] for _, columns, _ in used for column in columns)

    # ----- asking -----

    def rank(self, example: Example, values: Sequence[float]) -> Ranking:
        """Rank the modes for one example.

        Parameters
        ----------
        example
            The example.
        values
            What each mode's function predicts, in the order of `modes`; NaN where its roles can't be filled.
        """
        return self._voting.rank(example, values, self.counts, self._familiarity())

    def rank_batch(self, batch: ExampleBatch, values: Floats) -> RankingBatch:
        """Rank the modes for n examples; equal to `rank` of each. `values` has shape ``(n, len(modes))``."""
        return self._voting.rank_batch(batch, values, self.counts, self._familiarity())

    def remembered(self) -> tuple[View, Floats, RankingBatch]:
        """The examples that are remembered, how many each stands for, and how they are ranked now.

        There is at least one mode and one example.
        """
        view, weights = self._current_view()
        return view, weights, self._voting.rank_view(view, self.counts, self._familiarity())

    def experience(
        self,
    ) -> tuple[tuple[tuple[Context, tuple[str, ...], tuple[str, ...]], ...], frozenset[int]]:
        """Binary and unary relations that clauses look at, by context, and the situations that were seen of them."""
        known, v = self._familiarity(), self.vocabulary
        names = tuple(
            (context, tuple(v.relations[k] for k in relations), tuple(v.unary[k] for k in unary))
            for context, relations, unary in known.used
        )
        return names, frozenset(known.seen)

    def explain(self, example: Example, values: Sequence[float]) -> list[Verdict]:
        """How the winner fared against every other mode, in the order of the ranking."""
        ranking = self.rank(example, values)
        return self._voting.verdicts(example, values, ranking.modes)

    # ----- learning -----

    def observe(
        self,
        example: Example,
        assigned: int,
        fits: Bools,
        values: Floats,
        *,
        roles: Sequence[int] = (),
        hard: bool = False,
        weight: float = 1.0,
    ) -> int:
        """Take in one classified example; the number of pairs that it contradicts.

        Parameters
        ----------
        example
            The example.
        assigned
            Mode it was assigned to, or `NOISE`.
        fits
            Which modes' functions explain it, in the order of `modes`.
        values
            What they predict.
        roles
            Object playing each role of the assigned mode.
        hard
            Whether to prefer the example in memory even if it contradicts no pair (say, a role classifier).
        weight
            How many seen examples it stands for.

        Notes
        -----
        Learns nothing (that is `refresh`); cost some 100 µs.
        """
        wrong, seen = 0, self._familiarity()  # before anything changes: must not depend on who asked when
        if assigned != NOISE:
            self.counts[assigned] = self.counts.get(assigned, 0.0) + weight
            wrong = self._count(example, self._owner(example, assigned, fits, weight), fits, values, weight)
        self.exemplars.add(
            example, assigned, fits, values, hard=hard or wrong > 0, roles=roles, weight=weight
        )
        seen.add(example, self._voting.key(example))
        return wrong

    def sync(
        self,
        modes: Sequence[int],
        assigned: NDArray[np.integer[Any]],
        fits: Bools,
        values: Floats,
        roles: NDArray[np.integer[Any]] | None = None,
    ) -> None:
        """Follow a change of the modes: re-label all exemplars, drop pairs of modes that are gone.

        Parameters
        ----------
        modes
            Ids of the modes there are now.
        assigned
            Mode of the example in every slot of `exemplars` (see ``exemplars.rows``), shape ``(n,)``.
        fits, values
            Shape ``(n, len(modes))``.
        roles
            Object playing each role of the assigned mode, -1 for none, shape ``(n, most roles)``; default: as
            before.

        Notes
        -----
        Only pairs whose examples changed labels, or whose functions moved, are checked; only those that now
        err more than they did become stale.
        """
        modes, before = tuple(modes), self._labels(self._pairs)
        old = dict(zip(self.modes, self.exemplars.columns["values"].T.copy(), strict=True))
        moved = {m for at, m in enumerate(modes) if m in old and not _same(old[m], values[:, at])}
        kept = self.exemplars.set_modes(modes, assigned, fits, values, roles)
        weights = self.exemplars.weights()
        self.counts = {m: float(weights[self.exemplars.assigned == m].sum()) for m in modes}
        self._owners = Owners.of(self.exemplars, self._covering())
        lasting = {
            pair: labels[kept]
            for pair, labels in before.items()
            if set(pair) <= set(modes) and not set(pair) & moved
        }
        now = self._labels(lasting)
        self._update_pairs([pair for pair, labels in lasting.items() if np.array_equal(labels, now[pair])])
        self._reset_caches()

    def widen(self, vocabulary: Vocabulary, own: Floats) -> None:
        """Other own features from here on; everything is learned again of the examples that are remembered.

        Parameters
        ----------
        vocabulary
            The new names; those of relations and pairs stay.
        own
            Values of the own features for every slot of `exemplars`, shape ``(n, len(vocabulary.own))``.
        """
        self.vocabulary = vocabulary
        self.exemplars.widen(vocabulary, own)
        self._pairs, self._view = {}, None
        self._reset_caches()
        self._update_pairs(())
        self._reset_caches()

    def refresh(self, budget: float = math.inf, amended: set[int] | None = None) -> int:
        """Learn stale pairs anew, the most contradicted first, until the budget is spent; the cells spent.

        Work is counted in cells (`ModelConfig.cells_per_step`), never in time: the result is the same on any machine. A
        pair is learned in pieces (`Task`), and a piece is finished once begun: one call can overdraw the budget, and a
        pair may be finished by a later call.

        To `amended` are added modes of which it was learned again when they hold.
        """
        spent, changed = 0, set[int]()
        if not self.waits:
            return 0
        for pair in sorted((p for p in self._pairs.values() if p.stale), key=lambda p: p.urgency):
            before = pair.classifier
            while pair.stale and spent < budget:
                lesson = self._lessons([pair.modes])[pair.modes]
                spent += pair.refresh(lesson, self.config, budget - spent)
            if pair.classifier is not before:
                changed |= set(pair.modes)
        if changed:
            self._pairs_changed()
        if amended is not None:
            amended |= changed
        return spent

    # ----- state -----

    def to_dict(self, *, exemplars: bool = True) -> dict[str, Any]:
        """Plain JSON-able dictionary; without exemplars the classifier can answer but not go on learning."""
        return {
            "vocabulary": self.vocabulary.to_dict(),
            "modes": list(self.modes),
            "counts": [[mode, count] for mode, count in sorted(self.counts.items())],
            "pairs": [pair.to_dict() for pair in self._pairs.values()],
            "seen": sorted(self._familiarity().seen),
            "covered": [list(pair) for pair in sorted(self._owners.covered)],
            "certain": self._owners.to_list() if exemplars else [],
            "exemplars": self.exemplars.to_dict() if exemplars else None,
        }

    @classmethod
    def from_dict(
        cls, data: dict[str, Any], config: ClassificationConfig, pool: RowPool | None = None
    ) -> ModeClassifier:
        """Inverse of `to_dict`."""
        self = cls(Vocabulary.from_dict(data["vocabulary"]), config, pool)
        if data["exemplars"] is not None:
            self.exemplars.load(data["exemplars"])
        else:
            self.exemplars.modes = tuple(data["modes"])
        self.counts = {int(mode): float(count) for mode, count in data["counts"]}
        for plain in data["pairs"]:
            i, j = int(plain["classifier"]["i"]), int(plain["classifier"]["j"])
            self._pairs[i, j] = PairState.from_dict(plain, self._scope(i, j))
        self._reset_caches()
        covered = [(int(k), int(m)) for k, m in data["covered"]]
        self._remember(data["seen"], Owners.from_list(data.get("certain", []), covered))
        return self

    def __getstate__(self) -> dict[str, Any]:
        # Caches are rebuilt on demand; leaving them out keeps pickles and copies small.
        kept = {"vocabulary", "config", "exemplars", "counts", "_pairs", "_owners"}
        state = {name: value for name, value in self.__dict__.items() if name in kept}
        return state | {"_view": None, "_seen": sorted(self._familiarity().seen)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._reset_caches()
        self._remember(state["_seen"], state["_owners"])

    # ----- inside -----

    def _count(self, example: Example, owner: int, fits: Bools, values: Floats, weight: float) -> int:
        outcomes = self._voting.outcomes(example, np.asarray(values).tolist())
        wrong = 0
        explained = dict(zip(self.modes, np.asarray(fits).tolist(), strict=True))
        for at, ((i, j), pair) in enumerate(self._pairs.items()):
            for_i, for_j = (owner == m or self._covers(m, owner, explained) for m in (i, j))
            other = j if for_i else i
            if for_i == for_j or explained[other]:
                continue
            wrong += pair.observe(outcomes[at], for_i, self.config.relearn_growth, weight)
            self._voting.recount(at)
        return wrong

    def _covers(self, mode: int, owner: int, explained: Mapping[int, bool]) -> bool:
        """Whether a mode explains an example that belongs to one it covers, see `pair_labels`."""
        return explained[mode] and (owner, mode) in self._owners.covered

    def _owner(self, example: Example, assigned: int, fits: Bools, weight: float) -> int:
        """The mode that a new example belongs to."""
        explaining = [m for m, ok in zip(self.modes, np.asarray(fits).tolist(), strict=True) if ok]
        self._owners.count(assigned, example.key, explaining, weight)
        return self._owners.owner(assigned, example.key, explaining)

    def _familiarity(self) -> Familiarity:
        if self._seen is None:
            used = used_by(self.classifiers, self.vocabulary)
            view, _ = self._current_view()
            self._seen = Familiarity(used, situations(view, used).tolist())
        return self._seen

    def _current_view(self) -> tuple[View, Floats]:
        version = self.exemplars.version
        if self._view is None or self._view[0] != version:
            self._view = version, View.of_exemplars(self.exemplars), self.exemplars.weights()
        return self._view[1], self._view[2]

    def _lessons(self, pairs: Iterable[tuple[int, int]]) -> dict[tuple[int, int], Lesson]:
        """What each pair is to be learned from."""
        view, weights = self._current_view()
        labels = self._labels(pairs)
        rows = {pair: np.flatnonzero(found) for pair, found in labels.items()}
        return {pair: Lesson(view, at, labels[pair][at] > 0, weights[at]) for pair, at in rows.items()}

    def _labels(self, pairs: Iterable[tuple[int, int]]) -> dict[tuple[int, int], NDArray[np.int8]]:
        """Which exemplars teach each pair, and for which of its modes they are examples: see `pair_labels`."""
        assigned, fits, modes = self.exemplars.assigned, self.exemplars.columns["fits"], self.modes
        owners = self._owners.owners(self.exemplars)
        return pair_labels(assigned, owners, fits, modes, pairs)

    def _scope(self, i: int, j: int) -> Scope:
        return Scope.of(self.vocabulary, self.config, (i, j))

    def _update_pairs(self, unchanged: Iterable[tuple[int, int]]) -> None:
        every = list(combinations(sorted(self.modes), 2))
        kept = set(unchanged)
        lessons = self._lessons([pair for pair in every if pair not in kept])
        pairs = {}
        for i, j in every:
            pair = self._pairs.get((i, j))
            if pair is None:
                pair = PairState.new(i, j, self._scope(i, j), lessons[i, j])
            elif (i, j) in lessons:
                pair.check(lessons[i, j])
            pairs[i, j] = pair
        self._pairs = pairs

    def _reset_caches(self) -> None:
        self._voting = Voting(self.vocabulary, self.modes)
        self._pairs_changed()

    def _remember(self, seen: Iterable[int], owners: Owners) -> None:
        """Take over what can't be told from the exemplars, which are but a choice of the examples."""
        self._seen = Familiarity(used_by(self.classifiers, self.vocabulary), seen)
        self._owners = owners

    def _pairs_changed(self) -> None:
        self._voting.set_pairs(self.classifiers)
        self._seen = None
        self._owners = self._owners.with_covered(self._covering())

    def _covering(self) -> set[tuple[int, int]]:
        """Pairs (k, m) of modes of which m covers k."""
        assigned, fits = self.exemplars.assigned, self.exemplars.columns["fits"]
        return {
            (k, m)
            for at, m in enumerate(self.modes if len(assigned) else ())
            for k in covered_by(assigned, fits[:, at] | (assigned == m))
        }


def _same(a: Floats, b: Floats) -> bool:
    """Whether a function's values moved by no more than rounding."""
    return bool(
        np.allclose(a, b, rtol=ROUNDED, atol=ROUNDINGS * float(np.finfo(np.float64).eps), equal_nan=True)
    )
