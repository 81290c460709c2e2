//! MQTT 3.1.1 by the crate rumqttc, in a thread of its own that waits for the network alone.

use crate::broker::{Broker, Delivery, Inbound, Keeping, Message, Ticket};
use crate::config::{BrokerConfig, Tls};
use crate::failure::Failure;
use crate::input::Input;
use crate::outbox::{Next, Outbox};
use crate::probe::Probe;
use crate::topics;
use rumqttc::{
    AckMode, AsyncClient, ConnectionError, Event, EventLoop, LastWill, ManualAck, MqttOptions, Packet,
    PubAck, Publish, PublishOptions, QoS, SubscribeFilter, SubscribeReasonCode, TlsConfiguration, Transport,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};
use tokio::sync::Notify;

/// A larger message is not looked at: a second of samples of one cylinder has a hundredth of it.
pub const LARGEST_PAYLOAD: usize = 1024 * 1024;
/// The largest packet of MQTT: refused, it would come again for ever.
const LARGEST_PACKET: usize = 268_435_460;
/// Requests between our tasks and the connection, and in one writing to the network.
const REQUESTS: usize = 64;
/// Packets that are read before the first of them is handed over.
const READS: usize = 16;
/// Between attempts to connect.
const FIRST_PAUSE: Duration = Duration::from_millis(250);
const LONGEST_PAUSE: Duration = Duration::from_secs(15);
/// Attempts to find out the broker's limits, and between them.
const PROBES: u32 = 5;
const BETWEEN_PROBES: Duration = Duration::from_secs(60);
/// Between attempts to hand something to a queue that is full.
const BEAT: Duration = Duration::from_millis(1);

pub struct Mqtt {
    outbox: Arc<Outbox>,
    ended: Receiver<()>,
}

impl Mqtt {
    /// Connects, and again whenever the connection is lost, until [`close`](Broker::close); what comes goes to `inbox`.
    /// `gone` is what the broker says of us when we are.
    pub fn connect(
        config: &BrokerConfig,
        filters: Vec<String>,
        gone: Message,
        inbox: SyncSender<Input>,
    ) -> Result<Self, Failure> {
        let reach = reach(config)?;
        let probe = (config.queued > 0).then(|| probe(config, reach.clone()));
        let options = options(config, gone, reach);
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(|source| Failure::System { what: "start the network thread", source })?;
        let outbox = Arc::new(Outbox::default());
        let (end, ended) = sync_channel(1);
        let its_outbox = Arc::clone(&outbox);
        let run = move || {
            runtime.block_on(async {
                let (client, mut connection) = AsyncClient::builder(options).capacity(REQUESTS).build();
                let mut network = connection.network_options();
                network.set_tcp_nodelay(true);
                connection.set_network_options(network);
                let shared = Arc::new(Shared::default());
                tokio::spawn(subscribe(client.clone(), filters, Arc::clone(&shared)));
                tokio::spawn(send(client, its_outbox, Arc::clone(&shared), inbox.clone()));
                listen(connection, &shared, &inbox, probe).await;
            });
            let _ = end.send(());
        };
        let spawned = std::thread::Builder::new().name("mqtt".to_owned()).spawn(run);
        spawned.map_err(|source| Failure::System { what: "start the network thread", source })?;
        Ok(Self { outbox, ended })
    }
}

impl Broker for Mqtt {
    fn publish(&self, message: Message) {
        self.outbox.put(message);
    }

    fn send(&self) {
        self.outbox.send();
    }

    fn acknowledge(&self, tickets: Vec<Ticket>) {
        self.outbox.acknowledge(tickets);
    }

    fn close(self, wait: Duration) {
        self.outbox.close();
        let _ = self.ended.recv_timeout(wait);
    }
}

/// Of the connection that lasts.
fn options(config: &BrokerConfig, gone: Message, mut reach: MqttOptions) -> MqttOptions {
    reach
        .set_keep_alive(config.keep_alive_s)
        .set_clean_session(false)
        .set_ack_mode(AckMode::Manual)
        .set_max_request_batch(REQUESTS)
        .set_read_batch_size(READS)
        .set_max_packet_size(LARGEST_PACKET, LARGEST_PAYLOAD)
        .set_last_will(LastWill::new(gone.topic, gone.payload, QoS::AtLeastOnce, true));
    reach
}

/// Beside it; nobody listens to its topic.
fn probe(config: &BrokerConfig, mut reach: MqttOptions) -> Probe {
    reach.set_client_id(format!("{}-probe", config.client_id)).set_clean_session(true);
    let topic = topics::of_cylinder("pitchleak-probe", &config.client_id, "");
    Probe { options: reach, topic, messages: config.queued }
}

/// The way to the broker.
fn reach(config: &BrokerConfig) -> Result<MqttOptions, Failure> {
    let mut options = MqttOptions::new(&config.client_id, (config.host.as_str(), config.port));
    if let Some(login) = &config.login {
        options.set_credentials(&login.user, login.password.clone());
    }
    let tls = match &config.tls {
        None => return Ok(options),
        Some(Tls::Authority(ca)) => {
            TlsConfiguration::Simple { ca: ca.clone(), alpn: None, client_auth: None }
        }
        Some(Tls::System) => {
            TlsConfiguration::try_default_rustls().map_err(|error| Failure::Tls(error.to_string()))?
        }
    };
    options.set_transport(Transport::tls_with_config(tls));
    Ok(options)
}

/// Between the tasks of the network thread.
#[derive(Default)]
struct Shared {
    /// Counts connections: what belongs to one that is gone is not sent over the next.
    connection: AtomicU64,
    up: Notify,
}

/// Polls the connection, and does nothing else.
async fn listen(
    mut connection: EventLoop,
    shared: &Shared,
    inbox: &SyncSender<Input>,
    mut probe: Option<Probe>,
) {
    let (mut pause, mut session_kept) = (FIRST_PAUSE, false);
    loop {
        let inbound = match connection.poll().await {
            Ok(Event::Incoming(Packet::ConnAck(ack))) => {
                (pause, session_kept) = (FIRST_PAUSE, ack.session_present);
                shared.up.notify_one();
                if let Some(probe) = probe.take() {
                    tokio::spawn(find_limits(probe, inbox.clone()));
                }
                continue;
            }
            Ok(Event::Incoming(Packet::Publish(publish))) => {
                Inbound::Delivery(delivery(&publish, shared.connection.load(Ordering::Relaxed)))
            }
            Ok(Event::Incoming(Packet::SubAck(ack)))
                if ack.return_codes.contains(&SubscribeReasonCode::Failure) =>
            {
                Inbound::Down("the broker refuses a subscription".to_owned())
            }
            Ok(Event::Incoming(Packet::SubAck(_))) => Inbound::Up { session_kept },
            Ok(_) => continue,
            Err(ConnectionError::RequestsDone) => return,
            Err(error) => {
                shared.connection.fetch_add(1, Ordering::Relaxed);
                hand_over(inbox, Inbound::Down(error.to_string())).await;
                tokio::time::sleep(pause).await;
                pause = (2 * pause).min(LONGEST_PAUSE);
                continue;
            }
        };
        hand_over(inbox, inbound).await;
    }
}

fn delivery(publish: &Publish, connection: u64) -> Delivery {
    let size = publish.payload.len();
    Delivery {
        topic: String::from_utf8_lossy(&publish.topic).into_owned(),
        payload: if size <= LARGEST_PAYLOAD { Ok(publish.payload.to_vec()) } else { Err(size) },
        resent: publish.dup,
        ticket: (publish.qos == QoS::AtLeastOnce).then_some(Ticket { connection, id: publish.pkid }),
        received: Instant::now(),
    }
}

/// Also where the broker goes away meanwhile.
async fn find_limits(probe: Probe, inbox: SyncSender<Input>) {
    for _ in 0..PROBES {
        let limits = probe.limits().await;
        let found = limits.is_ok();
        hand_over(&inbox, Inbound::Limits(limits)).await;
        if found {
            return;
        }
        tokio::time::sleep(BETWEEN_PROBES).await;
    }
}

/// Gives the service what came; while it is behind, the thread goes on with other things.
async fn hand_over(inbox: &SyncSender<Input>, inbound: Inbound) {
    let mut input = Input::Broker(inbound);
    while let Err(TrySendError::Full(back)) = inbox.try_send(input) {
        input = back;
        tokio::time::sleep(BEAT).await;
    }
}

/// Subscribes anew with every connection: a broker may have lost the session.
async fn subscribe(client: AsyncClient, filters: Vec<String>, shared: Arc<Shared>) {
    loop {
        shared.up.notified().await;
        let filters = filters.iter().map(|filter| SubscribeFilter::new(filter.clone(), QoS::AtLeastOnce));
        if client.subscribe_many(filters).await.is_err() {
            return;
        }
    }
}

/// Empties the outbox into the connection.
async fn send(client: AsyncClient, outbox: Arc<Outbox>, shared: Arc<Shared>, inbox: SyncSender<Input>) {
    loop {
        match outbox.next().await {
            Next::Acknowledge(ticket) => {
                if ticket.connection != shared.connection.load(Ordering::Relaxed) {
                    continue;
                }
                let ack = ManualAck::PubAck(PubAck::new(ticket.id));
                if client.try_manual_ack(ack).is_err() {
                    outbox.put_back(Next::Acknowledge(ticket));
                    tokio::time::sleep(BEAT).await;
                }
            }
            Next::Publish(message) => publish(&client, &outbox, message, &inbox).await,
            Next::Close => {
                let _ = client.disconnect_with_timeout(Duration::from_secs(2)).await;
                return;
            }
        }
    }
}

async fn publish(client: &AsyncClient, outbox: &Arc<Outbox>, message: Message, inbox: &SyncSender<Input>) {
    let options = PublishOptions::at_least_once();
    let Keeping::Each(number) = message.keeping else {
        let _ = client.publish(message.topic, message.payload, options.retain(true)).await;
        return;
    };
    let (topic, payload) = (message.topic.clone(), message.payload.clone());
    let Ok(notice) = client.publish_tracked(topic, payload, options).await else { return };
    let (outbox, inbox) = (Arc::clone(outbox), inbox.clone());
    tokio::spawn(async move {
        match notice.wait_async().await {
            Ok(_) => hand_over(&inbox, Inbound::Confirmed(number)).await,
            Err(_) => outbox.put_back(Next::Publish(message)),
        }
    });
}
