"""Roll-outs of 200 steps, and why the failed ones failed (§4.8: figures 4.22 to 4.26, Table 4.18).

A ball that still overlaps what it has just bounced off looks as if it bounced again. Where the thesis' model said so,
and the surface was upright or a ramp's, "we manually corrected them in the results shown in figures 4.22 and 4.23". So
do these trials: there the roll-out goes on from what really came next. What becomes of them otherwise is told, too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.experiments.chapter4.learners import Learner, settings_of, taught
from relgym.experiments.chapter4.lesson import fresh_episodes
from relgym.experiments.chapter4.testing import scores_of
from relgym.experiments.data import THESIS_EXPERIMENTS, ball_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.rollouts import STRAY

__all__ = ["CAUSES", "STRAYS", "cause_of", "imagine", "occurrences", "trial_episodes"]

CAUSES: Final = (
    "bad collision resolution, vertical",
    "bad collision resolution, ramp slant",
    "bounce against a corner",
    "misclassified ramp bounce",
    "delayed falling",
    "bad collision resolution, level surface",
    "several contacts at once",
    "misclassified contact with a level surface",
    "other",
)
"""Rows of Table 4.18, and four that it doesn't have."""

STRAYS: Final = (1e-3, STRAY, 1e-1)
"""Position errors, in units, beyond which roll-outs are counted as failed; the thesis' axes are not readable."""

_MENDED: Final = ("bad collision resolution, vertical", "bad collision resolution, ramp slant")
"""What the thesis corrected by hand."""

_AFTERWARDS: Final = {
    "vertical": "bad collision resolution, vertical",
    "slope": "bad collision resolution, ramp slant",
    "level": "bad collision resolution, level surface",
    "slide": "delayed falling",
}
"""What a wrong step of free flight is called, by what the ball was last pushed by."""

_SIGNIFICANT: Final = 1e-6
"""Position error, in units, with which a failed roll-out begins to go wrong; all before is rounding."""

_CONFIGURATIONS: Final = 40

_RECENT: Final = 3
"""A body that was hit so few steps ago may still overlap."""


def imagine(
    *,
    learner: str,
    experiment: int,
    batches: Sequence[Sequence[int]],
    episodes: int,
    chosen_on: Mapping[str, Any],
    tests: Sequence[int],
    trials: int,
) -> dict[str, Any]:
    """Train on some batches, then let the most accurate model imagine whole episodes from their first scenes.

    The thesis took "the most accurate and most common models obtained in the 50 training batches" (§4.8).

    Parameters
    ----------
    learner, experiment, episodes
        The training (`relgym.experiments.chapter4.lesson`).
    batches
        Seed and order of each.
    chosen_on
        Examples by whose classification errors the model is chosen, as the tests of a lesson; not those of the trials.
    tests
        Seeds of the scenes, each shown in all 40 configurations as long as there are trials left.
    trials
        How many roll-outs; 80 in the thesis.

    Returns
    -------
    Plain data: errors of both coordinates by trial and step, paths, cause of every failure, and what was mended, all as
    the thesis shows them; by trial the largest error and the cause of a failure with nothing mended; counts of the
    bounces, and which batch was chosen.
    """
    model, chosen = _most_accurate(learner, experiment, batches, episodes, chosen_on)
    real = trial_episodes(experiment, tests, trials)
    bounces = Counter[str]()
    for episode in real:
        bounces.update(_surfaces(episode, experiment))
    mended, bare = (
        [
            _trial(*each, experiment)
            for each in zip(real, *_dreams(model, real, experiment, mend), strict=True)
        ]
        for mend in (True, False)
    )
    for trial, other in zip(mended, bare, strict=True):
        trial["unmended"] = {key: other[key] for key in ("largest", "cause")}
    return {"trials": mended, "bounces": dict(sorted(bounces.items())), "batch": chosen}


def occurrences(trials: Sequence[Mapping[str, Any]]) -> Counter[str]:
    """How often each row of Table 4.18 occurred: what was mended, and what made trials fail."""
    found = Counter(cause for trial in trials for _, cause in trial["mended"])
    found.update(trial["cause"] for trial in trials if trial["failed"])
    return found


def _most_accurate(
    learner: str,
    experiment: int,
    batches: Sequence[Sequence[int]],
    episodes: int,
    chosen_on: Mapping[str, Any],
) -> tuple[Learner, list[int]]:
    """The model of the batch with fewest classification errors, of both velocities together; and that batch."""
    setting = THESIS_EXPERIMENTS[experiment]
    fresh, laws = fresh_episodes(experiment, chosen_on), setting.modes()
    best: tuple[float, Learner, list[int]] | None = None
    for seed, order in batches:
        shown = ball_episodes(setting, seed=seed, order=order, episodes=episodes)
        model = taught(shown, settings_of(learner))
        if len(batches) == 1:
            return model, [seed, order]
        scores = scores_of(model, fresh, laws).values()
        # Where laws predict there are no modes to be confused: what is wrong counts.
        wrong = float(sum(s["counted"].get("strict", s["counted"]["wrong"]) for s in scores))
        if best is None or wrong < best[0]:
            best = wrong, model, [seed, order]
    assert best is not None, "there is at least one batch"
    return best[1], best[2]


def trial_episodes(experiment: int, tests: Sequence[int], trials: int) -> list[Episode]:
    """What really happens in the trials: number k shows configuration ``k mod 40``, one seed after the other."""
    found: list[Episode] = []
    for seed in tests:
        count = min(_CONFIGURATIONS, trials - len(found))
        setting = THESIS_EXPERIMENTS[experiment]
        rooms = ball_episodes(setting, seed=seed, episodes=_CONFIGURATIONS, order=None, test=True)
        found += islice(rooms, count)
    return found


def _dreams(
    model: Learner, real: Sequence[Episode], experiment: int, mend: bool
) -> tuple[NDArray[np.float64], list[int], list[list[tuple[int, str]]]]:
    """All roll-outs side by side, shape ``(trials, steps + 1, width)``; one that stopped repeats its last scene.

    Also how many steps of each were predicted; and which steps were mended, and of what.
    """
    truth = np.stack([episode.vectors for episode in real])
    places, speeds = _columns(real[0], "px", "py"), _columns(real[0], "vx", "vy")
    dreamed, steps = np.repeat(truth[:, :1], truth.shape[1], axis=1), [truth.shape[1] - 1] * len(truth)
    mended: list[list[tuple[int, str]]] = [[] for _ in real]
    going = np.arange(len(truth))
    right = np.full(len(truth), mend)
    for k in range(1, truth.shape[1]):
        step = model.predict_batch(real[0].layout, dreamed[going, k - 1])
        for stopped in going[~step.ok].tolist():
            steps[stopped] = k - 1
        going = going[step.ok]
        dreamed[going, k:] = step.vectors[step.ok][:, None]
        off = np.abs(dreamed[:, k][:, places] - truth[:, k][:, places]).max(axis=1) > _SIGNIFICANT
        for trial in going[right[going] & off[going]].tolist():
            cause = cause_of(real[trial], k - 1, experiment, dreamed[trial, k, speeds])
            if cause in _MENDED:
                mended[trial].append((k, cause))
                dreamed[trial, k:] = truth[trial, k]
            else:
                right[trial] = False
    return dreamed, steps, mended


def _columns(episode: Episode, *properties: str) -> list[int]:
    ball = episode.layout.index("ball")
    return [episode.layout.column(ball, prop) for prop in properties]


def _trial(
    episode: Episode,
    dreamed: NDArray[np.float64],
    steps: int,
    mended: Sequence[tuple[int, str]],
    experiment: int,
) -> dict[str, Any]:
    places = _columns(episode, "px", "py")
    off = np.abs(dreamed[:, places] - episode.vectors[:, places])
    off[steps + 1 :] = np.inf  # it said nothing there
    failed = bool((off > STRAY).any())
    begins = int(np.argmax((off > _SIGNIFICANT).any(axis=1))) if failed else -1
    said = dreamed[begins, _columns(episode, "vx", "vy")]
    return {
        "errors": [[_finite(v) for v in column] for column in off.T.tolist()],
        "largest": _finite(float(off.max())),
        "corner": bool(episode.truth.corner.any()),
        "failed": failed,
        "stopped": steps < len(episode),
        "begins": begins,
        "cause": cause_of(episode, begins - 1, experiment, said) if failed else "",
        "mended": [list(each) for each in mended],
        "real": episode.vectors[:, places].tolist(),
        "imagined": dreamed[:, places].tolist(),
    }


def _finite(value: float) -> float | None:
    """JSON knows no infinity."""
    return value if np.isfinite(value) else None


def cause_of(episode: Episode, step: int, experiment: int, said: NDArray[np.float64]) -> str:
    """Which row of Table 4.18 a failure belongs to, by what really happened in the step that went wrong.

    Parameters
    ----------
    episode
        What really happened.
    step
        The first transition whose result is off.
    experiment
        1 or 2.
    said
        Velocities that the model predicted, shape ``(2,)``.
    """
    surfaces = _surface_names(episode, experiment)
    if episode.truth.corner[step]:
        return "bounce against a corner"
    again = _again(episode, step, experiment, said, surfaces)
    if again:
        return _AFTERWARDS[again]
    if episode.truth.active[step] > 1:
        return "several contacts at once"
    if surfaces[step] in ("vertical", "slope"):
        return "misclassified ramp bounce"
    if surfaces[step] in ("level", "slide"):
        return "misclassified contact with a level surface"
    return "delayed falling" if "slide" in surfaces[max(0, step - _RECENT) : step] else "other"


def _again(
    episode: Episode, step: int, experiment: int, said: NDArray[np.float64], surfaces: Sequence[str]
) -> str:
    """Which surface is said to push the ball once more that did so in the last steps, and still overlaps; or none."""
    truth = episode.truth
    recent = range(max(0, step - _RECENT), step)
    hits = [j for j in recent if truth.pushing[j] & (truth.touched[step] - truth.pushing[step])]
    if not hits:
        return ""
    now, after = episode.columns("ball", "vx", "vy")[step : step + 2]
    modes = THESIS_EXPERIMENTS[experiment].modes()
    kinds: set[str] | None = None
    for axis, listed in enumerate((modes.x, modes.y)):
        if abs(said[axis] - after[axis]) > _SIGNIFICANT:
            here = {
                _kind(case.surface, case.sliding)
                for mode in listed
                if abs(mode.predict(now[None])[0] - said[axis]) <= _SIGNIFICANT
                for case in mode.cases
            }
            kinds = here if kinds is None else kinds & here
    if kinds and "slide" in kinds:
        # Where a ball doesn't rise or fall a level bounce says the same as sliding: what it did last tells them apart.
        kinds = kinds - {"level", "slide"} | {"slide" if surfaces[hits[-1]] == "slide" else "level"}
    return next((kind for kind in _AFTERWARDS if kind in (kinds or ())), "")


def _surfaces(episode: Episode, experiment: int) -> Mapping[str, int]:
    """How many bounces there were against which kind of surface; of a ball that slides, too, against upright ones."""
    names = _surface_names(episode, experiment)
    x = episode.columns("ball", "vx")[:, 0]
    turned = (x[:-1] * x[1:] < 0.0) & (episode.truth.active > 1) & ~episode.truth.corner
    upright = [name == "?" and bool(back) for name, back in zip(names, turned, strict=True)]
    single = Counter(name for name in names if name in ("vertical", "slope", "level"))
    return single + Counter({"vertical": sum(upright)})


def _surface_names(episode: Episode, experiment: int) -> list[str]:
    """Per transition: what the ball was pushed by; ``none``, ``slide``, ``level``, ``vertical``, ``slope``, ``?``."""
    modes = THESIS_EXPERIMENTS[experiment].modes()
    kinds = []
    for listed, axis in ((modes.x, "ball.vx"), (modes.y, "ball.vy")):
        options = [{_kind(case.surface, case.sliding) for case in mode.cases} for mode in listed]
        kinds.append([options[k] if k >= 0 else {"?"} for k in episode.truth.mode[axis].tolist()])
    return [
        "none" if active == 0 else next(iter(sorted((x & y) - {"none"})), "?")
        for x, y, active in zip(*kinds, episode.truth.active.tolist(), strict=True)
    ]


def _kind(surface: str, sliding: bool) -> str:
    if surface in ("left face", "right face"):
        return "vertical"
    if surface in ("floor", "ceiling"):
        return "slide" if sliding else "level"
    return surface
