//! Numbered values: the active value is in use elsewhere, the others are stored here.

/// The values that are not active, by number. Value 0 is active at first.
#[derive(Debug)]
pub(crate) struct Kept<T> {
    /// Number of the active value.
    active: usize,
    /// Inactive values by number; `None` at the active number and at numbers without a value.
    others: Vec<Option<T>>,
}

impl<T> Default for Kept<T> {
    fn default() -> Self {
        Self { active: 0, others: vec![None] }
    }
}

impl<T> Kept<T> {
    /// Number of the active value.
    pub(crate) fn active(&self) -> usize {
        self.active
    }

    /// The inactive value with a number; `None` if it is active or doesn't exist.
    pub(crate) fn get(&self, number: usize) -> Option<&T> {
        self.others.get(number).and_then(Option::as_ref)
    }

    /// All inactive values.
    pub(super) fn others(&self) -> impl Iterator<Item = &T> {
        self.others.iter().flatten()
    }

    /// Whether a number has a value, active or not.
    pub(crate) fn has(&self, number: usize) -> bool {
        number == self.active || self.get(number).is_some()
    }

    /// Moves the value `number` into `active`, and stores the previous active value. A number without a value gets
    /// `new`; if `new` is `None`, nothing changes.
    pub(crate) fn swap(&mut self, number: usize, active: &mut T, new: Option<T>) {
        let Some(value) = self.others.get_mut(number).and_then(Option::take).or(new) else { return };
        if number == self.active {
            return;
        }
        if self.others.len() <= number {
            self.others.resize_with(number + 1, || None);
        }
        self.others[self.active] = Some(std::mem::replace(active, value));
        self.active = number;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_back_by_their_number() {
        let (mut kept, mut active) = (Kept::default(), "a");
        let mut select = |number, new| {
            kept.swap(number, &mut active, Some(new));
            active
        };
        let seen = [select(0, "x"), select(2, "c"), select(0, "x"), select(2, "x"), select(1, "b")];
        assert_eq!(seen, ["a", "c", "a", "c", "b"]);
        assert_eq!((kept.active(), kept.get(2), kept.get(1)), (1, Some(&"c"), None));
        assert!(kept.has(0) && kept.has(1) && !kept.has(3));
        assert_eq!(kept.others().collect::<Vec<_>>(), [&"a", &"c"]);
    }

    #[test]
    fn a_number_without_a_value_changes_nothing() {
        let (mut kept, mut active) = (Kept::default(), 1);
        kept.swap(3, &mut active, None);
        assert_eq!((active, kept.active()), (1, 0));
    }
}
