//! Addresses as the items of a query: names in quotes. Nearly all that are ever asked for are ready made and copied; counters and
//! registers are put together.

use super::{ADDRESSES, Address};
use crate::encode::{Short, write_closed_integer};

impl Address {
    /// Appends the name in quotes, with a comma before it unless it is the first of its list.
    #[inline]
    pub(crate) fn write_item(self, first: bool, out: &mut Vec<u8>) {
        match ITEMS.get(self.row()).and_then(|row| row.get(self.column())) {
            Some(item) => item.behind_comma(first).append_to(out),
            None => self.write_long_item(first, out),
        }
    }

    /// Where its item stands in its row of [`ITEMS`]; beyond the end for a name that is put together.
    #[inline]
    fn column(self) -> usize {
        match self {
            Self::Input(n) | Self::Output(n) | Self::M(n) => usize::from(n),
            Self::Axis(axis)
            | Self::World(axis)
            | Self::CurTorque(axis)
            | Self::CurSpeed(axis)
            | Self::Faxis(axis) => axis.index(),
            Self::Counter(_) | Self::Addr(_) => COLUMNS,
            Self::Version
            | Self::CurMold
            | Self::CounterList
            | Self::CurMode
            | Self::BoardIoNum
            | Self::AxisNum
            | Self::CurAlarm
            | Self::CurCycle
            | Self::LastCycle
            | Self::MachineName
            | Self::CurAccount
            | Self::Origin
            | Self::MoldList
            | Self::IsMoving
            | Self::RemoteCmdLen
            | Self::ToolCoord => 0,
        }
    }

    /// The same for an index beyond the table: the name of index 0 without its digit, then the index.
    #[inline(never)]
    fn write_long_item(self, first: bool, out: &mut Vec<u8>) {
        let [zeroth, ..] = ITEMS.get(self.row()).copied().unwrap_or([Short::EMPTY; COLUMNS]);
        zeroth.behind_comma(first).without_last(b"0\"".len()).append_to(out);
        write_closed_integer(out, self.index().map_or(0, i64::from));
    }
}

/// How many items of a row are ready made: axes and words are numbered from 0 to 7.
const COLUMNS: usize = 8;

/// The names in quotes behind a comma, by row and index. In a row without an index, of counters and of registers only the first
/// counts.
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
    use super::super::LAST_COUNTER;
    use super::*;

    #[test]
    fn every_item_is_the_name_in_quotes() {
        let large =
            [Address::Counter(10), Address::Counter(LAST_COUNTER), Address::Input(8), Address::M(255)];
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
