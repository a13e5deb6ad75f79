"""Speed against MuJoCo on the same model and scenario, at stated accuracy.

    cargo build --release -p docktwin -p docktwin-peers
    target/venv-validation/bin/python benches/peers/peers.py [--repeats 5] [--whole]

Contenders take turns in one run, so that a busy machine disturbs all alike; cost is processor time of
the stepping thread. Scenario `apas_nominal`: `free` is the approach (0 to 0.70 s), `contact` from there
to 1.30 s (before the first latch), `whole` the 30 s with latches, joined rings and attenuation.

Accuracy of a row is the largest difference of the relative pose over `contact` from the same contender
at the finest step here: what its own integration, contact solution and step cost in truth. Model errors
(another contact law, facets) do not count against anybody. A ratio compares with docktwin's cheapest
row that is at least as accurate.

Contenders: docktwin's reduced and full twin; MuJoCo's RK4 with docktwin's law compiled into its
callback; MuJoCo with its own collision detection and contact solver (capsules and convex strips, spring
by `solref`), the attenuator compiled into the callback as before. Our callback and its activation states
cost MuJoCo time that its own elements might not; the rows `bare` are therefore a floor: three bodies,
shapes and solver, nothing else, put back on the recorded docking every 10 ms. They have no attenuator and
so no accuracy; their ratio is at the same step.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "validation" / "mujoco"))
os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / "target" / "numba"))

from docktwin_mujoco import docking, kernel as k, own_solver  # noqa: E402
from docktwin_mujoco.peer import rehearse, states  # noqa: E402
from docktwin_mujoco.scene import angle_between, get_state, rotation, set_state  # noqa: E402

SCENARIO = ROOT / "scenarios" / "apas_nominal.toml"
SAMPLE_S = 0.01
FREE_S, CONTACT_S = 0.70, 1.30
# Effective mass at a touch of the ring, kg: sets the stiffness of MuJoCo's own solver.
MASS_KG = 20.0
CAPSULES, STRIPS = 48, 8


@dataclass
class Result:
    """One run: processor time per simulated millisecond in each phase, us, and relative poses."""

    cost_us: dict
    poses: np.ndarray
    capture_s: float | None


def docktwin(binary, twin: str, step_ms: float, whole: bool) -> Result:
    """docktwin's half."""
    def run(until):
        command = [str(binary), "docking", str(SCENARIO), "--twin", twin, "--step-ms", repr(step_ms)]
        command += ["--sample-s", repr(SAMPLE_S), "--until-s", repr(until)]
        return json.loads(subprocess.run(command, capture_output=True, check=True).stdout)

    free, upto = run(FREE_S), run(CONTACT_S + SAMPLE_S)
    spent = [r["phases"]["whole"]["cpu_s"] for r in (free, upto)]
    cost = {
        "free": spent[0] / FREE_S * 1e3,
        "contact": (spent[1] - spent[0]) / (CONTACT_S + SAMPLE_S - FREE_S) * 1e3,
    }
    capture = None
    if whole:
        all_of_it = run(30.0)
        cost["whole"] = all_of_it["phases"]["whole"]["cpu_s"] / 30.0 * 1e3
        capture = all_of_it["capture_s"]
    p = np.array(upto["poses"])
    # x, y, z, w becomes w, x, y, z.
    return Result(cost, p[:, [0, 1, 2, 6, 3, 4, 5]], capture)


def relative(scene, model, data) -> np.ndarray:
    """Pose of `e4` in `e3`: m, then w, x, y, z."""
    a, b = get_state(model, data, "chaser"), get_state(model, data, "target")
    ra, rb = rotation(a.q), rotation(b.q)
    r3 = ra @ scene.chaser.r_body_port
    p = r3.T @ (b.p + rb @ scene.target.p_body_port_m - a.p - ra @ scene.chaser.p_body_port_m)
    q = np.empty(4)
    mujoco.mju_mat2Quat(q, (r3.T @ rb @ scene.target.r_body_port).ravel())
    return np.concatenate([p, q])


def mujoco_run(start, scene, how: str, step_ms: float, whole: bool) -> Result:
    """MuJoCo's half; all steps between two samples in one call of C."""
    step = step_ms * 1e-3
    model = None
    if how != "law":
        k_m = scene.mechanism.law.normal.stiffness / MASS_KG
        model = own_solver.model(scene, step, CAPSULES, STRIPS, k_m, how, 0.1)
    dock = docking.FullDocking(scene, step, model=model)
    if how != "law":
        dock.P[k.CONTACT_OFF], dock.P[k.EVERY] = 1.0, 1e9
    until = 30.0 if whole else CONTACT_S + SAMPLE_S
    dock.start(start, rows=round(until / 1e-3) + 2)
    steps, spent, poses = round(SAMPLE_S / step), {"free": 0.0, "contact": 0.0, "whole": 0.0}, []
    mujoco.set_mjcb_passive(dock.callback)
    for i in range(round(until / SAMPLE_S)):
        t = i * SAMPLE_S
        if t < CONTACT_S + 1.5 * SAMPLE_S:
            poses.append(relative(scene, dock.model, dock.data))
        dock.S[k.STAGE] = 4.0 * round(dock.S[k.STAGE] / 4.0)
        begin = time.process_time()
        mujoco.mj_step(dock.model, dock.data, nstep=steps)
        used = time.process_time() - begin
        spent["whole"] += used
        if t < CONTACT_S + 0.5 * SAMPLE_S:
            spent["free" if t < FREE_S - 0.5 * SAMPLE_S else "contact"] += used
    mujoco.set_mjcb_passive(None)
    length = {"free": FREE_S, "contact": CONTACT_S + SAMPLE_S - FREE_S, "whole": until}
    cost = {p: 1e3 * s / length[p] for p, s in spent.items() if p != "whole" or whole}
    capture = float(dock.S[k.CAPTURED]) if how == "law" and whole else None
    return Result(cost, np.array(poses), capture)


def bare(run, integrator: str, step_ms: float) -> Result:
    """The least that MuJoCo needs for these bodies, shapes and contacts."""
    step, scene = step_ms * 1e-3, run.scene
    k_m = scene.mechanism.law.normal.stiffness / MASS_KG
    model = own_solver.model(scene, step, CAPSULES, STRIPS, k_m, integrator, 0.1, states=False)
    data = mujoco.MjData(model)
    steps, spent = round(SAMPLE_S / step), {"free": 0.0, "contact": 0.0}
    for i in range(round((CONTACT_S + SAMPLE_S) / SAMPLE_S)):
        for name, state in states(run, round(i * SAMPLE_S / 1e-3)).items():
            set_state(model, data, name, state)
        begin = time.process_time()
        mujoco.mj_step(model, data, nstep=steps)
        used = time.process_time() - begin
        spent["free" if i * SAMPLE_S < FREE_S - 0.5 * SAMPLE_S else "contact"] += used
    length = {"free": FREE_S, "contact": CONTACT_S + SAMPLE_S - FREE_S}
    return Result({p: 1e3 * s / length[p] for p, s in spent.items()}, np.empty((0, 7)), None)


def error(got: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    """Largest difference of two series of poses, mm and degrees."""
    n = min(len(got), len(truth))
    d = np.linalg.norm(got[:n, :3] - truth[:n, :3], axis=1).max()
    a = max(angle_between(x[3:], y[3:]) for x, y in zip(got[:n], truth[:n]))
    return 1e3 * d, float(np.degrees(a))


def main() -> None:
    """Measures and writes the table."""
    args = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    args.add_argument("--repeats", type=int, default=5)
    args.add_argument("--whole", action="store_true", help="also the 30 s of the scenario")
    args.add_argument("--bin", default=str(ROOT / "target" / "release"), help="folder of binaries")
    args.add_argument("--out", default=str(ROOT / "benches" / "peers" / "results.md"))
    a = args.parse_args()
    folder = Path(a.bin).resolve()
    peer = folder / "docktwin-peers"
    run = rehearse(folder / "docktwin", SCENARIO, [f"run.duration_s={CONTACT_S + 0.05}"],
                   out=ROOT / "target" / "peers")
    start, scene = states(run), run.scene

    def ours(twin, step):
        return lambda whole: docktwin(peer, twin, step, whole)

    def theirs(how, step):
        return lambda whole: mujoco_run(start, scene, how, step, whole and how == "law")

    names = {
        "law": "MuJoCo RK4, docktwin's law", "implicitfast": "MuJoCo implicitfast, own solver",
        "RK4": "MuJoCo RK4, own solver",
    }
    ladder = (1.0, 0.5, 0.2)
    rows = {}
    for twin in ("reduced", "full"):
        for step in ladder:
            rows[(f"docktwin {twin}", step)] = ours(twin, step)
    for how, name in names.items():
        for step in ladder:
            rows[(name, step)] = theirs(how, step)
    floor = "MuJoCo bare, own solver"
    for integrator in ("implicitfast", "RK4"):
        for step in ladder:
            rows[(f"{floor}, {integrator}", step)] = (
                lambda whole, integrator=integrator, step=step: bare(run, integrator, step))
    # The finest of every contender is the truth of its accuracy; not timed.
    print("finest steps …", file=sys.stderr, flush=True)
    truth = {}
    for twin in ("reduced", "full"):
        truth[f"docktwin {twin}"] = docktwin(peer, twin, 0.02, False).poses
    for how, name in names.items():
        truth[name] = mujoco_run(start, scene, how, 0.05, False).poses
    cost: dict = {key: [] for key in rows}
    found = {}
    for n in range(a.repeats):
        for key, go in rows.items():
            found[key] = go(a.whole)
            cost[key].append(found[key].cost_us)
        print(f"repeat {n + 1} of {a.repeats}", file=sys.stderr, flush=True)
    off = {key: error(found[key].poses, truth[key[0]]) for key in rows if key[0] in truth}
    phases = ["free", "contact"] + (["whole"] if a.whole else [])
    lines = [
        "# Speed against MuJoCo", "",
        f"`benches/peers/peers.py`, MuJoCo {mujoco.__version__}, apas_nominal, {a.repeats} repeats in "
        "turn. Cost: processor time per simulated millisecond, us, median (least – most).", "",
        "| contender | step, ms | " + " | ".join(phases) + " | pose off, mm | ° | capture, s |",
        "| --- | --- |" + " --- |" * (len(phases) + 3),
    ]

    def cell(key, phase):
        values = [c[phase] for c in cost[key] if phase in c]
        if not values:
            return "–"
        return f"{np.median(values):.1f} ({min(values):.1f} – {max(values):.1f})"

    for key in rows:
        capture = found[key].capture_s
        lines.append(
            f"| {key[0]} | {key[1]:g} | " + " | ".join(cell(key, p) for p in phases)
            + (f" | {off[key][0]:.2e} | {off[key][1]:.1e} | " if key in off else " | – | – | ")
            + ("–" if capture is None else f"{capture:.4f}") + " |"
        )
    lines += ["", "Ratios: MuJoCo's cost over that of docktwin's cheapest row at least as accurate in "
              "pose; median (least – most) over the repeats.", "",
              "| MuJoCo | step, ms | against | " + " | ".join(phases) + " |",
              "| --- | --- | --- |" + " --- |" * len(phases)]
    for key in rows:
        if not key[0].startswith("MuJoCo"):
            continue
        for twin in ("docktwin reduced", "docktwin full"):
            if key in off:
                good = [r for r in rows if r[0] == twin and off[r][0] <= off[key][0]]
            else:
                good = [(twin, key[1])]
            if not good:
                lines.append(f"| {key[0]} | {key[1]:g} | {twin}: none as accurate |"
                             + " – |" * len(phases))
                continue
            best = min(good, key=lambda r: np.median([c["contact"] for c in cost[r]]))
            cells = []
            for p in phases:
                ratio = [x[p] / y[p] for x, y in zip(cost[key], cost[best]) if p in x and p in y]
                cells.append(f"{np.median(ratio):.1f} ({min(ratio):.1f} – {max(ratio):.1f})"
                             if ratio else "–")
            lines.append(f"| {key[0]} | {key[1]:g} | {twin}, {best[1]:g} ms | "
                         + " | ".join(cells) + " |")
    text = "\n".join(lines) + "\n"
    print(text)
    Path(a.out).write_text(text)


if __name__ == "__main__":
    main()
