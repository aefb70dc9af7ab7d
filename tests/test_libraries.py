"""The blocks of the page about other libraries run, where the library is installed."""

import importlib.util
import re
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[1] / "docs" / "other-libraries.md"
BLOCKS = dict(re.findall(r"^## ([^\n]+)\n.*?```python\n(.*?)```", PAGE.read_text("utf-8"), re.M | re.S))


@pytest.mark.parametrize(
    ("title", "needs"), [("TorchRL", "torchrl"), ("In the style of CleanRL", "torch"), ("Minari", "minari")]
)
def test_a_block_runs(title: str, needs: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if importlib.util.find_spec(needs) is None:
        pytest.skip(f"{needs} is not installed")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    names: dict[str, object] = {}
    exec(compile(BLOCKS[title], f"{PAGE.name}: {title}", "exec"), names)
    assert names.keys() & {"data", "reward", "dataset"}


def test_every_block_is_tried() -> None:
    assert list(BLOCKS) == ["TorchRL", "In the style of CleanRL", "Minari"]
