"""Thinking that counts: a policy's measured time added to what its decisions took.

What is simulated: nothing. A finished episode's clocks are put forward by the seconds for which its policy thought.

- ``duration_s`` grows by all of its thinking, ``cycle_time_s`` by its share of the thinking up to the last finished
  target; so, in the same ratio, do the other times a target (``OTHER_CYCLES``); every rate a second, minute or hour
  (``_per_s``, ``_per_min``, ``_per_h``), and what tables derive from it, falls as the duration grows; a phase
  ``phase_think_s`` holds the thinking.
- The world does not move meanwhile. For machines that stop for their work (picker, transplanter) that is what would
  happen, but for the time limit, which is not moved, and the seconds in the return, which are not charged. On a belt or
  on a cart that drives on, targets would also have come nearer, or left, while the policy thought: that is not
  simulated, so net rate and return are those of a policy that thinks in no time, and the charged cycle time is the
  least that thinking costs.

Thinking is the processor time of the thread that decides, on the machine that runs the benchmark: what else runs there
does not count, and waiting for something else (another process, a network) is not seen. It still differs from run to
run and from machine to machine; charged results are marked, and are never compared as if they repeated.
"""

from __future__ import annotations

from .record import Record

OTHER_CYCLES = ("shot_time_s", "pick_cycle_s")
"""Scores that are times a target as ``cycle_time_s`` is: of every shot, of every item that was put down."""
PER_TIME = ("_per_s", "_per_min", "_per_h")
"""How the names of rates end."""

CHARGED = "thinking charged, differs from run to run"
"""Said wherever such results are shown."""


def charged(record: Record) -> Record:
    """A copy of an episode's record with its thinking charged; bounds and failures stay as they are."""
    if "scorecard" not in record or record.get("charged"):
        return record
    card = dict(record["scorecard"])
    thought_s, until_s, last_s = record["decision_s"], record["decision_before_last_s"], record["last_s"]
    if last_s > 0.0:
        for name in ("cycle_time_s", *OTHER_CYCLES):
            if card.get(name) is not None:
                card[name] *= 1.0 + until_s / last_s
    duration_s = card.get("duration_s")
    if duration_s:
        card["duration_s"] = duration_s + thought_s
        for name in [name for name in card if name.endswith(PER_TIME) and card[name] is not None]:
            card[name] *= duration_s / (duration_s + thought_s)
    card["phase_think_s"] = thought_s
    return {**record, "scorecard": card, "charged": True}
