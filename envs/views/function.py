"""The view of anything: a function that the user writes names the objects in an observation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

from gymnasium import spaces

from relgym.arguments import refusing, refusing_calls
from relgym.envs.actions import acting, check_action_space
from relgym.envs.views.acts import Acts
from relgym.errors import ConfigError, ObservationError
from relgym.scene.objects import ACTION, ObjectType, Scene
from relgym.scene.schema import SceneSchema

__all__ = ["FunctionView", "Seen"]

Seen: TypeAlias = Mapping[str, Any]
"""Objects by name: a property vector, ``{property: value}``, either with the type's name before it, or ``None``."""


@refusing_calls(ConfigError)
class FunctionView:
    """Objects as a function of observation and info says.

    The function returns the objects that are there, by name. Each is its property vector or
    ``{property: value}``; ``(type name, either of them)`` is checked against the schema; ``None`` is absent.

    Parameters
    ----------
    schema
        What the scenes are made of. Where it has no action object, one is made from the action space (`Acts`).
    function
        Of (observation, info).
    action_space
        The env's action space.
    inverse
        Function of a scene that returns the observation that shows it; needed only by dreams of such
        observations.
    actions
        As of `NumbersView`.
    precision
        Relative precision of the numbers, ``5e-7`` for float32: smaller errors aren't counted as wrong.

    Raises
    ------
    ConfigError
        The schema's action object doesn't fit the action space.

    Notes
    -----
    A model file can't hold functions: it says that scenes were made by one, and dreams from the file alone show
    objects, name -> property vector. The functions are copied with the view (`copy.deepcopy` leaves them shared).

    Examples
    --------
    >>> ball = ObjectType("ball", ("y", "vy"))
    >>> schema = SceneSchema((ball,), (("ball", "ball"),))
    >>> view = FunctionView(schema, lambda seen, info: {"ball": {"y": seen[1], "vy": seen[0]}}, spaces.Discrete(2))
    >>> view.scene([0.5, 2.0])["ball"]["y"]
    2.0
    """

    matches = False

    @refusing(ConfigError)
    def __init__(
        self,
        schema: SceneSchema,
        function: Callable[[Any, Mapping[str, Any]], Seen],
        action_space: spaces.Space[Any],
        *,
        inverse: Callable[[Scene], Any] | None = None,
        actions: Sequence[str] | None = None,
        precision: float = 0.0,
    ) -> None:
        self._function, self._inverse, self.precision = function, inverse, precision
        self._acts: Acts | None = None
        schema = replace(schema, precision=precision) if precision else schema
        if ACTION in schema.order:
            check_action_space(schema, action_space)
            self.schema = schema
            return
        self._acts = Acts(action_space, actions)
        types = (*schema.types, self._acts.type)
        self.schema = replace(schema, types=types, objects=(*schema.objects, (ACTION, ACTION)))

    def scene(
        self,
        observation: Any,
        info: Mapping[str, Any] | None = None,
        *,
        last: Scene | None = None,
        expected: Scene | None = None,
    ) -> Scene:
        """The scene that the function makes of an observation; see `View.scene`."""
        seen = self._function(observation, {} if info is None else info)
        if not isinstance(seen, Mapping):
            raise ObservationError(
                f"the view's function returned {type(seen).__name__}; expected {{object name: properties}}"
            )
        scene = self.schema.scene(
            {name: self._vector(name, value) for name, value in seen.items() if value is not None}
        )
        missing = [
            name
            for name in self.schema.order
            if name not in scene and name != ACTION and not self.schema.type_of(name).optional
        ]
        if missing:
            raise ObservationError(
                f"the view's function left out {missing}; only objects of types declared optional may be absent"
            )
        return scene

    def _vector(self, name: str, value: Any) -> Any:
        if name not in self.schema.order:
            raise ObservationError(
                f"unknown object {name!r}; the view's schema has {list(self.schema.order)}"
            )
        kind = self.schema.type_of(name)
        if isinstance(value, tuple) and len(value) == 2 and isinstance(value[0], str):
            _check_type(name, kind, value[0])
            value = value[1]
        if not isinstance(value, Mapping):
            return value
        if set(value) != set(kind.properties):
            raise ObservationError(
                f"object {name!r} of type {kind.name!r}: expected the properties {kind.properties}, "
                f"got {tuple(value)}"
            )
        return [value[prop] for prop in kind.properties]

    def check_actions(self, space: spaces.Space[Any]) -> None:
        """Raise `ConfigError` unless the view can read actions of a space."""
        if self._acts is None:
            check_action_space(self.schema, space)
        else:
            self._acts.check(space)

    def with_action(self, scene: Scene, action: Any) -> Scene:
        """The scene with the action's properties: by the schema's own ranges, or see `Acts`."""
        return acting(scene, action) if self._acts is None else self._acts.acting(scene, action)

    def with_outcome(self, scene: Scene, reward: Any, terminated: bool) -> Scene:
        """The scene as it is: this view learns of the state alone (`TaskView` of more)."""
        return scene

    def observation(self, scene: Scene) -> Any:
        """What the inverse makes of a scene; `ConfigError` without one."""
        if self._inverse is None:
            raise ConfigError(
                "nothing says which observation shows a scene: pass inverse=function of a scene to the FunctionView"
            )
        return self._inverse(scene)

    def to_json(self) -> dict[str, Any]:
        """That there is a function, and no more: nothing in a file is ever evaluated."""
        return {"kind": "function"}


def _check_type(name: str, kind: ObjectType, came: str) -> None:
    if came != kind.name:
        raise ObservationError(
            f"object {name!r} changed its type: expected {kind.name!r}, got {came!r}; a type is for life, so give "
            f"objects of type {came!r} names of their own (declare the types optional, and show one at a time)"
        )
