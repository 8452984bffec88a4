"""Asking the compiled program of a model: one scene or many, as long as the model stays as it is.

The kernel is loaded, and compiled where no file holds it, once so much was asked that it pays (`Kernel`). A program
is lowered (`relgym.model.lowering`) for a layout once so many scenes have been asked of it since the model changed that
it pays, too: lowering costs as much as arrays take for a few scenes. Until then, and where there is no program for what
was learned, arrays answer (`relgym.model.querying`); all give the same bits.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.columns import SlotSignature
from relgym.errors import SlowWarning
from relgym.model.calibration import OWN, Audit, key_of, lead_bins
from relgym.model.lowering import lowered
from relgym.model.motion import TOUCHING
from relgym.model.parts import Parts
from relgym.model.perception import Percept, Situation
from relgym.model.prediction import OUTCOMES, BatchPrediction, Outcome, Prediction, ScenePrediction
from relgym.model.target.property_model import PropertyModel
from relgym.model.target.spread import Spreads, action_columns
from relgym.model.target.spread_split import place_of
from relgym.program.records import Answer, BeyondError, Program
from relgym.program.tape import encoded
from relgym.scene.objects import Scene, SceneLayout

if TYPE_CHECKING:
    from types import ModuleType

__all__ = ["KERNEL", "Kernel", "Programs"]

PATIENCE = 8
"""Scenes that arrays answer after each change of the model before a program is lowered: that takes about as long."""

ASKING, SCENE = 5e-4, 6e-6
"""What arrays take to answer, in seconds: each time, and for each scene."""

LOADING, COMPILING = 0.5, 20.0
"""What it takes to load the kernel from the disk, and to compile it, in seconds."""

_PREDICTED, _UNEXPLAINED, _DEPENDS, _UNSURE = (
    OUTCOMES.index(o) for o in (Outcome.PREDICTED, Outcome.UNEXPLAINED, Outcome.DEPENDS, Outcome.UNSURE)
)
_Bits = NDArray[np.int64]


class Programs:
    """The programs of one model, by layout; holds only what can be worked out again.

    Attributes
    ----------
    changes
        Counts how often the model has changed; whoever changes it says so by `changed`.
    """

    def __init__(self) -> None:
        self.changes = 0
        self._known: dict[int, tuple[SceneLayout, Parts, Runner | None]] = {}
        self._asked = 0

    def __reduce__(self) -> tuple[type[Programs], tuple[()]]:
        return Programs, ()

    def changed(self) -> None:
        """The model isn't what it was: programs are out of date."""
        self.changes += 1
        self._asked = 0
        if self._known:
            self._known.clear()

    def of(self, parts: Parts, layout: SceneLayout, scenes: int) -> Runner | None:
        """What runs the program for a layout; None: arrays answer.

        Parameters
        ----------
        parts
            The model.
        layout
            The scenes' layout.
        scenes
            How many are asked.
        """
        known = self._known.get(id(layout))
        if known is not None and known[0] is layout and known[1] is parts:
            return known[2]
        self._asked += scenes
        if (kernel := KERNEL.after(scenes)) is None or self._asked < PATIENCE:
            return None
        runner: Runner | None
        try:
            runner = Runner(parts, layout, lowered(parts, layout), kernel)
        except BeyondError:
            runner = None
        self._known[id(layout)] = (layout, parts, runner)
        return runner


class Kernel:
    """The compiled kernel, as this process has it: none before it pays.

    Loading it takes half a second, compiling it, once on a machine, twenty. Until arrays have taken about as long as
    that, in all, they answer: nobody waits twice as long as with the better of both ways, and who asks little never
    waits. What they took is estimated from what was asked, so that nothing depends on a clock.

    Attributes
    ----------
    module
        The kernel; None: not yet, or it can't be had.
    spent
        What arrays took so far, in seconds.
    """

    def __init__(self) -> None:
        self.module: ModuleType | None = None
        self.spent = 0.0
        self._missing = False

    def after(self, scenes: int) -> ModuleType | None:
        """The kernel, if it pays to have it now that so many scenes more are asked."""
        if self.module is None and not self._missing:
            self.spent += ASKING + SCENE * scenes
            if self.spent >= LOADING and (found := self._imported()) is not None:
                if self.spent >= COMPILING or found.is_compiled():
                    self.module = found
        return self.module

    def load(self) -> None:
        """Have it now, whether it pays or not; compiled with the first scene that is asked."""
        self.module = self._imported()

    def _imported(self) -> ModuleType | None:
        try:
            from relgym.program import kernel
        except ImportError as error:
            self._missing = True
            warnings.warn(
                f"numba can't be imported ({error}): models are run by arrays, some 30 times slower; "
                "pip install numba",
                SlowWarning,
                stacklevel=2,
            )
            return None
        return kernel


KERNEL: Final = Kernel()
"""That of this process."""


class _Told(NamedTuple):
    """What the kernel writes, in the order in which it takes it."""

    following: NDArray[np.float64]
    outcomes: NDArray[np.int8]
    modes: _Bits
    margins: NDArray[np.float64]
    players: _Bits
    noted: _Bits


class Runner:
    """Runs the program of one model for one layout.

    Parameters
    ----------
    parts, layout, program, kernel
        The model, the layout, the program for it, and the module that runs it.

    Raises
    ------
    BeyondError
        Others than modes and laws may give values, as far as anybody looked back: arrays know them.
    """

    def __init__(self, parts: Parts, layout: SceneLayout, program: Program, kernel: ModuleType) -> None:
        self._layout = layout
        self.program = program
        tape = encoded(program)
        self._run = kernel.run
        self._roles, self._space = tape.roles, tape.space()
        if not hasattr(kernel.run, "py_func"):  # interpreted (NUMBA_DISABLE_JIT)
            self._space = self._space.view(np.recarray)
        pair = None if parts.laws is None else parts.laws.learner.book.pair
        frame = "world" if pair is None else pair.frame
        self._keys = tuple((a.object, a.property) for a in program.answers)
        self._frames = tuple(frame if a.component >= 0 else "world" for a in program.answers)
        self._tellers = tuple(_Teller(parts, layout, a, frame) for a in program.answers)
        self._needed = frozenset(key for a in program.answers for key in a.needs)
        if not all(t.plain or not t.model.calibration.trials for t in self._tellers):
            raise BeyondError("values that guesses, regressions or former modes may give")
        self._plain = all(t.plain for t in self._tellers)

    def many(self, vectors: NDArray[np.float64]) -> BatchPrediction | None:
        """Predict what follows n scenes; None: arrays must, or can say why not."""
        with np.errstate(over="ignore", invalid="ignore"):
            total = float(vectors.sum())
        if (
            not math.isfinite(total) and not np.isfinite(vectors).all()
        ):  # finite numbers may add up to infinity
            return None
        calibrated = any(t.model.calibration.trials for t in self._tellers)
        told = self._told(vectors, len(vectors) if calibrated else 1)
        if told is None:
            return None
        probabilities = intervals = np.full(told.margins.shape, np.nan)
        if calibrated:
            probabilities, intervals = probabilities.copy(), intervals.copy()
            for k in range(len(self._tellers)):
                if not self._calibrate(k, told, probabilities, intervals):
                    return None
        return BatchPrediction(
            self._layout,
            told.following,
            self._keys,
            told.modes,
            told.outcomes,
            told.margins,
            self._frames,
            probabilities,
            intervals,
        )

    def _calibrate(
        self, k: int, told: _Told, probabilities: NDArray[np.float64], intervals: NDArray[np.float64]
    ) -> bool:
        """How right an answer's predictions are, in place; False where that changes what others rest on."""
        teller, outcomes, modes = self._tellers[k], told.outcomes[:, k], told.modes[:, k]
        a, model = teller.answer, teller.model
        if a.component >= 0 and (outcomes == _DEPENDS).any():
            return False  # whether laws had a value isn't told
        own = outcomes == _PREDICTED if a.component >= 0 else told.noted[:, k] > 0
        kinds = np.where(modes != 0, np.int8(_PREDICTED), outcomes)
        for rows in _alike(kinds, modes, told.margins[:, k], own):
            row, trusted = rows[0], bool(model.calibration.trials)
            winner = int(-modes[row] if a.component >= 0 else modes[row])
            key = key_of(int(kinds[row]), winner, float(told.margins[row, k]))
            value = 0.0 if own[row] else math.nan  # who has a value counts, not which
            said = model.assess(key, (value, math.nan, math.nan, math.nan, math.nan, 0.0))
            if said.speaker != OWN and own[row]:
                return False
            probabilities[rows, k], intervals[rows, k] = said.probability, said.interval
            claimed, before = model.claims(said), outcomes[rows]
            if claimed and not (trusted and winner):
                continue
            changed = before == (_UNEXPLAINED if claimed else _PREDICTED)
            if changed.any() and a.key in self._needed:
                return False
            outcomes[rows[changed]] = _PREDICTED if claimed else _UNSURE
        return True

    def one(self, scene: Scene) -> ScenePrediction | None:
        """Predict what follows one scene, whose numbers are finite; None: arrays must, or can say why not."""
        if not self._plain:
            return None
        now = scene.vector
        told = self._told(now[None], 1)
        if told is None:
            return None
        after, players = told.following[0], told.players[0]
        outcomes, modes = told.outcomes[0].tolist(), told.modes[0].tolist()
        margins, noted = told.margins[0].tolist(), told.noted[0].tolist()
        found: list[Prediction] = []
        for k, teller in enumerate(self._tellers):
            one = teller.tell(now, after, outcomes[k], modes[k], margins[k], noted[k], players[k])
            if one is None or (one.ok != (outcomes[k] == _PREDICTED) and teller.answer.key in self._needed):
                return None
            found.append(one)
        return ScenePrediction(Scene(scene.schema, self._layout, after), tuple(found))

    def _told(self, vectors: NDArray[np.float64], told: int) -> _Told | None:
        """Run the program. What it writes to is new each time: another thread may ask before this one has read it."""
        n, count = len(vectors), len(self._keys)
        found = _Told(
            vectors.copy(),
            np.empty((n, count), dtype=np.int8),
            np.empty((n, count), dtype=np.int64),
            np.empty((n, count)),
            np.empty((told, count, self._roles), dtype=np.int64),
            np.zeros((told, count), dtype=np.int64),
        )
        return None if self._run(self._space, vectors, *found) else found


class _Teller:
    """What is told of one answer: which bodies the roles are bound to, the spread, and how right it is.

    Attributes
    ----------
    answer, model
        The answer, and the model of its target.
    plain
        Whether none but modes, laws, and that nothing changes have values for it (`relgym.model.calibration`).
    """

    __slots__ = ("_body_names", "_frame", "_modes", "_spreads", "answer", "model", "plain")

    def __init__(self, parts: Parts, layout: SceneLayout, answer: Answer, frame: str) -> None:
        self.answer, self._frame = answer, frame
        self._body_names = tuple(layout.names[i] for i in layout.bodies)
        self._modes = {mode.id: mode for mode in answer.modes}
        index = layout.index(answer.object)
        model = self.model = parts.property_model(layout.types[index].name, answer.property)
        situation = Situation(Percept(parts.perception, layout, np.empty((0, layout.width)), None), index)
        signature = situation.signature
        gather = parts.perception.gather(layout, signature, tuple(situation.plain.tolist())).tolist()
        self._spreads = _spreads(model.spreads, signature, gather) if answer.modes else {}
        self.plain = _plain(model, governed=answer.component >= 0)

    def tell(
        self,
        now: NDArray[np.float64],
        after: NDArray[np.float64],
        outcome: int,
        mode: int,
        margin: float,
        noted: int,
        players: _Bits,
    ) -> Prediction | None:
        """The prediction of a scene; `noted` is the mode that gave the value, or of laws whom the body touches.

        None where it isn't the winner who gives the value, though it has one, or whether it has one isn't told.
        """
        a = self.answer
        lawful = a.component >= 0
        if lawful and outcome == _DEPENDS:
            return None
        own = outcome == _PREDICTED if lawful else noted > 0
        value, present = float(after[a.column]), float(now[a.column])
        roles: tuple[str, ...] = ()
        spread = math.nan
        if lawful and mode:
            roles = (a.object, *(name for k, name in enumerate(self._body_names) if noted >> k & 1))
        elif own and not lawful:
            spread = self._spreads[noted](now) if noted in self._spreads else math.nan
            roles = self._roles(mode, players) if mode else ()
        nothing = math.nan
        values = (value if own else nothing, nothing, nothing, nothing, nothing, present)
        key = key_of(_PREDICTED if mode else outcome, -mode if lawful else mode, margin)
        said = self.model.assess(key, values)
        if own and said.speaker != OWN:
            return None
        claimed = self.model.claims(said)
        if outcome == _PREDICTED and not claimed:
            outcome = _UNSURE
        elif outcome == _UNEXPLAINED and mode and claimed and self.model.calibration.trials:
            outcome = _PREDICTED
        frame = self._frame if lawful and mode == TOUCHING else "world"
        return Prediction(
            a.object,
            a.property,
            value,
            OUTCOMES[outcome],
            mode,
            roles,
            margin,
            frame,
            spread if own else nothing,
            said.probability,
            said.interval,
            Audit(key, values, said.speaker),
        )

    def _roles(self, mode: int, players: _Bits) -> tuple[str, ...]:
        known = self._modes.get(mode)
        if known is None:  # a limit, or a stop
            return (self.answer.object,)
        if not known.roles:
            return tuple(name for name in known.players if name is not None)
        names = list(known.players)
        for role in known.roles:
            names[role.number + 1] = self._body_names[int(players[role.number])]
        return tuple(name for name in names if name is not None)


def _alike(
    kinds: NDArray[np.int8], modes: _Bits, margins: NDArray[np.float64], own: NDArray[np.bool_]
) -> list[NDArray[np.intp]]:
    """Rows whose predictions are of one kind: of one outcome, mode and lead, with or without a value."""
    codes = ((modes * 8 + lead_bins(margins)) * 16 + kinds) * 2 + own
    order = np.argsort(codes, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(codes[order])) + 1) if len(order) else []


def _plain(model: PropertyModel, *, governed: bool) -> bool:
    """Whether none but a target's modes or laws, and that nothing changes, have values for it."""
    if model.fallback.guesses_something or model.candidates:
        return False
    if governed:
        return True
    former = model.latest in model.clusterer.clusters and not model.bounds(model.latest)
    doubted = model.record.doubts(_PREDICTED, model.config.claim_probability)
    return not model.rough and not (former and doubted and len(model.classifier.modes) > 1)


def _spreads(
    spreads: Spreads, signature: SlotSignature, gather: list[int]
) -> dict[int, Callable[[NDArray[np.float64]], float]]:
    """The spread of each mode as a function of the present state vector."""
    actions = [gather[k] for k in action_columns(signature).tolist()]
    found: dict[int, Callable[[NDArray[np.float64]], float]] = {}
    for mode, spread in spreads.by_mode.items():
        place = None if spread.split is None else place_of(spread.split.name, signature)
        if spread.split is not None and place is not None:
            found[mode] = _split(spread.split.of, gather[place])
        elif spread.by_action:
            found[mode] = _by_action(spread.by_action, spread.whole, actions)
        else:
            found[mode] = _whole(spread.whole)
    return found


def _split(of: Callable[[float], float], column: int) -> Callable[[NDArray[np.float64]], float]:
    return lambda now: of(float(now[column]))


def _by_action(
    known: dict[tuple[float, ...], float], whole: float, columns: list[int]
) -> Callable[[NDArray[np.float64]], float]:
    return lambda now: known.get(tuple(float(now[c]) for c in columns), whole)


def _whole(value: float) -> Callable[[NDArray[np.float64]], float]:
    return lambda now: value
