"""Whole dockings in both engines, from the start to the outcome.

    DOCKTWIN_BIN=target/debug/docktwin python validation/compare.py [SCENARIO ...]

Prints a Markdown table and writes it to `validation/results/dockings.md` after every scenario, with those
of the list that are still missing named as such; all rows of a table come from one run with one binary.
Scenarios named on the command line are printed only. The telemetry of MuJoCo's side goes to
`target/validation/<scenario>.parquet`, with docktwin's column names.

    DOCKTWIN_BIN=... python validation/compare.py --own-geometry UNTIL_S SCENARIO ...

prints the same with our law on MuJoCo's collision geometry (`own_geometry.py`), to UNTIL_S seconds,
with steps of 0.5 ms.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "validation" / "mujoco"))
os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / "target" / "numba"))

from docktwin_mujoco.dockings import HEADER, SCENARIOS, compare, line  # noqa: E402
from docktwin_mujoco.own_geometry import OnOwnGeometry  # noqa: E402
from docktwin_mujoco.telemetry import write  # noqa: E402


def report(lines, missing, version: str) -> str:
    """The file of results as far as the run has come."""
    text = [
        "# Whole dockings in both engines", "",
        f"Written by `validation/compare.py` in one run with `{version}`. Law held equal; geometry,",
        "integration and judgement each engine's own. docktwin: reduced twin, 0.1 ms; MuJoCo 4.0.0: RK4,",
        "0.2 ms. \"Off\" is MuJoCo against docktwin.", "", *lines, "",
    ]
    if missing:
        text += [f"Not run: {', '.join(missing)}.", ""]
    return "\n".join(text)


def main(names) -> None:
    """All scenarios, or those named."""
    named = os.environ.get("DOCKTWIN_BIN")
    if not named:
        sys.exit("name the docktwin binary in DOCKTWIN_BIN")
    binary = Path(named).resolve()
    version = subprocess.run([binary, "--version"], capture_output=True, text=True, check=True)
    version = version.stdout.splitlines()[0].strip()
    out = ROOT / "target" / "validation"
    out.mkdir(parents=True, exist_ok=True)
    results = ROOT / "validation" / "results"
    results.mkdir(exist_ok=True)
    own = {}
    if names[:1] == ["--own-geometry"]:
        if len(names) < 3:
            sys.exit("name the time to run to and a scenario: --own-geometry 1.2 apas_fast")
        until, names = float(names[1]), names[2:]
        own = {"engine": OnOwnGeometry, "step_s": 5e-4, "overrides": [f"run.duration_s={until}"]}
    lines, missing = list(HEADER), list(names or SCENARIOS)
    print(*lines, sep="\n", flush=True)
    while missing:
        item = missing.pop(0)
        name, _, how = item.partition(":")
        begin = time.process_time()
        found = compare(binary, name, how, out / (f"own_{name}" if own else "run"), **own)
        if not own:
            write(found.mujoco, found.scene, out / f"{item.replace(':', '_')}.parquet")
        lines.append(line(item, found))
        print(lines[-1], f"{time.process_time() - begin:.1f} s of processor time", flush=True)
        if not names:
            (results / "dockings.md").write_text(report(lines, missing, version))


if __name__ == "__main__":
    main(sys.argv[1:])
