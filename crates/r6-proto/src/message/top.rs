//! The keys at the top of a frame.

/// Defines the table of keys. Each row has the name in the code and the name on the wire.
macro_rules! top {
    ($( $key:ident $name:literal )+) => {
        /// A key at the top of a frame; the number is its slot.
        #[derive(Clone, Copy, PartialEq, Eq)]
        pub(crate) enum Top { $( $key, )+ }

        impl Top {
            /// All keys, by slot.
            pub const ALL: [Self; [$( $name ),+].len()] = [$( Self::$key ),+];

            /// Their names, by slot.
            pub const KEYS: [&str; Self::ALL.len()] = [$( $name ),+];

            /// The key with this name.
            pub fn of(name: &[u8]) -> Option<Self> {
                $( if name == $name.as_bytes() {
                    return Some(Self::$key);
                } )+
                None
            }
        }
    };
}

top! {
    DsId "dsID"
    ReqType "reqType"
    CmdType "cmdType"
    PackId "packID"
    QueryAddr "queryAddr"
    QueryData "queryData"
    CmdData "cmdData"
    CmdReply "cmdReply"
    CamId "camID"
    Ret "ret"
    EmptyList "emptyList"
    Instructions "instructions"
    DsData "dsData"
}

impl Top {
    /// The bit of this slot.
    #[inline]
    pub const fn bit(self) -> u32 {
        1 << self as u32
    }
}
