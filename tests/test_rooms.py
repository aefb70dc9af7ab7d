"""Imports point down only, and no two modules need each other: held to the code's own import statements."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FLOORS = (
    ("kernels",),
    ("mechanisms", "perception"),
    ("motion",),
    ("rendering",),
    ("simulation",),
    ("envs",),
    ("bounds", "agents"),
    ("benchmark", "papers", "viewer"),
    ("scripts",),
)
FLOOR = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}
HEAVY = ("cv2", "imageio", "matplotlib", "mujoco", "ortools", "pybullet", "ray", "stable_baselines3", "torch", "viser")
LONGEST = 400


def modules() -> dict[str, Path]:
    """Every module of the package by its dotted name below the root."""
    found = {}
    for room in FLOOR:
        for path in sorted((ROOT / room).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()


def imported(name: str) -> set[str]:
    """The package's modules that a module imports, at its top or inside a function."""
    path, found = MODULES[name], set()
    here = path.relative_to(ROOT).parent.parts
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if not isinstance(node, ast.ImportFrom):
            continue
        if node.level:
            base = ".".join([*here[: len(here) - node.level + 1], *filter(None, [node.module])])
        elif (node.module or "").split(".")[0] == "fieldgym":
            base = (node.module or "").partition(".")[2]
        else:
            continue
        for alias in node.names:
            within = f"{base}.{alias.name}".strip(".")
            found.add(within if within in MODULES else base)
    return {module for module in found if module in MODULES and module != name}


GRAPH = {name: imported(name) for name in MODULES}


def test_imports_point_down():
    wrong = [
        f"{name} imports {other}"
        for name, others in GRAPH.items()
        for other in others
        if (room := name.split(".")[0]) != (there := other.split(".")[0]) and FLOOR[there] >= FLOOR[room]
    ]
    assert not wrong


def test_no_two_modules_need_each_other():
    """A module's package counts only where something is imported from the package itself."""
    done, circles = set(), []

    def visit(name: str, way: tuple[str, ...]) -> None:
        if name in way:
            circles.append(" -> ".join((*way[way.index(name) :], name)))
        elif name not in done:
            for other in sorted(GRAPH[name]):
                visit(other, (*way, name))
            done.add(name)

    for name in MODULES:
        visit(name, ())
    assert not circles


def test_rooms_import_each_other_relatively_and_scripts_as_a_user_would():
    for name, path in MODULES.items():
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom):
                absolute = not node.level and (node.module or "").split(".")[0] == "fieldgym"
                if name.split(".")[0] == "scripts":
                    assert not node.level, f"{name}:{node.lineno}"
                else:
                    assert not absolute, f"{name}:{node.lineno}"


@pytest.mark.parametrize("room", ["kernels", "mechanisms", "motion"])
def test_the_lower_floors_need_no_engine(room):
    for name in MODULES:
        if name.split(".")[0] == room:
            for node in ast.walk(ast.parse(MODULES[name].read_text("utf-8"))):
                names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                names += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
                assert not {word.split(".")[0] for word in names} & {*HEAVY, "gymnasium"}, f"{name}"


def test_modules_are_short():
    paths = [*MODULES.values(), *ROOT.glob("*.py"), *(ROOT / "tests").glob("*.py")]
    long = {str(path): n for path in paths if (n := len(path.read_text("utf-8").splitlines())) > LONGEST}
    assert not long
