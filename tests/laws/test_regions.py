"""Free laws that differ from region to region."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relgym.laws.columns import Sources
from relgym.laws.free import FreeLearner, free_motion
from relgym.laws.records import ONE, Bound, FreeLaw, Piece, Region
from relgym.laws.regions import find_laws, find_regions
from relgym.reporting.motion import MotionRules, parse_motion
from relgym.scene.objects import POSE, Kinematics, ObjectType, Target
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Sphere

OWN = (*POSE, "vx", "vy", "spin")
BLOCK = ObjectType("block", OWN, Box(), velocity=("vx", "vy", None))
ROUND = ObjectType("round", OWN, Sphere(), velocity=("vx", "vy", None))


def sources(kind: ObjectType) -> Sources:
    rates = (("px", "vx"), ("py", "vy"), ("rz", "spin"))
    schema = SceneSchema(
        (kind,),
        (("a", kind.name),),
        planar=True,
        kinematics=tuple(Kinematics(kind.name, p, v) for p, v in rates),
    )
    return Sources.of(schema, kind, tuple(Target(kind.name, v) for _, v in rates))


WINDY = FreeLaw(
    "block",
    (Piece((("vx", 1.0),)), Piece((("vy", 1.0),)), Piece((("spin", 1.0),))),
    regions=(
        Region(
            (Bound("px", True, 0.25, 0.5), Bound("py", False, 1.0, 2.0)),
            (Piece((("vx", 1.0), (ONE, 0.125))), Piece((("vy", 1.0),)), Piece((("spin", 1.0),))),
        ),
    ),
)


def test_only_where_bodies_turn_places_are_known() -> None:
    assert sources(BLOCK).where == ("px", "py")
    assert sources(BLOCK).names == ("vx", "vy", "spin", "|v|*vx", "|v|*vy", "px", "py")
    assert sources(BLOCK).readable == ("vx", "vy", "spin", "|v|*vx", "|v|*vy")
    assert sources(ROUND).where == sources(ROUND).drag == ()


def test_between_regions_only_what_both_say_is_known() -> None:
    places = np.array([[0.5, 1.0], [0.25, 0.0], [3.0, 2.0], [0.3, 0.0], [3.0, 1.5]]).T
    x = np.concatenate([np.full((5, 5), 0.5), places])
    found = free_motion(WINDY, sources(BLOCK).names, x)
    assert found[0, :3].tolist() == [0.625, 0.5, 0.5]
    assert np.isnan(found[0, 3:]).all()
    assert (found[1:] == 0.5).all()


def test_a_region_is_found_and_its_border_narrows(rng: np.random.Generator) -> None:
    learner = FreeLearner(sources(BLOCK), seed=0)
    gaps = []
    for k in range(800):
        x = rng.uniform(-1.0, 1.0, 7)
        after = x[:3] + np.array([0.125 * (x[5] > 0.0), 0.0, 0.0])
        law = learner.law
        said = (
            np.full(3, np.nan) if law is None else free_motion(law, learner.sources.names, x[:, None])[:, 0]
        )
        assert not (np.abs(said - after) > 1e-12).any() or k < 100  # wrong only until the region is known
        learner.learn_one(x, after, bool((np.abs(said - after) <= 1e-12).all()), 1e-12)
        if learner.law is not None and learner.law.regions:
            (region,) = learner.law.regions
            gaps.append(region.bounds[0].high - region.bounds[0].low)
    assert learner.law is not None and learner.law.unexplained <= 0.02 * learner.law.examples
    (region,) = learner.law.regions
    assert [b.name for b in region.bounds] == ["px"]
    assert {p[0].formula(6) for p in (learner.law.components, region.components)} == {"vx", "vx + 0.125"}
    assert gaps[-1] < 0.05 and gaps[-1] < gaps[0]


def test_no_region_where_places_tell_nothing(rng: np.random.Generator) -> None:
    learner = FreeLearner(sources(BLOCK), seed=0)
    for _ in range(400):
        x = rng.uniform(-1.0, 1.0, 7)
        learner.learn_one(x, x[:3] + 0.125 * rng.integers(0, 2), False, 1e-12)
    assert learner.law is None


def test_laws_that_positions_do_not_part_get_no_region(rng: np.random.Generator) -> None:
    place, own = rng.uniform(size=(200, 2)), np.arange(200) % 2 == 0
    laws = [WINDY.components, WINDY.regions[0].components]
    assert find_regions(laws, [own, ~own], place, ("px", "py")) == ()


def test_saved_told_and_read_back() -> None:
    assert FreeLaw.from_json(WINDY.to_json()) == WINDY
    rules = MotionRules((replace(WINDY, examples=7),), (("block", ("vx", "vy", "spin")),), tolerance=1e-9)
    text = rules.text(17)
    assert "block touching nothing, where px >= 0.5 (else px <= 0.25) and py <= 1 (else py >= 2):" in text
    assert parse_motion(text.splitlines()[:-2]).free == rules.free


@pytest.mark.parametrize("count", [2, 3])
def test_first_components_alone(count: int) -> None:
    law = WINDY.first(count)
    assert (len(law.components), len(law.regions[0].components)) == (count, count)
    assert law.reads() == {"vx", "vy", "px", "py"} | ({"spin"} if count == 3 else set())


# ---------------------------------------------------------------------- by hand
def constant(value: float) -> tuple[Piece, ...]:
    return (Piece(((ONE, value),)),)


def in_bands(values: np.ndarray, place: np.ndarray, fewest: int = 6) -> list[float]:
    """Constants found, one for each law: a stretch has one if all of it agrees."""

    def fit(rows: np.ndarray) -> tuple[Piece, ...] | None:
        return constant(float(values[rows[0]])) if np.ptp(values[rows]) == 0.0 else None

    def obeys(law: tuple[Piece, ...]) -> np.ndarray:
        return values == law[0].terms[0][1]

    return [law[0].terms[0][1] for law in find_laws(fit, obeys, place, fewest=fewest)]


def test_laws_of_bands_are_found_the_largest_first() -> None:
    place = np.stack([np.linspace(0.0, 1.0, 160), np.random.default_rng(0).uniform(size=160)], axis=1)
    values = np.select([place[:, 0] < 0.2, place[:, 0] < 0.75], [1.0, 2.0], 3.0)
    assert in_bands(values, place) == [2.0, 3.0, 1.0]
    assert in_bands(values, place[:, ::-1]) == [2.0, 3.0, 1.0]  # along whichever axis
    shuffled = np.random.default_rng(1).permutation(160)
    assert in_bands(values[shuffled], place) == []  # where it is says nothing
    assert in_bands(values, place, fewest=81) == []  # no stretch is so long


def test_four_laws_at_most() -> None:
    place = np.linspace(0.0, 1.0, 320)[:, None]
    values = np.floor(8.0 * place[:, 0]).clip(0, 7)
    assert len(in_bands(values, place)) == 4


def test_regions_by_hand() -> None:
    """Elsewhere below 3, the second law from 4 to 6, the third from 7 on."""
    place = np.arange(10.0)[:, None].repeat(5, axis=0)
    x = place[:, 0]
    held = [x <= 3.0, (x >= 4.0) & (x <= 6.0), x >= 7.0]
    laws = [constant(0.0), constant(1.0), constant(2.0)]
    found = find_regions(laws, held, place, ("px",))
    # The first one that holds counts. So the third one, which is told from both others, comes before the second.
    assert [(r.components, r.bounds) for r in found] == [
        (laws[2], (Bound("px", True, 6.0, 7.0),)),
        (laws[1], (Bound("px", True, 3.0, 4.0),)),
    ]
    both = held[1] | (x == 2.0)  # what both explain tells no border
    found = find_regions(laws[:2], [held[0], both], place, ("px",))
    assert [r.bounds for r in found] == [(Bound("px", True, 3.0, 4.0),)]


@pytest.mark.parametrize("borders", [(-0.3, 0.4), (-0.5, -0.1), (-0.2, 0.2), (-0.5, 0.0, 0.5)])
def test_bands_side_by_side_whichever_is_the_widest(
    borders: tuple[float, ...], rng: np.random.Generator
) -> None:
    learner, x = FreeLearner(sources(BLOCK), seed=0), rng.uniform(-1.0, 1.0, (500, 7))
    after = x[:, :3].copy()
    after[:, 0] += 0.125 * np.searchsorted(borders, x[:, 5])
    for one, following in zip(x, after, strict=True):
        learner.store.add(np.concatenate([one, following]), cell=0)
    learner.fit(1e-12)
    assert learner.law is not None and learner.law.unexplained == 0
    said = free_motion(learner.law, learner.sources.names, x.T)
    known = ~np.isnan(said[0])
    assert known.mean() > 0.97
    np.testing.assert_allclose(said[:, known].T, after[known], atol=1e-12)
