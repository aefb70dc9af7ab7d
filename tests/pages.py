"""Play the code of a page as a reader would: ``python tests/pages.py PAGE`` in an empty folder; see ``test_pages.py``.

A page's blocks run one after another in one process: Python ones share their names, ``fieldgym`` commands run in the
same folder, so that one reads what another wrote. A comment before a block says what else there is to it:

- ``<!-- test: is first.py -->``: the block is a file of that name, there before anything runs; so is one after a
  sentence that ends with such a name;
- ``<!-- test: A -> B; C -> D -->``: what runs has B in place of A, to be short;
- ``<!-- test: needs torch -->``: the block stays out where that module is not installed, which is told;
- ``<!-- test: file NAME``, lines, ``-->``: a file that the page speaks of and does not show.
"""

import importlib.util
import re
import shlex
import shutil
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]

SHORTER = (
    (r"--episodes \d+", "--episodes 2"),
    (r"--steps \d+", "--steps 64"),
    (r"--seconds \d+", "--seconds 2"),
    (r"--speed \d+", "--speed 200"),
    (r"/tmp/results", "results/elsewhere"),
    (r"reproduce( all)?$", "reproduce transplanting --jobs 1"),
)
"""What every command is made short by."""
MORE = {
    "benchmark": {"--env": "SafflowerPicking", "--backend": "analytic", "--episodes": "2", "--jobs": "1"},
    "collect": {"--episodes": "2"},
    "evaluate": {"--episodes": "2"},
    "run": {"--backend": "analytic"},
    "train": {"--steps": "64", "--config": "small.yaml"},
    "view": {"--port": "0"},
}
"""Options that a command gets where the page gives none of that name."""
_FEW = (
    "{num_envs: 2, n_steps: 32, batch_size: 32, evaluation_episodes: 2, evaluate_every: 1, teacher_decisions: 1500, "
    "teacher_epochs: 1}"
)
SMALL = f"defaults: {_FEW}\npixels: {_FEW}\n"
"""Settings of a training that is over in seconds."""
NEEDS = {"fieldgym train": "sb3_contrib", "results/train/": "sb3_contrib", "fieldgym view": "viser",
         "fieldgym collect": "minari", "--video": "imageio"}  # fmt: skip
"""Modules of extras that commands need, by a part of them."""
NOT_RUN = {
    "pip install": "installs into the environment that the tests run in; test_packaging builds and installs the wheel",
    "make ": "test_readme holds the Makefile's targets to their names; CI calls them",
    ".ci/run": "is what runs these tests",
    "python scripts/speed.py": "measures for minutes; tests run its sections",
    "python scripts/clone_policy.py": "learns for a minute; test_clone runs it on a small set",
    "python scripts/train_weed_eyes.py": "learns for a quarter of an hour; test_weed_eyes plays its nets by hand",
    "python scripts/growth.py": "measures for hours; tests run its parts",
    "python -m fieldgym.scripts.compare_renderers": "measures for minutes; test_compare_renderers runs it on a camera",
    "python -m rl_zoo3.": "learns for minutes; test_gymnasium_wrappers trains and enjoys for some decisions",
    "python3.11 -m venv rllib": "likewise, for RLlib",
    "rllib/bin/": "likewise",
}
"""Commands that no test runs, and why."""
SHOWN = {"text", "toml", "yaml", "json"}
"""Languages of blocks that are read, not run; one that is a file says so."""


class Block(NamedTuple):
    """A fenced block: its language, its lines, what the comment before it says, and its line in the page."""

    language: str
    body: str
    mark: str
    line: int

    @property
    def name(self) -> str:
        """Name of the file that it is, empty if it is none."""
        found = re.match(r"is (\S+)", self.mark)
        return found[1] if found else ""

    @property
    def needs(self) -> str:
        """Module that it needs."""
        found = re.search(r"needs (\w+)", self.mark)
        return found[1] if found else ""

    def shortened(self, text: str) -> str:
        """Text with what the comment puts in the place of what."""
        for part in self.mark.split(";"):
            old, arrow, new = part.partition(" -> ")
            if arrow:
                if old.strip() not in self.body:
                    raise ValueError(f"line {self.line}: the block has no {old.strip()!r}")
                text = text.replace(old.strip(), new.strip())
        return text

    @property
    def commands(self) -> list[str]:
        """Lines of a shell, without comments; lines that go on are one."""
        lines = [re.sub(r"(^|\s)#.*", "", line) for line in self.body.replace("\\\n", " ").splitlines()]
        return [" ".join(line.split()).removeprefix(".venv/bin/") for line in lines if line.strip()]


_BLOCK = re.compile(
    r"(?:^[ ]*<!-- test: (?P<mark>[^\n]*?) -->\n+)?"
    r"^(?P<indent>[ ]*)```(?P<language>[^\n`]*)\n(?P<body>.*?)^(?P=indent)```$",
    re.M | re.S,
)


def blocks_of(text: str) -> list[Block]:
    """Every fenced block of a page but Sphinx's directives."""
    found = []
    for block in _BLOCK.finditer(text):
        if block["language"].startswith("{"):
            continue
        body = re.sub(rf"^{block['indent']}", "", block["body"], flags=re.M)
        before = re.search(r"`([\w.-]+\.\w+)`:?\s*\Z", text[: block.start()])
        mark = block["mark"] or (f"is {before[1]}" if before else "")
        found.append(Block(block["language"].strip(), body, mark, text[: block.start()].count("\n") + 1))
    return found


def files_of(text: str) -> dict[str, str]:
    """Files that comments hold, and blocks that are files, by name."""
    hidden = dict(re.findall(r"^<!-- test: file (\S+)\n(.*?)^-->$", text, re.M | re.S))
    return hidden | {block.name: block.body for block in blocks_of(text) if block.name}


def left_out(command: str) -> str:
    """Why a command is not run, empty if it is."""
    return next((why for start, why in NOT_RUN.items() if command.startswith(start)), "")


def missing(modules: str) -> str:
    """The first of some modules, in words, that is not installed; empty if all are."""
    return next((name for name in modules.split() if importlib.util.find_spec(name) is None), "")


def words_of(command: str) -> list[str]:
    """Words of a ``fieldgym`` command as the test gives them, the first one left out."""
    for pattern, short in SHORTER:
        command = re.sub(pattern, short, command)
    words = shlex.split(command)[1:]
    for option, value in MORE.get(words[0], {}).items():
        words += [] if option in words else [option, value]
    if "--video" in words and "--speed" not in words:
        words += ["--speed", "200"]  # fewer frames
    if words[0] == "view" and "--record" in words:
        words = words[: words.index("--port")]
    return words


def _install(example: Path) -> None:
    """Make a task beside this folder known as an installed package would."""
    shutil.copy(example / f"{example.name}.py", ".")
    folder = Path(f"{example.name}-0.1.0.dist-info")
    folder.mkdir()
    (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {example.name}\nVersion: 0.1.0\n")
    (folder / "entry_points.txt").write_text(f"[fieldgym.tasks]\n{example.name} = {example.name}:SPEC\n")


def play(page: Path) -> None:
    """Run all of a page; the first thing that fails is raised."""
    text = page.read_text("utf-8")
    for name, body in files_of(text).items():
        Path(name).write_text(body, "utf-8")
    Path("small.yaml").write_text(SMALL, "utf-8")
    for example in re.findall(r"pip install -e (examples/\w+)", text):
        _install(ROOT / example)
    sys.path.insert(0, str(Path.cwd()))

    from typer.testing import CliRunner

    from fieldgym.scripts import cli

    if not missing("viser"):
        from fieldgym.viewer import show

        show.Viewer.run = lambda self, until=None: None  # it would serve until somebody stops it
    names: dict[str, object] = {"__name__": "page"}
    for block in blocks_of(text):
        where = f"{page.name}, line {block.line}"
        if missing(block.needs):
            print(f"left out: {where}: {block.needs} is not installed")
        elif block.language == "python" and not block.name:
            print(f"runs: {where}", flush=True)
            exec(compile(block.shortened(block.body), where, "exec"), names)
        elif block.language not in SHOWN and not block.name:
            for command in block.commands:
                if left_out(command):
                    continue
                lacking = missing(" ".join(module for part, module in NEEDS.items() if part in command))
                if lacking:
                    print(f"left out: {where}: {command}: {lacking} is not installed")
                    continue
                words = words_of(block.shortened(command))
                print(f"runs: {where}: fieldgym {shlex.join(words)}", flush=True)
                done = CliRunner().invoke(cli.app, words, catch_exceptions=False)
                if done.exit_code:
                    raise RuntimeError(f"{where}: {command}\n{done.output}")


if __name__ == "__main__":
    play(Path(sys.argv[1]))
