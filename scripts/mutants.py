"""Mutation testing of the rules, the policies and the bounds: ``python scripts/mutants.py`` (or ``make mutants``).

A mutant is the package with one small mistake in it: a plus for a minus, a number off by one, a line left out. The
tests closest to the mutated module are run on it; a mutant that they let pass has survived, and shows what no test
notices. Mutants come from cosmic-ray's operators and three of this package's own (``scripts/mutants_found.py``), a
sample of them that a seed fixes, spread evenly over the rooms. They live in a copy of the tree; results are appended to
a file as they come, so that an interrupted run goes on where it was.

mutmut, the other tool that is kept up, mutates no function that carries a decorator, as every kernel here does. Of
cosmic-ray only the operators are used: its own runner mutates the working tree and starts the same command for every
mutant, 3 s of imports each; here every mutant is a fork of a process that has imported what the tests need of others.
Kernels run as Python where that is quicker than compiling a mutated one; those of the bounds' searches are compiled,
with a cache of their own.
"""

from __future__ import annotations

import hashlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer
from mutants_found import ROOMS, SKIPPED, chosen, closest  # beside this file: the package is not imported here

ROOT = Path(__file__).resolve().parents[1]
RESULTS = "mutants.jsonl"
PYTEST = ("-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-m", "not slow", "--tb=line")
MEMORY_BYTES = 8 * 2**30
COMPILE_S = 60.0
"""Allowed on top to what has to compile a mutated kernel."""
KILLED, TIME, SURVIVED = "killed", "out of time", "survived"


class Tests(NamedTuple):
    """Tests that are run on a mutant.

    Attributes:
        files: below the root, the likeliest to notice first.
        compiled: whether kernels are compiled, not run as Python.
    """

    files: tuple[str, ...]
    compiled: bool


class Outcome(NamedTuple):
    """What the tests said of a tree.

    Attributes:
        verdict: see ``KILLED`` and its like.
        seconds: of processor time.
        test: the first that failed, or what else is known.
    """

    verdict: str
    seconds: float
    test: str


def main(
    sample: Annotated[int, typer.Option(min=1, help="Mutants, spread evenly over the rooms.")] = 300,
    seed: Annotated[int, typer.Option(help="Which ones; a larger sample of a seed begins with the smaller one.")] = 0,
    out: Annotated[Path, typer.Option(help="Folder of the results.")] = Path("results/mutants"),
    only: Annotated[str, typer.Option(help="Modules whose path begins so.")] = "",
    again: Annotated[bool, typer.Option(help="Try the survivors once more: tests have been added.")] = False,
) -> None:
    """Sample mutants, run the closest tests on each, and list those that survive."""
    out.mkdir(parents=True, exist_ok=True)
    os.environ["NUMBA_CACHE_DIR"] = str(out.resolve() / "machine-code")
    _import_what_others_wrote()
    mutants = [mutant for mutant in chosen(ROOT, sample, seed) if mutant.module.startswith(only)]
    file = out / RESULTS
    known = read(file)
    done = {key for key, result in known.items() if not (again and result["verdict"] == SURVIVED and "diff" in result)}
    left = [mutant for mutant in mutants if mutant.key not in done]
    typer.echo(f"{len(mutants)} mutants, {len(mutants) - len(left)} of them known from {file}")
    # Always in the same place: machine code is kept by the folder of its source.
    tree, digest = copy_tree(out.resolve() / "tree")
    for number, mutant in enumerate(left, 1):
        tests = Tests(*closest(mutant.module))
        unmutated = f"{digest} {' '.join(tests.files)}"
        if unmutated not in known:
            known[unmutated] = kept(file, {"key": unmutated, **_whole(tree, tests)._asdict()})
        limit_s = 2.0 * known[unmutated]["seconds"] + 5.0 + (COMPILE_S if tests.compiled else 0.0)
        path = tree / mutant.module
        whole = path.read_text("utf-8")
        path.write_text(mutant.code, "utf-8")
        try:
            outcome = run(tree, tests, limit_s)
        finally:
            path.write_text(whole, "utf-8")
        row = {"key": mutant.key, "room": mutant.room, "module": mutant.module, "line": mutant.line}
        row |= {"operator": mutant.operator, **outcome._asdict(), "diff": mutant.diff}
        known[mutant.key] = kept(file, row)
        words = f"{outcome.verdict:11} {outcome.seconds:5.1f} s  {mutant.module}:{mutant.line} {mutant.operator}"
        typer.echo(f"{number:4}/{len(left)} {words}  {outcome.test}")
    report([known[mutant.key] for mutant in mutants], list(ROOMS))


def read(file: Path) -> dict[str, dict[str, Any]]:
    """Results by mutant, the last of each; a line that an interruption cut off is left out."""
    found = {}
    for line in file.read_text("utf-8").splitlines() if file.exists() else []:
        try:
            row = json.loads(line)
        except ValueError:
            continue
        found[row["key"]] = row
    return found


def kept(file: Path, row: dict[str, Any]) -> dict[str, Any]:
    """The same result, once it stands in the file."""
    with file.open("a", encoding="utf-8") as lines:
        lines.write(json.dumps(row) + "\n")
    return row


def report(rows: list[dict[str, Any]], rooms: list[str]) -> None:
    """Print the survivors with what was changed, and the score by room and in all."""
    for row in rows:
        if row["verdict"] == SURVIVED:
            typer.echo(f"\n{row['module']}:{row['line']} {row['operator']}\n{row['diff']}")
    typer.echo("")
    for room in [*rooms, ""]:
        some = [row for row in rows if room in ("", row["room"])]
        verdicts = Counter(row["verdict"] for row in some)
        if some:
            share = 1.0 - verdicts[SURVIVED] / len(some)
            counts = ", ".join(f"{verdict} {count}" for verdict, count in sorted(verdicts.items()))
            typer.echo(f"{room or 'all':22} {100.0 * share:5.1f} % of {len(some)} noticed ({counts})")
    typer.echo(f"{sum(row['seconds'] for row in rows) / 60.0:.1f} minutes of one core")


def copy_tree(folder: Path) -> tuple[Path, str]:
    """The files that git knows or would take, in a folder of the package's name, and a digest of them."""
    tree, digest = folder / "fieldgym", hashlib.sha256()
    shutil.rmtree(tree, ignore_errors=True)
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        check=True,
    )
    for name in sorted(listed.stdout.decode().split("\0")):
        source = ROOT / name
        if name and source.is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, tree / name)
            digest.update(name.encode() + b"\0" + source.read_bytes())
    return tree, digest.hexdigest()[:16]


def _whole(tree: Path, tests: Tests) -> Outcome:
    """What the tests take on the package as it is; a mutant gets more than twice that."""
    outcome, words = run(tree, tests, 600.0), " ".join(tests.files)
    if outcome.verdict != SURVIVED:
        raise typer.BadParameter(f"{words}: fails without any mutation ({outcome.test}): mend that first")
    typer.echo(f"     unmutated {outcome.seconds:5.1f} s  {words}")
    return outcome


def run(tree: Path, tests: Tests, limit_s: float) -> Outcome:
    """Run tests in a fork of this process, on the package in ``tree``."""
    log = tree.parent / "log"
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    child = os.fork()
    if child == 0:
        _run_here(tree, tests, limit_s, log)
    # Processor time is limited in the child; a test that sleeps for ever ends here.
    patience = time.monotonic() + 20.0 * limit_s
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            break
        if time.monotonic() > patience:
            os.killpg(child, signal.SIGKILL)
        time.sleep(0.02)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 2)
    text = log.read_text("utf-8", "replace")
    if os.WIFSIGNALED(status):
        killer = signal.Signals(os.WTERMSIG(status))
        late = killer in (signal.SIGXCPU, signal.SIGKILL)
        return Outcome(TIME if late else KILLED, seconds, killer.name)
    code = os.WEXITSTATUS(status)
    if code == 0:
        return Outcome(SURVIVED, seconds, "")
    if code in (1, 2):
        lines = [line for line in text.splitlines() if line.startswith(("FAILED", "ERROR"))]
        return Outcome(KILLED, seconds, lines[0].split(" - ")[0] if lines else "")
    raise RuntimeError(f"pytest ended with {code} on {' '.join(tests.files)}:\n{text[-2000:]}")


def _run_here(tree: Path, tests: Tests, limit_s: float, log: Path) -> None:
    """Become the process that runs the tests; never comes back."""
    code = 3
    try:
        os.setsid()
        target = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(target, 1)
        os.dup2(target, 2)
        sys.stdout = sys.stderr = os.fdopen(1, "w", encoding="utf-8")
        limit = int(limit_s) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        os.chdir(tree)
        sys.path[0] = str(tree.parent)
        sys.dont_write_bytecode = True
        import numba
        import pytest

        os.environ["NUMBA_DISABLE_JIT"] = str(int(not tests.compiled))
        numba.config.DISABLE_JIT = not tests.compiled  # type: ignore[attr-defined]
        left_out = " and ".join(f"not {name}" for name in SKIPPED)
        code = int(pytest.main([*PYTEST, "-k", left_out, *tests.files]))
    finally:
        sys.stdout.flush()
        os._exit(code)


def _import_what_others_wrote() -> None:
    """What every child would import for itself; nothing of this package, which the children import mutated."""
    import gymnasium  # noqa: F401
    import hypothesis  # noqa: F401
    import pytest  # noqa: F401
    import yaml  # noqa: F401

    assert "fieldgym" not in sys.modules


if __name__ == "__main__":
    typer.run(main)
