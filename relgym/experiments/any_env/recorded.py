"""A recording learned from as it comes: what was said of every object, what came, and what other learners say of it."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from relgym.baselines.changes import ONLINE, predicted_changes, titles
from relgym.config import ModelConfig
from relgym.envs.views import TableView
from relgym.experiments.any_env.data import size
from relgym.experiments.criterion import Figure
from relgym.experiments.recording import Recording
from relgym.model.predicting.prediction import ScenePrediction
from relgym.model.reports.text import Cell, table
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene, Target, Transition
from relgym.wrappers.follower import Follower
from relgym.wrappers.study import Study

__all__ = ["Rows", "live", "stream"]

_COLUMNS = ("step", "now", "seen", "last", "change", "said", "sure", "ended")


@dataclass
class Rows:
    """What happened to the objects of one type, one row per object and step.

    Attributes
    ----------
    properties
        Names of what is predicted.
    step
        Number of the step, shape ``(n,)``.
    now
        What the properties were, shape ``(n, m)``.
    seen
        What other learners are shown: the object's numbers, those of every object that is alone of its kind (with
        whether it is there), and the action's; shape ``(n, d)``.
    last
        The last step's change of the same object, or where it has just come of the last one of its type that has not,
        shape ``(n, m)``.
    change, said
        What changed, and what the model said would, shape ``(n, m)``.
    sure
        Whether a mode said it, shape ``(n, m)``.
    ended
        Whether the step ended the episode, shape ``(n,)``.
    """

    properties: tuple[str, ...]
    step: list[int] = field(default_factory=list)
    now: list[NDArray[np.float64]] = field(default_factory=list)
    seen: list[NDArray[np.float64]] = field(default_factory=list)
    last: list[NDArray[np.float64]] = field(default_factory=list)
    change: list[NDArray[np.float64]] = field(default_factory=list)
    said: list[NDArray[np.float64]] = field(default_factory=list)
    sure: list[list[bool]] = field(default_factory=list)
    ended: list[bool] = field(default_factory=list)

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """All of it as arrays."""
        return {name: np.array(getattr(self, name)) for name in _COLUMNS}

    def until(self, step: int) -> Rows:
        """The rows of the steps before this one."""
        count = bisect_left(self.step, step)
        return Rows(self.properties, *(getattr(self, name)[:count] for name in _COLUMNS))


def live(
    recording: Recording,
    targets: Sequence[Target],
    config: ModelConfig | None = None,
    model: WorldModel | None = None,
    *,
    learn: bool = True,
) -> tuple[WorldModel, dict[str, Rows]]:
    """Predict, compare and learn, step by step, as a `ModelLearner` would.

    Parameters
    ----------
    recording
        What happened.
    targets
        What is predicted, in causal order.
    config
        Of a new model.
    model
        A model to go on from, instead of a new one.
    learn
        Whether to learn.

    Returns
    -------
    The model, its classifiers up to date, and the rows of every type.
    """
    view = recording.view
    model = WorldModel(view.schema, config, targets=targets) if model is None else model
    study, follower = Study(model, learn=learn), Follower(view)
    rows: dict[str, Rows] = {}
    for target in model.targets:
        own = tuple(t.property for t in model.targets if t.type == target.type)
        rows.setdefault(target.type, Rows(own))
    earlier: Scene | None = None
    for number, step in enumerate(recording):
        if step.first:
            follower.begin(step.before, {})
            earlier = None
        now, before = follower.scene, follower.act(step.action)
        prediction = study.expect(before)
        transition = follower.follow(
            before, prediction, step.after, {}, reward=0.0, terminated=step.terminated
        )
        study.take_up(transition, prediction)
        if transition is not None and prediction is not None:
            _note(rows, view, number, earlier, transition, prediction, ended=step.terminated)
        earlier = now
    model.finish()
    return model, rows


def _note(
    rows: dict[str, Rows],
    view: object,
    number: int,
    earlier: Scene | None,
    transition: Transition,
    prediction: ScenePrediction,
    *,
    ended: bool,
) -> None:
    before, after = transition.before, transition.after
    others = _alone(view, before)
    for name in before.layout.names:
        found = rows.get(before[name].type.name)
        if found is None or name not in after:
            continue
        now = np.array([before[name][p] for p in found.properties])
        parts = [prediction[name, p] for p in found.properties]
        found.step.append(number)
        found.now.append(now)
        found.seen.append(np.concatenate([before[name].values, others]))
        found.last.append(_last_change(found, earlier, name, now))
        found.change.append(np.array([after[name][p] for p in found.properties]) - now)
        found.said.append(np.array([p.value for p in parts]) - now)
        found.sure.append([p.ok for p in parts])
        found.ended.append(ended)


def _last_change(
    found: Rows, earlier: Scene | None, name: str, now: NDArray[np.float64]
) -> NDArray[np.float64]:
    if earlier is not None and name in earlier:
        last: NDArray[np.float64] = now - np.array([earlier[name][p] for p in found.properties])
        return last
    return found.last[-1] if found.last else np.zeros(len(now))


def _alone(view: object, scene: Scene) -> NDArray[np.float64]:
    """Numbers of the objects that are alone of their kind, each behind whether it is there; zeros if not."""
    kinds = [part for part in view.rows if part.count == 1] if isinstance(view, TableView) else []
    found: list[NDArray[np.float64]] = [np.asarray(scene["action"].values)]
    for part in kinds:
        width = len(view.schema.type_of(part.name).properties) if isinstance(view, TableView) else 0
        here = part.name in scene
        found += [np.array([float(here)]), scene[part.name].values if here else np.zeros(width)]
    return np.concatenate(found)


def stream(name: str, rows: Rows, *, verbose: bool, batch: bool) -> Iterator[Figure]:
    """How the model compares with the best online baseline in the second half of the stream, property by property.

    Parameters
    ----------
    name
        Of the type of object, for people.
    rows
        What happened, and what the model said.
    verbose
        Whether to print a table of all learners.
    batch
        Whether that lists learners which are fitted once.
    """
    columns = rows.columns()
    late = np.arange(len(columns["step"])) >= len(columns["step"]) // 2
    kinds = {"all steps": late, "the episode goes on": late & ~columns["ended"].astype(bool)}
    told = predicted_changes(columns["seen"], columns["change"], once=batch, last=columns["last"])
    said = {"relgym": columns["said"]} | told
    lines: list[list[Cell]] = []
    for kind, keep in kinds.items():
        sizes = {who: size(guess - columns["change"], columns["change"], keep) for who, guess in said.items()}
        for k, prop in enumerate(rows.properties):
            lines.append([f"{name}.{prop}, {kind}", *(f"{s[k]:.3g}" for s in sizes.values())])
            best = min(float(s[k]) for who, s in sizes.items() if who in ONLINE)
            what = f"{name}.{prop}, prequential, {kind}, over the best online baseline"
            yield what, 1.0, float(sizes["relgym"][k]) / best, "<="
    if verbose:
        print(table(["nRMSE-d", *titles(said)], lines), "\n", flush=True)
