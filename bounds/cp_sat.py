"""Stops, targets, options and routes under a time limit as a CP-SAT model: proven optima up to rounding.

Times are rounded down to milliseconds and worths up to millionths, so that the solver's bound bounds the true problem.
"""

from __future__ import annotations

import math

import numpy as np

from .stops import Array, Stop

_MS, _MICRO = 1e3, 1e6


def solve(
    stops: list[Stop],
    worths: list[Array],
    budget_s: float,
    second: float,
    time_limit_s: float = 60.0,
    workers: int = 1,
) -> tuple[float, bool, float]:
    """Largest sum of worths minus ``second`` a second, over schedules that begin no decision after ``budget_s``.

    Args:
        stops: in the order in which they are passed.
        worths: (n, E) a stop, time not counted.
        budget_s: the last decision begins before this.
        second: price of a second in the objective, >= 0.
        time_limit_s: wall seconds.
        workers: threads of the solver.

    Returns:
        The solver's bound, whether it is the optimum, and the relative gap to the best solution found (NaN: none was).

    Raises:
        ImportError: OR-Tools is not installed: ``pip install "fieldgym[bench]"``.
    """
    try:
        from ortools.sat.python import cp_model
    except ImportError:
        raise ImportError('proven bounds need OR-Tools: pip install "fieldgym[bench]"') from None

    model = cp_model.CpModel()
    price = round(second * _MICRO / _MS)
    if abs(price - second * _MICRO / _MS) > 1e-9:
        # Millionths a millisecond: the price is rounded down so that the bound stays one.
        price = math.floor(second * _MICRO / _MS)
    spent, value, last_decision = [], [], []
    reached_before, leave_last = model.new_constant(1), 0
    for stop, worth in zip(stops, worths, strict=True):
        reached, driven = model.new_bool_var(""), model.new_bool_var("")
        model.add(reached == reached_before)
        n, options = worth.shape if stop.targets else (0, 0)
        arcs, arc_s = [], np.floor(stop.approach_s * _MS).astype(int)
        leave_ms = np.floor(stop.leave_s * _MS).astype(int)
        idle = model.new_bool_var("")
        model.add_hint(idle, True)
        arcs.append((0, 0, idle))
        straight = model.new_bool_var("")
        # Drives straight on when nothing is picked here and the machine leaves.
        model.add_bool_and([idle, driven]).only_enforce_if(straight)
        model.add_bool_or([idle.negated(), driven.negated(), straight])
        leaves = [int(leave_ms[0]) * straight]
        spent += leaves
        for j in range(n):
            skipped = model.new_bool_var("")
            arcs.append((j + 1, j + 1, skipped))
            ways = [model.new_bool_var("") for _ in range(options)]
            model.add(sum(ways) + skipped == 1)
            model.add_implication(idle, skipped)
            own_ms = [math.floor(stop.process_s[j, e] * _MS) for e in range(options)]
            coming = []
            for i in range(n + 1):
                if i != j + 1:
                    here = model.new_bool_var("")
                    arcs.append((i, j + 1, here))
                    coming.append(int(arc_s[i, j]) * here)
            ending = model.new_bool_var("")
            arcs.append((j + 1, 0, ending))
            model.add_implication(skipped.negated(), reached)
            leaving = model.new_bool_var("")
            model.add_bool_and([ending, driven]).only_enforce_if(leaving)
            model.add_bool_or([ending.negated(), driven.negated(), leaving])
            decision = sum(coming) + sum(t * way for t, way in zip(own_ms, ways, strict=True))
            leave = int(leave_ms[j + 1]) * leaving
            spent += [decision, leave]
            leaves.append(leave)
            value += [math.ceil(worth[j, e] * _MICRO) * ways[e] for e in range(options)]
            last_decision.append((ending, driven, decision))
        model.add_circuit(arcs)
        reached_before, leave_last = driven, sum(leaves)
        model.add_implication(driven, reached)
    # Leaving the last stop ends the episode; one that does not leave it uses its time up and pays for all of it.
    finished = reached_before
    longest = int(max(stop.longest_s for stop in stops) * _MS) + 1
    over = model.new_int_var(0, longest, "")
    is_last = []
    for ending, driven, decision in last_decision:
        final = model.new_bool_var("")
        model.add_implication(final, ending)
        model.add_implication(final, driven.negated())
        model.add(over <= decision).only_enforce_if(final)
        is_last.append(final)
    # Where no pick is the last decision, leaving is, or a drive, after which nothing comes.
    none = model.new_bool_var("")
    model.add_exactly_one([*is_last, none])
    model.add_implication(finished, none)
    model.add(over <= leave_last).only_enforce_if(finished)
    model.add(over == 0).only_enforce_if([none, finished.negated()])
    total = sum(spent)
    budget = math.ceil(budget_s * _MS)
    model.add(total <= budget + over)
    paid = model.new_int_var(0, 4 * (budget + longest), "")
    model.add(paid >= total)
    model.add(paid >= budget - 1).only_enforce_if(finished.negated())
    model.maximize(sum(value) - price * paid)
    solver = cp_model.CpSolver()
    solver.parameters.max_time_in_seconds = time_limit_s
    solver.parameters.num_workers = workers
    solver.parameters.random_seed = 0
    status = solver.solve(model)
    bound = solver.best_objective_bound / _MICRO
    if status not in (cp_model.OPTIMAL, cp_model.FEASIBLE):
        return bound, False, math.nan
    best = solver.objective_value / _MICRO
    gap = max(bound - best, 0.0) / max(abs(bound), 1e-9)
    return bound, status == cp_model.OPTIMAL, gap
