"""The view of tables: rows are objects, columns their properties."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from relgym.arguments import refusing, refusing_calls
from relgym.envs.spaces_json import space_from_json, space_to_json
from relgym.envs.views.acts import Acts
from relgym.envs.views.base import as_shown, precision_of
from relgym.envs.views.matching import matched
from relgym.envs.views.records import Rows, Static, identifiers, merged
from relgym.errors import ConfigError, ObservationError
from relgym.scene.objects import ACTION, Float2D, ObjectType, Scene
from relgym.scene.schema import SceneSchema

__all__ = ["TableView"]


@refusing_calls(ConfigError)
class TableView:
    """Rows of a table as objects, with bodies where the user says which columns are pose and size.

    Parameters
    ----------
    observation_space
        A Box of shape ``(rows, columns)``.
    action_space
        The env's action space.
    columns
        Names of the columns.
    rows
        What the rows are, from the first to the last: `Rows` records whose counts sum to the table's. Default:
        all of one type `row`, without bodies.
    presence
        The column that says whether a row holds an object (more than 0.5) or is empty; it is no property.
        Default: every row holds one.
    match
        Columns by which a row is recognised from step to step, in a table whose rows are sorted anew: column
        name -> a distance that is far, in the column's units. Rows and *expected* objects of a kind are paired
        so that the sum of squared distances is smallest; a row farther than 1 from all is a new object. Default:
        the k-th row is always the same object.
    changes
        Columns whose last step's change is a property too, called ``vx_change`` after the column ``vx``; 0 for an
        object that has just come. For envs whose next step depends on more than the table shows: what a driver is about
        to do shows in what he has just done.
    offsets
        Whether clauses may test gaps to other bodies and where their centres lie (`SceneSchema.offsets`). Default
        false.
    actions, static, up, planar
        As of `NumbersView`.

    Raises
    ------
    ConfigError
        A space that is no table, or declarations that don't fit it.

    Notes
    -----
    Objects may come and go. A matched table has twice as many names as rows, so that one that comes while another
    goes is never taken for it. A kind of one row is one object, however far it moves: where another may come in its
    place, give the kind two rows. The numbers of an empty row mean nothing, and may be NaN.

    Examples
    --------
    >>> space, push = spaces.Box(-9, 9, (2, 3), np.float64), spaces.Discrete(2)
    >>> view = TableView(space, push, columns=("here", "x", "v"), presence="here", match={"x": 1.0})
    >>> first = view.scene(np.array([[1.0, 0.0, 0.1], [1.0, 5.0, -0.1]]))
    >>> later = view.scene(np.array([[1.0, 4.9, -0.1], [1.0, 0.1, 0.1]]), last=first)
    >>> later["row1"]["x"], later["row2"]["x"]
    (0.1, 4.9)
    """

    @refusing(ConfigError)
    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        columns: Sequence[str],
        rows: Sequence[Rows] | None = None,
        presence: str | None = None,
        match: Mapping[str, float] | None = None,
        changes: Sequence[str] = (),
        offsets: bool = False,
        actions: Sequence[str] | None = None,
        static: Sequence[Static] = (),
        up: str = "y",
        planar: bool = True,
    ) -> None:
        self._space = _table(observation_space)
        count, width = self._space.shape
        identifiers("columns", columns, width)
        self.columns, self._presence = tuple(columns), presence
        self._match = None if match is None else dict(match)
        _check_columns(self.columns, [*([] if presence is None else [presence]), *(match or ()), *changes])
        self.changes, self._offsets = tuple(changes), offsets
        self.rows = (Rows("row", count),) if rows is None else tuple(rows)
        if sum(part.count for part in self.rows) != count:
            raise ConfigError(
                f"rows={self.rows}: expected counts that sum to the table's {count} rows, got "
                f"{sum(part.count for part in self.rows)}"
            )
        self._acts, self._static, self._axes = Acts(action_space, actions), tuple(static), (up, planar)
        self._properties = tuple(name for name in self.columns if name != presence)
        self._shown = np.array([self.columns.index(name) for name in self._properties], np.intp)
        self._changing = [self._properties.index(name) for name in self.changes]
        self._here = None if presence is None else self.columns.index(presence)
        self._scales = np.array(list((match or {}).values()), dtype=np.float64)
        if (self._scales <= 0.0).any():
            raise ConfigError(f"match={dict(match or {})}: expected distances greater than 0")
        self._names = _names(self.rows, spare=match is not None)
        self.schema = self._made_schema()
        self._fixed = {s.name: np.array(list(s.values.values()), dtype=np.float64) for s in self._static}

    def _made_schema(self) -> SceneSchema:
        kinds = [self._kind(part) for part in self.rows]
        fixed = [ObjectType(s.type or s.name, tuple(s.values), s.shape) for s in self._static]
        objects = [
            *((name, kind.name) for kind, names in zip(kinds, self._names, strict=True) for name in names),
            *((s.name, kind.name) for s, kind in zip(self._static, fixed, strict=True)),
        ]
        identifiers("names of the objects", [name for name, _ in objects], len(objects))
        types = (*merged([*kinds, *fixed]), self._acts.type)
        everything = (*objects, (ACTION, ACTION))
        up, planar = self._axes
        return SceneSchema(
            types, everything, up=up, planar=planar, offsets=self._offsets, precision=self.precision
        )

    def _kind(self, part: Rows) -> ObjectType:
        return ObjectType(
            part.type or part.name,
            (*self._properties, *(f"{name}_change" for name in self.changes), *part.constants),
            part.shape,
            pose=dict(part.pose),
            velocity=tuple(part.velocity),
            angles=tuple(part.angles),
            optional=self._presence is not None or self._match is not None,
        )

    # ------------------------------------------------------------------ scenes
    @property
    def matches(self) -> bool:
        """Whether `scene` heeds what was expected: see `View`."""
        return self._match is not None

    @property
    def precision(self) -> float:
        """Relative precision of the numbers that it shows: see `View`."""
        return precision_of(self._space.dtype in (np.float16, np.float32))

    @refusing(ObservationError)
    def scene(
        self,
        observation: Any,
        info: Mapping[str, Any] | None = None,
        *,
        last: Scene | None = None,
        expected: Scene | None = None,
    ) -> Scene:
        """The scene that a table shows; see `View.scene`."""
        table = self._checked(observation)
        values: dict[str, NDArray[np.float64]] = {}
        at = 0
        for part, names in zip(self.rows, self._names, strict=True):
            own = table[at : at + part.count]
            at += part.count
            here = np.arange(len(own)) if self._here is None else np.flatnonzero(own[:, self._here] > 0.5)
            constants = np.array(list(part.constants.values()), dtype=np.float64)
            chosen = self._chosen(own[here], names, here, last, last if expected is None else expected)
            for name, row in zip(chosen, own[here], strict=True):
                shown = row[self._shown]
                values[name] = np.concatenate([shown, self._changed(shown, name, last), constants])
        return self.schema.scene(values | self._fixed)

    def _changed(self, shown: NDArray[np.float64], name: str, last: Scene | None) -> NDArray[np.float64]:
        """By how much some of an object's numbers differ from those of the last scene."""
        if last is None or name not in last:
            return np.zeros(len(self._changing))
        found: NDArray[np.float64] = (shown - last[name].values[: len(shown)])[self._changing]
        return found

    def _chosen(
        self,
        rows: Float2D,
        names: Sequence[str],
        here: NDArray[np.intp],
        last: Scene | None,
        expected: Scene | None,
    ) -> list[str]:
        """Name of the object in each row."""
        if self._match is None or len(names) == 1:
            return [names[int(k)] for k in here]
        known = [name for name in names if expected is not None and name in expected]
        columns = [self.columns.index(name) for name in self._match]
        places = [self._properties.index(name) for name in self._match]
        wanted = np.array([expected[name].values[places] for name in known if expected is not None])
        pairs = matched(
            rows[:, columns] / self._scales,
            wanted.reshape(len(known), len(places)) / self._scales,
            farthest=1.0,
        )
        # A name that was there a step ago would make a leap of two different objects.
        free = iter(name for name in names if name not in known and (last is None or name not in last))
        return [known[k] if k >= 0 else next(free) for k in pairs.tolist()]

    def _checked(self, observation: Any) -> Float2D:
        try:
            table = np.asarray(observation, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise ObservationError(f"expected a table of numbers, got {observation!r}") from None
        if table.shape != self._space.shape:
            raise ObservationError(
                f"expected a table of shape {self._space.shape}, columns {self.columns}, got shape {table.shape}"
            )
        wrong = ~np.isfinite(table)
        if self._here is not None:
            wrong &= (table[:, [self._here]] > 0.5) | (np.arange(table.shape[1]) == self._here)
        if wrong.any():
            row, column = (int(k) for k in np.argwhere(wrong)[0])
            raise ObservationError(
                f"row {row}, column {self.columns[column]!r}: expected a finite number, got {table[row, column]}; "
                "check the env's observation before it is learned from"
            )
        return table

    def check_actions(self, space: spaces.Space[Any]) -> None:
        """Raise `ConfigError` unless the view can read actions of a space."""
        self._acts.check(space)

    @refusing(ObservationError)
    def with_action(self, scene: Scene, action: Any) -> Scene:
        """The scene with the action's properties: see `Acts`."""
        return self._acts.acting(scene, action)

    def action_values(self, actions: Any) -> Float2D:
        """Properties of the action object for n actions: see `View`."""
        return self._acts.values_batch(actions)

    def with_outcome(self, scene: Scene, reward: Any, terminated: bool) -> Scene:
        """The scene as it is: this view learns of the state alone (`TaskView` of more)."""
        return scene

    def observation(self, scene: Scene) -> NDArray[Any]:
        """A table that shows a scene; matched rows stand in the schema's order, empty ones are 0.

        Raises
        ------
        ObservationError
            More objects of a kind than rows, or a number that the table's dtype can't hold.
        """
        table = np.zeros(self._space.shape)
        at = 0
        for part, names in zip(self.rows, self._names, strict=True):
            present = [name for name in names if name in scene]
            if len(present) > part.count:
                raise ObservationError(f"expected at most {part.count} objects {part.name!r}, got {present}")
            for k, name in enumerate(present):
                row = at + (k if self._match is not None else names.index(name))
                table[row, self._shown] = scene[name].values[: len(self._shown)]
                if self._here is not None:
                    table[row, self._here] = 1.0
            at += part.count
        return as_shown(table, self._space.dtype)

    # ------------------------------------------------------------------ files
    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        return {
            "kind": "table",
            "observation": space_to_json(self._space),
            "action": space_to_json(self._acts.space),
            "columns": list(self.columns),
            "rows": [part.to_json() for part in self.rows],
            "presence": self._presence,
            "match": None if self._match is None else [[k, v] for k, v in self._match.items()],
            "changes": list(self.changes),
            "offsets": self._offsets,
            "actions": None if self._acts.names is None else list(self._acts.names),
            "static": [s.to_json() for s in self._static],
            "axes": list(self._axes),
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> TableView:
        """Read what `to_json` wrote."""
        return cls(
            space_from_json(data["observation"]),
            space_from_json(data["action"]),
            columns=data["columns"],
            rows=[Rows.from_json(part) for part in data["rows"]],
            presence=data["presence"],
            match=None if data["match"] is None else {str(k): float(v) for k, v in data["match"]},
            changes=data.get("changes", ()),
            offsets=bool(data.get("offsets", False)),
            actions=data["actions"],
            static=[Static.from_json(s) for s in data["static"]],
            up=data["axes"][0],
            planar=data["axes"][1],
        )


def _table(space: spaces.Space[Any]) -> spaces.Box:
    if not isinstance(space, spaces.Box) or len(space.shape) != 2:
        raise ConfigError(
            f"expected a table, a Box of shape (rows, columns), got {space}; "
            "gymnasium.wrappers.ReshapeObservation makes one of a flat Box, TransformObservation takes it out of a Dict"
        )
    return space


def _check_columns(columns: Sequence[str], named: Sequence[str]) -> None:
    if unknown := sorted(set(named) - set(columns)):
        raise ConfigError(f"presence or match name columns {unknown}; the table has {tuple(columns)}")


def _names(rows: Sequence[Rows], *, spare: bool) -> tuple[tuple[str, ...], ...]:
    """Names of the objects of each kind; a single one bears the kind's name."""
    found = []
    for part in rows:
        count = part.count * (2 if spare else 1)
        single = part.count == 1
        found.append((part.name,) if single else tuple(f"{part.name}{k}" for k in range(1, count + 1)))
    return tuple(found)
