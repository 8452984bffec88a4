"""Learners by name: the thesis' own system and relgym, asked the same questions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.mode import Mode
from relgym.clustering.roles import bind
from relgym.config import ModelConfig
from relgym.errors import ConfigError
from relgym.experiments.episodes import Episode
from relgym.model.percepts.perception import Perception
from relgym.model.reports.report import report
from relgym.model.reports.tables import ModelReport
from relgym.model.world_model import WorldModel
from relgym.scene.objects import SceneLayout
from relgym.scene.schema import SceneSchema
from relgym.thesis.model import ThesisModel
from relgym.thesis.settings import ThesisSettings

__all__ = [
    "Learner",
    "governed",
    "learner_of",
    "mode_values",
    "modes_of",
    "noise_of",
    "report_of",
    "settings_of",
    "taught",
    "trees_of",
]

Learner: TypeAlias = WorldModel | ThesisModel

_ORIGINAL: Final[Mapping[str, Mapping[str, Any]]] = {
    "original": {},
    "original, all examples test": {"grow_share": 1.0},
    "original, trees for rare modes": {"tree_least": 3, "tree_success": 0.95},
    "original, either class positive or not": {"polarities": False},
}


def settings_of(learner: str) -> ThesisSettings | ModelConfig:
    """Parameters of a learner by name (`relgym.experiments.chapter4.protocol`: `LEARNERS`, `ABLATIONS`).

    ``"one-polarity"`` is the thesis' learner without §3.4.5: the first mode of a pair is always the positive class.
    """
    known: dict[str, ThesisSettings | ModelConfig] = {
        **{name: ThesisSettings.original(**changes) for name, changes in _ORIGINAL.items()},
        "thesis": ThesisSettings.thesis(),
        "one-polarity": ThesisSettings.thesis(polarities=False),
        "world": ModelConfig(frames="world"),
        "default": ModelConfig(),
    }
    if learner not in known:
        raise ConfigError(f"learner {learner!r}: expected one of {sorted(known)}")
    return known[learner]


def learner_of(settings: ThesisSettings | ModelConfig, schema: SceneSchema) -> Learner:
    """An empty learner of a schema's scenes."""
    if isinstance(settings, ThesisSettings):
        return ThesisModel(schema, settings)
    return WorldModel(schema, settings)


def taught(episodes: Iterable[Episode], settings: ThesisSettings | ModelConfig) -> Learner:
    """What some episodes teach; its classifiers are up to date."""
    model: Learner | None = None
    for episode in episodes:
        model = model or learner_of(settings, episode.schema)
        for transition in episode.transitions():
            model.learn_one(transition)
    assert model is not None, "no episodes, no schema"
    model.finish()
    return model


def governed(model: Learner, target: str) -> bool:
    """Whether laws of contacts predict a target, and no modes."""
    if isinstance(model, ThesisModel):
        return False
    return model.governs(model.property_model(*target.split(".")).target)


def modes_of(model: Learner, target: str) -> tuple[Mode, ...]:
    """The learned modes of a target (``"ball.vx"``)."""
    if isinstance(model, ThesisModel):
        return model.modes(*target.split("."))
    return tuple(model.property_model(*target.split(".")).modes)


def noise_of(model: Learner, target: str) -> int:
    """Examples of a target that no mode explains."""
    if isinstance(model, ThesisModel):
        return model.noise(*target.split("."))
    return model.property_model(*target.split(".")).clusterer.noise_examples


def mode_values(
    model: Learner, target: str, layout: SceneLayout, before: NDArray[np.float64]
) -> NDArray[np.float64]:
    """What every learned mode would predict, shape ``(n, modes)``; NaN where its roles are open."""
    type_name, prop = target.split(".")
    if isinstance(model, ThesisModel):
        return model.mode_values(type_name, prop, layout, before)
    known = model.property_model(type_name, prop)
    percept = Perception(model.schema, (), model.config.geometry).percept(layout, before)
    (index,) = layout.of_type(type_name)
    x, signature = percept.rows(index, before), percept.situation(index).signature
    values = np.full((len(before), len(known.modes)), np.nan)
    for k, mode in enumerate(known.modes):
        binding = bind(mode, signature)
        if binding is not None and not binding.open:
            values[:, k] = binding.values(x)[:, 0]
    return values


def report_of(model: Learner) -> ModelReport:
    """Tables of modes, clauses and roles."""
    return model.report() if isinstance(model, ThesisModel) else report(model)


def trees_of(model: Learner, target: str) -> list[dict[str, Any]]:
    """Decision trees behind clauses (figures 4.2, 4.10 and 4.11): the modes that they part, the stage, the tree."""
    found = []
    if isinstance(model, ThesisModel):
        for pair in model.model_of(*target.split(".")).pairs:
            for stage in pair.stages:
                if stage.tree is not None:
                    name = "else" if stage.clause is None else str(stage.clause)
                    about = {"mode": pair.positive, "other": pair.negative, "stage": name}
                    found.append({**about, "tree": stage.tree.to_dict()})
        return found
    for each in model.property_model(*target.split(".")).classifier.classifiers:
        other = each.i if each.positive == each.j else each.j
        stages = [*map(str, each.definition.clauses), "else"]
        for name, tree in zip(stages, (*each.clause_trees, each.fall_through_tree), strict=True):
            if tree is not None:
                about = {"mode": each.positive, "other": other, "stage": name}
                found.append({**about, "tree": tree.to_dict()})
    return found
