//! Durations as people write them, with their unit: `500ms`, `0.5s`, `2min`.

/// Units and their length in seconds.
const UNITS: [(&str, f64); 6] = [("ns", 1e-9), ("us", 1e-6), ("ms", 1e-3), ("min", 60.0), ("h", 3600.0), ("s", 1.0)];

/// Parses a duration in seconds. Only 0 needs no unit. Negative, NaN and infinite numbers are errors.
pub fn seconds(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let unit = UNITS.iter().find_map(|(unit, factor)| Some((text.strip_suffix(unit)?, *factor)));
    let (number, factor) = unit.unwrap_or((text, 1.0));
    let number: Option<f64> = number.trim().parse().ok();
    match number.filter(|number| number.is_finite() && *number >= 0.0) {
        Some(number) if unit.is_none() && number != 0.0 => {
            Err(format!("'{text}' has no unit: say {text}s or {text}ms"))
        }
        // A division rounds once: 9 ms becomes the number nearest to 0.009 s, which 9 times 1e-3 is not.
        Some(number) => Ok(if factor < 1.0 { number / (1.0 / factor).round() } else { number * factor }),
        None => Err(format!("'{text}' is no duration: 0 or more with its unit, for instance 500ms, 0.5s, 2min")),
    }
}

/// Parses a duration as [`seconds`] does, with an optional minus sign.
fn signed_seconds(text: &str) -> Result<f64, String> {
    text.trim().strip_prefix('-').map_or_else(|| seconds(text), |before| seconds(before).map(|before_s| -before_s))
}

/// Parses a duration as [`seconds`] does; accepts `inf` too.
pub fn seconds_or_inf(text: &str) -> Result<f64, String> {
    if text.trim() == "inf" { Ok(f64::INFINITY) } else { seconds(text).map_err(|error| error + ", or inf") }
}

/// Parses the value of an option called `ms`, with an optional minus sign: a number without a unit is in milliseconds.
pub fn signed_milliseconds(text: &str) -> Result<f64, String> {
    let plain = text.trim().parse().ok().filter(|ms: &f64| ms.is_finite());
    plain.map_or_else(|| signed_seconds(text).map(|duration_s| duration_s * 1e3), Ok)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_units() {
        let cases = [
            ("2s", 2.0),
            ("500ms", 0.5),
            ("0.25s", 0.25),
            ("0", 0.0),
            ("0s", 0.0),
            (" 2 min ", 120.0),
            ("1.5h", 5400.0),
            ("300us", 3e-4),
            ("20 ns", 2e-8),
            ("1e-3 s", 1e-3),
        ];
        for (text, expected) in cases {
            assert_eq!(seconds(text), Ok(expected), "{text}");
        }
        for text in ["", "s", "-1s", "1d", "NaN", "inf", "ms", "1 2", "1e999"] {
            assert!(seconds(text).unwrap_err().contains("500ms, 0.5s, 2min"), "{text}");
        }
        for parsed in [seconds("5"), seconds_or_inf("5"), signed_seconds("-5")] {
            assert!(parsed.unwrap_err().starts_with("'5' has no unit: say 5s or 5ms"));
        }
    }

    #[test]
    fn durations_may_be_infinite_or_signed_milliseconds() {
        assert_eq!([seconds_or_inf("inf"), seconds_or_inf("1s")], [Ok(f64::INFINITY), Ok(1.0)]);
        assert!(seconds_or_inf("nan").unwrap_err().contains("or inf"));
        assert_eq!(["-5", "-5ms", "20", "0.02s"].map(signed_milliseconds), [Ok(-5.0), Ok(-5.0), Ok(20.0), Ok(20.0)]);
        assert!(signed_milliseconds("nan").is_err());
    }
}
