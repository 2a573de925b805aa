//! The golden vectors, one test each. A test decodes the vector and encodes it again. Replies must have
//! exactly the captured bytes.

use std::collections::BTreeSet;

use r6_proto::axis::AxisMask;
use r6_proto::dialect::{Addressing, Dialect, DsIdForm};
use r6_proto::frame::{FrameBuffer, Limits};
use r6_proto::message::reading::Counter;
use r6_proto::message::{Body, CommandReply, Header, PhotoAnswer};
use r6_proto::reply::{DataWriter, ReplyWriter, Verdict, encode_photo};
use r6_proto::request::CameraPoints;
use r6_proto::value::Value as WireValue;
use r6_proto::{Address, Decoder, Message, Request, RequestType};
use r6_testkit::vector::{self, ExpectedError, Vector};
use serde_json::Value;

#[path = "common/render.rs"]
mod render;

macro_rules! vectors {
    ($($stem:ident,)*) => {
        /// Every vector that has a test.
        const TESTED: &[&str] = &[$(stringify!($stem)),*];

        $(
            #[test]
            fn $stem() {
                check(&vector::load(stringify!($stem)));
            }
        )*
    };
}

vectors! {
    captured_add_rcc_2020_shape,
    captured_unit_a_add_rcc_ok,
    captured_unit_b_add_rcc_err,
    captured_unit_b_modify_gspd_reply,
    captured_unit_c_counters,
    captured_unit_c_modify_counter_reply,
    captured_unit_c_registers,
    captured_unit_c_rewrite_data_list_reply,
    captured_unit_c_rewrite_data_reply,
    captured_unit_c_start_button_reply,
    captured_unit_c_version_curmold,
    captured_unit_d_add_points_reply,
    captured_unit_d_photo,
    captured_unit_d_photo_answer,
    captured_unit_d_world,
    captured_unit_e_cmd_echo,
    captured_unit_e_query_echo,
    constructed_add_points_angle,
    constructed_add_points_none,
    constructed_add_points_pack_id,
    constructed_add_points_reply_pack_id,
    constructed_add_points_unknown_key,
    constructed_add_rcc_action_14,
    constructed_add_rcc_action_unknown,
    constructed_add_rcc_addr_cc,
    constructed_add_rcc_append,
    constructed_add_rcc_axis_move_eight,
    constructed_add_rcc_clear,
    constructed_add_rcc_curve_move,
    constructed_add_rcc_duplicate_key,
    constructed_add_rcc_linear_move,
    constructed_add_rcc_numbers,
    constructed_add_rcc_output,
    constructed_add_rcc_output_m,
    constructed_add_rcc_output_timed,
    constructed_add_rcc_physical_speed,
    constructed_add_rcc_physical_speed_off,
    constructed_add_rcc_physical_speed_then_line,
    constructed_add_rcc_reply_err,
    constructed_add_rcc_reply_ok,
    constructed_add_rcc_reversed_keys,
    constructed_add_rcc_short_ds_id,
    constructed_add_rcc_stop_on_signal,
    constructed_add_rcc_two,
    constructed_add_rcc_unknown_key,
    constructed_add_rcc_wait_delay,
    constructed_add_rcc_wait_input,
    constructed_add_rcc_wait_m_unlimited,
    constructed_add_rcc_whole_board,
    constructed_add_rcc_whole_board_short,
    constructed_add_rcc_work_frame,
    constructed_ck_status_absent,
    constructed_ck_status_decimal,
    constructed_ck_status_decimal_text,
    constructed_ck_status_hex,
    constructed_ck_status_hex_capital_x,
    constructed_ck_status_position,
    constructed_command_action_pause,
    constructed_command_action_single_cycle,
    constructed_command_action_stop,
    constructed_command_clear_alarm,
    constructed_command_clear_alarm_continue,
    constructed_command_clear_alarm_first_line,
    constructed_command_clear_alarm_run_next,
    constructed_command_clear_alarm_zero,
    constructed_command_cmd_type,
    constructed_command_heartbreak,
    constructed_command_home,
    constructed_command_m_output,
    constructed_command_modify_acc_dec,
    constructed_command_modify_counter,
    constructed_command_modify_gspd,
    constructed_command_modify_output,
    constructed_command_modify_stack_data,
    constructed_command_modify_tool,
    constructed_command_numbers,
    constructed_command_reply_cmd_echo_old_ok,
    constructed_command_reply_err,
    constructed_command_reply_old_refused,
    constructed_command_reply_unknown,
    constructed_command_rewrite_data,
    constructed_command_rewrite_data_list,
    constructed_command_run,
    constructed_command_short_ds_id,
    constructed_command_start_button,
    constructed_command_stop,
    constructed_command_stop_button,
    constructed_command_switch_coordinate,
    constructed_command_switch_mold,
    constructed_command_switch_tool,
    constructed_command_unknown,
    constructed_heartbeat_misspelt,
    constructed_heartbreak_pack_id,
    constructed_photo_answer_failed,
    constructed_photo_answer_pack_id,
    constructed_photo_answer_texts,
    constructed_photo_pack_id,
    constructed_query_all_22,
    constructed_query_axes_and_world,
    constructed_query_board_io_num_capital,
    constructed_query_cmd_type,
    constructed_query_counters,
    constructed_query_duplicate_key,
    constructed_query_echo_gbk_counter,
    constructed_query_escapes,
    constructed_query_faxis,
    constructed_query_number_pack_id,
    constructed_query_registers,
    constructed_query_registers_ends,
    constructed_query_remote_cmd_len,
    constructed_query_remote_cmd_len_cmd_type,
    constructed_query_remote_cmd_len_reply,
    constructed_query_reply_empty,
    constructed_query_reply_idle_torque_speed,
    constructed_query_reply_numbers,
    constructed_query_reply_utf8_name,
    constructed_query_short_ds_id,
    constructed_query_status,
    constructed_query_tool_coord,
    constructed_query_tool_coord_reply,
    constructed_query_unknown_address,
    constructed_query_unknown_keys,
    constructed_query_version_capital,
    constructed_query_with_spaces,
    constructed_rewrite_data_with_commas,
    constructed_unknown_no_type,
    constructed_unknown_panel_dialect,
    constructed_unknown_type,
    manual_4_1_query,
    manual_4_1_query_reply,
    manual_4_2_command_reply_new,
    manual_4_2_command_reply_old,
    manual_4_2_command_template,
    manual_5_1_photo,
    manual_5_1_photo_answer,
    manual_5_2_add_points,
    manual_5_2_add_points_reply,
    manual_6_1_1_axis_move,
    manual_6_1_2_work_frame,
    manual_6_1_3_wait,
    manual_6_1_4_stop_on_signal,
    manual_6_add_rcc_reply,
    manual_6_add_rcc_template,
    manual_7_heartbreak,
    manual_8_1_rewrite_data,
    manual_8_1_rewrite_data_list,
    manual_8_2_query,
    manual_8_2_query_echo,
    manual_8_3_add_points,
    manual_8_3_add_points_reply,
}

#[test]
fn every_vector_has_a_test() {
    let tested: BTreeSet<String> = TESTED.iter().map(|stem| (*stem).to_owned()).collect();
    let present: BTreeSet<String> = vector::all().into_iter().map(|vector| vector.stem).collect();
    let untested: Vec<_> = present.difference(&tested).collect();
    let gone: Vec<_> = tested.difference(&present).collect();
    assert!(untested.is_empty() && gone.is_empty(), "without a test: {untested:?}; without a file: {gone:?}");
}

fn check(vector: &Vector) {
    if let Some(error) = &vector.error {
        check_error(&vector.frame, error);
    } else {
        assert_eq!(
            frames_of(&vector.frame),
            (vec![Ok(vector.frame.clone())], 0),
            "the frame, alone and whole"
        );
    }
    let Some(bytes) = vector.decodable() else { return };
    let mut decoder = Decoder::new();
    let message = decoder.decode(bytes).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(comparable(&render::message(&message)), comparable(&vector.decoded));
    if let Some(canonical) = &vector.canonical {
        check_canonical(&message, canonical, &vector.decoded);
    }
    if vector.reencodes {
        check_reply(&message, &vector.frame);
    }
}

/// The position of a fault and its text.
type Fault = (u64, String);

/// The results of a frame buffer for these bytes as a separate stream, and how many bytes it still holds.
fn frames_of(bytes: &[u8]) -> (Vec<Result<Vec<u8>, Fault>>, usize) {
    let mut buffer = FrameBuffer::new(Limits::default());
    assert_eq!(buffer.push(bytes), bytes.len());
    let mut frames = Vec::new();
    while let Some(frame) = buffer.next() {
        frames.push(match frame {
            Ok(frame) => Ok(frame.bytes.to_vec()),
            Err(error) => Err((error.fault_offset, error.to_string())),
        });
    }
    let pending = buffer.pending();
    (frames, pending)
}

/// The frame buffer or the decoder must report the fault and its position.
fn check_error(frame: &[u8], expected: &ExpectedError) {
    let decoded = match Decoder::new().decode(frame) {
        Ok(message) => panic!("decoded: {}", render::message(&message)),
        Err(error) => (u64::try_from(error.at).unwrap(), error.to_string()),
    };
    let mut found: Vec<Fault> = frames_of(frame).0.into_iter().filter_map(Result::err).collect();
    found.push(decoded);
    let offset = u64::try_from(expected.offset).unwrap();
    assert!(
        found.iter().any(|(at, text)| *at == offset && text.contains(&expected.names)),
        "{expected:?} is not among {found:?}"
    );
}

/// Typed members with whole numbers as integers, so that `20` and `20.0` are the same speed.
///
/// Values in their wire form stay unchanged, because there the two differ.
fn comparable(decoded: &Value) -> Value {
    let mut out = decoded.clone();
    for name in ["instructions", "sets"] {
        if let Some(typed) = out.get_mut(name) {
            whole_numbers(typed);
        }
    }
    out
}

fn whole_numbers(value: &mut Value) {
    match value {
        Value::Number(number) => {
            let float = number.as_f64().unwrap();
            if float.fract() == 0.0 && float.abs() < 9e15 {
                #[expect(clippy::cast_possible_truncation, reason = "whole and small enough to be exact")]
                let whole = float as i64;
                *value = whole.into();
            }
        }
        Value::Array(items) => items.iter_mut().for_each(whole_numbers),
        Value::Object(members) => {
            members
                .iter_mut()
                .filter(|(name, _)| *name != "fields")
                .for_each(|(_, member)| whole_numbers(member));
        }
        Value::Null | Value::Bool(_) | Value::String(_) => {}
    }
}

/// The decoded message, sent again, must have the canonical bytes, and these must have the same meaning.
fn check_canonical(message: &Message<'_>, canonical: &str, decoded: &Value) {
    let mut bytes = Vec::new();
    with_request(message, |request| {
        let pack_id = message.header.pack_id.map(|pack_id| pack_id.text());
        let ds_id = message.header.ds_id.map(|ds_id| ds_id.text());
        let long = Some(DsIdForm::Long.ds_id(request.request_type()));
        let addressing = Addressing {
            ds_id: if ds_id.as_deref() == long { DsIdForm::Long } else { DsIdForm::Short },
            type_key: message.header.type_key,
            pack_id: pack_id.as_deref(),
        };
        request.encode(&addressing, &mut bytes).unwrap_or_else(|error| panic!("{error}"));
    });
    assert_eq!(String::from_utf8_lossy(&bytes), canonical);

    let mut decoder = Decoder::new();
    let again = decoder.decode(canonical.as_bytes()).unwrap_or_else(|error| panic!("canonical: {error}"));
    let mut expected = comparable(decoded);
    let members = expected.as_object_mut().unwrap();
    // Requests that we send have no unknown and no repeated keys.
    members.remove("unknownKeys");
    members.remove("duplicateKeys");
    assert_eq!(comparable(&render::message(&again)), expected, "the canonical form means something else");
}

/// Calls `send` with the request that has the same content as the message.
fn with_request(message: &Message<'_>, send: impl FnOnce(&Request<'_>)) {
    match &message.body {
        Body::Query(query) => {
            let addresses: Vec<Address> = query.resolved().map(|(_, address)| address.unwrap()).collect();
            send(&Request::Query(&addresses));
        }
        Body::Command(words) => {
            send(&Request::Command(&words.read().unwrap_or_else(|error| panic!("{error}"))))
        }
        Body::Heartbreak => send(&Request::Heartbreak),
        Body::PhotoAnswer(PhotoAnswer { cam_id, ret }) => {
            send(&Request::PhotoAnswer(PhotoAnswer { cam_id: *cam_id, ret: *ret }));
        }
        Body::AddPoints(points) => {
            let cameras: Vec<_> =
                points.sets().map(|(cam_id, points)| CameraPoints { cam_id, points }).collect();
            send(&Request::AddPoints(&cameras));
        }
        Body::AddRcc(list) => {
            let empty_list = list.empty_list.expect("what has a canonical form says emptyList");
            send(&Request::AddRcc { empty_list, instructions: list.instructions });
        }
        Body::QueryReply(_)
        | Body::CommandReply(_)
        | Body::Photo(_)
        | Body::Unknown(_)
        | Body::Rejected(_) => {
            panic!("no request: {}", render::message(message))
        }
    }
}

/// Writes the decoded reply with the controller's writer, for the request that it must have answered. The
/// result must have the captured bytes.
fn check_reply(message: &Message<'_>, frame: &[u8]) {
    let mut out = Vec::new();
    match &message.body {
        Body::Photo(photo) => {
            let pack_id = message.header.pack_id.map(|pack_id| pack_id.text());
            encode_photo(photo.cam_id, pack_id.as_deref(), &mut out);
        }
        Body::QueryReply(reply) => {
            let addresses = reply.addresses.map_or(Value::Null, render::values);
            answer(message, &[("queryAddr", addresses)], |request, header| {
                let Body::Query(query) = request.body else { panic!("no query") };
                ReplyWriter::new(Dialect::HC1, header, RequestType::Query).query(
                    query.addresses,
                    &mut out,
                    |data| reply.values.iter().for_each(|value| write(data, value)),
                );
            });
        }
        Body::CommandReply(reply) => {
            let word = reply.command().expect("hc1 names what it answers").into_owned();
            let command = Value::from(vec![word.clone()]);
            let empty = || Value::from(Vec::<Value>::new());
            answer(
                message,
                &[("cmdData", command), ("dsData", empty()), ("instructions", empty())],
                |request, header| {
                    let kind = match request.body {
                        Body::Command(_) => RequestType::Command,
                        Body::AddPoints(_) => RequestType::AddPoints,
                        Body::AddRcc(_) => RequestType::AddRcc,
                        _ => panic!("nothing answers {}", render::message(request)),
                    };
                    ReplyWriter::new(Dialect::HC1, header, kind).verdict(&word, verdict(reply), &mut out);
                },
            );
        }
        _ => panic!("no reply: {}", render::message(message)),
    }
    assert_eq!(String::from_utf8_lossy(&out), String::from_utf8_lossy(frame));
}

/// Decodes a request with the header of the reply and gives it to `reply`.
fn answer(message: &Message<'_>, payload: &[(&str, Value)], reply: impl FnOnce(&Message<'_>, Header<'_>)) {
    let header = &message.header;
    let mut request = serde_json::Map::new();
    for (name, value) in
        [("dsID", header.ds_id), (header.type_key.word(), header.type_word), ("packID", header.pack_id)]
    {
        if let Some(value) = value {
            request.insert(name.to_owned(), render::wire(value));
        }
    }
    request.extend(payload.iter().map(|(name, value)| ((*name).to_owned(), value.clone())));
    let bytes = Value::Object(request).to_string().into_bytes();
    let mut decoder = Decoder::new();
    let request = decoder.decode(&bytes).unwrap();
    reply(&request, request.header);
}

/// Writes a value with the method for its kind, judged by its form.
fn write(data: &mut DataWriter<'_, '_>, value: WireValue<'_>) {
    if value.is_list() {
        let items: Vec<_> = value.items().collect();
        if let [id, target, current] = &items[..]
            && id.is_number()
        {
            let number = |item: &WireValue<'_>| item.integer().unwrap();
            let (id, target, current) = (number(id), number(target), number(current));
            data.counter(&Counter { id, target, current, name: None });
        } else {
            let texts: Vec<_> = items.iter().map(|item| item.text()).collect();
            data.texts(texts.iter().map(|text| &**text));
        }
        return;
    }
    match (value.integer(), value.number()) {
        (Some(number), _) if !value.text().contains('.') => data.integer(number),
        (_, Some(number)) => data.decimal(number),
        (_, None) => data.text(&value.text()),
    }
}

fn verdict<'r>(reply: &CommandReply<'r>) -> Verdict<'r> {
    let words: Vec<String> = reply.words().iter().map(|word| word.text().into_owned()).collect();
    match &words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [_, "ok"] => Verdict::Ok,
        [_, "err"] => Verdict::BareErr,
        ["AddPoints", points] => Verdict::Points(points.parse().unwrap()),
        words => panic!("no verdict that hc1 gives: {words:?}"),
    }
}

#[test]
fn a_template_without_mask_has_none() {
    // The printed frame of manual 6 leaves every field of its moves empty. No empty field may become a zero.
    let vector = vector::load("manual_6_add_rcc_template");
    let mut decoder = Decoder::new();
    let message = decoder.decode(vector.decodable().unwrap()).unwrap();
    let Body::AddRcc(list) = message.body else { panic!("{}", render::message(&message)) };
    for instruction in list.instructions {
        let r6_proto::message::Action::AxisMove(motion) = instruction.action else {
            panic!("{instruction:?}")
        };
        assert_eq!(motion.manner.mask, None::<AxisMask>);
        assert_eq!(motion.target.given(), AxisMask::NONE);
    }
}
