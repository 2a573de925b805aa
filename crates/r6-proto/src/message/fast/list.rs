//! Reads lists of short plain texts: the addresses of a query, the values of its reply, the words of a
//! command.

use super::short_text;
use crate::value::Node;

/// Reads texts of a list into `nodes`, beginning at the opening quote at `from`. It continues while the texts
/// are short and plain, with only a comma between them. Returns the offset after the last text.
///
/// If the first item is not such a text, it returns `from`.
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
