//! Numbered values of which one is in use and the others are kept.

/// Values beside the active one. Value 0 is active at first.
#[derive(Debug)]
pub(super) struct Kept<T> {
    /// Number of the active value.
    active: usize,
    /// The others by number; none in the place of the active one.
    others: Vec<Option<T>>,
}

impl<T> Default for Kept<T> {
    fn default() -> Self {
        Self { active: 0, others: vec![None] }
    }
}

impl<T> Kept<T> {
    /// Number of the active value.
    pub(super) fn active(&self) -> usize {
        self.active
    }

    /// The value with a number, if it is kept beside the active one.
    pub(super) fn get(&self, number: usize) -> Option<&T> {
        self.others.get(number).and_then(Option::as_ref)
    }

    /// Values beside the active one.
    pub(super) fn others(&self) -> impl Iterator<Item = &T> {
        self.others.iter().flatten()
    }

    /// Puts the value with `number` into `active`, and keeps what was there. A number without a value gets a `new` one.
    ///
    /// # Errors
    /// That of `new`; nothing has changed then.
    pub(super) fn swap<E>(
        &mut self,
        number: usize,
        active: &mut T,
        new: impl FnOnce() -> Result<T, E>,
    ) -> Result<(), E> {
        if number == self.active {
            return Ok(());
        }
        if self.others.len() <= number {
            self.others.resize_with(number + 1, || None);
        }
        let value = match self.others[number].take() {
            Some(value) => value,
            None => new()?,
        };
        self.others[self.active] = Some(std::mem::replace(active, value));
        self.active = number;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_back_by_their_number() {
        let (mut kept, mut active) = (Kept::default(), "a");
        let mut select = |number, new| {
            kept.swap(number, &mut active, || Ok::<_, ()>(new)).unwrap();
            active
        };
        assert_eq!(
            [select(0, "x"), select(2, "c"), select(0, "x"), select(2, "x"), select(1, "b")],
            ["a", "c", "a", "c", "b"]
        );
        assert_eq!((kept.active(), kept.get(2), kept.get(1)), (1, Some(&"c"), None));
        assert_eq!(kept.others().collect::<Vec<_>>(), [&"a", &"c"]);
    }

    #[test]
    fn a_value_that_cannot_be_made_changes_nothing() {
        let (mut kept, mut active) = (Kept::default(), 1);
        assert_eq!(kept.swap(3, &mut active, || Err("none left")), Err("none left"));
        assert_eq!((active, kept.active()), (1, 0));
        assert_eq!(kept.swap(3, &mut active, || Ok::<_, ()>(4)), Ok(()));
        assert_eq!(active, 4);
    }
}
