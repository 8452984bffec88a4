"""What the Dyna experiments compare: courses, arms, and the agent that all arms share.

torch and Stable-Baselines3 belong to the extra ``sb3``; both are imported when an agent is made.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Literal

import gymnasium as gym

import relgym
from relgym.envs.flat import FlatSpec
from relgym.errors import ConfigError
from relgym.wrappers.action_repeat import ActionRepeat
from relgym.wrappers.dyna.config import DynaConfig
from relgym.wrappers.dyna.recorder import TransitionRecorder
from relgym.wrappers.flat import FlatView
from relgym.wrappers.truncated_episodes import TruncatedEpisodes

if TYPE_CHECKING:
    from relgym.baselines.neural_world import NeuralWorldModel
    from relgym.wrappers.sb3.dyna import Dyna

__all__ = [
    "AGENT",
    "ARMS",
    "COURSES",
    "WARM_UP",
    "Arm",
    "Change",
    "ChangingWorld",
    "Course",
    "make_agent",
    "make_dyna",
    "make_env",
    "nets_of",
]

WARM_UP: Final = 250
"""Random steps that every arm begins with."""

AGENT: Final[Mapping[str, Any]] = {
    "learning_rate": 1e-3,
    "batch_size": 256,
    "gamma": 0.99,
    "tau": 0.01,
    "learning_starts": WARM_UP,
    "policy_kwargs": {"net_arch": [64, 64], "optimizer_kwargs": {"fused": True}},  # a sixth faster
    "device": "cpu",
}
"""SAC's parameters, the same in all arms; the others are Stable-Baselines3's defaults."""


@dataclass(frozen=True)
class Course:
    """An env and how agents act in it.

    Attributes
    ----------
    name, title
        For files, and for people.
    env_id, arguments
        What `gymnasium.make` is asked for.
    mover
        Name of the object whose path is drawn.
    repeat
        Env steps that a decision lasts.
    horizon
        Decisions that an episode lasts at most.
    dreams
        How to dream there, where it isn't as by default: parameters of `DynaConfig`.
    agent
        Parameters of `AGENT` that differ here for agents that dream.
    truncate_after
        Decisions after which most real episodes are cut short for agents that dream (`TruncatedEpisodes`); 0: never.
    """

    name: str
    title: str
    env_id: str
    mover: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    repeat: int = 1
    horizon: int = 20
    dreams: Mapping[str, Any] = field(default_factory=dict)
    agent: Mapping[str, Any] = field(default_factory=dict)
    truncate_after: int = 0


@dataclass(frozen=True)
class Change:
    """How a world changes in mid-run.

    Attributes
    ----------
    after
        With the first episode that begins after so many env steps.
    arguments
        What the env is made with from then on, where it differs.
    """

    after: int
    arguments: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Arm:
    """A way to learn; the arms differ in nothing else.

    Attributes
    ----------
    name, title
        For files, and for people.
    model
        What is dreamed in.
    updates
        Gradient steps per real step; with a model, while it is accepted.
    catch_up
        Gradient steps at once when the model is first accepted.
    learned
        Whether reward and termination are learned too, or given.
    varied
        Whether objects of one type are exchanged and distances resampled: in dreams, or without a model in the
        replay buffer (objects only).
    doubted
        Whether the model's error must be small first (`ModelAcceptance`), or it is accepted as soon as it predicts, as
        in MBPO: nets that are never exact would hardly ever be accepted, and that arm would be SAC.
    """

    name: str
    title: str
    model: Literal["none", "neural", "relational"]
    updates: int = 1
    catch_up: int = 0
    learned: bool = False
    varied: bool = False
    doubted: bool = True

    @property
    def dreams(self) -> bool:
        """Whether agents train in a model too."""
        return self.model != "none"


_BALL_DREAMS: Final[Mapping[str, Any]] = {
    "horizon": 30,
    "dreams": 128,
    "every": 10,
    "capacity": 40_000,
    "from_start": 0.3,
    "resample": False,
    "permute": False,
    "perturb_velocity": 0.5,
    "updates": 40,
    "catch_up": 0,
}
"""Episodes are long and their steps short, so dreams branch off anywhere. Goals in mid-air would teach nothing, nor
would a left wall on the right; other speeds do, for a ball gets over a box or a ramp only after many bounces that pay
nothing. At first only a few rooms were seen, and a policy trained long in these knows no others: hence
`Course.truncate_after`."""

_BALL_AGENT: Final[Mapping[str, Any]] = {"ent_coef": "auto_0.01"}
"""What a decision pays is a few hundredths, and the weight of entropy settles at some thousandths. Begun at 1, it left
the critic with values of 4 where dreams brought none (seed 100, after 500 decisions): an end would lose so much. SAC
alone is better off with 1: at 5 updates a decision it took 9,000 with it and 14,750 with this (seed 0)."""

COURSES: Final = {
    course.name: course
    for course in (
        Course("truck", "TruckPush, task push", "relgym/TruckPush-v0", "truck"),
        Course(
            "ball",
            "BallGoal",
            "relgym/BallGoal-v0",
            "ball",
            repeat=5,
            horizon=100,
            dreams=_BALL_DREAMS,
            agent=_BALL_AGENT,
            truncate_after=10,
        ),
    )
}

_DYNA: Final[Mapping[str, Any]] = {"updates": 40, "catch_up": 10_000}
"""Of all arms with a model: 10,000 and 40 per real step make 36 for each of the first 1,000 real steps."""

ARMS: Final = {
    arm.name: arm
    for arm in (
        Arm("sac", "SAC", "none"),
        Arm("sac5", "SAC, 5 updates a step", "none", updates=5),
        Arm("sac20", "SAC, 20 updates a step", "none", updates=20),
        Arm("sac40", "SAC, 40 updates a step", "none", updates=40),
        Arm("sac-permuted", "SAC, objects permuted", "none", varied=True),
        Arm("ensemble", "Dyna, MLP ensemble", "neural", **_DYNA, learned=True, doubted=False),
        Arm("relgym", "Dyna, relgym", "relational", **_DYNA, learned=True, varied=True),
        Arm("relgym-given", "Dyna, relgym, reward given", "relational", **_DYNA, varied=True),
    )
}


class ChangingWorld(gym.Wrapper[Any, Any, Any, Any]):
    """One env at first, another one of the same kind later; both with the same seed.

    Parameters
    ----------
    env, later
        The envs.
    after
        Steps after which the next reset begins an episode of the later one.
    """

    def __init__(self, env: gym.Env[Any, Any], later: gym.Env[Any, Any], after: int) -> None:
        super().__init__(env)
        self._later, self._left = later, after

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode, in the later world when its time has come."""
        if seed is not None:
            self._later.reset(seed=seed)
        if self._left <= 0:
            self.env = self._later
        return super().reset(seed=seed, options=options)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """A step of the world as it is."""
        self._left -= 1
        return super().step(action)


def make_env(
    course: Course,
    change: Change | None = None,
    *,
    arm: Arm | None = None,
    spec: FlatSpec | None = None,
    **arguments: Any,
) -> gym.Env[Any, Any]:
    """The course's env as agents see it: flat, relative, with decisions of several steps where it has them.

    Parameters
    ----------
    course
        Where.
    change
        How the world changes, if it does.
    arm
        Who is to train in it; default: it is for tests. Most episodes of some are cut short (`Course.truncate_after`).
    spec
        What the flat view shows, where it isn't what the env declares.
    arguments
        Of the env, where they differ from the course's.
    """

    def made(**own: Any) -> gym.Env[Any, Any]:
        return gym.make(course.env_id, disable_env_checker=True, **{**course.arguments, **arguments, **own})

    env = made()
    if change is not None:
        env = ChangingWorld(env, made(**change.arguments), change.after)
    if course.truncate_after and arm is not None and arm.dreams:
        env = TruncatedEpisodes(env, course.truncate_after * course.repeat)
    env = TransitionRecorder(env)
    return FlatView(ActionRepeat(env, course.repeat) if course.repeat > 1 else env, spec)


def make_agent(arm: Arm, env: gym.Env[Any, Any], *, seed: int, **changes: Any) -> Any:
    """SAC, ready for `make_dyna`'s callback.

    Raises
    ------
    ConfigError
        Stable-Baselines3 isn't installed.
    """
    try:
        from stable_baselines3 import SAC
        from stable_baselines3.common.logger import Logger

        from relgym.wrappers.sb3.replay import replay_options
    except ImportError as missing:
        raise ConfigError(
            f"{missing}: Dyna needs the extra sb3 (pip install 'relgym[sb3]', or make dyna)"
        ) from None
    mixing = replay_options(env.observation_space, gamma=AGENT["gamma"])
    env.action_space.seed(seed)
    updates = 1 if arm.dreams else arm.updates  # until the model is accepted
    agent = SAC("MlpPolicy", env, seed=seed, gradient_steps=updates, **{**AGENT, **mixing, **changes})
    agent.set_logger(Logger(None, []))  # one of Stable-Baselines3's own leaves an empty folder behind
    return agent


def make_dyna(
    arm: Arm, course: Course, env: gym.Env[Any, Any], *, seed: int, model: Any = None, **changes: Any
) -> Any:
    """The arm's callback: a `Dyna`, a `PermutedReplay`, or none.

    `model` is dreamed in instead of a new one; `changes` go to its `DynaConfig`.
    """
    if not arm.dreams:
        if not arm.varied:
            return None
        from relgym.wrappers.sb3.permuting import PermutedReplay

        return PermutedReplay(seed=seed)
    model = _model(arm, env, seed) if model is None else model
    return _dyna(arm, course, model, seed=seed, **changes)


def _dyna(arm: Arm, course: Course, model: Any, *, seed: int, **changes: Any) -> Dyna:
    from relgym.wrappers.sb3.dyna import Dyna

    settings: dict[str, Any] = {
        "horizon": course.horizon,
        "updates": arm.updates,
        "catch_up": arm.catch_up,
        "permute": arm.varied,
        "resample": arm.varied,
        "seed": seed,
    }
    if not arm.doubted:
        settings |= {"accept_at": 1.0, "reject_at": 1.0}
    if (
        arm.model == "neural"
    ):  # nets draw their batches from all they have seen: waiting would only withhold steps
        settings["shuffle"] = 0
    chosen = DynaConfig(**{**settings, **course.dreams, **changes})
    return Dyna(model, chosen, reward_model="learned" if arm.learned else None)


def _model(arm: Arm, env: gym.Env[Any, Any], seed: int) -> Any:
    if arm.model == "relational":
        return relgym.WorldModel(env.get_wrapper_attr("schema"))
    return nets_of(env, seed=seed)


def nets_of(env: gym.Env[Any, Any], *, seed: int) -> NeuralWorldModel:
    """An ensemble of nets that learns an env's world, and knows nothing yet."""
    from relgym.baselines.ensemble import MLPEnsemble
    from relgym.baselines.neural_world import NeuralWorldModel

    # The nets see the scene as a policy does: relative and scaled, which is to their advantage.
    flat = env if env.has_wrapper_attr("flattener") else FlatView(env)
    features, schema = flat.get_wrapper_attr("flattener"), env.get_wrapper_attr("schema")
    return NeuralWorldModel(schema, features=features, ensemble=MLPEnsemble(seed=seed))
