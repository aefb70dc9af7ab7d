"""What is assumed of hoe weeding, with the range that sources leave it."""

from __future__ import annotations

from .declared import Assumption, Dossier, End, Yardstick
from .fields import CROP_GAPS, DENSITY, FIELD, PATCHES, PITCH, RECALL, STAGES, TILT, drift

_TOOL = (
    drift("Kept: between the two; no camera looks at the blade, so odometry decides."),
    TILT,
    Assumption(
        "depth that uproots half, mm",
        "6",
        End("4", {"process.depth50_m": 0.004}),
        End("9", {"process.depth50_m": 0.009}),
        "51 % of emerging, 21 % of seedling-stage plants uprooted at 10-30 mm (Kurstjens 2000)",
        "A",
        "Kept; rain after hoeing (90 -> 78 % killed, Terpstra 1981) would act like the upper end.",
    ),
    Assumption(
        "steepness of the depth response",
        "1.3",
        End("1.0", {"process.slope": 1.0}),
        End("2.0", {"process.slope": 2.0}),
        "identified from Kurstjens 2000: the share doubles from 10 to 30 mm",
        "A",
        "Kept: identified.",
    ),
    Assumption(
        "depth at four leaves, times two-leaf",
        "2",
        End("1.5", {"process.stage_factor": (0.5, 1.0, 1.5)}),
        End("3", {"process.stage_factor": (0.5, 1.0, 3.0)}),
        "roots hold better with age (Fogelberg 1998); no factor",
        "-",
        "Kept.",
    ),
    Assumption(
        "depth of grasses, times broadleaves",
        "1.3",
        End("1.0", {"process.grass_factor": 1.0}),
        End("1.75", {"process.grass_factor": 1.75}),
        "no figure",
        "-",
        "Kept.",
    ),
    Assumption(
        "root zone, times ours",
        "6 / 10 / 16 mm",
        End("0.7", {"process.root_m": (0.0042, 0.007, 0.0112)}),
        End("1.4", {"process.root_m": (0.0084, 0.014, 0.0224)}),
        "no figure",
        "-",
        "Kept.",
    ),
    Assumption(
        "crop: depth that loses half, mm",
        "12",
        End("8", {"process.crop_depth50_m": 0.008}),
        End("20", {"process.crop_depth50_m": 0.020}),
        "in-row robots lose under 5 % (40 % for one of seven, Gerhards 2024)",
        "A",
        "Kept: our crop loss lies under 5 %.",
    ),
    Assumption(
        "blade radius, mm",
        "14",
        End("13.1", {"process.blade_radius_m": 0.0131}),
        End("18", {"process.blade_radius_m": 0.018}),
        "blades keep 20 mm from the crop (Steketee)",
        "V",
        "Kept: at least the widest circle of 13 mm.",
    ),
    Assumption(
        "soil, kPa",
        "40",
        End("20", {"preset": "loose-soil"}),
        None,
        "ASABE D497: 14-44 kPa; shear strength 22-30 kPa (10.4236/ojop.2019.83008)",
        "M/A",
        "Preset `loose-soil`; the energy alone depends on it.",
    ),
    Assumption(
        "blade on its circle, m/s",
        "0.6, 10 m/s2",
        End("0.3, 5 m/s2", {"process.stir_velocity_m_s": 0.3, "process.stir_acceleration_m_s2": 5.0}),
        End("0.9, 15 m/s2", {"process.stir_velocity_m_s": 0.9, "process.stir_acceleration_m_s2": 15.0}),
        "none",
        "-",
        "Kept.",
    ),
    Assumption(
        "moves of the platform, m/s2",
        "10",
        End("5", {"reach.acceleration_m_s2": 5.0}),
        End("15", {"reach.acceleration_m_s2": 15.0}),
        "none for a 3-PRRS; deltas reach 100",
        "S",
        "Kept.",
    ),
)

HOE = Dossier(
    "fieldgym/HoeWeeding-v0",
    (*_TOOL, *FIELD, PATCHES, STAGES, DENSITY, PITCH, CROP_GAPS, RECALL),
    (
        Yardstick(
            "share of the weeds killed in one pass",
            "net_rate",
            100.0,
            "%",
            "92-94 % control by seven in-row hoeing robots over a season (Gerhards 2024, A); 62-87 % around the crop "
            "plants (Tillett 2008, A)",
            "One pass on clumped weeds with a colour detector, against several passes and a season's count per area.",
        ),
        Yardstick(
            "area, ha an hour",
            "work_per_h",
            1.0,
            "ha/h",
            "at most 1 km/h a row, 0.05 ha/h at 0.5 m (Gerhards 2024, A); FD20: 950 m/h over 3.5 m (S)",
            "One blade stirs weed by weed where theirs sweep the row.",
        ),
        Yardstick(
            "crop plants lost",
            "crop_loss_percent",
            1.0,
            "%",
            "under 5 %, 40 % for one of seven (Gerhards 2024, A)",
            "Agrees.",
        ),
    ),
    (
        "Covering with soil kills as well (>= 10 mm cover kills 95 %, Merfield 2018), and rain after hoeing saves "
        "weeds (90 -> 78 %): neither is modelled.",
    ),
)
