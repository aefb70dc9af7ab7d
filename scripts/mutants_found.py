"""Which mistakes ``scripts/mutants.py`` makes: modules, the tests closest to each, operators, places left out."""

from __future__ import annotations

import difflib
import hashlib
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import parso.python.tree
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.operator import Example, Operator
from cosmic_ray.plugins import get_operator

ROOMS: dict[str, tuple[str, ...]] = {
    "envs/safflower": ("core", "drawing", "features", "process", "rules", "state", "timing"),
    "envs/sorting": (
        "chances",
        "columns",
        "core",
        "drawing",
        "motions",
        "process",
        "reports",
        "rules",
        "state",
        "timing",
    ),
    "envs/transplanting": ("columns", "core", "process", "rules", "showing", "timing"),
    "envs/weeding": (
        *("core", "drawing", "features", "gaps", "process", "response", "rules", "sighting", "state", "timing"),
        *("tools/laser/aim", "tools/laser/process", "tools/hoe/arm", "tools/hoe/process"),
    ),
    "agents/policies": (
        *("base", "layout", "network", "routes", "safflower", "search", "sorting", "sorting_value"),
        *("transplanting", "weeding", "weeding_horizon", "weeding_outlook"),
    ),
    "bounds": (
        *("base", "belt", "gardener", "safflower", "shots", "sorting", "stops", "strip", "timeline"),
        *("transplanting", "weeding"),
    ),
}
"""Modules that are mutated, by room."""

DEMAND = "weeding_demand.py::test_kills_beyond_the_demand_are_worth_nothing"
TAKEN_DOWN = "drawn_fields.py::test_fields_are_those_that_were_taken_down[fieldgym/{}-v0]"
CLOSEST: dict[str, tuple[str, ...]] = {
    "envs/safflower/drawing": (
        TAKEN_DOWN.format("SafflowerPicking"),
        "safflower_laws",
        "laws_neighbours",
        "laws_parts",
    ),
    "envs/safflower": (
        "safflower_laws",
        "safflower_oracle",
        "safflower_task",
        "laws_cores",
        "safflower_standing",
        "laws_parts",
    ),
    "envs/sorting/drawing": (TAKEN_DOWN.format("ProduceSorting"), "sorting_field", "laws_parts"),
    "envs/sorting/motions": ("laws_sorter_motions", "sorting_task", "laws_parts"),
    "envs/sorting": (
        *("sorting_numbers", "sorting_task", TAKEN_DOWN.format("ProduceSorting"), "laws_cores", "laws_sorter_motions"),
        "laws_parts",
    ),
    "envs/transplanting/core": (
        *("transplanting_rules", "transplanting_recomputed", "laws_cores"),
        "drives.py::test_a_batch_of_machines_that_err_is_its_single_ones[fieldgym/TrayTransplanting-v0]",
    ),
    "envs/transplanting": (
        *("transplanting_timing", "transplanting_rules", "transplanting_recomputed", "laws_transplanter_policies"),
        TAKEN_DOWN.format("TrayTransplanting"),
        "laws_parts",
    ),
    "envs/weeding/drawing": (
        TAKEN_DOWN.format("LaserWeeding"),
        TAKEN_DOWN.format("HoeWeeding"),
        "weeding_task",
        "laws_parts",
    ),
    "envs/weeding/gaps": ("laws_neighbours", TAKEN_DOWN.format("LaserWeeding"), "weeding_numbers"),
    "envs/weeding/sighting": (TAKEN_DOWN.format("LaserWeeding"), TAKEN_DOWN.format("HoeWeeding"), "weeding_task"),
    "envs/weeding/tools/hoe": ("hoe", "weeding_numbers", "laws_constants"),
    "envs/weeding/tools/laser": ("weeding_numbers", "weeding_task", "laws_constants"),
    "envs/weeding": ("weeding_numbers", "weeding_task", "laws_cores", "laws_parts", DEMAND),
    "agents/policies/safflower": ("laws_picker_policies",),
    "agents/policies/sorting": ("laws_sorter_policies",),
    "agents/policies/transplanting": ("laws_transplanter_policies", "transplanting_policies"),
    "agents/policies/weeding": ("laws_weeder_policies",),
    "agents/policies/routes": ("routes", "laws_picker_policies"),
    "agents/policies/search": ("planning", "laws_sorter_policies"),
    "agents/policies": ("laws_policies", "sources"),
    "bounds/base": ("laws_bound_parts", "bounds"),
    "bounds/belt": ("laws_parts", "laws_bound_parts", "laws_bounds"),
    "bounds/sorting": ("laws_bounds",),
    "bounds/stops": ("laws_bound_parts", "laws_bounds"),
    "bounds/safflower": ("laws_bounds",),
    "bounds/transplanting": ("laws_bound_parts", "laws_bounds"),
    "bounds/timeline": ("laws_bound_parts", "laws_bounds"),
    "bounds": ("laws_bound_parts", "laws_bounds"),
}
"""Tests closest to a module, the likeliest to notice first; the first entry that its path begins with counts."""
SKIPPED = "policies_see", "policies_choose", "policies_finish", "planning_ahead", "looking_ahead", "every_tier_runs"
"""Parts of the names of tests that play whole episodes with every policy: slow, and seldom the first to notice."""
COMPILED = ("bounds", "agents/policies/search")
"""Modules whose tests run compiled kernels: searches that would take minutes as Python."""

EXCHANGED = {
    "ReplaceBinaryOperator": (
        "Add_Sub Sub_Add Mul_Div Div_Mul FloorDiv_Mul Mod_FloorDiv Pow_Mul RShift_LShift LShift_RShift BitOr_BitAnd "
        "BitAnd_BitOr"
    ),
    "ReplaceComparisonOperator": (
        "Lt_LtE Lt_GtE LtE_Lt LtE_Gt Gt_GtE Gt_LtE GtE_Gt GtE_Lt Eq_NotEq NotEq_Eq Is_IsNot IsNot_Is"
    ),
    "ReplaceUnaryOperator": "Delete_USub Delete_Not Delete_Invert",
}
ALONE = (
    "AddNot ExceptionReplacer NumberReplacer ReplaceAndWithOr ReplaceBreakWithContinue ReplaceContinueWithBreak "
    "ReplaceFalseWithTrue ReplaceOrWithAnd ReplaceTrueWithFalse ZeroIterationForLoop"
)
"""Of cosmic-ray's operators those whose mutants are mistakes that somebody could make. Left out is what Python itself
refuses at once (bits of floats, a decorator that is gone), which would only flatter the score."""


class Mutant(NamedTuple):
    """One mistake.

    Attributes:
        room: see ``ROOMS``.
        module: path below the root.
        line: where it is.
        operator: that made it.
        code: the whole module with it.
        diff: what was changed.
        key: the same for the same mistake in the same module.
    """

    room: str
    module: str
    line: int
    operator: str
    code: str
    diff: str
    key: str


OTHER_SUM = {"+=": "-=", "-=": "+=", "*=": "/=", "&=": "|="}
PAIRS = ("min max", "argmin argmax", "minimum maximum", "any all", "floor ceil")
OTHER_END = {one: other for pair in map(str.split, PAIRS) for one, other in (pair, pair[::-1])}


BASE: Any = Operator  # whose methods, as they are annotated, give nothing


class LineLeftOut(BASE):
    """An assignment into an array or an object, or one that adds to a name, becomes ``pass``."""

    def mutation_positions(self, node: Any) -> Iterator[Any]:
        """Of such statements."""
        if node.type == "expr_stmt" and len(node.children) == 3:
            target, sign = node.children[0], getattr(node.children[1], "value", "")
            stored = sign == "=" and any(mark in target.get_code() for mark in "[.")
            if stored or sign in ("+=", "-=", "&=", "*="):
                yield node.start_pos, node.end_pos

    def mutate(self, node: Any, index: int) -> Any:
        """The statement's place is kept by ``pass``."""
        leaf = node.get_first_leaf()
        return parso.python.tree.Keyword("pass", leaf.start_pos, leaf.prefix)

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        """One."""
        return (Example("a[0] = 1", "pass"),)


class OtherSum(BASE):
    """``+=`` becomes ``-=`` and the other way round."""

    def mutation_positions(self, node: Any) -> Iterator[Any]:
        """Of such signs."""
        if getattr(node, "value", "") in OTHER_SUM:
            yield node.start_pos, node.end_pos

    def mutate(self, node: Any, index: int) -> Any:
        """The other sign."""
        node.value = OTHER_SUM[node.value]
        return node

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        """One."""
        return (Example("a += 1", "a -= 1"),)


class OtherEnd(BASE):
    """The smallest for the largest, the first for the last, any for all: one name for its opposite."""

    def mutation_positions(self, node: Any) -> Iterator[Any]:
        """Of such names where they are called."""
        if node.type == "name" and node.value in OTHER_END and "(" in (node.get_next_leaf() or node).value:
            yield node.start_pos, node.end_pos

    def mutate(self, node: Any, index: int) -> Any:
        """The opposite."""
        node.value = OTHER_END[node.value]
        return node

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        """One."""
        return (Example("min(a, b)", "max(a, b)"),)


def operators() -> dict[str, Any]:
    """Every operator by name."""
    found: dict[str, Any] = {kind.__name__: kind() for kind in (LineLeftOut, OtherSum, OtherEnd)}
    names = [f"{group}_{pair}" for group, pairs in EXCHANGED.items() for pair in pairs.split()]
    return found | {name: get_operator(f"core/{name}")() for name in [*names, *ALONE.split()]}


SUMS = ("arith_expr", "term", "power", "shift_expr", "and_expr", "xor_expr", "expr")


def idle(node: Any) -> bool:
    """Whether nothing that a user sees can change where ``node`` stands.

    In annotations and what only a type checker reads (``Protocol``, ``TYPE_CHECKING``, ``assert``), decorators, texts,
    what an error says, whether ``zip`` is strict. A star is an operator only within a sum.
    """
    if node.type == "operator" and node.value in ("*", "**", "/", "|", "-", "+") and node.parent.type not in SUMS:
        return True
    child, parent = None, node
    while parent is not None:
        kind = parent.type
        if kind in ("decorator", "fstring", "assert_stmt", "raise_stmt", "import_from"):
            return True
        if kind == "annassign" and child is parent.children[1]:
            return True
        if kind in ("param", "tfpdef") and child is getattr(parent, "annotation", parent.children[-1]):
            return True
        if kind == "funcdef" and child is parent.annotation:
            return True
        if kind == "argument" and parent.children[0].get_code().strip() == "strict":
            return True
        if kind == "classdef" and "Protocol" in (parent.get_super_arglist() or parent.name).get_code():
            return True
        if kind == "if_stmt" and "TYPE_CHECKING" in parent.children[1].get_code():
            return True
        if kind in ("atom_expr", "power") and ".refuse(" in parent.get_code():
            return True
        child, parent = parent, parent.parent
    return False


def mutants(root: Path, room: str, module: str, seed: int) -> Iterator[tuple[tuple[int, int], str, int]]:
    """Place, operator and number of one mutant for each place in a module, the operator drawn where several fit."""
    tree = get_ast((root / module).read_text("utf-8"))
    places: dict[tuple[int, int], list[tuple[str, int]]] = {}
    for name, operator in operators().items():
        number = 0
        for node in ast_nodes(tree):
            for begin, _ in operator.mutation_positions(node):
                if not idle(node):
                    places.setdefault(begin, []).append((name, number))
                number += 1
    for place in sorted(places):
        draw = random.Random(f"{seed} {module} {place}")
        name, number = draw.choice(places[place])
        yield place, name, number


def chosen(root: Path, count: int, seed: int) -> list[Mutant]:
    """A sample, a mutant of each room in turn: of any length it is the beginning of a longer one."""
    drawn = []
    for room, names in ROOMS.items():
        pool = [
            (module, *found)
            for module in (f"{room}/{name}.py" for name in names)
            for found in mutants(root, room, module, seed)
        ]
        random.Random(f"{seed} {room}").shuffle(pool)
        drawn.append([(room, *found) for found in pool])
    turns = [each[turn] for turn in range(max(map(len, drawn))) for each in drawn if turn < len(each)]
    return [_made(root, *found) for found in turns[:count]]


def _made(root: Path, room: str, module: str, place: tuple[int, int], name: str, number: int) -> Mutant:
    whole = (root / module).read_text("utf-8")
    code = mutate_code(whole, operators()[name], number)
    assert code is not None
    lines = difflib.unified_diff(whole.splitlines(), code.splitlines(), lineterm="", n=0)
    diff = "\n".join(line for line in lines if not line.startswith(("---", "+++", "@@")))
    key = hashlib.sha256(f"{module}\0{code}".encode()).hexdigest()[:16]
    return Mutant(room, module, place[0], name, code, diff, key)


def closest(module: str) -> tuple[tuple[str, ...], bool]:
    """The tests closest to a module, as pytest names them, and whether they run compiled kernels."""
    names = next(names for begin, names in CLOSEST.items() if module.startswith(begin))
    tests = tuple(f"tests/test_{name}" if "::" in name else f"tests/test_{name}.py" for name in names)
    return tests, module.startswith(COMPILED)
