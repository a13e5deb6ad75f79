"""docktwin as a subprocess: its summary, its columns, and its start for the other engine."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .scenario import Scene, read_scene
from .scene import State, rotation

ROOT = Path(__file__).resolve().parents[3]
MODELS = ROOT / "models" / "urdf"


class Refused(Exception):
    """docktwin did not run: bad input, or the sides overlap at the start."""


@dataclass
class Rehearsal:
    """A run of docktwin."""

    summary: dict
    columns: dict
    scene: Scene


def rehearse(binary, scenario: Path, overrides=(), twin="reduced", out: Path | None = None,
             keep=False, columns=None) -> Rehearsal:
    """Runs a scenario. `columns`: names to read, None for all."""
    import pyarrow.parquet as pq

    command = [str(binary), "rehearse", str(scenario), "--out", str(out), "--twin", twin]
    command += ["--json", "--no-rrd"]
    for item in overrides:
        command += ["--set", item]
    shutil.rmtree(out, ignore_errors=True)
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    # 1 is a run that ended otherwise than expected: the physics is still there to compare.
    if done.returncode not in (0, 1):
        raise Refused(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr}{done.stdout}")
    try:
        summary = json.loads((out / "summary.json").read_text())
        table = pq.read_table(out / "telemetry.parquet", columns=columns)
        found = {n: table.column(n).to_numpy(zero_copy_only=False) for n in table.column_names}
        scene = read_scene(out / "scenario.toml", MODELS)
    finally:
        if not keep:
            shutil.rmtree(out, ignore_errors=True)
    return Rehearsal(summary, found, scene)


def state_names() -> list[str]:
    """Columns that pose and move the three bodies."""
    out = []
    for body in ("chaser", "ring", "target"):
        for what, unit in (("position", "m"), ("velocity", "m_s"), ("rate", "rad_s")):
            out += [f"{body}_{what}_{a}_{unit}" for a in "xyz"]
        out += [f"{body}_attitude_{a}" for a in "wxyz"]
    return out


def states(run: Rehearsal, row: int = 0) -> dict:
    """The three bodies in one row, in the frames of this side: the ring at its centre, and a chaser
    that carries a rigid ring at its own mass centre."""
    col, mech = run.columns, run.scene.mechanism

    def vector(body, what, unit):
        return np.array([col[f"{body}_{what}_{a}_{unit}"][row] for a in "xyz"])

    out = {}
    for body in ("chaser", "ring", "target"):
        q = np.array([col[f"{body}_attitude_{a}"][row] for a in "wxyz"])
        q = q / np.linalg.norm(q)
        s = State(vector(body, "position", "m"), q, vector(body, "velocity", "m_s"),
                  vector(body, "rate", "rad_s"))
        back = np.zeros(3)
        if body == "ring":
            back = mech.ring_body.com_m
        elif body == "chaser" and mech.attenuation is None:
            c = run.scene.chaser
            at = c.p_body_port_m + c.r_body_port @ (
                mech.p_mount_active_m + mech.r_mount_active @ mech.ring_body.com_m
            )
            back = at * mech.ring_body.mass_kg / (mech.ring_body.mass_kg + c.mass_kg)
        r = rotation(q)
        out[body] = State(s.p - r @ back, q, s.v - r @ np.cross(s.w, back), s.w)
    return out
