"""Single contacts, kept as they were seen: at once or later, and what laws see of them."""

from __future__ import annotations

import copy
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relgym.laws import encounters
from relgym.laws.book import LawBook
from relgym.laws.columns import Sources
from relgym.laws.encounters import EncounterStore
from relgym.laws.records import ONE, FreeLaw, Piece, Share
from relgym.laws.touching import Cast, Contacts
from relgym.scene.objects import POSE, ObjectType, SceneLayout
from relgym.scene.relations import Extractor
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Sphere

BALL = ObjectType("ball", (*POSE, "vx", "vy", "mass"), Sphere(), velocity=("vx", "vy", None))
WALL = ObjectType("wall", POSE, Box())
WIND = ObjectType("wind", ("x",), optional=True)
SCHEMA = SceneSchema(
    (BALL, WALL, WIND), (("a", "ball"), ("b", "ball"), ("w", "wall"), ("wind", "wind")), planar=True
)
SOURCES = {"ball": Sources.of(SCHEMA, BALL)}
WHOLE, CALM = SCHEMA.layout(), SCHEMA.layout(("a", "b", "w"))


def body(x: float, y: float, width: float, height: float, *more: float) -> list[float]:
    return [x, y, 0.0, 0.0, 0.0, 0.0, width, height, 1.0, *more]


def vector_of(layout: SceneLayout, rng: np.random.Generator) -> np.ndarray:
    """A ball on a wall, and another one beside it."""
    parts = {
        "a": body(0.0, 0.5, 1.0, 1.0, *rng.normal(size=2), 1.0),
        "b": body(1.0, 0.5, 1.0, 1.0, *rng.normal(size=2), 2.0),
        "w": body(0.0, -0.5, 9.0, 1.0),
        "wind": [float(rng.normal())],
    }
    return np.concatenate([parts[name] for name in layout.names])


def looked_at(cast: Cast, vectors: np.ndarray) -> Contacts:
    return Contacts.of(cast, Extractor(SCHEMA).extract(cast.layout, vectors), vectors)


def pair_of(cast: Cast, names: tuple[str, str]) -> int:
    return cast.pairs.index((cast.bodies[names[0]], cast.bodies[names[1]]))


PAIRS = (("a", "w"), ("b", "w"), ("a", "b"))


def kept(
    steps: list[tuple[int, bool]], *, later: bool, seed: int, book: LawBook | None = None
) -> EncounterStore:
    """Contacts of random scenes, by number of their pair, with or without the wind; later ones are confirmed."""
    store, known = EncounterStore(SCHEMA, SOURCES, seed=seed), book or LawBook(SCHEMA, SOURCES)
    rng = np.random.default_rng(seed)
    for number, (which, windy) in enumerate([(k, True) for k in range(3)] + steps):
        cast = known.cast(WHOLE if windy else CALM)
        vector, after = vector_of(cast.layout, rng), rng.normal(size=(2, len(cast.layout.bodies)))
        pair = pair_of(cast, PAIRS[which])
        if later and number >= 3:
            store.confirm(lambda rows, cast=cast: looked_at(cast, rows), cast, pair, vector, after)
        else:
            store.add(looked_at(cast, vector[None]), pair, vector, after, wrong=False)
    return store


def same(one: EncounterStore, other: EncounterStore) -> bool:
    arrays = one.to_arrays(), other.to_arrays()
    return one.to_json() == other.to_json() and all(
        arrays[0][name].tobytes() == arrays[1][name].tobytes() for name in arrays[0]
    )


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 2), st.booleans()), max_size=25),
    st.integers(0, 100),
    st.integers(4, 20),
)
def test_what_is_confirmed_is_kept_as_if_it_had_been_looked_at_at_once(
    steps: list[tuple[int, bool]], seed: int, most: int
) -> None:
    """Also where there is no room for all, and where something that laws may read is not there."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(encounters, "MOST_ROWS", most)
        at_once, later = (kept(steps, later=later, seed=seed) for later in (False, True))
        assert len(later) == len(at_once) == min(most, 3 + sum(windy for _, windy in steps))
        assert same(copy.deepcopy(later), at_once)
        assert same(later, at_once)


def test_what_is_kept_of_a_contact_by_hand() -> None:
    store, rng = EncounterStore(SCHEMA, SOURCES, seed=0), np.random.default_rng(0)
    cast = LawBook(SCHEMA, SOURCES).cast(WHOLE)
    vector = vector_of(WHOLE, rng)
    after = np.arange(6.0).reshape(2, 3)
    for names in (("a", "w"), ("a", "b")):
        store.add(looked_at(cast, vector[None]), pair_of(cast, names), vector, after, wrong=False)
    assert store.kinds == [("ball", "wall"), ("ball", "ball")]
    velocity = {name: vector[WHOLE.places[name, "vx"] :][:2].tolist() for name in "ab"}
    field = lambda name: store._column(name).T.tolist()  # noqa: E731
    assert field("now_a") == [velocity["a"]] * 2
    assert field("now_b") == [[0.0, 0.0], velocity["b"]]
    a, b = cast.bodies["a"], cast.bodies["b"]
    assert field("after_a") == [after[:, a].tolist()] * 2
    assert field("after_b") == [[0.0, 0.0], after[:, b].tolist()]  # what isn't learned keeps its velocity
    np.testing.assert_allclose(field("normal"), [[0.0, 1.0], [-1.0, 0.0]], atol=1e-12)  # from b to a
    assert field("extent_a") == [[1.0]] * 2 and field("extent_b") == [[9.0], [1.0]]
    assert field("arm_a") == [[0.0]] * 2  # no spin is learned
    wind = float(vector[WHOLE.places["wind", "x"]])
    assert SOURCES["ball"].names == ("vx", "vy", "mass", "wind.x")
    assert field("x_a")[0] == [*velocity["a"], 1.0, wind]
    assert field("x_b") == [[0.0] * 4, [*velocity["b"], 2.0, wind]]


def free_book() -> LawBook:
    """Balls that fall by 0.5 a step."""
    book = LawBook(SCHEMA, SOURCES)
    book.free["ball"] = FreeLaw("ball", (Piece((("vx", 1.0),)), Piece((("vy", 1.0), (ONE, -0.5)))))
    book.tolerance = 1e-9
    return book


def test_laws_see_relative_velocities_without_the_contact() -> None:
    store, book = kept([], later=False, seed=1), free_book()
    seen = store.encounters(book)
    assert seen is not None and len(seen) == 3
    assert [seen.names[k] for k in seen.kinds] == [("ball", "wall"), ("ball", "wall"), ("ball", "ball")]
    now = store._column("now_a") - store._column("now_b")
    np.testing.assert_array_equal(seen.now, now)
    np.testing.assert_allclose(seen.free - now, [[0.0] * 3, [-0.5, -0.5, 0.0]], atol=1e-15)  # both balls fall
    np.testing.assert_array_equal(seen.after, store._column("after_a") - store._column("after_b"))
    assert seen.rims is not None and not seen.rims.any()
    assert store.encounters(LawBook(SCHEMA, SOURCES)) is None  # without free laws nothing is known


@pytest.mark.parametrize(("share", "expected"), [(2 / 3, Share("mass", 1)), (0.5, Share(constant=0.5))])
def test_how_two_balls_share_an_impulse(share: float, expected: Share) -> None:
    """One of mass 1 and one of mass 2: two thirds of the relative change are the first one's."""
    store, book, rng = EncounterStore(SCHEMA, SOURCES, seed=0), free_book(), np.random.default_rng(0)
    cast = book.cast(WHOLE)
    for k in range(6):
        vector = vector_of(WHOLE, rng)
        heavy, light = WHOLE.places["b", "mass"], WHOLE.places["a", "mass"]
        vector[heavy], part = (2.0, share) if k % 2 else (1.0, 0.5)
        vector[light] = 1.0
        after = np.zeros((2, 3))
        push = rng.normal(size=2)
        for name, change in (("a", part * push), ("b", -(1.0 - part) * push)):
            at = WHOLE.places[name, "vx"]
            after[:, cast.bodies[name]] = vector[at : at + 2] + np.array([0.0, -0.5]) + change
        store.add(looked_at(cast, vector[None]), pair_of(cast, ("a", "b")), vector, after, wrong=False)
    assert store.shares(book) == {("ball", "ball"): expected}


def test_saved_and_read_it_goes_on() -> None:
    store = kept([(1, True)] * 5, later=True, seed=3)
    again = EncounterStore(SCHEMA, SOURCES, seed=9)
    again.restore(json.loads(json.dumps(store.to_json())), store.to_arrays())
    assert same(again, store) and again.seen == 8
    cast, rng = LawBook(SCHEMA, SOURCES).cast(WHOLE), np.random.default_rng(4)
    vector, after = vector_of(WHOLE, rng), np.ones((2, 3))
    for each in (store, again):
        each.add(looked_at(cast, vector[None]), pair_of(cast, ("a", "b")), vector, after, wrong=True)
    assert same(again, store)
