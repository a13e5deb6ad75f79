"""Files and telemetry are read as they are meant."""

from __future__ import annotations

import numpy as np
import pytest

from docktwin_mujoco.models import read_mechanism, rotation_rpy
from docktwin_mujoco.scenario import Telemetry, read_scene
from docktwin_mujoco.scene import rotation

SCENARIO = """schema = 1
[initial]
axial_speed_m_s = 0.1
[run]
duration_s = 1.0
[chaser]
model = "chaser_8t"
[target]
model = "target_12t"
[mechanism]
active = "apas_active"
passive = "apas_passive"
"""


def test_invariant_a_scene_is_found_through_its_scenario(models, tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(SCENARIO)
    scene = read_scene(path, models)
    assert (scene.chaser.mass_kg > 7000, scene.target.mass_kg) == (True, 12000.0)
    path.write_text(SCENARIO.replace('active = "apas_active"', ""))
    with pytest.raises(ValueError, match="mechanism_active"):
        read_scene(path, models)


def test_invariant_a_scenario_replaces_keys_of_the_law_and_takes_petals_off(models, tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(SCENARIO)
    plain = read_scene(path, models).mechanism
    path.write_text(
        SCENARIO + "petals = false\n[mechanism.contact]\ndamping_s_m = 0.25\n"
        "friction_kinetic = 0.0\nfriction_static = 0.0\n"
    )
    changed = read_scene(path, models).mechanism
    assert plain.law.normal.damping_s_m != 0.25 and changed.law.normal.damping_s_m == 0.25
    assert changed.law.normal.stiffness == plain.law.normal.stiffness
    assert plain.law.friction is not None and changed.law.friction is None
    assert plain.active.petals is not None and changed.active.petals is changed.passive.petals is None


def test_invariant_docked_rings_face_each_other(models):
    """Placements of the URDF give R_34 = I and rings face to face, petals interleaved."""
    mech = read_mechanism(models / "apas_active.urdf", models / "apas_passive.urdf")
    length = (mech.p_mount_active_m - mech.p_mount_passive_m)[0] + (
        mech.active.ring_section_radius_m + mech.passive.ring_section_radius_m
    )
    assert length == pytest.approx(0.45)
    assert mech.r_mount_active == pytest.approx(np.eye(3))
    assert mech.r_mount_passive == pytest.approx(np.diag([-1.0, -1.0, 1.0]))
    assert mech.law.normal.stiffness == 1e6


def test_oracle_fixed_axis_angles():
    x, z = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
    assert rotation_rpy([0, 0, np.pi / 2]) @ x == pytest.approx([0, 1, 0])
    # Roll first: z goes to -y, and yaw takes that to x.
    assert rotation_rpy([np.pi / 2, 0, np.pi / 2]) @ z == pytest.approx([1, 0, 0])


@pytest.mark.parametrize("recorded", ["with its ring", "alone"])
def test_invariant_the_recorded_point_of_the_chaser_is_recognised(models, tmp_path, recorded):
    path = tmp_path / "s.toml"
    path.write_text(SCENARIO)
    scene = read_scene(path, models)
    rng = np.random.default_rng(5)
    ring = scene.mechanism.ring_body
    p_ring = scene.chaser.p_body_port_m + scene.mechanism.p_mount_active_m + ring.com_m
    point = p_ring * ring.mass_kg / (ring.mass_kg + scene.chaser.mass_kg)
    if recorded == "alone":
        point = np.zeros(3)
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    r, p, v, w = rotation(q), rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)
    columns = {"time_s": np.array([0.0])}

    def put(body, at):
        rows = {"position": (p + r @ at, "m"), "rate": (w, "rad_s"),
                "velocity": (v + r @ np.cross(w, at), "m_s")}
        for what, (x, unit) in rows.items():
            columns.update({f"{body}_{what}_{a}_{unit}": np.array([x[i]])
                            for i, a in enumerate("xyz")})
        columns.update({f"{body}_attitude_{a}": np.array([q[i]]) for i, a in enumerate("wxyz")})

    put("chaser", point)
    put("ring", p_ring)
    put("target", np.zeros(3))
    tele = Telemetry(columns, scene)
    s = tele.state("chaser", 0)
    assert tele.chaser_point == recorded
    assert s.p == pytest.approx(p, abs=1e-14) and s.v == pytest.approx(v, abs=1e-13)
    columns["ring_position_x_m"] = columns["ring_position_x_m"] + 1e-3
    with pytest.raises(ValueError, match="rigid"):
        Telemetry(columns, scene)
