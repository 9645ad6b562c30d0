//! Ground: a level plane with friction that carries the feet, and the conditions of a crash.
//!
//! Three feet are `leg_m` below the rotors. A foot at the depth `d` that sinks at `v_n` is pushed up by `N`. Along the
//! ground a spring and damper of the same `k` and `c` tie the foot to its anchor, the point where it came down; `e` is
//! its distance from the anchor and `v_t` its velocity along the ground. Coulomb friction limits this force; beyond the
//! limit the anchor follows the foot:
//!
//! ```text
//! N   = max(0, k d + c v_n)                 for d > 0
//! F_t = -(k e + c v_t), no longer than friction N
//! ```
//!
//! So a vehicle that is pushed by less than its friction stands still. If friction were a function of velocity alone,
//! the vehicle would creep. This model of the contact along the ground is that of Cundall and Strack (Geotechnique
//! 29(1), 1979).
//!
//! A spring and a damper are the usual compliant contact model of multibody simulation; Marhefka and Orin (IEEE
//! Transactions on Systems, Man, and Cybernetics A 29(6), 1999) discuss it and its jump of force at the first touch,
//! which this model has too. A vehicle in the air crashes if it touches down faster or leans more than the limits
//! below, or if a rotor or the centre touches the ground. A vehicle on its feet tips over if a rotor or the
//! centre touches the ground. [`crate::landing`] decides whether the vehicle has landed.

use contract::message::PlantStatus;
use nalgebra::{Matrix3, Vector2, Vector3};
use settings::{GroundSettings, Scenario};

use crate::landing::Footing;
use crate::memory::Tape;
use crate::rotors;

/// Number of feet.
const FEET: f64 = 3.0;
/// Height up to which a foot counts as on the ground \[m\], so that a jolt is not a take-off.
const NEAR_M: f64 = 0.01;

/// Largest horizontal speed of a touchdown \[m/s\]; a faster one is a crash.
const MAX_DRIFT_MPS: f64 = 1.0;
/// Largest tilt of the body at a touchdown \[deg\]; a larger one is a crash.
const MAX_TILT_DEG: f64 = 20.0;
/// Stiffness \[N/m\] and damping \[N s/m\] of a foot of the vehicle of Table I, which yields 5 mm under its weight and
/// comes to rest without a bounce.
const FOOT: [f64; 2] = [700.0, 25.0];
/// Mass of the vehicle of Table I \[kg\]. The stiffness of the feet of another vehicle is in proportion to its mass.
const FOOT_MASS_KG: f64 = 1.1;

/// Ground plane, and the vehicle's points that can touch it.
#[derive(Debug, Clone)]
pub struct Ground {
    settings: GroundSettings,
    /// Stiffness of one foot \[N/m\].
    stiffness_npm: f64,
    /// Damping of one foot \[N s/m\].
    damping_nspm: f64,
    /// Rotor hubs in the body frame from the centre of mass \[m\].
    hubs: [Vector3<f64>; 3],
    /// Anchor of each foot, north and east \[m\]; `None` in the air.
    anchors: [Option<Vector2<f64>>; 3],
}

/// Motion of the vehicle, from which the motion of each of its points follows.
#[derive(Debug, Clone, Copy)]
pub struct BodyMotion {
    /// Position of the centre of mass, NED \[m\].
    pub position_m: Vector3<f64>,
    /// Body velocity \[m/s\].
    pub velocity_mps: Vector3<f64>,
    /// Body rates \[rad/s\].
    pub rates_radps: Vector3<f64>,
    /// Rotation from body to navigation frame.
    pub cnb: Matrix3<f64>,
}

impl BodyMotion {
    /// Position of the body point `at` and its velocity, NED \[m, m/s\].
    fn of(&self, at: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        (self.position_m + self.cnb * at, self.cnb * (self.velocity_mps + self.rates_radps.cross(at)))
    }
}

impl Ground {
    /// Builds the ground of `scenario`; `None` if the scenario has no ground.
    pub fn new(scenario: &Scenario) -> Option<Self> {
        let settings = scenario.plant.ground.clone();
        let hubs = rotors::hubs(scenario);
        let [stiffness_npm, damping_nspm] = FOOT.map(|of| of * (scenario.airframe.mass_kg / FOOT_MASS_KG));
        let present = settings.present;
        present.then_some(Self { settings, stiffness_npm, damping_nspm, hubs, anchors: [None; 3] })
    }

    /// Feet in the body frame \[m\].
    fn feet(&self) -> [Vector3<f64>; 3] {
        self.hubs.map(|hub| hub + Vector3::new(0.0, 0.0, self.settings.leg_m))
    }

    /// Force and moment of the ground on the vehicle in the body frame \[N, N m\].
    pub fn push(&self, motion: &BodyMotion) -> (Vector3<f64>, Vector3<f64>) {
        let (mut force_n, mut moment_nm) = (Vector3::zeros(), Vector3::zeros());
        for (foot, anchor) in self.feet().iter().zip(&self.anchors) {
            let (at_m, velocity_mps) = motion.of(foot);
            let normal_n = self.normal_n(&at_m, &velocity_mps);
            if normal_n > 0.0 {
                let stretch_m = anchor.map_or(Vector2::zeros(), |anchor| at_m.xy() - anchor);
                let pull_n = stretch_m * self.stiffness_npm + velocity_mps.xy() * self.damping_nspm;
                let along_n = pull_n.cap_magnitude(self.settings.friction * normal_n);
                let force = motion.cnb.tr_mul(&Vector3::new(-along_n.x, -along_n.y, -normal_n));
                force_n += force;
                moment_nm += foot.cross(&force);
            }
        }
        (force_n, moment_nm)
    }

    /// Updates the anchors at the end of a step: anchors the feet that have come down, and moves anchors whose spring
    /// would exceed the friction. Returns the length of the mean slide of the feet \[m\], which is small for a turn on
    /// the spot.
    pub fn settle(&mut self, motion: &BodyMotion) -> f64 {
        let mut slid_m = Vector2::zeros();
        for (i, foot) in self.feet().iter().enumerate() {
            let (at_m, velocity_mps) = motion.of(foot);
            let normal_n = self.normal_n(&at_m, &velocity_mps);
            self.anchors[i] = (normal_n > 0.0).then(|| {
                let reach_m = self.settings.friction * normal_n / self.stiffness_npm;
                let before = self.anchors[i].unwrap_or(at_m.xy());
                let anchor = at_m.xy() - (at_m.xy() - before).cap_magnitude(reach_m);
                slid_m += (anchor - before) / FEET;
                anchor
            });
        }
        slid_m.norm()
    }

    /// Writes or reads the anchors.
    pub fn remember(&mut self, tape: &mut Tape) {
        for anchor in &mut self.anchors {
            tape.option(anchor, Tape::value);
        }
    }

    /// Force of the ground on a foot that is at `at_m` and moves at `velocity_mps`, NED, upwards \[N\]; 0 in the air.
    fn normal_n(&self, at_m: &Vector3<f64>, velocity_mps: &Vector3<f64>) -> f64 {
        let depth_m = at_m.z - self.settings.down_m;
        if depth_m > 0.0 { (self.stiffness_npm * depth_m + self.damping_nspm * velocity_mps.z).max(0.0) } else { 0.0 }
    }

    /// Depth of the body point `at` below the ground \[m\].
    fn depth_m(&self, motion: &BodyMotion, at: &Vector3<f64>) -> f64 {
        motion.of(at).0.z - self.settings.down_m
    }

    /// Returns whether a foot touches the ground.
    pub fn carries(&self, motion: &BodyMotion) -> bool {
        self.feet().iter().any(|foot| self.depth_m(motion, foot) > 0.0)
    }

    /// Footing by the number of feet on the ground, or at most `NEAR_M` above it.
    pub fn footing(&self, motion: &BodyMotion) -> Footing {
        match self.feet().iter().filter(|foot| self.depth_m(motion, foot) > -NEAR_M).count() {
            0 => Footing::None,
            3 => Footing::All,
            _ => Footing::Some,
        }
    }

    /// Returns `Crashed` or `TippedOver`, else `None`. `was_on_feet` says whether a foot touched the ground before.
    pub fn breaks(&self, motion: &BodyMotion, was_on_feet: bool) -> Option<PlantStatus> {
        let is_struck = self.hubs.iter().chain([&Vector3::zeros()]).any(|part| self.depth_m(motion, part) > 0.0);
        let is_hard = !was_on_feet && self.carries(motion) && !self.is_gentle(motion);
        let has_crashed = is_hard || is_struck && !was_on_feet;
        let tipped_over = is_struck.then_some(PlantStatus::TippedOver);
        if has_crashed { Some(PlantStatus::Crashed) } else { tipped_over }
    }

    fn is_gentle(&self, motion: &BodyMotion) -> bool {
        let velocity = motion.cnb * motion.velocity_mps;
        let tilt_deg = libm::acos(motion.cnb[(2, 2)].clamp(-1.0, 1.0)).to_degrees();
        let is_slow = velocity.z <= self.settings.max_sink_mps && libm::hypot(velocity.x, velocity.y) <= MAX_DRIFT_MPS;
        is_slow && tilt_deg <= MAX_TILT_DEG
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ground() -> Ground {
        let mut scenario = Scenario::default();
        scenario.plant.ground.present = true;
        Ground::new(&scenario).expect("there is one")
    }

    /// Level motion at `velocity_mps` with the feet at `depth_m`.
    fn level(depth_m: f64, velocity_mps: [f64; 3]) -> BodyMotion {
        let GroundSettings { leg_m, down_m, .. } = GroundSettings::default();
        BodyMotion {
            position_m: Vector3::new(0.0, 0.0, down_m - leg_m + depth_m),
            velocity_mps: velocity_mps.into(),
            rates_radps: Vector3::zeros(),
            cnb: Matrix3::identity(),
        }
    }

    #[test]
    fn the_ground_pushes_up_only_feet_below_it() {
        let [stiffness_npm, damping_nspm] = FOOT;
        let (force, moment) = ground().push(&level(0.01, [0.0, 0.0, 0.1]));
        assert!(
            (force.z + 3.0 * (stiffness_npm * 0.01 + damping_nspm * 0.1)).abs() < 1e-9 && force.xy().norm() < 1e-12
        );
        assert!(moment.x.abs() < 1e-12, "left and right alike");
        assert_eq!(ground().push(&level(-0.001, [0.0, 0.0, 5.0])).0, Vector3::zeros());
        assert_eq!(ground().push(&level(0.001, [0.0, 0.0, -5.0])).0, Vector3::zeros(), "it does not hold back");
    }

    #[test]
    fn the_feet_of_a_heavier_vehicle_are_as_much_stiffer() {
        let mut heavier = Scenario::default();
        heavier.plant.ground.present = true;
        heavier.airframe.mass_kg *= 2.0;
        let [one, two] = [ground(), Ground::new(&heavier).expect("there is one")]
            .map(|ground| ground.push(&level(0.01, [0.0, 0.0, 0.1])).0.z);
        assert!((two - 2.0 * one).abs() < 1e-9, "{one} {two}");
    }

    #[test]
    fn friction_brakes_and_is_no_larger_than_its_share_of_the_load() {
        let friction = |v: f64| ground().push(&level(0.01, [v, 0.0, 0.0]));
        let load_n = -friction(0.0).0.z;
        let share = GroundSettings::default().friction;
        assert!(
            (friction(2.0).0.x + share * load_n).abs() < 1e-9 && (friction(-2.0).0.x - share * load_n).abs() < 1e-9
        );
        assert!((friction(0.01).0.x + 3.0 * FOOT[1] * 0.01).abs() < 1e-9);
        assert!(friction(2.0).1.y < friction(0.0).1.y, "feet that are held back pitch the nose down");
    }

    #[test]
    fn feet_at_rest_are_held_by_less_than_friction_and_slide_beyond_it() {
        let ([stiffness_npm, _], friction) = (FOOT, GroundSettings::default().friction);
        let reach_m = friction * 0.01;
        let mut ground = ground();
        let at = |north_m: f64| {
            let motion = level(0.01, [0.0; 3]);
            BodyMotion { position_m: motion.position_m + Vector3::new(north_m, 0.0, 0.0), ..motion }
        };
        assert_eq!(ground.settle(&at(0.0)), 0.0, "it comes down");
        let held = at(0.8 * reach_m);
        for _ in 0..1000 {
            assert_eq!(ground.settle(&held), 0.0, "and stays");
        }
        assert!((ground.push(&held).0.x + 3.0 * stiffness_npm * 0.8 * reach_m).abs() < 1e-9);
        assert!((ground.settle(&at(1.5 * reach_m)) - 0.5 * reach_m).abs() < 1e-12, "the rest is a slide");
        assert_eq!(ground.settle(&level(-0.001, [0.0; 3])), 0.0);
        assert_eq!(ground.settle(&at(5.0)), 0.0, "it comes down elsewhere");
    }

    #[test]
    fn a_gentle_touch_is_a_landing_and_others_are_not() {
        let touches = |motion: &BodyMotion| ground().breaks(motion, false);
        let crashed = Some(PlantStatus::Crashed);
        assert_eq!(touches(&level(0.001, [0.5, 0.0, 0.7])), None);
        assert_eq!(touches(&level(0.001, [0.0, 0.0, 3.0])), crashed, "too fast down");
        assert_eq!(touches(&level(0.001, [0.0, 3.0, 0.5])), crashed, "too fast sideways");
        let leaning =
            BodyMotion { cnb: *nalgebra::Rotation3::from_euler_angles(0.5, 0.0, 0.0).matrix(), ..level(0.0, [0.0; 3]) };
        assert_eq!((touches(&leaning), ground().breaks(&leaning, true)), (crashed, None));
    }

    #[test]
    fn a_touching_rotor_is_a_crash_from_the_air_and_a_tip_over_from_the_feet() {
        let sunk = level(0.5, [0.0; 3]);
        assert_eq!(ground().breaks(&sunk, false), Some(PlantStatus::Crashed));
        assert_eq!(ground().breaks(&sunk, true), Some(PlantStatus::TippedOver));
    }

    #[test]
    fn feet_are_down_one_by_one() {
        let leaning = |depth_m: f64| {
            let cnb = *nalgebra::Rotation3::from_euler_angles(0.2, 0.0, 0.0).matrix();
            ground().footing(&BodyMotion { cnb, ..level(depth_m, [0.0; 3]) })
        };
        assert_eq!([leaning(-0.2), leaning(0.0), leaning(0.2)], [Footing::None, Footing::Some, Footing::All]);
        assert_eq!(ground().footing(&level(-0.005, [0.0; 3])), Footing::All, "a jolt");
    }

    #[test]
    fn a_scenario_without_a_ground_builds_none() {
        assert!(Ground::new(&Scenario::default()).is_none());
    }
}
