//! Values of the command line, read with their units and limits.

use std::net::SocketAddr;
use std::time::Duration;

use r6_proto::grid::Grid;
use r6_proto::message::instruction::{BlendLevel, Manner, TIMES, TIMES_WANTED};

pub use r6_program::axis_mask;

/// Reads a time such as `100ms`, `1.5s`, `2m`; a bare number is seconds. Above 0, at most a day.
pub fn duration(text: &str) -> Result<Duration, String> {
    let (number, scale) = match text {
        _ if text.ends_with("ms") => (text.trim_end_matches("ms"), 0.001),
        _ if text.ends_with('s') => (text.trim_end_matches('s'), 1.0),
        _ if text.ends_with('m') => (text.trim_end_matches('m'), 60.0),
        _ => (text, 1.0),
    };
    let seconds = number.trim().parse::<f64>().map(|number| number * scale);
    match seconds {
        // A day is longer than any wait at a terminal.
        Ok(seconds) if seconds > 0.0 && seconds <= 86_400.0 => Ok(Duration::from_secs_f64(seconds)),
        Ok(_) => Err("a time has to be above 0 and at most a day".to_owned()),
        Err(_) => Err("write a time as 100ms, 1.5s or 2m".to_owned()),
    }
}

/// Reads the address where a controller listens, `IP:PORT`.
pub fn listen_address(text: &str) -> Result<SocketAddr, String> {
    let wanted = "write IP:PORT, as 127.0.0.1:9760 for this machine alone, 0.0.0.0:9760 for every network of it, or 127.0.0.1:0 for any \
                  free port";
    text.parse().map_err(|_| wanted.to_owned())
}

/// Reads the address where a panel is offered, `IP:PORT`.
pub fn panel_address(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| "write IP:PORT, as 127.0.0.1:9770, or 127.0.0.1:0 for any free port".to_owned())
}

/// Reads a coordinate in mm or degrees.
pub fn coordinate(text: &str) -> Result<f64, String> {
    finite(text, -1e6..=1e6, "a number of mm or degrees")
}

/// Reads a speed in percent, within [`Manner::SPEEDS`], in steps of 0.1.
pub fn speed_percent(text: &str) -> Result<f64, String> {
    let speed = finite(text, Manner::SPEEDS, Manner::SPEEDS_WANTED)?;
    on_grid(Grid::PERCENT, speed)
}

/// Reads the most that an axis may turn in one move, 0.001 to 10000 degrees.
pub fn largest_step(text: &str) -> Result<f64, String> {
    let wanted = "degrees from 0.001 to 10000";
    finite(text, 0.001..=10_000.0, wanted)
}

/// Reads seconds within [`TIMES`], in the controller's steps of 0.1.
pub fn delay_seconds(text: &str) -> Result<f64, String> {
    let delay = finite(text, TIMES, TIMES_WANTED)?;
    on_grid(Grid::TENTHS_OF_A_SECOND, delay)
}

/// Reads a blend level from 0 to 9.
pub fn blend_level(text: &str) -> Result<BlendLevel, String> {
    text.parse()
        .ok()
        .and_then(BlendLevel::new)
        .ok_or_else(|| "a blend level is a whole number from 0 to 9".to_owned())
}

/// Returns the value if the wire can carry it exactly.
pub fn on_grid(grid: Grid, value: f64) -> Result<f64, String> {
    match grid.step(value) {
        Ok(_) => Ok(value),
        Err(Some(nearest)) => Err(format!("it has to be {}; nearest: {nearest}", grid.wanted())),
        Err(None) => Err("it has to be a finite number".to_owned()),
    }
}

fn finite(text: &str, range: std::ops::RangeInclusive<f64>, wanted: &str) -> Result<f64, String> {
    text.parse::<f64>()
        .ok()
        .filter(|number| range.contains(number))
        .ok_or_else(|| format!("it has to be {wanted}"))
}

#[cfg(test)]
mod tests {
    use r6_proto::AxisMask;

    use super::*;

    #[test]
    fn times_have_units() {
        assert_eq!(duration("100ms"), Ok(Duration::from_millis(100)));
        assert_eq!(duration("1.5s"), Ok(Duration::from_millis(1500)));
        assert_eq!(duration("2m"), Ok(Duration::from_secs(120)));
        assert_eq!(duration("3"), Ok(Duration::from_secs(3)));
        for wrong in ["0s", "-1s", "ms", "", "1h", "nan", "inf", "99999999s"] {
            assert!(duration(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn where_to_listen_is_shown_by_example() {
        assert_eq!(listen_address("127.0.0.1:9760"), Ok(SocketAddr::from(([127, 0, 0, 1], 9760))));
        assert!(listen_address("[::1]:0").is_ok());
        for wrong in ["9760", "localhost:9760", "127.0.0.1", "127.0.0.1:99999", ""] {
            assert!(listen_address(wrong).unwrap_err().contains("127.0.0.1:9760"), "{wrong}");
            assert!(panel_address(wrong).unwrap_err().contains("127.0.0.1:9770"), "{wrong}");
        }
    }

    #[test]
    fn masks_are_hexadecimal_or_decimal() {
        assert_eq!(axis_mask("0x3F"), Ok(AxisMask::SIX));
        assert_eq!(axis_mask("63"), Ok(AxisMask::SIX));
        for wrong in ["0", "0x", "3F", "256", "0x100", "-1"] {
            assert!(axis_mask(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn speeds_are_above_zero_in_tenths() {
        assert_eq!(speed_percent("0.1"), Ok(0.1));
        assert_eq!(speed_percent("12.3"), Ok(12.3));
        assert_eq!(speed_percent("0.30000000000000004"), Ok(0.1 + 0.2));
        let between = speed_percent("5.55").unwrap_err();
        assert_eq!(between, "it has to be in steps of 0.1 percent; nearest: 5.5 or 5.6");
        for wrong in ["0", "0.05", "12.34", "100.1", "-5", "nan", "fast"] {
            assert!(speed_percent(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn coordinates_are_finite() {
        assert_eq!(coordinate("-90.5"), Ok(-90.5));
        for wrong in ["nan", "inf", "1e9", "", "1,5"] {
            assert!(coordinate(wrong).is_err(), "{wrong}");
        }
    }
}
