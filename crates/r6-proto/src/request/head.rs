//! The beginning of a request: brace, `dsID` and type. It depends on only three choices, so the compiler
//! prepares it for each of them, and one copy begins a frame.

use crate::dialect::{Addressing, DsIdForm};
use crate::message::{RequestType, TypeKey};

/// Length of the buffer. The longest head, that of `heartbreak`, fits exactly; a longer head is a compile
/// error.
const MOST: usize = 64;

#[derive(Clone, Copy)]
struct Head {
    bytes: [u8; MOST],
    length: usize,
}

impl Head {
    const fn of(request: RequestType, form: DsIdForm, key: TypeKey) -> Self {
        let head = Self { bytes: [0; MOST], length: 0 };
        let head = head.and("{\"dsID\":\"").and(form.ds_id(request)).and("\"");
        match key {
            TypeKey::Absent => head,
            TypeKey::ReqType | TypeKey::CmdType => {
                head.and(",\"").and(key.word()).and("\":\"").and(request.word()).and("\"")
            }
        }
    }

    /// The head followed by a text.
    const fn and(mut self, text: &str) -> Self {
        let (_, mut room) = self.bytes.split_at_mut(self.length);
        let mut rest = text.as_bytes();
        while let ([byte, later @ ..], [first, behind @ ..]) = (room, rest) {
            *byte = *first;
            (room, rest) = (later, behind);
        }
        assert!(rest.is_empty(), "a head is longer than MOST");
        self.length += text.len();
        self
    }
}

/// The heads by request, form and key.
static HEADS: [[[Head; 3]; 2]; 6] = {
    const fn keys(request: RequestType, form: DsIdForm) -> [Head; 3] {
        [
            Head::of(request, form, TypeKey::ReqType),
            Head::of(request, form, TypeKey::CmdType),
            Head::of(request, form, TypeKey::Absent),
        ]
    }
    const fn forms(request: RequestType) -> [[Head; 3]; 2] {
        [keys(request, DsIdForm::Long), keys(request, DsIdForm::Short)]
    }
    [
        forms(RequestType::Query),
        forms(RequestType::Command),
        forms(RequestType::Heartbreak),
        forms(RequestType::Photo),
        forms(RequestType::AddPoints),
        forms(RequestType::AddRcc),
    ]
};

/// Appends the head of a frame.
#[inline]
pub(super) fn append(out: &mut Vec<u8>, addressing: &Addressing<'_>, request: RequestType) {
    let [query, command, heartbreak, photo, add_points, add_rcc] = &HEADS;
    let [long, short] = match request {
        RequestType::Query => query,
        RequestType::Command => command,
        RequestType::Heartbreak => heartbreak,
        RequestType::Photo => photo,
        RequestType::AddPoints => add_points,
        RequestType::AddRcc => add_rcc,
    };
    let [req_type, cmd_type, absent] = match addressing.ds_id {
        DsIdForm::Long => long,
        DsIdForm::Short => short,
    };
    let head = match addressing.type_key {
        TypeKey::ReqType => req_type,
        TypeKey::CmdType => cmd_type,
        TypeKey::Absent => absent,
    };
    let end = out.len() + head.length;
    out.extend_from_slice(&head.bytes);
    out.truncate(end);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_head_has_its_own_words() {
        for request in RequestType::ALL {
            for ds_id in [DsIdForm::Long, DsIdForm::Short] {
                for type_key in [TypeKey::ReqType, TypeKey::CmdType, TypeKey::Absent] {
                    let mut out = b"before".to_vec();
                    append(&mut out, &Addressing { ds_id, type_key, pack_id: None }, request);
                    let named = match type_key {
                        TypeKey::ReqType => format!(",\"reqType\":\"{request}\""),
                        TypeKey::CmdType => format!(",\"cmdType\":\"{request}\""),
                        TypeKey::Absent => String::new(),
                    };
                    let wanted = format!("before{{\"dsID\":\"{}\"{named}", ds_id.ds_id(request));
                    assert_eq!(String::from_utf8(out).unwrap(), wanted);
                }
            }
        }
    }
}
