//! Which values of one robot changed after a number.

/// The numbers of the changes of one robot's values.
#[derive(Clone, Debug)]
pub struct Numbers {
    span: Span,
    /// The number of the last change of each value; 0 if it never changed.
    changed: Vec<u64>,
}

/// The numbers between which a reader can go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// The number that the values got when the robot was added or configured. What a reader knows from before
    /// is not about these values.
    pub born: u64,
    /// The number of the last change.
    pub number: u64,
}

impl Numbers {
    /// Numbers of this many values, which have not changed yet.
    #[must_use]
    pub fn new(born: u64, values: usize) -> Self {
        Self { span: Span { born, number: born }, changed: vec![0; values] }
    }

    /// The numbers between which a reader can go on.
    #[must_use]
    pub fn span(&self) -> Span {
        self.span
    }

    /// Makes every reader begin anew with these values.
    pub fn bear(&mut self, born: u64) {
        self.span = Span { born, number: born };
    }

    /// Notes that the values at these places changed. `number` is larger than all numbers before.
    pub fn change(&mut self, places: &[usize], number: u64) {
        for place in places {
            if let Some(changed) = self.changed.get_mut(*place) {
                *changed = number;
            }
        }
        if !places.is_empty() {
            self.span.number = number;
        }
    }

    /// The places of the values that changed after this number.
    pub fn since(&self, number: u64) -> impl Iterator<Item = usize> + '_ {
        let changed = self.changed.iter().enumerate();
        changed.filter(move |(_, changed)| **changed > number).map(|(place, _)| place)
    }
}
