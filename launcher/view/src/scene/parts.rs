//! Parts of messages in Foxglove's schemas. Quaternions are w, x, y, z; lengths are in metres.

use std::f64::consts::FRAC_1_SQRT_2;

use self::wire::foxglove::{
    ArrowPrimitive, Color, CubePrimitive, CylinderPrimitive, FrameTransform, Pose, Quaternion, SceneEntity,
    SpherePrimitive, Vector3,
};

pub use self::wire::google::protobuf::Timestamp;

/// Types generated from `proto/foxglove.proto`.
pub mod wire {
    #![expect(clippy::pedantic, clippy::enum_variant_names, reason = "generated code")]
    pub mod google {
        pub mod protobuf {
            include!(concat!(env!("OUT_DIR"), "/google.protobuf.rs"));
        }
    }
    pub mod foxglove {
        include!(concat!(env!("OUT_DIR"), "/foxglove.rs"));
    }
}

/// Identity rotation.
pub const LEVEL: [f64; 4] = [1.0, 0.0, 0.0, 0.0];
/// Rotation that turns the forward axis up: an arrow of Foxglove points forward.
pub const UP: [f64; 4] = [FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2, 0.0];

pub const ORANGE: Color = Color { r: 0.9, g: 0.45, b: 0.1, a: 1.0 };
pub const BLUE: Color = Color { r: 0.2, g: 0.5, b: 0.9, a: 0.9 };
pub const GREEN: Color = Color { r: 0.1, g: 0.6, b: 0.3, a: 0.6 };
pub const DARK: Color = Color { r: 0.25, g: 0.27, b: 0.3, a: 1.0 };
pub const DISC: Color = Color { r: 0.5, g: 0.55, b: 0.6, a: 0.6 };

pub fn timestamp(time_ns: u64) -> Timestamp {
    Timestamp { seconds: (time_ns / 1_000_000_000) as i64, nanos: (time_ns % 1_000_000_000) as i32 }
}

pub fn frame(parent: &str, child: &str, at_m: [f64; 3], rotation: [f64; 4], time: Timestamp) -> FrameTransform {
    FrameTransform {
        timestamp: Some(time),
        parent_frame_id: parent.into(),
        child_frame_id: child.into(),
        translation: Some(vector(at_m)),
        rotation: pose([0.0; 3], rotation).orientation,
    }
}

/// Makes an entity without shapes that moves with its frame.
pub fn entity(frame: &str, id: &str, time_ns: u64) -> SceneEntity {
    let (timestamp, frame_id, id) = (Some(timestamp(time_ns)), frame.into(), id.into());
    SceneEntity { timestamp, frame_id, id, frame_locked: true, ..SceneEntity::default() }
}

/// Returns the rotation that turns the forward axis into a unit `direction`.
pub fn along([x, y, z]: [f64; 3]) -> [f64; 4] {
    let turned = [1.0 + x, 0.0, -z, y];
    let length = turned.iter().map(|part| part * part).sum::<f64>().sqrt();
    // Backwards, half a turn about any axis across the forward axis serves.
    if length < 1e-9 { [0.0, 0.0, 0.0, 1.0] } else { turned.map(|part| part / length) }
}

pub fn vector([x, y, z]: [f64; 3]) -> Vector3 {
    Vector3 { x, y, z }
}

pub fn pose(position_m: [f64; 3], [w, x, y, z]: [f64; 4]) -> Pose {
    Pose { position: Some(vector(position_m)), orientation: Some(Quaternion { x, y, z, w }) }
}

pub fn arrow(from_m: [f64; 3], direction: [f64; 4], length_m: f64, color: Color) -> ArrowPrimitive {
    const HEAD_M: f64 = 0.06;
    ArrowPrimitive {
        pose: Some(pose(from_m, direction)),
        shaft_length: (length_m - HEAD_M).max(0.0),
        shaft_diameter: 0.02,
        head_length: HEAD_M.min(length_m),
        head_diameter: 0.05,
        color: Some(color),
    }
}

pub fn cube(at_m: [f64; 3], rotation: [f64; 4], size_m: [f64; 3], color: Color) -> CubePrimitive {
    CubePrimitive { pose: Some(pose(at_m, rotation)), size: Some(vector(size_m)), color: Some(color) }
}

pub fn disc(radius_m: f64, color: Color) -> CylinderPrimitive {
    CylinderPrimitive {
        pose: Some(pose([0.0; 3], LEVEL)),
        size: Some(vector([2.0 * radius_m, 2.0 * radius_m, 0.01])),
        bottom_scale: 1.0,
        top_scale: 1.0,
        color: Some(color),
    }
}

pub fn sphere(diameter_m: f64, color: Color) -> SpherePrimitive {
    SpherePrimitive { pose: Some(pose([0.0; 3], LEVEL)), size: Some(vector([diameter_m; 3])), color: Some(color) }
}
