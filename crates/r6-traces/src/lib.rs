//! Sends the spans of a program to an OpenTelemetry collector, with OTLP over HTTP.
//!
//! What is sent where is said by the environment, as OpenTelemetry's specification defines it:
//! `OTEL_EXPORTER_OTLP_ENDPOINT` (or `OTEL_EXPORTER_OTLP_TRACES_ENDPOINT`), `OTEL_SERVICE_NAME`,
//! `OTEL_TRACES_SAMPLER`, `OTEL_BSP_MAX_QUEUE_SIZE` and others. Without an address nothing is sent.
//!
//! The collector is reached over plain HTTP, so let it run on the same machine. It is told from threads of
//! its own: a collector that is slow or away delays nothing. At most 2048 spans wait for it, and those that
//! have no room are lost.

use std::fmt;
use std::time::Duration;

use async_trait::async_trait;
use http::HeaderMap;
use opentelemetry::global;
use opentelemetry::trace::TracerProvider;
use opentelemetry_http::hyper::HyperClient;
use opentelemetry_http::{Bytes, HeaderExtractor, HttpClient, HttpError, Request, Response};
use opentelemetry_otlp::{ExporterBuildError, SpanExporter, WithExportConfig, WithHttpConfig};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::propagation::TraceContextPropagator;
use opentelemetry_sdk::trace::SdkTracerProvider;
use tokio::runtime::{Builder, Handle, Runtime};
use tracing::{Level, Span, Subscriber};
use tracing_opentelemetry::OpenTelemetrySpanExt;
use tracing_subscriber::Layer;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::registry::LookupSpan;

/// The variables that name the collector.
const ADDRESSES: [&str; 2] = ["OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT"];

/// The longest time for one request to the collector.
const ANSWERS_WITHIN: Duration = Duration::from_secs(5);

/// How long the end of the program waits for the last spans to be taken.
const LAST_SPANS: Duration = Duration::from_secs(3);

/// Why no spans can be sent.
#[derive(Debug)]
pub enum TracesError {
    /// The address of the collector cannot be used: the variable, and its value.
    Address(&'static str, String),
    /// The exporter cannot be made of what the environment says.
    Exporter(ExporterBuildError),
    /// The system gives no thread.
    System(std::io::Error),
}

impl fmt::Display for TracesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Address(variable, value) => write!(
                f,
                "{variable} is `{value}`: it has to begin with http://, such as http://127.0.0.1:4318 (TLS is not there: let \
                 a collector on this machine send the traces on)"
            ),
            Self::Exporter(error) => write!(f, "traces cannot be sent: {error}"),
            Self::System(error) => write!(f, "traces cannot be sent: {error}"),
        }
    }
}

impl std::error::Error for TracesError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Address(..) => None,
            Self::Exporter(error) => Some(error),
            Self::System(error) => Some(error),
        }
    }
}

/// Spans are sent as long as this is there. Call [`Self::end`] so that the last ones are sent, too.
#[derive(Debug)]
pub struct Traces {
    provider: SdkTracerProvider,
    runtime: Runtime,
}

impl Traces {
    /// Sends spans to the collector that the environment names; `None` if it names none. The spans of this
    /// service have this name, unless the environment says another.
    ///
    /// # Errors
    /// [`TracesError`].
    pub fn begin(service: &'static str) -> Result<Option<Self>, TracesError> {
        let named = ADDRESSES.iter().find_map(|name| {
            let address = std::env::var(name).ok()?;
            (!address.is_empty()).then_some((*name, address))
        });
        match named {
            None => return Ok(None),
            Some((_, address)) if is_plain(&address) => {}
            Some((variable, address)) => return Err(TracesError::Address(variable, address)),
        }
        Self::send(None, service).map(Some)
    }

    /// The same to this collector, such as `http://127.0.0.1:4318`, whatever the environment says of its
    /// address.
    ///
    /// # Errors
    /// [`TracesError`].
    pub fn to_collector(address: &str, service: &'static str) -> Result<Self, TracesError> {
        if !is_plain(address) {
            return Err(TracesError::Address("the address of the collector", address.to_owned()));
        }
        Self::send(Some(format!("{}/v1/traces", address.trim_end_matches('/'))), service)
    }

    /// Without an address, the exporter takes that of the environment.
    fn send(address: Option<String>, service: &'static str) -> Result<Self, TracesError> {
        let mut builder = Builder::new_multi_thread();
        let runtime = builder.worker_threads(1).thread_name("traces").enable_all().build();
        let runtime = runtime.map_err(TracesError::System)?;
        let client = InRuntime {
            runtime: runtime.handle().clone(),
            client: HyperClient::with_default_connector(ANSWERS_WITHIN, None),
        };
        let exporter = SpanExporter::builder().with_http().with_http_client(client);
        let exporter = match address {
            Some(address) => exporter.with_endpoint(address),
            None => exporter,
        };
        let exporter = exporter.build();
        let resource = match std::env::var("OTEL_SERVICE_NAME") {
            Ok(_) => Resource::builder(),
            Err(_) => Resource::builder().with_service_name(service),
        };
        let provider = SdkTracerProvider::builder()
            .with_batch_exporter(exporter.map_err(TracesError::Exporter)?)
            .with_resource(resource.build())
            .build();
        global::set_text_map_propagator(TraceContextPropagator::new());
        Ok(Self { provider, runtime })
    }

    /// The layer of a subscriber that takes in the spans with this target, and no others.
    pub fn layer<S>(&self, target: &'static str) -> impl Layer<S> + use<S>
    where
        S: Subscriber + for<'a> LookupSpan<'a>,
    {
        tracing_opentelemetry::layer()
            .with_tracer(self.provider.tracer("r6"))
            .with_location(false)
            .with_threads(false)
            .with_filter(Targets::new().with_target(target, Level::TRACE))
    }

    /// Sends the last spans, within 3 s.
    pub fn end(self) {
        // What failed stands in the log already.
        let _ = self.provider.shutdown_with_timeout(LAST_SPANS);
        self.runtime.shutdown_background();
    }
}

/// Makes a span a part of the trace that the header `traceparent` names.
pub fn join_caller(span: &Span, headers: &HeaderMap) {
    let caller = global::get_text_map_propagator(|propagator| propagator.extract(&HeaderExtractor(headers)));
    // A span that is disabled has no place in a trace.
    let _ = span.set_parent(caller);
}

fn is_plain(address: &str) -> bool {
    address.starts_with("http://")
}

/// A client in a runtime of its own: the threads of the exporter have none.
#[derive(Debug)]
struct InRuntime {
    runtime: Handle,
    client: HyperClient,
}

#[async_trait]
impl HttpClient for InRuntime {
    async fn send_bytes(&self, request: Request<Bytes>) -> Result<Response<Bytes>, HttpError> {
        let client = self.client.clone();
        self.runtime.spawn(async move { client.send_bytes(request).await }).await?
    }
}
