from __future__ import annotations

import numpy as np
import pytest

from relgym.baselines.features import ContactFeatures, ThesisFeatures, columns, features
from relgym.errors import ConfigError, SchemaError
from relgym.experiments.data import BALL_EXPERIMENTS, ball_episodes

*_, EPISODE = ball_episodes(1, seed=100, episodes=3, order=None)  # the ball begins in the air
ROWS = EPISODE.vectors[:-1]


def test_thesis_features_are_all_numbers_around_the_ball() -> None:
    seen = ThesisFeatures(EPISODE.schema, "ball")
    x = seen.rows(EPISODE.layout, ROWS)
    assert x.shape == (200, EPISODE.layout.width) and len(seen.names) == EPISODE.layout.width
    place = {name: k for k, name in enumerate(seen.names)}
    assert not x[:, [place["ball.px"], place["ball.py"]]].any()
    far = EPISODE.columns("box", "px")[:-1, 0] - EPISODE.columns("ball", "px")[:-1, 0]
    np.testing.assert_array_equal(x[:, place["box.px"]], far)
    np.testing.assert_array_equal(
        x[:, list(columns(seen, ("vx", "vy")))], EPISODE.columns("ball", "vx", "vy")[:-1]
    )


def test_centred_rows_do_not_see_where_the_scene_lies() -> None:
    moved = ROWS.copy()
    for i in EPISODE.layout.bodies:
        moved[:, EPISODE.layout.column(i, "px")] += 3.0
    centred, raw = (ThesisFeatures(EPISODE.schema, "ball", centred=c) for c in (True, False))
    np.testing.assert_allclose(
        centred.rows(EPISODE.layout, moved), centred.rows(EPISODE.layout, ROWS), atol=1e-12
    )
    assert np.abs(raw.rows(EPISODE.layout, moved) - raw.rows(EPISODE.layout, ROWS)).max() == 3.0


def test_contact_features_name_what_touches() -> None:
    seen = ContactFeatures(EPISODE.schema, "ball")
    x = dict(zip(seen.names, seen.rows(EPISODE.layout, ROWS).T, strict=True))
    touching = x["1.touching"] > 0
    assert 0 < touching.sum() < 200
    assert (x["1.distance"][touching] <= 1e-9).all() and (x["1.distance"][~touching] > 1e-9).all()
    assert (x["1.distance"] <= x["2.distance"]).all()
    kinds = [x[f"1.is-{kind}"] for kind in ("ball", "box", "ceiling", "floor", "ramp", "wall")]
    np.testing.assert_array_equal(np.sum(kinds, axis=0), np.ones(200))
    assert columns(seen, ("vx", "vy")) == tuple(seen.names.index(v) for v in ("vx", "vy"))


def test_only_contacts_can_tell_of_a_missing_object() -> None:
    from dataclasses import replace

    alone = replace(BALL_EXPERIMENTS[1], objects=("box",))
    room = next(iter(ball_episodes(alone, seed=100, episodes=1)))
    layout = EPISODE.schema.layout(room.layout.names)
    assert ContactFeatures(EPISODE.schema, "ball").rows(layout, room.vectors).shape == (201, 26)
    with pytest.raises(SchemaError, match="can't tell which is missing"):
        ThesisFeatures(EPISODE.schema, "ball").rows(layout, room.vectors)


def test_unknown_features() -> None:
    with pytest.raises(ConfigError, match="features 'pixels': expected one of"):
        features("pixels", EPISODE.schema, "ball")
    with pytest.raises(ConfigError, match="contacts must be at least 1"):
        ContactFeatures(EPISODE.schema, "ball", contacts=0)
