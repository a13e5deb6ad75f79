"""Writes expected.json of a run, read with public packages alone.

    pip install mcap mcap-ros2-support pyarrow
    python expected.py schema-1/docking
"""
import json, struct, sys, zlib, pathlib
from mcap.reader import make_reader
import pyarrow.parquet as pq
from mcap_ros2.decoder import DecoderFactory
run = pathlib.Path(sys.argv[1])
r = make_reader(open(run / "run.mcap", "rb"), decoder_factories=[DecoderFactory()])
meta = {m.name: m.metadata for m in r.iter_metadata()}
cols = [meta["docktwin.columns"][k].split(" ") for k in sorted(meta["docktwin.columns"])]
ticks = {}
events = 0
for schema, ch, msg, d in r.iter_decoded_messages():
    t = ticks.setdefault(msg.log_time, {"row": {}, "contacts": []})
    if ch.topic == "/tick": t["tick"] = d.tick
    elif ch.topic == "/contacts":
        t["contacts"] = [[c.pair, *c.point_w_m, *c.normal_w, c.depth_m, c.normal_force_n, *c.friction_w_n] for c in d.contacts]
    elif ch.topic == "/events": events += 1
    else:
        for k in d.__slots__: t["row"][k] = getattr(d, k)
crc = {"rows": 0, "contacts": 0, "inputs": 0, "digests": 0}
n_contacts = 0
def cell(kind, v): return struct.pack("<d", v) if kind == "float64" else struct.pack("<Q", int(v))
for ns in sorted(ticks):
    t = ticks[ns]
    if "tick" not in t: continue
    b = struct.pack("<QQ", t["tick"], ns)
    crc["rows"] = zlib.crc32(b + b"".join(cell(k, t["row"][n]) for k, _, n in cols), crc["rows"])
    crc["inputs"] = zlib.crc32(b"".join(cell(k, t["row"][n]) for k, topic, n in cols if topic == "/inputs"), crc["inputs"])
    crc["digests"] = zlib.crc32(struct.pack("<Q", t["row"]["state_digest"]), crc["digests"])
    for c in t["contacts"]:
        n_contacts += 1
        crc["contacts"] = zlib.crc32(struct.pack("<QH11d", t["tick"], *c), crc["contacts"])
n = sum("tick" in t for t in ticks.values())
table = pq.read_table(run / "telemetry.parquet")
assert table.num_rows == n and table.column_names == ["tick", "time_s"] + [c[2] for c in cols]
out = {"ticks": n, "columns": len(cols), "pairs": len(meta["docktwin.pairs"]), "contacts": n_contacts, "events": events,
       "crc32": {k: f"{v:08x}" for k, v in crc.items()}}
(run / "expected.json").write_text(json.dumps(out, indent=2) + "\n")
print(out)
