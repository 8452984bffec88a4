"""Do relgym's types reach users? mypy --strict and pyright check a user's script beside the wheel and the checkout.

Run with the Python that has relgym's editable install, the extra sb3, mypy and pyright: `python .ci/check_types.py
dist/relgym-*.whl`. Both checkers work in a folder that isn't the checkout, for each Python that relgym supports.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

PYTHONS = ("3.11", "3.12", "3.13", "3.14")
SCRIPT = Path(__file__).with_name("users_script.py")
REVEALED = re.compile(
    r"""Revealed type is "(?P<mypy>.+)"$|Type of ".+" is "(?P<pyright>.+)"$""", re.MULTILINE
)


def main() -> None:
    """Check the script in both ways, and print each type that was revealed."""
    wheel = Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "user"
        folder.mkdir()
        script = Path(shutil.copy(SCRIPT, folder))
        pythons = {"editable": Path(sys.executable), "wheel": _with_wheel(Path(scratch) / "venv", wheel)}
        for name, python in pythons.items():
            home = _home(python, folder)
            assert ("site-packages" in home) == (name == "wheel"), f"{name}: found relgym at {home}"
            for version in PYTHONS:
                _check(f"mypy, {name}, Python {version}", _mypy(script, python, version), folder)
                _check(f"pyright, {name}, Python {version}", _pyright(script, python, version), folder)


def _mypy(script: Path, python: Path, version: str) -> list[str]:
    options = ["--strict", "--config-file=", "--python-executable", str(python), "--python-version", version]
    return ["mypy", *options, script.name]


def _pyright(script: Path, python: Path, version: str) -> list[str]:
    return ["pyright", "--pythonpath", str(python), "--pythonversion", version, script.name]


def _check(title: str, command: list[str], folder: Path) -> None:
    """Run a checker; an error, nothing revealed or `Any` in what is revealed ends all."""
    run = subprocess.run(
        [sys.executable, "-m", *command], cwd=folder, capture_output=True, text=True, check=False
    )
    found = [match["mypy"] or match["pyright"] for match in REVEALED.finditer(run.stdout)]
    vague = [kind for kind in found if re.search(r"\b(Any|Unknown)\b", kind)]
    if run.returncode or not found or vague:
        sys.exit(f"{title}: exit status {run.returncode}, vague: {vague}\n{run.stdout}{run.stderr}")
    kinds = ", ".join(sorted({kind.replace("relgym.", "") for kind in found}))
    print(f"{title}: no error; {len(found)} types revealed, none is Any: {kinds}", flush=True)


def _with_wheel(folder: Path, wheel: Path) -> Path:
    """A Python with the wheel, and with the libraries of this one; its editable relgym isn't among them."""
    venv.create(folder, symlinks=True)
    python = folder / "bin" / "python"
    install = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps"]
    subprocess.run([*install, "--disable-pip-version-check", str(wheel)], check=True)
    (site,) = (folder / "lib").glob("python*/site-packages")
    # A path in a .pth file is taken as it is: .pth files in there aren't read, so no editable install comes along.
    lent = [path for path in sys.path if Path(path).name == "site-packages"]
    (site / "lent.pth").write_text("".join(f"{path}\n" for path in lent))
    return python


def _home(python: Path, folder: Path) -> str:
    command = [str(python), "-c", "import relgym; print(relgym.__file__)"]
    clean = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    return subprocess.run(
        command, cwd=folder, env=clean, capture_output=True, text=True, check=True
    ).stdout.strip()


if __name__ == "__main__":
    main()
