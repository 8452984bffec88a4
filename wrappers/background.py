"""Learning in a process of its own, behind a bounded queue, so that acting never waits for it."""

from __future__ import annotations

import multiprocessing
import pickle
import queue as queues
from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import Any, NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.features import functions_of, register_function
from relgym.envs.arguments import checked_count
from relgym.errors import ConfigError, RelgymError
from relgym.model.prequential import Outcomes, Prequential, compared
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene, Transition
from relgym.scene.schema import SceneSchema

__all__ = ["Background"]

Names: TypeAlias = tuple[str, ...]
Bundle: TypeAlias = tuple[Names, Names, NDArray[np.float64], NDArray[np.float64]]
"""Objects before and after, and one row of numbers before and after for each transition of a run of equal ones: an
array by itself takes longer to send than all its numbers."""

PARCELS = 64
"""Transitions travel in parcels, of which the queue holds about so many: one by one, sending them costs the agent's
process twice as much."""


class Background:
    """A process that owns a model and learns, in order, what is put into its queue.

    Parameters
    ----------
    model
        What it begins with; a copy.
    prequential
        Where to begin counting the errors of predictions; ``None``: it doesn't predict.
    precision
        As of `Study`.
    queue
        Most transitions that may wait, >= 1. Raising it drops fewer when learning falls behind, and lets the model lag
        more. From 128 on they are sent several at a time, a 64th of this number.

    Attributes
    ----------
    sent, dropped : int
        Transitions that went in, and that found the queue full and were left out.

    Raises
    ------
    ConfigError
        A queue of no length, or features (`ModelConfig.features`) that are functions which no process can be sent.

    Notes
    -----
    The process is spawned, not forked, so that it shares no threads with engines and networks; that takes a second
    or two, and a script must guard its main part by ``if __name__ == "__main__":``. Which transitions are dropped
    depends on the machine, so the model isn't reproducible when any are.
    """

    def __init__(
        self, model: WorldModel, prequential: Prequential | None, *, queue: int, precision: float = 0.0
    ) -> None:
        length = checked_count("background", queue, 1, 10**7)
        functions = _sendable(model.config.features)
        context = multiprocessing.get_context("spawn")
        self._size = max(1, length // PARCELS)
        self._parcel: list[Transition] = []
        # Beside the parcels in the queue one is being packed.
        self._queue: Any = context.Queue((length + 1 - self._size) // self._size)
        self._queue.cancel_join_thread()  # who exits must not wait for a process that may be dead
        self._answers, remote = context.Pipe(duplex=False)
        self._process = context.Process(
            target=_learn,
            args=(model, prequential, precision, functions, self._queue, remote),
            daemon=True,
            name="relgym-learner",
        )
        self._process.start()
        remote.close()  # so that the end of the process is the end of the pipe
        self._trouble: Exception | None = None
        self.sent = self.dropped = 0

    def put(self, transition: Transition) -> bool:
        """Queue one transition; false, and counted, when the queue is full.

        Raises
        ------
        RelgymError
            The process has ended, or what it learned made it fail; noticed when a parcel is sent.
        """
        self._parcel.append(transition)
        if len(self._parcel) >= self._size:
            try:
                self._check()
            except Exception:
                self._parcel.pop()
                raise
            if self._queue.full():
                self._parcel.pop()
                self.dropped += 1
                return False
            self._queue.put_nowait(_packed(self._parcel))  # nobody else puts anything in
            self._parcel = []
        self.sent += 1
        return True

    def fetch(self) -> tuple[WorldModel, Prequential | None]:
        """Wait until everything queued was learned; copies of the model and of the counts.

        Raises
        ------
        RelgymError
            The process has ended, or what it learned made it fail.
        """
        self._check()
        try:
            self._ask()
            answer = self._answers.recv()
        except EOFError:
            self._complain()
        if isinstance(answer, Exception):
            self._trouble = answer
            raise answer
        model, prequential = answer
        return model, prequential

    def _check(self) -> None:
        """Raise what the process failed of, or that it has ended; unasked it says nothing else."""
        try:
            if self._trouble is None and self._answers.poll():
                said = self._answers.recv()
                # Else it is what nobody waited for, since asking was interrupted.
                self._trouble = said if isinstance(said, Exception) else None
        except (EOFError, OSError):  # its end, or ours
            self._complain()
        if self._trouble is not None:
            raise self._trouble

    def _complain(self) -> NoReturn:
        self._process.join(1.0)  # its pipe may end before it does
        raise RelgymError(
            f"the learning process has ended (exit code {self._process.exitcode}): what it hadn't handed over yet is "
            "lost; close() goes on without it, and learning in the foreground (background=None) shows why it ended"
        ) from None

    def _ask(self) -> None:
        while self._process.is_alive():
            try:
                self._queue.put([*_packed(self._parcel), None], timeout=1.0)
            except queues.Full:
                continue
            self._parcel = []
            return
        raise EOFError

    def close(self) -> None:
        """End the process; what is still queued is lost."""
        if self._process.is_alive():
            self._process.terminate()
        self._process.join()
        self._queue.close()
        self._answers.close()


def _learn(
    model: WorldModel,
    prequential: Prequential | None,
    precision: float,
    functions: bytes,
    queue: Any,
    answers: Any,
) -> None:
    """The process' life: learn what comes; answer every ``None`` with all that was learned so far.

    An error is reported at once, without being asked for.
    """
    trouble = _registered(functions)
    if trouble is not None:
        answers.send(trouble)
    while True:
        for bundle in queue.get():
            if bundle is None:
                answers.send((model, prequential) if trouble is None else trouble)
            elif trouble is None:
                try:
                    for transition in _unpacked(model.schema, bundle):
                        _take_up(model, prequential, precision, transition)
                except Exception as error:
                    trouble = error
                    answers.send(trouble)


def _sendable(features: Iterable[str]) -> bytes:
    """The users' functions among some features, for another process."""
    functions = functions_of(features)
    try:
        return pickle.dumps(functions)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ConfigError(
            f"features: the functions {sorted(functions)} can't be sent to the learning process ({error}); register "
            "such as are defined by def at the top level of a module, or learn in the foreground (background=None)"
        ) from None


def _registered(functions: bytes) -> Exception | None:
    """Register what another process sent; why that failed, if it did."""
    try:
        for name, function in pickle.loads(functions).items():
            register_function(name, function)
    except Exception as error:
        return ConfigError(
            f"features: a function can't be found in the learning process ({error}); define it at the top level of a "
            "module, outside of `if __name__ == '__main__':`, or learn in the foreground (background=None)"
        )
    return None


def _take_up(
    model: WorldModel, prequential: Prequential | None, precision: float, transition: Transition
) -> None:
    if prequential is not None:
        prediction = model.predict_one(transition.before)
        residuals, wrong = compared(prediction, transition.after, precision)
        prequential.count(residuals, wrong, Outcomes.of(prediction, transition.before, residuals))
        model.look_back(prediction, residuals, precision)
    model.learn_one(transition)


def _packed(transitions: Iterable[Transition]) -> list[Bundle]:
    bundles = []
    for (before, after), run in groupby(
        transitions, key=lambda t: (t.before.layout.names, t.after.layout.names)
    ):
        pairs = [(t.before.vector, t.after.vector) for t in run]
        bundles.append((before, after, np.stack([b for b, _ in pairs]), np.stack([a for _, a in pairs])))
    return bundles


def _unpacked(schema: SceneSchema, bundle: Bundle) -> Iterator[Transition]:
    names, later_names, vectors, later = bundle
    before, after = schema.layout(names), schema.layout(later_names)
    for vector, following in zip(vectors, later, strict=True):
        # Copies: a scene is kept long, and must not keep its whole bundle with it.
        yield Transition(Scene(schema, before, vector.copy()), Scene(schema, after, following.copy()))
