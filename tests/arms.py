"""A small arm that does just what it is asked, and a chain in closed form, for tests."""

import numpy as np

from smoskin.arrays import Floats
from smoskin.robot.arm import Arm, ArmState
from smoskin.robot.chain import Chain

UPPER, FORE, SHOULDER = 0.4, 0.4, 0.3
"""Lengths of the upper arm and the forearm and the shoulder's height, m."""
BENT = np.array([0.3, 0.9, -1.6])
"""Angles at which the forearm reaches forward, far from every limit."""


def forearm_chain() -> Chain:
    """Yaw, shoulder and elbow; at zero the arm stretches along x, the skin lies on the forearm."""
    boxes = [
        (1, (-0.05, -0.05, 0.2), (0.05, 0.05, 0.35)),
        (2, (0.0, -0.06, SHOULDER - 0.06), (UPPER, 0.06, SHOULDER + 0.06)),
        (3, (UPPER, -0.08, SHOULDER - 0.08), (UPPER + FORE, 0.08, SHOULDER + 0.08)),
    ]
    corners = [
        [(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]]
        for _, low, high in boxes
        for i in (0, 1)
        for j in (0, 1)
        for k in (0, 1)
    ]
    return Chain(
        axes=[[0, 0, 1], [0, -1, 0], [0, -1, 0]],
        anchors=[[0, 0, 0], [0, 0, SHOULDER], [UPPER, 0, SHOULDER]],
        lower=[-3.0, -0.5, -2.8],
        upper=[3.0, 2.5, -0.05],
        speed=[1.0, 1.0, 1.0],
        acceleration=[10.0, 10.0, 10.0],
        carriers=3,
        origin=[UPPER + 0.12, -0.08, SHOULDER + 0.08],
        turn=np.eye(3),
        corners=corners,
        moved_by=np.repeat([number for number, _, _ in boxes], 8),
    )


class IdealArm(Arm):
    """Joints that follow their speeds with their accelerations, exactly."""

    def __init__(self, chain: Chain, angles: Floats = BENT) -> None:
        self._chain = chain
        self.angles = np.array(angles)
        self.speeds = np.zeros(chain.joints)
        self.asked = np.zeros(chain.joints)
        self.meets = ""

    @property
    def chain(self) -> Chain:
        return self._chain

    def state(self) -> ArmState:
        return ArmState(angles=self.angles, speeds=self.speeds, meets=self.meets)

    def move(self, speeds: Floats) -> Floats:
        self.asked = np.clip(speeds, -self._chain.speed, self._chain.speed)
        return self.asked

    def stop(self) -> None:
        self.asked = np.zeros(self._chain.joints)

    def close(self) -> None:
        self.stop()

    def advance(self, seconds: float) -> None:
        """Let time go on."""
        most = self._chain.acceleration * seconds
        before = self.speeds
        self.speeds = before + np.clip(self.asked - before, -most, most)
        self.angles = self.angles + seconds * (before + self.speeds) / 2
