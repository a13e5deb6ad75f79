"""A rig in Python, written from docs/rig-protocol.md: an ideal plate with a spring stick between two stops.

The plate is where it is sent at the end of every tick, so G_I = 1, and the test of Table 4 can run on it:
row 3 with what is set by default. Lockstep repeats bit by bit. Python gives no guarantee of real time:
answers may come milliseconds late now and then, when it collects garbage or another process runs.

    python validation/rig/rig.py NAME
    python validation/rig/rig.py NAME --axis y --stiffness 94400 --free-play 0.010
"""

from __future__ import annotations

import argparse
import hashlib
import random
import signal
import sys
import time
from pathlib import Path

import iceoryx2 as iox2
import numpy as np

from geometry import RigFile, rotation
from protocol import (
    ACCELEROMETER,
    ENABLED,
    HOLD,
    IDLE,
    LEG_FORCE,
    LEG_LENGTH,
    LEG_SPEED,
    RETRACT,
    SENSOR_A,
    SENSOR_B,
    STOP,
    TRACK,
    TRUTH,
    RigCommand,
    RigEnd,
    RigMeasurement,
)

RETRACT_M_S = 0.01
# From the middle: in the play of its stick nothing touches.
RETRACT_M = 0.008
MODELS = Path(__file__).resolve().parents[2] / "models/urdf"


class Plate:
    """An ideal motion simulator: massless, without delay or error.

    It takes commands with the values of six legs and without. Its sensors stand in `e3` (A) and `e4` (B).
    They measure the contact, and, unless `bare`, weight and inertia of what they carry and a little noise,
    as sensors of steel do.
    """

    legs, pose = 6, True

    def __init__(self, rig: RigFile, axis, stiffness_n_m, free_play_m, bare=False):
        self.rig = rig
        self.axis = np.eye(3)["xyz".index(axis)]
        self.stiffness_n_m = stiffness_n_m
        self.free_play_m = free_play_m
        self.bare = bare
        self.reset()

    def reset(self):
        """Back to where it began."""
        self.p, self.q = self.rig.plate_in_the_middle()
        self.v, self.w = np.zeros(3), np.zeros(3)
        self.acceleration = np.zeros(3)
        self.leg_force_n = np.zeros(6)
        self.noise = random.Random(1)

    def follow(self, c: RigCommand) -> RigMeasurement:
        """One tick with a command."""
        dt = c.period_ns * 1e-9
        if c.mode == IDLE:
            self.reset()
        elif c.mode == TRACK:
            v = np.array(c.plate_velocity_m_s)
            self.acceleration = (v - self.v) / dt
            self.p, self.q = np.array(c.plate_position_m), np.array(c.plate_attitude)
            self.v, self.w = v, np.array(c.plate_rate_rad_s)
            self.leg_force_n = np.array(c.leg_force_n)
        elif c.mode == RETRACT:
            self._rest()
            p_34, _ = self.rig.docking(self.p, self.q)
            if p_34[0] <= self.rig.middle_p_34[0] + RETRACT_M:
                self.v = rotation(self.rig.q_b3)[:, 0] * RETRACT_M_S
                self.p = self.p + self.v * dt
        elif c.mode in (HOLD, STOP):
            self._rest()
        return self._measure(0 if c.mode == IDLE else ENABLED)

    def alone(self, _period_ns) -> RigMeasurement:
        """One tick without a command that is to be followed."""
        self._rest()
        return self._measure(ENABLED)

    def _rest(self):
        self.v, self.w, self.acceleration = np.zeros(3), np.zeros(3), np.zeros(3)

    def contact(self):
        """Force on what the plate carries and lever of its point from the origin of `e3`, in `e3`."""
        p_34, _ = self.rig.docking(self.p, self.q)
        x = float((p_34 - self.rig.middle_p_34) @ self.axis)
        depth_m = max(abs(x) - self.free_play_m, 0.0)
        return self.axis * (-np.sign(x) * self.stiffness_n_m * depth_m), p_34

    def _measure(self, status) -> RigMeasurement:
        force_3, arm_3 = self.contact()
        _, q_34 = self.rig.docking(self.p, self.q)
        port_3 = np.concatenate([-force_3, np.cross(arm_3, -force_3)])
        port_4 = np.concatenate([rotation(q_34).T @ force_3, np.zeros(3)])
        m = RigMeasurement(status=status, leg_count=6)
        m.capabilities = LEG_LENGTH | LEG_SPEED | LEG_FORCE | SENSOR_A | SENSOR_B | TRUTH
        lengths, speeds = self.rig.legs(self.p, self.q, self.v, self.w)
        m.leg_length_m[:], m.leg_speed_m_s[:] = lengths, speeds
        m.leg_force_n[:] = self.leg_force_n
        m.truth_position_m[:], m.truth_attitude[:] = self.p, self.q
        m.truth_twist[:] = np.concatenate([self.v, self.w])
        m.truth_port3[:], m.truth_port4[:] = port_3, port_4
        a, b = port_3, port_4
        if not self.bare:
            a = a + self.rig.weight_a() + self._noise()
            b = b + self.rig.weight_b(self.q, self.acceleration) + self._noise()
            force = self.rig.specific_force_at_b(self.q, self.acceleration)
            m.plate_acceleration[:3] = [x + self.noise.gauss(0.0, 7e-4) for x in force]
            m.capabilities |= ACCELEROMETER
        m.sensor_a[:], m.sensor_b[:] = a, b
        # Of the state alone: what stands in front of the legs is filled in later.
        state = bytes(m)[RigMeasurement.leg_length_m.offset :]
        digest = hashlib.blake2b(state, digest_size=8).digest()
        m.state_digest = int.from_bytes(digest, "little")
        return m

    def _noise(self):
        return np.array([self.noise.gauss(0.0, s) for s in (0.3, 0.3, 0.3, 0.15, 0.15, 0.15)])


class Port:
    """Both services of a rig over iceoryx2, with the settings of the page."""

    def __init__(self, name):
        iox2.set_log_level(iox2.LogLevel.Fatal)
        self.node = iox2.NodeBuilder.new().create(iox2.ServiceType.Ipc)
        self.node.blocking_cleanup_dead_nodes(iox2.Duration.from_secs(1))
        self.commands, command_bell = self._open(f"docktwin/{name}/command", RigCommand)
        self.measurements, measurement_bell = self._open(
            f"docktwin/{name}/measurement", RigMeasurement
        )
        self.publisher = self.measurements.publisher_builder().max_loaned_samples(1).create()
        self.notifier = measurement_bell.notifier_builder().create()
        self.listener = command_bell.listener_builder().create()
        self.subscriber = self.commands.subscriber_builder().buffer_size(64).create()

    def _open(self, service, payload):
        name = iox2.ServiceName.new(service)
        data = (
            self.node.service_builder(name)
            .publish_subscribe(payload)
            .history_size(1)
            .subscriber_max_buffer_size(64)
            .subscriber_max_borrowed_samples(2)
            .max_publishers(1)
            .max_subscribers(4)
            .max_nodes(8)
            .enable_safe_overflow(True)
            .open_or_create()
        )
        bell = (
            self.node.service_builder(name)
            .event()
            .max_notifiers(4)
            .max_listeners(4)
            .max_nodes(8)
            .open_or_create()
        )
        return data, bell

    def receive(self):
        """A copy of the next command, or nothing."""
        sample = self.subscriber.receive()
        return None if sample is None else RigCommand.from_buffer_copy(sample.payload().contents)

    def send(self, measurement):
        """Sends, and wakes the loop."""
        self.publisher.send_copy(measurement)
        self.notifier.notify()

    def wait(self, seconds):
        """Until a command may be there; the kernel rounds short waits on sockets up."""
        try:
            if seconds > 0.009:
                self.listener.timed_wait(iox2.Duration.from_secs_f64(seconds - 0.008))
            else:
                self.listener.try_wait()
                time.sleep(min(seconds, 50e-6))
        except iox2.ListenerWaitError:
            # A signal; whoever waits looks whether to go on.
            time.sleep(50e-6)


def serve(port, end, lockstep_patience_s, stop):
    """Answers until `stop()`."""
    patience_ns = int(lockstep_patience_s * 1e9)
    while not stop():
        command = port.receive()
        now_ns = time.clock_gettime_ns(time.CLOCK_MONOTONIC)
        if command is not None:
            port.send(end.command(command, now_ns))
        elif now_ns >= end.due_ns(patience_ns):
            port.send(end.silence(now_ns))
        else:
            port.wait(min((end.due_ns(patience_ns) - now_ns) * 1e-9, 0.05))


def arguments():
    """As on the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("name", help="of the rig, as in --rig ipc:NAME")
    parser.add_argument("--rig", type=Path, default=MODELS / "stewart.urdf", help="rig file")
    parser.add_argument("--axis", choices="xyz", default="x", help="of the stops, in e3")
    parser.add_argument("--stiffness", type=float, default=35.4e3, help="of a stop, N/m")
    parser.add_argument("--free-play", type=float, default=0.010, help="to each side, m")
    parser.add_argument("--bare", action="store_true", help="sensors without weight and noise")
    parser.add_argument("--lockstep-patience", type=float, default=1.0, help="s")
    return parser.parse_args()


def main():
    """Serves until it is told to end."""
    args = arguments()
    plate = Plate(RigFile(args.rig), args.axis, args.stiffness, args.free_play, args.bare)
    end = RigEnd(plate)
    stopped = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.append(True))
    serve(Port(args.name), end, args.lockstep_patience, lambda: bool(stopped))
    if end.refused:
        print("refused commands by reason:", end.refused, file=sys.stderr)


if __name__ == "__main__":
    main()
