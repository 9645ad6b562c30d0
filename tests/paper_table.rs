//! The numbers of the two airframes on docs/paper.md are those that the code computes.

use airframe::{Parameters, Trim};
use settings::Scenario;

use crate::harness::top;

/// Returns the number of digits after the point.
fn digits(printed: &str) -> usize {
    printed.split_once('.').map_or(0, |(_, digits)| digits.len())
}

/// Computes the figure of the row `row` of the page for the airframe of `scenario`.
fn of_the_airframe(row: &str, scenario: &Scenario) -> f64 {
    let vehicle = &scenario.airframe;
    let Parameters { g_mps2, mass_kg, iyy_kgm2, kf, km, .. } = *vehicle;
    let trim = Trim::solve(vehicle, false);
    let [omega_1, omega_2, _] = trim.actuation.rotor_speed;
    let moment_nm = km * omega_1 * omega_1 * trim.actuation.tilt_rad.sin();
    let full_thrust_n: f64 = scenario.limits().rotor_speed_max.iter().map(|omega| kf * omega * omega).sum();
    match row {
        "mass, kg" => mass_kg,
        "Ixx, kg m2" => vehicle.ixx_kgm2,
        "Iyy, kg m2" => iyy_kgm2,
        "Izz, kg m2" => vehicle.izz_kgm2,
        "K_M / K_F, m" => km / kf,
        "Omega_1 at trim" => omega_1,
        "Omega_2 at trim" => omega_2,
        "roll at trim, degrees" => trim.roll_rad.to_degrees(),
        "tilt at trim, degrees" => trim.actuation.tilt_rad.to_degrees(),
        "thrust over weight at full speed" => full_thrust_n / (mass_kg * g_mps2),
        "power at the shafts in hover, W" => trim.actuation.rotor_speed.iter().map(|omega| km * omega.powi(3)).sum(),
        "neglected moment K_M Omega_1^2 sin mu, N m" => moment_nm,
        "the same over Iyy, rad/s2" => moment_nm / iyy_kgm2,
        row => panic!("no such row of an airframe: {row}"),
    }
}

#[test]
fn the_airframes_have_the_numbers_of_the_page() {
    let [paper, ten_inch] = ["airframe.preset=\"paper\"", "airframe.preset=\"ten-inch\""]
        .map(|preset| settings::load(None, &["profile=\"paper\"".into(), preset.into()]).expect("settings"));
    let page = std::fs::read_to_string(top().join("docs/paper.md")).expect("a page that is readable");
    let table = page.lines().skip_while(|line| !line.starts_with("| of the airframe")).skip(2);
    let rows: Vec<&str> = table.take_while(|line| line.starts_with('|')).collect();
    assert_eq!(rows.len(), 13);
    for row in rows {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        for (scenario, printed) in [&paper, &ten_inch].into_iter().zip(&cells[1..]) {
            assert_eq!(
                format!("{:.*}", digits(printed), of_the_airframe(cells[0], scenario)),
                **printed,
                "{}",
                cells[0]
            );
        }
    }
}
