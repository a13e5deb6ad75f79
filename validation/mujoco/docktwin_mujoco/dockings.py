"""Comparison of one whole docking with docktwin's recording of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import kernel as k
from .docking import FullDocking, Run
from .peer import ROOT, rehearse, states
from .scenario import Scene
from .vec import matrix

# A colon names another attenuation than the scenario's. Short ones first.
SCENARIOS = (
    "apas_miss", "apas_rebound", "apas_nominal", "apas_nominal:differential", "light_chaser", "apas_fast",
    "apas75_paper_corner", "apas_corner_d", "apas_corner_a", "apas_corner_b", "apas_corner_c",
    "apas_corner_a:differential", "thrust_assist", "heavy_pair",
)
HEADER = (
    "| scenario | outcome, both | capture, s | latches | peak force, N | peak off | impulse off "
    "| relative pose until the first latch, mm and ° | to the end, mm |",
    "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
)


@dataclass
class Comparison:
    """Both runs and how far they are apart."""

    scene: Scene
    summary: dict
    mujoco: Run
    latches: list
    """docktwin's, in the order they caught."""
    until: str
    """What ended the time over which poses are compared: the first latch or the last contact."""
    pose_m: float
    angle_rad: float
    whole_m: float
    peak: float
    impulse: float


def _relative(p1, q1, p2, q2, port_1, port_2):
    """Port 2 in port 1, for every row: positions and rotation matrices."""
    out_p, out_r = [], []
    for a, qa, b, qb in zip(p1, q1, p2, q2):
        ra, rb = np.array(matrix(*qa)), np.array(matrix(*qb))
        r3, r4 = ra @ port_1[0], rb @ port_2[0]
        out_p.append(r3.T @ (b + rb @ port_2[1] - a - ra @ port_1[1]))
        out_r.append(r3.T @ r4)
    return np.array(out_p), np.array(out_r)


def compare(binary, name: str, how: str, out: Path, step_s: float = 2e-4, overrides=(),
            engine=FullDocking) -> Comparison:
    """Runs `name`, with attenuation `how` if given, in both engines. `engine` makes the docking of a
    scene and a step."""
    sets = list(overrides) + ([f'mechanism.attenuation="{how}"'] if how else [])
    run = rehearse(binary, ROOT / "scenarios" / f"{name}.toml", sets, out=out)
    col, scene = run.columns, run.scene
    last = len(col["time_s"]) - 1
    dock = engine(scene, step_s)
    # As long as docktwin's run, so that a limit passed there is looked for here too.
    got = dock.run(states(run), float(scene.run["duration_s"]), float(col["time_s"][0]))
    caught = sorted(
        (int(np.argmax(col[f"latch_{i}_phase"] == 3)), i) for i in (1, 2, 3)
        if (col[f"latch_{i}_phase"] == 3).any()
    )
    rows = got.rows
    n = min(last + 1, len(rows))
    if caught:
        upto, until = min(caught[0][0], n), "first latch"
    else:
        touched = np.flatnonzero(col["contact_depth_m"][:n] > 0.0)
        upto, until = (int(touched[-1]) + 1 if len(touched) else n), "last contact"

    def cols(body, what, unit=None):
        names = [f"{body}_{what}_{a}" + (f"_{unit}" if unit else "") for a in
                 ("xyz" if unit else "wxyz")]
        return np.stack([col[x][:n] for x in names], 1)

    c, t = scene.chaser, scene.target
    ports = (c.r_body_port, c.p_body_port_m), (t.r_body_port, t.p_body_port_m)
    pick = np.unique(np.r_[np.arange(0, n, 5), upto - 1])
    pa, ra = _relative(
        cols("chaser", "position", "m")[pick], cols("chaser", "attitude")[pick],
        cols("target", "position", "m")[pick], cols("target", "attitude")[pick], *ports,
    )
    b = k.BODIES
    pb, rb = _relative(
        rows[pick, b : b + 3], rows[pick, b + 3 : b + 7], rows[pick, b + 26 : b + 29],
        rows[pick, b + 29 : b + 33], *ports,
    )
    apart = np.linalg.norm(pa - pb, axis=1)
    # Of the relative rotation's skew part: exact for small angles.
    d = np.einsum("nij,nkj->nik", ra, rb)
    angle = 0.5 * np.linalg.norm(
        np.stack([d[:, 2, 1] - d[:, 1, 2], d[:, 0, 2] - d[:, 2, 0], d[:, 1, 0] - d[:, 0, 1]], 1),
        axis=1,
    )
    early = pick < upto
    s = run.summary
    # Finer than the recorded ticks, within one of which two latches may catch.
    order = sorted((t, i) for i, t in enumerate(s["latches_s"], 1) if t is not None)
    return Comparison(
        scene, s, got, [i for _, i in order], until, float(apart[early].max()),
        float(angle[early].max()), float(apart.max()),
        abs(got.peak_force_n / s["peak_force_n"] - 1.0) if s["peak_force_n"] else 0.0,
        abs(got.impulse_ns / s["impulse_ns"] - 1.0) if s["impulse_ns"] else 0.0,
    )


def line(name: str, f: Comparison) -> str:
    """A row of the table."""
    a, b = f.summary, f.mujoco

    def two(x, y, form):
        x, y = (form.format(v) if v is not None else "–" for v in (x, y))
        return x if x == y else f"{x}; {y}"

    order = lambda x: "".join(map(str, x)) or "–"  # noqa: E731
    return (
        f"| {name} | {two(a['outcome'], b.outcome, '{}')} "
        f"| {two(a['capture_s'], b.captured_s, '{:.3f}')} "
        f"| {two(order(f.latches), order(b.latch_order), '{}')} "
        f"| {two(a['peak_force_n'], b.peak_force_n, '{:.1f}')} | {100 * f.peak:.3f} % "
        f"| {100 * f.impulse:.3f} % | {1e3 * f.pose_m:.4f}, {np.degrees(f.angle_rad):.5f} "
        f"({f.until}) | {1e3 * f.whole_m:.3f} |"
    )
