"""The rig in Python: layout and validation as docs/rig-protocol.md says, contact as (14)."""

from __future__ import annotations

import ctypes
import math
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "validation/rig"))

from geometry import RigFile, compose, quaternion, rotation  # noqa: E402
from protocol import (  # noqa: E402
    HOLD,
    IDLE,
    LOCKSTEP,
    REFUSED,
    SAFE_STATE,
    TRACK,
    UNSOLICITED,
    RigCommand,
    RigEnd,
    RigMeasurement,
)

MS = 1_000_000


def page_fields(heading):
    """Offset, size and name of every row of a table of the page."""
    page = (ROOT / "docs/rig-protocol.md").read_text()
    section = page.split(f"### {heading}")[1].split("\n#")[0]
    cells = [line.split("|") for line in section.splitlines() if line.startswith("| ")]
    rows = [c for c in cells if c[1].strip().isdigit()]
    return [(int(c[1]), int(c[2]), c[3].strip().strip("`")) for c in rows]


@pytest.mark.parametrize("structure", [RigCommand, RigMeasurement])
def test_layout_is_that_of_the_page(structure):
    fields = [getattr(structure, name) for name, _ in structure._fields_]
    names = [name for name, _ in structure._fields_]
    ours = [(f.offset, f.size, n) for f, n in zip(fields, names)]
    assert ours == page_fields(structure.__name__)
    assert sum(size for _, size, _ in ours) == ctypes.sizeof(structure)


class Still:
    """A plant with six legs that counts what it is asked for."""

    legs, pose = 6, False

    def __init__(self):
        self.followed, self.left_alone = 0, 0

    def follow(self, _command):
        self.followed += 1
        return RigMeasurement()

    def alone(self, _period_ns):
        self.left_alone += 1
        return RigMeasurement()


def command(session, tick, mode, **changes):
    c = RigCommand(protocol_version=3, mode=mode, flags=LOCKSTEP, session=session, tick=tick)
    c.leg_count = 6
    c.loop_time_ns = c.wakeup_ns = tick * MS
    c.period_ns = MS
    c.plate_attitude[0] = 1
    for name, value in changes.items():
        setattr(c, name, value)
    return c


SPOILED = [
    (1, {"protocol_version": 2}),
    (3, {"tick": 1}),
    (4, {"plate_position_m": (ctypes.c_double * 3)(0, math.nan, 0)}),
    (5, {"flags": 0, "wakeup_ns": 10**18}),
    (6, {"mode": 5}),
    (7, {"session": 0}),
    (10, {"period_ns": 9_999}),
    (4, {"guard_force_n": math.inf}),
    (11, {"flags": LOCKSTEP | 1 << 2}),
    (11, {"guard_limits": 1 << 5}),
    (11, {"leg_count": 7}),
    (11, {"mechanism_mode": 4}),
    (11, {"reserved": (ctypes.c_uint64 * 8)(*[0] * 7, 1)}),
    (12, {"leg_count": 5}),
    (12, {"leg_count": 0}),
    (13, {"leg_force_n": (ctypes.c_double * 6)(0, 0, 1e200)}),
    (13, {"plate_attitude": (ctypes.c_double * 4)()}),
    (13, {"guard_limits": 1 << 4}),
]


@pytest.mark.parametrize(("reason", "changes"), SPOILED)
def test_a_refused_command_never_arrives(reason, changes):
    end = RigEnd(Still())
    end.command(command(5, 0, IDLE), 0)
    end.command(command(5, 1, TRACK), 0)
    spoiled = command(5, 2, TRACK)
    for name, value in changes.items():
        setattr(spoiled, name, value)
    m = end.command(spoiled, 0)
    assert m.refusal == reason and m.status & REFUSED and m.status & SAFE_STATE
    assert end.plant.followed == 2
    # Held until an idle command of a new session.
    for tick, mode in [(3, TRACK), (4, IDLE)]:
        assert end.command(command(5, tick, mode), 0).status & SAFE_STATE
    assert end.plant.followed == 2
    assert not end.command(command(6, 0, IDLE), 0).status & SAFE_STATE


def test_a_rig_that_takes_poses_needs_no_legs():
    end = RigEnd(Still())
    end.plant.legs, end.plant.pose = 0, True
    end.command(command(5, 0, IDLE), 0)
    m = end.command(command(5, 1, TRACK, leg_count=0), 0)
    assert not m.refusal and m.capabilities == 1 << 1 and end.plant.followed == 2
    # Leg values that nobody looks at do no harm.
    assert not end.command(command(5, 2, TRACK), 0).refusal


def test_silence_ends_in_the_safe_state():
    end = RigEnd(Still())
    end.command(command(5, 0, IDLE, flags=0), 0)
    assert end.due_ns(0) == math.inf
    end.command(command(5, 1, HOLD, flags=0, wakeup_ns=0), 3 * MS)
    assert end.due_ns(0) == 13 * MS
    m = end.silence(13 * MS)
    assert m.status & SAFE_STATE and m.status & UNSOLICITED and m.tick == 1
    assert end.due_ns(0) == 14 * MS


def test_a_session_begins_with_idle():
    end = RigEnd(Still())
    assert end.command(command(5, 0, TRACK), 0).status & SAFE_STATE
    assert end.plant.followed == 0


def test_the_contact_is_a_spring_beyond_its_free_play():
    pytest.importorskip("iceoryx2")
    from rig import Plate

    plate = Plate(RigFile(ROOT / "models/urdf/stewart.urdf"), "y", 35.4e3, 0.010, bare=True)
    turned = quaternion([0.0, 0.0, 0.1])
    for y, force in [(0.0, 0.0), (0.0099, 0.0), (0.016, -212.4), (-0.012, 70.8)]:
        x_34 = (plate.rig.middle_p_34 + [0.0, y, 0.0], turned)
        p, q = compose(compose(plate.rig.x_b3, x_34), plate.rig.x_4p)
        c = command(1, 1, TRACK)
        c.plate_position_m[:], c.plate_attitude[:] = p, q
        m = plate.follow(c)
        f3, f4 = np.array(m.truth_port3), np.array(m.truth_port4)
        np.testing.assert_allclose(rotation(turned) @ f4[:3], [0.0, force, 0.0], atol=1e-9)
        # Both ports hold each other in balance about the origin of e3.
        np.testing.assert_allclose(f3[:3], [0.0, -force, 0.0], atol=1e-9)
        np.testing.assert_allclose(f3[3:], np.cross(x_34[0], f3[:3]), atol=1e-9)


def test_sensors_of_steel_measure_the_weight():
    pytest.importorskip("iceoryx2")
    from rig import Plate

    plate = Plate(RigFile(ROOT / "models/urdf/stewart.urdf"), "x", 35.4e3, 0.010)
    m = plate.alone(MS)
    # 240 kg on the rack and 200 kg on the plate, gravity along -X; noise of 0.3 N.
    assert abs(m.sensor_a[0] + 240 * 9.81) < 3 and abs(m.sensor_b[0] + 200 * 9.81) < 3
    # An accelerometer at rest measures what holds it up.
    np.testing.assert_allclose(m.plate_acceleration, [9.81, 0, 0, 0, 0, 0], atol=5e-3)
