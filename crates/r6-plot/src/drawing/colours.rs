//! Tests that the colours of the axes differ and can be seen.

use super::AXIS_COLOURS;

/// The smallest difference of two colours, CIE76 ΔE. About 2 is just noticeable side by side.
const SMALLEST_DIFFERENCE: f64 = 30.0;

/// The smallest contrast with the white ground, as WCAG wants it of graphics.
const SMALLEST_CONTRAST: f64 = 3.0;

/// Red, green and blue of an sRGB colour, linear, 0 to 1.
fn linear(colour: &str) -> [f64; 3] {
    let part = |at: usize| {
        let value = f64::from(u8::from_str_radix(&colour[at..at + 2], 16).unwrap()) / 255.0;
        if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    };
    [part(1), part(3), part(5)]
}

/// L*, a*, b* of a colour under D65.
fn lab(colour: &str) -> [f64; 3] {
    let [r, g, b] = linear(colour);
    let x = (0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.95047;
    let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let z = (0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.08883;
    let [x, y, z] = [x, y, z].map(|t| if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn difference(one: &str, other: &str) -> f64 {
    lab(one).iter().zip(lab(other)).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

fn contrast_with_white(colour: &str) -> f64 {
    let [r, g, b] = linear(colour);
    1.05 / (0.2126 * r + 0.7152 * g + 0.0722 * b + 0.05)
}

#[test]
fn any_two_axes_differ() {
    for (number, one) in AXIS_COLOURS.iter().enumerate() {
        for other in &AXIS_COLOURS[number + 1..] {
            let difference = difference(one, other);
            assert!(difference >= SMALLEST_DIFFERENCE, "{one} and {other}: {difference:.1}");
        }
    }
}

#[test]
fn every_axis_is_seen_on_white() {
    for colour in AXIS_COLOURS {
        let contrast = contrast_with_white(colour);
        assert!(contrast >= SMALLEST_CONTRAST, "{colour}: {contrast:.2}");
    }
}

#[test]
fn the_difference_of_known_colours_is_known() {
    assert!((difference("#ffffff", "#000000") - 100.0).abs() < 0.1);
    assert!((contrast_with_white("#000000") - 21.0).abs() < 0.01);
}
