"""A rig on position loops, without oil: Table 4 against a single-axis simulation of its own, and the same rig known
by its measured response alone."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "validation" / "rig"))

from single_axis import ROWS, Lag, Rig, first_contact  # noqa: E402

HEXAPOD = "electric_hexapod"
# What is promised of R_e, R_T and the peak force, and of a rig made from a measurement.
AGAINST_OWN, AGAINST_MEASURED = 5e-3, 3e-3


@pytest.fixture(scope="module")
def table4(binary, tmp_path_factory):
    """First contacts of rows 1 to 6 along an axis: (R_e, R_T, peak), and the lead, s."""

    def run(rig: str, axis: str, *options: str):
        out = tmp_path_factory.mktemp("table4")
        command = [str(binary), "validate", "vibro-impact", "--json", "--axis", axis]
        command += ["--model", f"models/urdf/{rig}.toml", "--out", str(out), *options]
        done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)
        rows = [t["contacts"][0] for t in found["tests"]]
        assert len(rows) == len(ROWS)
        return [(c["R_e"], c["R_T"], c["peak_force_ratio"]) for c in rows], found["lead_s"]

    return run


@pytest.fixture(scope="module")
def identified(binary, tmp_path_factory):
    """File of `rig identify` of the hexapod along X, and its drive as a table."""
    out = tmp_path_factory.mktemp("identified")
    file, drive = out / "found.toml", out / "drive.toml"
    command = [str(binary), "rig", "identify", "--rig", "emulated", "--dof", "x", "--json"]
    command += ["--model", f"models/urdf/{HEXAPOD}.toml", "--out", str(file), "--drive", str(drive)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return file, drive, json.loads(done.stdout)["found"]


def worst(got, want):
    return max(abs(a / b - 1.0) for x, y in zip(got, want) for a, b in zip(x, y))


@pytest.mark.parametrize("axis", ["x", "y"])
def test_oracle_table_4_is_that_of_a_single_axis(table4, models, figure, identified, axis):
    rig = Rig.of_file(models / f"{HEXAPOD}.toml")
    leads = {"none": ("--compensator", "none"), "identified": ("--identification", str(identified[0]))}
    for name, options in leads.items():
        got, lead_s = table4(HEXAPOD, axis, *options)
        own = [first_contact(rig, row, lead_s) for row in range(1, 7)]
        off = worst(got, [(c.r_e, c.r_t, c.peak) for c in own])
        figure(f"{axis}, lead {name} {lead_s * 1e3:.2f} ms: {off:.2e} of R_e, R_T, peak, limit {AGAINST_OWN}")
        assert off < AGAINST_OWN


def test_oracle_delay_and_gains_are_those_of_the_file(models, figure, identified):
    found = identified[2]
    drive = Rig.of_file(models / f"{HEXAPOD}.toml").drive
    late_ms = (found["delay_s"] - drive.slow_s) * 1e3
    figure(f"delay {late_ms:+.4f} ms off, limit 0.1")
    assert abs(late_ms) < 0.1
    off = 0.0
    for point in found["response"]:
        x = point["frequency_hz"] / drive.hz
        gain = 1.0 / abs(complex(1.0 - x * x, 2.0 * drive.damping * x))
        off = max(off, abs(point["gain"] / gain - 1.0))
    figure(f"gains {off:.2e} off, limit 1e-3")
    assert off < 1e-3


@pytest.mark.parametrize("lead", ["none", "lead"])
def test_oracle_a_measured_rig_is_the_rig(table4, figure, lead):
    options = ("--compensator", lead, "--lead-ms", "22.46")
    got, want = (table4(f"{HEXAPOD}{kind}", "x", *options)[0] for kind in ("_measured", ""))
    off = worst([c[:2] for c in got], [c[:2] for c in want])
    figure(f"{lead}: {off:.2e} of R_e and R_T, limit {AGAINST_MEASURED}")
    assert off < AGAINST_MEASURED


def test_oracle_what_rig_identify_writes_is_what_is_shipped(models, identified):
    """The table that `--drive` writes is read as the shipped one, but for noise."""
    import tomllib

    with open(identified[1], "rb") as f:
        new = tomllib.load(f)["drive"]
    with open(models / f"{HEXAPOD}_measured.toml", "rb") as f:
        shipped = tomllib.load(f)["drive"]
    assert new["kind"] == shipped["kind"] == "measured"
    rows = shipped["response_hz_1_deg"]["value"]
    for (hz, gain, deg), want in zip(new["response_hz_1_deg"]["value"], rows):
        assert hz == want[0] and abs(gain / want[1] - 1) < 1e-4 and abs(deg - want[2]) < 0.02


def test_oracle_the_own_simulation_gains_nothing_without_a_lag():
    """A rig without lag leaves a stick that loses nothing."""
    fast = Rig(Lag(3e3, 0.7, 0.0), Lag(3e3, 0.7, 0.0))
    c = first_contact(fast, 3, fast.lead_s)
    assert abs(c.r_e - 1.0) < 1e-4 and abs(c.r_t - 1.0) < 1e-3 and abs(c.peak - 1.0) < 1e-3
