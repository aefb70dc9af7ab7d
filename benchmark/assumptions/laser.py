"""What is assumed of laser weeding, with the range that sources leave it."""

from __future__ import annotations

from dataclasses import replace

from .declared import Assumption, Dossier, End, Yardstick
from .eyes import aiming, with_numbers
from .fields import CROP_GAPS, DENSITY, FIELD, PATCHES, PITCH, RECALL, STAGES, TILT, drift

_MOTION = (
    Assumption(
        "aim error, mm an axis",
        "measured on pictures: rms 4.0 / 3.4, median radial 1.0",
        End("1.0", eyes=aiming(0.001)),
        End("2.0", eyes=aiming(0.002)),
        "Xiong 2017, 10.1016/j.compag.2017.11.023: 1.97 +- 0.88 mm mean radial, which is 1.57 mm an axis",
        "A",
        "Kept: fitted to pictures, a better core and worse tails than the published one; the tails are the lever.",
    ),
    Assumption(
        "path error while burning, mm an axis",
        "0",
        None,
        End("1.0", eyes=aiming(0.001, added=True)),
        "ABB IRB 365 manual 3HAC079184-003, ISO 9283: path accuracy 2.02 mm at 1.6 m/s, pose accuracy 0.05 mm",
        "V",
        "Kept at 0: the beam burns while the platform stands over ground; the end tests a platform that wobbles.",
    ),
    Assumption(
        "settling before a shot, s",
        "0.05, with picture and correction",
        None,
        End("0.30", {"preset": "settled"}),
        "same manual: 0.25 s to within 0.1 mm",
        "V",
        "Preset `settled`; at a fixed offered load the cart then drives more slowly.",
    ),
    Assumption(
        "accelerations of the platform",
        "10 and, leaning, 18 m/s2",
        End(
            "half",
            {"reach.travel_acceleration_m_s2": 5.0, "reach.lean_acceleration_m_s2": 9.0, "reach.expected_move_s": 0.37},
        ),
        End(
            "twice",
            {
                "reach.travel_acceleration_m_s2": 20.0,
                "reach.lean_acceleration_m_s2": 36.0,
                "reach.expected_move_s": 0.18,
                "machine.leg_force_limit_n": 1200.0,
                "machine.cart_force_limit_n": 4000.0,
            },
        ),
        "belt or linear-motor actuators of 2 m/s, 20 m/s2",
        "M",
        "Kept; commercial machines turn mirrors instead of a platform of 5 kg.",
    ),
    TILT,
    drift("Kept: between the two; the tool camera's gate of 22 mm makes more of it costly."),
    Assumption(
        "camera to use, s",
        "0.15",
        End("0.05", eyes=with_numbers(delay_s=0.05)),
        End("0.30", eyes=with_numbers(delay_s=0.30)),
        "Wu 2020, 10.1002/rob.21938: 50-300 ms",
        "A",
        "Kept: the window lies 0.3 m behind the view, so it hardly matters.",
    ),
)

_DOSE = (
    Assumption(
        "laser: published CO2 or commercial",
        "54 J on a spot of 6 mm, 200 W",
        None,
        End(
            "20 J on 3 mm, 150 W",
            {"preset": "commercial"},
        ),
        "Marx 2012 (CO2); LaserWeeder G1: about 20 J a weed on about 3 mm; both are 1.9-2.8 J/mm2",
        "A/V",
        "Linked presets `co2-2012` (the default's numbers) and `commercial`.",
    ),
    Assumption(
        "spot radius, mm",
        "3",
        End("1", {"process.spot_radius_m": 0.001}),
        None,
        "Andreasen 2024: 2 mm spot; Coleman 2021: 5 mm; Marx 2012: 6 mm",
        "A",
        "Kept with its dose: a narrower spot belongs to a lower dose (preset `commercial`).",
    ),
    Assumption(
        "power, W",
        "200",
        End("50", {"process.power_w": 50.0}),
        End("240", {"process.power_w": 240.0}),
        "50 W thulium (Andreasen 2024), 150-240 W CO2 (LaserWeeder)",
        "A/V",
        "Kept: the offered load turns power into area an hour, the share of killed weeds stays.",
    ),
    Assumption(
        "dose that kills 95 %, J",
        "54",
        End("20", {"process.ed95_j": 20.0, "process.crop_ed50_j": 7.4}),
        End("75", {"process.ed95_j": 75.0}),
        "Marx 2012: >= 54 J, monocots more; LaserWeeder: about 20 J; doses as they are",
        "A/V",
        "Kept: the published one.",
    ),
    Assumption(
        "steepness of the dose response",
        "4",
        End("2", {"process.slope": 2.0}),
        End("6", {"process.slope": 6.0}),
        "in no abstract of the dose-response papers",
        "-",
        "Kept: it moves little.",
    ),
    Assumption(
        "dose at four leaves, times two-leaf",
        "3",
        End("2", {"process.stage_factor": (0.4, 1.0, 2.0)}),
        End("6: most regrow", {"process.stage_factor": (0.4, 1.0, 6.0)}),
        "Andreasen 2024, 10.3389/fpls.2024.1375164: most species regrow if hit at four leaves",
        "A",
        "Kept: the end stands for regrowth, which no scorecard follows.",
    ),
    Assumption(
        "dose of grasses, times broadleaves",
        "1.75",
        End("1.5", {"process.grass_factor": 1.5}),
        End("3", {"process.grass_factor": 3.0}),
        "Marx 2012: monocots need more; Sosnoskie 2025: shielded meristems",
        "A",
        "Kept.",
    ),
    Assumption(
        "growing point, radius in mm by stage",
        "2.5 / 3 / 4",
        End("1.5 / 2 / 3", {"process.meristem_m": (0.0015, 0.002, 0.003)}),
        None,
        "LaserWeeder: meristem of a small weed about 3 mm across",
        "V",
        "Kept: leaf bases count as well.",
    ),
    Assumption(
        "dose that kills half of the crop, J",
        "20",
        End("10", {"process.crop_ed50_j": 10.0}),
        End("40", {"process.crop_ed50_j": 40.0}),
        "no dose found; stunting <= 1 % in the field (Sosnoskie 2025, 10.1002/ps.8912)",
        "-",
        "Kept: our crop loss of 0.03 % agrees with the field statement.",
    ),
)

LASER = Dossier(
    "fieldgym/LaserWeeding-v0",
    (*_MOTION, *_DOSE, *FIELD, PATCHES, STAGES, DENSITY, PITCH, CROP_GAPS, RECALL),
    (
        Yardstick(
            "weeds killed a second and laser",
            "done_per_s",
            1.0,
            "1/s",
            "1.85 shots at weeds (200,000 an hour by 30 lasers of 150 W, LaserWeeder G1, V)",
            "A platform of 5 kg moves 0.2 s from weed to weed where they turn mirrors: architecture, not a parameter.",
        ),
        Yardstick(
            "energy of the light, J a kill",
            "joules_per_weed",
            1.0,
            "J",
            "about 20 (LaserWeeder, V); 54 for 95 % of two-leaf dicots (Marx 2012, A)",
            "The published CO2 dose, its stage factors and the shots that miss; preset `commercial` for the other.",
        ),
        Yardstick(
            "share of the weeds killed in one pass",
            "net_rate",
            100.0,
            "%",
            "47-72 % of weeds by a low-power diode on a small robot (10.3389/fagro.2024.1388452, A); density -66 % "
            "after several commercial passes (Sosnoskie 2025, A); a moving scheduler treats 90 % of what is detected "
            "(Vargas 2025, A)",
            "Within what was measured. Detection loses most: with perfect eyes the planner kills 87 % where these "
            "cameras let it kill 60 %.",
        ),
        Yardstick(
            "area, ha an hour and laser",
            "work_per_h",
            1.0,
            "ha/h",
            "0.025-0.05 (0.61-1.21 ha/h by 24 lasers, LaserWeeder G2, V)",
            "2-4 times slower, for the reason given at the kills a second.",
        ),
    ),
    (
        "Sizes of the drawn weeds (9 x 5, 17 x 9, 28 x 14 mm) are at the upper end of what was published for chickweed "
        "(4-10 x 2-5, 5-25 mm, SLU): smaller ones merge less and are missed more; the cameras would have to be fitted "
        "anew.",
        "Distance of the rows and kind of the crop change pictures alone, not the tracks' model.",
        "Crop leaves that a shot burns count in `leaf_loss` alone; in the scenario `field` they cost reward too.",
    ),
)


LASER_SPEED = replace(LASER, env_id="fieldgym/LaserWeedingSpeed-v0", untested=())
"""The same machine, field and laser; the reference plans ahead, at the scenario's speed."""
