"""Asking the compiled program of a model: one scene or many, as long as the model says the same.

The kernel is loaded once so much was asked that it pays (`relgym.model.running.compiled`). A program is lowered
(`relgym.model.running.lowering`) for a layout once so many scenes have been asked of it since the model said something
else that it pays, too: lowering costs as much as arrays take for a few scenes. What most transitions change, votes, is
written into the program that there is. Until then, and where there is no program for what was learned, arrays answer
(`relgym.model.predicting.querying`); all give the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.columns import SlotSignature
from relgym.config.constants import REPAID
from relgym.model.parts import Parts
from relgym.model.percepts.perception import Percept, Situation
from relgym.model.percepts.scenes import scene_of, wrap
from relgym.model.predicting.calibration import GUESS, LATEST, OWN, PERSISTENCE, Audit, Key
from relgym.model.predicting.prediction import (
    OUTCOMES,
    BatchPrediction,
    Outcome,
    Prediction,
    ScenePrediction,
)
from relgym.model.predicting.querying import Odds, Said, derive, settled
from relgym.model.predicting.regression import Regression
from relgym.model.running.compiled import KERNEL
from relgym.model.running.grounds import Grounds
from relgym.model.running.lowering import lowered
from relgym.model.running.rolling import BatchRollout
from relgym.model.running.trusting import trusting
from relgym.model.target.spread import Spreads
from relgym.model.target.spread_split import place_of
from relgym.program.gpu import Card
from relgym.program.machine import Machine
from relgym.program.records import TOUCHING, Answer, BeyondError, Program, Trust
from relgym.program.tape import Tape, encoded, kind_of, ordered
from relgym.scene.objects import Scene, SceneLayout

__all__ = ["Programs", "Runner"]

_PREDICTED, _DEPENDS = OUTCOMES.index(Outcome.PREDICTED), OUTCOMES.index(Outcome.DEPENDS)
_Bits = NDArray[np.int64]


class Programs:
    """The programs of one model, by layout; holds only what can be worked out again.

    A program stays as long as the model holds what it was lowered from (`relgym.model.running.grounds`), whatever is
    learned.

    Attributes
    ----------
    changes
        Counts how often the model has changed; whoever changes it says so by `changed`.
    """

    def __init__(self) -> None:
        self.changes = 0
        self._grounds: Grounds | None = None
        self._known: dict[int, _Known] = {}
        self._asked = 0
        self._looked = 0  # at the grounds, after so many changes
        self._declined = self._resting = (
            0  # scenes that programs couldn't tell lately; that they aren't asked for it
        )

    def __reduce__(self) -> tuple[type[Programs], tuple[()]]:
        return Programs, ()

    def changed(self) -> None:
        """The model isn't what it was: programs may be out of date."""
        self.changes += 1

    def counted(self) -> None:
        """All that the latest change did was to count: programs that were up to date still are."""
        if self._looked == self.changes - 1:
            self._looked = self.changes
            for known in self._known.values():
                known.changes += known.changes == self.changes - 1

    def one(self, parts: Parts, scene: Scene, percept: Callable[[Scene], Percept]) -> ScenePrediction | None:
        """What the program says of one scene, whose numbers are finite; None: arrays must, or can say why not.

        While the model learns, who gives a value is settled after the program has run. Where laws depend on what isn't
        known it can't tell, and arrays answer after all: so after each time in vain it rests for twice as many scenes
        as before, up to `REPAID`.
        """
        if self._resting and self._looked != self.changes:
            self._resting -= 1
            return None
        if (runner := self.of(parts, scene.layout, 1)) is None:
            return None
        resumes = parts.resumes(scene.layout, scene.vector)
        if not resumes and (said := runner.sure(scene)) is not None:
            return said
        if self._resting:
            self._resting -= 1
            return None
        said = runner.argued(scene, percept(scene), resumes=resumes)
        self._declined = self._resting = 0 if said is not None else min(2 * self._declined + 1, REPAID)
        return said

    def of(self, parts: Parts, layout: SceneLayout, scenes: int, *, at_once: bool = False) -> Runner | None:
        """What runs the program for a layout; None: arrays answer.

        Parameters
        ----------
        parts
            The model.
        layout
            The scenes' layout.
        scenes
            How many are asked.
        at_once
            Whether a program is lowered for them whether that pays or not.
        """
        if (machine := KERNEL.after(scenes)) is None:
            return None
        if self._grounds is None or self._looked != self.changes:
            self._look(parts)
        known = self._known.get(id(layout))
        if known is not None and known.layout is layout and known.parts is parts:
            if known.changes != self.changes and known.runner is not None:
                known.runner.follow()
            known.changes = self.changes
            return known.runner
        alone = _alone(self._asked, scenes)
        self._asked += scenes
        if alone and not at_once:
            return None
        runner: Runner | None
        try:
            runner = Runner(parts, layout, lowered(parts, layout), machine)
        except BeyondError:
            runner = None
        self._known[id(layout)] = _Known(layout, parts, runner, self.changes)
        return runner

    def _look(self, parts: Parts) -> None:
        """Drop all programs if they were lowered from something else than the model now holds."""
        grounds, self._looked = Grounds.of(parts), self.changes
        if self._grounds is None or not self._grounds.same(grounds):
            self._grounds, self._asked = grounds, 0
            self._known.clear()


@dataclass(slots=True)
class _Known:
    """What runs the program for a layout, None where there is none, and after how many changes it was up to date."""

    layout: SceneLayout
    parts: Parts
    runner: Runner | None
    changes: int


@dataclass(slots=True)
class _Reaching:
    """Targets of a regression that are asked, where on the tape it stands how far these reach, and of when that is."""

    regression: Regression
    targets: list[int]
    where: NDArray[np.intp]
    revision: int = -1


class _Told(NamedTuple):
    """What the kernel says of one scene, answer by answer."""

    following: NDArray[np.float64]
    outcomes: list[int]
    modes: list[int]
    margins: list[float]
    noted: list[int]
    players: _Bits
    sure: list[list[float]]
    """Probability and interval of each answer; empty unless it is settled."""
    believed: list[list[int]]
    """Number and place of each answer's belief; empty unless it is settled."""
    experts: list[list[float]]
    """What everybody but persistence says of each answer (`relgym.model.predicting.calibration.EXPERTS`)."""
    far: list[int]
    """The bin of how far the scene lies from what regressions of each answer learned."""


class Runner:
    """Runs the program of one model for one layout.

    Parameters
    ----------
    parts, layout, program, machine
        The model, the layout, the program for it, and what runs it.
    """

    def __init__(self, parts: Parts, layout: SceneLayout, program: Program, machine: Machine) -> None:
        self._parts, self._layout = parts, layout
        self.program = program
        self._settling: bool | None = None
        self._settled = False  # whether that is what is known now
        self._asked = 0  # scenes one by one, since then
        self._believing = False  # whether of all answers it is known how right they were
        self._kinds: dict[int, Key] = {}  # of predictions, by number
        self._turn = Lock()
        tape = encoded(program)
        self._space, count = tape.space(), len(program.answers)
        self._now, self._after = np.empty(program.width), np.empty(program.width)
        told = ("outcomes", "modes", "margins", "touched", "players", "sure", "believed", "experts", "far")
        self._tells = tuple(
            self._space[name][0, :count] for name in told
        )  # where the kernel leaves what it says
        self._given, self._given_values = (self._space[name][0] for name in ("given", "given_values"))
        self._machine = machine
        space, now, after = (each.ctypes.data for each in (self._space, self._now, self._after))
        self._one = partial(_run_one, machine.call, space, now, after)
        pair = None if parts.laws is None else parts.laws.learner.book.pair
        frame = "world" if pair is None else pair.frame
        self._keys = tuple((a.object, a.property) for a in program.answers)
        self._frames = tuple(frame if a.component >= 0 else "world" for a in program.answers)
        self._tellers = tuple(_Teller(parts, layout, a, frame) for a in program.answers)
        self._needed = frozenset(key for a in program.answers for key in a.needs)
        self._voted = tuple(t.model for t in self._tellers if t.answer.vote is not None)
        self._votes: list[list[tuple[int, int]] | None] = []
        self._lay(tape)

    def _lay(self, tape: Tape) -> None:
        """Take note of where what changes often stands in the tape that is run, and write what holds now."""
        self._sizes = tape.sizes
        self._places = tape.votes
        self._regressions = self._reaches_at(tape.reaches)
        self._votes = [None for places, _ in tape.votes for _ in places]
        self.follow()

    def follow(self) -> None:
        """Write what changes often into the program: votes, and how far regressions reach.

        All else that it says is as it was. How right its predictions are is written anew when somebody asks for many.
        """
        self._settled, self._asked = False, 0
        code, k, moved = self._space["code"][0], 0, False
        for model, (places, by_tie) in zip(self._voted, self._places, strict=True):
            voting = model.classifier._voting
            for place, votes in zip(places, voting._votes, strict=True):
                if votes is not self._votes[k]:  # they are counted into a list of their own
                    self._votes[k], moved = votes, True
                    code[place : place + 2 * len(votes)] = [v for pair in votes for v in pair]
                k += 1
            first = voting._by_tie(model.classifier.counts)
            code[by_tie : by_tie + len(first)] = first
        if moved:
            self._space["memory_keys"] = 0  # answers that are remembered were voted for as it was before
        for known in self._regressions:
            if known.revision != known.regression.revision:
                known.revision = known.regression.revision
                self._space["numbers"][0, known.where] = known.regression.reach[known.targets]

    def _reaches_at(self, places: Sequence[int]) -> list[_Reaching]:
        """Regressions that are asked."""
        found: dict[str, tuple[list[int], list[int]]] = {}
        for teller, place in zip(self._tellers, places, strict=True):
            if place >= 0:
                name, prop = teller.target.type, teller.target.property
                targets, starts = found.setdefault(name, ([], []))
                targets.append(self._parts.regressions[name].targets.index(prop))
                starts.append(place)
        known = [(self._parts.regressions[name], *each) for name, each in found.items()]
        return [
            _Reaching(r, targets, np.array(starts)[:, None] + np.arange(r.reach.shape[1]))
            for r, targets, starts in known
        ]

    def many(self, vectors: NDArray[np.float64], *, on_card: bool = False) -> BatchPrediction | None:
        """Predict what follows n scenes; None: arrays must, or can say why not.

        Parameters
        ----------
        vectors
            State vectors, shape ``(n, width)``.
        on_card
            Whether a graphics card does it.

        Raises
        ------
        ConfigError
            There is none.
        """
        if (settling := self._settles()) is None:
            return None
        n, count = shape = len(vectors), len(self._keys)
        following, outcomes = np.empty(vectors.shape), np.empty(shape, dtype=np.int8)
        modes, margins = np.empty(shape, dtype=np.int64), np.empty(shape)
        sure = np.empty((2, n, count)) if settling else np.full((2, n, count), np.nan)
        told = outcomes, modes, margins, sure
        with self._turn:
            if on_card:
                bad = self._card().run(self._tape(), vectors, following, told, settling=settling)
            else:
                bad = self._machine.run(self._space, vectors, following, told, settling=settling)
        if bad:
            return None
        return BatchPrediction(
            self._layout, following, self._keys, modes, outcomes, margins, self._frames, *sure
        )

    def roll(
        self,
        vectors: NDArray[np.float64],
        steps: int,
        actions: NDArray[np.float64],
        first: int,
        *,
        on_card: bool = False,
    ) -> BatchRollout | None:
        """Roll n scenes out; None: arrays must, or can say why not.

        Parameters
        ----------
        vectors, on_card
            As for `many`.
        steps, actions, first
            As for `relgym.program.machine.Machine.roll`.

        Raises
        ------
        ConfigError
            There is no card.
        """
        if (settling := self._settles()) is None:
            return None
        asked = vectors, steps, actions, first
        with self._turn:
            if on_card:
                following, lasted = self._card().roll(self._tape(), *asked, settling=settling)
            else:
                following, lasted = self._machine.roll(self._space, *asked, settling=settling)
        return None if (lasted < 0).any() else BatchRollout(self._layout, following, lasted)

    def _card(self) -> Card:
        return KERNEL.card(self._sizes)

    def _tape(self) -> tuple[_Bits, NDArray[np.float64]]:
        """The tape as it is now."""
        sizes = self._sizes
        return self._space["code"][0, : sizes.code], self._space["numbers"][0, : sizes.numbers]

    def _settles(self) -> bool | None:
        """Whether it is known how right predictions were; then the kernel is told. None: it has no words for that."""
        if self._settled:
            return self._settling
        self._settling = any(t.model.calibration.trials for t in self._tellers)
        if self._settling:
            try:
                known = trusting(self._parts, self._layout, self.program)
                tape = encoded(known)
                tape.lay(self._space)
                self._lay(tape)
                for teller, answer in zip(self._tellers, known.answers, strict=True):
                    teller.trusts(answer.trust)
            except BeyondError:
                self._settling = None
        self._believing = bool(self._settling) and all(teller.spoken for teller in self._tellers)
        self._settled = True
        return self._settling

    def _knows(self) -> bool:
        """Whether the program knows how right its predictions were, now that one more scene is asked."""
        if not self._settled and self._asked >= REPAID:
            self._settles()
        self._asked += 1
        return self._settled and self._believing

    def argued(self, scene: Scene, percept: Percept, *, resumes: bool = False) -> ScenePrediction | None:
        """Predict what follows one scene; None where the program can't tell it.

        What the program says is what arrays would have said of modes and laws; whose value counts is settled here as
        there (`relgym.model.predicting.querying.settled`). Where that is another one than the program's own, and other
        answers need it, the program says what follows from it. The percept is for what isn't asked of the program, such
        as what the mode says that held last; `resumes` tells whether it is to be asked.
        """
        now, given = scene.vector, dict[int, tuple[int, float]]()
        numbers: list[float] = now.tolist()
        told = self._told(now, settling=False)
        if told is None:
            return None
        following, own, parts = now.copy(), True, self._parts
        odds = Odds()
        found: list[Prediction] = []
        after, outcomes, modes, margins, noted, players, _, _, experts, far = told
        for k, teller in enumerate(self._tellers):
            a = teller.answer
            said = experts[k]
            raw = teller.tell(numbers, said[OWN], outcomes[k], modes[k], margins[k], noted[k], players[k])
            if raw is None:
                return None
            model, lawful = teller.model, a.component >= 0
            others = None if model.candidates else teller.values(said, numbers)
            if others is not None and resumes and not lawful and model.asks_latest:
                (latest,) = model.latest_values(percept, teller.index, following[None]).tolist()
                if math.isfinite(latest):
                    others = (*others[:LATEST], latest, *others[LATEST + 1 :])
            away = far[k] if far[k] and raw.mode and not lawful and model.tells_how_far else 0
            known = raw, odds, others, away, teller.relied_on
            one = settled(parts, model, percept, teller.index, following, *known, lawful=lawful)
            following[a.column] = one.value
            found.append(one)
            same = one.value == after[a.column]
            if a.key not in self._needed:
                own = own and same
            elif not (same and one.ok == (outcomes[k] == _PREDICTED)):
                given[k] = 1 if one.ok else 2, one.value
                told = self._told(now, settling=False, given=given)
                if told is None:
                    return None
                after, outcomes, modes, margins, noted, players, _, _, experts, far = told
        if own:
            following = after
        else:
            derive(scene.schema, self._layout, now[None], following[None])
            wrap(self._layout, following)
        return ScenePrediction(scene_of(scene.schema, self._layout, following), tuple(found))

    def sure(self, scene: Scene) -> ScenePrediction | None:
        """Predict what follows one scene, if the program knows how right its predictions were; else None.

        It is told that once many scenes were asked of a model that stays as it is.
        """
        if not self._knows():
            return None
        now = scene.vector
        told = self._told(now, settling=True)
        if told is None:
            return None
        after, rows = told.following, zip(self._tellers, *told[1:-1], strict=True)
        numbers: list[float] = now.tolist()
        found: list[Prediction] = []
        kinds = self._kinds
        for teller, outcome, mode, margin, noted, players, sure, believed, experts in rows:
            probability, interval = sure
            speaker, spread = teller.spoken[believed[1]]
            if speaker == GUESS:  # what it left isn't told
                return None
            values = teller.values(experts, numbers)
            roles, own, frame = teller.known(numbers, mode, noted, players)
            if speaker != OWN:
                own = math.nan if speaker == PERSISTENCE else spread
            key = kinds.get(believed[0])
            if key is None:
                key = kinds[believed[0]] = Key(*kind_of(believed[0]))
            found.append(
                Prediction(
                    teller.answer.object,
                    teller.answer.property,
                    values[speaker],
                    OUTCOMES[outcome],
                    mode,
                    roles,
                    margin,
                    frame,
                    own,
                    probability,
                    interval,
                    Audit(key, values, speaker),
                )
            )
        return ScenePrediction(scene_of(scene.schema, self._layout, after), tuple(found))

    def _told(
        self,
        now: NDArray[np.float64],
        *,
        settling: bool,
        given: Mapping[int, tuple[int, float]] | None = None,
    ) -> _Told | None:
        """Run the program of one scene; None: arrays must, or can say why not.

        All that is told is new: another thread may ask before this one has read it.

        Parameters
        ----------
        now, settling
            The scene's state vector, and whether the program settles who gives values.
        given
            What is settled already: of answers by number whether they are known (1) or not (2), and their values.
        """
        with self._turn:
            self._now[:] = now
            for k, (known, value) in (given or {}).items():
                self._given[k], self._given_values[k] = known, value
            bad = self._one(settling)
            if given:
                self._given[list(given)] = 0
            if bad:
                return None
            outcomes, modes, margins, noted, players, sure, believed, experts, far = self._tells
            return _Told(
                self._after.copy(),
                outcomes.tolist(),
                modes.tolist(),
                margins.tolist(),
                noted.tolist(),
                players.copy(),
                sure.tolist() if settling else [],
                believed.tolist() if settling else [],
                experts.tolist(),
                far.tolist(),
            )


def _run_one(call: Callable[..., int], space: int, now: int, after: int, settling: bool) -> int:
    """Run the kernel for one scene, which says in the work space what it tells of it."""
    return call(space, 1, settling, True, False, now, after, None, None, None, None)


class _Teller:
    """What is told of one answer: which bodies the roles are bound to, the spread, and how right it is.

    Attributes
    ----------
    answer, model
        The answer, and the model of its target.
    target, index
        Which property of which object it is of.
    relied_on
        See `Parts.relied_on`.
    spoken
        Who speaks in each belief, and what that one left lately, in the order on the tape; empty: nothing is believed.
    """

    __slots__ = (
        *("_body_names", "_fixed", "_frame", "_modes", "_spreads"),
        *("answer", "index", "model", "relied_on", "spoken", "target"),
    )

    def __init__(self, parts: Parts, layout: SceneLayout, answer: Answer, frame: str) -> None:
        self.answer, self._frame = answer, frame
        self.spoken: list[tuple[int, float]] = []
        self._body_names = tuple(layout.names[i] for i in layout.bodies)
        self._modes = {mode.id: mode for mode in answer.modes}
        self._fixed = {  # roles that are bound to the same objects in every scene
            mode.id: tuple(name for name in mode.players if name is not None)
            for mode in answer.modes
            if not mode.roles
        }
        index = self.index = layout.index(answer.object)
        model = self.model = parts.property_model(layout.types[index].name, answer.property)
        self.target = model.target
        self.relied_on = parts.relied_on(model)
        situation = Situation(Percept(parts.perception, layout, np.empty((0, layout.width)), None), index)
        signature = situation.signature
        gather = parts.perception.gather(layout, signature, tuple(situation.plain.tolist())).tolist()
        self._spreads = _spreads(model.spreads, signature, gather) if answer.modes else {}

    def tell(
        self,
        now: list[float],
        value: float,
        outcome: int,
        mode: int,
        margin: float,
        noted: int,
        players: _Bits,
    ) -> Said | None:
        """What modes or laws say of a scene; `noted` is the mode that gave the value, or of laws whom the body touches.

        None where it isn't told whether they have a value.
        """
        lawful = self.answer.component >= 0
        if lawful and outcome == _DEPENDS:
            return None
        if not (outcome == _PREDICTED if lawful else noted > 0):
            value = math.nan
        roles, spread, frame = self.known(now, mode, noted, players)
        return Said(value, OUTCOMES[outcome], mode, roles, margin, frame, spread)

    def trusts(self, trust: Trust | None) -> None:
        """Take note of what is believed now."""
        self.spoken = [] if trust is None else [(b.speaker, b.spread) for b in ordered(trust.beliefs)]

    def values(self, said: list[float], now: list[float]) -> tuple[float, ...]:
        """What each of `EXPERTS` says, persistence too; NaN: nothing."""
        return (*said, now[self.answer.column])

    def known(
        self, now: list[float], mode: int, noted: int, players: _Bits
    ) -> tuple[tuple[str, ...], float, str]:
        """Roles, spread and frame of what modes or laws say; arguments as of `tell`."""
        a = self.answer
        if a.component >= 0:
            if not mode:
                return (), math.nan, "world"
            touched = (name for k, name in enumerate(self._body_names) if noted >> k & 1)
            return (a.object, *touched), math.nan, self._frame if mode == TOUCHING else "world"
        if noted <= 0:
            return (), math.nan, "world"
        spread = self._spreads[noted](now) if noted in self._spreads else math.nan
        return self._roles(mode, players) if mode else (), spread, "world"

    def _roles(self, mode: int, players: _Bits) -> tuple[str, ...]:
        if (fixed := self._fixed.get(mode)) is not None:
            return fixed
        known = self._modes.get(mode)
        if known is None:  # a limit, or a stop
            return (self.answer.object,)
        names = list(known.players)
        for role in known.roles:
            names[role.number + 1] = self._body_names[int(players[role.number])]
        return tuple(name for name in names if name is not None)


def _alone(asked: int, scenes: int) -> bool:
    """Whether a scene is the only one that was asked since what a model says has changed.

    To lower a program takes about as long as arrays take to answer one scene (rent or buy: Karlin et al. 1988).
    """
    return asked + scenes < 2


def _spreads(
    spreads: Spreads, signature: SlotSignature, gather: list[int]
) -> dict[int, Callable[[list[float]], float]]:
    """The spread of each mode as a function of the present state vector."""
    actions = [gather[k] for k in signature.actions]
    found: dict[int, Callable[[list[float]], float]] = {}
    for mode, spread in spreads.by_mode.items():
        place = None if spread.split is None else place_of(spread.split.name, signature)
        if spread.split is not None and place is not None:
            found[mode] = _split(spread.split.of, gather[place])
        elif spread.by_action:
            found[mode] = _by_action(spread.by_action, spread.whole, actions)
        else:
            found[mode] = _whole(spread.whole)
    return found


def _split(of: Callable[[float], float], column: int) -> Callable[[list[float]], float]:
    return lambda now: of(now[column])


def _by_action(
    known: dict[tuple[float, ...], float], whole: float, columns: list[int]
) -> Callable[[list[float]], float]:
    return lambda now: known.get(tuple([now[c] for c in columns]), whole)


def _whole(value: float) -> Callable[[list[float]], float]:
    return lambda now: value
