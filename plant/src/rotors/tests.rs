use airframe::{Parameters, Trim};

use super::*;

/// Rotors after `change` to the scenario, and the actuator positions at hover.
fn rotors(change: impl Fn(&mut Scenario)) -> (Rotors, Actuation) {
    let mut scenario = Scenario::default();
    change(&mut scenario);
    (Rotors::new(&scenario), Trim::solve(&Parameters::default(), false).actuation)
}

#[test]
fn without_air_thrust_and_torque_are_those_of_the_paper() {
    let (rotors, mut at) = rotors(|scenario| scenario.plant.tilt_reaction = true);
    (at.rotor_speed, at.tilt_rad) = ([1300.0, 1200.0, 1100.0], 0.3);
    let (air, rates) = (Vector3::new(3.0, -2.0, 1.0), Vector3::new(0.5, -0.3, 0.2));
    let Wrench { force_n, moment_nm } = rotors.thrust(&at, &Condition::default(), &air, &rates);
    let Parameters { l1_m: l1, l2_m: l2, l3_m: l3, kf, km, .. } = Parameters::default();
    let [f1, f2, f3] = at.rotor_speed.map(|omega| kf * omega * omega);
    let [m1, m2, m3] = at.rotor_speed.map(|omega| km * omega * omega);
    let (sin, cos) = 0.3_f64.sin_cos();
    let force = Vector3::new(0.0, f1 * sin, -(f1 * cos + f2 + f3));
    let moment =
        Vector3::new(-l3 * (f2 - f3), -l2 * (f2 + f3) + l1 * f1 * cos + m1 * sin, l1 * f1 * sin - m1 * cos + m2 - m3);
    assert!((force_n - force).norm() < 1e-14 && (moment_nm - moment).norm() < 1e-14);
}

#[test]
fn spinning_rotors_precess() {
    let (rotors, at) = rotors(|scenario| scenario.plant.rotor.inertia_kgm2 = 2e-5);
    let h = rotors.momentum(&at, &Actuation::default()).own;
    // Two rotors turn clockwise seen from above, one counter-clockwise: the sum points down.
    let [o1, o2, o3] = at.rotor_speed;
    assert!((h.z - 2e-5 * (o1 * at.tilt_rad.cos() - o2 + o3)).abs() < 1e-15 && h.z > 0.0);
    assert!((h.y + 2e-5 * o1 * at.tilt_rad.sin()).abs() < 1e-15);
    // The momentum of a vehicle that rolls right turns to the left: rotors that spin clockwise then pitch the vehicle
    // up.
    let needed = Vector3::new(1.0, 0.0, 0.0).cross(&h);
    assert!(needed.y < 0.0, "to keep rolling it would have to be pitched down, so it pitches up");
}

#[test]
fn a_rotor_that_spins_up_turns_the_vehicle_against_it() {
    let (rotors, at) = rotors(|scenario| scenario.plant.rotor.inertia_kgm2 = 2e-5);
    let spin_up = |rotor: usize| {
        let mut rates = Actuation::default();
        rates.rotor_speed[rotor] = 1000.0;
        -rotors.momentum(&at, &rates).rate.z
    };
    assert!(spin_up(2) < 0.0 && (spin_up(2) + 0.02).abs() < 1e-15, "clockwise, so the nose goes left");
    assert!(spin_up(1) > 0.0 && spin_up(0) < 0.0);
    let tilting = Actuation { tilt_rad: 1.0, ..Actuation::default() };
    assert!(rotors.momentum(&at, &tilting).rate.y < 0.0, "its axis leans to the left");
}

#[test]
fn a_climb_costs_thrust_and_a_cross_wind_pushes() {
    let plain = rotors(|_| ());
    let (rotors, at) = rotors(|scenario| {
        scenario.plant.rotor.inflow_ns2pm = 1e-4;
        scenario.plant.rotor.h_force_ns2pm = 2e-5;
    });
    let more = |air: Vector3<f64>| {
        let sound = Condition::default();
        let still = Vector3::zeros();
        rotors.thrust(&at, &sound, &air, &still).force_n - plain.0.thrust(&at, &sound, &air, &still).force_n
    };
    assert_eq!(more(Vector3::zeros()), Vector3::zeros());
    let ([o1, o2, o3], (sin, cos)) = (at.rotor_speed, at.tilt_rad.sin_cos());
    let climbing = more(Vector3::new(0.0, 0.0, -2.0));
    let lost = 2.0 * (1e-4 * (o1 * cos * cos + o2 + o3) + 2e-5 * o1 * sin * sin);
    assert!((climbing.z - lost).abs() < 1e-12, "less lift: {climbing}");
    let forward = more(Vector3::new(3.0, 0.0, 0.0));
    assert!((forward.x + 3.0 * 2e-5 * (o1 + o2 + o3)).abs() < 1e-12, "it brakes: {forward}");
}

#[test]
fn a_vehicle_that_turns_is_damped_at_its_hubs() {
    let plain = rotors(|_| ());
    let (rotors, at) = rotors(|scenario| {
        scenario.plant.rotor.inflow_ns2pm = 1e-4;
        scenario.plant.rotor.h_force_ns2pm = 2e-5;
    });
    let more = |rates: Vector3<f64>| {
        let (sound, still) = (Condition::default(), Vector3::zeros());
        rotors.thrust(&at, &sound, &still, &rates).moment_nm - plain.0.thrust(&at, &sound, &still, &rates).moment_nm
    };
    let ([o1, o2, o3], (sin, cos)) = (at.rotor_speed, at.tilt_rad.sin_cos());
    let Parameters { l1_m: l1, l2_m: l2, l3_m: l3, .. } = Parameters::default();
    let (inflow, across) = (1e-4, 2e-5);
    // Rolling at p moves the right hub down and the left hub up at p l3, which changes the inflow of each by p l3.
    let roll = more(Vector3::x());
    assert!((roll.x + inflow * l3 * l3 * (o2 + o3)).abs() < 1e-12, "it damps the roll: {roll}");
    // Pitching at q moves the front hub, whose axis is tilted, up at q l1, and the rear hubs down at q l2.
    let pitch = more(Vector3::y());
    let front = (inflow * cos * cos + across * sin * sin) * o1 * l1 * l1;
    assert!((pitch.y + front + inflow * l2 * l2 * (o2 + o3)).abs() < 1e-12, "it damps the pitch: {pitch}");
    // Yawing at r moves the hubs across the air.
    let yaw = more(Vector3::z());
    let front = (inflow * sin * sin + across * cos * cos) * o1 * l1 * l1;
    assert!((yaw.z + front + across * (l2 * l2 + l3 * l3) * (o2 + o3)).abs() < 1e-12, "it damps the yaw: {yaw}");
}
