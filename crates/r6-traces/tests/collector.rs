//! A gateway whose spans go to a collector.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use opentelemetry_proto::tonic::collector::trace::v1::ExportTraceServiceRequest;
use opentelemetry_proto::tonic::common::v1::any_value::Value as Attribute;
use opentelemetry_proto::tonic::trace::v1::Span;
use opentelemetry_proto::tonic::trace::v1::span::SpanKind;
use opentelemetry_proto::tonic::trace::v1::status::StatusCode;
use prost::Message;
use r6_gateway::{
    AuditSettings, Gateway, GatewaySettings, HistorySettings, RawPolicy, RobotConfig, RobotName, TlsSettings,
};
use r6_sim::VirtualController;
use r6_traces::{Traces, join_caller};
use serde_json::{Value, json};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

const PATIENCE: Duration = Duration::from_secs(20);

/// A collector: the bodies of `POST /v1/traces`.
fn collector() -> (SocketAddr, Receiver<Vec<u8>>) {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let address = listener.local_addr().unwrap();
    let (bodies, received) = channel();
    std::thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            let bodies = bodies.clone();
            std::thread::spawn(move || {
                let mut stream = BufReader::new(stream);
                while let Some((head, body)) = request(&mut stream) {
                    assert!(head.starts_with("POST /v1/traces "), "{head}");
                    if bodies.send(body).is_err() {
                        return;
                    }
                    let answer = b"HTTP/1.1 200 OK\r\ncontent-type: application/x-protobuf\r\ncontent-length: 0\r\n\r\n";
                    stream.get_mut().write_all(answer).unwrap();
                }
            });
        }
    });
    (address, received)
}

/// The head and the body of a request, or of an answer.
fn request(stream: &mut BufReader<TcpStream>) -> Option<(String, Vec<u8>)> {
    let mut head = String::new();
    while !head.ends_with("\r\n\r\n") {
        if stream.read_line(&mut head).ok()? == 0 {
            return None;
        }
    }
    let lower = head.to_ascii_lowercase();
    let length = lower.lines().find_map(|line| line.strip_prefix("content-length: ")?.parse().ok());
    let mut body = vec![0; length.unwrap_or(0)];
    stream.read_exact(&mut body).ok()?;
    Some((head, body))
}

/// One request to the gateway: the status and the body.
fn call(gateway: SocketAddr, token: &str, what: &str, more: &str, body: &Value) -> (u16, Value) {
    let stream = TcpStream::connect(gateway).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let mut stream = BufReader::new(stream);
    let body = body.to_string();
    let head = format!(
        "{what} HTTP/1.1\r\nhost: {gateway}\r\nauthorization: Bearer {token}\r\ncontent-type: application/json\r\n\
         content-length: {}\r\n{more}\r\n",
        body.len()
    );
    stream.get_mut().write_all(head.as_bytes()).unwrap();
    stream.get_mut().write_all(body.as_bytes()).unwrap();
    let (head, body) = request(&mut stream).unwrap();
    let status = head.split(' ').nth(1).unwrap().parse().unwrap();
    (status, serde_json::from_slice(&body).unwrap_or(Value::Null))
}

fn text(span: &Span, name: &str) -> Option<String> {
    let value = span.attributes.iter().find(|attribute| attribute.key == name)?.value.clone()?.value?;
    match value {
        Attribute::StringValue(text) => Some(text),
        Attribute::IntValue(number) => Some(number.to_string()),
        _ => None,
    }
}

/// The spans of these bodies that have this name.
fn named<'a>(spans: &'a [Span], name: &str) -> Vec<&'a Span> {
    spans.iter().filter(|span| span.name == name).collect()
}

#[test]
fn a_collector_behind_tls_is_refused_in_words() {
    let error = Traces::to_collector("https://collector:4318", "hall-2").unwrap_err().to_string();
    assert!(error.contains("`https://collector:4318`") && error.contains("http://127.0.0.1:4318"), "{error}");
}

#[test]
fn a_command_is_a_trace_with_its_parts_and_joins_that_of_its_caller() {
    let (address, received) = collector();
    let traces = Traces::to_collector(&format!("http://{address}/"), "hall-2").unwrap();
    tracing_subscriber::registry().with(traces.layer(r6_gateway::traces::TARGET)).init();
    r6_gateway::traces::join_callers(join_caller);

    let data = tempfile::tempdir().unwrap();
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().unwrap();
    let (robot, gateway) = runtime.block_on(async {
        let robot = VirtualController::start().await.unwrap();
        let config = RobotConfig::new(RobotName::new("press").unwrap(), robot.address().to_string());
        (robot, Gateway::start(settings(data.path(), config)).await.unwrap())
    });
    let token = r6_gateway::make_token(data.path(), r6_api::gateway::Role::Operator, None, "t".to_owned());
    let token = token.unwrap().1;
    let at = gateway.address();
    let begun = Instant::now();
    while call(at, &token, "GET /v1/robots/press", "", &json!({})).1["link"] != "up" {
        assert!(begun.elapsed() < PATIENCE, "the robot is not up");
    }

    let (status, lease) = call(at, &token, "POST /v1/robots/press/lease", "", &json!({}));
    assert_eq!(status, 200, "{lease}");
    let parent = "traceparent: 00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01\r\n";
    let speed = json!({ "command": "modifyGSPD", "arguments": ["30"], "lease": lease["lease"] });
    let (status, done) = call(at, &token, "POST /v1/robots/press/commands", parent, &speed);
    assert_eq!(status, 200, "{done}");
    assert_eq!(call(at, &token, "POST /v1/robots/press/stop", "", &json!({})).0, 200);
    let start = json!({ "command": "startButton", "arguments": [], "lease": lease["lease"] });
    let (status, refused) = call(at, &token, "POST /v1/robots/press/commands", "", &start);
    assert_eq!((status, &refused["code"]), (409, &json!("stopped")));
    assert_eq!(call(at, "secret-of-a-stranger", "GET /v1/robots", "", &json!({})).0, 401);
    assert_eq!(call(at, &token, "GET /v1/secret-path", "", &json!({})).0, 404);

    runtime.block_on(async {
        gateway.shutdown().await.unwrap();
        drop(robot);
    });
    traces.end();
    let bodies: Vec<Vec<u8>> = received.try_iter().collect();
    let requests = bodies.iter().map(|body| ExportTraceServiceRequest::decode(body.as_slice()).unwrap());
    let resources: Vec<_> = requests.flat_map(|request| request.resource_spans).collect();
    let service = resources[0].resource.as_ref().unwrap().attributes.iter();
    assert!(service.clone().any(|named| format!("{named:?}").contains("hall-2")), "{resources:?}");
    let spans: Vec<Span> =
        resources.into_iter().flat_map(|of| of.scope_spans).flat_map(|scope| scope.spans).collect();

    // The command is in the trace of its caller, and its parts are in it.
    let commands = named(&spans, "modifyGSPD");
    let [command] = commands.as_slice() else { panic!("{commands:?}") };
    assert_eq!(hex(&command.trace_id), "0af7651916cd43dd8448eb211c80319c");
    let served = named(&spans, "POST /v1/robots/{name}/commands");
    let request = served.iter().find(|span| span.span_id == command.parent_span_id).unwrap();
    assert_eq!(hex(&request.parent_span_id), "b7ad6b7169203331");
    assert_eq!(request.kind, SpanKind::Server as i32);
    assert_eq!(text(request, "http.response.status_code").as_deref(), Some("200"));
    assert_eq!(text(command, "r6.robot").as_deref(), Some("press"));
    assert_eq!(text(command, "r6.outcome").as_deref(), Some("accepted"));
    assert_eq!(text(command, "r6.command_id"), Some(done["command_id"].to_string()));
    for part in ["write the intent", "send and wait for the reply", "write the outcome"] {
        let found = named(&spans, part);
        assert_eq!(found.iter().filter(|span| span.parent_span_id == command.span_id).count(), 1, "{part}");
    }

    // So is a stop, and what was refused.
    let stop = named(&spans, "stop")[0];
    assert_eq!(text(stop, "r6.outcome").as_deref(), Some("confirmed"));
    let refused = named(&spans, "startButton")[0];
    assert_eq!(text(refused, "r6.outcome").as_deref(), Some("stopped"));
    assert_eq!(refused.status.as_ref().unwrap().code, StatusCode::Error as i32);

    // Secrets are in none of them, nor the paths of strangers.
    assert_eq!(named(&spans, "GET").len(), 1);
    for secret in [token.as_str(), "secret", lease["lease"]["secret"].as_str().unwrap()] {
        assert!(
            !bodies.iter().any(|body| body.windows(secret.len()).any(|at| at == secret.as_bytes())),
            "{secret}"
        );
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn settings(data: &std::path::Path, robot: RobotConfig) -> GatewaySettings {
    GatewaySettings {
        listen: SocketAddr::from((Ipv4Addr::LOCALHOST, 0)),
        data: data.to_owned(),
        store: None,
        robots: vec![robot],
        robot_settings: r6_client::RobotSettings::default(),
        raw: Vec::new(),
        raw_policy: RawPolicy::default(),
        hall: None,
        audit: AuditSettings::default(),
        history: HistorySettings { on: false, ..HistorySettings::default() },
        names: Vec::new(),
        tls: TlsSettings::Off,
    }
}
