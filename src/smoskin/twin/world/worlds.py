"""The worlds by their names: the plain one, the hard one, and one for each effect alone."""

from typing import Final

from smoskin.errors import ArgumentError
from smoskin.twin.world.arm import Gravity
from smoskin.twin.world.arrival import Arrival
from smoskin.twin.world.effect import Effect, World
from smoskin.twin.world.fields import Earth, Motor, Steel, Warmth
from smoskin.twin.world.making import Contact, Cover, Debonded, Fingers, Glue, Sectors
from smoskin.twin.world.memory import BoucWen, Hysteresis
from smoskin.twin.world.strangers import STRANGERS

PLAIN: Final = World(name="plain")
"""The twin's own assumptions."""
_HARD: Final[dict[str, Effect]] = {
    "contact": Contact(),
    "fingers": Fingers(),
    "gravity": Gravity(),
    # A crease remembers what moved it, touch or weight.
    "hysteresis": Hysteresis(),
    "debonded": Debonded(),
    "glue": Glue(),
    "sectors": Sectors(),
    "earth": Earth(),
    "motor": Motor(),
    "steel": Steel(),
    "warmth": Warmth(),
    "arrival": Arrival(),
}
HARD: Final = World(name="hard", effects=tuple(_HARD.values()))
"""All effects at once."""
EFFECTS: Final[dict[str, Effect]] = (
    {"stream": Effect()}
    | _HARD
    | {"cover": Cover(), "bouc-wen": BoucWen()}
    | {name: Contact(laws=(name,)) for name in STRANGERS}
)
"""Effects by name, alone. `stream`: none, but readings as often as all effects have them."""


def world_of(world: str = "plain", effect: str | None = None) -> World:
    """The world of a name, or that of one effect alone.

    It raises an `ArgumentError` if there is none of the name, or both are asked for.

    Examples
    --------
    >>> world_of("hard").name, len(world_of(effect="earth").effects)
    ('hard', 1)
    """
    worlds = {one.name: one for one in (PLAIN, HARD)}
    if world not in worlds:
        raise ArgumentError(f"world must be one of {', '.join(worlds)}; got {world!r}")
    if effect is None:
        return worlds[world]
    if effect not in EFFECTS:
        raise ArgumentError(f"effect must be one of {', '.join(EFFECTS)}; got {effect!r}")
    return World(name=effect, effects=(EFFECTS[effect],))
