"""What was done an hour and what energy it took, beside the scorecard: derived from it and the machine's numbers."""

from __future__ import annotations

from functools import lru_cache

from ..envs.rates import HOUR_S, JOULES_PER_KWH, Rates, items
from ..envs.task import task
from .record import Record, condition
from .suites import Condition

WORK, EACH_S, EACH_J, AREA_KWH, LOSS = "work_per_h", "done_per_s", "joules_each", "kwh_per_ha", "loss_percent"
MET, ACCEPTED = "demand_met", "accepted_per_h"
"""Names of the derived scores: hectares (metres of row, trays, items) an hour, finished targets a second, joules of
tool and motors a finished target, kilowatt hours of both a hectare, and what the crop lost in percent. Where a net rate
is demanded: whether it was met, and the work an hour that counts, none where it was not."""
HECTARES = "ha"


@lru_cache(maxsize=256)
def rates_of(where: Condition) -> Rates:
    """How scorecards under a condition are read; as items where results are of what this version does not know."""
    try:
        assembly = task(where.env_id).assembly
        if assembly.rates is None:
            return items()
        settings = where.settings
        return assembly.rates(assembly.configured(settings.get("scenario"), overrides=settings.get("overrides")))
    except (KeyError, TypeError, ValueError):
        return items()


def derived(record: Record) -> dict[str, float]:
    """The derived scores of an episode; what there is none of is missing, as are all where a scorecard is older."""
    card = {name: float(value) for name, value in record["scorecard"].items() if value is not None}
    rates = rates_of(condition(record))
    try:
        work, joules = rates.per_h(card), rates.joules(card)
        done, area_ha = card["done"], work * card["duration_s"] / HOUR_S
        found = {WORK: work, EACH_S: card["throughput_per_min"] / 60.0}
        if joules > 0.0 and done > 0.0:
            found[EACH_J] = joules / done
        if rates.unit == HECTARES and area_ha > 0.0:
            found[AREA_KWH] = joules / JOULES_PER_KWH / area_ha
        if rates.demanded > 0.0:
            met = card["net_rate"] >= rates.demanded
            found |= {MET: float(met), ACCEPTED: work if met else 0.0}
        return found | ({LOSS: card[rates.loss_percent]} if rates.loss_percent else {})
    except KeyError:
        return {}


def unit_of(where: Condition) -> str:
    """What an hour's work under a condition is counted in."""
    return rates_of(where).unit
