"""Trains a model beside an agent: each real step is predicted, compared with what happened, and then learned from."""

from __future__ import annotations

import math
from time import perf_counter
from typing import Any, Literal, cast

import numpy as np

from relgym.envs.arguments import checked_least
from relgym.envs.dreams.setting import check_knowledge
from relgym.errors import ConfigError
from relgym.model.percepts.scenes import mismatch
from relgym.model.predicting.motion import possible_targets
from relgym.model.predicting.prediction import ScenePrediction
from relgym.model.predicting.prequential import Outcomes, Prequential, compared
from relgym.model.world_model import WorldModel
from relgym.scene.objects import TASK, Scene
from relgym.scene.schema import SceneSchema
from relgym.wrappers.dyna.acceptance import Key, ModelAcceptance, Verdict
from relgym.wrappers.dyna.config import DynaConfig, checked_config
from relgym.wrappers.dyna.lens import Lens
from relgym.wrappers.dyna.recorder import Experience
from relgym.wrappers.dyna.reward_models import (
    Acting,
    LearnedRewardModel,
    NeuralModel,
    NeuralRewardModel,
    RewardModel,
    check_rewards,
)
from relgym.wrappers.dyna.stock import DreamModel, SceneStock, changing

__all__ = ["ModelTrainer", "check_model", "checked_reward_model"]


class ModelTrainer:
    """Lets a model predict each real step, measures the error, and lets it learn: test, then train (Dawid 1984).

    A model that was accepted and then rejected may be one of a world that has changed: its old examples still count,
    and nothing in a scene tells old from new. So a replacement starts to learn the same steps from nothing, and
    whichever of the two is accepted first is used from then on (Gama et al. 2004 start anew at such a point).

    Parameters
    ----------
    model
        The model. A frozen one (``model.frozen``) is measured too, but neither learns nor is replaced. Replacing needs
        a method ``untaught``, such as `WorldModel.untaught`.
    reward_model
        Reward and termination; one that learns (`LearnedRewardModel`) learns from every step as it comes.
        ``"learned"``: as for `Dyna`.
    config
        Free parameters.
    precision
        Relative precision of what is observed (`relgym.envs.views.View.precision`): what is off by no more isn't wrong.

    Raises
    ------
    ConfigError
        `reward_model` isn't one; or when a step is taken up, the reward of one that doesn't learn is NaN or infinite.

    Attributes
    ----------
    stock : SceneStock
        Real scenes in which roll-outs begin.
    prequential : Prequential
        Errors of the predictions of real steps, by whichever model was at work.
    seconds : float
        Time spent on predicting and learning.
    renewals : int
        How often the model has been replaced.
    verdict : Verdict or None
        Of the last step: how far the prediction was off, that of reward and end included.
    wrong : tuple of (object, property)
        What the model said nothing or something wrong of in the last step.
    error : float
        How far values of the last step were off, guesses included, by how much such properties usually change: the
        largest ratio, at most 1. 1 where there was no value, or nothing is known to change.
    """

    def __init__(
        self,
        model: DreamModel,
        reward_model: RewardModel | Literal["learned"],
        config: DynaConfig | None = None,
        precision: float = 0.0,
    ) -> None:
        self._config = checked_config(config)
        self._precision = checked_least("precision", precision, 0.0)
        self._trainee = _Trainee(model, self._config, np.random.default_rng([self._config.seed, 1]))
        self._replacement: _Trainee | None = None
        self._replacements = 0
        self.reward_model = checked_reward_model(reward_model, model, model.schema)
        self.stock = SceneStock()
        self.prequential = Prequential(self._config.window)
        self.seconds = 0.0
        self.renewals = 0
        self.verdict: Verdict | None = None
        self.wrong: tuple[Key, ...] = ()
        self.error = 1.0

    @property
    def model(self) -> DreamModel:
        """The model in use: the one that was passed, until a replacement takes its place."""
        return self._trainee.model

    @property
    def acceptance(self) -> ModelAcceptance:
        """Whether the model is accepted."""
        return self._trainee.acceptance

    def take_up(self, real: Experience) -> None:
        """Predict a real step, compare, and learn from it or from an earlier one."""
        started = perf_counter()
        predicted = self.model.predict_one(real.transition.before)
        self.verdict = self._evaluated(self.model, predicted, real)
        self.acceptance.count(self.verdict)
        residuals, wrong = compared(predicted, real.transition.after, self._precision)
        self.wrong = wrong
        layout = real.transition.before.layout
        ratios = [
            self.acceptance.ratio((layout.types[layout.index(name)].name, prop), off)
            for (name, prop), off in residuals.items()
        ]
        self.error = max(ratios, default=1.0)
        self.prequential.count(residuals, wrong, Outcomes.of(predicted, real.transition.before, residuals))
        self.stock.add(real.start, first=real.first)
        replacement = self._challenge()
        if replacement is not None:
            said = replacement.model.predict_one(real.transition.before)
            replacement.acceptance.count(self._evaluated(replacement.model, said, real))
        if hasattr(self.reward_model, "learn_step"):
            # At once, not shuffled: rewards and ends are rare at first.
            self.reward_model.learn_step(real.transition, real.reward, terminated=real.terminated)
        self._trainee.learn(real)
        if replacement is not None:
            replacement.learn(real)
            if replacement.acceptance.accepted:
                self._trainee, self._replacement, self.renewals = replacement, None, self.renewals + 1
        self.seconds += perf_counter() - started

    def adopt(self, model: DreamModel) -> None:
        """Go on with another model of the same world, which has learned from all steps so far."""
        self._trainee.model, self._replacement = model, None
        self.renewals += 1

    def catch_up(self) -> None:
        """Learn from the transitions that are still waiting; there may be no more steps to mix them with."""
        started = perf_counter()
        self._trainee.catch_up()
        self.seconds += perf_counter() - started

    def _challenge(self) -> _Trainee | None:
        """The replacement of a model that was accepted and then rejected, if it has one."""
        patience, own = self._config.renew, self._trainee
        alone = isinstance(self.reward_model, NeuralRewardModel)  # which is the model itself
        if own.acceptance.accepted or not own.acceptance.switches or alone or not (patience and own.learns):
            self._replacement = None
        elif self._replacement is None or self._replacement.steps >= patience:
            untaught = getattr(own.model, "untaught", None)
            if untaught is None:
                return None
            self._replacements += 1
            rng = np.random.default_rng([self._config.seed, 4, self._replacements])
            self._replacement = _Trainee(untaught(), self._config, rng)
        return self._replacement

    def _evaluated(self, model: DreamModel, predicted: ScenePrediction, real: Experience) -> Verdict:
        before, after = real.start, real.transition.after
        changes: dict[Key, float] = {(TASK, "reward"): real.reward, (TASK, "terminated"): 1.0}
        residuals: dict[Key, float] = {}
        moving = changing(model)
        for o in before:
            if o.name not in after:
                continue
            for prop in o.type.properties:
                key, now = (o.type.name, prop), after[o.name][prop]
                # A property without a target is predicted to stay as it is.
                if key in moving or (now != o[prop] and prop not in o.type.exogenous):
                    _widen(changes, key, now - o[prop])
                    _widen(residuals, key, now - predicted.scene[o.name][prop])
        if predicted.ok:
            residuals |= self._task_residuals(real, predicted.scene)
        known = predicted.ok and all(map(math.isfinite, residuals.values()))
        return Verdict(residuals if known else {}, changes)

    def _task_residuals(self, real: Experience, predicted: Scene) -> dict[Key, float]:
        layout = real.start.layout
        following = np.concatenate([predicted[name].values for name in layout.names])
        evaluated = self.reward_model.evaluate(
            layout, real.start.vector[None], np.asarray(real.action)[None], following[None]
        )
        if not getattr(
            self.reward_model, "learned", False
        ):  # of one that learns NaN says that it doesn't know
            check_rewards(evaluated.rewards, self.reward_model)
        return {
            (TASK, "reward"): real.reward - float(evaluated.rewards[0]),
            (TASK, "terminated"): float(real.terminated) - float(evaluated.terminated[0]),
        }


class _Trainee:
    """A model, whether it is accepted, and the transitions that are still to be learned from."""

    def __init__(self, model: DreamModel, config: DynaConfig, rng: np.random.Generator) -> None:
        self.model = model
        self.acceptance = ModelAcceptance(
            accept_at=config.accept_at, reject_at=config.reject_at, window=config.window, least=config.least
        )
        self.learns = not getattr(model, "frozen", False)
        self.steps = 0
        self._waiting: list[Experience] = []
        self._shuffle, self._rng = config.shuffle, rng

    def learn(self, real: Experience) -> None:
        """Keep `shuffle` transitions waiting; for each new one learn from a random one of them."""
        self.steps += 1
        if not self.learns:
            return
        self._waiting.append(real)
        if len(self._waiting) > self._shuffle:
            chosen = int(self._rng.integers(len(self._waiting)))
            self._waiting[chosen], self._waiting[-1] = self._waiting[-1], self._waiting[chosen]
            self._teach(self._waiting.pop())

    def catch_up(self) -> None:
        """Learn from all that are waiting."""
        for k in self._rng.permutation(len(self._waiting)).tolist():
            self._teach(self._waiting[k])
        self._waiting.clear()

    def _teach(self, real: Experience) -> None:
        if hasattr(self.model, "learn_step"):  # the task as well
            self.model.learn_step(real.transition, real.reward, terminated=real.terminated)
        else:
            self.model.learn_one(real.transition)


def checked_reward_model(
    reward_model: Any, model: DreamModel, schema: SceneSchema, acting: Acting | None = None
) -> RewardModel:
    """The reward model that an argument stands for; ``"learned"`` makes one.

    Parameters
    ----------
    reward_model
        What the user passed.
    model
        The model whose roll-outs it is for.
    schema, acting
        Of the scenes, as `LearnedRewardModel` takes them.

    Raises
    ------
    ConfigError
        It has no method ``evaluate``.
    """
    if isinstance(reward_model, str) and reward_model == "learned":
        if hasattr(model, "predict_rewards"):
            return NeuralRewardModel(cast(NeuralModel, model), acting=acting)
        moving = changing(model)
        if schema.targets is None:  # anything may turn out to change
            moving |= {(t.type, t.property) for t in possible_targets(schema)}
        return LearnedRewardModel(schema, moving, acting=acting)
    if not callable(getattr(reward_model, "evaluate", None)):
        raise ConfigError(
            f"reward_model={reward_model!r}: expected 'learned', or an object with "
            "evaluate(layout, before, actions, after) for arrays of steps, as a relgym.envs.tasks.Task has"
        )
    if isinstance(reward_model, (LearnedRewardModel, NeuralRewardModel)) and acting is not None:
        reward_model.adopt(acting)
    found: RewardModel = reward_model
    return found


def check_model(model: Any, lens: Lens, *, at_once: bool = False) -> None:
    """Raise an error unless a model can predict the env's scenes.

    Parameters
    ----------
    model
        The model.
    lens
        What the agent sees and does.
    at_once
        Whether roll-outs begin before it has learned any more.

    Raises
    ------
    ConfigError
        It isn't a model, or one of other scenes.
    QueryError
        It knows none of its targets, and can't learn or is needed at once.
    """
    missing = [
        name for name in ("schema", "targets", "predict_one", "predict_batch") if not hasattr(model, name)
    ]
    if missing:
        raise ConfigError(f"{type(model).__name__} is no model to dream with: it lacks {missing}")
    schema = lens.recorder.view.schema
    if difference := mismatch(schema, model.schema):
        raise ConfigError(
            f"the model was made for other scenes than the env shows: {difference}; make it with the recorder's schema "
            "(env.get_wrapper_attr('view').schema)"
        )
    frozen = getattr(model, "frozen", False)
    if isinstance(model, WorldModel) and (frozen or at_once):
        check_knowledge(model)
    if frozen and not model.targets:
        raise ConfigError(
            "the model knows none of the targets and can't learn (it was loaded without its history): load one that "
            "has learned, or save with history=True"
        )


def _widen(found: dict[Key, float], key: Key, value: float) -> None:
    if abs(value) >= abs(found.get(key, 0.0)):
        found[key] = value
