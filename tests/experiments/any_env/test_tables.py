"""Recordings of envs that can't be installed here: written, read, learned from, and evaluated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from relgym.envs.views import Rows, Static, TableView
from relgym.errors import ConfigError
from relgym.experiments.any_env.data import size
from relgym.experiments.any_env.pong import KINDS, kinds_of, names
from relgym.experiments.any_env.recorded import Rows as Seen
from relgym.experiments.any_env.recorded import live, stream
from relgym.experiments.any_env.suite import SUITE
from relgym.experiments.benchmark import main
from relgym.experiments.recording import Recording, record
from relgym.experiments.seeds import TUNING_SEEDS
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Target
from relgym.scene.shapes import Box


class Bounce(gym.Env[Any, Any]):
    """A table of three: a ball between floor and ceiling, two paddles far away; whole numbers, v' = -v at a wall."""

    def __init__(self) -> None:
        self.observation_space = spaces.Box(-300.0, 300.0, (3, 7), np.float64)
        self.action_space = spaces.Discrete(6)
        self.y, self.dy, self.steps = 100.0, 2.0, 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.y, self.dy, self.steps = float(self.np_random.integers(60, 120)), 2.0, 0
        return self._table(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        if self.y + self.dy > 178.0 or self.y + self.dy < 15.0:
            self.dy = -self.dy
        self.y += self.dy
        self.steps += 1
        return self._table(), 0.0, self.steps >= 150, False, {}

    def _table(self) -> Any:
        ball = [1.0, 80.0, self.y, 2.0, 2.0, 0.0, self.dy]
        return np.array(
            [[1.0, 142.0, 50.0, 4.0, 15.0, 0.0, 0.0], ball, [0.0, 18.0, 50.0, 4.0, 15.0, 0.0, 0.0]]
        )


def view() -> TableView:
    env = Bounce()
    body: dict[str, Any] = {
        "shape": Box(),
        "pose": {"px": "x", "py": "y", "sx": "w", "sy": "h"},
        "velocity": ("dx", "dy", None),
    }
    walls = [
        Static(name, {"px": 80.0, "py": y, "sx": 400.0, "sy": 20.0}, type="wall", shape=Box())
        for name, y in (("ceiling", 189.0), ("floor", 4.0))
    ]
    return TableView(
        env.observation_space,
        env.action_space,
        columns=("here", "x", "y", "w", "h", "dx", "dy"),
        rows=[Rows(n, type="ball" if n == "ball" else "paddle", **body) for n in ("player", "ball", "enemy")],
        presence="here",
        static=walls,
        offsets=True,
    )


def played(steps: int, seed: int = 0) -> Recording:
    return record(Bounce(), view(), lambda _, rng: int(rng.integers(6)), steps, seed)


@pytest.fixture(scope="module")
def lived() -> tuple[Recording, WorldModel, dict[str, Seen]]:
    recording = played(900)
    return (recording, *live(recording, [Target("ball", "dy")]))


def test_a_recording_is_what_was_seen(tmp_path: Path) -> None:
    recording = played(320)
    recording.save(tmp_path / "some.npz")
    again = Recording.load(tmp_path / "some.npz")
    assert again.view.schema == recording.view.schema
    assert [s.first for s in again] == [k in (0, 150, 300) for k in range(320)]
    for step, other in zip(recording, again, strict=True):
        np.testing.assert_array_equal(step.before, other.before)
        assert (step.action, step.terminated) == (other.action, other.terminated)
    steps = list(again)
    np.testing.assert_array_equal(steps[7].after, steps[8].before)
    assert not np.array_equal(steps[149].after, steps[150].before)


def test_every_step_is_predicted_before_it_is_learned(
    lived: tuple[Recording, WorldModel, dict[str, Seen]],
) -> None:
    recording, model, rows = lived
    columns = rows["ball"].columns()
    assert columns["step"].tolist() == list(range(900))
    assert columns["ended"].sum() == 6
    np.testing.assert_array_equal(columns["now"][:, 0], recording.before[:, 1, 6])
    np.testing.assert_array_equal(
        columns["change"][:, 0], recording.after[:, 1, 6] - recording.before[:, 1, 6]
    )
    assert set(columns["change"][:, 0]) == {-4.0, 0.0, 4.0}
    assert not columns["sure"][0, 0] and columns["said"][0, 0] == 0.0
    assert [m.formula(3) for m in model.modes("ball", "dy")] == ["dy' = dy", "dy' = -dy"]
    early = rows["ball"].until(10)
    assert early.step == list(range(10)) and len(early.seen) == 10


def test_walls_are_exact_and_named_on_fresh_games(
    lived: tuple[Recording, WorldModel, dict[str, Seen]],
) -> None:
    _, model, _ = lived
    _, tested = live(played(300, seed=5), (), model=model, learn=False)
    columns = tested["ball"].columns()
    assert (columns["change"] != 0.0).sum() >= 2
    np.testing.assert_array_equal(columns["said"], columns["change"])
    assert not names(model, Target("ball", "dy"), "paddle")


def test_the_stream_is_compared_with_what_others_say(
    lived: tuple[Recording, WorldModel, dict[str, Seen]], capsys: pytest.CaptureFixture[str]
) -> None:
    _, _, rows = lived
    columns = rows["ball"].columns()
    np.testing.assert_array_equal(columns["last"][1:150], columns["change"][:149])
    assert size(columns["change"], columns["change"], columns["ended"] | True)[0] == pytest.approx(
        1.0, abs=0.01
    )
    found = list(stream("ball", rows["ball"], verbose=True, batch=False))
    assert len(found) == 2 and max(value for _, _, value, _ in found) < 1.05
    text = capsys.readouterr().out
    assert "ball.dy, all steps" in text and "constant velocity" in text


def test_what_happened_to_the_ball_is_told_by_its_displacements() -> None:
    before = np.array([[2, 1], [2, 1], [2, 1], [2, -2], [2, -2], [-2, 3]], dtype=float)
    after = np.array([[2, 1], [-2, 1], [-2, -1], [2, 3], [2, 3], [-2, 2]], dtype=float)
    y = np.array([100.0, 100.0, 178.0, 16.0, 100.0, 20.0])
    found = [KINDS[k] for k in kinds_of(before, after, y)]
    assert found == ["flight", "paddle", "paddle", "wall", "other change", "other change"]


def test_the_command_measures_pong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, seed in (("", 0), ("-test", 5)):
        recording = played(400, seed)
        before, after = recording.before.copy(), recording.after.copy()
        # Every twenty frames, whatever it is that does it.
        turned = np.where(np.arange(401) // 20 % 2, 1.0, -1.0)
        before[:, 1, 5], after[:, 1, 5] = turned[:-1], turned[1:]
        changed = replace(recording, before=before, after=after)
        changed.save(tmp_path / f"pong{name}-{TUNING_SEEDS[0]}.npz")
    options = ["--tuning", "--quick", "--recordings", str(tmp_path), "--out", str(tmp_path / "out")]
    main(SUITE, ["pong", *options])
    text = capsys.readouterr().out
    assert "paddles, sign of dx" in text
    assert "a clause names the wall" in text
    assert [line.split()[1] for line in text.splitlines() if line.startswith("paddle ")] == ["20"]


def test_what_was_never_recorded_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="pong is learned from recordings, and no folder was named"):
        main(SUITE, ["pong", "--out", str(tmp_path)])
