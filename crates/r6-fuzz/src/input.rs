//! Reads the next values of a target from the fuzzer's bytes.

/// A position in the bytes. After their end every value is 0 or empty, so any bytes are a valid input.
#[derive(Clone, Debug)]
pub struct Input<'b> {
    rest: &'b [u8],
}

impl<'b> Input<'b> {
    /// The beginning of the bytes.
    #[must_use]
    pub fn new(bytes: &'b [u8]) -> Self {
        Self { rest: bytes }
    }

    /// Whether nothing is left.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    /// All that is left.
    #[must_use]
    pub fn rest(&self) -> &'b [u8] {
        self.rest
    }

    /// The next byte.
    pub fn byte(&mut self) -> u8 {
        match self.rest.split_first() {
            Some((byte, rest)) => {
                self.rest = rest;
                *byte
            }
            None => 0,
        }
    }

    /// The lowest bit of the next byte.
    pub fn flag(&mut self) -> bool {
        self.byte() & 1 == 1
    }

    /// The next two bytes as a number.
    pub fn number(&mut self) -> u16 {
        u16::from_le_bytes([self.byte(), self.byte()])
    }

    /// A number below `end` from one byte; `end` must not be 0.
    pub fn below(&mut self, end: usize) -> usize {
        usize::from(self.byte()) % end
    }

    /// Picks one of several values.
    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }

    /// The next `count` bytes, or as many as are left.
    pub fn bytes(&mut self, count: usize) -> &'b [u8] {
        let (taken, rest) = self.rest.split_at(count.min(self.rest.len()));
        self.rest = rest;
        taken
    }

    /// Bytes with their length in one byte before them.
    pub fn piece(&mut self) -> &'b [u8] {
        let count = usize::from(self.byte());
        self.bytes(count)
    }

    /// The bytes up to the next end of line, without it.
    pub fn line(&mut self) -> &'b [u8] {
        let end = self.rest.iter().position(|byte| *byte == b'\n');
        let line = self.bytes(end.unwrap_or(self.rest.len()));
        self.bytes(1);
        line
    }

    /// A number from `-limit` to `limit`, in steps of a thousandth of `limit`.
    pub fn decimal(&mut self, limit: f64) -> f64 {
        let number = i16::from_le_bytes([self.byte(), self.byte()]);
        f64::from(number % 1001) / 1000.0 * limit
    }
}
