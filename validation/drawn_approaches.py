"""200 drawn approaches in both engines: outcomes, capture times, peak forces side by side.

    DOCKTWIN_BIN=target/debug/docktwin nice python validation/drawn_approaches.py
    python validation/drawn_approaches.py --report

Draws are fixed by their number, so a run that was stopped goes on where it was. Each line of
`target/statistics/runs.jsonl` is one approach; the report goes to `validation/results/`.
Every disagreement is run again with halved steps on both sides and with the target moved by a
micrometre: where engines that agree with themselves no better than with each other part, the
approach itself decides on less than either knows.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "validation" / "mujoco"))
os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / "target" / "numba"))

from docktwin_mujoco.docking import FullDocking  # noqa: E402
from docktwin_mujoco.peer import Refused, rehearse, state_names, states  # noqa: E402

WORK = ROOT / "target" / "statistics"
RESULTS = ROOT / "validation" / "results"
SEED = 20261122
EACH = 100
STEP_S = 5e-4
DURATION_S = 20.0
# After capture the loads of this long are still compared.
AFTER_CAPTURE_S = 2.0


def disc(rng, radius):
    """A point drawn evenly from a disc."""
    r, a = radius * math.sqrt(rng.random()), 2.0 * math.pi * rng.random()
    return r * math.cos(a), r * math.sin(a)


def draw(box: str, number: int):
    """Scenario and `--set` values of one approach."""
    rng = np.random.default_rng([SEED, {"idss": 1, "paper": 2}[box], number])
    two = lambda x: rng.uniform(-x, x, 2)  # noqa: E731
    if box == "idss":
        # <= 0.04 m/s, <= 0.10 m, <= 4 degrees as vector sums; 0.05 to 0.10 m/s.
        scenario = "apas_nominal"
        v = {"axial_speed_m_s": rng.uniform(0.05, 0.10)}
        v["lateral_y_m"], v["lateral_z_m"] = disc(rng, 0.10)
        v["lateral_speed_y_m_s"], v["lateral_speed_z_m_s"] = disc(rng, 0.04)
        v["pitch_deg"], v["yaw_deg"] = disc(rng, 4.0)
        v["roll_deg"] = rng.uniform(-4.0, 4.0)
        v["pitch_rate_deg_s"], v["yaw_rate_deg_s"] = disc(rng, 0.20)
        v["roll_rate_deg_s"] = rng.uniform(-0.20, 0.20)
    else:
        # The paper's box, each axis for itself; even numbers with inward, odd with outward petals.
        scenario = "apas_fast" if number % 2 == 0 else "apas75_paper_corner"
        v = {"axial_speed_m_s": 0.35}
        v["lateral_y_m"], v["lateral_z_m"] = two(0.30)
        v["lateral_speed_y_m_s"], v["lateral_speed_z_m_s"] = two(0.10)
        v["pitch_deg"], v["yaw_deg"] = two(7.0)
        v["roll_deg"] = rng.uniform(-15.0, 15.0)
        v["pitch_rate_deg_s"], v["yaw_rate_deg_s"] = two(1.0)
        v["roll_rate_deg_s"] = rng.uniform(-1.0, 1.0)
    return scenario, {f"initial.{k}": round(float(x), 6) for k, x in v.items()}


def both(binary, scenario, values, halved=False, moved_m=0.0):
    """One approach in both engines."""
    values = dict(values)
    values["initial.lateral_y_m"] = values["initial.lateral_y_m"] + moved_m
    sets = [f"{k}={v!r}" for k, v in values.items()]
    sets += [f"run.duration_s={DURATION_S}", "run.stop_when_decided=true"]
    if halved:
        sets.append("run.steps_per_tick=20")
    t = time.perf_counter()
    run = rehearse(
        binary, ROOT / "scenarios" / f"{scenario}.toml", sets, out=WORK / "run",
        columns=["time_s", *state_names()],
    )
    t_rust = time.perf_counter() - t
    s = run.summary
    # Finer than the recorded ticks, within one of which two latches may catch.
    caught = [(t, i) for i, t in enumerate(s["latches_s"], 1) if t is not None]
    t = time.perf_counter()
    dock = FullDocking(run.scene, 0.5 * STEP_S if halved else STEP_S)
    got = dock.run(states(run), DURATION_S, stop_when_decided=True,
                   after_capture_s=AFTER_CAPTURE_S)
    return {
        "docktwin": {
            "outcome": s["outcome"], "capture_s": s["capture_s"],
            "first_contact_s": s["first_contact_s"], "peak_n": s["peak_force_n"],
            "impulse_ns": s["impulse_ns"], "latches": [i for _, i in sorted(caught)],
            "end_s": float(run.columns["time_s"][-1]),
        },
        "mujoco": {
            "outcome": got.outcome, "capture_s": got.captured_s,
            "first_contact_s": got.first_contact_s, "peak_n": got.peak_force_n,
            "impulse_ns": got.impulse_ns, "latches": got.latch_order, "end_s": got.end_s,
        },
        "wall_s": [t_rust, time.perf_counter() - t],
    }


def disagrees(r) -> bool:
    """Another outcome, or a capture more than 5 % away."""
    a, b = r["docktwin"], r["mujoco"]
    if a["outcome"] != b["outcome"]:
        return True
    if a["capture_s"] is None or b["capture_s"] is None:
        return a["capture_s"] is not b["capture_s"]
    return abs(b["capture_s"] / a["capture_s"] - 1.0) > 0.05


def run_all(binary, each: int) -> None:
    """Draws not yet run, then the disagreements again."""
    WORK.mkdir(parents=True, exist_ok=True)
    path = WORK / "runs.jsonl"
    done = {(r["box"], r["number"]) for r in load()}
    order = [(box, n) for n in range(each) for box in ("idss", "paper")]
    for box, number in order:
        if (box, number) in done:
            continue
        scenario, values = draw(box, number)
        record = {"box": box, "number": number, "scenario": scenario, "values": values}
        try:
            record.update(both(binary, scenario, values))
            if disagrees(record):
                record["halved"] = both(binary, scenario, values, halved=True)
                record["moved"] = both(binary, scenario, values, moved_m=1e-6)
        except Refused as refused:
            record["refused"] = str(refused).splitlines()[-1]
        with path.open("a") as f:
            f.write(json.dumps(record) + "\n")
        print(box, number, record.get("refused") or (
            f"{record['docktwin']['outcome']} {record['mujoco']['outcome']} "
            f"{record['docktwin']['capture_s']} {record['mujoco']['capture_s']} "
            f"{record['docktwin']['peak_n']:.1f} {record['mujoco']['peak_n']:.1f} "
            f"wall {record['wall_s'][0]:.1f} {record['wall_s'][1]:.1f}"
        ), flush=True)


def load():
    """What has been run."""
    path = WORK / "runs.jsonl"
    if not path.is_file():
        return []
    return [json.loads(line) for line in path.read_text().splitlines() if line.strip()]


def report() -> str:
    """The table, as Markdown; also as CSV."""
    rows = sorted(load(), key=lambda r: (r["box"], r["number"]))
    RESULTS.mkdir(exist_ok=True)
    ran = [r for r in rows if "refused" not in r]
    with (RESULTS / "statistics.csv").open("w", newline="") as f:
        out = csv.writer(f, lineterminator="\n")
        keys = ["outcome", "capture_s", "first_contact_s", "peak_n", "impulse_ns", "latches"]
        names = list(rows[0]["values"])
        out.writerow(
            ["box", "number", "scenario", *names]
            + [f"{side}_{key}" for side in ("docktwin", "mujoco") for key in keys]
        )
        for r in rows:
            line = [r["box"], r["number"], r["scenario"], *(r["values"][n] for n in names)]
            for side in ("docktwin", "mujoco"):
                for key in keys:
                    x = r[side][key] if "refused" not in r else "refused"
                    x = "".join(map(str, x)) if isinstance(x, list) else x
                    line.append(f"{x:.7g}" if isinstance(x, float) else x)
            out.writerow(line)

    def ratio(r, key):
        return abs(r["mujoco"][key] / r["docktwin"][key] - 1.0)

    lines = [
        "# Drawn approaches in both engines",
        "",
        "Written by `validation/drawn_approaches.py`; every approach stands in `statistics.csv`. Law held",
        "equal, geometry and integration each engine's own. docktwin: reduced twin, 0.1 ms;",
        f"MuJoCo: RK4, {1e3 * STEP_S:g} ms. Seed {SEED}, {DURATION_S:g} s at most.",
        "",
        "| box | ran | refused | same outcome | same latch order | capture time: median, worst "
        "| peak force, no limit passed: median, 95 %, worst | limit passed: median, worst |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for box in ("idss", "paper", "both"):
        mine = [r for r in ran if box in (r["box"], "both")]
        refused = sum(1 for r in rows if "refused" in r and box in (r["box"], "both"))
        if not mine:
            continue
        same = [r for r in mine if r["docktwin"]["outcome"] == r["mujoco"]["outcome"]]
        latch = sum(r["docktwin"]["latches"] == r["mujoco"]["latches"] for r in mine)
        cap = [
            ratio(r, "capture_s") for r in same
            if r["docktwin"]["capture_s"] and r["mujoco"]["capture_s"]
        ]
        touched = [r for r in mine if r["docktwin"]["peak_n"] > 0.0]
        # A run ends where a limit is passed, and forces rise by a kilonewton a millisecond there.
        limited = [r for r in touched if "limit_exceeded" in
                   (r["docktwin"]["outcome"], r["mujoco"]["outcome"])]
        peak = [ratio(r, "peak_n") for r in touched if r not in limited]
        past = [ratio(r, "peak_n") for r in limited]
        lines.append(
            f"| {box} | {len(mine)} | {refused} | {len(same)} ({100 * len(same) / len(mine):.1f} %) "
            f"| {latch} | {_pct(np.median(cap)) if cap else '–'}, {_pct(max(cap)) if cap else '–'} "
            f"| {_pct(np.median(peak))}, {_pct(np.quantile(peak, 0.95))}, {_pct(max(peak))} "
            f"| {f'{_pct(np.median(past))}, {_pct(max(past))}' if past else '–'} |"
        )
    lines += ["", "Outcomes, docktwin (rows) against MuJoCo (columns):", ""]
    kinds = sorted({r[s]["outcome"] for r in ran for s in ("docktwin", "mujoco")})
    lines += ["| | " + " | ".join(kinds) + " |", "| --- |" + " --- |" * len(kinds)]
    for a in kinds:
        n = [sum(r["docktwin"]["outcome"] == a and r["mujoco"]["outcome"] == b for r in ran)
             for b in kinds]
        lines.append(f"| {a} | " + " | ".join(map(str, n)) + " |")
    bad = [r for r in ran if disagrees(r)]
    lines += ["", f"Another outcome, or a capture more than 5 % away: {len(bad)}.", ""]
    if bad:
        lines += [
            "| approach | docktwin | MuJoCo | both with halved steps | both with the target moved "
            "by 1 µm |",
            "| --- | --- | --- | --- | --- |",
        ]
        for r in bad:
            lines.append(
                f"| {r['box']} {r['number']} | {_story(r['docktwin'])} | {_story(r['mujoco'])} | "
                + " | ".join(
                    f"{_story(r[w]['docktwin'])}; {_story(r[w]['mujoco'])}"
                    for w in ("halved", "moved")
                )
                + " |"
            )
    refused = [r for r in rows if "refused" in r]
    if refused:
        lines += ["", "Refused by docktwin before a start: " + ", ".join(
            f"{r['box']} {r['number']}" for r in refused
        ) + " (the lateral motion taken back leads through the petals)."]
    wall = np.array([r["wall_s"] for r in ran])
    lines += ["", f"Wall time a run, median: docktwin {np.median(wall[:, 0]):.1f} s with its recording, "
              f"MuJoCo {np.median(wall[:, 1]):.1f} s.", ""]
    text = "\n".join(lines)
    (RESULTS / "statistics.md").write_text(text)
    return text


def _pct(x) -> str:
    return f"{100 * x:.2g} %"


def _story(s) -> str:
    t = "" if s["capture_s"] is None else f" at {s['capture_s']:.3f} s"
    return f"{s['outcome']}{t}, {s['peak_n']:.0f} N"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--report", action="store_true", help="only write the report")
    parser.add_argument("--each", type=int, default=EACH, help="approaches of each box")
    args = parser.parse_args()
    if not args.report:
        binary = os.environ.get("DOCKTWIN_BIN")
        if not binary:
            sys.exit("name the docktwin binary in DOCKTWIN_BIN")
        run_all(Path(binary).resolve(), args.each)
    print(report())
