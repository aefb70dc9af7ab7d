"""What is assumed of the fields of both weeders."""

from __future__ import annotations

from .declared import Assumption, End
from .eyes import scaled, tracking, with_numbers

FIELD = (
    Assumption(
        "share of weeds in clusters",
        "0.75",
        End("0.5", {"scenario.clumped": 0.5}),
        End("1.0", {"scenario.clumped": 1.0}),
        "quadrat counts are negative binomial (San Martin 2018, Marshall 1988)",
        "A",
        "Kept: the hard end of what is plausible; `load-1.0-even` and `load-1.6-even` are the other one.",
    ),
    Assumption(
        "weeds a cluster",
        "6",
        End("3", {"scenario.cluster_size": 3.0}),
        End("12", {"scenario.cluster_size": 12.0, "scenario.max_weeds": 400}),
        "k of the negative binomial 0.2-2 in fields, ours 2.8 on 0.25 m2",
        "M/D",
        "Kept.",
    ),
    Assumption(
        "spread of a cluster, mm",
        "50",
        None,
        End("100", {"scenario.cluster_sigma_m": 0.10}),
        "structure at every scale is expected (Cousens); no figure",
        "-",
        "Kept: the hard end.",
    ),
)
PATCHES = Assumption(
    "densest over thinnest along the row",
    "1: no patches beyond clusters",
    None,
    End("20, every 3 m", {"scenario.patch_contrast": 20.0}),
    "field papers find and map patches of metres (San Martin 2018, Marshall 1988); k 0.2-2",
    "A/M",
    "Corrected in the scenario `patchy`.",
)
STAGES = Assumption(
    "stages: cotyledon / two-leaf / four-leaf",
    ".40 / .45 / .15",
    End("early: .6 / .35 / .05", {"scenario.stage_shares": (0.6, 0.35, 0.05)}),
    End("late: .2 / .4 / .4", {"scenario.stage_shares": (0.2, 0.4, 0.4)}),
    "no distribution found",
    "-",
    "Kept: an early pass, as the laser papers advise.",
)
DENSITY = Assumption(
    "weeds a m2, at the same offered load",
    "40",
    End("25", {"scenario.density_per_m2": 25.0}),
    End("100", {"scenario.density_per_m2": 100.0, "scenario.max_weeds": 600}),
    "0-12 after good control (Kunz 2016), 15-150 (hoe trials), 190 (San Martin 2018)",
    "A/S",
    "Kept; `dense` has 100.",
)
PITCH = Assumption(
    "crop plants, m apart",
    "0.16",
    End("0.125", {"scenario.crop_pitch_m": 0.125}),
    End("0.20", {"scenario.crop_pitch_m": 0.20}),
    "beet is drilled 127-152 mm apart (crystalsugar 434)",
    "V",
    "Kept.",
)
CROP_GAPS = Assumption(
    "crop plants that did not emerge",
    "none",
    None,
    End("a quarter", {"scenario.crop_missing": 0.25}),
    "emergence of beet 70-80 % (crystalsugar 434)",
    "V",
    "Corrected in the scenario `patchy`.",
)
RECALL = Assumption(
    "share of weeds that are seen, times the fitted one",
    "1 (0.96-0.98 where a weed stands alone)",
    End("0.8", eyes=scaled("recall", 0.8)),
    None,
    "colour index 0.52-0.74 (OWL, 10.1038/s41598-021-03858-9)",
    "A",
    "Kept: fitted to pictures of drawn plants, which flatter the detector.",
)


TILT = Assumption(
    "track error of a tilting frame, mm an axis",
    "0",
    End("4, as on ISO class C", eyes=tracking(0.004)),
    End("12, as on ISO class D", eyes=tracking(0.012)),
    "from ISO 8608 roughness and a paddy field of 645e-6 m3 (Hujos 3072), camera 0.85-1.45 m up",
    "D",
    "Corrected by the scenarios that shake the ground.",
)


def drift(decided: str) -> Assumption:
    """The drift of the odometry, and what is made of it."""
    return Assumption(
        "odometry drift, share of the way",
        "0.01",
        End("0.006", eyes=with_numbers(drift_share=0.006)),
        End("0.038", eyes=with_numbers(drift_share=0.038)),
        "below 0.006 downward stereo (lathe rig); 0.0376 visual odometry over 1.8 km of crop (diva2:1166554)",
        "A",
        decided,
    )
