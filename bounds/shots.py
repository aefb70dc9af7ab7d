"""What a weeding tool's shots can do to the weeds of a strip: the options that bounds choose from.

A shot serves weeds by shares: whatever kills a weed has shares that add up to at least one. A weed that its own track
alone can kill is served whole or not at all; where several tracks reach it, the share is dose over tolerance.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..envs.weeding.process import dose
from ..envs.weeding.state import CROP_KIND, MODES, R
from ..envs.weeding.timing import G
from ..kernels.sums import in_order

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
Flags = NDArray[np.bool_]

NOTICED = 1e-3
"""Share of its tolerance below which a dose on a weed is not followed up, but taken off what the weed can take."""
STRAY_M = 1e-3
"""How far the simulated tool may work from where it was sent."""
CORRECTED_M = 0.025
"""With any reports: how far a machine may believe a weed from where its tool camera then finds it."""
_FAINT, _FORGIVEN = 0.01, 0.05
"""With any reports: a shot farther away than where this share of a weed's tolerance arrives does nothing to it, but
that much is taken off the tolerance."""


class Shots(NamedTuple):
    """What can be done, J options in the order of their targets along the row.

    Attributes:
        told_m: (J, 2), where the machine believes the target when it sets out.
        aim_m: (J, 2), where it works.
        slack_m: (J,), how far the machine may believe it from ``told_m``.
        stand_s: (J,), standing over it.
        cost: (J,), what the shot costs in reward, >= 0.
        share_first: (J + 1,), place of an option's first share.
        share_weed: (C,), weed that is served, counted among those that can be killed.
        share: (C,).
        weeds: how many can be killed.
        worth: (weeds,), what each counts.
        energy_j: (J,).
        whole: (weeds,), whether shares count for nothing until they add up to 1; else they count as they are.
        advance: (J,), what the shot pays in advance for its shares, in worth.
        track: (J,), -1 where none is known.
        mode: (J,), likewise.
    """

    told_m: Array
    aim_m: Array
    slack_m: Array
    stand_s: Array
    cost: Array
    share_first: Numbers
    share_weed: Numbers
    share: Array
    weeds: int
    worth: Array
    energy_j: Array
    whole: Flags
    advance: Array
    track: Numbers
    mode: Numbers

    def option_of_share(self) -> Numbers:
        """Option (C,) of every share."""
        return np.repeat(np.arange(len(self.stand_s)), np.diff(self.share_first))

    def brought(self) -> Array:
        """What an option (J,) brings where nothing was done before, less what it pays in advance."""
        total = -self.advance
        np.add.at(total, self.option_of_share(), self.share * self.worth[self.share_weed])
        return total

    def due(self, killed: float) -> Array:
        """What an option (J,) costs more than it brings beside wholes, ``killed`` being the value of a worth of one."""
        total = self.cost + killed * self.advance
        beside = np.where(self.whole[self.share_weed], 0.0, self.share * self.worth[self.share_weed])
        np.subtract.at(total, self.option_of_share(), killed * beside)
        return total

    def least(self, of_share: Array) -> Array:
        """The least of the values (C,) of the shares that serve each weed, (weeds,)."""
        least = np.full(self.weeds, np.inf)
        np.minimum.at(least, self.share_weed, of_share)
        return least

    def least_split(self, value: Array) -> Array:
        """``least`` of values (J,) split among an option's shares: no schedule stays below their sum over weeds."""
        option, total = self.option_of_share(), np.zeros(len(self.stand_s))
        np.add.at(total, option, self.share)
        return self.least((value / np.maximum(total, 1e-12))[option])


class Option(NamedTuple):
    """One of ``Shots``, before they are put in order; its shares by thing."""

    told: Array
    aim: Array
    slack_m: float
    stand_s: float
    cost: float
    energy_j: float
    shares: dict[int, float]
    track: int = -1
    mode: int = -1
    advance: float = 0.0


def in_row(options: list[Option], worth: Array, whole: Flags | None = None) -> Shots:
    """In the order along the row, with the weeds that can be killed counted anew.

    ``worth`` is that of all weeds; ``whole`` says which die whole or not at all, by default all of them.
    """
    whole = np.ones(len(worth), bool) if whole is None else whole
    options = sorted(options, key=lambda option: float(option.told[G.along]))
    weeds = sorted({weed for option in options for weed in option.shares})
    index = {weed: i for i, weed in enumerate(weeds)}
    counts = [len(option.shares) for option in options]
    return Shots(
        told_m=np.array([option.told for option in options]).reshape(-1, 2),
        aim_m=np.array([option.aim for option in options]).reshape(-1, 2),
        slack_m=np.array([option.slack_m for option in options], float),
        stand_s=np.array([option.stand_s for option in options], float),
        cost=np.array([option.cost for option in options], float),
        share_first=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        share_weed=np.array([index[weed] for option in options for weed in option.shares], np.int64),
        share=np.array([share for option in options for share in option.shares.values()], float),
        weeds=len(weeds),
        worth=worth[weeds] if weeds else np.zeros(0),
        energy_j=np.array([option.energy_j for option in options], float),
        whole=whole[weeds] if weeds else np.zeros(0, bool),
        advance=np.array([option.advance for option in options], float),
        track=np.array([option.track for option in options], np.int64),
        mode=np.array([option.mode for option in options], np.int64),
    )


def undominated(options: list[Option]) -> list[Option]:
    """Of one target's modes those that another one does not beat in everything."""
    kept: list[Option] = []
    for option in sorted(options, key=lambda o: o.stand_s):
        if option.shares and not any(
            other.cost <= option.cost + 1e-12
            and other.energy_j <= option.energy_j
            and other.advance <= option.advance + 1e-12
            and all(other.shares.get(weed, 0.0) >= share for weed, share in option.shares.items())
            for other in kept
        ):
            kept.append(option)
    return kept


def drawn_shots(core: Any, row: int, stray_m: float = 0.0) -> Shots:
    """Options of the tracks that lie in the rules.

    Args:
        core: the rules.
        row: the world.
        stray_m: how far the tool may work from where it was sent.
    """
    state, tables, work = core.state, core.tables, core.process.work
    tracks, end = int(state.track_count[row]), tables.weeds_end
    aim, told = state.track_aim[row, :tracks], state.track_report[row, :tracks]
    plant, tolerance, kind = state.plant[row], state.plant_tolerance[row], state.plant_kind[row]
    crop_price, energy_price = -float(tables.weights[R.crop]), -float(tables.weights[R.energy])
    # Doses on what stands near: weeds at their nearest, crop plants at their farthest.
    received: dict[int, dict[int, Array]] = {}
    harmed: dict[int, list[tuple[int, int]]] = {}
    for track in range(tracks):
        gap = plant - aim[track]
        near = np.flatnonzero((np.abs(gap[:, G.along]) <= work.reach_m + stray_m) & np.isfinite(tolerance))
        for p in near.tolist():
            distance = float(np.hypot(*gap[p]))
            off = distance + stray_m if kind[p] == CROP_KIND else max(distance - stray_m, 0.0)
            doses = np.array([dose(work, mode, off, 0.0, int(kind[p])) for mode in range(MODES)])
            if p < end:
                received.setdefault(p, {})[track] = doses
            else:
                for mode in np.flatnonzero(doses >= tolerance[p]).tolist():
                    harmed.setdefault(p, []).append((track, mode))
    shares: dict[tuple[int, int], dict[int, float]] = {}
    for weed, by_track in received.items():
        for (track, mode), share in _shares(by_track, float(tolerance[weed])).items():
            shares.setdefault((track, mode), {})[weed] = share
    # A crop plant dies once: each track that may kill it carries its part of the price.
    crop_cost = np.zeros((tracks, MODES))
    for pairs in harmed.values():
        able = len({track for track, _ in pairs})
        for track, mode in pairs:
            crop_cost[track, mode] += crop_price / able
    options = []
    for track in range(tracks):
        ways = [
            Option(
                told[track],
                aim[track],
                0.0,
                float(tables.stand_s[mode]),
                energy_price * float(tables.energy_j[mode]) + crop_cost[track, mode],
                float(tables.energy_j[mode]),
                shares.get((track, mode), {}),
                track,
                mode,
            )
            for mode in range(MODES)
        ]
        options += undominated(ways)
    return in_row(options, state.plant_worth[row])


def _shares(by_track: dict[int, Array], tolerance: float) -> dict[tuple[int, int], float]:
    """Shares of one weed by track and mode; empty where it cannot be killed."""
    most = {track: float(doses.max()) for track, doses in by_track.items()}
    if in_order(most.values()) < tolerance:
        return {}
    best = max(most, key=lambda track: most[track])
    rest = in_order(most.values()) - most[best]
    if rest < NOTICED * tolerance:
        return {(best, mode): 1.0 for mode, d in enumerate(by_track[best]) if d >= tolerance - rest}
    faint = in_order(value for value in most.values() if value < NOTICED * tolerance)
    found = {}
    for track, doses in by_track.items():
        for mode, d in enumerate(doses.tolist()):
            if most[track] >= NOTICED * tolerance and d > 0.0:
                found[track, mode] = min(d / (tolerance - faint), 1.0)
    return found


def any_shots(core: Any, row: int) -> Shots:
    """Options whatever the cameras report: any number of shots at every weed, where they do most.

    A shot that does something to a weed may do its best to every other one whose circle of influence it shares.
    """
    state, tables, work = core.state, core.tables, core.process.work
    end = tables.weeds_end
    weeds = np.flatnonzero(np.isfinite(state.plant_tolerance[row, :end]))
    place, kind = state.plant[row, weeds], state.plant_kind[row, weeds]
    tolerance = (1.0 - _FORGIVEN) * state.plant_tolerance[row, weeds]
    stand, energy_price = tables.stand_s, -float(tables.weights[R.energy])
    best = {k: np.array([dose(work, mode, 0.0, 0.0, k) for mode in range(MODES)]) for k in set(kind.tolist())}
    radius = np.array([_influence_m(work, int(k), _FAINT * t) for k, t in zip(kind, tolerance, strict=True)])
    share = np.array(
        [np.minimum(stand / _least_work_s(best[int(k)], stand, t), 1.0) for k, t in zip(kind, tolerance, strict=True)]
    )
    options = []
    for i in range(len(weeds)):
        gap = np.hypot(*(place - place[i]).T)
        near = np.flatnonzero(gap <= radius + radius[i])
        slack = CORRECTED_M + float(radius[i])
        options += undominated(
            [
                Option(
                    place[i],
                    place[i],
                    slack,
                    float(stand[mode]),
                    energy_price * float(tables.energy_j[mode]),
                    float(tables.energy_j[mode]),
                    {int(j): float(share[j, mode]) for j in near},
                )
                for mode in range(MODES)
            ]
        )
    return in_row(options, state.plant_worth[row, weeds])


def _influence_m(work: Any, kind: int, least: float) -> float:
    """Distance beyond which no shot brings the dose ``least``."""
    low, high = 0.0, float(work.reach_m)
    for _ in range(30):
        middle = 0.5 * (low + high)
        strong = max(dose(work, mode, middle, 0.0, kind) for mode in range(MODES)) >= least
        low, high = (middle, high) if strong else (low, middle)
    return high


def _least_work_s(doses: Array, stand_s: Array, tolerance: float) -> float:
    """Least standing time of shots whose doses add up to a tolerance."""
    whole = float(tolerance * (stand_s / doses).min())
    if tolerance > 4.0 * doses.max():
        return whole
    counts = [np.arange(int(np.ceil(tolerance / d)) + 1) for d in doses.tolist()]
    counts = [count[:24] for count in counts]
    grid = np.stack(np.meshgrid(*counts, indexing="ij"), axis=-1).reshape(-1, len(doses))
    enough = grid @ doses >= tolerance
    return max(float((grid @ stand_s)[enough].min()), whole) if enough.any() else whole
