//! Keys of earlier versions, which are refused by the name of what takes their place. The table leaves with the first
//! release.

/// Replacement of a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Now {
    /// Key in seconds where the old one was in samples.
    Seconds(&'static str),
    /// None; the words say what to do.
    Gone(&'static str),
}

/// Old keys.
pub const MOVED: [(&str, Now); 4] = [
    ("mpc.np", Now::Seconds("mpc.prediction_horizon_s")),
    ("mpc.nu", Now::Seconds("mpc.control_horizon_s")),
    ("plant.sensors.attitude", Now::Gone("no sensor of the EKF measures it; without one `plant.noise` is the error")),
    (
        "plant.sensors.filter_radps",
        Now::Gone("the complementary filter has left; set `plant.sensors.filter` = \"ekf\""),
    ),
];
