"""``relgym eval`` and ``relgym rollout``: a model on fresh episodes of its env."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice

from relgym.console.models import ModelInEnv
from relgym.experiments.evaluate import Evaluation, evaluate
from relgym.experiments.fresh import fresh_episodes, transitions
from relgym.experiments.horizons import Horizons, horizons
from relgym.experiments.rollouts import RolloutErrors, rollouts
from relgym.experiments.scores import Score, score
from relgym.experiments.truth import true_episodes

__all__ = ["Evaluated", "RolledOut", "evaluated", "rolled_out"]

_RULE = "─" * 80


@dataclass(frozen=True, slots=True)
class Evaluated:
    """Errors one step ahead.

    Attributes
    ----------
    env
        Id of the env.
    score
        Errors by target.
    truth
        Errors by what really happened, in the home worlds; else None.
    scenes
        What is special about the scenes that `truth` is of.
    """

    env: str
    score: Score
    truth: Evaluation | None
    scenes: str = ""

    def __str__(self) -> str:
        parts = [f"{self.env}, random actions\n\n{self.score}"]
        if self.truth is not None:
            parts.append(
                f"{_RULE}\nOn the thesis' test scenes ({self.scenes}), by what really happened\n\n{self.truth}"
            )
        return "\n\n".join(parts)


@dataclass(frozen=True, slots=True)
class RolledOut:
    """Errors of whole episodes.

    Attributes
    ----------
    env
        Id of the env.
    horizons
        How the errors grow.
    truth
        Roll-outs with and without a corner that was hit, in the home worlds; else None.
    scenes
        What is special about the scenes that `truth` is of.
    """

    env: str
    horizons: Horizons
    truth: RolloutErrors | None
    scenes: str = ""

    def __str__(self) -> str:
        parts = [f"{self.env}, random actions\n\n{self.horizons}"]
        if self.truth is not None:
            parts.append(f"{_RULE}\nOn the thesis' test scenes ({self.scenes})\n\n{self.truth}")
        return "\n\n".join(parts)


def evaluated(found: ModelInEnv, *, steps: int, seed: int) -> Evaluated:
    """Test a model one step ahead on so many fresh steps."""
    fresh = transitions(fresh_episodes(found.env, found.view, seed=seed, most=steps), steps)
    scored = score(found.model, fresh, found.view.precision)
    known = true_episodes(found.env_id, found.arguments, found.model.schema, seed=seed)
    if known is None:
        return Evaluated(found.env_id, scored, None)
    episodes = list(known.episodes(-(-steps // known.steps)))
    return Evaluated(found.env_id, scored, evaluate(found.model, episodes, known.laws), known.scenes)


def rolled_out(found: ModelInEnv, *, trials: int, steps: int, seed: int) -> RolledOut:
    """Let a model imagine so many fresh episodes, of so many steps at most."""
    fresh = list(islice(fresh_episodes(found.env, found.view, seed=seed, most=steps), trials))
    errors = horizons(found.model, fresh)
    known = true_episodes(found.env_id, found.arguments, found.model.schema, seed=seed)
    if known is None or steps < known.steps:
        return RolledOut(found.env_id, errors, None)
    return RolledOut(found.env_id, errors, rollouts(found.model, list(known.episodes(trials))), known.scenes)
