"""Fuzz model files for a while: ``python tests/fuzz/run.py --minutes 10``; ``--case N`` shows one case again.

Every eighth changed file is written, with a checksum that fits, and read again; of the others the content is handed
over as it is, since the container is the same whatever it holds.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent.parent / "support")]

from file_fuzzing import Fuzzer, Tally  # noqa: E402


def main() -> int:
    """Run; the exit status is 1 if anything was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--files", type=int, default=10**9, help="at most so many files")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--case", type=int, help="only this one")
    asked = parser.parse_args()
    numbers = range(asked.first, asked.first + asked.files)
    if asked.case is not None:
        numbers = range(asked.case, asked.case + 1)
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:
        fuzzer, until = Fuzzer(Path(folder), asked.seed), time.monotonic() + 60.0 * asked.minutes
        tally = Tally()
        for number in numbers:
            if time.monotonic() > until:
                break
            known = len(tally.findings)
            fuzzer.one(number, tally)
            for found in tally.findings[known:]:
                print(f"--- case {found.number} of {found.seed}, {found.stage}\n{found.trace}", flush=True)
            if tally.files % 1000 == 0:
                print(_line(tally), flush=True)
    print(_line(tally))
    print("typed, after loading:", dict(tally.typed_later))
    print("found:", dict(Counter((f.stage, f.trace.strip().splitlines()[-1][:100]) for f in tally.findings)))
    return 1 if tally.findings else 0


def _line(tally: Tally) -> str:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    return (
        f"{tally.files:,} files, {tally.accepted:,} accepted, {len(tally.findings)} raw errors or hangs, slowest "
        f"{tally.slowest:.2f} s, peak memory {peak} MB"
    )


if __name__ == "__main__":
    sys.exit(main())
