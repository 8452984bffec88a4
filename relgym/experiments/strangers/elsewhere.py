"""Worlds of other packages, of kinds that nothing was made for: Atari's memory, several objectives, a flapping bird.

Gymnasium makes each of them once this module is imported; the packages are those of the extra ``bench-elsewhere``, and
are imported when an env is made. Atari's observation is the console's memory of 128 bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from importlib.util import find_spec
from typing import Any, Final

import gymnasium as gym

from relgym.errors import ConfigError

__all__ = ["ELSEWHERE", "WORLDS"]

WORLDS: Final[Mapping[str, tuple[str, Mapping[str, Any]]]] = {
    "Pong": ("ale_py:ALE/Pong-v5", {"obs_type": "ram"}),
    "Breakout": ("ale_py:ALE/Breakout-v5", {"obs_type": "ram"}),
    "Freeway": ("ale_py:ALE/Freeway-v5", {"obs_type": "ram"}),
    "SpaceInvaders": ("ale_py:ALE/SpaceInvaders-v5", {"obs_type": "ram"}),
    "FlappyBird": ("flappy_bird_gymnasium:FlappyBird-v0", {"use_lidar": False}),
    "Minecart": ("mo_gymnasium:minecart-v0", {}),
    "FourRoom": ("mo_gymnasium:four-room-v0", {}),
    "ResourceGathering": ("mo_gymnasium:resource-gathering-v0", {}),
    "WaterReservoir": ("mo_gymnasium:water-reservoir-v0", {}),
    "DeepSeaTreasure": ("mo_gymnasium:deep-sea-treasure-v0", {}),
    "FruitTree": ("mo_gymnasium:fruit-tree-v0", {}),
}
"""Gymnasium's id, with the package that registers it, and options, by name."""

ELSEWHERE: Final = tuple(f"relgym-elsewhere/{name}-v0" for name in WORLDS)
"""Ids that `gymnasium.make` knows once this module is imported."""


def _made(name: str, **options: Any) -> gym.Env[Any, Any]:
    env_id, given = WORLDS[name]
    package = env_id.partition(":")[0]
    if find_spec(package) is None:
        raise ConfigError(f"{package} is not installed: pip install 'relgym[bench-elsewhere]'")
    return gym.make(env_id, **given, **options)


for _id, _name in zip(ELSEWHERE, WORLDS, strict=True):
    gym.register(_id, partial(_made, _name))
