"""What to do when a model has been learned."""

from __future__ import annotations

import shlex

from relgym.console.learning import Round, switch

__all__ = ["next_steps"]


def next_steps(learned: Round) -> str:
    """Commands that make sense next, and what each does, as text."""
    file = shlex.quote(learned.file)
    found = {
        f"relgym rules {file}": "print the model",
        f"relgym explain {file}": "why it predicts what it predicts, in a scene",
        f"relgym eval {file}": "test it on other fresh steps",
        f"relgym rollout {file}": "how far ahead it holds",
    }
    width = max(map(len, found))
    lines = ["Next", *(f"  {command:<{width}}  {text}" for command, text in found.items())]
    if learned.advised:
        more = switch((*learned.features, *learned.advised))
        lines.append(f"or learn again with what is advised: {more}, or --follow-advice")
    return "\n".join(lines)
