"""Laws from streams: the thesis' rooms, materials, moving balls, noise."""

from __future__ import annotations

import numpy as np
import pytest
from law_streams import Stream, errors, formulas, learn, taught
from numpy.typing import NDArray

from relgym.envs.ball_box_ramp import BallBoxRampEnv
from relgym.experiments.data import BallExperiment, ball_episodes
from relgym.laws.learner import LawLearner
from relgym.laws.text import law_rows


def episodes(
    experiment: int | BallExperiment, count: int, *, seed: int = 0, test: bool = False
) -> list[Stream]:
    found = ball_episodes(experiment, seed=seed, episodes=count, test=test)
    return [Stream(b.schema, b.layout, b.vectors) for b in found]


def played(env: BallBoxRampEnv, count: int, *, seed: int) -> list[Stream]:
    streams = []
    for k in range(count):
        env.reset(seed=100 * seed + k)
        rows = [env.vector]
        for _ in range(200):
            env.step(0)
            rows.append(env.vector)
        streams.append(Stream(env.schema, env.schema.layout(), np.stack(rows)))
    return streams


# ---------------------------------------------------------------------- the thesis' experiments
@pytest.mark.parametrize(
    ("experiment", "count", "tangent"), [(1, 8, "u_t"), (2, 16, "max(0, u_t - 0.2 J_n)")]
)
def test_three_sentences_explain_every_step(experiment: int, count: int, tangent: str) -> None:
    learner = taught(episodes(experiment, count))
    bounce = {1: "-0.9", 2: "-0.95"}[experiment]
    assert formulas(learner.book) == [[f"max(u_n, {bounce} v_n)"], [tangent]]
    assert learner.book.pair is not None
    assert learner.book.pair.frame == "contact"
    assert len(law_rows(learner.book, ["ball"])) == 3
    assert errors(learner.book, episodes(experiment, 16, seed=1, test=True)) == (0, 0, 3200)


@pytest.mark.parametrize("incline", [15.0, 60.0])
def test_other_inclines_need_no_learning(incline: float) -> None:
    learner = taught(episodes(2, 12))
    away = episodes(BallExperiment(incline, 0.95, (0.2,), 8), 8, seed=1)
    assert errors(learner.book, away) == (0, 0, 1600)


def test_types_that_differ_in_friction() -> None:
    learner = taught(episodes(3, 16))
    normal, tangent = formulas(learner.book)
    assert normal == ["max(u_n, -0.95 v_n)"]
    assert sorted(tangent) == ["max(0, u_t - 0.1 J_n)", "max(0, u_t - 0.2 J_n)"]
    assert errors(learner.book, episodes(3, 12, seed=1, test=True))[0] == 0


def touching_only(kind: str, stream: Stream) -> NDArray[np.intp]:
    layout = stream.layout
    return np.array([k for k, i in enumerate(layout.bodies) if layout.types[i].name != kind], dtype=np.intp)


@pytest.mark.parametrize("experiment", [1, 2])
def test_the_floor_teaches_everything(experiment: int) -> None:
    wrong, abstained, _ = errors(
        _of_one_kind(experiment, "floor").book, episodes(experiment, 10, seed=1, test=True)
    )
    assert (wrong, abstained) == (0, 0)


@pytest.mark.parametrize("experiment", [1, 2])
def test_walls_alone_leave_open_what_gravity_does(experiment: int) -> None:
    learner = _of_one_kind(experiment, "wall", 24)
    wrong, abstained, _ = errors(learner.book, episodes(experiment, 10, seed=1, test=True))
    assert wrong == 0
    assert abstained > 0


def _of_one_kind(experiment: int, kind: str, count: int = 12) -> LawLearner:
    streams = episodes(experiment, count)
    learner = LawLearner(streams[0].schema, streams[0].schema.targets or (), seed=0)
    others = touching_only(kind, streams[0])
    layout = streams[0].layout
    ball = layout.bodies.index(layout.index("ball"))
    for stream in streams:
        learn(learner, stream, lambda touch: not touch[ball, others].any())
    return learner


def test_where_friction_has_changed_only_what_came_since_counts() -> None:
    learner = LawLearner(BallBoxRampEnv().schema, BallBoxRampEnv().schema.targets or (), seed=0)
    tangents, seen = [], []
    for friction in (0.1, 0.2):
        for stream in played(BallBoxRampEnv(friction=friction), 10, seed=int(10 * friction)):
            learn(learner, stream)
        tangents.append(formulas(learner.book)[1])
        seen.append(learner.contacts_seen)
    assert tangents == [["max(0, u_t - 0.1 J_n)"], ["max(0, u_t - 0.2 J_n)"]]
    assert learner.book.pair is not None and learner.book.pair.unexplained == 0
    assert errors(learner.book, played(BallBoxRampEnv(friction=0.2), 8, seed=7)) == (0, 0, 1600)
    assert learner.book.pair.examples < seen[1]  # those of before are forgotten


def test_what_is_met_late_is_no_change_of_the_world() -> None:
    world = BallBoxRampEnv(friction={"floor": 0.1, "box": 0.4, "ramp": 0.3, "wall": 0.2})
    learner = LawLearner(world.schema, world.schema.targets or (), seed=0)
    streams = played(world, 24, seed=3)
    others = touching_only("floor", streams[0])
    ball = streams[0].layout.bodies.index(streams[0].layout.index("ball"))
    for stream in streams[:8]:
        learn(learner, stream, lambda touch: not touch[ball, others].any())
    for stream in streams[8:]:
        learn(learner, stream)
    assert learner.book.pair is not None
    assert len(learner._store) == learner.contacts_seen  # all are kept
    told = " ".join(formulas(learner.book)[1])
    assert "u_t - 0.1 J_n" in told and "u_t - 0.3 J_n" in told


def test_the_same_stream_and_seed_give_the_same_laws() -> None:
    one, two = (taught(episodes(2, 3)).to_json(history=True) for _ in range(2))
    assert one == two


def test_it_goes_on_as_if_never_saved() -> None:
    streams = episodes(2, 5)
    whole = taught(streams)
    first = taught(streams[:2])
    again = LawLearner(first.schema, first.schema.targets or (), seed=7)
    again.restore(first.to_json(history=True), first.to_arrays())
    for stream in streams[2:]:
        learn(again, stream)
    assert again.to_json(history=True) == whole.to_json(history=True)
    for name, array in whole.to_arrays().items():
        assert again.to_arrays()[name].tobytes() == array.tobytes()


# ---------------------------------------------------------------------- other worlds
def test_balls_share_what_passes_between_them() -> None:
    env = BallBoxRampEnv(balls=3)
    learner = taught(played(env, 8, seed=1))
    assert formulas(learner.book) == [["max(u_n, -0.9 v_n)"], ["u_t"]]
    assert learner.book.shares["ball", "ball"].formula() == "0.5"
    assert errors(learner.book, played(env, 6, seed=2)) == (0, 0, 3600)


def test_every_material_has_its_own_law() -> None:
    bounces = {"floor": 0.9, "ramp": 0.6, "box": 0.3, "wall": 0.75, "ceiling": 0.9}
    env = BallBoxRampEnv(elasticity=bounces)
    learner = taught(played(env, 16, seed=1))
    normal, tangent = formulas(learner.book)
    assert set(normal) == {f"max(u_n, -{e:g} v_n)" for e in set(bounces.values())}
    assert tangent == ["u_t"]
    assert errors(learner.book, played(env, 6, seed=2))[0] == 0


@pytest.mark.parametrize("sd", [1e-6, 1e-4])
def test_noisy_positions(sd: float, rng: np.random.Generator) -> None:
    noisy = []
    for stream in episodes(2, 10):
        vectors = stream.vectors.copy()
        at = stream.layout.offsets[stream.layout.index("ball")]
        shift = rng.normal(size=(len(vectors) + 1, 2)) * sd
        vectors[:, at : at + 2] += shift[1:]
        vectors[:, at + 9 : at + 11] += shift[1:] - shift[:-1]
        noisy.append(Stream(stream.schema, stream.layout, vectors))
    pair = taught(noisy).book.pair
    assert pair is not None
    assert pair.frame == "contact"
    ((normal,), (tangent,)) = pair.axes
    weights = {name: weight for law in (normal, tangent) for p in law.pieces for name, weight in p.terms}
    assert weights["v_n"] == pytest.approx(-0.95, rel=0.01)
    assert weights["J_n"] == pytest.approx(-0.2, rel=0.01)
