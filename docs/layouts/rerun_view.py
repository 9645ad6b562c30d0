"""Writes a run as a Rerun recording with its blueprint: the vehicle, its path, thrust, wind, curves and events.

    pip install rerun-sdk mcap mcap-protobuf-support
    trefoil export runs/survey --to foxglove
    python3 docs/layouts/rerun_view.py runs/survey
    rerun runs/survey/flight.rrd

Rerun's own converter of MCAP (`rerun runs/survey/foxglove.mcap`) has transforms, poses and numbers, and no SceneUpdate,
which holds the shapes. So this script reads the same topics, and writes the shapes too.
"""

import argparse
import sys
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

#: Curves: entity, message field, names of its parts.
CURVES = {
    "/truth": {
        "position/true": ("actual.position_m", "xyz"),
        "attitude/true": ("actual.attitude_rad", ("roll", "pitch", "yaw")),
        "actuators/rotors": ("actuators.rotor_speed", ("rotor_1", "rotor_2", "rotor_3")),
        "actuators/tilt": ("actuators", ("tilt_rad",)),
    },
    "/reference": {
        "position/reference": ("position_m", "xyz"),
        "attitude/reference": ("attitude_rad", ("roll", "pitch", "yaw")),
    },
}
LEVELS = {1: "DEBUG", 2: "INFO", 3: "WARN", 4: "ERROR", 5: "CRITICAL"}


def blueprint():
    """The vehicle beside its curves, with the events below."""
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Spatial3DView(
                    origin="/scene",
                    contents=["/scene/**", "/frames/**"],
                    spatial_information=rrb.SpatialInformation(target_frame="map"),
                    eye_controls=rrb.EyeControls3D(
                        position=[-1.2, -1.6, 1.0], look_target=[0, 0, 0], tracking_entity="/scene/body/cubes"
                    ),
                ),
                rrb.TextLogView(origin="/events"),
                row_shares=[4, 1],
            ),
            rrb.Vertical(
                rrb.TimeSeriesView(origin="/position", name="Position, NED [m]"),
                rrb.TimeSeriesView(origin="/attitude", name="Attitude [rad]"),
                rrb.TimeSeriesView(origin="/actuators/rotors", name="Rotors [rotor speed unit]"),
                rrb.TimeSeriesView(origin="/actuators/tilt", name="Tilt of rotor 1 [rad]"),
            ),
        ),
        rrb.TimePanel(timeline="time", state="collapsed"),
        collapse_panels=True,
    )


def xyz(vector):
    return [vector.x, vector.y, vector.z]


def rotation(quaternion):
    return rr.Quaternion(xyzw=[quaternion.x, quaternion.y, quaternion.z, quaternion.w])


def rgba(color):
    return [round(255 * part) for part in (color.r, color.g, color.b, color.a)]


def turned(quaternion, vector):
    """The vector turned by the quaternion."""
    q, v = xyz(quaternion), vector
    cross = lambda a, b: [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    t = [2 * part for part in cross(q, v)]
    return [a + quaternion.w * b + c for a, b, c in zip(v, t, cross(q, t))]


def log_frames(message):
    """Transforms between named frames; each pair has an entity of its own."""
    for frame in message.transforms:
        rr.log(
            f"frames/{frame.child_frame_id}",
            rr.Transform3D(
                translation=xyz(frame.translation),
                quaternion=rotation(frame.rotation),
                parent_frame=frame.parent_frame_id,
                child_frame=frame.child_frame_id,
            ),
        )


def log_scene(message):
    """The shapes of each entity, in the frame of the entity."""
    for entity in message.entities:
        path = f"scene/{entity.id.replace(' ', '_')}"
        rr.log(path, rr.CoordinateFrame(entity.frame_id))
        if entity.cubes:
            rr.log(
                f"{path}/cubes",
                rr.CoordinateFrame(entity.frame_id),
                rr.Boxes3D(
                    centers=[xyz(cube.pose.position) for cube in entity.cubes],
                    sizes=[xyz(cube.size) for cube in entity.cubes],
                    quaternions=[rotation(cube.pose.orientation) for cube in entity.cubes],
                    colors=[rgba(cube.color) for cube in entity.cubes],
                    fill_mode="solid",
                ),
            )
        for shape in entity.cylinders:
            rr.log(
                f"{path}/disc",
                rr.CoordinateFrame(entity.frame_id),
                rr.Cylinders3D(lengths=shape.size.z, radii=shape.size.x / 2, colors=rgba(shape.color), fill_mode="solid"),
            )
        for shape in entity.spheres:
            half = [part / 2 for part in xyz(shape.size)]
            ball = rr.Ellipsoids3D(half_sizes=[half], colors=[rgba(shape.color)], fill_mode="solid")
            rr.log(f"{path}/ball", rr.CoordinateFrame(entity.frame_id), ball)
        if not (entity.cubes or entity.cylinders or entity.spheres):
            lengths = [arrow.shaft_length + arrow.head_length for arrow in entity.arrows]
            rr.log(
                path,
                rr.Arrows3D(
                    origins=[xyz(arrow.pose.position) for arrow in entity.arrows],
                    vectors=[
                        turned(arrow.pose.orientation, [length, 0, 0]) for arrow, length in zip(entity.arrows, lengths)
                    ],
                    colors=[rgba(arrow.color) for arrow in entity.arrows],
                    radii=0.012,
                ),
            )


def log_line(path, message, color):
    points = [xyz(pose.position) for pose in message.poses]
    rr.log(path, rr.CoordinateFrame(message.frame_id), rr.LineStrips3D([points], colors=[color], radii=0.01))


def log_curves(curves, message):
    for entity, (field, names) in curves.items():
        value = message
        for part in field.split("."):
            value = getattr(value, part)
        for name in names:
            rr.log(f"{entity}/{name}", rr.Scalars(getattr(value, name)))


def convert(log, out):
    """Writes the recording of `log` to `out`."""
    rr.init("trefoil", recording_id=str(log.resolve()))
    rr.save(out, default_blueprint=blueprint())
    rr.log("scene", rr.CoordinateFrame("map"), static=True)
    with log.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            rr.set_time("time", duration=message.log_time * 1e-9)
            match channel.topic:
                case "/view/tf" | "/view/tf_static":
                    log_frames(decoded)
                case "/view/vehicle" | "/view/arrows":
                    log_scene(decoded)
                case "/view/course":
                    log_line("scene/course", decoded, [26, 153, 77])
                case "/view/path":
                    log_line("scene/path", decoded, [230, 115, 26])
                case "/view/log":
                    rr.log("events", rr.TextLog(decoded.message, level=LEVELS.get(decoded.level, "INFO")))
                case topic if topic in CURVES:
                    log_curves(CURVES[topic], decoded)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, help="folder of a run with its foxglove.mcap, or that file")
    parser.add_argument("--out", type=Path, help="recording to write [default: flight.rrd beside the log]")
    arguments = parser.parse_args()
    log = arguments.run / "foxglove.mcap" if arguments.run.is_dir() else arguments.run
    if not log.exists():
        sys.exit(f"there is no {log}: `trefoil export RUN --to foxglove` writes it")
    out = arguments.out or log.with_name("flight.rrd")
    convert(log, out)
    print(f"written to {out}")


if __name__ == "__main__":
    main()
