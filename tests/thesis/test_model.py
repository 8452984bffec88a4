"""The whole system on small forms of experiments 1 and 2 and on box pushing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relgym.errors import ConfigError, QueryError, SchemaError
from relgym.experiments.data import THESIS_EXPERIMENTS, ball_episodes, truck_episodes
from relgym.experiments.episodes import Episode
from relgym.thesis.model import ThesisModel
from relgym.thesis.settings import DEVIATIONS, ThesisSettings

SEED = 901


def taught(episodes: list[Episode], settings: ThesisSettings) -> ThesisModel:
    model = ThesisModel(episodes[0].schema, settings)
    for episode in episodes:
        for transition in episode.transitions():
            model.learn_one(transition)
    return model


@pytest.fixture(scope="module")
def one() -> list[Episode]:
    return list(ball_episodes(THESIS_EXPERIMENTS[1], seed=SEED, episodes=40))


@pytest.fixture(scope="module")
def models(one: list[Episode]) -> dict[str, ThesisModel]:
    return {name: taught(one, getattr(ThesisSettings, name)()) for name in ("thesis", "original")}


@pytest.mark.parametrize("name", ["thesis", "original"])
def test_experiment_1_has_the_modes_of_table_4_2(models: dict[str, ThesisModel], name: str) -> None:
    model = models[name]
    assert {m.formula(3) for m in model.modes("ball", "vx")} >= {
        "vx' = vx",
        "vx' = -0.9 vx",
        "vx' = 0.525 vx - 0.823 vy + 0.000424",
    }
    assert {m.formula(3) for m in model.modes("ball", "vy")} >= {"vy' = vy - 0.00098", "vy' = 0"}
    for prop in ("vx", "vy"):
        counted = sum(m.examples for m in model.modes("ball", prop)) + model.noise("ball", prop)
        assert counted == model.seen == 8000


def test_its_clauses_are_those_of_table_4_3(models: dict[str, ThesisModel]) -> None:
    (x, _) = models["thesis"].report().targets
    straight = next(m.mode for m in x.modes if m.function == "vx' = vx")
    bounce = next(m.mode for m in x.modes if m.function == "vx' = -0.9 vx")
    (pair,) = [p for p in x.pairs if {p.mode, p.other} == {straight, bounce}]
    assert {"¬intersect(A, *)", "¬y-aligned(A, *)"} <= {row.clause for row in pair.rows}
    assert pair.performance > 0.99


def test_bounces_fail_and_flights_do_not(models: dict[str, ThesisModel]) -> None:
    tests = list(ball_episodes(THESIS_EXPERIMENTS[1], seed=SEED + 1, episodes=20, test=True))
    before = np.concatenate([e.vectors[:-1] for e in tests])
    after = np.concatenate([e.vectors[1:] for e in tests])
    layout = tests[0].layout
    column = layout.column(layout.index("ball"), "vy")
    truth = np.concatenate([e.truth.mode["ball.vy"] for e in tests])
    names = tests[0].truth.mode_names["ball.vy"]
    for model in models.values():
        found = model.predict_batch(layout, before)
        wrong = np.abs(found.vectors[:, column] - after[:, column]) > 1e-9
        rates = {name: wrong[truth == k].mean() for k, name in enumerate(names) if (truth == k).any()}
        assert rates["fly"] < 0.01 and rates["slide, floor"] < 0.01
        assert rates["bounce, floor"] > 0.05  # looks like sliding (§4.3.4)
        assert found.parts == (("ball", "vx"), ("ball", "vy"))


def test_friction_has_a_mode_for_each_direction() -> None:
    episodes = list(ball_episodes(THESIS_EXPERIMENTS[2], seed=SEED, episodes=40))
    model = taught(episodes, ThesisSettings.thesis())
    found = {m.formula(3) for m in model.modes("ball", "vx")}
    assert {"vx' = vx", "vx' = -0.95 vx"} <= found
    assert {f.replace(" + 0.39 vy", "").replace(" - 0.39 vy", "") for f in found} >= {
        "vx' = vx - 0.000196",
        "vx' = vx + 0.000196",
    }


def test_box_pushing_is_table_3_1() -> None:
    settings = ThesisSettings.original(context="all")
    model = taught(list(truck_episodes(seed=SEED, repeats=1)), settings)
    modes = model.modes("truck", "vx")
    assert sorted(sorted(w for r in m.open_roles for _, w in r.terms if w < 0) for m in modes) == [
        [pytest.approx(-7.5)],
        [pytest.approx(-5.0), pytest.approx(-2.5)],
        [pytest.approx(-2.5)] * 3,
    ]
    assert model.noise("truck", "vx") == 0
    tests = list(truck_episodes(seed=SEED, repeats=1, test=True))[::4]
    for episode in tests:
        found = model.predict_batch(episode.layout, episode.vectors[:-1])
        column = episode.layout.column(episode.layout.index("truck"), "vx")
        np.testing.assert_allclose(found.vectors[:, column], episode.vectors[1:, column], atol=1e-9)


def test_the_same_stream_gives_the_same_model(one: list[Episode]) -> None:
    first, second = (taught(one[:8], ThesisSettings.original()).describe() for _ in range(2))
    assert first == second


def test_nothing_is_predicted_before_anything_is_learned(one: list[Episode]) -> None:
    model = ThesisModel(one[0].schema)
    found = model.predict_batch(one[0].layout, one[0].vectors[:2])
    assert not found.ok.any() and not found.modes.any()
    with pytest.raises(QueryError, match=r"no target ball\.px; there are"):
        model.modes("ball", "px")
    with pytest.raises(SchemaError, match="learns declared targets"):
        ThesisModel(replace(one[0].schema, targets=None))


def test_settings_say_what_is_out_of_range() -> None:
    with pytest.raises(ConfigError, match=r"unify_ratio must lie in \(0, 1\], got 2"):
        ThesisSettings.thesis(unify_ratio=2)
    with pytest.raises(ConfigError, match="noise_variance must be a positive number"):
        ThesisSettings(noise_variance=0.0)


def test_deviations_say_where_and_why() -> None:
    assert len({(d.preset, d.section, d.printed) for d in DEVIATIONS}) == len(DEVIATIONS)
    for each in DEVIATIONS:
        assert each.preset in ("thesis", "original", "both") and all((each.section, each.here, each.reason))
