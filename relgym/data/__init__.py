"""Learning from data that an env has left behind: arrays, episodes, Minari data sets; imported as ``relgym.data``."""

from __future__ import annotations

from relgym.data.dataset import Dataset, Episode
from relgym.data.learner import DataLearner, fit, progressive, score

__all__ = ["DataLearner", "Dataset", "Episode", "fit", "progressive", "score"]
