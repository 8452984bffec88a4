"""Laws of worlds that the thesis' rooms don't show: space, spin, masses, materials, and what no law can state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from law_streams import Stream, errors, formulas, moved, taught

from relgym.experiments.laws.trials import INEXPRESSIBLE, TRIALS, Trial, trial_rooms
from relgym.experiments.laws.worlds import Ball, Material, World
from relgym.laws.book import LawBook
from relgym.laws.learner import LawLearner
from relgym.laws.text import law_rows
from relgym.scene.schema import SceneSchema

ROUGH = Material(0.9, 0.2)


def streams(world: World, count: int, *, seed: int, steps: int = 200) -> list[Stream]:
    return [Stream(r.schema, r.layout, r.vectors) for r in trial_rooms(world, count, seed=seed, steps=steps)]


@pytest.fixture(scope="module")
def books() -> dict[str, LawBook]:
    return {}


def learned(books: dict[str, LawBook], trial: Trial) -> LawBook:
    """The laws of a trial world after few episodes; learned once for all tests."""
    if trial.name not in books:
        count = 4 if trial.world.dimensions == 3 else 8
        books[trial.name] = taught(streams(trial.world, count, seed=1)).book
    return books[trial.name]


@pytest.mark.parametrize("trial", TRIALS, ids=[trial.name for trial in TRIALS])
def test_every_world_has_its_laws(trial: Trial, books: dict[str, LawBook]) -> None:
    book = learned(books, trial)
    assert book.pair is not None
    assert book.pair.frame == trial.frame
    assert {law for axis in formulas(book) for law in axis} == trial.laws
    wrong, abstained, total = errors(book, streams(trial.world, 2, seed=2))
    assert wrong + abstained <= 0.001 * total


def named(name: str) -> Trial:
    return next(trial for trial in TRIALS if trial.name == name)


def test_space_obeys_the_laws_of_the_plane(books: dict[str, LawBook]) -> None:
    plane = taught(streams(World(2, materials={"block": ROUGH}), 6, seed=3)).book
    space = learned(books, named("space"))
    space = _book_of(space, space.schema)
    space.pair = plane.pair
    assert errors(space, streams(named("space").world, 2, seed=3))[:2] == (0, 0)


def test_a_disc_takes_a_third_of_what_drags_at_its_rim(books: dict[str, LawBook]) -> None:
    rows = law_rows(learned(books, named("a spinning ball")), ["ball"])
    assert [row.statement for row in rows] == [
        "vx' = vx, vy' = vy - 0.00098, spin' = spin",
        "v'_n = max(u_n, -0.9 v_n)",
        "v'_t = max(0, u_t - 0.6 J_n)",
        "velocities take 0.3333333 of the change along t, spins the rest",
    ]


def test_masses_decide_shares(books: dict[str, LawBook]) -> None:
    unknown = learned(books, named("two balls of unknown mass"))
    assert unknown.shares["heavy", "light"].formula() == "0.25"
    seen = learned(books, named("five balls"))
    assert seen.shares["ball", "ball"].formula() == "mass_B / (mass_A + mass_B)"


def test_two_spinning_balls() -> None:
    world = World(
        2, (Ball(spins=True), Ball(radius=0.15, spins=True)), materials={"block": ROUGH}, between=ROUGH
    )
    book = taught(streams(world, 12, seed=1)).book
    assert formulas(book) == [["max(u_n, -0.9 v_n)"], ["max(0, u_t - 0.6 J_n)"]]
    assert book.pair is not None
    assert {f"{grip:.6g}" for _, grip in book.pair.grips} == {"0.333333"}
    wrong, abstained, total = errors(book, streams(world, 3, seed=2))
    assert wrong + abstained <= 0.001 * total


def test_a_spin_that_nothing_drags_at_is_left_alone() -> None:
    smooth = World(2, (Ball(spins=True),), materials={"block": Material(0.9)})
    learner = taught(streams(smooth, 4, seed=1))
    assert formulas(learner.book) == [["max(u_n, -0.9 v_n)"], ["u_t"]]
    assert learner.book.components("ball") == ("vx", "vy")


@pytest.mark.parametrize("name", sorted(INEXPRESSIBLE))
def test_what_the_form_cannot_state_is_left_unsaid(name: str) -> None:
    learner = taught(streams(INEXPRESSIBLE[name], 5, seed=1))
    wrong, abstained, total = errors(learner.book, streams(INEXPRESSIBLE[name], 2, seed=2))
    assert wrong == 0
    assert 0 < abstained < 0.3 * total  # contacts only: free flight is still predicted


# ---------------------------------------------------------------------- what must not matter
@pytest.mark.parametrize("name", ["a spinning ball", "five rough balls"])
def test_company_changes_no_bit(name: str, books: dict[str, LawBook]) -> None:
    trial = named(name)
    book = learned(books, trial)
    stream = streams(trial.world, 1, seed=5)[0]
    _, whole = moved(book, stream)
    for k in range(0, len(stream.vectors) - 1, 7):
        _, alone = moved(book, stream, slice(k, k + 1))
        assert alone.velocity.tobytes() == np.ascontiguousarray(whole.velocity[:, k : k + 1]).tobytes()
        assert (alone.known == whole.known[k]).all()


def test_the_order_of_objects_does_not_matter(books: dict[str, LawBook]) -> None:
    book = learned(books, named("five balls"))
    stream = streams(named("five balls").world, 1, seed=6)[0]
    _, one = moved(book, stream)
    turned = _reversed(stream)
    _, two = moved(_book_of(book, turned.schema), turned)
    assert np.allclose(one.velocity, two.velocity[..., ::-1], atol=1e-15)
    assert (one.known == two.known[:, ::-1]).all()


def _reversed(stream: Stream) -> Stream:
    """The same scenes with their objects in reverse order."""
    schema = replace(stream.schema, objects=stream.schema.objects[::-1])
    layout = schema.layout()
    columns = []
    for name in layout.names:
        part = stream.layout.slice(stream.layout.index(name))
        columns += list(range(part.start, part.stop))
    return Stream(schema, layout, stream.vectors[:, columns])


def _book_of(book: LawBook, schema: SceneSchema) -> LawBook:
    """The same laws for scenes of another schema."""
    other = LawBook(schema, book.sources)
    other.free, other.pair, other.shares, other.tolerance = book.free, book.pair, book.shares, book.tolerance
    return other


def test_spinning_goes_on_as_if_never_saved() -> None:
    parts = streams(named("a spinning ball").world, 5, seed=7)
    whole, first = taught(parts), taught(parts[:2])
    again = LawLearner(first.schema, first.schema.targets or (), seed=9)
    again.restore(first.to_json(history=True), first.to_arrays())
    taught(parts[2:], learner=again)
    assert again.to_json(history=True) == whole.to_json(history=True)
