"""The examples of the five-bars' and the motion pages print what they say, and all drawings are those of the code."""

import contextlib
import importlib
import io
import re
from pathlib import Path

import numpy as np
import pytest

DOCS = Path(__file__).resolve().parents[1] / "docs"


def numbers(text):
    return [float(value) for value in re.findall(r"-?\d+\.?\d*", text)]


@pytest.mark.parametrize("page", ["mechanisms/five-bar.md", "mechanisms/translational-five-bar.md", "motion.md"])
def test_examples_print_what_they_say(page):
    (code,) = re.findall(r"```python\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), flags=re.DOTALL)
    promised = re.findall(r"^ *print\(.*\)  # (.*)$", code, flags=re.MULTILINE)
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(compile(code, page, "exec"), {})  # the page's own code
    lines = said.getvalue().splitlines()
    assert len(lines) == len(promised) >= 3
    for line, comment in zip(lines, promised, strict=True):
        found = numbers(line)
        np.testing.assert_allclose(numbers(comment)[: len(found)], found, atol=1e-9)
        words = re.findall(r"[A-Za-z]\w+", line)
        assert words == re.findall(r"[A-Za-z]\w+", comment)[: len(words)]


@pytest.mark.parametrize(
    ("module", "folder", "names"),
    [
        ("five_bars", "mechanisms", ("five-bar.svg", "translational-five-bar.svg")),
        ("flow", ".", ("decision-flow.svg",)),
        ("motion", ".", ("motion-laws.svg", "motion-gates.svg")),
        ("three_prrs", "mechanisms", ("three-prrs.svg",)),
        ("three_ups_rpu", "mechanisms", ("three-ups-rpu.svg",)),
    ],
)
def test_drawings_are_up_to_date(module, folder, names, tmp_path, monkeypatch):
    matplotlib = pytest.importorskip("matplotlib")
    monkeypatch.syspath_prepend(str(DOCS / "drawings"))
    importlib.import_module(module).main(tmp_path)
    for name in names:
        made = (tmp_path / name).read_text(encoding="utf-8")
        kept = (DOCS / folder / name).read_text(encoding="utf-8")
        # Other versions of matplotlib write other paths, but the same texts.
        assert sorted(re.findall(r"<!-- (.*?) -->", made)) == sorted(re.findall(r"<!-- (.*?) -->", kept))
        if f"v{matplotlib.__version__}" in kept:
            assert made == kept
