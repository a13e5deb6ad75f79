"""Table 4 on a rig with position loops, along one axis: bodies, drive, stick and sensor as one system of delay
differential equations, written from the equations and the rig's file alone.

    m_r x'' = f            bodies, driven by what the sensor says
    y       = drive(x_c)   second (or first) order behind a transport delay; x_c = x + lead x'
    F       = -K dz(y)     stick of stiffness K with play to both sides
    f       = sensor(F)    second order behind a delay

A command is for the instant one tick after it is sent, so the drive is late by its delay less a tick. Time is
continuous here; the loop of docktwin samples at 1 kHz.
"""

import tomllib
from dataclasses import dataclass
from math import pi, sqrt, tau

TICK_S = 1e-3
STEP_S = 1e-4
#: Rows of Table 4: stiffness N/m, mass of each body kg, approach speed m/s.
ROWS = [
    (35.4e3, 32423.0, 0.0089),
    (35.4e3, 8106.0, 0.0178),
    (35.4e3, 2026.0, 0.0355),
    (94.4e3, 1597.0, 0.038),
    (94.4e3, 898.0, 0.051),
    (94.4e3, 575.0, 0.063),
]
PLAY_M = 0.010


@dataclass(frozen=True)
class Lag:
    """Second order behind a delay; without a damping ratio first order."""

    hz: float
    damping: float | None
    delay_s: float

    @property
    def slow_s(self):
        """How late a slow signal is."""
        return self.delay_s + (1.0 if self.damping is None else 2.0 * self.damping) / (tau * self.hz)

    def rates(self, value, rate, wanted):
        w = tau * self.hz
        if self.damping is None:
            return w * (wanted - value), 0.0
        return rate, w * w * (wanted - value) - 2.0 * self.damping * w * rate


@dataclass(frozen=True)
class Rig:
    drive: Lag
    sensor: Lag

    @classmethod
    def of_file(cls, path):
        """Drive and sensor A of a rig's TOML with `drive.kind = "position_loop"`."""
        with open(path, "rb") as f:
            file = tomllib.load(f)
        number = lambda table, key: float(table[key]["value"])
        d, s = file["drive"], file["sensors"]["force"]
        damping = number(d, "damping_ratio") if d["order"]["value"] == 2 else None
        drive = Lag(number(d, "natural_frequency_hz"), damping, number(d, "delay_s") - TICK_S)
        sensor = Lag(number(s, "natural_frequency_hz"), number(s, "damping_ratio"), number(s, "delay_s"))
        return cls(drive, sensor)

    @property
    def lead_s(self):
        """The lead that undoes the rig where it is slow."""
        return self.drive.slow_s + self.sensor.slow_s


def _hermite(track, t):
    """Value of a track of (value, rate), a row a step, at a time that lies within it or before it."""
    if t <= 0.0:
        value, rate = track[0]
        return value + rate * t, rate
    at = min(t / STEP_S, len(track) - 1.000001)
    i = int(at)
    u = at - i
    (a, da), (b, db) = track[i], track[i + 1]
    h = STEP_S
    value = (
        a * (1 + 2 * u) * (1 - u) ** 2 + da * h * u * (1 - u) ** 2
        + b * u * u * (3 - 2 * u) + db * h * u * u * (u - 1)
    )
    rate = 6 * u * (1 - u) * (b - a) / h + da * (1 - u) * (1 - 3 * u) + db * u * (3 * u - 2)
    return value, rate


@dataclass(frozen=True)
class Contact:
    r_e: float
    r_t: float
    peak: float


def first_contact(rig, row, lead_s):
    """R_e, R_T and peak force over that of the simulated system, of the first contact of a row (1 to 6)."""
    stiffness, mass, speed = ROWS[row - 1]
    m_r = 0.5 * mass
    drive, sensor = rig.drive, rig.sensor

    def force(y):
        return -stiffness * (y - min(max(y, -PLAY_M), PLAY_M))

    # Long in flight: everything follows at the speed of approach, the plate by its lag behind.
    late = drive.slow_s - lead_s
    begin = -0.8 * PLAY_M
    s = [begin, speed, begin - late * speed, speed, 0.0, 0.0]
    bodies, plate = [(s[0], s[1])], [(s[2], s[3])]
    forces = [0.0]

    def slopes(t, s):
        x, v, y, vy, f, vf = s
        x_c, v_c = _hermite(bodies, t - drive.delay_s) if drive.delay_s > 0.0 else (x, v)
        # First order has its speed by its law.
        dy, dvy = drive.rates(y, vy, x_c + lead_s * v_c)
        felt = force(_hermite(plate, t - sensor.delay_s)[0]) if sensor.delay_s > 0.0 else force(y)
        df, dvf = sensor.rates(f, vf, felt)
        return [v, f / m_r, dy, dvy, df, dvf]

    contact_s = pi * sqrt(m_r / stiffness)
    n = 0
    touched = left = None
    while True:
        t, h = n * STEP_S, STEP_S
        k1 = slopes(t, s)
        k2 = slopes(t + h / 2, [a + h / 2 * b for a, b in zip(s, k1)])
        k3 = slopes(t + h / 2, [a + h / 2 * b for a, b in zip(s, k2)])
        k4 = slopes(t + h, [a + h * b for a, b in zip(s, k3)])
        s = [a + h / 6 * (p + 2 * q + 2 * r + w) for a, p, q, r, w in zip(s, k1, k2, k3, k4)]
        n += 1
        bodies.append((s[0], s[1]))
        plate.append((s[2], s[3] if drive.damping is not None else k4[2]))
        forces.append(force(s[2]))
        if touched is None and forces[-1] < 0.0:
            touched = n
        if touched is not None and left is None and forces[-1] == 0.0:
            left = n
        # The sensor has settled long since.
        if left is not None and n > left + 300:
            break
        if n * STEP_S > 20.0:
            raise RuntimeError("no whole contact")

    def crossing(i):
        """When the plate reaches the stop between two steps."""
        a, b = plate[i - 1][0] - PLAY_M, plate[i][0] - PLAY_M
        return (i - 1 + a / (a - b)) * STEP_S

    held = crossing(left) - crossing(touched)
    want = speed * sqrt(stiffness * m_r)
    return Contact(abs(s[1]) / speed, held / contact_s, max(-f for f in forces) / want)


if __name__ == "__main__":
    import sys

    rig = Rig.of_file(sys.argv[1] if len(sys.argv) > 1 else "models/urdf/electric_hexapod.toml")
    print(f"late by {rig.drive.slow_s * 1e3:.3f} ms and {rig.sensor.slow_s * 1e3:.3f} ms")
    for lead in (0.0, rig.lead_s):
        for row in range(1, 7):
            c = first_contact(rig, row, lead)
            print(f"lead {lead * 1e3:7.3f} ms row {row}: R_e {c.r_e:.5f} R_T {c.r_t:.5f} peak {c.peak:.5f}")
