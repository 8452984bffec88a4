"""All free parameters of relgym, as frozen dataclasses.

Every field says what it means, its symbol and section in the thesis where it has one, its default and range,
and what raising it does. Nothing here imports the rest of the package.
"""

from __future__ import annotations

from relgym.config.classification import ClassificationConfig
from relgym.config.clustering import ClusteringConfig
from relgym.config.model import ModelConfig

__all__ = ["ClassificationConfig", "ClusteringConfig", "ModelConfig"]
