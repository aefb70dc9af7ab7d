"""Numbers of an order book: what customers want of which grade until when, and the bins that it is packed into."""

from __future__ import annotations

from dataclasses import dataclass

from ...kernels.config import Config, num

GRADES_HELD = 4
"""A shipment has at most a line of each grade."""


@dataclass(frozen=True)
class OrderConfig(Config):
    """Orders against which a stream is packed; without shipments there are none, and every item counts.

    A packing house packs what is ordered, not what comes: it plans by incoming fruit, capacity and demand [published:
    Hass Avocado Board, Avocado Quality Manual, packing house]. What is measured there is the fill rate: units delivered
    in time / units ordered [published: Schoensleben, Integral Logistics Management 1.4.4]. The clock is that of a
    consumer pack line, minutes for a lorry's hours.
    """

    shipments: int = num(0, 0, 16, "")
    """Lorries that leave while produce comes; 0: no orders [assumed]."""
    every_s: float = num(22.0, 1.0, 3600.0, "s")
    """From the beginning to the first cut-off, and from each to the next [assumed: four in a stream]."""
    lines: int = num(2, 1, GRADES_HELD, "")
    """Order lines of a shipment, each of another grade, any with equal chance [assumed]."""
    count: tuple[int, int] = num((4, 8), 1, 500, "")
    """Items of a line, uniform [assumed: consumer packs of 4 to 8 pieces]."""
    surplus: float = num(0.2, 0.0, 1.0, "")
    """What an item that no line waits for is worth, as a share of its grade's value [assumed: sold loose]."""
    bin_holds: int = num(6, 1, 10_000, "")
    """Items in a bin beside the belt, right ones or wrong ones; a full one is swapped for an empty one [assumed: a
    punnet tray of 2 x 3]."""
    swap_s: float = num(4.0, 0.0, 600.0, "s")
    """Until the empty one stands there: nothing can be let go over it before [assumed, a fraction of the minute in
    which a robot behind a packer fills and changes a whole carton, published: Global Pac's COR, 2022]."""

    def check(self) -> None:
        """Counts have a lower and an upper end."""
        if self.count[0] > self.count[1]:
            self.refuse("count", "give the smaller one first")

    @property
    def max_lines(self) -> int:
        """Lines of a whole book."""
        return self.shipments * self.lines
