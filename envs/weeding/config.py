"""Numbers that all weeders share: field, cart, rewards and the tiers of offered load; tools add theirs.

Every number says where it comes from: [published] printed by a source, [identified] found so that a published
result comes out or fitted to rendered images, [assumed] a free choice. "The paper" is Wang et al., Kinematics and
statics analysis of a novel 4-DOF parallel mechanism for laser weeding robot (3UPS-RPU).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...kernels.config import Config, choice, flag, nested, num
from ..drives import DriveErrors, LinearDrive, RotaryDrive
from .bed_config import BedConfig
from .ground_config import GroundConfig

STAGES = ("cotyledon", "two-leaf", "four-leaf")
SPECIES = ("broadleaf", "grass")

LEAF_M = {"beet": 0.055, "maize": 0.090}
"""Length of a crop plant's leaves as they are drawn [assumed]."""

SPEEDS_M_S = (0.001, 3.0)
"""A scenario's own speed lies between these."""


EVEN = (1.0, 1.0, 1.0), (1.0, 1.0, 1.0)
"""Every weed counts as one."""


@dataclass(frozen=True)
class ScenarioConfig(Config):
    """One kind of field and the cart's speed over it. Lengths in metres."""

    density_per_m2: float = num(..., 0.01, 2000.0, "1/m2")
    """Mean density of weeds [published range: up to 190 per m2]."""
    offered_load: float = num(..., 0.001, 100.0, "")
    """Seconds of work that grow into the window each second at the constant speed: density x width x speed x service.
    Policies separate near and above 1 [derived]."""
    clumped: float = num(0.75, 0.0, 1.0, "")
    """Share of the weeds that grow in Thomas clusters; the others are a Poisson background [assumed]."""
    cluster_size: float = num(6.0, 0.1, 1000.0, "")
    """Mean number of weeds of a cluster [assumed]."""
    cluster_sigma_m: float = num(0.05, 0.0, 1.0, "m")
    """Standard deviation of a weed's distance from its cluster's centre, per axis [assumed]."""
    strip_m: float = num(8.0, 0.05, 500.0, "m")
    """Length of the strip that is one episode [assumed]."""
    band_m: float = num(0.40, 0.01, 2.0, "m")
    """Working width, the crop rows about its middle [assumed]."""
    row_m: float = num(0.40, 0.05, 3.0, "m")
    """Distance of the crop rows [published range 0.3-0.5]."""
    crop: Literal["beet", "maize"] = choice("beet", ("beet", "maize"))
    """``"beet"`` (a rosette) or ``"maize"`` (an upright grass): looks, and how far its leaves reach."""
    crop_pitch_m: float = num(0.16, 0.01, 5.0, "m")
    """Distance of the crop plants in a row [assumed]."""
    crop_missing: float = num(0.0, 0.0, 0.95, "")
    """Share of the crop plants that did not emerge [assumed; published for beet: 0.20-0.30, crystalsugar 434]."""
    patch_contrast: float = num(1.0, 1.0, 1000.0, "")
    """Weeds where they are densest along the row over those where they are thinnest; 1 grows no patches [assumed]."""
    patch_m: float = num(3.0, 0.1, 100.0, "m")
    """From patch to patch [assumed]."""
    crop_jitter_m: tuple[float, float] = num((0.015, 0.008), 0.0, 0.5, "m")
    """Standard deviation of their places along and across the row [published range 10-20 mm along; assumed across]."""
    leaf_radius_m: float | None = num(None, 0.001, 0.5, "m")
    """Radius of the disc about a crop plant's stem over which its leaves spread evenly; None: as the crop is drawn, 55
    mm for beet, 90 mm for maize [assumed]."""
    leaves_count: bool = flag(False)
    """Whether leaves that crop plants lose cost anything."""
    grass_share: float = num(0.30, 0.0, 1.0, "")
    """Share of grasses among the weeds [assumed]."""
    stage_shares: tuple[float, float, float] = num((0.40, 0.45, 0.15), 0.0, 1.0, "")
    """Shares of cotyledon, two-leaf and four-leaf weeds [assumed: an early pass]."""
    demanded: float = num(0.0, 0.0, 1.0, "")
    """Share of the weeds that has to die. Kills beyond it are worth nothing, so that what is left to win is time: as
    fast as you like down to the demanded share. 0: every kill counts."""
    worth: tuple[tuple[float, float, float], tuple[float, float, float]] = num(EVEN, 0.0, 100.0, "")
    """What a weed counts by species (broadleaf, grass) and stage, in reward and net rate."""
    energy_j: float = num(0.0, 0.0, 1e9, "J")
    """Energy that the tool may spend on a strip: what a battery holds for it. 0: as much as is asked for."""
    max_weeds: int = num(320, 1, 20_000, "")
    """Most weeds of a strip; draws beyond are cut off."""
    drives: DriveErrors = nested(DriveErrors)
    """Errors of the tool's drives: legs, sliders and swings; what the cart's drive errs by is the odometry's."""
    ground: GroundConfig = nested(GroundConfig)
    """What the cart drives over."""
    bed: BedConfig = nested(BedConfig)
    """How many rows the working width holds, and the ground about them."""

    def check(self) -> None:
        """Hold shares to their sum, and the room to what grows."""
        if abs(sum(self.stage_shares) - 1.0) > 1e-9:
            self.refuse("stage_shares", "give shares that add up to 1")
        if self.demanded > 0.0 and self.worth != EVEN:
            self.refuse("worth", "a share of the weeds is demanded by number: give 1 for every kind")
        if self.bed.ridge_m > 0.0 and self.bed.rows > 1 and self.bed.ridge_width_m > self.row_m:
            self.refuse("bed.ridge_width_m", f"ridges would overlap, give at most row_m = {self.row_m:g} m")
        outermost_m = max(abs(across) for across in self.rows_m)
        if outermost_m > 0.5 * self.band_m:
            self.refuse("bed.rows", f"the outer rows stand {outermost_m:g} m beside the middle, beyond half of band_m")
        expected = self.density_per_m2 * self.strip_m * self.weedy_m
        if self.max_weeds < expected:
            self.refuse("max_weeds", f"the strip holds {expected:.0f} weeds on average, give at least as many")

    @property
    def leaf_m(self) -> float:
        """How far a crop plant's leaves reach."""
        return LEAF_M[self.crop] if self.leaf_radius_m is None else self.leaf_radius_m

    @property
    def crops(self) -> int:
        """Crop plants that can stand in the working width or reach into it; one of each row beyond each end."""
        # On the shortest strip too, so many that each has all its neighbours on both sides.
        fewest = 0 if self.bed.rows == 1 else 1
        return self.bed.rows * (max(int(self.strip_m / self.crop_pitch_m), fewest) + 3)

    @property
    def rows_m(self) -> tuple[float, ...]:
        """Where the crop rows stand across, from right to left."""
        return tuple((row - 0.5 * (self.bed.rows - 1)) * self.row_m for row in range(self.bed.rows))

    @property
    def weedy_m(self) -> float:
        """Width of what weeds grow on: the working width, or what of it lies in the bands about the rows."""
        band_m = self.bed.row_band_m
        if band_m is None:
            return self.band_m
        end_m, width_m = -0.5 * self.band_m, 0.0
        for across_m in self.rows_m:
            low_m = max(across_m - 0.5 * band_m, end_m)
            end_m = min(across_m + 0.5 * band_m, 0.5 * self.band_m)
            width_m += max(end_m - low_m, 0.0)
        return width_m


WORN = DriveErrors(
    LinearDrive(encoder_m=0.0003, backlash_m=0.0002, stiction_m=0.00005),
    RotaryDrive(encoder_rad=0.002, backlash_rad=0.0029, stiction_rad=0.0005),
    lag_s=0.010,
)
"""Drives after a season in dust: cylinders whose screws have 0.2 mm of play and encoders that are off by 0.3 mm, gears
of 10 arc minutes, servos of 16 Hz [assumed: play of rolled ball screws is 0.05-0.2 mm, of planetary gears 3-15 arc
minutes]."""

TILLED = GroundConfig(iso_class="C", drift_share=0.02, slip_share=0.01, wander_m=0.0143)
"""A seedbed that wheels have pressed, and an odometry that is off by 2 % on it [assumed, within the published]."""

RIDGED = BedConfig(rows=2, row_band_m=0.12, crop_height_m=0.06, ridge_m=0.02, ridge_width_m=0.16, frame_m=0.045)
"""Twin rows on low ridges, as carrots are grown, between which a hoe has gone before; the crop stands 60 mm
high, and the frame is set so that laser and hoe reach furrows and ridges [assumed]."""

SCENARIOS: dict[str, ScenarioConfig] = {
    "load-0.7": ScenarioConfig(40.0, 0.7),
    "load-1.0": ScenarioConfig(40.0, 1.0),
    "load-1.25": ScenarioConfig(40.0, 1.25),
    "load-1.6": ScenarioConfig(40.0, 1.6),
    "load-1.0-even": ScenarioConfig(40.0, 1.0, clumped=0.0),
    "load-1.6-even": ScenarioConfig(40.0, 1.6, clumped=0.0),
    "dense": ScenarioConfig(100.0, 1.0, strip_m=1.6),
    "patchy": ScenarioConfig(40.0, 1.25, crop_missing=0.25, patch_contrast=20.0),
    "field": ScenarioConfig(40.0, 1.25, leaves_count=True, drives=WORN, ground=TILLED),
    "ridged": ScenarioConfig(40.0, 1.25, row_m=0.20, bed=RIDGED),
}
WORTH: dict[str, ScenarioConfig] = {
    "worth": ScenarioConfig(40.0, 1.25, worth=((0.3, 1.0, 3.0), (0.3, 1.0, 3.0))),
}
"""``load-1.25`` where a weed counts by what it would take from the crop: those that emerged before the crop's first
leaves, which stand at four leaves by now, three times what those at two leaves do, and seedlings that come with the
next flush a third [assumed; that yield loss falls steeply with the weeds' relative time of emergence is published:
Cousens et al. 1987, Kropff and Spitters 1991]."""
BATTERY: dict[str, ScenarioConfig] = {"battery": ScenarioConfig(40.0, 1.25, energy_j=4000.0)}
"""``load-1.25`` with 4 kJ of light a strip, for a laser that a small robot carries: 1.25 kJ a square metre. A laser of
a tenth of efficiency takes 40 kJ of a battery for it, so that 1 kWh lasts for 90 strips, 290 m2 [assumed; label doses
ask for about 9 kJ]."""

"""Tiers by offered load at 40 weeds per m2 (an ordinary infestation), clumped unless they say ``even``; ``dense`` has
100 per m2 on a shorter strip, driven as slowly as its load of 1.0 asks. ``patchy`` is ``load-1.25`` where a quarter of
the crop did not emerge and weeds stand in patches of metres, as field papers map them, at the same density. ``field``
is ``load-1.25`` with a machine that has worked for a season, on ground that is no plane: nobody exchanges screws and
calibrates encoders before every field. There leaves count too. ``ridged`` has two rows 0.20 m apart on ridges of 20 mm,
weeds within 60 mm of them alone and a crop taller by 10 mm: the tool goes up and down with the ground, and works higher
over the furrows."""

DEMANDS: dict[str, ScenarioConfig] = {
    "demand-0.90": ScenarioConfig(40.0, 1.25, demanded=0.90),
    "demand-0.60": ScenarioConfig(40.0, 1.25, demanded=0.60),
}
"""The other family of tiers, for a cart whose speed is chosen: as fast as you like down to a demanded share of the
weeds, on the fields of ``load-1.25``. 0.90 is what practice reaches [published: seven hoeing robots, 92-94 %, Gerhards
et al. 2024]; perfect eyes do as well, the cameras' model does at no speed, so 0.60 asks of these cameras what they can
give. A weed that is missing costs as much as 20 seconds [assumed: by hand it takes 2-4 s at 25 EUR/h, and a machine of
58,000 USD a laser, 8 years and 1,000 h a year costs that much in about ten]."""


@dataclass(frozen=True)
class CartConfig(Config):
    """How the cart drives, and how its cameras are mounted."""

    start_m: float = num(0.45, 0.0, 10.0, "m")
    """The strip begins this far in front of the platform's middle; the front camera has seen it already [assumed]."""
    camera_ahead_m: float = num(0.85, 0.0, 5.0, "m")
    """Front camera in front of the platform's middle [assumed]."""
    camera_view_m: float = num(0.40, 0.05, 5.0, "m")
    """Length of ground that the front camera sees [assumed; its height follows]."""
    notch_m_s: float = num(0.02, 0.001, 1.0, "m/s")
    """Step by which the speed variant changes the commanded speed [assumed]."""
    speed_range_m_s: tuple[float, float] = num((0.03, 0.27), 0.001, 10.0, "m/s")
    """Speeds that the speed variant may command; at the upper end the highest dose is just possible [assumed]."""
    acceleration_m_s2: float = num(0.3, 0.001, 50.0, "m/s2")
    """Of the cart when the commanded speed changes [assumed]."""
    moment_s: float = num(0.10, 0.001, 60.0, "s")
    """What waiting a moment takes at least [assumed]."""
    illegal_s: float = num(0.25, 0.001, 60.0, "s")
    """What an action that is not possible costs at least [assumed]."""
    early_s: float = num(0.40, 0.0, 60.0, "s")
    """A candidate may be chosen this long before it enters the window; the tool waits for it [assumed]."""
    time_factor: float = num(2.5, 0.001, 1000.0, "")
    """The episode is cut off after this many times the scenario's own driving time [assumed]."""

    def check(self) -> None:
        """Hold the speeds to their order."""
        low, high = self.speed_range_m_s
        if not low < high:
            self.refuse("speed_range_m_s", "give slowest < fastest")

    @property
    def seen_ahead_m(self) -> float:
        """A weed is in the front camera's view from this far in front of the platform's middle on."""
        return self.camera_ahead_m + 0.5 * self.camera_view_m

    @property
    def unseen_m(self) -> float:
        """Where a weed leaves the front camera's view; from here on the odometry carries it."""
        return self.camera_ahead_m - 0.5 * self.camera_view_m


@dataclass(frozen=True)
class RewardWeights(Config):
    """Value of the named reward terms, in killed weeds."""

    killed: float = num(1.0, -1000.0, 1000.0, "")
    """For every weed that dies."""
    crop: float = num(-5.0, -1000.0, 1000.0, "")
    """For every crop plant that dies [assumed]."""
    seconds: float = num(-0.05, -1000.0, 1000.0, "1/s")
    """About a tenth of what a second of work earns at load 1 [assumed]."""
    joules: float = num(-0.0005, -1000.0, 1000.0, "1/J")
    """A normal dose costs 4 % of a weed [assumed]."""
    leaves: float = num(-1.0, -1000.0, 0.0, "")
    """For all leaves of a crop plant that lives; what burns or is stirred costs its share, where the scenario's
    ``leaves_count`` says so [assumed: a fifth of a plant that dies]."""


@dataclass(frozen=True)
class FieldTask(Config):
    """Everything that defines a weeding task but for its tool; tools add their reach and their process."""

    scenario: ScenarioConfig = nested(SCENARIOS["load-1.25"])
    """The field and how much of it there is to do."""
    cart: CartConfig = nested(CartConfig)
    """How the cart drives."""
    weights: RewardWeights = nested(RewardWeights)
    """What the named reward terms are worth."""
    slots: int = num(16, 1, 64, "")
    """Candidates that a policy is shown at once."""
    pictures: Literal["easy", "field"] = choice("field", ("easy", "field"))
    """What the cameras' pictures show: plants of one shape and colour a kind on even ground, or plants, light and soil
    that differ."""
    eyes: Literal["classical", "learned"] = choice("learned", ("classical", "learned"))
    """What the cameras' pictures are looked at with: colour and shapes, or a network for each camera."""
    speed_control: bool = flag(False)
    """Whether the action includes the cart's speed."""
    nominal_move_s: float = num(0.26, 0.0, 60.0, "s")
    """Mean move between two weeds, for the offered load alone [identified: fixed order at load 1]."""

    def check(self) -> None:
        """Hold field and cart to what the tool reaches."""
        if 0.5 * self.scenario.band_m > self.half_width_m + 1e-9:
            self.refuse("scenario.band_m", f"the tool reaches {self.half_width_m} m to either side, give less")
        if self.cart.unseen_m < self.front_m:
            self.refuse(
                "cart.camera_ahead_m",
                f"the front camera's view must end before the window begins ({self.front_m} m): give more, or a "
                "shorter camera_view_m",
            )
        low, high = SPEEDS_M_S
        if not low <= self.speed_m_s <= high:
            self.refuse(
                "scenario.offered_load",
                f"it asks for {self.speed_m_s:g} m/s with this density, width and service time: allowed are {low:g} to "
                f"{high:g} m/s",
            )

    @property
    def front_m(self) -> float:
        """The window begins this far in front of the machine's middle; it ends as far behind it."""
        raise NotImplementedError

    @property
    def half_width_m(self) -> float:
        """Reach to either side."""
        raise NotImplementedError

    @property
    def tool_line(self) -> tuple[float, float, float]:
        """The straight line on which the tool works; as it stands, straight down to the ground.

        Returns:
            Where it begins, metres over what it works on; the height of that over the ground; and 1 where it begins
            over its place across, 0 where over the frame's middle.
        """
        return 0.05, 0.0, 1.0

    @property
    def eye_m(self) -> float:
        """Height of the front camera over the ground."""
        return self.parameters.camera_height_m  # type: ignore[attr-defined]

    @property
    def depths_m(self) -> tuple[float, float, float]:
        """How deep the tool works in the ground, by mode; as it stands, it does not."""
        return 0.0, 0.0, 0.0

    @property
    def looks_after(self) -> bool:
        """Whether a camera beside the tool corrects it after the move; as it stands, there is none."""
        return False

    @property
    def label_work_s(self) -> NDArray[np.float64]:
        """Seconds (species, stage) on a weed in the mode that its kind calls for."""
        raise NotImplementedError

    @property
    def service_s(self) -> float:
        """Expected seconds for one weed: the move, and the work that its kind calls for."""
        scenario = self.scenario
        work_s = 0.0
        for share, row in zip((1.0 - scenario.grass_share, scenario.grass_share), self.label_work_s, strict=True):
            for part, seconds in zip(scenario.stage_shares, row.tolist(), strict=True):
                work_s += share * part * seconds
        return self.nominal_move_s + work_s

    @property
    def speed_m_s(self) -> float:
        """Constant speed of the scenario: what its offered load asks for, in whole millimetres a second."""
        scenario = self.scenario
        return round(scenario.offered_load / (scenario.density_per_m2 * scenario.weedy_m * self.service_s), 3)

    @property
    def time_limit_s(self) -> float:
        """Simulated seconds after which an episode is cut off."""
        way = self.scenario.strip_m + self.cart.start_m + self.front_m
        return self.cart.time_factor * way / self.speed_m_s
