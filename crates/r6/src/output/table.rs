//! Plain tables: columns as wide as their widest cell.

use std::fmt;

use r6_proto::printable;

/// Rows of cells.
#[derive(Debug, Default)]
pub struct Table {
    rows: Vec<Vec<String>>,
    right: &'static [usize],
}

impl Table {
    /// An empty table. The columns with these indices are aligned right, as numbers are.
    pub fn with_right_columns(right: &'static [usize]) -> Self {
        Self { rows: Vec::new(), right }
    }

    /// An empty table.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a row.
    pub fn row<const N: usize>(&mut self, cells: [&dyn fmt::Display; N]) {
        self.push(cells.iter().map(ToString::to_string).collect());
    }

    /// Adds a row of any length. A cell stays one line, because control characters are escaped.
    pub fn push(&mut self, cells: Vec<String>) {
        self.rows.push(cells.iter().map(|cell| printable(cell).to_string()).collect());
    }

    /// How many rows there are.
    pub fn height(&self) -> usize {
        self.rows.len()
    }

    fn widths(&self) -> Vec<usize> {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        (0..columns)
            .map(|column| {
                let cells = self.rows.iter().filter_map(|row| row.get(column));
                cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
            })
            .collect()
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let widths = self.widths();
        for (number, row) in self.rows.iter().enumerate() {
            let mut text = String::new();
            for (column, (cell, width)) in row.iter().zip(&widths).enumerate() {
                if column > 0 {
                    text.push_str("  ");
                }
                let blanks = " ".repeat(width.saturating_sub(cell.chars().count()));
                if self.right.contains(&column) {
                    text.push_str(&blanks);
                    text.push_str(cell);
                } else {
                    text.push_str(cell);
                    text.push_str(&blanks);
                }
            }
            if number > 0 {
                f.write_str("\n")?;
            }
            f.write_str(text.trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let mut table = Table::with_right_columns(&[1]);
        table.row([&"axis-0", &10.5, &"deg"]);
        table.row([&"模号", &-137.25, &""]);
        assert_eq!(table.to_string(), "axis-0     10.5  deg\n模号      -137.25");
    }

    #[test]
    fn a_cell_is_one_line() {
        let mut table = Table::new();
        table.row([&"version", &"v1\r\nREADY\u{1b}[2J"]);
        assert_eq!(table.to_string(), r"version  v1\r\nREADY\u{1b}[2J");
    }
}
