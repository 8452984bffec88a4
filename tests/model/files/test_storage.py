"""Model files: what is saved is what comes back, and what was damaged is refused."""

from __future__ import annotations

import copy
import json
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from worlds import ROOM_TARGETS, RawStep, learned, line, room, scene, schema_of, transitions

from relgym.errors import ModelFileError
from relgym.experiments.data import ball_episodes
from relgym.model.files.storage import read_model, schema_from_json, schema_to_json, write_model
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Kinematics, ObjectType, Target
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, ConvexPolyhedron, Prism, Sphere, Wedge

SCHEMA = SceneSchema(
    (
        ObjectType(
            "ball", ("x", "vx", "d"), Sphere(), parent="thing", pose={"px": "x"}, velocity=("vx", None, None)
        ),
        ObjectType("box", ("px",), Box(), optional=True),
        ObjectType("ramp", ("px",), Wedge()),
        ObjectType("roof", ("px",), Prism(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))),
        ObjectType("rock", ("px",), ConvexPolyhedron(((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)))),
        ObjectType("action", ("force", "brake"), exogenous=("force",), flags=("brake",)),
    ),
    (("b", "ball"), ("action", "action")),
    up="z",
    planar=False,
    kinematics=(Kinematics("ball", "x", "vx", 0.5, False),),
    targets=(Target("ball", "vx"), Target("box", "px", (("ball", "vx"),))),
    action_scale=(("force", -2.0, 3.0),),
)


def test_a_schema_comes_back_whole() -> None:
    again = schema_from_json(json.loads(json.dumps(schema_to_json(SCHEMA))))
    assert again == SCHEMA
    assert again.types == SCHEMA.types
    assert [t.flags for t in again.types] == [t.flags for t in SCHEMA.types]
    assert again.targets == SCHEMA.targets


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_come_back_to_the_bit(tmp_path_factory: pytest.TempPathFactory, number: float) -> None:
    path = tmp_path_factory.mktemp("numbers") / "model.json"
    write_model(path, {"number": number}, None)
    again = read_model(path)[0]["number"]
    assert np.float64(again).tobytes() == np.float64(number).tobytes()


@pytest.mark.parametrize("history", [False, True])
def test_a_loaded_model_predicts_the_same_bits(history: bool, room_model: WorldModel, tmp_path: Path) -> None:
    room_model.save(tmp_path / "model", history=history)
    again = WorldModel.load(tmp_path / "model")
    assert again.frozen is not history
    for before, _ in room(1, 60):
        one, two = (m.predict_one(scene(m.schema, before)) for m in (room_model, again))
        assert one.scene.vector.tobytes() == two.scene.vector.tobytes()
        assert one.parts == two.parts


@pytest.mark.parametrize("history", [False, True])
def test_saving_what_was_loaded_gives_the_same_bytes(
    history: bool, room_model: WorldModel, tmp_path: Path
) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    room_model.save(one, history=history)
    WorldModel.load(one).save(two, history=history)
    assert one.read_bytes() == two.read_bytes()


@pytest.mark.parametrize("cut", [7, 90, 200])
def test_learning_goes_on_as_if_never_saved(cut: int, room_steps: list[RawStep], tmp_path: Path) -> None:
    schema = schema_of(room_steps, ROOM_TARGETS)
    steps = transitions(schema, room_steps[:260])
    whole, model = WorldModel(schema), WorldModel(schema)
    for each in steps:
        whole.learn_one(each)
    for each in steps[:cut]:
        model.learn_one(each)
    model.save(tmp_path / "half", history=True)
    model = WorldModel.load(tmp_path / "half")
    for each in steps[cut:]:
        model.learn_one(each)
    whole.save(tmp_path / "whole", history=True)
    model.save(tmp_path / "model", history=True)
    assert (tmp_path / "model").read_bytes() == (tmp_path / "whole").read_bytes()


def test_learning_goes_on_in_the_balls_room(tmp_path: Path) -> None:
    # Modes that explain one another's examples by chance, rest apart from bouncing, thresholds in clauses.
    episodes = list(ball_episodes(1, seed=0, episodes=4))
    whole, model = WorldModel(episodes[0].schema), WorldModel(episodes[0].schema)
    for episode in episodes:
        for each in episode.transitions():
            whole.learn_one(each)
            model.learn_one(each)
        model.save(tmp_path / "half", history=True)
        model = WorldModel.load(tmp_path / "half")
    whole.save(tmp_path / "whole", history=True)
    model.save(tmp_path / "model", history=True)
    assert (tmp_path / "model").read_bytes() == (tmp_path / "whole").read_bytes()


def test_learning_goes_on_with_open_roles(tmp_path: Path) -> None:
    steps = line(0, 200, ("light", "heavy", "heavy"))
    schema = schema_of(steps)
    whole, model = WorldModel(schema), WorldModel(schema)
    for k, each in enumerate(transitions(schema, steps)):
        whole.learn_one(each)
        model.learn_one(each)
        if k % 70 == 69:
            model.save(tmp_path / "half", history=True)
            model = WorldModel.load(tmp_path / "half")
    whole.save(tmp_path / "whole", history=True)
    model.save(tmp_path / "model", history=True)
    assert (tmp_path / "model").read_bytes() == (tmp_path / "whole").read_bytes()


def test_modes_whose_conditions_were_learned_again_are_kept(room_model: WorldModel, tmp_path: Path) -> None:
    model = copy.deepcopy(room_model)
    target = next(t for t in model.targets if model.modes(t.type, t.property))
    part = model.property_model(target.type, target.property)
    part.amended = {part.modes[0].id}
    model.save(tmp_path / "model.json", history=True)
    again = WorldModel.load(tmp_path / "model.json")
    assert again.property_model(target.type, target.property).amended == part.amended
    part.amended = {10_000}
    model.save(tmp_path / "other.json", history=True)
    with pytest.raises(ModelFileError, match="there is no mode 10000"):
        WorldModel.load(tmp_path / "other.json")


def test_without_its_history_a_model_only_predicts(room_model: WorldModel, tmp_path: Path) -> None:
    room_model.save(tmp_path / "model")
    again = WorldModel.load(tmp_path / "model")
    with pytest.raises(ModelFileError, match="history=True"):
        again.learn_one(transitions(again.schema, room(0, 1))[0])
    with pytest.raises(ModelFileError, match="without its history"):
        again.save(tmp_path / "other", history=True)
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize("twin", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
@pytest.mark.parametrize("frozen", [False, True])
def test_copies_and_pickles_predict_the_same(
    twin: Callable[[WorldModel], WorldModel], frozen: bool, room_model: WorldModel, tmp_path: Path
) -> None:
    model = room_model
    if frozen:
        room_model.save(tmp_path / "model")
        model = WorldModel.load(tmp_path / "model")
    again = twin(model)
    for before, _ in room(1, 60):
        each = scene(model.schema, before)
        assert again.predict_one(each).parts == model.predict_one(each).parts
    assert json.dumps(again.to_json()) == json.dumps(model.to_json())


def test_the_callers_data_travel_along(room_model: WorldModel, tmp_path: Path) -> None:
    room_model.save(tmp_path / "model", extra={"env": "Room-v0", "low": [0.0, -1.0]})
    assert WorldModel.load_with_extra(tmp_path / "model")[1] == {"env": "Room-v0", "low": [0.0, -1.0]}


def test_a_model_that_knows_nothing_is_saved_too(tmp_path: Path) -> None:
    WorldModel(SCHEMA).save(tmp_path / "model", history=True)
    assert WorldModel.load(tmp_path / "model").targets == SCHEMA.targets


# ---------------------------------------------------------------------- damage
@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[bool, bytes]:
    """Bytes of a small model, without and with history."""
    folder = tmp_path_factory.mktemp("files")
    steps = room(0, 40)
    model = learned(schema_of(steps, ROOM_TARGETS), steps)
    found = {}
    for history in (False, True):
        model.save(folder / "model", history=history)
        found[history] = (folder / "model").read_bytes()
    return found


@pytest.mark.parametrize("history", [False, True])
@pytest.mark.parametrize("part", [0.0, 0.001, 0.3, 0.9, 0.999])
def test_truncated_files_are_refused(
    history: bool, part: float, files: dict[bool, bytes], tmp_path: Path
) -> None:
    path = tmp_path / "model"
    path.write_bytes(files[history][: int(part * len(files[history]))])
    with pytest.raises(ModelFileError, match="model"):
        WorldModel.load(path)


@pytest.mark.parametrize("history", [False, True])
@given(data=st.data())
def test_no_changed_byte_goes_unnoticed(
    history: bool, files: dict[bool, bytes], data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    whole = bytearray(files[history])
    where = data.draw(st.integers(0, len(whole) - 1))
    whole[where] ^= data.draw(st.integers(1, 255))
    path = tmp_path_factory.mktemp("damage") / "model"
    path.write_bytes(whole)
    try:
        again = WorldModel.load(path)
    except ModelFileError:
        return
    # A few bytes of a zip mean nothing (dates, versions), nor does the 17th digit of some floats: then everything
    # else must have come back.
    again.save(path, history=history)
    assert path.read_bytes() == files[history]


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "truncated"),
        ("[1, 2]", "another kind of JSON"),
        ("{}", "another kind of JSON"),
        ('{"format": "relgym-model", "version": 99}', "version 1 to 6, got 99"),
        ('{"format": "relgym-model", "version": 1, "body": {}, "sha256": "0"}', "checksum"),
        ("import os", "can't be read"),
        ("\x00\xff", "can't be read"),
    ],
)
def test_foreign_files_are_refused(text: str, match: str, tmp_path: Path) -> None:
    path = tmp_path / "model"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(ModelFileError, match=match):
        WorldModel.load(path)


def test_an_edited_number_is_noticed(files: dict[bool, bytes], tmp_path: Path) -> None:
    path = tmp_path / "model"
    assert b'"seen":40' in files[False]
    path.write_bytes(files[False].replace(b'"seen":40', b'"seen":41'))
    with pytest.raises(ModelFileError, match="edited"):
        WorldModel.load(path)


def test_a_part_that_is_missing_is_named(tmp_path: Path) -> None:
    write_model(tmp_path / "model", {"extra": {}}, None)
    with pytest.raises(ModelFileError, match="schema"):
        WorldModel.load(tmp_path / "model")


def test_another_zip_is_no_model(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "model", "w") as archive:
        archive.writestr("readme.txt", "nothing")
    with pytest.raises(ModelFileError, match="zip"):
        WorldModel.load(tmp_path / "model")


def test_a_failed_write_leaves_the_old_file_and_no_rubbish(
    files: dict[bool, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "model"
    path.write_bytes(files[False])

    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(ModelFileError, match="disk full"):
        write_model(path, {}, None)
    assert path.read_bytes() == files[False]
    assert [p.name for p in tmp_path.iterdir()] == ["model"]


def test_numpys_numbers_in_declarations_can_be_kept(tmp_path: Path) -> None:
    """Bounds of a float32 Box as an action's range, a step computed by NumPy."""
    schema = SceneSchema(
        (ObjectType("p", ("x", "v")), ObjectType("action", ("u",))),
        (("one", "p"), ("action", "action")),
        planar=np.bool_(True),  # type: ignore[arg-type]
        kinematics=(Kinematics("p", "x", "v", np.float32(0.5)),),  # type: ignore[arg-type]
        action_scale=(("u", np.float32(-1.5), np.float64(2.0)),),  # type: ignore[arg-type]
    )
    model = WorldModel(schema)
    model.extra = {"count": np.int64(3)}
    model.save(tmp_path / "m.json")
    again = WorldModel.load(tmp_path / "m.json")
    assert again.schema == schema and again.extra == {"count": 3}
    model.extra = {"what": object()}
    with pytest.raises(ModelFileError, match="a model's file can't hold <object"):
        model.save(tmp_path / "other.json")
    assert not (tmp_path / "other.json").exists()
