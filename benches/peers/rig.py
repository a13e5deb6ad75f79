"""Speed of the motion simulator's platform against MuJoCo on the same closed loops, at equal accuracy.

    cargo build --release -p docktwin-peers
    target/venv-validation/bin/python benches/peers/rig.py [--repeats 5]

The plate of `models/urdf/stewart.urdf`, its six legs with their masses, gravity. Two motions, 2 s each,
without loss: `large`, soft leg springs, let go near a corner of the docking workspace, swings of half a
metre; `oil`, the file's oil springs, millimetres at 15 to 40 Hz, which is what the rig does.

Contenders take turns in one run, so that a busy machine disturbs all alike; cost is processor time of
the stepping thread per simulated millisecond. Accuracy of a row is the largest difference of the
plate's pose, at 201 instants, from the finest step of the same engine, and how far both engines' finest
steps are apart stands below each table. A ratio compares with the cheapest row of ours that is at least
as accurate, in metres and in radians.

MuJoCo as fast and as accurate as we found it: Newton's solver (one iteration: the constraints are
linear in acceleration), dense matrices (sparse ones and CG or PGS cost a quarter more), springs as
joint stiffness, all steps between two samples in one call of C, nothing that collides or is limited.
`hung` is the plate on the first rod by a ball joint, which leaves five loops to close. The time constant
of a loop is two steps, MuJoCo's least, or one, with its safeguard off; at a half it gets worse again.
The soft loops make RK4 a method of second order wherever they count.
Our reduced rig pays for its valves and seals though they are shut and without friction.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Callable

import mujoco
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "validation" / "mujoco"))

from docktwin_mujoco import platform  # noqa: E402
from docktwin_mujoco.platform import Settings  # noqa: E402
from docktwin_mujoco.rig import read_rig  # noqa: E402
from docktwin_mujoco.scene import angle_between  # noqa: E402

RIG = ROOT / "models" / "urdf" / "stewart.urdf"
UNTIL_S, SAMPLE_S = 2.0, 0.01
# A corner where no leg is like another; place of release in corners, stiffness of a leg (None: oil).
CORNER = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])
MOTIONS = {"large": (0.8, 1e5), "oil": (0.004, None)}
# Steps between two samples: a factor of 1.25 or so from row to row, so that a ratio at equal accuracy
# loses little to the ladder.
OURS = (500, 400, 320, 250, 200, 160, 125, 100, 80, 64, 50, 40, 32, 25, 20, 16, 12, 10, 8, 6, 5)
FULL = (200, 100, 80, 50, 40, 20, 10)
THEIRS = (25, 20, 10, 5, 2)
FIRST_ORDER = (100, 50, 20, 10)
# For several milliseconds of processor time.
LAPS = 5


@dataclass
class Result:
    """One run: processor time per simulated millisecond, us, and poses of the plate (w, x, y, z)."""

    cost_us: float
    poses: np.ndarray
    loop_m: float | None = None


@dataclass
class Contender:
    """Somebody who moves the platform: `run(motion, steps per sample)`."""

    engine: str
    name: str
    steps: tuple
    run: Callable[[str, int], Result]


def ours(binary: Path, motion: str, steps: int, full: bool = False) -> Result:
    """docktwin's reduced rig, or the full one."""
    corners, spring = MOTIONS[motion]
    command = [str(binary), "platform", "release", str(RIG), "--laps", str(LAPS)]
    command += ["--place", ",".join(repr(float(x)) for x in corners * CORNER)]
    command += ["--step-ms", repr(1e3 * SAMPLE_S / steps)]
    command += ["--until-s", repr(UNTIL_S), "--sample-s", repr(SAMPLE_S)]
    command += ["--full"] if full else []
    if spring:
        command += ["--spring-n-m", repr(spring)]
    answer = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    # x, y, z, w becomes w, x, y, z.
    poses = np.array(answer["poses"])[:, [0, 1, 2, 6, 3, 4, 5]]
    return Result(1e3 * answer["cpu_s"] / answer["sim_s"], poses)


def mujoco_run(rig, motion: str, steps: int, **settings) -> Result:
    """MuJoCo's closed loops."""
    corners, spring = MOTIONS[motion]
    p = platform.released(
        rig, Settings(SAMPLE_S / steps, **settings), corners * CORNER, spring or rig.oil_spring_n_m
    )
    poses, loop, spent = platform.run(p, UNTIL_S, SAMPLE_S, time.process_time)
    return Result(1e3 * spent / UNTIL_S, poses, loop)


def contenders(binary: Path) -> tuple[list[Contender], dict[str, Callable[[str], Result]]]:
    """All rows, and the finest run of every engine. Another engine is an entry in both."""
    rig = read_rig(RIG)

    def theirs(name, steps, **settings):
        return Contender("MuJoCo", f"MuJoCo {name}", steps,
                         lambda motion, n: mujoco_run(rig, motion, n, **settings))

    hung = {"plate_on_leg": True}
    rows = [
        Contender("docktwin", "docktwin reduced", OURS, lambda motion, n: ours(binary, motion, n)),
        # Judged by the reduced rig's finest run: its own is held back by the joint solver.
        Contender("docktwin", "docktwin full", FULL,
                  lambda motion, n: ours(binary, motion, n, full=True)),
        theirs("RK4", THEIRS),
        theirs("RK4, 1 step", THEIRS, time_constant_steps=1.0),
        theirs("RK4, hung", THEIRS, **hung),
        theirs("RK4, hung, 1 step", THEIRS, time_constant_steps=1.0, **hung),
        theirs("implicitfast, hung", FIRST_ORDER, integrator="implicitfast", **hung),
        theirs("Euler, hung", FIRST_ORDER, integrator="Euler", **hung),
    ]
    finest = {
        "docktwin": lambda motion: ours(binary, motion, 2000),
        "MuJoCo": lambda motion: mujoco_run(rig, motion, 200, time_constant_steps=1.0),
    }
    return rows, finest


def apart(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """Largest difference of two series of poses, m and rad."""
    return (
        float(np.linalg.norm(a[:, :3] - b[:, :3], axis=1).max()),
        max(angle_between(x[3:], y[3:]) for x, y in zip(a, b)),
    )


def spread(values, digits: int) -> str:
    """Median (least – most)."""
    return f"{np.median(values):.{digits}f} ({min(values):.{digits}f} – {max(values):.{digits}f})"


def measure(rows, finest, motion: str, repeats: int) -> str:
    """Markdown tables of one motion: cost beside accuracy, and ratios at equal accuracy."""
    truth = {engine: go(motion).poses for engine, go in finest.items()}
    keys = [(c, n) for c in rows for n in c.steps]
    cost = {(c.name, n): [] for c, n in keys}
    off, loop = {}, {}
    for k in range(repeats):
        for c, n in keys:
            result = c.run(motion, n)
            cost[c.name, n].append(result.cost_us)
            off[c.name, n] = apart(result.poses, truth[c.engine])
            loop[c.name, n] = result.loop_m
        print(f"{motion}: repeat {k + 1} of {repeats}", file=sys.stderr, flush=True)
    lines = [f"## Motion `{motion}`", "",
             "| contender | step, ms | cost | pose off, m | rad | loops open, m |",
             "| --- | --- | --- | --- | --- | --- |"]
    for c, n in keys:
        key = c.name, n
        gap = "–" if loop[key] is None else f"{loop[key]:.0e}"
        lines.append(f"| {c.name} | {1e3 * SAMPLE_S / n:.4g} | {spread(cost[key], 2)} | "
                     f"{off[key][0]:.1e} | {off[key][1]:.1e} | {gap} |")
    first, *others = truth
    lines += [""] + [
        f"Finest steps of {first} and {other}: {m:.1e} m, {a:.1e} rad apart."
        for other in others for m, a in [apart(truth[other], truth[first])]
    ]
    lines += ["", "| contender | step, ms | against docktwin reduced, ms | times its cost |",
              "| --- | --- | --- | --- |"]
    us = rows[0]
    for c, n in keys:
        if c is us:
            continue
        good = [m for m in us.steps
                if all(x <= y for x, y in zip(off[us.name, m], off[c.name, n]))]
        step = f"| {c.name} | {1e3 * SAMPLE_S / n:.4g} |"
        if not good:
            lines.append(f"{step} none as accurate | – |")
            continue
        best = min(good, key=lambda m: np.median(cost[us.name, m]))
        ratios = [x / y for x, y in zip(cost[c.name, n], cost[us.name, best])]
        lines.append(f"{step} {1e3 * SAMPLE_S / best:.4g} | {spread(ratios, 1)} |")
    return "\n".join(lines)


def table(binary: Path, repeats: int) -> str:
    """The whole comparison as markdown."""
    rows, finest = contenders(binary)
    head = ["# The platform against MuJoCo", "",
            f"`benches/peers/rig.py`, MuJoCo {mujoco.__version__}, {repeats} repeats in turn. Cost: "
            "processor time per simulated millisecond, us, median (least – most). `1 step`: time "
            "constant of the loops; `hung`: the plate a child of the first rod."]
    return "\n\n".join(["\n".join(head)] + [measure(rows, finest, m, repeats) for m in MOTIONS]) + "\n"


def main() -> None:
    """Measures and writes the table."""
    args = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    args.add_argument("--repeats", type=int, default=5)
    args.add_argument("--bin", default=str(ROOT / "target" / "release"), help="folder of binaries")
    args.add_argument("--out", default=str(ROOT / "benches" / "peers" / "rig.md"))
    a = args.parse_args()
    text = table(Path(a.bin).resolve() / "docktwin-peers", a.repeats)
    print(text)
    Path(a.out).write_text(text)


if __name__ == "__main__":
    main()
