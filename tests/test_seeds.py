"""Seeds are told apart once: blocks do not overlap, and nowhere else in the code stands a seed's number."""

import ast
import sys
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import pytest
import typer
from test_rooms import MODULES

from fieldgym.benchmark import suites
from fieldgym.kernels.seeds import BLOCKS, HELD_OUT, SHOWN, TUNED, Block, HeldOutError, refuse_held_out
from fieldgym.scripts import cli

SMALLEST = 10_000
"""Numbers from here on may not stand beside a seed's name: smaller ones lie at the beginning of the tuned block."""
NOT_OF_FIELDS = {"BOOTSTRAP_SEED"}
"""Names of seeds that no field is drawn from."""
HOME = "kernels.seeds"


def large(node: ast.AST) -> bool:
    """Whether an expression holds a number that could be a block's."""
    return any(
        isinstance(part, ast.Constant) and type(part.value) is int and part.value >= SMALLEST for part in ast.walk(node)
    )


def seeds_in(tree: ast.AST) -> list[str]:
    """Where a large number stands beside a seed's name, or begins a range."""
    found = []
    for node in ast.walk(tree):
        names, value = [], None
        if isinstance(node, ast.Assign):
            names, value = [ast.unparse(target) for target in node.targets], node.value
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            names, value = [ast.unparse(node.target)], node.value
        elif isinstance(node, ast.keyword) and node.arg:
            names, value = [node.arg], node.value
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "range" and len(node.args) > 1:
            names, value = ["a range of seeds"], node.args[0]
        elif isinstance(node, ast.FunctionDef):
            spare = len(node.args.args) - len(node.args.defaults)
            for argument, default in zip(node.args.args[spare:], node.args.defaults, strict=True):
                if "seed" in argument.arg.lower() and large(default):
                    found.append(f"{argument.arg} of {node.name}")
        if value is not None and large(value):
            found += [name for name in names if "seed" in name.lower() and name not in NOT_OF_FIELDS]
    return found


def test_blocks_lie_one_behind_the_other():
    blocks = list(BLOCKS.values())
    assert all(block.first < block.end for block in blocks)
    assert all(one.end <= other.first for one, other in pairwise(blocks))


def test_a_block_gives_no_more_than_it_has():
    block = Block(10, 13, "three")
    assert list(block.take(2, 1)) == [11, 12]
    with pytest.raises(ValueError, match="3 seeds behind 1"):
        block.take(3, 1)


@pytest.mark.parametrize("name", sorted(set(MODULES) - {HOME}))
def test_no_other_module_writes_a_seed_down(name):
    assert not seeds_in(ast.parse(MODULES[name].read_text("utf-8")))


def test_the_look_for_seeds_sees_each_way_to_write_one():
    for line in (
        "FIRST_SEED = 700_000",
        "FIRST_SEED: int = 700_000",
        "a(seed=700_000)",
        "range(700_000, n)",
        "def a(b, seed=700_000): ...",
        "MEASURE_SEED = X + 1_000_000 - 5_000",
    ):
        assert seeds_in(ast.parse(line)), line
    assert not seeds_in(ast.parse("def a(steps=700_000, seed=0): range(n, 700_000)"))


def test_suites_take_their_seeds_from_their_blocks():
    blocks = {"quick": TUNED, "full": HELD_OUT, "tiers": SHOWN}
    assert set(blocks) == set(suites.SUITES)
    for name, block in blocks.items():
        for case in suites.suite(name).cases:
            assert case.seeds == tuple(block.take(len(case.seeds)))


def test_what_is_no_benchmark_is_refused_held_out_seeds():
    refuse_held_out([HELD_OUT.first - 1, HELD_OUT.end, *SHOWN.take(2)])
    for seed in (HELD_OUT.first, HELD_OUT.end - 1):
        with pytest.raises(HeldOutError, match="held out for the benchmark"):
            refuse_held_out([0, seed])


NOT_THE_FIELDS = {"train"}
"""Commands whose ``--seed`` is of something else: a run, whose fields lie in ``TRAINING``."""
WORDS = {
    "run": ["HoeWeeding", "--policy", "fifo", "--episodes", "2"],
    "evaluate": ["HoeWeeding", "--policy", "fifo", "--episodes", "2"],
    "collect": ["HoeWeeding", "--policy", "fifo", "--episodes", "2"],
    "view": ["HoeWeeding"],
    "field draw": ["HoeWeeding", "--out", "no/field.csv"],
    "field check": ["field.csv", "--env", "HoeWeeding"],
}
"""How the others are called."""


def seeded(group: Any, above: tuple[str, ...] = ()) -> Iterator[str]:
    """Every command with a ``--seed`` by its words."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from seeded(command, (*above, name))
        elif any("--seed" in option.opts for option in command.params):
            yield " ".join((*above, name))


def test_every_command_with_a_seed_is_known_here():
    assert set(seeded(typer.main.get_command(cli.app))) - NOT_THE_FIELDS == set(WORDS)


@pytest.mark.parametrize("command", WORDS)
def test_commands_refuse_held_out_seeds(command, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)

    words = WORDS[command]
    # The first of two episodes may be played, the second may not.
    seed = HELD_OUT.first - ("--episodes" in words)
    monkeypatch.setattr(sys, "argv", ["fieldgym", *command.split(), *words, "--seed", str(seed)])
    with pytest.raises(SystemExit) as left:
        cli.main()
    out, err = capsys.readouterr()
    assert left.value.code == 2 and out == "" and err.count("\n") == 1
    assert f"seed {HELD_OUT.first} is held out for the benchmark" in err
    assert not (tmp_path / "no").exists()
