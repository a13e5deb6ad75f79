"""Time of a step of MuJoCo alone on the docking scene: its own collision detection and contact solver,
all steps in one call of C; only the attenuator is compiled from `kernel.py`. Processor time.

    DOCKTWIN_BIN=target/debug/docktwin python validation/solver_speed.py
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import mujoco

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "validation" / "mujoco"))
os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / "target" / "numba"))

from docktwin_mujoco import docking, kernel as k, own_solver  # noqa: E402
from docktwin_mujoco.peer import rehearse, states  # noqa: E402

# Effective mass at a touch of the ring, about that of the ring and a lever of its radius, kg.
MASS_KG = 20.0


def main() -> None:
    """From the state of `apas_nominal` before and in contact."""
    binary = os.environ.get("DOCKTWIN_BIN")
    if not binary:
        sys.exit("name the docktwin binary in DOCKTWIN_BIN")
    run = rehearse(Path(binary).resolve(), ROOT / "scenarios" / "apas_nominal.toml",
                   ["run.duration_s=1.4"], out=ROOT / "target" / "validation" / "speed")
    stiffness = run.scene.mechanism.law.normal.stiffness
    print("| integrator, step | shapes a side | free, us a step | in contact, us a step | contacts |")
    print("| --- | --- | --- | --- | --- |")
    for integrator in ("RK4", "implicitfast"):
        for capsules, strips in ((48, 8), (192, 24)):
            step = 2e-4
            m = own_solver.model(run.scene, step, capsules, strips, stiffness / MASS_KG, integrator,
                                 0.1)
            dock = docking.FullDocking(run.scene, step, model=m)
            dock.P[k.CONTACT_OFF], dock.P[k.EVERY] = 1.0, 1e9
            times, most = [], 0
            for at in (0.2, 1.1):
                row = int(at * 1000)
                best = 1e9
                for _ in range(5):
                    dock.start(states(run, row))
                    mujoco.set_mjcb_passive(dock.callback)
                    begin = time.process_time()
                    mujoco.mj_step(m, dock.data, nstep=200)
                    best = min(best, (time.process_time() - begin) / 200)
                    mujoco.set_mjcb_passive(None)
                    most = max(most, dock.data.ncon)
                times.append(1e6 * best)
            print(f"| {integrator}, {1e3 * step:g} ms | {capsules} capsules, 3 x {strips} strips | "
                  f"{times[0]:.0f} | {times[1]:.0f} | {most} |", flush=True)


if __name__ == "__main__":
    main()
