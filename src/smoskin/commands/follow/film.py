"""A film of the demonstration: the arm, the true force as an arrow, and what the arm is told."""

import io
import os
from typing import TYPE_CHECKING, Final

from smoskin.arrays import Floats
from smoskin.commands.follow.stage import Moment, Stage
from smoskin.errors import require
from smoskin.outputs import check_output, write_output

if TYPE_CHECKING:
    from PIL.Image import Image

_EVERY: Final = 0.15
"""Time from picture to picture, s."""
_LENGTH: Final = 0.15
"""Length of the arrow of a force of 1 N, m."""


class Film:
    """Pictures of moments; `save` writes them as a GIF.

    It raises a `FileError` if there is such a file already, unless `force` says that it may be
    replaced, and a `MissingExtraError` without the extra ``plots``.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        size: tuple[int, int] = (400, 300),
        force: bool = False,
    ) -> None:
        require("films", "plots", "matplotlib", "PIL")
        check_output(path, force=force)
        self._path, self._size = path, size
        self._pictures: list[Image] = []
        self._due = 0.0

    def watch(self, stage: Stage, moment: Moment) -> None:
        """Take a picture of a moment, if one is due."""
        if moment.time < self._due or moment.press < 0:
            return
        from PIL import Image, ImageDraw

        self._due = moment.time + _EVERY
        arrows: tuple[tuple[Floats, Floats], ...] = ()
        if moment.force > 0.0:
            arrows = ((moment.place - _LENGTH * moment.push, moment.place),)
        image = Image.fromarray(stage.arm.picture("side", self._size, arrows))
        draw = ImageDraw.Draw(image)
        words = f"{moment.force:.2f} N   {1e3 * moment.speed:.0f} mm/s"
        draw.text((12, 10), words, fill=(20, 30, 40), font_size=20)
        draw.text((12, 36), moment.command.reason.value, fill=(20, 30, 40), font_size=14)
        self._pictures.append(image.quantize(128, method=Image.Quantize.FASTOCTREE))

    def save(self) -> None:
        """Write the film."""
        buffer = io.BytesIO()
        first, *others = self._pictures
        first.save(
            buffer,
            format="GIF",
            save_all=True,
            append_images=others,
            duration=round(1e3 * _EVERY),
            loop=0,
            optimize=True,
        )
        write_output(self._path, buffer.getvalue())
