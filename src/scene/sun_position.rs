//! Where the sun stands, by date and place.
//!
//! Model: the low-precision formulas of the Astronomical Almanac. With n the days since noon of 1 January 2000 (universal time):
//!
//! ```text
//! L = 280.460 + 0.9856474 n    g = 357.528 + 0.9856003 n    lambda = L + 1.915 sin g + 0.020 sin 2g
//! e = 23.439 - 4e-7 n          ra = atan2(cos e sin lambda, cos lambda)    sin dec = sin e sin lambda
//! hour angle = 15 (6.697375 + 0.0657098242 n + hours) + longitude - ra
//! sin elevation = sin dec sin lat + cos dec cos lat cos h
//! tan azimuth = -cos dec sin h / (sin dec cos lat - cos dec sin lat cos h)
//! ```
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | lat | `latitude_deg` | degrees, north positive | |
//! | longitude | `longitude_deg` | degrees, east positive | |
//! | elevation, azimuth | `SunPosition` | degrees; azimuth from north over east | |
//!
//! Limits: 1950 to 2050, to 0.02 degrees; the air's refraction is left out (half a degree at the horizon, 0.1 at 10 degrees).
//! Guarded by `agrees_with_an_ephemeris`, `unusable_dates_are_errors`.
//! Source: J. Michalsky, The Astronomical Almanac's algorithm for approximate solar position, Solar Energy 40, 1988.

use crate::{Error, Result};

/// Direction to the sun, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SunPosition {
    /// Above the horizon.
    pub(super) elevation_deg: f64,
    /// From north over east.
    pub(super) azimuth_deg: f64,
}

/// The sun at a moment, `2026-06-21T15:30+02:00`, seen from a place.
pub(super) fn sun_position(date_time: &str, latitude_deg: f64, longitude_deg: f64) -> Result<SunPosition> {
    let n = days_since_2000(date_time)?;
    let l = 280.460 + 0.985_647_4 * n;
    let g = (357.528 + 0.985_600_3 * n).to_radians();
    let lambda = (l + 1.915 * g.sin() + 0.020 * (2.0 * g).sin()).to_radians();
    let e = (23.439 - 4e-7 * n).to_radians();
    let ra = (e.cos() * lambda.sin()).atan2(lambda.cos());
    let (sin_dec, lat) = (e.sin() * lambda.sin(), latitude_deg.to_radians());
    let cos_dec = (1.0 - sin_dec * sin_dec).sqrt();
    let hours = (n + 0.5).rem_euclid(1.0) * 24.0;
    // The formula counts whole and part days alike; the hours make up for the sidereal day.
    let sidereal_deg = 15.0 * (6.697_375 + 0.065_709_824_2 * n + hours) + longitude_deg;
    let h = sidereal_deg.to_radians() - ra;
    let sin_el = sin_dec * lat.sin() + cos_dec * lat.cos() * h.cos();
    let azimuth = (-cos_dec * h.sin()).atan2(sin_dec * lat.cos() - cos_dec * lat.sin() * h.cos());
    Ok(SunPosition {
        elevation_deg: sin_el.clamp(-1.0, 1.0).asin().to_degrees(),
        azimuth_deg: azimuth.to_degrees().rem_euclid(360.0),
    })
}

const FORM: &str =
    "expected a date, a time and its offset from universal time, such as \"2026-06-21T15:30+02:00\"";

/// Days since 2000-01-01T12:00Z.
fn days_since_2000(text: &str) -> Result<f64> {
    let bad = |what: &str| Error::invalid("date_time", format!("`{text}`: {what}"));
    let number = |at: std::ops::Range<usize>| -> Result<u32> {
        let digits = text.get(at).filter(|s| s.bytes().all(|b| b.is_ascii_digit()));
        digits.and_then(|s| s.parse().ok()).ok_or_else(|| bad(FORM))
    };
    let mark = |at: usize, allowed: &[u8]| {
        text.as_bytes().get(at).copied().filter(|b| allowed.contains(b)).ok_or_else(|| bad(FORM))
    };
    mark(4, b"-")?;
    mark(7, b"-")?;
    mark(10, b"T ")?;
    mark(13, b":")?;
    let (year, month, day) = (number(0..4)?, number(5..7)?, number(8..10)?);
    let (hour, minute) = (number(11..13)?, number(14..16)?);
    let (second, zone) = match text.as_bytes().get(16) {
        Some(b':') => (number(17..19)?, 19),
        _ => (0, 16),
    };
    let (offset_min, end) = match mark(zone, b"Z+-")? {
        b'Z' => (0, zone + 1),
        sign => {
            mark(zone + 3, b":")?;
            let (h, m) = (number(zone + 1..zone + 3)?, number(zone + 4..zone + 6)?);
            if h > 14 || m > 59 {
                return Err(bad("an offset is at most 14 hours"));
            }
            let minutes = f64::from(h * 60 + m);
            (if sign == b'-' { -minutes as i32 } else { minutes as i32 }, zone + 6)
        }
    };
    if text.len() != end {
        return Err(bad(FORM));
    }
    if !(1950..=2050).contains(&year) {
        return Err(bad("the formulas hold from 1950 to 2050"));
    }
    let leap = u32::from(year % 4 == 0 && (year % 100 != 0 || year % 400 == 0));
    let lengths = [31, 28 + leap, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let length = month.checked_sub(1).and_then(|m| lengths.get(m as usize)).copied().unwrap_or(0);
    if !(1..=length).contains(&day) || hour > 23 || minute > 59 || second > 59 {
        return Err(bad("there is no such day or time"));
    }
    let leap_days = |y: u32| (y - 1) / 4 - (y - 1) / 100 + (y - 1) / 400;
    let years = f64::from(year) - 2000.0;
    let before = f64::from(leap_days(year)) - f64::from(leap_days(2000));
    let in_year: u32 = lengths.iter().take(month as usize - 1).sum::<u32>() + day - 1;
    let time = (f64::from(hour) * 60.0 + f64::from(minute) - f64::from(offset_min)) / 1440.0
        + f64::from(second) / 86_400.0;
    Ok(365.0 * years + before + f64::from(in_year) + time - 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_an_ephemeris() {
        // NREL's solar position algorithm (pvlib, without refraction): elevation and azimuth.
        for (date, lat, lon, elevation, azimuth) in [
            ("2026-06-21T15:30+02:00", 52.5, 13.4, 50.406, 236.595),
            ("1951-03-01T06:00Z", -33.9, 18.4, 17.019, 88.112),
            ("2049-12-31T23:10Z", 21.3, -157.9, 44.883, 191.418),
            ("2000-02-29T09:00+09:00", 36.4, 136.6, 27.804, 125.634),
            ("2024-09-22T12:00Z", 0.0, 0.0, 88.131, 270.366),
            ("2026-01-10T20:00-05:00", 69.6, -18.9, -42.101, 352.698),
        ] {
            let p = sun_position(date, lat, lon).unwrap();
            assert!((p.elevation_deg - elevation).abs() < 0.02, "{date}: {p:?} {elevation}");
            let turn = (p.azimuth_deg - azimuth + 180.0f64).rem_euclid(360.0) - 180.0;
            assert!(turn.abs() * elevation.to_radians().cos() < 0.02, "{date}: {p:?} {azimuth}");
        }
        // The same moment in three notations.
        let at = |text: &str| sun_position(text, 10.0, 20.0).unwrap();
        assert_eq!(at("2026-06-21T15:30+02:00"), at("2026-06-21T13:30Z"));
        assert_eq!(at("2026-06-21 15:30:00+02:00"), at("2026-06-21T10:00:00-03:30"));
    }

    #[test]
    fn unusable_dates_are_errors() {
        for bad in [
            "",
            "2026-06-21",
            "2026-06-21T15:30",
            "2026-06-21T15:30+2",
            "2026-06-21T15:30Zulu",
            "2026-02-29T15:30Z",
            "2026-00-10T15:30Z",
            "2026-13-10T15:30Z",
            "2026-06-21T24:00Z",
            "1949-06-21T15:30Z",
            "2051-06-21T15:30Z",
            "2026-06-21T15:30+15:00",
            "２０26-06-21T15:30Z",
            "2026-06-2éT15:30Z",
        ] {
            assert!(sun_position(bad, 0.0, 0.0).is_err(), "{bad}");
        }
        assert!(sun_position("2024-02-29T15:30Z", 0.0, 0.0).is_ok());
    }
}
