"""Reads a flight log with the public MCAP and protobuf packages alone, as any user of the log would.

    pip install mcap mcap-protobuf-support
    python3 read_log.py flight.mcap

Checks topics, schemas, times and counts, then prints one line of JSON. A torn log is read to the tear. Exit code 1
with a message on stderr when something is not as promised in launcher/flight/proto/trefoil.proto.
"""

import json
import struct
import sys
import tomllib

from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from mcap_protobuf.decoder import DecoderFactory as Protobuf

SAMPLE_NS = 10_000_000

# Schema name and fields of every topic.
TOPICS = {
    "/state": ("trefoil.v1.State", "stamp applied_sequence applied_age_ns measured command_in_force"
               " status status_name arrivals arrived navigation sensed"),
    "/reference": ("trefoil.v1.Reference", "stamp position_m velocity_mps w_mps attitude_rad rates_radps"
                   " disturbance_mps2 flags preview_step_ns preview"),
    "/controls": ("trefoil.v1.Controls", "stamp demand disturbance status status_name iterations solve_ns"
                  " active_constraints fallbacks"),
    "/actuators": ("trefoil.v1.Actuators", "stamp command flags"),
    "/truth": ("trefoil.v1.Truth", "tick sequence checksum actual actuators"),
}
# Events of the processes; a flight without events has no message.
EVENTS = "/events"
EVENT = ("trefoil.v1.Event", "tick node epoch what why swap by fault_number fault origin")


class Unexpected(Exception):
    """The log is not as promised."""


def expect(condition, message):
    if not condition:
        raise Unexpected(message)


def scenario_of(file):
    """Returns the run's merged settings, the first metadata record."""
    file.seek(0)
    record = next(NonSeekingReader(file).iter_metadata())
    expect(record.name == "scenario", f"the first metadata record is {record.name}, not scenario")
    return tomllib.loads(record.metadata["toml"])


def messages_of(file):
    """Yields all messages in the order of writing, then None if the log has no footer."""
    file.seek(0)
    reader = NonSeekingReader(file, validate_crcs=True, decoder_factories=[Protobuf()])
    try:
        yield from reader.iter_decoded_messages(log_time_order=False)
    except (EndOfFile, struct.error):
        yield None


def check(schema, channel, message, decoded):
    """Checks one message against the documented format."""
    topic = channel.topic
    expect(topic in TOPICS or topic == EVENTS, f"unknown topic {topic}")
    name, fields = EVENT if topic == EVENTS else TOPICS[topic]
    expect((schema.name, schema.encoding) == (name, "protobuf"), f"{topic} holds {schema.name} in {schema.encoding}")
    found = [field.name for field in decoded.DESCRIPTOR.fields]
    expect(found == fields.split(), f"{topic} has the fields {found}")
    if topic == EVENTS:
        expect(message.log_time == decoded.tick * SAMPLE_NS, f"event at tick {decoded.tick}: log_time {message.log_time}")
        return
    if topic == "/truth":
        expect(message.log_time == decoded.tick * SAMPLE_NS, f"{topic} tick {decoded.tick}: log_time {message.log_time}")
        return
    stamp = decoded.stamp
    expect(message.log_time == stamp.tick * SAMPLE_NS, f"{topic} tick {stamp.tick}: log_time {message.log_time}")
    published = getattr(stamp.publish_ns, topic[1:])
    expect(message.publish_time == published, f"{topic} tick {stamp.tick}: publish_time {message.publish_time}")


def ordinary(path):
    """Counts the messages that the usual tutorial loop reads, by topic."""
    counts = {}
    with open(path, "rb") as file:
        for _, channel, _, _ in make_reader(file, decoder_factories=[Protobuf()]).iter_decoded_messages():
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
    return counts


def summary(path):
    """Reads and checks the log at `path`."""
    counts = dict.fromkeys([*TOPICS, EVENTS], 0)
    times_s, heights_m, complete = [], [], True
    with open(path, "rb") as file:
        scenario = scenario_of(file)
        for item in messages_of(file):
            if item is None:
                complete = False
                break
            check(*item)
            counts[item.channel.topic] += 1
            times_s.append(item.message.log_time * 1e-9)
            if item.channel.topic == "/truth":
                heights_m.append(-item.decoded_message.actual.position_m.z)
        empty = [topic for topic in TOPICS if counts[topic] == 0]
        expect(not empty, f"no message on {' '.join(empty)}")
        if complete:
            file.seek(0)
            index = make_reader(file).get_summary()
            indexed = {index.channels[number].topic: count
                       for number, count in index.statistics.channel_message_counts.items()}
            told = {topic: count for topic, count in counts.items() if count > 0}
            expect(indexed == told, f"the index counts {indexed}, the messages are {told}")
            expect(ordinary(path) == told, f"the ordinary loop reads {ordinary(path)}, the messages are {told}")
    return {
        "counts": counts,
        "first_s": min(times_s),
        "last_s": max(times_s),
        "max_height_m": max(heights_m),
        "complete": complete,
        "scenario": scenario.get("name"),
    }


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: read_log.py FILE")
    try:
        print(json.dumps(summary(sys.argv[1])))
    except Exception as error:  # whatever a foreign or damaged file provokes is the finding
        sys.exit(f"{sys.argv[1]}: {type(error).__name__}: {error}")


if __name__ == "__main__":
    main()
