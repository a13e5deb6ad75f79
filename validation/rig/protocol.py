"""The rig port as docs/rig-protocol.md gives it: structures, numbers, and how a rig validates commands."""

from __future__ import annotations

import ctypes
import math

VERSION = 3
IDLE, HOLD, TRACK, RETRACT, STOP = range(5)
LOCKSTEP = 1
ENABLED, SAFE_STATE, REFUSED, UNSOLICITED = 1, 1 << 5, 1 << 6, 1 << 8
LEG_COMMAND, POSE_COMMAND = 1, 1 << 1
LEG_LENGTH, LEG_SPEED, LEG_FORCE = 1 << 8, 1 << 9, 1 << 10
SENSOR_A, SENSOR_B, ACCELEROMETER, TRUTH = 1 << 12, 1 << 13, 1 << 14, 1 << 21
KNOWN_FLAGS, KNOWN_GUARD_LIMITS = 0b11, 0b11111
SILENT_PERIODS = 10
PERIODS_NS = range(10_000, 1_000_000_001)
LARGEST = 1e12
GUARD_POSE = 1 << 4


def is_attitude(q):
    """Whether four numbers are a unit quaternion, within 1 %."""
    return abs(math.sqrt(sum(x * x for x in q)) - 1) <= 0.01


class RigCommand(ctypes.Structure):
    """From the loop to the rig, once a tick."""

    _fields_ = [
        ("protocol_version", ctypes.c_uint32),
        ("mode", ctypes.c_uint32),
        ("flags", ctypes.c_uint32),
        ("leg_count", ctypes.c_uint32),
        ("session", ctypes.c_uint64),
        ("tick", ctypes.c_uint64),
        ("loop_time_ns", ctypes.c_uint64),
        ("wakeup_ns", ctypes.c_uint64),
        ("period_ns", ctypes.c_uint64),
        ("leg_length_m", ctypes.c_double * 6),
        ("leg_speed_m_s", ctypes.c_double * 6),
        ("leg_flow_speed_m_s", ctypes.c_double * 6),
        ("leg_force_n", ctypes.c_double * 6),
        ("flow_ahead_s", ctypes.c_double),
        ("force_ahead_s", ctypes.c_double),
        ("plate_position_m", ctypes.c_double * 3),
        ("plate_attitude", ctypes.c_double * 4),
        ("plate_velocity_m_s", ctypes.c_double * 3),
        ("plate_rate_rad_s", ctypes.c_double * 3),
        ("plate_acceleration", ctypes.c_double * 6),
        ("plate_wrench", ctypes.c_double * 6),
        ("mechanism_mode", ctypes.c_uint32),
        ("guard_limits", ctypes.c_uint32),
        ("mechanism", ctypes.c_double * 8),
        ("guard_reference_a", ctypes.c_double * 6),
        ("guard_reference_b", ctypes.c_double * 6),
        ("guard_force_n", ctypes.c_double),
        ("guard_moment_nm", ctypes.c_double),
        ("guard_leg_speed_m_s", ctypes.c_double),
        ("guard_speed_m_s", ctypes.c_double),
        ("guard_rate_rad_s", ctypes.c_double),
        ("guard_point_m", ctypes.c_double * 3),
        ("guard_box_middle_m", ctypes.c_double * 3),
        ("guard_box_attitude", ctypes.c_double * 4),
        ("guard_box_half_m", ctypes.c_double * 3),
        ("guard_box_turn_rad", ctypes.c_double),
        ("reserved", ctypes.c_uint64 * 8),
    ]

    @staticmethod
    def type_name() -> str:
        """Under which iceoryx2 knows it."""
        return "DocktwinRigCommandV3"

    def numbers(self):
        """Every number that must be finite."""
        for name, kind in self._fields_:
            if kind is ctypes.c_double:
                yield getattr(self, name)
            elif issubclass(kind, ctypes.Array) and kind._type_ is ctypes.c_double:
                yield from getattr(self, name)

    def is_in_range(self):
        """Whether no number is beyond any rig, and what is followed as an attitude is one."""
        return (
            all(abs(x) <= LARGEST for x in self.numbers())
            and (self.mode != TRACK or is_attitude(self.plate_attitude))
            and (not self.guard_limits & GUARD_POSE or is_attitude(self.guard_box_attitude))
        )

    def keeps_reserved(self):
        """Whether nothing stands where a later version may have something."""
        return (
            not self.flags & ~KNOWN_FLAGS
            and not self.guard_limits & ~KNOWN_GUARD_LIMITS
            and self.leg_count <= 6
            and self.mechanism_mode <= 3
            and not any(self.reserved)
        )


class RigMeasurement(ctypes.Structure):
    """From the rig to the loop, once a tick."""

    _fields_ = [
        ("protocol_version", ctypes.c_uint32),
        ("status", ctypes.c_uint32),
        ("refusal", ctypes.c_uint32),
        ("capabilities", ctypes.c_uint32),
        ("session", ctypes.c_uint64),
        ("tick", ctypes.c_uint64),
        ("stamp_ns", ctypes.c_uint64),
        ("state_digest", ctypes.c_uint64),
        ("drive", ctypes.c_uint32),
        ("leg_count", ctypes.c_uint32),
        ("latch_count", ctypes.c_uint32),
        ("guard_tripped", ctypes.c_uint32),
        ("leg_length_m", ctypes.c_double * 6),
        ("leg_speed_m_s", ctypes.c_double * 6),
        ("leg_force_n", ctypes.c_double * 6),
        ("valve_spool", ctypes.c_double * 6),
        ("sensor_a", ctypes.c_double * 6),
        ("sensor_b", ctypes.c_double * 6),
        ("plate_acceleration", ctypes.c_double * 6),
        ("plate_position_m", ctypes.c_double * 3),
        ("plate_attitude", ctypes.c_double * 4),
        ("plate_velocity_m_s", ctypes.c_double * 3),
        ("plate_rate_rad_s", ctypes.c_double * 3),
        ("latch_phase", ctypes.c_uint32 * 8),
        ("ring_displacement_m", ctypes.c_double * 3),
        ("ring_rotation_rad", ctypes.c_double * 3),
        ("temperature_c", ctypes.c_double * 8),
        ("truth_position_m", ctypes.c_double * 3),
        ("truth_attitude", ctypes.c_double * 4),
        ("truth_twist", ctypes.c_double * 6),
        ("truth_port3", ctypes.c_double * 6),
        ("truth_port4", ctypes.c_double * 6),
        ("reserved", ctypes.c_uint64 * 8),
    ]

    @staticmethod
    def type_name() -> str:
        """Under which iceoryx2 knows it."""
        return "DocktwinRigMeasurementV3"


class RigEnd:
    """The rig's end: validates every command, keeps the safe state, lets the plant take its ticks.

    A plant has `follow(command)` and `alone(period_ns)`, which take one tick and return a measurement, and
    `legs` and `pose`: how many legs it follows, and whether it follows the plate's pose without them.
    """

    def __init__(self, plant):
        self.plant = plant
        self.session = 0
        self.tick = None
        self.held = None
        self.lockstep = False
        self.safe = False
        self.stopped = False
        self.period_ns = 1_000_000
        self.stamp_ns = 0
        self.moved_ns = 0
        self.ahead = 0
        self.silent = False
        self.refused = {}

    def _refusal(self, c: RigCommand, now_ns: int) -> int:
        if c.protocol_version != VERSION:
            return 1
        if not c.keeps_reserved():
            return 11
        if c.mode > STOP:
            return 6
        if c.mode == TRACK and not self._follows(c.leg_count):
            return 12
        if c.period_ns not in PERIODS_NS:
            return 10
        if c.session == 0:
            return 7
        if c.session == self.session and self.tick is not None and c.tick <= self.tick:
            return 3
        if not all(map(math.isfinite, c.numbers())):
            return 4
        if not c.is_in_range():
            return 13
        if not c.flags & LOCKSTEP and c.wakeup_ns > now_ns:
            return 5
        return 0

    def _follows(self, leg_count):
        if leg_count == 0:
            return self.plant.pose
        return self.plant.legs in (0, leg_count)

    def due_ns(self, lockstep_patience_ns: int) -> float:
        """When the rig takes a tick of its own unless a command comes."""
        if self.safe and (self.silent or not self.lockstep):
            return self.moved_ns + self.period_ns
        led = self.held is not None and self.held.mode in (HOLD, TRACK, RETRACT)
        if not self.safe and not led:
            return math.inf
        if self.lockstep:
            return self.moved_ns + lockstep_patience_ns
        return self.moved_ns + SILENT_PERIODS * self.period_ns

    def command(self, c: RigCommand, now_ns: int) -> RigMeasurement:
        """One command in, one measurement out."""
        real = not c.flags & LOCKSTEP
        if real and not self.lockstep and now_ns > self.due_ns(0):
            self.safe = True
        self.moved_ns, self.silent = now_ns, False
        refusal = self._refusal(c, now_ns)
        if refusal:
            self.safe = True
            self.ahead += 1
            self.refused[refusal] = self.refused.get(refusal, 0) + 1
            m = self.plant.alone(self.period_ns)
            m.status |= REFUSED
            m.refusal = refusal
            return self._fill(m, c.session, c.tick, now_ns if real else self.stamp_ns + self.period_ns)
        fresh = c.session != self.session
        missed = 0 if fresh else c.tick - self.tick - 1
        if c.mode == IDLE:
            self.safe = self.safe and not fresh
            self.stopped = False
        elif fresh:
            self.safe = True
        self.stopped = self.stopped or c.mode == STOP
        owed = max(missed - self.ahead, 0) if real else 0
        self.session, self.tick, self.period_ns = c.session, c.tick, c.period_ns
        self.lockstep, self.ahead = not real, 0
        if self.safe:
            m = self.plant.alone(c.period_ns)
        else:
            for _ in range(min(owed, SILENT_PERIODS)):
                self.plant.follow(self.held)
            self.held = RigCommand.from_buffer_copy(c)
            if self.stopped:
                self.held.mode = STOP
            m = self.plant.follow(self.held)
        return self._fill(m, c.session, c.tick, c.wakeup_ns + c.period_ns)

    def silence(self, now_ns: int) -> RigMeasurement:
        """One period without a command, after the patience with the loop is over."""
        # From then on along a grid, but never behind by more than a period.
        on_grid_ns = self.moved_ns + self.period_ns if self.safe else now_ns
        self.moved_ns = max(min(on_grid_ns, now_ns), now_ns - self.period_ns)
        self.safe, self.silent = True, True
        self.ahead += 1
        m = self.plant.alone(self.period_ns)
        m.status |= UNSOLICITED
        stamp_ns = self.stamp_ns if self.lockstep else now_ns
        return self._fill(m, self.session, self.tick or 0, stamp_ns)

    def _fill(self, m, session, tick, stamp_ns):
        m.protocol_version = VERSION
        m.session, m.tick, m.stamp_ns = session, tick, stamp_ns
        m.capabilities |= (LEG_COMMAND if self.plant.legs else 0) | (POSE_COMMAND if self.plant.pose else 0)
        if self.safe:
            m.status |= SAFE_STATE
        self.stamp_ns = stamp_ns
        return m
