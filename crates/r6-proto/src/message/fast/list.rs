//! Lists of short plain texts: the addresses of a query, the values of its reply, the words of a command.

use super::short_text;
use crate::value::Node;

/// Reads texts of a list into `nodes`, from the quote of an item at `from` on, for as long as they are short and plain and
/// nothing but a comma is between them; gives the offset behind the last.
///
/// Where not even the first is such a text, that is `from` itself.
#[inline]
pub(in crate::message) fn read_texts(bytes: &[u8], from: usize, nodes: &mut Vec<Node>) -> usize {
    let mut at = from;
    let mut behind = from;
    while bytes.get(at) == Some(&b'"')
        && let Some(node) = short_text(bytes, at + 1)
    {
        nodes.push(node);
        behind = node.span.end as usize + 1;
        if bytes.get(behind) != Some(&b',') {
            break;
        }
        at = behind + 1;
    }
    behind
}
