use rumqttc::{
    BrokerSessionResumePolicy, Client, ConnectionError, Event, MqttOptions, Packet, PublishOptions, QoS,
    SessionMode,
};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Sends with quality of service 1, also over a broker's restart.
pub struct Sender {
    client: Client,
    sent: u64,
    acknowledged: Arc<AtomicU64>,
}

fn options(name: &str, port: u16) -> MqttOptions {
    let mut options = MqttOptions::new(name, ("127.0.0.1", port));
    options.set_session_mode(SessionMode::Persistent).set_keep_alive(60);
    options.set_broker_session_resume_policy(BrokerSessionResumePolicy::AllowBrokerOnly);
    options.set_max_packet_size(Some(256_000_000));
    options
}

impl Sender {
    pub fn new(port: u16) -> Self {
        let (client, mut connection) = Client::builder(options("sender", port)).capacity(10).build();
        let acknowledged = Arc::new(AtomicU64::default());
        let count = Arc::clone(&acknowledged);
        std::thread::spawn(move || {
            for event in connection.iter() {
                match event {
                    Ok(Event::Incoming(Packet::PubAck(_))) => _ = count.fetch_add(1, Ordering::Relaxed),
                    Ok(_) => {}
                    Err(ConnectionError::RequestsDone) => return,
                    Err(_) => std::thread::sleep(Duration::from_millis(50)),
                }
            }
        });
        Self { client, sent: 0, acknowledged }
    }

    pub fn send(&mut self, topic: &str, payload: &[u8]) {
        self.client.publish(topic, payload.to_vec(), PublishOptions::at_least_once()).unwrap();
        self.sent += 1;
    }

    /// Waits until the broker has all of it.
    pub fn flush(&self) {
        super::wait_until("the broker has all", || self.acknowledged.load(Ordering::Relaxed) >= self.sent);
    }
}

/// Keeps every message of some topics.
pub struct Listener {
    _client: Client,
    heard: Arc<Mutex<BTreeMap<String, Vec<String>>>>,
}

impl Listener {
    pub fn new(port: u16, filter: &str) -> Self {
        let (client, mut connection) = Client::builder(options("listener", port)).capacity(10).build();
        let heard: Arc<Mutex<BTreeMap<String, Vec<String>>>> = Arc::default();
        let keep = Arc::clone(&heard);
        let (subscriber, filter) = (client.clone(), filter.to_owned());
        let (ready, subscribed) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            for event in connection.iter() {
                match event {
                    Ok(Event::Incoming(Packet::ConnAck(_))) => {
                        let _ = subscriber.try_subscribe(filter.clone(), QoS::AtLeastOnce);
                    }
                    Ok(Event::Incoming(Packet::SubAck(_))) => _ = ready.send(()),
                    Ok(Event::Incoming(Packet::Publish(publish))) => {
                        let topic = String::from_utf8_lossy(&publish.topic).into_owned();
                        let payload = String::from_utf8_lossy(&publish.payload).into_owned();
                        keep.lock().unwrap().entry(topic).or_default().push(payload);
                    }
                    Ok(_) => {}
                    Err(ConnectionError::RequestsDone) => return,
                    Err(_) => std::thread::sleep(Duration::from_millis(50)),
                }
            }
        });
        subscribed.recv_timeout(Duration::from_secs(20)).unwrap();
        Self { _client: client, heard }
    }

    /// Messages of topics that end so.
    pub fn heard(&self, end: &str) -> Vec<String> {
        let heard = self.heard.lock().unwrap();
        heard.iter().filter(|(topic, _)| topic.ends_with(end)).flat_map(|(_, all)| all.clone()).collect()
    }
}
