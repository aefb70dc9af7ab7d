"""Several results folders on one page."""

import json
from pathlib import Path

from test_report import BELT, POLICIES, POTS, SEEDS, bound, record, write

from fieldgym.benchmark.report import page, reader
from fieldgym.benchmark.store import MANIFEST


def test_a_task_is_told_of_by_the_last_folder_that_holds_it(tmp_path: Path):
    """Results of two states of the code stand side by side, and are not mixed within a task."""
    both = [record(where, name, seed) for where in (POTS, BELT) for name in POLICIES[where] for seed in SEEDS]
    again = [record(BELT, name, seed) for name in ("fifo", "nearest") for seed in range(100, 103)]
    first, second = write(tmp_path / "both", both, [bound(BELT, 0)]), write(tmp_path / "again", again)
    made = json.loads((second / MANIFEST).read_text())
    (second / MANIFEST).write_text(json.dumps({**made, "source": "4567cdef"}))
    study = reader.load(first, second)
    pots, belt = study.chapters
    assert pots.headline.seeds == tuple(SEEDS) and belt.headline.seeds == (100, 101, 102)
    assert belt.headline.policies == ("fifo", "nearest") and belt.headline.bound is None
    said = dict(page.stamp(study, "x"))
    assert said["Version"] == (
        "fieldgym 9.8.7, source 0123abcd (Safflower picking); fieldgym 9.8.7, source 4567cdef (Produce sorting)"
    )
    assert said["Suite"] == "full" and said["Seeds"] == "0 to 102"
    assert [source.manifest["source"] for source in reader.load(first, second, first).sources] == ["0123abcd"]
