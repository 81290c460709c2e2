//! What a browser, Prometheus and whoever asks for its health are told, over HTTP/1.1. Nobody keeps others waiting.

use crate::Failure;
use crate::metrics::Metrics;
use crate::run::network_thread;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use http_body_util::Full;
use hyper::body::{Bytes, Incoming};
use hyper::header::{CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, X_CONTENT_TYPE_OPTIONS};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use pitchleak_view::page::drawing::{self, Drawing};
use sha2::{Digest as _, Sha256};
use std::convert::Infallible;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio::time::{sleep, timeout};

/// Whoever has asked for nothing by then waits in vain.
const PATIENCE: Duration = Duration::from_secs(1);
/// For a connection, whatever its pace.
const LONGEST: Duration = Duration::from_secs(10);
/// At one time.
const CONNECTIONS: usize = 500;
/// A longer head of a request is none of ours; hyper wants no less.
const LONGEST_HEAD: usize = 8192;
/// The page: one file, without a word to anybody but us.
const PAGE: &str = include_str!("page.html");

/// The page with the drawing of a cylinder that the reports have.
fn page() -> String {
    let svg = Drawing::default().svg().into_string();
    PAGE.replace("<!-- drawing -->", &svg).replace("/* drawing.css */", drawing::STYLE)
}

/// What is told.
struct Told {
    metrics: Arc<Metrics>,
    /// Between two checkpoints.
    every: Duration,
    page: String,
    /// What the page may do: run its own script, and ask us.
    policy: String,
}

/// Listens in a thread of its own; `every` is the time between checkpoints. Says where, as the system may choose the port.
pub fn start(address: SocketAddr, metrics: Arc<Metrics>, every: Duration) -> Result<SocketAddr, Failure> {
    let failed = |source| Failure::Listen { address: address.to_string(), source };
    let listener = std::net::TcpListener::bind(address).map_err(failed)?;
    listener.set_nonblocking(true).map_err(failed)?;
    let bound = listener.local_addr().map_err(failed)?;
    let page = page();
    let told = Arc::new(Told { metrics, every, policy: policy(&page), page });
    let run = async move || {
        if let Ok(listener) = TcpListener::from_std(listener) {
            listen(&listener, &told).await;
        }
    };
    network_thread("http", run)?;
    Ok(bound)
}

async fn listen(listener: &TcpListener, told: &Arc<Told>) {
    let room = Arc::new(Semaphore::new(CONNECTIONS));
    while let Ok(place) = Arc::clone(&room).acquire_owned().await {
        let Ok((stream, _)) = listener.accept().await else {
            // No more files may be open: soon there are fewer.
            sleep(PATIENCE / 10).await;
            continue;
        };
        let told = Arc::clone(told);
        tokio::spawn(async move {
            serve(stream, &told).await;
            drop(place);
        });
    }
}

async fn serve(stream: TcpStream, told: &Told) {
    let answer = service_fn(async |request| Ok::<_, Infallible>(told.answer(&request)));
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(PATIENCE).keep_alive(false).max_buf_size(LONGEST_HEAD);
    // Whoever goes away has no use for an answer.
    let _ = timeout(LONGEST, http.serve_connection(TokioIo::new(stream), answer)).await;
}

impl Told {
    fn answer(&self, request: &Request<Incoming>) -> Response<Full<Bytes>> {
        let trouble = self.metrics.trouble(self.every);
        let board = &self.metrics.board;
        let (status, kind, body) = match (request.method(), request.uri().path()) {
            (&Method::GET, "/") => (StatusCode::OK, "text/html; charset=utf-8", self.page.clone()),
            (&Method::GET, "/cylinders") => {
                (StatusCode::OK, "application/json", board.lines(trouble.as_deref()))
            }
            (&Method::GET, "/pasts") => (StatusCode::OK, "application/json", board.pasts()),
            (&Method::GET, "/metrics") => {
                let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
                (StatusCode::OK, kind, self.metrics.text())
            }
            (&Method::GET, "/health") => {
                let status = if trouble.is_none() { StatusCode::OK } else { StatusCode::SERVICE_UNAVAILABLE };
                let silent = board.silent().map(|silent| silent + "\n").unwrap_or_default();
                (status, "text/plain", format!("{}\n{silent}", trouble.as_deref().unwrap_or("well")))
            }
            _ => (
                StatusCode::NOT_FOUND,
                "text/plain",
                "GET /, /cylinders, /pasts, /metrics or /health\n".to_owned(),
            ),
        };
        let response = Response::builder()
            .status(status)
            .header(CONTENT_TYPE, kind)
            .header(CACHE_CONTROL, "no-store")
            .header(X_CONTENT_TYPE_OPTIONS, "nosniff")
            .header(CONTENT_SECURITY_POLICY, &self.policy)
            .body(Full::new(Bytes::from(body)));
        // Every header is one that HTTP allows.
        response.unwrap_or_default()
    }
}

/// What stands between a tag and its end may run or paint, and nothing else.
fn policy(page: &str) -> String {
    let hash = |tag: &str| {
        let (_, rest) = page.split_once(&format!("<{tag}>")).unwrap_or_default();
        let (inside, _) = rest.split_once(&format!("</{tag}>")).unwrap_or_default();
        STANDARD.encode(Sha256::digest(inside))
    };
    let (script, style) = (hash("script"), hash("style"));
    format!(
        "default-src 'none'; connect-src 'self'; script-src 'sha256-{script}'; style-src 'sha256-{style}'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::Board;
    use pitchleak::core::PerLeak;
    use std::io::{Read as _, Write as _};
    use std::net::TcpStream;
    use std::time::Instant;

    fn get(address: SocketAddr, request: &str) -> String {
        let mut connection = TcpStream::connect(address).expect("a listener");
        connection.write_all(request.as_bytes()).expect("a reader");
        let mut text = String::new();
        let _ = connection.read_to_string(&mut text);
        text
    }

    fn started(silent_after: Duration) -> (SocketAddr, Arc<Metrics>) {
        let loopback = "127.0.0.1:0".parse().expect("an address");
        let metrics = Arc::new(Metrics::new(Arc::new(Board::new(silent_after))));
        (start(loopback, Arc::clone(&metrics), Duration::from_secs(1)).expect("a port"), metrics)
    }

    #[test]
    fn metrics_and_health_are_told_and_nothing_else() {
        let (address, _) = started(Duration::from_secs(60));
        assert!(get(address, "GET /metrics HTTP/1.1\r\n\r\n").contains("\npitchleak_messages_total 0\n"));
        assert!(get(address, "GET /health HTTP/1.1\r\nHost: x\r\n\r\n").starts_with("HTTP/1.1 503 "));
        assert!(get(address, "GET / HTTP/1.1\r\n\r\n").contains("<!DOCTYPE html>"));
        assert!(get(address, "POST / HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 404 "));
        assert!(get(address, &"x".repeat(2 * LONGEST_HEAD)).starts_with("HTTP/1.1 4"));
    }

    /// Of 120, each once held all others up for its second.
    #[test]
    fn who_says_nothing_keeps_nobody_waiting() {
        let (address, _) = started(Duration::from_secs(60));
        let _silent: Vec<_> = (0..120).map(|_| TcpStream::connect(address).expect("a listener")).collect();
        let asked = Instant::now();
        assert!(get(address, "GET /health HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 503 "));
        assert!(asked.elapsed() < PATIENCE, "{:?}", asked.elapsed());
    }

    #[test]
    fn a_cylinder_that_is_silent_is_named() {
        let (address, metrics) = started(Duration::ZERO);
        metrics.connected.set(1);
        assert!(get(address, "GET /health HTTP/1.1\r\n\r\n").ends_with("\r\n\r\nwell\n"));
        metrics.board.expect([("T7/B2", PerLeak::default(), Vec::new())]);
        assert!(get(address, "GET /health HTTP/1.1\r\n\r\n").ends_with("well\nsilent: T7/B2 for 0 s\n"));
        assert!(metrics.text().contains("pitchleak_silent_seconds{cylinder=\"T7/B2\"}"));
    }

    #[test]
    fn the_page_runs_nothing_but_its_own_script() {
        let page = page();
        assert_eq!((page.matches("<script>").count(), page.matches("<style>").count()), (1, 1));
        for lure in ["<script ", "src=", "href=", "url(", "@import", "innerHTML", " style=", " on"] {
            let found = page.split_inclusive('>').any(|piece| piece.contains('<') && piece.contains(lure));
            assert!(!found || lure == " on", "{lure}");
        }
        assert!(!page.contains("innerHTML"));
    }
}
