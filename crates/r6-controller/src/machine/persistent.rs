//! State that survives a power cut and counts its possible changes.

use std::ops::{Deref, DerefMut};

use r6_motion::Frame;

/// A value that counts how often it may have changed. Every mutable borrow counts.
#[derive(Clone, Debug, Default)]
pub(crate) struct Persistent<T> {
    value: T,
    changes: u64,
}

impl<T> Persistent<T> {
    pub fn new(value: T) -> Self {
        Self { value, changes: 0 }
    }

    /// How often it may have changed.
    pub fn changes(&self) -> u64 {
        self.changes
    }
}

impl<T> Deref for Persistent<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> DerefMut for Persistent<T> {
    fn deref_mut(&mut self) -> &mut T {
        self.changes += 1;
        &mut self.value
    }
}

/// A tool or workbench, as it was given and as a transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placed {
    /// X, Y, Z in mm, U, V, W in degrees.
    pub offset: [f64; 6],
    /// The same as a transform.
    pub frame: Frame,
}
