"""Whole dockings in both engines, from the start to the outcome.

    DOCKTWIN_BIN=target/debug/docktwin python validation/compare.py [SCENARIO ...]

Prints a Markdown table and writes it to `validation/results/dockings.md`; the telemetry of MuJoCo's
side goes to `target/validation/<scenario>.parquet`, with docktwin's column names.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "validation" / "mujoco"))
os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / "target" / "numba"))

from docktwin_mujoco.dockings import HEADER, SCENARIOS, compare, line  # noqa: E402
from docktwin_mujoco.telemetry import write  # noqa: E402


def main(names) -> None:
    """All scenarios, or those named."""
    binary = os.environ.get("DOCKTWIN_BIN")
    if not binary:
        sys.exit("name the docktwin binary in DOCKTWIN_BIN")
    out = ROOT / "target" / "validation"
    out.mkdir(parents=True, exist_ok=True)
    lines = list(HEADER)
    for item in names or SCENARIOS:
        name, _, how = item.partition(":")
        begin = time.process_time()
        found = compare(Path(binary).resolve(), name, how, out / "run")
        write(found.mujoco, found.scene, out / f"{item.replace(':', '_')}.parquet")
        lines.append(line(item, found))
        print(lines[-1], f"{time.process_time() - begin:.1f} s of processor time", flush=True)
    if not names:
        text = "\n".join(
            ["# Whole dockings in both engines", "",
             "Written by `validation/compare.py`. Law held equal; geometry, integration and judgement "
             "each", "engine's own. docktwin: reduced twin, 0.1 ms; MuJoCo: RK4, 0.2 ms.", "", *lines,
             ""]
        )
        results = ROOT / "validation" / "results"
        results.mkdir(exist_ok=True)
        (results / "dockings.md").write_text(text)


if __name__ == "__main__":
    main(sys.argv[1:])
