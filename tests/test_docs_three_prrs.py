"""The examples of the 3-PRRS and workspace pages print what they say."""

import contextlib
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
