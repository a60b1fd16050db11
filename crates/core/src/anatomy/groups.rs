//! Disjoint sets (union-find), for connected components of a mesh.

/// Disjoint sets of item indices.
pub struct Groups(Vec<u32>);

impl Groups {
    /// Puts each of `count` items into a set of its own.
    pub fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    fn root(&mut self, mut item: u32) -> u32 {
        while self.0[item as usize] != item {
            // Path halving: the item skips to its grandparent.
            self.0[item as usize] = self.0[self.0[item as usize] as usize];
            item = self.0[item as usize];
        }
        item
    }

    /// Merges the sets of two items.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }

    /// Number of each item's set, counted from 0 in the order of the sets' first items.
    pub fn numbered(mut self) -> Vec<u32> {
        let count = self.0.len();
        let mut numbers = vec![0; count];
        let mut next = 0;
        for item in 0..count as u32 {
            // The root of a set is its lowest item, so it is numbered first.
            let root = self.root(item);
            if root == item {
                numbers[item as usize] = next;
                next += 1;
            } else {
                numbers[item as usize] = numbers[root as usize];
            }
        }
        numbers
    }
}
