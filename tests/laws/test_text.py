from __future__ import annotations

import numpy as np
import pytest
from law_streams import Stream, moved, taught

from relgym.errors import ConfigError
from relgym.experiments.data import ball_episodes
from relgym.laws.account import accounts
from relgym.laws.book import LawBook
from relgym.laws.text import law_rows, world_rows
from relgym.laws.touching import Contacts
from relgym.scene.relations import Extractor


@pytest.fixture(scope="module")
def streams() -> list[Stream]:
    return [Stream(b.schema, b.layout, b.vectors) for b in ball_episodes(2, seed=0, episodes=12)]


@pytest.fixture(scope="module")
def book(streams: list[Stream]) -> LawBook:
    return taught(streams).book


def test_sentences(book: LawBook) -> None:
    assert [str(row) for row in law_rows(book, ["ball"])] == [
        "ball touching nothing: vx' = vx, vy' = vy - 0.00098",
        "touching, along the normal n: v'_n = max(u_n, -0.95 v_n)",
        "touching, along the slip direction t: v'_t = max(0, u_t - 0.2 J_n)",
    ]


def functions(book: LawBook, incline: float) -> set[tuple[str, ...]]:
    return {row.functions for row in world_rows(book, "ball", incline)}


def test_table_4_9_follows_from_the_laws(book: LawBook) -> None:
    assert functions(book, 45.0) == {
        ("vx' = -0.17 vx - 1.17 vy + 0.000588", "vy' = -0.78 vx + 0.22 vy - 0.000588"),
        ("vx' = 0.22 vx - 0.78 vy + 0.000392", "vy' = -1.17 vx - 0.17 vy - 0.000392"),
        ("vx' = -0.475 vx - 0.475 vy", "vy' = -0.475 vx - 0.475 vy"),
    }
    assert functions(book, 90.0) == {
        ("vx' = -0.95 vx", "vy' = 0.39 vx + vy - 0.00098"),
        ("vx' = -0.95 vx", "vy' = -0.39 vx + vy - 0.00098"),
        ("vx' = -0.95 vx", "vy' = 0"),
    }


def test_table_4_2_follows_from_the_laws() -> None:
    smooth = taught(Stream(b.schema, b.layout, b.vectors) for b in ball_episodes(1, seed=0, episodes=8)).book
    (row,) = world_rows(smooth, "ball", 30.0)
    assert row.case == "v'_n = -0.9 v_n, v'_t = u_t"
    assert row.functions == (
        "vx' = 0.525 vx - 0.8227241 vy + 0.0004243524",
        "vy' = -0.8227241 vx - 0.425 vy - 0.000245",
    )


def test_no_functions_without_normals(book: LawBook) -> None:
    with pytest.raises(ConfigError, match="contact normals"):
        world_rows(LawBook(book.schema, book.sources), "ball", 30.0)


def test_a_contact_accounts_for_itself(book: LawBook, streams: list[Stream]) -> None:
    stream = streams[0]
    contacts, motion = moved(book, stream)
    row = int(np.flatnonzero(contacts.hits.sum(axis=1) == 1)[0])
    vectors = stream.vectors[row : row + 1]
    relations = Extractor(stream.schema).extract(stream.layout, vectors)
    (account,) = accounts(book, Contacts.of(contacts.cast, relations, vectors), vectors)
    assert account.objects[0] == "ball"
    assert [axis.axis for axis in account.axes] == ["n", "t"]
    ball = stream.layout.bodies.index(stream.layout.index("ball"))
    after = sum(np.array(axis.direction) * axis.value for axis in account.axes)
    assert np.allclose(after, motion.velocity[:, row, ball], atol=1e-12)
    assert "max(u_n, -0.95 v_n)" in str(account)
