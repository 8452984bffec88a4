"""Learning in a process of its own, behind a bounded queue, so that acting never waits for it."""

from __future__ import annotations

import multiprocessing
import queue as queues
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.envs.arguments import checked_count
from relgym.errors import RelgymError
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene, SceneSchema, Transition
from relgym.wrappers.prequential import Prequential, compared

__all__ = ["Background"]

Packed: TypeAlias = tuple[tuple[str, ...], NDArray[np.float64], tuple[str, ...], NDArray[np.float64]]
"""Objects and vector before, objects and vector after: a transition without its schema."""

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
        context = multiprocessing.get_context("spawn")
        self._size = max(1, length // PARCELS)
        self._parcel: list[Packed | None] = []
        # Beside the parcels in the queue one is being packed.
        self._queue: Any = context.Queue((length + 1 - self._size) // self._size)
        self._queue.cancel_join_thread()  # who exits must not wait for a process that may be dead
        self._answers, remote = context.Pipe(duplex=False)
        self._process = context.Process(
            target=_learn,
            args=(model, prequential, precision, self._queue, remote),
            daemon=True,
            name="relgym-learner",
        )
        self._process.start()
        remote.close()  # so that the end of the process is the end of the pipe
        self.sent = self.dropped = 0

    def put(self, transition: Transition) -> bool:
        """Queue one transition; false, and counted, when the queue is full."""
        self._parcel.append(_packed(transition))
        if len(self._parcel) >= self._size:
            try:
                self._queue.put_nowait(self._parcel)
            except queues.Full:
                self._parcel.pop()
                self.dropped += 1
                return False
            self._parcel = []  # the one that was sent is pickled later, by the queue's thread
        self.sent += 1
        return True

    def fetch(self) -> tuple[WorldModel, Prequential | None]:
        """Wait until everything queued was learned; copies of the model and of the counts.

        Raises
        ------
        RelgymError
            The process has ended, or what it learned made it fail.
        """
        try:
            self._ask()
            answer = self._answers.recv()
        except EOFError:
            raise RelgymError(
                f"the learning process has ended (exit code {self._process.exitcode}); learn in the foreground "
                "(background=None) to see why"
            ) from None
        if isinstance(answer, Exception):
            raise answer
        model, prequential = answer
        return model, prequential

    def _ask(self) -> None:
        while self._process.is_alive():
            try:
                self._queue.put([*self._parcel, None], timeout=1.0)
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
    model: WorldModel, prequential: Prequential | None, precision: float, queue: Any, answers: Any
) -> None:
    """The process' life: learn what comes; answer every ``None`` with all that was learned so far."""
    trouble: Exception | None = None
    while True:
        for packed in queue.get():
            if packed is None:
                answers.send((model, prequential) if trouble is None else trouble)
            elif trouble is None:
                try:
                    _take_up(model, prequential, precision, _unpacked(model.schema, packed))
                except Exception as error:
                    trouble = error


def _take_up(
    model: WorldModel, prequential: Prequential | None, precision: float, transition: Transition
) -> None:
    if prequential is not None:
        residuals, wrong = compared(model.predict_one(transition.before), transition.after, precision)
        prequential.count(residuals, wrong)
    model.learn_one(transition)


def _packed(transition: Transition) -> Packed:
    before, after = transition.before, transition.after
    return before.layout.names, before.vector, after.layout.names, after.vector


def _unpacked(schema: SceneSchema, packed: Packed) -> Transition:
    names, vector, later_names, later = packed
    before, after = schema.layout(names), schema.layout(later_names)
    return Transition(Scene(schema, before, vector), Scene(schema, after, later))
