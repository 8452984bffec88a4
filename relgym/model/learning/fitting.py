"""Learning from many transitions, one after the other, exactly as they would be learned from as they come."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from relgym.config.checks import checked_count
from relgym.config.constants import MOST_STEPS
from relgym.errors import DataError, ModelFileError, ObservationError
from relgym.model.predicting.prequential import StepReport, compared
from relgym.model.predicting.score import Score
from relgym.scene.objects import ACTION, Scene, Transition
from relgym.scene.schema import SceneSchema

if TYPE_CHECKING:
    from relgym.model.predicting.prediction import ScenePrediction
    from relgym.model.protocol import SceneLearner
    from relgym.model.world_model import WorldModel

__all__ = ["Progress", "as_transitions", "compare_and_learn", "ends_of", "progressive", "transitions_of"]


@dataclass(frozen=True, slots=True)
class Progress:
    """How a model did on the steps since the last report, each predicted before it was learned from.

    Attributes
    ----------
    steps
        How many steps it has predicted so far.
    score
        Of the predictions since the last report.
    report
        Of the latest step.
    """

    steps: int
    score: Score
    report: StepReport


def compare_and_learn(
    model: SceneLearner,
    transition: Transition,
    prediction: ScenePrediction | None,
    *,
    precision: float = 0.0,
    learn: bool = True,
) -> StepReport:
    """Compare a prediction with what came, then learn from it: all that learning online does after a step.

    Parameters
    ----------
    model
        Who learns.
    transition
        What happened.
    prediction
        What the model had said of it; ``None`` where it wasn't asked: then nothing is compared.
    precision
        Relative precision of what was observed; errors below it aren't counted as wrong.
    learn
        Whether to learn.
    """
    residuals, wrong = compared(prediction, transition.after, precision)
    learned = None
    if learn:
        learned = (
            model.take_up(transition, prediction, residuals, precision)
            if prediction is not None
            else model.learn_one(transition)
        )
    return StepReport(prediction, residuals, wrong, learned, transition)


def progressive(
    model: WorldModel,
    transitions: Iterable[Transition],
    *,
    every: int = 1,
    precision: float = 0.0,
    learn: bool = True,
) -> Iterator[Progress]:
    """Predict each transition, then learn from it; a report after every so many, and one of what remains."""
    checked_count("every", every, 1, MOST_STEPS)
    if learn and model.frozen:
        raise ModelFileError(
            "this model was loaded without its history and can only predict: save it with save(path, history=True) to "
            "go on learning, or ask for its score"
        )
    score, steps = Score(), 0
    report: StepReport | None = None
    for transition in transitions:
        prediction = model.predict_one(transition.before)
        report = compare_and_learn(model, transition, prediction, precision=precision, learn=learn)
        score.add(prediction, transition, precision)
        steps += 1
        if steps % every == 0:
            yield Progress(steps, score, report)
            score, report = Score(), None
    if report is not None:
        yield Progress(steps, score, report)


def as_transitions(given: Iterable[Any], check: Callable[[Scene], None]) -> list[Transition]:
    """Transitions among anything that holds them: `Transition`, or what has one as its ``transition``.

    Parameters
    ----------
    given
        What holds them.
    check
        Raises `ObservationError` for scenes that can't be learned from.

    Raises
    ------
    DataError
        Something else, none at all, scenes of another world, NaN or infinity; the message says which one.
    """
    if isinstance(given, (str, bytes, Mapping)) or not isinstance(given, Iterable):
        raise DataError(f"expected transitions, got {type(given).__name__}; {_ELSEWHERE}")
    found: list[Transition] = []
    for number, item in enumerate(given):
        transition = getattr(item, "transition", item)
        if not isinstance(transition, Transition):
            raise DataError(
                f"item {number}: expected a Transition (or a record with one), got {type(item).__name__}; {_ELSEWHERE}"
            )
        try:
            check(transition.before)
            check(transition.after)
        except ObservationError as error:
            raise DataError(f"transition {number}: {error}") from None
        found.append(transition)
    if not found:
        raise DataError("no transitions to learn from; expected at least one")
    return found


_ELSEWHERE = (
    "arrays go in as fit(observations, actions, next_observations), and relgym.fit reads what an env showed: "
    "episodes, arrays of any space, Minari data sets"
)


def transitions_of(
    schema: SceneSchema,
    observations: Any,
    actions: Any = None,
    next_observations: Any = None,
    *,
    terminations: Any = None,
    truncations: Any = None,
) -> list[Transition]:
    """Transitions from arrays whose columns are a schema's properties.

    Parameters
    ----------
    schema
        What the scenes are made of; all of its objects are present in every row.
    observations
        ``{object name: array of shape (n, properties)}`` for all objects but the action, or one array of shape
        ``(n, width)`` with their properties side by side, in the schema's order.
    actions
        Properties of the action object in physical units, shape ``(n, properties)``; none where the schema has none.
    next_observations
        As `observations`, after each step. Default: row k + 1 follows row k, but where an episode ends.
    terminations, truncations
        Where an episode ended, shape ``(n,)``.

    Raises
    ------
    DataError
        Lengths or shapes that don't fit, other dtypes than numbers, NaN or infinity, or no step at all.
    """
    names = [name for name in schema.order if name != ACTION]
    now = _matrix(schema, names, observations, "observations")
    count = len(now)
    acts = ACTION in schema.order
    if acts is (actions is None):
        raise DataError(
            f"actions: the schema has {'an action object' if acts else 'no action object'}, and "
            f"{'none were' if acts else 'some were'} given"
        )
    done = _matrix(schema, [ACTION], actions, "actions") if acts else np.empty((count, 0))
    later = (
        now if next_observations is None else _matrix(schema, names, next_observations, "next_observations")
    )
    for what, array in (("actions", done), ("next_observations", later)):
        if len(array) != count:
            raise DataError(f"{what}: expected {count} rows, as many as observations, got {len(array)}")
    ended = ends_of(count, terminations, truncations)
    rows = np.arange(count)
    if next_observations is None:
        rows = rows[:-1][~ended[:-1]]
        later = now[1:][~ended[:-1]]
    if not len(rows):
        raise DataError("no step to learn from: expected at least one row that another one follows")
    before, after = schema.layout(), schema.layout(names)
    # The action stands where the schema has it; the other objects keep their order.
    place = {name: before.slice(before.index(name)) for name in before.names}
    found = []
    for row, following in zip(rows.tolist(), later, strict=True):
        vector = np.empty(before.width)
        for name in names:
            vector[place[name]] = now[row, after.slice(after.index(name))]
        if acts:
            vector[place[ACTION]] = done[row]
        found.append(Transition(Scene(schema, before, vector), Scene(schema, after, following.copy())))
    return found


def ends_of(count: int, terminations: Any, truncations: Any) -> NDArray[np.bool_]:
    """Which of `count` steps ended an episode, shape ``(count,)``; `DataError` for other lengths, or no flags."""
    ended = np.zeros(count, dtype=np.bool_)
    for what, given in (("terminations", terminations), ("truncations", truncations)):
        if given is None:
            continue
        try:
            flags = np.asarray(given)
        except ValueError:  # ragged
            raise DataError(f"{what}: expected {count} flags, one for each step, got {given!r}") from None
        if flags.shape == (count, 1):
            flags = flags[:, 0]
        if flags.shape != (count,):
            raise DataError(f"{what}: expected {count} flags, one for each step, got shape {flags.shape}")
        if flags.dtype.kind not in "biuf" or not np.isin(flags, (0, 1)).all():
            raise DataError(f"{what}: expected booleans, or 0 and 1, got dtype {flags.dtype}")
        ended |= flags.astype(np.bool_)
    return ended


def _matrix(schema: SceneSchema, names: Sequence[str], given: Any, what: str) -> NDArray[np.float64]:
    """Properties of some objects side by side, shape ``(n, width)``."""
    columns = [f"{name}.{prop}" for name in names for prop in schema.type_of(name).properties]
    if isinstance(given, Mapping):
        if set(given) != set(names):
            raise DataError(
                f"{what}: expected an array for each of {list(names)}, got {sorted(map(str, given))}"
            )
        parts = [
            _numbers(given[name], f"{what}[{name!r}]", list(schema.type_of(name).properties))
            for name in names
        ]
        if len({len(part) for part in parts}) > 1:
            lengths = {name: len(part) for name, part in zip(names, parts, strict=True)}
            raise DataError(f"{what}: expected equally many rows of all objects, got {lengths}")
        return np.concatenate(parts, axis=1) if parts else np.empty((0, 0))
    return _numbers(given, what, columns)


def _numbers(given: Any, what: str, columns: Sequence[str]) -> NDArray[np.float64]:
    try:
        raw = np.asarray(given)
    except ValueError:
        raise DataError(f"{what}: expected an array, got rows of different lengths") from None
    if raw.dtype.kind not in "biuf":
        raise DataError(f"{what}: expected an array of numbers, got dtype {raw.dtype}")
    array = raw.astype(np.float64)
    if array.ndim != 2 or array.shape[1] != len(columns):
        hint = "; reshape(-1, 1) makes a column of it" if array.ndim == 1 and len(columns) == 1 else ""
        raise DataError(
            f"{what}: expected shape (n, {len(columns)}) for {list(columns)}, got {array.shape}{hint}"
        )
    if not len(array):
        raise DataError(f"{what}: no rows; expected at least one")
    if not np.isfinite(array).all():
        row, column = (int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise DataError(
            f"{what}: row {row}, {columns[column]}: expected a finite number, got {array[row, column]}; leave such "
            "steps out, and mark the step before them as truncated"
        )
    return array
