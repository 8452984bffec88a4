"""Benchmarks of bodies that push, turn and stack: laws read off a stream, on scenes that no learner saw.

A *contact step* is one transition of one body that touches something; every one counts (`relgym benchmark bodies`).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from itertools import product
from statistics import median
from typing import Any, Final

from relgym.experiments.benchmark import Benchmark, Extent, Known, Option, Shown, Suite
from relgym.experiments.bodies.deliveries import ARMS, REAL
from relgym.experiments.bodies.trials import CLOSE, NUDGE, Tally
from relgym.experiments.bodies.worlds import Setting
from relgym.experiments.criterion import Measure, measured

__all__ = ["FORCES", "STRANGE", "SUITE"]

SEEDS: Final = (410, 411, 412, 413, 414)
"""Training seeds; nothing was chosen on them, or on the scenes to test on, but for the conveyor (see the page)."""

FRESH: Final = {"conveyor": (420, 421, 422, 423, 424)}
"""Training seeds of worlds that were looked at with the others when rules were made."""

PART: Final = 20
"""Episodes to learn from at most in all worlds but those of pushing: laws are found within ten."""

ROLLS: Final = 7
"""Test episodes of which roll-outs are made, three of each."""

FEW: Final = 2
"""Seeds of worlds that nothing was made for."""

FEW_EPISODES: Final = 5
"""Episodes that most whole models learn from among other forces, and that they and such worlds are tested on."""

WHOLE: Final = {"conveyor": (FEW_EPISODES, 2 * FEW_EPISODES, PART)}
"""Other numbers of episodes for the whole model: in 1,000 transitions bodies may hardly touch the wall that runs."""

TIMED: Final = 2
"""Further episodes in which the time of learning is taken."""

FEW_PARCELS: Final = 2
"""Episodes for each seed of the ensemble of nets, which takes long."""

_HEAD: Final = """`relgym benchmark bodies` wrote this page. A disc, driven by random forces, pushes boxes in a room,
or boxes fall and topple; relgym reads the laws of contact off the stream of transitions, one at a time, and is then
asked of scenes that it never saw. A *contact step* is one transition of one body that touches something; it is right
if both components of the velocity and the turning rate are, and every one counts. Of what is neither right nor wrong
relgym says that it doesn't know. *worst* and *median* are over training seeds (410 to 414; *of* says how many: where
it is fewer than five, no more were run); all are tested on the same scenes. Nothing was chosen on them but for the
conveyor: when laws are doubted was decided after a look at what was wrong there, so that its seeds are 420 to 424, and
only the scenes that it is tested on are those that were looked at. An episode has 200 steps.

Where boxes lie on each other the engine itself (pymunk, 10,000 sweeps a step) doesn't always come to an end. Its own
residual is the change of a velocity when the same step is solved with twice as many sweeps: steps at which that is
larger than the tolerance are *unsettled*, and counted apart where a table says so. How it works is told in [Read a
model](../guides/reading-a-model.md)."""


def _bodies(seed: int) -> tuple[str, ...]:
    """Two to four boxes, by turns."""
    return ("box",) * (2 + seed % 3)


def _laws(
    known: Known,
    extent: Extent,
    setting: Setting | Callable[[int], Setting],
    *tests: Setting,
    episodes: int | None = None,
    tested: int | None = None,
    seeds: Sequence[int] | None = None,
    **more: Any,
) -> list[Any]:
    """Trials of laws with all seeds, learned in a setting (or one for each seed) and tested there or in others."""
    arguments = []
    for seed in extent.first(SEEDS if seeds is None else seeds):
        home = setting if isinstance(setting, Setting) else setting(seed)
        arguments.append(
            {
                "setting": asdict(home),
                "seed": seed,
                "episodes": min(extent["episodes"], episodes or extent["episodes"]),
                "tests": [asdict(each) for each in tests or (home,)],
                "test_episodes": min(extent["tests"], tested or extent["tests"]),
                **more,
            }
        )
    return known("relgym.experiments.bodies.trials:law_trial", arguments)


def _shares(name: str, found: Sequence[Any], right: float, wrong: float, test: int = 0) -> list[Measure]:
    if not found:
        return []
    tallies = [Tally(*each["tallies"][test]) for each in found]
    counted, left = sum(t.contacts for t in tallies), sum(t.unsettled for t in tallies)
    apart = f" and {left:,} unsettled" if left else ""
    shares = [t.right_share for t in tallies]
    return [
        measured(f"{name}: right, % of {counted:,} contact steps{apart}", right, shares, ">="),
        measured(f"{name}: claimed and wrong, %", wrong, [t.wrong_share for t in tallies]),
    ]


def _sizes(extent: Extent, episodes: int | None = None, tests: int | None = None) -> str:
    """How much was learned from, and tested on."""
    learned, tested = (
        200 * min(most, some or most)
        for most, some in ((extent["episodes"], episodes), (extent["tests"], tests))
    )
    return f"Each seed: learned from {learned:,} transitions, tested on {tested:,}."


def _said(name: str, found: Sequence[Any]) -> list[str]:
    """What was learned with the first seed."""
    return [f"{name}: {row}" for row in found[0]["laws"]] if found else []


# ------------------------------------------------------------------ sections
def _pushing(extent: Extent, known: Known) -> Shown:
    measures: list[Measure] = []
    rolls: list[Measure] = []
    notes: list[str] = []
    for friction, elasticity in product((0.0, 0.5), (0.0, 0.8)):
        name = f"friction {friction:g}, elasticity {elasticity:g}"

        def setting(seed: int, friction: float = friction, elasticity: float = elasticity) -> Setting:
            return Setting(_bodies(seed), friction, elasticity)

        found = _laws(known, extent, setting, rolls=min(extent["tests"], ROLLS))
        measures += _shares(name, found, 99.9, 0.05)
        if found:
            close = [
                100.0 * sum(e is not None and e <= CLOSE for e in each["rolled"]) / len(each["rolled"])
                for each in found
            ]
            rolls.append(measured(f"{name}: roll-outs of 100 steps within 1e-6, %", 95.0, close, ">="))
            grown = sorted(e / NUDGE for each in found for e in each["grown"] if e is not None)
            notes.append(
                f"{name}: velocities off by {NUDGE:g} at first grow to positions off by {median(grown):.2g} times as "
                f"much in 100 steps (median; at most {grown[-1]:.2g})"
            )
    notes += _said("with friction and elasticity", found)
    return Shown([*measures, *rolls], [_sizes(extent), *notes])


def _stacks(extent: Extent, known: Known) -> Shown:
    measures: list[Measure] = []
    for elasticity in (0.0, 0.3):
        setting = Setting(("box",) * 3, 0.5, elasticity, gravity=9.8, driven=False)
        found = _laws(known, extent, setting, episodes=PART, tolerance=CLOSE, checked=True)
        measures += _shares(f"gravity, friction 0.5, elasticity {elasticity:g}", found, 98.0, 0.2)
    return Shown(measures, [_sizes(extent, PART)])


def _masses(extent: Extent, known: Known) -> Shown:
    measures: list[Measure] = []
    notes: list[str] = []
    kinds = (("one density", "uniform", ("box",) * 3, 1e-6), ("each its own", "own", ("box",) * 2, 0.01))
    for name, masses, bodies, limit in kinds:
        setting = Setting(bodies, 0.5, masses=masses)  # type: ignore[arg-type]
        found = _laws(known, extent, setting, episodes=2 * PART)
        if found:
            for k, what in enumerate(("masses", "moments over masses")):
                errors = [math.inf if each["inertia"][k] is None else each["inertia"][k] for each in found]
                measures.append(measured(f"{name}: largest relative error of {what}", limit, errors))
        measures += _shares(name, found, 99.9, 0.05)
        notes += [row for row in _said(name, found) if "mass" in row]
    return Shown(measures, [_sizes(extent, 2 * PART), *notes])


def _transfer(extent: Extent, known: Known) -> Shown:
    measures: list[Measure] = []
    for friction in (0.0, 0.5):
        home = Setting(("box", "box"), friction)
        others = {
            "10 boxes": replace(home, bodies=("box",) * 10),
            "a hexagon, a triangle and a T": replace(home, bodies=("box", "hexagon", "triangle", "tee")),
        }
        found = _laws(known, extent, home, *others.values(), episodes=PART)
        for k, name in enumerate(others):
            measures += _shares(f"friction {friction:g}, {name}", found, 99.9, 0.05, k)
    return Shown(measures, [_sizes(extent, PART)])


FORCES: Final = {
    "linear damping": Setting(damping=0.5),
    "conveyor": Setting(friction=0.5, conveyor=1.0),
    "wind": Setting(wind=3.0),
    "magnet": Setting(magnet=0.3),
    "spring": Setting(spring=5.0),
    "quadratic drag": Setting(drag=0.3),
}
"""Worlds with what moves bodies beside contacts."""


def _forces(extent: Extent, known: Known) -> Shown:
    measures: list[Measure] = []
    notes: list[str] = []
    for name, setting in FORCES.items():
        seeds = extent.first(FRESH.get(name, SEEDS))
        found = _laws(known, extent, setting, episodes=PART, seeds=seeds)
        if found:
            tallies = [Tally(*each["tallies"][0]) for each in found]
            wrong = [t.wrong_share for t in tallies]
            measures.append(measured(f"{name}, laws: claimed and wrong, %", 0.1, wrong))
            least = min(t.right_share for t in tallies)
            notes.append(f"{name}, laws: right, % of contact steps, worst seed: {least:.4g}")
            notes += [row for row in _said(name, found) if "touching nothing" in row or "surfaces" in row]
        for size in WHOLE.get(name, (FEW_EPISODES,)):
            count = min(extent["episodes"], size)
            arguments = {"setting": asdict(setting), "episodes": count, "test_episodes": FEW_EPISODES}
            models = known(
                "relgym.experiments.bodies.trials:model_trial",
                [{**arguments, "seed": seed} for seed in seeds],
            )
            if not models:
                continue
            what = f"{name}, the whole model after {200 * count:,}"
            fresh, learning = ([Tally(*each[key]) for each in models] for key in ("fresh", "learning"))
            measures.append(measured(f"{what}: claimed and wrong, %", 0.1, [t.wrong_share for t in fresh]))
            right, early = (
                ", ".join(f"{share:.3g}" for share in shares)
                for shares in ([t.right_share for t in fresh], [t.wrong_share for t in learning])
            )
            notes.append(f"{what}: right, % of contact steps, seed by seed: {right}")
            notes.append(f"{what}, while it learned: claimed and wrong, %: {early}")
            said = Counter(sentence for each in models for sentence in each["forces"])
            notes += [f"{what}, {said[each]} of {len(models)} seeds: {each}" for each in sorted(said)]
    whole = f"The whole model: tested on {200 * FEW_EPISODES:,} transitions."
    return Shown(measures, [f"Laws: {_sizes(extent, PART)}", whole, *notes])


def _strange(extent: Extent, known: Known) -> Shown:
    measures: list[Measure] = []
    for name, setting in STRANGE.items():
        found = _laws(
            known,
            extent,
            setting,
            episodes=PART,
            tested=FEW_EPISODES,
            seeds=SEEDS[:FEW],
            tolerance=CLOSE,
            checked=True,
        )
        measures += _shares(name, found, 98.0, 0.1)
    return Shown(measures, [_sizes(extent, PART, FEW_EPISODES)])


_FALLING: Final = Setting(("box",) * 3, 0.5, gravity=9.8, driven=False)

STRANGE: Final = {
    "hexagons": Setting(("hexagon",) * 3, 0.5),
    "six boxes that bounce": Setting(("box",) * 6, 0.5, 0.3),
    "triangles fall": replace(_FALLING, bodies=("triangle",) * 3),
    "Ts fall and bounce": replace(_FALLING, bodies=("tee",) * 3, elasticity=0.3),
    "boxes on the floor, pushed": replace(_FALLING, driven=True),
    "a disc ten times as heavy": Setting(friction=0.5, elasticity=0.5, heavy=10.0),
    "a disc a tenth as heavy": Setting(heavy=0.1),
    "walls askew": Setting(friction=0.3, tilt=0.15),
    "walls askew, boxes fall and bounce": replace(_FALLING, friction=0.3, elasticity=0.3, tilt=0.15),
    "friction by type": Setting(("box", "hexagon", "triangle"), 0.5, materials=(0.9, 0.2, 0.5, 0.7)),
    "friction by object": Setting(friction=0.5, materials=(0.9, 0.2, 0.5, 0.7)),
    "discs and a box": Setting(("puck", "box", "puck"), 0.5, 0.3),
    "falling in air": replace(_FALLING, elasticity=0.2, damping=0.6),
    "falling on a conveyor": replace(_FALLING, conveyor=1.0),
    "wind and drag": Setting(friction=0.3, elasticity=0.3, wind=3.0, drag=0.3),
}
"""Worlds that no threshold and no rule was made for."""


def _models(extent: Extent, known: Known) -> Shown:
    setting = {
        "setting": asdict(Setting(friction=0.5)),
        "episodes": min(extent["episodes"], PART // 2),
        "timed": TIMED,
    }
    found = known(
        "relgym.experiments.bodies.trials:model_trial",
        [{**setting, "seed": seed, "test_episodes": FEW_EPISODES} for seed in extent.first(SEEDS)],
    )
    measures = [
        measured("scenes right, %", 99.0, [each["scenes"][0] for each in found], ">="),
        measured("scenes claimed and wrong, %", 0.05, [each["scenes"][1] for each in found]),
        measured("learning from a transition, ms", 3.0, [each["cost"] for each in found]),
    ]
    return Shown(measures if found else [], [_sizes(extent, PART // 2, FEW_EPISODES)])


def _deliveries(extent: Extent, known: Known) -> Shown:
    measures: list[Measure] = []
    notes: list[str] = []
    for arm, title in ARMS.items():
        # Nets are planned in anew at every decision, mostly until time is up: that takes eight times as long.
        count = min(extent["parcels"], FEW_PARCELS) if arm == "ensemble" else extent["parcels"]
        found = known(
            "relgym.experiments.bodies.deliveries:delivered",
            [
                {"arm": arm, "seed": seed, "episodes": count, "first": k * extent["parcels"]}
                for k, seed in enumerate(extent.first(SEEDS))
            ],
        )
        if not found:
            continue
        good = [100.0 * each["good"] / each["episodes"] for each in found]
        whole = sum(each["episodes"] for each in found)
        what = f"{title}: delivered, % of {count} episodes for each seed"
        if arm == "relgym":
            measures.append(measured(what, 80.0, good, ">="))
        delivered = sum(each["good"] for each in found)
        each_of = ", ".join(f"{each['good']}" for each in found)
        notes.append(f"{title}: {delivered} of {whole} episodes ({each_of} of {count})")
        times = [median(each[key] for each in found) for key in ("learning", "testing")]
        notes.append(
            f"{title}: {times[0]:.0f} s of processor time to learn, {times[1] / count:.2g} s for an episode (median)"
        )
    return Shown(measures, notes)


_PARTS: Final[Mapping[str, tuple[str, Callable[[Extent, Known], Shown]]]] = {
    "pushing": ("Pushing", _pushing),
    "stacks": ("Boxes that fall, bounce, topple and stack (to 1e-6)", _stacks),
    "masses": ("Masses that aren't seen", _masses),
    "transfer": ("Learned with two boxes, used with others", _transfer),
    "forces": ("Other forces", _forces),
    "models": ("The whole model, three boxes", _models),
    "deliveries": (f"Parcels delivered after {REAL:,} real steps of relgym/BoxPush-v0", _deliveries),
    "strange": ("Worlds that nothing was made for (to 1e-6)", _strange),
}

SUITE: Final = Suite(
    "bodies",
    "Bodies that push, turn and stack",
    {name: Benchmark(title, measure) for name, (title, measure) in _PARTS.items()},
    seeds=len(SEEDS),
    options={
        "episodes": Option(100, "to learn from at most, 200 steps each"),
        "tests": Option(20, "episodes to test on"),
        "parcels": Option(20, "to deliver, for each seed"),
    },
    head=_HEAD,
)
