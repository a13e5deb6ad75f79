"""The check cases through both engines, one table.

    DOCKTWIN_BIN=target/debug/docktwin python validation/oracles/write_table.py [CASE ...]

Writes `validation/oracles/table.md`. Rows are kept in `target/validation/oracles`, so that a run that was
stopped goes on where it was; a case named on the command line is run anew.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "validation"), str(ROOT / "validation" / "mujoco")]
os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / "target" / "numba"))

from oracles.cases import CASES, ENGINES  # noqa: E402

HEAD = (
    "| case | quantity | closed form | docktwin, reduced | docktwin, full | MuJoCo, law rewritten "
    "| MuJoCo's own contact | off: reduced, full, MuJoCo, own |",
    "| --- | --- | --- | --- | --- | --- | --- | --- |",
)
INTRO = """# Check cases in both engines

Written by `validation/oracles/write_table.py`. docktwin ran a scenario under `scenarios/` in each of its
twins (reduced: own integrator, 0.1 ms; full: rapier, 0.2 ms); MuJoCo 4.0.0 (RK4, 0.2 ms, tumbling 1 ms)
started from the same state with geometry and law written again. MuJoCo's own contact solver has
solref = (−k/m_eff, −c/m_eff); exponents other than one, levers and bending petals are not in its reach
here (`tests/test_own_contact.py` has those). "Off" is relative to the closed form; of the NESC rates,
to the size of the rate. – means not part of that engine's cases.
"""
OUTRO = """
- NESC and Dzhanibekov: docktwin flies half the rates for twice the time, as when scenarios allowed 20°/s at most
  and a tenth for ten times, the same motion by Euler's equations; the figures are scaled back. At the
  published rates they are unit tests of docktwin: `oracle_nesc_check_case_2`, `oracle_dzhanibekov_period`.
- Block and ball are no docking: of docktwin they are unit tests of its friction
  (`oracle_sliding_block_stops_where_coulomb_says_as_the_bristle_shrinks`,
  `oracle_ball_slips_then_rolls_at_five_sevenths`), with the bound named instead of a figure. Both
  MuJoCo columns are measured; the bristle there breaks away at 0.1 mm.
- The oblique cases' closed forms hold the geometry still during the contact: what is left of their
  errors at these speeds is theirs, and equal in all columns.
- Delay and compensation in the loop are not in MuJoCo and not here.
"""


def figure(value) -> str:
    """A number with seven digits, or a text."""
    if isinstance(value, float):
        return f"{value:.7g}"
    return value or "–"


def line(row) -> str:
    """A row of the table."""
    offs = []
    for engine in ENGINES:
        off = row.off(engine)
        offs.append("–" if off is None else "0" if off == 0.0 else f"{off:.1e}")
    unit = f", {row.unit}" if row.unit else ""
    cells = [row.case, row.quantity + unit, figure(row.want),
             *(figure(row.found.get(e)) for e in ENGINES), ", ".join(offs)]
    return f"| {' | '.join(cells)} |"


def main(names) -> None:
    """All cases, or those named; the rows of cases run before are kept."""
    named = os.environ.get("DOCKTWIN_BIN")
    if not named:
        sys.exit("name the docktwin binary in DOCKTWIN_BIN")
    kept = ROOT / "target" / "validation" / "oracles"
    kept.mkdir(parents=True, exist_ok=True)
    for name in names or CASES:
        if not names and (kept / f"{name}.md").is_file():
            continue
        with tempfile.TemporaryDirectory() as scratch:
            rows = CASES[name](Path(named).resolve(), Path(scratch) / name)
        text = "".join(f"{line(row)}\n" for row in rows)
        print(text, end="", flush=True)
        (kept / f"{name}.md").write_text(text)
    missing = [name for name in CASES if not (kept / f"{name}.md").is_file()]
    rows = [(kept / f"{name}.md").read_text() for name in CASES if name not in missing]
    text = "\n".join([INTRO, *HEAD, ""]) + "".join(rows) + OUTRO
    if missing:
        text += f"- Not run: {', '.join(missing)}.\n"
    (ROOT / "validation" / "oracles" / "table.md").write_text(text)


if __name__ == "__main__":
    main(sys.argv[1:])
