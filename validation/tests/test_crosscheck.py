"""`docktwin validate crosscheck`: one short docking from end to end."""

from __future__ import annotations

import json
import os
import subprocess
import sys

from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def crossed(binary, tmp_path_factory):
    """Runs it once; gives (exit code, stdout, directory)."""
    out = tmp_path_factory.mktemp("crosscheck") / "out"
    done = subprocess.run(
        [str(binary), "validate", "crosscheck", "scenarios/apas_fast.toml",
         "--set", "run.duration_s=1.0", "--out", str(out), "--python", sys.executable, "--json"],
        capture_output=True, text=True, cwd=ROOT,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    assert done.returncode in (0, 1), done.stderr
    return done.returncode, done.stdout, out


def test_oracle_crosscheck_of_a_docking(crossed, figure):
    code, said, out = crossed
    found = json.loads(said)
    figure(f"pose {1e3 * found['position_m']:.4f} mm, {np.degrees(found['angle_rad']):.5f} degrees, "
           f"peak off by {100 * found['peak_force_difference']:.3f} % (limits 1 mm, 0.1 degrees, 5 %)")
    assert code == 0 and found["within"] and found["aligned"]
    assert found["until"] == "first latch" and found["ticks_judged"] > 500
    assert found["position_m"] <= 1e-3 and found["angle_rad"] <= np.radians(0.1)
    assert found["peak_force_difference"] <= 0.05
    # Two engines, not one compared with itself.
    assert found["position_m"] > 0.0 and found["peak_force_difference"] > 0.0
    rows = {r["what"]: r for r in found["rows"]}
    assert rows["latch order"]["docktwin"] == rows["latch order"]["mujoco"] == "1 2 3"
    assert json.loads((out / "comparison.json").read_text()) == found
    for name in ("relative_position", "relative_attitude", "position_difference",
                 "attitude_difference", "port_force"):
        assert (out / f"{name}.svg").read_text().startswith("<svg")
    assert (out / "crosscheck.rrd").stat().st_size > 10_000


def test_invariant_the_second_run_is_a_run_like_any_other(crossed, binary):
    _, _, out = crossed
    ours, theirs = str(out / "docktwin"), str(out / "mujoco")

    def docktwin(*words):
        return subprocess.run([str(binary), *words], capture_output=True, text=True, cwd=ROOT)

    same = ["--tol", "m=1e-3", "--tol", "rad=2e-3", "--tol", "m_s=0.05", "--tol", "rad_s=0.5"]
    done = docktwin("diff", ours, theirs, "--align", "first-contact", "--json", *same)
    assert done.returncode in (0, 1), done.stderr
    found = json.loads(done.stdout)
    known = {c["column"]: c for c in found["columns"]}
    assert known["relative_position_x_m"]["worst"] < 1e-3
    assert known["ring_attitude_w"]["worst"] < 1e-3
    # What MuJoCo does not know is not there, rather than made up.
    assert "energy_kinetic_j" in found["only"][0] and not found["only"][1]
    latch = known["latch_1_force_x_n"]
    assert latch["peak"] > 100.0 and latch["rms"] < 0.05 * latch["peak"]
    # Places of contact carry the force that acts.
    done = docktwin("export", theirs, "--format", "csv", "--contacts", "--out", str(out / "t.csv"))
    assert done.returncode == 0, done.stderr
    assert docktwin("report", theirs).returncode == 0
    assert docktwin("replay", theirs).returncode == 2
