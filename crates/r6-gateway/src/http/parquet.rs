//! The history as a file of Apache Parquet, for pandas, Polars, DuckDB and the like.
//!
//! Numbers stay numbers, times are microseconds UTC, and a missing value is null. The file says of which
//! robot and signal it is, in its key-value metadata.

use std::sync::Arc;

use parquet::basic::{ConvertedType, LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::Result;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};
use r6_api::AddressValue;
use r6_api::gateway::History;
use r6_proto::address::ValueType;

use super::history::good_ms;
use crate::core::history::buckets::Bucket;
use crate::core::history::sample::Sample;

/// The media type, as it is registered at IANA.
pub const MEDIA_TYPE: &str = "application/vnd.apache.parquet";

/// The columns of a file, each with a value or null for every row.
struct Columns(Vec<(&'static str, Column)>);

enum Column {
    /// Microseconds since 1970, UTC; never null.
    Times(Vec<i64>),
    Decimals(Vec<Option<f64>>),
    Integers(Vec<Option<i64>>),
    Flags(Vec<Option<bool>>),
    Texts(Vec<Option<String>>),
}

/// The file with these samples. `about` is the answer in words, for the metadata.
///
/// # Errors
/// Those of the library, which writes into memory: there are none that a caller could mend.
pub fn of_samples(samples: &[Sample], kind: ValueType, about: &History) -> Result<Vec<u8>> {
    let values = samples.iter().map(|sample| sample.state.value(kind)).collect();
    let gaps = samples.iter().map(|sample| sample.state.gap().map(|gap| gap.word().to_owned())).collect();
    let columns = vec![
        ("time", Column::Times(samples.iter().map(|sample| sample.time.0).collect())),
        ("value", column(values, kind)),
        ("gap", Column::Texts(gaps)),
    ];
    Columns(columns).file(about)
}

/// The file with these buckets.
///
/// # Errors
/// As [`of_samples`].
pub fn of_buckets(buckets: &[Bucket], kind: ValueType, about: &History) -> Result<Vec<u8>> {
    let all = |of: fn(&Bucket) -> Option<f64>| Column::Decimals(buckets.iter().map(of).collect());
    let last = |bucket: &Bucket| bucket.last.as_ref().and_then(|last| last.value(kind));
    let samples = |bucket: &Bucket| i64::try_from(bucket.samples).ok();
    let columns = vec![
        ("time", Column::Times(buckets.iter().map(|bucket| bucket.start.0).collect())),
        ("mean", all(|bucket| bucket.mean)),
        ("min", all(|bucket| bucket.range.map(|range| range.0))),
        ("max", all(|bucket| bucket.range.map(|range| range.1))),
        ("last", column(buckets.iter().map(last).collect(), kind)),
        ("good_ms", all(|bucket| Some(good_ms(bucket)))),
        ("samples", Column::Integers(buckets.iter().map(samples).collect())),
    ];
    Columns(columns).file(about)
}

/// The values as a column of the type that their address has. A value of another type, which a controller
/// sent against the table, is null there.
fn column(values: Vec<Option<AddressValue>>, kind: ValueType) -> Column {
    match kind {
        ValueType::Decimal => Column::Decimals(each(values, |value| match value {
            AddressValue::Decimal(number) => Some(number),
            _ => None,
        })),
        ValueType::Integer | ValueType::Word => Column::Integers(each(values, |value| match value {
            AddressValue::Integer(number) => Some(number),
            AddressValue::Word(word) => Some(i64::from(word)),
            _ => None,
        })),
        ValueType::Flag => Column::Flags(each(values, |value| match value {
            AddressValue::Flag(flag) => Some(flag),
            _ => None,
        })),
        ValueType::Text | ValueType::TextList | ValueType::Counter => {
            Column::Texts(each(values, |value| match value {
                AddressValue::Text(text) => Some(text),
                list_or_counter => serde_json::to_string(&list_or_counter).ok(),
            }))
        }
    }
}

fn each<T>(values: Vec<Option<AddressValue>>, read: fn(AddressValue) -> Option<T>) -> Vec<Option<T>> {
    values.into_iter().map(|value| value.and_then(read)).collect()
}

impl Columns {
    fn file(self, about: &History) -> Result<Vec<u8>> {
        let fields = self.0.iter().map(|(name, column)| column.field(name)).collect::<Result<_>>()?;
        let schema = Type::group_type_builder("history").with_fields(fields).build()?;
        let properties = WriterProperties::builder()
            .set_created_by("r6".to_owned())
            .set_key_value_metadata(Some(metadata(about)))
            .build();
        let mut writer = SerializedFileWriter::new(Vec::new(), Arc::new(schema), Arc::new(properties))?;
        let mut rows = writer.next_row_group()?;
        for (_, column) in self.0 {
            column.write(&mut rows)?;
        }
        rows.close()?;
        writer.into_inner()
    }
}

impl Column {
    fn field(&self, name: &str) -> Result<TypePtr> {
        let of = |physical| Type::primitive_type_builder(name, physical);
        let field = match self {
            Self::Times(_) => of(Physical::INT64)
                .with_repetition(Repetition::REQUIRED)
                .with_logical_type(Some(LogicalType::timestamp(true, TimeUnit::MICROS))),
            Self::Decimals(_) => of(Physical::DOUBLE),
            Self::Integers(_) => of(Physical::INT64),
            Self::Flags(_) => of(Physical::BOOLEAN),
            Self::Texts(_) => of(Physical::BYTE_ARRAY)
                .with_converted_type(ConvertedType::UTF8)
                .with_logical_type(Some(LogicalType::String)),
        };
        Ok(Arc::new(field.build()?))
    }

    fn write(self, rows: &mut SerializedRowGroupWriter<'_, Vec<u8>>) -> Result<()> {
        match self {
            Self::Times(times) => write::<Int64Type>(rows, &times, None),
            Self::Decimals(of) => write_optional::<DoubleType>(rows, of),
            Self::Integers(of) => write_optional::<Int64Type>(rows, of),
            Self::Flags(of) => write_optional::<BoolType>(rows, of),
            Self::Texts(of) => {
                let bytes = of.into_iter().map(|text| text.map(|text| ByteArray::from(text.into_bytes())));
                write_optional::<ByteArrayType>(rows, bytes.collect())
            }
        }
    }
}

fn write_optional<T: DataType>(
    rows: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    values: Vec<Option<T::T>>,
) -> Result<()> {
    // The level of a row says whether it has a value; null takes no place among the values.
    let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
    let present: Vec<T::T> = values.into_iter().flatten().collect();
    write::<T>(rows, &present, Some(&levels))
}

fn write<T: DataType>(
    rows: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    values: &[T::T],
    levels: Option<&[i16]>,
) -> Result<()> {
    let Some(mut column) = rows.next_column()? else {
        return Err(parquet::errors::ParquetError::General("a column more than the schema has".to_owned()));
    };
    column.typed::<T>().write_batch(values, levels, None)?;
    column.close()
}

fn metadata(about: &History) -> Vec<KeyValue> {
    let History {
        robot,
        signal,
        unit,
        from,
        to,
        bucket_ms,
        kept_until,
        unreadable_chunks,
        averages,
        next_cursor,
        ..
    } = about;
    let averages = (!averages.is_empty()).then(|| serde_json::to_string(averages).ok()).flatten();
    let bucket_ms = bucket_ms.map(|width| width.to_string());
    let pairs = [
        ("robot", Some(robot.clone())),
        ("signal", Some(signal.clone())),
        ("unit", unit.clone()),
        ("from", Some(from.clone())),
        ("to", Some(to.clone())),
        ("bucket_ms", bucket_ms),
        ("kept_until", kept_until.clone()),
        ("unreadable_chunks", Some(unreadable_chunks.to_string())),
        ("averages", averages),
        ("next_cursor", next_cursor.clone()),
    ];
    let told = pairs.into_iter().filter(|(_, value)| value.is_some());
    told.map(|(key, value)| KeyValue::new(format!("r6.{key}"), value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::history::sample::{Micros, State};
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;
    use r6_api::gateway::{AveragesUsed, Gap, HistoryAverages};

    fn about(bucket_ms: Option<u64>) -> History {
        History {
            robot: "press".to_owned(),
            signal: "axis-0".to_owned(),
            unit: Some("mm".to_owned()),
            from: "F".to_owned(),
            to: "T".to_owned(),
            bucket_ms,
            samples: None,
            buckets: None,
            kept_until: None,
            unreadable_chunks: 2,
            averages: vec![HistoryAverages {
                from: "A".to_owned(),
                to: "B".to_owned(),
                width_ms: 60_000,
                used: AveragesUsed::Exact,
            }],
            next_cursor: Some("t9".to_owned()),
        }
    }

    fn read(file: Vec<u8>) -> SerializedFileReader<axum::body::Bytes> {
        SerializedFileReader::new(axum::body::Bytes::from(file)).unwrap()
    }

    /// The rows as the library prints them.
    fn rows(states: &[State], kind: ValueType) -> Vec<String> {
        let samples = |(at, state): (i64, &State)| Sample { time: Micros(at), state: state.clone() };
        let samples: Vec<_> = (0..).zip(states).map(samples).collect();
        let reader = read(of_samples(&samples, kind, &about(None)).unwrap());
        let rows = reader.get_row_iter(None).unwrap();
        rows.enumerate()
            .map(|(at, row)| {
                let row = row.unwrap();
                assert_eq!(row.get_timestamp_micros(0).unwrap(), i64::try_from(at).unwrap());
                let mut columns = row.get_column_iter().skip(1).map(|(_, field)| field.to_string());
                format!("{} {}", columns.next().unwrap(), columns.next().unwrap())
            })
            .collect()
    }

    #[test]
    fn each_type_of_value_has_its_column_and_a_gap_is_null() {
        let gap = State::Gap(Gap::Lost);
        let text = |text: &str| State::Text(text.into());
        assert_eq!(
            rows(&[State::Decimal(-1.25), gap.clone()], ValueType::Decimal),
            ["-1.25E0 null", "null \"lost\""]
        );
        let far = State::Integer(i64::MIN);
        assert_eq!(rows(&[gap.clone(), far], ValueType::Integer)[1], "-9223372036854775808 null");
        let word = State::Integer(i64::from(u32::MAX));
        assert_eq!(rows(&[word], ValueType::Word), ["4294967295 null"]);
        assert_eq!(
            rows(&[State::Integer(1), State::Integer(0)], ValueType::Flag),
            ["true null", "false null"]
        );
        assert_eq!(rows(&[text("=1+1, \"a\"")], ValueType::Text), ["\"=1+1, \"a\"\" null"]);
        assert_eq!(rows(&[text(r#"["a","b"]"#)], ValueType::TextList), [r#""["a","b"]" null"#]);
        assert!(rows(&[], ValueType::Counter).is_empty());
    }

    #[test]
    fn a_file_says_what_it_is() {
        let bucket = Bucket {
            start: Micros(1_700_000_000_000_000),
            mean: Some(0.5),
            range: Some((0.0, 1.0)),
            last: None,
            good: 10_500,
            weight: 10_500,
            samples: 3,
        };
        let reader = read(of_buckets(&[bucket], ValueType::Decimal, &about(Some(1000))).unwrap());
        let metadata = reader.metadata().file_metadata();
        let pairs = metadata.key_value_metadata().unwrap();
        let of = |key: &str| pairs.iter().find(|pair| pair.key == key)?.value.as_deref();
        let told =
            ["r6.robot", "r6.signal", "r6.unit", "r6.bucket_ms", "r6.unreadable_chunks", "r6.next_cursor"];
        let known = ["press", "axis-0", "mm", "1000", "2", "t9"];
        assert_eq!(told.map(of), known.map(Some));
        let averages = r#"[{"from":"A","to":"B","width_ms":60000,"used":"exact"}]"#;
        assert_eq!(of("r6.averages"), Some(averages));
        assert!(pairs.iter().all(|pair| pair.key != "r6.kept_until"), "what is not known is left out");
        let names: Vec<_> =
            metadata.schema_descr().columns().iter().map(|column| column.name().to_owned()).collect();
        assert_eq!(names, ["time", "mean", "min", "max", "last", "good_ms", "samples"]);
        let row = reader.get_row_iter(None).unwrap().next().unwrap().unwrap();
        assert_eq!(row.get_timestamp_micros(0).unwrap(), 1_700_000_000_000_000);
        assert_eq!(row.get_double(5).unwrap().to_bits(), 10.5_f64.to_bits());
        assert_eq!(row.get_long(6).unwrap(), 3);
    }
}
