"""The laser paper's chapter: what holds, what does not, and that the verdicts follow from the numbers."""

import contextlib
import io
import re
from pathlib import Path

import numpy as np
import pytest

from fieldgym.mechanisms import ThreeUPSRPU
from fieldgym.papers import Verdict, laser, laser_formulas, laser_model

DOCS = Path(__file__).resolve().parents[1] / "docs"


@pytest.fixture(scope="module")
def findings() -> dict[str, Verdict]:
    return {finding.item: finding.verdict for finding in laser.chapter().findings}


def test_case_one_is_as_the_paper_says(findings: dict[str, Verdict]) -> None:
    case_one = [verdict for item, verdict in findings.items() if re.match(r"Fig\. 5\([abc]", item)]
    assert len(case_one) == 6 and set(case_one) == {Verdict.REPRODUCED}


def test_case_two_depends_on_the_orientation_model(findings: dict[str, Verdict]) -> None:
    refuted = {item for item, verdict in findings.items() if item.startswith("Fig. 5") and verdict is Verdict.REFUTED}
    assert refuted == {"Fig. 5(e, second half)", "Fig. 5(f, second half)"}
    assert findings["Fig. 5(f, slopes)"] is Verdict.REPRODUCED
    assert findings["Robot description, movements"] is Verdict.REPRODUCED


def test_the_third_reading_of_eq_4_is_its_own_formula() -> None:
    """Rx Ry with Y_o = 0, written out leg by leg as eq. 4 is printed, and its derivatives by differences."""
    _, second = laser_model.cases(2001)
    found = laser_model.curves_of_eq_4(ThreeUPSRPU.published().attachments, second)
    angle = np.pi / 90 * second.time_s
    c, s, ra, rb, z = np.cos(angle), np.sin(angle), 400.0, 300.0, 600.0
    squares = [
        (ra - rb * c) ** 2 + (z - rb * s) ** 2,
        (rb * c - ra) ** 2 + (rb * s * s) ** 2 + (z - rb * c * s) ** 2,
        (rb * c - ra) ** 2 + (z + rb * s) ** 2,
        (ra - rb * c) ** 2 + (rb * s * s) ** 2 + (z + rb * c * s) ** 2,
    ]
    lengths = np.sqrt(np.stack(squares, axis=-1))
    np.testing.assert_allclose(found.lengths, lengths, atol=1e-9)
    np.testing.assert_allclose(found.lengths[-1], [511.221, 518.432, 712.461, 707.231], atol=5e-4)
    rates = np.gradient(lengths, second.time_s, axis=0)
    np.testing.assert_allclose(found.velocities[1:-1], rates[1:-1], atol=1e-5)
    bends = np.gradient(found.velocities, second.time_s, axis=0)
    np.testing.assert_allclose(found.accelerations[1:-1], bends[1:-1], atol=1e-5)


def test_model_errors_are_corrected_and_singular_cases_refuted(findings: dict[str, Verdict]) -> None:
    for item in (
        "Eqs 2-4, orientation",
        "Eq. 14, H_5 = -r4^ n5^",
        "Eq. 9, n6 along the platform's z",
        "Eq. 4 in case 2",
        "Eq. 10, (v_l, 0, 0) = G V",
        "Eq. 15, H_6 with n6 along z",
        "Eq. 16, a_m = G A + V^T H V",
    ):
        assert findings[item] is Verdict.REPRODUCED_WITH_CORRECTION
    for item in ("Eqs 10, 16 in case 1", "Eqs 10, 16 in case 2", "Eq. 17 in case 1", "Text on Fig. 5, stability"):
        assert findings[item] is Verdict.REFUTED
    assert findings["Eq. 17 in case 2, t > 0"] is Verdict.REPRODUCED
    right = [item for item in findings if item.startswith(tuple(f"Eq. {n}," for n in (5, 6, 7, 8, 11, 12, 13)))]
    assert len(right) == 7 and {findings[item] for item in right} == {Verdict.REPRODUCED}


def test_a_leg_out_of_order_would_be_refuted() -> None:
    first, second = laser_model.cases(201)
    exact = laser_model.curves(ThreeUPSRPU.published(), first)
    swapped = laser_model.Curves(*(curve[:, [0, 3, 2, 1]] for curve in exact))
    verdicts = [finding.verdict for finding in laser._case_one(swapped, swapped)]
    assert verdicts[1:4] == [Verdict.REFUTED] * 3
    still = laser_model.Curves(*(np.zeros_like(curve) + 1.0 for curve in exact))
    assert laser._case_one(still, still)[-1].verdict is Verdict.REFUTED
    other = laser_model.curves(ThreeUPSRPU.weeder(), second)
    readings = {str(name): other for name in (laser.PRINTED, laser.FLAT, laser.EXACT)}
    assert laser._case_two(readings, second.time_s)[0].verdict is Verdict.REFUTED
    # The mechanism's own orientation is a correction of the paper's two readings, and no more.
    readings[laser.EXACT] = laser_model.curves(ThreeUPSRPU.published(), second)
    assert laser._case_two(readings, second.time_s)[0].verdict is Verdict.REPRODUCED_WITH_CORRECTION


def test_equations_that_are_wrong_would_be_refuted() -> None:
    """Eqs 5-8 of a platform that turns the other way, against the lengths of the one that does not."""
    _, second = laser_model.cases(101)
    exact = ThreeUPSRPU.published()
    turned = laser_model.Case("turned", second.time_s, second.poses, second.rates * [1.0, 1.0, 1.0, -1.0])

    class Mixed(ThreeUPSRPU):
        def twist(self, pose, rates):
            return exact.twist(pose, turned.rates)

    mixed = Mixed(**{name: getattr(exact, name) for name in exact.__dataclass_fields__})
    verdicts = [finding.verdict for finding in laser_formulas._velocities(mixed, second)]
    assert verdicts == [Verdict.REPRODUCED, *[Verdict.REFUTED] * 3]


def test_accelerations_of_legs_three_and_four_change_sign_where_the_errata_say() -> None:
    _, second = laser_model.cases(100_001)
    text = (DOCS / "errata.md").read_text(encoding="utf-8")
    for machine, legs in ((ThreeUPSRPU.published(), (2, 3)), (ThreeUPSRPU.published(paper_orientation=True), (3,))):
        acceleration = laser_model.curves(machine, second).accelerations
        for leg in legs:
            last = second.time_s[np.flatnonzero(acceleration[:, leg] > 0.0)[-1]]
            assert f"$a_{leg + 1} > 0$ until {last:.2f} s" in text


def test_every_figure_can_be_drawn() -> None:
    pytest.importorskip("matplotlib")
    from matplotlib.figure import Figure

    figures = laser.chapter().figures
    assert len({figure.stem for figure in figures}) == len(figures) == 6
    for figure in figures:
        canvas = Figure(layout="constrained")
        figure.draw(canvas)
        assert all(axes.has_data() for axes in canvas.axes)


def test_the_example_of_the_docs_page_prints_what_it_says() -> None:
    page = (DOCS / "mechanisms" / "three-ups-rpu.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "three-ups-rpu.md", "exec"), {})
    said = re.findall(r"print\(.*\)  # (.*)", code)
    lines = printed.getvalue().splitlines()
    assert len(lines) == len(said) > 4
    for line, comment in zip(lines, said, strict=True):
        assert comment.startswith(line)
