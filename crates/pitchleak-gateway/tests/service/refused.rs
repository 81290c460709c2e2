//! What is refused, and what it cannot use.

use crate::harness::{Gateway, Mosquitto, Sender, TRACE, batches, wait_until};

#[test]
fn a_wrong_authority_and_a_wrong_password_are_refused() {
    let Some(broker) = Mosquitto::start("") else { return };
    let mut foreign = Gateway::new(&broker, |text| text.replace("authority.pem", "another-authority.pem"));
    let mut guesser = Gateway::new(&broker, |text| text);
    std::fs::write(guesser.path("password"), "guessed").unwrap();
    foreign.start();
    guesser.start();
    foreign.wait_for("UnknownIssuer");
    guesser.wait_for("NotAuthorized");
    for gateway in [&mut foreign, &mut guesser] {
        assert!(gateway.get("/health").contains("503"), "no connection is well");
        assert!(!gateway.said.lock().unwrap().contains("connected;"));
        assert_eq!(gateway.end(), Some(0));
    }
}

#[test]
fn what_it_cannot_use_is_counted_and_costs_no_memory() {
    let Some(broker) = Mosquitto::start("") else { return };
    let mut gateway = Gateway::new(&broker, |text| text);
    gateway.start();
    gateway.wait_for("connected");
    let mut sender = Sender::new(broker.port);
    let good = &batches(TRACE, 50)[..8];
    sender.send("pitch/T1/B1/samples", good[0].as_bytes());
    sender.send("pitch/T1/B1/samples", &vec![b'['; 100_000_000]);
    for k in 0..300 {
        sender.send(&format!("pitch/T{k}/invented/samples"), good[0].as_bytes());
    }
    for text in
        ["{", "[[[[", "[{\"t_s\": 1e999}]", "\u{0}", "", "[{\"t_s\": 9, \"pa_psi\": 4}]", "null", "[{}]"]
    {
        sender.send("pitch/T1/B1/samples", text.as_bytes());
    }
    sender.send("pitch/T1/B1/samples", &[0xff; 1000]);
    // A clock that leaps ahead for one message, and comes back.
    let leap = good[1].replace("\"t_s\":", "\"t_s\":9");
    for batch in [leap.as_str(), good[2].as_str(), good[2].as_str()] {
        sender.send("pitch/T1/B1/samples", batch.as_bytes());
    }
    sender.flush();
    wait_until("all came", || gateway.metric("pitchleak_messages_total") >= 314.0);
    wait_until("fifty are watched", || (gateway.metric("pitchleak_cylinders") - 50.0).abs() < 0.5);
    assert!(gateway.get("/health").contains("200 OK"));
    // What came is told once it has been read.
    for kind in ["too_large", "too_many_cylinders", "unreadable", "late"] {
        wait_until(kind, || gateway.get("/metrics").contains(&format!("kind=\"{kind}\"")));
    }
    assert!(gateway.peak_memory() < 400_000_000, "{} bytes", gateway.peak_memory());
    assert!(gateway.said.lock().unwrap().lines().count() < 40);
    assert_eq!(gateway.end(), Some(0));
}
