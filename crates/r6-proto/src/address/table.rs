//! The table of query addresses. To add an address, add a row here, a row in `docs/PROTOCOL.md`, and the
//! virtual controller's answer.

use super::{AddressInfo, Ports, RegisterIndex, ValueType};
use crate::axis::AxisIndex;

/// The type of an address's index.
pub(super) trait Index: Sized {
    /// The lowest and the highest index.
    const RANGE: (u32, u32);

    /// The index with this number, which must be within the range.
    fn of(number: u32) -> Option<Self>;

    fn number(self) -> u32;
}

impl Index for AxisIndex {
    const RANGE: (u32, u32) = (0, 7);

    fn of(number: u32) -> Option<Self> {
        u8::try_from(number).ok().and_then(Self::new)
    }

    fn number(self) -> u32 {
        u32::from(Self::number(self))
    }
}

/// Index of the words of inputs, outputs and M points. One board has 32 points, and a command can name boards
/// 0 to 7.
impl Index for u8 {
    const RANGE: (u32, u32) = (0, 7);

    fn of(number: u32) -> Option<Self> {
        Self::try_from(number).ok()
    }

    fn number(self) -> u32 {
        u32::from(self)
    }
}

/// Index of counters. The manual sets no limit to counter ids; nine digits are more than any pendant shows.
impl Index for u32 {
    const RANGE: (u32, u32) = (0, 999_999_999);

    fn of(number: u32) -> Option<Self> {
        Some(number)
    }

    fn number(self) -> u32 {
        self
    }
}

impl Index for RegisterIndex {
    const RANGE: (u32, u32) = (Self::FIRST as u32, Self::LAST as u32);

    fn of(number: u32) -> Option<Self> {
        u16::try_from(number).ok().and_then(Self::new)
    }

    fn number(self) -> u32 {
        u32::from(Self::number(self))
    }
}

/// Defines the table. Each row has: the address and the type of its index, its name on the wire up to the
/// index, the type of the value, the unit, the ports that offer it, the first manual or firmware that knows
/// it, the source, and the meaning.
macro_rules! addresses {
    ($(
        $name:ident $(($index:ty))? $stem:literal $value:ident $unit:literal $ports:ident $since:literal $source:literal $meaning:literal
    )+) => {
        /// The name of one readable value (manual 4.1.1 and later manuals).
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Address {
            $( #[doc = concat!("`", $stem, $( addresses!(n $index), )? "`: ", $meaning, ".")] $name $(($index))?, )+
        }

        /// Every address, in the manual's order, then the later ones.
        pub const ADDRESSES: [AddressInfo; [$( $stem ),+].len()] = [$( AddressInfo {
            name: concat!($stem, $( addresses!(n $index) )?),
            indices: addresses!(range $($index)?),
            value: ValueType::$value,
            unit: $unit,
            meaning: $meaning,
            ports: Ports::$ports,
            since: $since,
            source: $source,
        }, )+];

        /// The rows, by name.
        enum Row { $( $name, )+ }

        impl Address {
            /// The number of the row.
            #[inline]
            pub(super) fn row(self) -> usize {
                match self {
                    $( Self::$name { .. } => Row::$name as usize, )+
                }
            }

            /// The index of an indexed address.
            #[must_use]
            pub fn index(self) -> Option<u32> {
                match self {
                    $( addresses!(pattern $name number $($index)?) => addresses!(number number $($index)?), )+
                }
            }

            /// The address with this stem (its name up to the index) and this index.
            #[inline]
            pub(super) fn of(stem: &[u8], index: impl FnOnce((u32, u32)) -> Option<u32>) -> Option<Self> {
                $( if stem == $stem.as_bytes() {
                    return addresses!(of index $name $($index)?);
                } )+
                None
            }
        }
    };
    (n $index:ty) => { "n" };
    (range) => { None };
    (range $index:ty) => { Some(<$index as Index>::RANGE) };
    (pattern $name:ident $number:ident) => { Self::$name };
    (pattern $name:ident $number:ident $index:ty) => { Self::$name($number) };
    (number $number:ident) => { None };
    (number $number:ident $index:ty) => { Some(<$index as Index>::number($number)) };
    (of $digits:ident $name:ident) => { Some(Self::$name) };
    (of $digits:ident $name:ident $index:ty) => { $digits(<$index as Index>::RANGE).and_then(<$index as Index>::of).map(Self::$name) };
}

#[rustfmt::skip]
addresses! {
    Version "version" Text "" Both "V6.0" "4.1.1 #1" "firmware version"
    CurMold "curMold" Text "" Pendant "V6.0" "4.1.1 #2" "name of the program (mold) in use"
    CounterList "counterList" TextList "" Both "V6.0" "4.1.1 #3" "ids of the counters"
    Counter(u32) "counter-" Counter "" Both "V6.0" "4.1.1 #4" "one counter: id, target, current"
    CurMode "curMode" Integer "" Both "V6.0" "4.1.1 #5" "operation mode: 0 none, 1 manual, 2 auto, 3 stop, 7 running, 8 single step, 9 single cycle"
    BoardIoNum "boardIOnum" Integer "" Both "V6.0" "4.1.1 #6" "number of IO boards"
    Input(u8) "input-" Word "" Both "V6.0" "4.1.1 #7" "inputs 32n+1 to 32n+32"
    Output(u8) "output-" Word "" Both "V6.0" "4.1.1 #8" "outputs 32n+1 to 32n+32"
    AxisNum "axisNum" Integer "" Both "V6.0" "4.1.1 #9" "number of axes"
    Axis(AxisIndex) "axis-" Decimal "deg" Both "V6.0" "4.1.1 #10" "position of axis n (mm on a linear axis)"
    World(AxisIndex) "world-" Decimal "mm, deg" Both "V6.0" "4.1.1 #11" "pose: X, Y, Z in mm, U, V, W in degrees, M7, M8"
    CurAlarm "curAlarm" Integer "" Both "V6.0" "4.1.1 #12" "number of the present alarm, 0 for none"
    CurCycle "curCycle" Decimal "s" Both "V6.0" "4.1.1 #13" "time of the present cycle"
    LastCycle "lastCycle" Decimal "s" Both "V6.0" "4.1.1 #14" "time of the last cycle"
    MachineName "machineName" Text "" Both "V6.0" "4.1.1 #15" "name of the machine"
    CurTorque(AxisIndex) "curTorque-" Integer "1/2580 of rated" Mainboard "V6.0" "4.1.1 #16" "torque of axis n; 2580 is the rated torque"
    CurSpeed(AxisIndex) "curSpeed-" Integer "RPM" Mainboard "V6.0" "4.1.1 #17" "motor speed of axis n"
    CurAccount "curAccount" Text "" Pendant "V6.0" "4.1.1 #18" "user logged in at the pendant"
    Origin "origin" Flag "" Both "V6.0" "4.1.1 #19" "1 once the machine is homed"
    MoldList "moldList" TextList "" Both "V6.0" "4.1.1 #20" "names of the programs (molds)"
    IsMoving "isMoving" Flag "" Both "V6.0" "4.1.1 #21" "1 while moving, 0 at rest"
    M(u8) "M-" Word "" Both "V6.0" "4.1.1 #22" "M points 32n+1 to 32n+32"
    Addr(RegisterIndex) "Addr-" Integer "" Both "206 master F1" "later manual; captured, unit C" "register n, a whole number"
    RemoteCmdLen "RemoteCmdLen" Integer "" Both "207beta25" "later manual; used by units A, B, C" "instructions left in the instruction list"
    ToolCoord "toolCoord" TextList "" Both "207beta91" "later manual" "tool, workbench and collaborative desk in use"
    Faxis(AxisIndex) "faxis-" Decimal "deg" Both "unknown" "asked for by the maker's viewer" "undocumented; taken for the commanded position of axis n"
}
