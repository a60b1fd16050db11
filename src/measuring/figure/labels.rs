//! Placement of labels in a figure, clear of other labels and of markers.

/// A rectangle, pixels: left, top, right, bottom.
pub(super) type Rect = [i32; 4];

/// Distance of a label from its marker, pixels.
const GAP: i32 = 9;
/// Half the height of a label with its margin, pixels.
const HALF_HEIGHT: i32 = 8;
/// Half the side of the square kept free around a marker, pixels.
const MARKER: i32 = 6;
/// Number of label positions tried above and below a marker.
const LINES: i32 = 7;

/// Rectangle kept free around the marker at a pixel.
pub(super) fn marker((x, y): (i32, i32)) -> Rect {
    [x - MARKER, y - MARKER, x + MARKER, y + MARKER]
}

/// Left end and vertical centre of each label within `frame`, pixels; `None` if no position is free. `names` holds the
/// marker's position and the label's width, in order of priority. A label lies at its marker, or farther off if another
/// label or a rectangle of `taken` is there.
pub(super) fn positions(names: &[((i32, i32), i32)], mut taken: Vec<Rect>, frame: Rect) -> Vec<Option<(i32, i32)>> {
    names
        .iter()
        .map(|&((x, y), width)| {
            let rows = (0..LINES).flat_map(|row| [-1, 1].map(|side| y + side * (11 + 2 * HALF_HEIGHT * row)));
            let spots = rows.flat_map(|row| [(x + GAP, row), (x - GAP - width, row)]);
            let box_of = |(left, middle): (i32, i32)| [left, middle - HALF_HEIGHT, left + width, middle + HALF_HEIGHT];
            let free = |spot: &(i32, i32)| {
                let name = box_of(*spot);
                let inside = name[0] >= frame[0] && name[1] >= frame[1] && name[2] <= frame[2] && name[3] <= frame[3];
                inside && !taken.iter().any(|other| overlap(&name, other))
            };
            let spot = spots.into_iter().find(free)?;
            taken.push(box_of(spot));
            Some(spot)
        })
        .collect()
}

fn overlap(a: &Rect, b: &Rect) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FRAME: Rect = [0, 0, 1000, 600];

    #[test]
    fn a_name_alone_is_at_the_upper_right_of_its_point() {
        assert_eq!(positions(&[((100, 300), 80)], vec![marker((100, 300))], FRAME), [Some((109, 289))]);
        // At the figure's right edge, the label lies to the left of its marker.
        assert_eq!(positions(&[((990, 300), 80)], vec![marker((990, 300))], FRAME), [Some((901, 289))]);
    }

    #[test]
    fn names_without_room_are_left_out() {
        let here = ((100, 300), 80);
        let found = positions(&[here; 60], vec![marker((100, 300))], FRAME);
        assert_eq!(found.iter().flatten().count(), 28, "7 lines above and below, left and right");
        assert_eq!(positions(&[((5, 5), 2000)], vec![], FRAME), [None]);
    }

    proptest! {
        #[test]
        fn no_name_lies_on_another_or_on_a_point(
            points in proptest::collection::vec((20..980i32, 20..580i32), 1..20), width in 10..150i32,
        ) {
            let names: Vec<_> = points.iter().map(|&point| (point, width)).collect();
            let found: Vec<Rect> = positions(&names, points.iter().copied().map(marker).collect(), FRAME)
                .into_iter()
                .flatten()
                .map(|(x, y)| [x, y - HALF_HEIGHT, x + width, y + HALF_HEIGHT])
                .collect();
            for (i, a) in found.iter().enumerate() {
                prop_assert!(found[..i].iter().all(|b| !overlap(a, b)));
                prop_assert!(!points.iter().any(|&point| overlap(a, &marker(point))));
            }
        }
    }
}
