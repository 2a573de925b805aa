//! Frames that the vectors need not contain.

/// Frames with every action, every member and every form of a value, so that a fault in one of them is found
/// without a random change.
pub const EVERY: [(&str, &[&str]); 3] = [
    (
        "every_action",
        &[
            r#"{"reqType":"AddRCC","emptyList":"0","instructions":["#,
            r#"{"action":"17","m0":"1","m3":"4","m0_p":"5","m1_p":"6","smooth":"3","speed":"12.5","delay":"0.1","tool":"1","coord":"2","ckStatus":"0x3F"},"#,
            r#"{"oneshot":"1","action":"4","m0":"1","m1":"2.5"},{"oneshot":"1","action":"10","m2":"3","speed":"80"},"#,
            r#"{"action":"51","isUse":"1","speed":"250"},{"action":"52","isUse":"1","ioNumber":"4","io_status":"0"},"#,
            r#"{"action":"100","type":"0","point":"1","io_status":"2","limit":"3.0","isUnlimit":"1"},"#,
            r#"{"action":"200","type":"7","point":"32","io_status":"1","delay":"0.5"},{"action":"204","type":"6","point":"9","point2":"2"},"#,
            r#"{"oneshot":"1","action":"800","cnt_id":"3"},{"oneshot":"1","action":"14","m0":"1"}]}"#,
        ],
    ),
    (
        "every_member_of_a_point",
        &[
            r#"{"reqType":"AddPoints","dsData":[{"camID":"3","data":["#,
            r#"{"ModelID":"2","X":"1.5","Y":"-2.25","Z":"3","U":"4","V":"5","Angel":"6.125","Similarity":"0.875","Color":"7","Rel":"1"},"#,
            r#"{"X":1,"Y":2}]}]}"#,
        ],
    ),
    (
        "every_form_of_a_value",
        &[
            r#"{"reqType":"query","queryData":["R6","-1","0.500000",1,["4","20","7"],["1","2"],"parts[4][T:20][C:7]"]}"#,
        ],
    ),
];
