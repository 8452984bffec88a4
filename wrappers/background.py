"""Learning in a process of its own, behind a bounded queue, so that acting never waits for it."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import queue as queues
import signal
import threading
import weakref
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import groupby
from multiprocessing.connection import Connection, wait
from typing import Any, NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.features import functions_of, register_function
from relgym.config import ModelConfig
from relgym.envs.arguments import checked_count
from relgym.errors import ConfigError, RelgymError
from relgym.hypotheses import register_hypothesis, registered
from relgym.model.predicting.prequential import Outcomes, Prequential, compared
from relgym.model.protocol import SceneLearner
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene, Transition
from relgym.scene.schema import SceneSchema

__all__ = ["Background"]

Names: TypeAlias = tuple[str, ...]
Bundle: TypeAlias = tuple[Names, Names, NDArray[np.float64], NDArray[np.float64]]
"""Objects before and after, and one row of numbers before and after for each transition of a run of equal ones: an
array by itself takes longer to send than all its numbers."""

Answer: TypeAlias = tuple[int, SceneLearner, Prequential | None] | Exception | None
"""What was learned, with the number of the question; or what made it fail; ``None``: the process has ended."""

WATCH = 1.0
"""Seconds after which the process looks whether its parent is still there, if nothing tells it sooner."""

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
    dropped : int
        Transitions that found the queue full and were left out.

    Raises
    ------
    ConfigError
        A queue of no length, features (`ModelConfig.features`) that are functions which no process can be sent, or a
        process that may have no children (a daemonic worker of `multiprocessing`).

    Notes
    -----
    The process is spawned, not forked, so that it shares no threads with engines and networks; that takes a second
    or two, and a script must guard its main part by ``if __name__ == "__main__":``. Which transitions are dropped
    depends on the machine, so the model isn't reproducible when any are.

    It ends with this object and with the process that made it, however that ends. An interrupt from the keyboard
    reaches every process of a terminal; this one ignores it, and what it learned can be fetched afterwards.
    """

    def __init__(
        self, model: SceneLearner, prequential: Prequential | None, *, queue: int, precision: float = 0.0
    ) -> None:
        length = checked_count("background", queue, 1, 10**7)
        functions = _sendable(model.config if isinstance(model, WorldModel) else ModelConfig())
        if multiprocessing.current_process().daemon:
            raise ConfigError(
                f"background={queue}: this is a daemonic worker process, which may have no children; learn in the "
                "foreground here (background=None), or in the main process"
            )
        context = multiprocessing.get_context("spawn")
        self._size = max(1, length // PARCELS)
        # Beside the parcels in the queue one is being packed: the number of its first transition, and what is in it.
        # One assignment changes both, so that an interrupt leaves them right.
        self._parcel: tuple[int, list[Transition]] = (0, [])
        self._queue: Any = context.Queue((length + 1 - self._size) // self._size)
        self._queue.cancel_join_thread()  # who exits must not wait for a process that may be dead
        answers, remote = context.Pipe(duplex=False)
        self._process = context.Process(
            target=_learn,
            args=(model, prequential, precision, functions, self._queue, remote, os.getpid()),
            daemon=True,
            name="relgym-learner",
        )
        with _uninterrupted():
            self._process.start()
        remote.close()  # so that the end of the process is the end of the pipe
        self._inbox: queues.SimpleQueue[Answer] = queues.SimpleQueue()
        # Interrupts are raised in the main thread only: no answer is ever read by half.
        self._reader = threading.Thread(
            target=_read, args=(answers, self._inbox), daemon=True, name="relgym-answers"
        )
        self._reader.start()
        self._end = weakref.finalize(self, _end, self._process, self._queue, self._reader)
        self._trouble: Exception | None = None
        self._asked = 0
        self.dropped = 0

    @property
    def sent(self) -> int:
        """Number of transitions that went in."""
        first, parcel = self._parcel
        return first + len(parcel)

    def put(self, transition: Transition) -> bool:
        """Queue one transition; false, and counted, when the queue is full.

        Raises
        ------
        RelgymError
            The process has ended, or what it learned made it fail; noticed when a parcel is sent.
        """
        first, parcel = self._parcel
        if len(parcel) + 1 >= self._size:
            self._check()
            if self._queue.full():
                self.dropped += 1
                return False
            self._queue.put_nowait((first, _packed([*parcel, transition])))  # nobody else puts anything in
            self._parcel = (first + len(parcel) + 1, [])
        else:
            parcel.append(transition)
        return True

    def fetch(self) -> tuple[SceneLearner, Prequential | None]:
        """Wait until everything queued was learned; copies of the model and of the counts.

        Raises
        ------
        RelgymError
            The process has ended, or what it learned made it fail.
        """
        self._check()
        question = self._ask()
        while True:
            try:
                answer = self._inbox.get(timeout=1.0)
            except queues.Empty:
                if self._reader.is_alive():
                    continue
                answer = None
            if answer is None:
                self._complain()
            if isinstance(answer, Exception):
                self._trouble = answer
                raise answer
            number, model, prequential = answer
            if number == question:  # else nobody waited for it, since asking was interrupted
                return model, prequential

    def _check(self) -> None:
        """Raise what the process failed of, or that it has ended; unasked it says nothing else."""
        if not self._process.is_alive():
            self._reader.join(1.0)  # its last words come before its end
        while self._trouble is None and not self._inbox.empty():
            said = self._inbox.get()
            if said is None:
                self._complain()
            self._trouble = said if isinstance(said, Exception) else None
        if self._trouble is not None:
            raise self._trouble

    def _complain(self) -> NoReturn:
        self._inbox.put(None)  # whoever asks next is told, too
        self._process.join(1.0)  # its pipe may end before it does
        raise RelgymError(
            f"the learning process has ended (exit code {self._process.exitcode}): what it hadn't handed over yet is "
            "lost; close() goes on without it, and learning in the foreground (background=None) shows why it ended"
        ) from None

    def _ask(self) -> int:
        """Send what is left and a question; its number."""
        self._asked += 1
        while self._process.is_alive():
            first, parcel = self._parcel
            try:
                self._queue.put((first, [*_packed(parcel), self._asked]), timeout=1.0)
            except queues.Full:
                continue
            self._parcel = (first + len(parcel), [])
            return self._asked
        self._complain()

    def close(self) -> None:
        """End the process; what is still queued is lost."""
        self._end()


def _end(process: Any, queue: Any, reader: threading.Thread) -> None:
    """End the process and all that belongs to it."""
    if process.is_alive():
        process.terminate()
    process.join(5.0)
    if process.is_alive():  # stopped, say
        process.kill()
        process.join()
    queue.close()
    reader.join(5.0)  # the end of the process is the end of its pipe


def _read(answers: Connection, inbox: queues.SimpleQueue[Answer]) -> None:
    """Take in what the process says, until it ends."""
    while True:
        try:
            inbox.put(answers.recv())
        except (EOFError, OSError):
            answers.close()
            inbox.put(None)
            return
        except Exception as error:  # an answer that can't be read
            inbox.put(RelgymError(f"the learning process said what can't be read: {error!r}"))


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Where a process is started in here, interrupts from the keyboard never reach it, not even while it imports."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with(parent: int) -> None:
    """End this process as soon as its parent has ended, however that happened.

    The end of a pipe tells at once; but other children of the parent may hold it open, hence the second look.
    """
    known = multiprocessing.parent_process()
    while os.getppid() == parent:
        if known is not None and wait([known.sentinel], WATCH):
            break
    os._exit(0)


def _learn(
    model: SceneLearner,
    prequential: Prequential | None,
    precision: float,
    functions: bytes,
    queue: Any,
    answers: Connection,
    parent: int,
) -> None:
    """The process' life: learn what comes; answer every question with all that was learned so far.

    An error is reported at once, without being asked for.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    trouble = _registered(functions)
    if trouble is not None:
        answers.send(trouble)
    learned = 0
    while True:
        number, bundles = queue.get()
        for bundle in bundles:
            if isinstance(bundle, int):
                answers.send((bundle, model, prequential) if trouble is None else trouble)
            elif trouble is None:
                try:
                    for transition in _unpacked(model.schema, bundle):
                        if number == learned:  # else it comes again, since sending was interrupted
                            _take_up(model, prequential, precision, transition)
                            learned += 1
                        number += 1
                except Exception as error:
                    trouble = error
                    answers.send(trouble)


def _sendable(config: ModelConfig) -> bytes:
    """The users' functions and hypothesis classes that a model needs, for another process."""
    functions, kinds = functions_of(config.features), [registered(name) for name in config.hypotheses]
    try:
        return pickle.dumps((functions, kinds))
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ConfigError(
            f"features, hypotheses: {[*sorted(functions), *config.hypotheses]} can't be sent to the learning process "
            f"({error}); register such as are defined by def or class at the top level of a module, or learn in the "
            "foreground (background=None)"
        ) from None


def _registered(sent: bytes) -> Exception | None:
    """Register what another process sent; why that failed, if it did."""
    try:
        functions, kinds = pickle.loads(sent)
        for name, function in functions.items():
            register_function(name, function)
        for kind in kinds:
            register_hypothesis(kind)
    except Exception as error:
        return ConfigError(
            f"features, hypotheses: one of them can't be found in the learning process ({error}); define it at the top "
            "level of a module, outside of `if __name__ == '__main__':`, or learn in the foreground (background=None)"
        )
    return None


def _take_up(
    model: SceneLearner, prequential: Prequential | None, precision: float, transition: Transition
) -> None:
    if prequential is not None:
        prediction = model.predict_one(transition.before)
        residuals, wrong = compared(prediction, transition.after, precision)
        prequential.count(residuals, wrong, Outcomes.of(prediction, transition.before, residuals))
        model.take_up(transition, prediction, residuals, precision)
    else:
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
