"""Bodies that turn: what contacts at points do to them, and laws learned from bodies that touch in one point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import FEWEST, MOST_ROWS, TOLD
from relgym.laws.columns import Sources
from relgym.laws.description import CONSTANT_BITS, EXCEPTION_BITS
from relgym.laws.frames import POINT, axis_names, turned
from relgym.laws.free import free_motion
from relgym.laws.impulses import Rows, Solved, table_of
from relgym.laws.inertia import AREA, SQUARE, Inertia, Pushes, find_gyrations, find_mass, ratios
from relgym.laws.kinds import fit_apart, fit_together
from relgym.laws.pair import PairFit
from relgym.laws.pieces import AxisExamples
from relgym.laws.points import Island, across, lever
from relgym.laws.records import ONE, FreeLaw, Kind, PairLaw
from relgym.laws.store import Store
from relgym.laws.touching import Cast, Contacts
from relgym.scene.axes import WORLD, Axes
from relgym.scene.geometry.vectors import FloatArray, dot
from relgym.scene.schema import SceneSchema

__all__ = ["PushStore", "Yields", "eases", "precedented", "push", "rows_of", "shape_features"]


def shape_features(cast: Cast, pose: FloatArray, body: int) -> dict[str, FloatArray]:
    """What inertia may read of a body's size and shape in n scenes; `pose` has shape ``(n, K, 9)``."""
    used = cast.axes.used
    s, t = (pose[:, body, 6 + axis] for axis in used)
    area, x2, y2 = cast.squares[:, body]
    return {
        AREA: area * s * t,
        SQUARE: x2 * s**2 + y2 * t**2,
        **{f"s{WORLD[axis]}": pose[:, body, 6 + axis] for axis in used},
    }


@dataclass(frozen=True, slots=True)
class Yields:
    """How easy the bodies of n scenes are to move and to turn.

    Attributes
    ----------
    light
        One over mass, shape ``(n, K)``: 0 for what no contact moves, NaN where unknown.
    nimble
        Mass over moment, shape ``(n, K)``.
    """

    light: FloatArray
    nimble: FloatArray


def eases(inertia: Inertia, contacts: Contacts, columns: Mapping[int, FloatArray]) -> Yields:
    """How easy bodies are to move and to turn; `columns` are what the laws read of each mover (`Motion`).

    0 for bodies that nothing touches in any scene: nobody asks.
    """
    cast, pose, points = contacts.cast, contacts.pose, contacts.points
    light, nimble = np.zeros((2, *pose.shape[:2]))
    assert points is not None, "only bodies that turn have points"
    touched = np.zeros(pose.shape[1], dtype=bool)
    touched[cast.first[points.pair]] = touched[cast.second[points.pair]] = True
    for body in cast.movers:
        if not touched[body]:
            continue
        sources = cast.sources[body][0]
        own = {name: columns[body][k] for k, name in enumerate(sources.names) if _inert(sources, name)}
        features = {**own, **shape_features(cast, pose, body)}
        name = sources.type.name
        light[:, body] = np.nan
        if inertia.mass is not None:
            key = cast.layout.names[cast.layout.bodies[body]] if inertia.mass.by == "object" else name
            with np.errstate(divide="ignore"):
                light[:, body] = 1.0 / inertia.mass.values(features, [key] * len(pose))
        if sources.spin is not None:
            nimble[:, body] = _nimble(inertia, name, features, len(pose))
    return Yields(light, nimble)


def _nimble(inertia: Inertia, name: str, features: Mapping[str, FloatArray], count: int) -> FloatArray:
    """Mass over moment of bodies of a type; NaN where unknown, 0 where contacts don't turn it."""
    known = inertia.gyration(name)
    if known is None:
        return np.full(count, np.nan)
    if known.piece is None:
        return np.zeros(count)
    every = _squared(features) | {ONE: np.ones(count)}
    if not all(term in every for term, _ in known.piece.terms):
        return np.full(count, np.nan)
    value = known.piece.values(every, np.ones(count))
    return np.where(value > 0.0, 1.0 / np.where(value > 0.0, value, 1.0), np.nan)


def _squared(features: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    return ratios(features) | {f"{n}^2": features[n] ** 2 for n in ("sx", "sy", "sz") if n in features}


def _inert(sources: Sources, name: str) -> bool:
    """Whether a column is a body's own and no velocity."""
    return "." not in name and name not in (*sources.moving, *sources.drag, *sources.where)


# ------------------------------------------------------------------ what points do
def rows_of(
    island: Island,
    cast: Cast,
    yields: Yields,
    law: PairLaw,
    chosen: NDArray[np.intp],
    now: FloatArray,
    free: FloatArray,
) -> tuple[Rows, NDArray[np.bool_]]:
    """The rows of islands, and which islands' laws and masses are all known, shape ``(m,)``.

    Parameters
    ----------
    island
        Islands with equally many points.
    cast, yields
        The bodies.
    law, chosen
        The law of pairs, and number of each axis' law for each of the cast's pairs, -1 where none is known.
    now, free
        Velocities and turning rates (counter-clockwise) of all bodies, shape ``(3, n, K)``.
    """
    points = island.points
    m, c = island.rows.shape
    scene, bodies = points.scene, [side[points.pair] for side in (cast.first, cast.second)]
    light, nimble = ([values[scene, body] for body in bodies] for values in (yields.light, yields.nimble))
    # Where only one of an island's bodies moves at each contact, and it is one body, its mass doesn't matter.
    alone = ~cast.both[points.pair].any(axis=1, keepdims=True)
    light = [np.where(alone, 1.0, light[0]), np.where(cast.both[points.pair], light[1], 0.0)]
    turning = [each * ease for each, ease in zip(light, nimble, strict=True)]
    axes = np.concatenate([points.normal, turned(points.normal)], axis=2)  # (2, m, 2c)
    levers = [lever(np.concatenate([arm, arm], axis=2), axes) for arm in points.arms]
    double = [np.concatenate([body, body], axis=1) for body in bodies]
    along = axes[0][:, :, None] * axes[0][:, None] + axes[1][:, :, None] * axes[1][:, None]
    gain = np.zeros((m, 2 * c, 2 * c))
    for p, sign_p in ((0, 1.0), (1, -1.0)):
        ease, spin = (np.concatenate([a, a], axis=1) for a in (light[p], turning[p]))
        for q, sign_q in ((0, 1.0), (1, -1.0)):
            same = double[p][:, :, None] == double[q][:, None]
            effect = ease[:, :, None] * along + spin[:, :, None] * levers[p][:, :, None] * levers[q][:, None]
            gain += np.where(same, sign_p * sign_q * effect, 0.0)
    velocities = []
    for moving in (free, now):
        relative = across(moving[:, scene, bodies[0]], points.arms[0])
        relative = relative - across(moving[:, scene, bodies[1]], points.arms[1])
        velocities.append(
            np.concatenate([dot(relative, points.normal), dot(relative, turned(points.normal))], axis=1)
        )
    if law.surfaces:
        running = np.concatenate([np.zeros((m, c)), law.running(cast.kinds)[points.pair]], axis=1)
        velocities = [each - running for each in velocities]
    numbers = chosen[:, points.pair]
    tables, signs = _tables(law, numbers)
    known = (numbers >= 0).all(axis=(0, 2)) & np.isfinite(gain).all(axis=(1, 2))
    known &= np.isfinite(velocities[0]).all(axis=1) & np.isfinite(velocities[1]).all(axis=1)
    known &= (np.diagonal(gain, axis1=1, axis2=2) > 0.0).all(axis=1)
    return Rows(gain, velocities[0], velocities[1], tables, signs), known


def _tables(law: PairLaw, numbers: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
    """Weights and signs of all rows' laws; `numbers` has shape ``(2, m, c)``."""
    most = max(len(each.pieces) for laws in law.axes for each in laws)
    letters = axis_names(law.frame, len(law.axes))
    tables, signs = [], []
    for axis, laws in enumerate(law.axes):
        told = [table_of(each, axis, letters, most) for each in laws]
        tables.append(np.stack([table for table, _ in told])[numbers[axis]])
        signs.append(np.array([sign for _, sign in told])[numbers[axis]])
    return np.concatenate(tables, axis=1), np.concatenate(signs, axis=1)


def precedented(
    rows: Rows, solved: Solved, law: PairLaw, numbers: NDArray[np.intp], slack: float
) -> NDArray[np.bool_]:
    """Islands in which no contact turns the motion at a point back in a sense in which none was seen to, ``(m,)``.

    See `relgym.laws.composition.within`.
    """
    c = rows.free.shape[1] // 2
    yields = np.diagonal(rows.gain, axis1=1, axis2=2)
    after = rows.free + (rows.gain * solved.impulse[:, None]).sum(axis=2)
    without = after - yields * solved.impulse
    fine = np.ones(len(after), dtype=bool)
    for axis, laws in enumerate(law.axes):
        part = slice(axis * c, (axis + 1) * c)
        value, free = after[:, part], without[:, part]
        if axis:  # the slip direction is that of the free motion
            sense = np.where(free < 0.0, -1.0, 1.0)
            value, free = sense * value, sense * free
        below, above = np.array([each.signs for each in laws]).T[:, numbers[axis]]
        back, forth = (value < -slack) & (free >= -slack), (value > slack) & (free <= slack)
        fine &= ~((back & ~below) | (forth & ~above)).any(axis=1)
    return fine


def push(
    island: Island, cast: Cast, yields: Yields, solved: Solved, velocity: FloatArray, some: NDArray[np.bool_]
) -> None:
    """Let the impulses of some islands act on velocities and turning rates, shape ``(3, n, K)``, in place."""
    points, c = island.points, island.rows.shape[1]
    alone = ~cast.both[points.pair].any(axis=1)
    for k in range(c):
        normal = points.normal[:, :, k]
        total = solved.impulse[:, k] * normal + solved.impulse[:, k + c] * turned(normal)
        for side, (bodies, sign) in enumerate(((cast.first, 1.0), (cast.second, -1.0))):
            body, scene = bodies[points.pair[:, k]], points.scene[:, k]
            light = (
                np.where(alone, 1.0, yields.light[scene, body])
                if not side
                else np.where(cast.both[points.pair[:, k]], yields.light[scene, body], 0.0)
            )
            turn = light * yields.nimble[scene, body] * lever(points.arms[side][:, :, k], total)
            change = sign * np.concatenate([light * total, turn[None]])
            velocity[:, scene[some], body[some]] += change[:, some]


# ------------------------------------------------------------------ learning
class PushStore:
    """A bounded number of contacts of two bodies in one point, as they were observed.

    Parameters
    ----------
    schema
        The scenes' schema.
    sources
        Columns of each type whose velocity is learned.
    seed
        Seed of the choice of contacts that make room.
    """

    def __init__(self, schema: SceneSchema, sources: Mapping[str, Sources], *, seed: int) -> None:
        self.sources = sources
        self.kinds: list[Kind] = []
        self.objects: list[str] = []
        self._sizes = tuple(f"s{WORLD[axis]}" for axis in Axes.of(schema).used)
        self._turn = Axes.of(schema).turn
        columns = max((len(s.names) for s in sources.values()), default=0)
        d = len(self._sizes)
        # A turning rate beside the velocity; area and mean square distance beside the sizes.
        moving, shape = d + 1, 2 + d
        widths = {"kind": 1, "normal": d}
        for side in "ab":
            widths |= {f"object_{side}": 1, f"now_{side}": moving, f"after_{side}": moving, f"arm_{side}": d}
            widths |= {f"shape_{side}": shape, f"x_{side}": columns}
        ends = np.cumsum(list(widths.values())).tolist()
        self._at = {name: slice(end - w, end) for (name, w), end in zip(widths.items(), ends, strict=True)}
        self._store = Store(ends[-1], MOST_ROWS, seed=seed)

    def __len__(self) -> int:
        return len(self._store.rows)

    @property
    def shape(self) -> tuple[int, int]:
        """Width of a contact's row, and most contacts kept."""
        return self._store.shape

    @property
    def object_columns(self) -> tuple[int, ...]:
        """Columns of a row that hold numbers of objects."""
        return tuple(self._at[f"object_{side}"].start for side in "ab")

    @property
    def seen(self) -> int:
        """Number of contacts so far, those no longer kept included."""
        return self._store.seen

    @seen.setter
    def seen(self, count: int) -> None:
        self._store.seen = count

    def add(
        self,
        contacts: Contacts,
        pair: int,
        vector: NDArray[np.float64],
        after: NDArray[np.float64],
        *,
        wrong: bool,
    ) -> None:
        """Keep a contact of a single scene; `after` are all bodies' next velocities and turning rates."""
        cast, points = contacts.cast, contacts.points
        assert points is not None, "only bodies that turn have points"
        kind = cast.kinds[pair]
        if kind not in self.kinds:
            self.kinds.append(kind)
        state = cast.padded(vector[None])[:, 0]
        at = int(np.flatnonzero(points.pair == pair)[0])
        row = np.zeros(self._store.rows.shape[1])
        row[self._at["kind"]] = self.kinds.index(kind)
        row[self._at["normal"]] = points.normal[:, at]
        for side, body in (("a", int(cast.first[pair])), ("b", int(cast.second[pair]))):
            row[self._at[f"object_{side}"]] = self._number(cast.layout.names[cast.layout.bodies[body]])
            row[self._at[f"now_{side}"]] = now = state[cast.velocities[:, body]]
            row[self._at[f"after_{side}"]] = after[:, body] if body in cast.sources else now
            row[self._at[f"arm_{side}"]] = points.arms["ab".index(side), :, at]
            row[self._at[f"shape_{side}"]] = [
                v[0] for v in shape_features(cast, contacts.pose, body).values()
            ]
            if body in cast.sources:
                start = self._at[f"x_{side}"].start
                places = cast.sources[body][1]
                row[start : start + len(places)] = state[places]
        if np.isfinite(row).all():
            self._store.add(row, cell=2 * self.kinds.index(kind) + wrong)

    def _number(self, name: str) -> int:
        if name not in self.objects:
            self.objects.append(name)
        return self.objects.index(name)

    # ------------------------------------------------------------------ deriving
    def inertia(self, free: Mapping[str, FreeLaw], tolerance: float, *, rng: np.random.Generator) -> Inertia:
        """What the contacts tell of masses and moments."""
        kinds = self._column("kind")[0].astype(np.intp)
        sides = []
        spinning, both = [], np.zeros(len(kinds), dtype=bool)
        for side in "ab":
            pushes = self._pushes(free, kinds, side)
            names = [self.kinds[k]["ab".index(side)] for k in kinds.tolist()]
            moves = np.array([name in free for name in names], dtype=bool)
            spins = np.array([n in free and self._spins(free[n]) for n in names], dtype=bool)
            spinning.append(pushes.of(np.flatnonzero(moves & spins)))
            sides.append(pushes)
            both = moves & both if side == "b" else moves
        gyrations = find_gyrations(_joined(spinning), tolerance, rng=rng)
        rows = np.flatnonzero(both)
        return Inertia(find_mass(sides[0].of(rows), sides[1].of(rows), tolerance), gyrations)

    def _spins(self, law: FreeLaw) -> bool:
        """Whether a free law says what becomes of the turning rate, too."""
        return len(law.components) > len(self.sources[law.type].velocity)

    def _pushes(self, free: Mapping[str, FreeLaw], kinds: NDArray[np.intp], side: str) -> Pushes:
        change = self._column(f"after_{side}") - self._free(free, kinds, side)
        arm = self._column(f"arm_{side}")
        names = np.array([kind["ab".index(side)] for kind in self.kinds] or [""])[kinds]
        objects = np.array(self.objects or [""])[self._column(f"object_{side}")[0].astype(np.intp)]
        return Pushes(
            change[:2],
            self._turn * change[2],
            lever(arm, change[:2]),
            np.sqrt(dot(arm, arm)),
            self._features(kinds, side),
            names,
            objects,
        )

    def _features(self, kinds: NDArray[np.intp], side: str) -> dict[str, FloatArray]:
        """What inertia may read of one side's bodies; NaN where a type lacks it."""
        shape = self._column(f"shape_{side}")
        found = dict(zip((AREA, SQUARE, *self._sizes), shape, strict=True))
        columns = self._column(f"x_{side}")
        for k, kind in enumerate(self.kinds):
            sources = self.sources.get(kind["ab".index(side)])
            part = kinds == k
            for number, name in enumerate(sources.names if sources else ()):
                if sources is not None and _inert(sources, name):
                    found.setdefault(name, np.full(len(kinds), np.nan))[part] = columns[number, part]
        return found

    def fit(
        self, free: Mapping[str, FreeLaw], inertia: Inertia, tolerance: float, *, rng: np.random.Generator
    ) -> PairFit | None:
        """The law of pairs, and which contacts it explains; None where nothing is known of any contact.

        Both rows of a point: ``u`` is what the velocity would be without that row's own impulse, which is what the
        first body's change of velocity tells, and ``J_n`` is what the normal impulse would change along t.
        """
        kinds = self._column("kind")[0].astype(np.intp)
        normal = self._column("normal")
        axes = (normal, turned(normal))
        light, change, velocities = self._sides(free, inertia, kinds)
        gains, impulse = [], [dot(change, axis) for axis in axes]
        for axis in axes:
            gain = light[0][0] + light[1][0]
            for side, (_, spin) in zip("ab", light, strict=True):
                gain = gain + spin * lever(self._column(f"arm_{side}"), axis) ** 2
            gains.append(gain)
        after, now = ([dot(v, axis) for axis in axes] for v in velocities)
        u = [a - g * x for a, g, x in zip(after, gains, impulse, strict=True)]
        part = np.flatnonzero(np.isfinite(np.stack([*u, *after, *now, *gains])).all(axis=0))
        if not len(part):
            return None
        seen = _Seen(
            np.stack([a[part] for a in u]),
            np.stack([a[part] for a in now]),
            np.stack([a[part] for a in after]),
            (gains[1] * impulse[0])[part],
            kinds[part],
            2.0 * tolerance,  # each has the errors of four: two velocities, two turning rates
        )
        found = self._stated(seen, {}, rng=rng)
        moving = {} if found.explained.all() else _running(seen, found.explained, self.kinds)
        if moving:
            other = self._stated(seen, moving, rng=rng)
            cost = len(moving) * (CONSTANT_BITS + 0.5 * float(np.log2(len(part))))
            if other.law.bits + cost < found.law.bits:
                surfaces = tuple((self.kinds[k], speed) for k, speed in sorted(moving.items()))
                law = replace(other.law, bits=other.law.bits + cost, surfaces=surfaces)
                found = PairFit(law, other.explained)
        whole = np.zeros(len(kinds), dtype=bool)
        whole[part] = found.explained
        bits = found.law.bits + EXCEPTION_BITS * 2.0 * (len(kinds) - len(part))
        return PairFit(replace(found.law, bits=bits), whole)

    def _stated(self, seen: _Seen, moving: Mapping[int, float], *, rng: np.random.Generator) -> PairFit:
        """The laws of both axes, where the surfaces of some kinds of contacts run at some speed."""
        speed = np.zeros(len(seen.kinds))
        for kind, value in moving.items():
            speed[seen.kinds == kind] = value
        u, now, after = (np.stack([a[0], a[1] - speed]) for a in (seen.free, seen.now, seen.after))
        sense = np.where(u[1] < 0.0, -1.0, 1.0)
        rows = {
            "u_n": u[0], "v_n": now[0], "u_t": sense * u[1], "v_t": sense * now[1],
            "J_n": seen.push, ONE: np.ones(len(speed)),
        }  # fmt: skip
        order = (("u_n", "v_n", "u_t", "v_t", ONE), ("u_t", "v_t", "u_n", "v_n", "J_n", ONE))
        laws, explained, bits = [], np.ones(len(speed), dtype=bool), 0.0
        for names, y in zip(order, (after[0], sense * after[1]), strict=True):
            x = np.stack([rows[n] for n in names], axis=1)
            examples = AxisExamples(names, x, y, names[0], seen.tolerance)
            together = fit_together(examples, seen.kinds, self.kinds, rng=rng)
            fit = fit_apart(examples, seen.kinds, self.kinds, together, np.inf, rng=rng)
            laws.append(fit.laws)
            explained &= fit.explained
            bits += fit.bits
        return PairFit(PairLaw(POINT, tuple(laws), bits), explained)

    def _sides(
        self, free: Mapping[str, FreeLaw], inertia: Inertia, kinds: NDArray[np.intp]
    ) -> tuple[list[tuple[FloatArray, FloatArray]], FloatArray, list[FloatArray]]:
        """How easily both bodies move and turn, the first one's unit; its change; velocities at the points."""
        count = len(kinds)
        change, eased = np.empty((2, count)), []
        at = [np.zeros((2, count)), np.zeros((2, count))]
        mass = []
        for side, sign in (("a", 1.0), ("b", -1.0)):
            pushes = self._pushes(free, kinds, side)
            moves = np.array([kind["ab".index(side)] in self.sources for kind in self.kinds], dtype=bool)[
                kinds
            ]
            nimble = np.zeros(count)
            for name in np.unique(pushes.types).tolist():
                sources, part = self.sources.get(name), pushes.types == name
                if sources is not None and sources.spin is not None:
                    own = {n: f[part] for n, f in pushes.features.items()}
                    nimble[part] = _nimble(inertia, name, own, int(part.sum()))
            own_mass = np.full(count, np.nan)
            if inertia.mass is not None:
                keys = pushes.objects if inertia.mass.by == "object" else pushes.types
                own_mass = inertia.mass.values(pushes.features, keys.tolist())
            mass.append(own_mass)
            if side == "a":
                change, light = pushes.change, np.ones(count)
            else:
                light = np.where(moves, mass[0] / np.where(mass[1] == 0.0, np.nan, mass[1]), 0.0)
            eased.append((light, light * nimble))
            arm = self._column(f"arm_{side}")
            for k, which in enumerate(("after", "now")):
                moving = self._column(f"{which}_{side}")
                moving = np.concatenate([moving[:2], self._turn * moving[2:]])
                at[k] = at[k] + sign * across(moving, arm)
        return eased, change, at

    def _free(self, free: Mapping[str, FreeLaw], kinds: NDArray[np.intp], side: str) -> FloatArray:
        """Free motion of one side of all contacts; the present velocity of what isn't learned."""
        velocity = self._column(f"now_{side}").copy()
        for k, kind in enumerate(self.kinds):
            name = kind["ab".index(side)]
            sources = self.sources.get(name)
            if sources is None:
                continue
            part = np.flatnonzero(kinds == k)
            velocity[: len(sources.moving), part] = np.nan
            if name in free:
                columns = self._column(f"x_{side}")[: len(sources.names), part]
                known = free_motion(free[name], sources.names, columns)
                velocity[: len(known), part] = known
        return velocity

    def _column(self, name: str) -> FloatArray:
        """One field of all contacts, components first."""
        return np.ascontiguousarray(self._store.rows[:, self._at[name]].T)

    # ------------------------------------------------------------------ saving
    def to_json(self) -> dict[str, Any]:
        """Everything but the contacts."""
        kinds = [list(kind) for kind in self.kinds]
        return {"kinds": kinds, "objects": list(self.objects), "store": self._store.to_json()}

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The contacts."""
        return self._store.to_arrays()

    def restore(self, data: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take over what `to_json` and `to_arrays` wrote."""
        self.kinds = [(str(a), str(b)) for a, b in data["kinds"]]
        self.objects = [str(name) for name in data.get("objects", [])]
        self._store.restore(data["store"], arrays)


@dataclass(frozen=True, slots=True)
class _Seen:
    """Contacts as laws see them: velocities along normal and tangent, shape ``(2, n)``, and what the normal push does.

    Attributes
    ----------
    free, now, after
        Without each row's own impulse, before, and after; the tangent isn't turned to the slip.
    push
        What the normal impulse would change along the tangent, shape ``(n,)``.
    kinds
        Number of each contact's kind, shape ``(n,)``.
    tolerance
        Largest residual of an explained velocity.
    """

    free: FloatArray
    now: FloatArray
    after: FloatArray
    push: FloatArray
    kinds: NDArray[np.intp]
    tolerance: float


def _running(seen: _Seen, explained: NDArray[np.bool_], names: Sequence[Kind]) -> dict[int, float]:
    """Speeds at which the surfaces of some kinds of contacts seem to run: what sticks to them moves at that speed.

    Where contacts with a type of bodies are unexplained it is the velocity along the tangent that most of them end at.
    """
    found: dict[int, float] = {}
    for surface in sorted({names[k][1] for k in np.unique(seen.kinds[~explained]).tolist()}):
        own = [k for k in np.unique(seen.kinds).tolist() if names[k][1] == surface]
        ends = np.sort(seen.after[1][np.isin(seen.kinds, own) & (np.abs(seen.push) > seen.tolerance)])
        if not len(ends):
            continue
        alike = np.searchsorted(ends, ends + seen.tolerance, side="right") - np.arange(len(ends))
        first, count = int(alike.argmax()), int(alike.max())
        speed = float(np.median(ends[first : first + count]))
        if count >= FEWEST and abs(speed) > TOLD * seen.tolerance:
            found |= dict.fromkeys(own, speed)
    return found


def _joined(parts: Sequence[Pushes]) -> Pushes:
    """Pushes of several kinds of bodies."""
    names = {name: None for part in parts for name in part.features}
    features = {
        name: np.concatenate([p.features.get(name, np.full(len(p.turn), np.nan)) for p in parts])
        for name in names
    }
    change, turn, torque, reach, types, objects = (
        np.concatenate([getattr(p, field) for p in parts], axis=-1)
        for field in ("change", "turn", "torque", "reach", "types", "objects")
    )
    return Pushes(change, turn, torque, reach, features, types, objects)
