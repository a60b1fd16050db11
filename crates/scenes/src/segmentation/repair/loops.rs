//! Loops of open edges, which belong to a single triangle.

use std::collections::{BTreeMap, HashMap};

use super::edges;

/// Simple loops of open edges, as vertices in the direction of the triangles that would close the loop.
///
/// Open edges that form no loop, because the winding is inconsistent, are left out.
pub(super) fn loops(triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut next = BTreeMap::<u32, Vec<u32>>::new();
    for [from, to] in edges::open(triangles) {
        next.entry(to).or_default().push(from);
    }
    // The lowest vertex is at the end of each list, so it is taken first.
    next.values_mut().for_each(|list| list.sort_unstable_by(|a, b| b.cmp(a)));
    let starts: Vec<u32> = next.keys().copied().collect();
    let mut found = Vec::new();
    for start in starts {
        let mut path = vec![start];
        let mut position = HashMap::from([(start, 0)]);
        while let Some(to) = path.last().and_then(|at| next.get_mut(at)?.pop()) {
            match position.get(&to).copied() {
                Some(first) => {
                    let found_loop = path[first..].to_vec();
                    path[first + 1..].iter().for_each(|vertex| _ = position.remove(vertex));
                    path.truncate(first + 1);
                    if found_loop.len() > 2 {
                        found.push(found_loop);
                    }
                }
                None => {
                    position.insert(to, path.len());
                    path.push(to);
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::loops;

    #[test]
    fn two_holes_that_share_a_corner_are_two_loops() {
        // A fan of six triangles about vertex 0, with two opposite triangles missing.
        let fan = [[0, 1, 2], [0, 2, 3], [0, 4, 5], [0, 5, 6]];
        let found = loops(&fan);
        assert_eq!(found.iter().map(Vec::len).sum::<usize>(), 8);
        // A strip whose rim passes through vertex 0 twice gives two loops, each with the vertex once.
        assert_eq!(found.len(), 2);
        for found_loop in found {
            let mut sorted = found_loop.clone();
            sorted.sort_unstable();
            sorted.dedup();
            assert_eq!(sorted.len(), found_loop.len());
        }
    }
}
