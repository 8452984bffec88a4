"""How laws are measured: scores, noise, classic control."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relgym.config import ModelConfig
from relgym.experiments.data import ball_episodes
from relgym.experiments.laws.classic import CLASSICS, Classic, classic_transitions
from relgym.experiments.laws.scaling import on_the_floor
from relgym.experiments.laws.score import Score, score, score_laws, taught
from relgym.experiments.laws.trials import TRIALS, constants, noisy, trial_rooms
from relgym.experiments.rooms import Room
from relgym.laws.book import LawBook
from relgym.laws.records import ZERO, AxisLaw, PairLaw, Piece
from relgym.model.world_model import WorldModel
from relgym.scene.relations import Extractor

SPIN = next(trial for trial in TRIALS if trial.frame == "point").world


def test_scores_count_what_is_off_and_what_is_not_said() -> None:
    rooms = trial_rooms(SPIN, 5, seed=1)
    model, fresh = taught(rooms), trial_rooms(SPIN, 1, seed=2)[0]
    assert model.governed == {"ball"}
    assert (score(model, [fresh]), score_laws(_laws(model), [fresh])) == (Score(200, 0, 0), Score(200, 0, 0))
    column = fresh.layout.column(fresh.layout.index("ball1"), "spin")
    vectors = fresh.vectors.copy()
    vectors[-1, column] += 0.25
    bent = Room(fresh.schema, fresh.layout, vectors)
    assert score(model, [bent]).wrong == score_laws(_laws(model), [bent]).wrong == 1
    assert Score(200, 1, 3).bad == 4
    assert Score(200, 1, 3).share == pytest.approx(0.02)


def _laws(model: WorldModel) -> LawBook:
    assert model.laws is not None
    return model.laws


def test_noise_touches_what_moves_only() -> None:
    (episode,) = ball_episodes(1, seed=0, episodes=1)
    (found,) = noisy([episode], 1e-3, rng=np.random.default_rng(0))
    off = found.vectors - episode.vectors
    at = episode.layout.offsets[episode.layout.index("ball")]
    moving = np.zeros(off.shape[1], dtype=bool)
    moving[[at, at + 1, at + 9, at + 10]] = True
    assert (off[:, ~moving] == 0.0).all()
    assert off[:, moving].std(axis=0) == pytest.approx(1e-3, rel=0.2)


def test_constants_are_the_weights_other_than_one() -> None:
    book = LawBook(SPIN.schema(), {})
    assert constants(book) == {}
    free, bounce = Piece((("u_n", 1.0),)), Piece((("v_n", -0.95),))
    drag = Piece((("u_t", 1.0), ("J_n", -0.2)))
    axes = (AxisLaw((free, bounce), "max", ()),), (AxisLaw((ZERO, drag), "max", ()),)
    book.pair = PairLaw("contact", axes, 0.0)
    assert constants(book) == {"v_n": -0.95, "J_n": -0.2}


def test_scenes_of_the_scaling_benchmark_touch_as_often_as_they_say() -> None:
    for touching, objects in ((2, 12), (8, 12), (2, 60)):
        world, layout, vectors = on_the_floor(touching, objects)
        assert len(layout.bodies) == objects
        touch = Extractor(world.schema()).extract(layout, vectors).relation("intersect")[0, :touching]
        assert touch.sum(axis=1).tolist() == [1] * touching


@pytest.mark.parametrize("classic", CLASSICS, ids=[c.env for c in CLASSICS])
def test_classic_control_as_scenes(classic: Classic) -> None:
    schema, flat = classic_transitions(classic, 30, seed=0, body=False)
    _, again = classic_transitions(classic, 30, seed=0, body=True)
    assert len(flat) == 30
    assert [t.after.vector.tolist() for t in flat] == [t.after.vector.tolist() for t in again]
    assert schema.targets is not None
    assert [t.property for t in schema.targets] == list(classic.properties)


def test_a_body_without_contacts_learns_the_same_modes() -> None:
    schema, found = classic_transitions(CLASSICS[1], 40, seed=0, body=True)
    models = [WorldModel(schema, replace(ModelConfig(), frames=f)) for f in ("auto", "world")]
    for transition in found:
        for model in models:
            model.learn_one(transition)
    assert models[0].governed == frozenset()
    assert models[0].to_json()["targets"] == models[1].to_json()["targets"]
