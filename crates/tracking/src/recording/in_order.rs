//! Removal of implausible time stamps.

/// Largest plausible distance of the first or the last time from its neighbour, ns: one hour.
const LONE_NS: u64 = 3_600_000_000_000;

/// Removes implausible items and returns their number. First, a single first or last item more than an hour from the
/// rest is removed. Then the fewest items are removed such that the remaining times do not decrease.
///
/// A single wrong time therefore removes a single item, however large its error. If a clock was set back, the shorter
/// part is removed.
pub(super) fn keep_in_order<T>(items: &mut Vec<T>, time_ns: impl Fn(&T) -> u64) -> u64 {
    let before = items.len();
    let mut kept = longest_ascending(items, &time_ns);
    let lone = |a: usize, b: usize| time_ns(&items[b]) - time_ns(&items[a]) > LONE_NS;
    // With two items there is no majority to decide which is wrong.
    let (first, last) = match kept[..] {
        [.., second, last] if kept.len() > 2 => {
            (lone(kept[0], kept[1]).then_some(kept[0]), lone(second, last).then_some(last))
        }
        _ => (None, None),
    };
    if first.is_some() || last.is_some() {
        // The last item is removed first, so the index of the first one stays valid.
        for index in [last, first].into_iter().flatten() {
            items.remove(index);
        }
        // A removed item may have kept good items out of the sequence, so the sequence is computed again.
        kept = longest_ascending(items, &time_ns);
    }
    if kept.len() < items.len() {
        let (mut kept, mut index) = (kept.into_iter().peekable(), 0..);
        items.retain(|_| index.next().is_some_and(|index| kept.next_if_eq(&index).is_some()));
    }
    (before - items.len()) as u64
}

/// Ascending indices of the longest subsequence of `items` with non-decreasing times. If several are equally long, the
/// subsequence with the earliest end.
///
/// Patience sorting, O(n log n): M. L. Fredman, On computing the length of longest increasing subsequences, Discrete
/// Mathematics 11 (1975).
fn longest_ascending<T>(items: &[T], time_ns: impl Fn(&T) -> u64) -> Vec<usize> {
    const NONE: usize = usize::MAX;
    if items.is_sorted_by_key(&time_ns) {
        return (0..items.len()).collect();
    }
    // Last item of the best subsequence of each length, and predecessor of each item in its subsequence.
    let (mut ends, mut previous) = (Vec::<usize>::new(), vec![NONE; items.len()]);
    for (i, item) in items.iter().enumerate() {
        let time = time_ns(item);
        let length = ends.partition_point(|&end| time_ns(&items[end]) <= time);
        if length > 0 {
            previous[i] = ends[length - 1];
        }
        match ends.get_mut(length) {
            Some(end) => *end = i,
            None => ends.push(i),
        }
    }
    let mut run = Vec::with_capacity(ends.len());
    let mut at = ends.last().copied();
    while let Some(i) = at {
        run.push(i);
        at = previous.get(i).copied().filter(|&before| before != NONE);
    }
    run.reverse();
    run
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn kept(times: &[u64]) -> Vec<u64> {
        let mut times = times.to_vec();
        let before = times.len();
        let removed = keep_in_order(&mut times, |t| *t);
        assert_eq!(before - times.len(), removed as usize);
        times
    }

    #[test]
    fn one_wrong_time_removes_one_item_wherever_it_is() {
        let day = 1_790_000_000_000_000_000;
        let good: Vec<_> = (0..10).map(|i| day + i * 16_666_667).collect();
        for wrong in [0, 1, day - 2 * LONE_NS, day + 2 * LONE_NS, u64::MAX] {
            for at in 0..=good.len() {
                let mut times = good.clone();
                times.insert(at, wrong);
                assert_eq!(kept(&times), good, "{wrong} at {at}");
            }
        }
    }

    #[test]
    fn a_clock_set_back_removes_the_shorter_part() {
        assert_eq!(kept(&[50, 51, 52, 10, 11]), [50, 51, 52]);
        assert_eq!(kept(&[50, 51, 10, 11, 12]), [10, 11, 12]);
        assert_eq!(kept(&[0, 0, 20, 20, 6]), [0, 0, 20, 20]);
    }

    #[test]
    fn a_pause_or_a_pair_is_accepted() {
        let pause = [0, 1, 2 * LONE_NS, 2 * LONE_NS + 1];
        assert_eq!(kept(&pause), pause);
        assert_eq!(kept(&[0, 2 * LONE_NS]), [0, 2 * LONE_NS]);
        assert_eq!((kept(&[]), kept(&[7])), (vec![], vec![7]));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn the_kept_items_are_the_longest_ascending_part(times in prop::collection::vec(0..12_u64, 0..12)) {
            let kept = kept(&times);
            prop_assert!(kept.is_sorted());
            // Reference result by trying every subset.
            let longest = (0..1_u32 << times.len())
                .map(|mask| (0..times.len()).filter(|i| mask >> i & 1 == 1).map(|i| times[i]).collect::<Vec<_>>())
                .filter(|part| part.is_sorted())
                .map(|part| part.len())
                .max();
            prop_assert_eq!(Some(kept.len()), longest);
        }
    }
}
