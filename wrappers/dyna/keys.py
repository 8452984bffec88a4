"""Names in observations that Stable-Baselines3's policies can't take."""

from __future__ import annotations

from typing import Any

from gymnasium import spaces

from relgym.errors import ConfigError

__all__ = ["check_keys"]


def check_keys(space: spaces.Space[Any]) -> None:
    """Refuse a Dict with a dot in a key now; PyTorch would when a policy is made, and not say what to do.

    Raises
    ------
    ConfigError
        Such a key; the text says how to rename it.
    """
    if not isinstance(space, spaces.Dict):
        return
    dotted = [key for key in space.spaces if "." in key]
    if dotted:
        renamed = {key: key.replace(".", "_") for key in dotted}
        raise ConfigError(
            f"observations have keys with a dot, {dotted}, which Stable-Baselines3's policies can't have as names of "
            f"their parts: rename them ({renamed}) with gymnasium.wrappers.TransformObservation, or wrap the env in "
            "gymnasium.wrappers.FlattenObservation and use MlpPolicy"
        )
