//! `GET /metrics` and `GET /health`, one request after the other, each bounded in size and time.

use crate::failure::Failure;
use crate::metrics::Metrics;
use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A longer request is none of ours.
const LONGEST: usize = 4096;
/// Who is slower waits in vain.
const PATIENCE: Duration = Duration::from_secs(1);

/// Listens in a thread of its own; `every` is the time between checkpoints. Says where, as the system may choose the port.
pub fn start(address: SocketAddr, metrics: Arc<Metrics>, every: Duration) -> Result<SocketAddr, Failure> {
    let failed = |source| Failure::Listen { address: address.to_string(), source };
    let listener = TcpListener::bind(address).map_err(failed)?;
    let bound = listener.local_addr().map_err(failed)?;
    let run = move || {
        for connection in listener.incoming() {
            // Whoever goes away is gone.
            let _ = connection.and_then(|connection| answer(connection, &metrics, every));
        }
    };
    let spawned = std::thread::Builder::new().name("http".to_owned()).spawn(run);
    spawned.map_err(failed)?;
    Ok(bound)
}

fn answer(mut connection: TcpStream, metrics: &Metrics, every: Duration) -> io::Result<()> {
    connection.set_write_timeout(Some(PATIENCE))?;
    let request = request(&mut connection)?;
    let (status, kind, body) = match request.as_str() {
        "GET /metrics" => ("200 OK", "text/plain; version=0.0.4", metrics.text()),
        "GET /health" => match metrics.trouble(every) {
            None => ("200 OK", "text/plain", "well\n".to_owned()),
            Some(trouble) => ("503 Service Unavailable", "text/plain", format!("{trouble}\n")),
        },
        _ => ("404 Not Found", "text/plain", "GET /metrics or GET /health\n".to_owned()),
    };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        body.len()
    );
    connection.write_all([head, body].concat().as_bytes())
}

/// Method and path.
fn request(connection: &mut TcpStream) -> io::Result<String> {
    let end = Instant::now() + PATIENCE;
    let mut bytes = Vec::new();
    let mut part = [0; 512];
    while !bytes.windows(4).any(|four| four == b"\r\n\r\n") && bytes.len() < LONGEST {
        let left = end.saturating_duration_since(Instant::now()).max(Duration::from_millis(1));
        connection.set_read_timeout(Some(left))?;
        match connection.read(&mut part)? {
            0 => break,
            count => bytes.extend(part.iter().take(count)),
        }
        if Instant::now() >= end {
            return Err(io::ErrorKind::TimedOut.into());
        }
    }
    let line = bytes.split(|byte| *byte == b'\r').next().unwrap_or_default();
    let words: Vec<_> = line.split(|byte| *byte == b' ').take(2).collect();
    Ok(String::from_utf8_lossy(&words.join(&b' ')).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn get(address: SocketAddr, request: &str) -> String {
        let mut connection = TcpStream::connect(address).expect("a listener");
        connection.write_all(request.as_bytes()).expect("a reader");
        let mut text = String::new();
        let _ = connection.read_to_string(&mut text);
        text
    }

    #[test]
    fn metrics_and_health_are_told_and_nothing_else() {
        let loopback = "127.0.0.1:0".parse().expect("an address");
        let address = start(loopback, Arc::new(Metrics::new()), Duration::from_secs(1)).expect("a port");
        // Who says nothing does not keep others from their answers for ever.
        let _silent = TcpStream::connect(address).expect("a listener");
        assert!(get(address, "GET /metrics HTTP/1.1\r\n\r\n").contains("\npitchleak_messages_total 0\n"));
        assert!(get(address, "GET /health HTTP/1.1\r\nHost: x\r\n\r\n").starts_with("HTTP/1.1 503 "));
        assert!(get(address, "POST / HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 404 "));
        assert!(get(address, &"x".repeat(LONGEST)).starts_with("HTTP/1.1 404 "));
    }
}
