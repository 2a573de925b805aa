//! Removes the points of a line that make no visible difference.

use super::canvas::Place;

/// How far a line may be from the removed points, pixels: less than the width of a line.
const TOLERANCE: f64 = 0.12;

/// How many points are processed together. In the worst case the work grows with the square of this number.
const STRETCH: usize = 512;

/// The width of a column, pixels. Within a column only the ends and the extremes are visible.
const COLUMN: f64 = 0.5;

/// Keeps at most four points for each column of pixels. The line must run to the right.
pub fn by_column(places: &[Place]) -> Vec<Place> {
    let mut kept = Vec::new();
    for column in places.chunk_by(|a, b| (a.0 / COLUMN).floor() == (b.0 / COLUMN).floor()) {
        let extreme = |better: fn(&f64, &f64) -> bool| {
            let numbered = column.iter().enumerate();
            numbered
                .reduce(|best, next| if better(&next.1.1, &best.1.1) { next } else { best })
                .map(|best| best.0)
        };
        let ends = [Some(0), extreme(f64::lt), extreme(f64::gt), column.len().checked_sub(1)];
        let mut numbers: Vec<usize> = ends.into_iter().flatten().collect();
        numbers.sort_unstable();
        numbers.dedup();
        kept.extend(numbers.into_iter().filter_map(|number| column.get(number)));
    }
    kept
}

/// Keeps as few points as the shape of the line needs (Ramer, Douglas and Peucker). The first and the last
/// point stay.
pub fn thin(places: &[Place]) -> Vec<Place> {
    let mut kept: Vec<Place> = Vec::new();
    kept.extend(places.first());
    let mut rest = places;
    while rest.len() > 1 {
        let stretch = rest.get(..rest.len().min(STRETCH)).unwrap_or(rest);
        thin_stretch(stretch, &mut kept);
        rest = rest.get(stretch.len() - 1..).unwrap_or_default();
    }
    kept
}

/// Appends the needed points after the first point.
fn thin_stretch(places: &[Place], kept: &mut Vec<Place>) {
    let mut waiting = vec![places];
    while let Some(part) = waiting.pop() {
        let (Some(first), Some(last)) = (part.first(), part.last()) else { continue };
        let farthest = part
            .iter()
            .enumerate()
            .map(|(n, place)| (n, distance(*place, *first, *last)))
            .fold((0, 0.0), |best, next| if next.1 > best.1 { next } else { best });
        match farthest {
            (n, off) if off > TOLERANCE => {
                // The first half is processed first.
                waiting.extend(part.get(n..));
                waiting.extend(part.get(..=n));
            }
            _ => kept.push(*last),
        }
    }
}

/// The distance of a place from the line between two others.
fn distance(place: Place, from: Place, to: Place) -> f64 {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let (px, py) = (place.0 - from.0, place.1 - from.1);
    let square = dx * dx + dy * dy;
    let share = if square > 0.0 { ((px * dx + py * dy) / square).clamp(0.0, 1.0) } else { 0.0 };
    (px - share * dx).hypot(py - share * dy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_has_two_ends_for_each_stretch() {
        let line: Vec<_> = (0..2000).map(|n| (f64::from(n), f64::from(n) * 0.5)).collect();
        let thinned = thin(&line);
        assert!(thinned.len() <= 6, "{}", thinned.len());
        assert_eq!((thinned[0], thinned[thinned.len() - 1]), (line[0], line[1999]));
    }

    #[test]
    fn corners_and_curves_stay() {
        let corner = [(0.0, 0.0), (5.0, 0.0), (10.0, 0.0), (10.0, 5.0), (10.0, 10.0)];
        assert_eq!(thin(&corner), [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)]);
        let curve: Vec<_> = (0..500).map(|n| (f64::from(n), (f64::from(n) / 50.0).sin() * 50.0)).collect();
        let thinned = thin(&curve);
        assert!(thinned.len() > 20 && thinned.len() < 200, "{}", thinned.len());
        for place in &curve {
            let near = thinned.windows(2).map(|pair| distance(*place, pair[0], pair[1]));
            assert!(near.fold(f64::INFINITY, f64::min) <= TOLERANCE);
        }
    }

    #[test]
    fn a_column_keeps_its_ends_and_extremes() {
        let column = [(0.0, 5.0), (0.1, 9.0), (0.2, 6.0), (0.3, 1.0), (0.4, 5.0)];
        assert_eq!(by_column(&column), [(0.0, 5.0), (0.1, 9.0), (0.3, 1.0), (0.4, 5.0)]);
        let sparse = [(0.0, 1.0), (0.6, 2.0), (1.2, 3.0)];
        assert_eq!(by_column(&sparse), sparse);
    }

    #[test]
    fn few_points_are_no_trouble() {
        assert_eq!(thin(&[]), []);
        assert_eq!(thin(&[(1.0, 2.0)]), [(1.0, 2.0)]);
        assert_eq!(thin(&[(1.0, 2.0), (1.0, 2.0)]), [(1.0, 2.0), (1.0, 2.0)]);
    }
}
