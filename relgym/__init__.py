"""Learn a readable model of what actions do, online, while an agent acts."""

from __future__ import annotations

from pathlib import Path

# Python started in a checkout takes ./relgym before an installed wheel; envs/ and wrappers/ lie beside it.
_ROOT = Path(__file__).resolve().parent.parent
if (_ROOT / "pyproject.toml").is_file() and (_ROOT / "envs" / "__init__.py").is_file():
    __path__.append(str(_ROOT))
