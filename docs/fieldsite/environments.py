"""The page of an environment, from what its code declares."""

from __future__ import annotations

import re
from collections.abc import Mapping
from inspect import cleandoc
from typing import Any, NamedTuple

import gymnasium as gym

from fieldgym.envs.columns import Says
from fieldgym.envs.references import resolved
from fieldgym.envs.task import TaskSpec
from fieldgym.kernels.config_tables import Line, rows

from .markdown import between, code, number, table, value

SOURCES = ("published", "identified", "assumed", "derived")
"""Where a number comes from, as its declaration says."""
SETTING = "without a source"
_PARTS = ("scenario.", "weights.", "perception.")
"""Parts of a configuration that have sections of their own."""
_MECHANISMS = {
    "safflower": "[five-bar](../mechanisms/five-bar.md)",
    "transplanting": "[translational five-bar](../mechanisms/translational-five-bar.md)",
    "laser": "[3UPS-RPU](../mechanisms/three-ups-rpu.md)",
    "hoe": "[3-PRRS](../mechanisms/three-prrs.md)",
    "sorting": "[3-PRRS](../mechanisms/three-prrs.md)",
}
"""The page of each machine's mechanism, by the folder that the environment's code lies in."""


class Opened(NamedTuple):
    """An environment at the beginning of an episode.

    Attributes:
        spec: what the package knows of it.
        env: the environment.
        core: its rules.
        slots: K, candidates shown at once.
    """

    spec: TaskSpec
    env: Any
    core: Any
    slots: int

    @classmethod
    def of(cls, spec: TaskSpec) -> Opened:
        """Make and reset it."""
        env: Any = gym.make(spec.id, backend="analytic").unwrapped
        env.reset(seed=0)
        candidates = env.core.observation_space["candidates"].shape[0]
        return cls(spec, env, env.core, candidates // len(env.core.candidate_features))


def slug(spec: TaskSpec) -> str:
    """Name of the environment's page: ``laser-weeding-speed``."""
    return "-".join(_words(spec))


def title(spec: TaskSpec) -> str:
    """Name of the environment in words: ``Laser weeding speed``."""
    return " ".join(_words(spec)).capitalize()


def _words(spec: TaskSpec) -> list[str]:
    return [word.lower() for word in re.findall(r"[A-Z][a-z]+", spec.name.rpartition("-v")[0])]


def page(spec: TaskSpec, picture: str, board: str, history: str, replay: str) -> str:
    """The whole page as Markdown.

    Args:
        spec: of the environment.
        picture: what shows it, beside the page.
        board: its slice of the leaderboard, as Markdown.
        history: of its versions, likewise.
        replay: where a replay of it lies, beside the page; empty where there is none.
    """
    opened = Opened.of(spec)
    sections = {
        "Actions": _actions(opened),
        "Observation": _observation(opened),
        "Reward": _reward(opened),
        "Scorecard": _scorecard(opened),
        "Scenarios": _scenarios(spec),
        "End of an episode": _end(opened),
        "Perception": _perception(spec),
        "Calibration": _calibration(spec),
        "Use": _use(spec),
        "Leaderboard": board,
        "Replay": _replay(spec, replay),
        "Versions": history,
    }
    opened.env.close()
    text = [f"# {title(spec)}\n", _head(spec, picture)]
    text += [f"## {heading}\n\n{body.strip()}\n" for heading, body in sections.items() if body]
    return "\n".join(text)


def _docstring(spec: TaskSpec) -> list[str]:
    """Paragraphs of the environment's docstring, without the lists of arguments and errors."""
    text = cleandoc(resolved(spec.entry_point).__doc__ or "")
    return re.split(r"\n\n(?:Args|Raises):\n", text)[0].split("\n\n")


def _paragraph(spec: TaskSpec, name: str) -> str:
    """The paragraph of the docstring that begins with ``**name**``, empty where there is none."""
    return next((text for text in _docstring(spec) if text.startswith(f"**{name}**")), "")


def _head(spec: TaskSpec, picture: str) -> str:
    first, *others = _docstring(spec)
    plain = [text for text in others if not text.startswith("**") and not text.startswith("- ")]
    # A table of what is in one line each; ``first`` names the id, which stands there.
    first = re.sub(r"\s*\(``[^`]*``\)", "", first)
    facts = [
        ("id", code(spec.id)),
        ("machine", spec.machine),
        ("paper", spec.paper),
        ("mechanism", _mechanism(spec)),
        ("one decision", spec.decision),
        ("backends", ", ".join(map(code, spec.backends))),
        ("perception", ", ".join(map(code, spec.perceptions))),
        ("compared with", code(spec.reference)),
    ]
    shown = f"![{title(spec)}, as the environment's `render()` draws it]({picture})\n"
    return "\n\n".join([first, shown, *plain, table(("", ""), [fact for fact in facts if fact[1]])])


def _place(spec: TaskSpec) -> list[str]:
    return str(spec.entry_point).split(":")[0].split(".")


def _mechanism(spec: TaskSpec) -> str:
    """A link to the page of its mechanism, empty where it has none."""
    return next((_MECHANISMS[name] for name in reversed(_place(spec)) if name in _MECHANISMS), "")


def _actions(opened: Opened) -> str:
    spec, core, k = opened.spec, opened.core, opened.slots
    said = [f"`Discrete({core.action_space.n})`: {spec.actions.partition(': ')[2] or spec.actions}, K = {k}.\n"]
    belief = spec.assembly.belief
    if belief is not None:
        found = belief(core)
        options, extras = found.options or ("",), found.extras
        each = len(options) * k + len(extras)
        lines = []
        for b, block in enumerate(found.blocks):
            begin, also = b * each, f", {block}" if block else ""
            for i, option in enumerate(options):
                name = f"{begin} + " * bool(begin) + (f"{len(options)} k + {i}" if len(options) > 1 else "k")
                last = begin + len(options) * (k - 1) + i
                lines.append((code(name), f"{begin + i} to {last}", f"slot k{', ' + option if option else ''}{also}"))
            for i, extra in enumerate(extras):
                number_of = begin + len(options) * k + i
                lines.append((code(str(number_of)), str(number_of), extra + also))
        said.append(table(("action", "numbers", "what it does"), lines))
    said.append(_paragraph(spec, "Action").partition(": ")[2])
    return "\n".join(said)


def _features(says: Mapping[str, Says]) -> str:
    heading = ("column", "name", "what it is", "unit", "divided by", "shown from .. to")
    lines = (
        (
            str(i),
            code(name),
            said.doc,
            said.unit or "-",
            number(said.scale),
            f"{number(said.low)} .. {number(said.high)}",
        )
        for i, (name, said) in enumerate(says.items())
    )
    return table(heading, lines, right=(0, 4))


def _observation(opened: Opened) -> str:
    core, k, said = opened.core, opened.slots, opened.core.meanings()
    columns = len(core.candidate_features)
    return f"""A `Dict` of `float32` boxes: `machine` ({len(core.machine_features)},), `candidates`
({k * columns},), which is a table of K = {k} rows of {columns} columns, and the `action_mask` ({core.action_space.n},).
What is shown is the quantity divided by its scale, held to the range of the last column. See [pixels](../pixels.md) for
pictures beside or instead of candidates.

### `machine`

{_features(said["machine"])}
### `candidates`

{_features(said["candidates"])}"""


def _reward(opened: Opened) -> str:
    said = opened.core.meanings()["rewards"]
    weights = [line for line in rows(opened.core.config) if line.name.startswith("weights.")]
    if len(weights) != len(said):
        raise ValueError(f"{opened.spec.id}: {len(said)} terms of the reward, {len(weights)} weights")
    lines = (
        (code(name), says.doc, says.unit or "-", value(line.default), code(line.name), _sourced(line))
        for (name, says), line in zip(said.items(), weights, strict=True)
    )
    heading = ("term", "counts", "unit", "weight", "set by", "why")
    return 'The sum of `info["rewards"]`, each term its quantity times its weight.\n\n' + table(heading, lines, (3,))


def _scorecard(opened: Opened) -> str:
    said = opened.core.meanings()
    phases = {f"phase_{name}_s": f"seconds of this phase: {says.doc}" for name, says in said["phases"].items()}
    lines = (
        (code(name), phases[name] if name in phases else says.doc, says.unit or "-")
        for name, says in said["scores"].items()
    )
    spent = ", ".join(map(code, said["phases"]))
    after = f'\nThe phases of one decision stand in `info["phases_s"]`: {spent}.\n'
    return '`info["scorecard"]` after every decision.\n\n' + table(("score", "what it is", "unit"), lines) + after


def _scenarios(spec: TaskSpec) -> str:
    assembly = spec.assembly
    by_name = {name: rows(scenario) for name, scenario in assembly.scenarios.items()}
    names = list(by_name)
    same, differing = [], []
    for lines in zip(*by_name.values(), strict=True):
        shown = [value(line.default) for line in lines]
        line = lines[0]
        head = (code(line.name), line.unit or "-")
        if len(set(shown)) == 1:
            same.append((*head, shown[0], _sourced(line)))
        else:
            differing.append((*head, *shown, _sourced(line)))
    marked = [f"{code(name)}{' (headline)' if name == spec.headline else ''}" for name in names]
    text = [f"Where none is named, `{spec.headline}` is meant. [Your own](../your-scenario.md) is a file.\n"]
    if differing:
        text += ["### What differs\n", table(("number", "unit", *marked, "meaning"), differing)]
    text += ["### What is the same in all\n", table(("number", "unit", "value", "meaning"), same)]
    return "\n".join(text)


def _end(opened: Opened) -> str:
    spec, told = opened.spec, []
    for paragraph in _docstring(spec):
        if not paragraph.startswith(("**", "- ")):
            sentences = re.split(r"(?<=[.;])\s+", " ".join(paragraph.split()))
            told += [part for part in sentences if re.search(r"\bends when|truncated at|time_factor", part)]
    limits = []
    for name in spec.scenarios:
        core = spec.assembly.core(spec.assembly.configured(scenario=name), None, 1)
        limits.append((code(name), number(round(_time_limit_s(core), 1))))
    said = " ".join(f"{part[0].upper()}{part[1:].rstrip('.;')}." for part in told)
    return f"{said}\n\n`truncated` says that the time limit was reached, in simulated seconds:\n\n" + table(
        ("scenario", "time limit, s"), limits, right=(1,)
    )


def _time_limit_s(core: Any) -> float:
    tables = core.tables if hasattr(core, "tables") else core.terms
    return float(tables.time_limit_s)


def _perception(spec: TaskSpec) -> str:
    assembly, config = spec.assembly, spec.assembly.config()
    if assembly.measured is None:
        return ""
    measured = rows(assembly.measured(config))
    perfect = [value(line.default) for line in rows(assembly.perfect(config))]
    lines = [
        (code(line.name), line.unit or "-", value(line.default), ideal, line.doc)
        for line, ideal in zip(measured, perfect, strict=True)
    ]
    heading = ("number", "unit", "`model`, measured", "`perfect`", "meaning")
    name = next(name for name in ("safflower", "transplanting", "weeding", "sorting") if name in _place(spec))
    return f"""`camera` renders the machine's pictures and finds the targets in them; `model` draws what such a camera
reports from statistics that `scripts/measure_camera.py {name}` measured on rendered pictures and left in
`assets/perception/`; `perfect` tells the truth. Those of the headline scenario:

{table(heading, lines)}"""


def _sourced(line: Line) -> str:
    return f"{line.doc} [{line.source}]" if line.source else line.doc


def _kind(line: Line) -> str:
    """What kind of number it is: the first source that its declaration names."""
    told = line.source or " ".join(re.findall(r"\[([^\]]*)\]", line.doc))
    return min((source for source in SOURCES if source in told), key=told.find, default=SETTING)


def _calibration(spec: TaskSpec) -> str:
    lines = [line for line in rows(spec.assembly.configured()) if not line.name.startswith(_PARTS)]
    groups = {kind: [line for line in lines if _kind(line) == kind] for kind in (*SOURCES, SETTING)}
    told = ", ".join(f"{len(group)} {kind}" for kind, group in groups.items() if group)
    text = [
        "Every number of the machine and its work with where it comes from: *published* by the source that is named,",
        "*identified* (found so that a published result comes out), *assumed*, or without a source, as choices are.",
        f"There are {told}. All can be changed: `overrides={{...}}`, `--set`. What each\n"
        "assumption does to the results stands [on a page of its own](../assumptions.md).\n",
    ]
    heading = ("number", "unit", "value", "may be", "meaning", "comes from")
    # A mechanism's dimensions are explained with its formulas.
    of_mechanism = f"see {_mechanism(spec)}" if _mechanism(spec) else ""
    for kind, group in groups.items():
        shown = (
            (
                code(line.name),
                line.unit or "-",
                value(line.default),
                between(line.low, line.high) or code(line.type),
                line.doc or of_mechanism,
                line.source or "-",
            )
            for line in group
        )
        text += [f"### {kind.capitalize()}\n", table(heading, shown)] if group else []
    return "\n".join(text)


def _use(spec: TaskSpec) -> str:
    short = spec.name.rpartition("-v")[0] if spec.id.startswith("fieldgym/") else spec.id
    rule = next(name for name in spec.policies if name != spec.reference)
    return f"""```python
import gymnasium as gym
import fieldgym
from fieldgym.agents import act_single, make_policy

env = gym.make("{spec.id}", scenario="{spec.headline}", backend="analytic")
policy = make_policy("{rule}", env)
observation, info = env.reset(seed=1)
over = False
while not over:
    observation, reward, terminated, truncated, info = env.step(act_single(policy, observation))
    over = terminated or truncated
print(info["scorecard"]["net_rate"], info["scorecard"]["cycle_time_s"])
```

```bash
fieldgym run {short} --policy {rule} --backend analytic --quiet
fieldgym evaluate {short} --policy {rule} --against {spec.reference} --episodes 2 --backend analytic
```

Policies by name: {", ".join(map(code, ("random", *spec.policies)))}. The environment's own docstring, with every
keyword of `gym.make`, is in the [API reference](../api/environments.md)."""


def _replay(spec: TaskSpec, replay: str) -> str:
    if not replay:
        return ""
    command = f"fieldgym view {spec.name.rpartition('-v')[0]} --record replay.html --seconds 20"
    return f"""<a href="{replay}">A replay of twenty seconds</a>, one page with a time slider that needs no network,
made by `{command}`. [Watching in the browser](../view.md) says what else there is."""
