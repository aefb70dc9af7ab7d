"""A suction bag that fills up, and heads whose filaments wilt: what makes the order of picking matter."""

from __future__ import annotations

from dataclasses import dataclass

from ...kernels.config import Config, num


@dataclass(frozen=True)
class Bag(Config):
    """The bag that the suction blows into; as it stands, it is never full and never in the way.

    A petal harvester for safflower with a cutting blade, a vacuum motor, a flexible tube and a bag lost 20.9, 6.9 and
    5.1 % at air speeds of 19, 25 and 36 m/s [published: amsr.areeo.ac.ir, article 120783]: what slows the air costs
    filaments, and a bag that fills up slows it.
    """

    capacity_g: float = num(0.0, 0.0, 10_000.0, "g")
    """Filaments that fill it: a full bag allows no pick until it is emptied; 0 for a bag that holds any amount."""
    empty_s: float = num(20.0, 0.0, 3600.0, "s")
    """Taking it off, emptying it into the crate on the cart and putting it back [assumed]."""
    clog: float = num(0.45, 0.0, 0.95, "")
    """Share of the cut filaments that a full bag lets drop beside what drops anyway, in proportion to its fill
    [assumed: the published losses go on rising as they do from 25 to 19 m/s, down to some 15 m/s with a full bag]."""


@dataclass(frozen=True)
class Wilting(Config):
    """When filaments wilt on the head, counted from the beginning of the episode; as it stands, never.

    Florets are picked early in the morning [published: Stockberger 1935, USDA Farmers' Bulletin 663], while the dew
    keeps spines soft and filaments whole; a head in the sun is over sooner than one in the shade, a late one sooner
    than a fresh one.
    """

    closes_s: tuple[float, float] = num((0.0, 0.0), 0.0, 86400.0, "s")
    """First and last time at which the window of an open head closes: fresh ones close in all of this range, late ones
    in its first half, each alike likely [assumed]; (0, 0) for never."""
    read_sigma_s: float = num(30.0, 0.0, 3600.0, "s")
    """Standard deviation of what the statistical camera reads off a head's colour and droop about that time
    [assumed]; a camera that renders tells the mean of the head's stage."""

    def check(self) -> None:
        """The range ascends."""
        if self.closes_s[0] > self.closes_s[1]:
            self.refuse("closes_s", "give a first and a last time in s")
