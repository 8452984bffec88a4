"""Asking the compiled program of a model: one scene or many, as long as the model stays as it is.

A program is lowered (`relgym.model.lowering`) for a layout once so many scenes have been asked of it since the model
changed that it pays: lowering costs as much as arrays take for a few scenes. Until then, and where there is no program
for what was learned, arrays answer (`relgym.model.querying`); both give the same bits.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.columns import SlotSignature
from relgym.errors import SlowWarning
from relgym.model.lowering import lowered
from relgym.model.motion import TOUCHING
from relgym.model.parts import Parts
from relgym.model.perception import Percept, Situation
from relgym.model.prediction import OUTCOMES, BatchPrediction, Outcome, Prediction, ScenePrediction
from relgym.model.spread import Spreads, action_columns
from relgym.model.spread_split import place_of
from relgym.program.records import Answer, BeyondError, Program
from relgym.program.tape import encoded
from relgym.scene.objects import Scene, SceneLayout

if TYPE_CHECKING:
    from types import ModuleType

__all__ = ["Programs"]

PATIENCE = 8
"""Scenes that arrays answer after each change of the model before a program is lowered: that takes about as long."""

_PREDICTED, _UNEXPLAINED, _OUTSIDE = (
    OUTCOMES.index(o) for o in (Outcome.PREDICTED, Outcome.UNEXPLAINED, Outcome.OUTSIDE)
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
        if self._asked < PATIENCE or (kernel := _kernel()) is None:
            return None
        runner: Runner | None
        try:
            runner = Runner(parts, layout, lowered(parts, layout), kernel)
        except BeyondError:
            runner = None
        self._known[id(layout)] = (layout, parts, runner)
        return runner


_loaded: list[ModuleType | None] = []


def _kernel() -> ModuleType | None:
    """The compiled kernel; None, with a warning the first time, where numba is missing."""
    if not _loaded:
        try:
            from relgym.program import kernel
        except ImportError as error:
            _loaded.append(None)
            warnings.warn(
                f"numba can't be imported ({error}): models are run by arrays, some 30 times slower; "
                "pip install numba",
                SlowWarning,
                stacklevel=2,
            )
        else:
            _loaded.append(kernel)
    return _loaded[0]


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
    """

    def __init__(self, parts: Parts, layout: SceneLayout, program: Program, kernel: ModuleType) -> None:
        self._parts, self._layout = parts, layout
        self.program = program
        tape = encoded(program)
        self._run = kernel.run
        self._roles, self._space = tape.roles, tape.space()
        if self._space.dtype.fields is not None and not hasattr(kernel.run, "py_func"):
            self._space = self._space.view(np.recarray)  # interpreted (NUMBA_DISABLE_JIT)
        pair = None if parts.laws is None else parts.laws.learner.book.pair
        self._frame = "world" if pair is None else pair.frame
        self._keys = tuple((a.object, a.property) for a in program.answers)
        self._frames = tuple(self._frame if a.component >= 0 else "world" for a in program.answers)
        self._tellers = tuple(_Teller(parts, layout, a, self._frame) for a in program.answers)

    def many(self, vectors: NDArray[np.float64]) -> BatchPrediction | None:
        """Predict what follows n scenes; None: arrays must, or can say why not."""
        with np.errstate(over="ignore", invalid="ignore"):
            total = float(vectors.sum())
        if (
            not math.isfinite(total) and not np.isfinite(vectors).all()
        ):  # finite numbers may add up to infinity
            return None
        told = self._told(vectors)
        if told is None:
            return None
        return BatchPrediction(
            self._layout, told.following, self._keys, told.modes, told.outcomes, told.margins, self._frames
        )

    def one(self, scene: Scene) -> ScenePrediction | None:
        """Predict what follows one scene, whose numbers are finite; None: arrays must, or can say why not."""
        now = scene.vector
        told = self._told(now[None])
        if told is None:
            return None
        after, players = told.following[0], told.players[0]
        outcomes, modes = told.outcomes[0].tolist(), told.modes[0].tolist()
        margins, noted = told.margins[0].tolist(), told.noted[0].tolist()
        found = tuple(
            teller.tell(now, after, outcomes[k], modes[k], margins[k], noted[k], players[k])
            for k, teller in enumerate(self._tellers)
        )
        return ScenePrediction(Scene(scene.schema, self._layout, after), found)

    def _told(self, vectors: NDArray[np.float64]) -> _Told | None:
        """Run the program. What it writes to is new each time: another thread may ask before this one has read it."""
        n, count = len(vectors), len(self._keys)
        told = _Told(
            vectors.copy(),
            np.empty((n, count), dtype=np.int8),
            np.empty((n, count), dtype=np.int64),
            np.empty((n, count)),
            np.empty((1, count, self._roles), dtype=np.int64),
            np.zeros((1, count), dtype=np.int64),
        )
        return None if self._run(self._space, vectors, *told) else told


class _Teller:
    """What is told of one answer to a single scene: who plays which role, and the spread."""

    __slots__ = ("_answer", "_body_names", "_frame", "_modes", "_spreads", "_stand_ins")

    def __init__(self, parts: Parts, layout: SceneLayout, answer: Answer, frame: str) -> None:
        self._answer, self._frame = answer, frame
        self._body_names = tuple(layout.names[i] for i in layout.bodies)
        self._modes = {mode.id: mode for mode in answer.modes}
        index = layout.index(answer.object)
        model = parts.property_model(layout.types[index].name, answer.property)
        situation = Situation(Percept(parts.perception, layout, np.empty((0, layout.width)), None), index)  # type: ignore[arg-type]
        signature = situation.signature
        gather = parts.perception.gather(layout, signature, tuple(situation.plain.tolist())).tolist()
        self._spreads = _spreads(model.spreads, signature, gather) if answer.modes else {}
        best, beyond = model.guess, model.guess_beyond
        self._stand_ins = (
            math.nan if best is None else best.mode.sigma,
            math.nan if beyond is None else beyond.mode.sigma,
            beyond is not None,
        )

    def tell(
        self,
        now: NDArray[np.float64],
        after: NDArray[np.float64],
        outcome: int,
        mode: int,
        margin: float,
        noted: int,
        players: _Bits,
    ) -> Prediction:
        """The prediction of a scene; `noted` is the mode that gave the value, or of laws whom the body touches."""
        a = self._answer
        value = float(after[a.column])
        roles: tuple[str, ...] = ()
        spread = math.nan
        if a.component >= 0:
            if mode:
                touched = (name for k, name in enumerate(self._body_names) if noted >> k & 1)
                roles = (a.object, *touched)
        elif noted > 0:
            spread = self._spreads[noted](now) if noted in self._spreads else math.nan
            if mode:
                roles = self._roles(mode, players)
        if noted < 0:  # a fallback value
            spread = self._stand_ins[1] if noted == -2 and self._stand_ins[2] else self._stand_ins[0]
        said = self._frame if mode == TOUCHING and a.component >= 0 else "world"
        return Prediction(a.object, a.property, value, OUTCOMES[outcome], mode, roles, margin, said, spread)

    def _roles(self, mode: int, players: _Bits) -> tuple[str, ...]:
        known = self._modes.get(mode)
        if known is None:  # a limit, or a stop
            return (self._answer.object,)
        if not known.roles:
            return tuple(name for name in known.players if name is not None)
        names = list(known.players)
        for role in known.roles:
            names[role.number + 1] = self._body_names[int(players[role.number])]
        return tuple(name for name in names if name is not None)


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
