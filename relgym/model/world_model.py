"""The whole model of a world: one property model per target, composed (§1.2.6)."""

from __future__ import annotations

import copy
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, replace
from functools import partial
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import array_of, refusing, whole
from relgym.clustering.mode import Mode
from relgym.config import ModelConfig
from relgym.config.checks import checked_count
from relgym.config.constants import ALL_DIGITS, DIGITS, MOST_STEPS, SUMMABLE
from relgym.errors import ConfigError, ModelFileError, ObservationError, QueryError, RelgymError
from relgym.files.reading import FileLimits
from relgym.html import html_text
from relgym.laws.book import LawBook
from relgym.model.files.archive import parts_from_json, parts_to_arrays, parts_to_json
from relgym.model.files.storage import read_model, write_model
from relgym.model.learning.fitting import Progress, as_transitions, progressive, transitions_of
from relgym.model.learning.journal import Journal
from relgym.model.learning.merging import merge
from relgym.model.learning.transition import NOTHING, LearnReport, finish, learn
from relgym.model.parts import Parts
from relgym.model.percepts.locality import (
    Neighbourhoods,
    check_size,
    foci,
    large,
    learn_locally,
    predict_locally,
    predict_many_locally,
)
from relgym.model.percepts.perception import Percept, Situation
from relgym.model.percepts.scenes import Arrival, next_values, with_action
from relgym.model.predicting.prediction import BatchPrediction, Outcome, ScenePrediction
from relgym.model.predicting.querying import predict, predict_many
from relgym.model.predicting.score import Score, scored
from relgym.model.reports.advice import Advice, advices, together
from relgym.model.reports.rules import doubted, of_laws, rule_list
from relgym.model.reports.text import SURFACES
from relgym.model.running.compiled import KERNEL
from relgym.model.running.lowering import lowered
from relgym.model.running.rolling import BatchRollout, step_by_step
from relgym.model.running.runner import Programs, Runner
from relgym.model.running.trusting import trusting
from relgym.model.target.hindsight import (
    Confirmed,
    Retrospect,
    calibration_to_json,
    hindsight_to_json,
    look_back,
    restore_calibration,
    restore_hindsight,
)
from relgym.model.target.property_model import PropertyModel
from relgym.program.records import BeyondError
from relgym.program.source import python_source
from relgym.reporting.naming import named_text
from relgym.reporting.parser import parse_rules
from relgym.reporting.rules import RuleList
from relgym.scene.objects import ACTION, ObjectType, Scene, SceneLayout, Target, Transition
from relgym.scene.schema import SceneSchema

__all__ = ["LearnReport", "WorldModel", "with_action"]

_TAKES_ARRAYS = "device='cuda': this model, or one of the scenes, takes arrays: device='cpu' has them"

_OVERFLOWS = math.sqrt(math.sqrt(SUMMABLE))
"""Products of several numbers as large as this may be infinite."""


class WorldModel:
    """Learns, one transition at a time, what happens next in a world of objects.

    Parameters
    ----------
    schema
        The scenes' schema.
    config
        Free parameters: a `ModelConfig`, or a dict of those that differ from the default
        (``{"seed": 1, "clustering": {"draws": 500}}``).
    targets
        What to learn, in causal order; default: the schema's targets, and if it names none, every property
        that changes (kinematics and exogenous properties apart).

    Examples
    --------
    >>> from relgym.scene.objects import ObjectType, Target, Transition
    >>> from relgym.scene.schema import SceneSchema
    >>> ball = ObjectType("ball", ("v",))
    >>> schema = SceneSchema((ball,), (("b", "ball"),), targets=(Target("ball", "v"),))
    >>> model = WorldModel(schema)
    >>> v = 8.0
    >>> for _ in range(12):
    ...     _ = model.learn_one(Transition(schema.scene({"b": [v]}), schema.scene({"b": [0.5 * v]})))
    ...     v *= 0.5
    >>> model.modes("ball", "v")[0].formula()
    "v' = 0.5 v"
    >>> model.predict_one(schema.scene({"b": [3.0]})).scene["b"]["v"]
    1.5
    """

    @refusing(ConfigError)
    def __init__(
        self,
        schema: SceneSchema,
        config: ModelConfig | Mapping[str, Any] | None = None,
        *,
        targets: Sequence[Target] | None = None,
    ) -> None:
        self._state = Parts(schema, ModelConfig.of(config), schema.targets if targets is None else targets)
        self.seen = 0
        self.frozen = False
        self.extra: dict[str, Any] = {}
        self.condition_names: dict[str, str] = {}
        self._percept: tuple[Scene, Percept] | None = None
        self._rules: tuple[Any, RuleList] | None = None
        self._advice: tuple[Any, tuple[Advice, ...]] | None = None
        self._stored: tuple[RuleList, tuple[Advice, ...]] | None = None

        self._neighbourhoods: tuple[Scene, Neighbourhoods] | None = None
        self._journal = Journal()
        self._programs = Programs()
        self._damaged = False

    def __getstate__(self) -> dict[str, Any]:
        if self._damaged:
            self._roll_back()
        return self.__dict__ | {
            "_percept": None,
            "_neighbourhoods": None,
            "_rules": None,
            "_advice": None,
            "_journal": Journal(),
            "_programs": Programs(),
        }

    @property
    def _parts(self) -> Parts:
        if self._damaged:  # a rollback was interrupted, too
            self._roll_back()
        return self._state

    def _made(self, name: str, *arguments: Any, numbers: int = 0) -> Any:
        """What a method returns, whose step is made either as a whole or not at all, whatever error comes in between.

        Arguments are kept until the next checkpoint: the method is called with them again where a later step fails.
        """
        if self._damaged:
            self._roll_back()
        mark = self._journal.prepare(self._learned)
        self._programs.changed()
        try:
            found = getattr(self, name)(*arguments)
            self._journal.add(name, arguments, numbers)
        except BaseException:
            self._damaged = True
            self._journal.drop(mark)
            self._roll_back()
            raise
        return found

    def _learned(self) -> WorldModel:
        """A model with all that steps change, and nothing of what its owner has attached to this one."""
        bare = WorldModel(self.schema, self.config, targets=())
        bare._state, bare.seen = self._state, self.seen
        return bare

    def _roll_back(self) -> None:
        """Be what it was after the last step that was made as a whole."""
        self._programs.changed()
        whole: WorldModel = self._journal.replayed(lambda model, name, given: getattr(model, name)(*given))
        # All at once, as far as interrupts go.
        self.__dict__.update(
            _state=whole._state,
            seen=whole.seen,
            _percept=None,
            _neighbourhoods=None,
            _rules=None,
            _advice=None,
            _damaged=False,
        )

    def __repr__(self) -> str:
        parts = ", ".join(f"{t}: {len(self._parts.models[t].modes)} modes" for t in self.targets)
        return f"WorldModel({parts or 'no targets yet'}; {self.seen} transitions)"

    def _repr_html_(self) -> str:
        return html_text(repr(self), self.describe())

    @property
    def schema(self) -> SceneSchema:
        """The scenes' schema."""
        return self._parts.schema

    @property
    def config(self) -> ModelConfig:
        """Free parameters."""
        return self._parts.config

    @property
    def targets(self) -> tuple[Target, ...]:
        """What is learned, in causal order."""
        return self._parts.targets

    @property
    def discovers(self) -> bool:
        """Whether it may find more targets as it learns: none were named, and it isn't frozen."""
        return self._parts.open and not self.frozen

    @property
    def history(self) -> int:
        """Number of examples remembered of the type that has most; see `ModelConfig.history`."""
        return max((len(table) for table in self._parts.tables.values()), default=0)

    @refusing(QueryError)
    def property_model(self, type_name: str, prop: str) -> PropertyModel:
        """The model of one target; `QueryError` when there is none."""
        return self._parts.property_model(type_name, prop)

    @refusing(QueryError)
    def modes(self, type_name: str, prop: str) -> tuple[Mode, ...]:
        """Modes of one target, by id; `QueryError` when it is none."""
        return self.property_model(type_name, prop).modes

    @refusing(ObservationError)
    def learn_one(self, transition: Transition) -> LearnReport:
        """Take up one transition.

        Parameters
        ----------
        transition
            A scene (with its action) and the scene that followed.

        Raises
        ------
        ObservationError
            NaN or infinity somewhere, or another schema; the model is unchanged.
        ShapeError
            A body can't be: an extent isn't positive, or a sphere isn't round; the model is unchanged.
        ModelFileError
            The model was loaded without its history and can't go on learning.

        Notes
        -----
        Whatever else is raised, an interrupt from the keyboard included, the model is as it was before
        (`relgym.model.learning.journal`).

        A transition in which a number is far larger than all that is known of its property is set aside, and counted in
        `set_aside`, not in `seen` (`relgym.model.percepts.screening`).

        Cost: relations once, then per target O(modes); searches and re-learning when an example is news.
        """
        self._check_step(transition)
        report: LearnReport = self._made("_learn", transition, numbers=2 * len(transition.before.vector))
        return report

    @refusing(ObservationError)
    def take_up(
        self,
        transition: Transition,
        prediction: ScenePrediction,
        residuals: Mapping[tuple[str, str], float],
        precision: float = 0.0,
    ) -> LearnReport:
        """`look_back` and `learn_one` in one: what came as predicted is only counted, and offered to what is kept.

        Parameters, errors and notes as there. The model is the same as if both had been called, but for what modes
        predicted and came true, and what is only roughly known: of that some is left out (`ModelConfig.downsampling`).
        """
        self._check_step(transition)
        scenes = transition.before, transition.after, prediction.scene
        numbers = sum(len(scene.vector) for scene in scenes)
        precision = self._told(prediction, residuals, precision)
        report: LearnReport = self._made(
            "_take_up", transition, prediction, dict(residuals), precision, numbers=numbers
        )
        return report

    def _take_up(
        self,
        transition: Transition,
        prediction: ScenePrediction,
        residuals: Mapping[tuple[str, str], float],
        precision: float,
    ) -> LearnReport:
        looked = self._look_back(prediction, residuals, precision)
        report = self._learn(transition, prediction, looked.confirmed)
        if looked.counted and report.counted:
            self._programs.counted()
        return report

    def _told(self, prediction: Any, residuals: Any, precision: Any) -> float:
        """The precision, once it is known that all three are what they should be: else nothing is begun."""
        if not isinstance(prediction, ScenePrediction):
            raise ObservationError(f"prediction={prediction!r}: expected what predict_one gives")
        if not isinstance(residuals, Mapping) or not all(
            [isinstance(off, (int, float)) and math.isfinite(off) for off in residuals.values()]
        ):
            raise ObservationError(f"residuals={residuals!r}: expected finite numbers by (object, property)")
        return self._precision(precision)

    def _check_step(self, transition: Transition) -> None:
        self._parts.check(transition.before)
        self._parts.check(transition.after)
        if self.frozen:
            raise ModelFileError(
                "this model was loaded without its history and can only predict; "
                "save it with save(path, history=True) to go on learning"
            )
        check_size(self._parts, transition.before.layout)

    def _learn(
        self,
        transition: Transition,
        told: ScenePrediction | None = None,
        confirmed: Mapping[tuple[str, str], Confirmed] = NOTHING,
    ) -> LearnReport:
        before = transition.before
        following = next_values(before, transition.after)
        if not self._parts.screen.admits(before.layout, before.vector, following):
            return LearnReport({}, 0, set_aside=True)
        if large(before.layout):
            report = learn_locally(self._parts, self._near(before), transition, self.seen, told, confirmed)
        else:
            report = learn(self._parts, self._perceive(before), transition, None, told, confirmed)
        self._parts.arrival = Arrival(transition.after.layout, transition.after.vector)
        self.seen += 1
        return report

    @property
    def set_aside(self) -> int:
        """Number of transitions that held a gross error and weren't learned from."""
        return self._parts.screen.set_aside

    def fit(
        self,
        observations: Any,
        actions: Any = None,
        next_observations: Any = None,
        *,
        terminations: Any = None,
        truncations: Any = None,
        precision: float | None = None,
    ) -> Self:
        """Learn from many transitions, in their order, as if they came one by one.

        Each is predicted before it is learned from, as `relgym.wrappers.ModelLearner` does, so the model is the same
        to the last byte. It goes on from what it knows; `untaught` gives a model that has learned nothing.
        `relgym.fit` takes what an env showed: flat observations, episodes, Minari data sets.

        Parameters
        ----------
        observations
            Transitions (or records with a ``transition``, as `relgym.wrappers.sb3.TransitionRecorder` keeps them), and
            nothing else; or the scenes before each step, as arrays in units of the properties:
            ``{object name: shape (n, properties)}``, or all objects' properties side by side, in the order of the
            schema, shape ``(n, width)``.
        actions
            Properties of the action object in physical units, shape ``(n, properties)``.
        next_observations
            Scenes after each step, as `observations`. Default: row k + 1 follows row k, but where an episode ends.
        terminations, truncations
            Where episodes ended, shape ``(n,)``; of use without `next_observations`.
        precision
            Relative precision of the numbers: 0 for float64, 5e-7 for float32. Default: the schema's.

        Raises
        ------
        DataError
            Lengths that differ, other shapes or dtypes, NaN or infinity, nothing to learn from; the model is unchanged.
        ModelFileError
            The model was loaded without its history and can't go on learning.

        Examples
        --------
        >>> from relgym.scene.objects import ObjectType
        >>> from relgym.scene.schema import SceneSchema
        >>> schema = SceneSchema((ObjectType("ball", ("v",)),), (("b", "ball"),))
        >>> v = np.linspace(1.0, 9.0, 40)[:, None]
        >>> model = WorldModel(schema).fit(v, next_observations=0.5 * v)
        >>> model.modes("ball", "v")[0].formula()
        "v' = 0.5 v"
        >>> model.score(v + 0.1, next_observations=0.5 * (v + 0.1)).right
        1.0
        """
        for _ in self.progressive(
            observations,
            actions,
            next_observations,
            terminations=terminations,
            truncations=truncations,
            precision=precision,
        ):
            pass
        return self

    def progressive(
        self,
        observations: Any,
        actions: Any = None,
        next_observations: Any = None,
        *,
        terminations: Any = None,
        truncations: Any = None,
        precision: float | None = None,
        every: int = 1,
    ) -> Iterator[Progress]:
        """Learn as `fit` does, and report how each transition was predicted before it was learned from.

        As river's ``evaluate.iter_progressive_val_score``: what was measured was never seen before.

        Parameters
        ----------
        observations, actions, next_observations, terminations, truncations, precision
            As of `fit`.
        every
            A report after so many transitions, and one of what remains.
        """
        found = self._transitions(observations, actions, next_observations, terminations, truncations)
        return progressive(self, found, every=every, precision=self._precision(precision))

    def score(
        self,
        observations: Any,
        actions: Any = None,
        next_observations: Any = None,
        *,
        terminations: Any = None,
        truncations: Any = None,
        precision: float | None = None,
    ) -> Score:
        """How well it predicts transitions that it hasn't learned from: RMSE, R², share right, share abstained.

        Nothing is learned. Arguments as of `fit`; cost: as `predict_batch`.
        """
        found = self._transitions(observations, actions, next_observations, terminations, truncations)
        return scored(self, found, self._precision(precision))

    def _precision(self, given: float | None) -> float:
        if type(given) is float and 0.0 <= given < math.inf:
            return given
        value = (
            self.schema.precision if given is None else float(array_of("precision", given, (), ConfigError))
        )
        if value < 0.0:
            raise ConfigError(f"precision={given!r}: expected a finite number of at least 0")
        return value

    def _transitions(
        self, observations: Any, actions: Any, next_observations: Any, terminations: Any, truncations: Any
    ) -> list[Transition]:
        arrays = isinstance(observations, (np.ndarray, Mapping)) or any(
            given is not None for given in (actions, next_observations, terminations, truncations)
        )
        if not arrays:
            return as_transitions(observations, self._parts.check)
        return transitions_of(
            self.schema,
            observations,
            actions,
            next_observations,
            terminations=terminations,
            truncations=truncations,
        )

    @refusing(ObservationError)
    def look_back(
        self,
        prediction: ScenePrediction,
        residuals: Mapping[tuple[str, str], float],
        precision: float = 0.0,
    ) -> None:
        """Take note of how a prediction came out, before the step is learned from.

        A target whose predictions were too often wrong lately counts as `unexplained`, until they are right again
        (`relgym.model.target.hindsight`). A model that is never told counts as right where its modes cover the
        examples.

        Parameters
        ----------
        prediction
            What the model said.
        residuals
            Observed minus predicted value by (object, property), in units of the property; objects that vanished have
            none.
        precision
            Relative precision of what was observed (`View.precision`); of numbers below 1 it is absolute.
        """
        precision = self._told(prediction, residuals, precision)
        self._made("_look_back", prediction, dict(residuals), precision)

    def _look_back(
        self, prediction: ScenePrediction, residuals: Mapping[tuple[str, str], float], precision: float
    ) -> Retrospect:
        layout, expected = prediction.scene.layout, prediction.scene.vector
        places = layout.places
        came = [
            (places[key], part.value + off)
            for part in prediction.parts
            if (off := residuals.get(key := (part.object, part.property))) is not None
        ]
        if not self._parts.screen.plausible(layout, expected, came):
            return Retrospect({}, counted=False)
        return look_back(self._parts, prediction, residuals, precision)

    @refusing(ConfigError)
    def merge(self, other: WorldModel) -> None:
        """Take up all that another model of the same world remembers, as if this one had seen it too.

        Modes are united by function, clauses are learned again from both memories. Laws of motion are those of the
        model that saw more transitions.

        Raises
        ------
        ConfigError
            Another schema, configuration (but for the seed), or targets.
        ModelFileError
            One of the two was loaded without its history.
        """
        if self.frozen or other.frozen:
            raise ModelFileError(
                "a model that was loaded without its history can't be merged; keep history=True"
            )
        whole = copy.deepcopy(self._parts)  # what fails half way leaves this model as it was
        merge(whole, other._parts, follow_laws=other.seen > self.seen)
        seen = self.seen + other.seen
        finish(whole)
        self._programs.changed()
        self.__dict__.update(_state=whole, seen=seen, _percept=None, _neighbourhoods=None, _journal=Journal())

    def untaught(self) -> WorldModel:
        """A model of the same schema, configuration and named targets that has learned nothing."""
        named = None if self._parts.open else self.targets
        return WorldModel(self.schema, self.config, targets=named)

    def finish(self) -> int:
        """Re-learn every stale classifier and solve regressions now, without a budget; returns the work spent.

        A model without its history has nothing to learn from and stays as it is.
        """
        self._rules = self._advice = None
        if self.frozen:
            return 0
        work: int = self._made("_finish")
        return work

    def _finish(self) -> int:
        return finish(self._parts)

    @property
    def laws(self) -> LawBook | None:
        """Laws of motion learned so far, in force or not; None with ``frames="world"``."""
        return None if self._parts.laws is None else self._parts.laws.learner.book

    @property
    def governed(self) -> frozenset[str]:
        """Names of the types whose velocity laws of motion predict at present."""
        return frozenset() if self._parts.laws is None else self._parts.laws.governed

    @refusing(QueryError)
    def governs(self, target: Target) -> bool:
        """Whether laws of motion, not modes, predict a target: they describe its transitions in fewer bits."""
        return self._parts.governs(target)

    def _perceive(self, scene: Scene) -> Percept:
        """Relations of a scene; the last one's are remembered, since prediction comes before learning."""
        if self._percept is None or self._percept[0] is not scene:
            self._percept = (scene, self._parts.perception.percept(scene.layout, scene.vector[None]))
        return self._percept[1]

    @refusing(ObservationError)
    def predict_one(self, scene: Scene) -> ScenePrediction:
        """Predict the scene that follows (Figure 1.5, §3.6).

        Raises
        ------
        ObservationError
            NaN or infinity somewhere, or another schema.
        """
        if (found := self._run_one(scene)) is not None:
            return found
        self._parts.check(scene)
        check_size(self._parts, scene.layout)
        with self._calm(scene.vector):
            if large(scene.layout):
                ask = partial(self._programs.one, self._parts)
                return predict_locally(self._parts, self._near(scene), scene, ask)
            return predict(self._parts, self._perceive(scene), scene)

    def _run_one(self, scene: Scene) -> ScenePrediction | None:
        """What the compiled program says of a scene; None where there is none, or the scene can't be."""
        parts = self._parts
        if not parts.admits(scene) or large(scene.layout):
            return None
        return self._programs.one(parts, scene, self._perceive)

    def _run_many(self, layout: SceneLayout, vectors: NDArray[np.float64]) -> BatchPrediction | None:
        """The same of n scenes; None too for what isn't an array of such."""
        parts = self._parts
        if not parts.knows(layout) or large(layout) or not isinstance(vectors, np.ndarray):
            return None
        if vectors.ndim != 2 or vectors.shape[1] != layout.width or vectors.dtype != np.float64:
            return None
        runner = self._programs.of(parts, layout, len(vectors))
        found = None if runner is None else runner.many(np.ascontiguousarray(vectors))
        return found if found is None else self._resumed(layout, vectors, found)

    def _resumed(
        self, layout: SceneLayout, vectors: NDArray[np.float64], told: BatchPrediction
    ) -> BatchPrediction:
        """What a program says of n scenes, with what arrays say of those of which it doesn't know all."""
        rows = self._parts.resumed(layout, vectors)
        if len(rows):
            said = predict_many(
                self._parts, self._parts.perception.percept(layout, vectors[rows]), layout, vectors[rows]
            )
            for name in ("vectors", "modes", "outcomes", "margins", "probabilities", "intervals"):
                getattr(told, name)[rows] = getattr(said, name)
        return told

    def _near(self, scene: Scene) -> Neighbourhoods:
        """A large scene, taken apart; the last one is remembered."""
        if self._neighbourhoods is None or self._neighbourhoods[0] is not scene:
            self._neighbourhoods = (scene, Neighbourhoods(self._parts, scene))
        return self._neighbourhoods[1]

    def _calm(self, vectors: NDArray[np.float64]) -> AbstractContextManager[None]:
        """Where numbers are so large that what is worked out from them may overflow, that needs no warning."""
        largest = max(float(vectors.max(initial=0.0)), -float(vectors.min(initial=0.0)))
        return nullcontext() if largest < _OVERFLOWS else np.errstate(over="ignore", invalid="ignore")

    @refusing(ObservationError)
    def predict_batch(
        self, layout: SceneLayout, vectors: NDArray[np.float64], *, device: Literal["cpu", "cuda"] = "cpu"
    ) -> BatchPrediction:
        """Predict what follows n scenes with the same objects; bit for bit what `predict_one` gives.

        Parameters
        ----------
        layout
            The scenes' layout.
        vectors
            State vectors, shape ``(n, layout.width)``.
        device
            As for `rollout_batch`; a single step takes a card less time than to send it the scenes.

        Raises
        ------
        ConfigError
            As for `rollout_batch`.
        ObservationError
            The shape doesn't fit, or a number is NaN or infinite.
        """
        if _on_card(device):
            vectors = self._parts.checked_batch(layout, vectors)
            runner = self._runner(layout, len(vectors), on_card=True)
            told = None if runner is None else runner.many(vectors, on_card=True)
            if told is None:
                raise ConfigError(_TAKES_ARRAYS)
            return self._resumed(layout, vectors, told)
        if (found := self._run_many(layout, vectors)) is not None:
            return found
        vectors = self._parts.checked_batch(layout, vectors)
        check_size(self._parts, layout)
        with self._calm(vectors):
            if large(layout):
                near = [Neighbourhoods(self._parts, Scene(self.schema, layout, v.copy())) for v in vectors]
                return predict_many_locally(self._parts, near, layout, vectors)
            percept = self._parts.perception.percept(layout, vectors)
            return predict_many(self._parts, percept, layout, vectors)

    @refusing(ObservationError)
    def rollout(
        self, scene: Scene, steps: int, actions: Sequence[Sequence[float]] | NDArray[np.float64] | None = None
    ) -> list[ScenePrediction]:
        """Predict `steps` steps ahead, each from the last prediction; stops early where a mode fails.

        Parameters
        ----------
        scene
            Where to start.
        steps
            Number of steps, at least 1.
        actions
            Properties of the action object at each step (physical units), shape ``(steps, properties)``;
            default: those of `scene` throughout.

        Returns
        -------
        One prediction per step; the last one is not `ok` when the roll-out ended early.
        """
        checked_count("steps", steps, 1, MOST_STEPS)
        if actions is not None:
            given = np.asarray(actions, dtype=np.float64)
            width = len(scene.layout.types[scene.layout.index(ACTION)].properties)
            if given.ndim != 2 or len(given) < steps or given.shape[1] != width:
                raise ObservationError(f"actions: expected shape ({steps}, {width}), got {given.shape}")
        predictions: list[ScenePrediction] = []
        for k in range(steps):
            if actions is not None:
                scene = with_action(scene, actions[k])
            predictions.append(self.predict_one(scene))
            if not predictions[-1].ok:
                break
            scene = predictions[-1].scene
        return predictions

    @refusing(ObservationError)
    def rollout_batch(
        self,
        layout: SceneLayout,
        vectors: NDArray[np.float64],
        steps: int,
        actions: NDArray[np.float64] | None = None,
        *,
        device: Literal["cpu", "cuda"] = "cpu",
    ) -> BatchRollout:
        """Roll n scenes with the same objects out; each of them bit for bit where `rollout` comes to.

        Parameters
        ----------
        layout
            The scenes' layout.
        vectors
            State vectors, shape ``(n, layout.width)``.
        steps
            Number of steps, at least 1.
        actions
            Properties of the action object (physical units), shape ``(steps, n, properties)``; default: those of
            `vectors` throughout.
        device
            ``"cuda"``: a thread of an Nvidia card for each scene, which takes some ten seconds to compile the first
            time. Values agree with the processor's to 1e-12 where bodies are turned or sines are looked at, else to
            the bit.

        Raises
        ------
        ConfigError
            `device` is something else, there is no card, or this model has no program that a card could run.
        ObservationError
            Shapes don't fit, or a number is NaN or infinite.

        Notes
        -----
        Cost: *Running and exporting* has the figures (`docs/guides/running-and-exporting.md`).
        """
        checked_count("steps", steps, 1, MOST_STEPS)
        on_card = _on_card(device)
        vectors = self._parts.checked_batch(layout, vectors)
        taken, first = np.empty((steps, len(vectors), 0)), 0
        if actions is not None:
            where = layout.slice(layout.index(ACTION))
            first, wanted = where.start, (steps, len(vectors), where.stop - where.start)
            taken = np.ascontiguousarray(actions, dtype=np.float64)
            if taken.shape != wanted:
                raise ObservationError(f"actions: expected shape {wanted}, got {taken.shape}")
            if not np.isfinite(taken).all():
                raise ObservationError("actions: some are NaN or infinite")
        runner = self._runner(layout, steps * len(vectors), on_card=on_card)
        if on_card and runner is None:
            raise ConfigError(_TAKES_ARRAYS)
        if runner is not None and not self._parts.recalls:
            found = runner.roll(vectors, steps, taken, first, on_card=on_card)
            if found is not None:
                return found
            if on_card:
                raise ConfigError(_TAKES_ARRAYS)
        return step_by_step(partial(self.predict_batch, device=device), layout, vectors, taken, first)

    def _runner(self, layout: SceneLayout, scenes: int, *, on_card: bool) -> Runner | None:
        """What runs the program for a layout, of which so many scenes are asked; for a card whether it pays or not."""
        if large(layout):
            return None
        if on_card:
            KERNEL.load()
        return self._programs.of(self._parts, layout, scenes, at_once=on_card)

    @refusing(ConfigError)
    def describe(
        self,
        *,
        details: bool = False,
        digits: int = DIGITS,
        names: Mapping[str, str] | None = None,
        check: Iterable[Scene] | None = None,
        frame: str | None = None,
        incline: float | Sequence[float] = SURFACES,
    ) -> str:
        """The model as text: a list of ``if / elif / else`` branches for each property, or laws of motion.

        The text says all that the model says: `relgym.reporting.parser.parse_rules` reads it back.

        Parameters
        ----------
        details
            The tables behind it instead: modes by number, the clauses that tell each pair of them apart, roles (the
            thesis' tables 3.1-3.2, 4.2-4.5).
        digits
            Significant digits of coefficients.
        names
            Other names for conditions, for this text only; `name_condition` keeps them.
        check
            Scenes to compare the printed text's predictions with `predict_one`'s on; how often both say the same is
            printed with the rules.
        frame, incline
            With ``"world"`` also what the laws in force give along the world's axes on surfaces with some inclines, in
            degrees (`relgym.model.reports.report.describe`).

        Raises
        ------
        ConfigError
            Another frame, or a name that can't be one.
        """
        from relgym.model.reports.report import describe

        digits = whole("digits", digits, 1, ALL_DIGITS + 1, ConfigError)
        return describe(
            self, details=details, digits=digits, names=names, check=check, frame=frame, incline=incline
        )

    @refusing(ConfigError)
    def to_python(self, layout: SceneLayout | None = None) -> str:
        """The model as the text of a Python module that needs numpy alone, for scenes with certain objects.

        Its ``step(vector)`` predicts one scene, ``predict(vectors)`` many: next state vectors, outcomes (by the order
        of `Outcome`), modes, margins, probabilities and intervals, as `predict_batch` does. Every mode, law, choice
        between two modes and description of a role is a function of its own. Only the mode that held last, which the
        model asks of the scene that follows the latest transition, isn't asked.

        Parameters
        ----------
        layout
            The scenes' layout; default: all objects of the schema.

        Raises
        ------
        ConfigError
            There is no program for the model: it has laws of motion in space, bodies there that are turned, functions
            that a user registered, or roles that several objects without a body could play.
        """
        layout = self.schema.layout() if layout is None else layout
        try:
            program = trusting(self._parts, layout, lowered(self._parts, layout))
            sentences = tuple(outcome.value for outcome in Outcome)
            return python_source(program, self.describe() if self.has_rules else repr(self), sentences)
        except BeyondError as beyond:
            raise ConfigError(
                f"this model can't be written as Python, since it holds {beyond}; predict_batch runs it"
            ) from None

    @property
    def has_rules(self) -> bool:
        """Whether there are rules: not of a model from a file of version 1 that was saved without its history."""
        return not self.frozen or self._stored is not None

    def rules(self) -> RuleList:
        """The model as a rule list: what `describe` prints, for programs.

        Cost: some 10 ms for each property with several modes, up to seconds where there are ten; kept until the model
        learns on.
        """
        if self.frozen:
            if self._stored is None:  # see `has_rules`
                raise ModelFileError(
                    "this model was loaded without its history, from a file that holds no rules; "
                    "save it again where it was learned"
                )
            return doubted(self._stored[0], self._parts.models.values()).renamed(self.condition_names)
        state = tuple((m.undecided, m.unexplained, m.calibration.trials) for m in self._parts.models.values())
        if self._rules is None or self._rules[0] != (self.seen, state):
            self._rules = (self.seen, state), rule_list(self)
        return self._rules[1].renamed(self.condition_names)

    def name_condition(self, condition: str, name: str) -> None:
        """Call a condition by a name of your own, in rules and explanations; the model's file keeps it.

        Parameters
        ----------
        condition
            Its present name (``"drifting"``, or ``"ball.vy: drifting"`` where several properties have one of that
            name), or its text as printed.
        name
            Words of letters, digits and hyphens.

        Raises
        ------
        ConfigError
            No condition is called so, or several; or the name can't be one.
        """
        rules = self.rules()
        text = named_text(rules, condition)
        rules.renamed({text: name})  # refuses what can't be a name
        self.condition_names = self.condition_names | {text: name}

    def layouts_seen(self) -> Iterator[tuple[ObjectType, ...]]:
        """Types of the objects of each kind of scene that it remembers having learned from."""
        for table in self._parts.tables.values():
            for signature in table.signatures:
                yield signature.types

    @refusing(QueryError)
    def law_lines(self, scene: Scene, index: int, digits: int = DIGITS) -> tuple[str, ...]:
        """What laws of motion say of an object: its free law, then every contact, a line each."""
        index = whole("index", index, 0, len(scene), QueryError)
        digits = whole("digits", digits, 1, ALL_DIGITS + 1, ConfigError)
        laws = self._parts.laws
        if large(scene.layout):
            small = self._near(scene).named(index)
            scene, index = small, small.layout.index(scene.layout.names[index])
        return () if laws is None else laws.lines(self._perceive(scene), index, digits)

    def advice(self) -> tuple[Advice, ...]:
        """What isn't explained, target by target, and which features would explain it (`ModelConfig.features`).

        A model that was loaded without its history knows what was known when it was saved.

        Cost: up to a second for each such target; kept until the model learns on.
        """
        models = self._parts.models.values()
        state = self.seen, tuple((m.undecided, m.hindsight.wrong, m.hindsight.spoken) for m in models)
        if self._advice is None or self._advice[0] != state:
            self._advice = state, advices(self._parts)
        found = self._advice[1]
        if self._stored is None:
            return found
        # Hindsight goes on without the history; what features would do is known from when there was one.
        known, now = {a.target: a for a in self._stored[1]}, {a.target: a for a in found}
        for target, advice in list(known.items()):
            if target in now:
                known[target] = replace(advice, wrong=now[target].wrong, spoken=now[target].spoken)
            elif advice.spoken:
                del known[target]
        known = now | known
        return tuple(known[str(t)] for t in self.targets if str(t) in known)

    def advised_features(self) -> tuple[str, ...]:
        """`ModelConfig.features` of a model that follows `advice`: what is on, and what is advised behind it.

        Each advice is for one target; together they may ask for more columns than there may be. What most targets need
        goes first then, and what doesn't fit is left out. Cost: that of `advice`.
        """
        return together(self._parts, self.advice())

    @refusing(ObservationError)
    def explain(self, scene: Scene) -> str:
        """Why this prediction: mode, function, roles, clause and runner-up of every target."""
        from relgym.model.reports.explain import explain

        with self._calm(scene.vector):
            if large(scene.layout):
                near = self._near(scene)
                return "\n\n".join(explain(self, near.named(k)) for k in foci(self._parts, scene.layout))
            return explain(self, scene)

    @refusing(ObservationError)
    def percept(self, scene: Scene) -> Percept:
        """What the learners see of a scene."""
        return self._perceive(scene)

    @refusing(QueryError)
    def situation(self, scene: Scene, index: int) -> Situation:
        """How the object with this index is situated in a scene."""
        return self._perceive(scene).situation(whole("index", index, 0, len(scene), QueryError))

    @refusing(ConfigError)
    def save(
        self, path: str | os.PathLike[str], *, history: bool = False, extra: dict[str, Any] | None = None
    ) -> None:
        """Write the model to one file, atomically.

        Parameters
        ----------
        path
            Where to write.
        history
            Whether to keep what further learning needs; without it the loaded model can only predict. What is put off
            while it learns is done for the file first, as by `finish`: values that aren't claimed may be better there.
        extra
            Plain data of the caller's; default: the attribute `extra`, where a learner around an env keeps its spaces.
        """
        if not history:
            finished = copy.deepcopy(self)  # saving must not change what is learned from here on
            finished.finish()
            body = finished._body(history=False, extra=extra)
            write_model(path, body | {"report": finished._report()}, None)
            return
        if self.frozen:
            raise ModelFileError(
                "this model was loaded without its history: save it with history=False, or load it from a file "
                "that was saved with history=True"
            )
        write_model(path, self._body(history=True, extra=extra), parts_to_arrays(self._parts))

    def _body(self, *, history: bool, extra: dict[str, Any] | None) -> dict[str, Any]:
        """All that a file says. What is known in hindsight stands apart: it is not learned from transitions."""
        body = self.to_json(history=history) | {"extra": self.extra if extra is None else extra}
        known = hindsight_to_json(self._parts)
        body |= {"names": self.condition_names} if self.condition_names else {}
        body |= {"hindsight": known} if known else {}
        stated = calibration_to_json(self._parts)
        return body | {"calibration": stated} if stated else body

    def _report(self) -> dict[str, Any]:
        """What can't be told without the history: rules, as text, and advice."""
        if self.frozen and self._stored is None:
            return {}
        return {
            "rules": self.rules().text(ALL_DIGITS),
            "advice": [asdict(advice) for advice in self.advice()],
        }

    def _restore_report(self, data: Mapping[str, Any]) -> None:
        if data:
            advice = tuple(map(Advice.from_json, data.get("advice", ())))
            rules = of_laws(self, parse_rules(data.get("rules", "")))
            told, spoken = (
                [part.target for part in rules.properties],
                [str(target) for target in self.targets if not self.governs(target)],
            )
            if told != spoken:
                raise ModelFileError(
                    f"report.rules: expected rules of {spoken}, got {told}; save the model again"
                )
            self._stored = rules, advice

    @refusing(ConfigError)
    def to_json(self, *, history: bool = False) -> dict[str, Any]:
        """Plain data: schema, config and everything learned."""
        return parts_to_json(self._parts, history=history) | {"seen": self.seen}

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, limits: FileLimits | None = None) -> WorldModel:
        """Read a model file.

        Parameters
        ----------
        path
            The file.
        limits
            How much it may ask for before it is refused; default: those of `FileLimits`. A file is read within them,
            whoever made it.

        Raises
        ------
        ModelFileError
            Truncated, edited, foreign, of another version, too large, or inconsistent.
        """
        return cls.load_with_extra(path, limits=limits)[0]

    @classmethod
    @refusing(ConfigError)
    def load_with_extra(
        cls, path: str | os.PathLike[str], *, limits: FileLimits | None = None
    ) -> tuple[WorldModel, dict[str, Any]]:
        """Read a model file and the caller's data in it; arguments as of `load`."""
        body, arrays = read_model(path, limits)
        try:
            model = cls._restored(body, arrays)
        except ModelFileError as error:
            raise ModelFileError(f"{path}: {error}") from None
        return model, model.extra

    @classmethod
    def _restored(cls, body: dict[str, Any], arrays: Mapping[str, NDArray[Any]] | None) -> WorldModel:
        """The model that a file's body and history stand for; `ModelFileError` unless all of it fits together."""
        try:
            parts, data = parts_from_json(body, arrays)
            restore_hindsight(parts, data.get("hindsight", {}))
            restore_calibration(parts, data.get("calibration", {}))
            model = cls(parts.schema, parts.config, targets=())
            model._state, model.seen, model.frozen = parts, data["seen"], arrays is None
            model.extra, model.condition_names = data["extra"], dict(data.get("names", {}))
            model._restore_report(data.get("report", {}))
        except RelgymError as error:
            raise error if isinstance(error, ModelFileError) else ModelFileError(str(error)) from None
        return model


def _on_card(device: Any) -> bool:
    """Whether a graphics card is asked."""
    if device not in ("cpu", "cuda"):
        raise ConfigError(f"device={device!r}: expected 'cpu' or 'cuda'")
    return bool(device == "cuda")
