//! Mix-ups of landmarks: two touched in exchanged order, one touched elsewhere, or two touched at one position.

use super::csv::Named;
use super::registration::{PointPair, rms_of_fit};

/// Smallest number of landmarks among which an exchange can be found. Among four landmarks, exchanging the other two
/// fits equally well.
const EXCHANGE_FROM: usize = 5;

/// Smallest number of landmarks among which a single wrong one can be found: a fit of the others must have more than
/// three landmarks.
const SINGLE_FROM: usize = 5;

/// Limits of an explanation's RMS residual: this fraction of the unexplained residual, and this many mm below it.
const EXPLAINS: (f64, f64) = (0.4, 2.0);

/// Limit up to which further explanations are named: this factor times the RMS residual of the best explanation, plus
/// this many mm.
const AS_GOOD: (f64, f64) = (1.5, 1.0);

/// Distance of two landmarks in the scene, mm, above which the user can't mistake one for the other.
const APART_MM: f64 = 15.0;

/// Distance between two touches in the tracker's frame, mm, below which they count as one position.
const TOGETHER_MM: f64 = 4.0;

/// Likely explanation of landmarks that don't fit.
#[derive(Debug, Clone, PartialEq)]
pub enum MixUp {
    /// Two landmarks were touched in exchanged order.
    Exchanged {
        /// Indices of the landmarks in each likely pair, the best pair first.
        pairs: Vec<[usize; 2]>,
        /// RMS residual after exchanging the first pair, mm.
        rms_mm: f64,
    },
    /// One landmark was touched elsewhere.
    Single {
        /// Index of the landmark.
        index: usize,
        /// RMS residual of the other landmarks, mm.
        rms_mm: f64,
    },
    /// Two landmarks were touched at one position.
    Same {
        /// Indices of the two landmarks.
        pair: [usize; 2],
        /// Distance between the touches, mm.
        touched_mm: f64,
        /// Distance of the landmarks in the scene, mm.
        scene_mm: f64,
    },
}

impl MixUp {
    /// Likely explanation of landmarks that don't fit; `None` if they fit, or if no mix-up explains the misfit.
    pub fn of(pairs: &[PointPair]) -> Option<Self> {
        if let Some(same) = same(pairs) {
            return Some(same);
        }
        let rms_mm = rms_of_fit(pairs)?;
        let explains = |better: f64| better < EXPLAINS.0 * rms_mm && rms_mm - better > EXPLAINS.1;
        let exchanged = exchanged(pairs).filter(|(_, rms)| explains(*rms));
        let single = single(pairs).filter(|(_, rms)| explains(*rms));
        match (exchanged, single) {
            (Some((_, exchanged)), Some((index, rms_mm))) if rms_mm < 0.5 * exchanged => {
                Some(Self::Single { index, rms_mm })
            }
            (Some((pairs, rms_mm)), _) => Some(Self::Exchanged { pairs, rms_mm }),
            (None, Some((index, rms_mm))) => Some(Self::Single { index, rms_mm }),
            (None, None) => None,
        }
    }

    /// The explanation in words. `names` are the landmarks in the order of the indices.
    pub fn describe<T>(&self, names: &[Named<T>]) -> String {
        let name = |index: usize| names.get(index).map_or("?", |named| named.name.as_str());
        match self {
            Self::Exchanged { pairs, rms_mm } => {
                let each = pairs.iter().map(|[a, b]| format!("`{}` and `{}`", name(*a), name(*b)));
                let each = each.collect::<Vec<_>>().join(", or ");
                format!(
                    "{each} were likely touched in each other's turn: exchanged, the RMS residual is {rms_mm:.2} mm"
                )
            }
            Self::Single { index, rms_mm } => {
                let name = name(*index);
                format!("`{name}` was likely touched elsewhere: without it, the RMS residual is {rms_mm:.2} mm")
            }
            Self::Same { pair: [a, b], touched_mm, scene_mm } => format!(
                "`{}` and `{}` were touched at one position ({touched_mm:.1} mm apart, in the scene {scene_mm:.1} mm)",
                name(*a),
                name(*b)
            ),
        }
    }
}

/// First two landmarks that were touched at one position; `None` if there are none.
fn same(pairs: &[PointPair]) -> Option<MixUp> {
    for (a, first) in pairs.iter().enumerate() {
        for (b, second) in pairs.iter().enumerate().skip(a + 1) {
            let scene_mm = first.scene_mm.distance(second.scene_mm);
            let touched_mm = first.tracker_mm.distance(second.tracker_mm);
            // Touches that are all close together are due to a wrong unit, not to a mix-up.
            let is_unit = pairs.len() > 2 && pairs.iter().all(|p| p.tracker_mm.distance(first.tracker_mm) < APART_MM);
            if scene_mm > APART_MM && touched_mm < TOGETHER_MM && !is_unit {
                return Some(MixUp::Same { pair: [a, b], touched_mm, scene_mm });
            }
        }
    }
    None
}

/// Pairs of landmarks whose exchange fits best, and the RMS residual after exchanging the first pair, mm.
fn exchanged(pairs: &[PointPair]) -> Option<(Vec<[usize; 2]>, f64)> {
    if pairs.len() < EXCHANGE_FROM {
        return None;
    }
    let mut changed = pairs.to_vec();
    let mut found: Vec<([usize; 2], f64)> = Vec::new();
    for a in 0..pairs.len() {
        for b in a + 1..pairs.len() {
            (changed[a].tracker_mm, changed[b].tracker_mm) = (pairs[b].tracker_mm, pairs[a].tracker_mm);
            found.extend(rms_of_fit(&changed).map(|rms| ([a, b], rms)));
            (changed[a].tracker_mm, changed[b].tracker_mm) = (pairs[a].tracker_mm, pairs[b].tracker_mm);
        }
    }
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    let best = found.first()?.1;
    let as_good = found.iter().take_while(|(_, rms)| *rms < AS_GOOD.0 * best + AS_GOOD.1);
    Some((as_good.map(|(pair, _)| *pair).collect(), best))
}

/// Index of the landmark without which the others fit best, and the others' RMS residual, mm.
fn single(pairs: &[PointPair]) -> Option<(usize, f64)> {
    if pairs.len() < SINGLE_FROM {
        return None;
    }
    let without = |index: usize| {
        let mut others = pairs.to_vec();
        others.remove(index);
        Some((index, rms_of_fit(&others)?))
    };
    (0..pairs.len()).filter_map(without).min_by(|a, b| a.1.total_cmp(&b.1))
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};
    use proptest::prelude::*;

    use super::*;

    /// Landmarks about a belly, mm.
    const SCENE: [[f64; 3]; 7] = [
        [0.0, 0.0, 80.0],
        [0.0, 90.0, 60.0],
        [0.0, -90.0, 55.0],
        [140.0, 0.0, 0.0],
        [-135.0, 0.0, 0.0],
        [90.0, -70.0, 60.0],
        [-85.0, -70.0, 60.0],
    ];

    fn touched(count: usize, noise: &[[f64; 3]]) -> Vec<PointPair> {
        let turn = DQuat::from_rotation_z(2.0) * DQuat::from_rotation_x(0.4);
        let pair = |(scene, noise): (&[f64; 3], &[f64; 3])| {
            let scene_mm = DVec3::from_array(*scene);
            PointPair {
                scene_mm,
                tracker_mm: turn * scene_mm + DVec3::new(300.0, 5.0, -80.0) + DVec3::from_array(*noise),
            }
        };
        SCENE.iter().zip(noise).take(count).map(pair).collect()
    }

    fn exchange(pairs: &mut [PointPair], a: usize, b: usize) {
        (pairs[a].tracker_mm, pairs[b].tracker_mm) = (pairs[b].tracker_mm, pairs[a].tracker_mm);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_exchange_is_named_from_the_fifth_on(
            noise in prop::array::uniform7(prop::array::uniform3(-1.0..1.0_f64)),
            count in 5..=7_usize,
            a in 0..7_usize,
            b in 0..7_usize,
        ) {
            prop_assume!(a < b && b < count);
            let mut pairs = touched(count, &noise);
            prop_assert_eq!(MixUp::of(&pairs), None);
            exchange(&mut pairs, a, b);
            let found = MixUp::of(&pairs);
            prop_assert!(
                matches!(&found, Some(MixUp::Exchanged { pairs, rms_mm }) if pairs.contains(&[a, b]) && *rms_mm < 1.8),
                "{:?}", found
            );
        }

        #[test]
        fn a_single_wrong_touch_is_named(
            noise in prop::array::uniform7(prop::array::uniform3(-1.0..1.0_f64)),
            index in 0..7_usize,
            direction in prop::array::uniform3(-1.0..1.0_f64),
        ) {
            let mut pairs = touched(7, &noise);
            pairs[index].tracker_mm += 40.0 * DVec3::from_array(direction).normalize_or(DVec3::X);
            let found = MixUp::of(&pairs);
            prop_assert!(matches!(found, Some(MixUp::Single { index: i, .. }) if i == index), "{:?}", found);
        }
    }

    #[test]
    fn five_landmarks_show_an_exchange_and_two_a_double_touch() {
        let mut pairs = touched(5, &[[0.2, -0.3, 0.1]; 7]);
        assert_eq!(MixUp::of(&pairs), None);
        exchange(&mut pairs, 0, 3);
        assert_eq!(MixUp::of(&pairs[..4]), None, "four don't tell which two");
        let Some(found @ MixUp::Exchanged { .. }) = MixUp::of(&pairs) else { panic!("{:?}", MixUp::of(&pairs)) };
        let names = ["TOP", "UPPER", "LOWER", "LEFT", "RIGHT"].map(|name| Named { name: name.to_owned(), value: () });
        assert!(found.describe(&names).contains("`TOP` and `LEFT`"), "{}", found.describe(&names));
        let mut pairs = touched(2, &[[0.0; 3]; 7]);
        assert_eq!(MixUp::of(&pairs), None);
        pairs[1].tracker_mm = pairs[0].tracker_mm + DVec3::X;
        assert!(matches!(MixUp::of(&pairs), Some(MixUp::Same { pair: [0, 1], .. })));
        assert_eq!(MixUp::of(&[]), None);
    }
}
