"""Checks the derived messages of a log by the public package of Foxglove's schemas.

    pip install mcap mcap-protobuf-support foxglove-schemas-protobuf
    python3 read_view.py flight.mcap

Decodes every message twice: by the schema in the log, and by the package. Compares the frames with the states of the
same times, and the arrows with the rotor speeds. Prints one line of JSON; exit code 1 with a message if a value
differs.
"""

import collections
import json
import math
import sys
import tomllib

from foxglove_schemas_protobuf import FrameTransforms_pb2, Log_pb2, PosesInFrame_pb2, SceneUpdate_pb2
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

TYPES = {
    "foxglove.FrameTransforms": FrameTransforms_pb2.FrameTransforms,
    "foxglove.SceneUpdate": SceneUpdate_pb2.SceneUpdate,
    "foxglove.PosesInFrame": PosesInFrame_pb2.PosesInFrame,
    "foxglove.Log": Log_pb2.Log,
}
#: Lengths of arrows, as in launcher/view/src/scene/mod.rs.
THRUST_M_PER_N, WIND_M_PER_MPS = 0.08, 0.2
KF = 1.970e-6
#: Bytes of a message in the file besides its data: opcode, length, channel, sequence, two times.
HEADER_BYTES = 31


def expect(condition, message):
    if not condition:
        sys.exit(message)


def xyz(vector):
    return (vector.x, vector.y, vector.z)


def turned(q, v):
    """Returns the vector `v` rotated by the quaternion `q`."""
    u = (q.x, q.y, q.z)
    cross = lambda a, b: (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    t = tuple(2 * c for c in cross(u, v))
    return tuple(a + q.w * b + c for a, b, c in zip(v, t, cross(u, t)))


def nose(attitude):
    """Returns the direction of the body's forward axis in NED, by the Euler angles."""
    return (math.cos(attitude.pitch) * math.cos(attitude.yaw), math.cos(attitude.pitch) * math.sin(attitude.yaw),
            -math.sin(attitude.pitch))


def near(one, other, what):
    expect(all(abs(a - b) < 1e-9 for a, b in zip(one, other, strict=True)), f"{what}: {one} is not {other}")


def length(arrow):
    return arrow.shaft_length + arrow.head_length


def read(path):
    truths, derived, size = {}, collections.defaultdict(list), collections.Counter()
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        wind = tomllib.loads(next(reader.iter_metadata()).metadata["toml"])["plant"]["wind_ned_mps"]
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            size[channel.topic.startswith("/view/")] += len(message.data) + HEADER_BYTES
            if channel.topic == "/truth":
                truths[message.log_time] = decoded
            elif channel.topic.startswith("/view/"):
                by_package = TYPES[schema.name].FromString(message.data)
                expect(by_package.SerializeToString() == decoded.SerializeToString(), f"{schema.name} is another schema")
                derived[channel.topic].append((message.log_time, by_package))
    return truths, derived, wind, size[True] / size[False]


def main():
    truths, derived, wind, share = read(sys.argv[1])
    parents = {}
    for topic in ("/view/tf_static", "/view/tf"):
        for time_ns, frames in derived[topic]:
            for frame in frames.transforms:
                parents[frame.child_frame_id] = frame.parent_frame_id
                expect(frame.timestamp.ToNanoseconds() == time_ns, f"{topic}: a frame of another time")
                q = frame.rotation
                expect(abs(q.x**2 + q.y**2 + q.z**2 + q.w**2 - 1) < 1e-9, f"{frame} has no unit quaternion")
    ned = derived["/view/tf_static"][0][1].transforms[0]
    for axis, expected in (((1, 0, 0), (0, 1, 0)), ((0, 1, 0), (1, 0, 0)), ((0, 0, 1), (0, 0, -1))):
        near(turned(ned.rotation, axis), expected, "an axis of ned in map: east, north, up")
    for time_ns, frames in derived["/view/tf"]:
        truth, (body, rotor, _) = truths[time_ns], frames.transforms
        near(xyz(body.translation), xyz(truth.actual.position_m), "position")
        near(turned(body.rotation, (1, 0, 0)), nose(truth.actual.attitude_rad), "nose")
        tilt = truth.actuators.tilt_rad
        near(turned(rotor.rotation, (0, 0, -1)), (0, math.sin(tilt), -math.cos(tilt)), "axis of rotor 1")
    for time_ns, scene in derived["/view/arrows"]:
        truth, entities = truths[time_ns], {entity.id: entity for entity in scene.entities}
        for rotor in (1, 2, 3):
            arrow, = entities[f"thrust {rotor}"].arrows
            speed = getattr(truth.actuators.rotor_speed, f"rotor_{rotor}")
            near((length(arrow),), (KF * speed**2 * THRUST_M_PER_N,), f"thrust {rotor}")
            near(turned(arrow.pose.orientation, (1, 0, 0)), (0, 0, -1), "thrust points up")
        blows = [velocity for from_s, velocity in wind if time_ns >= from_s * 1e9 - 1]
        arrows = entities["wind"].arrows
        expect(len(arrows) == (1 if blows and any(blows[-1]) else 0), f"{len(arrows)} arrows for the wind {blows}")
        for arrow in arrows:
            along = turned(arrow.pose.orientation, (length(arrow) / WIND_M_PER_MPS, 0, 0))
            near(along, blows[-1], "wind")
    (_, vehicle), = derived["/view/vehicle"]
    frames = {entity.frame_id for entity in vehicle.entities} | {"rotor_1", "ned"}
    expect(frames <= parents.keys(), f"no transform to {frames - parents.keys()}")
    (_, course), = derived["/view/course"]
    times_s = [time_ns / 1e9 for time_ns, _ in derived["/view/tf"]]
    gaps = [after - before for before, after in zip(times_s, times_s[1:])]
    print(json.dumps({
        "counts": {topic: len(found) for topic, found in sorted(derived.items())},
        "share": share,
        "gap_s": [round(min(gaps), 3), round(max(gaps), 3)],
        "course": [len(course.poses), course.frame_id],
        "path": len(derived["/view/path"][-1][1].poses),
        "parents": parents,
        "log": [f"{Log_pb2.Log.Level.Name(log.level)} {log.message}" for _, log in derived["/view/log"]],
    }))


if __name__ == "__main__":
    main()
