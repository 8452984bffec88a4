"""What all relgym envs share: one flat state array, observations cut from it, exact states, typed errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from relgym.arguments import refusing
from relgym.envs.arguments import checked_action, checked_options
from relgym.envs.flat import FlatSpec
from relgym.envs.tasks import Task, TaskOutcome
from relgym.errors import ConfigError, ObservationError
from relgym.scene.objects import ACTION, POSE, Float1D, Scene, SceneLayout
from relgym.scene.schema import SceneSchema

__all__ = [
    "DEFAULT_BOUNDS",
    "EnvState",
    "Observation",
    "SceneEnv",
]

Observation: TypeAlias = dict[str, NDArray[np.float64]]
"""Property vector of every object, by name."""

Bounds: TypeAlias = Mapping[str, tuple[float, float]]
"""Smallest and largest value of each property."""

DEFAULT_BOUNDS: Bounds = {
    **dict.fromkeys(POSE[:3], (-1e4, 1e4)),
    **dict.fromkeys(POSE[3:6], (-np.pi, np.pi)),
    **dict.fromkeys(POSE[6:], (0.0, 1e3)),
}
"""Bounds of the nine pose components: units, radians and units."""


@dataclass(frozen=True)
class EnvState:
    """Everything that an env's future depends on, as `SceneEnv.get_state` returns it.

    Parameters
    ----------
    vector
        The state vector (a read-only copy), without an action.
    hidden
        What the env keeps beside it: an engine's velocities, say. Opaque, immutable, picklable.
    random
        State of the env's random generator.
    steps
        How many steps the episode has lasted: the task's time limit depends on it.
    """

    vector: Float1D
    hidden: Any
    random: Mapping[str, Any]
    steps: int = 0


class SceneEnv(gym.Env[Observation, Any]):
    """Base of the envs whose observations are scenes.

    A subclass says how an episode begins (`_begin`), how a step goes (`_advance`) and, if its state is more
    than the state vector, how the rest is saved and restored (`_hidden`, `_restore`).

    Parameters
    ----------
    schema
        What the scenes are made of. All but the action is part of the observation.
    action_space
        The space of actions.
    bounds
        Smallest and largest value of each property; pose components default to `DEFAULT_BOUNDS`.
    render_mode
        ``None``, ``"rgb_array"`` or ``"human"``.
    task
        What the agent is asked to do; without one the reward is 0 and no episode ends.
    time_limit
        After how many steps the task's time is up and an episode is truncated; none: never.

    Attributes
    ----------
    schema : SceneSchema
        Constant for the env's life; wrapped envs give it with ``env.get_wrapper_attr("schema")``.
    task : Task or None
        Reward and termination as pure functions, which dreams use too.
    flat_spec : FlatSpec
        What flat views of the env show unless told otherwise.
    """

    flat_spec = FlatSpec()

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 50}  # noqa: RUF012

    def __init__(
        self,
        schema: SceneSchema,
        action_space: spaces.Space[Any],
        bounds: Bounds,
        render_mode: str | None,
        *,
        task: Task | None = None,
        time_limit: int | None = None,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ConfigError(
                f"render_mode={render_mode!r}: expected None or one of {self.metadata['render_modes']}"
            )
        self.schema = schema
        self.render_mode = render_mode
        self.action_space = action_space
        self.task = task
        self._time_limit = time_limit
        self._steps = 0
        self._layout = schema.layout(name for name in schema.order if name != ACTION)
        self.observation_space: spaces.Space[Any] = _observation_space(
            self._layout, {**DEFAULT_BOUNDS, **bounds}
        )
        self._cuts = [(name, self._layout.slice(i)) for i, name in enumerate(self._layout.names)]
        self._state: Float1D | None = None
        self._viewer: Any = None

    # --- the Gymnasium contract -----------------------------------------------------------------------------

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; see the env's docstring for its `options`.

        Raises
        ------
        ConfigError
            An unknown option, or an illegal value; the env is unchanged.
        """
        super().reset(seed=seed)
        self._state = self._begin(checked_options(options), rng=self.np_random)
        self._steps = 0
        if self.render_mode == "human":
            self.render()
        return self._observation(), {"scene": self.scene, **self._info(), **self._reset_info()}

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Advance by one step; `ActionError` when `action` lies outside the action space."""
        before = self._required_state()
        checked = checked_action(self.action_space, action)
        self._state = after = self._advance(before, checked)
        self._steps += 1
        if self.render_mode == "human":
            self.render()
        if self.task is None:
            return self._observation(), 0.0, False, self._late(), self._info()
        verdict = self.task.evaluate(self._layout, before[None], np.asarray(checked)[None], after[None])
        return self._evaluated(verdict)

    def render(self) -> Any:
        """Draw the scene: as an array of shape (height, width, 3), or in a window for ``"human"``."""
        from relgym.envs.rendering import SceneViewer

        if self.render_mode is None:
            raise ConfigError("nothing to render to: make the env with render_mode='rgb_array' or 'human'")
        if self._viewer is None:
            self._viewer = SceneViewer(self.render_mode, fps=self.metadata["render_fps"])
        marks = () if self.task is None else self.task.regions(self.scene)
        return self._viewer.show(self.scene, self._view(), marks)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    # --- scenes and states ----------------------------------------------------------------------------------

    @property
    def scene(self) -> Scene:
        """The current scene, without an action."""
        return self._scene_of(self._required_state())

    @property
    def vector(self) -> Float1D:
        """The current state vector, shape ``(width,)``: a copy."""
        return self._required_state().copy()

    def get_state(self) -> EnvState:
        """Everything that the future depends on; `set_state` continues from it exactly."""
        vector = self.vector
        vector.flags.writeable = False
        return EnvState(vector, self._hidden(), self.np_random.bit_generator.state, self._steps)

    @refusing(ObservationError)
    def set_state(self, state: EnvState | Scene) -> Observation:
        """Continue from `state`: of this env or of another one with the same schema.

        Parameters
        ----------
        state
            What `get_state` returned, or any scene with this env's objects (an action in it is ignored).
            After a scene, the hidden rest is inferred from it, the random generator goes on as it was, and the
            time limit counts from 0.

        Raises
        ------
        ObservationError
            The state or scene has other objects than this env.
        """
        if isinstance(state, Scene):
            self._state, self._steps = self._vector_of(state), 0
            self._restore(self._state, None)
        else:
            if state.vector.shape != (self._layout.width,):
                raise ObservationError(
                    f"expected a state of shape {(self._layout.width,)} for {list(self._layout.names)}, "
                    f"got {state.vector.shape}; make the env with the arguments of the one it came from"
                )
            self._state, self._steps = state.vector.copy(), state.steps
            self._restore(self._state, state.hidden)
            self.np_random.bit_generator.state = state.random
        return self._observation()

    def __getstate__(self) -> dict[str, Any]:
        # Engine, window and cached slices are rebuilt; what remains can be copied and pickled.
        started = self._state is not None
        kept = {name: value for name, value in self.__dict__.items() if name not in self._transient}
        return {"kept": kept, "hidden": self._hidden() if started else None}

    def __setstate__(self, saved: dict[str, Any]) -> None:
        self.__dict__.update(saved["kept"])
        self.__dict__.update(dict.fromkeys(self._transient))
        if self._state is not None:
            self._restore(self._state, saved["hidden"])

    # --- what a subclass supplies ---------------------------------------------------------------------------

    _transient: tuple[str, ...] = ("_viewer",)
    """Names of the attributes that can't be copied; `_restore` makes them again."""

    def _begin(self, options: Mapping[str, Any], *, rng: np.random.Generator) -> Float1D:
        """Draw a scene and return its state vector."""
        raise NotImplementedError

    def _advance(self, state: Float1D, action: Any) -> Float1D:
        """Return the next state vector: a new array."""
        raise NotImplementedError

    def _info(self) -> dict[str, Any]:
        """What `reset` and `step` report about the current state."""
        return {}

    def _reset_info(self) -> dict[str, Any]:
        """What only `reset` reports."""
        return {}

    def _view(self) -> Any:
        """The `View` to draw; ``None`` for the whole scene."""
        return None

    def _hidden(self) -> Any:
        """Everything besides the state vector that the future depends on; immutable."""
        return None

    def _restore(self, vector: Float1D, hidden: Any) -> None:
        """Take over a state; `hidden` is ``None`` when only the scene is known."""

    # --- helpers --------------------------------------------------------------------------------------------

    def _evaluated(self, verdict: TaskOutcome) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        success = bool(verdict.succeeded[0])
        info = {**self._info(), "is_success": success}  # the name that SB3's evaluation looks for
        terminated = bool(verdict.terminated[0])
        return self._observation(), float(verdict.rewards[0]), terminated, self._late(), info

    def _late(self) -> bool:
        return self._time_limit is not None and self._steps >= self._time_limit

    def _observation(self) -> Observation:
        # One fresh array per call, cut into views: callers may keep and change what they get.
        copy = self._required_state().copy()
        return {name: copy[cut] for name, cut in self._cuts}

    def _scene_of(self, vector: Float1D) -> Scene:
        return Scene(self.schema, self._layout, vector.copy())

    def _required_state(self) -> Float1D:
        if self._state is None:
            raise ResetNeeded(f"call reset() before using {type(self).__name__}'s state")
        return self._state

    def _vector_of(self, scene: Scene) -> Float1D:
        names, types = self._layout.names, self._layout.types
        missing = [
            name
            for name, t in zip(names, types, strict=True)
            if name not in scene or scene[name].type.properties != t.properties
        ]
        extra = [o.name for o in scene if o.type.has_body and o.name not in names]
        if missing or extra:
            raise ObservationError(
                f"the scene doesn't fit this env: missing or of another type {missing}, unknown {extra}; "
                "take scenes from an env made with the same arguments"
            )
        return np.concatenate([scene[name].values for name in names])


def _observation_space(layout: SceneLayout, bounds: Bounds) -> spaces.Dict:
    boxes: dict[str, spaces.Space[Any]] = {}
    for name, t in zip(layout.names, layout.types, strict=True):
        low, high = (np.array([bounds[p][k] for p in t.properties]) for k in (0, 1))
        boxes[name] = spaces.Box(low, high, dtype=np.float64)
    return spaces.Dict(boxes)
