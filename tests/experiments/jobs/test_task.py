from __future__ import annotations

import ast
from pathlib import Path

import pytest

from relgym.errors import ConfigError
from relgym.experiments.jobs import code
from relgym.experiments.jobs.code import code_version, modules_behind
from relgym.experiments.jobs.task import Task, canonical


def test_a_task_runs_its_function() -> None:
    value, seconds = Task("statistics:fmean", {"data": [1.0, 2.0, 6.0]}).run()
    assert value == 3.0 and seconds >= 0.0


def test_the_key_depends_on_function_and_arguments_but_not_on_their_order_or_the_kind() -> None:
    task = Task("statistics:quantiles", {"data": [1, 2], "n": 4})
    assert task.key == Task("statistics:quantiles", {"n": 4, "data": [1, 2]}, "slow").key
    others = [
        Task("statistics:quantiles", {"data": [1, 2], "n": 5}),
        Task("statistics:multimode", {"data": [1, 2], "n": 4}),
    ]
    assert len({task.key, *(other.key for other in others)}) == 3


def test_results_are_what_json_makes_of_them() -> None:
    value, _ = Task("builtins:dict", {"pair": (1, 2)}).run()
    assert value == {"pair": [1, 2]}


@pytest.mark.parametrize("function", ["fmean", "statistics:", ":fmean"])
def test_a_function_needs_module_and_name(function: str) -> None:
    with pytest.raises(ConfigError, match=r"expected 'package.module:name'"):
        _ = Task(function).key


def test_no_such_module() -> None:
    with pytest.raises(ConfigError, match=r"no module 'relgym\.nowhere'"):
        _ = Task("relgym.nowhere:thing").key


def test_only_plain_data() -> None:
    with pytest.raises(ConfigError, match="plain data"):
        canonical({"a": object()})


def test_the_version_covers_what_is_imported_and_nothing_else() -> None:
    behind = modules_behind("relgym.numeric.tree")
    assert behind == (
        "relgym.arguments",
        "relgym.config.checks",
        "relgym.config.classification",
        "relgym.config.constants",
        "relgym.errors",
        "relgym.numeric.tree",
        "relgym.scheduling.work",
    )
    learner = modules_behind("relgym.experiments.worlds.online")
    assert {"relgym.numeric.tree", "relgym.model.world_model", "relgym.laws.pair"} <= set(learner)
    assert not {"relgym.cli", "relgym.experiments.plots"} & set(learner)
    assert code_version("relgym.errors") != code_version("relgym.numeric.tree")


def test_words_do_not_matter_and_code_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    texts = {
        "first": "def f():\n    return 1\n",
        "words": '"""What."""\n\n\ndef f():\n    """How."""\n    return 1  # why\n',
        "other": "def f():\n    return 2\n",
    }
    versions = {}
    for folder, text in texts.items():
        (tmp_path / f"{folder}_made_up.py").write_text(text)
        versions[folder] = code_version(f"{folder}_made_up")
    assert len(set(versions.values())) == 3  # their names differ
    bare = {folder: ast.dump(code._bare(f"{folder}_made_up")) for folder in texts}
    assert bare["first"] == bare["words"] != bare["other"]
