"""What plants of data sets are to a weeder: the crop, a broadleaved weed, a grass, or nothing that matters."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches

from ...kernels.config_kinds import show
from ..assembly import meant
from ..field import FieldError
from .config import SPECIES

CROP, LEFT_OUT = "crop", "left-out"
CLASSES = (CROP, *SPECIES, LEFT_OUT)
"""What a species may be taken for."""

_BROADLEAF, _GRASS = SPECIES
CROP_LABELS = (*range(1, 21), 23, *range(24, 28), 92, 93, 94)
"""Label ids of CropAndWeed that are crops (maize, beet, pea, ... in all their stages)."""
GRASS_LABELS = (31, 48, 62, 65, 68, 69, 74, 75, 81, 84, 86)
"""Label ids of CropAndWeed that are grasses, as its own variant ``Fine24`` groups them."""
CROP_AND_WEED = {
    **{str(label): _BROADLEAF for label in range(1, 100)},
    **dict.fromkeys(map(str, GRASS_LABELS), _GRASS),
    **dict.fromkeys(map(str, CROP_LABELS), CROP),
    "255": LEFT_OUT,
}
"""Label id of CropAndWeed -> class; 255 is vegetation that nobody named."""

_GRASSES = (
    *("agrostis", "alopecurus", "apera", "avena", "brachiaria", "bromus", "cynodon", "cyperus", "dactyloctenium"),
    *("digitaria", "echinochloa", "eleusine", "elymus", "eragrostis", "festuca", "hordeum", "lolium", "panicum"),
    *("phalaris", "phleum", "poa", "setaria", "sorghum", "urochloa", "vulpia"),
)
_BROADLEAVES = (
    *("abutilon", "aethusa", "amaranthus", "ambrosia", "anagallis", "anchusa", "anthemis", "arctotheca", "atriplex"),
    *("bidens", "capsella", "cardaria", "centaurea", "cerastium", "chenopodium", "cirsium", "convolvulus", "conyza"),
    *("datura", "daucus", "descurainia", "echium", "equisetum", "erigeron", "erodium", "euphorbia", "fallopia"),
    *("fumaria", "galeopsis", "galinsoga", "galium", "geranium", "ipomoea", "kochia", "lactuca", "lamium", "lapsana"),
    *("malva", "matricaria", "medicago", "mercurialis", "myosotis", "papaver", "persicaria", "plantago", "polygonum"),
    *("portulaca", "ranunculus", "raphanus", "rapistrum", "rumex", "salsola", "senecio", "sida", "sinapis"),
    *(
        "sisymbrium",
        "solanum",
        "sonchus",
        "spergula",
        "stellaria",
        "taraxacum",
        "thlaspi",
        "trifolium",
        "tripleurospermum",
    ),
    *("urtica", "veronica", "vicia", "viola", "xanthium"),
)
KNOWN = {
    CROP: CROP,
    "none": LEFT_OUT,
    "weed": _BROADLEAF,
    _BROADLEAF: _BROADLEAF,
    _GRASS: _GRASS,
    **dict.fromkeys(_GRASSES, _GRASS),
    **dict.fromkeys(_BROADLEAVES, _BROADLEAF),
}
"""Role, class or genus -> class; a weed of which nothing else is said counts as broadleaved."""


def classified(name: str, mapping: Mapping[str, str], where: str) -> str:
    """What a species is to a weeder.

    A name of Weed-COCO is a role, or ``crop: name`` or ``weed: name``, with anything in brackets behind it.

    Args:
        name: a label id, a role, a genus, a scientific name, or both of Weed-COCO's.
        mapping: what counts before all that is known, by name or by genus.
        where: file and line, for messages.

    Raises:
        FieldError: it is unknown; the message says how to map it.
    """
    whole = " ".join(name.split()).lower()
    plain = whole.split("(")[0].strip()
    role, _, species = (part.strip() for part in plain.partition(":"))
    species = species or role
    genus = species.split(" ")[0]
    for said in (whole, plain, species, genus):
        if said in mapping:
            return mapping[said]
    if role in (CROP, "none") or species == "unspecified":
        species = genus = role
    for said in (species, genus):
        if said in KNOWN:
            return KNOWN[said]
    near = get_close_matches(genus[:40], (*CLASSES, "weed", *_GRASSES, *_BROADLEAVES), n=1, cutoff=0.8)
    hint = f"did you mean {near[0]!r}? " if near else ""
    raise FieldError(
        f"{where}: species {show(name)} is unknown: {hint}map it to one of {', '.join(CLASSES)}; known are crop, weed "
        f"and {len(_GRASSES) + len(_BROADLEAVES)} genera such as {', '.join((*_GRASSES[:2], *_BROADLEAVES[9:12]))}"
    )


def checked_mapping(mapping: Mapping[str, str]) -> dict[str, str]:
    """A mapping of species to classes, its names as they are compared.

    Raises:
        FieldError: a class is unknown.
    """
    for name, choice in mapping.items():
        if choice not in CLASSES:
            raise FieldError(f"species {show(name)} cannot be {show(choice)}: {meant(str(choice)[:40], CLASSES)}")
    return {" ".join(str(name).split()).lower(): choice for name, choice in mapping.items()}
