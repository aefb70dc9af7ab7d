"""The examples of the 3-PRRS and workspace pages print what they say, and the drawing is the one the code makes."""

import contextlib
import importlib.util
import io
import re
from pathlib import Path

import numpy as np
import pytest

DOCS = Path(__file__).resolve().parents[1] / "docs"


def numbers(text):
    return [float(value) for value in re.findall(r"-?\d+\.?\d*", text)]


@pytest.mark.parametrize("page", ["three-prrs", "workspaces"])
def test_example_prints_what_it_says(page):
    text = (DOCS / "mechanisms" / f"{page}.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    promised = re.findall(r"^ *print\(.*\)  # (.*)$", code, flags=re.MULTILINE)
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(compile(code, page, "exec"), {})  # the page's own code
    lines = said.getvalue().splitlines()
    assert len(lines) == len(promised) >= 2
    for line, comment in zip(lines, promised, strict=True):
        found = numbers(line)
        np.testing.assert_allclose(numbers(comment)[: len(found)], found, atol=1e-9)
        words = re.findall(r"[A-Za-z]\w+", line)
        assert words == re.findall(r"[A-Za-z]\w+", comment)[: len(words)]


def test_drawing_is_up_to_date(tmp_path, monkeypatch):
    matplotlib = pytest.importorskip("matplotlib")
    spec = importlib.util.spec_from_file_location("three_prrs_drawing", DOCS / "drawings" / "three_prrs.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    target = tmp_path / "three-prrs.svg"
    monkeypatch.setattr("sys.argv", ["three_prrs.py", str(target)])
    module.main()
    kept = (DOCS / "mechanisms" / "three-prrs.svg").read_text(encoding="utf-8")
    made = target.read_text(encoding="utf-8")

    def names(svg):
        return sorted(re.findall(r"<!-- (.*?) -->", svg))

    # Other versions of matplotlib write other paths, but the same texts.
    assert names(made) == names(kept)
    if f"v{matplotlib.__version__}" in kept:
        assert made == kept
