"""Files of today are read, and what doesn't fit in one is named: types, ranges, references, shapes."""

from __future__ import annotations

import base64
import copy
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from points import schema_of, transitions

from relgym.errors import ModelFileError
from relgym.files import reading
from relgym.files.reading import FileLimits
from relgym.model.files.storage import read_model, write_model
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.target.hindsight import calibration_to_json
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Transition

FILES = Path(__file__).parent / "v1"
LATER = Path(__file__).parent / "v2" / "ball-calibrated-history"

Change = Callable[[dict[str, Any], dict[str, Any]], object]


def changed(name: str, change: Change, path: Path) -> Path:
    """A file whose content was changed, with the checksum that goes with that."""
    body, stored = read_model(FILES / f"{name}.relgym")
    arrays = None if stored is None else dict(stored)
    change(body, arrays or {})
    write_model(path, body, arrays)
    return path


def test_the_checksum_covers_the_history(tmp_path: Path) -> None:
    from relgym.files.reading import read_members, write_arrays, write_members

    body, stored = read_model(FILES / "mountain-car-history.relgym")
    assert stored is not None
    arrays = dict(stored)
    write_model(tmp_path / "file", body, arrays)
    members = read_members((tmp_path / "file").read_bytes(), ("model.json", "history.npz"))
    arrays["target0.y"][0] += 1.0
    members["history.npz"] = write_arrays(arrays)
    (tmp_path / "file").write_bytes(write_members(members))
    with pytest.raises(ModelFileError, match="checksum"):
        WorldModel.load(tmp_path / "file")


def test_limits_are_the_callers(tmp_path: Path) -> None:
    path = FILES / "truck-history.relgym"
    for limits, name in ((FileLimits(file=1000), "file"), (FileLimits(arrays=1000), "arrays")):
        with pytest.raises(ModelFileError, match=rf"limits=FileLimits\({name}=\d+\)"):
            WorldModel.load(path, limits=limits)
    assert WorldModel.load(path, limits=FileLimits()).seen == 500


@pytest.mark.parametrize(
    "extra", [{1: "a"} | {"b": 2}, {"x": object()}, {"x": b"1"}, {"x": "\ud800"}, {"x": {1, 2}}]
)
def test_extra_that_is_no_plain_data_is_refused(extra: dict[Any, Any], tmp_path: Path) -> None:
    model = WorldModel.load(FILES / "mountain-car.relgym")
    with pytest.raises(ModelFileError, match="expected extra to be plain data"):
        model.save(tmp_path / "file", extra=extra)
    circle: dict[str, Any] = {}
    circle["circle"] = circle
    with pytest.raises(ModelFileError, match="nested too deep"):
        model.save(tmp_path / "file", extra=circle)
    assert not list(tmp_path.iterdir())


def _target(body: dict[str, Any], k: int = 0) -> dict[str, Any]:
    model: dict[str, Any] = body["targets"][k]["model"]
    return model


def _pair(body: dict[str, Any]) -> dict[str, Any]:
    """The first pair of modes that has a clause."""
    pairs = [pair for part in body["targets"] for pair in part["model"]["classifier"]["pairs"]]
    found: dict[str, Any] = next(p for p in pairs if any(p["classifier"]["definition"]["clauses"]))
    return found


def _literal(body: dict[str, Any]) -> dict[str, Any]:
    clauses = _pair(body)["classifier"]["definition"]["clauses"]
    found: dict[str, Any] = next(literal for clause in clauses for literal in clause)
    return found


def _columns(body: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = _target(body)["classifier"]["exemplars"]["columns"]
    return found


def _scrambled(text: str, dtype: str, value: int) -> str:
    numbers = np.frombuffer(base64.b64decode(text), dtype=dtype).copy()
    numbers[0] = value
    return base64.b64encode(numbers.tobytes()).decode()


DAMAGES: dict[str, tuple[str, Change, str]] = {
    "a missing field": ("truck", lambda b, a: b.pop("seen"), "missing required field `seen`"),
    "a field too many": ("truck", lambda b, a: b.update(more=1), "unknown field `more`"),
    "text for a number": ("truck", lambda b, a: b.update(seen="1"), r"Expected `int`, got `str` - at `\$\.seen`"),
    "a negative count": ("truck", lambda b, a: b.update(seen=-1), "Expected `int` >= 0"),
    "a number that is none": (
        "truck", lambda b, a: _target(b)["clusterer"].update(largest=float("nan")), "largest"
    ),
    "a configuration out of range": ("truck", lambda b, a: b["config"].update(history=1), "history must be at least"),
    "a search for ever": (
        "truck", lambda b, a: b["config"]["clustering"].update(draws=10**9), "draws must be at most 100,000"
    ),
    "a noise of zero": ("truck", lambda b, a: _target(b)["clusterer"].update(sigma=0.0), "sigma"),
    "a noise whose square overflows": (
        "truck", lambda b, a: _target(b)["clusterer"].update(rounding=1e200), "rounding"
    ),
    "rules that leave a target out": (
        "truck", lambda b, a: b.update(report={"rules": "Learned from 9 transitions."}), "expected rules of"
    ),
    "advice with a field too many": (
        "truck",
        lambda b, a: b.update(
            report={
                "rules": "",
                "advice": [
                    {"target": "x", "unexplained": 0, "left": 1, "features": [], "law": "", "remains": 1, "kind": 1}
                ],
            }
        ),
        "unknown",
    ),
    "laws without a tolerance": ("ball-laws", lambda b, a: b["laws"]["laws"].update(tolerance=0.0), "tolerance"),
    "a number in the history that is no size": (
        "truck-history", lambda b, a: a["table0.x"].__setitem__((0, 0), 1e200), "at most 1e"
    ),
    "an unknown type": ("truck", lambda b, a: b["schema"]["objects"][0].__setitem__(1, "cow"), "unknown type 'cow'"),
    "a shape without a surface": (
        "truck",
        lambda b, a: b["schema"]["types"][0].update(shape={"kind": "prism", "vertices": [[0, 0], [1, 0], [2, 0]]}),
        "lies on the line of its neighbours",
    ),
    "a target that is none": ("truck", lambda b, a: b["targets"][0]["target"].__setitem__(1, "px"), "target"),
    "a mode twice": (
        "truck", lambda b, a: _target(b)["clusterer"]["modes"].append(_target(b)["clusterer"]["modes"][0]), "twice"
    ),
    "a mode of another property": (
        "truck", lambda b, a: _target(b)["clusterer"]["modes"][0]["roles"][0]["terms"].append(["wings", 1.0]), "wings"
    ),
    "a role of no type": (
        "truck", lambda b, a: _target(b)["clusterer"]["modes"][0]["roles"][-1].update(type="cow"), "cow|target's own"
    ),
    "a vote for no mode": ("truck", lambda b, a: _target(b)["classifier"]["modes"].append(99), "expected some of"),
    "a pair of modes missing": (
        "truck", lambda b, a: _target(b)["classifier"]["pairs"].pop(), "every pair of modes once"
    ),
    "an unknown relation": (
        "ball-modes", lambda b, a: _literal(b).update(relation="likes"), "there is no .*'likes'"
    ),
    "a variable left out": ("truck", lambda b, a: _literal(b)["args"].__setitem__(0, 9), "variables below"),
    "an unknown context": (
        "ball-modes", lambda b, a: _pair(b)["classifier"].update(context="far"), "Invalid enum value 'far'"
    ),
    "counts for other outcomes": (
        "ball-modes", lambda b, a: _pair(b)["classifier"]["counts"].append([1.0, 0.0]), "counts: expected"
    ),
    "a tree in a circle": (
        "ball-modes",
        lambda b, a: _pair(b)["classifier"]["trees"].__setitem__(
            0,
            {"columns": ["vx"], "column": [0, -1], "threshold": [0.0, 0.0], "below": [1, 1], "above": [0, 1],
             "positive": [1.0, 1.0], "negative": [0.0, 0.0]},
        ),
        "trees",
    ),
    "another vocabulary": (
        "truck", lambda b, a: _target(b)["classifier"]["vocabulary"]["unary"].append("cow"), "vocabulary.unary"
    ),
    "players of other roles": ("truck", lambda b, a: _target(b)["casting"][0][1]["kinds"].clear(), "kinds"),
    "a limit that takes part in the vote": (
        "truck",
        lambda b, a: _target(b)["limits"].update(high=[_target(b)["classifier"]["modes"][0], 1.0]),
        "takes part in the vote|below the high one",
    ),
    "exemplars of other sizes": (
        "truck-history", lambda b, a: _columns(b)["sizes"].update(K=10**4, K2=10**4), "bytes for the shape"
    ),
    "an exemplar of no object": (
        "truck-history",
        lambda b, a: _columns(b)["arrays"].update(target=_scrambled(_columns(b)["arrays"]["target"], "<i8", 77)),
        "expected one of the objects",
    ),
    "an exemplar that isn't there": (
        "truck-history",
        lambda b, a: _columns(b)["arrays"].update(row=_scrambled(_columns(b)["arrays"]["row"], "<i8", 10**6)),
        "that aren't there",
    ),
    "cells that share a slot": (
        "truck-history",
        lambda b, a: _target(b)["classifier"]["exemplars"]["cells"][0][3].append(0),
        "every slot in one cell",
    ),
    "a law of nothing": (
        "ball-laws", lambda b, a: b["laws"]["laws"]["free"][0]["components"][0].append(["wings", 1.0]), "wings"
    ),
    "a law of another axis": (
        "ball-laws", lambda b, a: b["laws"]["laws"]["pair"]["axes"].append([]), "laws|axes"
    ),
    "a law that governs nothing": ("ball-laws", lambda b, a: b["laws"]["governed"].append("box"), "governed"),
    "no laws": ("ball-laws", lambda b, a: b.update(laws=None), "config.frames"),
    "more wrong than said": (
        "ball-modes", lambda b, a: b["hindsight"]["ball.vx"]["steps"].__setitem__(0, [1, 2]), "more wrong than said"
    ),
    "a missing array": ("truck-history", lambda b, a: a.pop("target0.y"), "target0.y"),
    "an array too many": ("truck-history", lambda b, a: a.update(more=np.zeros(1)), "too many: .*more"),
    "an array of another type": (
        "truck-history", lambda b, a: a.update({"target0.y": a["target0.y"].astype(np.int64)}), "expected float64"
    ),
    "an array of another shape": (
        "truck-history", lambda b, a: a.update({"table0.x": a["table0.x"][:, 1:]}), "of shape"
    ),
    "a row that isn't there": (
        "truck-history", lambda b, a: a["target0.rows"].__setitem__(0, 10**6), "expected rows of the table"
    ),
    "a contact that came later than the last": (
        "ball-laws-history",
        lambda b, a: a.update({"laws.contacts.arrived": np.full(len(a["laws.contacts.rows"]), 10**9)}),
        "no more than came",
    ),
    "a label of no mode": ("truck-history", lambda b, a: a["target0.labels"].__setitem__(0, 99), "one of"),
    "a body twice": (
        "truck-history",
        lambda b, a: np.copyto(a["table0.bodies"], 0, where=a["table0.bodies"] > 0),
        "every body once",
    ),
    "a role without properties": (
        "truck-history",
        lambda b, a: _target(b)["clusterer"]["modes"][0]["roles"].append({"type": "truck", "terms": []}),
        "no property counts",
    ),
    "forgotten examples of no mode": (
        "truck-history", lambda b, a: a.update({"target0.forgotten": np.array([[99, 1]])}), "a mode that never was"
    ),
    "an infinite value": (
        "truck-history", lambda b, a: a["target0.y"].__setitem__(0, np.inf), "expected finite numbers"
    ),
    "a state of another random generator": (
        "truck-history",
        lambda b, a: _target(b)["clusterer"]["random"].update(bit_generator="MT19937"),
        "bit_generator",
    ),
    "places of no mode": (
        "truck", lambda b, a: _target(b).update(places=[[99, [[1]]]]), "there is no mode 99"
    ),
    "places of too few roles": (
        "truck",
        lambda b, a: _target(b).update(places=[[_target(b)["clusterer"]["modes"][0]["id"], [[1] * 9]]]),
        "expected slots of",
    ),
    "a scene of another type": (
        "truck", lambda b, a: b.update(arrival={"objects": [["a", "none"]], "values": [0.0]}), "no such type"
    ),
    "a scene of too many numbers": (
        "truck", lambda b, a: b.update(arrival={"objects": [["a", "truck"]], "values": [0.0] * 99}), "numbers"
    ),
    "extra that is nested too deep": ("truck", lambda b, a: b.update(extra={"a": _deep(64)}), "at most 64 levels"),
}  # fmt: skip


def _deep(levels: int) -> Any:
    found: Any = []
    for _ in range(levels):
        found = [found]
    return found


@pytest.mark.parametrize("name", DAMAGES)
def test_what_does_not_fit_is_named(name: str, tmp_path: Path) -> None:
    file, change, match = DAMAGES[name]
    path = tmp_path / "model"
    with pytest.raises(ModelFileError, match=match):
        WorldModel.load(changed(file, change, path))


@pytest.mark.parametrize("name", ["mountain-car-calibrated", "cart-pole-calibrated-history"])
def test_a_regression_without_weights_is_refused(name: str, tmp_path: Path) -> None:
    body, arrays = read_model(LATER.parent / f"{name}.relgym")
    body["regressions"]["self"]["ridges"][-1][2] = []
    write_model(tmp_path / "model", body, arrays)
    with pytest.raises(ModelFileError, match="expected weights of some of the targets"):
        WorldModel.load(tmp_path / "model")


def _noisy(steps: int) -> tuple[WorldModel, list[Transition]]:
    """Of twenty numbers that are noise, whose regression is being solved after 73 steps; and what comes next."""
    names = tuple(f"x{k}" for k in range(20))
    rng = np.random.default_rng(0)

    def moved(s: np.ndarray, u: np.ndarray) -> list[float]:
        return [*rng.normal(size=20).tolist()]

    schema = schema_of(names, ("a",))
    came = transitions(schema, moved, rng.normal(size=(steps + 12, 20)), rng.normal(size=(steps + 12, 1)))
    model = WorldModel(schema)
    for transition in came[:steps]:
        compare_and_learn(model, transition, model.predict_one(transition.before))
    return model, came[steps:]


@pytest.fixture(scope="module")
def pending(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pending") / "model"
    _noisy(73)[0].save(path, history=True)
    return path


@pytest.mark.parametrize("steps", [65, 73])
def test_a_solution_that_is_pending_goes_on_as_if_never_saved(steps: int, tmp_path: Path) -> None:
    """The first one, before which only the linear regression has been solved, and a later one."""
    model, rest = _noisy(steps)
    assert len(model._parts.regressions["self"]._ready) == (1 if steps == 65 else 2)
    model.save(tmp_path / "model", history=True)
    again = WorldModel.load(tmp_path / "model")
    for k, transition in enumerate(rest):
        found = []
        for each in (model, again):
            regression = each._parts.regressions["self"]
            assert k or "begun1" in regression.to_arrays()
            told = each.predict_one(transition.before)
            many = each.predict_batch(transition.before.layout, np.stack([transition.before.vector] * 2))
            assert many.vectors[1].tobytes() == told.scene.vector.tobytes()
            compare_and_learn(each, transition, told)
            arrays = regression.to_arrays() | {"reach": regression.reach}
            found.append({name: array.tobytes() for name, array in arrays.items()})
            found[-1]["record"] = repr(regression.record("x3")).encode()
        assert found[0] == found[1], k


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("columns", 1e300, "numbers whose squares can be summed"),
        ("responses", np.nan, "numbers whose squares can be summed"),
        ("count", 3, "one of so many rows to be remembered"),
        ("gone_over", -1, "numbers of rows, in order"),
        ("left_out", -1.0, "expected sums of squares"),
        ("left0", np.nan, "expected mean squares"),
        ("begun1", 10_000, "rows that came, and columns that are done"),
        ("begun_gram1", np.inf, "expected finite numbers"),
    ],
)
def test_what_a_regression_remembers_fits_it(
    name: str, value: float, said: str, pending: Path, tmp_path: Path
) -> None:
    body, stored = read_model(pending)
    arrays = {key: np.array(array) for key, array in dict(stored or {}).items()}
    arrays[f"regression0.{name}"].flat[0] = value
    write_model(tmp_path / "model", body, arrays)
    with pytest.raises(ModelFileError, match=said):
        WorldModel.load(tmp_path / "model")
    del arrays[f"regression0.{name}"]
    write_model(tmp_path / "model", body, arrays)
    if name != "left0":  # which earlier files don't say
        with pytest.raises(ModelFileError, match="missing"):
            WorldModel.load(tmp_path / "model")


@pytest.mark.parametrize(
    ("name", "shape", "said"),
    [
        ("table0.x", (20_000, 3), "expected float64 of shape"),
        ("table0.serial", (20_000,), "expected int64 of shape"),
        ("target0.y", (20_000,), "as many as there are rows"),
        ("target0.forgotten", (20_000, 2), "more than modes"),
    ],
)
def test_arrays_that_can_not_fit_are_refused_by_their_headers(
    name: str, shape: tuple[int, ...], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def more(body: dict[str, Any], arrays: dict[str, Any]) -> None:
        arrays[name] = np.zeros(shape, dtype=arrays[name].dtype)

    path = changed("truck-history", more, tmp_path / "model")
    monkeypatch.setattr(reading, "_array", lambda *_: pytest.fail("room was made for an array"))
    with pytest.raises(ModelFileError, match=said):
        WorldModel.load(path)


def test_a_number_of_the_next_mode_needs_no_memory(tmp_path: Path) -> None:
    path = changed(
        "truck-history",
        lambda b, a: _target(b)["clusterer"].update(next_id=2**31 - 1),
        tmp_path / "model",
    )
    tracemalloc.start()
    assert WorldModel.load(path).describe(details=True)
    assert tracemalloc.get_traced_memory()[1] < 100 << 20
    tracemalloc.stop()


SMALL = Path(__file__).parent.parent.parent / "fuzz" / "corpus"


def _fields(value: Any, where: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], dict[str, Any], str]]:
    """Every field of a body, with the names of the fields that it lies in."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield (*where, key), value, key
            yield from _fields(inner, (*where, key))
    elif isinstance(value, list):
        for inner in value:
            yield from _fields(inner, where)


_MISSING = object()


@pytest.mark.parametrize(
    "path", [SMALL / "puck", SMALL / "pay", SMALL / "discs-frozen", LATER], ids=lambda p: p.name
)
@pytest.mark.parametrize("empty", [None, [], {}, _MISSING], ids=["null", "list", "object", "missing"])
def test_every_field_may_be_empty_or_is_refused(path: Path, empty: Any) -> None:
    """One of each kind; what is accepted describes and saves."""
    body, stored = read_model(path.with_suffix(".relgym"))
    arrays = None if stored is None else dict(stored)
    kinds = {where[-3:]: (inside, key) for where, inside, key in _fields(body)}
    for where, (inside, key) in kinds.items():
        kept = inside.pop(key)
        if empty is not _MISSING:
            inside[key] = copy.copy(empty)
        try:
            model = WorldModel._restored(copy.deepcopy(body), arrays)
            model.describe(details=True)
            model.to_json()
        except ModelFileError:
            pass
        except Exception as error:
            raise AssertionError(f"{'.'.join(where)} = {empty}") from error
        finally:
            inside[key] = kept


@pytest.fixture(scope="module")
def waiting(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of twenty numbers that are noise, with values that nobody claimed and whose predictions were left out."""
    path = tmp_path_factory.mktemp("waiting") / "model"
    _noisy(182)[0].save(path, history=True)
    return path


def _waiting(body: dict[str, Any]) -> list[Any]:
    found: list[Any] = next(known["waiting"] for known in body["calibration"].values() if "waiting" in known)
    return found


def test_what_waits_to_be_counted_goes_on_as_if_never_saved(waiting: Path) -> None:
    model, rest = _noisy(182)
    again = WorldModel.load(waiting)
    for transition in rest:
        for each in (model, again):
            compare_and_learn(each, transition, each.predict_one(transition.before))
        assert calibration_to_json(model._parts) == calibration_to_json(again._parts)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda found: found[0].__setitem__(1, 5), "expected 5 experts"),
        (lambda found: found[0][3].append(1.0), "expected 5 experts"),
        (lambda found: found[0][3].__setitem__(4, None), "what the speaker and persistence were off by"),
        (lambda found: found[0][3].__setitem__(2, -1.0), "waiting"),
        (lambda found: found[0][3].__setitem__(4, 1e200), "waiting"),
    ],
)
def test_what_waits_to_be_counted_fits(
    change: Callable[[list[Any]], object], said: str, waiting: Path, tmp_path: Path
) -> None:
    body, stored = read_model(waiting)
    change(_waiting(body))
    write_model(tmp_path / "model", body, dict(stored or {}))
    with pytest.raises(ModelFileError, match=said):
        WorldModel.load(tmp_path / "model")
