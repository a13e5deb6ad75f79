"""A run of docktwin once more, in MuJoCo: `python -m docktwin_mujoco RUN OUT`.

RUN is a run directory of docktwin. Its scenario is run from the first row of its telemetry; OUT gets
`telemetry.parquet` and `contacts.parquet`, stdout the result as JSON. Exit codes: 0 it ran, whatever
the outcome; 2 it cannot be run here, with the reason on stderr.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import mujoco
import pyarrow.parquet as pq

from .listed import engine
from .peer import Rehearsal, state_names, states
from .scenario import read_scene
from .telemetry import write, write_contacts


def run(source: Path, out: Path, step_s: float) -> dict:
    """Runs it and writes its tables; gives the result."""
    scene = read_scene(source / "scenario.toml", source / "models")
    names = ["time_s", *state_names()]
    with pq.ParquetFile(source / "telemetry.parquet") as table:
        batch = next(table.iter_batches(batch_size=1, columns=names))
    first = {n: batch.column(n).to_numpy(zero_copy_only=False) for n in names}
    rules = scene.run
    began = time.perf_counter()
    dock = engine(scene)(scene, step_s, float(rules.get("tick_s", 1e-3)))
    # As long as docktwin's run may last, so that a limit passed there is looked for here too.
    got = dock.run(
        states(Rehearsal({}, first, scene)), float(rules["duration_s"]), float(first["time_s"][0]),
        stop_when_decided=bool(rules.get("stop_when_decided", False)),
    )
    wall_s = time.perf_counter() - began
    out.mkdir(parents=True, exist_ok=True)
    write(got, scene, out / "telemetry.parquet")
    write_contacts(got, out / "contacts.parquet")
    return {
        "engine": f"MuJoCo {mujoco.__version__}",
        "integrator": "RK4",
        "step_s": step_s,
        "outcome": got.outcome,
        "reason": got.reason,
        "decided_s": got.decided_s,
        "end_s": got.end_s,
        "first_contact_s": got.first_contact_s,
        "capture_s": got.captured_s,
        "latches_s": [times[2] for times in got.latches_s],
        "peak_force_n": got.peak_force_n,
        "peak_moment_nm": got.peak_moment_nm,
        "peak_penetration_m": got.peak_depth_m,
        "impulse_ns": got.impulse_ns,
        "ticks": len(got.rows) - 1,
        "wall_s": wall_s,
    }


def main() -> None:
    """The command line."""
    p = argparse.ArgumentParser(prog="python -m docktwin_mujoco", description=__doc__,
                                formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("source", type=Path, metavar="RUN", help="run directory of docktwin")
    p.add_argument("out", type=Path, metavar="OUT", help="directory of the two tables")
    p.add_argument("--step-ms", type=float, default=0.2, help="step of MuJoCo, ms [0.2]")
    args = p.parse_args()
    try:
        result = run(args.source, args.out, args.step_ms * 1e-3)
    except (ValueError, OSError, FloatingPointError) as e:
        print(e, file=sys.stderr)
        sys.exit(2)
    print(json.dumps(result))


if __name__ == "__main__":
    main()
