"""What to do when a model has been learned."""

from __future__ import annotations

import shlex

from relgym.console.learning import Round

__all__ = ["next_steps"]


def next_steps(learned: Round) -> dict[str, str]:
    """Commands that make sense next, and what each does."""
    file = shlex.quote(learned.file)
    found = {}
    if learned.advised:
        features = ",".join((*learned.features, *learned.advised))
        again = f"relgym learn {shlex.quote(learned.env_id)} --features {shlex.quote(features)} --out {file}"
        found[again] = "learns again with the features that are advised (or: --follow-advice)"
    return found | {
        f"relgym rules {file}": "prints the model",
        f"relgym explain {file}": "says why it predicts what it predicts",
        f"relgym eval {file}": "tests it on other fresh steps",
        f"relgym rollout {file}": "shows how far ahead it holds",
    }
