"""Files that outlive crashes, and files that somebody else wrote: nothing is lost, nothing is believed unseen."""

import ast
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from made_up import Playing, record, small_suite, write

from fieldgym.benchmark import runner, store, tables
from fieldgym.benchmark.report import leaderboard, reader
from fieldgym.kernels import files, locks

pytestmark = pytest.mark.portable

ROOT = Path(__file__).parents[1]


def run_python(code: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    names = {**os.environ, **environment}
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        env=names,
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=120,
    )


# Writing


def test_a_file_is_on_the_disk_before_it_takes_the_old_ones_place_and_the_folder_after(tmp_path: Path, monkeypatch):
    happened = []
    fsync, rename = os.fsync, os.replace

    def kind(handle: int) -> str:
        return "folder" if os.path.isdir(f"/dev/fd/{handle}") else "file"

    monkeypatch.setattr(os, "fsync", lambda handle: (happened.append(kind(handle)), fsync(handle)))
    monkeypatch.setattr(os, "replace", lambda a, b: (happened.append("rename"), rename(a, b)))
    files.replace_file(tmp_path / "f.json", "ä\r\n")
    assert happened == ["file", "rename", "folder"]
    assert (tmp_path / "f.json").read_bytes() == "ä\r\n".encode()


def test_a_file_whose_writing_fails_stays_what_it_was(tmp_path: Path):
    (tmp_path / "f.json").write_text("old", "utf-8")
    with pytest.raises(ZeroDivisionError), files.replaced(tmp_path / "f.json") as new:
        assert (new.parent, new.suffix) == (tmp_path, ".json")
        new.write_text("half", "utf-8")
        raise ZeroDivisionError
    assert [path.name for path in tmp_path.iterdir()] == ["f.json"]
    assert (tmp_path / "f.json").read_text("utf-8") == "old"


def test_a_record_is_on_the_disk_before_it_is_told(tmp_path: Path, monkeypatch):
    synced, fsync = [], os.fsync
    told: list[bool] = []
    monkeypatch.setattr(os, "fsync", lambda handle: (synced.append(os.fstat(handle).st_ino), fsync(handle)))
    ino = lambda: (tmp_path / store.EPISODES).stat().st_ino  # noqa: E731
    runner.run_suite(small_suite(1), tmp_path, run=Playing(), on_record=lambda _: told.append(synced[-1] == ino()))
    assert told == [True, True]


def test_a_record_is_whole_where_the_disk_takes_it_in_parts(tmp_path: Path, monkeypatch):
    write = os.write
    monkeypatch.setattr(os, "write", lambda handle, data: write(handle, data[:50]))
    runner.run_suite(small_suite(1), tmp_path, run=Playing())
    assert len(store.read(tmp_path / store.EPISODES)) == 2


def calls(tree: ast.AST) -> list[tuple[str, ast.Call]]:
    found = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    return [(getattr(node.func, "attr", getattr(node.func, "id", "")), node) for node in found]


def sources() -> list[Path]:
    rooms = [path for path in ROOT.rglob("*.py") if not {"tests", "build", ".venv"} & set(path.relative_to(ROOT).parts)]
    return [path for path in rooms if not any(part.startswith(".") for part in path.relative_to(ROOT).parts)]


def test_text_is_read_and_written_as_utf_8_whatever_the_locale():
    odd = []
    for path in sources():
        for name, call in calls(ast.parse(path.read_text("utf-8"))):
            words = [ast.unparse(each) for each in (*call.args, *(keyword.value for keyword in call.keywords))]
            named = any("utf" in word for word in words)
            binary = any(word in ("'rb'", "'wb'", "'ab'", "'xb'") for word in words)
            owner = ast.unparse(call.func)
            if (name in ("read_text", "write_text") and owner not in ("read_text",) and not named) or (
                owner == "open" and not named and not binary
            ):
                odd.append(f"{path.relative_to(ROOT)}:{call.lineno}")
    assert not odd


def test_there_is_one_way_to_replace_a_file():
    """``str.replace`` takes two arguments, ``dataclasses.replace`` names fields: a rename is called with one path."""
    own = {ROOT / "kernels" / "files.py", ROOT / "benchmark" / "store.py"}
    odd = [
        f"{path.relative_to(ROOT)}:{call.lineno}"
        for path in sources()
        if path not in own
        for name, call in calls(ast.parse(path.read_text("utf-8")))
        if ast.unparse(call.func) in ("os.replace", "os.rename")
        or (
            name in ("replace", "rename")
            and isinstance(call.func, ast.Attribute)
            and len(call.args) == 1
            and not call.keywords
        )
    ]
    assert not odd


# Locks


def test_two_runs_do_not_share_a_folder(tmp_path: Path):
    first = store.Results(tmp_path, store.manifest(small_suite()), resume=False)
    with pytest.raises(
        store.ResultsError, match=rf"another run writes into .* \(process {os.getpid()} of .*--out$"
    ) as told:
        runner.run_suite(small_suite(), tmp_path, resume=True, run=Playing())
    assert "\n" not in str(told.value)
    first.close()
    runner.run_suite(small_suite(1), tmp_path, run=Playing())
    assert not (tmp_path / locks.LOCK).exists()


def test_ctrl_c_and_refusals_let_go_of_the_folder(tmp_path: Path):
    with pytest.raises(runner.InterruptedRunError):
        runner.run_suite(small_suite(), tmp_path, run=Playing(stop_before=3))
    (tmp_path / store.MANIFEST).unlink()
    for _ in range(2):
        with pytest.raises(store.ResultsError, match=r"manifest\.json is missing"):
            runner.run_suite(small_suite(), tmp_path, resume=True, run=Playing())
    assert not (tmp_path / locks.LOCK).exists()


KILLED = """
import os, sys
from pathlib import Path
from fieldgym.kernels.locks import FolderLock
lock = FolderLock(Path(sys.argv[1]))
os._exit(9)
"""


def test_what_a_killed_run_left_is_taken_over(tmp_path: Path):
    assert run_python(KILLED, str(tmp_path)).returncode == 9
    left = json.loads((tmp_path / locks.LOCK).read_bytes())
    with locks.FolderLock(tmp_path):
        now = json.loads((tmp_path / locks.LOCK).read_bytes())
        assert now["process"] == os.getpid() != left["process"]
        with pytest.raises(locks.FolderBusyError):
            locks.FolderLock(tmp_path)
    locks.FolderLock(tmp_path).release()


@pytest.mark.parametrize("content", [b"", b"[]", b"{", b"\xff", b'{"process": "x"}', b"[" * 9000])
def test_a_lock_that_is_damaged_does_not_hold(tmp_path: Path, content: bytes):
    (tmp_path / locks.LOCK).write_bytes(content)
    locks.FolderLock(tmp_path).release()


def test_a_lock_of_another_host_holds_until_it_is_deleted(tmp_path: Path):
    told = {"process": 1, "host": "far.away", "user": "eve\n", "since": "yesterday"}
    (tmp_path / locks.LOCK).write_text(json.dumps(told), "utf-8")
    with pytest.raises(
        locks.FolderBusyError, match=r"process 1 of eve on far.away, since yesterday.* delete .*\.lock$"
    ):
        locks.FolderLock(tmp_path)


def test_without_locks_of_the_system_a_living_process_holds(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(locks, "fcntl", None)
    mine = {**locks._self(), "process": os.getppid()}
    (tmp_path / locks.LOCK).write_text(json.dumps(mine), "utf-8")
    with pytest.raises(locks.FolderBusyError):
        locks.FolderLock(tmp_path)
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    (tmp_path / locks.LOCK).write_text(json.dumps({**mine, "process": dead.pid}), "utf-8")
    locks.FolderLock(tmp_path).release()


# What a terminal takes


COMMAND = "from fieldgym.scripts.cli import main; main()"


def told_by_report(folder: Path, tmp_path: Path, **how: Any) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-c", COMMAND, "report", str(folder), "--out", str(tmp_path / "page.html")]
    words += ["--leaderboard", str(tmp_path / "board.md")]
    return subprocess.run(words, text=True, encoding="utf-8", timeout=120, stderr=subprocess.PIPE, **how)


def test_reports_are_utf_8_and_their_table_is_told_whatever_the_locale(tmp_path: Path):
    odd = [{**record("fixed-order", seed), "scenario": "p\u00f6ts"} for seed in (1, 2)]
    locale = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0", "PYTHONIOENCODING": "ascii"}
    folder = write(tmp_path / "r\u00f6w", [*odd, record("nearest", 1)])
    done = told_by_report(folder, tmp_path, env={**os.environ, **locale}, stdout=subprocess.PIPE)
    assert done.returncode == 0 and done.stdout.startswith("Written: ") and done.stderr == ""
    assert "p\u00f6ts" in (tmp_path / "page.html").read_text("utf-8")


def test_the_terminals_tables_survive_an_ascii_terminal(tmp_path: Path):
    code = """
import sys
from pathlib import Path
import typer
from fieldgym.scripts.common import execute
app = typer.Typer()
@app.command()
def main() -> None:
    from rich.console import Console
    from fieldgym.benchmark import store, tables
    console = Console(width=150)
    for table in tables.terminal_tables(tables.summarise(store.read(Path(sys.argv[2])), []), 150):
        console.print(table)
sys.argv.insert(1, "--")
execute(app, "x")
"""
    code = code.replace("def main() -> None:", "def main(file: str) -> None:")
    folder = write(tmp_path / "r", [{**record("b\u00e4r", seed), "scenario": "p\u00f6ts"} for seed in (1, 2)])
    done = run_python(code, str(folder / store.EPISODES), PYTHONIOENCODING="ascii", PYTHONUTF8="0")
    assert done.returncode == 0, done.stderr
    assert "b?r" in done.stdout and "p?ts" in done.stdout and done.stderr == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_standard_output_is_not_blamed_on_the_folder(tmp_path: Path):
    folder = write(tmp_path / "r", [record("fixed-order", seed) for seed in (1, 2)])
    with open("/dev/full", "w", encoding="utf-8") as full:
        done = told_by_report(folder, tmp_path, stdout=full)
    assert (done.returncode, done.stderr) == (
        2,
        "fieldgym: cannot write to the standard output (No space left on device)\n",
    )


def test_markdown_escapes_names(tmp_path: Path):
    name = "a|b`c\n<i>[x](y) *z*"
    records = [{**record(policy, seed), "scenario": name} for policy in ("fixed-order", name) for seed in (1, 2)]
    folder = write(tmp_path / "r", records)
    board = leaderboard.render(reader.load(folder), f"fieldgym report --out {name}")
    summary = tables.markdown(tables.summarise(records, []))
    escaped = r"a\|b\`c &lt;i&gt;\[x\](y) \*z\*"
    for text in (board, summary):
        assert escaped in text and "<i>" not in text.replace("a|b`c <i>[x](y) *z* ``", "")
        rows = [line for line in text.splitlines() if line.startswith("|") and "fixed-order" in line]
        ours = [line for line in text.splitlines() if line.startswith("|") and escaped in line]
        assert {row.replace(r"\|", "").count("|") for row in rows} == {
            row.replace(r"\|", "").count("|") for row in ours
        }


def test_ctrl_c_while_the_command_loads_ends_it_quietly(tmp_path: Path):
    """The script that pip makes is called fieldgym; Ctrl-C comes before main is called."""
    script = tmp_path / "fieldgym"
    loading = "import os, signal, fieldgym; {}os.kill(os.getpid(), signal.SIGINT); print('went on')"
    script.write_text(loading.format("signal.signal(signal.SIGINT, signal.SIG_IGN); "), "utf-8")
    ignored = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=60)
    assert (ignored.returncode, ignored.stdout, ignored.stderr) == (0, "went on\n", "")
    script.write_text(
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); " + loading.format(""), "utf-8"
    )
    stopped = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=60)
    assert (stopped.returncode, stopped.stdout, stopped.stderr) == (-signal.SIGINT, "", "")
    script.write_text(
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); import os, typer\n"
        "from fieldgym.scripts.common import execute\napp = typer.Typer()\n"
        "@app.command()\ndef main() -> None:\n    os.kill(os.getpid(), signal.SIGINT)\nexecute(app, 'fieldgym')\n",
        "utf-8",
    )
    told = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=60)
    assert told.returncode == 130 and "Traceback" not in told.stderr
