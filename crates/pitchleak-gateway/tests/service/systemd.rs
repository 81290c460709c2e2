//! What systemd is told, with a socket that stands for it.

use crate::harness::Gateway;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpListener;
use std::os::fd::OwnedFd;
use std::os::unix::net::{UnixDatagram, UnixStream};
use std::process::Stdio;
use std::time::Duration;

/// Of the watchdog, as systemd would ask for it.
const WATCHDOG: Duration = Duration::from_millis(200);

struct Systemd(UnixDatagram);

impl Systemd {
    /// What is told next; none where nothing is told for three times what the watchdog asks for.
    fn hear(&self) -> Option<String> {
        let mut bytes = [0; 100];
        self.0.set_read_timeout(Some(3 * WATCHDOG)).unwrap();
        let length = self.0.recv(&mut bytes).ok()?;
        Some(String::from_utf8_lossy(&bytes[..length]).trim_end().to_owned())
    }
}

/// Until it takes no more.
fn fill(mut pipe: &UnixStream) {
    pipe.set_nonblocking(true).unwrap();
    loop {
        match pipe.write(&[b' '; 4096]) {
            Ok(_) => {}
            Err(error) if error.kind() == ErrorKind::WouldBlock => break,
            Err(error) => panic!("{error}"),
        }
    }
    pipe.set_nonblocking(false).unwrap();
}

#[test]
fn systemd_hears_that_it_is_ready_alive_stopping_and_nothing_while_it_hangs() {
    // A broker that says nothing.
    let broker = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = broker.local_addr().unwrap().port();
    let mut gateway = Gateway::at(port, |text| text);
    let socket = gateway.path("notify");
    let systemd = Systemd(UnixDatagram::bind(&socket).unwrap());
    let (mut journal, standard_error) = UnixStream::pair().unwrap();
    let its_own = Stdio::from(OwnedFd::from(standard_error.try_clone().unwrap()));
    let watchdog_us = WATCHDOG.as_micros().to_string();
    gateway.start_as(|command| {
        command.env("NOTIFY_SOCKET", &socket).env("WATCHDOG_USEC", watchdog_us).stderr(its_own)
    });
    let connection = broker.accept().unwrap();
    assert_eq!(systemd.hear().as_deref(), Some("READY=1"));
    (0..3).for_each(|_| assert_eq!(systemd.hear().as_deref(), Some("WATCHDOG=1")));

    // Its thread of samples waits for a journal that takes no more lines.
    fill(&standard_error);
    drop(connection);
    while systemd.hear().is_some() {}
    journal.set_nonblocking(true).unwrap();
    let mut lines = [0; 65536];
    while journal.read(&mut lines).is_ok() {}
    assert_eq!(systemd.hear().as_deref(), Some("WATCHDOG=1"));

    assert_eq!(gateway.end(), Some(0));
    let mut last = None;
    while let Some(state) = systemd.hear() {
        last = Some(state);
    }
    assert_eq!(last.as_deref(), Some("STOPPING=1"));
}
