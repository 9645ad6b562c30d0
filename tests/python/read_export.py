"""Compares the exports of a run with its log: CSV by pandas, Parquet by duckdb, ULog by pyulog.

    pip install mcap mcap-protobuf-support pandas duckdb pyulog
    python3 read_export.py RUN

RUN holds flight.mcap, csv/, parquet/ and flight.ulg. The log is read with the public MCAP and protobuf packages. Prints
one line of JSON; exit code 1 with a message when a value is not that of the log.
"""

import json
import math
import struct
import sys
from operator import attrgetter
from pathlib import Path

import duckdb
import numpy
import pandas
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from pyulog import ULog

TOPICS = ("state", "reference", "controls", "actuators")
#: Field that is not compared: a table has the name of a status in the column beside its number.
NAMES = "status_name"


def bits(value):
    """Returns a value as bits, so that -0.0 is not 0.0; every NaN is the same."""
    if isinstance(value, float):
        return "nan" if math.isnan(value) else struct.pack("<d", value).hex()
    return value


def columns(descriptor, before=""):
    for field in descriptor.fields:
        if field.message_type is None:
            yield before + field.name
        else:
            yield from columns(field.message_type, f"{before}{field.name}.")


def tables(log):
    """Returns the messages of each topic: the names of the fields, and for each message its time and values. Messages
    of STATE also have the fields of the TRUTH of their tick."""
    found = {}
    with log.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        truths = {}
        for _, channel, message, decoded in reader.iter_decoded_messages([f"/{topic}" for topic in (*TOPICS, "truth")]):
            if channel.topic == "/truth":
                names = [name for name in columns(decoded.DESCRIPTOR) if name.startswith("actu")]
                truths[decoded.tick] = dict(zip(names, attrgetter(*names)(decoded)))
                continue
            names, rows = found.setdefault(channel.topic[1:], (list(columns(decoded.DESCRIPTOR)), []))
            rows.append((message.log_time * 1e-9, dict(zip(names, attrgetter(*names)(decoded)))))
    names, rows = found["state"]
    names.extend(next(iter(truths.values())))
    for _, row in rows:
        row.update(truths[row["stamp.tick"]])
    for names, rows in found.values():
        rows.sort(key=lambda row: order(names, row[1]))
    return found


def order(names, row):
    """Returns a sort key for rows: a log has the order of writing, an export that of the ticks."""
    return [str(bits(row[name])) for name in names if name != NAMES]


def same(topic, name, place, ours, theirs):
    if bits(ours) != bits(theirs):
        sys.exit(f"{topic}.{name} of row {place}: the log has {ours!r}, the export {theirs!r}")


def compare_table(topic, rows, read):
    """Compares the rows of the log with `read`, the rows of the export as dictionaries."""
    if len(rows) != len(read):
        sys.exit(f"{topic}: the log has {len(rows)} messages, the export {len(read)} rows")
    read = sorted(read, key=lambda row: order(rows[0][1], row))
    for place, ((time_s, row), found) in enumerate(zip(rows, read)):
        if abs(found["time_s"] - time_s) > 1e-9:
            sys.exit(f"{topic}: row {place} is at {found['time_s']}, the log has {time_s}")
        for name, value in row.items():
            if name != NAMES:
                same(topic, name, place, value, found[name])
    return len(rows)


def plain(frame):
    """Returns the rows of a frame with Python's own numbers."""
    return [dict(zip(frame.columns, (v.item() if hasattr(v, "item") else v for v in row)))
            for row in frame.itertuples(index=False, name=None)]


def csv(run, topic):
    return pandas.read_csv(run / "csv" / f"{topic}.csv")


def parquet(run, topic):
    result = duckdb.sql(f"select * from '{run / 'parquet' / f'{topic}.parquet'}'")
    return [dict(zip(result.columns, row)) for row in result.fetchall()]


def compare_ulog(run, logged):
    """Compares our topics in the ULog file, and the topics of PX4 that are made of them."""
    data = {found.name: found.data for found in ULog(str(run / "flight.ulg")).data_list}
    counts = {}
    for topic, (_, rows) in logged.items():
        found = data[f"trefoil_{topic}"]
        rows = [row for row in rows if row[1]["intact"]]
        names = [name for name in rows[0][1] if name not in (NAMES, "intact")]
        read = [dict(zip(names, values)) for values in zip(*(found[name].tolist() for name in names))]
        for place, ((_, row), theirs) in enumerate(zip(rows, sorted(read, key=lambda row: order(names, row)), strict=True)):
            for name in names:
                same(topic, name, place, row[name], theirs[name])
        counts[topic] = len(rows)
    truth, attitude = data["vehicle_local_position_groundtruth"], data["vehicle_attitude_groundtruth"]
    states = sorted((row for _, row in logged["state"][1] if row["intact"]), key=lambda row: row["stamp.tick"])
    for place, state in enumerate(states):
        for ours, theirs in (("x", "x"), ("y", "y"), ("z", "z")):
            same("px4", theirs, place, float(numpy.float32(state[f"actual.position_m.{ours}"])),
                 truth[theirs][place].item())
        q = [attitude[f"q[{i}]"][place].item() for i in range(4)]
        roll = math.atan2(2 * (q[0] * q[1] + q[2] * q[3]), 1 - 2 * (q[1] ** 2 + q[2] ** 2))
        yaw = math.atan2(2 * (q[0] * q[3] + q[1] * q[2]), 1 - 2 * (q[2] ** 2 + q[3] ** 2))
        for name, angle in (("roll", roll), ("yaw", yaw)):
            if abs(math.sin((angle - state[f"actual.attitude_rad.{name}"]) / 2)) > 1e-5:
                sys.exit(f"vehicle_attitude_groundtruth of row {place}: {name} {angle}")
    # The velocity is the change of the position.
    north, east = (numpy.gradient(truth[axis], truth["timestamp"] * 1e-6) for axis in "xy")
    for axis, change in (("vx", north), ("vy", east)):
        if numpy.abs(truth[axis] - change)[2:-2].max() > 0.2:
            sys.exit(f"{axis} is not the velocity: {numpy.abs(truth[axis] - change).max()}")
    rotor = data["actuator_outputs"]["output[0]"]
    if len(rotor) == 0 or not rotor.max() > 0:
        sys.exit("actuator_outputs has no rotor speeds")
    return counts


def main():
    run = Path(sys.argv[1])
    logged = tables(run / "flight.mcap")
    counts = {"csv": {}, "parquet": {}}
    for topic, (_, rows) in logged.items():
        frame = csv(run, topic)
        counts["csv"][topic] = compare_table(topic, rows, plain(frame))
        found = parquet(run, topic)
        counts["parquet"][topic] = compare_table(topic, rows, found)
        for (_, row), theirs in zip(rows, sorted(found, key=lambda theirs: order(rows[0][1], theirs))):
            row["intact"] = bool(theirs["is_intact"])
    counts["ulog"] = compare_ulog(run, logged)
    events, cycles = (pandas.read_csv(run / "csv" / f"{name}.csv") for name in ("events", "cycles"))
    if not events.equals(pandas.read_parquet(run / "parquet" / "events.parquet").astype(events.dtypes)):
        sys.exit("the events differ between CSV and Parquet")
    counts["events"] = [f"{event.node} {event.what}" for event in events.itertuples()]
    counts["logged"] = [message.message for message in ULog(str(run / "flight.ulg")).logged_messages]
    counts["parameters"] = ULog(str(run / "flight.ulg")).initial_parameters
    counts["cycles"] = cycles.groupby("node").size().to_dict()
    print(json.dumps(counts))


if __name__ == "__main__":
    main()
