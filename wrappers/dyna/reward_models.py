"""Reward models: reward and termination of imagined steps, learned from real ones or predicted by a neural model."""

from __future__ import annotations

import os
from collections import Counter, deque
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.mode import Mode
from relgym.config import ClusteringConfig, ModelConfig
from relgym.envs.tasks import RewardFunctions, TaskOutcome
from relgym.errors import ConfigError, ModelFileError, RelgymError
from relgym.files.reading import FileLimits
from relgym.files.records import checked
from relgym.model.files.storage import schema_from_json, schema_to_json
from relgym.model.percepts.scenes import mismatch
from relgym.model.predicting.prediction import BatchPrediction
from relgym.model.world_model import WorldModel
from relgym.scene.objects import (
    ACTION,
    STILL,
    TASK,
    Float1D,
    Float2D,
    ObjectType,
    SceneLayout,
    Target,
    Transition,
)
from relgym.scene.schema import SceneSchema
from relgym.wrappers.dyna.acting import acting_all
from relgym.wrappers.dyna.file_format import RewardModelBody

__all__ = ["Acting", "LearnedRewardModel", "NeuralModel", "NeuralRewardModel", "RewardModel", "check_rewards"]

Acting: TypeAlias = Callable[[SceneLayout, Float2D, Any], tuple[SceneLayout, NDArray[np.float64]]]
"""From layout, state vectors and actions of the bare env to layout and state vectors with the actions in them."""

_NOW, _NEXT = "now", "next"
_TOLD: Final = ("reward", "terminated")
_FILE: Final = "learned_task"  # under this name the rest of a reward model stands in a model's file
_RIGHT: Final = 1e-6  # how far a right verdict may be off

_EXACT: Final = ModelConfig(
    frames="world",
    clustering=ClusteringConfig(min_examples=4),
)
"""What a task says is free of noise, and success is rare at first: four examples found a mode."""

_REMEMBERED: Final = 500
"""It is looked up which modes were right together: of so many of the latest real steps, of as many of those before, and
of so many that ended an episode. What is paid for in one place may not be seen again for many episodes, and ends that
pay come once in a thousand steps at first: neither must be forgotten in between."""

_REVIEW: Final = 10
"""Real steps between two such reviews while the modes stay the same ones: a review costs some milliseconds."""


class RewardModel(Protocol):
    """Reward and termination of n steps; a `relgym.envs.tasks.Task` is one.

    A reward model with ``learned = True`` gives NaN where it has not learned the reward; from any other, NaN is an
    error.
    """

    def evaluate(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> TaskOutcome:
        """Evaluate n steps; scenes without actions, actions in the units of the bare env's space."""


def check_rewards(rewards: NDArray[np.float64], reward_model: RewardModel) -> None:
    """Raise `ConfigError` unless all rewards that a reward model gave are finite."""
    if not np.isfinite(rewards).all():
        bad = rewards[~np.isfinite(rewards)][0]
        raise ConfigError(
            f"{type(reward_model).__name__} gave a reward of {bad}: expected finite numbers; fix the reward function"
        )


class LearnedRewardModel(RewardFunctions):
    """Learns reward and termination as properties of the bodiless object `task`, with modes and clauses.

    They are functions of the scene, the action and the next scene. So its model has a schema of its own, without
    bodies: of all objects that are the only one of their type an object ``now`` with the properties that change, an
    object ``next`` with the same one step on, and an object ``still`` with the others; the action, and the task.

    Parameters
    ----------
    schema
        The scenes' schema.
    changing
        (type, property) pairs that change.
    config
        Parameters of the model; laws of motion don't apply.
    acting
        Puts actions into scenes; default: as the env of `Dyna` or `explore` does, else by the schema's affine maps.

    Attributes
    ----------
    model : WorldModel
        What was learned: ``print(reward_model.model.describe())``.

    Notes
    -----
    A reward that depends on one among several objects of a type can't be learned.

    It evaluates steps as an env's task does, so `LearnedModelEnv` takes it as its ``task``. Where nothing is known,
    rewards are NaN.

    The reward may depend on whether the step ends the episode, as a bonus for success does: it is learned given that.

    Policies exploit errors of a reward model. The thresholds learned for a bonus and for termination differ slightly:
    in between, the bonus would be paid without an end, again and again. So where a mode of the reward and one of
    termination were never right of the same real step, the reward is NaN.
    """

    learned: Final = True

    def __init__(
        self,
        schema: SceneSchema,
        changing: set[tuple[str, str]],
        config: ModelConfig | None = None,
        *,
        acting: Acting | None = None,
    ) -> None:
        self.schema = schema
        self._changing = frozenset(changing)
        self._acting = acting
        counts = Counter(name for _, name in schema.objects)
        single = [
            (name, schema.type(t)) for name, t in schema.objects if counts[t] == 1 and t not in (ACTION, TASK)
        ]
        self._every = [(name, t.name, prop) for name, t in single for prop in t.properties]
        self._divide(apart=True)
        self._action = schema.type(ACTION).properties if ACTION in schema.order else ()
        self.model = WorldModel(self._small_schema(), config or _EXACT)
        self._ends, self._latest = deque[Float1D](maxlen=_REMEMBERED), deque[Float1D]()
        self._earlier: list[Float1D] = []
        self._passed = 0
        self._rng = np.random.default_rng(0)
        self._claimants: tuple[int, tuple[Mode, ...], list[list[tuple[int, float]]]] | None = None
        self._places: tuple[SceneLayout, NDArray[np.intp]] | None = None
        self._together: set[tuple[int, int]] = set()
        self._reviewed: tuple[int, tuple[int, ...]] = (0, ())

    def _divide(self, *, apart: bool) -> None:
        """Which properties the objects of its schema hold; not `apart`, as in earlier files, ``now`` holds them all."""
        moving = [(name, prop) for name, kind, prop in self._every if (kind, prop) in self._changing]
        others = [(name, prop) for name, kind, prop in self._every if (kind, prop) not in self._changing]
        every = [(name, prop) for name, _, prop in self._every]
        self._held = {_NOW: moving if apart else every, _NEXT: moving, STILL: others if apart else []}

    def adopt(self, acting: Acting) -> None:
        """Put actions into scenes as an env does, unless that was said at construction."""
        self._acting = self._acting or acting

    def untaught(self) -> LearnedRewardModel:
        """A reward model of the same scenes and parameters that has learned nothing."""
        return LearnedRewardModel(self.schema, set(self._changing), self.model.config, acting=self._acting)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the reward model to one file, atomically, with all that further learning needs; `load` reads it.

        The file is that of `model`, which `relgym.WorldModel.load` reads, with the rest beside it.
        """
        remembered = {"ends": self._ends, "latest": self._latest, "earlier": self._earlier}
        data: dict[str, Any] = {name: [v.tolist() for v in part] for name, part in remembered.items()}
        data |= {
            "schema": schema_to_json(self.schema),
            "changing": sorted(map(list, self._changing)),
            "passed": self._passed,
            "rng": self._rng.bit_generator.state,
            "together": sorted(map(list, self._together)),
            "reviewed": self._reviewed,
        }
        self.model.save(path, history=True, extra={**self.model.extra, _FILE: data})

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        *,
        acting: Acting | None = None,
        limits: FileLimits | None = None,
    ) -> LearnedRewardModel:
        """Read what `save` wrote; evaluating and learning go on as if it had never been saved.

        Parameters
        ----------
        path
            The file.
        acting
            As of the class: functions aren't part of the file.
        limits
            How much the file may ask for; default: those of `FileLimits`.

        Raises
        ------
        ModelFileError
            Not the file of a reward model, a damaged one, or one of another version.
        """
        model, extra = WorldModel.load_with_extra(path, limits=limits)
        if _FILE not in extra:
            raise ModelFileError(
                f"{path} holds a model but no learned task: expected what LearnedRewardModel.save wrote"
            )
        try:
            reward_model = cls._restored(
                checked(extra[_FILE], RewardModelBody, "the learned task"), extra[_FILE], model
            )
        except RelgymError as error:
            raise ModelFileError(f"{path}: {error}") from None
        reward_model._acting = acting
        model.extra = {name: part for name, part in extra.items() if name != _FILE}
        return reward_model

    @classmethod
    def _restored(
        cls, body: RewardModelBody, data: Mapping[str, Any], model: WorldModel
    ) -> LearnedRewardModel:
        """What a file holds of it, taken over once all of it is known to fit together."""
        schema = schema_from_json(data["schema"])
        for name, prop in body.changing:
            if prop not in schema.type(name).properties:
                raise ModelFileError(f"type {name!r} has no property {prop!r} that could change")
        reward_model = cls(schema, set(body.changing))
        if STILL not in model.schema.order:
            reward_model._divide(apart=False)
            reward_model.model = WorldModel(reward_model._small_schema())
        if (difference := mismatch(reward_model.model.schema, model.schema)) or model.frozen:
            raise ModelFileError(f"its model is of another world: {difference or 'it has no history'}")
        width = model.schema.layout().width
        if model.schema.layout() != reward_model.model.schema.layout() or set(model.targets) != set(
            reward_model.model.targets
        ):
            raise ModelFileError("its model is of another world: other objects or targets")
        for each in (*body.ends, *body.latest, *body.earlier):
            if len(each) != width:
                raise ModelFileError(f"a remembered step has {len(each)} numbers, expected {width}")
        reward_model._ends.extend(map(np.array, body.ends))
        reward_model._latest.extend(map(np.array, body.latest))
        reward_model._earlier.extend(map(np.array, body.earlier))
        reward_model._passed, reward_model._rng.bit_generator.state = body.passed, data["rng"]
        reward_model._together, reward_model._reviewed = (
            set(body.together),
            (body.reviewed[0], tuple(body.reviewed[1])),
        )
        reward_model.model = model
        return reward_model

    def _small_schema(self) -> SceneSchema:
        kinds = {name: self.schema.type(t) for name, t in self.schema.objects}

        def named(pairs: list[tuple[str, str]]) -> tuple[str, ...]:
            return tuple(f"{name}_{prop}" for name, prop in pairs)

        def flags(pairs: list[tuple[str, str]]) -> tuple[str, ...]:
            return named([(name, prop) for name, prop in pairs if prop in kinds[name].flags])

        parts = {
            **{name: (named(pairs), flags(pairs)) for name, pairs in self._held.items()},
            ACTION: (self._action, self.schema.type(ACTION).flags if self._action else ()),
        }
        types = [ObjectType(name, own, flags=known) for name, (own, known) in parts.items() if own]
        types.append(ObjectType(TASK, _TOLD))
        # Whether a step ends an episode is what it is most often paid for.
        ended = Target(TASK, "terminated")
        targets = (ended, Target(TASK, "reward", given=((TASK, "terminated"),)))
        return SceneSchema(tuple(types), tuple((t.name, t.name) for t in types), targets=targets)

    @property
    def verdicts(self) -> int:
        """How many modes of reward and termination are known."""
        return sum(len(self.model.modes(TASK, prop)) for prop in _TOLD)

    def learn_step(self, transition: Transition, reward: float, *, terminated: bool) -> None:
        """Learn the reward and the end of a real step."""
        before, after = transition.before, transition.after
        values: dict[str, list[float]] = {
            part: [(after if part == _NEXT else before)[name][prop] for name, prop in pairs]
            for part, pairs in self._held.items()
        }
        if self._action:
            values[ACTION] = before[ACTION].values.tolist()
        values = {name: part for name, part in values.items() if part}
        small = self.model.schema.scene({**values, TASK: [0.0, 0.0]})
        said = {(TASK, "reward"): float(reward), (TASK, "terminated"): float(terminated)}
        self.model.learn_one(Transition(small, small.replace(said)))
        self._remember(small.replace(said).vector, ended=terminated)

    def _remember(self, lesson: Float1D, *, ended: bool) -> None:
        """Keep the latest; of those before, each is as likely to be kept as any other (Vitter 1985)."""
        if ended:
            self._ends.append(lesson)
            self._reviewed = (0, ())  # which modes are right of ends is what changes most with one more
            return
        self._latest.append(lesson)
        if len(self._latest) <= _REMEMBERED:
            return
        oldest = self._latest.popleft()
        self._passed += 1
        place = int(self._rng.integers(self._passed))
        if len(self._earlier) < _REMEMBERED:
            self._earlier.append(oldest)
        elif place < _REMEMBERED:
            self._earlier[place] = oldest

    def evaluate(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> TaskOutcome:
        """Rewards and ends as modes predict them; NaN where none does."""
        rewards, ended, _ = self.outcomes(self.joined(layout, before, actions, after))
        return TaskOutcome(rewards, ended, np.zeros(len(before), dtype=bool))

    def joined(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> Float2D:
        """State vectors of its own model, of n steps: what `outcomes` takes."""
        parts = [before, after, np.zeros((len(before), 1))]
        if self._action:
            acting = self._acting or partial(acting_all, self.schema)
            whole, joined = acting(layout, before, actions)
            parts.append(joined[:, whole.slice(whole.index(ACTION))])
        vectors: Float2D = np.concatenate(parts, axis=1).take(self._columns(layout), axis=1)
        return vectors

    def outcomes(self, vectors: Float2D) -> tuple[Float1D, NDArray[np.bool_], NDArray[np.int64]]:
        """Rewards, ends, and by which modes of reward and of termination; of n steps.

        Parameters
        ----------
        vectors
            As `joined` makes them, shape ``(n, width)``; what they say of the task doesn't count.

        Returns
        -------
        Shapes ``(n,)``, ``(n,)`` and ``(n, 2)``; rewards are NaN where nothing is known.
        """
        small = self.model.schema.layout()
        found = self.model.predict_batch(small, self.unsaid(vectors))
        pairs = _pairs(found)
        known = found.ok & self._ever_together(pairs)
        reward, ended = (found.vectors[:, column] for column in self._told_columns())
        return np.where(known, reward, np.nan), (ended > 0.5) & known, pairs

    def claims(self, vectors: Float2D, ended: NDArray[np.bool_]) -> tuple[tuple[Mode, ...], Float2D]:
        """What each mode of the reward says of n steps, whether it holds there or not.

        Parameters
        ----------
        vectors
            As for `outcomes`.
        ended
            Whether the step ends the episode, shape ``(n,)``.

        Returns
        -------
        The modes, and what they say, shape ``(n, modes)``.
        """
        if self._claimants is None or self._claimants[0] != self.model.seen:
            small, modes = self.model.schema.layout(), tuple(self.model.modes(TASK, "reward"))
            # Of its own targets, with a prime, a reward knows whether the step ends the episode.
            terms = [
                [
                    (
                        -1 if prop.endswith("'") else small.column(small.index(role.type), prop),
                        weight,
                    )
                    for role in mode.roles
                    for prop, weight in role.terms
                ]
                for mode in modes
            ]
            self._claimants = self.model.seen, modes, terms
        _, modes, terms = self._claimants
        said = np.empty((len(vectors), len(modes)))
        for k, mode in enumerate(modes):
            said[:, k] = mode.intercept
            for column, weight in terms[k]:
                said[:, k] += weight * (ended if column < 0 else vectors[:, column])
        return modes, said

    def lessons(self) -> Float2D:
        """The real steps that it remembers, as `joined` makes them, with their rewards and ends; ``(n, width)``."""
        known = [*self._ends, *self._latest, *self._earlier]
        return np.stack(known) if known else np.zeros((0, self.model.schema.layout().width))

    def said(self, lessons: Float2D) -> tuple[Float1D, NDArray[np.bool_]]:
        """Rewards and ends of `lessons`."""
        reward, ended = (lessons[:, column] for column in self._told_columns())
        return reward, ended > 0.5

    def unsaid(self, lessons: Float2D) -> Float2D:
        """`lessons` without their rewards and ends, as `joined` makes them."""
        asked = lessons.copy()
        asked[:, self._told_columns()] = 0.0
        return asked

    def _told_columns(self) -> list[int]:
        small = self.model.schema.layout()
        return [small.column(small.index(TASK), prop) for prop in _TOLD]

    def _ever_together(self, pairs: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which modes of reward and termination were right of one and the same real step; shape ``(n,)``."""
        seen, modes = self._reviewed
        # Their ids alone: how many examples each has would be counted anew for every batch.
        learners = [self.model.property_model(TASK, prop).clusterer for prop in _TOLD]
        now = tuple(number for learner in learners for number in sorted(learner.clusters))
        if self.model.seen >= seen + _REVIEW or now != modes:
            self._reviewed, self._together = (self.model.seen, now), self._right_together()
        together = np.zeros(len(pairs), dtype=np.bool_)
        for reward, ended in self._together:
            together |= (pairs[:, 0] == reward) & (pairs[:, 1] == ended)
        return together

    def _right_together(self) -> set[tuple[int, int]]:
        """Modes of reward and termination that are right of some remembered step."""
        said = self.lessons()
        if not len(said):
            return set()
        columns = self._told_columns()
        found = self.model.predict_batch(self.model.schema.layout(), self.unsaid(said))
        right = found.ok & (np.abs(found.vectors - said)[:, columns] <= _RIGHT).all(axis=1)
        return set(map(tuple, _pairs(found)[right].tolist()))

    def _columns(self, layout: SceneLayout) -> NDArray[np.intp]:
        """Where the numbers of its own scenes lie among those of a step: before, after, a zero, and the action."""
        if self._places is None or self._places[0] is not layout:
            zero = 2 * layout.width
            found: list[int] = []
            for name in self.model.schema.layout().names:
                if name == TASK:
                    found += [zero] * len(_TOLD)
                elif name == ACTION:
                    found += range(zero + 1, zero + 1 + len(self._action))
                else:
                    first = layout.width if name == _NEXT else 0
                    found += [first + layout.column(layout.index(o), prop) for o, prop in self._held[name]]
            self._places = layout, np.array(found, dtype=np.intp)
        return self._places[1]


def _pairs(found: BatchPrediction) -> NDArray[np.int64]:
    """The modes of reward and termination, scene by scene, shape ``(n, 2)``."""
    return found.modes[:, [found.parts.index((TASK, prop)) for prop in _TOLD]]


class NeuralModel(Protocol):
    """A model that predicts rewards and ends beside scenes, such as `relgym.baselines.NeuralWorldModel`."""

    schema: SceneSchema

    def predict_rewards(
        self, layout: SceneLayout, vectors: Float2D
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Rewards and ends of n scenes with actions in them."""


class NeuralRewardModel:
    """A model that predicts rewards and ends itself, as a reward model.

    Parameters
    ----------
    model
        The model; it learns the task together with the scenes.
    acting
        Puts actions into scenes; default: as of `LearnedRewardModel`.
    """

    learned: Final = True

    def __init__(self, model: NeuralModel, *, acting: Acting | None = None) -> None:
        self.model = model
        self._acting = acting

    def adopt(self, acting: Acting) -> None:
        """As of `LearnedRewardModel`."""
        self._acting = self._acting or acting

    def evaluate(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> TaskOutcome:
        """As the model predicts; the next scene isn't used."""
        acting = self._acting or partial(acting_all, self.model.schema)
        rewards, ended = self.model.predict_rewards(*acting(layout, before, actions))
        return TaskOutcome(rewards, ended, np.zeros(len(before), dtype=bool))
