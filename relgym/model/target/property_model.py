"""The model of one target: its modes, when each holds, and which objects its roles are bound to (Figure 1.4)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.classification.examples import NOISE as UNKNOWN
from relgym.classification.examples import Example, Vocabulary
from relgym.classification.mode_classifier import ModeClassifier
from relgym.classification.ranking import RankingBatch
from relgym.classification.rows import RowPool
from relgym.clustering.clusterer import ClusterReport, ModeClusterer
from relgym.clustering.columns import SlotSignature
from relgym.clustering.examples import ExampleTable
from relgym.clustering.features import features_for
from relgym.clustering.mode import NOISE, Mode
from relgym.clustering.roles import Binding
from relgym.config import ModelConfig
from relgym.config.constants import EVIDENCE, FEWEST, LEFT_OPEN, MEMORY, RECENT, ROUGH, SEARCHED_CELLS
from relgym.model.percepts.grouping import distinct, members
from relgym.model.percepts.perception import Percept, Situation
from relgym.model.predicting.calibration import EXPERTS, OWN, Assessment, Calibration, Key
from relgym.model.predicting.prediction import OUTCOMES, Outcome, Prediction
from relgym.model.target.candidates import Candidates
from relgym.model.target.casting import Casting
from relgym.model.target.conditions import Conditions, needed
from relgym.model.target.ended import come_and_go, ended
from relgym.model.target.fallback import Fallback
from relgym.model.target.functions import ModeFunctions, Verdict, bodies_of
from relgym.model.target.guess import Guesses
from relgym.model.target.hindsight import Hindsight, Standing
from relgym.model.target.limits import Limits, find_limits
from relgym.model.target.scope import EVERYWHERE, Scope, find_scope
from relgym.model.target.spread import Spreads, measure
from relgym.model.target.stops import Stops, find_stops
from relgym.program.records import NO_RUNNER_UP
from relgym.scene.objects import Target
from relgym.scene.schema import SceneSchema
from relgym.scheduling.agenda import Budget

__all__ = ["PropertyModel", "Verdict", "bodies_of"]

_PREDICTED, _NO_MODE, _NO_ROLES, _OUTSIDE, _UNEXPLAINED = (
    OUTCOMES.index(o)
    for o in (Outcome.PREDICTED, Outcome.NO_MODE, Outcome.NO_ROLES, Outcome.OUTSIDE, Outcome.UNEXPLAINED)
)


_NOTHING = Calibration()


class PropertyModel:
    """Learns and predicts one target.

    Parameters
    ----------
    target
        What it predicts.
    vocabulary
        Names of what its classifiers are shown, without what `conditions` adds.
    config
        Free parameters.
    schema
        The scenes' schema.
    pool
        Holds the numbers of the vocabulary's own features that its classifiers remember, and those of other targets of
        its type.

    Attributes
    ----------
    clusterer, classifier, casting
        The learners of modes, of their preconditions and of role bindings.
    spreads
        How far examples scatter about their modes.
    limits
        Which modes are limits: they take no part in the vote but cut off what its winner predicts.
    stops
        Which modes are walls at work: they take no part in the vote either.
    past
        Ids of modes that have ended (`relgym.model.target.ended`): nor do they.
    amended
        Ids of modes of which it was learned again when they hold, or whose objects, or where a limit cuts them off.
    hindsight
        How the latest predictions came out, if somebody looked back at them.
    calibration
        How right predictions of every kind were, if somebody looked back at them, and who gives their values.
    latest
        Id of the mode that explained the latest example that any mode did.
    surmise
        Whether what modes say is never claimed, since only laws of motion can know (`Laws.beyond_modes`).
    leaned_on
        Whether laws of other properties read this one's next value. Then its modes answer as long as it has any: what a
        guess leaves would be magnified in those laws.
    """

    def __init__(
        self,
        target: Target,
        vocabulary: Vocabulary,
        config: ModelConfig,
        schema: SceneSchema,
        pool: RowPool,
    ) -> None:
        self.target = target
        self.schema = schema
        self.config = config
        self._base = vocabulary
        self._pool = pool
        self.conditions = Conditions(schema, target)
        self.clusterer = ModeClusterer(target, config.clustering, seed=config.seed)
        shown = self.conditions.vocabulary(vocabulary, ())
        self.classifier = ModeClassifier(shown, config.classifying, pool)
        self.casting = Casting(vocabulary, config.classification)
        self.functions = ModeFunctions(self.clusterer, self.casting, config)
        self.fallback = Fallback(self.clusterer, offered=bool(features_for(config.features, target.type)))
        self.spreads = Spreads()
        self.limits = Limits()
        self.stops = Stops()
        self.past: set[int] = set()
        self.amended: set[int] = set()
        self.hindsight = Hindsight()
        self.candidates = Candidates(config.hypotheses)
        self.calibration = Calibration(config.claim_probability, config.claim_slips, len(config.hypotheses))
        self.latest = NOISE
        self.surmise = False
        self.leaned_on = False
        self._unsettled = True
        self._unmeasured = False

    @property
    def modes(self) -> tuple[Mode, ...]:
        """All modes but noise, by id."""
        return self.clusterer.modes

    def mode(self, number: int) -> Mode:
        """The mode of that id."""
        return self.functions.mode(number)

    def _assess(self) -> bool:
        seen = self.clusterer.seen
        if not self.clusterer.clusters:
            return seen >= RECENT
        return seen >= RECENT and _noisy(self.clusterer.labels[-RECENT:]) > 0.5

    @property
    def needs(self) -> frozenset[tuple[str, str]]:
        """(type, property) pairs whose next values a mode's function reads or a clause tests."""
        modes = [c.mode for c in self.clusterer.clusters.values()]
        return needed(self.target, modes, self.classifier.classifiers)

    # ------------------------------------------------------------------ learning
    def learn_one(
        self,
        table: ExampleTable,
        row: int,
        y: float,
        signature: SlotSignature,
        example: Example,
        budget: Budget | None = None,
        weight: int = 1,
    ) -> ClusterReport:
        """Take up one example: cluster it, then let the classifiers see where it belongs.

        Parameters
        ----------
        table, row
            The example's regression row.
        y
            The property's next value.
        signature, example
            The types in the row's slots, and how the target object is situated.
        budget
            What may be spent on searches; default: as much as they take.
        weight
            How many examples this one stands for.
        """
        x = table.x[row : row + 1]
        seen = self._with_values(example, signature, x, len(self.clusterer.y))
        self._compare(signature, seen, x[0], y)
        report = self.clusterer.learn_one(table, row, y, budget)
        if weight > 1:
            self.clusterer.stand_for(report.mode, weight - 1)
        self._unsettled = _noisy(self.clusterer.labels[-RECENT:]) > LEFT_OPEN
        if report.mode != NOISE and self.latest not in report.fits:
            self.latest = report.mode
        self.fallback.unexplained = self._assess()
        self._unmeasured |= self.clusterer.seen % RECENT == 0
        if report.changed or (self._unmeasured and (budget is None or budget.left)):
            self._measure(table, budget)
        refuted = self.limits.overstepped(y, self.clusterer.scale.tolerance)
        refuted |= self.stops.contradicted(report.mode, signature, x[0])
        mode = self._of_now(report)
        if self._turned(mode) or report.changed or refuted:
            self._follow(table)
        fits = np.array([i in report.fits for i in self.classifier.modes], dtype=bool)
        values = np.array(self.functions.values_one(signature, x[0].tolist(), self.classifier.modes))
        if mode in self.limits:
            given, credit = self._credited(np.array([mode]), fits[None], values[None], self.classifier.modes)
            mode, fits = int(given[0]), credit[0]
        if mode in self.functions.places:
            self.functions.confirm_places(table, seen.row, mode)
        assigned = UNKNOWN if mode == NOISE or self.bounds(mode) else mode
        played = self.functions.played_one(table, seen.row, mode)
        self.classifier.observe(seen, assigned, fits, values, roles=played, weight=weight)
        if played:
            self.casting.observe(self.mode(mode), seen, played, weight)
        self.vouch()
        return report

    def _of_now(self, report: ClusterReport) -> int:
        """The mode that an example is of: not one that has ended, as long as another one explains it, too."""
        if report.mode not in self.past:
            return report.mode
        return next((mode for mode in report.fits if mode not in self.past), report.mode)

    def _turned(self, mode: int) -> bool:
        """Take note of modes that have ended, or of one that hasn't after all; whether there were any."""
        if mode in self.past:
            self.past.discard(mode)
            return True
        if not self.undecided or self.fallback.inexact:  # of what is only roughly known all fail now and then
            return False
        known = self.calibration
        over = ended(
            self.clusterer.labels,
            self.classifier.modes,
            lambda mode: known.failing(Key(_PREDICTED, mode, 0)),
            self.classifier.alternatives,
        )
        if over:
            self.past |= over
            known.fleeting |= come_and_go(self.clusterer.labels, self.past)
            self.hindsight = Hindsight()  # another vote is taken from now on
        return bool(over)

    @property
    def waits(self) -> bool:
        """Whether something is being looked for, or is due."""
        c, fallback = self.clusterer, self.fallback
        if c.waits or self.classifier.waits or self.casting.waits:
            return True
        return self.candidates.due(c.seen) or (fallback.guessable and fallback.guesses.stale(c.seen))

    @property
    def standing(self) -> Standing:
        """How much a prediction teaches that came out as such ones do."""
        c = self.clusterer
        if self._unsettled or self.fallback.lawless:
            return Standing.COARSE
        # Of laws that nothing tells apart, what does may come yet, or again.
        if self.undecided or c.population.chancy:
            return Standing.OPEN
        return Standing.SETTLED

    def take_for_known(self, mode: int) -> bool:
        """Count an example for which others stand; false if the mode that predicted it is gone.

        `NOISE`: it was only roughly right, and nobody asked which mode held.
        """
        if mode != NOISE and mode not in self.clusterer.clusters:
            return False
        self.clusterer.pass_over()
        if mode != NOISE:
            self.latest = mode
        return True

    def follow_latest(self, signature: SlotSignature, x: NDArray[np.float64], y: float) -> None:
        """Take note of which mode explains an example that isn't learned from, since others stand for it.

        Of modes whose roles bodies play only learning tells that (`cast`).
        """
        ids = tuple(self.clusterer.clusters)
        errors = np.abs(np.array(self.functions.values_one(signature, x.tolist(), ids)) - y)
        fits = errors <= self.clusterer.scale.tolerance
        if fits.any() and not (self.latest in ids and fits[ids.index(self.latest)]):
            self.latest = ids[int(np.nanargmin(errors))]

    @property
    def cast(self) -> bool:
        """Whether bodies play roles in a mode."""
        return any([self.casting.embodied(cluster.mode) for cluster in self.clusterer.clusters.values()])

    def _compare(self, signature: SlotSignature, example: Example, x: NDArray[np.float64], y: float) -> None:
        """Let the guess and the modes predict an example before it is learned from."""
        binding = self.fallback.guessing(signature)
        if binding is None or self.fallback.unexplained or not self.classifier.modes:
            return
        row = x[: len(signature.columns)].tolist()
        if not self.fallback.scope.covers_one(row, signature):
            return
        values = self.functions.values_one(signature, row, self.classifier.modes)
        first = self.classifier.rank(example, values).modes[0]
        said = values[self.classifier.modes.index(first)]
        if np.isfinite(said):
            self.fallback.guesses.compare(said - y, binding.value(row) - y)

    def _with_values(
        self, example: Example, signature: SlotSignature, x: NDArray[np.float64], number: int = -1
    ) -> Example:
        """An example by its number, with the values that `conditions` adds, of a regression row ``(1, d)``."""
        if not self.conditions.columns:
            return example.with_own(example.own, number)
        return example.with_own(
            np.concatenate([example.own, self.conditions.values(signature, x)[0]]), number
        )

    @property
    def flags(self) -> frozenset[str]:
        """Names, as clauses use them, of the numbers that are 1 or 0 as something holds or not."""
        others = {f"{t.name}.{prop}" for t in self.schema.types for prop in t.flags}
        return frozenset(others.union(self.schema.type(self.target.type).flags))

    def follow(self, table: ExampleTable, budget: Budget | None = None) -> None:
        """The modes changed from outside: classifiers follow at once, spreads as soon as the budget allows it."""
        self._follow(table)
        if len(labels := self.clusterer.labels[-RECENT:]):
            self._unsettled = _noisy(labels) > LEFT_OPEN
        self.fallback.unexplained = self._assess()
        self._unmeasured = True
        if budget is None or budget.left:
            self._measure(table, budget)

    def _measure(self, table: ExampleTable, budget: Budget | None) -> None:
        """How far examples scatter, and how far approximations go."""
        self._unmeasured = False
        self.spreads = measure(self.clusterer, table)
        # Of bodies relations may tell what the numbers of a row don't.
        bodiless = not any(t.has_body for t in self.schema.types)
        bounded = self.fallback.lawless or (bodiless and self.clusterer.noise_examples >= FEWEST)
        asked = self.config.abstain and bounded and len(self.clusterer.rows)
        self.fallback.scope = (
            find_scope(self.clusterer, table, guessing=self.fallback.lawless) if asked else EVERYWHERE
        )
        if budget is not None:  # so that not all of many targets are measured in the same step
            budget.spend(SEARCHED_CELLS)

    def start_over(self, table: ExampleTable) -> None:
        """Learn all classifiers anew, of what they remember."""
        self._widen(table, self.classifier.vocabulary.follows)

    def remembered(self, slot: int) -> tuple[Example, int]:
        """What its classifiers remember in a slot, without what `conditions` adds, and its row in the example table."""
        kept = self.classifier.exemplars
        c = kept.columns
        k = int(c["exists"][slot].sum())
        example = Example(
            c["table"][slot][:, :k, :k],
            c["unary"][slot][:, :k],
            c["close"][slot][:k],
            c["pair"][slot][:k],
            kept.own_of(slot)[: len(self._base.own)],
            int(c["target"][slot]),
            kept.key_of(slot),
            int(c["row"][slot]),
            c["approached"][slot][:k],
        )
        return example, int(self.clusterer.rows[example.row])

    def remember(self, table: ExampleTable, example: Example, weight: float) -> None:
        """Let the classifiers remember one more of the examples there are, by its number in ``example.row``."""
        number = np.array([example.row])
        assigned = int(self.clusterer.labels[example.row])
        modes = self.classifier.modes
        known, fits = self.clusterer.fits(table, number)
        shown = np.array([bool(fits[0, known.index(i)]) for i in modes], dtype=bool)
        values = self.functions.values_many(table, self.clusterer.rows[number], modes)[0]
        labels, credit = self._credited(np.array([assigned]), shown[None], values[None], modes)
        assigned, shown = int(labels[0]), credit[0]
        played = self.functions.played(table, number, assigned)[0].tolist()
        label = assigned if assigned in modes else UNKNOWN
        self.classifier.exemplars.add(example, label, shown, values, roles=played, weight=weight)
        if played:
            self.casting.observe(self.mode(assigned), example, played)

    def keep(self, rows: NDArray[np.bool_]) -> None:
        """Forget the examples of dropped rows of the example table, shape ``(rows,)``."""
        numbers = self.clusterer.keep(rows)
        exemplars = self.classifier.exemplars.columns["row"]
        exemplars[:] = numbers[exemplars]

    def go_on(self, table: ExampleTable, budget: Budget) -> None:
        """Go on with a search for modes that is under way, as far as the budget goes."""
        if self.clusterer.go_on(table, budget):
            self.follow(table, budget)

    def approximate(self, table: ExampleTable, budget: Budget) -> None:
        """Look for an approximation if one is due, as far as the budget goes."""
        if self.clusterer.approximate_now(table, budget):
            self.follow(table, budget)

    def search(self, table: ExampleTable, budget: Budget) -> None:
        """Finish the searches that are under way or due, those of a target that has begun anew among them."""
        changed = self.clusterer.go_on(table, budget, begin=True)
        for _ in range(2):  # an approximation may be under way, and another one due
            changed |= self.clusterer.approximate_now(table, budget)
            changed |= self.clusterer.go_on(table, budget, begin=True)
        if changed:
            self.follow(table)

    def refresh(self, budget: int | None) -> int:
        """Re-learn stale classifiers within a budget of work (None: all); returns the work spent."""
        left = float("inf") if budget is None else budget
        spent = self.classifier.refresh(left, self.amended)
        spent += self.casting.refresh(self.classifier.exemplars, left - spent, self.amended)
        if self.amended and (revised := self.amended & self.reliable):
            self.amended -= revised
            self.calibration.revise(revised)
        if spent:
            self.vouch()
        return spent

    @property
    def accounted_for(self) -> bool:
        """Whether laws explain what was seen: else what a mode got wrong may be what nothing explains."""
        known = self.clusterer
        return not known.approximate and known.noise_examples <= LEFT_OPEN * known.seen

    @property
    def reliable(self) -> frozenset[int]:
        """Modes that are told from all others without an error in what is remembered, if laws explain what was seen.

        But none that scatters by more than what comes out right may be off: with so wide a tolerance anything explains
        what was seen, and what others leave is known better.
        """
        if not self.accounted_for:
            return frozenset()
        rounding = ROUGH * self.clusterer.floor
        told = self.classifier.flawless - self.casting.flawed
        return frozenset(mode for mode in told if self.mode(mode).sigma <= rounding or self._sharp(mode))

    def _sharp(self, mode: int) -> bool:
        """Whether a mode scatters by so little that nearly all it says comes out right."""
        return 2.0 * self.mode(mode).sigma <= self.config.claim_error * self.calibration.change

    @property
    def proven(self) -> int:
        """Bits by which examples speak for a mode that is the only one and explains all of them; 0 where none does.

        No condition and no choice of players was made to suit them, and what they scatter by is as good as right. So of
        n examples each is explained by what the others show: leave any of them out, and the function is the same. A
        next one that isn't would be one in n or more: log2 n bits, whole ones, of which fewer than `EVIDENCE` say
        nothing.
        """
        known = self.clusterer
        if len(self.classifier.modes) != 1 or known.approximate or known.noise_examples:
            return 0
        (only,) = self.classifier.modes
        if not self._sharp(only):
            return 0
        if self.casting.embodied(self.mode(only)) or len(self.functions.places.get(only, (0,))) != 1:
            return 0
        bits = known.seen.bit_length() - 1
        return bits if bits >= EVIDENCE else 0

    def vouch(self) -> None:
        """Tell what is known of predictions which modes are likely to be right, though they were never tried."""
        self.calibration.reliable, self.calibration.proven = self.reliable, self.proven

    def reconsider(self, table: ExampleTable, budget: Budget) -> None:
        """Guess anew where nothing is explained, and ask for hypotheses, if it is time, as far as the budget goes."""
        if self.fallback.guessable and self.fallback.guesses.stale(self.clusterer.seen):
            self.fallback.guesses.renew(self.clusterer, table, self.fallback.scope, budget)
        if self.candidates.due(self.clusterer.seen) and len(self.clusterer.rows):
            for renewed in self.candidates.renew(self.clusterer, table, budget):
                self.calibration.renewed(len(EXPERTS) + renewed)

    def retarget(self, target: Target, table: ExampleTable) -> None:
        """Be given other next values: modes and classifiers are learned again, from what is remembered."""
        self.target = target
        self.conditions = Conditions(self.schema, target)
        self.clusterer.retarget(target)
        self.casting = Casting(self._base, self.config.classification)
        self.functions = ModeFunctions(self.clusterer, self.casting, self.config)
        self.fallback.guesses.drop()
        self.hindsight, self._unsettled = Hindsight(), True  # what follows is another model's word
        self.calibration.forget()
        self.candidates.forget()
        self._follow(table)
        self._widen(table, self.classifier.vocabulary.follows)

    def lead(self, prop: str, step: float, table: ExampleTable) -> None:
        """Take note that ``prop' = prop + step * target'``: clauses may test where that leads to."""
        others = tuple(pair for pair in self.classifier.vocabulary.follows if pair[0] != prop)
        self._widen(table, (*others, (prop, step)))
        self._follow(table)

    def _widen(self, table: ExampleTable, follows: tuple[tuple[str, float], ...]) -> None:
        exemplars = self.classifier.exemplars
        rows = self.clusterer.rows[exemplars.rows.astype(np.intp)]
        ahead = np.full((len(rows), len(self.conditions.columns)), np.nan)
        for number in np.unique(table.signature_ids[rows]):
            part = np.flatnonzero(table.signature_ids[rows] == number)
            ahead[part] = self.conditions.values(table.signatures[int(number)], table.x[rows[part]])
        own = exemplars.columns["own"][:, : len(self._base.own)]
        vocabulary = self.conditions.vocabulary(self._base, follows)
        self.classifier.widen(vocabulary, np.concatenate([own, ahead], axis=1))

    def _follow(self, table: ExampleTable) -> None:
        """The set of modes changed: what the classifiers remember is labelled anew."""
        self.functions.find_places(table)
        self.fallback.bound.clear()
        before, self.limits = self.limits, find_limits(self.clusterer, table)
        self.stops = self._find_stops(table)
        numbers = self.classifier.exemplars.rows.astype(np.intp)
        known, fits = self.clusterer.fits(table, numbers)
        self.past.intersection_update(known)
        ids = tuple(i for i in known if not self.bounds(i))
        fits = fits[:, [not self.bounds(i) for i in known]]
        values = self.functions.values_many(table, self.clusterer.rows[numbers], ids)
        labels, fits = self._credited(self.clusterer.labels[numbers], fits, values, ids)
        self.calibration.keep(ids)
        self.amended = set(ids) if self.limits != before else self.amended.intersection(ids)
        self.classifier.sync(ids, np.where(np.isin(labels, ids), labels, UNKNOWN), fits, values)
        self.casting.sync({m.id: m for m in self.modes})
        self.functions.recast(table, self.classifier.exemplars)
        self.casting.recall(self.classifier.exemplars)
        self.vouch()

    def _credited(
        self,
        labels: NDArray[np.integer],
        fits: NDArray[np.bool_],
        values: NDArray[np.float64],
        modes: Sequence[int],
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Labels and fits with the examples of limits given to modes that lead beyond them, the commonest first."""
        clusters = self.clusterer.clusters
        order = sorted(range(len(modes)), key=lambda k: (-clusters[modes[k]].fitted, modes[k]))
        labels, found = self.limits.credited(
            labels,
            fits[:, order],
            values[:, order],
            [modes[k] for k in order],
            self.clusterer.scale.tolerance,
        )
        fits = np.empty_like(found)
        fits[:, order] = found
        return labels, fits

    def _find_stops(self, table: ExampleTable) -> Stops:
        given = [prop for name, prop in self.conditions.pairs if name == self.target.type]
        taken = (self.limits.low, self.limits.high)
        return find_stops(self.clusterer, table, self.classifier.vocabulary.follows, given, taken)

    # ------------------------------------------------------------------ answering
    def bounds(self, mode: int) -> bool:
        """Whether a mode takes no part in the vote: it stands in where the others would lead too far, or has ended."""
        return mode in self.limits or mode in self.stops or mode in self.past

    @property
    def unexplained(self) -> bool:
        """Whether it is known by now that modes don't describe the target: just some of its examples, or not when."""
        return (self.fallback.unexplained or self.undecided) and self.explained_by is None

    @property
    def explained_by(self) -> int | None:
        """Number of the hypothesis that gives most of the values, if it can be claimed; None where none does."""
        speakers = self.calibration.speakers() if self.candidates else {}
        most = max(speakers, key=lambda k: speakers[k], default=OWN) - len(EXPERTS)
        return most if most >= 0 and self.candidates.laws[most] is not None else None

    def explanation(self) -> str | None:
        """Name and law of the hypothesis that gives most of the values, for people; None where none does."""
        number = self.explained_by
        return None if number is None else self.candidates.statement(number)

    @property
    def undecided(self) -> bool:
        """Whether modes cover the examples, but nothing tells which of them holds when.

        See `relgym.model.target.hindsight`. With a single mode there is no choice; whether it holds is told by the
        examples that it leaves over.
        """
        return self.hindsight.undecided and len(self.classifier.modes) > 1

    def verdict(self, key: Key, values: Sequence[float]) -> tuple[Assessment, bool]:
        """Who gives the value of a prediction, how right it will be, and whether it is claimed."""
        known = self.record.verdict(key, values)
        return (known[0], False) if self.surmise and self.config.abstain else known

    def own_word(self, key: Key) -> Assessment | None:
        """How right a prediction will be whose winner has the word whatever others say; None where that depends."""
        return self.record.own_word(key)

    def assess_many(
        self, key: Key, values: NDArray[np.float64]
    ) -> Iterator[tuple[NDArray[np.intp], Assessment]]:
        """`assess` of n predictions in one cell, ``values`` of shape ``(n, experts)``."""
        return self.record.assess_many(key, values)

    def claims(self, key: Key, told: Assessment) -> bool:
        """Whether a prediction of a mode or a law is claimed; what nobody ever looked back at isn't doubted."""
        if self.surmise and self.config.abstain:
            return False
        return self.record.claims(key, told)

    @property
    def doubtful(self) -> bool:
        """Whether no kind of its modes' predictions came true often enough to be claimed, nor would a new one be."""
        known = self.record
        if not known.trials:
            return False
        kinds = [(key, told) for key, _, told in known.kinds(_PREDICTED)]
        new = {*self.classifier.modes} - {key.winner for key, _ in kinds}
        keys = [Key(_PREDICTED, mode, NO_RUNNER_UP) for mode in sorted(new)]
        kinds += [(key, known.assess(key, (0.0,) * known.experts)) for key in keys]
        return not any(self.claims(key, told) for key, told in kinds)

    @property
    def claimed(self) -> float:
        """Share of its modes' predictions so far that are of kinds which are claimed by now; 1 where none was made."""
        kinds = [(key, heard, told) for key, heard, told in self.record.kinds(_PREDICTED)]
        every = sum(heard for _, heard, _ in kinds)
        return sum(heard for key, heard, told in kinds if self.claims(key, told)) / every if every else 1.0

    @property
    def asks_latest(self) -> bool:
        """Whether the mode that held last is asked: not where the vote's winners are mostly right.

        Nor where modes are approximations: of these it is the place that decides, and no law goes on until it changes.
        """
        if self.latest not in self.clusterer.clusters or not self.follows_latest:
            return False
        return not self.bounds(self.latest)

    @property
    def follows_latest(self) -> bool:
        """Whether which mode held is to be known of every example, since the one that held last may be asked."""
        if len(self.classifier.modes) < 2 or self.fallback.inexact:
            return False
        return self.rough or self.record.doubts(_PREDICTED)

    def latest_values(
        self, percept: Percept, index: int, following: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """What the mode that held last says of one object of n scenes, shape ``(n,)``; NaN where its roles are open."""
        x = percept.rows(index, following, ordered=False)
        return self.functions.values(percept.situation(index).signature, x, (self.latest,))[:, 0]

    @property
    def record(self) -> Calibration:
        """What is known of earlier predictions; of a model that always answers nothing."""
        return self.calibration if self.config.abstain else _NOTHING

    @property
    def asks_regressions(self) -> bool:
        """Whether regressions have a say: where little is known, or what won votes was off too often to be claimed.

        Or where nobody can tell, since nothing won so far, or what it read was wrong.
        """
        known = self.record
        return (
            self.rough
            or known.doubts(_PREDICTED)
            or (known.trials > 0 and math.isnan(known.share(_PREDICTED)))
        )

    @property
    def rough(self) -> bool:
        """Whether so much is unexplained, or explained only roughly, that regressions may know better.

        So they may where nothing tells which mode holds, though half of what a record remembers came.
        """
        if self._unsettled or self.fallback.lawless:
            return True
        return self.undecided and 2 * self.calibration.trials >= MEMORY

    @property
    def tells_how_far(self) -> bool:
        """Whether how right its modes are is known by how far a scene lies from what was learned: of approximations."""
        return self.clusterer.approximate and self.rough

    @property
    def lost(self) -> bool:
        """Whether modes aren't asked: nothing is explained, or an approximation errs more than the guess."""
        return self.fallback.unexplained or (
            not self.leaned_on and self.fallback.guess is not None and self.fallback.guesses.superior
        )

    def mode_values(self, percept: Percept, index: int, following: NDArray[np.float64]) -> list[float]:
        """What every mode would predict, in the order of ``classifier.modes``; NaN where its roles are open.

        Arguments as of `predict_one`.
        """
        x = percept.rows(index, following[None])[0].tolist()
        return self.functions.values_one(percept.situation(index).signature, x, self.classifier.modes)

    def example(self, percept: Percept, index: int, following: NDArray[np.float64]) -> Example:
        """What the classifiers are shown of a single scene; arguments as of `predict_one`."""
        situation = percept.situation(index)
        # Conditions are of objects alone of their type, so their order doesn't matter.
        x = percept.rows(index, following[None], ordered=False)
        return replace(self._shown(situation, x), key=situation.keys[0])

    def _shown(self, situation: Situation, x: NDArray[np.float64]) -> Example:
        """`example` without the key, by which examples are kept and not classified."""
        first = situation.examples[0]
        return self._with_values(first, situation.signature, x) if self.conditions.columns else first

    def predict_one(self, percept: Percept, index: int, following: NDArray[np.float64]) -> Prediction:
        """Predict for one object of a single scene; the caller fills in names.

        Parameters
        ----------
        percept
            The scene.
        index
            The object.
        following
            Next values predicted so far, shape ``(width,)``.
        """
        situation = percept.situation(index)
        outcome = Outcome.UNEXPLAINED if self.lost else Outcome.NO_MODE
        nothing = Prediction("", "", float("nan"), outcome)
        if self.lost or not self.classifier.modes:
            return nothing
        casts = self._casts(situation.signature)
        row = percept.rows(index, following[None], ordered=casts)
        x = row[0].tolist()
        if not self.fallback.scope.covers_one(x, situation.signature):
            return nothing.replace(outcome=Outcome.UNEXPLAINED)
        example = self._shown(situation, row)
        ranking = self.classifier.rank(
            example, self.functions.values_one(situation.signature, x, self.classifier.modes)
        )
        if self.config.abstain and not ranking.seen and len(self.classifier.modes) > 1:
            return self._leaning(ranking.modes[0], situation.signature, row)
        layout, order = percept.layout, situation.order[0] if casts else situation.plain
        for place, mode in enumerate(ranking.modes):
            binding = self.functions.binding(situation.signature, mode)
            if binding is None:
                continue
            slots: tuple[int, ...] | None = ()
            if binding.open:
                slots = self.functions.cast(mode, binding, example, order, layout)
            if slots is None:
                if not self.config.abstain:
                    continue
                # What lost the vote doesn't become likely because the winner's players are in doubt.
                return nothing.replace(outcome=Outcome.OUTSIDE)
            rest = iter(slots)
            played = (0, *(s if s >= 0 else next(rest) for s in binding.forced))
            roles = tuple(layout.names[order[s]] for s in played)
            margin = ranking.margin if place == 0 else 0.0
            outcome = Outcome.UNEXPLAINED if self.undecided else Outcome.PREDICTED
            value = self.fallback.within(binding.value(x, slots), situation.signature, row)
            found = Prediction("", "", value, outcome, mode, roles, margin)
            found = self._stopped(self.limits.cut_off(found), situation.signature, row)
            return found.replace(spread=self.spreads.at(found.mode, situation.signature, x))
        return nothing.replace(outcome=Outcome.NO_ROLES)

    def predict_batch(self, percept: Percept, index: int, following: NDArray[np.float64]) -> Verdict:
        """Predict for one object of n scenes; bit for bit what `predict_one` gives.

        Parameters
        ----------
        percept
            The scenes.
        index
            The object.
        following
            Next values predicted so far, shape ``(n, width)``.
        """
        n = len(percept)
        verdict = Verdict(
            np.full(n, np.nan), np.zeros(n, dtype=np.int64), np.full(n, _NO_MODE, dtype=np.int8), np.zeros(n)
        )
        modes = self.classifier.modes
        if self.lost:
            verdict.outcomes[:] = _UNEXPLAINED
        if self.lost or not modes:
            return verdict
        situation = percept.situation(index)
        x = percept.rows(index, following, ordered=self._casts(situation.signature))
        ranking = self._rank_batch(situation, x)
        verdict.outcomes[:] = _NO_ROLES
        said = _UNEXPLAINED if self.undecided else _PREDICTED
        outside = ~ranking.seen if self.config.abstain and len(modes) > 1 else np.zeros(n, dtype=np.bool_)
        beyond = ~self.fallback.scope.covers(x, situation.signature)
        verdict.outcomes[outside], verdict.outcomes[beyond] = _OUTSIDE, _UNEXPLAINED
        waiting = ~(outside | beyond)
        for place in range(len(modes)):
            for mode in np.unique(ranking.modes[waiting, place]):
                binding = self.functions.binding(situation.signature, int(mode))
                if binding is None:
                    continue
                part = np.flatnonzero(waiting & (ranking.modes[:, place] == mode))
                done, values = self._apply(int(mode), binding, percept, situation, x, part)
                verdict.values[done], verdict.modes[done] = values, mode
                verdict.outcomes[done] = said
                verdict.margins[done] = ranking.margin[done] if place == 0 else 0.0
                waiting[done] = False
                if self.config.abstain:  # in doubt about the players
                    verdict.outcomes[part[waiting[part]]] = _OUTSIDE
                    waiting[part] = False
            if not waiting.any():
                break
        verdict.values[:] = self.fallback.all_within(verdict.values, situation.signature, x)
        self.limits.cut_off_all(verdict.values, verdict.modes)
        self.stops.apply(situation.signature, x, verdict.values, verdict.modes)
        self._lean(verdict, ranking.modes[:, 0], outside & ~beyond, situation.signature, x)
        return verdict

    def _leaning(self, mode: int, signature: SlotSignature, row: NDArray[np.float64]) -> Prediction:
        """Outside experience: no claim, but the value that the vote's winner gives, if none of its roles is open."""
        binding = self.functions.binding(signature, mode)
        if binding is None or binding.open:
            return Prediction("", "", float("nan"), Outcome.OUTSIDE)
        x = row[0].tolist()
        value, spread = (
            self.fallback.within(binding.value(x), signature, row),
            self.spreads.at(mode, signature, x),
        )
        return Prediction("", "", value, Outcome.OUTSIDE, spread=spread)

    def _lean(
        self,
        verdict: Verdict,
        winners: NDArray[np.int64],
        outside: NDArray[np.bool_],
        signature: SlotSignature,
        x: NDArray[np.float64],
    ) -> None:
        """`_leaning` of all scenes that are outside experience, shape ``(n,)``."""
        for mode in np.unique(winners[outside]):
            binding = self.functions.binding(signature, int(mode))
            if binding is not None and not binding.open:
                part = outside & (winners == mode)
                verdict.values[part] = self.fallback.all_within(
                    binding.values(x[part])[:, 0], signature, x[part]
                )

    def _stopped(self, found: Prediction, signature: SlotSignature, row: NDArray[np.float64]) -> Prediction:
        """The prediction, or the constant of a stop that it runs into."""
        if not self.stops.every:
            return found
        values, modes = np.array([found.value]), np.array([found.mode])
        self.stops.apply(signature, row, values, modes)
        if modes[0] == found.mode and (values[0] == found.value or np.isnan(values[0])):
            return found
        return found.replace(value=float(values[0]), mode=int(modes[0]), roles=found.roles[:1])

    def _apply(
        self,
        mode: int,
        binding: Binding,
        percept: Percept,
        situation: Situation,
        x: NDArray[np.float64],
        part: NDArray[np.intp],
    ) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Those of the given examples whose roles can be filled, and the mode's values there."""
        if not binding.open:
            return part, binding.values(x[part])[:, 0]
        examples, order = situation.examples, situation.order
        done, values = np.zeros(len(part), dtype=np.bool_), np.full(len(part), np.nan)
        # Players depend on the relations and the order alone: one search for all scenes that share them.
        first, which = distinct(examples.table[part], order[part])
        for i, alike in zip(part[first].tolist(), members(which), strict=True):
            slots = self.functions.cast(mode, binding, examples[i], order[i], percept.layout)
            if slots is not None:
                done[alike], values[alike] = True, binding.values_as(x[part[alike]], slots)
        return part[done], values[done]

    def _casts(self, signature: SlotSignature) -> bool:
        """Whether some mode has a role that several objects could play."""
        bindings = (self.functions.binding(signature, mode) for mode in self.classifier.modes)
        return any(binding is not None and bool(binding.open) for binding in bindings)

    def _rank_batch(self, situation: Situation, x: NDArray[np.float64]) -> RankingBatch:
        """Rank the modes for n examples; a single mode has no runner-up and needs no look at the scene."""
        modes, n = self.classifier.modes, len(x)
        if len(modes) == 1:
            sure = np.ones(n, dtype=np.bool_)
            return RankingBatch(np.full((n, 1), modes[0]), np.zeros((n, 1)), np.full(n, np.inf), sure, sure)
        shown = situation.preview(self.classifier.relations)
        if self.conditions.columns:
            ahead = self.conditions.values(situation.signature, x)
            shown = replace(shown, own=np.concatenate([shown.own, ahead], axis=1))
        return self.classifier.rank_batch(shown, self.functions.values(situation.signature, x, modes))

    # ------------------------------------------------------------------ saving
    def to_json(self, *, history: bool) -> dict[str, Any]:
        """Plain data: modes, classifiers and roles; exemplars only with history."""
        return {
            "clusterer": self.clusterer.to_json(),
            "unexplained": self.fallback.unexplained,
            "guess": self.fallback.guesses.to_json(),
            "spreads": self.spreads.to_json(),
            "scope": self.fallback.scope.to_json(),
            "latest": self.latest,
            "unsettled": self._unsettled,
            "classifier": self.classifier.to_dict(exemplars=history),
            "casting": self.casting.to_json(),
            **({"candidates": self.candidates.to_json()} if self.candidates else {}),
            "limits": self.limits.to_json(),
            "stops": self.stops.to_json(),
            **({"places": self.functions.places_to_json()} if self.functions.places else {}),
            **({"past": sorted(self.past)} if self.past else {}),
            **({"amended": sorted(self.amended)} if self.amended else {}),
        }

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """What further learning needs beside `to_json`."""
        return self.clusterer.to_arrays()

    def restore(self, data: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> None:
        """Take over what `to_json` and `to_arrays` wrote."""
        self.clusterer.restore(data["clusterer"], arrays)
        self.fallback.unexplained = bool(data["unexplained"])
        self.fallback.guesses = Guesses.from_json(self.target, data.get("guess", {}))
        self.spreads = Spreads.from_json(data["spreads"])
        self.fallback.scope = Scope.from_json(data.get("scope", {}))
        self.latest = int(data.get("latest", NOISE))
        self._unsettled = bool(data.get("unsettled", False))
        self.classifier = ModeClassifier.from_dict(data["classifier"], self.config.classifying, self._pool)
        self.conditions.keep(self.classifier.vocabulary.own)
        self.casting.restore(data["casting"])
        if self.candidates:
            self.candidates.restore(data["candidates"])
        self.limits = Limits.from_json(data.get("limits", {}))
        self.stops = Stops.from_json(data.get("stops", {}))
        self.past = {int(mode) for mode in data.get("past", ())}
        self.amended = {int(mode) for mode in data.get("amended", ())}
        self.functions.restore_places(data.get("places", ()))
        self.fallback.bound.clear()


def _noisy(labels: NDArray[np.int32]) -> float:
    """Share of some examples, one at least, that no mode explains."""
    return float(np.count_nonzero(labels == NOISE)) / len(labels)
