//! Place on the earth that the origin of the flight's NED frame stands for.
//!
//! The simulated flight has no place. Positions near the origin become degrees by the formula for a plane that touches
//! a sphere there: `latitude = latitude of home + x / R`, `longitude = longitude of home + y / (R cos(latitude of
//! home))`, in radians, with the mean radius R of the earth. 500 m from home, the farthest that a flight gets, the
//! error against a sphere is below 0.1 m at latitudes up to 60 degrees. Homes beyond 80 degrees are refused.

use std::str::FromStr;

/// Mean radius of the earth \[m\].
const RADIUS_M: f64 = 6_371_000.0;
/// Latitude beyond which the formula is not used \[degrees\].
const MAX_LATITUDE_DEG: f64 = 80.0;

/// Latitude, longitude and height of the origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Home {
    /// Latitude \[degrees\], north positive.
    pub latitude_deg: f64,
    /// Longitude \[degrees\], east positive.
    pub longitude_deg: f64,
    /// Height above mean sea level \[m\].
    pub height_m: f64,
}

impl Home {
    /// Default of `--home`: the place where PX4's simulators begin, at Zurich.
    pub const USUAL: &str = "47.397742,8.545594,488";

    /// Returns latitude and longitude \[1e-7 degrees\] and height \[mm\] of a position in NED \[m\].
    pub fn at(&self, ned_m: [f64; 3]) -> [i32; 3] {
        let [north_m, east_m, down_m] = ned_m;
        let latitude_deg = self.latitude_deg + (north_m / RADIUS_M).to_degrees();
        let parallel_m = RADIUS_M * libm::cos(self.latitude_deg.to_radians());
        let longitude_deg = self.longitude_deg + (east_m / parallel_m).to_degrees();
        [latitude_deg * 1e7, longitude_deg * 1e7, (self.height_m - down_m) * 1e3].map(|value| value.round() as i32)
    }
}

impl FromStr for Home {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Vec<f64> = text.split(',').filter_map(|number| number.trim().parse().ok()).collect();
        match numbers[..] {
            [latitude_deg, longitude_deg, height_m]
                if text.split(',').count() == 3
                    && latitude_deg.abs() <= MAX_LATITUDE_DEG
                    && longitude_deg.abs() <= 180.0
                    && height_m.abs() <= 1e4 =>
            {
                Ok(Self { latitude_deg, longitude_deg, height_m })
            }
            _ => Err(format!(
                "'{text}' is no home: LATITUDE,LONGITUDE,HEIGHT in degrees (at most 80 north or south) and metres, for example {}",
                Self::USUAL
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_minute_of_latitude_is_a_nautical_mile_and_one_of_longitude_is_shorter() {
        let home: Home = "60,10,100".parse().unwrap();
        let [latitude, longitude, height] = home.at([0.0, 0.0, 0.0]);
        assert_eq!([latitude, longitude, height], [600_000_000, 100_000_000, 100_000]);
        let [latitude, longitude, height] = home.at([185.3, 185.3, -20.0]);
        let minutes = |e7: i32, from: i32| f64::from(e7 - from) * 1e-7 * 60.0;
        assert!((minutes(latitude, 600_000_000) - 0.1).abs() < 1e-4, "north");
        assert!((minutes(longitude, 100_000_000) - 0.2).abs() < 1e-4, "east, at 60 degrees");
        assert_eq!(height, 120_000, "down is negative");
    }

    #[test]
    fn invalid_homes_are_refused() {
        assert!(Home::USUAL.parse::<Home>().is_ok());
        for text in ["", "1,2", "1,2,3,4", "90,0,0", "0,181,0", "a,b,c", "NaN,0,0", "1,2,x,3"] {
            assert!(text.parse::<Home>().unwrap_err().contains(Home::USUAL), "{text}");
        }
    }
}
