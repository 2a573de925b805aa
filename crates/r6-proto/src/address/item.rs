//! Writes addresses as the items of a query: names in quotes. Almost all addresses are prepared at compile
//! time and copied. Registers, and counters from 8 on, are put together when they are written.

use super::{ADDRESSES, Address};
use crate::encode::{Short, write_closed_integer};

impl Address {
    /// Appends the name in quotes, with a comma before it unless it is the first item of its list.
    #[inline]
    pub(crate) fn write_item(self, first: bool, out: &mut Vec<u8>) {
        #[expect(clippy::indexing_slicing, reason = "a constant below the table's length in every arm")]
        let row = &ITEMS[self.row()];
        let index = self.index().unwrap_or(0);
        match row.get(index as usize) {
            Some(item) => item.behind_comma(first).append_to(out),
            None => write_long_item(row, index, first, out),
        }
    }
}

/// The same for an index beyond the prepared ones: the name of index 0 without its digit, then the index.
#[inline(never)]
fn write_long_item([zeroth, ..]: &[Short; COLUMNS], index: u32, first: bool, out: &mut Vec<u8>) {
    zeroth.behind_comma(first).without_last(b"0\"".len()).append_to(out);
    write_closed_integer(out, i64::from(index));
}

/// How many items of a row are prepared. Axes and words are numbered 0 to 7.
const COLUMNS: usize = 8;

/// The names in quotes after a comma, by row and index. Rows without an index, and the row of the registers,
/// use only their first item.
static ITEMS: [[Short; COLUMNS]; ADDRESSES.len()] = {
    let mut items = [[Short::EMPTY; COLUMNS]; ADDRESSES.len()];
    let (mut slots, mut rows) = (items.as_mut_slice(), ADDRESSES.as_slice());
    while let ([row_of_items, later_slots @ ..], [row, later_rows @ ..]) = (slots, rows) {
        let mut columns = row_of_items.as_mut_slice();
        let mut digit = b'0';
        while let [item, later_columns @ ..] = columns {
            let begun = Short::EMPTY.and(b",\"");
            *item = match (row.name.as_bytes(), row.indices) {
                ([name @ .., _], Some(_)) => begun.and(name).with(digit),
                (name, _) => begun.and(name),
            }
            .with(b'"');
            columns = later_columns;
            digit += 1;
        }
        (slots, rows) = (later_slots, later_rows);
    }
    items
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_the_name_in_quotes() {
        let large = [Address::Counter(10), Address::Counter(999_999_999), Address::Input(8), Address::M(255)];
        let named = ADDRESSES.iter().flat_map(|row| {
            let (first, last) = row.indices.unwrap_or((0, 0));
            (first..=last.min(first + 100))
                .map(|index| Address::parse(&row.name.replace("-n", &format!("-{index}"))).unwrap())
        });
        for address in named.chain(large) {
            let mut items = Vec::new();
            address.write_item(true, &mut items);
            address.write_item(false, &mut items);
            assert_eq!(String::from_utf8(items).unwrap(), format!("\"{address}\",\"{address}\""));
        }
    }
}
