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
_DEPTH: Final = 60e-3
"""m: how deep under the sheet's bottom vertices a motor and steel inside a limb lie; 50 mm from
the nearest chip of `curved`, 20 mm off its limb's axis."""
_INSIDE: Final[dict[str, Effect]] = {
    "motor-inside": Motor(place=(0.5, 0.5, -_DEPTH)),
    "steel-inside": Steel(place=(0.5, 0.5, -_DEPTH)),
}
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
LIMB: Final = World(
    name="limb",
    effects=tuple(_INSIDE.get(f"{name}-inside", effect) for name, effect in _HARD.items()),
)
"""The same with motor and steel inside the limb, under the middle of the skin, not beside it."""
EFFECTS: Final[dict[str, Effect]] = (
    {"stream": Effect()}
    | _HARD
    | _INSIDE
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
    worlds = {each.name: each for each in (PLAIN, HARD, LIMB)}
    if world not in worlds:
        raise ArgumentError(f"world must be one of {', '.join(worlds)}; got {world!r}")
    if effect is None:
        return worlds[world]
    if effect not in EFFECTS:
        raise ArgumentError(f"effect must be one of {', '.join(EFFECTS)}; got {effect!r}")
    return World(name=effect, effects=(EFFECTS[effect],))
