"""The operator's page of an arm: the arm as it stands, what it is allowed and why, and controls.

Decides what an operator sees and may do. Whatever the page does is asked of the driver, which knows
no page: closed, the arm goes on where it needs no switch held, else it stands.
"""

import io
import queue
import threading
from collections.abc import Callable
from contextlib import redirect_stdout
from html import escape
from typing import TYPE_CHECKING, Final, final

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact
from smoskin.robot.driver import Driver
from smoskin.robot.follow import THRESHOLDS, Command, Follow, State
from smoskin.robot.holding import Holding
from smoskin.robot.simulated import Shape, SimulatedArm
from smoskin.roles import Resource
from smoskin.service.page.markers import UNITS, arrow
from smoskin.service.page.parts import first_paint, html, within
from smoskin.service.page.scene import ESTIMATED, pick, triangles
from smoskin.service.page.server import serve

if TYPE_CHECKING:
    import viser

_PERIOD: Final = 1.0 / 25.0
_WORDS_EVERY: Final = 4
_SIGNS: Final = 20.0
"""Signs a second of a button that is held, Hz: four within the deadline of the switch."""
_THICK: Final = 3.0
"""How much larger a force is drawn than on the page of a skin alone: an arm is seen from afar."""


@final
class ArmPage(Resource):
    """The page of an arm, served to browsers on this machine; closing it leaves the arm alone.

    The model tells the shapes of whichever arm moves; `words` take the word ``zero``; without
    `switch` nothing need be held; the warning stands there for good; port 0 is a free one. With
    `touch`, which touches a virtual skin, the mouse presses it.
    """

    def __init__(
        self,
        design: SkinDesign,
        model: SimulatedArm,
        driver: Driver,
        follow: Follow,
        words: "queue.Queue[str]",
        switch: Holding | None,
        warning: str,
        port: int,
        touch: Callable[[tuple[Contact, ...]], None] | None = None,
    ) -> None:
        self._design = design
        self._driver, self._follow, self._switch = driver, follow, switch
        self._chain, self._warning, self._answer = model.chain, warning, ""
        low, high = model.chain.corners.min(axis=0), model.chain.corners.max(axis=0)
        aim = (low + high) / 2 * (0.5, 1.0, 1.0)
        eye = aim + np.array((0.35, -1.0, 0.35)) * 1.15 * (high - low).max()
        title, sentence = "smoskin follow", "An arm that yields to touch: not a safety function"
        views = {name: ",".join(map(str, at * UNITS)) for name, at in (("eye", eye), ("aim", aim))}
        marks = {"force on the skin, as its chips tell it": ESTIMATED}
        paint = first_paint(title, sentence, marks, keys="z zero", **views)
        self._server, self.url = serve(port, title, *paint)
        start = self._server.initial_camera
        start.position, start.look_at = eye * UNITS, aim * UNITS
        self._stage(design, model.shapes())
        self._add_controls(title, words)
        if touch is not None:
            self._add_finger(touch)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="smoskin-arm", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the page; any number of times."""
        if not self._closing.is_set():
            self._closing.set()
            self._thread.join(5.0)
            with redirect_stdout(io.StringIO()):  # the standard output is the caller's
                self._server.stop()

    def _stage(self, design: SkinDesign, shapes: tuple[Shape, ...]) -> None:
        """Set the arm, its skin and the force on it."""
        scene, chain = self._server.scene, self._chain
        wide, cell, far = 3 * UNITS, 0.1 * UNITS, 9 * UNITS
        ground = scene.add_grid("/ground", width=wide, height=wide, fade_distance=far)
        ground.cell_size, ground.section_size = cell, 5 * cell
        parts = range(chain.joints + 1)
        self._frames = [scene.add_frame(f"/part{k}", show_axes=False) for k in parts]
        for number, shape in enumerate(shapes):
            places, faces = _mesh(shape)
            places = (places @ shape.turn.T + shape.place) * UNITS
            color, name = tuple(shape.color.tolist()), f"/part{shape.moved_by}/{number}"
            scene.add_mesh_simple(name, places, faces, color=color, flat_shading=True)
        sheet, skin = geometry(design).sheet, f"/part{chain.carriers}"
        places = (sheet.vertices @ chain.turn.T + chain.origin) * UNITS
        faces, paper = triangles(sheet.facets), (247, 226, 186)
        self._sheet = scene.add_mesh_simple(
            f"{skin}/sheet", places, faces, color=paper, side="double"
        )
        mesh = arrow(np.array((0.0, 0.0, -1.0)), _THICK)
        self._force = scene.add_mesh_simple(f"{skin}/force", *mesh, color=ESTIMATED)

    def _add_controls(self, title: str, words: "queue.Queue[str]") -> None:
        """Add what an operator reads and presses."""
        gui, driver, switch = self._server.gui, self._driver, self._switch
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(31, 111, 181))
        gui.set_panel_label(title)
        gui.main_panel.dock_right()
        # First, so that a phone shows it without scrolling.
        stop = gui.add_button("Stop", color="red", hint="Disarms; the arm stands at once.")
        stop.on_click(lambda event: self._do("Disarmed.", driver.disarm))
        self._card = gui.add_html("")
        arm = gui.add_button("Arm", hint="Lets touches move the arm; it must rest untouched.")
        arm.on_click(lambda event: self._do("Armed.", driver.arm))
        hold = gui.add_button("Hold to run", visible=switch is not None)
        reset = gui.add_button("Reset", hint="Forgets a fault; the arm is disarmed then.")
        reset.on_click(lambda event: self._do("Reset.", driver.reset))
        self._zero = gui.add_button("Zero", hint="Let go of the skin first.")
        self._zero.on_click(lambda event: words.put("zero"))
        begin = self._follow.limits.begin
        self._threshold = gui.add_slider("Moves from, N", *THRESHOLDS, 0.05, begin)

        @hold.on_hold(callback_hz=_SIGNS)
        async def _(event: object) -> None:  # on the server's own loop: it waits for no thread
            if switch is not None:
                switch.sign()

        @self._threshold.on_update
        def _(event: object) -> None:
            wanted = float(self._threshold.value)
            if wanted != self._follow.limits.begin:
                self._do("", lambda: driver.set_threshold(wanted))

    def _add_finger(self, touch: Callable[[tuple[Contact, ...]], None]) -> None:
        """Let the left button press the skin, as hard as a slider says, while it is held."""
        gui, sheet = self._server.gui, geometry(self._design).sheet.vertices
        gui.add_html(html("finger"))
        push = gui.add_slider("Press, N", 0.05, 1.0, 0.05, 0.7)

        @self._sheet.on_drag("left")
        async def _(event: "viser.SceneNodeDragEvent[viser.MeshHandle]") -> None:
            place, newest = None, self._driver.newest
            if event.phase != "end" and newest is not None:
                drawn = self._chain.posture(newest[0].angles).on_skin(sheet)
                eye = event.client.camera.position
                ray = np.asarray(event.end_position) - eye
                place = pick(self._design, drawn, eye / UNITS, ray)
            force = (0.0, 0.0, -within(push))
            touches = () if place is None else (Contact(position=place, force=force),)
            self._do("", lambda: touch(touches))

        @self._server.on_client_disconnect
        async def _(client: object) -> None:  # with its button held, perhaps
            touch(())

    def _do(self, done: str, action: Callable[[], None]) -> None:
        """Do what was asked, or say why not."""
        try:
            action()
        except ArgumentError as error:
            done = f"Not done: {error}"
        self._answer = done

    def _run(self) -> None:
        """Draw the newest look again and again."""
        turn = 0
        while not self._closing.wait(_PERIOD):
            if (newest := self._driver.newest) is not None:
                with self._server.atomic():
                    self._draw(newest[0].angles, newest[1])
                    if turn % _WORDS_EVERY == 0:
                        self._write(newest[1])
            turn += 1

    def _draw(self, angles: Floats, command: Command) -> None:
        """Put the parts where they are, and the force on the skin."""
        from viser.transforms import SO3

        frames = self._chain.posture(angles).frames
        for frame, (turn, shift) in zip(self._frames, frames, strict=True):
            frame.wxyz, frame.position = SO3.from_matrix(turn).wxyz, shift * UNITS
        turn, shift = frames[self._chain.carriers]
        if command.place is not None and command.force is not None:
            force = _THICK * command.force @ turn
            self._force.vertices = arrow(force, _THICK)[0].astype(np.float32)
            self._force.position = (command.place - shift) @ turn * UNITS
        self._force.visible = command.force is not None

    def _write(self, command: Command) -> None:
        """Tell state, cause, touch and limits in words."""
        limits, state, fault = self._follow.limits, self._follow.state, self._follow.fault
        moving = state in (State.MOVING, State.RELEASING)
        lamps = {"Armed": state not in (State.DISARMED, State.FAULT), "Moving": moving}
        lamps |= {"Still": not moving, "Fault": state is State.FAULT}
        if self._switch is not None:
            lamps["Switch held"] = self._switch()
        signs = [(name, "●" if on else "○", "yes" if on else "no") for name, on in lamps.items()]
        force = command.force
        self._card.content = html(
            "arm",
            word=escape(state.value.capitalize()),
            sentence=escape((fault or command.reason).value),
            lamps="".join(f"<li>{sign} {name}: {word}</li>" for name, sign, word in signs),
            touch="–" if force is None else f"F {np.linalg.norm(force):.2f} N",
            begin=f"{limits.begin:.2f}",
            end=f"{limits.end:.2f}",
            way=f"{1e3 * self._follow.way:.0f}",
            distance=f"{1e3 * limits.distance:.0f}",
            duration=f"{limits.duration:g}",
            speed=f"{1e3 * limits.speed:.0f}",
            answer=escape(self._answer) or "&nbsp;",
            warning=escape(self._warning),
        )
        self._threshold.disabled = self._zero.disabled = state is not State.DISARMED


def _mesh(shape: Shape) -> tuple[Floats, Ints]:
    """Vertices, (V, 3), m, and triangles, (F, 3), of a shape about its middle."""
    from trimesh import creation

    radius, height = float(shape.size[0]), max(2 * float(shape.size[1]), 1e-6)
    solid = creation.box(2 * shape.size)
    if shape.kind != "box":
        solid = getattr(creation, shape.kind)(height=height, radius=radius)
    return np.asarray(solid.vertices), np.asarray(solid.faces)
