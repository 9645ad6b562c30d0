//! Shapes of the vehicle, each in the frame that it moves with.

use airframe::Parameters;

use super::parts::wire::foxglove::SceneEntity;
use super::parts::{DARK, DISC, GREEN, LEVEL, ORANGE, along, cube, disc, entity, sphere};

/// Radius of a rotor's disc, as a share of the distance between rotor and centre.
const DISC_SHARE: f64 = 0.55;
/// Thickness of an arm \[m\].
const ARM_M: f64 = 0.025;

/// Returns the hub of a rotor, counted from 0, in the body frame \[m\].
pub fn hub(vehicle: &Parameters, rotor: usize) -> [f64; 3] {
    let Parameters { l1_m, l2_m, l3_m, .. } = *vehicle;
    [[l1_m, 0.0, 0.0], [-l2_m, l3_m, 0.0], [-l2_m, -l3_m, 0.0]][rotor]
}

/// Returns body, arms and rotors of a vehicle, and a ball for the reference. The front arm has another colour.
pub fn vehicle(vehicle: &Parameters) -> Vec<SceneEntity> {
    let mut body = entity("body", "body", 0);
    body.cubes.push(cube([0.0; 3], LEVEL, [0.16, 0.1, 0.06], DARK));
    let mut all = vec![];
    for rotor in 0..3 {
        let at_m = hub(vehicle, rotor);
        let length_m = at_m.iter().map(|part| part * part).sum::<f64>().sqrt();
        let color = if rotor == 0 { ORANGE } else { DARK };
        let direction = along(at_m.map(|part| part / length_m));
        body.cubes.push(cube(at_m.map(|part| part / 2.0), direction, [length_m, ARM_M, ARM_M], color));
        let name = format!("rotor_{}", rotor + 1);
        all.push(SceneEntity { cylinders: vec![disc(length_m * DISC_SHARE, DISC)], ..entity(&name, &name, 0) });
    }
    all.push(SceneEntity { spheres: vec![sphere(0.15, GREEN)], ..entity("reference", "reference", 0) });
    all.push(body);
    all
}
