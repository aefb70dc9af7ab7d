"""Ground that shakes: its spectrum, how wheels filter it, where it puts tool and camera, and who is told of it."""

from dataclasses import replace
from math import gamma, pi, sqrt
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from fieldgym.bounds.weeding import instance_of
from fieldgym.envs.field import FieldError
from fieldgym.envs.field_files import read_field, write_field
from fieldgym.envs.rough import STEP_M, coherence, density_m3
from fieldgym.envs.shaking import (
    Frame,
    Shape,
    U,
    believed,
    carried,
    frame_at,
    given_back,
    height_at,
    lands,
    sinks_m,
    ways_at,
)
from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.field import Profile, WeedField
from fieldgym.envs.weeding.ground import (
    draw_profile,
    draw_profiles,
    drift_of,
    shape_of,
    span,
    surface_of,
)
from fieldgym.envs.weeding.ground_config import GroundConfig
from fieldgym.envs.weeding.perception import TOOL_GATE_M, PerceptionModel
from fieldgym.envs.weeding.process import dose
from fieldgym.envs.weeding.state import T
from fieldgym.envs.weeding.tools.hoe.config import HoeWeedingConfig
from fieldgym.envs.weeding.tools.hoe.env import hoe_core
from fieldgym.envs.weeding.tools.laser.aim import poses
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.env import laser_core

EASY = PerceptionModel.measured("classical", "easy")


def on(task: Any = WeedingConfig, scenario: str = "load-1.0", **ground: Any) -> Any:
    """A task on some ground."""
    return replace(task(), scenario=replace(SCENARIOS[scenario], ground=GroundConfig(**ground)))


def drawn(config: Any, worlds: int = 1, perception: Any = None, make: Any = laser_core) -> Any:
    core = make(config, perception or PerceptionModel.perfect(), worlds)
    core.reset_rows(np.arange(worlds), [np.random.default_rng(seed) for seed in range(worlds)])
    return core


@pytest.mark.parametrize(("iso_class", "n0_m3", "waviness"), [("B", 64e-6, 2.0), ("soil", 645e-6, 1.24)])
def test_profiles_have_the_spectrum_of_their_class(iso_class, n0_m3, waviness):
    config = on(iso_class=iso_class)
    config = replace(config, scenario=replace(config.scenario, strip_m=40.0, max_weeds=2000))
    heights = [draw_profile(config, look) for look in np.random.default_rng(1).random(120)]
    window = np.hanning(len(heights[0]))
    step = heights[0].along_m[1] - heights[0].along_m[0]
    waves = np.fft.rfftfreq(len(window), step)
    for line in ("left_m", "middle_m", "right_m"):
        power = [np.abs(np.fft.rfft(window * getattr(one, line))) ** 2 for one in heights]
        found = 2.0 * step * np.mean(power, axis=0) / (window**2).sum()
        for low, high in ((0.12, 0.3), (0.3, 0.8), (0.8, 2.0), (2.0, 3.3)):
            band = (waves > low) & (waves < high)
            wanted = n0_m3 * (waves[band] / 0.1) ** -waviness
            assert found[band].sum() == pytest.approx(wanted.sum(), rel=0.12), (line, low)
        # Beyond the measured band nothing is drawn.
        assert found[waves > 4.5].max() < 1e-3 * n0_m3 * 35.0**-waviness


@pytest.mark.parametrize(("waves_per_m", "apart_m", "iso_class"), [(0.1, 1.32, "C"), (0.6, 0.66, "soil")])
def test_lines_share_what_those_of_isotropic_ground_do(waves_per_m, apart_m, iso_class):
    ground = GroundConfig(iso_class=iso_class)

    def plane(across):
        """Spectrum in the plane whose lines have density ~ n^-w."""
        return (waves_per_m**2 + across**2) ** (-0.5 * (ground.waviness + 1.0))

    whole, _ = quad(plane, 0.0, np.inf)
    shared, _ = quad(plane, 0.0, np.inf, weight="cos", wvar=2.0 * pi * apart_m)
    assert coherence(ground, np.array([waves_per_m]), apart_m)[0] == pytest.approx(shared / whole, rel=1e-6)
    order = 0.5 * ground.waviness
    assert whole == pytest.approx(0.5 * sqrt(pi) * gamma(order) / gamma(order + 0.5) * waves_per_m**-ground.waviness)


def test_densities_are_the_standard_s():
    # 16, 64, 256, 1024 e-6 m3 at 0.1 cycles/m, falling by 100 a decade.
    found = [density_m3(GroundConfig(iso_class=c), np.array([0.1, 1.0])).tolist() for c in "ABCD"]
    assert np.allclose(found, [[16e-6, 16e-8], [64e-6, 64e-8], [256e-6, 256e-8], [1024e-6, 1024e-8]])


def test_wheels_filter_the_ground_to_heave_pitch_and_roll_as_reckoned_directly():
    config = on(iso_class="D", wander_m=0.0143)
    profile, shape = draw_profile(config, 0.37), shape_of(config)
    surface = surface_of(config, [profile])[0]
    for cart in (-0.45, 0.013, 3.3, 8.2):
        points, heights = [], []
        for ahead in (0.675, -0.675):
            for beside, line in ((0.66, profile.left_m), (-0.66, profile.right_m)):
                under = cart + ahead + np.linspace(-0.05, 0.05, 2001)
                points.append((ahead, beside, 1.0))
                heights.append(np.trapezoid(np.interp(under, profile.along_m, line), under) / 0.1)
        slope, lift, heave = np.linalg.lstsq(np.array(points), np.array(heights), rcond=None)[0]
        frame = frame_at(surface, shape, cart)
        assert frame.heave_m == pytest.approx(heave, abs=2e-8)
        assert np.tan(frame.pitch_rad) == pytest.approx(-slope, abs=2e-7)
        assert np.tan(frame.roll_rad) == pytest.approx(lift, abs=2e-7)
        sway = np.interp([cart + 0.675, cart - 0.675], profile.along_m, profile.sway_m)
        assert frame.sway_m == pytest.approx(sway.mean()) and frame.yaw_rad == pytest.approx(
            np.arctan((sway[0] - sway[1]) / 1.35)
        )


TILTED = Frame(0.012, 0.011, -0.009, 0.008, 0.006)
TURN = Rotation.from_euler("ZYX", [TILTED.yaw_rad, TILTED.pitch_rad, TILTED.roll_rad])


def test_points_of_the_frame_go_where_rotations_put_them_and_come_back():
    point = np.array([0.3, -0.15, 0.7])
    wanted = TURN.apply(point - [0.0, 0.0, 0.85]) + np.array([2.0, TILTED.sway_m, TILTED.heave_m + 0.85])
    found = carried(TILTED, 0.85, 2.0, *point)
    assert np.allclose(found, wanted, atol=1e-12)
    assert np.allclose(given_back(TILTED, 0.85, 2.0, *found), point, atol=1e-12)
    # Nose down, left side up, to the left: each sign by itself.
    assert carried(Frame(0.0, 0.1, 0.0, 0.0, 0.0), 0.0, 0.0, 1.0, 0.0, 0.0)[2] < 0.0
    assert carried(Frame(0.0, 0.0, 0.1, 0.0, 0.0), 0.0, 0.0, 0.0, 1.0, 0.0)[2] > 0.0
    assert carried(Frame(0.0, 0.0, 0.0, 0.0, 0.1), 0.0, 0.0, 1.0, 0.0, 0.0)[1] > 0.0


def ramp(slope, side=0.0):
    """Ground that rises along the row and to the left, as a kernel takes it, and its shape for the laser."""
    config = on(second_motion=True)
    first, rows = span(config)
    along = first + STEP_M * np.arange(rows, dtype=np.float64)
    left, middle, right = slope * along + side * np.array([[0.66], [0.0], [-0.66]])
    profile = Profile(along, left, middle, right, np.zeros(rows), np.zeros(rows))
    return surface_of(config, [profile])[0], shape_of(config)


def test_on_a_ramp_everything_goes_up_with_it_and_a_beam_straight_down_stays_square_to_it():
    surface, shape = ramp(0.1)
    frame = frame_at(surface, shape, 2.0)
    assert frame == pytest.approx((0.2, -np.arctan(0.1), 0.0, 0.0, 0.0), abs=1e-9)
    assert height_at(surface, shape, 3.0, 0.1) == pytest.approx(0.3)
    turn = Rotation.from_euler("Y", frame.pitch_rad)
    eye = turn.apply([0.05, 0.0, shape.gap_m + shape.low_m - 0.85]) + np.array([2.0, 0.0, 0.2 + 0.85])
    down = turn.apply([0.0, 0.0, -1.0])
    # The plane that the tool works on lies level at the height that the ground has where it was sent.
    level = 0.1 * 2.05 + shape.low_m
    met = eye + (level - eye[2]) / down[2] * down
    assert np.allclose(lands(surface, shape, 2.0, 2.05, 0.0, 0.0), met[:2], atol=1e-9)
    assert abs(sinks_m(surface, shape, 2.0, 2.0, 0.0)) < 0.005


def test_a_camera_that_believes_itself_level_is_wrong_by_its_tilt():
    config = on(iso_class="D")
    surface, shape = surface_of(config, [draw_profile(config, 0.6)])[0], shape_of(config)
    for cart, along, across in ((1.0, 1.9, 0.1), (4.0, 4.7, -0.18)):
        frame, level = frame_at(surface, shape, cart), height_at(surface, shape, along, across)
        turn = Rotation.from_euler("ZYX", [frame.yaw_rad, frame.pitch_rad, frame.roll_rad])
        eye = turn.apply([0.85, 0.0, 0.0]) + np.array([cart, frame.sway_m, frame.heave_m + 0.85])
        ray = turn.inv().apply([along, across, level] - eye)
        wanted = np.array([cart + 0.85, 0.0]) + ray[:2] * (-0.85 / ray[2])
        found = believed(surface, shape, cart, 0.85, 0.85, along, across)
        assert np.allclose(found, wanted, atol=1e-12)
        assert 1e-4 < np.hypot(*(found - np.array([along, across]))) < 0.05


def test_ground_is_the_strip_s_own_whatever_is_drawn_beside_it_and_differs_from_strip_to_strip():
    config = on(iso_class="C", slip_share=0.02, wander_m=0.0143)
    many = drawn(config, 3)
    for row in range(3):
        one = laser_core(config, PerceptionModel.perfect(), 1)
        one.reset_rows(np.zeros(1, np.int64), [np.random.default_rng(row)])
        assert one.state.surface[0].tobytes() == many.state.surface[row].tobytes()
    assert not np.array_equal(many.state.surface[0], many.state.surface[1])
    level = drawn(on(), 3)
    assert level.state.surface.shape == (3, 0, len(U))
    assert level.state.plant.tobytes() == many.state.plant.tobytes()


def test_slip_strays_within_its_bounds_and_sway_by_what_it_should():
    config = on(slip_share=0.02, wander_m=0.0143)
    looks = np.random.default_rng(2).random(300)
    profiles = draw_profiles(config, looks)
    slips = np.concatenate([np.diff(one.slip_m) / STEP_M for one in profiles])
    assert np.abs(slips).max() <= 0.045 + 1e-12 and slips.std() == pytest.approx(0.02, rel=0.1)
    assert np.concatenate([one.sway_m for one in profiles]).std() == pytest.approx(0.0143, rel=0.1)
    assert not any(one.left_m.any() for one in profiles)


def test_drift_is_the_ground_s_where_it_says_one_the_same_for_every_camera():
    ground = GroundConfig(drift_share=0.02)
    looks = np.random.default_rng(3).random(20_000)
    assert np.std([drift_of(ground, look) for look in looks]) == pytest.approx(0.02, rel=0.03)
    exact = replace(EASY, drift_share=0.3)
    found = [drawn(on(drift_share=0.02), 4, model).state.track_report for model in (exact, EASY)]
    assert np.array_equal(*found)


def shots(core, decisions=120):
    """Plans and outcomes of the first legal shots in every state."""
    for _ in range(decisions):
        mask = core.observe()["action_mask"][0]
        plan = core.plan(np.array([int(np.argmax(mask))]))
        yield plan
        result = core.apply(plan, core.nominal(plan))
        if result.terminated[0] or result.truncated[0]:
            return


def test_the_tool_camera_takes_what_is_within_its_gate_after_the_move_and_the_motion_takes_its_time():
    config = on(iso_class="soil")
    core = drawn(config)
    surface, shape = core.state.surface[0], core.tables.shape
    corrected, passed = 0, 0
    for plan in shots(core):
        if plan.kind[0] >= 3:
            continue
        track, speed, phases = plan.track[0], config.speed_m_s, plan.phases_s[0]
        along, across = plan.correction[0]
        target = plan.target[0] - [along, 0.0, across]
        at = lands(surface, shape, plan.cart[0] + speed * phases[:2].sum(), *target)
        way = core.state.track_aim[0, track] - at
        inside = np.hypot(*way) <= TOOL_GATE_M
        assert plan.correction[0] == pytest.approx(way if inside else np.zeros(2), abs=1e-12)
        reach = config.reach
        motion = max(
            sqrt(10.0 / sqrt(3.0) * abs(along) / reach.travel_acceleration_m_s2),
            sqrt(10.0 / sqrt(3.0) * abs(across) / reach.lean_acceleration_m_s2),
        )
        assert phases[2] == pytest.approx(config.process.correct_s + motion)
        begin = plan.cart[0] + speed * phases[:3].sum()
        parts = [lands(surface, shape, begin + part * speed * phases[3], *plan.target[0]) for part in (0.0, 0.5, 1.0)]
        assert plan.aim[0] == pytest.approx((parts[0] + 4.0 * np.array(parts[1]) + parts[2]) / 6.0, abs=1e-12)
        corrected, passed = corrected + inside, passed + (not inside)
    assert corrected > 20 and passed > 0


def test_without_its_camera_the_tool_works_where_the_frame_puts_it():
    core = drawn(on(iso_class="C", tool_camera=False))
    for plan in shots(core):
        assert not plan.correction.any()


def test_a_second_motion_alone_moves_no_shot_of_perfect_reports():
    plans = [next(p for p in shots(drawn(on(second_motion=after))) if p.kind[0] < 3) for after in (False, True)]
    assert plans[1].aim == pytest.approx(plans[0].aim, abs=1e-9) and not plans[1].correction[0].round(9).any()


def test_the_hoe_works_as_deep_as_the_ground_stands_under_it():
    level, rough = (drawn(on(HoeWeedingConfig, **ground), make=hoe_core) for ground in ({}, {"iso_class": "D"}))
    surface, shape = rough.state.surface[0], rough.tables.shape
    depths = []
    for plan in shots(rough):
        if plan.kind[0] >= 3:
            continue
        mode, phases = int(plan.kind[0]), plan.phases_s[0]
        cart = plan.cart[0] + rough.config.speed_m_s * (phases[:3].sum() + 0.5 * phases[3])
        share = max(1.0 + sinks_m(surface, shape, cart, *plan.aim[0]) / rough.config.process.depth_m[mode], 0.0)
        place = rough.state.plant[0].copy()
        before = rough.state.plant_dose[0].copy()
        rough.apply(plan, rough.nominal(plan))
        struck = np.flatnonzero(rough.state.plant_dose[0] > before)
        for i in struck:
            along, across = place[i] - plan.aim[0]
            alone = dose(rough.process.work, mode, along, across, int(rough.state.plant_kind[0, i]))
            assert rough.state.plant_dose[0, i] - before[i] == pytest.approx(share * alone)
            depths.append(share)
    assert min(depths) < 0.9 and max(depths) > 1.1
    assert level.tables.shape.beside == 1.0 and level.state.totals[0, T.shots] == 0.0


def test_pybullet_puts_cart_platform_and_beam_where_the_rules_say():
    from fieldgym.simulation.weeder import WeederMachine

    config = on(iso_class="soil", wander_m=0.0143)
    surface, shape = surface_of(config, [draw_profile(config, 0.2)])[0], shape_of(config)
    cart = 1.0 + 0.1 / 240.0 * np.arange(121, dtype=np.float64)
    beam = np.tile([1.03, 0.08, -0.11], (121, 1))
    ways = ways_at(surface, shape, cart)
    with WeederMachine(config.parameters) as machine:
        start = poses(config.reach, beam[:1], cart[:1])[0]
        machine.reset(float(cart[0]), start, 0.1, ways[0].tolist())
        plane = config.reach.target_height_m + height_at(surface, shape, 1.11, -0.11)
        report = machine.run(cart, poses(config.reach, beam, cart), plane, ways=ways)
        frame = frame_at(surface, shape, cart[-1])
        assert np.allclose(
            machine._machine.point("frame", (0.3, 0.2, 0.5)),
            carried(frame, shape.pivot_m, cart[-1], 0.3, 0.2, 0.5),
            atol=2e-5,
        )
        assert report.final_error_m < 5e-4 and not report.saturated.any()
        found, wanted = machine.beam_world(plane), np.array(lands(surface, shape, cart[-1], *beam[-1]))
    assert np.allclose(found, wanted, atol=1e-4)
    assert np.hypot(*(wanted - [1.11, -0.11])) > 1e-3


@pytest.mark.parametrize("suffix", [".csv", ".geojson"])
def test_a_field_on_rough_ground_goes_through_a_file_and_plays_the_same(tmp_path, suffix):
    core = drawn(on(iso_class="D", slip_share=0.02), 1, EASY)
    batch = core.draw([np.random.default_rng(5)])
    field = core.unstack(batch)[0]
    write_field(field, tmp_path / f"strip{suffix}")
    back = read_field(tmp_path / f"strip{suffix}", WeedField)
    assert back == field and back.profile is not None
    core.load(np.zeros(1, np.int64), batch)
    before = core.state.surface.tobytes(), core.state.track_report.tobytes(), core.state.track_aim.tobytes()
    core.load(np.zeros(1, np.int64), core.stack([core.complete(back, np.random.default_rng(0))]))
    assert (core.state.surface.tobytes(), core.state.track_report.tobytes(), core.state.track_aim.tobytes()) == before


def test_a_profile_is_drawn_where_it_is_needed_and_refused_where_the_ground_is_level():
    rough, level = (drawn(on(**ground), 1, EASY) for ground in ({"iso_class": "D"}, {}))
    field = rough.unstack(rough.draw([np.random.default_rng(5)]))[0]
    bare = replace(field, profile=None)
    assert rough.complete(bare, np.random.default_rng(9)).profile.left_m.tobytes() == field.profile.left_m.tobytes()
    with pytest.raises(FieldError, match=r"level: leave the profile out, or give scenario.ground.iso_class"):
        level.complete(field, np.random.default_rng(0))
    backwards = Profile(*(values[::-1] for values in field.profile.arrays().values()))
    with pytest.raises(FieldError, match="ascending"):
        rough.complete(replace(field, profile=backwards), np.random.default_rng(0))


def test_shape_says_what_the_tool_s_line_is():
    laser, hoe = shape_of(on(iso_class="A")), shape_of(on(HoeWeedingConfig, iso_class="A"))
    assert isinstance(laser, Shape) and (laser.gap_m, laser.low_m, laser.beside) == (0.85, 0.02, 0.0)
    assert (hoe.low_m, hoe.beside) == (0.0, 1.0)


def test_no_bound_is_claimed_where_the_ground_moves_the_tool():
    with pytest.raises(ValueError, match="no bound is known where the ground moves the tool"):
        instance_of(drawn(on(iso_class="A")))


def test_the_odometry_errs_for_as_much_of_its_way_as_the_tool_comes_later():
    config = on(drift_share=0.03, slip_share=0.02, tool_camera=False)
    core = drawn(config, perception=EASY)
    surface, shape, shifts = core.state.surface[0], core.tables.shape, []
    for plan in shots(core):
        if plan.kind[0] >= 3:
            continue
        report = core.state.track_report[0, plan.track[0]]
        cart = plan.cart[0] + config.speed_m_s * plan.phases_s[0, :2].sum()
        slips = np.interp([cart, report[0]], shape.first_m + STEP_M * np.arange(len(surface)), surface[:, U.slip])
        shift = plan.target[0, 0] + plan.target[0, 1] - report[0]
        assert shift == pytest.approx(slips[0] - slips[1], abs=1e-9) and plan.target[0, 2] == report[1]
        shifts.append(shift)
    assert np.abs(shifts).max() > 1e-3
